# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Effects, models and what a fit says: knows no problem, no file and no plot.

A model is a sum of named effects: ``White() + Flicker() + RandomWalk()``. An effect belongs to one
domain (``noise``, ``calibration`` or ``filter``), registers itself when its class is made, and
nothing else names it. What an effect *does* is said by the kind it derives from, in the package of
its domain.

"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
import importlib.util
from pathlib import Path
import re
from types import MappingProxyType
from typing import Any, cast, ClassVar, Generic, TypeVar

import numpy as np

from . import verdict
from .domains import DOMAINS, package
from ..core.errors import InputError, unknown, UsageError

Details = TypeVar('Details')     # what a domain keeps of a fit
Capable = TypeVar('Capable')     # a kind of effect
Same = TypeVar('Same', bound='Effect')
_REGISTRY: dict[str, dict[str, type[Effect]]] = {}


@dataclass(frozen=True)
class Parameter:
    """
    One parameter of an effect.

    Parameters
    ----------
    name : str
        As it is written in study.yaml, e.g. ``N``.
    unit : str
        SI unit with the placeholders of :func:`imu_noise_tools.core.units.si`, e.g.
        ``{rate}/sqrt(Hz)``.
    lower, upper : float
        Bounds within which it is searched for.
    log : bool
        Whether it is searched for on a logarithmic scale (all that cannot change sign).
    amplitude : bool
        Whether the effect vanishes as it goes to zero: only such a parameter can be null.
    linear : bool
        Whether it multiplies a column of a regressor: then it is solved for, not searched for.
    discrete : bool
        Whether only the values that ``starts`` proposes are tried.
    title : str
        What it is, in a few words.
    choices : tuple of str
        Names, where it is one of a few: it is written and read by name everywhere, and its value
        among the numbers of a fit is the index (:meth:`choice`).
    formerly : str
        Its name in older studies and specifications, which is still read.
    words : tuple of str
        What 0, 1, … mean, of one whose numbers stand for something else.
    knee : float
        Of one that may be nothing as well as span powers of ten: the value below which the scale
        of the search is linear, and above which it is logarithmic.

    """

    name: str
    unit: str
    lower: float
    upper: float
    log: bool = True
    amplitude: bool = False
    linear: bool = False
    discrete: bool = False
    title: str = ''
    choices: tuple[str, ...] = ()
    formerly: str = ''
    knee: float = 0.0
    words: tuple[str, ...] = ()

    @classmethod
    def choice(cls, name: str, choices: Iterable[str], title: str = '',
               formerly: str = '') -> Parameter:
        """Return a parameter that is one of a few names."""
        names = tuple(choices)
        return cls(name, '1', 0, len(names) - 1, log=False, discrete=True, title=title,
                   choices=names, formerly=formerly)

    def others(self, value: float) -> list[float]:
        """Return the choices that a value is not, as numbers; none where it is no choice."""
        return [float(k) for k in range(len(self.choices)) if k != value]

    def number(self, value: Any) -> float:
        """
        Return a value as a number: that of a choice is the index of its name.

        Raise UsageError for what is no number, or not among the choices.

        """
        if self.choices and value in self.choices:
            return float(self.choices.index(value))
        try:
            number = float(value)
        except (TypeError, ValueError):
            number = float('nan')
            if not self.choices:
                raise UsageError(
                    f'{self.name} = {value!r} is not a number', 'give a number') from None
        if self.choices and number not in range(len(self.choices)):
            raise UsageError(
                f'invalid {self.name} {value}', f'choose from {", ".join(self.choices)}'
            )
        return number

    def in_words(self, value: float | None) -> str:
        """Return what a value stands for, where it is no number but that; else nothing."""
        known = value is not None and value in range(len(self.words))
        return self.words[int(value)] if known and value is not None else ''

    def to_search(self, value: float) -> float:
        """Return where a value is on the scale of the search."""
        if self.knee:
            return float(np.log1p(value / self.knee))
        return float(np.log(value)) if self.log else float(value)

    def from_search(self, x: float) -> float:
        """Return the value at a place on the scale of the search."""
        if self.knee:
            return float(self.knee * np.expm1(x))
        return float(np.exp(x)) if self.log else float(x)

    def slope(self, value: float) -> float:
        """Return by how much a value changes along the scale of the search."""
        return value + self.knee if self.log or self.knee else 1.0

    def written(self, value: float) -> float | str:
        """Return a value as people read it: the name of a choice, any other as it is."""
        return self.choices[int(value)] if self.choices else value


