from __future__ import annotations

import importlib.util
import os
import signal
import subprocess
import sys
import time
import zipfile
from contextlib import suppress
from pathlib import Path

import fmpy
import numpy as np
import pytest
from slave_building import with_units
from typer.testing import CliRunner, Result

from attitude_fmu.cosim.command_line import application
from attitude_fmu.cosim.interface import read_interface
from attitude_fmu.cosim.recording import read_csv, write_csv
from attitude_fmu.cosim.ssp import open_ssp, read_ssv, write_ssp
from attitude_fmu.cosim.system import Component, System, check, connect, start_values
from attitude_fmu.fmu_src.build import folder_of
from attitude_fmu.fmu_src.catalogue import KINDS, Kind
from attitude_fmu.fmu_src.native.compile import host_platform

HEARING_CTRL_C = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)  # what runs the tests may ignore it
from attitude_fmu.cosim.command_line import main
main()
"""


@pytest.fixture(scope="session")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The project's FMUs of the native kind, built once for these tests."""
    folder = tmp_path_factory.mktemp("dist")
    done = run("build", "--dist", str(folder))
    assert done.exit_code == 0, done.stderr
    return folder


@pytest.fixture(scope="session")
def both_kinds(dist: Path) -> Path:
    """The folder `dist`, with the FMUs of the Python kind as well."""
    done = run("build", "--kind", "python", "--dist", str(dist))
    assert done.exit_code == 0, done.stderr
    return dist


def run(*arguments: str) -> Result:
    return CliRunner().invoke(application, list(arguments))


