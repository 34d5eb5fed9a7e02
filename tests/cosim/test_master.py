from __future__ import annotations

import errno
import math
import os
import signal
import subprocess
import sys
import tempfile
import threading
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from slave_building import build

from attitude_fmu.cosim.errors import ResultsError, RunStoppedError, SystemRefusedError
from attitude_fmu.cosim.master import Order, simulate
from attitude_fmu.cosim.recording import Recording, read_csv, read_rows, rescue, write_csv
from attitude_fmu.cosim.slave import Slave
from attitude_fmu.cosim.ssp import open_ssp, write_ssp
from attitude_fmu.cosim.system import Component, System, connect
from attitude_fmu.cosim.workspace import claimed, whole_or_not

JACOBI: Order = "jacobi"
GAUSS_SEIDEL: Order = "gauss-seidel"


def troublemaker(fmus: dict[str, Path], way: int) -> System:
    system = System("trouble", (Component("motor", fmus["troublemaker"]),), stop_time=1.0)
    return system.with_values("trouble", {"motor.way": way})


def test_jacobi_takes_the_values_of_the_last_point(decay: System) -> None:
    results = simulate(decay, step=0.1, order=JACOBI).results
    x, y = [1.0], [-1.0]
    for _ in range(10):
        x, y = [*x, x[-1] + 0.1 * y[-1]], [*y, -x[-1]]
    assert results["integrator.x"].tolist() == x
    assert results["gain.y"].tolist() == y


def test_gauss_seidel_takes_the_values_of_those_before(decay: System) -> None:
    results = simulate(decay, step=0.1, order=GAUSS_SEIDEL).results
    x = [1.0]
    for _ in range(10):
        x.append(x[-1] + 0.1 * -x[-1])
    assert results["integrator.x"].tolist() == x
    assert results["gain.y"].tolist() == [-value for value in x]


@pytest.mark.parametrize("order", [JACOBI, GAUSS_SEIDEL])
def test_coupling_error_halves_with_the_step(decay: System, order: Order) -> None:
    def error(step: float) -> float:
        return abs(float(simulate(decay, step=step, order=order).results["integrator.x"][-1]) - math.exp(-1.0))

    coarse, fine = error(0.01), error(0.005)
    assert fine < 4e-3
    assert coarse / fine == pytest.approx(2.0, rel=0.05)


def test_inputs_are_known_at_initialisation(fmus: dict[str, Path]) -> None:
    # against the order of the components: the last one feeds the first
    system = System(
        "chain",
        (
            *(Component(name, fmus["gain"]) for name in ("third", "second", "first")),
            Component("source", fmus["integrator"]),
        ),
        connect("source", "first", ("x", "u"))
        + connect("first", "second", ("y", "u"))
        + connect("second", "third", ("y", "u")),
        stop_time=0.1,
    ).with_values("start", {"source.x0": 2.0, "first.k": 3.0, "second.k": 5.0, "third.k": 7.0})
    assert simulate(system, step=0.1).results["third.y"][0] == 210.0


def test_loop_without_delay_settles_or_is_refused(fmus: dict[str, Path]) -> None:
    loop = System(
        "loop",
        (Component("a", fmus["gain"]), Component("b", fmus["gain"])),
        connect("a", "b", ("y", "u")) + connect("b", "a", ("y", "u")),
        stop_time=1.0,
    ).with_values("offset", {"a.c": 1.0, "b.c": 1.0})
    settling = loop.with_values("gain", {"a.k": 0.5, "b.k": 0.5})
    assert simulate(settling).results["a.y"][0] == pytest.approx(2.0, abs=1e-11)
    growing = loop.with_values("gain", {"a.k": 2.0, "b.k": 2.0})
    with pytest.raises(SystemRefusedError, match=r"do not settle.*a\.y -> b\.u.*break the loop"):
        simulate(growing)


def test_time_is_counted_not_accumulated(decay: System) -> None:
    step = 0.001
    results = simulate(decay, step=step).results
    assert results["time"].tolist() == [k * step for k in range(1000)] + [1.0]
    assert results["integrator.last_time"][1:].tolist() == [k * step for k in range(1000)]


