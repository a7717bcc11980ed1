# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""How the loop searches: what begins a chain, which chain is kept, what is asked again."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from imu_noise_tools.loop import diagnosis
from imu_noise_tools.loop.effect import Finding, Fit, Model, model_of, registry
from imu_noise_tools.loop.findings import pairs, rivals, surplus, yields
from imu_noise_tools.loop.prediction import State
from imu_noise_tools.loop.search import FROM_NOTHING, ROUNDS, Search
from imu_noise_tools.loop.verdict import CANNOT_TELL


def found(name, view='frequency', gain=100.0, **more):
    """Return a finding of an effect of noise."""
    return Finding(name, gain, registry('noise')[name](), view=view, **more)


@pytest.fixture
def search():
    """Return a search that has looked at nothing yet."""
    problem = SimpleNamespace(exchanges=lambda *_: ())
    search = Search(State(problem, Fit(model_of('noise', ('white',)), {}, 0.0), None))
    search.places.supported = lambda model: search.places.at(model).fit.supported
    return search


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
    assert pairs(one, other) == hides


def test_what_explains_far_more_yields_to_none():
    """A step of 19 nats on three axes is not what they share by 67 000."""
    step = found('step', 'time', 19.0)
    assert yields(found('shared_noise', 'coherence', 100.0), step)
    assert not yields(found('shared_noise', 'coherence', 67_000.0), step)
    assert not yields(step, found('shared_noise', 'coherence', 19.0))


def test_a_shadow_falls_by_the_measure_of_what_casts_it(search):
    """What fails counts whole; a gain counts no part of a view for more than a little."""
    filters = found('low_pass', gain=180.0)

    def shadowed(with_it, without, finding=filters):
        some = {k: {'frequency': float(f), 'coherence': float(c)} for k, (f, c) in {
            True: with_it, False: without}.items()}
        search.places.tests = lambda model: [
            Finding(k, x, view=k, p_value=0.0 if x else 1.0)
            for k, x in some[finding.name in model].items()]
        return search.against.shadowed(
            model_of('noise', ('white', finding.name)), finding.name, finding)

    assert not shadowed((0, 1500), (180, 1500))
    assert '180 nats, and 8000' in shadowed((0, 8000), (180, 8000))
    assert not shadowed((100, 8000), (19_000, 8000)), 'uncapped it explains 18 900'
    blunt, sharp = (replace(found('narrowband'), effect=registry('noise')['narrowband'](
        {'frequency': 10.0, 'width': width})) for width in (1.0, 0.01))
    assert not shadowed((0, 8000), (100, 8000), blunt), 'other axes hear it too'
    elsewhere = Finding('sweep', 8000.0, view='sweep', p_value=0.0)
    search.places.tests = lambda model: [elsewhere]
    model = model_of('noise', ('white', 'narrowband'))
    assert search.against.shadowed(model, 'narrowband', blunt)
    assert not search.against.shadowed(model, 'narrowband', sharp), 'nothing imitates it'


@pytest.mark.parametrize(('fails', 'doubted'), [
    ('distribution', False), ('coherence', False), ('frequency', True)])
def test_a_line_that_all_axes_hear_casts_no_shadow_on_a_temperature(search, fails, doubted):
    """Samples unlike noise and axes that share a hum say nothing of a drift by some degrees."""
    search.places.tests = lambda model: [Finding(fails, 4384.0, view=fails, p_value=0.0)]
    said = search.against.shadowed(model_of('noise', ('white', 'temperature')), 'temperature',
                                   found('temperature', 'time', 260.0))
    assert bool(said) == doubted


@pytest.mark.parametrize('last', [False, True])
def test_nothing_is_judged_where_far_more_has_fallen(search, last):
    """Without the grid of the output a filter behind it has no form."""
    search.against.unconfirmed = lambda model, name, f: (
        0.0, 'not confirmed' if f.name == 'quantization' else '')
    search.against.unhealed_with = search.against.shadowed = lambda *_: ''
    search.against.shaped = lambda model, name, f: 'a smooth form fits better'
    chain = [found('quantization', gain=4e5), found('shared_noise', 'coherence', 5e4),
             found('low_pass', gain=180.0)]
    assert [*search.backward(chain, last)] == [
        'quantization', 'shared_noise', *['low_pass'] * last]


def test_without_what_explained_far_more_it_is_another_search(search):
    looks = []
    search.places.problem = SimpleNamespace(exchanges=lambda *_: (), looks=6)
    search.places.look_further = looks.append
    chain = [found('quantization', gain=4e5), found('low_pass', gain=180.0)]
    search.forward = lambda held=(): [f for f in chain if f.name not in search.refuted]
    search.with_odds = list
    search.backward = lambda some, last: {some[0].name: some[0]} if some else {}
    assert search.settled() == []
    assert looks == [6, 2], 'the filter explained no more than is usual'


@pytest.mark.parametrize('last', [False, True])
def test_what_means_leave_is_held_against_the_last_of_them(search, last):
    search.against.unconfirmed = lambda *_: (100.0, '')
    search.against.unhealed_with = search.against.shadowed = lambda *_: ''
    search.against.shaped = lambda model, name, f: (
        'a smooth form fits better' if f.view == 'time' else '')
    out = search.backward([found('transient', 'time'), found('narrowband'),
                           found('ramp', 'time')], last=last)
    assert [*out] == ['transient', 'ramp'][-1 - last:]


