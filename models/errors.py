"""The project's errors: one family, so that a caller catches `AttitudeFmuError` and nothing else of ours escapes."""

from __future__ import annotations


class AttitudeFmuError(Exception):
    """Base of every error that this package raises on purpose."""


class InstanceError(AttitudeFmuError):
    """An error of one instance of a model; its message begins with the instance's name."""


class ValueRefusedError(InstanceError, ValueError):
    """A parameter or input that the model cannot take.

    The message reads ``instance.variable = value unit: why (allowed range)``.
    """

    def __init__(self, variable: str, value: object, unit: str, why: str, allowed: str) -> None:
        shown = f"{value} {unit}".rstrip() if unit != "1" else str(value)
        super().__init__(f"{variable} = {shown}: {why} (allowed: {allowed})")
        self.variable = variable
        self.value = value


class ModelStoppedError(InstanceError, ArithmeticError):
    """A model whose numbers left the range of floats; its last good state is kept."""
