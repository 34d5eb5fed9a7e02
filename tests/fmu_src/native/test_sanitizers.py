"""Random calls of FMUs compiled with the address and undefined-behaviour sanitizers (`sanitized_machine`)."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from fmu_instance import EVERY_KIND
from sanitized_build import Change, run_sanitized, sanitized, toolchain

from attitude_fmu.fmu_src.catalogue import CATALOGUE, Entry, entry

_FEW, _MANY = (30, 25), (2000, 40)
ENTRIES = (EVERY_KIND, entry("AttitudeSensor"))
ALL_ENTRIES = (EVERY_KIND, *CATALOGUE)


def _replaced(file: str, old: str, new: str) -> Change:
    def change(sources: dict[str, bytes]) -> None:
        assert sources[file].count(old.encode()) == 1
        sources[file] = sources[file].replace(old.encode(), new.encode())

    return change


def _findings(entry: Entry, folder: Path, extent: tuple[int, int], seconds: float, *change: Change) -> str:
    """What went wrong: a sanitizer's report or an unexpected answer, then the calls before; empty if nothing did."""
    toolchain()
    fmu = sanitized(entry, folder, *change)
    journal = folder / "journal.txt"
    try:
        done = run_sanitized("sanitized_machine.py", [*fmu, journal, *extent], seconds)
        report = "" if done.returncode == 0 else done.stderr[-8000:]
    except subprocess.TimeoutExpired:
        report = f"not finished after {seconds} s"
    calls = journal.read_text()[-3000:] if journal.exists() else "none"
    return f"{report}\nthe last calls:\n{calls}" if report else ""


def _check(entry: Entry, folder: Path, extent: tuple[int, int], seconds: float) -> None:
    findings = _findings(entry, folder, extent, seconds)
    if findings:
        pytest.fail(findings, pytrace=False)  # whole, where an assertion would cut it


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.identifier)
def test_any_calls_get_the_expected_answer_and_touch_nothing_else(entry: Entry, tmp_path: Path) -> None:
    _check(entry, tmp_path, _FEW, 120.0)


@pytest.mark.slow
@pytest.mark.parametrize("entry", ALL_ENTRIES, ids=lambda entry: entry.identifier)
def test_thousands_of_call_sequences_get_the_expected_answers(entry: Entry, tmp_path: Path) -> None:
    _check(entry, tmp_path, _MANY, 1500.0)


_BUGS: dict[str, tuple[Change, str]] = {
    "read past a table": (
        _replaced("fmi2.c", "return reference < VARIABLES &&", "return reference <= VARIABLES &&"),
        "out of bounds",
    ),
    "write past an array on the stack": (
        _replaced("instance.c", "double state[STATES + 1];", "double state[STATES - 1];"),
        "stack-buffer-overflow",
    ),
    "integer overflow": (
        _replaced("instance.c", "++instance->now.ticks[clock];", "(int)++instance->now.ticks[clock] + 2147483647;"),
        "signed integer overflow",
    ),
    "use after free": (
        _replaced(
            "fmi2.c", "    free(instance->name);\n    free(instance);", "    free(instance);\n    free(instance->name);"
        ),
        "heap-use-after-free",
    ),
    "array not looked for": (
        _replaced(
            "fmi2.c",
            """    if (count && (!references || !values))
        return refuse(instance, NO_ARRAY, instance->name);
    for (size_t i = 0; i < count; i++)
        if (find""",
            """    for (size_t i = 0; i < count; i++)
        if (find""",
        ),
        "null pointer",
    ),
    "leak": (_replaced("fmi2.c", "        free(*state);\n", ""), "self.allocations() == self.begin_allocations"),
    "call taken in a wrong stage": (
        _replaced("fmi2.c", '"fmi2DoStep", STEPPING, STEPPING', '"fmi2DoStep", STEPPING, TERMINATED'),
        "('DoStep'",
    ),
    "half a refused call": (
        _replaced("instance.c", "        memcpy(now->ticks, ticks, sizeof ticks);\n", ""),
        "essence(after, self.facts) == essence(before, self.facts)",
    ),
}


_FAST = ("write past an array on the stack", "integer overflow", "call taken in a wrong stage")


@pytest.mark.parametrize("name", [pytest.param(n, marks=() if n in _FAST else pytest.mark.slow) for n in _BUGS])
def test_a_bug_put_into_the_runtime_is_found(name: str, tmp_path: Path) -> None:
    change, trace = _BUGS[name]
    assert trace in _findings(EVERY_KIND, tmp_path, (400, 40), 120.0, change)
