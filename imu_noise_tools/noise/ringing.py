# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Damped rings in the samples of an axis: e^(-t/tau) (a cos w t + b sin w t) from a moment on.

Knocks at one mount ring at one frequency and die out alike: frequency and time constant are
shared, moments and amplitudes are each one's own. In white noise of variance 1 the two columns of
a ring gain 1/2 b' G^-1 b nats, b the sums over them and G their products, exponentially
distributed where there is none (the matched filter: Turin, IRE Trans. IT-6, 1960); a filter of one
pole gives b for all moments at once. Which frequencies and time constants are worth that, frames
of several lengths say, each a factor of two apart.

What is tried is paid for: with tau in samples, n/tau moments, pi tau frequencies and the number of
lengths are told apart. A first knock pays for all of it, others for their moments.

"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.fft import dct, dst, idct, next_fast_len, rfft
from scipy.linalg.lapack import ztbtrs
from scipy.ndimage import maximum_filter1d
from scipy.optimize import minimize
from scipy.special import ndtr

from .smooth import reference_spectrum
from ..core.spectrum import cosine_transform
from ..core.statistics import median_sigma

ROWS = 1 << 16  # samples of frames that are transformed at a time
PIECE = 1 << 19  # samples that are whitened together
LONG = 1 << 19  # samples of a record: frames of a longer one do not overlap
SHORTEST_S, LONGEST_S = 0.005, 1.0  # s: time constants that are looked for
SHORTEST = 4  # samples: no time constant is shorter
FRAME = 3  # time constants in a frame: of that length it hears most of a ring
FRAMES = 64  # frames in a record, at least: no frame is longer
# periods in a time constant, at least: what swings less is a step or a spike as well
SWINGS = 1.0
# so few periods do where there are so many knocks alike
HARDLY, ALIKE = 0.3, 3
# a search that ends within 1 % of SWINGS has ended at it
ENDS = 0.99
HIGHEST = 0.45  # of the sample rate: above, hardly more than every second swing is seen
HUMP = 3.0  # times the amplitude that an octave around has: something sounds there all along
HOLLOW = 0.5  # times the amplitude that an octave around has: there a filter takes something out
MEDIAN = 1 << 12  # moments at most, whose median tells what is usual in a stretch
LOUDLY = 3.0  # standard deviations of that median: of more it is no white noise
LOUDER = 1.25  # times as loud as usual: a stretch that is less so counts as usual
STRETCHES = 24  # of the record, in which loudness and the usual power are told
SEEDS = 5  # frequencies and time constants at most, from which a search begins
FAINT = 5.0  # nats below what all cells of a length cost: cells down to there may be a seed
WIDER = float(np.log(2))  # by which ln tau may move from that of the frame where it was found
KNOWN = 8  # moments at most, from which a frequency and a time constant are refined
MOST = 0.05  # of the record: what rings for more of it is no knock (a choice)
# passes at most, and times the nats of the last one that the next must reach to go on
PASSES, MORE = 4, 1.1
SINGLE = 4.0  # standard deviations: a sample farther out may be one that stands for itself
# a ring must gain what the single samples around it have; of so many and more, this share
FEW, NEARLY = 7, 0.9
# times the nats of the single samples around knocks: a record with more of them in all has knocks
# by chance, and those are kept that gain so many times what theirs have (a choice)
MANY = 2.0
KINDS = 3  # of knocks (frequency, time constant) in a record, at most
BETWEEN = 3.0  # nats more that a frequency and a time constant cost: cells that touch are searched
# times the nats that a moment costs: knocks whose median gains less may be chance, and count as
# longer where it is asked how much of the record rings
CLEARLY = 2.0
AGAIN = 3.0  # nats beyond its moment that each knock but the first must gain
# nats: what is beyond is the tail of chance, which is looked at where so many values are
UNEVEN, TOLD = 3.0, 20
BESIDE = 10  # frequencies of a frame on each side that tell that tail
APART = 3.0  # time constants between two knocks, at least
BEFORE, BEHIND = 3, 5  # time constants around a knock in which it has to explain what stands out
EXPLAINS = 0.7  # of the nats that stand out there: a knock must gain more (a choice)
SWELLS = 2.0  # times what its mirror image gains before it: a knock must gain more (a choice)