@pytest.mark.parametrize('falls', [True, False])
def test_what_healed_behind_one_that_fell_is_asked_beside_all_that_stay(search, falls):
    """A relaxation stood for flicker, which came last; without it the coupling has no noise."""
    search.against.unconfirmed = lambda model, name, f: (
        0.0, 'not confirmed' if falls and f.name == 'gauss_markov' else '')
    search.against.unhealed = lambda before, after, f: (
        'heals 0' if f.name == 'shared_noise' and 'flicker' not in before else '')
    search.against.shaped = search.against.shadowed = lambda *_: ''
    chain = [found('gauss_markov', gain=280.0), found('shared_noise', 'coherence', 860.0),
             found('flicker', gain=27.0)]
    assert [*search.backward(chain)] == ['gauss_markov' if falls else 'shared_noise']


@pytest.mark.parametrize(('against', 'falls'), [
    (FROM_NOTHING, True), ('', False), (f'{CANNOT_TELL} ramp', False)])
def test_what_is_named_has_its_form_without_what_is_not_told_from_nothing(search, against, falls):
    """A creep that all axes have: beside a transient that is not named, it had its form."""
    search.against.unconfirmed = lambda *_: (100.0, '')
    search.against.unhealed_with = search.against.shadowed = lambda *_: ''
    search.against.shaped = lambda model, name, f: (
        '' if 'transient' in model else 'a course that axes have in common')
    chain = [found('transient', 'time', against=against), found('shared_noise', 'coherence')]
    assert [*search.backward(chain)] == ['shared_noise'] * falls


def test_what_nearly_every_sensor_has_is_expected():
    """Of two as good it is ten times as likely, though no more is gained by it."""
    walk, other = found('random_walk', gain=40.0), found('gauss_markov', gain=40.0)
    assert walk.gain == other.gain and walk.penalty == other.penalty
    assert np.exp(surplus(walk) - surplus(other)) == pytest.approx(10, rel=0.01)


def test_two_that_bend_a_view_to_and_fro_are_seen_together_where_nothing_stands_out(search):
    """Neither gains anything alone; where something does, that is looked at first."""
    filled, notch, line = found('quantization', gain=2.0), found('notch'), found('ramp', 'time')
    filled, line = replace(filled, penalty=6.5), replace(line, penalty=8.0)
    beside = {'': [filled], 'quantization': [notch]}
    _places(search, beside)
    search.places.tests = leaves({'': 2000.0})
    search.places.beside_others = lambda f, *_: f
    search.against.unhealed = lambda *_: ''
    search.against.unlowered = lambda *_: (10.0, '')
    assert search._pair([], search.places.at(search.places.base)) == [filled, notch]
    beside[''] = [line, filled]
    assert search._pair([], search.places.at(search.places.base)) == []


@pytest.mark.parametrize('gain', [5.0, 50.0])
def test_a_second_one_is_asked_for_before_all_others(search, gain):
    """Only the kinds wanted are fitted, and that counts as one look."""
    asked = []
    step = found('step', 'time', gain=gain, penalty=10.0)

    def some(fit, wanted):
        asked.append('some')
        return [f for f in (step, found('low_pass')) if wanted(type(f.effect))]

    places = search.places
    vars(search.places.problem).update(
        looks=1, knows_candidates=lambda fit: False, point=lambda model: Fit(model, {}, 0.0),
        some_candidates=some)
    model = places.base.plus(registry('noise')['ramp']())
    for _ in range(2):
        place = places.offering(model, lambda kind: kind.paired)
        assert (place is not None) == (gain > 10.0)
        assert place is None or place.candidates == (step,)
    assert asked == ['some', 'some'] and places._looked == 1
    other = places.offering(places.base.plus(registry('noise')['drift']()), lambda kind: True)
    assert other is None and asked == ['some', 'some']
    places.problem.candidates = lambda fit: [step]
    assert places.at(model).candidates == (step,) and places._looked == 1


@pytest.mark.parametrize('gain', [13.5, 15.0])
def test_two_steps_that_are_only_seen_together_pay_once_for_being_believed(search, gain):
    """Penalties of 13 each are 26; 10 and what the second gains beside the first need 19."""
    first, second = (found('step', 'time', gain=x, penalty=13.0) for x in (10.0, gain))
    _places(search, {'': [first], 'step': [second]})
    search.places.tests = leaves({})
    search.against.unhealed, search.against.unlowered = (lambda *_: ''), (lambda *_: (9.0, ''))
    search.places.beside_others = lambda f, *_: f
    pair = search.chain()
    assert [f.gain for f in pair] == [10.0, gain]
    search.forward()
    sure, _ = search.odds(search.places.base, 'step.2')
    assert sure == pytest.approx(1 / (1 + np.exp(26.0 - 6.9 - 10.0 - gain)), abs=2e-3)


