"""The command ``reproduce``, on an experiment of a second: tables, pictures, and an interrupted run that goes on."""

from __future__ import annotations

import csv
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from rich.console import Console
from typer.testing import CliRunner

from attitude_fmu.cosim import paper_a, reproduce
from attitude_fmu.cosim.command_line import application
from attitude_fmu.cosim.experiment import Case, Cases, Claim, Experiment
from attitude_fmu.cosim.monte_carlo import Trial, run_trials
from attitude_fmu.cosim.recording import Results
from attitude_fmu.cosim.system import Component, System

SEEDS = 4
MANY = 10 * (os.cpu_count() or 1) + 10
"""More than run and wait in the processes when the first is done: an interrupt leaves some."""


def last_yaw(results: Results) -> dict[str, float]:
    return {"yaw": float(np.degrees(results["sensor.euler.yaw"][-1]))}


def trial(dist: Path, seed: int, stop: float) -> Trial:
    system = System("bare", (Component("sensor", dist / "AttitudeSensor.fmu"),)).with_values(
        "seed", {"sensor.seed": seed, "sensor.alignment.duration": 0.1}
    )
    return Trial("", system, last_yaw, stop, record=("sensor.euler.yaw",), step=0.01, interval=0.1)


def drawn(figure: Figure, cases: Cases) -> None:
    figure.subplots().plot([float(figures["yaw"]) for figures in cases["bare"]])


def experiment(stop: float, seeds: int = SEEDS) -> Experiment:
    def cases(dist: Path) -> tuple[Case, ...]:
        return (Case("bare", partial(trial, dist, stop=stop), seeds),)

    claims = (
        Claim("yaw after a second", 1e3, "deg", "nowhere", "bare", "yaw", bound=True),
        Claim("yaw, as printed", 1e3, "deg", "nowhere", "bare", "yaw", because="it cannot be a thousand"),
        Claim("yaw, in words", None, "deg", "nowhere", "bare", "yaw", best="bare", tuned="bare"),
    )
    return Experiment("bare", "paper-a", "A sensor alone", ("AttitudeSensor",), cases, claims, drawn)


@pytest.fixture
def brief(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paper_a, "EXPERIMENTS", (experiment(1.0),))


@pytest.mark.usefixtures("brief")
def test_command_writes_table_and_picture_and_runs_nothing_twice(sensor_dist: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    arguments = ["reproduce", "paper-a", "--out", str(out), "--dist", str(sensor_dist)]
    done = CliRunner().invoke(application, arguments)
    assert done.exit_code == 0, done.stderr
    assert {path.name for path in out.iterdir()} == {"trials", "bare", "bare.png", "paper-a.csv"}
    assert "A sensor alone" in done.stdout
    assert "explained: it cannot be a thousand" in done.stdout
    assert "3 rows: 1 inside, 1 explained, 1 not printed." in " ".join(done.stdout.split())
    with (out / "paper-a.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["what"], row["verdict"], row["published"]) for row in rows] == [
        ("yaw after a second", "inside", "1000.0"),
        ("yaw, as printed", "explained", "1000.0"),
        ("yaw, in words", "not printed", ""),
    ]
    assert [path.name for path in (out / "bare").iterdir()] == ["bare.ssp"]
    files = {path: path.stat().st_mtime_ns for path in (out / "trials").rglob("*.npz")}
    assert len(files) == SEEDS
    assert CliRunner().invoke(application, arguments).exit_code == 0
    assert {path: path.stat().st_mtime_ns for path in (out / "trials").rglob("*.npz")} == files


@pytest.mark.usefixtures("brief")
def test_written_system_runs_as_the_first_seed_did(sensor_dist: Path, tmp_path: Path) -> None:
    folder, again = tmp_path / "systems", tmp_path / "again"
    paths = reproduce.write_systems(paper_a.EXPERIMENTS[0], sensor_dist, folder)
    done = CliRunner().invoke(application, ["run", str(paths[0]), "--step", "0.01", "--out", str(again)])
    assert done.exit_code == 0, done.stderr
    one = trial(sensor_dist, 1, 1.0)._replace(name="one")
    with (again / "results.csv").open(newline="", encoding="utf-8") as file:
        last = list(csv.DictReader(file))[-1]
    assert float(last["time"]) == one.stop_time
    yaw = np.degrees(float(last["sensor.euler.yaw"]))
    assert yaw == float(run_trials([one], tmp_path / "trials")["one"]["yaw"])


INTERRUPTED = f"""
import signal, sys
sys.path[:0] = [{str(Path(__file__).parent)!r}]
from attitude_fmu.cosim import paper_a
from attitude_fmu.cosim.command_line import main
import test_reproduce
if __name__ == "__main__":
    # what runs the tests may ignore it
    signal.signal(signal.SIGINT, signal.default_int_handler)
    paper_a.EXPERIMENTS = (test_reproduce.experiment(300.0, test_reproduce.MANY),)
    main()
"""


def test_interrupted_command_says_so_and_goes_on_where_it_stopped(sensor_dist: Path, tmp_path: Path) -> None:
    script, out = tmp_path / "interrupted.py", tmp_path / "out"
    script.write_text(INTERRUPTED)
    command = [sys.executable, str(script), "reproduce", "paper-a", "--out", str(out), "--dist", str(sensor_dist)]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        try:
            for _ in range(600):
                if list(out.rglob("1.npz")):
                    break
                time.sleep(0.05)
            # as a terminal does: to the whole group
            os.killpg(process.pid, signal.SIGINT)
            _, said = process.communicate(timeout=60.0)
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    kept = {path: path.stat().st_mtime_ns for path in out.rglob("*.npz")}
    assert 0 < len(kept) < MANY
    assert process.returncode == 130
    assert f"the same command goes on from the trials in {out / 'trials'}" in said
    assert not (out / "paper-a.csv").exists()
    again = subprocess.run(command, capture_output=True, text=True, check=False)
    assert again.returncode == 0, again.stderr
    assert len(list(out.rglob("*.npz"))) == MANY
    assert {path: path.stat().st_mtime_ns for path in kept} == kept
    assert (out / "paper-a.csv").is_file()


def test_table_shows_what_the_paper_prints_beside_the_distribution() -> None:
    one = experiment(1.0)
    trials = [{"yaw": np.array(float(value))} for value in range(101)]
    console = Console(width=160, record=True, file=open(os.devnull, "w"))  # noqa: SIM115
    console.print(reproduce.table(one, reproduce.findings(one, {"bare": trials})))
    lines = [line.split(", deg")[1].split() for line in console.export_text().splitlines() if "yaw" in line]
    assert lines == [
        ["≤", "1000", "50", "5", "95", "inside,", "100%", "keep", "it"],
        ["1000", "50", "5", "95", "explained"],
        ["-", "50", "5", "95", "50", "1x", "50"],
    ]


def test_unknown_paper_is_refused() -> None:
    assert CliRunner().invoke(application, ["reproduce", "paper-c"]).exit_code == 2
