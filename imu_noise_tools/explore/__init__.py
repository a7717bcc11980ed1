# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The loop in the browser: a local page over a study on disk, driven by clicks.

A thin shell: what is clicked are the :mod:`imu_noise_tools.tasks` of the command line, what is
drawn comes from the problem of the domain, what is said from :mod:`imu_noise_tools.report.words`.

Built on NiceGUI. Of three that were weighed (Panel with Bokeh, NiceGUI, Dash) it is the one whose
page is ordinary HTML with ordinary CSS, so it folds for a phone and follows a dark theme; whose
server can speak first (a websocket), which progress and a second window need; whose plots can be
brushed; and whose wheel holds every script and font, plotly's too, for a third of the size of
the others. It mounts below a path, so the token of the address guards all of it at once.

``session``
    the study, what is under way, who changed it: no browser is needed to test it
``jobs``
    what a process computes, so that the page goes on answering
``panels``
    what can be looked at, as numbers; one module for each domain beside it
``figure``, ``page``, ``server``
    a panel as plotly draws it; the screen; the address

"""
