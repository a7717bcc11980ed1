# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Count losses and read rates of stamps as drivers make them, against the truth.

Each pattern is the mechanism of a driver (a queue, a frame, a tick, a poll), not a formula of the
package. Per pattern and draw another rate (50 to 400 Hz unless the mechanism has its own), length
and clock error. Run as ``python bench/stamps.py [--draws 10] [--seed 1]``.

"""

from __future__ import annotations

import argparse

import numpy as np

from imu_noise_tools.core.record import ImuRecord
from imu_noise_tools.health import examine

RATES = (50.0, 62.5, 83.3, 100.0, 119.0, 125.0, 180.0, 200.0, 238.0, 285.714, 333.3, 400.0)


class Draw:
    """One draw: when the sensor sampled, by its own clock seen from the host, s."""

    def __init__(self, rng, rate=None, seconds=None, ppm=50.0, wander=0.0):
        self.rng = rng
        rate = rate or float(rng.choice(RATES))
        seconds = seconds or float(rng.uniform(300, 900))
        self.nominal = rate
        self.rate = rate * (1 + 1e-6 * ppm * rng.uniform(-1, 1))
        self.p = 1 / self.rate
        n = int(seconds * rate)
        taken = np.arange(n) * self.p
        if wander:      # slow, as an oscillator that warms up and cools down
            x = np.linspace(0, 1, n)
            taken = taken + wander * taken[-1] * (x * (1 - x) * rng.uniform(-1, 1))
        self.taken = taken
        self.there = np.ones(n, bool)

    @property
    def lost(self):
        """Samples lost between the first and the last that arrived."""
        kept = np.flatnonzero(self.there)
        return int(kept[-1] - kept[0] + 1 - len(kept))

    @property
    def mean_rate(self):
        """Samples per second of the sensor, those lost included."""
        kept = np.flatnonzero(self.there)
        return (kept[-1] - kept[0]) / (self.taken[kept[-1]] - self.taken[kept[0]])

    def singles(self, count):
        """Lose single samples, never two in reach of each other."""
        n = len(self.there)
        at = np.sort(self.rng.choice(np.arange(200, n - 200), count, replace=False))
        self.there[at[np.diff(at, prepend=-1000) > 100]] = False

    def share(self, share):
        """Lose a share of the samples, each by itself by chance."""
        self.there[100:-100] &= self.rng.random(len(self.there) - 200) > share

    def runs(self, count, low, high):
        """Lose runs of samples."""
        n = len(self.there)
        slot = n // (count + 1)
        for k in range(count):
            length = int(self.rng.integers(low, high + 1))
            at = (k + 1) * slot + int(self.rng.integers(-slot // 4, slot // 4))
            self.there[at:at + length] = False

    def arrived(self):
        """Return when the samples that were not lost were taken."""
        return self.taken[self.there]


def in_order(t):
    """Return times of a queue: none is served before the one ahead of it."""
    return np.maximum.accumulate(t)


def read_by_loop(t, period, rng, spread=0.1, parse=1e-4, start=0.0):
    """Return stamps given when a loop that wakes every so often finds samples in a buffer."""
    steps = period * (1 + spread * np.abs(rng.standard_normal(int(t[-1] / period * 1.3) + 50)))
    wakes = start + np.cumsum(steps)
    wakes = wakes[:np.searchsorted(wakes, t[-1]) + 2]
    turn = np.searchsorted(wakes, t)
    first = np.searchsorted(turn, turn)
    return in_order(wakes[turn] + parse * (np.arange(len(t)) - first))


def read_in_packets(t, size, parse, delay, rng):
    """Return stamps of packets of so many samples, each sent when full and late by ``delay``."""
    packet = np.arange(len(t)) // size
    last = np.minimum((packet + 1) * size - 1, len(t) - 1)
    sent = t[last] + delay(int(packet[-1]) + 1)[packet]
    return in_order(in_order(sent) + parse * (np.arange(len(t)) % size))


def stalled(t, rng, count, low, high, parse=2e-4):
    """Return stamps of a thread that is held up, then works off its queue."""
    out = t.copy()
    for at in rng.uniform(t[0] + 1, t[-1] - 3, count):
        until = at + rng.uniform(low, high)
        k = np.flatnonzero((t >= at) & (t < until))
        out[k] = np.maximum(out[k], until + parse * np.arange(len(k)))
    return in_order(out)


def px4(n, rate_tick=4.0e-3, every=34, more=8.0e-4):
    """Return times of a scheduler run every 4 ms that slips against the sensor's interrupt."""
    return np.cumsum(np.where(np.arange(n) % every == every - 1, rate_tick + more, rate_tick))


