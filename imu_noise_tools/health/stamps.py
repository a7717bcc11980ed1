# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The stamps of a record: what is wrong with them, their order, and the clock behind them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..core.clock import fit_clock, regular_rate, SELDOM
from ..core.record import ImuRecord, Memory
from ..core.statistics import FAR
from ..core.units import times

SWAPPED_S = 2.0         # messages overtake each other by no more, s
SCATTERED = 0.01        # share of stamps that fall from which on no clock is set back so often
FEW = 10                # nor so many, if fewer, where the stamps get on as if none were
REACH = 20.0            # times as far as usual a stamp that scatters falls at most
AHEAD_S = 1.0           # a step of stamps that is so much longer than that of the receive times, s
ROUGH = 0.01            # of an interval: stamps that scatter by less are as good as even ones
COMPARED = 1 << 20      # pairs far apart that tell how many are alike by chance
BESIDE = 20             # samples on either side, between which such a step has to stay


@dataclass(frozen=True)
class Stamps:
    """What is wrong with the stamps of a record."""

    not_finite: int
    repeated: int           # messages that came twice: same stamp, same data, and not by chance
    duplicate: int          # samples with the stamp of the one before
    backward: int           # stamps before that of the sample before
    swapped: bool           # sorting by stamp puts the backward ones right
    ahead: int              # forward jumps that the receive times do not have


def examine_stamps(record: ImuRecord) -> Stamps:
    """Count what is wrong with the stamps."""
    t = record.t[np.isfinite(record.t)]
    step = np.diff(t)
    repeated = len(_repeated(record))
    same = int(np.sum(np.diff(record.t) == 0))
    backward = int(np.sum(step < 0))
    return Stamps(record.n - len(t), repeated, same - repeated, backward,
                  backward > 0 and _swapped(t), len(_set_ahead(record)))


def _swapped(t: np.ndarray) -> bool:
    """Tell whether sorting puts stamps right: those of samples that overtook each other."""
    order = np.argsort(t, kind='stable')
    after = np.diff(t[order])
    later = after[after > 0]        # of a clock that begins anew again and again most are alike
    step = np.median(later) if len(later) else 0.0
    moved = np.max(np.abs(order - np.arange(len(t))))
    close = np.sum(after < 0.25 * step) > np.sum(np.diff(t) == 0)
    return bool(moved * step < SWAPPED_S and not close)


def _repeated(record: ImuRecord) -> np.ndarray:
    """
    Return the samples (k,) that are messages which came twice.

    They have stamp and data of the one before. Where a stamp is held, two samples at rest may be
    alike by chance in all that is resolved, as often as two that are far apart: nothing came
    twice unless most of them did, and more than chance scatters by.

    """
    same = np.flatnonzero(np.diff(record.t) == 0)
    alike = same[_equal(record, same, same + 1)] + 1
    if not len(alike):
        return alike
    pairs = (np.arange(min(record.n - k, COMPARED)) for k in FAR if k < record.n)
    share = max((float(np.mean(_equal(record, at, at + k))) for at, k in zip(pairs, FAR)),
                default=0.0)
    chance = share * len(same)
    twice = len(alike) - chance         # times one over 1 - share: chance makes them alike, too
    return alike if twice > (1 - share) * max(0.5 * len(alike), 3 * chance ** 0.5) else alike[:0]


