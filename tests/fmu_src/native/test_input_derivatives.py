"""fmi2SetRealInputDerivatives: inputs that follow a slope within a step."""

from __future__ import annotations

import math
from collections.abc import Callable
from importlib import import_module
from itertools import pairwise
from pathlib import Path
from typing import Any

import every_kind
import pytest
from fmu_instance import EVERY_KIND, Instance

from attitude_fmu.fmu_src.catalogue import CATALOGUE, Entry
from attitude_fmu.models.record import Real, defaults, flatten, leaves, unflatten
from attitude_fmu.models.system import TIME_TOLERANCE, Run

Load = Callable[[Path], Instance]
Signal = Callable[[float], float]

UNEVEN = 1.1e-3
"""s, a period with which no tick of EveryKind's fast clock comes near one of its slow one before 0.13 s."""


def _slope(unit: Instance, **slopes: float) -> None:
    references = [unit.variables[name].valueReference for name in slopes]
    unit.fmu.setRealInputDerivatives(references, [1] * len(slopes), list(slopes.values()))


def _due(run: Run) -> float:
    ticks = zip(run.model.clocks, run.counts, strict=True)
    return min(run.start_time + (count + 1) * clock.period(run.coefficients) for clock, count in ticks)


def _advance(run: Run, inputs_at: Callable[[float], Any], until: float) -> None:
    """Every tick with the inputs of its own time."""
    while (time := _due(run)) <= until + TIME_TOLERANCE * max(1.0, until):
        run.advance(inputs_at(time), time)


def _bits(values: list[Any]) -> list[str]:
    return [float(value).hex() for value in values]


@pytest.mark.parametrize("entry", [EVERY_KIND, *CATALOGUE], ids=lambda entry: entry.identifier)
def test_each_tick_sees_the_inputs_of_its_own_time(built: Callable[..., Path], load: Load, entry: Entry) -> None:
    model = import_module(entry.module).MODEL
    unit = load(built(entry, "native"))
    changes = {"period": UNEVEN} if entry is EVERY_KIND else {}
    parameters = {leaf.name: changes.get(leaf.name, leaf.start) for leaf in leaves(model.Parameters)}
    starts = flatten(defaults(model.Inputs))
    slopes = [0.1 * (i + 1) if isinstance(leaf.fact, Real) else 0.0 for i, leaf in enumerate(leaves(model.Inputs))]
    named = {leaf.name: slope for leaf, slope in zip(leaves(model.Inputs), slopes, strict=True) if slope}
    run = Run(model, unflatten(model.Parameters, parameters.values()), defaults(model.Inputs))
    unit.initialise(**changes)
    time = 0.0
    for length in (1e-3, 7.3e-3, 0.031, 0.0, 0.02, 0.04):

        def inputs_at(tick: float, begin: float = time) -> Any:
            moved = [start + slope * (tick - begin) for start, slope in zip(starts, slopes, strict=True)]
            return unflatten(model.Inputs, moved)

        _slope(unit, **named)
        unit.fmu.doStep(time, length)
        time += length
        _advance(run, inputs_at, time)
        shown = unit.bits()
        assert [shown[leaf.name] for leaf in leaves(model.Outputs)] == _bits(run.shown())
        state = {f"state.{leaf.name}": x for leaf, x in zip(leaves(model.State), flatten(run.state), strict=True)}
        visible = [name for name in state if name in shown]
        assert len(visible) > 3
        assert [shown[name] for name in visible] == _bits([state[name] for name in visible])
        assert [shown[leaf.name] for leaf in leaves(model.Inputs)] == _bits(starts)  # they stay as they were set


@pytest.fixture
def unit(native_fmu: Path, load: Load) -> Instance:
    return load(native_fmu)


def test_a_slope_holds_for_one_step(native_fmu: Path, load: Load) -> None:
    sloped, held = load(native_fmu), load(native_fmu)
    for one in (sloped, held):
        one.initialise(**{"noise.density": 0.0, "rate[1]": 1.0})
    _slope(sloped, **{"rate[1]": 50.0})
    for one in (sloped, held):
        one.step(1, 0.02)
    assert sloped["shown.rate[1]"] > 1.1 * held["shown.rate[1]"]
    held.restore(sloped.serialised())
    _slope(held, **{"rate[1]": 0.0})
    for one in (sloped, held):
        one.step(1, 0.02, start=0.02)
    assert sloped.bits() == held.bits()


def test_the_last_slope_counts(native_fmu: Path, load: Load) -> None:
    twice, once = load(native_fmu).initialise(), load(native_fmu).initialise()
    _slope(twice, **{"rate[1]": 50.0, "rate[2]": 3.0})
    _slope(twice, **{"rate[1]": -2.0})
    _slope(once, **{"rate[1]": -2.0, "rate[2]": 3.0})
    for one in (twice, once):
        one.step(1, 0.02)
    assert twice.bits() == once.bits()


def test_slopes_are_saved_with_the_state(native_fmu: Path, load: Load) -> None:
    one, other = load(native_fmu).initialise(), load(native_fmu).initialise()
    one.step(1, 0.01)
    before = one.serialised()
    _slope(one, **{"rate[1]": 50.0})
    other.restore(one.serialised())
    for unit in (one, other):
        unit.step(1, 0.02, start=0.01)
    assert other.bits() == one.bits()
    other.restore(before)  # which has none
    other.step(1, 0.02, start=0.01)
    assert other["shown.rate[1]"] != one["shown.rate[1]"]


