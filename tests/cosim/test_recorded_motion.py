"""Recorded motion with optical ground truth, fed to the ideal device."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from vqf import VQF

from attitude_fmu.cosim import recorded_motion

FOLDER = os.environ.get("ATTITUDE_FMU_DATA")
with_recordings = pytest.mark.skipif(not FOLDER, reason="ATTITUDE_FMU_DATA names no folder of recordings")


def quaternions(rotations: Rotation) -> np.ndarray:
    return rotations.as_quat()[:, [3, 0, 1, 2]]


def test_the_metric_sees_tilt_and_not_heading() -> None:
    reference = Rotation.random(50, random_state=1)
    tilted = Rotation.from_rotvec([0.01, 0.0, 0.0]) * reference
    turned = Rotation.from_rotvec([0.0, 0.0, 1.0]) * reference
    assert recorded_motion.inclination_errors(quaternions(reference), quaternions(tilted)) == pytest.approx(0.01)
    assert recorded_motion.inclination_errors(quaternions(reference), quaternions(turned)) == pytest.approx(
        0.0, abs=1e-7
    )


@with_recordings
@pytest.mark.parametrize(
    ("trial", "published"),
    [("05_undisturbed_slow_rotation_with_breaks_B", 0.35), ("11_undisturbed_slow_translation_B", 0.42)],
)
def test_the_metric_gives_vqfs_published_figure(trial: str, published: float) -> None:
    recording = recorded_motion.load(Path(str(FOLDER)) / "broad" / f"{trial}.npz")
    peer = VQF(recording.period).updateBatch(
        np.ascontiguousarray(recording.rate), np.ascontiguousarray(recording.specific_force)
    )["quat6D"]
    assert np.degrees(recorded_motion.inclination_rmse(recording, peer)) == pytest.approx(published, abs=0.005)


@with_recordings
def test_the_default_solver_stays_near_the_reference_on_real_motion() -> None:
    # our own figures are 0.33 and 0.37 deg; twice that would be a broken solver, not a worse tuning
    for trial in ("11_undisturbed_slow_translation_B", "25_disturbed_tapping_B"):
        recording = recorded_motion.load(Path(str(FOLDER)) / "broad" / f"{trial}.npz")
        q_nb = recorded_motion.attitudes(recording, recorded_motion.ideal_parameters(recording.period))
        assert np.degrees(recorded_motion.inclination_rmse(recording, q_nb)) < 0.7
