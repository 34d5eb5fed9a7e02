"""How a Python exception leaves a pythonfmu slave without harm, and with its reason visible.

pythonfmu 0.7 ends a call that raised with fmi2Fatal. (fmi2Error cannot be had: every other way out of the wrapper
leaves the interpreter locked. A false ``do_step`` would be fmi2Discard, on which masters stop silently or loop.)
On its way it drops one reference too many to the instance, the class and the log queue, and the host crashes
later; one more reference to each, taken before, makes up for it, so that fmi2Reset, fmi2SetFMUstate, fmi2FreeInstance
and further calls work.

The wrapper logs the text only with logging on, and as a printf format: ``%`` is doubled, and the text goes to stderr
as well. A message queued for the log would reach the host with the exception still set, which a host written in
Python does not survive: refusals queue none.
"""

from __future__ import annotations

import contextlib
import functools
import sys
import traceback
from collections.abc import Callable
from typing import Any, TypeVar

from ..models.errors import AttitudeFmuError, InstanceError

_Method = TypeVar("_Method", bound=Callable[..., Any])


class FailedCall(Exception):  # noqa: N818 - its name stands in no message
    """What the wrapper gets to see: it logs the repr."""

    def __repr__(self) -> str:
        return str(self).encode("utf-8", "replace").decode().replace("%", "%%")


def _hold(slave: Any) -> None:
    with contextlib.suppress(ImportError, AttributeError):
        from ctypes import py_object, pythonapi

        for thing in (slave, type(slave), slave.log_queue):
            pythonapi.Py_IncRef(py_object(thing))


def _message(slave: Any, error: BaseException) -> str:
    """The error's text with the instance's name, which an `InstanceError` brings and no other does."""
    if isinstance(error, InstanceError):
        return str(error)
    kind = "" if isinstance(error, AttitudeFmuError) else f"{type(error).__name__}: "
    return f"{slave.instance_name}: {kind}{error}".removesuffix(": ")


def _show(message: str, error: BaseException) -> None:
    with contextlib.suppress(Exception):  # a host without a console has no stderr
        print(message, file=sys.stderr, flush=True)
        if isinstance(error, Exception) and not isinstance(error, AttitudeFmuError):
            traceback.print_exception(error, file=sys.stderr)


def guarded(method: _Method) -> _Method:
    """A slave's method whose exceptions reach the host as fmi2Fatal and nothing worse."""

    @functools.wraps(method)
    def call(self: Any, *arguments: Any) -> Any:
        try:
            return method(self, *arguments)
        except BaseException as error:  # also KeyboardInterrupt: the wrapper mishandles every one
            message = _message(self, error)
            with contextlib.suppress(Exception):  # what broke may be the instance itself
                self.count_refusal()
            _show(message, error)
            _hold(self)
            raise FailedCall(message) from None

    return call  # type: ignore[return-value]
