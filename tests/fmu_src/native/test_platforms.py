"""What a native FMU holds for each platform, and that it runs there and after a compiler of the user's own."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
import lief
import numpy as np
import pytest
from foreign import Answer, Host, library_of, runner_of
from replay import Replay

from attitude_fmu.cosim.master import simulate
from attitude_fmu.cosim.scenarios import gimbal
from attitude_fmu.cosim.system import check
from attitude_fmu.fmu_src.build import build
from attitude_fmu.fmu_src.catalogue import CATALOGUE, Entry, Kind
from attitude_fmu.fmu_src.catalogue import entry as entry_called
from attitude_fmu.fmu_src.native.compile import headers, host_platform

STEP = 1e-3
COMPONENTS = ("plant", "sensor", "controller")
OTHER_MACHINES = ("win64", "aarch64-linux")
TOLERANCE = 1e-9
"""Of a signal's largest value: what is promised between platforms, whose C libraries round differently."""

SENSOR = entry_called("AttitudeSensor")
Built = Callable[[Entry, Kind], Path]

only_linux = pytest.mark.skipif(host_platform().folder != "linux64", reason="compares with the Linux library")


def _names(fmu: Path) -> set[str]:
    with zipfile.ZipFile(fmu) as archive:
        return set(archive.namelist())


def _without_binaries(fmu: Path, target: Path) -> Path:
    with zipfile.ZipFile(fmu) as source, zipfile.ZipFile(target, "w") as copy:
        for name in source.namelist():
            if not name.startswith("binaries/"):
                copy.writestr(name, source.read(name))
    return target


def _library(fmu: Path, folder: str) -> bytes:
    with zipfile.ZipFile(fmu) as archive:
        (name,) = [name for name in archive.namelist() if re.match(rf"binaries/{folder}/.", name)]
        return archive.read(name)


def _parsed(library: bytes) -> Any:
    binary = lief.parse(list(library))
    assert binary is not None
    return binary


def _fmi_functions() -> set[str]:
    """The functions for co-simulation, by the standard's header."""
    text = (headers() / "fmi2Functions.h").read_text()
    common, _, rest = text.rpartition("Functions for FMI2 for Model Exchange")
    co_simulation = rest.partition("Functions for FMI2 for Co-Simulation")[2]
    found = set(re.findall(r"^\s*FMI2_Export\s+\w+\s+(fmi2\w+);", common + co_simulation, re.MULTILINE))
    assert {"fmi2Instantiate", "fmi2DoStep", "fmi2GetStringStatus"} <= found
    return found


# --- this machine --------------------------------------------------------------------------------------------------


def test_sources_lie_in_the_fmu_without_the_standards_headers(built: Built) -> None:
    fmu = built(SENSOR, "native")
    sources = {name.removeprefix("sources/") for name in _names(fmu) if name.startswith("sources/")}
    assert {"fmu.c", "model.c", "model.h", "fmi2.c", "buildDescription.xml"} <= sources
    assert not [name for name in sources if name.startswith("fmi2") and name.endswith(".h")]
    with zipfile.ZipFile(fmu) as archive:
        texts = [archive.read(f"sources/{name}").decode() for name in sources if name.endswith((".c", ".h"))]
    included = {name for text in texts for name in re.findall(r'#include "(.*)"', text)}
    assert included - {"fmi2Functions.h"} <= sources


def test_host_build_holds_the_library_of_this_platform_only(built: Built) -> None:
    binaries = {name for name in _names(built(SENSOR, "native")) if name.startswith("binaries/")}
    here = host_platform()
    assert binaries == {f"binaries/{here.folder}/AttitudeSensor{here.suffix}"}


def _fuses_multiply_and_add() -> bool:
    features = Path("/proc/cpuinfo")
    return features.is_file() and " fma " in features.read_text()


