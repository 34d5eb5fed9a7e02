"""Builds the FMUs of a release, of both kinds and for every platform.

``.venv/bin/python build_fmu.py [NAME ...]``
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from attitude_fmu.fmu_src.build import Platforms
from attitude_fmu.fmu_src.build_messages import Kinds, build_and_tell, tell_other_sources
from attitude_fmu.fmu_src.catalogue import CATALOGUE
from attitude_fmu.models.errors import AttitudeFmuError

_CHECKOUT = Path(__file__).resolve().parent
_NAMES = ", ".join(entry.identifier for entry in CATALOGUE)


def main(
    names: Annotated[list[str] | None, typer.Argument(help=f"Which FMUs: {_NAMES}. All if none is named.")] = None,
    kind: Annotated[Kinds, typer.Option(help="Compiled from C, or run by Python, or both.")] = "all",
    platform: Annotated[
        Platforms, typer.Option(help="What native FMUs are compiled for: this machine, or all.")
    ] = "all",
    dist: Annotated[
        Path, typer.Option(help="Folder to put them in; the Python kind goes to its folder python.")
    ] = Path("dist"),
) -> None:
    """Build the FMUs from the models, whether there are some already or not.

    From cold a full build takes a minute or two: the compiler makes the C library of every platform once.
    """
    tell_other_sources(_CHECKOUT / "fmu_src", Console(stderr=True))
    try:
        build_and_tell(dist, names or None, Console(), kinds=kind, platforms=platform, always=True)
    except AttitudeFmuError as error:
        Console(stderr=True).print(str(error), style="red", markup=False, highlight=False, soft_wrap=True)
        sys.exit(1)


if __name__ == "__main__":
    typer.run(main)