def test_default_scenario_end_to_end(dist: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    settings = ("--set", "sensor.alignment.duration=0.2", "--set", "sensor.seed=7", "--set", "plant.wind.speed=3")
    done = run("run", "--stop", "3.5", "--step", "0.002", "--out", str(out), "--dist", str(dist), *settings)
    assert done.exit_code == 0, done.stderr
    for text in ("sensor error, yaw", "jitter, loop on", "jitter, loop off", "real-time factor", "results.csv"):
        assert text in done.stdout
    names = {"results.csv", "loop_off.csv", "overview.png", "system.ssp", "parameters.ssv"}
    assert {path.name for path in out.iterdir()} == names
    results = read_csv(out / "results.csv")
    assert results["time"][-1] == 3.5
    assert len(results) == 1751
    assert np.max(np.abs(results["sensor.euler.yaw"] - results["plant.euler.yaw"])) < 0.2
    used = read_ssv(out / "parameters.ssv")
    assert used.values["sensor.seed"] == "7"
    assert used.values["controller.mode"] == "3"
    assert len(used.values) > 100
    again = run("run", str(out / "system.ssp"), "--step", "0.002", "--out", str(tmp_path / "again"))
    assert again.exit_code == 0, again.stderr
    assert "3.5 s, communication step" in again.stdout
    assert "jitter, loop off" in again.stdout
    repeated = read_csv(tmp_path / "again" / "results.csv")
    assert (repeated["sensor.euler.yaw"] == results["sensor.euler.yaw"]).all()
    with zipfile.ZipFile(out / "system.ssp") as archive:
        texts = [archive.read(name).decode() for name in archive.namelist() if not name.endswith(".fmu")]
    # other tools do not read them
    assert not any("Enumeration" in text for text in texts)


def test_written_system_and_parameters_give_the_same_run(dist: Path, tmp_path: Path) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    common = ("--stop", "0.3", "--step", "0.01")
    done = run("run", "static", *common, "--dist", str(dist), "--out", str(first), "--set", "sensor.filter.kind=kalman")
    assert done.exit_code == 0, done.stderr
    with open_ssp(first / "system.ssp") as back:
        values = {str(port): value for port, value in start_values(back, check(back)).items()}
    assert values["sensor.filter.kind"] == 3
    ours = ("--parameters", str(first / "parameters.ssv"), "--out", str(second))
    done = run("run", str(first / "system.ssp"), *common, *ours)
    assert done.exit_code == 0, done.stderr
    before, after = read_csv(first / "results.csv"), read_csv(second / "results.csv")
    assert all((before[name] == after[name]).all() for name in before.dtype.names)


def test_step_of_communication_and_order_agree_at_rest(dist: Path, tmp_path: Path) -> None:
    # constant inputs: the sensor's own clocks decide, not the master
    ends = []
    for number, choice in enumerate((("--step", "0.001"), ("--step", "0.01"), ("--master", "jacobi"))):
        out = tmp_path / str(number)
        done = run("run", "static", "--stop", "0.2", "--dist", str(dist), "--out", str(out), *choice)
        assert done.exit_code == 0, done.stderr
        ends.append(read_csv(out / "results.csv")[-1])
    assert ends[0] == ends[1] == ends[2]


def test_both_kinds_give_the_same_run_and_the_written_system_carries_the_one_that_ran(
    both_kinds: Path, tmp_path: Path
) -> None:
    rows = {}
    for kind in KINDS:
        out = tmp_path / kind
        settings = ("--set", "sensor.alignment.duration=0.2", "--set", "sensor.seed=7")
        place = ("--dist", str(both_kinds), "--out", str(out))
        done = run("run", "--fmu", kind, "--stop", "0.5", "--step", "0.005", *place, *settings)
        assert done.exit_code == 0, done.stderr
        rows[kind] = read_csv(out / "results.csv")
        with zipfile.ZipFile(out / "system.ssp") as archive:
            carried = archive.read("resources/AttitudeSensor.fmu")
        assert carried == (folder_of(both_kinds, kind) / "AttitudeSensor.fmu").read_bytes()
    assert rows["native"].dtype == rows["python"].dtype
    for name in rows["native"].dtype.names:
        if sys.platform == "linux":
            assert (rows["native"][name] == rows["python"][name]).all(), name
        else:
            np.testing.assert_allclose(rows["native"][name], rows["python"][name], rtol=1e-9, err_msg=name)


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (("run", "gimbl"), 1, "there is no scenario called 'gimbl'; did you mean gimbal?"),
        (("run", "no.ssp"), 1, "file not found: no.ssp"),
        (("run", "static", "--set", "seed=3"), 2, "write it as component.variable=value"),
        (("run", "static", "--set", "sensor.sede=3"), 1, "AttitudeSensor has no variable 'sede'; did you mean seed?"),
        (("run", "static", "--set", "sensor.solver.kind=gyros"), 1, "not one of levelling (1), gyro (2), fused (3)"),
        (("run", "static", "--record", "sensor.eulr.*"), 1, "nothing to record is called sensor.eulr.*"),
        (("run", "static", "--step", "0"), 1, "step = 0 s: a positive time is wanted"),
        (("run", "static", "--step", "1e-300"), 1, "too small for 60 s (at most 1e+09 steps)"),
        (("run", "static", "--interval", "nan"), 1, "recording interval = nan s: a multiple of the step"),
        (
            ("run", "gimbal", "--set", "plant.wind.speed=-5"),
            1,
            "plant.wind.speed = -5 m/s: too small (allowed: 0 to 60",
        ),
        (("run", "static", "--set", "sensor.seed=4294967296"), 1, "sensor.seed = 4294967296: too large (allowed: 0 to"),
        (("run", "/tmp"), 1, "/tmp is a folder; give the .ssp file of a system"),
        (("info", "nosuch"), 1, "to info also an .fmu file"),
        (("info", "static", "--pattern", "nosuch"), 1, "static has nothing with 'nosuch' in its name"),
        (("build", "AttitudeSensor", "--dist", "/proc/none"), 1, "/proc/none"),
        (("run", "static", "--out", "/proc/none"), 1, "cannot write into /proc/none"),
        (("run", "--master", "newton"), 2, "newton"),
        (("build", "AtitudeSensor"), 1, "AtitudeSensor"),
        (("info", "none.fmu"), 1, "FMU not found: none.fmu"),
        (("run", "static", "--fmu", "fortran"), 2, "'fortran' is not one of"),
        (("run", "mine.ssp", "--fmu", "python"), 2, "--fmu python: mine.ssp is taken as it is"),
        (("run", "mine.ssp", "--dist", "d"), 2, "--dist d: mine.ssp is taken as it is; the option is for scenarios"),
        (("info", "mine.fmu", "--dist", "d"), 2, "--dist d: mine.fmu is taken as it is; the option is for scenarios"),
        (
            ("run", "gimbal", "--set", "sensor.temperature=300"),
            1,
            "plant.temperature is connected to it; set plant.ambient_temperature",
        ),
        (("build", "--platform", "amiga"), 2, "'amiga' is not one of"),
    ],
)
def test_wrong_request_is_one_clear_line(
    dist: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], code: int, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    is_file = any(argument.endswith((".ssp", ".fmu")) for argument in arguments)
    extra = () if "--dist" in arguments or is_file else ("--dist", str(dist))
    done = run(*arguments, *extra)
    assert done.exit_code == code
    assert message in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr
    assert len(done.stderr.splitlines()) == 1 or code == 2


