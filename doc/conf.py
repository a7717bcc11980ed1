# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The manual: ``make docs`` builds it into build/manual, and rosdoc2 finds this file.

rosdoc2 copies doc/ elsewhere and executes this file from there without a name of its own, so where
the sources lie is asked of Sphinx and not of ``__file__``. What the code itself knows (effects,
commands, parameters of the nodes, plots of the formulas) is written by generate.py into
doc/generated before the sources are read. Formulas become MathML: the pages need no network.

"""

from __future__ import annotations

from pathlib import Path
import subprocess
import sys

from docutils import nodes
from docutils.utils.math import pick_math_environment, wrap_math_code
from docutils.utils.math.latex2mathml import tex2mathml

import imu_noise_tools

project = 'imu_noise_tools'
author = 'imu_noise_tools maintainers'
copyright = f'2026, {author}'       # noqa: A001  (the name is Sphinx's)
release = version = imu_noise_tools.__version__

extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon']
myst_enable_extensions = ['colon_fence', 'dollarmath', 'deflist']
myst_heading_anchors = 3
exclude_patterns = ['_build']
nitpick_ignore_regex = [('py:.*', '.*')]

html_theme = 'furo'
html_title = 'imu_noise_tools'
html_math_renderer = 'mathml'
html_css_files = ['manual.css']
html_copy_source = False
pygments_style = 'friendly'

autodoc_member_order = 'bysource'
autodoc_typehints = 'none'
autodoc_mock_imports = ['rclpy']
rosdoc2_settings = {'override_theme': False}


def mathml(self, node: nodes.Element, block: bool) -> None:
    """Write a formula as MathML."""
    code = node.astext()
    if block:
        self.body.append('<div class="math">')
        if pick_math_environment(code) == 'align*':
            code = wrap_math_code(code, as_block=True)
    self.body.append(tex2mathml(code, as_block=block))
    if block:
        self.body.append('</div>\n')
    raise nodes.SkipNode


def generate(app) -> None:
    """Write the pages that the code itself knows."""
    source = Path(app.srcdir)
    here = source / 'doc' if (source / 'doc' / 'generate.py').exists() else source
    subprocess.run([sys.executable, str(here / 'generate.py')], check=True)


def setup(app) -> None:
    """Register both, and the style sheet by its place (see above)."""
    source = Path(app.srcdir)
    app.config.html_static_path = [
        str(p) for p in (source / 'doc' / '_static', source / '_static') if p.exists()][:1]
    app.add_html_math_renderer(
        'mathml', (lambda self, node: mathml(self, node, False), None),
        (lambda self, node: mathml(self, node, True), None))
    app.connect('builder-inited', generate)