@pytest.mark.parametrize(("compiled_by", "flags"), [("fmpy", ""), ("fmpy", "-mfma"), ("fmutool", "")])
def test_sources_compiled_by_the_user_give_the_same_bits(
    built: Built, tmp_path: Path, compiled_by: str, flags: str
) -> None:
    if flags == "-mfma" and not _fuses_multiply_and_add():
        pytest.skip("this processor does not fuse multiplication and addition")
    if shutil.which(os.environ.get("CC", "cc")) is None:
        pytest.skip("no C compiler is installed")
    scripts = Path(sys.executable).parent
    ours = built(SENSOR, "native")
    theirs = _without_binaries(ours, tmp_path / "AttitudeSensor.fmu")
    if compiled_by == "fmpy":
        pytest.importorskip("cmake")
        command = [sys.executable, "-m", "fmpy", "compile", str(theirs)]
    else:
        pytest.importorskip("fmu_manipulation_toolbox")
        source, theirs = theirs, tmp_path / "compiled.fmu"
        command = [str(scripts / "fmutool"), "-input", str(source), "-output", str(theirs), "-compile-sources"]
    environment = {**os.environ, "PATH": f"{scripts}{os.pathsep}{os.environ['PATH']}", "CFLAGS": flags}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr
    folder = host_platform().folder
    assert _library(theirs, folder) != _library(ours, folder)
    results = [fmpy.simulate_fmu(str(fmu), stop_time=3.0, output_interval=STEP) for fmu in (ours, theirs)]
    assert len(results[0]) == 3001
    assert np.ptp(results[0]["rate_measured[1]"]) > 0.0, "no noise in the run"
    assert results[0].tobytes() == results[1].tobytes()


@pytest.mark.parametrize("entry", CATALOGUE, ids=lambda entry: entry.identifier)
@only_linux
def test_linux_library_loads_since_glibc_2_17_and_shows_only_fmi(built: Built, entry: Entry) -> None:
    binary = _parsed(_library(built(entry, "native"), "linux64"))
    wanted = {
        auxiliary.name for need in binary.symbols_version_requirement for auxiliary in need.get_auxiliary_symbols()
    }
    versions = [tuple(map(int, name.removeprefix("GLIBC_").split("."))) for name in wanted]
    assert versions
    assert max(versions) <= (2, 17)
    assert set(binary.libraries) <= {"libc.so.6", "libm.so.6"}
    assert {symbol.name for symbol in binary.exported_symbols} == _fmi_functions()


_LOADERS = {".data.rel.ro", ".relro_padding", ".dynamic", ".got", ".got.plt", ".init_array", ".fini_array"}
"""Sections that the loader fills in: tables of addresses, what is imported, what runs at loading."""


@pytest.mark.parametrize("entry", CATALOGUE, ids=lambda entry: entry.identifier)
@only_linux
def test_linux_library_has_nothing_that_instances_could_share_and_write(built: Built, entry: Entry) -> None:
    binary = _parsed(_library(built(entry, "native"), "linux64"))
    writable = {section.name for section in binary.sections if section.has(lief.ELF.Section.FLAGS.WRITE)}
    assert ".data.rel.ro" in writable
    assert writable <= _LOADERS


def test_same_bytes_wherever_it_is_built(built: Built, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("current", "temporary"):
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path / "current")
    monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
    assert build(SENSOR, tmp_path / "a folder with blanks").read_bytes() == built(SENSOR, "native").read_bytes()


# --- the runs that are compared ------------------------------------------------------------------------------------


class Parts(NamedTuple):
    """The coupled system's FMUs by component, and what each does in it."""

    fmus: dict[str, Path]
    replays: dict[str, Replay]


def _parts(dist: Path, seconds: float) -> Parts:
    system = gimbal(dist)
    interfaces = check(system)
    records = simulate(system, stop_time=seconds, step=STEP, order="jacobi").results
    replays = {one.name: Replay.of(system, one.name, interfaces, records) for one in system.components}
    return Parts({one.name: one.fmu for one in system.components}, replays)


