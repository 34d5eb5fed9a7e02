"""What FMUs do to the process that they live in; each case in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from attitude_fmu.fmu_src.build import build
from attitude_fmu.fmu_src.catalogue import Entry, Kind, entry
from attitude_fmu.fmu_src.native.compile import host_platform

HERE = Path(__file__).parent

_HEAD = """
import gc, resource, shutil, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from fmu_instance import Instance
archives = [Path(name) for name in sys.argv[2:] if name.endswith(".fmu")]
def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()
"""


def _run(code: str, *arguments: object, blocked: tuple[str, ...] = ()) -> str:
    guard = f"""
import sys
class Guard:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {blocked!r}:
            raise ModuleNotFoundError("blocked: " + name)
sys.meta_path.insert(0, Guard())
"""
    done = subprocess.run(
        [sys.executable, "-c", (guard if blocked else "") + code, str(HERE), *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONFAULTHANDLER": "1"},
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return done.stdout


@pytest.fixture
def other_version(tmp_path: Path, kind: Kind, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The test FMU with another filter and the same names."""
    source = (HERE / "every_kind.py").read_text()
    (tmp_path / "changed").mkdir()
    (tmp_path / "changed" / "every_kind.py").write_text(
        source.replace("0.9", "0.5").replace("0.1, _driven", "0.5, _driven")
    )
    monkeypatch.syspath_prepend(str(tmp_path / "changed"))
    return build(Entry("EveryKind", "every_kind"), tmp_path, kind)


def test_two_versions_live_in_one_process(fmu: Path, other_version: Path) -> None:
    out = _run(
        _HEAD
        + """
results = []
for order in (archives, archives[::-1]):
    units = {archive: Instance(archive) for archive in order}
    for unit in units.values():
        unit.initialise(**{"rate[1]": 1.0, "noise.density": 0.0, "rate[2]": 1.0}).step(1)
        unit["rate[1]"] = 0.0
        unit.step(1, start=1e-3)
    results.append([round(units[archive]["shown.rate[1]"], 9) for archive in archives])
    for unit in units.values():
        unit.close()
print(results)
""",
        fmu,
        other_version,
    )
    assert out.strip() == "[[0.9, 0.5], [0.9, 0.5]]"


def test_it_goes_on_when_the_folder_of_the_first_is_gone(fmu: Path) -> None:
    out = _run(
        _HEAD
        + """
first, second = Instance(archives[0]), Instance(archives[0])
first.initialise().step(3)
first.close()
second.initialise().step(4)
third = Instance(archives[0])
third.initialise().step(5)
print(second["shown.count"], third["shown.count"])
""",
        fmu,
    )
    assert out.split() == ["4", "5"]


def test_it_leaves_the_path_as_it_was(python_fmu: Path) -> None:
    out = _run(_HEAD + "before = list(sys.path); unit = Instance(archives[0]); print(before == sys.path)", python_fmu)
    assert out.strip() == "True"


_BARE_HOST = """
import ctypes, sys, zipfile, tempfile, pathlib
from ctypes import CFUNCTYPE, POINTER, Structure, byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
folder = pathlib.Path(tempfile.mkdtemp())
zipfile.ZipFile(sys.argv[2]).extractall(folder)
text = (folder / "modelDescription.xml").read_text()
guid = text.split('guid="')[1].split('"')[0].encode()
fmi = ctypes.CDLL(str(folder / "binaries" / sys.argv[3]))
class Callbacks(Structure):
    _fields_ = [(name, c_void_p) for name in ("logger", "allocate", "free", "finished", "environment")]
callbacks = Callbacks()
fmi.fmi2Instantiate.restype = c_void_p
fmi.fmi2Instantiate.argtypes = [c_char_p, c_int, c_char_p, c_char_p, POINTER(Callbacks), c_int, c_int]
unit = fmi.fmi2Instantiate(b"unit", 1, guid, (folder / "resources").as_uri().encode(), byref(callbacks), 0, 0)
assert unit
fmi.fmi2SetupExperiment.argtypes = [c_void_p, c_int, c_double, c_double, c_int, c_double]
assert fmi.fmi2SetupExperiment(unit, 0, 0.0, 0.0, 0, 0.0) == 0
for name in ("fmi2EnterInitializationMode", "fmi2ExitInitializationMode"):
    getattr(fmi, name).argtypes = [c_void_p]
    assert getattr(fmi, name)(unit) == 0
fmi.fmi2DoStep.argtypes = [c_void_p, c_double, c_double, c_int]
for i in range(10):
    assert fmi.fmi2DoStep(unit, i * 1e-3, 1e-3, 0) == 0
fmi.fmi2FreeInstance.argtypes = [c_void_p]
fmi.fmi2FreeInstance(unit)
print("numpy" in sys.modules, "lxml" in sys.modules, "attitude_fmu" in sys.modules)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="loads the Linux binary by hand")
def test_it_needs_nothing_but_the_host_itself(fmu: Path) -> None:
    blocked = ("numpy", "lxml", "attitude_fmu", "matplotlib", "fmpy", "scipy", "typing_extensions", "casadi")
    assert _run(_BARE_HOST, fmu, f"{host_platform().folder}/EveryKind.so", blocked=blocked).split() == [
        "False",
        "False",
        "False",
    ]


def test_errors_and_resets_leave_no_python_object_behind(python_fmu: Path) -> None:
    out = _run(
        _HEAD
        + """
