"""Random records for tests: legal values near given ones, and numbers to the last bit."""

from __future__ import annotations

import math
import random
from typing import Any

from attitude_fmu.models.errors import ValueRefusedError
from attitude_fmu.models.record import (
    Boolean,
    Enumeration,
    Integer,
    Leaf,
    Real,
    check,
    defaults,
    flatten,
    leaves,
    unflatten,
)
from attitude_fmu.models.system import Model, check_rules

COUNTERS = {
    "ticks": (0, 1, 7, 4999, 5001, 5008, 5012, 5063, 9998, 10_003, 123_456),
    "wind.calls": (0, 1, 500),
    "engaged": (0, 1),
    "sequence.row": (0, 1, 3, 4, 47, 48, 49),
    "sequence.left": (0, 0, 1, 500),
    "sequence.ends": (0, 0, 1),
    "steady": (0, 1),
    "shock.pulses": (1, 1, 3),
    "attitude.alignment.sums.samples": (0, 10, 999, 1000, 1001),
    "attitude.fusion.rest.quiet": (0.0, 1.0, 1.6, 4.0),
    "accelerometer.samples": (0, 4, 5, 7),
    "accelerometer.silent": (0, 0, 1, 2),
    "accelerometer.words": (0, 1, 300),
    **{f"accelerometer.{w}.condition[{axis}]": (0, 0, 1, 2) for w in ("latest", "earlier") for axis in (1, 2, 3)},
    **{f"gyro[{axis}].condition": (0, 0, 1, 2) for axis in (1, 2, 3)},
    **{f"gyro[{axis}].words": (0, 1, 300, 15_000) for axis in (1, 2, 3)},
    **{f"{part}.misalignment[{axis}]": (0.0, 0.0, 0.01) for part in ("gyro", "accelerometer") for axis in (1, 2, 3)},
    "gyro.range": (math.radians(75.0), math.radians(150.0), math.radians(300.0)),
    **{f"fault[{i}].start": (0.0, 0.0, 0.3, 1e9) for i in (1, 2)},
    **{f"fault[{i}].end": (0.0, 0.5, 1e9, 1e9) for i in (1, 2)},
    **{f"fault[{i}].size": (-1.0, 0.1) for i in (1, 2)},
}
"""Values that reach every branch: start, shutter and knock, end of the alignment, rest, a due word, silence, faults,
and the ranges that every part has."""

NEVER_WILD = ("attitude.q_nb", "attitude.fusion.covariance")
"""What no run can bring to zero or to a hundred times itself."""

LEAST = {"solver_period": 1e-4}
"""Steps shorter than these make random runs last."""


def near(leaf: Leaf, value: float, chance: random.Random) -> float:
    """A random legal value near `value`."""
    fact = leaf.fact
    if isinstance(fact, Enumeration):
        return chance.randint(1, len(fact.items))
    if isinstance(fact, Boolean):
        return chance.randint(0, 1)
    if leaf.name in COUNTERS:
        return chance.choice(COUNTERS[leaf.name])
    if isinstance(fact, Integer):
        return value
    assert isinstance(fact, Real)
    low = fact.min if fact.min is not None else -float("inf")
    high = fact.max if fact.max is not None else float("inf")
    wild = chance.random()
    if wild < 0.1 and not leaf.name.startswith(NEVER_WILD):
        moved = 0.0 if wild < 0.05 else 100.0 * value
    else:
        moved = value * (1.0 + 0.1 * chance.gauss(0.0, 1.0)) + (0.001 * chance.gauss(0.0, 1.0) if value == 0.0 else 0.0)
    return min(max(moved, low), high)


def settable_near(leaf: Leaf, value: float, chance: random.Random) -> float:
    """A random legal value of a parameter or input, near `value`; whole numbers move as well."""
    if not isinstance(leaf.fact, Integer):
        return near(leaf, value, chance)
    low = value - 9 if leaf.fact.min is None else max(leaf.fact.min, value - 9)
    high = value + 9 if leaf.fact.max is None else min(leaf.fact.max, value + 9)
    return chance.randint(int(low), int(high))


def points_near(record: type, centre: Any, chance: random.Random) -> list[float]:
    return [float(near(leaf, value, chance)) for leaf, value in zip(leaves(record), flatten(centre), strict=True)]


def bits(values: list[float]) -> list[str]:
    return [float(value).hex() for value in values]


def reconciled(model: Model, parameters: list[float]) -> list[float] | None:
    """Parameters that go together: those that a rule refuses back at their start values, or as near as the rule lets.

    None where that is not enough, or where a run would take very many steps.
    """
    found = list(parameters)
    places = {leaf.name: (place, leaf.start) for place, leaf in enumerate(leaves(model.Parameters))}
    for rule in model.rules:
        low, high = rule.limits(unflatten(model.Parameters, found))
        place, start = places[rule.field]
        if not low <= found[place] <= high:
            found[place] = type(start)(min(max(start, low), high))
        if found[place] < LEAST.get(rule.field, found[place]):
            return None
    try:
        check(model.Parameters, found, model.name)
        check_rules(model, unflatten(model.Parameters, found), model.name)
    except ValueRefusedError:
        return None
    return found


def legal_parameters(model: Model, chance: random.Random) -> list[float]:
    """Random parameters that go together."""
    while True:
        parameters = reconciled(model, points_near(model.Parameters, defaults(model.Parameters), chance))
        if parameters is not None:
            return parameters
