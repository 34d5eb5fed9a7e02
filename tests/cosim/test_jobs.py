from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from attitude_fmu.cosim.errors import RunStoppedError, SystemRefusedError
from attitude_fmu.cosim.jobs import Job, run_jobs
from attitude_fmu.cosim.master import simulate
from attitude_fmu.cosim.system import Component, System
from attitude_fmu.models.errors import AttitudeFmuError


def trouble(fmus: dict[str, Path], way: int) -> System:
    system = System("trouble", (Component("motor", fmus["troublemaker"]),))
    return system.with_values("way", {"motor.way": way})


def silent(_name: str, _time: float) -> None:
    return None


def test_jobs_give_what_a_run_in_this_process_gives(decay: System, tmp_path: Path) -> None:
    seen: dict[str, float] = {}
    jobs = [Job(name, decay, tmp_path / f"{name}.csv", 1.0, step=0.01, order="jacobi") for name in ("a", "b")]
    outcomes = run_jobs(jobs, lambda name, reached: seen.update({name: reached}))
    here = simulate(decay, step=0.01, order="jacobi").results
    assert all((outcomes[name].results == here).all() for name in ("a", "b"))
    assert seen == {"a": 1.0, "b": 1.0}
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "b.csv"]


def test_crash_of_an_fmu_is_survived_and_its_rows_are_kept(fmus: dict[str, Path], tmp_path: Path) -> None:
    with pytest.raises(RunStoppedError, match=r"took the whole run down \(code 139\) after t = 0\.5 s") as caught:
        run_jobs([Job("crash", trouble(fmus, 4), tmp_path / "crash.csv", 1.0, step=0.1)], silent)
    assert len(caught.value.results) == 6
    assert [path.name for path in tmp_path.iterdir()] == ["crash.csv"]
    assert len((tmp_path / "crash.csv").read_text().splitlines()) == 7


def test_failure_of_one_ends_the_other(fmus: dict[str, Path], decay: System, tmp_path: Path) -> None:
    jobs = [
        Job("endless", decay, tmp_path / "endless.csv", 1e4, step=1e-3, interval=1.0),
        Job("failing", trouble(fmus, 1), tmp_path / "failing.csv", 1.0, step=0.1),
    ]
    with pytest.raises(RunStoppedError, match="the bearing has seized"):
        run_jobs(jobs, silent)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["endless.csv", "failing.csv"]


def test_refusal_crosses_the_process(fmus: dict[str, Path], tmp_path: Path) -> None:
    system = trouble(fmus, 0).with_values("typo", {"motor.wya": 1})
    with pytest.raises(SystemRefusedError, match="did you mean way"):
        run_jobs([Job("refused", system, tmp_path / "r.csv", 1.0)], silent)


def test_error_of_our_own_is_called_one(decay: System, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    job = Job("odd", decay, tmp_path / "r.csv", 1.0, record=(5,))  # type: ignore[arg-type]
    with pytest.raises(AttitudeFmuError, match="internal error: TypeError"):
        run_jobs([job], silent)
    assert "Traceback" in capfd.readouterr().err


@pytest.mark.parametrize(("presses", "patience"), [(1, 10.0), (2, 1.9)])
def test_fmu_that_hangs_is_ended_and_its_rows_are_kept(
    fmus: dict[str, Path], tmp_path: Path, presses: int, patience: float
) -> None:
    reached = threading.Event()
    told: list[str] = []
    pressed: list[float] = []

    def press() -> None:
        reached.wait(30.0)
        time.sleep(0.3)
        pressed.append(time.monotonic())
        for _ in range(presses):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.3)

    def watch(_name: str, time: float) -> None:
        if time > 0.45:
            reached.set()

    thread = threading.Thread(target=press)
    thread.start()
    job = Job("hang", trouble(fmus, 5), tmp_path / "hang.csv", 1.0, step=0.1)
    with pytest.raises(RunStoppedError, match=r"stopped by the user at t = 0\.5 s") as caught:
        run_jobs([job], watch, lambda: told.append("stopping"))
    took = time.monotonic() - pressed[0]
    thread.join()
    assert took < patience
    assert caught.value.interrupted
    assert told == ["stopping"]
    assert [path.name for path in tmp_path.iterdir()] == ["hang.csv"]
    assert len((tmp_path / "hang.csv").read_text().splitlines()) == 7


def test_failure_is_told_also_when_the_other_hangs(fmus: dict[str, Path], tmp_path: Path) -> None:
    jobs = [Job(f"way {way}", trouble(fmus, way), tmp_path / f"{way}.csv", 1.0, step=0.1) for way in (5, 8)]
    with pytest.raises(RunStoppedError, match="the bearing has seized"):
        run_jobs(jobs, silent)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["5.csv", "8.csv"]
    assert len((tmp_path / "5.csv").read_text().splitlines()) == 7


def test_children_leave_ctrl_c_to_their_parent_from_the_start(decay: System, tmp_path: Path) -> None:
    finished = threading.Event()
    hit: set[int | None] = set()

    def press() -> None:
        while not finished.wait(0.002):
            for child in multiprocessing.active_children():
                if child.pid is not None:
                    with suppress(ProcessLookupError):
                        os.kill(child.pid, signal.SIGINT)
                    hit.add(child.pid)

    thread = threading.Thread(target=press)
    thread.start()
    try:
        outcomes = run_jobs([Job("a", decay, tmp_path / "a.csv", 1.0, step=0.01)], silent)
    finally:
        finished.set()
        thread.join()
    assert len(outcomes["a"].results) == 101
    assert hit


def test_ctrl_c_ends_all_jobs_and_keeps_their_results(decay: System, tmp_path: Path) -> None:
    started = threading.Event()

    def press() -> None:
        started.wait(30.0)
        time.sleep(0.2)
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=press)
    thread.start()
    jobs = [Job(name, decay, tmp_path / f"{name}.csv", 1e4, step=1e-3, interval=0.1) for name in ("a", "b")]
    with pytest.raises(RunStoppedError, match="stopped by the user") as caught:
        run_jobs(jobs, lambda _name, _time: started.set())
    thread.join()
    assert caught.value.interrupted
    assert all(len(path.read_text().splitlines()) > 2 for path in (tmp_path / "a.csv", tmp_path / "b.csv"))
