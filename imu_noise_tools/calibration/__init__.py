"""Calibration: scale, cross-axis sensitivity and bias from poses, and what else may be in the outputs."""

from . import effects  # noqa: F401  (registers the effects)
