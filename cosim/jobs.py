"""Runs in processes of their own: several at a time, and an FMU that crashes takes down its own run only."""

from __future__ import annotations

import io
import math
import multiprocessing
import pickle
import signal
import sys
import tempfile
import time as clock
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, suppress
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, NamedTuple

from attitude_fmu.models.errors import AttitudeFmuError

from .errors import ResultsError, RunStoppedError
from .interrupts import ignored_interrupts, noted_interrupts
from .master import Order, Outcome, Plan, plan_run, run_plan, spill_of
from .recording import Recording, Results, keep, read_rows, rescue
from .system import System
from .workspace import claimed, safe_folder

_GRACE = 2.0
"""s, how long a run that is asked to stop may take for the step that it is in."""

Progress = Callable[[str, float], None]
"""Called with a job's name and the time (s) that it has reached."""


class Job(NamedTuple):
    """One run: `results` is its CSV file, the rest as `simulate` takes it."""

    name: str
    system: System
    results: Path
    stop_time: float
    step: float = 1e-3
    order: Order = "gauss-seidel"
    record: tuple[str, ...] | None = None
    interval: float | None = None


class _Process(NamedTuple):
    job: Job
    process: Any
    messages: Connection


class _Answer(NamedTuple):
    """How a job ended: with an outcome that still lacks its rows, or with an error."""

    outcome: Outcome | None
    error: AttitudeFmuError | None
    crashed: bool = False


def check_job(job: Job) -> Plan:
    """Raise `SystemRefusedError` if a job cannot be run; touches no file."""
    return plan_run(job.system, job.stop_time, job.step, job.order, job.record, job.interval)


def run_jobs(
    jobs: Sequence[Job], progress: Progress, stopping: Callable[[], None] = lambda: None
) -> dict[str, Outcome]:
    """Run all jobs at the same time, each in its own process; gives what they recorded, by name.

    When one fails, or at Ctrl-C, all are ended, each with its results so far on disk; `stopping` is called at Ctrl-C.
    One that does not end within 2 s, or at a second Ctrl-C, is killed.

    Raises the first failure: `SystemRefusedError`, `RunStoppedError` or `ResultsError`.
    """
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    with (
        tempfile.TemporaryDirectory(prefix="attitude_fmu_", dir=safe_folder()) as workspace,
        noted_interrupts(most=2) as interrupted,
    ):
        running: list[_Process] = []
        try:
            for job in jobs:
                running.append(_started(context, job, Path(workspace), stop))
            answers = _collect(running, stop, progress, interrupted, stopping)
            return _outcomes(running, answers)
        finally:
            for _, process, messages in running:
                process.terminate()
                process.join()
                messages.close()


def _started(context: Any, job: Job, workspace: Path, stop: Any) -> _Process:
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_work, args=(job, workspace, sender, stop), daemon=True)
    with ignored_interrupts():
        process.start()
    # the child holds the other end: its death is the end of the file
    sender.close()
    return _Process(job, process, receiver)


def _work(job: Job, workspace: Path, messages: Connection, stop: Any) -> None:
    """The child: runs a job and tells its parent."""
    # inherited from the parent, but not everywhere
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def tell(time: float) -> None:
        try:
            messages.send(("time", time))
        except OSError:
            # the parent is gone: keep the results and go as well
            raise KeyboardInterrupt from None
        if stop.is_set():
            raise KeyboardInterrupt

    def close(recording: Recording) -> Results:
        # writing may take longer than an FMU is waited for
        with suppress(OSError):
            messages.send(("ended", None))
        keep(recording.filled(), job.results, recording.path)
        # the parent takes the rows from the file
        return recording.close(keep_file=True)

    heard = _Heard()
    try:
        with redirect_stderr(heard):
            outcome = run_plan(job.system, check_job(job), job.results, tell, workspace, close)
        answer = _Answer(outcome, None)
    except AttitudeFmuError as error:
        answer = _Answer(None, portable(error))
    except Exception as error:
        traceback.print_exc(file=heard)
        answer = _Answer(None, AttitudeFmuError(f"internal error: {type(error).__name__}: {error}"))
    heard.pass_on(str(answer.error or ""))
    with suppress(BrokenPipeError):
        messages.send(("answer", answer))


