from __future__ import annotations

import importlib
import os
import signal
import sys
import threading
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from attitude_fmu.cosim.errors import ResultsError, RunStoppedError
from attitude_fmu.cosim.master import simulate
from attitude_fmu.cosim.monte_carlo import Trial, run_trials
from attitude_fmu.cosim.recording import Results
from attitude_fmu.cosim.system import Component, System


def last(results: Results, factor: float = 1.0) -> Mapping[str, float]:
    return {"x": factor * float(results["integrator.x"][-1])}


def finished(results: Results) -> Mapping[str, float]:
    return {"time": float(results["time"][-1])}


def trials(decay: System, count: int) -> list[Trial]:
    return [
        Trial(f"start/{k}", decay.with_values("k", {"integrator.x0": float(k)}), last, 0.2, step=0.01)
        for k in range(count)
    ]


def written(folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in folder.rglob("*.npz")}


def test_figures_are_those_of_a_run_in_this_process(decay: System, tmp_path: Path) -> None:
    found = run_trials(trials(decay, 3), tmp_path, workers=2)
    here = simulate(trials(decay, 3)[2].system, stop_time=0.2, step=0.01, order="jacobi").results
    assert list(found) == ["start/0", "start/1", "start/2"]
    assert found["start/2"]["x"] == here["integrator.x"][-1]
    assert found["start/0"]["x"] == 0.0


def test_only_what_is_missing_is_run(decay: System, tmp_path: Path) -> None:
    run_trials(trials(decay, 2), tmp_path)
    before = written(tmp_path)
    told: list[int] = []
    again = run_trials(trials(decay, 3), tmp_path, told.append)
    after = written(tmp_path)
    assert {name: after[name] for name in before} == before
    assert told == [2, 3]
    assert len(again) == 3


@pytest.mark.parametrize(
    "changed",
    [
        lambda trial: trial._replace(stop_time=0.3),
        lambda trial: trial._replace(step=0.02),
        lambda trial: trial._replace(take=partial(last, factor=2.0)),
        lambda trial: trial._replace(system=trial.system.with_values("x", {"integrator.x0": 7.0})),
    ],
    ids=["stop time", "step", "figure", "value"],
)
def test_a_changed_trial_is_run_again(decay: System, tmp_path: Path, changed) -> None:  # type: ignore[no-untyped-def]
    trial = trials(decay, 2)[1]
    first = run_trials([trial], tmp_path)
    second = run_trials([changed(trial)], tmp_path)
    assert first["start/1"]["x"] != second["start/1"]["x"]


MODULE = "from beside import FACTOR\n\n\ndef figure(results):\n    return {'x': FACTOR * results['integrator.x'][-1]}\n"


@pytest.mark.parametrize(
    ("changed", "text", "counts"),
    [
        ("beside.py", "FACTOR = 20.0\n", True),
        ("further.py", "FACTOR = 20.0\n", True),
        ("stranger.py", "FACTOR = 20.0\n", False),
    ],
    ids=["imported", "imported by what is imported", "not imported"],
)
def test_a_change_in_what_the_function_of_the_figures_imports_counts(
    decay: System, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: str, text: str, counts: bool
) -> None:
    source = tmp_path / "source"
    source.mkdir()
    (source / "figures_of_a_test.py").write_text(MODULE)
    (source / "beside.py").write_text("from further import FACTOR\n")
    for name in ("further.py", "stranger.py"):
        (source / name).write_text("FACTOR = 1.0\n")
    monkeypatch.syspath_prepend(str(source))
    # another case may have imported one of the same name
    monkeypatch.delitem(sys.modules, "figures_of_a_test", raising=False)
    take = importlib.import_module("figures_of_a_test").figure
    trial = trials(decay, 2)[1]._replace(take=take)
    first = run_trials([trial], tmp_path / "trials")
    before = written(tmp_path / "trials")
    (source / changed).write_text(text)
    second = run_trials([trial], tmp_path / "trials")
    assert (written(tmp_path / "trials") != before) is counts
    assert second["start/1"]["x"] == pytest.approx((20.0 if counts else 1.0) * first["start/1"]["x"])


def test_a_changed_fmu_is_run_again(fmus: dict[str, Path], tmp_path: Path) -> None:
    fmu = tmp_path / "gain.fmu"
    fmu.write_bytes(fmus["gain"].read_bytes())
    trial = Trial("gain", System("gain", (Component("gain", fmu),)), finished, 0.1, step=0.1)
    run_trials([trial], tmp_path / "trials")
    before = written(tmp_path)
    fmu.write_bytes(fmus["integrator"].read_bytes())
    run_trials([trial], tmp_path / "trials")
    assert written(tmp_path) != before


def test_a_damaged_file_is_made_anew(decay: System, tmp_path: Path) -> None:
    expected = run_trials(trials(decay, 2), tmp_path)
    (tmp_path / "start" / "1.npz").write_bytes(b"PK\x03\x04 half a file")
    assert np.array_equal(run_trials(trials(decay, 2), tmp_path)["start/1"]["x"], expected["start/1"]["x"])


@pytest.mark.parametrize(("way", "message"), [(1, "the bearing has seized"), (4, "took a process down")])
def test_a_failure_keeps_what_was_there(
    fmus: dict[str, Path], decay: System, tmp_path: Path, way: int, message: str
) -> None:
    motor = System("trouble", (Component("motor", fmus["troublemaker"]),)).with_values("way", {"motor.way": way})
    study = [*trials(decay, 1), Trial("trouble", motor, finished, 1.0, step=0.1)]
    with pytest.raises(RunStoppedError, match=message):
        run_trials(study, tmp_path, workers=1)
    assert list(written(tmp_path)) == ["0.npz"]


def test_interrupted_study_goes_on_where_it_stopped(decay: System, tmp_path: Path) -> None:
    study = [trial._replace(stop_time=2.0) for trial in trials(decay, 12)]

    def interrupt(done: int) -> None:
        if done == 2:
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(RunStoppedError, match="stopped by the user") as caught:
        run_trials(study, tmp_path, interrupt, workers=1)
    assert caught.value.interrupted
    kept = written(tmp_path)
    assert 2 <= len(kept) < len(study)
    assert len(run_trials(study, tmp_path)) == len(study)
    assert {name: time for name, time in written(tmp_path).items() if name in kept} == kept


def test_a_second_study_in_the_same_folder_is_refused(decay: System, tmp_path: Path) -> None:
    refused: list[str] = []

    def second(_done: int) -> None:
        try:
            run_trials(trials(decay, 1), tmp_path)
        except ResultsError as error:
            refused.append(str(error))

    def meanwhile(done: int) -> None:
        if not refused:
            thread = threading.Thread(target=second, args=(done,))
            thread.start()
            thread.join()

    run_trials(trials(decay, 1), tmp_path, meanwhile)
    assert "another run is writing" in refused[0]


def test_names_must_differ(decay: System, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="two trials are called start/0"):
        run_trials([*trials(decay, 1), *trials(decay, 1)], tmp_path)
