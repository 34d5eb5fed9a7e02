"""Building FMUs with words: what is being built, and how large it came out, for which platforms."""

from __future__ import annotations

import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Literal

from rich.console import Console

from .build import Platforms, build_all, folder_of
from .catalogue import KINDS, Kind
from .errors import BuildError
from .native.compile import compiler, host_platform

Kinds = Literal["native", "python", "all"]
"""One kind of FMU, or both."""


def build_and_tell(
    dist: Path,
    names: Sequence[str] | None,
    console: Console,
    *,
    kinds: Kinds = "native",
    platforms: Platforms = "host",
    always: bool = False,
    only_built: bool = False,
    option: str = "--kind",
) -> None:
    """Build the FMUs called `names` (all if None) into `dist` where stale, or always, and tell of each.

    With `only_built` those that are up to date are passed over in silence. `option` is what the user would write to
    choose the kind, for the message of the `BuildError` where native FMUs cannot be built.
    """
    for kind in KINDS if kinds == "all" else (kinds,):
        if kind == "native":
            _check_compiler(platforms, option)
        _build_kind(dist, names, console, kind, platforms, always, only_built)


def tell_other_sources(expected: Path, console: Console) -> None:
    """Warn if what builds is not the folder `expected`, but an installed copy, which edits there do not reach."""
    actual = Path(__file__).resolve().parent
    if actual != expected.resolve():
        _print(console, f"warning: building from {actual.parent}, not from {expected.parent}: pip install -e . there")


def _check_compiler(platforms: Platforms, option: str) -> None:
    try:
        compiler()
        if platforms == "host":
            host_platform()
    except BuildError as error:
        raise BuildError(f"{error} ({option} python)") from None


def _build_kind(
    dist: Path,
    names: Sequence[str] | None,
    console: Console,
    kind: Kind,
    platforms: Platforms,
    always: bool,
    only_built: bool,
) -> None:
    with console.status("") as spinner:

        def tell(name: str, event: str) -> None:
            path = folder_of(dist, kind) / f"{name}.fmu"
            if event == "building" and console.is_terminal:
                spinner.update(f"building {path}")
            elif event == "building":
                _print(console, f"building {path}")
            elif event == "built" or not only_built:
                _print(console, f"{event} {path}, {_described(path, kind)}")

        build_all(dist, names, tell, kind=kind, platforms=platforms, always=always)


def _described(path: Path, kind: Kind) -> str:
    size = f"{path.stat().st_size / 1000:.0f} kB"
    if kind == "python":
        return f"{size}, for Python"
    with zipfile.ZipFile(path) as fmu:
        folders = dict.fromkeys(name.split("/")[1] for name in fmu.namelist() if name.startswith("binaries/"))
    return f"{size}, for {', '.join(folders)}"


def _print(console: Console, line: str) -> None:
    console.print(line, style="dim", highlight=False, markup=False, soft_wrap=True)
