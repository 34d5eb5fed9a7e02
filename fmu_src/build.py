"""Builds the FMUs of the catalogue.

``build_all(Path("dist"))`` makes what is missing or older than its sources; ``build`` makes one in any case. Native
FMUs lie in the folder itself, those of the Python kind in its folder ``python``, under the same names.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple
from xml.etree import ElementTree

from .catalogue import CATALOGUE, Entry, Kind, with_device, with_values
from .catalogue import entry as entry_called
from .errors import BuildError
from .native.compile import PLATFORMS, host_platform
from .sources import fingerprint_of, guid_of

Platforms = Literal["host", "all"]
"""The platforms that a native FMU is compiled for: this machine's own, or every one."""

Progress = Callable[[str, str], None]
"""Called with an FMU's identifier and what happens: "building", "built" or "up to date"."""


class Order(NamedTuple):
    """What to assemble: the entry, the kind, and the folders of the platforms of a native FMU."""

    entry: Entry
    kind: Kind
    platforms: tuple[str, ...]

    def to_json(self) -> str:
        """The order as text for another process."""
        return json.dumps(self)

    @classmethod
    def from_json(cls, text: str) -> Order:
        """The order that `to_json` wrote."""
        entry, kind, platforms = json.loads(text)
        whole = Entry(*entry)
        starts = tuple((name, value) for name, value in whole.starts)
        return cls(whole._replace(starts=starts), kind, tuple(platforms))


def _quiet(_identifier: str, _event: str) -> None:
    return None


def _entry(
    which: str | Entry, device: str | None = None, specimen: int = 0, values: Mapping[str, Any] | None = None
) -> Entry:
    entry = entry_called(which) if isinstance(which, str) else which
    if device is not None:
        entry = with_device(entry, device, specimen)
    elif specimen:
        raise BuildError(f"specimen {specimen} of which device? Name one, such as {entry.device or 'AttitudeSensor'}")
    return with_values(entry, values) if values else entry


def folder_of(dist: Path, kind: Kind) -> Path:
    """Where in `dist` the FMUs of a kind lie."""
    return dist if kind == "native" else dist / "python"


def _search_path() -> str:
    """Where this process finds modules, for another one.

    The current folder, where it belongs, comes last: a ``random.py`` in it must not hide the standard library's.
    """
    places = [place for place in sys.path if place]
    return os.pathsep.join([*places, os.getcwd()] if "" in sys.path else places)


def _folders(kind: Kind, platforms: Platforms) -> tuple[str, ...]:
    if kind == "python":
        return ()
    wanted = [host_platform()] if platforms == "host" else PLATFORMS
    return tuple(platform.folder for platform in wanted)


def _assembled(entry: Entry, kind: Kind, platforms: Platforms, archive: Path) -> None:
    order = Order(entry, kind, _folders(kind, platforms))
    done = subprocess.run(
        # -P: with -m alone the current folder would be the first place to look
        [sys.executable, "-P", "-m", f"{__package__}.assemble", order.to_json(), str(archive)],
        env={**os.environ, "PYTHONPATH": _search_path(), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        encoding="utf-8",
        errors="replace",
        check=False,
    )
    if done.returncode != 0:
        said = (done.stderr or done.stdout).strip()
        separator = "\n" if "\n" in said else " "
        raise BuildError(f"{entry.identifier} could not be built:{separator}{said}")


def build(
    which: str | Entry,
    dist: Path,
    kind: Kind = "native",
    platforms: Platforms = "host",
    *,
    device: str | None = None,
    specimen: int = 0,
    values: Mapping[str, Any] | None = None,
) -> Path:
    """Build one FMU into the folder `dist`; a file of the same name is replaced whole or not at all.

    A sensor starts with the parameters of a `device` and of one `specimen` of it, if named (`with_device`), and any
    model with other `values`, which also change the file's name (`with_values`).
    """
    entry = _entry(which, device, specimen, values)
    folder = folder_of(dist, kind)
    target = folder / f"{entry.identifier}.fmu"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        handle, unfinished = tempfile.mkstemp(prefix=f".{entry.identifier}_", suffix=".tmp", dir=folder)
        os.close(handle)
        try:
            _assembled(entry, kind, platforms, Path(unfinished))
            Path(unfinished).chmod(0o644)
            os.replace(unfinished, target)
        finally:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(unfinished)
    except OSError as error:
        raise BuildError(f"{target} could not be written: {error.strerror or error}") from error
    return target


def is_stale(which: str | Entry, dist: Path, kind: Kind = "native", platforms: Platforms = "host") -> bool:
    """Whether the FMU in `dist` is missing, unreadable, not made from the sources as they are, or lacks a platform."""
    entry = _entry(which)
    try:
        with zipfile.ZipFile(folder_of(dist, kind) / f"{entry.identifier}.fmu") as fmu:
            guid = ElementTree.fromstring(fmu.read("modelDescription.xml")).get("guid")
            present = {name.split("/")[1] for name in fmu.namelist() if name.startswith("binaries/")}
    except (OSError, KeyError, zipfile.BadZipFile, ElementTree.ParseError):
        return True
    return guid != guid_of(fingerprint_of(entry, kind)) or not present.issuperset(_folders(kind, platforms))


def build_all(
    dist: Path,
    names: Sequence[str] | None = None,
    progress: Progress = _quiet,
    *,
    kind: Kind = "native",
    platforms: Platforms = "host",
    always: bool = False,
) -> list[Path]:
    """Build the FMUs called `names` (all of the catalogue if None) where stale; the paths, in the order asked for."""
    entries = list(CATALOGUE) if names is None else [entry_called(name) for name in names]
    paths = []
    for entry in entries:
        if always or is_stale(entry, dist, kind, platforms):
            progress(entry.identifier, "building")
            build(entry, dist, kind, platforms)
            progress(entry.identifier, "built")
        else:
            progress(entry.identifier, "up to date")
        paths.append(folder_of(dist, kind) / f"{entry.identifier}.fmu")
    return paths