@pytest.mark.parametrize(
    "wrong",
    [
        ("--step", "-1"),
        ("--interval", "0.15"),
        ("--record", "nosuch"),
        ("--set", "motor.way=x"),
        ("--set", "motor.way=7"),
    ],
)
def test_refused_run_leaves_earlier_results_alone(
    fmus: dict[str, Path], tmp_path: Path, wrong: tuple[str, str]
) -> None:
    system = System("t", (Component("motor", fmus["troublemaker"]),), stop_time=1.0)
    path = write_ssp(system, tmp_path / "t.ssp")
    out = tmp_path / "out"
    assert run("run", str(path), "--step", "0.1", "--out", str(out)).exit_code == 0
    before = {file.name: file.read_bytes() for file in out.iterdir()}
    done = run("run", str(path), "--step", "0.1", "--out", str(out), *wrong)
    assert done.exit_code == 1
    assert {file.name: file.read_bytes() for file in out.iterdir()} == before


def test_system_and_parameters_that_were_given_are_not_overwritten(fmus: dict[str, Path], tmp_path: Path) -> None:
    path = write_ssp(System("t", (Component("motor", fmus["troublemaker"]),), stop_time=1.0), tmp_path / "t.ssp")
    out = tmp_path / "out"
    assert run("run", str(path), "--step", "0.1", "--stop", "0.5", "--out", str(out)).exit_code == 0
    done = run("run", str(out / "system.ssp"), "--out", str(out))
    assert done.exit_code == 1
    assert "would be overwritten by what the run writes; choose another --out" in " ".join(done.stderr.split())
    done = run("run", str(path), "--parameters", str(out / "parameters.ssv"), "--out", str(out))
    assert "would be overwritten" in done.stderr
    with open_ssp(out / "system.ssp") as back:
        assert back.stop_time == 0.5


def test_value_out_of_its_range_is_refused_before_the_start(dist: Path, tmp_path: Path) -> None:
    settings = ("--set", "sensor.temperature=25")
    done = run("run", "static", "--stop", "0.1", "--out", str(tmp_path), "--dist", str(dist), *settings)
    assert done.exit_code == 1
    assert done.stderr == "attitude-fmu: sensor.temperature = 25 K: too small (allowed: 200 to 450 K)\n"


@pytest.mark.parametrize("kind", KINDS)
def test_values_that_do_not_go_together_are_refused_in_the_words_of_the_fmu(
    both_kinds: Path, tmp_path: Path, kind: Kind
) -> None:
    place = ("--out", str(tmp_path), "--dist", str(both_kinds))
    done = run("run", "--fmu", kind, "--stop", "0.1", *place, "--set", "plant.tripod.stiffness.pitch=1")
    assert done.exit_code == 1
    assert done.stderr.startswith(
        "attitude-fmu: plant: start values refused: plant.tripod.stiffness.pitch = 1 N.m/rad: "
        "the camera's weight tips the tripod over (allowed: 6.8"
    )
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.parametrize(("kind", "status"), [("native", "error"), ("python", "fatal")])
def test_input_that_leaves_its_range_ends_the_run_in_the_words_of_the_fmu(
    both_kinds: Path, fmus: dict[str, Path], tmp_path: Path, kind: Kind, status: str
) -> None:
    kelvin = '<Unit name="K"><BaseUnit K="1"/></Unit>'
    oven = with_units(fmus["integrator"], tmp_path / "oven.fmu", kelvin, "K")
    sensor = Component("sensor", folder_of(both_kinds, kind) / "AttitudeSensor.fmu")
    system = System(
        "oven", (Component("oven", oven), sensor), connect("oven", "sensor", ("x", "temperature")), stop_time=1.0
    ).with_values("heat", {"oven.x0": 300.0, "oven.drive": 400.0})
    out = tmp_path / "out"
    done = run("run", str(write_ssp(system, tmp_path / "oven.ssp")), "--step", "0.125", "--out", str(out))
    assert done.exit_code == 1
    assert done.stderr == (
        f"attitude-fmu: sensor: fmi2SetReal returned {status} at t = 0.375 s: "
        f"sensor.temperature = 500 K: too large (allowed: 200 to 450 K); what was recorded until then is in {out}\n"
    )
    assert read_csv(out / "results.csv")["time"][-1] == 0.375