@dataclass(frozen=True)
class Effect:
    """
    One named physical effect; empty ``values`` mean: to be fitted.

    A subclass states the class variables below. Naming it (a non-empty ``name``) registers it.

    """

    domain: ClassVar[str] = ''
    name: ClassVar[str] = ''
    symbol: ClassVar[str] = ''
    title: ClassVar[str] = ''
    equation: ClassVar[str] = ''
    signature: ClassVar[str] = ''
    hint: ClassVar[str] = ''
    reference: ClassVar[str] = ''
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    field_units: ClassVar[bool] = False  # do people read it in deg/sqrt(h) and the like, or in SI?
    several: ClassVar[bool] = False  # may a model hold more than one of it?
    # how many of it are looked for: more together would bend to anything
    most: ClassVar[float] = float('inf')
    views: ClassVar[tuple[str, ...]] = ()  # views in which adding it is judged; none named: all
    # can nothing else imitate what shows it, so that a misfit elsewhere casts no doubt on it?
    certain: ClassVar[bool] = False
    # does the view that shows it fail by what it gains? if not, it need not heal that view
    counted: ClassVar[bool] = True
    # can two of these hide each other? the fit stretches the noise over what one of them leaves,
    # so that neither heals its view alone: they are tried in pairs
    paired: ClassVar[bool] = False
    # does it lower the fitted floor, so that others of these, and paired ones, become visible?
    # they are tried in pairs with it
    uncovers: ClassVar[bool] = False
    # what a paired one does on several targets, in words, where what it explains may be that: the
    # paired one is tried before it; empty: nothing
    yields: ClassVar[str] = ''
    # is it in nearly every sensor? then it pays less to be believed
    common: ClassVar[bool] = False
    # if its form is refuted, is the misfit real all the same? later candidates may not claim it
    stays: ClassVar[bool] = False
    # does it say where something is, and not what? it is tried where nothing that has a name holds
    nameless: ClassVar[bool] = False
    # views whose failure casts no doubt on it: it may cause that itself, or has no part in it
    aside: ClassVar[tuple[str, ...]] = ()
    # parameters that do nothing unless the record asks for them: priced only where they are used
    optional: ClassVar[tuple[str, ...]] = ()

    # the file of a user's own that it is from
    loaded_from: ClassVar[str] = ''

    _named: ClassVar[dict[str, Parameter]]

    values: Mapping[str, Any] = field(default_factory=dict)     # a choice by name or index
    label: str = ''

    def __init_subclass__(cls, **kwargs: Any) -> None:
        """Register the class under its domain and name."""
        super().__init_subclass__(**kwargs)
        if '__slots__' in cls.__dict__:
            raise TypeError(
                f'{cls.__name__}: slots build a class twice, so it would register twice'
            )
        if cls.__dict__.get('name'):
            known = _REGISTRY.setdefault(cls.domain, {})
            other = known.get(cls.name)
            if other and (other.__module__, other.__qualname__) != (
                cls.__module__,
                cls.__qualname__,
            ):
                raise UsageError(
                    f'two effects are named {cls.name} ({other.__module__} and {cls.__module__})',
                    'give the new one another name',
                )
            known[cls.name] = cls

    @classmethod
    def _by_name(cls) -> dict[str, Parameter]:
        # once a class: fits ask by the hundred thousand
        if '_named' not in cls.__dict__:
            cls._named = {p.name: p for p in cls.parameters}
        return cls._named

    def __post_init__(self) -> None:
        """Check the names of the values and freeze them."""
        known = self._by_name()
        given = self.values
        if not given.keys() <= known.keys():
            given = self._renamed()
        values = {k: v if type(v) is float and not known[k].choices else known[k].number(v)
                  for k, v in given.items()}
        object.__setattr__(self, 'values', MappingProxyType(values))
        object.__setattr__(self, 'label', self.label or self.name)

    def _renamed(self) -> dict[str, Any]:
        """Return the values by names of today; raise UsageError for a name that never was."""
        known = self._by_name()
        now = {p.formerly: p.name for p in self.parameters
               if p.formerly and p.name not in self.values}
        given = {now.get(k, k): v for k, v in self.values.items()}
        unknown = sorted(set(given) - set(known))
        if unknown:
            raise UsageError(
                f'{self.name} has no parameter {", ".join(unknown)}',
                f'its parameters are {", ".join(known) or "none"}',
            )
        return given

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle by name and values: where a user's own was loaded from is no module."""
        given = dict(self.values), self.label
        known = _REGISTRY.get(self.domain, {}).get(self.name)
        return (_named, (self.domain, self.name, *given)) if known is type(self) \
            else (type(self), given)

    def __hash__(self) -> int:
        """Hash by label and values."""
        return hash((self.name, self.label, tuple(sorted(self.values.items()))))

    def __getitem__(self, name: str) -> float:
        """Return one value."""
        return self.values[name]

    def __add__(self, other: Effect | Model) -> Model:
        """Return the sum as a model."""
        return Model((self,)) + other

    @classmethod
    def lineage(cls) -> tuple[str, ...]:
        """
        Return its name and those of the effects it derives from, nearest first.

        What is known of an effect by name (a threshold, a rule of reading) holds for those that
        derive from it.

        """
        names = [c.__dict__['name'] for c in cls.__mro__ if c.__dict__.get('name')]
        return tuple(names)

    @property
    def sharp(self) -> bool:
        """Whether, as it is, nothing of another form bends as it does."""
        return False

    @property
    def as_measured(self) -> bool:
        """Whether it takes its levels from the record, and so has no form that may be another."""
        return False

    @property
    def fitted(self) -> bool:
        """Whether every parameter has a value."""
        return all(p.name in self.values for p in self.parameters)

    @classmethod
    def parameter(cls, name: str) -> Parameter:
        """Return a parameter by its name or former name; raise KeyError without one."""
        for p in cls.parameters:
            if name in (p.name, p.formerly):
                return p
        raise KeyError(name)

    def chosen(self, name: str) -> str:
        """Return the name of a parameter's choice."""
        return self.parameter(name).choices[int(self.values[name])]

    def part_of(self, model: Model) -> str:
        """Say that it is another one's shape in a model rather than one by itself, or nothing."""
        return ''

    def written(self) -> dict[str, float | str]:
        """Return the values as people read them, choices by name."""
        return {k: self.parameter(k).written(v) for k, v in self.values.items()}

    def with_values(self: Same, **values: float | str) -> Same:
        """Return a copy with these values in place of, or beside, the old ones."""
        known = self._by_name()
        if not known.keys() >= values.keys():
            return type(self)({**self.values, **values}, self.label)    # which says what is wrong
        # fits do this by the hundred thousand: what it has was looked at when it was made
        more = {k: v if type(v) is float and not known[k].choices else known[k].number(v)
                for k, v in values.items()}
        out = object.__new__(type(self))
        had = cast('MappingProxyType[str, float]', self.values)
        out.__dict__.update(self.__dict__, values=MappingProxyType(had | more))
        return out

    @classmethod
    def example(cls) -> Effect:
        """Return one with values, by default the middle of their bounds: for tests and help."""
        return cls(
            {
                p.name: (
                    0.0
                    if p.choices
                    else float(np.sqrt(p.lower * p.upper))
                    if p.log
                    else 0.5 * (p.lower + p.upper)
                )
                for p in cls.parameters
            }
        )