@pytest.fixture(scope="session")
def parts(built: Built) -> Parts:
    """Three seconds of the FMUs of this machine; the sensor has aligned itself by then."""
    return _parts({built(entry, "native").parent for entry in CATALOGUE}.pop(), 3.0)


@pytest.fixture(scope="session")
def scratch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("platforms")


@pytest.fixture(scope="session")
def here(scratch: Path) -> Host:
    """The host on this machine."""
    return Host.compiled(runner_of("linux64", scratch), scratch)


def _run(host: Host, parts: Parts, component: str, commands: list[str], folder: Path) -> Answer:
    library = library_of(parts.fmus[component], host.runner.platform, folder)
    return host.run(library, parts.replays[component].interface.description.guid, commands)


def _life(replay: Replay) -> list[str]:
    """A run with its second half repeated from a saved state, a refused value, and all over again after a reset."""
    half, whole = 500, 1000
    spoiled = next(one.reference for one, _ in replay.inputs if one.type == "Real")
    return [
        *replay.start(),
        *replay.steps(0, half, STEP),
        "save",
        *replay.steps(half, whole, STEP),
        *replay.read(),
        "restore",
        *replay.steps(half, whole, STEP),
        *replay.read(),
        f"real {spoiled} 7ff8000000000000",
        *replay.read(),
        "reset",
        *replay.start(),
        *replay.steps(0, whole, STEP),
        *replay.read(),
        "terminate",
    ]


def _check_life(answer: Answer, replay: Replay) -> None:
    assert answer.others() == ["2.0 default", "real 3", "done"]
    assert len(answer.log) == 1, answer.log
    assert "= nan" in answer.log[0]
    assert "not a finite number" in answer.log[0]
    first, again, after_refusal, after_reset = answer.reals()
    assert first == again == after_refusal == after_reset
    names = [variable.name for variable in replay.wholes]
    refused = [row[names.index("refused_calls")] for row in answer.wholes("get-integer")]
    assert refused == [0, 0, 1, 0]


def _check_near(answer: Answer, reference: Answer) -> None:
    """The same whole numbers, quantised values among them, and reals that agree to `TOLERANCE`."""
    assert answer.others() == reference.others()
    assert answer.wholes("get-integer") == reference.wholes("get-integer")
    theirs, ours = np.array(answer.reals()), np.array(reference.reals())
    assert theirs.shape == ours.shape
    assert np.all(np.abs(theirs - ours) <= TOLERANCE * np.max(np.abs(ours), axis=0))


@only_linux
@pytest.mark.parametrize("component", COMPONENTS)
def test_c_host_gets_the_numbers_of_the_coupled_run(here: Host, parts: Parts, scratch: Path, component: str) -> None:
    replay = parts.replays[component]
    answer = _run(here, parts, component, list(replay.run(STEP, 10)), scratch)
    assert answer.others() == ["2.0 default", "done"]
    rows = slice(None, None, 10)
    assert np.array_equal(answer.reals(), replay.recorded(replay.reals, rows))
    assert np.array_equal(answer.wholes("get-integer"), replay.recorded(replay.wholes, rows))
    assert np.ptp(answer.reals(), axis=0).any()


@only_linux
@pytest.mark.parametrize("component", COMPONENTS)
def test_full_life_in_a_c_host(here: Host, parts: Parts, scratch: Path, component: str) -> None:
    replay = parts.replays[component]
    _check_life(_run(here, parts, component, _life(replay), scratch), replay)


# --- every platform ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def everywhere(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMUs for all platforms."""
    folder = tmp_path_factory.mktemp("everywhere")
    for entry in CATALOGUE:
        build(entry, folder, platforms="all")
    return folder


@pytest.fixture(scope="session")
def parts_everywhere(everywhere: Path) -> Parts:
    return _parts(everywhere, 20.0)


@pytest.fixture(scope="session", params=OTHER_MACHINES)
def machine(request: pytest.FixtureRequest, scratch: Path) -> Host:
    """The host on another platform."""
    return Host.compiled(runner_of(request.param, scratch), scratch)