def test_reset_forgets_slopes(native_fmu: Path, load: Load) -> None:
    used, fresh = load(native_fmu).initialise(), load(native_fmu).initialise()
    _slope(used, **{"rate[1]": 50.0})
    used.fmu.reset()
    for one in (used.initialise(), fresh):
        one.step(1, 0.02)
    assert used.bits() == fresh.bits()


@pytest.mark.parametrize(
    ("name", "order", "slope", "reason"),
    [
        ("rate[1]", 2, 1.0, "EveryKind: derivative of order 2 of rate[1] refused: only the first is used"),
        ("rate[1]", 0, 1.0, "EveryKind: derivative of order 0 of rate[1] refused: only the first is used"),
        ("rate[1]", 1, math.nan, "EveryKind: the derivative of rate[1] is nan"),
        ("rate[1]", 1, -math.inf, "EveryKind: the derivative of rate[1] is -inf"),
        ("gain", 1, 1.0, "EveryKind: gain is no input"),
        ("shown.rate[1]", 1, 1.0, "EveryKind: shown.rate[1] is no input"),
        ("state.drift", 1, 1.0, "EveryKind: state.drift is no input"),
        ("steps", 1, 1.0, "EveryKind: steps is of type Integer, not Real"),
        ("switch", 1, 1.0, "EveryKind: switch is of type Boolean, not Real"),
    ],
)
def test_what_is_no_slope_of_a_real_input_is_refused_and_changes_nothing(
    native_fmu: Path, load: Load, name: str, order: int, slope: float, reason: str
) -> None:
    unit, untouched = load(native_fmu).initialise(), load(native_fmu).initialise()
    references = [unit.variables[one].valueReference for one in ("temperature", name)]
    assert unit.refusal(lambda: unit.fmu.setRealInputDerivatives(references, [1, order], [100.0, slope])) == reason
    for one in (unit, untouched):
        one.step(1, 0.05)
    assert unit.bits() == untouched.bits()


@pytest.mark.parametrize(
    ("slope", "reason"), [(1e4, "1298.15 K: too large"), (-1e4, "-701.85 K: too small, kelvin wanted")]
)
def test_a_slope_that_leaves_the_range_within_a_step_is_refused_and_changes_nothing(
    native_fmu: Path, load: Load, slope: float, reason: str
) -> None:
    unit, other = load(native_fmu).initialise(), load(native_fmu).initialise()
    for one in (unit, other):
        _slope(one, temperature=slope)
    told = unit.refusal(lambda: unit.step(1, 0.1), by="fmi2DoStep")
    assert told == f"EveryKind.temperature = {reason} (allowed: 200 to 400 K)"
    for one in (unit, other):
        one.step(1, 5e-3)  # which stays in it
    assert unit.bits() == other.bits()


def test_slopes_are_refused_where_nothing_can_be_set(unit: Instance) -> None:
    unit.initialise().step()
    unit.fmu.terminate()
    assert "setting input derivatives refused: terminated" in unit.refusal(lambda: _slope(unit, **{"rate[1]": 1.0}))


def test_derivatives_of_outputs_are_refused(unit: Instance) -> None:
    unit.initialise().step()
    reference = unit.variables["shown.rate[1]"].valueReference
    reason = unit.refusal(lambda: unit.fmu.getRealOutputDerivatives([reference], [1]))
    assert reason == "EveryKind: derivatives of outputs are not offered"


# --- what they are good for

STOP = 2.56
SHORT_MEMORY = {"noise.density": 0.0, "shape": 2}
"""A filter that has forgotten all but the last milliseconds of a step."""


def _exact(signal: Signal, times: list[float]) -> list[float]:
    parameters = every_kind.Parameters(noise=every_kind.NoiseParameters(density=0.0), shape=2)

    def inputs_at(time: float) -> every_kind.Inputs:
        return every_kind.Inputs(rate=(signal(time), 0.0, 0.0))

    run = Run(every_kind.MODEL, parameters, inputs_at(0.0))
    shown = []
    for time in times:
        _advance(run, inputs_at, time)
        shown.append(run.outputs().shown.rate[0])
    return shown


def _error(unit: Instance, signal: Signal, slope: Signal | None, length: float) -> float:
    """Largest error at the communication points of a run with large steps."""
    unit.fmu.reset()
    unit.initialise(**SHORT_MEMORY, **{"rate[1]": signal(0.0)})
    times = [i * length for i in range(round(STOP / length))]
    shown = []
    for time in times:
        unit["rate[1]"] = signal(time)
        if slope is not None:
            _slope(unit, **{"rate[1]": slope(time)})
        unit.fmu.doStep(time, length)
        shown.append(unit["shown.rate[1]"])
    exact = _exact(signal, [time + length for time in times])
    return max(abs(a - b) for a, b in zip(shown, exact, strict=True))


def test_with_slopes_the_error_of_large_steps_falls_with_their_square(unit: Instance) -> None:
    def signal(time: float) -> float:
        return math.sin(time)

    def slope(time: float) -> float:
        return math.cos(time)

    lengths = (0.16, 0.08, 0.04)
    held = [_error(unit, signal, None, length) for length in lengths]
    sloped = [_error(unit, signal, slope, length) for length in lengths]
    for large, small in pairwise(held):
        assert large / small == pytest.approx(2.0, rel=0.1)
    for large, small in pairwise(sloped):
        assert large / small == pytest.approx(4.0, rel=0.1)
    assert sloped[-1] < 0.05 * held[-1]