def _swings(omega, tau):
    """Return how often what rings swings in its time constant, where a search ends counted in."""
    return omega * tau / (ENDS * 2 * np.pi)


class Rings(NamedTuple):
    """
    Knocks (k,) of an axis.

    ``begin`` is the first sample of each, ``cos`` and ``sin`` are its amplitudes, ``nats`` its
    gain and ``worth`` what of it is beyond chance; ``omega`` (rad) and ``tau`` are in samples.

    """

    begin: np.ndarray
    cos: np.ndarray
    sin: np.ndarray
    omega: np.ndarray
    tau: np.ndarray
    nats: np.ndarray
    worth: np.ndarray

    @property
    def swings(self) -> np.ndarray:
        """How often each swings in its time constant, (k,)."""
        return _swings(self.omega, self.tau)

    def of(self, some: np.ndarray) -> Rings:
        """Return those that are chosen."""
        return Rings(*(x[some] for x in self))

    def mean(self, n: int) -> Iterator[tuple[slice, np.ndarray]]:
        """Return where each of them is in n samples, and what it adds there."""
        for begin, a, b, omega, tau in zip(self.begin.astype(int), *self[1:5]):
            columns = _columns(min(n - begin, _length(tau)), omega, tau)
            yield slice(begin, begin + len(columns)), columns @ (a, b)

    def out_of(self, y: np.ndarray, step: float = 0.0) -> np.ndarray:
        """Return samples (n,) without them; those of a grid stay on it where it has a step."""
        y = np.array(y, float)
        for at, mean in self.mean(len(y)):
            y[at] -= step * np.round(mean / step) if step > 0 else mean
        return y


NONE = Rings(*np.zeros((7, 0)))


def find_rings(y: np.ndarray, dt: float, least: float, joined: bool = False) -> Rings:
    """
    Return the knocks in samples y (n,), of which those that ring alike are worth ``least`` nats.

    None of those that a filter takes out where samples are ``joined`` by lines, which bend there
    as behind no filter. Looked for again where there are any: the spectrum by which samples are
    whitened must not hold them, and strong ones are in it until they are out of it.

    """
    if not _lengths(len(y), dt) or not np.ptp(y) > 0:
        return NONE
    found, total = NONE, 0.0
    for _ in range(PASSES):
        white = _White.of(y, found.out_of(y) if len(found.begin) else y)
        found = _found(white, dt, least, judged=False)
        if float(np.sum(found.nats)) <= MORE * total:
            break
        total = float(np.sum(found.nats))
    if not len(found.begin):
        return NONE
    white = _White.of(y, found.out_of(y))
    found = _found(white, dt, least)
    amplitude = np.array([white.beside(x) for x in found.omega])
    # mirrored at its ends, a wave that is there all along has a kink
    ends = (found.begin < found.tau) | (found.begin > len(y) - FRAME * found.tau)
    return found.of(~(joined & (amplitude < HOLLOW) | ends & (amplitude > HUMP)))


