# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sensor's own low-pass filter."""

import numpy as np

from ..kinds import Parameter, Response

FORMS = ('first_order', 'butterworth_2', 'butterworth_2_analogue', 'moving_average')


class LowPass(Response):
    """Power falls towards Nyquist: the sensor's bandwidth is below half the sample rate."""

    name = 'low_pass'
    symbol = 'cutoff'
    title = "the sensor's own low-pass"
    equation = (
        'gain^2: first order (1-p)^2/(1-2p cos w+p^2), p = e^(-2 pi cutoff dt); Butterworth '
        '1/(1+(tan(w/2)/tan(wc/2))^4) or 1/(1+(f/cutoff)^4); moving average (sin(w r/2)/(r '
        'sin(w/2)))^2, r = 0.443/(cutoff dt)'
    )
    signature = (
        'PSD falls near Nyquist; the Allan deviation lies below N/sqrt(tau) at the first tau; no '
        'repeated samples'
    )
    hint = (
        'The digital low-pass of the sensor is set below half the output rate. Harmless: N holds '
        'below the cutoff. Ask for a lower output rate, or a wider filter, if neighbouring '
        'samples must be independent.'
    )
    reference = 'IEEE 1554, bandwidth'
    decide = 'set the widest filter of the sensor and record again'
    parameters = (
        Parameter('cutoff', 'Hz', 1e-3, 1e5, title='-3 dB frequency'),
        Parameter.choice('form', FORMS, title='shape of the fall'),
    )

    def starts(self, evidence):
        """
        Return the two best cutoffs of each form.

        The best are those behind which the measured spectrum is flattest, coefficient by
        coefficient: far off the minimum a fit of the power itself goes astray, since a gain near
        zero makes the smallest mismatch enormous.

        """
        bins, dt = evidence.whole.bins, evidence.dt
        log_power = np.log(np.maximum(evidence.whole.power, 1e-300))
        falls = np.geomspace(0.02, 1.6, 40) * 0.5 / dt
        # an average is one of a whole number of samples
        averages = 0.443 / (np.arange(2, 65) * dt)

        def roughness(effect):
            left = log_power - np.log(np.maximum(effect.gain2(bins.f, dt), 1e-12))
            return np.average((left - np.average(left, weights=bins.count)) ** 2,
                              weights=bins.count)

        out = []
        for form in FORMS:
            tried = [
                self.with_values(cutoff=float(c), form=form)
                for c in (averages if form == 'moving_average' else falls)
            ]
            out += sorted(tried, key=roughness)[:2]
        return out

    def bounds(self, evidence):
        """Up to a little beyond Nyquist, where the beginning of a fall still shows."""
        return {'cutoff': (1 / evidence.duration, 1 / evidence.dt)}

    def gain2(self, f, dt):
        """Return the squared gain."""
        f, c, form = np.asarray(f, float), self['cutoff'], self.chosen('form')
        if form == 'first_order':
            p = np.exp(-2 * np.pi * c * dt)
            return (1 - p) ** 2 / ((1 - p) ** 2 + p * (2 * np.sin(np.pi * f * dt)) ** 2)
        if form == 'butterworth_2':
            top = np.tan(np.pi * min(c * dt, 0.499))
            return 1 / (1 + (np.tan(np.pi * np.minimum(f * dt, 0.49999)) / top) ** 4)
        if form == 'butterworth_2_analogue':
            return 1 / (1 + (f / c) ** 4)
        r = max(0.443 / (c * dt), 1.0)
        return np.maximum((np.sin(np.pi * f * dt * r) / (r * np.sin(np.pi * f * dt))) ** 2, 1e-9)

    def apply(self, x, inputs, rng):
        """Filter through the DCT: the even extension has no transient at the ends."""
        from scipy.fft import dct, idct

        c = dct(x, type=2, norm='ortho')
        k = np.arange(1, len(x))
        c[1:] *= np.sqrt(self.gain2(k / (2 * len(x) * inputs.dt), inputs.dt))
        return idct(c, type=2, norm='ortho')

    @classmethod
    def example(cls):
        """Return a cutoff at a quarter of Nyquist at 100 Hz."""
        return cls({'cutoff': 12.0, 'form': 'first_order'})
