"""The PID of the stabilised head: its parts, and the same controller as a response and as a system."""

from __future__ import annotations

import numpy as np
import pytest

from attitude_fmu.cosim.control.head_models import BODY_RATES
from attitude_fmu.cosim.control.head_pid import DEEP, ENCODERS, WIDE, Pid, pid_controller, pid_response
from attitude_fmu.cosim.control.responses import response

DT = 0.002
PIDS = (Pid(4e-3, 60.0, 15.0, 0.3, 3.0), Pid(2e-3, 80.0, 30.0, 0.1, 10.0), Pid(1e-3, 120.0, 20.0, 1.0, 30.0))


def test_response_and_system_are_the_same_controller() -> None:
    f = np.geomspace(0.01, 249.0, 80)
    A, B, C, D, _ = pid_controller(PIDS, DT)
    found = response(A, B, C, D, f, DT)
    wanted = pid_response(PIDS, f, DT)
    # the integral's pole at 1 costs digits at low frequencies
    assert np.abs(found - wanted).max(axis=(1, 2)) == pytest.approx(0.0, abs=1e-7 * np.abs(wanted).max())
    assert np.allclose(found, wanted, rtol=1e-6, atol=1e-9)


def test_each_axis_reads_its_gyro_and_its_encoder_only() -> None:
    read = np.abs(pid_response(PIDS, np.array([1.0, 30.0]), DT)).max(axis=0) > 0.0
    for axis, (element, _) in enumerate(BODY_RATES):
        assert set(np.flatnonzero(read[axis])) == {element, ENCODERS + axis}


def test_gyro_and_encoder_together_tell_the_angle_at_every_frequency() -> None:
    s = 2j * np.pi * np.geomspace(0.001, 1e3, 50)
    by_gyro, by_joint = PIDS[0].angle(s)
    assert np.allclose(s * by_gyro + by_joint, 1.0, rtol=1e-12)
    # the encoder alone at rest, the gyro between its corners
    assert abs(by_joint[0]) == pytest.approx(1.0, abs=0.01)
    assert abs(PIDS[1].angle(2j * np.pi)[1]) < 0.15


def test_notch_stays_at_its_frequency_when_sampled() -> None:
    pid = PIDS[2]
    z = np.exp(2j * np.pi * pid.notch * DT)
    s = 2.0 / DT * (z - 1.0) / (z + 1.0)
    assert pid.stop(s, DT) == pytest.approx(DEEP / WIDE, rel=1e-9)


def test_gain_crosses_a_free_inertia_55_degrees_ahead() -> None:
    pid = PIDS[0]
    s = 2j * np.pi * pid.crossover
    loop = -pid.gain(s) / (pid.inertia * s * s)
    # atan 3 + atan 10 - 90 - atan 1/5
    assert np.degrees(np.angle(loop)) + 180.0 == pytest.approx(54.5, abs=0.1)
    assert abs(loop) == pytest.approx(1.0, abs=0.1)


def test_only_the_integrals_follow_a_limit() -> None:
    A, _, C, _, lead = pid_controller(PIDS, DT)
    moved = np.flatnonzero(np.any(lead != 0.0, axis=1))
    assert len(moved) == len(PIDS)
    assert np.allclose(np.diag(A)[moved], 1.0)
    # with the output held, each forgets at its own corner, w_c/10
    kept = np.linalg.eigvals((A - lead @ C)[np.ix_(moved, moved)])
    wanted = [1.0 - DT * 2.0 * np.pi * pid.crossover / 10.0 for pid in PIDS]
    assert np.allclose(np.sort(kept), np.sort(wanted))
