# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""Effects of a calibration: rows of the regressor I in O = G I, or scatter of the poses."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from .poses import Poses, unit
from ..loop.effect import Effect, Parameter

OWN = np.where(np.eye(3, dtype=bool), np.arange(3), -1)     # each output feels its own row alone
_OTHERS = np.array([[-1, 0, 1], [2, -1, 3], [4, 5, -1]])
_EACH = np.array([[0], [1], [2]])
_BIG = 1e12
_SIZES = ('inputs of several sizes on each axis: poses between the faces (45 deg edges), or '
          'several '
          'rates')


def _named(symbol: str, unit_: str, indices=('x', 'y', 'z'), title: str = '') -> tuple[Parameter,
                                                                                       ...]:
    return tuple(Parameter(f'{symbol}_{k}', unit_, -_BIG, _BIG, log=False, amplitude=True,
                           title=title and f'{title} {k}') for k in indices)


class CalibrationEffect(Effect):
    """Base of every effect of a calibration."""

    domain: ClassVar[str] = 'calibration'
    sensors: ClassVar[tuple[str, ...]] = ('accel', 'gyro')
    needs: ClassVar[str] = ''           # the poses that show it

    def why_not(self, poses: Poses) -> str:
        """Return why these poses say nothing about it, or an empty string."""
        return '' if poses.sensor in self.sensors else f'not an effect of {poses.sensor}'


class Regressor(CalibrationEffect):
    """
    An effect that adds rows to the regressor I, and so columns to G = O I' (I I')^-1.

    A subclass gives :meth:`columns` and its parameters; by default every output has a coefficient
    for every row (so 3 parameters a row, output after output). ``feeds`` (3, rows) says otherwise:
    the index of the parameter with which a row enters an output, -1 for none. With ``at_input``
    the rows are a change of the *input*, which then passes through the scale factors like any
    other. The parameter named by ``placed`` is no coefficient: each of :meth:`places` is tried.

    """

    feeds: ClassVar[np.ndarray | None] = None
    at_input: ClassVar[bool] = False
    #: whether it belongs to the session alone: fitted, and not taken out of other records
    passing: ClassVar[bool] = False
    #: whether S and bias hold at the reference temperature with it, and at no other
    heated: ClassVar[bool] = False
    #: whether it is told by inputs of several sizes, and by those alone
    shaped: ClassVar[bool] = False
    #: name of the parameter that says where its rows begin or end, where it has one
    placed: ClassVar[str] = ''

    @property
    def coefficients(self) -> tuple[Parameter, ...]:
        """Parameters that are solved for."""
        return tuple(p for p in self.parameters if p.name != self.placed)

    def columns(self, poses: Poses) -> np.ndarray:
        """Return the rows of I, (rows, n), for the mean input (SI) of each pose."""
        raise NotImplementedError

    def places(self, poses: Poses) -> np.ndarray:
        """Return the values (k,) to be tried of the parameter with which it is placed, rising."""
        return np.zeros(0)

    def terms(self, poses: Poses, scale: np.ndarray) -> np.ndarray:
        """Return the change of the outputs by each parameter, (3, n, parameters); scale: S."""
        rows = np.atleast_2d(self.columns(poses)) * poses.amount
        feeds = self.feeds if self.feeds is not None else np.arange(3 * len(rows)).reshape(3, -1)
        out = np.zeros((3, poses.n, len(self.coefficients)))
        for (axis, row), parameter in np.ndenumerate(feeds):
            if parameter >= 0:
                out[axis, :, parameter] += rows[row]
        return np.einsum('ij,jnk->ink', scale, out) if self.at_input else out


class Scatter(CalibrationEffect):
    """An effect with no fixed course: it makes poses scatter, one amplitude."""

    #: whether its amplitude stands in place of the tilt of the faces that was stated
    tilts: ClassVar[bool] = False

    @property
    def amplitude(self) -> float:
        """Its one value; 0 before it is fitted."""
        return next(iter(self.values.values()), 0.0)

    def bounds(self, poses: Poses, scale: np.ndarray) -> tuple[float, float]:
        """Return the range in which its amplitude is looked for; scale (3, 3) is S."""
        return self.parameters[0].lower, self.parameters[0].upper

    def covariance(self, poses: Poses, scale: np.ndarray, amplitude: float) -> np.ndarray:
        """Return the covariance of each pose's outputs, (n, 3, 3), SI^2; scale (3, 3) is S."""
        raise NotImplementedError