class _White(NamedTuple):
    """
    Whitened samples (n,) and what of: pieces of a length, the root of the spectrum of one.

    ``loud`` are the factors by which stretches of the record were divided beyond that.

    """

    w: np.ndarray
    length: int
    spectrum: np.ndarray
    loud: np.ndarray
    known: dict[int, tuple[np.ndarray, np.ndarray]]     # of pieces, sums and products of steps

    @classmethod
    def of(cls, y: np.ndarray, reference: np.ndarray) -> _White:
        """
        Whiten samples by the spectrum of others, in pieces as long as a transform likes.

        The last overlaps the one before: knocks are likeliest at the ends of a record. The
        spectrum is that of the piece in the middle; where it is louder the samples tell.

        """
        length = len(y) // -(-len(y) // PIECE)
        while next_fast_len(length, real=True) > length:
            length -= 1
        count = len(y) // length
        middle = slice(count // 2 * length, (count // 2 + 1) * length)
        # in samples: variance over 2 dt of a one-sided density
        root = np.sqrt(reference_spectrum(cosine_transform(reference[middle]), 0.5))
        w = np.empty(len(y), np.float32)
        for i in np.minimum(np.arange(0, len(y), length), len(y) - length):
            c = cosine_transform(y[i:i + length])
            c[0] = 0.0
            c[1:] /= root
            w[i:i + length] = idct(c, type=2, norm='ortho', overwrite_x=True)
        parts = np.array_split(w, STRETCHES)
        loud = np.array([median_sigma(x[::len(x) // 2048 + 1]) for x in parts])
        loud /= np.median(loud[count // 2 * STRETCHES // count:][:-(-STRETCHES // count)])
        loud = loudest(loud)
        loud[loud < LOUDER] = 1.0
        for part, factor in zip(parts, loud):
            part /= factor
        return cls(w, length, root, loud, {})

    def root(self, i: int, omega: float) -> float:
        """Return by what the samples around i were divided at a frequency."""
        k = min(int(omega / np.pi * self.length), len(self.spectrum)) - 1
        return float(self.spectrum[k] * self.loud[i * STRETCHES // len(self.w)])

    def beside(self, omega: float) -> float:
        """Return the amplitude at a frequency in all of the record, over an octave's around."""
        k = int(omega / np.pi * self.length)
        return float(self.spectrum[min(k, len(self.spectrum)) - 1]
                     / np.median(self.spectrum[k // 2:2 * k]))

    def steps(self, begin: int, tau: float) -> float:
        """
        Return the nats of the best pair of steps near a moment, or of two if they have more.

        A step is whitened by what its cosines are divided by: from sample t on it has coefficients
        -a_k sin(pi k t/n), a_k = (2 n)^(-1/2)/sin(pi k/2n), and two of them have the product
        1/2 sum a_k^2 (cos(pi k (t - s)/n) - cos(pi k (t + s)/n)).

        """
        n = self.length
        piece = min(begin // n * n, len(self.w) - n)    # where it begins
        if piece not in self.known:
            k = np.arange(1, n)
            a = np.sqrt(0.5 / n) / np.sin(0.5 * np.pi * k / n) / self.spectrum
            c = cosine_transform(np.array(self.w[piece:piece + n], float))[1:]
            self.known[piece] = (np.append(0.0, 0.5 * dst(-a * c, type=1)),
                                 0.5 * dct(np.concatenate([[0.0], a * a, [0.0]]), type=1))
        sums, products = self.known[piece]

        def grid(first: float, last: float, most: int) -> np.ndarray:
            some = np.linspace(first, last, min(most, int(last - first) + 1))
            at = np.unique(np.round(begin - piece + some).astype(int))
            return at[(at > 0) & (at < n)]

        def product(t, s):
            both = t + s
            return 0.5 * (products[np.abs(t - s)] - products[np.minimum(both, 2 * n - both)])

        at = np.union1d(grid(-tau, 2 * tau, 96), grid(-tau, BEHIND * tau, 192))
        if len(at) < 2:
            return 0.0
        x, p = sums[at], product(at[:, None], at)
        one, x, p = _best_pair(x, p)
        return max(one, one + _best_pair(x, p)[0] - 2 * AGAIN)


def _best_pair(x: np.ndarray, p: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """
    Return the nats of the best two of columns, and what is left of sums and products without.

    ``x`` (k,) are the columns' sums over the samples, ``p`` (k, k) their products.

    """
    size = np.diag(p)
    alone = size > 1e-3 * np.max(size)      # others are in those that were taken
    size = np.where(alone, size, np.inf)
    det = 1 - p**2 / np.outer(size, size)
    z = x / np.sqrt(size)
    told = det > 1e-3
    nats = (z**2 + z[:, None] ** 2 - 2 * p / np.sqrt(np.outer(size, size)) * np.outer(z, z)) / \
        np.where(told, det, np.inf)
    i, j = np.unravel_index(np.argmax(nats), nats.shape)
    best = np.array([i, j] if nats[i, j] > np.max(z**2) else [np.argmax(z**2)])
    solved = np.linalg.solve(p[np.ix_(best, best)], np.column_stack([x[best], p[best]]))
    return (0.5 * float(x[best] @ solved[:, 0]), x - p[:, best] @ solved[:, 0],
            p - p[:, best] @ solved[:, 1:])


def _length(tau: float) -> int:
    """Return how many samples a ring of a time constant is followed."""
    return int(8 * tau) + 4


def _columns(length: int, omega: float, tau: float) -> np.ndarray:
    """Return what a ring adds for each of its amplitudes, (length, 2)."""
    t = np.arange(length)
    return np.exp(-t / tau)[:, None] * np.column_stack([np.cos(omega * t), np.sin(omega * t)])


def _both(z: np.ndarray, q: float, p: np.ndarray | complex) -> np.ndarray:
    """
    Return the nats of both columns, z = sum w e^(-t/tau - i omega t).

    With q = sum e^(-2t/tau) and p = sum e^(-2t/tau - 2 i omega t) this is 1/2 b' G^-1 b.

    """
    cross = p.real * (z.real**2 - z.imag**2) + 2 * p.imag * z.real * z.imag
    return (q * (z.real**2 + z.imag**2) - cross) / (q * q - np.abs(p) ** 2)


def _lengths(n: int, dt: float) -> list[int]:
    """Return the frames (samples) in which rings are looked for."""
    shortest = FRAME * max(SHORTEST, SHORTEST_S / dt)
    longest = min(FRAME * LONGEST_S / dt, n / FRAMES)
    powers = range(int(np.ceil(np.log2(shortest))), int(np.log2(max(longest, 1.0)) + 0.5) + 1)
    return [1 << j for j in powers]


def _cost(n: int, tau: float, lengths: list[int]) -> tuple[float, float]:
    """Return the nats that a moment costs, and a frequency and a time constant."""
    return float(np.log(n / tau)), float(np.log(len(lengths) * np.pi * tau)) + BETWEEN


def _usual(power: np.ndarray, step: int = 1) -> np.ndarray:
    """
    Return the usual power (stretches, ...) of moments (m, ...), in what noise has on average.

    The louder of neighbours where it changes, and that of white noise where it may be that: the
    median of k has a relative standard deviation of 1/(ln 2 sqrt(k)).

    """
    parts = np.array_split(power, int(np.clip(len(power) // step // 64, 1, STRETCHES)))
    out = np.array([np.median(x[::max(step, len(x) // MEDIAN)], axis=0)
                    for x in parts]) / np.log(2)
    if len(out) > 2:
        out = loudest(out)
    few = max(1, min(len(parts[0]) // step, MEDIAN))
    return np.where(out > 1 + LOUDLY / (np.log(2) * np.sqrt(few)), out, 1.0)


def _over_usual(power: np.ndarray, step: int = 1) -> np.ndarray:
    """Divide the power of moments (m, ...) by what is usual, in place."""
    usual = _usual(power, step)
    for part, level in zip(np.array_split(power, len(usual)), usual):
        part /= level
    return power


def _power(w: np.ndarray, length: int, fewest: float = SWINGS) -> tuple[np.ndarray, int, int]:
    """
    Return the nats (frames, frequencies) of swings in frames, their distance, the first frequency.

    In units of 1/length; a frequency that the frame holds whole times has columns that are
    orthogonal.

    """
    first, last = int(np.ceil(fewest * FRAME)), int(HIGHEST * length)
    hop = length if len(w) > LONG else length // 2
    frames = sliding_window_view(w, length)[::hop]
    out, rows = np.empty((len(frames), last + 1 - first), np.float32), max(1, ROWS // length)
    for i in range(0, len(frames), rows):
        z = rfft(frames[i:i + rows], axis=1)[:, first:last + 1]
        np.square(z.real, out=out[i:i + rows])
        out[i:i + rows] += np.square(z.imag)
    out /= length
    return out, hop, first


class _Seed(NamedTuple):
    """Where a search begins: nats, time constant, frequency (in samples), and first samples."""

    nats: float
    tau: float
    omega: float
    at: np.ndarray


def _seeds(w: np.ndarray, lengths: list[int], fewest: float) -> list[_Seed]:
    """Return the places that stand out most, each as a frequency at several moments."""
    found = []
    for length in lengths:
        tau = length / FRAME
        power, hop, first = _power(w, length, fewest)
        power = _over_usual(power)
        row, k = np.nonzero(power > max(6.0, np.log(power.size) - FAINT))
        nats = power[row, k]
        best = np.argsort(-nats)
        row, k, nats = row[best], k[best], nats[best]
        # what all moments of a frequency have together
        over = np.maximum(nats - np.log(len(w) / tau), 0.0)
        together = np.bincount(k, over, minlength=power.shape[1])
        loud = [int(j) for j in np.argsort(-together)[:2] if together[j] > 0]
        for j, size in [*zip(k[:SEEDS], nats), *((j, together[j] + np.log(len(w) / tau))
                                                 for j in loud)]:
            at: list[int] = []
            for i in row[np.abs(k - j) <= 1][:KNOWN**2] * hop:
                if len(at) < KNOWN and all(abs(i - other) > 2 * APART * tau for other in at):
                    at.append(int(i))
            omega = 2 * np.pi * (j + first) / length
            found.append(_Seed(float(size), tau, omega, np.array(at)))
    out: list[_Seed] = []
    for s in sorted(found, key=lambda s: -s.nats):
        if all(abs(s.omega - o.omega) * min(s.tau, o.tau) > 0.7
               or max(s.tau, o.tau) > 2.1 * min(s.tau, o.tau) for o in out):
            out.append(s)
    return out[:SEEDS]


def _nats(w: np.ndarray, omega: float, tau: float, most: int) -> np.ndarray:
    """Return the nats of rings that begin at the first ``most`` samples of w (..., n)."""
    pole = np.exp(-1 / tau - 1j * omega)
    # z_i = w_i + pole z_i+1 as two diagonals: a filter takes half a second to load
    diagonals = np.empty((2, w.shape[-1]), complex, order='F')
    diagonals[:] = [[-pole], [1.0]]
    z = ztbtrs(diagonals, w.T.astype(complex), uplo='U')[0].T
    return _both(z[..., :most], 1 / (1 - np.exp(-2 / tau)), 1 / (1 - pole * pole))


def _refined(w: np.ndarray, seed: _Seed, lengths: list[int],
             fewest: float) -> tuple[float, float, float]:
    """Return (worth in nats, frequency, time constant), the best near a seed."""
    # a ring may begin half a frame before it, or in it
    begins, length = int(1.5 * FRAME * seed.tau) + 1, int((1.5 * FRAME + BEHIND) * seed.tau) + 8
    begin = np.clip(seed.at - int(0.5 * FRAME * seed.tau), 0, max(0, len(w) - length))
    some = np.array([w[i:i + length] for i in begin])
    low, high = max(SHORTEST, lengths[0] / FRAME / 1.5), 1.5 * lengths[-1] / FRAME

    def at(x):
        return seed.omega + x[0] / seed.tau, seed.tau * np.exp(np.clip(x[1], -WIDER, WIDER))

    def lost(x):
        omega, tau = at(x)
        rings = _swings(omega, tau) > fewest and omega < 2 * np.pi * HIGHEST
        if not rings or not low <= tau <= high:
            return 0.0
        nats = np.sort(np.max(_nats(some, omega, tau, begins), axis=1))
        moment, form = _cost(len(w), tau, lengths)
        return form + moment - nats[-1] - np.sum(np.maximum(nats[:-1] - moment - AGAIN, 0.0))

    best = minimize(lost, [0.0, 0.0], method='Nelder-Mead', options={
        'initial_simplex': [[0, 0], [0.6, 0], [0, 0.5]], 'maxfev': 40, 'xatol': 0.02,
        'fatol': 0.02})
    return (-float(best.fun), *at(best.x))


def _throughout(w: np.ndarray, omega: float,
                tau: float) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Yield (first sample, nats, those beside what is usual) of rings that begin in a piece."""
    halo, step = _length(tau), max(1, int(tau / 2))
    for i in range(0, len(w), PIECE):
        nats = _nats(w[i:i + PIECE + halo], omega, tau, PIECE)
        yield i, nats, _over_usual(nats.copy(), step)


def _moments(w: np.ndarray, omega: float, tau: float,
             least: float) -> list[tuple[int, float, float]]:
    """
    Return the samples at which a ring begins that gains so much, the clearest first.

    With what it gains beside what such rings usually gain there, and that in what they gain of
    white noise.

    """
    found: list[tuple[float, int, float]] = []
    for i, raw, nats in _throughout(w, omega, tau):
        top = nats == maximum_filter1d(nats, 2 * int(APART * tau) + 1)
        k = np.flatnonzero(top & (nats > least))
        found += zip(-nats[k], k + i, raw[k] / nats[k])
    return [(int(at), -float(less), float(usual)) for less, at, usual in sorted(found)]


def _found(white: _White, dt: float, least: float, judged: bool = True) -> Rings:
    """
    Return the knocks in whitened samples, in units of the samples that they were.

    Where they are not ``judged``, whatever rings is one, unless it does so too long or too often.

    """
    w, lengths = white.w.copy(), _lengths(len(white.w), dt)
    out = NONE
    for _ in range(KINDS if lengths else 0):
        found = _best(w, lengths, SWINGS)
        rings = NONE
        ended = found[0] < least or _swings(*found[1:]) < (2 - ENDS) / ENDS * SWINGS
        if ended and _scattered(w) > least:     # the first samples of each stand out
            rings = _alike(white, w, max(found[0], least), dt, judged)
        if not len(rings.begin):
            if found[0] < least:
                break
            rings = _of_a_kind(white, w, found, dt, judged)
        if np.sum(rings.worth) >= least:
            out = Rings(*(np.concatenate(x) for x in zip(out, rings)))
    return out.of(np.argsort(out.begin))


def _best(w: np.ndarray, lengths: list[int], fewest: float) -> tuple[float, float, float]:
    """Return (worth in nats, frequency, time constant) of what rings clearest."""
    return max((_refined(w, seed, lengths, fewest) for seed in _seeds(w, lengths, fewest)),
               default=(0.0, 0.0, 0.0))


def _alike(white: _White, w: np.ndarray, more: float, dt: float, judged: bool) -> Rings:
    """
    Take several alike that hardly swing out of whitened samples w, where they are worth ``more``.

    That is more than the best that swings.

    """
    found, rest = _best(w, _lengths(len(w), dt), HARDLY), w.copy()
    if found[0] < more or _swings(*found[1:]) > SWINGS:
        return NONE
    rings = _of_a_kind(white, rest, found, dt, judged)
    if len(rings.begin) < ALIKE:
        return NONE
    w[:] = rest
    return rings


def _of_a_kind(white: _White, w: np.ndarray, found: tuple[float, float, float], dt: float,
               judged: bool) -> Rings:
    """Take what rings as was found out of whitened samples w; return what of it are knocks."""
    _, omega, tau = found
    lengths, hardly = _lengths(len(w), dt), _swings(omega, tau) < SWINGS
    moment, form = _cost(len(w), tau, lengths)
    moments = _moments(w, omega, tau, moment + AGAIN)
    # what lingers here and there gains little each time; knocks that are clear may be more
    faint = np.median([x for _, x, _ in moments] or [0.0]) < CLEARLY * (moment + AGAIN)
    time = tau * (APART if faint else 1.0)
    if tau * dt > LONGEST_S or _many(moments) * time > MOST * len(w):
        for i, _, _ in moments:
            w[_around(i, tau)] = 0.0
        return NONE
    rings, single = _knocks(white, w, omega, tau, moments, moment + AGAIN, judged)
    if judged and _scattered(white.w) > MANY * np.sum(single):
        # among so many single samples some look like anything
        rings = rings.of((single < rings.nats / MANY) & (not hardly))
    if judged and len(rings.begin):
        rings = _beyond(rings, _tail(w, omega, tau, lengths))
    if not len(rings.begin):
        return NONE
    rings.worth[np.argmax(rings.nats)] += AGAIN - form
    return rings


def _many(moments: Iterable[tuple[int, float, float]]) -> float:
    """
    Return how many moments there are, as many as would all gain alike: (sum x)^2/sum x^2.

    Beside knocks one that chance has made counts next to nothing, of a swing that goes on all the
    time nearly one. The time of a ring is, counted so, its time constant: (tau/2)^2/(tau/4).

    """
    nats = np.array([gained for _, gained, _ in moments])
    return float(np.sum(nats) ** 2 / np.sum(nats**2)) if len(nats) else 0.0


class Tail(NamedTuple):
    """
    Chance, by several accounts (t,): what goes beyond a threshold e^-cost of the time, by a mean.

    None of them where it is that of chi-squared with two degrees of freedom, e^-x.

    """

    threshold: np.ndarray
    cost: np.ndarray
    mean: np.ndarray

    def beyond(self, nats: np.ndarray) -> np.ndarray:
        """Return by how much nats (k,) are less than they seem, those of normal noise by none."""
        x = np.asarray(nats)[..., None]
        return np.max(x - self.cost - (x - self.threshold) / self.mean, axis=-1, initial=0.0)


def tail_of(nats: np.ndarray) -> Tail:
    """
    Return the tail of nats (k,), where it is longer than by chance.

    It is where the level of noise wanders: a little and again and again, which all beyond a
    threshold tell together, or seldom and far (Pickands, Annals of Statistics 3, 1975), which the
    few tell that go farthest.

    """
    found = []
    some = nats[nats > UNEVEN]
    for top in (some, np.sort(some)[-TOLD - 1:]):
        if len(top) < TOLD:
            continue
        threshold = UNEVEN if top is some else float(top[0])
        top = top[top > threshold]
        mean = float(np.mean(top - threshold)) if len(top) else 0.0
        if mean > 1 + 2 / np.sqrt(max(len(top), 1)):
            found.append((threshold, np.log(len(nats) / len(top)), mean))
    return Tail(*np.reshape(found, (-1, 3)).T)


def _tail(w: np.ndarray, omega: float, tau: float, lengths: list[int]) -> Tail:
    """
    Return the tail of what swings of whitened noise gain at a frequency, and around it.

    Normal noise of whatever spectrum has the same at all frequencies. A line that wanders is now
    here and now there, and in the time of a ring it hardly moves.

    """
    # rings a time constant apart are independent
    here = tail_of(np.concatenate([x[::max(1, int(tau))]
                                   for _, _, x in _throughout(w, omega, tau)]))
    length = min(lengths, key=lambda x: abs(np.log(x / (FRAME * tau))))
    power, _, first = _power(w, length, SWINGS if omega * tau > np.pi * SWINGS else HARDLY)
    k = int(round(omega / (2 * np.pi) * length)) - first
    around = tail_of(_over_usual(power[:, max(0, k - BESIDE):k + BESIDE + 1]).ravel())
    return Tail(*(np.append(x, y) for x, y in zip(here, around)))


def _beyond(rings: Rings, tail: Tail) -> Rings:
    """Return the rings that are worth something beside noise of that tail, and what."""
    rings = rings._replace(worth=rings.worth - tail.beyond(rings.nats))
    return rings.of(rings.worth > 0)


def _knocks(white: _White, w: np.ndarray, omega: float, tau: float,
            moments: Iterable[tuple[int, float, float]], least: float,
            judged: bool) -> tuple[Rings, np.ndarray]:
    """
    Take what rings at some moments out of whitened samples w, the clearest first.

    Return those that are knocks (k,), worth what they gain beyond ``least``, and the nats of
    single samples around each.

    """
    out, single = [], []
    for i, _, usual in moments:
        columns = _columns(min(len(w) - i, _length(tau)), omega, tau)
        size, nats = _fitted(columns, w[i:i + len(columns)])
        if nats < usual * least:    # it was part of one that is out by now
            continue
        alone = _single(w[_around(i, tau)])
        apart = np.sum(alone) * (1.0 if len(alone) < FEW else NEARLY)
        if judged and (nats < apart or nats < _rivals(
                white, w, i, omega, tau, columns, nats, usual * least)):
            w[_around(i, tau)] = 0.0
            continue
        beside = nats / usual
        out.append((i, *(size * white.root(i, omega)), omega, tau, beside, beside - least))
        single.append(np.sum(alone))
        w[i:i + len(columns)] -= columns @ size
    return Rings(*np.reshape(out, (-1, 7)).T), np.array(single)


def _around(begin: int, tau: float) -> slice:
    """Return the samples around a moment in which a knock has to explain what stands out."""
    return slice(max(0, begin - int(BEFORE * tau)), begin + int(BEHIND * tau) + 1)


def _beside(w: np.ndarray, at: slice) -> tuple[float, int]:
    """
    Return the variance of whitened samples beside a stretch, of which single ones do not count.

    The spectrum by which they were whitened is that of all the record: where the stretch is, noise
    may be louder or less so. And of how many samples it is: of many, for what is louder for a
    while stands out as well. What is louder before the stretch than behind it may go on in it.

    """
    def power(side: np.ndarray) -> float:
        return float(np.mean(np.minimum(side**2, SINGLE**2)))

    width = max(len(w) // STRETCHES, at.stop - at.start)
    before, behind = w[max(0, at.start - width):at.start], w[at.stop:at.stop + width]
    beside = np.append(before, behind)
    if not len(beside):
        return 1.0, 1
    if len(before) > 0.5 * len(behind) and power(before) > power(beside):
        beside = before
    return power(beside), len(beside)


def _single(w: np.ndarray) -> np.ndarray:
    """Return the nats of whitened samples that may each stand for itself."""
    return 0.5 * w[np.abs(w) > SINGLE] ** 2 - AGAIN


def _scattered(w: np.ndarray) -> float:
    """
    Return the nats of single samples of a record, whitened, beyond what normal noise has.

    Of n normal samples 2 Q(s) n are beyond s = SINGLE, and have (s phi(s) + Q(s) - 2 AGAIN Q(s)) n
    nats: those of a long record have more than knocks. Each stretch counts by its level, or by
    that of a louder one beside it, for it may begin there.

    """
    parts = np.array_split(w, STRETCHES)
    levels = np.maximum(loudest(np.array([median_sigma(x) for x in parts])), 1 / LOUDER)
    beyond = float(ndtr(-SINGLE))
    by_chance = SINGLE * np.exp(-0.5 * SINGLE**2) / np.sqrt(2 * np.pi) + (1 - 2 * AGAIN) * beyond
    return float(sum(np.sum(_single(x / s)) for x, s in zip(parts, levels))) - by_chance * len(w)


def loudest(levels: np.ndarray) -> np.ndarray:
    """Return of the levels (s, ...) of stretches the largest of each and of those beside it."""
    return np.max([levels, np.roll(levels, 1, axis=0), np.roll(levels, -1, axis=0)], axis=0)


def _fitted(columns: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the amplitudes (2,) of columns (m, 2) in whitened samples, and what they gain."""
    size = np.linalg.lstsq(columns, w, rcond=None)[0]
    return size, 0.5 * float(size @ columns.T @ w)


def _rivals(white: _White, w: np.ndarray, begin: int, omega: float, tau: float,
            columns: np.ndarray, nats: float, least: float) -> float:
    """
    Return the nats that a ring must have to be the best name for what stands out there.

    As many times ``least`` as noise is louder there than usual, the ring taken out of it. Most
    of what stands out around it, in samples w; more than what swells before it as it fades behind
    it, as of a line that passes; and more than two steps or four have, as of what switches. What
    hardly swings and is there from the beginning may as well creep: nothing is before it. Nor is
    what is heard at an end alone where a filter lets nothing pass: mirrored there, a record has
    that frequency all the same.

    """
    early = begin < max(SHORTEST, 0.1 * tau) and omega * tau < 2 * np.pi
    if early or min(begin, len(w) - begin) < 2 * tau and white.beside(omega) < HOLLOW:
        return np.inf
    at = _around(begin, tau)
    level, count = _beside(w, at)
    some = w[at]
    stands = 0.5 * float(np.sum(some**2 - level)) - 2 * level * np.sqrt(
        0.5 * len(some) * (1 + len(some) / count))
    before = w[max(0, begin - len(columns)):begin][::-1]
    swells = _fitted(columns[:len(before)], before)[1] if len(before) > SHORTEST else 0.0
    left = (float(np.sum(some**2)) - 2 * nats) / len(some)
    least = max(left * least, EXPLAINS * stands, SWELLS * swells)
    return max(least, white.steps(begin, tau)) if nats > least else least
