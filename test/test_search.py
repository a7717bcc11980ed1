# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the loop searches: what begins a chain, which chain is kept, what is asked again."""

from __future__ import annotations

from types import SimpleNamespace

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
    search.place = lambda model: SimpleNamespace(fit=SimpleNamespace(supported=None))
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


@pytest.mark.parametrize(('names', 'left', 'best'), [
    # each of two says little alone, and a third that does some of both needs either beside it
    (['gauss_markov', 'low_pass'], {}, ['low_pass', 'quantization']),
    (['gauss_markov', 'low_pass'], {'low_pass, quantization': 90.0}, ['gauss_markov', 'low_pass']),
    # three where two do
    (['gauss_markov', 'low_pass', 'notch'], {
        'gauss_markov, low_pass': 9.0, 'gauss_markov, quantization': 9.0,
        'gauss_markov, notch': 9.0, 'low_pass, notch': 9.0, 'quantization, notch': 9.0,
        'notch, quantization': 9.0,
        'notch, low_pass': 9.0}, ['low_pass', 'quantization']),
])
def test_what_stood_out_is_taken_in_the_fewest_that_leave_nothing(search, names, left, best):
    ramp, main = found('ramp', 'time'), [found(k) for k in names]
    other = [*main[:-1], found('quantization')]
    worth = {frozenset(('low_pass', 'quantization')): 515.0}
    search._rivals = lambda chain, i: []
    search.place = lambda model: SimpleNamespace(fit=SimpleNamespace(
        supported=worth.get(frozenset(model.labels[2:]), 505.0)))
    search.tests = leaves({f'ramp, {k}': v for k, v in left.items()})
    chains = [[ramp, *main], [ramp, *other]]
    search.scores = {search._set_of(c): 300.0 for c in chains}
    got = search._as_few(chains[0], chains)
    assert {f.name for f in got} == {'ramp', *best}
    here = search.scores[search._set_of(got)]
    assert here == max(search.scores.values()) and not any(
        k > search._set_of(got) for k in search.scores)


def test_one_that_needs_no_other_is_left_alone(search):
    """Nothing is fitted where the last member of a chain is in no doubt."""
    main = [found('gauss_markov'), found('low_pass')]
    search.scores = {search._set_of(main): 300.0, search._set_of(main[:1]): 200.0}
    assert search._as_few(main, [main, [found('rts')]]) == main


@pytest.mark.parametrize(('other', 'first'), [(300.0, True), (320.0, False)])
def test_of_chains_that_leave_nothing_the_simpler_may_explain_as_much(search, other, first):
    """Three relaxations for flicker: what each gains at its place is more than all together."""
    main = [found('flicker', gain=150.0), found('narrowband', gain=200.0)]
    held = [found('rts', gain=170.0), main[1], found('gauss_markov', gain=50.0)]
    supported = {frozenset(('flicker', 'narrowband')): 310.0,
                 frozenset(('rts', 'narrowband', 'gauss_markov')): other}
    search.chain = lambda begin=(): [*begin] or main
    search._rivals = lambda *_: []
    search.place = lambda model: SimpleNamespace(fit=SimpleNamespace(
        supported=supported.get(frozenset(model.labels[1:]))))
    search.tests = leaves({})
    search._explained_away = lambda *_: search.scores.update({
        frozenset(search.model_of(c).labels): sum(f.gain for f in c) for c in (
            main, held, held[:1], main[:1])})
    assert search.forward(held) == (main if first else held)
    if first:
        best = search.scores[frozenset(search.model_of(main).labels)]
        assert all(best - search.scores[frozenset(search.model_of(held[:k]).labels)] >= 10
                   for k in (1, 3))


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