class Scale(Regressor):
    """Each axis' output per unit of its own input."""

    name = 'scale'
    symbol = 'S'
    title = 'scale factors'
    equation = 'o_k = S_kk i_k'
    signature = 'output grows in proportion to the input'
    hint = 'base model'
    reference = 'IEEE 1554; six-position method'
    parameters = _named('S', '1', ('xx', 'yy', 'zz'), 'scale factor')
    feeds = OWN

    def columns(self, poses: Poses) -> np.ndarray:
        """Return the input."""
        return poses.rates


class CrossAxis(Regressor):
    """Each axis' output per unit of the other axes' input: axes not orthogonal, or turned."""

    name = 'cross_axis'
    symbol = 'S'
    title = 'cross-axis sensitivities'
    equation = 'o_k = sum_l S_kl i_l, l != k'
    signature = 'output follows the input of another axis'
    hint = 'base model; a common turn of the fixture looks the same'
    reference = 'IEEE 1554; six-position method'
    parameters = _named('S', '1', ('xy', 'xz', 'yx', 'yz', 'zx', 'zy'), 'cross-axis sensitivity')
    feeds = _OTHERS

    def columns(self, poses: Poses) -> np.ndarray:
        """Return the input."""
        return poses.rates


class Bias(Regressor):
    """Output at no input."""

    name = 'bias'
    symbol = 'b'
    title = 'biases'
    equation = 'o_k = b_k'
    signature = 'the same offset in every pose'
    hint = 'base model'
    reference = 'IEEE 1554; six-position method'
    parameters = _named('b', '{rate}', title='bias')
    feeds = _EACH

    def columns(self, poses: Poses) -> np.ndarray:
        """Return ones."""
        return np.ones((1, poses.n))


class Quadratic(Regressor):
    """Scale factor that changes with the input: vibration rectification follows from it."""

    name = 'quadratic'
    symbol = 'q'
    title = 'quadratic non-linearity'
    equation = 'o_k = q_k i_k^2'
    signature = 'both ends of an axis off to the same side, by the square of the input'
    hint = 'a non-linear spring or drive; check at half range; it turns vibration into bias'
    reference = 'IEEE 1293 (K2)'
    parameters = _named('q', '1/({rate})', title='quadratic coefficient')
    feeds = OWN
    needs = _SIZES
    shaped = True

    def columns(self, poses: Poses) -> np.ndarray:
        """Return the square of the input."""
        return poses.rates ** 2


class Cubic(Regressor):
    """Scale factor that changes with the square of the input: compression towards the ends."""

    name = 'cubic'
    symbol = 'c'
    title = 'cubic non-linearity'
    equation = 'o_k = c_k i_k^3'
    signature = 'both ends of an axis too large or too small, inner inputs right'
    hint = 'saturation coming on; check the range setting'
    reference = 'IEEE 1293 (K3)'
    parameters = _named('c', '1/({rate})^2', title='cubic coefficient')
    feeds = OWN
    needs = _SIZES
    shaped = True

    def columns(self, poses: Poses) -> np.ndarray:
        """Return the cube of the input."""
        return poses.rates ** 3


class Asymmetry(Regressor):
    """Scale factor that differs between positive and negative input."""

    name = 'asymmetry'
    symbol = 'a'
    title = 'scale-factor asymmetry'
    equation = 'o_k = a_k |i_k|'
    signature = 'both ends of an axis off to the same side, in proportion to the input'
    hint = 'electronics with different gain for the two signs'
    reference = 'IEEE 1554 (scale factor asymmetry)'
    parameters = _named('a', '1', title='asymmetry')
    feeds = OWN
    needs = _SIZES
    shaped = True

    def columns(self, poses: Poses) -> np.ndarray:
        """Return the size of the input."""
        return np.abs(poses.rates)


class _OfTemperature(Regressor):
    """What follows the temperature, so that S and bias are those at the reference."""

    heated = True

    def why_not(self, poses: Poses) -> str:
        """Temperature has to be known, and to change."""
        if why := super().why_not(poses):
            return why
        if not np.isfinite(poses.temperature).all():
            return 'no temperature was recorded'
        return '' if np.ptp(poses.temperature) > 0.1 else 'the temperature did not change'


