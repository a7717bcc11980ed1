# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the loop searches: what begins a chain, which chain is kept, what is asked again."""

from __future__ import annotations

import pytest

from imu_noise_tools.loop.diagnosis import _pairs, _Search, ROUNDS
from imu_noise_tools.loop.effect import Finding, model_of, registry


def found(name, view='frequency', gain=100.0):
    """Return a finding of an effect of noise."""
    return Finding(name, gain, registry('noise')[name](), view=view)


@pytest.fixture
def search():
    """Return a search that has looked at nothing yet."""
    out = object.__new__(_Search)
    out.base = model_of('noise', ('white',))
    out.refuted, out.scores, out._yielded = {}, {}, []
    out._beside, out._disproved, out._aside, out._nameless = {}, {}, {}, {}
    return out


def leaves(nats):
    """Return tests of a model, by what fails after the names added to it, nats."""
    def tests(model):
        left = nats.get(', '.join(model.labels[1:]), 0.0)
        return [Finding('frequency', left, view='frequency', p_value=0.0 if left else 0.5)]
    return tests


@pytest.mark.parametrize(('one', 'other', 'hides'), [
    (found('transient', 'time'), found('step', 'time'), True),
    (found('low_pass'), found('ramp', 'time'), True),
    (found('ramp', 'time'), found('low_pass'), False),
    (found('low_pass'), found('quantization'), True),
    (found('spikes', 'distribution'), found('ramp', 'time'), False),
])
def test_what_hides_another(one, other, hides):
    """Two means each other; what lowers the noise all that it stood beside, a mean too."""
    assert _pairs(one, other) == hides


@pytest.mark.parametrize('last', [False, True])
def test_what_means_leave_is_held_against_the_last_of_them(search, last):
    search._unconfirmed = lambda *_: (100.0, '')
    search._unhealed_with = search._shadowed = lambda *_: ''
    search._shaped = lambda model, name, f: '' if f.view != 'time' else 'a smooth form fits better'
    out = search.backward([found('transient', 'time'), found('narrowband'),
                           found('ramp', 'time')], last=last)
    assert [*out] == ['transient', 'ramp'][-1 - last:]


def test_a_chain_that_leaves_nothing_goes_before_more_surplus(search):
    """And is the likelier by as much as the other leaves, but for what was not tried beside it."""
    main = [found('transient', 'time', 900.0), found('ramp', 'time', 600.0), found('narrowband')]
    held = [main[0], main[2], found('random_walk', gain=40.0)]
    search.chain = lambda begin=(): [*begin] or main
    search._rivals = lambda *_: []
    search.place = lambda model: object()
    search.tests = leaves({'transient, ramp, narrowband': 27.0})
    sets = [search.model_of(c).labels for c in (
        main, main[:2], [*held[:2], found('slow_periodic')])]
    search.scores = {}
    search._explained_away = lambda *_: search.scores.update(zip(map(frozenset, sets), (
        1600.0, 1500.0, 1035.0)))
    assert search.forward(held) == held
    best = search.scores.pop(frozenset(search.model_of(held).labels))
    assert [search.scores[frozenset(k)] - best for k in sets] == [-27.0, -27.0, -5.0]
    search.tests = leaves({})
    assert search.forward(held) == main


def test_a_rival_begins_a_chain_with_what_was_found_behind_the_first(search):
    main = [found('rate_quantization'), found('notch'), found('low_pass')]
    rival = found('quantization')
    search._heals = lambda *_: False
    search._unlowered = lambda before, after, both: (
        {'notch': 10.0, 'low_pass': 300.0}[after.labels[-1]], '')
    search.tests = leaves({'': 500.0, 'quantization, notch': 100.0})
    assert search._begun([rival], main) == [rival, main[2]]
    search.tests = leaves({'': 500.0, 'quantization, low_pass': 450.0})
    assert search._begun([rival], main) == []
    search._heals = search._lowers = lambda *_: True
    assert search._begun([rival], main) == [rival]


def test_what_is_left_in_the_end_is_asked_again(search):
    """Where more falls each time than there are rounds: without what fell it may not hold."""
    chain = [found('narrowband', gain=100.0 - k) for k in range(ROUNDS + 3)]
    search.forward = lambda held=(): chain[:len(chain) - len(search.refuted)]
    search.with_odds = list
    search.backward = lambda some, last: {
        search.labels_of(some)[-1]: some[-1]} if len(some) > 1 else {}
    assert search.settled() == chain[:1]
