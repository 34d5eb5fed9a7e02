"""The coupled FMUs in masters that are not ours; each test is skipped where the master is not installed."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
import numpy as np
import pytest
from other_master import rows_of

from attitude_fmu.cosim.master import simulate
from attitude_fmu.cosim.scenarios import gimbal
from attitude_fmu.cosim.ssp import open_ssp, write_ssp
from attitude_fmu.cosim.system import System, check, start_values
from attitude_fmu.fmu_src.build import build_all

STEPS = 2500
"""Of 1 ms: the sensor aligns itself, then the controller stabilises with it."""

STEP = 1e-3
BOUND = 1e-12
"""Of the largest value of the signal in our own Jacobi run."""

Records = np.ndarray[Any, np.dtype[Any]]


class Reference(NamedTuple):
    """The system, its file, what our own master makes of it in Jacobi order, and the outputs by name and FMI type."""

    system: System
    ssp: Path
    records: Records
    outputs: dict[str, str]

    def readable(self) -> list[tuple[str, str]]:
        """Outputs that are no enumerations: those libcosim and ecos cannot read."""
        return [(name, kind) for name, kind in self.outputs.items() if kind != "Enumeration"]


@pytest.fixture(scope="session")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dist")
    build_all(folder, kind="native")
    return folder


@pytest.fixture(scope="session")
def reference(dist: Path, tmp_path_factory: pytest.TempPathFactory) -> Reference:
    system = gimbal(dist)
    outputs = {
        f"{component}.{variable.name}": variable.type
        for component, interface in check(system).items()
        for variable in interface.variables.values()
        if variable.causality == "output"
    }
    ssp = write_ssp(system, tmp_path_factory.mktemp("ssp") / "gimbal.ssp")
    records = simulate(system, stop_time=STEPS * STEP, step=STEP, order="jacobi").results
    assert not records["sensor.aligned"][0]
    assert records["sensor.aligned"][-1]
    assert set(outputs) == set(records.dtype.names) - {"time"}
    return Reference(system, ssp, records, outputs)


def _agree(theirs: Mapping[str, Records], ours: Records, first: int = 0) -> None:
    for name, values in theirs.items():
        expected = ours[name][first:].astype(float)
        assert len(values) == len(ours)
        difference = np.max(np.abs(values[first:].astype(float) - expected))
        assert difference <= BOUND * np.max(np.abs(expected)), f"{name}: {difference:.3g}"


def _run(
    master: str,
    reference: Reference,
    read: Sequence[tuple[str, str]],
    settings: Mapping[int, Sequence[tuple[str, float]]] | None = None,
) -> dict[str, Records]:
    name = reference.system.parameter_sets[0].name
    rows = rows_of(master, reference.ssp, name, STEP, STEPS, read, settings)
    return {name: rows[:, column] for column, (name, _) in enumerate(read)}


def test_libcosim_agrees_with_our_master(reference: Reference) -> None:
    results = _run("libcosim", reference, reference.readable())
    _agree(results, reference.records, first=1)


def test_ecos_agrees_with_our_master(reference: Reference) -> None:
    results = _run("ecos", reference, reference.readable())
    _agree(results, reference.records)


def test_refused_value_shows_in_an_output_where_the_master_ignores_statuses(reference: Reference) -> None:
    settings = {10: [("controller.setpoint.yaw", float("nan"))]}
    results = _run("ecos", reference, reference.readable(), settings)
    refused = results.pop("controller.refused_calls")
    assert not refused[:10].any()
    assert (refused[10:] == 1).all()
    _agree(results, reference.records)


def _container(reference: Reference, folder: Path) -> Path:
    """One FMU that couples those of the system by the system's own connections and values."""
    system = reference.system
    names = {component.name: component.fmu.name for component in system.components}
    for component in system.components:
        shutil.copy(component.fmu, folder)
    description = {
        "name": "container.fmu",
        "step_size": STEP,
        **{f"auto_{what}": False for what in ("link", "input", "output", "parameter")},
        "fmu": list(names.values()),
        "link": [
            [names[source.component], source.variable, names[target.component], target.variable]
            for source, target in system.connections
        ],
        "output": [[names[name.split(".")[0]], name.split(".", 1)[1], name] for name in reference.outputs],
        "start": [
            [names[port.component], port.variable, str(value)]
            for port, value in start_values(system, check(system)).items()
        ],
    }
    (folder / "container.json").write_text(json.dumps(description))
    program = Path(sys.executable).with_name("fmucontainer")
    done = subprocess.run(
        [str(program), "-fmu-directory", str(folder), "-container", "container.json"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "container.fmu"


def test_container_fmu_agrees_with_our_master(reference: Reference, tmp_path: Path) -> None:
    pytest.importorskip("fmu_manipulation_toolbox")
    container = _container(reference, tmp_path)
    results = fmpy.simulate_fmu(
        str(container), stop_time=STEPS * STEP, step_size=STEP, output_interval=STEP, output=list(reference.outputs)
    )
    _agree({name: results[name] for name in reference.outputs}, reference.records)


def test_master_that_starts_wires_at_zero_is_told_what_is_wrong(reference: Reference) -> None:
    # FMPy's own runner of .ssp files does so, whatever the file says
    code = f"from fmpy.ssp.simulation import simulate_ssp; simulate_ssp({str(reference.ssp)!r}, step_size={STEP})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "fmi2SetReal failed with status 3" in done.stderr
    assert "sensor.temperature = 0 K: too small, kelvin wanted" in done.stdout


@pytest.mark.parametrize("identifier", ["TripodGimbal", "AttitudeSensor", "GimbalController"])
def test_python_twin_in_place_of_a_native_fmu_gives_the_same_bits(
    reference: Reference, dist: Path, tmp_path: Path, identifier: str
) -> None:
    (twin,) = build_all(dist, [identifier], kind="python")
    mixed = tmp_path / "mixed.ssp"
    with zipfile.ZipFile(reference.ssp) as source, zipfile.ZipFile(mixed, "w") as copy:
        for name in source.namelist():
            is_replaced = name == f"resources/{identifier}.fmu"
            copy.writestr(name, twin.read_bytes() if is_replaced else source.read(name))
    with open_ssp(mixed) as system:
        assert twin.read_bytes() in [component.fmu.read_bytes() for component in system.components]
        records = simulate(system, stop_time=1.0, step=STEP, order="jacobi").results
    assert len(records) == 1001
    assert records.dtype == reference.records.dtype
    assert records.tobytes() == reference.records[: len(records)].tobytes()