def test_of_what_gains_nothing_alone_that_which_leaves_least_is_looked_at_first(search):
    """Where all of a spectrum is wrong a filter gains nothing, though most of it falls by it."""
    near, *faint = (found(k, gain=g, penalty=8.0) for k, g in (
        ('low_pass', -200.0), ('quantization', 2.0), ('gauss_markov', 1.0), ('notch', 0.0)))
    peak = found('narrowband', gain=500.0)
    beside = {'': [*faint, near], 'low_pass': [peak]}
    _places(search, beside)
    search.places.tests = leaves(dict.fromkeys(['', *(f.name for f in faint)], 1e5)
                                 | {'low_pass': 2000.0})
    search.places.beside_others = lambda f, *_: f
    search.against.unhealed = lambda *_: ''
    search.against.unlowered = lambda *_: (10.0, '')
    assert search._pair([], search.places.at(search.places.base)) == [near, peak]


@pytest.mark.parametrize('last', [False, True])
def test_what_explains_little_is_not_judged_where_far_more_falls_in_the_same_look(search, last):
    """Without that it may be as good as a form without a name, which it was not beside it."""
    search.against.unconfirmed = lambda *_: (100.0, '')
    search.against.unhealed_with = search.against.shadowed = lambda *_: ''
    search.against.shaped = lambda *_: 'a knee fits better'
    chain = [found('quantization', gain=22500.0), found('low_pass', gain=37.0),
             found('notch', gain=4000.0)]
    out = search.backward(chain, last=last)
    assert [*out] == (['quantization', 'low_pass', 'notch'] if last else ['quantization', 'notch'])


def test_a_chain_that_leaves_nothing_goes_before_more_surplus(search):
    """And is the likelier by as much as the other leaves, but for what was not tried beside it."""
    main = [found('transient', 'time', 900.0), found('ramp', 'time', 600.0), found('narrowband')]
    held = [main[0], main[2], found('gauss_markov', gain=40.0)]
    search.chain = lambda begin=(): [*begin] or main
    search._rivals = lambda *_: []
    search.places.at = lambda model: SimpleNamespace(fit=SimpleNamespace(supported=None))
    search.places.tests = leaves({'transient, ramp, narrowband': 27.0})
    sets = [search.places.model_of(c).labels for c in (
        main, main[:2], [*held[:2], found('slow_periodic')])]
    search.scores = {}
    search._explained_away = lambda *_: search.scores.update(zip(map(frozenset, sets), (
        1600.0, 1500.0, 1035.0)))
    assert search.forward(held) == held
    best = search.scores.pop(frozenset(search.places.model_of(held).labels))
    assert [search.scores[frozenset(k)] - best for k in sets] == [-27.0, -27.0, -5.0]
    search.places.tests = leaves({})
    assert search.forward(held) == main


@pytest.mark.parametrize('less', [True, False])
def test_a_chain_that_leaves_fewer_views_goes_before_more_surplus(search, less):
    """One name for five levels, of which the path gains far more one after another."""
    loud = found('spikes', 'distribution', 1000.0)
    main = [loud, *(found('step', 'time', 80.0) for _ in range(5))]
    held = [loud, found('rts', gain=25.0)]
    search.chain = lambda begin=(): [*begin] or main
    search._rivals = lambda *_: []
    search.places.at = lambda model: SimpleNamespace(
        fit=SimpleNamespace(supported=None), candidates=())

    def tests(model):
        fails = {'coherence': 70.0}
        if 'step' in model or not less:
            fails['time'] = 900.0
        return [Finding(k, v, view=k, p_value=0.0) for k, v in fails.items()]
    search.places.tests = tests
    way = frozenset(search.places.model_of(main[:2]).labels)    # it is tried in what follows it
    search._explained_away = lambda *_: search.scores.update({way: 1080.0})
    assert search.forward(held) == (held if less else main)
    if less:
        best = search.scores[frozenset(search.places.model_of(held).labels)]
        assert best - search.scores[way] == 900.0


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
    search.places.at = lambda model: SimpleNamespace(fit=SimpleNamespace(
        supported=worth.get(frozenset(model.labels[2:]), 505.0)))
    search.places.tests = leaves({f'ramp, {k}': v for k, v in left.items()})
    chains = [[ramp, *main], [ramp, *other]]
    search.scores = {search.places.set_of(c): 300.0 for c in chains}
    got = search._as_few(chains[0], chains)
    assert {f.name for f in got} == {'ramp', *best}
    here = search.scores[search.places.set_of(got)]
    assert here == max(search.scores.values()) and not any(
        k > search.places.set_of(got) for k in search.scores)


def test_what_the_best_chain_hides_speaks_against_no_other(search):
    """Where quantization is, nobody sees that the samples are not normal."""
    def tests(model):
        shown = leaves({})(model)
        return shown if 'quantization' in model else [
            *shown, Finding('distribution', 44.0, view='distribution', p_value=0.0)]

    main = [found('notch'), found('narrowband'), found('quantization')]
    other = [found('low_pass')]
    search._rivals = lambda chain, i: []
    search.places.tests = tests
    search.places.at = lambda model: SimpleNamespace(fit=SimpleNamespace(
        supported=520.0 if 'low_pass' in model else 500.0))
    search.scores = {search.places.set_of(c): 300.0 for c in (main, other)}
    assert search._as_few(main, [main, other]) == other


def test_what_an_edge_gains_counts_once(search):
    """It falls within the means of the view of time, but the spectrum holds it."""
    search.places.at = lambda model: SimpleNamespace(fit=SimpleNamespace(supported=500.0))
    assert search._worth([found('ramp', 'time', elsewhere=161.0)]) == 500
    assert search._worth([found('rts', elsewhere=30.0, samples=30.0)]) == 530


