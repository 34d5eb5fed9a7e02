"""The project's errors: one family, so that a caller catches `AttitudeFmuError` and nothing else of ours escapes."""

from __future__ import annotations


def digits(value: float) -> str:
    """A number as messages show it, the same from Python and C."""
    return f"{value:.15g}"


class AttitudeFmuError(Exception):
    """Base of every error that this package raises on purpose."""


class InstanceError(AttitudeFmuError):
    """An error of one instance of a model; its message begins with the instance's name."""


class ValueRefusedError(InstanceError, ValueError):
    """A parameter or input that the model cannot take.

    The message reads ``instance.variable = value unit: why (allowed range)``.
    """

    def __init__(self, variable: str, value: float, unit: str, why: str, allowed: str) -> None:
        shown = digits(value) if unit == "1" else f"{digits(value)} {unit}"
        super().__init__(f"{variable} = {shown}: {why} (allowed: {allowed})")
        self.variable = variable
        self.value = value


class ModelStoppedError(InstanceError, ArithmeticError):
    """A model whose numbers left the range of floats; its last good state is kept."""
