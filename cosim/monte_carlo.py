"""Many runs, of which only some figures are kept: side by side, on disk as soon as each is there, and never twice.

    trials = [Trial(f"seed_{seed}", system.with_values("seed", {"sensor.seed": seed}), rms, 60.0) for seed in range(20)]
    figures = run_trials(trials, Path("out/trials"))

What a trial gave lies in a file of its name, with the key of all that it follows from: the bytes of its FMUs, their
connections and values, the experiment, and the function that takes the figures with the source of its module and of
those that this imports from its own folder, and so on. An interrupted study goes on where it stopped; a trial whose key
has changed is run again.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import multiprocessing
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from functools import cache, partial
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from attitude_fmu.models.errors import AttitudeFmuError

from .errors import ResultsError, RunStoppedError
from .interrupts import ignored_interrupts, noted_interrupts
from .master import Order, simulate
from .recording import Results
from .system import System
from .workspace import claimed, whole_or_not

Figures = Mapping[str, NDArray[Any]]
"""What a trial gives: arrays by name, most of them of one number."""

Take = Callable[[Results], Mapping[str, Any]]
"""Makes figures of what a run recorded: a function of a module, or a `functools.partial` of one."""

_KEY = "trial key"


class Trial(NamedTuple):
    """One run and what is taken of it; the rest is as `simulate` takes it. `name` is the path of its file."""

    name: str
    system: System
    take: Take
    stop_time: float
    record: tuple[str, ...] | None = None
    step: float = 1e-3
    interval: float | None = None
    order: Order = "jacobi"


def run_trials(
    trials: Sequence[Trial],
    folder: Path,
    progress: Callable[[int], None] = lambda _: None,
    workers: int | None = None,
) -> dict[str, Figures]:
    """Run what `folder` does not hold yet, `workers` at a time (default: all cores); gives the figures of all, by name.

    `progress` is told how many trials are there. Ctrl-C lets the trials that run come to their end and keeps them; a
    trial that fails stops the rest likewise.

    Raises the first failure (`SystemRefusedError`, `RunStoppedError`), `RunStoppedError` when interrupted, and
    `ResultsError` if the disk does not take the results or another study writes there.
    """
    _check_names(trials)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultsError(f"cannot write into {folder}: {error.strerror or error}") from error
    with claimed(folder):
        keys = _keys(trials)
        found = {trial.name: _kept(_file(folder, trial), keys[trial.name]) for trial in trials}
        done = {name: figures for name, figures in found.items() if figures is not None}
        progress(len(done))
        missing = [trial for trial in trials if trial.name not in done]
        for trial, figures in _run(missing, workers or os.cpu_count() or 1):
            _keep(_file(folder, trial), keys[trial.name], figures)
            done[trial.name] = figures
            progress(len(done))
    return {trial.name: done[trial.name] for trial in trials}


def _check_names(trials: Sequence[Trial]) -> None:
    seen: set[str] = set()
    for trial in trials:
        if trial.name in seen:
            raise ValueError(f"two trials are called {trial.name}")
        seen.add(trial.name)


def _file(folder: Path, trial: Trial) -> Path:
    return folder / f"{trial.name}.npz"


# --- running --------------------------------------------------------------------------------------------------------


def _run(trials: Sequence[Trial], workers: int) -> Iterator[tuple[Trial, Figures]]:
    """The trials as they end, in any order."""
    if not trials:
        return
    context = multiprocessing.get_context("spawn")
    with noted_interrupts() as interrupted, ProcessPoolExecutor(min(workers, len(trials)), mp_context=context) as pool:
        with ignored_interrupts():
            waiting = {pool.submit(_figures, trial): trial for trial in trials}
        try:
            yield from _ended(waiting, interrupted)
        finally:
            _cancel(waiting)


def _ended(waiting: Mapping[Future[Figures], Trial], interrupted: list[bool]) -> Iterator[tuple[Trial, Figures]]:
    """Trials and figures as they come; after a failure or Ctrl-C those that still run, then it is raised."""
    failure: Exception | None = None
    for future in as_completed(waiting):
        trial = waiting[future]
        try:
            figures = future.result()
        except CancelledError:
            failure = failure or RunStoppedError("stopped by the user; what is there is kept", 0.0, interrupted=True)
        except BrokenProcessPool:
            failure = failure or RunStoppedError(f"an FMU took a process down, in trial {trial.name} or beside it", 0.0)
        except (AttitudeFmuError, ArithmeticError, ValueError) as error:
            error.add_note(f"in trial {trial.name}")
            failure = failure or error
        else:
            yield trial, figures
        if failure is not None or interrupted:
            _cancel(waiting)
    if failure is not None:
        raise failure


def _cancel(futures: Mapping[Future[Figures], Trial]) -> None:
    for future in futures:
        future.cancel()


def _figures(trial: Trial) -> Figures:
    outcome = simulate(
        trial.system,
        stop_time=trial.stop_time,
        step=trial.step,
        order=trial.order,
        record=trial.record,
        interval=trial.interval,
    )
    return {name: np.asarray(value) for name, value in trial.take(outcome.results).items()}


# --- keeping --------------------------------------------------------------------------------------------------------


def _keys(trials: Sequence[Trial]) -> dict[str, str]:
    """By name, a hash of all that a trial's figures follow from."""
    content, sources = cache(_content), cache(_sources)

    def key(trial: Trial) -> str:
        system = trial.system
        parts = [
            [(component.name, content(component.fmu)) for component in system.components],
            system.connections,
            [sorted(one.values.items()) for one in system.parameter_sets],
            (system.start_time, trial.stop_time, trial.record, trial.step, trial.interval, trial.order),
            _code(trial.take, sources),
        ]
        return hashlib.sha256(repr(parts).encode()).hexdigest()

    return {trial.name: key(trial) for trial in trials}


