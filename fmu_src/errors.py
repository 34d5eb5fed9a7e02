"""Errors of building and of running FMUs."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

from ..models.errors import AttitudeFmuError


class InterfaceError(AttitudeFmuError, TypeError):
    """Records that cannot be shown as FMI variables."""


class BuildError(AttitudeFmuError, RuntimeError):
    """An FMU that could not be built."""


class CallRefusedError(AttitudeFmuError, RuntimeError):
    """A call that FMI or the instance's state does not allow."""


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A hint that names what is spelt like `name`, or nothing."""
    close = get_close_matches(name, list(known), n=3, cutoff=0.6)
    return f"; did you mean {' or '.join(close)}?" if close else ""
