"""FMI 2.0 for co-simulation as a C host calls it: every function, any argument, nothing checked on the way."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from ctypes import POINTER, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any

OK, WARNING, DISCARD, ERROR = range(4)
CO_SIMULATION = 1

C_TYPES: dict[str, Any] = {"Real": c_double, "Integer": c_int, "Boolean": c_int, "String": c_char_p}

# The messages come as the only variable argument, after the format "%s".
Logger = ctypes.CFUNCTYPE(None, c_void_p, c_char_p, c_int, c_char_p, c_char_p, c_char_p)


class Host(ctypes.Structure):
    """fmi2CallbackFunctions."""

    _fields_ = (
        ("logger", Logger),
        ("allocateMemory", c_void_p),
        ("freeMemory", c_void_p),
        ("stepFinished", c_void_p),
        ("componentEnvironment", c_void_p),
    )


_REFERENCES, _COUNT, _PLACE = POINTER(c_uint), c_size_t, POINTER(c_void_p)

_ARGUMENTS: dict[str, tuple[Any, ...]] = {
    "FreeInstance": (),
    "SetDebugLogging": (c_int, _COUNT, POINTER(c_char_p)),
    "SetupExperiment": (c_int, c_double, c_double, c_int, c_double),
    "EnterInitializationMode": (),
    "ExitInitializationMode": (),
    "Terminate": (),
    "Reset": (),
    **{f"Get{kind}": (_REFERENCES, _COUNT, POINTER(c_type)) for kind, c_type in C_TYPES.items()},
    **{f"Set{kind}": (_REFERENCES, _COUNT, POINTER(c_type)) for kind, c_type in C_TYPES.items()},
    "GetFMUstate": (_PLACE,),
    "SetFMUstate": (c_void_p,),
    "FreeFMUstate": (_PLACE,),
    "SerializedFMUstateSize": (c_void_p, POINTER(c_size_t)),
    "SerializeFMUstate": (c_void_p, c_char_p, c_size_t),
    "DeSerializeFMUstate": (c_char_p, c_size_t, _PLACE),
    "GetDirectionalDerivative": (_REFERENCES, _COUNT, _REFERENCES, _COUNT, POINTER(c_double), POINTER(c_double)),
    "SetRealInputDerivatives": (_REFERENCES, _COUNT, POINTER(c_int), POINTER(c_double)),
    "GetRealOutputDerivatives": (_REFERENCES, _COUNT, POINTER(c_int), POINTER(c_double)),
    "DoStep": (c_double, c_double, c_int),
    "CancelStep": (),
    "GetStatus": (c_int, POINTER(c_int)),
    "GetRealStatus": (c_int, POINTER(c_double)),
    "GetIntegerStatus": (c_int, POINTER(c_int)),
    "GetBooleanStatus": (c_int, POINTER(c_int)),
    "GetStringStatus": (c_int, POINTER(c_char_p)),
}
"""What each function takes after the component."""

FUNCTIONS = tuple(_ARGUMENTS)


class Library:
    """The functions of an FMU's shared library, without ``fmi2`` before their names."""

    def __init__(self, path: Path | str) -> None:
        self.loaded = ctypes.CDLL(str(path))
        for name, arguments in _ARGUMENTS.items():
            function = getattr(self.loaded, f"fmi2{name}")
            function.argtypes = (c_void_p, *arguments)
            function.restype = None if name == "FreeInstance" else c_int
            setattr(self, name, function)
        self.Instantiate = self.loaded.fmi2Instantiate
        self.Instantiate.argtypes = (c_char_p, c_int, c_char_p, c_char_p, POINTER(Host), c_int, c_int)
        self.Instantiate.restype = c_void_p

    def nothing(self, name: str) -> tuple[Any, ...]:
        """Arguments for the function after the component: zero and NULL."""
        return tuple(
            None if hasattr(kind, "contents") or kind in (c_void_p, c_char_p) else 0 for kind in _ARGUMENTS[name]
        )


def array(c_type: Any, values: Sequence[Any]) -> Any:
    """A C array, of a size that a sanitizer can check."""
    return (c_type * len(values))(*values)


class Unit:
    """One instance and what it has logged: ``(status, category, text)``."""

    def __init__(
        self,
        library: Library,
        name: bytes,
        guid: bytes,
        *,
        kind: int = CO_SIMULATION,
        resources: bytes | None = None,
        has_host: bool = True,
        has_logger: bool = True,
        logging: bool = False,
    ) -> None:
        self.library = library
        self.log: list[tuple[int, str, str]] = []
        self.logged_names: set[bytes] = set()
        self._logger = Logger(self._take) if has_logger else Logger(0)
        self.host = Host(self._logger, None, None, None, None)
        host = byref(self.host) if has_host else None
        self.has_log = has_host and has_logger
        self.handle = library.Instantiate(name, kind, guid, resources, host, 0, logging)

    def _take(self, _environment: Any, name: bytes, status: int, category: bytes, form: bytes, text: bytes) -> None:
        assert form == b"%s"
        self.logged_names.add(name)
        self.log.append((status, category.decode(), text.decode("utf-8", "backslashreplace")))

    def call(self, name: str, *arguments: Any) -> int:
        status: int = getattr(self.library, name)(self.handle, *arguments)
        return status

    def get(self, kind: str, references: Sequence[int]) -> tuple[int, list[Any]]:
        values = array(C_TYPES[kind], [-1] * len(references))
        status = self.call(f"Get{kind}", array(c_uint, references), len(references), values)
        return status, list(values)

    def set(self, kind: str, references: Sequence[int], values: Sequence[Any]) -> int:
        return self.call(f"Set{kind}", array(c_uint, references), len(references), array(C_TYPES[kind], values))

    def setup(self, start_time: float = 0.0) -> int:
        return self.call("SetupExperiment", 0, 0.0, start_time, 0, 0.0)

    def initialise(self, start_time: float = 0.0) -> list[int]:
        return [self.setup(start_time), self.call("EnterInitializationMode"), self.call("ExitInitializationMode")]

    def step(self, time: float, size: float) -> int:
        return self.call("DoStep", time, size, 1)

    def save(self, state: c_void_p | None = None) -> c_void_p:
        state = c_void_p() if state is None else state
        assert self.call("GetFMUstate", byref(state)) == OK
        return state

    def drop(self, state: c_void_p) -> None:
        assert self.call("FreeFMUstate", byref(state)) == OK
        assert state.value is None

    def serialised(self, state: c_void_p) -> bytes:
        size = c_size_t()
        assert self.call("SerializedFMUstateSize", state, byref(size)) == OK
        content = ctypes.create_string_buffer(size.value)
        assert self.call("SerializeFMUstate", state, content, size.value) == OK
        return content.raw

    def deserialised(self, content: bytes) -> tuple[int, c_void_p]:
        state = c_void_p()
        return self.call("DeSerializeFMUstate", content, len(content), byref(state)), state

    def free(self) -> None:
        self.library.FreeInstance(self.handle)
        self.handle = None
