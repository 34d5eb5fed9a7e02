"""The command ``attitude-fmu sensor``: files, table, errors."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from attitude_fmu.cosim.command_line import application
from attitude_fmu.cosim.sensor import sources_of, values_of
from attitude_fmu.cosim.sensor_report import bounds, shown, summary
from attitude_fmu.models.sensors.datasheet import Tolerance
from attitude_fmu.models.sensors.devices import DEVICES

FILES = {"gyro.png", "accelerometer.png", "characteristics.csv"}
HEARING_CTRL_C = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs the tests may ignore it
from attitude_fmu.cosim.command_line import main
main()
"""


def sensor(*arguments: str, wide: bool = True) -> Result:
    return CliRunner(env={"COLUMNS": "200"} if wide else {}).invoke(application, ["sensor", *arguments])


@pytest.fixture(scope="module")
def shown_sensor(sensor_dist: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Result]:
    out = tmp_path_factory.mktemp("shown")
    settings = ("--set", "accelerometer.output_data_rate=125_Hz", "--set", "gyro.noise_density=4e-4")
    done = sensor("ADXRS450_ADXL355", "--quick", "--out", str(out), "--dist", str(sensor_dist), *settings)
    return out, done


def rows(path: Path) -> Iterator[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        yield from csv.DictReader(file)


def test_the_command_writes_pictures_and_table_and_shows_it(shown_sensor: tuple[Path, Result]) -> None:
    out, done = shown_sensor
    assert done.exit_code == 0, done.stderr
    assert {path.name for path in out.iterdir()} == FILES
    for name in ("gyro.png", "accelerometer.png"):
        assert (out / name).read_bytes()[:4] == b"\x89PNG"
    for text in ("noise density", "bias instability, Allan floor", "Rev. 0 Table 1", "agree with the datasheet"):
        assert text in done.stdout
    assert "ADXRS450_ADXL355, specimen 1; set: accelerometer.output_data_rate=125_Hz" in done.stdout


def test_a_number_that_was_changed_no_longer_agrees(shown_sensor: tuple[Path, Result]) -> None:
    lines = {(row["part"], row["quantity"]): row for row in rows(shown_sensor[0] / "characteristics.csv")}
    density = lines["gyro", "noise density"]
    assert density["sheet"] == "0.015"
    assert density["verdict"] == "FAIL"
    # 4e-4 rad/s/Hz^0.5, known to 1 % or so
    assert float(density["modelled"]) == pytest.approx(0.0229, rel=0.05)
    assert lines["accelerometer", "noise density"]["verdict"] == "pass"


def test_the_sheet_is_read_at_the_chosen_setting(shown_sensor: tuple[Path, Result]) -> None:
    lines = {(row["part"], row["quantity"]): row for row in rows(shown_sensor[0] / "characteristics.csv")}
    delay = lines["accelerometer", "delay"]
    assert delay["sheet"] == "12.34"
    assert delay["verdict"] == "pass"


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("ADXRS450_ADXL35",), 1, "there is no device called 'ADXRS450_ADXL35'; did you mean ADXRS450_ADXL355"),
        (("adis16354_300",), 1, "did you mean ADIS16354_300"),
        (("nothing",), 1, f"(devices: {', '.join(DEVICES)})"),
        (("ADXRS450_ADXL355", "--set", "sede=3"), 1, "no variable 'sede'; did you mean seed?"),
        (("ADXRS450_ADXL355", "--set", "gyro.range=fast"), 1, "gyro.range = fast: not a finite number"),
        (("ADXRS450_ADXL355", "--set", "seed"), 2, "write it as parameter=value"),
    ],
)
def test_what_cannot_be_measured_is_refused(
    sensor_dist: Path, tmp_path: Path, arguments: tuple[str, ...], code: int, message: str
) -> None:
    out = tmp_path / "out"
    done = sensor(*arguments, "--quick", "--out", str(out), "--dist", str(sensor_dist))
    assert done.exit_code == code
    assert message in done.stderr
    assert not out.exists() or not list(out.iterdir())


@pytest.mark.skipif(sys.platform == "win32", reason="signals")
def test_an_interrupted_run_leaves_no_half_files(sensor_dist: Path, tmp_path: Path) -> None:
    command = ["sensor", "ADXRS450_ADXL355", "--out", str(tmp_path), "--dist", str(sensor_dist)]
    with subprocess.Popen(
        [sys.executable, "-c", HEARING_CTRL_C, *command],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        try:
            deadline = time.monotonic() + 30.0
            while not list(tmp_path.glob(".sensor_*")) and time.monotonic() < deadline:
                time.sleep(0.05)
            time.sleep(1.0)
            process.send_signal(signal.SIGINT)
            _, said = process.communicate(timeout=30.0)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130
    assert "stopped by the user" in said
    assert "Traceback" not in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("device", DEVICES)
def test_every_device_has_values_and_sources_for_the_same_names(device: str) -> None:
    assert values_of(device).keys() == sources_of(device).keys()


def test_limits_of_a_tolerance_are_three_sigma_or_its_own() -> None:
    sigma = Tolerance(2.0, "%", "sigma", "a sheet", mean=1.0)
    assert bounds(sigma) == pytest.approx((-0.05, 0.07))
    assert bounds(sigma._replace(limit=4.0)) == pytest.approx((-0.03, 0.05))
    assert bounds(sigma._replace(reading="limits")) == pytest.approx((-0.01, 0.03))
    assert bounds(sigma._replace(reading="three sigma")) == pytest.approx((-0.01, 0.03))


@pytest.mark.parametrize(
    ("value", "text"), [(0.0, "0"), (0.015, "0.015"), (1234.56, "1235"), (2e-5, "2.0e-05"), (float("nan"), "none")]
)
def test_numbers_are_shown_in_few_digits(value: float, text: str) -> None:
    assert shown(value) == text


def test_nothing_judged_is_summed_up_as_such() -> None:
    assert summary(()) == "0 of 0 numbers agree with the datasheet"