class Model:
    """A sum of effects with labels that are unique: ``sinusoid``, ``sinusoid.2``."""

    def __init__(self, effects: Iterable[Any] = ()) -> None:
        found: list[Effect] = []
        for e in effects:
            found.append(self._labelled(e, found))
        self.effects = tuple(found)

    @staticmethod
    def _labelled(effect: Effect, others: list[Effect]) -> Effect:
        taken = {o.label for o in others}
        if effect.label not in taken:
            return effect
        if not effect.several:
            raise UsageError(
                f'the model already has {effect.label}', 'it can hold only one of this kind'
            )
        k = 2
        while f'{effect.name}.{k}' in taken:
            k += 1
        return replace(effect, label=f'{effect.name}.{k}')

    def __add__(self, other: Effect | Model) -> Model:
        """Return the model with an effect, or all of another model's, added."""
        more = other.effects if isinstance(other, Model) else (other,)
        return Model(self.effects + tuple(more))

    __radd__ = __add__
    plus = __add__

    def minus(self, label: str) -> Model:
        """Return the model without one effect; raise UsageError where there is none."""
        if label not in self.labels:
            raise UsageError(
                f'the model has no {label}', f'it has {", ".join(self.labels) or "nothing"}'
            )
        return Model(e for e in self.effects if e.label != label)

    def with_effect(self, effect: Effect) -> Model:
        """Return the model with the effect of the same label replaced."""
        return (
            self.with_values({effect.label: effect.values})
            if type(self[effect.label]) is type(effect)
            else Model(effect if e.label == effect.label else e for e in self.effects)
        )

    def with_values(self, values: Mapping[str, Mapping[str, float]]) -> Model:
        """
        Return the model with values in place of or beside those it has.

        They are given by label and parameter.

        """
        out = Model()
        out.effects = tuple(
            e.with_values(**values[e.label]) if e.label in values else e for e in self.effects
        )
        return out

    def __iter__(self) -> Iterator[Effect]:
        """Iterate over the effects."""
        return iter(self.effects)

    def __len__(self) -> int:
        """Return how many effects there are."""
        return len(self.effects)

    def __eq__(self, other: object) -> bool:
        """Compare effects and values."""
        return isinstance(other, Model) and self.effects == other.effects

    def __hash__(self) -> int:
        """Hash by the effects."""
        return hash(self.effects)

    def __getitem__(self, label: str) -> Effect:
        """Return the effect of a label."""
        for e in self.effects:
            if e.label == label:
                return e
        raise KeyError(label)

    def __contains__(self, label: str) -> bool:
        """Tell whether an effect of this label is in it."""
        return label in self.labels

    @property
    def labels(self) -> list[str]:
        """Labels in order."""
        return [e.label for e in self.effects]

    def of(self, kind: type[Capable]) -> list[Capable]:
        """Return the effects that have a capability."""
        return [e for e in self.effects if isinstance(e, kind)]

    def __repr__(self) -> str:
        """Read like the physics."""
        return ' + '.join(self.labels) or '(nothing)'