@pytest.mark.parametrize(('left', 'members', 'goes_on'), [
    (90.0, 2, True), (0.0, 2, False), (90.0, 3, False)])
def test_a_short_chain_whose_end_was_not_looked_at_is_followed_on(search, left, members, goes_on):
    """The effort is bounded, and may have gone into what came to nothing; or it is spent."""
    search.places.problem.looks = 0
    search.places.overlooked = lambda chain: True
    search.places.left = lambda chain: left
    search.chain = lambda begin: [*begin, found('step', 'time')]
    assert len(search._continued([found('low_pass')] * members)) == members + goes_on
    assert search.places._may_look == goes_on


def test_one_that_needs_no_other_is_left_alone(search):
    """Nothing is fitted where the last member of a chain is in no doubt."""
    main = [found('gauss_markov'), found('low_pass')]
    search.scores = {search.places.set_of(main): 300.0, search.places.set_of(main[:1]): 200.0}
    assert search._as_few(main, [main]) == main


@pytest.mark.parametrize('name, view, kept', [
    ('variance_change', 'variance', True), ('ramp', 'time', False)])
def test_what_is_read_from_the_samples_is_in_no_fit(search, name, view, kept):
    """No set explains as much without it; what a mean explains the spectrum may as well."""
    one, more = found('low_pass', penalty=9.6), found(name, view, gain=120.0, penalty=8.0)
    search.places.at = lambda model: SimpleNamespace(fit=SimpleNamespace(supported=500.0))
    search.places.tests = leaves({})
    search.scores = {search.places.set_of(c): sum(f.gain for f in c)
                     for c in ([one], [one, more])}
    best = search._as_few([one, more], [[one], [one, more]])
    assert [f.name for f in best] == ['low_pass', name][:1 + kept]


@pytest.mark.parametrize(('other', 'first'), [(300.0, True), (320.0, False)])
def test_of_chains_that_leave_nothing_the_simpler_may_explain_as_much(search, other, first):
    """Three relaxations for flicker: what each gains at its place is more than all together."""
    main = [found('flicker', gain=150.0), found('narrowband', gain=200.0)]
    held = [found('rts', gain=170.0), main[1], found('gauss_markov', gain=50.0)]
    supported = {frozenset(('flicker', 'narrowband')): 310.0,
                 frozenset(('rts', 'narrowband', 'gauss_markov')): other}
    search.chain = lambda begin=(): [*begin] or main
    search._rivals = lambda *_: []
    search.places.at = lambda model: SimpleNamespace(fit=SimpleNamespace(
        supported=supported.get(frozenset(model.labels[1:]))))
    search.places.tests = leaves({})
    search._explained_away = lambda *_: search.scores.update({
        frozenset(search.places.model_of(c).labels): sum(f.gain for f in c) for c in (
            main, held, held[:1], main[:1])})
    assert search.forward(held) == (main if first else held)
    if first:
        best = search.scores[frozenset(search.places.model_of(main).labels)]
        assert all(best - search.scores[frozenset(search.places.model_of(held[:k]).labels)] >= 10
                   for k in (1, 3))


@pytest.mark.parametrize('said', [0.0, 5.0])
def test_what_members_gain_on_their_way_does_not_choose_between_chains(search, said):
    """A swing gains more behind a relaxation than behind a filter; together they are as good."""
    main = [found('low_pass', gain=368.0, penalty=8.0, samples=said),
            found('slow_periodic', 'time', 95.0)]
    other = [found('gauss_markov', gain=351.0, penalty=10.0),
             found('slow_periodic', 'time', 140.0)]
    chains = [main, other]
    search.places.at = lambda model: SimpleNamespace(fit=SimpleNamespace(supported=500.0))
    search.places.tests = leaves({})
    search.scores = {search.places.set_of(c): sum(f.gain for f in c) for c in chains}
    more = search.places.set_of([*other, found('notch')])
    search.scores[more] = 485.0
    assert search._as_few(other, chains) == main
    best, rival = (search.scores[search.places.set_of(c)] for c in chains)
    assert best - rival == 2 + said and more not in search.scores


@pytest.mark.parametrize('left', [0.0, 375.0])
def test_a_chain_that_leaves_something_counts_by_its_fit(search, left):
    """Samples on a grid are those of either rounding, and only one has the filter's spectrum."""
    main = [found('rate_quantization', 'grid', 18432.0), found('low_pass', gain=368.0)]
    other = [found('quantization', gain=18431.0, samples=18431.0), main[1]]
    search.places.at = lambda model: SimpleNamespace(fit=SimpleNamespace(
        supported=565.0 if 'rate_quantization' in model.labels else 535.0))
    search.places.tests = leaves({'quantization, low_pass': left})
    chains = [main, other]
    search.scores = {search.places.set_of(c): sum(f.gain for f in c) for c in chains}
    more = search.places.set_of([*other, found('notch')])
    search.scores[more] = search.scores[search.places.set_of(other)] + 5.0
    search._less_by_what_is_left(main, chains)
    best, rival = (search.scores[search.places.set_of(c)] for c in chains)
    assert best - rival == (31.0 if left else 1.0)
    assert search.scores[more] == rival + 5.0