class _Heard(io.TextIOBase):
    """Keeps the last of what FMUs in Python print to stderr, to pass on what the error does not say anyway."""

    def __init__(self) -> None:
        self.pieces: deque[str] = deque(maxlen=1000)

    def write(self, text: str) -> int:
        self.pieces.append(text)
        return len(text)

    def pass_on(self, said: str) -> None:
        for line in "".join(self.pieces).splitlines():
            if line.strip() and line.strip() not in said:
                print(line, file=sys.stderr)


def portable(error: AttitudeFmuError) -> AttitudeFmuError:
    """The error, or its message alone where it would not come through to another process."""
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # an error whose class wants more than its message
        return AttitudeFmuError(str(error))
    return error


def _collect(
    running: list[_Process], stop: Any, progress: Progress, interrupted: list[bool], stopping: Callable[[], None]
) -> dict[str, _Answer]:
    answers: dict[str, _Answer] = {}
    waiting = list(running)
    computing = list(running)
    killed: set[str] = set()
    patience = math.inf
    while waiting:
        ready = wait([one.messages for one in waiting], timeout=0.2)
        if interrupted and not stop.is_set():
            stopping()
            stop.set()
        if stop.is_set():
            patience = min(patience, clock.monotonic() + _GRACE)
        if len(interrupted) > 1 or clock.monotonic() > patience:
            killed.update(one.job.name for one in computing)
            for one in computing:
                one.process.kill()
        for one in [one for one in waiting if one.messages in ready]:
            kind, value = _message(one, one.job.name in killed)
            if kind == "time":
                progress(one.job.name, value)
                continue
            if one in computing:
                computing.remove(one)
            if kind == "answer":
                waiting.remove(one)
                answers[one.job.name] = value
                if value.error is not None:
                    stop.set()
    return answers


def _message(one: _Process, killed: bool) -> tuple[str, Any]:
    try:
        kind, value = one.messages.recv()
        return kind, value
    except (EOFError, OSError):
        one.process.join()
        code = one.process.exitcode
        how = f"code {code}"
        if code < 0:
            with suppress(ValueError):
                how = signal.Signals(-code).name
        message = "stopped by the user" if killed else f"an FMU took the whole run down ({how})"
        error = RunStoppedError(message, one.job.system.start_time, interrupted=killed)
        return "answer", _Answer(None, error, crashed=True)


def _outcomes(running: list[_Process], answers: dict[str, _Answer]) -> dict[str, Outcome]:
    outcomes: dict[str, Outcome] = {}
    failures: list[AttitudeFmuError] = []
    for job, process, _ in running:
        outcome, error, crashed = answers[job.name]
        process.join()
        rows = None if isinstance(error, ResultsError) else _rows(job, crashed)
        if outcome is not None and rows is not None:
            outcomes[job.name] = outcome._replace(results=rows)
        elif isinstance(error, RunStoppedError):
            failures.append(_stopped(error, rows, crashed))
        else:
            failures.append(error or ResultsError(f"the results in {spill_of(job.results)} are gone"))
    if failures:
        # a run that was only asked to stop says nothing about why
        raise next((f for f in failures if not getattr(f, "interrupted", False)), failures[0])
    return outcomes


def _rows(job: Job, crashed: bool) -> Results | None:
    spill = spill_of(job.results)
    with claimed(job.results):
        if crashed:
            return rescue(spill, job.results)
        rows = read_rows(spill)
        spill.unlink(missing_ok=True)
        return rows


def _stopped(error: RunStoppedError, rows: Results | None, crashed: bool) -> RunStoppedError:
    """The error with the rows of the run, and with their time where the process itself could not tell it."""
    if not crashed:
        return RunStoppedError(str(error), error.time, rows, error.interrupted)
    time = error.time if rows is None or not len(rows) else float(rows["time"][-1])
    when = "at" if error.interrupted else "after"
    return RunStoppedError(f"{error} {when} t = {time:.6g} s", time, rows, error.interrupted)