def _equal(record: ImuRecord, one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return which of the samples (k,) equal others on all axes, (k,) bool."""
    equal = np.ones(len(one), bool)
    for data in record.data:
        for k in range(3):
            x = np.asarray(data[:, k])
            equal &= (x[one] == x[other]) | (np.isnan(x[one]) & np.isnan(x[other]))
    return equal


def ordered(record: ImuRecord, memory: Memory | None = None) -> ImuRecord:
    """
    Return the record with stamps that never fall, and no sample twice.

    Stamps that fall by less than half an interval are scatter of the clock, and held; so are those
    that fall further where many do. Samples that came in the wrong order are put right; where a
    clock was set back, what follows goes on from there. A repeated message is dropped; a stamp
    given to two different samples stays with both.

    """
    raw = record.t
    record = replace(record, t=_held(raw))
    found = examine_stamps(record)
    # those that were held are alike by that, and told as what they are
    held = int(np.sum((np.diff(record.t) == 0) & (np.diff(raw) != 0)))
    memory = memory or Memory()
    said = []
    back = int(np.sum(raw[1:] < raw[:-1]))
    if _often(raw) and not found.backward:
        said.append(f'{back} stamp(s) lie before the one before, by up to '
                    f'{1e3 * np.nanmax(record.t - raw):.3g} ms: they scatter, and the samples are '
                    'taken in the order in which they came')
    if found.not_finite:
        record = record.taken(np.isfinite(record.t), memory)
        said.append(f'{found.not_finite} sample(s) without a stamp were dropped')
    if found.backward and found.swapped:
        record = record.taken(np.argsort(record.t, kind='stable'), memory)
        said.append(f'{times(found.backward, "backward stamp")}: the samples were put in order')
    elif found.backward:
        record = replace(record, t=_going_on(record.t))
        said.append(
            f'{times(found.backward, "backward stamp")}: the clock was set back, later samples '
            'follow on'
        )
    leaps = _set_ahead(record)
    if len(leaps):
        record = replace(record, t=_as_received(record, leaps))
        said.append(f'the clock was set ahead {times(len(leaps))}, which the receive times do '
                    'not show: later samples follow on')
    if found.repeated:
        keep = np.ones(record.n, bool)
        keep[_repeated(record)] = False
        record = record.taken(keep, memory)
        said.append(f'{found.repeated} duplicate message(s) were dropped')
    if (duplicate := found.duplicate - held) > 0:
        said.append(
            f'{times(duplicate, "duplicate stamp")} with different data: the samples were kept'
        )
    return record.warned(*said)


def evenly_stamped(record: ImuRecord) -> ImuRecord | None:
    """
    Return the record with stamps on the clock behind them, or None where that changes nothing.

    A sensor samples evenly, and its driver stamps late; but one that is asked now and then samples
    when it is asked. Which of the two it is stamps do not tell.

    """
    t = record.t
    if record.n < 2 or not np.isfinite(t).all() or np.any(np.diff(t) < 0):
        return None
    clock = fit_clock(t)
    if clock is None or clock.jitter_s * clock.rate_hz < ROUGH:
        return None
    place = clock.place(record.n)
    return replace(record, t=float(np.median(t - place / clock.rate_hz)) + place / clock.rate_hz)


def _set_ahead(record: ImuRecord) -> np.ndarray:
    """
    Return the samples (k,) after which the clock of the stamps was set ahead.

    A gap takes as long for the receiver; what only comes late falls back by it later.

    """
    t, received = record.t, record.receive_t
    if received is None:
        return np.zeros(0, int)
    late = t - received
    leaps = np.flatnonzero(np.diff(late) > AHEAD_S)
    stays = [np.median(late[k + 1:k + 1 + BESIDE]) - np.median(late[max(k + 1 - BESIDE, 0):k + 1])
             > 0.5 * (late[k + 1] - late[k]) for k in leaps.tolist()]
    return leaps[np.array(stays, bool)]


def _as_received(record: ImuRecord, leaps: np.ndarray) -> np.ndarray:
    """Return stamps whose leaps are as many regular steps as the receive times say."""
    assert record.receive_t is not None
    t = record.t.copy()
    rate = regular_rate(t)
    if rate is None:
        return t
    for k in leaps.tolist():
        steps = max(1, round(float(record.receive_t[k + 1] - record.receive_t[k]) * rate))
        t[k + 1:] -= t[k + 1] - t[k] - steps / rate
    return t


def _held(t: np.ndarray) -> np.ndarray:
    """Return stamps in which those that fall by scatter stay as the highest before them."""
    step = np.diff(t)
    falls = -step[step < 0]
    if not len(falls):
        return t
    rate = regular_rate(t)
    reach = 0.5 / rate if rate else 0.0
    if _often(t) and not _swapped(t[np.isfinite(t)]):
        reach = max(reach, REACH * float(np.median(falls)))
    high = np.fmax.accumulate(t)
    return np.where(high - t < reach, high, t)


def _often(t: np.ndarray) -> bool:
    """Tell whether more of stamps t (n,), s, fall than where a clock is set back."""
    step = np.diff(t[np.isfinite(t)])
    falls = np.sum(step < 0)
    gets_on = np.sum(step) > 0.5 * np.sum(step[step > 0])   # runs that begin anew do not
    return bool(falls > SCATTERED * len(t) or gets_on and falls > max(SELDOM * len(t), FEW))


def _going_on(t: np.ndarray) -> np.ndarray:
    """
    Return stamps in which every backward step has become one regular step.

    A lone wrong stamp is mended.

    """
    t = t.copy()
    rate = regular_rate(t)
    dt = 1 / rate if rate else 0.0
    for k in np.flatnonzero(np.diff(t) < 0):
        if k + 1 < len(t) and t[k] > t[k + 1]:
            before = t[k - 1] if k else t[k] - dt
            if 0 < k and before < t[k + 1] and t[k + 1] - before < 3 * dt:
                t[k] = 0.5 * (before + t[k + 1])                    # this one alone ran ahead
            elif k + 2 < len(t) and 0 < t[k + 2] - t[k] < 3 * dt:
                t[k + 1] = 0.5 * (t[k] + t[k + 2])                  # the next one alone fell back
            else:
                t[k + 1:] += t[k] + dt - t[k + 1]
    return np.maximum.accumulate(t)
