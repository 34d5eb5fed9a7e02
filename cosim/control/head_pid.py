"""A PID on each axis of the stabilised head, shaped on the true loop.

    q = joint + F (gyro/s - joint),   F = s w_b / ((s + w_0) (s + w_b))
    u = -J w_c (s + w_d) (s + w_i) / (s (1 + s/w_n)) N q

q is the camera's angle as two sensors tell it: between w_0 and w_b the gyro, whose drift matters below and whose delay
above; outside the joint's encoder, which does not see the tripod move. N is a notch at the ball head's resonance. A
cascade of a rate loop in an angle loop with the same gains is the same controller.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import control  # type: ignore[import-untyped]
import numpy as np

from ..errors import LinearisationRefusedError
from .conditioning import Array
from .head_models import AXES, BODY_RATES, JOINT
from .responses import Complex
from .stabilised_head import Controller, Head, controlled, jitter_of_parts, radius, single_loops

READINGS = 9
ENCODERS = 6
"""Where the encoders' readings begin, behind three gyros and three accelerometers."""

LEAD, INTEGRAL, FILTER = 3.0, 10.0, 5.0
"""w_c/w_d, w_c/w_i and w_n/w_c: 55 degrees of phase ahead of a double integrator at the crossover."""

DEEP, WIDE = 0.1, 0.5
"""Damping ratios of the notch's zeros and poles; assumption."""

_CROSSOVERS = tuple(6.0 * 2.0 ** (k / 4.0) for k in range(13))
_SLOW = (0.1, 0.3, 1.0, 3.0)
_BLENDS = (0.3, 1.0, 3.0, 10.0, 30.0)

PEAK = 1.8
"""Largest |S| of each loop, the others closed: a gain margin of 7 dB and a phase margin of 32 degrees at least."""

_ROLL = 0.3
"""Weight of the roll, which turns the picture but not the line of sight; assumption."""

_THINNED = 3
"""Every third frequency does for comparing designs."""

_INERTIA_AT = 40.0
"""Hz; above friction and tripod, below the ball head: where a joint's inertia is read off."""


class Pid(NamedTuple):
    """Inertia (kg.m2), notch, crossover w_c, and the band w_0 to w_b of the gyro (Hz)."""

    inertia: float
    notch: float
    crossover: float
    slow: float
    blend: float

    def angle(self, s: Any) -> tuple[Any, Any]:
        """q by the gyro and by the joint's angle."""
        w_0, w_b = 2.0 * np.pi * self.slow, 2.0 * np.pi * self.blend
        both = (s + w_0) * (s + w_b)
        return w_b / both, (s * s + w_0 * s + w_0 * w_b) / both

    def gain(self, s: Any) -> Any:
        """u by q."""
        w = 2.0 * np.pi * self.crossover
        return -self.inertia * w * (s + w / LEAD) * (s + w / INTEGRAL) / (s * (1.0 + s / (FILTER * w)))

    def stop(self, s: Any, dt: float) -> Any:
        """N, at its frequency after sampling by Tustin's rule."""
        w = 2.0 / dt * np.tan(np.pi * self.notch * dt)
        return (s * s + 2.0 * DEEP * w * s + w * w) / (s * s + 2.0 * WIDE * w * s + w * w)


def pid_response(pids: Sequence[Pid], frequencies: Array, dt: float) -> Complex:
    """Torques by the nine readings, sampled by Tustin's rule: frequencies x 3 x 9."""
    z = np.exp(2j * np.pi * frequencies * dt)
    s = 2.0 / dt * (z - 1.0) / (z + 1.0)
    K = np.zeros((len(z), len(pids), READINGS), complex)
    for axis, (pid, (element, sign)) in enumerate(zip(pids, BODY_RATES, strict=True)):
        (gyro, joint), gain = pid.angle(s), pid.gain(s) * pid.stop(s, dt)
        K[:, axis, element], K[:, axis, ENCODERS + axis] = sign * gain * gyro, gain * joint
    return K