class Temperature(_OfTemperature):
    """Bias that follows the temperature."""

    name = 'temperature'
    symbol = 't'
    title = 'temperature drift of the biases'
    equation = 'o_k = t_k (T - T_ref)'
    signature = 'residual follows the temperature of the pose'
    hint = 'let it warm up, or record the temperature along and compensate'
    reference = 'IEEE 1293, IEEE 1431 (thermal sensitivity of bias)'
    parameters = _named('t', '({rate})/K', title='bias per degree')
    feeds = _EACH
    needs = 'the same poses again at another temperature, with a temperature topic'

    def columns(self, poses: Poses) -> np.ndarray:
        """Return the temperature above the reference."""
        return (poses.temperature - poses.reference_temperature)[None]


class TemperatureCurve(_OfTemperature):
    """Bias that follows the temperature by a curve: the square and the cube beside the line."""

    name = 'temperature_curve'
    symbol = 't'
    title = 'curved temperature drift of the biases'
    equation = 'o_k = t2_k (T - T_ref)^2 + t3_k (T - T_ref)^3'
    signature = 'residual bends with the temperature of the pose'
    hint = 'record poses over the whole range of use; a polynomial holds within it only'
    reference = 'IEEE 1293, IEEE 1431 (thermal model of bias, third order)'
    parameters = _named('t2', '({rate})/K^2', title='bias per degree^2') + _named(
        't3', '({rate})/K^3', title='bias per degree^3')
    feeds = np.array([[0, 3], [1, 4], [2, 5]])
    needs = 'the same poses again at four temperatures or more, with a temperature topic'

    def columns(self, poses: Poses) -> np.ndarray:
        """Return square and cube of the temperature above the reference."""
        t = poses.temperature - poses.reference_temperature
        return np.vstack([t ** 2, t ** 3])


class _InTime(Regressor):
    """What the biases do over the time of the session."""

    passing = True
    needs = 'faces held again at the end of the session'

    def why_not(self, poses: Poses) -> str:
        """Poses of one time, or of records without a common one, tell nothing of it."""
        return super().why_not(poses) or ('' if np.ptp(poses.time) > 0
                                          else 'all poses are of one time')


class WarmUp(_InTime):
    """
    Bias that settles in time: exponentials of 40 s and of 200 s, what small sensors warm up with.

    Two fixed time constants keep it linear; those between are sums of the two.

    """

    name = 'warm_up'
    symbol = 'w'
    title = 'settling of the biases after the start'
    equation = 'o_k = w40_k exp(-t / 40 s) + w200_k exp(-t / 200 s), t since the start'
    signature = 'residual falls with the time of the pose, fast at first'
    hint = 'let it warm up before the first pose, or record the temperature along'
    reference = 'IEEE 1293 (turn-on transient)'
    parameters = _named('w40', '{rate}', title='settling within a minute') + _named(
        'w200', '{rate}', title='settling within ten minutes')
    feeds = np.array([[0, 3], [1, 4], [2, 5]])

    def columns(self, poses: Poses) -> np.ndarray:
        """Return the two exponentials of the time since the start of the record."""
        return np.exp(-poses.time / np.array([[40.0], [200.0]]))


class Drift(_InTime):
    """Bias that grows in time by a constant rate, over the session."""

    name = 'drift'
    symbol = 'd'
    title = 'drift of the biases in time'
    equation = 'o_k = d_k t, t since the start of the record'
    signature = 'residual follows the time of the pose; faces held again at the end differ'
    hint = 'let it warm up first; hold the first faces again at the end'
    reference = 'IEEE 1293 (bias trend)'
    parameters = _named('d', '({rate})/s', title='bias per second')
    feeds = _EACH

    def columns(self, poses: Poses) -> np.ndarray:
        """Return the time since the start of the record."""
        return poses.time[None]


