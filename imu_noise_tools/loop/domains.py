# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The domains of the loop, and where each is found: the one place that lists them.

A domain is a package of its own name. It is loaded when something of it is first asked for, so its
effects are known however the question came. Its face is

``problems(arrays)``, ``arrays_of(problems)``
    its targets (:class:`~imu_noise_tools.loop.problem.Problem`) from the arrays of evidence.npz,
    and back;
``TITLE``, ``NEXT``, ``DECIDES``, ``NUMBERS``, ``UNDISTURBED``
    of the page about a study; (command, why) once nothing is missing, ``{study}`` its folder; the
    same where a target is undecidable, empty where its values serve all the same; the format of
    export whose numbers open the page, empty where it has none to export; what is said of a
    recording that nothing is wrong with;

and, since imports run one way, functions in the module of its name in the layers above it:

``part('plots', name).pictures(study, full)``, ``part('tasks', name).outputs(study, folder)``
    its pictures as PNG bytes by name (some targets in full), and all of its files by name;
``part('explore', name).panels(state)``, ``by_hand(state)``
    what can be looked at of a target, and which effects can be put into its model by hand;
``part('cli', name).solved(folder, targets)``
    what is printed after a change beside the coefficients, or nothing.

"""

from __future__ import annotations

import importlib
from types import ModuleType

#: in the order in which people meet them
DOMAINS = ('noise', 'calibration', 'filter')
#: the oldest format of the evidence that still means what it meant, and holds all that is asked.
#: In 2 that of noise has more views, and by others' numbers an older one fails them; in 3 it has
#: what a coarse output tells of its noise
OLDEST = {'noise': 3, 'calibration': 1, 'filter': 1}
_ROOT = __name__.rpartition('.loop.')[0]


def package(name: str) -> ModuleType:
    """Return the package of a domain, loaded on first use; raise KeyError for no domain."""
    if name not in DOMAINS:
        raise KeyError(name)
    return importlib.import_module(f'{_ROOT}.{name}')


def part(layer: str, name: str) -> ModuleType:
    """Return the module that a layer has for a domain; raise KeyError for no domain."""
    if name not in DOMAINS:
        raise KeyError(name)
    return importlib.import_module(f'{_ROOT}.{layer}.{name}')
