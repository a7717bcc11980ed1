# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Effects and models, whatever the problem: names, labels, values, sums, and a user's own file."""

from __future__ import annotations

from dataclasses import dataclass
import pickle
import re

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from imu_noise_tools.core.errors import InputError, UsageError
from imu_noise_tools.loop.domains import DOMAINS
from imu_noise_tools.loop.effect import (
    Effect,
    find_effect,
    load_effects,
    Model,
    model_of,
    Parameter,
    registry,
    Score,
    View,
)

DOMAIN = 'test_effect'


class Tone(Effect):
    """Something that may be there more than once."""

    domain, name, several = DOMAIN, 'tone', True
    parameters = (Parameter('a', '{rate}', 1e-6, 1e2, amplitude=True),
                  Parameter('phase', 'rad', -3.0, 3.0, log=False))


class Floor(Effect):
    """Something that is there once."""

    domain, name = DOMAIN, 'floor'
    parameters = (Parameter('level', '', 1e-2, 1e2, amplitude=True),)


class Switch(Effect):
    """Something that comes in kinds."""

    domain, name = 'test_choices', 'switch'
    parameters = (Parameter.choice('kind', ('slow', 'fast'), title='how fast'),
                  Parameter('level', '', 1e-2, 1e2))


def test_a_choice_is_named():
    p = Switch.parameter('kind')
    assert p == Parameter('kind', '1', 0, 1, log=False, discrete=True, title='how fast',
                          choices=('slow', 'fast'))
    e = Switch({'kind': 'fast', 'level': 2})
    assert e == Switch({'kind': 1.0, 'level': 2.0}), 'by index, as older studies have it'
    assert e.chosen('kind') == 'fast' and e.written() == {'kind': 'fast', 'level': 2.0}
    assert e.with_values(kind='slow')['kind'] == 0.0
    assert Switch.example().chosen('kind') == 'slow'
    for wrong in ('middling', 2.0, 0.5, None):
        with pytest.raises(UsageError, match='slow, fast'):
            Switch({'kind': wrong})
    with pytest.raises(UsageError, match='number'):
        Switch({'level': 'fast'})
    with pytest.raises(KeyError):
        Switch.parameter('colour')


def test_naming_a_class_registers_it():
    assert dict(registry(DOMAIN)) == {'tone': Tone, 'floor': Floor}
    assert find_effect(DOMAIN, 'tone') is Tone and find_effect(DOMAIN, 'tone.7') is Tone
    with pytest.raises(TypeError):
        registry(DOMAIN)['other'] = Floor


def test_domains_do_not_mix():
    assert 'tone' not in registry('noise')
    with pytest.raises(UsageError, match='unknown noise effect tone') as error:
        find_effect('noise', 'tone')
    assert 'white' in error.value.remedy or not registry('noise')


def test_an_abstract_kind_stays_out(clean_registry):
    class Kind(Effect):
        domain = DOMAIN

    class Heir(Tone):                                # inherits the name, does not state it
        pass

    assert dict(registry(DOMAIN)) == {'tone': Tone, 'floor': Floor}
    assert Kind.name == '' and Heir.name == 'tone'


def test_a_name_is_taken_once(clean_registry):
    with pytest.raises(UsageError, match='two effects are named tone'):
        class Other(Effect):
            domain, name = DOMAIN, 'tone'
    assert find_effect(DOMAIN, 'tone') is Tone


def test_slots_are_refused(clean_registry):
    with pytest.raises(TypeError, match='slots'):
        @dataclass(frozen=True, slots=True)
        class Slotted(Effect):
            domain, name = DOMAIN, 'slotted'


def test_values():
    e = Tone({'a': np.float64(2)})
    assert e['a'] == 2 and type(e['a']) is float and not e.fitted
    full = e.with_values(phase=1)
    assert full.fitted and full.values == {'a': 2.0, 'phase': 1.0} and e.values == {'a': 2.0}
    with pytest.raises(TypeError):
        full.values['a'] = 3
    with pytest.raises(AttributeError):
        full.label = 'x'
    with pytest.raises(UsageError, match='tone has no parameter b') as error:
        Tone({'b': 1.0})
    assert 'a, phase' in error.value.remedy


