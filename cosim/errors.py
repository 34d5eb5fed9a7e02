"""What can go wrong when FMUs are put together and run, each with one message for the user."""

from __future__ import annotations

from typing import Any

from attitude_fmu.models.errors import AttitudeFmuError


class SystemRefusedError(AttitudeFmuError, ValueError):
    """A coupled system that cannot be read, or cannot run as it is described."""


class LinearisationRefusedError(AttitudeFmuError, ValueError):
    """A model that has no linear or sampled model of the kind that is asked for."""


class ExportRefusedError(AttitudeFmuError, ValueError):
    """A controller that cannot become an FMU as it is."""


class ResultsError(AttitudeFmuError, OSError):
    """Results that cannot be written to or read from disk."""


class RunStoppedError(AttitudeFmuError, RuntimeError):
    """A run that an FMU, a crash or the user ended early.

    `time` (s) is how far it came, `results` what was recorded until then (None if nothing was).
    """

    def __init__(self, message: str, time: float, results: Any = None, interrupted: bool = False) -> None:
        super().__init__(message)
        self.time = time
        self.results = results
        self.interrupted = interrupted

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.time, self.results, self.interrupted)