@pytest.mark.parametrize('other', [500.0, 540.0])
def test_a_shaft_is_not_as_many_lines_that_gain_more_behind_a_filter(search, other):
    """Where they leave the same they explain the same, but for what is said of all the rest."""
    main = [found('harmonics', gain=1315.0, penalty=17.0), found('low_pass', gain=257.0)]
    lines = [found('sinusoid', gain=g, penalty=17.0) for g in (845.0, 401.0, 3406.0)]
    chains = [main, [*lines[:2], main[1], lines[2]]]
    search.places.at = lambda model: SimpleNamespace(fit=SimpleNamespace(
        supported=500.0 if 'harmonics' in model.labels else other))
    search.places.tests = leaves({})
    search.scores = {search.places.set_of(c): sum(f.gain for f in c) for c in chains}
    assert search._as_few(chains[1], chains) == chains[other > 534]


def test_a_rival_begins_a_chain_with_what_was_found_behind_the_first(search):
    main = [found('rate_quantization'), found('notch'), found('low_pass')]
    rival = found('quantization')
    search._heals = lambda *_: False
    search.places.beside_others = lambda f, name, model: replace(f, explains=0.5)
    search.against.unlowered = lambda before, after, both: (
        {'notch': 10.0, 'low_pass': 300.0}[after.labels[-1]], '')
    search.places.tests = leaves({'': 500.0, 'quantization, notch': 100.0})
    assert search._begun([rival], main) == [replace(rival, explains=0.5), main[2]]
    # what the main chain leaves may be what stands out beside the rival
    search.places.at = lambda model: SimpleNamespace(model=model, candidates=main[1:])
    assert search._begun([rival], main[:1]) == []
    search.places.tests = leaves({'': 500.0, 'rate_quantization': 60.0})
    assert search._begun([rival], main[:1]) == [replace(rival, explains=0.5), main[2]]
    search.places.tests = leaves({'': 500.0, 'quantization, low_pass': 450.0})
    assert search._begun([rival], main) == []
    search._heals = search._lowers = lambda *_: True
    assert search._begun([rival], main) == [rival]


@pytest.mark.parametrize('shared', [90.0, 110.0])
def test_what_would_yield_to_a_mean_is_no_rival_of_it_whichever_stands_out_more(search, shared):
    able = {'': [found('transient', 'time'), found('shared_noise', 'coherence', shared)]}
    able[''].sort(key=lambda f: -f.gain)
    search._heals = search._lowers = lambda *_: True
    search._pair = lambda *_: []
    search.places.at = lambda model: SimpleNamespace(
        model=model, candidates=able.get(', '.join(model.labels[1:]), []))
    assert [f.name for f in search.chain()] == ['transient']
    assert [f.name for f in search._yielded] == ['shared_noise']


def test_what_is_left_in_the_end_is_asked_again(search):
    """Where more falls each time than there are rounds: without what fell it may not hold."""
    chain = [found('narrowband', gain=100.0 - k) for k in range(ROUNDS + 3)]
    search.forward = lambda held=(): chain[:len(chain) - len(search.refuted)]
    search.with_odds = list
    search.backward = lambda some, last: {
        search.places.labels_of(some)[-1]: some[-1]} if len(some) > 1 else {}
    assert search.settled() == chain[:1]


def test_what_only_stands_for_what_has_no_name_is_refuted(search):
    search._nameless = {'shared_noise': found('shared_noise', 'coherence')}
    filters, step, line = found('low_pass'), found('step', 'time'), found('spikes')
    weak, bent = replace(filters, gain=-1.0), replace(filters, against='its form is another')
    able = {'shared_noise': [found('spikes'), weak, bent],
            'shared_noise, spikes': [found('quantization')]}
    search.places.at = lambda model: SimpleNamespace(
        model=model, candidates=able[', '.join(model.labels[1:])])

    def stands_in(members, finding):
        return search._stands_in(members, search.places.model_of(members), finding.name, finding)

    assert stands_in([filters], filters)
    blunt, sharp = (replace(found('narrowband'), effect=registry('noise')['narrowband'](
        {'frequency': 10.0, 'width': width})) for width in (1.0, 0.01))
    assert stands_in([blunt], blunt)
    assert not stands_in([sharp], sharp), 'nothing else draws what is so narrow'
    assert not stands_in([line], line)
    filled = found('quantization')
    assert not stands_in([line, filled], filled), 'it stands out beside both'
    assert not stands_in([step], step), 'what axes share yields to it'
    search.refuted = {'spikes': line}
    assert not stands_in([line], line), 'another of its name was refuted, and left it the label'
    search._nameless = {}
    assert not stands_in([filters], filters)


