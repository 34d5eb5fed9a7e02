"""Errors of building and of running FMUs."""

from __future__ import annotations

from ..models.errors import AttitudeFmuError


class InterfaceError(AttitudeFmuError, TypeError):
    """Records that cannot be shown as FMI variables."""


class BuildError(AttitudeFmuError, RuntimeError):
    """An FMU that could not be built."""


class CallRefusedError(AttitudeFmuError, RuntimeError):
    """A call that FMI or the instance's state does not allow."""