def in_buffers(d):
    """Return when buffers of a drawn size were read, and the turn of each sample."""
    size = int(d.rng.choice([4, 8, 16, 26, 32, 50, 85, 128, 256, 500]))
    late = d.rng.choice([2e-5, 1e-3, 5e-3, 2e-2])
    d.there[len(d.there) // size * size:] = False       # the last is not full
    t = d.arrived()
    turn = np.arange(len(t)) // size
    return in_order(t[size - 1::size] + d.rng.gamma(2, late / 2, turn[-1] + 1)), turn


def counted_back(d):
    """Return stamps of the pattern: the reading less as many intervals as are stated."""
    read, turn = in_buffers(d)
    last = np.searchsorted(turn, turn, 'right') - 1
    return read[turn] - (last - np.arange(len(turn))) / d.nominal


def one_stamp(d):
    """Return stamps of the pattern: one for all samples of a buffer."""
    read, turn = in_buffers(d)
    return read[turn]


def spread(d):
    """Return stamps of the pattern: spread evenly from one reading to the next."""
    read, turn = in_buffers(d)
    size = np.bincount(turn)[0]
    before = np.r_[read[0] - size * d.p, read[:-1]]
    return before[turn] + (read - before)[turn] * (np.arange(len(turn)) % size + 1) / size


def polled_back(d):
    """Return stamps of the pattern: counted back from when a loop reads what there is."""
    period = d.rng.choice([8, 26, 85, 256]) / d.nominal
    spread = d.rng.choice([0.002, 0.05, 0.3])
    read = read_by_loop(d.arrived(), period, d.rng, spread, parse=0.0)
    last = np.searchsorted(read, read, 'right') - 1
    return read - (last - np.arange(len(read))) / d.nominal


def even(d):
    """Return stamps of the pattern: even."""
    return d.arrived()


def interrupt(d):
    """Return stamps of the pattern: interrupt."""
    return d.arrived() + 20e-6 * d.rng.standard_normal(d.there.sum())


def scheduler(d, share=0.05):
    """Return stamps of the pattern: scheduler."""
    return in_order(d.arrived() + share * d.p * d.rng.standard_normal(d.there.sum()))


def rough_scheduler(d):
    """Return stamps of the pattern: rough scheduler."""
    return scheduler(d, 0.3)


def queue(d, mean=0.2):
    """Return stamps of the pattern: queue."""
    return in_order(d.arrived() + d.rng.exponential(mean * d.p, d.there.sum()))


def heavy(d):
    """Return stamps of the pattern: heavy."""
    return in_order(d.arrived() + 0.05 * d.p * d.rng.pareto(1.5, d.there.sum()))


def usb_1ms(d):
    """Return stamps of the pattern: a USB device polled every 1 ms."""
    return np.ceil(d.arrived() / 1e-3) * 1e-3 + 5e-6 * d.rng.random(d.there.sum())


def usb_8ms(d):
    """Return stamps of the pattern: a USB device polled every 8 ms."""
    return np.ceil(d.arrived() / 8e-3) * 8e-3 + 5e-6 * d.rng.random(d.there.sum())


def ftdi(d):
    """Return stamps of the pattern: an FTDI serial adapter with its latency timer."""
    return read_by_loop(d.arrived(), 16e-3, d.rng, spread=0.002)


def serial_buffer(d):
    """Return stamps of the pattern: serial buffer."""
    return read_by_loop(d.arrived(), 60e-3, d.rng, spread=0.2, parse=1.5e-3)


def bluetooth(d):
    """Return stamps of the pattern: bluetooth."""
    return read_in_packets(d.arrived(), 10, 2e-4, lambda n: d.rng.gamma(2, 8e-3, n), d.rng)


def python_loop(d):
    """Return stamps of the pattern: python loop."""
    return read_by_loop(d.arrived(), 20e-3, d.rng, spread=0.3)


def milliseconds(d):
    """Return stamps of the pattern: milliseconds."""
    return np.floor(d.arrived() * 1e3) / 1e3


def jiffies(d):
    """Return stamps of the pattern: stamps taken on kernel ticks."""
    return np.floor(d.arrived() / 1e-2) * 1e-2


def windows(d):
    """Return stamps of the pattern: windows."""
    return np.floor(d.arrived() / 15.625e-3) * 15.625e-3


def ntp_forward(d):
    """Return stamps of the pattern: a clock that NTP sets forward."""
    t = d.arrived()
    return t + (t > t[-1] * d.rng.uniform(0.2, 0.8)) * d.p * (d.rng.integers(1, 8) + 0.5)


def ntp_little_back(d):
    """Return stamps of the pattern: a clock that NTP sets back a little."""
    t = d.arrived()
    return t - (t > t[-1] * d.rng.uniform(0.2, 0.8)) * 0.4 * d.p


def set_back(d):
    """Return stamps of the pattern: set back."""
    t = d.arrived()
    return t - (t > t[-1] * d.rng.uniform(0.2, 0.8)) * 3600.0


def slewed(d):
    """Return stamps of the pattern: slewed."""
    t = d.arrived()
    return t + 5e-4 * np.clip(t - 100, 0, 100) - 5e-4 * np.clip(t - 200, 0, 100)


def stalls(d):
    """Return stamps of the pattern: stalls."""
    return stalled(d.arrived(), d.rng, 20, 0.05, 0.5) + 1e-5 * d.rng.random(d.there.sum())


def collector(d):
    """Return stamps of the pattern: collector."""
    t = d.arrived()
    return in_order(np.where(np.mod(t, 2.0) < 0.06, t - np.mod(t, 2.0) + 0.06, t))


def scheduler_slip(d):
    """Return stamps of the pattern: scheduler slip."""
    n = len(d.there)
    d.taken = px4(n)
    return d.arrived() + 15e-6 * d.rng.standard_normal(d.there.sum())


def fifo_polled(d):
    """Return stamps of the pattern: a device FIFO polled by the host."""
    return read_by_loop(d.arrived(), 50e-3, d.rng, spread=0.05, parse=5e-5)


def overflow(d):
    """Return times of a FIFO of 85 samples that overflows while its reader is held up."""
    d.runs(6, 20, 85)
    t = d.arrived()
    hole = np.flatnonzero(np.diff(t) > 10 * d.p)
    out = t.copy()
    for k in hole:      # what was in the FIFO arrives together with the first after it
        some = np.arange(max(0, k - 10), k + 1)
        out[some] = t[k + 1] - 1e-4 * (k + 1 - some)
    return read_by_loop(in_order(out), 20e-3, d.rng, spread=0.05, parse=5e-5)


PATTERNS = {
    # name: (what makes the sensor, what is lost, what makes the stamps)
    'hardware stamps': ({}, None, even),
    'interrupt, 20 us': ({}, None, interrupt),
    'scheduler, 5 %': ({}, None, scheduler),
    'scheduler, 30 %': ({}, None, rough_scheduler),
    'queue, exponential 20 %': ({}, None, queue),
    'heavy-tailed delays': ({}, None, heavy),
    'USB frames of 1 ms': ({}, None, usb_1ms),
    'USB polled every 8 ms': ({}, None, usb_8ms),
    'FTDI latency timer 16 ms': ({}, None, ftdi),
    'serial buffer, 60 ms': ({}, None, serial_buffer),
    'Bluetooth packets of 10': ({}, None, bluetooth),
    'loop that sleeps 20 ms': ({}, None, python_loop),
    'milliseconds': ({}, None, milliseconds),
    'milliseconds at 1 kHz': (dict(rate=1000.0, seconds=300.0, ppm=150), None, milliseconds),
    'ticks of 10 ms at 285 Hz': (dict(rate=285.714), None, jiffies),
    'ticks of 15.6 ms at 100 Hz': (dict(rate=100.0), None, windows),
    'ticks of 10 ms at 99.3 Hz': (dict(rate=99.3), None, jiffies),
    'oscillator off by 1e-3': (dict(ppm=1000), None, interrupt),
    'oscillator wanders by 1e-3': (dict(ppm=1000, wander=1e-3), None, interrupt),
    'wanders, through a queue': (dict(wander=1e-3), None, queue),
    'clock stepped on': ({}, None, ntp_forward),
    'clock stepped back a little': ({}, None, ntp_little_back),
    'clock set back an hour': ({}, None, set_back),
    'clock slewed 500 ppm': ({}, None, slewed),
    'thread held up 20 times': ({}, None, stalls),
    'collector every 2 s': ({}, None, collector),
    'scheduler that slips': (dict(rate=250.0), None, scheduler_slip),
    'FIFO polled every 50 ms': ({}, None, fifo_polled),
    'hardware stamps, 30 single losses': ({}, ('singles', 30), even),
    'hardware stamps, 5 % lost': ({}, ('share', 0.05), even),
    'interrupt, 1 % lost': ({}, ('share', 0.01), interrupt),
    'scheduler 5 %, runs of 3 to 40': ({}, ('runs', 5, 3, 40), scheduler),
    'scheduler 5 %, 2 % lost': ({}, ('share', 0.02), scheduler),
    'scheduler 30 %, 10 single losses': ({}, ('singles', 10), rough_scheduler),
    'queue, 20 single losses': ({}, ('singles', 20), queue),
    'heavy-tailed delays, runs': ({}, ('runs', 6, 2, 30), heavy),
    'USB 1 ms, single losses': ({}, ('singles', 20), usb_1ms),
    'USB 8 ms, runs of 10 to 50': ({}, ('runs', 5, 10, 50), usb_8ms),
    'FTDI, packets of 8 lost': ({}, ('runs', 6, 8, 8), ftdi),
    'serial buffer, runs of 60 to 90': ({}, ('runs', 3, 60, 90), serial_buffer),
    'Bluetooth, packets of 10 lost': (dict(rate=100.0), ('runs', 5, 10, 10), bluetooth),
    'device FIFO overflows': ({}, None, overflow),
    'milliseconds, 20 single losses': ({}, ('singles', 20), milliseconds),
    'milliseconds at 1 kHz, 20 lost': (
        dict(rate=1000.0, seconds=300.0), ('singles', 20), milliseconds
    ),
    'ticks of 10 ms at 285 Hz, runs': (dict(rate=285.714), ('runs', 5, 20, 40), jiffies),
    'wanders by 1e-3, single losses': (dict(wander=1e-3), ('singles', 20), interrupt),
    'clock stepped on, single losses': ({}, ('singles', 10), ntp_forward),
    'thread held up, runs lost': ({}, ('runs', 5, 5, 30), stalls),
    'scheduler that slips, runs': (dict(rate=250.0), ('runs', 6, 5, 20), scheduler_slip),
    # of a sensor whose rate is off from the stated one by up to 2 %
    'buffer counted back, 2 % off': (dict(ppm=20_000), None, counted_back),
    'one stamp a buffer, 2 % off': (dict(ppm=20_000), None, one_stamp),
    'buffer spread evenly, 2 % off': (dict(ppm=20_000), None, spread),
    'loop counts back, 2 % off': (dict(ppm=20_000), None, polled_back),
}


def record(name, rng) -> tuple[ImuRecord, int, float]:
    """Return a record of a pattern, how many samples it lost, and its rate."""
    sensor, loss, stamps = PATTERNS[name]
    d = Draw(rng, **sensor)
    if loss:
        getattr(d, loss[0])(*loss[1:])
    t = stamps(d)
    n = len(t)
    x = 1e-3 * rng.standard_normal((n, 6)) + [0, 0, 0, 0, 0, 9.8]
    t = t + rng.uniform(0, 10)
    return ImuRecord(x[:, :3], x[:, 3:], t - t[0], d.rate, start=t[0]), d.lost, d.mean_rate


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--draws', type=int, default=10)
    parser.add_argument('--seed', type=int, default=1)
    parser.add_argument('--only', default='')
    args = parser.parse_args()
    print('| pattern | counted exactly | lost, found of true (worst draw) | rate, worst error |')
    print('|---|---|---|---|')
    right = good = total = 0
    for k, name in enumerate(PATTERNS):
        if args.only not in name:
            continue
        exact, worst, off = 0, (0, 0), []
        for draw in range(args.draws):
            r, lost, rate = record(name, np.random.default_rng([args.seed, k, draw]))
            h = examine(r)
            exact += h.missing == lost
            if abs(h.missing - lost) >= abs(worst[0] - worst[1]):
                worst = h.missing, lost
            off.append(abs(h.rate_hz / rate - 1))
        close = int(np.sum(np.array(off) < 1e-5))
        right, good, total = right + exact, good + close, total + args.draws
        print(f'| {name} | {exact} of {args.draws} | {worst[0]} of {worst[1]} | '
              f'{max(off):.1e} ({close} within 1e-5) |', flush=True)
    print(f'\nlosses counted exactly {right} of {total}; rate within 1e-5 {good} of {total}')


if __name__ == '__main__':
    main()
