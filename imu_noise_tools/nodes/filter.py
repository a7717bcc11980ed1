"""The filter node: one Imu message in, one with less noise out."""

from __future__ import annotations

import sys

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import Imu

from . import messages
from .loop import Loop, serve
from .params import Setting, Settings
from .run import events_executor, run
from .topics import ImuInput, live, overridable, result, STEADY
from ..denoise.engine import Engine
from ..denoise.evaluate import Innovations
from ..errors import InputError
from ..record import AXES

_SHOWN = 4096           # latest innovations of which the figures are published
