"""Margins of loops, held against python-control, closed forms, and loops closed one by one."""

from __future__ import annotations

import control
import numpy as np
import pytest

from attitude_fmu.cosim.control.margins import disk_margin, gain_of, loop_at_a_time, margins, phase_of, sensitivity

F = np.geomspace(1e-3, 1e2, 4000)
S = 2j * np.pi * F
GRID = 2e-5
"""Square of the step between frequencies, (ln 1e5 / 4000)^2 = 8e-6, which linear interpolation errs by; twice that."""


def test_margins_are_those_of_python_control() -> None:
    s = control.tf("s")
    plant = 40.0 / (s * (s + 2.0) * (s + 20.0))
    gain, phase, _, crossover = control.margin(plant)
    found = margins(plant(S), F)
    assert found.gain_up == pytest.approx(gain, rel=GRID)
    assert found.gain_down == 0.0
    assert np.degrees(found.phase) == pytest.approx(phase, rel=GRID)
    assert 2.0 * np.pi * found.crossover == pytest.approx(crossover, rel=GRID)
    assert found.peak == pytest.approx(1.0 / control.stability_margins(plant)[2], rel=GRID)


def test_conditionally_stable_loop_has_a_margin_downwards() -> None:
    s = control.tf("s")
    loop = 10.0 * (s + 1.0) ** 2 / s**3
    # s^3 + k (s + 1)^2 is stable for k > 1/2: Routh
    assert margins(loop(S), F).gain_down == pytest.approx(0.05, rel=GRID)
    assert margins(loop(S), F).gain_up == np.inf


def test_poles_that_leave_through_one_and_minus_one_are_margins_too() -> None:
    """k/(z - 1.1) has its pole at 1.1 - k: stable for 0.1 < k < 2.1."""
    f = np.concatenate([[1e-6], np.geomspace(1e-2, 49.9, 200), [50.0]])
    found = margins(1.0 / (np.exp(2j * np.pi * f * 0.01) - 1.1), f)
    assert found.gain_down == pytest.approx(0.1, rel=1e-6)
    assert found.gain_up == pytest.approx(2.1, rel=1e-6)


def test_loop_without_a_crossing_has_all_margins() -> None:
    found = margins(0.1 / (1.0 + S), F)
    assert found[:4] == (0.0, np.pi, np.inf, 0.0)


def test_disk_margin_of_an_integrator_is_two_at_all_frequencies() -> None:
    # |1 + L| / |1 - L| = 1 for an imaginary L
    alpha = disk_margin(sensitivity((1.0 / S[::400])[:, None, None]))
    assert np.allclose(alpha, 2.0, rtol=1e-12)
    assert phase_of(2.0) == pytest.approx(0.5 * np.pi)
    assert gain_of(2.0) == np.inf


def test_disk_margin_of_one_loop_is_the_nearest_factor_that_makes_it_unstable() -> None:
    L = (1.5 * np.exp(-0.3 * S) / S)[:, None, None]
    alpha = disk_margin(sensitivity(L))
    assert np.allclose(alpha, 2.0 * np.abs(1.0 + L[:, 0, 0]) / np.abs(1.0 - L[:, 0, 0]), rtol=1e-9)
    found = margins(L[:, 0, 0], F)
    # what the disk promises is never more than what either margin alone has
    assert gain_of(float(alpha.min())) <= found.gain_up
    assert phase_of(float(alpha.min())) <= found.phase


def test_edges_of_the_disk_are_its_gain_and_its_phase() -> None:
    alpha = 0.7
    real, imaginary = (((1.0 + 0.5 * d) / (1.0 - 0.5 * d)) for d in (alpha, 1j * alpha))
    assert gain_of(alpha) == pytest.approx(real)
    assert abs(imaginary) == pytest.approx(1.0)
    assert phase_of(alpha) == pytest.approx(np.angle(imaginary))


def test_coupling_one_way_costs_no_disk_margin() -> None:
    random = np.random.default_rng(7)
    diagonal = np.zeros((6, 3, 3), complex)
    for i in range(3):
        diagonal[:, i, i] = 1.5 * random.standard_normal(6) + 1j * random.standard_normal(6)
    coupled = diagonal.copy()
    coupled[:, 0, 1], coupled[:, 0, 2], coupled[:, 1, 2] = 3.0, 1.0, 2.0
    alone = np.abs(np.einsum("fii->fi", diagonal) - 0.5).max(axis=1)
    found = disk_margin(coupled)
    # never on the unsafe side, and near: the infimum over scalings is not reached for a triangular matrix
    assert (found <= (1.0 + 1e-9) / alone).all()
    assert (found >= 0.95 / alone).all()


def test_loop_at_a_time_is_the_loop_with_the_others_closed() -> None:
    random = np.random.default_rng(8)
    L = random.standard_normal((5, 3, 3)) + 1j * random.standard_normal((5, 3, 3))
    found = loop_at_a_time(sensitivity(L))
    for i in range(3):
        rest = [k for k in range(3) if k != i]
        for k, one in enumerate(L):
            others = np.linalg.solve(np.eye(2) + one[np.ix_(rest, rest)], one[rest, i])
            assert found[k, i] == pytest.approx(one[i, i] - one[i, rest] @ others, rel=1e-10)
