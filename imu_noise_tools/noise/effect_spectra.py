# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""What effects put into the bins of a part, and how that turns with their values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from .behind import leaks_behind, responses_on, together
from .evidence import Evidence
from .kinds import Response, Spectrum
from ..core.spectrum import asked, Bins, gathered, leaked
from ..loop.effect import Model, Parameter

UNITS = 128  # spectra of effects and gains of responses that are kept of a part


class EffectSpectra:
    """
    The spectra of effects in the bins of a part, as expected behind the sensor's responses.

    What effects of some values put there is the same whatever else is in their model: it is kept
    with the evidence.

    Parameters
    ----------
    evidence : Evidence
    part : str
        ``whole``, ``first`` or ``second``.

    """

    def __init__(self, evidence: Evidence, part: str):
        self.evidence, self.part_name, self.dt = evidence, part, evidence.dt
        self.bins: Bins = evidence.part(part).bins
        self._units = evidence.units[part]

    def of_model(self, model: Model,
                 leaks: bool = False) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """
        Return (v, {label: v of that effect}), (b,) each; v is 0 of a model without noise.

        With what leaks and what rounding adds, which shows behind a response that leaves little;
        of a model that has none where it ``leaks`` all the same.

        """
        each = {e.label: self.spectrum(e, model) for e in model.of(Spectrum)}
        total = sum(each.values(), np.zeros(len(self.bins.f)))
        if each and (leaks or leaks_behind(model)):
            total = total + self._rounding(model, each)
            total = total + leaked(total, self.bins)
        return total, each

    def spectrum(self, effect: Spectrum, model: Model) -> np.ndarray:
        """Return what one effect of a model puts into the bins, (b,)."""
        behind = responses_on(effect, model)
        if effect.centre is not None:
            return self._peak(effect, behind)
        square, key, one = self._unit(effect)
        if behind:
            return square * gathered(one * self._gain2(behind, effect.flat), self.bins)
        if not key:
            return gathered(one, self.bins)
        return square * self._kept((*key, ''), lambda: gathered(one, self.bins))

    def slopes(self, effect: Spectrum, model: Model) -> dict[str, np.ndarray]:
        """Return d v/d x, (b,) each, of what a spectrum has in closed form, by name."""
        slopes, behind = effect.slopes(self.bins), responses_on(effect, model)
        if slopes and behind:
            gain = gathered(self._gain2(behind), self.bins)
            slopes = {name: slope * gain for name, slope in slopes.items()}
        return dict(slopes)

    def slope(self, effect: Spectrum, parameter: Parameter, x: float, model: Model,
              h: float = 1e-4) -> np.ndarray:
        """Return d v/d x (b,) by central differences, x a parameter on its search scale."""
        up, down = (self.spectrum(effect.with_values(**{
            parameter.name: parameter.from_search(x + step)}), model) for step in (h, -h))
        return (up - down) / (2 * h)

    def response_slopes(self, response: Response, at: Sequence[tuple[Parameter, float]],
                        model: Model, each: Mapping[str, np.ndarray],
                        h: float = 1e-6) -> np.ndarray:
        """
        Return d v/d x (b, p) of a response's parameters, ``at`` places on their search scales.

        Of its gain alone, by differences upwards; ``each`` is the spectrum by label. Power goes
        with the gain, and so does what leaks.

        """
        moved = [response.with_values(**{p.name: p.from_search(x + h)}) for p, x in at]
        out = self._turned(model, response, moved, h)
        if leaks_behind(model):
            out += leaked(sum(each.values()) + self._rounding(model, each), self.bins, out)
        return out

    def _peak(self, effect, behind):
        """Return what a peak puts into the bins, behind responses."""
        own = effect.binned(self.bins)
        return own * gathered(self._gain2(behind), self.bins) if behind else own

    def _unit(self, effect):
        """
        Return (square, key, PSD (g,)) of an effect before any response: the PSD is of amplitude 1.

        Power goes with the square of an amplitude: what else it depends on seldom moves, and is
        kept by its key; without an amplitude there is none.

        """
        amplitude = effect.amplitudes
        size = effect[amplitude[0]] if len(amplitude) == 1 else 0.0
        if not size > 0:
            return 1.0, (), self._psd(effect)
        key = type(effect), *((k, v) for k, v in effect.values.items() if k != amplitude[0])
        return size**2, key, self._kept(
            key, lambda: self._psd(effect.with_values(**{amplitude[0]: 1.0})))

    def _psd(self, effect):
        """Return the PSD (g,) of an effect, with the colour that the samples show."""
        at, colour = asked(self.bins), effect.colour(self.evidence, self.part_name)
        psd = effect.psd(at, self.dt)
        return psd if colour is None else psd * colour(at)

    def _turned(self, model, own, moved, h):
        """Return slopes (b, p) of what is behind a response, of what it is ``moved`` to by h."""
        out = np.zeros((len(self.bins.f), len(moved)))
        alike: dict[tuple, list[Spectrum]] = {}
        for e in (e for e in model.of(Spectrum) if own.acts_on(e)):
            behind = responses_on(e, model)
            key = *(r.label for r in behind), e.flat and any(r.scatters for r in behind)
            alike.setdefault(key, []).append(e)
        for (*_, flat), spectra in alike.items():
            behind = responses_on(spectra[0], model)
            here = self._gain2(behind, flat)
            turn = np.stack([(self._gain2(behind, flat, up) - here) / h for up in moved], axis=1)
            units = (self._unit(e) for e in spectra if e.centre is None)
            smooth = sum((square * one for square, _, one in units), np.zeros(len(turn)))
            out += gathered(turn * smooth[:, None], self.bins)
            peaks = [e.binned(self.bins) for e in spectra if e.centre is not None]
            if peaks:
                out += np.sum(peaks, axis=0)[:, None] * gathered(turn, self.bins)
        return out

    def _gain2(self, responses, white=False, moved=None):
        """
        Return the squared gain (g,) of responses where :func:`gathered` wants it.

        On white noise or other; one of them as ``moved`` where there is that.

        """
        at = asked(self.bins)
        if moved is not None:
            responses = [moved if r.label == moved.label else r for r in responses]
        each = [r.gain2(at, self.dt) if r is moved else self._kept(
            (type(r), *r.values.items()), partial(r.gain2, at, self.dt)) for r in responses]
        return together(responses, each, at, self.dt, white)

    def _kept(self, key, make):
        """Return what was made for a key, or make it."""
        if key not in self._units:
            if len(self._units) > UNITS:
                self._units.clear()
            self._units[key] = make()
        return self._units[key]

    def _rounding(self, model, each):
        """
        Return the power of the output's rounding (b,), none where a spectrum by label is that.

        That happens behind the filter: where the filter leaves nothing, it is what is measured.

        """
        if any(np.any(each[e.label]) for e in model.of(Spectrum) if 'grid' in e.explains):
            return 0.0
        return self.evidence.remembered(('rounding', self.part_name), self._added_by_rounding)

    def _added_by_rounding(self):
        added = self.evidence.rounding
        lags = 2 * np.pi * self.dt * np.arange(1, len(added))
        return 2 * self.dt * np.maximum(
            added[0] + 2 * np.cos(self.bins.f[:, None] * lags) @ added[1:], 0.0)
