# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pieces of an HTML page; what is passed as text is escaped, what is passed as HTML is not."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from html import escape

__all__ = ['badge', 'bullets', 'cell', 'escape', 'image', 'page', 'table']

_STYLE = """
:root { --ink: #1f2d3d; --faint: #5d6b78; --line: #dfe4e8 }
* { box-sizing: border-box }
body { font: 16px/1.5 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; color: var(--ink);
  background: #fff; max-width: 76rem; margin: 0 auto; padding: 1rem }
h1 { font-size: 1.6rem; line-height: 1.2; margin: .5rem 0; overflow-wrap: anywhere }
h2 { font-size: 1.25rem; margin: 2.2rem 0 .5rem; border-top: 2px solid var(--line);
  padding-top: 1rem }
h3 { font-size: 1.05rem; margin: 1.4rem 0 .3rem }
p, li { max-width: 46rem }
ul { padding-left: 1.2rem; margin: .4rem 0 }
.small { font-size: .87rem }
.faint { color: var(--faint) }
.bad { color: #b3261e; font-weight: 600 }
.good { color: #1a7f4b; font-weight: 600 }
.doubt { color: #8a5a00; font-weight: 600 }
.line { white-space: nowrap }
.wide { overflow-x: auto; -webkit-overflow-scrolling: touch }
table { border-collapse: collapse; font-size: .9rem; margin: .4rem 0 .8rem }
th, td { text-align: left; padding: .3rem .8rem .3rem 0; border-bottom: 1px solid var(--line);
  vertical-align: top; min-width: 3rem }
th { font-weight: 600; color: var(--faint); white-space: nowrap }
figure { margin: .8rem 0; overflow-x: auto }
figure img { max-width: 100%; height: auto; border: 1px solid var(--line) }
@media (max-width: 45rem) { figure img { max-width: none; width: 60rem } }
figcaption { font-size: .87rem; color: var(--faint); max-width: 46rem }
code { background: #f1f4f6; padding: .1rem .35rem; border-radius: .25rem; overflow-wrap: anywhere }
.warn { border-left: 4px solid #e0a800; padding: .1rem .8rem; background: #fff9e6 }
"""


def page(title: str, parts: Iterable[str]) -> str:
    """Return a whole page of a title (text) and parts (HTML)."""
    body = '\n'.join(p for p in parts if p)
    return ('<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f'<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n'
            f'<h1>{escape(title)}</h1>\n{body}\n</body>\n</html>\n')


def table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """Return a table; the head is text, cells are HTML."""
    first = ''.join(f'<th>{escape(h)}</th>' for h in head)
    rest = ''.join('<tr>' + ''.join(f'<td>{c}</td>' for c in row) + '</tr>\n' for row in rows)
    top = f'<thead><tr>{first}</tr></thead>\n' if first else ''
    return f'<div class="wide"><table>{top}<tbody>\n{rest}</tbody></table></div>'


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
