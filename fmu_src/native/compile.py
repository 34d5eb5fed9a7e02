"""Compiles the C sources of an FMU for every platform, with the compiler of the ``ziglang`` package.

Options that matter: no contraction of ``a * b + c`` into one rounding, so that the bits are Python's; glibc 2.17, so
that Linux distributions since 2013 can load it; only the FMI functions visible.
"""

from __future__ import annotations

import importlib.util
import os
import platform
import struct
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

from ..errors import BuildError

_OPTIONS = ("-std=c11", "-O2", "-g0", "-ffp-contract=off", "-fno-math-errno", "-fno-sanitize=undefined", "-shared")
_POSIX_OPTIONS = ("-fPIC", "-fvisibility=hidden")


class Platform(NamedTuple):
    """A folder in ``binaries/``, the suffix of libraries there, and the targets: two make a universal one."""

    folder: str
    suffix: str
    targets: tuple[str, ...]


_APPLE = ("x86_64-macos.11.0", "aarch64-macos.11.0")

PLATFORMS = (
    Platform("linux64", ".so", ("x86_64-linux-gnu.2.17",)),
    Platform("aarch64-linux", ".so", ("aarch64-linux-gnu.2.17",)),
    Platform("win64", ".dll", ("x86_64-windows-gnu",)),
    Platform("darwin64", ".dylib", _APPLE),
    Platform("aarch64-darwin", ".dylib", _APPLE),
)
"""What FMI 2.0 hosts look for; those on Apple's processors look into either of the last two."""


def host_platform() -> Platform:
    """The platform of this machine. Raises `BuildError` if FMUs are not built for it."""
    number = {"x86_64": 0, "amd64": 0, "aarch64": 1, "arm64": 1}.get(platform.machine().lower())
    folders = {"linux": ("linux64", "aarch64-linux"), "win32": ("win64",), "darwin": ("darwin64", "aarch64-darwin")}
    of_system = folders.get(sys.platform, ())
    if number is None or number >= len(of_system):
        raise BuildError(f"native FMUs are not built for {sys.platform} on {platform.machine()}; use the Python kind")
    return next(candidate for candidate in PLATFORMS if candidate.folder == of_system[number])


def headers() -> Path:
    """FMI 2.0's C headers, as FMPy brings them. Raises `BuildError` if it is not installed."""
    spec = importlib.util.find_spec("fmpy")
    if spec is None or spec.origin is None:
        raise BuildError("native FMUs are compiled with the headers of the package fmpy, which is missing")
    return Path(spec.origin).parent / "c-code"


def compiler() -> list[str]:
    """The command that compiles. Raises `BuildError` if it is not installed."""
    if importlib.util.find_spec("ziglang") is None:
        raise BuildError(
            "native FMUs are compiled with the package ziglang, which is missing: pip install ziglang, or use the "
            "Python kind"
        )
    return [sys.executable, "-m", "ziglang", "cc"]


_MISLEADING = ("CPATH", "C_INCLUDE_PATH", "LIBRARY_PATH", "SDKROOT")
"""Variables that would let other headers and libraries in, and so other bytes."""


def _can_write(folder: Path) -> bool:
    """Whether a folder, made where it is missing, can be written."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK)


def _environment(cache: Path) -> dict[str, str]:
    """What the compiler runs in; what it keeps for later lies in the user's cache, or in `cache` if that cannot be."""
    environment = {name: value for name, value in os.environ.items() if name not in _MISLEADING}
    environment["ZIG_LOCAL_CACHE_DIR"] = str(cache)
    kept = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    if os.name == "posix" and "ZIG_GLOBAL_CACHE_DIR" not in os.environ and not _can_write(Path(kept)):
        environment["ZIG_GLOBAL_CACHE_DIR"] = str(cache)
    return environment


def _compiled(folder: Path, target: str) -> bytes:
    library = folder / f"{target}.library"
    is_windows, is_apple = "windows" in target, "macos" in target
    options = [*_OPTIONS, *(() if is_windows else _POSIX_OPTIONS), *(() if is_apple else ("-s",))]
    done = subprocess.run(
        # relative paths, because absolute ones would end in the bytes
        [*compiler(), "-target", target, *options, "-I", str(headers()), "fmu.c", "-lm", "-o", library.name],
        cwd=folder,
        capture_output=True,
        encoding="utf-8",
        errors="replace",
        check=False,
        env=_environment(folder / "cache"),
    )
    if done.returncode != 0:
        raise BuildError(f"the C code could not be compiled for {target}:\n{done.stderr.strip()}")
    return library.read_bytes()


def _universal(slices: Sequence[bytes]) -> bytes:
    """A universal Mach-O file of several thin ones: a big-endian table of contents, then each at a page of its own."""
    page = 14
    table = struct.pack(">II", 0xCAFEBABE, len(slices))
    places = []
    end = 1 << page
    for content in slices:
        _magic, processor, subtype = struct.unpack_from("<III", content)
        table += struct.pack(">IIIII", processor, subtype & 0x00FFFFFF, end, len(content), page)
        places.append(end)
        end = -(-(end + len(content)) >> page) << page
    whole = bytearray(places[-1] + len(slices[-1]))
    whole[: len(table)] = table
    for place, content in zip(places, slices, strict=True):
        whole[place : place + len(content)] = content
    return bytes(whole)


def compile_all(sources: dict[str, bytes], platforms: Sequence[Platform]) -> dict[str, bytes]:
    """The library of each platform, by the name of its folder. Raises `BuildError` if the compiler refuses."""
    targets = sorted({target for wanted in platforms for target in wanted.targets})
    with tempfile.TemporaryDirectory(prefix="attitude_fmu_") as name:
        folder = Path(name)
        for source, content in sources.items():
            (folder / source).write_bytes(content)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            compiled = dict(zip(targets, pool.map(lambda target: _compiled(folder, target), targets), strict=True))
    return {
        wanted.folder: compiled[wanted.targets[0]]
        if len(wanted.targets) == 1
        else _universal([compiled[target] for target in wanted.targets])
        for wanted in platforms
    }
