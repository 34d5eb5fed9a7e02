"""Models as traces, and traces as C."""

from __future__ import annotations

import math
import shutil
import subprocess
from importlib import import_module
from math import nan
from pathlib import Path
from typing import Any

import casadi
import every_kind
import pytest
from fmu_instance import EVERY_KIND
from hypothesis import given
from hypothesis import strategies as st

from attitude_fmu.fmu_src.assemble import c_sources
from attitude_fmu.fmu_src.catalogue import CATALOGUE, Entry
from attitude_fmu.fmu_src.errors import BuildError
from attitude_fmu.fmu_src.native.c_code import model_source, number
from attitude_fmu.fmu_src.native.compile import compiler, headers
from attitude_fmu.fmu_src.trace import trace
from attitude_fmu.models.system import Clock, Model, Task
from attitude_fmu.models.vectors import ZERO3

MODEL = every_kind.MODEL
FINGERPRINT = "0123456789abcdef" * 4
ALL = [EVERY_KIND, *CATALOGUE]


def _source(model: Model) -> str:
    return model_source(trace(model), "{guid}", FINGERPRINT)


def _with_output(change: Any) -> Model:
    """The test model, the first of its rates changed."""

    def outputs(x: Any, p: Any, c: Any) -> Any:
        shown = every_kind.outputs(x, p, c).shown
        first, *others = shown.rate
        return every_kind.NamedOutputs(shown._replace(rate=(change(first), *others)))

    return MODEL._replace(outputs=outputs)


def test_a_tunable_parameter_must_not_move_a_clock() -> None:
    def coefficients(p: Any) -> Any:
        return every_kind.coefficients(p)._replace(fast=p.period * (2.0 + p.gain))

    with pytest.raises(BuildError, match=r"a clock's period depends on gain, which must then not be tunable"):
        trace(MODEL._replace(coefficients=coefficients))


def test_a_clock_may_follow_from_fixed_parameters_through_coefficients() -> None:
    traced = trace(MODEL._replace(clocks=(Clock("fast", lambda c: c.fast * c.sigma), MODEL.clocks[1])))
    assert len(traced.tasks) == 2


def test_an_operation_that_c_is_not_known_of_is_refused() -> None:
    with pytest.raises(BuildError, match=r"outputs: no C for CasADi's operation \d+"):
        _source(_with_output(lambda value: value.tan()))


def test_a_constant_that_is_no_number_is_refused() -> None:
    with pytest.raises(BuildError, match="a NaN in a model's constants"):
        _source(_with_output(lambda value: value + nan))


@given(st.floats(allow_nan=False))
def test_a_constant_is_written_to_the_last_bit(value: float) -> None:
    written = number(value)
    assert float(written.replace("HUGE_VAL", "inf")).hex() == value.hex()
    assert math.isinf(value) or "." in written or "e" in written  # not an integer of C


@pytest.mark.parametrize("fails", [False, True])
def test_casadi_is_left_as_it_was(fails: bool) -> None:
    assert casadi.GlobalOptions.getSimplificationOnTheFly()
    if fails:
        with pytest.raises(
            BuildError, match=r"outputs: ZeroDivisionError: float division by zero \(test_tracing\.py:\d+"
        ):
            trace(_with_output(lambda value: value + 1.0 / 0.0))
    else:
        trace(MODEL)
    assert casadi.GlobalOptions.getSimplificationOnTheFly()
    assert float(casadi.SX(2.0)) == 2.0


def _with_if(x: Any, p: Any, c: Any) -> Any:
    return every_kind.outputs(x, p, c) if x.drift > 1.0 else None


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (
            {"coefficients": lambda p: every_kind.coefficients(p)._replace(sigma=math.exp(p.gain))},
            r"coefficients: a signal given .* functions of attitude_fmu\.models\.scalar .*\(test_tracing\.py:\d+ in",
        ),
        ({"outputs": _with_if}, r"outputs: an if.* on a signal; use where\(.*\(test_tracing\.py:\d+ in _with_if\)$"),
        ({"coefficients": lambda p: 3.0}, "coefficients must return Coefficients, gave float$"),
        ({"initial_state": lambda p, c, u: None}, "initial_state must return State, gave NoneType$"),
        ({"tasks": (Task("move", "fast", lambda *_: ZERO3),)}, "task move must return State, gave tuple$"),
        (
            {"initial_state": lambda p, c, u: every_kind.State(0.0, 0.0, 0.0)},
            "initial_state must give 5 numbers in State",
        ),
        (
            {"tasks": (MODEL.tasks[0], MODEL.tasks[1]._replace(clock="slwo"))},
            r"task walk runs at a clock 'slwo', which is not there \(clocks: fast, slow\)$",
        ),
        ({"seed": lambda p: p.sede}, r"seed, clocks and tasks: AttributeError: .*'sede' \(test_tracing\.py:\d+ in"),
        (
            {"outputs": lambda x, p, c: every_kind.outputs("x", p, c)},
            r"outputs: AttributeError: .* \(every_kind\.py:\d+",
        ),
    ],
)
def test_what_a_models_author_got_wrong_is_told_with_its_place(change: dict[str, Any], told: str) -> None:
    with pytest.raises(BuildError, match=f"^Every kind: {told}"):
        trace(MODEL._replace(**change))


def test_a_step_writes_only_what_it_changes() -> None:
    traced = trace(MODEL)
    names = [variable.name for variable in traced.interface.variables]
    walk = next(task for task in traced.tasks if task.task.name == "walk")
    assert [names[place] for place in walk.ways[0].step.places] == ["state.drift"]


def test_tasks_are_grouped_by_clock_in_their_order() -> None:
    sample, walk = MODEL.tasks
    mixed = MODEL._replace(
        tasks=(walk, sample, walk._replace(name="again"), sample._replace(name="more")), clocks=MODEL.clocks
    )
    assert [task.task.name for task in trace(mixed).tasks] == ["sample", "more", "walk", "again"]


def test_the_c_names_the_models_variables_and_holds_the_start_values() -> None:
    source = _source(MODEL)
    assert '{"noise.density", REAL},' in source
    assert '{"mode", ENUMERATION},' in source
    assert '{298.15, 200.0, 400.0, "K", "200 to 400 K", 1},' in source
    assert "/* state.filtered[1] */" in source


def _warnings(command: list[str], entry: Entry, folder: Path) -> str:
    for name, content in c_sources(trace(import_module(entry.module).MODEL), FINGERPRINT).items():
        (folder / name).write_bytes(content)
    options = ["-std=c11", "-Wall", "-Wextra", "-isystem", str(headers())]
    done = subprocess.run([*command, *options, "fmu.c"], cwd=folder, capture_output=True, text=True, check=False)
    return done.stderr if done.returncode == 0 else f"failed: {done.stderr}"


@pytest.mark.parametrize("entry", ALL, ids=lambda entry: entry.identifier)
def test_clang_has_nothing_to_say_of_the_c(tmp_path: Path, entry: Entry) -> None:
    assert _warnings([*compiler(), "-O0", "-g0", "-c", "-o", "fmu.o"], entry, tmp_path) == ""


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_gcc_has_nothing_to_say_of_the_c(tmp_path: Path) -> None:
    assert _warnings(["gcc", "-O2", "-c"], EVERY_KIND, tmp_path) == ""


@pytest.mark.parametrize("entry", ALL, ids=lambda entry: entry.identifier)
def test_a_trace_gives_the_same_c_every_time(entry: Entry) -> None:
    model = import_module(entry.module).MODEL
    assert _source(model) == _source(model)
