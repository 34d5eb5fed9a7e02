"""Building the small FMUs of these tests."""

from __future__ import annotations

import sys
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
