# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Resolution of the rate output: few distinct levels."""

import numpy as np

from ..evidence import Evidence
from ..kinds import Defect, Inputs, NoiseEffect, Parameter, Spectrum
from ..rounded import coarse, told_by_grid
from ...core.statistics import grid_step, quiet_sigma
from ...loop.effect import Effect, Estimate, Finding, Fit, View

STRETCHES = 8   # of a part, each told by its samples where the grid is
ALIKE = 0.01    # relative difference of the steps of two halves that have one grid


class RateQuantization(Spectrum, Defect):
    """
    The output is rounded to a step.

    White noise of N = step/sqrt(12 fs) where the noise spans half a step or more.

    """

    name = 'rate_quantization'
    symbol = 'step'
    title = 'resolution of the rate output'
    equation = 'S(f) = step^2 dt/12 (two-sided): N = step/sqrt(12 fs)'
    signature = 'few distinct levels, evenly spaced; white'
    hint = (
        'The output word is short or the range is set too wide: choose a smaller range or a '
        'longer word. Below half a standard deviation of noise the rounding is no longer white, '
        'and averaging no longer helps.'
    )
    reference = 'Widrow and Kollar, Quantization Noise, 2008'
    decide = 'choose a finer output range'
    parameters = (
        Parameter('step', '{rate}', 1e-12, 1e3, amplitude=True, title='step of the output'),
        Parameter(
            'white',
            '1',
            0,
            1,
            log=False,
            discrete=True,
            title='1 where the noise spans half a step, so that rounding adds white noise; else 0',
            words=('rounding adds none', 'rounding adds white noise'),
        ),
    )
    filtered = False
    certain = True      # samples on few levels: no form of the spectrum puts them there
    views = ()
    explains = ('grid',)
    moves_means = True
    mutes = ('distribution', 'variance')  # samples on a coarse grid are not normal

    @property
    def hides(self) -> tuple[str, ...]:     # type: ignore[override]
        """Where the noise does not span half a step, power moves with the mean."""
        return () if self['white'] else ('variance',)

    @classmethod
    def statistics(cls, y: np.ndarray, inputs: Inputs) -> dict[str, np.ndarray]:
        """
        Keep the step, that of each half by itself, the number of levels and the noise.

        And the share of the samples beside which it shows: :func:`quiet_sigma`.

        """
        step, levels = grid_step(y)
        sigma, told = quiet_sigma(y, step)
        return {
            'step': np.array(step),
            'halves': np.array([grid_step(half)[0] for half in np.array_split(y, 2)]),
            'levels': np.array(levels),
            'sigma': np.array(sigma),
            'told': np.array(told),
        }

    @classmethod
    def held_out(cls, evidence: Evidence, part: str, fit: Fit) -> View | None:
        """Return what the samples of each stretch say for a grid that the model does not have."""
        kept = evidence.kept(cls.name)
        n = evidence.n // (1 if part == 'whole' else 2)
        halves, step = kept.get('halves', np.zeros(2)), float(kept.get('step', 0.0))
        gain = told_by_grid(kept, n)
        if not gain or np.any(np.abs(halves - step) > ALIKE * step):
            return None
        known = any('grid' in e.explains for e in fit.model.of(NoiseEffect))
        pull = np.full(STRETCHES, 0.0 if known else np.sqrt(2 * gain / STRETCHES))
        first = 0.5 * evidence.duration if part == 'second' else 0.0
        t = first + (np.arange(STRETCHES) + 0.5) * n * evidence.dt / STRETCHES
        return View('grid', t, pull, float(np.mean(pull**2)), float(np.sqrt(2 / STRETCHES)), 's')

    def find(self, evidence: Evidence) -> Finding | None:
        """Find the step in the levels; it is an effect from half a standard deviation on."""
        kept = evidence.kept(self.name)
        step, sigma = float(kept['step']), float(kept['sigma'])
        if not step > 0:
            return None
        # where noise is less than half a step what the samples show is the crossing of levels,
        # which the white noise of the fit takes as it is
        white = float(not coarse(step, sigma))
        return Finding(
            self.name,
            told_by_grid(kept, evidence.n),
            self.with_values(step=step, white=white),
            {'step': Estimate(step, 0.0, (step, step)), 'white': Estimate(white, None, None)},
            view='grid',
            evidence=f'{int(kept["levels"])} levels, step {step / max(sigma, 1e-300):.2g} '
            'standard deviations',
        )

    def psd(self, f: np.ndarray, dt: float) -> np.ndarray:
        """step^2 dt/6, one-sided."""
        return np.full(np.shape(f), self['white'] * self['step'] ** 2 * dt / 6)

    def avar(self, m: np.ndarray, dt: float) -> np.ndarray:
        """step^2/(12 m)."""
        return self['white'] * self['step'] ** 2 / 12 / np.asarray(m)

    def apply(self, x: np.ndarray, inputs: Inputs, rng: np.random.Generator) -> np.ndarray:
        """Round to the step."""
        return self['step'] * np.round(x / self['step'])

    @classmethod
    def example(cls) -> Effect:
        """Return a resolution of 0.05 deg/s (8.7e-4 rad/s)."""
        return cls({'step': 8.7e-4, 'white': 1.0})
