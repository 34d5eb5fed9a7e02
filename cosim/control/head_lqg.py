"""An LQG for all three axes of the stabilised head.

The estimator knows plant, wind and friction on the move, and the sensor with its noise and delay as it is. What it
does not know is put in as noise, which is what gives the loop its margins; these numbers are below.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg  # type: ignore[import-untyped]

from ..errors import LinearisationRefusedError
from .conditioning import Array
from .head_models import JOINT, LINE, Friction
from .lqg import Cost, Observer, Plant, estimator, lqg, regulator, truncated
from .stabilised_head import MOTION, Controller, Head, Loop, closed_loop, line_of_sight

CORNER = 0.55
"""Hz; 1 - sinc^2(f T) of an exposure of T = 1 s rises as a first-order high-pass of this corner, sqrt(3)/(pi T)."""

ENCODER = 2e-5
"""rad, rms of an encoder's error: 18 bit have steps of 24 urad, 7 urad rms; threefold for what the linear plant does
not know. Assumption; the plant's FMU gives true angles."""

TORQUES = (1e-4, 2e-4, 3e-4, 4.5e-4, 6e-4, 9e-4, 1.3e-3, 2e-3)
"""N.m/sqrt(Hz), white torque noise that stands for the plant's unknowns: the least of these that gives the margins."""

DISK = 0.6
"""Disk margin that is asked for: 33 degrees or 5.4 dB, in all three loops at once."""

_REDUCED = 0.02
"""By how much the reduced controller's jitter may be larger."""

_ORDERS = range(30, 151, 5)

_RATE, _FORCE = 1e-4, 1e-3
"""rad/s and m/s2, rms of further white noise of the readings: keeps the estimator regular where a sensor is ideal."""

_WEIGHTS = (1.0, 1.0, 0.3)
"""Of yaw, pitch and roll; the roll turns the picture but not the line of sight, assumption."""

_LEAK = 0.1
"""Weight of the angle itself beside its motion within exposures: the head stays where it points."""

_EFFORT = 4e-3
"""rad/N.m: what a torque may cost in angle; bounds the crossover."""


class Lqg(NamedTuple):
    """The controller, its loop, and the loop of the one from which it was reduced."""

    controller: Controller
    loop: Loop
    whole: Loop


def lqg_design(head: Head, friction: Friction) -> Lqg:
    """The LQG with the least torque noise in its estimator that has the margins, reduced as far as it costs 2 %.

    Raises `LinearisationRefusedError` where none has them.
    """
    best = 0.0
    for torque in TORQUES:
        observer, readings, torques = _designed(head, friction, torque)
        loop = closed_loop(head, _controller(observer))
        if loop.radius >= 1.0:
            continue
        best = max(best, float(loop.disk.min()))
        if best >= DISK:
            return _reduced(loop, observer, readings, torques)
    raise LinearisationRefusedError(
        f"no LQG has a disk margin of {DISK:g}, the best has {best:.2g}: the sensor is too late for this head; choose "
        "a sensor with less delay, or a stiffer ball head"
    )


def _controller(observer: Observer) -> Controller:
    return Controller(*observer.controller(), observer.Gu)


def _reduced(whole: Loop, observer: Observer, readings: Array, torques: Array) -> Lqg:
    largest = line_of_sight(whole.jitter()) * (1.0 + _REDUCED)
    for order in _ORDERS:
        if order >= len(observer.F):
            break
        controller = _controller(truncated(observer, order, readings, torques))
        loop = closed_loop(whole.head, controller)
        if loop.radius < 1.0 and loop.disk.min() >= DISK and line_of_sight(loop.jitter()) <= largest:
            return Lqg(controller, loop, whole)
    return Lqg(_controller(observer), whole, whole)


def _designed(head: Head, friction: Friction, torque: float) -> tuple[Observer, Array, Array]:
    """The observer, and what its inputs are in units of: innovations (9), torques (3)."""
    dt = head.clocks.period
    plant = _plant(head, friction, torque)
    cost = Cost(CORNER, np.array(_WEIGHTS), _LEAK, np.full(3, _EFFORT))
    # the sensor's own states follow the plant's and cost nothing
    k = head.plant.mean.system.nstates + 3
    part = Plant(plant.A[:k, :k], plant.B[:k], plant.C[:, :k], plant.E[:, :k], plant.W[:k, :k], plant.R)
    correction, readings = estimator(plant)
    return lqg(plant, regulator(part, cost, dt), correction), readings, np.full(3, torque / np.sqrt(2.0 * dt))


def _plant(head: Head, friction: Friction, torque: float) -> Plant:
    """x = (plant, torque of friction, sensor), y = (readings, joint angles)."""
    dt = head.clocks.period
    p, s = head.plant.mean, head.sensor.noise
    P, S = p.system, s.system
    n, m = P.nstates, S.nstates
    kept = np.exp(-2.0 * np.pi * friction.corner * dt)
    A = np.block([[P.A, P.B], [np.zeros((3, n)), np.diag(kept)]])
    B = np.vstack([P.B, np.zeros((3, 3))])
    white = P.B * torque / np.sqrt(2.0 * dt)
    G = linalg.block_diag(np.hstack([p.G @ np.sqrt(p.QN), white]), np.diag(friction.rms * np.sqrt(1.0 - kept**2)))
    # the sensor steps after the plant: it takes the motion at the end of the step
    moved = S.B @ np.hstack([P.C[MOTION], np.zeros((6, 3))])
    A = np.block([[A, np.zeros((n + 3, m))], [moved @ A, S.A]])
    B, own = np.vstack([B, moved @ B]), s.G @ np.sqrt(s.QN)
    G = np.block([[G, np.zeros((n + 3, own.shape[1]))], [moved @ G, own]])
    joint, line = np.zeros((3, n + 3 + m)), np.zeros((3, n + 3 + m))
    joint[:, :n], line[:, :n] = P.C[JOINT], P.C[LINE]
    C = np.vstack([np.hstack([np.zeros((6, n + 3)), S.C]), joint])
    R = np.diag(np.repeat(np.square([_RATE, _FORCE, ENCODER]), 3))
    return Plant(A, B, C, line, G @ G.T, R)
