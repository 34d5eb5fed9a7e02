"""Runs in processes of their own: several at a time, and an FMU that crashes takes down its own run only."""

from __future__ import annotations

import io
import multiprocessing
import pickle
import signal
import sys
import tempfile
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, suppress
from multiprocessing.connection import Connection, wait
from pathlib import Path
from typing import Any, NamedTuple

from attitude_fmu.models.errors import AttitudeFmuError

from .errors import RunStoppedError
from .master import Order, Outcome, noted_interrupts, safe_folder, simulate, spill_of
from .recording import rescue, write_csv
from .system import System

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


def run_jobs(jobs: Sequence[Job], progress: Progress) -> dict[str, Outcome]:
    """Run all jobs at the same time, each in its own process; gives what they recorded, by name.

    When one fails, or at Ctrl-C, all are ended, each with its results so far on disk.
    Raises the first failure: `SystemRefusedError`, `RunStoppedError` or `ResultsError`.
    """
    context = multiprocessing.get_context("spawn")
    stop = context.Event()
    with tempfile.TemporaryDirectory(prefix="attitude_fmu_", dir=safe_folder()) as workspace:
        running = []
        for job in jobs:
            receiver, sender = context.Pipe(duplex=False)
            process = context.Process(target=_work, args=(job, Path(workspace), sender, stop), daemon=True)
            process.start()
            # the child holds the other end: its death is the end of the file
            sender.close()
            running.append(_Process(job, process, receiver))
        try:
            return _collect(running, stop, progress)
        finally:
            for _, process, messages in running:
                process.terminate()
                process.join()
                messages.close()


def _work(job: Job, workspace: Path, messages: Connection, stop: Any) -> None:
    """The child: runs a job and tells its parent."""
    # the parent decides what Ctrl-C means
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def tell(time: float) -> None:
        try:
            messages.send(("time", time))
        except OSError:
            # the parent is gone: keep the results and go as well
            raise KeyboardInterrupt from None
        if stop.is_set():
            raise KeyboardInterrupt

    heard = _Heard()
    try:
        with redirect_stderr(heard):
            outcome = simulate(
                job.system,
                stop_time=job.stop_time,
                step=job.step,
                order=job.order,
                record=job.record,
                interval=job.interval,
                results=job.results,
                progress=tell,
                workspace=workspace,
            )
        answer: tuple[str, Any] = ("done", outcome)
    except AttitudeFmuError as error:
        answer = ("failed", _portable(error))
    heard.pass_on(str(answer[1]) if answer[0] == "failed" else "")
    with suppress(BrokenPipeError):
        messages.send(answer)


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


def _portable(error: AttitudeFmuError) -> AttitudeFmuError:
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:  # an error whose class wants more than its message
        return AttitudeFmuError(str(error))
    return error


def _collect(running: list[_Process], stop: Any, progress: Progress) -> dict[str, Outcome]:
    outcomes: dict[str, Outcome] = {}
    failures: list[AttitudeFmuError] = []
    reached = {one.job.name: one.job.system.start_time for one in running}
    waiting = list(running)
    with noted_interrupts() as interrupted:
        while waiting:
            ready = wait([one.messages for one in waiting], timeout=0.2)
            if interrupted:
                stop.set()
            for one in [one for one in waiting if one.messages in ready]:
                kind, value = _message(one, reached[one.job.name])
                if kind == "time":
                    reached[one.job.name] = value
                    progress(one.job.name, value)
                    continue
                waiting.remove(one)
                if kind == "done":
                    outcomes[one.job.name] = value
                else:
                    failures.append(value)
                    stop.set()
    if failures:
        # a run that was only asked to stop says nothing about why
        raise next((f for f in failures if not getattr(f, "interrupted", False)), failures[0])
    return outcomes


def _message(one: _Process, reached: float) -> tuple[str, Any]:
    try:
        kind, value = one.messages.recv()
        return kind, value
    except EOFError:
        return "failed", _crashed(one, reached)


def _crashed(one: _Process, reached: float) -> RunStoppedError:
    one.process.join()
    code = one.process.exitcode
    how = f"code {code}"
    if code < 0:
        with suppress(ValueError):
            how = signal.Signals(-code).name
    results = rescue(spill_of(one.job.results))
    time = reached
    if results is not None and len(results):
        write_csv(one.job.results, results)
        time = float(results["time"][-1])
    return RunStoppedError(f"an FMU took the whole run down ({how}) after t = {time:.6g} s", time, results)
