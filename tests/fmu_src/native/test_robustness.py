"""What hosts do to native FMUs that no host should do, and what some do that others do not."""

from __future__ import annotations

import math
import os
import re
import shutil
import struct
import subprocess
import sys
import zipfile
import zlib
from collections.abc import Callable, Sequence
from ctypes import byref, c_char_p
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from fmi2_calls import ERROR, OK, Library, Unit, array
from fmpy import read_model_description, simulate_fmu
from sanitized_twin import HEAD_WORDS

from attitude_fmu.fmu_src.catalogue import CATALOGUE, Entry
from attitude_fmu.fmu_src.native.compile import compiler, headers, host_platform

EXTREMES = (math.nan, math.inf, -math.inf, 5e-324, -5e-324, 1e-320, -0.0, 1e308, -1e308, sys.float_info.max)
UNITS, THREADS = 64, 8
CYCLES, WARM_UP, GROWTH = 10_000, 1_000, 1 << 20

Built = Callable[[Entry, str], Path]

_KIND = {"Enumeration": "Integer"}
_NAMED_VALUE = re.compile(r"^unit\.[\w.\[\],]+( clock's period)? = ")


class Fmu(NamedTuple):
    """An unpacked FMU."""

    library: Library
    guid: bytes
    variables: Sequence[Any]

    def unit(self, name: str = "unit", **arguments: Any) -> Unit:
        return Unit(self.library, name.encode(), self.guid, **arguments)

    def of(self, kind: str, *causalities: str) -> list[Any]:
        return [v for v in self.variables if _KIND.get(v.type, v.type) == kind and v.causality in causalities]


def _library(folder: Path, identifier: str) -> Path:
    platform = host_platform()
    return folder / "binaries" / platform.folder / f"{identifier}{platform.suffix}"


def _unpacked(archive: Path, folder: Path) -> Fmu:
    with zipfile.ZipFile(archive) as content:
        content.extractall(folder)
    description = read_model_description(folder)
    return Fmu(Library(_library(folder, archive.stem)), description.guid.encode(), description.modelVariables)


@pytest.fixture(scope="module", params=CATALOGUE, ids=lambda entry: entry.identifier)
def entry(request: pytest.FixtureRequest) -> Entry:
    chosen: Entry = request.param
    return chosen