def test_equality_and_pickles():
    a, b = Tone({'a': 1.0}, 'tone.2'), Tone({'a': 1.0}, 'tone.2')
    assert a == b and hash(a) == hash(b)
    assert a != Tone({'a': 1.0}) and a != Tone({'a': 2.0}, 'tone.2')
    back = pickle.loads(pickle.dumps(a))
    assert back == a and back.label == 'tone.2'
    assert pickle.loads(pickle.dumps(Floor() + a)) == Floor() + a


def test_example_is_the_middle_of_the_bounds():
    assert Tone.example().values == pytest.approx({'a': 1e-2, 'phase': 0.0})


def test_a_sum_reads_like_the_physics():
    model = Floor() + Tone() + Tone()
    assert repr(model) == 'floor + tone + tone.2' and len(model) == 3
    assert model == Model([Floor(), Tone(), Tone()]) == model_of(DOMAIN, ['floor', 'tone', 'tone'])
    assert 'tone.2' in model and 'tone.3' not in model
    assert model['tone.2'].label == 'tone.2'
    with pytest.raises(KeyError):
        model['tone.3']
    assert repr(Model()) == '(nothing)'


def test_a_sum_of_models_and_of_a_list():
    assert (Floor() + (Tone() + Tone())).labels == ['floor', 'tone', 'tone.2']
    assert (Model([Floor()]) + Model([Tone()])).labels == ['floor', 'tone']
    assert Model([Floor()]).plus(Tone()).labels == ['floor', 'tone']


def test_what_is_there_once_is_refused_twice():
    with pytest.raises(UsageError, match='already has floor'):
        Floor() + Floor()
    with pytest.raises(
            UsageError, match='unknown test_effect effect flor: did you mean floor') as error:
        model_of(DOMAIN, ['flor'])
    assert 'floor' in error.value.remedy


def test_minus_keeps_labels():
    model = Floor() + Tone({'a': 1.0}) + Tone({'a': 2.0})
    less = model.minus('tone')
    assert less.labels == ['floor', 'tone.2'] and less['tone.2']['a'] == 2.0
    # the freed label is taken again before a new one is made
    assert less.plus(Tone()).labels == ['floor', 'tone.2', 'tone']
    with pytest.raises(UsageError, match='the model has no tone.3') as error:
        model.minus('tone.3')
    assert 'floor, tone, tone.2' in error.value.remedy


def test_replacing_an_effect_keeps_the_order():
    model = (Floor() + Tone()).with_effect(Floor({'level': 3.0}))
    assert model.labels == ['floor', 'tone'] and model['floor']['level'] == 3.0


@given(st.lists(st.sampled_from(['plus', 'minus']), max_size=12), st.randoms())
def test_labels_stay_unique(moves, random):
    model = Model([Floor()])
    for move in moves:
        if move == 'plus':
            model = model.plus(Tone())
        elif len(model) > 1:
            model = model.minus(random.choice(model.labels[1:]))
        assert len(set(model.labels)) == len(model.labels)
        assert model.labels[0] == 'floor'


@given(st.sampled_from([Parameter('a', '1', 1e-6, 1e6), Parameter('b', '1', -9.0, 9.0, log=False),
                        Parameter('c', '1', 0.0, 0.02, log=False, knee=1e-4)]), st.floats(1e-9, 1))
def test_the_scale_of_a_search_leads_back_and_rises_by_its_slope(parameter, share):
    low, high = parameter.lower, parameter.upper
    value = low + share * (high - low)
    x = parameter.to_search(value)
    assert parameter.from_search(x) == pytest.approx(value, rel=1e-9, abs=1e-12)
    rise = (parameter.from_search(x + 1e-4) - parameter.from_search(x - 1e-4)) / 2e-4
    assert parameter.slope(value) == pytest.approx(rise, rel=1e-6)