def test_failing_fmu_leaves_its_results(fmus: dict[str, Path], tmp_path: Path) -> None:
    system = System("t", (Component("motor", fmus["troublemaker"]),), stop_time=1.0)
    path = write_ssp(system.with_values("way", {"motor.way": 1}), tmp_path / "t.ssp")
    done = run("run", str(path), "--step", "0.1", "--out", str(tmp_path / "out"))
    assert done.exit_code == 1
    assert "motor: fmi2DoStep returned fatal at t = 0.5 s: the bearing has seized at 100% load" in done.stderr
    assert "what was recorded until then is in" in done.stderr
    assert len((tmp_path / "out" / "results.csv").read_text().splitlines()) == 7


def test_crashing_fmu_leaves_its_results_and_nothing_older(fmus: dict[str, Path], tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "overview.png").write_text("of an earlier run")
    system = System("t", (Component("motor", fmus["troublemaker"]),), stop_time=1.0)
    path = write_ssp(system.with_values("way", {"motor.way": 4}), tmp_path / "t.ssp")
    done = run("run", str(path), "--step", "0.1", "--out", str(out))
    assert done.exit_code == 1
    assert "an FMU took the whole run down (code 139) after t = 0.5 s" in done.stderr
    assert {file.name for file in out.iterdir()} == {"results.csv", "system.ssp", "parameters.ssv"}


def test_own_ssp_gets_summary_table_picture_and_all_outputs(fmus: dict[str, Path], tmp_path: Path) -> None:
    path = write_ssp(System("t", (Component("board", fmus["switchboard"]),), stop_time=1.0), tmp_path / "t.ssp")
    done = run("run", str(path), "--step", "0.1", "--out", str(tmp_path / "o"), "--record", "board.enabled")
    assert done.exit_code == 0, done.stderr
    assert "board.level" in done.stdout
    assert "board.enabled" in done.stdout
    assert (tmp_path / "o" / "overview.png").is_file()


def test_second_run_into_a_folder_is_refused_and_the_first_one_goes_on(fmus: dict[str, Path], tmp_path: Path) -> None:
    path = write_ssp(System("t", (Component("ramp", fmus["integrator"]),), stop_time=1e4), tmp_path / "t.ssp")
    out = tmp_path / "out"
    options = ["run", str(path), "--step", "0.01", "--interval", "1", "--out", str(out)]
    command = [sys.executable, "-c", HEARING_CTRL_C, *options]
    spill = out / "results.partial.npy"
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        try:
            wait_for(spill)
            before = spill.stat().st_ino, spill.stat().st_size
            done = run(*options, "--stop", "1")
            assert done.exit_code == 1
            assert done.stderr == (
                f"attitude-fmu: another run is writing into {out}; let it end, or choose another place\n"
            )
            assert (spill.stat().st_ino, spill.stat().st_size) == before
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    # a run that was killed keeps nobody out
    assert spill.is_file()
    assert run(*options, "--stop", "1").exit_code == 0
    assert not [file for file in out.iterdir() if file.name.startswith(".") and file.is_file()]
    assert read_csv(out / "results.csv")["time"][-1] == 1.0


def test_run_whose_master_was_killed_still_owns_its_results(fmus: dict[str, Path], tmp_path: Path) -> None:
    motor = System("t", (Component("motor", fmus["troublemaker"]),), stop_time=1.0)
    path = write_ssp(motor.with_values("hang", {"motor.way": 5}), tmp_path / "t.ssp")
    out = tmp_path / "out"
    options = ["run", str(path), "--step", "0.1", "--out", str(out)]
    command = [sys.executable, "-c", HEARING_CTRL_C, *options]
    with subprocess.Popen(command, stderr=subprocess.DEVNULL, start_new_session=True) as process:
        try:
            wait_for(out / "results.partial.npy")
            process.kill()
            process.wait()
            done = run(*options, "--set", "motor.way=0")
            assert done.exit_code == 1
            assert f"another run is writing into {out / 'results.csv'}" in done.stderr
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)


def wait_for(path: Path) -> None:
    for _ in range(300):
        if path.is_file():
            break
        time.sleep(0.1)


