"""Profiles as data: files, parameter values, and the labelled rests of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from attitude_fmu.cosim.errors import ResultsError, SystemRefusedError
from attitude_fmu.cosim.profiles import (
    PAPER_A_STATIC,
    PROFILES,
    Interval,
    Profile,
    labelled_intervals,
    move,
    profile_parameters,
    profile_values,
    read_profile,
    turn,
    write_profile,
)
from attitude_fmu.models.plants.turntable_profile import KIND, NO_AXES, ROWS, Axes
from attitude_fmu.models.record import defaults, flatten, leaves, unflatten
from attitude_fmu.models.scalar import PI
from attitude_fmu.models.system import Run
from attitude_fmu.models.turntable import MODEL

DEG = PI / 180.0
SHORT = Profile(
    "short",
    (
        move("up", Axes(0.0, 1.0 * DEG, 0.0), 0.3),
        turn("round", Axes(2.0 * DEG, 0.0, 0.0), 0.2),
        move("passed", NO_AXES, 0.0),
        move("down, and back", Axes(0.0, -1.0 * DEG, 0.0), 0.4, speed=5.0 * DEG),
    ),
)


def parameters(values: dict[str, Any]) -> Any:
    """The table's parameters with these values."""
    table = leaves(MODEL.Parameters)
    assert set(values) <= {leaf.name for leaf in table}
    return unflatten(MODEL.Parameters, [values.get(leaf.name, leaf.start) for leaf in table])


def recorded(profile: Profile, seconds: float, step: float = 0.01) -> Any:
    """What a run of the table with this profile shows."""
    inputs = defaults(MODEL.Inputs)
    run = Run(MODEL, parameters(profile_values(profile)), inputs)
    rows = []
    for k in range(round(seconds / step) + 1):
        run.advance(inputs, k * step)
        out = run.outputs()
        rows.append((k * step, out.row, out.resting, out.turning, out.axis_angle.middle))
    names = [("time", float), ("table.row", int), ("table.resting", bool), ("table.turning", bool), ("middle", float)]
    return np.array(rows, dtype=names)


def test_rests_and_turns_of_a_run_are_found_by_their_labels() -> None:
    results = recorded(SHORT, 8.0)
    found = labelled_intervals(SHORT, results)
    assert [(one.label, one.row, one.kind) for one in found] == [
        ("up", 1, "move"),
        ("round", 2, "turn"),
        ("down, and back", 4, "move"),
    ]
    for one, duration in zip(found, (0.3, 0.2, 0.4), strict=True):
        # the row that follows begins one step after the last that rests
        assert one.end - one.start == pytest.approx(duration - 0.01)
    np.testing.assert_allclose(found[2].of(results)["middle"], -1.0 * DEG, atol=1e-5)
    assert len(found[2].of(results)) == 40


def test_rows_that_a_run_did_not_reach_give_no_interval() -> None:
    assert [one.label for one in labelled_intervals(SHORT, recorded(SHORT, 1.1))] == ["up"]


def test_a_run_that_did_not_record_the_row_is_told_so() -> None:
    with pytest.raises(SystemRefusedError, match=r"did not record rig\.row"):
        labelled_intervals(SHORT, recorded(SHORT, 0.1), "rig")


@pytest.mark.parametrize("profile", [*PROFILES.values(), SHORT], ids=lambda profile: profile.name)
def test_a_file_gives_back_the_profile(tmp_path: Path, profile: Profile) -> None:
    """To 15 digits in the file's units."""
    again = read_profile(write_profile(profile, tmp_path / f"{profile.name}.csv"))
    assert again.name == profile.name
    assert [(row.label, row.kind, row.temperature) for row in again.rows] == [
        (row.label, row.kind, row.temperature) for row in profile.rows
    ]
    for one, other in zip(again.rows, profile.rows, strict=True):
        assert [*one.angle, *one.rate, one.duration] == pytest.approx(
            [*other.angle, *other.rate, other.duration], rel=1e-14
        )