class Step(_InTime):
    """Bias that is another one from some pose on; ``b`` is the one at the end."""

    name = 'step'
    symbol = 'j'
    title = 'step of the biases between two poses'
    equation = 'o_k = -j_k before the time t, 0 after it'
    signature = 'residual has one level up to some pose and another one from the next on'
    hint = ('a knock, a cable that pulls, a restart or a change of range at the time t; the bias '
            'given is the one after it: calibrate again where it may step back')
    reference = 'IEEE 1293 (bias repeatability)'
    parameters = (Parameter('t', 's', 0.0, _BIG, log=False, title='time of the step'),
                  *_named('j', '{rate}', title='step of the bias'))
    feeds = _EACH
    placed = 't'
    needs = 'faces held again at the end of the session, four poses on each side of the step'

    def columns(self, poses: Poses) -> np.ndarray:
        """Return minus one before the step, 0 from it on."""
        return np.where(poses.time < self.values.get('t', 0.0), -1.0, 0.0)[None]

    def places(self, poses: Poses) -> np.ndarray:
        """Return the times between poses that leave more than three coefficients on each side."""
        time = np.sort(poses.time)
        between = (time[1:] + time[:-1]) / 2
        return np.unique(between[len(self.coefficients):-len(self.coefficients)])

    def why_not(self, poses: Poses) -> str:
        """Poses are needed on both sides of it."""
        return super().why_not(poses) or ('' if len(self.places(poses))
                                          else 'too few poses before and after any step')

    @classmethod
    def example(cls) -> Step:
        """Return one within a short session."""
        return cls({'t': 60.0, 'j_x': 0.01, 'j_y': 0.0, 'j_z': -0.01})


class TemperatureScale(_OfTemperature):
    """Scale factor that follows the temperature."""

    name = 'temperature_scale'
    symbol = 'u'
    title = 'temperature drift of the scale factors'
    equation = 'o_k = u_k (T - T_ref) i_k'
    signature = 'residual follows temperature times input'
    hint = 'record the temperature along and compensate'
    reference = 'IEEE 1293, IEEE 1431 (thermal sensitivity of scale factor)'
    parameters = _named('u', '1/K', title='scale per degree')
    feeds = OWN
    needs = 'the same poses again at another temperature, with a temperature topic'

    def columns(self, poses: Poses) -> np.ndarray:
        """Return temperature above the reference times the input."""
        return (poses.temperature - poses.reference_temperature) * poses.rates


class GSensitivity(Regressor):
    """Gyroscope output that follows the specific force, by a full 3 x 3 matrix."""

    name = 'g_sensitivity'
    symbol = 'D'
    title = 'g-sensitivity'
    equation = 'o_k = sum_l D_kl f_l'
    signature = 'bias of a gyroscope depends on which way is up'
    hint = 'proof mass not balanced; turn about each axis with both of its ends up'
    reference = 'IEEE 1431, IEEE 1554 (acceleration-sensitive drift)'
    parameters = _named('D', '(rad/s)/(m/s^2)', tuple(k + m for k in 'xyz' for m in 'xyz'),
                        'g-sensitivity')
    sensors = ('gyro',)
    needs = 'turns or rests with each axis up and down, the specific force recorded along'

    def columns(self, poses: Poses) -> np.ndarray:
        """Return the specific force."""
        return poses.force

    def why_not(self, poses: Poses) -> str:
        """Specific force has to be known."""
        return super().why_not(poses) or _no_force(poses)


class EarthRate(Regressor):
    """Vertical part of the Earth's rotation, about the axis that points up."""

    name = 'earth_rate'
    symbol = 'E'
    title = 'Earth rate'
    equation = 'i = E u, u: up; E = 15.04 deg/h sin(latitude)'
    signature = 'bias of a gyroscope changes sign with the end that is up, the same on every axis'
    hint = 'give --latitude; below the resolution of most MEMS gyroscopes'
    reference = 'IEEE 1554'
    parameters = (Parameter('E', 'rad/s', -1e-4, 1e-4, log=False, amplitude=True,
                            title='vertical Earth rate'),)
    feeds = np.where(np.eye(3, dtype=bool), 0, -1)
    at_input = True
    sensors = ('gyro',)
    needs = 'rests or turns with each axis up and down, until the noise is below 15 deg/h'

    def columns(self, poses: Poses) -> np.ndarray:
        """Return the direction of up."""
        return unit(poses.force)

    def why_not(self, poses: Poses) -> str:
        """Specific force has to be known."""
        return super().why_not(poses) or _no_force(poses)


