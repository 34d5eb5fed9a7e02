"""Runs an FMU's library as a small C host would, on this machine's processor or on another one."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import zipfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import pytest

from attitude_fmu.fmu_src.native.compile import PLATFORMS, Platform, compiler, headers

_SOURCE = Path(__file__).with_name("host.c")
_INSTANCE = "unit"  # what host.c calls it
_ARM_LIBRARIES = Path("/usr/aarch64-linux-gnu")


class Runner(NamedTuple):
    """A platform, and the command that runs its programs here."""

    platform: Platform
    command: tuple[str, ...]
    environment: dict[str, str]


def runner_of(folder: str, scratch: Path) -> Runner:
    """What runs programs for a folder of ``binaries/``; skips the test where that is not installed."""
    platform = next(candidate for candidate in PLATFORMS if candidate.folder == folder)
    if folder == "win64":
        wine = shutil.which("wine") or shutil.which("wine64")
        if wine is None:
            pytest.skip("wine, which runs the Windows library, is not installed")
        return Runner(platform, (wine,), {"WINEPREFIX": str(scratch / "wine"), "WINEDEBUG": "-all", "DISPLAY": ""})
    if folder == "aarch64-linux":
        emulator = shutil.which("qemu-aarch64") or shutil.which("qemu-aarch64-static")
        if emulator is None:
            pytest.skip("qemu-user, which runs the aarch64 library, is not installed")
        if not _ARM_LIBRARIES.is_dir():
            pytest.skip("libc6-arm64-cross, which the aarch64 library needs, is not installed")
        return Runner(platform, (emulator, "-L", str(_ARM_LIBRARIES)), {})
    return Runner(platform, (), {})


class Host(NamedTuple):
    """The compiled host of one platform."""

    program: Path
    runner: Runner

    @classmethod
    def compiled(cls, runner: Runner, folder: Path) -> Host:
        """The host for the runner's platform, compiled into `folder`."""
        program = folder / f"host_{runner.platform.folder}.exe"
        target = runner.platform.targets[0]
        libraries = () if "windows" in target else ("-ldl",)
        options = ["-target", target, "-std=c11", "-O2", "-I", str(headers()), str(_SOURCE), *libraries]
        subprocess.run([*compiler(), *options, "-o", str(program)], check=True)
        return cls(program, runner)

    def run(self, library: Path, guid: str, commands: Iterable[str]) -> Answer:
        """Let the host do the commands with an FMU's library."""
        done = subprocess.run(
            [*self.runner.command, str(self.program), str(library), guid],
            input="\n".join(commands),
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, **self.runner.environment},
        )
        assert done.returncode == 0, done.stderr
        # wine has things to say as well
        logged = [line for line in done.stderr.splitlines() if line.startswith(f"{_INSTANCE} ")]
        return Answer(done.stdout.splitlines(), logged)


class Answer(NamedTuple):
    """The lines that the host printed, and those that the FMU logged."""

    lines: list[str]
    log: list[str]

    def reals(self) -> list[list[float]]:
        """What each ``get-real`` gave."""
        texts = (line.split()[1:] for line in self.lines if line.startswith("get-real "))
        return [[struct.unpack(">d", bytes.fromhex(text))[0] for text in row] for row in texts]

    def wholes(self, command: str) -> list[list[int]]:
        """What each ``get-integer`` or ``get-boolean`` gave."""
        return [[int(text) for text in line.split()[1:]] for line in self.lines if line.startswith(f"{command} ")]

    def others(self) -> list[str]:
        """All other lines: the version, calls that were refused, the end."""
        return [line for line in self.lines if not line.startswith("get-")]


def library_of(fmu: Path, platform: Platform, folder: Path) -> Path:
    """An FMU's library for a platform, unpacked into `folder`."""
    with zipfile.ZipFile(fmu) as archive:
        return Path(archive.extract(f"binaries/{platform.folder}/{fmu.stem}{platform.suffix}", folder))


def bits(value: float) -> str:
    """A double as the host reads it."""
    return struct.pack(">d", value).hex()


def setting(references: Sequence[int], values: Sequence[float]) -> str:
    """The command that sets real variables."""
    return "real " + " ".join(f"{reference} {bits(value)}" for reference, value in zip(references, values, strict=True))


def getting(command: str, references: Sequence[int]) -> str:
    """The command that reads variables."""
    return f"{command} {' '.join(map(str, references))}"