def test_ctrl_c_says_so_and_keeps_the_results(dist: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-c", HEARING_CTRL_C, "run", "static", "--stop", "1000"]
    options = ["--out", str(tmp_path), "--dist", str(dist), "--interval", "0.1"]
    with subprocess.Popen(
        [*command, *options],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        spill = tmp_path / "results.partial.npy"
        wait_for(spill)
        time.sleep(1.0)
        try:
            # as a terminal does: to the whole group
            os.killpg(process.pid, signal.SIGINT)
            _, said = process.communicate(timeout=60.0)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130
    assert "stopped by the user at t = " in said
    assert "Traceback" not in said
    rows = read_csv(tmp_path / "results.csv")
    assert len(rows) >= 1
    assert f"stopped by the user at t = {rows['time'][-1]:.6g} s" in said
    assert "stopping ..." in said
    assert not spill.exists()


def test_build_tells_what_was_built_and_for_what(tmp_path: Path) -> None:
    native, python = (folder_of(tmp_path, kind) / "GimbalController.fmu" for kind in KINDS)
    command = ("build", "GimbalController", "--kind", "all", "--dist", str(tmp_path))
    told = run(*command).stdout
    sizes = [f"{path.stat().st_size / 1000:.0f} kB" for path in (native, python)]
    assert told.splitlines() == [
        f"building {native}",
        f"built {native}, {sizes[0]}, for {host_platform().folder}",
        f"building {python}",
        f"built {python}, {sizes[1]}, for Python",
    ]
    assert [line.split(",")[0] for line in run(*command).stdout.splitlines()] == [
        f"up to date {native}",
        f"up to date {python}",
    ]


@pytest.mark.parametrize(
    ("arguments", "option"), [(("run", "static"), "--fmu"), (("info", "static"), "--fmu"), (("build",), "--kind")]
)
def test_where_native_fmus_cannot_be_built_the_other_kind_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...], option: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with monkeypatch.context() as patch:
        patch.setattr("platform.machine", lambda: "riscv64")
        done = run(*arguments)
    assert done.exit_code == 1
    way_out = f"use the Python kind ({option} python)\n"
    assert done.stderr == f"attitude-fmu: native FMUs are not built for {sys.platform} on riscv64; {way_out}"
    find_spec = importlib.util.find_spec
    with monkeypatch.context() as patch:
        patch.setattr(
            "importlib.util.find_spec", lambda name, *more: None if name == "ziglang" else find_spec(name, *more)
        )
        done = run(*arguments)
    assert done.exit_code == 1
    assert done.stderr == (
        "attitude-fmu: native FMUs are compiled with the package ziglang, which is missing: pip install ziglang, or "
        f"{way_out}"
    )


def test_version_and_help(dist: Path) -> None:
    assert run("--version").stdout.startswith("attitude-fmu ")
    shown = run("run", "--help").stdout
    for text in ("Examples", "--set", "--master", "--fmu", "attitude-fmu run --stop 10", "overview.png"):
        assert text in shown
    for name in ("AttitudeSensor", "TripodGimbal", "GimbalController"):
        assert read_interface(dist / f"{name}.fmu").variables
    shown = run("info", "static", "--dist", str(dist), "--pattern", "solver").stdout
    assert "sensor.solver.kind" in shown
    assert "2 gyro" in shown
    shown = run("info", "gimbal", "--dist", str(dist), "--pattern", "wind").stdout
    assert "plant.wind.speed = 10 m/s  (0 to 60 m/s)" in shown
    assert "mean speed at the camera" in shown
    assert run("info", "gimbal", "--dist", str(dist), "--pattern", "PLANT*speed").stdout.splitlines()[1:2] == [
        "  plant.wind.speed = 10 m/s  (0 to 60 m/s)"
    ]
    assert "plant.rate[1] -> sensor.rate[1]" in run("info", "gimbal", "--dist", str(dist), "--all").stdout


def test_csv_of_a_run_is_what_fmpy_writes(dist: Path, tmp_path: Path) -> None:
    done = run("run", "static", "--stop", "0.05", "--out", str(tmp_path), "--dist", str(dist))
    assert done.exit_code == 0, done.stderr
    results = read_csv(tmp_path / "results.csv")
    write_csv(tmp_path / "again.csv", results, ["sensor.euler.yaw"])
    fmpy.write_csv(tmp_path / "fmpy.csv", results, ["sensor.euler.yaw"])
    assert (tmp_path / "again.csv").read_bytes() == (tmp_path / "fmpy.csv").read_bytes()