@pytest.mark.parametrize("step", [0.3, 0.0007, 1e-3, 1.0, 5.0])
def test_run_ends_at_the_stop_time(decay: System, step: float) -> None:
    results = simulate(decay, step=step, stop_time=1.0).results
    assert results["time"][-1] == 1.0
    assert len(results) == math.ceil(1.0 / step - 1e-9) + 1
    assert np.all(np.diff(results["time"]) > 1e-5)


def test_interval_thins_the_record_and_keeps_the_end(decay: System) -> None:
    results = simulate(decay, step=0.01, stop_time=0.25, interval=0.1).results
    assert results["time"] == pytest.approx([0.0, 0.1, 0.2, 0.25], abs=1e-12)
    with pytest.raises(SystemRefusedError, match="multiple of the step"):
        simulate(decay, step=0.01, interval=0.025)


@pytest.mark.parametrize(("step", "stop"), [(0.0, 1.0), (math.nan, 1.0), (-1.0, 1.0), (0.1, 0.0), (0.1, math.inf)])
def test_impossible_times_are_refused(decay: System, step: float, stop: float) -> None:
    with pytest.raises(SystemRefusedError, match="wanted"):
        simulate(decay, step=step, stop_time=stop)


@pytest.mark.parametrize(("step", "interval"), [(1e-300, None), (1e-12, None), (0.1, math.nan), (0.1, 0.0)])
def test_impossible_steps_and_intervals_are_refused(decay: System, step: float, interval: float | None) -> None:
    with pytest.raises(SystemRefusedError, match="too small for 1 s|a multiple of the step"):
        simulate(decay, step=step, interval=interval)
    with pytest.raises(SystemRefusedError, match="order = newton: not one of jacobi, gauss-seidel"):
        simulate(decay, order="newton")  # type: ignore[arg-type]


def test_last_step_is_as_long_as_what_is_left(fmus: dict[str, Path]) -> None:
    system = System("ramp", (Component("ramp", fmus["integrator"]),)).with_values("v", {"ramp.drive": 1.0})
    assert simulate(system, step=0.3, stop_time=1.0).results["ramp.x"][-1] == pytest.approx(1.0, abs=1e-12)


def test_first_row_is_that_after_initialisation(fmus: dict[str, Path]) -> None:
    assert simulate(troublemaker(fmus, 0), step=0.5).results["motor.exited"].tolist() == [1, 1, 1]


