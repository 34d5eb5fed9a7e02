from __future__ import annotations

import io
import math
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from attitude_fmu.cosim.interface import read_interface
from attitude_fmu.cosim.plot import Picture, plot
from attitude_fmu.cosim.recording import Results
from attitude_fmu.cosim.report import Report, Roles, angle_errors, jitter, report, roles_of, table, wrapped
from attitude_fmu.cosim.system import Component, System

ROLES = Roles("plant", "sensor", "controller")
AXES = ("yaw", "pitch", "roll")


def results(duration: float = 10.0, step: float = 0.001) -> Results:
    """Truth at rest; a sensor off by 1, 2 and 3 mrad, aligned from 2 s on."""
    names = [f"{part}.euler.{axis}" for part in ("plant", "sensor") for axis in AXES]
    dtype = np.dtype([("time", "f8"), *[(name, "f8") for name in names], ("sensor.aligned", "?")])
    rows = np.zeros(round(duration / step) + 1, dtype)
    rows["time"] = np.arange(len(rows)) * step
    rows["sensor.aligned"] = rows["time"] >= 2.0
    for number, axis in enumerate(AXES):
        rows[f"sensor.euler.{axis}"] = 1e-3 * (number + 1)
    return rows


def shown(numbers: Report) -> str:
    """The table as text."""
    text = io.StringIO()
    Console(width=100, file=text).print(table(numbers, "title"))
    return text.getvalue()


def test_angles_are_compared_the_short_way_round() -> None:
    rows = results()
    rows["plant.euler.yaw"] = math.pi - 1e-3
    rows["sensor.euler.yaw"] = -math.pi + 1e-3
    assert angle_errors(rows, "sensor", "plant", 0.0)["yaw"] == pytest.approx(2e-3, abs=1e-12)
    assert wrapped(np.array([3 * math.pi / 2])) == pytest.approx(-math.pi / 2)


def test_errors_are_counted_from_the_alignment_on() -> None:
    rows = results()
    rows["sensor.euler.pitch"][rows["time"] < 2.0] = 1.0
    rows["sensor.euler.pitch"][-1] = 5e-3
    numbers = report(rows, 5.0, ROLES, {})
    assert numbers.aligned == 2.0
    yaw, pitch, _ = numbers.errors
    assert yaw.rms == pytest.approx(1e-3)
    assert pitch.largest == pytest.approx(5e-3)
    assert numbers.real_time_factor == pytest.approx(2.0)


def test_jitter_is_the_rms_about_the_mean_of_each_exposure() -> None:
    rows = results()
    # a slow drift between exposures does not count, motion within one does; azimuth shrinks with elevation
    rows["plant.euler.pitch"] = math.pi / 3 + 100e-6 * math.sqrt(2) * np.sin(2 * math.pi * 10.0 * rows["time"])
    rows["plant.euler.yaw"] = np.floor(rows["time"]) + 200e-6 * math.sqrt(2) * np.cos(2 * math.pi * 5.0 * rows["time"])
    value = jitter(rows, "plant", 4.0)
    assert value is not None
    assert value.exposures == 6
    assert value.rms == pytest.approx(1e-6 * math.hypot(100.0, 200.0 * 0.5), rel=1e-3)
    assert value.worst == pytest.approx(value.rms, rel=1e-3)


def test_wander_is_the_rms_about_the_mean_of_all_exposures() -> None:
    rows = results()
    # a ramp of 6 urad over the six exposures from 4 s to 10 s: rms 6/sqrt(12), furthest 3
    rows["plant.euler.pitch"] = 1e-6 * rows["time"]
    rows["plant.euler.yaw"] = 0.0
    value = jitter(rows, "plant", 4.0)
    assert value is not None
    assert value.wander == pytest.approx(6e-6 / math.sqrt(12.0), rel=1e-2)
    assert value.furthest == pytest.approx(3e-6, rel=1e-2)
    assert value.rms == pytest.approx(1e-6 / math.sqrt(12.0), rel=1e-2)


def test_turning_through_north_is_no_jitter() -> None:
    rows = results()
    rows["plant.euler.yaw"] = wrapped(math.pi - 1e-6 + 2e-6 * (np.arange(len(rows)) % 2))
    value = jitter(rows, "plant", 4.0)
    assert value is not None
    assert value.rms == pytest.approx(1e-6, rel=1e-3)


def test_too_coarse_a_record_gives_no_jitter() -> None:
    numbers = report(results(step=0.02), 1.0, ROLES, {})
    assert numbers.jitter is None
    assert "Recorded too coarsely for jitter: every 0.02 s" in shown(numbers)
    assert report(results(step=0.01), 1.0, ROLES, {}).jitter is not None


def test_loop_that_was_not_aligned_is_told_briefly() -> None:
    numbers = report(results(duration=1.0), 1.0, ROLES, {})
    text = " ".join(shown(numbers).split())
    assert "did not finish its alignment" in text
    assert "plant.euler" not in text


def test_alignment_with_the_last_record_gives_no_errors() -> None:
    numbers = report(results(duration=2.0), 1.0, ROLES, {})
    assert numbers.errors == ()
    assert "did not finish its alignment before the end" in " ".join(shown(numbers).split())
    assert report(results(duration=2.001), 1.0, ROLES, {}).errors


def test_too_short_for_an_exposure_gives_no_jitter() -> None:
    assert jitter(results(), "plant", 9.5) is None


@pytest.mark.parametrize("aligned", [True, False])
def test_table_and_picture_of_a_loop(tmp_path: Path, aligned: bool) -> None:
    rows = results()
    rows["plant.euler.pitch"] = 1e-4 * np.sin(20.0 * rows["time"])
    rows["sensor.aligned"] &= aligned
    numbers = report(rows, 1.0, ROLES, {}, loop_off=rows)
    text = shown(numbers)
    assert ("line-of-sight jitter, loop off" in text) == aligned
    assert ("did not finish its alignment" in text) == (not aligned)
    plot(tmp_path / "p.png", Picture("title", ("subtitle", "set: x"), rows, ROLES, numbers, {}, loop_off=rows))
    assert (tmp_path / "p.png").stat().st_size > 10_000


def test_system_of_other_parts_gets_a_summary(fmus: dict[str, Path], tmp_path: Path) -> None:
    system = System("other", (Component("board", fmus["switchboard"]),))
    interfaces = {"board": read_interface(fmus["switchboard"])}
    roles = roles_of(system, interfaces)
    assert roles == Roles(None, None, None)
    rows = np.zeros(3, [("time", "f8"), ("board.level", "f8"), ("board.odd", "?")])
    rows["time"], rows["board.level"], rows["board.odd"] = [0.0, 1.0, 2.0], [3.0, 4.0, -1.0], [True, False, True]
    numbers = report(rows, 1.0, roles, interfaces)
    level, odd = numbers.spreads
    assert (level.smallest, level.mean, level.largest) == (-1.0, 2.0, 4.0)
    assert odd.mean == pytest.approx(2.0 / 3.0)
    assert "board.level" in shown(numbers)
    assert plot(tmp_path / "p.png", Picture("other", (), rows, roles, numbers, interfaces)).is_file()
