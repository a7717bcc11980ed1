# SPDX-FileCopyrightText: 2026 imu_noise_tools maintainers
# SPDX-License-Identifier: Apache-2.0

"""From arrays to raw messages, thousands at once: the inverse of :mod:`decode`."""

from __future__ import annotations

from functools import cache
import struct

import numpy as np

from .decode import ACCEL, ACCEL_COVARIANCE, GYRO, GYRO_COVARIANCE


def serialise(
    stamp: np.ndarray, values: np.ndarray, frame_id: str, encoding: str = 'cdr'
) -> np.ndarray:
    """
    Return messages of a header and doubles, one a row.

    Parameters
    ----------
    stamp : ndarray (n,)
        Header stamps, ns since the epoch.
    values : ndarray (n, k)
        The doubles of each message.
    frame_id : str
        The frame of all of them.
    encoding : str
        ``cdr`` (little-endian) or ``ros1``.

    Returns
    -------
    ndarray (n, length) uint8
        What padding there is, is zero.

    """
    n = len(stamp)
    name = frame_id.encode() + (b'' if encoding == 'ros1' else b'\0')
    body = 16 + len(name) if encoding == 'ros1' else 4 + (12 + len(name) + 7) // 8 * 8
    out = np.zeros((n, body + 8 * values.shape[1]), np.uint8)
    if encoding == 'ros1':
        out[:, 0:4] = np.arange(n, dtype='<u4').view(np.uint8).reshape(n, 4)
    else:
        out[:, 1] = 1
    out[:, 4:12] = split_stamp(stamp)
    out[:, 12:16] = np.frombuffer(struct.pack('<I', len(name)), np.uint8)
    out[:, 16:16 + len(name)] = np.frombuffer(name, np.uint8)
    out[:, body:] = np.ascontiguousarray(values, '<f8').view(np.uint8).reshape(n, -1)
    return out


def split_stamp(stamp: np.ndarray) -> np.ndarray:
    """Return seconds and nanoseconds as bytes, (n, 8) uint8."""
    seconds, rest = np.divmod(np.asarray(stamp, np.int64), 1_000_000_000)
    return (
        np.stack([seconds.astype('<u4'), rest.astype('<u4')], axis=1).view(np.uint8).reshape(-1, 8)
    )


def imu_values(
    gyro: np.ndarray | None,
    accel: np.ndarray | None,
    gyro_covariance: np.ndarray | None = None,
    accel_covariance: np.ndarray | None = None,
    out: np.ndarray | None = None,
) -> np.ndarray:
    """
    Return the doubles of Imu messages, (n, 37).

    Parameters
    ----------
    gyro, accel : ndarray (n, 3) or None
        Angular rate and acceleration; a part that is None is left as it is in ``out``, and without
        that it is zero and marked absent (-1), as is the orientation (REP-145).
    gyro_covariance, accel_covariance : array (9,), (3, 3), (n, 9) or (n, 3, 3), optional
        Row-major; zeros mean unknown.
    out : ndarray (n, 37), optional
        What to start from.

    """
    fresh = out is None
    if out is None:
        out = np.zeros((max(len(x) for x in (gyro, accel) if x is not None), 37))
        out[:, 3] = 1.0
        out[:, 4] = -1.0
    for data, place, covariance, where in ((gyro, GYRO, gyro_covariance, GYRO_COVARIANCE),
                                           (accel, ACCEL, accel_covariance, ACCEL_COVARIANCE)):
        if data is not None:
            out[:, place] = data
        elif fresh:
            out[:, where.start] = -1.0
        if covariance is not None:
            given = np.asarray(covariance, float)
            out[:, where] = given.reshape(-1, 9) if given.size > 9 else given.reshape(9)
    return out


@cache
def definition(type: str, encoding: str) -> tuple[str, str]:
    """
    Return a type's message definition and its hash, as bags hold them.

    The hash is an md5 for ROS 1, RIHS01 for ROS 2.

    """
    from rosbags.typesys import get_typestore, Stores
    store = get_typestore(Stores.ROS1_NOETIC if encoding == 'ros1' else Stores.ROS2_JAZZY)
    text, md5 = store.generate_msgdef(type, ros_version=1 if encoding == 'ros1' else 2)
    return text, md5 if encoding == 'ros1' else store.hash_rihs01(type)
