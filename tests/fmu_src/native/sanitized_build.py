"""An FMU's C sources compiled with the address and undefined-behaviour sanitizers, and processes that can load them."""

from __future__ import annotations

import importlib
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from attitude_fmu.fmu_src.assemble import c_sources
from attitude_fmu.fmu_src.catalogue import Entry
from attitude_fmu.fmu_src.native.compile import headers
from attitude_fmu.fmu_src.sources import fingerprint_of, guid_of
from attitude_fmu.fmu_src.trace import trace

HERE = Path(__file__).parent
_OPTIONS = (
    *("-std=c11", "-O1", "-g", "-fno-omit-frame-pointer", "-ffp-contract=off", "-fno-math-errno", "-shared", "-fPIC"),
    *("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"),
)
_RUNTIMES = {"gcc": ("libasan.so",), "clang": ("libclang_rt.asan.so", "libclang_rt.asan-x86_64.so")}
_SHARED = {"gcc": (), "clang": ("-shared-libasan",)}

Change = Callable[[dict[str, bytes]], None]


class Toolchain(NamedTuple):
    """A compiler and the address sanitizer's shared library, which has to be loaded before everything else."""

    command: tuple[str, ...]
    runtime: str


def _runtime(compiler: str) -> str | None:
    for name in _RUNTIMES[compiler]:
        asked = subprocess.run([compiler, f"-print-file-name={name}"], capture_output=True, text=True, check=False)
        place = Path(asked.stdout.strip())
        if place.is_absolute() and place.exists():
            return str(place.resolve())
    return None


@cache
def toolchain() -> Toolchain:
    """What to compile with; skips the test if there is nothing."""
    for compiler in _RUNTIMES:
        runtime = _runtime(compiler) if shutil.which(compiler) else None
        if runtime is not None:
            return Toolchain((compiler, *_SHARED[compiler]), runtime)
    pytest.skip("no gcc or clang with an address sanitizer")


class SanitizedFmu(NamedTuple):
    """A library and what its host has to know."""

    library: Path
    module: str
    guid: str


def sanitized(entry: Entry, folder: Path, change: Change = lambda _sources: None) -> SanitizedFmu:
    """The FMU's library, from C sources that `change` may spoil."""
    fingerprint = fingerprint_of(entry, "native")
    sources = c_sources(trace(importlib.import_module(entry.module).MODEL), fingerprint)
    sources["sanitized_fmu.c"] = (HERE / "sanitized_fmu.c").read_bytes()
    change(sources)
    for name, content in sources.items():
        (folder / name).write_bytes(content)
    command = [*toolchain().command, *_OPTIONS, "-I", str(headers()), "sanitized_fmu.c", "-lm", "-o", "sanitized.so"]
    subprocess.run(command, cwd=folder, check=True)
    return SanitizedFmu(folder / "sanitized.so", entry.module, guid_of(fingerprint))


def run_sanitized(script: str, arguments: Sequence[object], timeout: float) -> subprocess.CompletedProcess[str]:
    """The Python script in a process that can load what the sanitizers have instrumented."""
    environment = {
        **os.environ,
        "LD_PRELOAD": toolchain().runtime,
        # Python itself leaks; the machine counts what the FMU allocates and frees
        "ASAN_OPTIONS": "detect_leaks=0:detect_stack_use_after_return=1:strict_string_checks=1",
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "PYTHONPATH": os.pathsep.join([str(HERE), str(HERE.parent), *(place for place in sys.path if place)]),
        "PYTHONMALLOC": "malloc",  # so that the arrays that functions are given are guarded as well
    }
    return subprocess.run(
        [sys.executable, str(HERE / script), *map(str, arguments)],
        env=environment,
        capture_output=True,
        text=True,
        errors="replace",
        timeout=timeout,
        check=False,
    )