def test_a_claim_is_counted_in_the_view_that_shows_it(search):
    """Beside something else that fails there; or in all views in which an effect is judged."""
    def unhealed(finding, before, after, scores=None):
        search.places.tests = lambda some: [
            Finding(k, x, view=k, p_value=0.0, log_score=scores and scores[some is after])
            for k, x in some.items()]
        return search.against.unhealed(before, after, finding)

    alone = found('rts', 'frequency', 1600.0)
    beside = found('rts', 'frequency', 1600.0, elsewhere=1400.0)    # the samples say so much of it
    assert unhealed(alone, {'frequency': 1150.0}, {'frequency': 730.0})
    assert not unhealed(beside, {'frequency': 1150.0}, {'frequency': 730.0})
    assert unhealed(beside, {'frequency': 1150.0}, {'frequency': 1100.0})
    shock = found('shock', 'distribution', 1400.0)
    assert unhealed(shock, {'distribution': 15.0}, {'distribution': 10.0})
    loud = {'distribution': 15.0, 'variance': 2000.0}
    assert not unhealed(shock, loud, {'distribution': 10.0, 'variance': 100.0})
    assert unhealed(shock, loud, {'distribution': 10.0, 'variance': 1990.0})
    assert unhealed(shock, loud, {'distribution': 10.0}), 'a view that is hidden is not healed'
    # with less noise taken for it, what is left stands out as much; the data are likelier
    step = found('step', 'time', 80.0)
    assert unhealed(step, {'time': 300.0}, {'time': 310.0})
    assert unhealed(step, {'time': 300.0}, {'time': 310.0}, (-5000.0, -5060.0))
    assert not unhealed(step, {'time': 300.0}, {'time': 310.0}, (-5000.0, -5100.0))
    # what is faster than the view looks is not asked there
    assert unhealed(found('temperature', 'time', 430.0, elsewhere=200.0), {'time': 95.0}, {
        'time': 1280.0})
    assert not unhealed(found('temperature', 'time', 430.0, elsewhere=410.0), {'time': 95.0}, {
        'time': 1280.0})
    relaxing = found('gauss_markov', 'frequency', 80.0)     # by another view than its own
    search.places.tests = lambda some: [Finding(k, x, view=k, p_value=0.0, log_score=y)
                                        for k, (x, y) in some.items()]
    assert search.against.unhealed(
        {'frequency': (300.0, None), 'time': (50.0, -5000.0)},
        {'frequency': (500.0, None), 'time': (50.0, -5200.0)}, relaxing)


def test_two_that_are_in_the_mean_heal_together_what_one_of_them_does_not(search):
    step, swing = found('step', 'time', 800.0), found('slow_periodic', 'time', 400.0)
    ramp, rts = found('ramp', 'time', 1200.0), found('rts', 'frequency', 800.0)
    base = search.places.base
    # the step leaves the swing, which stands out more, and the swing the step
    left = {'': 1200.0, 'step': 900.0, 'slow_periodic': 1000.0, 'slow_periodic, step': 30.0,
            'ramp': 0.0, 'ramp, step': 0.0, 'rts': 1100.0, 'rts, step': 1000.0}

    def tests(model):
        gain = left[', '.join(sorted(model.labels[1:]))]
        return [Finding('time', gain, view='time', p_value=0.0 if gain else 0.5)]

    search.places.tests = tests
    beside = base.plus(step.effect)
    assert search.against.unhealed_with(base, beside, step, [])
    assert search.against.unhealed_with(base, beside, step, [rts])
    assert not search.against.unhealed_with(base, beside, step, [rts, swing])
    assert search.against.unhealed_with(base, beside, step, [ramp]), 'the ramp does it alone'
    assert not search.against.unhealed_with(base, beside, step, [ramp, swing])
    left['slow_periodic, step'] = 880.0
    assert search.against.unhealed_with(base, beside, step, [rts, swing])
    # noise that something adds to hides a step as well, but does nothing of what it does
    left['rts, step'] = 20.0
    assert not search.against.unhealed_with(base, beside, step, [rts, swing])
    assert search.against.unhealed_with(base, base.plus(rts.effect), rts, [step]) == ''


@pytest.mark.parametrize(('last', 'fall'), [(False, 1), (True, 2)])
def test_of_several_of_one_name_the_last_is_asked_first(search, last, fall):
    """What they leave together is held against each of them."""
    search.against.unconfirmed = lambda *_: (100.0, '')
    search.against.unhealed_with = lambda *_: ''
    search.against.shadowed = lambda *_: ''
    search.against.shaped = lambda model, name, f: 'a smooth form fits better'
    band = Finding('narrowband', 100.0, registry('noise')['narrowband'](), view='frequency')
    out = search.backward([band, band], last=last)
    assert [*out] == ['narrowband', 'narrowband.2'][-fall:]


def test_rivals_that_share_alike_come_in_one_order(search):
    """A set's own order differs from run to run; what is said of the same input must not."""
    some = [f'rival_{k}' for k in range(8)]
    search.scores = {frozenset(['chosen']): 1.0, frozenset(reversed(some)): 0.0}
    probability, said = search.odds(Model(), 'chosen')
    assert said == some[:3] and probability == pytest.approx(1 / (1 + np.exp(-1.0)))


def test_what_comes_with_it_or_without_it_is_no_rival(search):
    """A grid was said to be that of a rate, of an angle, or a step that either may have beside."""
    rate, angle = found('rate_quantization', gain=90.0), found('quantization', gain=89.0)
    search.scores = {frozenset(k.split()): v for k, v in (
        ('low_pass rate_quantization', 1.6), ('low_pass rate_quantization step', 1.2),
        ('low_pass quantization', 0.4), ('low_pass quantization step', 0.0))}
    probability, said = search.odds(Model(), 'rate_quantization')
    assert said == ['quantization'] and probability == pytest.approx(0.77, abs=0.01)
    rate = replace(rate, probability=probability, against=f'{CANNOT_TELL} quantization')
    angle, step = replace(angle, probability=0.23), found('step', 'time', 52.0, probability=0.41)
    assert rivals([rate, step, angle]) == [rate, angle]
    assert rivals([step, angle]) == [step, angle]
    assert rivals([replace(rate, against=FROM_NOTHING), step]) == [
        replace(rate, against=FROM_NOTHING)]


