"""The communication points of a run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

from .errors import SystemRefusedError
from .interface import Interface
from .system import System

_MOST_STEPS = 10**9


class Span(NamedTuple):
    """From `start` to `stop` (s) in `steps` steps of `step` (s), the last of `last` (s); each `every`-th recorded."""

    start: float
    stop: float
    step: float
    steps: int
    last: float
    every: int

    @classmethod
    def of(cls, system: System, stop_time: float | None, step: float, interval: float | None) -> Span:
        stop = system.stop_time if stop_time is None else stop_time
        if stop is None:
            raise SystemRefusedError(f"system {system.name} has no stop time of its own; give one")
        if not (math.isfinite(step) and step > 0.0):
            raise SystemRefusedError(f"step = {step:g} s: a positive time is wanted")
        if not (math.isfinite(system.start_time) and math.isfinite(stop) and stop > system.start_time):
            raise SystemRefusedError(
                f"stop time = {stop:g} s: later than the start at {system.start_time:g} s is wanted"
            )
        if (stop - system.start_time) / step > _MOST_STEPS:
            raise SystemRefusedError(
                f"step = {step:g} s: too small for {stop - system.start_time:g} s (at most {_MOST_STEPS:g} steps)"
            )
        # a rest far below a step is the rounding of start + k * step, not a step of its own
        steps = max(1, math.ceil((stop - system.start_time) / step - 1e-6))
        last = stop - (system.start_time + (steps - 1) * step)
        if abs(last - step) <= 1e-6 * step:
            last = step
        every = 1 if interval is None else _multiple(interval, step)
        return cls(system.start_time, stop, step, steps, last, every)

    @property
    def rows(self) -> int:
        """The start, every n-th communication point, and the end."""
        return 1 + math.ceil(self.steps / self.every)

    def time(self, point: int) -> float:
        """The time (s) of a communication point."""
        return self.stop if point == self.steps else self.start + point * self.step


def _multiple(interval: float, step: float) -> int:
    every = round(interval / step) if math.isfinite(interval) else 0
    if every < 1 or abs(every * step - interval) > 1e-6 * step:
        raise SystemRefusedError(f"recording interval = {interval:g} s: a multiple of the step, {step:g} s, is wanted")
    return every


def check_last_step(span: Span, interfaces: Mapping[str, Interface]) -> None:
    """Raise `SystemRefusedError` if the last step is shorter and an FMU takes steps of one size only."""
    if span.last == span.step:
        return
    for name, interface in interfaces.items():
        if not interface.description.coSimulation.canHandleVariableCommunicationStepSize:
            raise SystemRefusedError(
                f"component {name} takes steps of one size only, and {span.stop - span.start:g} s is no multiple of "
                f"{span.step:g} s; choose another stop time or step"
            )
