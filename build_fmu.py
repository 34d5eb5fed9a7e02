"""Builds the FMUs: ``python build_fmu.py [--dist DIST] [NAME ...]``."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from attitude_fmu.fmu_src.build import build_all
from attitude_fmu.fmu_src.catalogue import CATALOGUE
from attitude_fmu.models.errors import AttitudeFmuError

_NAMES = ", ".join(entry.identifier for entry in CATALOGUE)


def main(
    names: Annotated[list[str] | None, typer.Argument(help=f"Which FMUs: {_NAMES}. All if none is named.")] = None,
    dist: Annotated[Path, typer.Option(help="Folder to put them in.")] = Path("dist"),
) -> None:
    """Build the FMUs from the models in Python, through pythonfmu."""
    console = Console()
    try:
        paths = build_all(dist, names, lambda name, event: console.print(f"{name}: {event}"), always=True)
    except AttitudeFmuError as error:
        Console(stderr=True).print(str(error), style="red", markup=False, highlight=False, soft_wrap=True)
        sys.exit(1)
    for path in paths:
        console.print(f"{path}  {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    typer.run(main)
