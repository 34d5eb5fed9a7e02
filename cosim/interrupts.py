"""Ctrl-C and progress during a run."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Progress = Callable[[float], None]


class Watch:
    """Tells how far a run is, about two hundred times, and ends it when the user asks."""

    def __init__(self, progress: Progress | None, interrupted: list[bool]) -> None:
        self.progress = progress
        self.interrupted = interrupted

    def stops(self, time: float) -> bool:
        """Tell the time (s) that the run has reached; says whether it is to end."""
        try:
            if self.progress is not None:
                self.progress(time)
        except KeyboardInterrupt:
            self.interrupted.append(True)
        return bool(self.interrupted)


@contextmanager
def noted_interrupts(most: int = 1) -> Iterator[list[bool]]:
    """Note Ctrl-C instead of raising, which could strike inside an FMU that is written in Python.

    The list that it gives holds one entry for each. After `most` of them another one raises as usual.
    """
    noted: list[bool] = []
    if threading.current_thread() is not threading.main_thread():
        yield noted
        return

    def note(number: int, frame: Any) -> None:
        noted.append(True)
        if len(noted) >= most:
            signal.signal(signal.SIGINT, before)

    before = signal.getsignal(signal.SIGINT)
    if before in (signal.SIG_IGN, None):
        yield noted
        return
    signal.signal(signal.SIGINT, note)
    try:
        yield noted
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def ignored_interrupts() -> Iterator[None]:
    """Processes that are started inside ignore Ctrl-C from their first moment; the parent decides what it means."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before if before is not None else signal.SIG_DFL)
