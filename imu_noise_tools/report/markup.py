# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pieces of an HTML page; what is passed as text is escaped, what is passed as HTML is not."""

from __future__ import annotations

import base64
from collections.abc import Iterable
import hashlib
from html import escape

__all__ = ['badge', 'bullets', 'cell', 'copied', 'escape', 'folded', 'image', 'page', 'table']

_STYLE = """
:root { --ink: #1f2d3d; --faint: #5d6b78; --line: #dfe4e8; --paper: #fff; --box: #f3f6f8;
  --bad: #b3261e; --good: #1a7f4b; --doubt: #8a5a00; --warn: #fff9e6; color-scheme: light dark }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e9ee; --faint: #9fadba; --line: #36424e; --paper: #14191f; --box: #1f272f;
    --bad: #ff8a80; --good: #6fd39b; --doubt: #f2bf5e; --warn: #2d2814 }
  figure img { filter: invert(.92) hue-rotate(180deg) } }
* { box-sizing: border-box }
body { font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; color: var(--ink);
  background: var(--paper); max-width: 76rem; margin: 0 auto; padding: 1rem }
h1 { font-size: 1.6rem; line-height: 1.2; margin: .5rem 0; overflow-wrap: anywhere }
h2 { font-size: 1.25rem; margin: 2.2rem 0 .5rem; border-top: 2px solid var(--line);
  padding-top: 1rem }
h3 { font-size: 1.05rem; margin: 1.4rem 0 .3rem }
h4 { font-size: 1rem; margin: 1.2rem 0 .2rem }
p, li { max-width: 46rem; overflow-wrap: anywhere }
ul { padding-left: 1.2rem; margin: .4rem 0 }
dt { font-weight: 600 }
dd { margin: 0 0 .5rem 1rem; max-width: 46rem }
details { border: 1px solid var(--line); border-radius: .4rem; margin: .6rem 0; padding: 0 .8rem }
summary { cursor: pointer; padding: .5rem 0; overflow-wrap: anywhere }
pre { background: var(--box); padding: .6rem .8rem; margin: .3rem 0; border-radius: .3rem;
  overflow-x: auto }
.small { font-size: .87rem }
.faint { color: var(--faint) }
.bad { color: var(--bad); font-weight: 600 }
.good { color: var(--good); font-weight: 600 }
.doubt { color: var(--doubt); font-weight: 600 }
.line { white-space: nowrap }
.wide { overflow-x: auto; -webkit-overflow-scrolling: touch }
.copy button { font: inherit; padding: .2rem .9rem }
table { border-collapse: collapse; font-size: .9rem; margin: .4rem 0 .8rem }
th, td { text-align: left; padding: .3rem .8rem .3rem 0; border-bottom: 1px solid var(--line);
  vertical-align: top; min-width: 3rem }
th { font-weight: 600; color: var(--faint); white-space: nowrap }
figure { margin: .8rem 0; overflow-x: auto }
figure img { max-width: 100%; height: auto; border: 1px solid var(--line) }
figcaption { font-size: .87rem; color: var(--faint); max-width: 46rem }
code { background: var(--box); padding: .1rem .35rem; border-radius: .25rem;
  overflow-wrap: anywhere }
pre code { padding: 0 }
.warn { border-left: 4px solid #e0a800; padding: .1rem .8rem; background: var(--warn) }
@media (max-width: 45rem) {
  figure img { max-width: none; width: 46rem }
  thead { display: none }
  table, tbody, tr, td { display: block }
  tr { border-bottom: 2px solid var(--line); padding: .3rem 0 }
  td { border: 0; padding: .1rem 0; overflow-wrap: anywhere }
  td:empty { display: none }
  .line { white-space: normal }
  td[data-head]:not([data-head=""])::before { content: attr(data-head) ": ";
    color: var(--faint) } }
@media print {
  body { max-width: none; font-size: 11px }
  .copy button { display: none }
  figure, tr { break-inside: avoid } }
"""
# folded parts are printed too; a copy goes by selection where the clipboard is not to be had
SCRIPT = """
for (const box of document.querySelectorAll('.copy')) {
  const text = box.querySelector('pre'), button = box.querySelector('button');
  const done = () => { button.textContent = 'Copied'; };
  button.hidden = false;
  button.addEventListener('click', () => {
    const chosen = () => { getSelection().selectAllChildren(text); document.execCommand('copy'); };
    if (navigator.clipboard) {
      navigator.clipboard.writeText(text.textContent).then(done, () => { chosen(); done(); });
    } else { chosen(); done(); }
  });
}
addEventListener('beforeprint', () => {
  for (const part of document.querySelectorAll('details')) { part.open = true; }
});
"""
# the page loads nothing and runs nothing but that
_POLICY = ("default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-"
           + base64.b64encode(hashlib.sha256(SCRIPT.encode()).digest()).decode('ascii') + "'")


def page(title: str, parts: Iterable[str]) -> str:
    """Return a whole page of a title (text) and parts (HTML)."""
    body = '\n'.join(p for p in parts if p)
    return ('<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f'<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n'
            f'<h1>{escape(title)}</h1>\n{body}\n<script>{SCRIPT}</script>\n</body>\n</html>\n')


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table; the head is text, cells are HTML. On a phone each cell has its head."""
    names = list(head)
    first = ''.join(f'<th scope="col">{escape(h)}</th>' for h in names)
    body = ''
    for row in rows:
        cells = ''.join(
            f'<td data-head="{escape(names[k]) if k < len(names) else ""}">{c}</td>'
            for k, c in enumerate(row))
        body += f'<tr>{cells}</tr>\n'
    top = f'<thead><tr>{first}</tr></thead>\n' if first else ''
    return f'<div class="wide"><table>{top}<tbody>\n{body}</tbody></table></div>' if body else ''


def folded(summary: str, body: str, unfold: bool) -> str:
    """Return a part with a summary (HTML) that opens and closes."""
    return (f'<details{" open" if unfold else ""}><summary>{summary}</summary>\n{body}\n'
            '</details>')


def copied(text: str) -> str:
    """Return text in a box of its own, with a button that copies it."""
    return (f'<div class="copy"><pre><code>{escape(text)}</code></pre>'
            '<button type="button" hidden>Copy</button></div>')


def bullets(items: Iterable[str], style: str = '') -> str:
    """Return a list of HTML items; nothing for none."""
    found = ''.join(f'<li>{i}</li>\n' for i in items)
    return f'<ul class="{style}">\n{found}</ul>' if found else ''


def image(data: bytes, title: str, caption: str = '') -> str:
    """Return a PNG inside the page."""
    coded = base64.b64encode(data).decode('ascii')
    said = f'<figcaption>{escape(caption)}</figcaption>' if caption else ''
    return (f'<figure><img alt="{escape(title)}" src="data:image/png;base64,{coded}">'
            f'{said}</figure>')


def badge(text: str, style: str) -> str:
    """Return text in one of the page's styles: good, doubt, bad, faint."""
    return f'<span class="{style}">{escape(text)}</span>'


def cell(text: str) -> str:
    """Return text that is not broken over lines."""
    return badge(text, 'line')
