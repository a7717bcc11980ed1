"""Noise of one axis of a static record: effects, evidence, fit, the problem that the loop drives."""

from . import effects  # noqa: F401  (registers them)
from .kinds import (
    Coupling,
    Defect,
    Inputs,
    Line,
    Mean,
    Modulation,
    NoiseEffect,
    Parameter,  # noqa: F401
    Response,
    Spectrum,
)