def pid_controller(pids: Sequence[Pid], dt: float) -> Controller:
    """The same as a system: on each axis integral, lag of the lead, notch and angle.

    Where a limit cuts the torque, or another controller gives it, the integrals alone follow.
    """
    systems = [_axis(pid, sign, dt) for pid, (_, sign) in zip(pids, BODY_RATES, strict=True)]
    together = control.append(*systems)
    B, D = np.zeros((together.nstates, READINGS)), np.zeros((len(pids), READINGS))
    L = np.zeros((together.nstates, len(pids)))
    for axis, (element, _) in enumerate(BODY_RATES):
        for place, own in ((element, 2 * axis), (ENCODERS + axis, 2 * axis + 1)):
            B[:, place], D[:, place] = together.B[:, own], together.D[:, own]
        integral = axis * systems[axis].nstates
        L[integral, axis] = dt * 2.0 * np.pi * pids[axis].crossover / INTEGRAL / together.C[axis, integral]
    return Controller(together.A, B, together.C, D, L)


def _axis(pid: Pid, sign: float, dt: float) -> control.StateSpace:
    """From gyro and joint angle to torque, the integral's state first."""
    s = control.tf("s")
    w, lag = 2.0 * np.pi * pid.crossover, 2.0 * np.pi * pid.crossover * FILTER
    size, lead, integral = -pid.inertia * w, w / LEAD, w / INTEGRAL
    parts = [[size * lead * integral, -size * (lag - lead) * (lag - integral)]]
    gain = control.sample_system(control.ss(np.diag([0.0, -lag]), np.ones((2, 1)), parts, size * lag), dt, "tustin")
    angles = [control.sample_system(control.ss(part), dt, "tustin") for part in pid.angle(s)]
    stop = control.sample_system(control.ss(pid.stop(s, dt)), dt, "tustin")
    angle = stop * control.ss([], [], [], [[sign, 1.0]], dt) * control.append(*angles)
    return control.ss(
        np.block([[gain.A, gain.B @ angle.C], [np.zeros((angle.nstates, 2)), angle.A]]),
        np.vstack([gain.B @ angle.D, angle.B]),
        np.hstack([gain.C, gain.D @ angle.C]),
        gain.D @ angle.D,
        dt,
        remove_useless_states=False,
    )


def inertias(head: Head) -> Array:
    """What each motor turns, kg.m2: 1/|(2 pi f)^2 angle/torque| well above the friction's stiffness."""
    k = int(np.searchsorted(head.frequencies, _INERTIA_AT))
    angle = np.abs(np.diagonal(head.mean.torque[k, JOINT]))
    return np.asarray(1.0 / ((2.0 * np.pi * head.frequencies[k]) ** 2 * angle))


def resonances(head: Head) -> Array:
    """Where each joint resonates with the ball head, Hz: the peak of |(2 pi f)^2 angle/torque| above the loop."""
    f = head.frequencies
    above = f > _INERTIA_AT
    angles = np.abs(np.diagonal(head.mean.torque[above, JOINT], axis1=1, axis2=2))
    return np.asarray(f[above][np.argmax(angles * f[above, None] ** 2, axis=0)])


def pid_design(head: Head) -> list[Pid]:
    """The gains with the least jitter of all with |S| below `PEAK` in each loop; axis by axis, the others closed.

    Raises `LinearisationRefusedError` where there are none.
    """
    thin = head.thinned(_THINNED)
    shapes = zip(inertias(head), resonances(head), strict=True)
    pids = [Pid(inertia, notch, _CROSSOVERS[0], _SLOW[0], _BLENDS[0]) for inertia, notch in shapes]
    for axis, name in enumerate(AXES):
        found = []
        for gains in product(_CROSSOVERS, _SLOW, _BLENDS):
            pids[axis] = Pid(*pids[axis][:2], *gains)
            loop = controlled(thin, pid_response(pids, thin.frequencies, thin.clocks.period))
            if np.abs(1.0 / (1.0 + single_loops(loop)[:, axis])).max() < PEAK:
                yaw, pitch, roll = jitter_of_parts(thin, loop)
                found.append((yaw**2 + pitch**2 + (_ROLL * roll) ** 2, gains))
        for _, gains in sorted(found):
            pids[axis] = Pid(*pids[axis][:2], *gains)
            if radius(head, pid_controller(pids, head.clocks.period)) < 1.0:
                break
        else:
            raise LinearisationRefusedError(
                f"no PID of {name} has a peak of |S| below {PEAK:g}: the sensor is too late for this head; choose "
                "one with less delay"
            )
    return pids
