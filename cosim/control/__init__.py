"""Models and FMUs as python-control's systems, and python-control's systems as FMUs.

=======================  =================================================================================
`operating_point`        where a model stays at constant inputs, or what inputs hold it there
`model_ss`               the exact linear model at a sampling time, `control.StateSpace`
`continuous_ss`          the same as a continuous system, delays as Pade approximations
`model_noise`            with the states that shape the noise, and its covariances
`model_nlsys`            the whole model, its noise as inputs, `control.NonlinearIOSystem`
`fmu_nlsys`              any co-simulation FMU that can save its state, `control.NonlinearIOSystem`
`fmu_frd`                the frequency response of any FMU, measured, `control.FrequencyResponseData`
`to_fmu`                 a linear system of python-control as a controller FMU
`controller_of`          what such an FMU is made of
`refuse_algebraic_loop`  refuses an interconnection whose outputs need each other at once
=======================  =================================================================================

Discrete systems are x[k+1] = A x[k] + B u[k], y[k] = C x[k]: u[k] is held from t_k to t_k+1, y[k] read at t_k. The
outputs of a model never read its inputs, so that D = 0; this is one communication step of a Jacobi master, and models
that are connected with each other need no further delay.

Signals have their FMI names, with ``_`` for a dot, which python-control keeps for itself: ``euler_yaw``, ``rate[1]``.
States keep their dots. Everything is in SI units. What cannot be done is refused by `LinearisationRefusedError`,
`ExportRefusedError` or `SystemRefusedError`, which say what to do.
"""

from ..errors import ExportRefusedError, LinearisationRefusedError, SystemRefusedError
from .algebraic_loops import refuse_algebraic_loop
from .continuous import continuous_ss
from .export import controller_of, to_fmu
from .fmu_systems import FmuSystem, fmu_nlsys
from .frequency import MeasuredFrequencyResponse, fmu_frd
from .linear import model_ss
from .noise import ModelNoise, model_noise
from .nonlinear import ModelSystem, model_nlsys
from .operating_point import OperatingPoint, operating_point

__all__ = [
    "ExportRefusedError",
    "FmuSystem",
    "LinearisationRefusedError",
    "MeasuredFrequencyResponse",
    "ModelNoise",
    "ModelSystem",
    "OperatingPoint",
    "SystemRefusedError",
    "continuous_ss",
    "controller_of",
    "fmu_frd",
    "fmu_nlsys",
    "model_nlsys",
    "model_noise",
    "model_ss",
    "operating_point",
    "refuse_algebraic_loop",
    "to_fmu",
]