@pytest.fixture(scope="module")
def fmu(entry: Entry, built: Built, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    return _unpacked(built(entry, "native"), tmp_path_factory.mktemp(entry.identifier))


def _outputs(fmu: Fmu, unit: Unit) -> tuple[int, list[float]]:
    return unit.get("Real", [variable.valueReference for variable in fmu.of("Real", "output", "local")])


def _life(fmu: Fmu, unit: Unit) -> tuple[int, list[float]]:
    """Initialise, step and read; the first status that is not OK."""
    statuses = [*unit.initialise(), *(unit.step(i * 1e-3, 1e-3) for i in range(3))]
    status, values = _outputs(fmu, unit)
    return max(*statuses, status), values


def _check_answer(unit: Unit, status: int, values: Sequence[float]) -> None:
    """All is finite, or the log names the instance, the variable and its value."""
    if status == OK:
        assert all(map(math.isfinite, values))
    else:
        assert status == ERROR
        assert _NAMED_VALUE.match(unit.log[0][2]), unit.log[0]
    unit.log.clear()


# --- values -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", EXTREMES, ids=str)
def test_an_extreme_value_is_refused_by_name_or_digested_and_a_reset_heals(fmu: Fmu, value: float) -> None:
    unit = fmu.unit()
    usual = _life(fmu, unit)
    assert usual[0] == OK
    for variable in fmu.of("Real", "parameter", "input"):
        assert unit.call("Reset") == OK
        status = unit.set("Real", [variable.valueReference], [value])
        if status == ERROR:
            assert unit.log[0][2].startswith(f"unit.{variable.name} = "), unit.log
            unit.log.clear()
        else:
            _check_answer(unit, *_life(fmu, unit))
    assert unit.call("Reset") == OK
    assert _life(fmu, unit) == usual
    unit.free()


@pytest.mark.parametrize("value", EXTREMES, ids=str)
def test_an_extreme_input_between_steps_stops_or_harms_nothing(fmu: Fmu, value: float) -> None:
    unit = fmu.unit()
    for variable in fmu.of("Real", "input"):
        assert unit.call("Reset") == OK
        assert unit.initialise() == [OK, OK, OK]
        before = _outputs(fmu, unit)
        if unit.set("Real", [variable.valueReference], [value]) == ERROR:
            assert unit.log.pop()[2].startswith(f"unit.{variable.name} = ")
            assert _outputs(fmu, unit) == before
            assert unit.step(0.0, 1e-3) == OK
        else:
            status = max(unit.step(0.0, 1e-3), unit.step(1e-3, 1e-3))
            _check_answer(unit, *(_outputs(fmu, unit) if status == OK else (status, [])))
    unit.free()


@pytest.mark.parametrize("causality", ["parameter", "input"])
@pytest.mark.parametrize("end", ["min", "max"])
def test_everything_at_the_end_of_its_range_at_once_is_digested_or_refused_by_name(
    fmu: Fmu, causality: str, end: str
) -> None:
    unit = fmu.unit()
    unlimited = -sys.float_info.max if end == "min" else sys.float_info.max
    for variable in fmu.of("Real", causality):
        limit = getattr(variable, end)
        assert unit.set("Real", [variable.valueReference], [unlimited if limit is None else float(limit)]) == OK
    _check_answer(unit, *_life(fmu, unit))
    unit.free()


# --- many instances ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def threads_host(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """threads.c, compiled."""
    if sys.platform != "linux":
        pytest.skip("the host is for Linux")
    program = tmp_path_factory.mktemp("threads") / "threads"
    source = Path(__file__).with_name("threads.c")
    options = ["-std=gnu11", "-O2", "-I", str(headers()), str(source), "-ldl", "-lm", "-lpthread"]
    subprocess.run([*compiler(), "-target", host_platform().targets[0], *options, "-o", str(program)], check=True)
    return program


def test_instances_in_many_threads_do_what_they_do_one_after_the_other(fmu: Fmu, threads_host: Path) -> None:
    seeds = [str(v.valueReference) for v in fmu.of("Integer", "parameter") if v.name.split(".")[-1] == "seed"]
    inputs = [f"{v.valueReference}:{v.start}" for v in fmu.of("Real", "input")]
    command = [threads_host, fmu.library.loaded._name, fmu.guid.decode(), str(UNITS), str(THREADS), ",".join(seeds)]
    done = subprocess.run([*command, *inputs], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["0", str(UNITS)]


_CYCLES = """
import gc, os, sys
sys.path[:0] = sys.argv[1:3]
from fmi2_calls import OK, Library, Unit
library, guid = Library(sys.argv[3]), sys.argv[4].encode()

def resident():
    gc.collect()
    with open("/proc/self/statm") as numbers:
        return int(numbers.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

def cycle():
    unit = Unit(library, b"unit", guid, has_logger=False)
    assert unit.initialise() == [OK, OK, OK]
    state = unit.save()
    for i in range(3):
        assert unit.step(i * 1e-3, 1e-3) == OK
    status, other = unit.deserialised(unit.serialised(state))
    assert status == unit.call("SetFMUstate", other) == OK
    for place in (state, other):
        unit.drop(place)
    unit.free()

for number in range(int(sys.argv[5]) + int(sys.argv[6])):
    if number == int(sys.argv[5]):
        before = resident()
    cycle()
print(resident() - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_ten_thousand_instances_leave_less_than_a_mebibyte_behind(entry: Entry, fmu: Fmu) -> None:
    folders = [Path(__file__).parent, Path(__file__).parents[1]]
    arguments = [*folders, fmu.library.loaded._name, fmu.guid.decode(), WARM_UP, CYCLES]
    done = subprocess.run(
        [sys.executable, "-c", _CYCLES, *map(str, arguments)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) < GROWTH


def test_the_state_of_another_fmu_is_refused(entry: Entry, fmu: Fmu, built: Built, tmp_path: Path) -> None:
    other_entry = CATALOGUE[CATALOGUE.index(entry) - 1]
    unit, other = fmu.unit(), _unpacked(built(other_entry, "native"), tmp_path).unit()
    assert unit.initialise() == other.initialise() == [OK, OK, OK]
    before, foreign = _outputs(fmu, unit), other.save()
    assert unit.deserialised(other.serialised(foreign))[0] == ERROR
    assert "saved state refused" in unit.log[0][2]
    assert _outputs(fmu, unit) == before
    other.drop(foreign)
    unit.free()
    other.free()


# words of a serialised state, counted from its end; the last is the checksum
_STALE, _IS_SLOPED = -2, -3
_OUTPUTS_STALE, _STATE_STALE = 1, 4


def _doctored(content: bytes, word: int, value: int) -> bytes:
    words = list(struct.unpack(f"<{len(content) // 8}q", content))
    words[word] = value
    body = struct.pack(f"<{len(words) - 1}q", *words[:-1])
    return body + struct.pack("<Q", zlib.crc32(body))


def _refused_word(fmu: Fmu) -> int:
    """Where the count of refused calls lies."""
    (reference,) = (v.valueReference for v in fmu.variables if v.name == "refused_calls")
    return 8 * (HEAD_WORDS + reference)


@pytest.mark.parametrize(
    ("word", "value", "status"),
    [
        (_STALE, _OUTPUTS_STALE, OK),
        (_STALE, 8, ERROR),
        (_STALE, -1, ERROR),
        (_STALE, _OUTPUTS_STALE | _STATE_STALE, ERROR),  # while it is stepping
        (_IS_SLOPED, 1, OK),
        (_IS_SLOPED, 2, ERROR),
        (_IS_SLOPED, -1, ERROR),
    ],
)
def test_a_doctored_state_is_refused_and_changes_nothing(fmu: Fmu, word: int, value: int, status: int) -> None:
    unit = fmu.unit()
    assert unit.initialise() == [OK, OK, OK]
    assert unit.step(0.0, 1e-3) == OK
    state = unit.save()
    before = unit.serialised(state)
    taken, doctored = unit.deserialised(_doctored(before, word, value))
    assert taken == OK
    assert unit.call("SetFMUstate", doctored) == status
    if status == ERROR:
        assert unit.log[-1][2] == "unit: saved state refused: it is damaged"
        moment = slice(0, _refused_word(fmu)), slice(_refused_word(fmu) + 8, -8)
        after = unit.serialised(unit.save(state))
        assert [after[part] for part in moment] == [before[part] for part in moment]
    assert unit.step(1e-3, 1e-3) == OK
    for place in (state, doctored):
        unit.drop(place)
    unit.free()


def test_bytes_of_another_version_are_refused_and_leave_a_reused_state_alone(fmu: Fmu) -> None:
    unit = fmu.unit()
    assert unit.initialise() == [OK, OK, OK]
    state = unit.save()
    before = unit.serialised(state)
    for fingerprint in (1, 2):
        foreign = _doctored(before, fingerprint, 4711)
        assert unit.call("DeSerializeFMUstate", foreign, len(foreign), byref(state)) == ERROR
        assert unit.log[-1][2] == "unit: saved state refused: another FMU or version saved it"
        assert unit.serialised(state) == before
    assert unit.call("SetFMUstate", state) == OK
    unit.drop(state)
    unit.free()


# --- places -----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def odd_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("odd") / "Größe 100 % [neu] #1" / "ein Gerät"
    folder.mkdir(parents=True)
    return folder


def test_it_runs_from_a_folder_with_any_characters_whatever_it_is_told_of_it(
    entry: Entry, built: Built, odd_folder: Path
) -> None:
    folder = odd_folder / entry.identifier
    fmu = _unpacked(built(entry, "native"), folder)
    resources = folder / "resources"
    locations = (resources.as_uri().encode(), f"file:/{resources}".encode(), b"nowhere://%zz%", b"%s%n", b"", None)
    results = []
    for location in locations:
        unit = fmu.unit(resources=location)
        results.append(_life(fmu, unit))
        unit.free()
    assert results[0][0] == OK
    assert results == [results[0]] * len(locations)


def test_fmpy_runs_it_from_a_folder_with_any_characters(entry: Entry, built: Built, odd_folder: Path) -> None:
    archive = odd_folder / f"{entry.identifier} [2].fmu"
    archive.write_bytes(built(entry, "native").read_bytes())
    assert len(simulate_fmu(str(archive), stop_time=0.01, output_interval=1e-3)) == 11


# --- the log ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("arguments", [{"has_host": False}, {"has_logger": False}], ids=["no host", "no logger"])
def test_a_host_without_logger_gets_its_errors_as_well(fmu: Fmu, arguments: dict[str, bool]) -> None:
    unit = fmu.unit(logging=True, **arguments)
    assert unit.initialise() == [OK, OK, OK]
    assert unit.set("Real", [0xFFFFFFFF], [1.0]) == ERROR
    assert unit.call("SetDebugLogging", 1, 1, array(c_char_p, [b"nothing"])) == ERROR
    assert Unit(fmu.library, b"unit", b"{other}", **arguments).handle is None
    assert unit.call("Terminate") == OK
    unit.free()


def test_errors_are_logged_unless_the_host_switches_them_off(fmu: Fmu) -> None:
    unit = fmu.unit()
    counts = []
    for categories in (None, (0, [b"logStatusError"]), (1, [b"logAll"]), (0, []), (1, [])):
        if categories is not None:
            on, names = categories
            assert unit.call("SetDebugLogging", on, len(names), array(c_char_p, names)) == OK
        assert unit.set("Real", [0xFFFFFFFF], [1.0]) == ERROR
        counts.append(len(unit.log))
        unit.log.clear()
    unit.free()
    assert counts == [1, 0, 1, 0, 1]


@pytest.mark.parametrize("logging", [False, True])
def test_events_are_logged_only_if_the_host_wants_them(fmu: Fmu, logging: bool) -> None:
    unit = fmu.unit(logging=logging)
    assert unit.initialise() == [OK, OK, OK]
    unit.free()
    assert bool(unit.log) == logging
    assert {category for _, category, _ in unit.log} <= {"logEvents"}


@pytest.mark.parametrize("name", ["100 %", "%s%s%n%d", "größer %.*f", "a\nb"])
def test_any_name_reaches_the_log_unharmed(fmu: Fmu, name: str) -> None:
    unit = fmu.unit(name, logging=True)
    assert unit.set("Real", [0xFFFFFFFF], [1.0]) == ERROR
    assert unit.initialise() == [OK, OK, OK]
    unit.free()
    assert unit.log[0][2] == f"{name}: there is no variable with value reference 4294967295"
    assert all(text.startswith(f"{name}: ") for _, _, text in unit.log)
    assert unit.logged_names == {name.encode()}


@pytest.mark.parametrize("letter", ["x", "ü", "€", "😀"])
@pytest.mark.parametrize("shift", range(4))
def test_the_message_of_a_very_long_name_is_cut_between_characters(fmu: Fmu, letter: str, shift: int) -> None:
    name = "." * shift + letter * 100_000
    unit = fmu.unit(name)
    assert unit.set("Real", [0xFFFFFFFF], [1.0]) == ERROR
    unit.free()
    text = unit.log[0][2]
    assert name.startswith(text)
    assert 1000 < len(text.encode()) < 1024
    assert unit.logged_names == {name.encode()}


_MESSAGES = """
import locale, sys
sys.path[:0] = sys.argv[1:3]
from fmi2_calls import Library, Unit
print(locale.setlocale(locale.LC_ALL, "") and locale.localeconv()["decimal_point"])
unit = Unit(Library(sys.argv[3]), b"unit", sys.argv[4].encode(), logging=True)
unit.initialise(0.25)
unit.step(7.5, 0.125)
unit.step(0.25, -0.5)
unit.set("Real", [int(sys.argv[5])], [1234567.5])
for _, _, text in unit.log:
    print(text)
"""


@pytest.fixture(scope="module")
def comma_locale(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """What makes a process write 0,5."""
    if shutil.which("localedef") is None:
        pytest.skip("no localedef")
    folder = tmp_path_factory.mktemp("locales")
    command = ["localedef", "-i", "de_DE", "-f", "UTF-8", str(folder / "de_DE.UTF-8")]
    if subprocess.run(command, capture_output=True, check=False).returncode != 0:
        pytest.skip("no German locale to be made here")
    return {"LOCPATH": str(folder), "LC_ALL": "de_DE.UTF-8"}


def test_the_hosts_locale_does_not_change_the_messages(fmu: Fmu, comma_locale: dict[str, str]) -> None:
    folders = [Path(__file__).parent, Path(__file__).parents[1]]
    limited = next(v.valueReference for v in fmu.of("Real", "parameter", "input") if v.max and float(v.max) < 1e6)
    arguments = [*folders, fmu.library.loaded._name, fmu.guid.decode(), limited]
    told = []
    for settings in ({"LC_ALL": "C"}, comma_locale):
        environment = {**os.environ, **settings, "PYTHONIOENCODING": "utf-8"}
        command = [sys.executable, "-c", _MESSAGES, *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, encoding="utf-8", check=True, env=environment)
        told.append(done.stdout.splitlines())
    assert [lines[0] for lines in told] == [".", ","]
    assert told[0][1:] == told[1][1:]
    assert "unit: a step from t = 7.5 s, but the FMU stands at t = 0.25 s" in told[0]
    assert len(told[0]) == 5
