"""Small models whose sampled form can be written down."""

from __future__ import annotations

from math import exp
from typing import Annotated, Any, NamedTuple

from attitude_fmu.models.record import Integer, Real
from attitude_fmu.models.scalar import clip, round_half_up
from attitude_fmu.models.system import Clock, Model, Task


class Parameters(NamedTuple):
    fast: Annotated[float, Real("s", "period of the lag's clock", min=1e-6)] = 0.25
    reading: Annotated[float, Real("s", "period of the reading's clock", min=1e-6)] = 1.0
    slow: Annotated[float, Real("s", "period of the drift's clock", min=1e-6)] = 10.0
    every: Annotated[int, Integer("ticks for each reading", min=1)] = 1
    pole: Annotated[float, Real("1", "of the lag", min=-2.0, max=2.0)] = 0.8
    noise: Annotated[float, Real("1", "of a reading")] = 0.0
    drift: Annotated[float, Real("1", "standard deviation of what adds itself slowly")] = 0.0
    step: Annotated[float, Real("1", "of the quantiser", min=1e-12)] = 0.5
    limit: Annotated[float, Real("1", "of a reading", min=0.0)] = 1e6
    seed: Annotated[int, Integer("key of all noise", min=0)] = 1


class Coefficients(NamedTuple):
    fast: Annotated[float, Real("s", "period")]
    reading: Annotated[float, Real("s", "period")]
    slow: Annotated[float, Real("s", "period")]
    every: Annotated[float, Integer("divider")]


class Inputs(NamedTuple):
    level: Annotated[float, Real("1", "what is measured")] = 0.0
    offset: Annotated[float, Real("1", "what the drift's clock lets through")] = 0.0


class State(NamedTuple):
    lag: Annotated[float, Real("1", "lag")]
    shown: Annotated[float, Real("1", "as read")]
    readings: Annotated[float, Real("1", "readings so far")]
    drift: Annotated[float, Real("1", "drift")]
    added: Annotated[float, Real("1", "drift and offset")]
    idle: Annotated[float, Real("1", "follows the level, and nothing follows from it")]


class Values(NamedTuple):
    reading: Annotated[float, Real("1", "as read")]


class Outputs(NamedTuple):
    value: Values
    count: Annotated[float, Integer("readings so far")]


DRIFT_MEMORY = exp(-0.3)


def _lag(x: State, u: Inputs, p: Parameters, _c: Coefficients, _w: tuple[Any, ...]) -> State:
    return x._replace(lag=p.pole * x.lag + (1.0 - p.pole) * u.level, idle=0.5 * x.idle + u.level)


def _read(x: State, _u: Inputs, p: Parameters, _c: Coefficients, w: tuple[Any, ...]) -> State:
    value = x.lag + x.added + p.noise * w[0]
    shown = p.step * round_half_up(clip(value, -p.limit, p.limit) / p.step)
    return x._replace(shown=shown, readings=x.readings + 1.0)


def _drift(x: State, u: Inputs, p: Parameters, _c: Coefficients, w: tuple[Any, ...]) -> State:
    now = DRIFT_MEMORY * x.drift + p.drift * (1.0 - DRIFT_MEMORY**2) ** 0.5 * w[0]
    return x._replace(drift=now, added=now + u.offset)


def model(order: tuple[str, ...] = ("fast", "reading", "slow")) -> Model:
    """A lag at a fast clock, read into a register at another, to which a third adds a drift."""
    periods = {
        "fast": Clock("fast", lambda c: c.fast),
        "reading": Clock("reading", lambda c: c.reading),
        "slow": Clock("slow", lambda c: c.slow),
    }
    return Model(
        name="Probe",
        description="a lag, a register and a drift",
        Parameters=Parameters,
        Coefficients=Coefficients,
        Inputs=Inputs,
        State=State,
        Outputs=Outputs,
        coefficients=lambda p: Coefficients(p.fast, p.reading, p.slow, 1.0 * p.every),
        initial_state=lambda _p, _c, u: State(u.level, u.level, 0.0, 0.0, 0.0, u.level),
        outputs=lambda x, _p, _c: Outputs(Values(x.shown), x.readings),
        clocks=tuple(periods[name] for name in order),
        tasks=(
            Task("lag", "fast", _lag),
            Task("read", "reading", _read, every=lambda c: c.every, normals=1),
            Task("drift", "slow", _drift, normals=1),
        ),
        seed=lambda p: p.seed,
    )


class ChainParameters(NamedTuple):
    slow: Annotated[float, Real("s", "period of the relay's clock", min=1e-6)] = 10.0


class ChainCoefficients(NamedTuple):
    slow: Annotated[float, Real("s", "period")]


class ChainInputs(NamedTuple):
    level: Annotated[float, Real("1", "what enters the line")] = 0.0


class ChainOutputs(NamedTuple):
    late: Annotated[float, Real("1", "end of the line")]
    walk: Annotated[float, Real("1", "coloured noise")]
    relayed: Annotated[float, Real("1", "the same, as a slower clock reads it")]


def chained(samples: int) -> Model:
    """A delay line of so many samples, every second, and coloured noise that a slower clock hands on."""
    line = tuple[(Annotated[float, Real("1", "on its way")],) * samples]  # type: ignore[misc]
    chain_state = NamedTuple(  # noqa: UP014, the length is known here only
        "ChainState",
        [
            ("line", line),
            ("walk", Annotated[float, Real("1", "coloured noise")]),
            ("relayed", Annotated[float, Real("1", "as read")]),
        ],
    )

    def step(x: Any, u: ChainInputs, _p: Any, _c: Any, w: tuple[Any, ...]) -> Any:
        return x._replace(line=(u.level, *x.line[:-1]), walk=0.5 * x.walk + w[0])

    def relay(x: Any, _u: Any, _p: Any, _c: Any, _w: Any) -> Any:
        return x._replace(relayed=x.walk)

    return Model(
        name="Chain",
        description="a delay line and a relay",
        Parameters=ChainParameters,
        Coefficients=ChainCoefficients,
        Inputs=ChainInputs,
        State=chain_state,
        Outputs=ChainOutputs,
        coefficients=lambda p: ChainCoefficients(p.slow),
        initial_state=lambda _p, _c, _u: chain_state((0.0,) * samples, 0.0, 0.0),  # type: ignore[call-arg]
        outputs=lambda x, _p, _c: ChainOutputs(x.line[-1], x.walk, x.relayed),
        clocks=(Clock("each", lambda _c: 1.0), Clock("slow", lambda c: c.slow)),
        tasks=(Task("step", "each", step, normals=1), Task("relay", "slow", relay)),
        seed=lambda _p: 0,
    )
