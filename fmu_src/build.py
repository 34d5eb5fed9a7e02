"""Builds the FMUs of the catalogue.

``build_all(Path("dist"))`` makes what is missing or older than its sources; ``build`` makes one in any case.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Sequence
from pathlib import Path
from xml.etree import ElementTree

from .catalogue import CATALOGUE, Entry
from .catalogue import entry as entry_called
from .errors import BuildError
from .sources import sources_of

Progress = Callable[[str, str], None]
"""Called with an FMU's identifier and what happens: "building", "built" or "up to date"."""


def _quiet(_identifier: str, _event: str) -> None:
    return None


def _entry(which: str | Entry) -> Entry:
    return entry_called(which) if isinstance(which, str) else which


def _search_path() -> str:
    """Where this process finds modules, for another one.

    The current folder, where it belongs, comes last: a ``random.py`` in it must not hide the standard library's.
    """
    places = [place for place in sys.path if place]
    return os.pathsep.join([*places, os.getcwd()] if "" in sys.path else places)


def _assembled(entry: Entry, archive: Path) -> None:
    done = subprocess.run(
        # -P: with -m alone the current folder would be the first place to look
        [sys.executable, "-P", "-m", f"{__package__}.assemble", json.dumps(entry), str(archive)],
        env={**os.environ, "PYTHONPATH": _search_path(), "PYTHONDONTWRITEBYTECODE": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise BuildError(f"{entry.identifier} could not be built:\n{(done.stderr or done.stdout).strip()}")


def build(which: str | Entry, dist: Path) -> Path:
    """Build one FMU into the folder `dist`; a file of the same name is replaced whole or not at all."""
    entry = _entry(which)
    target = dist / f"{entry.identifier}.fmu"
    try:
        dist.mkdir(parents=True, exist_ok=True)
        handle, unfinished = tempfile.mkstemp(prefix=f".{entry.identifier}_", suffix=".tmp", dir=dist)
        os.close(handle)
        try:
            _assembled(entry, Path(unfinished))
            Path(unfinished).chmod(0o644)
            os.replace(unfinished, target)
        finally:
            with contextlib.suppress(FileNotFoundError):
                os.unlink(unfinished)
    except OSError as error:
        raise BuildError(f"{target} could not be written: {error.strerror or error}") from error
    return target


def is_stale(which: str | Entry, dist: Path) -> bool:
    """Whether the FMU in `dist` is missing, unreadable or not made from the sources as they are now."""
    entry = _entry(which)
    try:
        with zipfile.ZipFile(dist / f"{entry.identifier}.fmu") as fmu:
            guid = ElementTree.fromstring(fmu.read("modelDescription.xml")).get("guid")
    except (OSError, KeyError, zipfile.BadZipFile, ElementTree.ParseError):
        return True
    return guid != sources_of(entry).guid


def build_all(
    dist: Path, names: Sequence[str] | None = None, progress: Progress = _quiet, *, always: bool = False
) -> list[Path]:
    """Build the FMUs called `names` (all of the catalogue if None) where stale; the paths, in the order asked for."""
    entries = list(CATALOGUE) if names is None else [entry_called(name) for name in names]
    paths = []
    for entry in entries:
        if always or is_stale(entry, dist):
            progress(entry.identifier, "building")
            build(entry, dist)
            progress(entry.identifier, "built")
        else:
            progress(entry.identifier, "up to date")
        paths.append(dist / f"{entry.identifier}.fmu")
    return paths
