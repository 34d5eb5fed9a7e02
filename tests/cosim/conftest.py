"""FMUs that the tests of this room couple: small pythonfmu slaves, built once."""

from __future__ import annotations

from pathlib import Path

import pytest
from slave_building import build

from attitude_fmu.cosim.system import Component, System, connect
from attitude_fmu.fmu_src.build import build_all


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """The test FMUs by the name of their file."""
    folder = tmp_path_factory.mktemp("fmus")
    sources = sorted((Path(__file__).parent / "slaves").glob("*.py"))
    return {source.stem: build(source, folder / f"{source.stem}.fmu") for source in sources}


@pytest.fixture
def decay(fmus: dict[str, Path]) -> System:
    """dx/dt = -x: an integrator and a gain in a loop."""
    return System(
        "decay",
        (Component("integrator", fmus["integrator"]), Component("gain", fmus["gain"])),
        (*connect("integrator", "gain", ("x", "u")), *connect("gain", "integrator", ("y", "u"))),
        stop_time=1.0,
    ).with_values("start", {"integrator.x0": 1.0})


@pytest.fixture(scope="session")
def sensor_dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the native FMU of the attitude sensor."""
    folder = tmp_path_factory.mktemp("sensor")
    build_all(folder, ["AttitudeSensor"])
    return folder


@pytest.fixture(scope="session")
def bench_dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the two FMUs of the bench."""
    folder = tmp_path_factory.mktemp("bench")
    build_all(folder, ["Turntable", "AttitudeSensor"])
    return folder
