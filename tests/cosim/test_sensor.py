"""The command ``attitude-fmu sensor``: files, table, errors."""

from __future__ import annotations

import csv
import io
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner, Result

from attitude_fmu.cosim.command_line import application
from attitude_fmu.cosim.sensor import sources_of, values_of
from attitude_fmu.cosim.sensor_report import Line, bounds, limits_name, shown, spread, summary, table
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
    settings = (
        *("--set", "accelerometer.output_data_rate=125_Hz"),
        *("--set", "gyro.noise_density=4e-4"),
        *("--set", "gyro.clock_error[3]=-0.18"),
        *("--set", "gyro.bias_temperature_slope[2]=0.001"),
        *("--set", "gyro.thermometer.sensitivity=4.9"),
    )
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
    low, high = map(float, density["interval"].split(" to "))
    # 4e-4 rad/s/Hz^0.5 is 0.0229 deg/s; the record's 95 % interval, twice as wide: 99.99 %
    assert abs(float(density["modelled"]) - 0.02292) < high - low
    assert high - low < 0.0015
    assert lines["accelerometer", "noise density"]["verdict"] == "pass"
    assert lines["gyro", "offset by temperature"]["verdict"] == "FAIL"
    assert lines["gyro", "thermometer codes"]["verdict"] == "FAIL"
    assert lines["gyro", "thermometer codes"]["modelled"] == "0 of 3 exact"
    assert lines["accelerometer", "thermometer codes"]["modelled"] == "4 of 4 exact"


def test_the_filter_of_a_slow_piece_is_right_at_its_clock_and_too_late_for_the_sheet(
    shown_sensor: tuple[Path, Result],
) -> None:
    lines = {(row["part"], row["quantity"]): row for row in rows(shown_sensor[0] / "characteristics.csv")}
    # 63/f0 at 13.1 kHz is 4.8 ms; Table 1 ends at 4.75 ms
    assert lines["gyro", "delay, of any piece"]["verdict"] == "FAIL"
    assert lines["gyro", "delay"]["verdict"] == "pass"
    assert lines["gyro", "delay"]["modelled"].endswith(", 4.802")
    assert lines["gyro", "-3 dB frequency"]["verdict"] == "pass"
    # at a clock counted to 0.02 %
    assert float(lines["gyro", "-3 dB frequency"]["sheet"].split(", ")[2]) == pytest.approx(79.7 * 0.82, rel=3e-4)
    assert lines["gyro", "register words a second"]["verdict"] == "pass"


def test_a_random_walk_that_the_sheets_density_contradicts_is_shown_without_verdict(
    shown_sensor: tuple[Path, Result],
) -> None:
    lines = {(row["part"], row["quantity"]): row for row in rows(shown_sensor[0] / "characteristics.csv")}
    walk = lines["accelerometer", "velocity random walk"]
    assert (walk["sheet"], walk["rule"], walk["verdict"]) == ("5.3 XY, 7.7 Z", "contradicts the density", "")
    # 22.5 ug/rtHz / sqrt(2) * 60, as well known as the density: 4 %
    assert float(walk["modelled"]) == pytest.approx(22.5e-6 * 9806.65 / 2**0.5 * 60.0, rel=0.04)


def test_the_sheet_is_read_at_the_chosen_setting(shown_sensor: tuple[Path, Result]) -> None:
    lines = {(row["part"], row["quantity"]): row for row in rows(shown_sensor[0] / "characteristics.csv")}
    delay = lines["accelerometer", "delay"]
    assert delay["source"] == "ADXL355 Rev. D p. 26, table: 12.34 ms"
    clock = 1.0 + float(values_of("ADXRS450_ADXL355", 1)["accelerometer.clock_error"])
    # shown in four digits; the clock is counted to 0.02 %
    assert float(delay["sheet"]) == pytest.approx(12.34 / clock, rel=7e-4)
    assert delay["verdict"] == "pass"


def test_a_narrow_terminal_shows_verdicts_and_leaves_rules_and_sources_to_the_file() -> None:
    line = Line("gyro", "delay", "ms", "4", "3.94", "", True, "±2%", "a source", "datasheet")
    for width, is_told in ((80, False), (160, True)):
        console = Console(width=width, record=True, file=io.StringIO())
        console.print(table([line], "a part", width))
        text = console.export_text()
        assert "pass" in text
        assert ("a source" in text) == ("±2%" in text) == is_told


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("ADXRS450_ADXL35",), 1, "there is no device called 'ADXRS450_ADXL35'; did you mean ADXRS450_ADXL355"),
        (("adis16354_300",), 1, "did you mean ADIS16354_300"),
        (("nothing",), 1, f"(devices: {', '.join(DEVICES)})"),
        (("ADXRS450_ADXL355", "--set", "sede=3"), 1, "no variable 'sede'; did you mean seed?"),
        (("ADXRS450_ADXL355", "--set", "gyro.range=fast"), 1, "gyro.range = fast: not a finite number"),
        (("ADXRS450_ADXL355", "--set", "seed"), 2, "write it as parameter=value"),
        (("ADXRS450_ADXL355", "--set", "rate[1]=0.1"), 1, "rate[1] is an input: the bench drives it"),
        (("ADXRS450_ADXL355", "--set", "fault[1].kind=stuck"), 1, "fault[1].kind = stuck: a part with a fault"),
        (("ADXRS450_ADXL355", "--set", "heater.enabled=true"), 1, "heater.enabled = true: the temperatures would be"),
        (("ADXRS450_ADXL355", "--set", "ideal=true"), 1, "ideal = true: a sensor without errors"),
        (
            ("ADIS16354_75", "--set", "gyro.divider=1984", "--set", "accelerometer.divider=1984"),
            1,
            "the filter passes 0.00825 Hz: too little to find its noise",
        ),
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


def test_limits_are_called_by_what_binds() -> None:
    # the ADXL355's offset drift: typical 0.01, limits +-0.15 mg/degC
    drift = Tolerance(0.01, "mg/degC", "sigma", "a sheet", limit=0.15)
    assert limits_name(drift) == "3 sigma"
    assert limits_name(drift._replace(size=0.06)) == "limits"
    assert limits_name(drift._replace(reading="limits")) == "limits"


def test_pieces_without_an_error_get_no_verdict_for_it() -> None:
    tolerance = Tolerance(2.0, "%", "sigma", "a sheet")
    for values, verdict in (
        (np.zeros(3), None),
        (np.array([0.0, 0.05, 0.0]), True),
        (np.array([0.0, 0.07, 0.0]), False),
    ):
        line = spread("gyro", "scale error", ("%", 0.01), values, tolerance)
        assert line.agrees is verdict


def test_nothing_judged_is_summed_up_as_such() -> None:
    assert summary(()) == "0 of 0 numbers agree with the datasheet"