@pytest.mark.parametrize(('scores', 'said', 'probability'), [
    ({'harmonics': 1.0, 'sinusoid': 0.5}, 'sinusoid', 1.0),     # the strongest line at least
    ({'harmonics': 9.0, 'sinusoid': 0.5}, 'harmonics', 1.0),
    ({'harmonics': 1.0, 'sinusoid': 0.5, '': 1.5}, 'harmonics', 0.3),
    ({'harmonics': 1.0, 'step': 0.5}, 'harmonics', 0.62),
])
def test_of_a_shaft_and_its_strongest_line_the_line_is_there(search, scores, said, probability):
    """Which of the two it is may not be told: a line is there in any case."""
    search.scores = {frozenset({'white', *([k] if k else [])}): v for k, v in scores.items()}
    search.places.failing = lambda model: 0.0
    _places(search, {'': [found(k) for k in scores if k]})
    f, = search.with_odds([found('harmonics')])
    assert f.name == said and f.probability == pytest.approx(probability, abs=0.02)
    assert bool(f.against) == (probability < 0.95)


@pytest.mark.parametrize(('gained', 'probability'), [(22.0, 1.0), (-2.0, 0.0)])
def test_of_two_that_each_hold_what_they_share_both_are_there(search, gained, probability):
    """A course of all axes is in what they share; by itself that gains the course as well."""
    chain = [found('transient', 'time', 140.0), found('shared_noise', 'coherence', 90.0)]
    alone = {'': 0.0, 'transient': 133.0, 'shared_noise': 240.0}
    search.scores = {frozenset({'white', *([k] if k else [])}): v for k, v in alone.items()}
    search.scores[search.places.set_of(chain)] = 222.0
    search.places.failing = lambda model: 0.0
    _places(search, {}, lambda model: 500.0 - gained * ('transient' not in model))
    first, second = search.with_odds(chain)
    assert first.probability == pytest.approx(probability, abs=0.2)
    assert second.probability == pytest.approx(1.0)


def test_what_is_left_of_a_chain_has_odds_though_no_chain_came_by_it(search):
    """What fell in the last round is taken out, and nothing is looked at anew."""
    search.scores = {frozenset({'white', *more}): v for *more, v in (
        ('step', 40.0), ('step', 'ramp', 60.0), ('step', 'ramp', 'notch', 90.0))}
    search.places.failing = lambda model: 0.0
    _places(search, {})
    first, second = search.with_odds([found('step', 'time'), found('notch')])
    assert first.probability == pytest.approx(1.0) and second.probability == pytest.approx(1.0)


def _places(search, standing, fits=lambda model: None):
    """Let what stands out at a model be given by the names added to it, joined by commas."""
    def at(model):
        names = ', '.join(model.labels[1:])
        return SimpleNamespace(model=model, fit=SimpleNamespace(supported=fits(model)),
                               candidates=tuple(standing.get(names, ())))
    search.places.at = at
    search.places.offering = lambda model, wanted: at(model)


def test_what_stands_out_most_is_asked_for_beside_another_before_less_is_taken(search):
    """A filter around a line that nothing holds yet: alone neither heals, and other noise does."""
    filtered, line, other = found('low_pass', gain=200.0), found('narrowband', gain=190.0), \
        found('gauss_markov', gain=60.0)
    _places(search, {'': [filtered, other], 'low_pass': [line]})
    search._heals = lambda members, f: f.name != 'low_pass' or bool(members)
    search._lowers = lambda *_: True
    search.places.tests = leaves({'': 500.0})
    search.against.unhealed, search.against.unlowered = (lambda *_: ''), (lambda *_: (9.0, ''))
    search.places.beside_others = lambda f, *_: f
    assert [f.name for f in search.chain()] == ['low_pass', 'narrowband']


@pytest.mark.parametrize(('left', 'first'), [(500.0, 'band'), (0.0, 'narrowband')])
def test_what_has_no_name_begins_a_chain_where_a_name_leaves_something(search, left, first):
    """Though a name explains more, and never as its rival."""
    named, nameless = found('narrowband', gain=900.0), found('band', gain=200.0)
    search.chain = lambda begin=(): [*begin] or [named]
    _places(search, {'': [nameless, named]})
    search.places.tests = leaves({'narrowband': left})
    search._heals = search._lowers = lambda *_: True
    search.places.problem.point = lambda model: Fit(model_of('noise', ('white',)), {}, 0.0)
    assert [f.name for f in search.able(search.places.at(search.places.base))] == [
        'narrowband', 'band']
    assert [f.name for f in search.forward()] == [first]
    if first == 'narrowband':
        assert not any('band' in k for k in search.scores)


def test_what_has_no_name_is_fitted_only_where_no_name_has_its_place(search, monkeypatch):
    named, nameless = found('narrowband', gain=900.0), found('band', gain=200.0)
    monkeypatch.setattr(type(nameless.effect), 'part_of', lambda *_: 'a peak is in it')
    search.chain = lambda begin=(): [*begin] or [named]
    _places(search, {'': [nameless, named]})
    search.places.tests = leaves({'narrowband': 500.0})
    search._heals = search._lowers = lambda *_: pytest.fail('fitted')
    search.places.problem.point = lambda model: Fit(model_of('noise', ('white',)), {}, 0.0)
    assert [f.name for f in search.forward()] == ['narrowband']


