"""A small model with every kind of variable, alternatives, noise and two clocks: a lag driven through a switch."""

from __future__ import annotations

from math import inf
from typing import Annotated, Any, NamedTuple

from attitude_fmu.models.record import Boolean, Enumeration, Integer, Item, Matrix3, Real, Vector3
from attitude_fmu.models.scalar import both, where
from attitude_fmu.models.system import Clock, Model, Rule, Task
from attitude_fmu.models.vectors import IDENTITY3, ZERO3, add, multiply, scale

SHAPE = Enumeration(
    "Shape", (Item("lag", "first-order lag"), Item("mean", "mean with the last value")), "kind of filter"
)


class NoiseParameters(NamedTuple):
    density: Annotated[float, Real("rad/(s.Hz^0.5)", "white noise, one-sided", min=0.0, max=1.0)] = 1e-3
    seed: Annotated[int, Integer("key of all noise", min=0)] = 1


class Parameters(NamedTuple):
    noise: NoiseParameters = NoiseParameters()
    mounting: Annotated[Matrix3, Real("1", "mounting matrix", min=-1.0, max=1.0)] = IDENTITY3
    shape: Annotated[int, SHAPE] = 1
    period: Annotated[float, Real("s", "period of the fast clock", min=1e-4, max=1.0, nominal=1e-3)] = 1e-3
    gain: Annotated[float, Real("1", "gain", display="%", tunable=True)] = 1.0
    lower: Annotated[float, Real("1", "less than the gain", tunable=True)] = 0.0
    shift: Annotated[int, Integer("counts added to the register", min=-9, max=9, tunable=True)] = 0
    inverted: Annotated[bool, Boolean("turns the sign", tunable=True)] = False
    mode: Annotated[int, Enumeration("Mode", (Item("on", "runs"), Item("held", "holds")), "mode", tunable=True)] = 1


class Coefficients(NamedTuple):
    fast: Annotated[float, Real("s", "fast period")]
    sigma: Annotated[float, Real("rad/s", "noise of a sample", display="deg/s")]
    whole: Annotated[int, Integer("counts")]
    rise: Annotated[float, Real("K", "temperature of the part above ambient")]


class Inputs(NamedTuple):
    rate: Annotated[Vector3, Real("rad/s", "true rate", min=-100.0, max=100.0, display="deg/s")] = ZERO3
    temperature: Annotated[float, Real("K", "temperature", min=200.0, max=400.0, display="degC")] = 298.15
    steps: Annotated[int, Integer("counts added", min=0, max=10)] = 0
    switch: Annotated[bool, Boolean("lets the rate in")] = True
    choice: Annotated[int, Enumeration("Choice", (Item("a", "a"), Item("b", "b")), "one of two")] = 1


class State(NamedTuple):
    filtered: Annotated[Vector3, Real("rad/s", "filtered rate")]
    drift: Annotated[float, Real("rad/s", "slow random walk")]
    ticks: Annotated[float, Integer("ticks of the fast clock")]


class Outputs(NamedTuple):
    rate: Annotated[Vector3, Real("rad/s", "rate as read", display="deg/s")]
    count: Annotated[float, Integer("ticks and shift")]
    moving: Annotated[float, Boolean("rate above noise")]
    level: Annotated[float, Enumeration("Level", (Item("low", "low"), Item("high", "high")), "size")]
    square: Annotated[float, Real("rad2/s2", "square of the filtered rate")]


class NamedOutputs(NamedTuple):
    shown: Outputs


def coefficients(p: Parameters) -> Coefficients:
    return Coefficients(p.period, p.noise.density * (0.5 / p.period) ** 0.5, 3, 2.0)


def initial_state(p: Parameters, c: Coefficients, u: Inputs) -> State:
    return State(scale(p.gain, u.rate), 0.0, 0.0)


def _driven(x: State, u: Inputs, p: Parameters, c: Coefficients, normals: tuple[Any, ...]) -> Any:
    sign = where(p.inverted > 0.5, -1.0, 1.0)
    noisy = add(multiply(p.mounting, u.rate), scale(c.sigma, normals))
    return scale(sign * p.gain * where(u.switch > 0.5, 1.0, 0.0), noisy)


def lag(x: State, u: Inputs, p: Parameters, c: Coefficients, normals: tuple[Any, ...]) -> State:
    breaks = where(both(u.choice > 1.5, u.steps > 9.5), 0.0, 1.0)
    filtered = add(scale(0.9, x.filtered), scale(0.1, _driven(x, u, p, c, normals)))
    return State(filtered, x.drift, x.ticks + 1.0 / breaks + u.steps)


def mean(x: State, u: Inputs, p: Parameters, c: Coefficients, normals: tuple[Any, ...]) -> State:
    return State(scale(0.5, add(x.filtered, _driven(x, u, p, c, normals))), x.drift, x.ticks + 1.0)


def walk(x: State, u: Inputs, p: Parameters, c: Coefficients, normals: tuple[Any, ...]) -> State:
    return x._replace(drift=x.drift + 1e-6 * normals[0] * (u.temperature - 298.15))


def outputs(x: State, p: Parameters, c: Coefficients) -> NamedOutputs:
    a, b, d = x.filtered
    size = a * a + b * b + d * d
    high = where(size > 1.0, 2.0, 1.0)
    return NamedOutputs(Outputs((a + x.drift, b, d), x.ticks + p.shift, where(size > 0.0, 1.0, 0.0), high, size))


MODEL = Model(
    name="Every kind",
    description="Small test model with every kind of variable",
    Parameters=Parameters,
    Coefficients=Coefficients,
    Inputs=Inputs,
    State=State,
    Outputs=NamedOutputs,
    coefficients=coefficients,
    initial_state=initial_state,
    outputs=outputs,
    clocks=(Clock("fast", lambda c: c.fast), Clock("slow", lambda c: 0.0125)),
    tasks=(
        Task("sample", "fast", {1: lag, 2: mean}, choice=lambda p: p.shape, normals=3),
        Task("walk", "slow", walk, normals=1),
    ),
    seed=lambda p: p.noise.seed,
    rules=(Rule("lower", "more than 100 % of the gain %s %d", lambda p: (-inf, p.gain)),),
)