unit = Instance(archives[0])
module = next(m for name, m in sys.modules.items() if name.endswith("_slave") and name.startswith("every_kind"))
kind = module.EveryKind
def living():
    gc.collect()
    return sum(isinstance(thing, kind) for thing in gc.get_objects())
unit.initialise()
before = sys.getrefcount(kind), sys.getrefcount(vars(module)), living()
for i in range(200):
    for call in (lambda: unit.__setitem__("temperature", 25.0), lambda: unit.fmu.doStep(7.0, 1e-3)):
        try:
            call()
        except Exception:
            pass
        else:
            raise SystemExit("no error")
    unit.fmu.reset()
    unit.initialise()
after = living(), sys.getrefcount(kind), sys.getrefcount(vars(module))
print(before, after)
unit.fmu.freeInstance()
for i in range(50):
    unit.open()
    unit.initialise().step(2)
    unit.fmu.freeInstance()
print(living(), sys.getrefcount(kind), sys.getrefcount(vars(module)))
""",
        python_fmu,
    )
    first, last = out.strip().splitlines()
    assert first == "(7, 3, 1) (1, 7, 3)"
    assert last == "0 5 3"


_MEMORY = (
    _HEAD
    + """
unit = Instance(archives[0])
unit.initialise()
inputs = [v.valueReference for v in unit.variables.values() if v.causality == "input" and v.type == "Real"]
outputs = [v.valueReference for v in unit.variables.values() if v.causality == "output" and v.type == "Real"]
starts = {"temperature": 300.0, "specific_force[3]": 9.80665}
values = [starts.get(v.name, 1e-3) for v in unit.variables.values() if v.valueReference in inputs]
def run(begin, end):
    for i in range(begin, end):
        unit.fmu.setReal(inputs, values)
        unit.fmu.doStep(i * 1e-3, 1e-3)
        unit.fmu.getReal(outputs)
        if i % 100 == 0:
            state = unit.fmu.getFMUstate()
            unit.fmu.setFMUstate(state)
            unit.fmu.freeFMUstate(state)
STEPS = int(sys.argv[3])
run(0, STEPS // 10)
before = resident()
run(STEPS // 10, STEPS)
print(resident() - before)
"""
)


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_memory_does_not_grow(fmu: Path) -> None:
    assert int(_run(_MEMORY, fmu, 20_000)) < 500_000


_LIVES = (
    _HEAD
    + """
from fmpy.fmi2 import fmi2CallbackFunctions
unit = Instance(archives[0])
unit.fmu.fmi2FreeInstance(unit.fmu.component)
def live(times):
    for _ in range(times):
        unit.fmu.instantiate(callbacks=fmi2CallbackFunctions())
        unit.initialise().step(2)
        for call in (lambda: unit.fmu.getReal([4711]), lambda: unit.__setitem__("temperature", 25.0)):
            try:
                call()
            except Exception:
                pass
        unit.restore(unit.serialised())
        unit.fmu.reset()
        unit.fmu.fmi2FreeInstance(unit.fmu.component)
live(300)
before = resident()
live(3000)
print(resident() - before)
"""
)


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_instances_that_come_and_go_leave_no_memory_behind(native_fmu: Path) -> None:
    assert int(_run(_LIVES, native_fmu)) < 200_000  # one instance has 2 kB


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_memory_of_the_attitude_sensor_does_not_grow_in_a_million_steps(
    built: Callable[[Entry, Kind], Path], kind: Kind
) -> None:
    assert int(_run(_MEMORY, built(entry("AttitudeSensor"), kind), 1_000_000)) < 500_000