def _content(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def _sources(module: Path) -> tuple[tuple[str, str], ...]:
    """Name and content of a module and of all in its folder that it counts on, through imports of imports."""
    found: set[Path] = set()
    waiting = {module}
    while waiting:
        found |= waiting
        waiting = {path for one in waiting for path in _neighbours(one)} - found
    return tuple((path.name, _content(path)) for path in sorted(found))


def _neighbours(module: Path) -> Iterator[Path]:
    """The modules of the same folder that a module imports."""
    for name in _imported(ast.parse(module.read_bytes())):
        path = module.with_name(f"{name}.py")
        if path.is_file():
            yield path


def _imported(tree: ast.Module) -> Iterator[str]:
    """Last names of the modules imported absolutely or from the same package."""
    for node in ast.walk(tree):
        match node:
            case ast.Import(names=names) | ast.ImportFrom(module=None, names=names, level=1):
                yield from (one.name.rpartition(".")[2] for one in names)
            case ast.ImportFrom(module=str(name), level=0 | 1):
                yield name.rpartition(".")[2]


def _code(take: Take, sources: Callable[[Path], Any]) -> tuple[Any, ...]:
    """The function and its fixed arguments, and the sources that it counts on."""
    if isinstance(take, partial):
        return (*_code(take.func, sources), take.args, sorted(take.keywords.items()))
    return take.__module__, take.__qualname__, sources(Path(inspect.getfile(take)))


def _kept(path: Path, key: str) -> Figures | None:
    """What an earlier study left under this key."""
    try:
        with np.load(path) as archive:
            if str(archive[_KEY]) == key:
                return {name: archive[name] for name in archive.files if name != _KEY}
    except (OSError, ValueError, KeyError, EOFError, BadZipFile):
        # none, of another key, or damaged: run again
        return None
    return None


def _keep(path: Path, key: str, figures: Figures) -> None:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultsError(f"cannot write {path}: {error.strerror or error}") from error
    kept: dict[str, Any] = {_KEY: np.array(key), **figures}
    with whole_or_not(path) as draft:
        np.savez(draft, **kept)
