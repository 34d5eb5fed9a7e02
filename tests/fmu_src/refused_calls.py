"""Calls that an instance of EveryKind, initialised and three steps on, must refuse; with what the reason must match."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from fmu_instance import Instance

Call = Callable[[Instance], Any]


def _setting(name: str, value: Any) -> Call:
    return lambda unit: unit.__setitem__(name, value)


def _setting_reals(names: tuple[str, ...], *values: float) -> Call:
    return lambda unit: unit.fmu.setReal([unit.variables[name].valueReference for name in names], list(values))


RATES = ("rate[1]", "rate[2]", "rate[3]")

REFUSED: dict[str, tuple[Call, str]] = {
    "not a number": (_setting("temperature", math.nan), r"EveryKind.temperature = nan K: not a finite"),
    "not a number, of the other sign": (
        _setting("temperature", -math.nan),
        r"EveryKind.temperature = nan K: not a finite",
    ),
    "celsius": (_setting("temperature", 25.0), r"EveryKind.temperature = 25 K: .*kelvin.*200 to 400 K"),
    "too large": (_setting("rate[1]", 101.0), r"EveryKind.rate\[1\] = 101 rad/s: too large"),
    "infinite": (_setting("gain", math.inf), r"EveryKind.gain = inf"),
    "no such choice": (_setting("choice", 3), r"EveryKind.choice = 3: no such choice .*1 a, 2 b"),
    "integer out of range": (_setting("steps", -1), r"EveryKind.steps = -1: too small"),
    "fixed parameter": (
        _setting("period", 2e-3),
        r"EveryKind.period = 0.002 s: fixed, can be set only before the end of initialisation "
        r"\(allowed: 0.0001 to 1 s\)",
    ),
    "fixed parameter out of range": (_setting("period", 2.0), r"EveryKind.period = 2 s: too large"),
    "a list with one bad value": (_setting_reals(RATES, 1.0, 2.0, 300.0), r"rate\[3\] = 300 rad/s: too large"),
    "a list with two bad values": (
        _setting_reals(("period", "temperature"), 2e-3, 25.0),
        r"temperature = 25 K: too small",
    ),
    "a list with a coefficient and a value": (
        _setting_reals(("temperature", "coefficient.sigma"), 25.0, 1.0),
        r"coefficient.sigma cannot be set: its causality is calculatedParameter",
    ),
    "a list with an output and no variable": (
        lambda unit: unit.fmu.setReal([unit.variables["shown.rate[1]"].valueReference, 4711], [1.0, 1.0]),
        r"no variable with value reference 4711",
    ),
    "output": (_setting("shown.count", 3), r"shown.count cannot be set: its causality is output"),
    "count of refusals": (_setting("refused_calls", 0), r"refused_calls cannot be set: its causality is output"),
    "state": (_setting("state.drift", 0.0), r"state.drift cannot be set: its causality is local"),
    "wrong type": (lambda u: u.fmu.setReal([u.variables["steps"].valueReference], [1.0]), r"steps is of type Integer"),
    "reading the wrong type": (lambda u: u.fmu.getBoolean([0]), r"noise.density is of type Real, not Boolean"),
    "reading a number as an integer": (lambda u: u.fmu.getInteger([0]), r"of type Real, not Integer or Enumeration"),
    "string": (lambda u: u.fmu.getString([0]), r"noise.density is of type Real, not String"),
    "no such string": (lambda u: u.fmu.getString([4711]), r"no variable with value reference 4711"),
    "setting a string": (lambda u: u.fmu.setString([0], ["1"]), r"noise.density is of type Real, not String"),
    "no such variable": (lambda u: u.fmu.getReal([4711]), r"no variable with value reference 4711"),
    "communication point": (lambda u: u.fmu.doStep(0.5, 1e-3), r"from t = 0.5 s, but the FMU stands at t = 0.003 s"),
    "backwards": (lambda u: u.fmu.doStep(3e-3, -1e-3), r"a step of -0.001 s"),
    "no step size": (lambda u: u.fmu.doStep(3e-3, math.nan), r"a step of nan s"),
    "too far": (lambda u: u.fmu.doStep(3e-3, 2e9), r"a step of 2000000000 s from t = 0.003 s \(allowed: .* 1000000000"),
    "a second experiment": (
        lambda u: u.fmu.setupExperiment(startTime=1.0),
        r"fmi2SetupExperiment refused: the instance is initialised already",
    ),
    "initialising again": (
        lambda u: u.fmu.enterInitializationMode(),
        r"fmi2EnterInitializationMode refused: the instance is initialised already",
    ),
    "ending no initialisation": (
        lambda u: u.fmu.exitInitializationMode(),
        r"fmi2ExitInitializationMode refused: the instance is initialised already",
    ),
}
