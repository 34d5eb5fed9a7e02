"""Recorded rates and specific forces fed to an ideal sensor, and its attitude held against a reference."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from attitude_fmu.models.attitude_sensor import MODEL, Inputs, Parameters
from attitude_fmu.models.record import defaults
from attitude_fmu.models.system import Run

Array = NDArray[np.float64]
ALIGNMENT_TIME = 0.5
"""s at rest at the start of a recording."""


class Recording(NamedTuple):
    """One trial: samples of an IMU and, at some of them, the attitude seen by cameras."""

    name: str
    period: float
    rate: Array
    specific_force: Array
    reference: Array
    at: NDArray[np.int64]


def load(path: Path) -> Recording:
    """A trial packed as ``.npz`` with `gyr` (rad/s), `acc` (m/s^2), `q` (w, x, y, z), `idx` and `Ts` (s)."""
    with np.load(path) as packed:
        return Recording(
            path.stem,
            float(packed["Ts"]),
            packed["gyr"].astype(float),
            packed["acc"].astype(float),
            packed["q"].astype(float),
            packed["idx"].astype(np.int64),
        )


def ideal_parameters(period: float) -> Parameters:
    """An ideal device that reads at the recording's rate and solves by the default solver."""
    parameters: Parameters = defaults(Parameters)
    return parameters._replace(
        ideal=True,
        processor=parameters.processor._replace(period=period),
        alignment=parameters.alignment._replace(duration=ALIGNMENT_TIME),
    )


def attitudes(recording: Recording, parameters: Parameters) -> Array:
    """q_nb after every sample, shape (n, 4)."""
    still = defaults(Inputs)
    run = Run(MODEL, parameters, still, name=recording.name)
    q_nb = np.empty((len(recording.rate), 4))
    samples: Any = zip(recording.rate.tolist(), recording.specific_force.tolist(), strict=True)
    for n, (rate, force) in enumerate(samples):
        inputs = still._replace(rate=tuple(rate), specific_force=tuple(force))
        run.advance(inputs, (n + 1) * recording.period)
        q_nb[n] = run.state.attitude.q_nb
    return q_nb


def inclination_errors(reference: Array, estimate: Array) -> Array:
    """2 acos(sqrt(e_w^2 + e_z^2)) with e = q_estimate (x) q_reference^-1: tilt apart from heading, rad.

    Source: the metric of the BROAD benchmark (Laidig et al., Data 2021, 6(7), 72).
    """
    w, v = estimate[:, 0], estimate[:, 1:]
    a, b = reference[:, 0], reference[:, 1:]
    real = w * a + np.sum(v * b, axis=1)
    up = (a[:, None] * v - w[:, None] * b - np.cross(v, b))[:, 2]
    errors: Array = 2.0 * np.arccos(np.clip(np.hypot(real, up), 0.0, 1.0))
    return errors


def inclination_rmse(recording: Recording, q_nb: Array) -> float:
    """Root mean square of the inclination error over the reference's rows, rad."""
    errors = inclination_errors(recording.reference, q_nb[recording.at])
    return float(np.sqrt(np.mean(errors**2)))
