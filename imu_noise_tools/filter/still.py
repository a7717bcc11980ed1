# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Whether noise goes on where the motion stops, or where it cannot be.

From the rate alone a motion that goes on all the time, a car on its springs, is the same as noise
of the sensor with its correlation: whichever is in the model takes all of it, and where that is
the noise the filter takes the motion away. They are told apart where the motion stops for a while
and the noise does not; and white noise is as strong at the highest frequencies, where no motion
comes to.

"""

from __future__ import annotations

from typing import cast

import numpy as np

from .statespace import Block, FilterEffect, output_noise, OutputNoise, white_of
from ..core.spectrum import cosine_transform
from ..loop.effect import Model
from ..loop.verdict import HEALED

LAG = 1 - np.exp(-1.0)      # share of its variance by which noise has changed over the lag
LONG = 8        # lags of a stretch
FEWEST = 16     # stretches, of which some may be at rest
FEW = 0.1       # of them at rest, and of them in motion, at least (a choice)
# in a third of those at rest, and in all, of what noise changes by: less and it is not there, more
# and nothing rests; alone it changes by 0.32 at least, and 0.9 at most, in 1600 records
LEAST, STILL = 0.3, 1.3
FASTEST = 0.9   # of Nyquist, from which on there is noise alone
MOVING = 4.0    # times as much changes in motion; alone it does 1.9 times at most


def is_coloured(effect: FilterEffect) -> bool:
    """Tell whether it is noise with a memory, and no line."""
    block = effect.block(1.0) if isinstance(effect, OutputNoise) else None
    return block is not None and len(block.h) > 0 and not effect.line


def outlasts_motion(z: np.ndarray, dt: float, model: Model, label: str) -> bool:
    """
    Tell whether noise of a model is all that changes at some times, and little of it at others.

    By the mean square of differences over a lag, in stretches, over what the noise of the model
    makes of them: about 1 at rest.

    Parameters
    ----------
    z : ndarray (n,)
        Rate as measured, NaN where it is missing.
    dt : float
        Interval, s.
    model : Model
        With values, that of the noise among them.
    label : str
        Of the noise in question, which :func:`is_coloured`.

    """
    lag = _lag(output_noise(Model([model[label]]), dt), len(z))
    change = _change(output_noise(model, dt), lag)
    square = (z[lag:] - z[:-lag]) ** 2
    count = len(square) // (LONG * lag)
    if count < FEWEST:
        return False
    square = square[:count * LONG * lag].reshape(count, LONG * lag)
    seen = np.isfinite(square).mean(axis=1) > 0.5
    if np.count_nonzero(seen) < FEWEST:
        return False
    mean = np.nanmean(square[seen], axis=1) / change
    least, still, most = np.quantile(mean, [FEW / 3, FEW, 1 - FEW])
    return bool(least > LEAST and still < STILL and most > MOVING)


def is_as_strong(z: np.ndarray, model: Model, label: str) -> bool:
    """
    Tell whether noise that is stronger than stated is so at the highest frequencies as well.

    Most of what is more must be there, less twice what chance moves it by. A weaker one takes no
    motion away.

    Parameters
    ----------
    z : ndarray (n,)
        Rate as measured.
    model : Model
        With values, that of the noise and of the white noise that it scales among them.
    label : str
        Of the effect that scales it.

    """
    white = white_of(model)
    more = cast(FilterEffect, model[label]).block(1.0).r_factor - 1
    if white is None or more <= 0:
        return True
    c = cosine_transform(z - np.mean(z))[int(FASTEST * len(z)):]
    level = float(np.mean(c**2)) / white.block(1.0).r
    return level * (1 + 2 * np.sqrt(2 / len(c))) - 1 > HEALED * more


def _lag(noise: Block, most: int) -> int:
    """Return over how many samples most of it has changed, half of ``most`` at most."""
    lag, whole = 1, 2 * float(noise.h @ noise.p0 @ noise.h)
    while lag < most // 2 and _change(noise, lag) < LAG * whole:
        lag += max(1, lag // 8)
    return lag


def _change(noise: Block, lag: int) -> float:
    """Return the mean square of what noise changes by over a lag."""
    later = np.linalg.matrix_power(noise.phi, lag)
    return float(2 * noise.r + 2 * noise.h @ (noise.p0 - later @ noise.p0) @ noise.h)