def test_whole_number_reaches_a_switch_as_0_or_1(fmus: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    system = System(
        "switches",
        (Component("a", fmus["switchboard"]), Component("b", fmus["switchboard"])),
        connect("a", "b", ("steps", "switch_in")),
    )
    sent: list[int] = []
    close = Slave.close

    def look(slave: Slave) -> None:
        sent.extend(int(feed.gather()[0]) for feed in slave.feeds)
        close(slave)

    monkeypatch.setattr(Slave, "close", look)
    simulate(system, step=0.1, stop_time=0.3)
    assert sent == [1]


def test_each_fmu_is_quoted_with_its_own_words(fmus: dict[str, Path]) -> None:
    others = tuple(Component(name, fmus["gain"]) for name in ("first", "last"))
    trouble = troublemaker(fmus, 1)
    system = replace(trouble, components=(others[0], *trouble.components, others[1]))
    with pytest.raises(RunStoppedError, match="motor: fmi2DoStep .* the bearing has seized"):
        simulate(system, step=0.1)
    with pytest.raises(RunStoppedError, match="motor: start values refused: .*no bearing"):
        simulate(system.with_values("refusing", {"motor.way": 7}), step=0.1)


def test_output_that_is_no_number_is_warned_of(fmus: dict[str, Path]) -> None:
    (warning,) = simulate(troublemaker(fmus, 6), step=0.1).warnings
    assert warning == "motor: y is not a finite number at t = 0.6 s"


def test_record_takes_names_and_wildcards(decay: System) -> None:
    names = simulate(decay, step=0.1, record=["integrator.*", "gain.u"]).results.dtype.names
    assert names == (
        "time",
        "integrator.x0",
        "integrator.drive",
        "integrator.u",
        "integrator.x",
        "integrator.last_time",
        "gain.u",
    )
    with pytest.raises(
        SystemRefusedError, match=r"nothing to record is called gain\.v; did you mean gain\.y or gain\.u"
    ):
        simulate(decay, step=0.1, record=["gain.v"])


def test_switches_and_whole_numbers_travel(fmus: dict[str, Path], tmp_path: Path) -> None:
    system = System(
        "switches",
        (Component("a", fmus["switchboard"]), Component("b", fmus["switchboard"])),
        connect("a", "b", ("steps", "switch_in"), ("odd", "number_in")),
        stop_time=0.4,
    ).with_values("s", {"a.enabled": False, "b.label": "x y", "a.number_in": 7})
    results = simulate(system, step=0.1, order=GAUSS_SEIDEL, results=tmp_path / "r.csv").results
    assert results["a.steps"].tolist() == [0, 1, 2, 3, 4]
    assert results["b.switch_seen"].tolist() == [False, True, True, True, True]
    assert results["b.number_seen"].tolist() == [0, 1, 0, 1, 0]
    assert results["a.number_seen"].tolist() == [0, 7, 7, 7, 7]
    assert results["a.level"].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    assert results.dtype["a.odd"] == np.bool_
    assert results.dtype["a.steps"] == np.int32
    assert (tmp_path / "r.csv").read_text().splitlines()[2] == "0.1,0.5,1,7,True,False,0.5,1,1,True,True"


def test_fmpy_takes_the_results(decay: System, tmp_path: Path) -> None:
    results = simulate(decay, step=0.01, results=tmp_path / "ours.csv").results
    fmpy.write_csv(tmp_path / "fmpy.csv", results)
    assert (tmp_path / "ours.csv").read_bytes() == (tmp_path / "fmpy.csv").read_bytes()
    for read in (fmpy.read_csv, read_csv):
        back = read(tmp_path / "ours.csv")
        assert back["integrator.x"].tolist() == results["integrator.x"].tolist()


def test_csv_with_switches_reads_back(fmus: dict[str, Path], tmp_path: Path) -> None:
    system = System("s", (Component("a", fmus["switchboard"]),), stop_time=0.3)
    results = simulate(system, step=0.1, results=tmp_path / "r.csv").results
    back = read_csv(tmp_path / "r.csv")
    assert back.dtype.names == results.dtype.names
    assert all((back[name] == results[name]).all() for name in results.dtype.names or ())
    assert back.dtype["a.odd"] == np.bool_
    (tmp_path / "r.csv").write_text("nonsense")
    with pytest.raises(ResultsError, match="cannot read results"):
        read_csv(tmp_path / "r.csv")


def test_csv_of_special_values_equals_that_of_fmpy(tmp_path: Path) -> None:
    values = [0.0, -0.0, 1e16, 1e-5, 0.1 + 0.2, math.inf, math.nan, 5e-324, 123456789.0]
    rows = np.zeros(len(values), [("time", "f8"), ("whole", "i4"), ("switch", "?"), ("single", "f4")])
    rows["time"], rows["whole"], rows["switch"] = values, range(-4, 5), [True, False, True] * 3
    columns = ["whole", "switch"]
    write_csv(tmp_path / "ours.csv", rows, columns)
    fmpy.write_csv(tmp_path / "fmpy.csv", rows, columns)
    assert (tmp_path / "ours.csv").read_bytes() == (tmp_path / "fmpy.csv").read_bytes()


@pytest.mark.parametrize(
    ("way", "message"),
    [
        (1, r"motor: fmi2DoStep returned fatal at t = 0\.5 s: .*the bearing has seized at 100% load"),
        (2, r"motor: fmi2DoStep returned discard at t = 0\.5 s: step too long"),
    ],
)
def test_failing_fmu_ends_the_run_with_its_own_words(
    fmus: dict[str, Path], tmp_path: Path, way: int, message: str
) -> None:
    path = tmp_path / "results.csv"
    with pytest.raises(RunStoppedError, match=message) as caught:
        simulate(troublemaker(fmus, way), step=0.1, results=path)
    assert caught.value.time == 0.5
    assert caught.value.results["motor.y"] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])
    assert len(path.read_text().splitlines()) == 7
    assert list(tmp_path.iterdir()) == [path]


