"""The command calibrate: a piece on the turntable, what is written, and what it gains in another run."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from attitude_fmu.cosim import calibrate as command
from attitude_fmu.cosim.calibration_schedule import Schedule
from attitude_fmu.cosim.command_line import application
from attitude_fmu.cosim.devices import device_parameters
from attitude_fmu.cosim.master import simulate
from attitude_fmu.cosim.ssp import read_ssv
from attitude_fmu.cosim.system import Component, System
from attitude_fmu.models.attitude.rotations import STANDARD_GRAVITY
from attitude_fmu.models.attitude_sensor import SOLVER

DEVICE, SPECIMEN = "ADXRS450_ADXL355", 3
SHORT = Schedule((-5.0, 30.0, 65.0), (50.0,), 1, rest=1.0, verified_rest=0.6)
"""Enough to see what the command does; what it reaches is for the slow test."""


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("calibration")


def calibrate(*arguments: str) -> Result:
    return CliRunner().invoke(application, ["calibrate", *arguments])


def asked(out: Path, dist: Path) -> tuple[str, ...]:
    return ("--device", DEVICE, "--specimen", str(SPECIMEN), "--quick", "--out", str(out), "--dist", str(dist))


@pytest.fixture(scope="module")
def short() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(command, "QUICK", SHORT)
        yield


@pytest.fixture(scope="module")
def done(out: Path, bench_dist: Path, short: None) -> Result:
    found = calibrate(*asked(out, bench_dist))
    assert found.exit_code == 0, found.stderr
    return found


def tilt_errors(out: Path) -> dict[str, Any]:
    """Errors of pitch and roll by case, deg."""
    with (out / "residuals.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return {
        case: np.array(
            [[float(row["pitch error (deg)"]), float(row["roll error (deg)"])] for row in rows if row["case"] == case]
        )
        for case in ("before", "after", "repeatable")
    }


def test_the_static_error_falls_tenfold_and_below_a_twentieth_of_a_degree(done: Result, out: Path) -> None:
    assert "reaches the goal" in " ".join(done.stdout.split())
    errors = tilt_errors(out)
    # 36 angles: every rest was reached
    assert {len(found) for found in errors.values()} == {36}
    rms = {case: np.sqrt(np.mean(found**2)) for case, found in errors.items()}
    assert rms["after"] < 0.1 * rms["before"]
    assert np.max(np.abs(errors["after"])) < 0.05


@pytest.mark.slow
@pytest.mark.parametrize(("device", "largest"), [("ADXRS450_ADXL355", 0.01), ("ADIS16354_150", 0.075)])
def test_the_whole_schedule_leaves_what_the_part_itself_wanders(
    device: str, largest: float, bench_dist: Path, tmp_path: Path
) -> None:
    """0.002 deg rms of an ADXL355 (the table), 0.015 deg of an ADIS16354 (flicker, registers); bounds: five times."""
    found = calibrate("--device", device, "--specimen", "1", "--out", str(tmp_path), "--dist", str(bench_dist))
    assert found.exit_code == 0, found.stderr
    errors = tilt_errors(tmp_path)
    assert {len(found) for found in errors.values()} == {36 * 7}
    assert np.sqrt(np.mean(errors["after"] ** 2)) < 0.1 * np.sqrt(np.mean(errors["before"] ** 2))
    assert np.max(np.abs(errors["after"])) < largest
    with (tmp_path / "calibration.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    off = [(float(row["fitted"]) - float(row["true"])) / float(row["standard error"]) for row in rows]
    # of 57 coefficients that are off by chance none is beyond 4.5 sigma in 99.9 % of all pieces
    assert len(rows) == 57
    assert np.max(np.abs(off)) < 4.5


@pytest.mark.usefixtures("done")
def test_coefficients_are_those_of_the_piece(out: Path) -> None:
    with (out / "calibration.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 9 + 3 * 5 + 9 + 9 + 3 * 5
    off = {
        (row["part"], row["coefficient"]): (float(row["fitted"]) - float(row["true"])) / float(row["standard error"])
        for row in rows
    }
    # but for the biases, whose few power-ups make Student's t of one degree of freedom of them, none is off by 5 sigma
    assert max(abs(x) for (_, name), x in off.items() if not name.startswith("bias")) < 5.0


@pytest.mark.usefixtures("done")
def test_the_file_calibrates_the_piece_in_another_system(out: Path, bench_dist: Path) -> None:
    pitch, roll = np.radians((17.0, -29.0))
    up = STANDARD_GRAVITY * np.array((-np.cos(pitch) * np.sin(roll), np.sin(pitch), np.cos(pitch) * np.cos(roll)))
    tilted = {f"sensor.specific_force[{i}]": float(x) for i, x in enumerate(up, 1)}
    bench = (
        System("bench", (Component("sensor", bench_dist / "AttitudeSensor.fmu"),))
        .with_set(device_parameters(DEVICE, SPECIMEN))
        .with_values("tilted", {**tilted, "sensor.temperature": 313.15, "sensor.alignment.duration": 0.0})
        .with_values("levelling", {"sensor.solver.kind": SOLVER.value("levelling"), "sensor.seed": 77})
    )
    errors = []
    for system in (bench, bench.with_set(read_ssv(out / "calibration.ssv"))):
        results = simulate(system, stop_time=3.0, step=0.005, record="sensor.euler.*").results
        read = [np.mean(results[f"sensor.euler.{angle}"][20:]) for angle in ("pitch", "roll")]
        errors.append(np.degrees(np.max(np.abs(np.array(read) - (pitch, roll)))))
    assert errors[1] < 0.1 * errors[0]
    assert errors[1] < 0.05


@pytest.mark.usefixtures("done")
def test_the_same_command_again_runs_nothing(out: Path, bench_dist: Path) -> None:
    def made() -> dict[Path, int]:
        return {path: path.stat().st_mtime_ns for path in out.rglob("*.npz")}

    before, table = made(), (out / "calibration.csv").read_text()
    assert len(before) == 3 + 3
    assert calibrate(*asked(out, bench_dist)).exit_code == 0
    assert made() == before
    assert (out / "calibration.csv").read_text() == table


@pytest.mark.usefixtures("done")
def test_the_picture_and_nothing_else_is_written(out: Path) -> None:
    names = {"calibration.ssv", "calibration.csv", "residuals.csv", "calibration.png", "trials"}
    assert {path.name for path in out.iterdir()} == names


def test_what_there_is_not_is_refused(bench_dist: Path, tmp_path: Path) -> None:
    refused = calibrate("--device", "ADIS16355", "--out", str(tmp_path / "new"), "--dist", str(bench_dist))
    assert refused.exit_code == 1
    assert "there is no device called 'ADIS16355'; did you mean ADIS16354" in refused.stderr
    assert not (tmp_path / "new").exists()
    refused = calibrate("--set", "gyro.basi[1]=0.1", "--out", str(tmp_path / "new"), "--dist", str(bench_dist))
    assert refused.exit_code == 1
    assert "has no variable 'gyro.basi[1]'; did you mean gyro.bias[1]" in refused.stderr
    refused = calibrate("--set", "gyro.range=-1", "--out", str(tmp_path / "new"), "--dist", str(bench_dist))
    assert refused.exit_code == 1
    assert "gyro.range" in refused.stderr


def test_a_folder_that_cannot_be_written_is_refused(bench_dist: Path, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("not a folder")
    refused = calibrate("--out", str(tmp_path / "taken"), "--dist", str(bench_dist))
    assert refused.exit_code == 1
    assert f"cannot write into {tmp_path / 'taken'}" in refused.stderr