def test_a_file_written_by_hand_is_read(tmp_path: Path) -> None:
    path = tmp_path / "mine.csv"
    path.write_text(
        "label,kind,inner (deg),outer rate (rpm),duration (min),temperature (degC)\n"
        "warm,move,20,,1.5,40\n"
        "\n"
        "spin,turn,,3,0.5\n"
    )
    warm, spin = read_profile(path).rows
    assert warm == move("warm", Axes(0.0, 0.0, 20.0 * DEG), 90.0, temperature=313.15)
    assert spin == turn("spin", Axes(pytest.approx(0.1 * PI), 0.0, 0.0), 30.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "is empty"),
        ("kind,inner\nmove,1\n", r"unknown column 'inner'; did you mean inner \(deg\)"),
        ("kind,inner (kg)\nmove,1\n", r"column 'inner \(kg\)': display unit 'kg' is not of the kind of 'rad'"),
        ("kind,inner (deg)\nmove,1\nmove,x\n", r"row 2, column 'inner \(deg\)': 'x' is no number"),
        ("kind,inner (deg)\nmove,nan\n", r"row 1 .*angle\.inner = nan rad: not a finite number"),
        ("kind,inner (deg)\nrest,1\n", r"row 1, column 'kind': 'rest'; there are move and turn"),
        ("kind,inner (deg)\nmove,1,2\n", "row 1 has 3 cells for 2 columns"),
        ("label,kind,duration (s)\nbad,move,-1\n", r"row 1 \(bad\)\.duration = -1 s: too small"),
        ("kind,temperature (K)\nmove,25\n", r"row 1 \(\)\.temperature = 25 K: too small, kelvin wanted"),
        ("kind,inner (deg)\n", r"has 0 rows; a table takes 1 to 48"),
        ("kind,inner (deg)\n" + "move,1\n" * 49, r"has 49 rows"),
    ],
)
def test_what_a_file_gets_wrong_is_told_with_row_and_column(tmp_path: Path, text: str, why: str) -> None:
    path = tmp_path / "bad.csv"
    path.write_text(text)
    with pytest.raises(SystemRefusedError, match=why):
        read_profile(path)


def test_files_that_cannot_be_read_or_written_are_told(tmp_path: Path) -> None:
    with pytest.raises(SystemRefusedError, match="none.csv"):
        read_profile(tmp_path / "none.csv")
    with pytest.raises(ResultsError, match="nowhere"):
        write_profile(SHORT, tmp_path / "nowhere" / "x.csv")


def test_values_end_the_profile_and_leave_no_row_of_the_default() -> None:
    values = profile_values(PAPER_A_STATIC)
    assert values["profile.row[1].angle.inner"] == 43.5 * DEG
    assert values["profile.row[2].kind"] == KIND.value("end")
    full = Profile("full", (move("", NO_AXES, 1.0),) * ROWS)
    assert flatten(parameters(profile_values(full)).profile.row[-1])[0] == KIND.value("move")


def test_the_chamber_starts_at_the_first_temperature_and_rows_keep_the_last() -> None:
    profile = Profile(
        "warm",
        (
            move("a", NO_AXES, 1.0),
            move("b", NO_AXES, 1.0, temperature=313.15),
            move("c", NO_AXES, 1.0),
            move("d", NO_AXES, 1.0, temperature=273.15),
        ),
    )
    values = profile_values(profile)
    assert values["chamber.initial_temperature"] == 313.15
    assert [values[f"profile.row[{k}].temperature"] for k in (1, 2, 3, 4)] == [313.15, 313.15, 313.15, 273.15]


def test_a_parameter_set_names_its_component() -> None:
    found = profile_parameters(SHORT, "bench")
    assert found.name == "short"
    assert found.values["bench.profile.row[2].kind"] == KIND.value("turn")
    assert set(profile_parameters(SHORT, "").values) == set(profile_values(SHORT))


def test_an_interval_takes_both_of_its_ends() -> None:
    results = np.array([(0.0,), (0.1,), (0.2,), (0.3,)], dtype=[("time", float)])
    assert Interval("x", 1, "move", 0.1, 0.2).of(results)["time"].tolist() == [0.1, 0.2]
