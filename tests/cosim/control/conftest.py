"""FMUs that python-control gets to know: ours, and some that are not."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from pendulum_building import build_pendulum
from pythonfmu import FmuBuilder

from attitude_fmu.fmu_src.build import build_all

_SLAVES = Path(__file__).parents[1] / "slaves"


@pytest.fixture(scope="session")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with our native FMUs."""
    folder = tmp_path_factory.mktemp("dist")
    build_all(folder)
    return folder


@pytest.fixture(scope="session")
def python_dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with our FMUs of the Python kind."""
    folder = tmp_path_factory.mktemp("python_dist")
    build_all(folder, kind="python")
    return folder / "python"


@pytest.fixture(scope="session")
def pendulum(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Somebody else's FMU in C."""
    return build_pendulum(tmp_path_factory.mktemp("pendulum"))


@pytest.fixture(scope="session")
def slave(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Builds a plain pythonfmu slave by the name of its file, with saved states unless told otherwise."""
    folder = tmp_path_factory.mktemp("slaves")

    def built(name: str, saves: bool = True, source: Path = _SLAVES) -> Path:
        options = {"canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true"} if saves else {}
        target = folder / f"{name}_{saves}.fmu"
        if not target.exists():
            paths = list(sys.path)
            try:
                FmuBuilder.build_FMU(source / f"{name}.py", target, needsExecutionTool="false", **options)
            finally:
                sys.path[:] = paths
                sys.modules.pop(name, None)
        return target

    return built
