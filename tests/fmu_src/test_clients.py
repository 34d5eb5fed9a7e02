"""Other masters; each test is skipped where the master is not installed."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

_LIBCOSIM = """
import sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave

execution = CosimExecution.from_step_size(step_size=1_000_000)
index = execution.add_local_slave(CosimLocalSlave(fmu_path=sys.argv[1], instance_name="unit"))
observer, override = CosimObserver.create_last_value(), CosimManipulator.create_override()
execution.add_observer(observer)
execution.add_manipulator(override)
references = {v.name.decode(): v.reference for v in execution.slave_variables(index)}
assert execution.step(10)
count = observer.last_integer_values(index, [references["shown.count"]])[0]
override.slave_real_values(index, [references["temperature"]], [25.0])
print("seen:", count, execution.step(1))
"""


def test_libcosim_runs_it_and_survives_a_bad_value(fmu: Path) -> None:
    pytest.importorskip("libcosimpy")
    done = subprocess.run([sys.executable, "-c", _LIBCOSIM, str(fmu)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    seen = [line for line in done.stdout.splitlines() if line.startswith("seen:")]  # among libcosim's own log
    assert seen == ["seen: 10 False"]
    assert "unit.temperature = 25 K" in done.stdout + done.stderr


def test_fmpy_runs_it_in_one_call(fmu: Path) -> None:
    fmpy = pytest.importorskip("fmpy")
    results = fmpy.simulate_fmu(
        str(fmu), stop_time=0.1, step_size=1e-3, output_interval=0.01, start_values={"rate[1]": 2.0, "shape": 2}
    )
    assert results["shown.count"][-1] == 100