def test_run_goes_on_after_a_warning(fmus: dict[str, Path]) -> None:
    outcome = simulate(troublemaker(fmus, 3), step=0.1)
    assert outcome.results["time"][-1] == 1.0
    assert outcome.warnings == ("motor: running warm",)


def test_refused_start_value_names_variable_and_reason(fmus: dict[str, Path]) -> None:
    with pytest.raises(SystemRefusedError, match=r"motor\.way = many: not a whole number"):
        simulate(System("t", (Component("motor", fmus["troublemaker"]),)).with_values("v", {"motor.way": "many"}))


def test_ctrl_c_keeps_the_results(fmus: dict[str, Path], tmp_path: Path) -> None:
    def press(time: float) -> None:
        if time > 0.35:
            os.kill(os.getpid(), signal.SIGINT)

    before = signal.getsignal(signal.SIGINT)
    with pytest.raises(RunStoppedError, match=r"stopped by the user at t = 0\.4 s") as caught:
        simulate(troublemaker(fmus, 0), step=0.1, results=tmp_path / "r.csv", progress=press)
    assert caught.value.interrupted
    assert len((tmp_path / "r.csv").read_text().splitlines()) == 1 + 5
    assert signal.getsignal(signal.SIGINT) is before


def test_ctrl_c_tells_the_time_of_the_last_row(decay: System) -> None:
    def press(time: float) -> None:
        if time > 0.35:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(RunStoppedError, match=r"stopped by the user at t = 0\.25 s") as caught:
        simulate(decay, step=0.05, interval=0.25, progress=press)
    assert caught.value.time == caught.value.results["time"][-1] == 0.25