class WrongGravity(Regressor):
    """Local gravity that differs from the one assumed."""

    name = 'wrong_gravity'
    symbol = 'dg'
    title = 'wrong local gravity'
    equation = 'i = (1 + dg) i'
    signature = 'none: a common scale factor looks the same'
    hint = 'give --gravity, or --latitude and --height: 0.5 % between the equator and the poles'
    reference = 'NIMA TR8350.2'
    parameters = (Parameter('dg', '1', -0.01, 0.01, log=False, amplitude=True,
                            title='relative error of gravity'),)
    feeds = np.where(np.eye(3, dtype=bool), 0, -1)
    at_input = True
    sensors = ('accel',)
    needs = 'no pose at all: only the local gravity itself (--gravity, or --latitude and --height)'

    def columns(self, poses: Poses) -> np.ndarray:
        """Return the input."""
        return poses.rates


class Tilt(Scatter):
    """
    Faces that are not level, each by a small random tilt of its own: two angles of this rms.

    The lateral readings scatter by g theta, the axial ones by g theta^2 only. In a model it stands
    in place of the tilt that was stated.

    """

    name = 'tilt'
    symbol = 'theta'
    title = 'tilt of the faces'
    equation = 'lateral: (g theta)^2, axial: (g theta^2)^2'
    signature = 'lateral readings scatter from pose to pose, axial ones hardly'
    hint = 'level the table, square the block; or use 12 spread poses, which need no level'
    reference = 'six-position method'
    parameters = (Parameter('angle', 'rad', 1e-4, 0.5, amplitude=True,
                            title='rms of each of two tilt angles'),)
    tilts = True
    needs = 'each face held several times, put down anew: tilt scatters the lateral readings alone'

    def covariance(self, poses: Poses, scale: np.ndarray, amplitude: float) -> np.ndarray:
        """
        Return the covariance of outputs of inputs m u, with D the diagonal of S.

        D ((m theta)^2 (1 - u u') + (m theta^2)^2 u u') D.

        Not S itself: estimated from tilted faces, its cross-axis terms are too uncertain to weigh
        by.

        """
        m = np.linalg.norm(poses.inputs, axis=0)
        u = unit(poses.inputs)
        along = np.einsum('in,jn->nij', u, u)
        across = np.eye(3) - along
        at_input = (m * amplitude)[:, None, None] ** 2 * (across + amplitude ** 2 * along)
        own = np.diag(scale)
        return own[:, None] * at_input * own

    def why_not(self, poses: Poses) -> str:
        """Poses of unknown direction have no tilt."""
        return super().why_not(poses) or ('' if poses.known
                                          else 'poses of free direction have no tilt')


class Repeatability(Scatter):
    """Bias that changes from pose to pose by more than the noise within one."""

    name = 'repeatability'
    symbol = 'r'
    title = 'pose-to-pose scatter'
    equation = 'every reading: r^2'
    signature = 'all readings scatter by more than the noise within a pose, with no course'
    hint = ('bias instability, hysteresis or mechanical stress; hold poses again to average it '
            'down, and to see whether it is another one each time: what jumps with the direction '
            'looks the same')
    reference = 'IEEE 1554 (repeatability)'
    parameters = (Parameter('sigma', '{rate}', 1e-9, _BIG, amplitude=True,
                            title='scatter between poses'),)
    needs = 'each pose held several times: scatter that repeats on no input'
    stays = True        # what has no name must not take that of what it looks like

    def bounds(self, poses: Poses, scale: np.ndarray) -> tuple[float, float]:
        """Up to 0.5 % of the input: more is no bias that wanders."""
        size = poses.magnitude * np.abs(np.diag(scale)).mean() / np.median(poses.amount)
        return 1e-3 * float(np.median(poses.std / poses.amount)) + 1e-12, 5e-3 * size

    def covariance(self, poses: Poses, scale: np.ndarray, amplitude: float) -> np.ndarray:
        """Return sigma^2 times the identity, in units of the output."""
        return (amplitude * poses.amount)[:, None, None] ** 2 * np.eye(3)


def _no_force(poses: Poses) -> str:
    return '' if np.isfinite(poses.force).all() else 'the specific force is not known'


#: the model that every calibration starts from, and whose S and b a correction is made of
BASE = ('scale', 'cross_axis', 'bias')