def test_capabilities():
    assert [e.label for e in (Floor() + Tone() + Tone()).of(Tone)] == ['tone', 'tone.2']


# --- a user's own file ---------------------------------------------------------------------------

HUM = """
from imu_noise_tools.loop.effect import Effect, Parameter

class Hum(Effect):
    domain, name = 'test_effect', 'hum'
    parameters = (Parameter('a', '', 0.1, 10),)
"""


def test_load_effects(tmp_path, clean_registry):
    path = tmp_path / 'mine.py'
    path.write_text(HUM)
    assert load_effects(path) == ['hum']
    assert find_effect(DOMAIN, 'hum')().label == 'hum'
    # given twice (a command run after another in one process), it is the same effect
    assert load_effects(path) == ['hum']


@pytest.mark.parametrize(('text', 'message'), [
    ('x = 1\n', 'defines no effect'),
    ('def broken(:\n', 'SyntaxError'),
    ('raise RuntimeError("no licence")\n', 'RuntimeError: no licence'),
    ('import not_a_module_anywhere\n', 'ModuleNotFoundError'),
])
def test_a_file_that_cannot_be_used(tmp_path, clean_registry, text, message):
    path = tmp_path / 'mine.py'
    path.write_text(text)
    with pytest.raises(InputError, match=message) as error:
        load_effects(path)
    assert str(path) in error.value.message and error.value.remedy


def test_no_such_file(tmp_path):
    with pytest.raises(InputError, match='no such file'):
        load_effects(tmp_path / 'none.py')
    with pytest.raises(InputError, match='no such file'):
        load_effects(tmp_path)


def test_a_name_that_is_taken(tmp_path, clean_registry):
    path = tmp_path / 'mine.py'
    path.write_text(HUM.replace("'hum'", "'tone'"))
    with pytest.raises(UsageError, match='two effects are named tone'):
        load_effects(path)


# --- scores --------------------------------------------------------------------------------------

def _view(name, excess, std):
    return View(name, np.zeros(3), np.zeros(3), excess, std)


def test_a_score_is_the_mean_over_views():
    s = Score.of([_view('f', 0.3, 0.03), _view('t', 0.1, 0.04)])
    assert s.excess == pytest.approx(0.2) and s.std == pytest.approx(0.025)
    assert not s.within_chance and Score.of([_view('f', 0.05, 0.03)]).within_chance


def test_views_that_do_not_apply_are_left_out():
    s = Score.of([_view('f', 0.3, 0.03), _view('c', np.nan, np.nan)])
    assert list(s.views) == ['f'] and s.excess == pytest.approx(0.3)
    nothing = Score.of([])
    assert np.isnan(nothing.excess) and not nothing.within_chance


@pytest.mark.parametrize('domain', DOMAINS)
def test_a_power_of_a_unit_is_in_parentheses(domain):
    """(rad/s)^2 and (m/s^2)^2: rad/s^2 is another unit, and m/s^2^2 is none."""
    for effect in registry(domain).values():
        assert not [p.unit for p in effect.parameters if '}^' in p.unit], effect.name


@pytest.mark.parametrize('domain', DOMAINS)
def test_what_an_example_says_of_itself_is_true(domain):
    """Where it says a value in SI behind one in the field's units, both are the example's."""
    per = {'deg': np.pi / 180, 'arcsec': np.pi / 648000}
    said = 0
    for name, cls in registry(domain).items():
        text = ' '.join((cls.example.__doc__ or '').split())
        for value, unit, per_time, si in re.findall(
                r'([\d.]+) (deg|arcsec)/?([hs]?)[^(.]* \(([\d.e-]+) rad', text):
            said += 1
            field = float(value) * per[unit] / (3600 if per_time == 'h' else 1)
            if '/g' not in text:
                assert field == pytest.approx(float(si), rel=0.03), (name, text)
            if sum(p.linear for p in cls.parameters) < 2:      # else it may be made of several
                known = list(cls.example().values.values())
                assert np.any(np.isclose(known, float(si), rtol=1e-3)), (name, text)
    assert said or domain != 'noise'