def unfitted(model: Model) -> Model:
    """Return the model without values, labels kept."""
    return Model(type(e)({}, e.label) for e in model)


def registry(domain: str) -> Mapping[str, type[Effect]]:
    """
    Return the effects of a domain by name, in the order in which they registered.

    The domain's package is loaded on first use, so its own effects are always among them.

    """
    if domain in DOMAINS:
        package(domain)
    return MappingProxyType(_REGISTRY.get(domain, {}))


def find_effect(domain: str, name: str) -> type[Effect]:
    """
    Return an effect's class by its name (or a label such as ``sinusoid.2``).

    Raise UsageError for an unknown one.

    """
    known = registry(domain)
    plain = re.sub(r'\.\d+$', '', name)
    if plain not in known:
        raise unknown(f'{domain} effect', name, known)
    return known[plain]


def _named(domain: str, name: str, values: Mapping[str, float], label: str) -> Effect:
    """Return an effect that came from another process."""
    return find_effect(domain, name)(values, label)


def model_of(domain: str, names: Iterable[str]) -> Model:
    """
    Return the model, not yet fitted, of these names.

    Raise UsageError for an unknown or repeated one.

    """
    return Model(find_effect(domain, n)() for n in names)


def load_effects(path: str | Path) -> list[str]:
    """
    Run a user's Python file, so that the effects in it register; return their names.

    Raises
    ------
    InputError
        The file is not there, fails, or defines no effect.

    """
    path = Path(path)
    if not path.is_file():
        raise InputError(
            f'{path}: no such file', '--effects-from takes a Python file that defines effects'
        )
    for domain in DOMAINS:  # so that a name that is taken is seen
        package(domain)
    spec = importlib.util.spec_from_file_location(f'imu_noise_user_{path.stem}', path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except UsageError:
        raise
    except (Exception, SystemExit) as error:
        raise InputError(f'{path}: {type(error).__name__}: {error}', 'fix the file') from error
    found = [
        c for known in _REGISTRY.values() for c in known.values() if c.__module__ == spec.name
    ]
    for own in found:
        own.loaded_from = str(path.resolve())
    if not found:
        raise InputError(
            f'{path}: defines no effect', 'derive a class from an effect kind and give it a name'
        )
    return [c.name for c in found]


def loaded_effects() -> list[str]:
    """Return the files of a user's own effects, which another process has to load as well."""
    every = (c.loaded_from for known in _REGISTRY.values() for c in known.values())
    return list(dict.fromkeys(filter(None, every)))


@dataclass(frozen=True)
class Estimate:
    """
    One fitted number and its uncertainty.

    ``value`` is None where the interval of an amplitude reaches zero; ``point`` still holds the
    most likely number, which the model is drawn with. ``fixed`` marks what came from the samples
    rather than from the fit. ``profile`` are (value, deviance) where the profile likelihood was
    looked at: 2 ln L below its maximum; not kept with a study.

    """

    value: float | None
    std: float | None
    ci95: tuple[float, float] | None
    unit: str = ''
    upper95: float | None = None
    note: str = ''
    point: float | None = None
    fixed: bool = False
    profile: tuple[tuple[float, float], ...] = field(default=(), compare=False, repr=False)


@dataclass(frozen=True)
class Fit(Generic[Details]):
    """
    What fitting a model gave: the model with its values, an estimate of each, and what went wrong.

    ``flags`` are sentences for people: a bound hit, a start that did not move, an effect not
    observable. ``details`` belongs to the domain (a covariance matrix, residuals). ``supported``
    is a log-likelihood in which what a model cannot explain has levels of its own at a stated
    cost: by it models of one target are compared; None where the domain has none.

    """

    model: Model
    estimates: Mapping[str, Mapping[str, Estimate]]
    log_likelihood: float
    flags: tuple[str, ...] = ()
    details: Details = None  # type: ignore[assignment]
    supported: float | None = None


@dataclass(frozen=True)
class View:
    """
    One way to look at the data.

    Pulls (standard normal under a true model) at x, and their excess deviance per bin.

    ``excess`` is 0 in expectation for the true model, with scatter ``std``. ``log_score``, where
    given, is the total -2 ln p of the data under the prediction, up to what the data alone decide:
    it also rewards a sharper prediction. ``muted`` marks one that an effect of the model makes
    fail by itself: it is heard only as a change between two such models. ``allowed`` is the excess
    that a model which is only coarse may have by itself.

    """

    name: str
    x: np.ndarray
    pull: np.ndarray
    excess: float
    std: float
    unit: str = ''
    log_score: float | None = None
    muted: bool = False
    allowed: float = 0.0

    @property
    def over(self) -> float:
        """What of the excess is more than the model may have by itself."""
        return self.excess - self.allowed

    @property
    def deviance(self) -> float:
        """Total over the bins, for the comparison of two models on the same data."""
        return self.excess * len(self.pull) if self.log_score is None else self.log_score


@dataclass(frozen=True)
class Score:
    """
    How well a fit predicts data it has not seen.

    The mean over the views of their excess, and its scatter: that of chance, and what the views
    allow, so that ``CHANCE`` times it is the limit of both. ``muted`` views count as zero in both:
    what mutes a view neither raises nor lowers the error by it.

    """

    excess: float
    std: float
    views: Mapping[str, View] = field(default_factory=dict)
    muted: Mapping[str, View] = field(default_factory=dict)
    allowed: float = 0.0

    @property
    def within_chance(self) -> bool:
        """Whether a true model could score as much, in all and in each view."""
        return verdict.within_chance(self.excess, self.std) and not self.failing

    @property
    def side(self) -> str:
        """Say whether the error is within, at the edge of, or beyond chance."""
        return verdict.side(self.within_chance, bool(self.failing))

    @property
    def failing(self) -> list[str]:
        """Names of the views that fail, the surest first; the surest where only their sum does."""
        each = {k: (v.over, v.std) for k, v in self.views.items()}
        found = verdict.views_failing(each)
        over, chance = self.excess - self.allowed, self.std - self.allowed / verdict.CHANCE
        if not found and each and verdict.tail(over, chance) < verdict.HELD_OUT_LEVEL:
            found = [min(each, key=lambda k: verdict.tail(*each[k]))]
        return found

    @classmethod
    def of(cls, views: Iterable[View]) -> Score:
        """Average views with equal weights."""
        said = [v for v in views if np.isfinite(v.excess)]
        views = {v.name: v for v in said if not v.muted}
        muted = {v.name: v for v in said if v.muted}
        if not views:
            return cls(float('nan'), float('nan'), {}, muted)
        k = len(views) + len(muted)
        allowed = float(sum(v.allowed for v in views.values()) / k)
        return cls(
            float(sum(v.excess for v in views.values()) / k),
            float(np.sqrt(sum(v.std**2 for v in views.values())) / k) + allowed / verdict.CHANCE,
            views,
            muted,
            allowed,
        )


@dataclass(frozen=True)
class Finding:
    """
    One candidate of a diagnosis, or one test that failed (then ``effect`` is None).

    ``gain`` is in nats of log-likelihood over the model without it, ``penalty`` what chance could
    give. ``explains`` is the share of what fails that it takes away; ``against`` says what speaks
    against it, empty where nothing does. ``shapes`` counts the parameters besides one that the
    penalty does not price. ``elsewhere`` are the nats of the gain that its view does not show;
    ``samples`` those of them that no likelihood of a model holds: what the samples themselves say,
    or say against it (negative). ``log_score`` is that of a test's view. ``bounded`` says that
    it lies at a bound, where what is unexplained beside it may hold it. ``where`` is the time or
    the frequency, with its unit, at which to look for what made a test fail.

    """

    name: str
    gain: float
    effect: Effect | None = None
    estimates: Mapping[str, Estimate] = field(default_factory=dict)
    penalty: float = 0.0
    view: str = ''
    evidence: str = ''
    probability: float | None = None
    p_value: float | None = None
    explains: float | None = None
    against: str = ''
    shapes: int = 0
    elsewhere: float = 0.0
    samples: float = 0.0
    log_score: float | None = None
    bounded: bool = False
    where: str = ''