@pytest.mark.parametrize(('view', 'first'), [('coherence', 'shared_noise'), ('frequency', 'band')])
def test_what_has_no_name_is_asked_where_a_view_that_shows_it_is_left(search, view, first):
    """Of a resonance that axes share a coherence was left, and which of two names was not told."""
    named, nameless = found('shared_noise', gain=900.0), found('band', gain=200.0)
    search.chain = lambda begin=(): [*begin] or [named]
    search._rivals = lambda *_: []
    _places(search, {'': [nameless, named]})
    search.places.tests = lambda model: [
        Finding(view, 500.0, view=view, p_value=0.0)] if 'shared_noise' in model else [
        Finding(v, 0.0 if 'band' in model else 900.0, view=v, p_value=0.5 * ('band' in model))
        for v in ('frequency', 'coherence')]
    search._heals = search._lowers = lambda *_: True
    search.places.problem.point = lambda model: Fit(model_of('noise', ('white',)).plus(
        named.effect) if 'shared_noise' in model else model, {}, 0.0)
    assert [f.name for f in search.forward()] == [first]


@pytest.mark.parametrize(('after', 'holds'), [(60.0, True), (250.0, False)])
def test_what_is_as_measured_heals_nothing_where_no_less_fails_in_all(search, after, holds):
    """It fits its own view whatever is there; what the mean does instead may fail by more."""
    search.places.tests = lambda some: [
        Finding(view, gain, view=view, p_value=0.0)
        for view, gain in (('frequency', 0.0 if 'band' in some else 200.0),
                           ('time', after if 'band' in some else 40.0))]
    base = search.places.base
    said = search.against.unhealed(base, base.plus(found('band').effect), found('band'))
    assert holds != bool(said)


def test_a_chain_that_is_held_is_weighed_without_what_has_fallen(search):
    """Beside noise that has fallen a filter had gained little; without it, it gains the most."""
    main = [found('gauss_markov', gain=90.0), found('notch', gain=80.0)]
    held = [found('low_pass', gain=20.0), found('narrowband', gain=60.0)]
    supported = {'gauss_markov': 1000.0, 'low_pass': 1100.0}
    search.chain = lambda begin=(): [*begin] or main
    search._rivals = lambda *_: []
    _places(search, {}, lambda model: supported.get(model.labels[-2:][0], 0.0))
    search.places.tests = leaves({'gauss_markov, notch': 5.0, 'low_pass, narrowband': 5.0})
    assert search.forward(held) == held
    worth = search.scores[search.places.set_of(held)]
    assert worth > search.scores.get(search.places.set_of(main), -np.inf)
    supported['low_pass'] = 900.0
    assert search.forward(held) == main


@pytest.mark.parametrize('gone', [True, False])
def test_what_fell_beside_what_is_gone_is_asked_again_where_one_of_its_kind_took_its_place(
        search, gone):
    """Beside two steps a relaxation had gained little; a telegraph was named, which gains less."""
    step, relaxation, telegraph = (
        found(name, view, gain) for name, view, gain in (
            ('step', 'time', 17.0), ('gauss_markov', 'frequency', 16.0),
            ('rts', 'frequency', 11.0)))
    search.places.problem.exchanges = lambda effect, later: ('gauss_markov', 'rts') * any(
        effect.name == 'rts' and e.name == 'step' for e in later)
    search.against.unconfirmed = lambda *_: (100.0, '')
    search.against.unhealed_with = search.against.shadowed = lambda *_: ''
    search.against.shaped = lambda model, name, f: (
        'gains no more than chance' if name == 'gauss_markov' and 'step' in model else '')
    _places(search, {'': [relaxation, telegraph], 'step': [relaxation, telegraph]})
    search._heals = search._lowers = lambda *_: True
    search.refuted.update(search.backward([step, relaxation]))
    assert [*search.refuted] == ['gauss_markov']
    chain = [telegraph] if gone else [step, telegraph]
    out = search._exchanged(chain)
    assert [f.name for f in out] == (['gauss_markov'] if gone else ['step', 'rts'])
    assert ('gauss_markov' in search.refuted) != gone


@pytest.mark.parametrize('probability, explains, said', [
    (0.01, 0.0, 'complete'),
    (0.3, 0.0, 'undecidable'),
    (0.01, 0.4, 'undecidable'),
])
def test_what_is_next_to_certainly_nothing_leaves_nothing_undecided(
        monkeypatch, probability, explains, said):
    one = found('narrowband', gain=13.2, penalty=12.8, probability=probability,
                explains=explains, against=FROM_NOTHING)
    model = SimpleNamespace(labels=())
    places = SimpleNamespace(base=model, tests=lambda m: [], error=lambda m: None,
                             model_of=lambda chain: model, at=lambda m: None)
    monkeypatch.setattr(diagnosis, 'Search', lambda *_: SimpleNamespace(
        places=places, refuted={}, settled=lambda: [one]))
    error = SimpleNamespace(views={}, failing=())
    problem = SimpleNamespace(advice=lambda *said: '', leave=lambda model: '')
    state = SimpleNamespace(model=model, error=error, problem=problem)
    assert diagnosis.diagnose(state).verdict == said
