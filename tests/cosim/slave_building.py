"""Building the small FMUs of these tests."""

from __future__ import annotations

import sys
import zipfile
from pathlib import Path

from pythonfmu import FmuBuilder


def build(source: Path, target: Path) -> Path:
    """Build an FMU and forget the module that pythonfmu imported for it, so that the FMU runs its own code."""
    paths = list(sys.path)
    try:
        FmuBuilder.build_FMU(source, target)
    finally:
        sys.path[:] = paths
        sys.modules.pop(source.stem, None)
    return target


def with_units(fmu: Path, target: Path, definitions: str, unit: str) -> Path:
    """The FMU with units on its variables, in `target`."""
    with zipfile.ZipFile(fmu) as old, zipfile.ZipFile(target, "w") as new:
        for name in old.namelist():
            data = old.read(name)
            if name == "modelDescription.xml":
                text = data.decode().replace("<Real", f'<Real unit="{unit}"')
                data = text.replace(
                    "<LogCategories>", f"<UnitDefinitions>{definitions}</UnitDefinitions><LogCategories>"
                )
                data = data.encode()
            new.writestr(name, data)
    return target


METRE = '<Unit name="m"><BaseUnit m="1"/></Unit>'
