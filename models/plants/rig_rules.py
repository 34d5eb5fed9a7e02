"""Limits of a rig's parameters that follow from one another, part by part."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Any

from ..scalar import Scalar, floor, maximum, sqrt, where
from ..system import Rule
from .gimbal import Axes
from .wind import longest_period

MARGIN = 1e-9
"""Relative width of a limit: what is computed from decimal numbers may miss it by roundings."""


def _moment_rule(name: str, axis: int) -> Rule:
    def limits(p: Any) -> tuple[Scalar, Scalar]:
        inertia = getattr(p, name).inertia
        return 0.0, (inertia[axis - 1] + inertia[axis - 2]) * (1.0 + MARGIN)

    return Rule(f"{name}.inertia[{axis + 1}]", "larger than the other two together, as in no rigid body", limits)


def _product_rules(name: str) -> tuple[Rule, ...]:
    """The inertia tensor is positive definite: what its minors leave for xy, xz and then yz."""

    def around(centre: Scalar, square: Scalar) -> tuple[Scalar, Scalar]:
        half = (1.0 - MARGIN) * sqrt(maximum(square, 0.0))
        return centre - half, centre + half

    def xy_limits(p: Any) -> tuple[Scalar, Scalar]:
        x, y, _ = getattr(p, name).inertia
        return around(0.0, x * y)

    def xz_limits(p: Any) -> tuple[Scalar, Scalar]:
        x, _, z = getattr(p, name).inertia
        return around(0.0, x * z)

    def yz_limits(p: Any) -> tuple[Scalar, Scalar]:
        (x, y, z), (xy, xz, _) = getattr(p, name).inertia, getattr(p, name).products
        return around(xy * xz / x, (x * y - xy * xy) * (x * z - xz * xz) / (x * x))

    why = "too large for the moments, as in no rigid body"
    return tuple(
        Rule(f"{name}.products[{i}]", why, limits) for i, limits in enumerate((xy_limits, xz_limits, yz_limits), 1)
    )


def body_rules(name: str) -> tuple[Rule, ...]:
    """The body in the field `name` is rigid."""
    return (*[_moment_rule(name, axis) for axis in range(3)], *_product_rules(name))


def pulse_rule(name: str, length: Callable[[Any], Scalar], why: str) -> Rule:
    """The pulse in the field `name` is over, after its `length` (s), before it starts again."""

    def limits(p: Any) -> tuple[Scalar, Scalar]:
        return where(getattr(p, name).period > 0.0, length(p), 0.0), inf

    return Rule(f"{name}.period", why, limits)


def wind_rule() -> Rule:
    """The wind's clock, a whole number of solver steps, follows the vortices that the body sheds."""

    def limits(p: Any) -> tuple[Scalar, Scalar]:
        steps = floor(longest_period(p.wind) / p.solver_period * (1.0 + MARGIN))
        return 0.0, where(p.wind.shedding * p.wind.speed > 0.0, steps * p.solver_period * (1.0 + MARGIN), inf)

    why = (
        "too long for the vortices, which turn at 0.2 wind.speed/wind.lens_diameter: five of it in a turn are wanted; "
        "shorten it, and the solver_period where nothing is allowed, or set wind.shedding to 0"
    )
    return Rule("wind.period", why, limits)


def start_rule(axis: int) -> Rule:
    """A joint starts between its end stops."""

    def limits(p: Any) -> tuple[Scalar, Scalar]:
        stop = p.stop[axis]
        free = stop.stiffness <= 0.0
        return where(free, -inf, stop.lower), where(free, inf, stop.upper)

    return Rule(f"initial.joint.{Axes._fields[axis]}", "beyond the joint's end stop", limits)