def _check_apple(library: bytes, name: str) -> None:
    universal = lief.MachO.parse(list(library))
    assert universal is not None, name
    slices = list(universal)
    assert {part.header.cpu_type for part in slices} == {
        lief.MachO.Header.CPU_TYPE.X86_64,
        lief.MachO.Header.CPU_TYPE.ARM64,
    }
    for part in slices:
        assert part.header.file_type == lief.MachO.Header.FILE_TYPE.DYLIB
        exported = {symbol.name.removeprefix("_") for symbol in part.exported_symbols}
        assert exported - {"_mh_dylib_header", "__dso_handle"} == _fmi_functions()  # the linker's own two
        assert [library.name for library in list(part.libraries)[1:]] == ["/usr/lib/libSystem.B.dylib"]
    # Apple's processors refuse code without a signature
    arm = next(part for part in slices if part.header.cpu_type == lief.MachO.Header.CPU_TYPE.ARM64)
    assert arm.has_code_signature


@pytest.mark.slow
@pytest.mark.parametrize("entry", CATALOGUE, ids=lambda entry: entry.identifier)
def test_every_platform_has_its_library(everywhere: Path, entry: Entry) -> None:
    name = entry.identifier
    fmu = everywhere / f"{name}.fmu"
    assert {path for path in _names(fmu) if path.startswith("binaries/")} == {
        f"binaries/linux64/{name}.so",
        f"binaries/aarch64-linux/{name}.so",
        f"binaries/win64/{name}.dll",
        f"binaries/darwin64/{name}.dylib",
        f"binaries/aarch64-darwin/{name}.dylib",
    }
    assert fmu.stat().st_size < 5e6
    for folder, machine in (("linux64", lief.ELF.ARCH.X86_64), ("aarch64-linux", lief.ELF.ARCH.AARCH64)):
        binary = _parsed(_library(fmu, folder))
        assert binary.header.machine_type == machine
        assert {symbol.name for symbol in binary.exported_symbols} == _fmi_functions()
    windows = _parsed(_library(fmu, "win64"))
    assert windows.header.machine == lief.PE.Header.MACHINE_TYPES.AMD64
    assert {entry.name for entry in windows.get_export().entries} == _fmi_functions()
    foreign = {one.name.lower() for one in windows.imports}
    assert not [one for one in foreign if not one.startswith(("kernel32", "ntdll", "api-ms-win-crt-", "ucrtbase"))]
    _check_apple(_library(fmu, "darwin64"), name)
    assert _library(fmu, "darwin64") == _library(fmu, "aarch64-darwin")


@pytest.mark.slow
@pytest.mark.parametrize("entry", CATALOGUE, ids=lambda entry: entry.identifier)
def test_same_bytes_for_every_platform(everywhere: Path, entry: Entry, tmp_path: Path) -> None:
    again = build(entry, tmp_path / "somewhere else", platforms="all")
    assert again.read_bytes() == (everywhere / again.name).read_bytes()


@pytest.mark.slow
@only_linux
@pytest.mark.parametrize("component", COMPONENTS)
def test_full_life_on_another_machine(
    here: Host, machine: Host, parts_everywhere: Parts, scratch: Path, component: str
) -> None:
    replay = parts_everywhere.replays[component]
    answers = [_run(host, parts_everywhere, component, _life(replay), scratch) for host in (machine, here)]
    _check_life(answers[0], replay)
    _check_near(*answers)


@pytest.mark.slow
@only_linux
@pytest.mark.parametrize("component", COMPONENTS)
def test_long_run_with_noise_agrees_on_another_machine(
    here: Host, machine: Host, parts_everywhere: Parts, scratch: Path, component: str
) -> None:
    commands = list(parts_everywhere.replays[component].run(STEP, 10))
    answers = [_run(host, parts_everywhere, component, commands, scratch) for host in (machine, here)]
    assert len(answers[0].reals()) == 2001
    _check_near(*answers)