def test_failed_writing_leaves_the_earlier_file(tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("earlier")

    def write_half() -> None:
        with whole_or_not(path) as draft:
            draft.write_text("half")
            raise OSError("disk full")

    with pytest.raises(ResultsError, match="cannot write"):
        write_half()
    assert path.read_text() == "earlier"
    assert list(tmp_path.iterdir()) == [path]


def test_rows_of_very_many_columns_can_be_read(tmp_path: Path) -> None:
    path = tmp_path / "r.partial.npy"
    names = [f"component.a_rather_long_name[{number}]" for number in range(1000)]
    recording = Recording(np.dtype([("time", "f8"), *[(name, "f8") for name in names]]), 3, path)
    recording.times[:2] = [0.0, 0.1]
    recording.close(keep_file=True)
    rows = read_rows(path)
    assert rows is not None
    assert rows["time"].tolist() == [0.0, 0.1]
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(ResultsError, match="cannot read the rows"):
        read_rows(path)


@pytest.mark.skipif(not hasattr(os, "posix_fallocate"), reason="this system cannot promise room on a disk")
def test_full_disk_shows_before_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []

    def full(_file: int, _start: int, size: int) -> None:
        asked.append(size)
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    path = tmp_path / "r.partial.npy"
    with pytest.raises(
        ResultsError, match=r"cannot keep 10000 rows of 80 bytes \(0\.8 MB\) in .*No space left.*--interval"
    ):
        Recording(np.dtype([("time", "f8"), ("y", "f8", 9)]), 10_000, path)
    assert asked[0] > 800_000
    assert not path.exists()


def test_more_rows_than_memory_holds_are_refused() -> None:
    with pytest.raises(
        ResultsError, match=r"cannot keep 10{13} rows of 8 bytes .* in memory; .*\(--interval\) makes fewer"
    ):
        Recording(np.dtype([("time", "f8")]), 10**13)


def test_paths_may_be_text_and_one_pattern_may_stand_alone(fmus: dict[str, Path], tmp_path: Path) -> None:
    system = System("s", (Component("ramp", str(fmus["integrator"])),), stop_time=0.2)
    path = str(tmp_path / "r.csv")
    results = simulate(system, step=0.1, record="ramp.x", results=path, workspace=str(tmp_path)).results
    assert results.dtype.names == ("time", "ramp.x")
    assert (read_csv(write_csv(path, read_csv(path))) == results).all()
    with open_ssp(str(write_ssp(system, str(tmp_path / "s.ssp")))) as same:
        assert same.stop_time == 0.2


CLAIMING = """
import sys, time
from pathlib import Path
from attitude_fmu.cosim.workspace import claimed
with claimed(Path(sys.argv[1])):
    print("claimed", flush=True)
    time.sleep(600)
"""


@pytest.mark.parametrize("name", ["r.csv", ""])
def test_what_another_process_writes_is_refused_until_it_is_gone(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    with subprocess.Popen([sys.executable, "-c", CLAIMING, str(path)], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == "claimed\n"
            with pytest.raises(ResultsError, match="another run is writing into"), claimed(path):
                pass
        finally:
            process.kill()
    with claimed(path), pytest.raises(ResultsError, match="another run is writing into"), claimed(path):
        pass
    assert list(tmp_path.iterdir()) == []


def test_refused_start_leaves_the_earlier_results(fmus: dict[str, Path], tmp_path: Path) -> None:
    path = tmp_path / "r.csv"
    path.write_text("earlier")
    with pytest.raises(RunStoppedError, match="start values refused"):
        simulate(troublemaker(fmus, 7), step=0.1, results=path)
    assert path.read_text() == "earlier"
    assert list(tmp_path.iterdir()) == [path]


def test_nothing_is_left_behind(decay: System, tmp_path: Path) -> None:
    paths, modules = list(sys.path), set(sys.modules)
    simulate(decay, step=0.1, workspace=tmp_path)
    assert list(tmp_path.iterdir()) == []
    assert sys.path == paths
    assert {"integrator", "gain"}.isdisjoint(set(sys.modules) - modules)


def test_rebuilt_fmu_runs_its_new_code(fmus: dict[str, Path], tmp_path: Path) -> None:
    results = []
    for rate in (1.0, 2.0):
        source = tmp_path / str(rate) / "ramp.py"
        source.parent.mkdir()
        text = (Path(__file__).parent / "slaves" / "integrator.py").read_text()
        source.write_text(text.replace("Integrator", "Ramp").replace("self.u + self.drive", str(rate)))
        fmu = build(source, source.with_suffix(".fmu"))
        results.append(float(simulate(System("r", (Component("r", fmu),)), stop_time=1.0).results["r.x"][-1]))
    assert results == pytest.approx([1.0, 2.0])


def test_runs_in_threads_do_not_touch_signals(decay: System) -> None:
    ends: list[float] = []

    def work() -> None:
        ends.append(float(simulate(decay, step=0.1).results["integrator.x"][-1]))

    threads = [threading.Thread(target=work) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(ends) == 2
    assert ends[0] == ends[1]


def test_folder_with_a_difficult_name_is_avoided(
    decay: System, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    difficult = tmp_path / "ü [a] b"
    difficult.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(difficult))
    assert simulate(decay, step=0.1).results["time"][-1] == 1.0
    with pytest.raises(ResultsError, match="plain name"):
        simulate(decay, step=0.1, workspace=difficult)


def test_unwritable_results_are_reported_before_the_run(decay: System, tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match="cannot write"):
        simulate(decay, step=0.1, results=tmp_path / "missing" / "r.csv")


def test_rows_of_a_crashed_run_can_be_rescued(tmp_path: Path) -> None:
    path = tmp_path / "r.partial.npy"
    recording = Recording(np.dtype([("time", "f8"), ("y", "f8")]), 1000, path)
    recording.rows["y"][:3] = [1.0, 2.0, 3.0]
    recording.times[:3] = [0.0, 0.1, 0.2]
    with pytest.raises(ResultsError, match=r"cannot write .*the rows are kept in .*r\.partial\.npy"):
        rescue(path, tmp_path / "missing" / "r.csv")
    assert path.is_file()
    rows = rescue(path, tmp_path / "r.csv")
    assert rows is not None
    assert rows["y"].tolist() == [1.0, 2.0, 3.0]
    assert read_csv(tmp_path / "r.csv")["y"].tolist() == [1.0, 2.0, 3.0]
    assert rescue(path, tmp_path / "r.csv") is None
