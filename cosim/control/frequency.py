"""The frequency response of any co-simulation FMU, measured by running it, with how far it can be trusted.

    G(w) = Y(w)/U(w)       lines of whole periods, after the transient, one input at a time

An FMU moved by a sum of sines answers all frequencies in one run; by single sines, one after the other, it answers each
with all of the amplitude. What is measured is the sampled system from inputs held over a step to the outputs read
between steps: what a digital controller at that rate sees.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import control as ct  # type: ignore[import-untyped]
import numpy as np
from numpy.typing import NDArray

from attitude_fmu.fmu_src.errors import did_you_mean

from ..errors import SystemRefusedError
from ..interface import Value, Variable
from ..multisine import Bins, Measured, is_settling, measured, multisine, odd_bins
from .driven_fmu import Array, DrivenFmu, Signals

Method = Literal["multisine", "stepped"]
Progress = Callable[[float], None]
"""Called with the share of the whole that is done."""

_LINES = 40
"""Frequencies that are measured where none are named."""
_LOWEST_BIN = 5
"""Turns of the lowest sine in a period: near it, the lines of odd number lie at least so close."""
_DEFAULT_PERIOD = 1000
"""Steps of a period where nothing says how long it is to be."""
_STEPPED_TURNS = 6
_STEPPED_STEPS = 48
"""Least turns and steps of a record of a single sine."""
_SHARE_OF_RANGE = 0.01
_SETTLED = 0.005
"""Relative change of the response from the first measured period to the last that is not spoken of."""


class Distortion(NamedTuple):
    """rms size of the lines without a sine over that of the lines with one, (outputs, inputs): what even and odd
    nonlinearity put there, and the noise that is left in the mean of the periods.

    A linear system has `even` and `odd` no larger than `noise`.
    """

    even: Array
    odd: Array
    noise: Array


class MeasuredFrequencyResponse(ct.FrequencyResponseData):  # type: ignore[misc]
    """A measured response: `coherence` and `standard_error` (outputs, inputs, frequencies), `distortion`, `amplitude`.

    The standard error is sqrt(E|G - true|^2) of the complex response, from the scatter of its N records, which are
    periods times realisations. Gain (relative) and phase (rad) have 1/sqrt(2) of it each:
    ``standard_error/abs(frdata)/sqrt(2)``. Coherence is 1/N on average where nothing follows the input; one realisation
    does not show nonlinearity in it, which repeats with the period. Both are NaN with one record.
    `amplitude` (inputs,) is the largest value that each input was moved by.

    >>> found = fmu_frd("dist/GimbalController.fmu", 0.002, [30, 100], "euler.yaw", "motor_torque.yaw", amplitude=1e-3)
    >>> found.coherence.shape, found.standard_error.shape, found.distortion.odd.shape
    ((1, 1, 2), (1, 1, 2), (1, 1))
    """

    def __init__(
        self,
        frdata: NDArray[np.complex128],
        omega: Array,
        dt: float,
        coherence: Array,
        standard_error: Array,
        distortion: Distortion,
        amplitude: Array,
        **names: Any,
    ) -> None:
        super().__init__(frdata, omega, dt, **names)
        self.coherence = coherence
        self.standard_error = standard_error
        self.distortion = distortion
        self.amplitude = amplitude

    def __call__(self, x: Any = None, squeeze: bool | None = None, return_magphase: bool | None = None) -> Any:
        """The response at points z = exp(j w dt), straight lines between the measured ones, held beyond the last.

        At points j w, which python-control's own class wants for any dt, w has to be a measured frequency.
        """
        points = np.atleast_1d(0.0 if x is None else x)
        if np.any(np.abs(np.abs(points) - 1.0) > 1e-9) or not np.any(np.real(points)):
            return super().__call__(x, squeeze=squeeze, return_magphase=return_magphase)
        omega = np.angle(points) / self.dt
        flat = self.frdata.reshape(-1, len(self.omega))
        values = np.array([np.interp(np.abs(omega), self.omega, row) for row in flat])
        values = np.where(omega < 0.0, values.conj(), values).reshape(*self.frdata.shape[:2], -1)
        if squeeze is False or not (squeeze or self.issiso()):
            return values
        return np.squeeze(values) if squeeze or np.ndim(x) == 0 else values[0, 0]

    def __getitem__(self, key: Any) -> MeasuredFrequencyResponse:
        part = super().__getitem__(key)
        rows = [self.output_labels.index(label) for label in part.output_labels]
        columns = [self.input_labels.index(label) for label in part.input_labels]
        table = np.ix_(rows, columns)
        return MeasuredFrequencyResponse(
            part.frdata,
            self.omega,
            self.dt,
            self.coherence[table],
            self.standard_error[table],
            Distortion(*[values[table] for values in self.distortion]),
            self.amplitude[columns],
            inputs=part.input_labels,
            outputs=part.output_labels,
            name=part.name,
        )


class _Sines(NamedTuple):
    """A record: so many steps, lines with a sine on them."""

    length: int
    bins: Bins

    def omega(self, dt: float) -> Array:
        return np.asarray(2.0 * np.pi * self.bins / (self.length * dt))


def fmu_frd(
    path: Path | str,
    dt: float,
    omega: Sequence[float] | Array | None = None,
    inputs: Signals = None,
    outputs: Signals = None,
    parameters: Mapping[str, Value] | None = None,
    name: str | None = None,
    *,
    method: Method = "multisine",
    amplitude: float | Mapping[str, float] | None = None,
    period: float | None = None,
    periods: int = 3,
    realisations: int = 2,
    transient: float | None = None,
    settle: float = 0.0,
    coupling_delay: int = 1,
    seed: int = 1,
    progress: Progress | None = None,
) -> MeasuredFrequencyResponse:
    """G(w) = Y(w)/U(w): the response of a co-simulation FMU with steps of `dt` (s), measured by running it.

    `omega` (rad/s) are wanted frequencies, 40 by default; each is moved to the nearest one whose turns are whole in a
    period, and `frequency` of the result tells which. `inputs`, `outputs` and `parameters` are as for `fmu_nlsys`;
    inputs stay at their start values, which `parameters` may change, but for the one that is moved. First the FMU runs
    `settle` (s) so; each record then begins with `transient` (s) that is not used, by default one period of the sum of
    sines, or as long as the slowest sine's record.

    `method` "multisine": random phases on odd lines of a period of `period` (s; by default five turns of the lowest
    frequency), so that even lines and odd ones left out show nonlinearity (`distortion`). "stepped": one sine after
    the other. Either way `periods` are measured and the whole is done `realisations` times with new phases drawn from
    `seed`. Without pauses: noise in the FMU is new each time, and averaged.

    `amplitude`, the largest deviation from the start value, is one number or one for each name; by default a hundredth
    of the range that the FMU declares, or of the nominal value, else 1. `coupling_delay` is that of `fmu_nlsys`.
    `progress` hears of the share that is done.

    Warns where the response still changes from the first measured period to the last, by more than 0.5 % and in another
    way than noise: the transient has not died. With fewer than three periods this cannot be told.

    Raises `SystemRefusedError` for what cannot be measured, `RunStoppedError` when the FMU fails.

    >>> import control
    >>> plant = fmu_frd(
    ...     "dist/TripodGimbal.fmu", 0.001, [20, 50, 100, 300, 1000], "motor_torque.yaw", "joint_rate.yaw",
    ...     {"wind.speed": 0.0}, amplitude=0.001, realisations=1,
    ... )
    >>> plant.coherence.shape
    (1, 1, 5)
    >>> closed = control.feedback(plant, 0.01)
    """
    _check(method, periods, realisations, coupling_delay)
    with DrivenFmu(path, dt, inputs, outputs, parameters) as fmu:
        if not fmu.inputs or not fmu.outputs:
            raise SystemRefusedError(f"{fmu.path.name} has no {'outputs' if fmu.inputs else 'inputs'} to measure")
        plan = _plan(method, fmu.dt, omega, period)
        sizes = _amplitudes(fmu, amplitude)
        bench = _Bench(fmu, periods, realisations, transient, coupling_delay, np.random.default_rng(seed))
        bench.rest(settle)
        done = 0.0
        total = float(sum(sines.length for sines in plan) * len(sizes))
        longest = max(sines.length for sines in plan)
        table: list[list[Measured]] = []
        for place, size in enumerate(sizes):
            table.append([])
            for sines in plan:
                table[-1].append(bench.measure(place, size, sines, longest))
                done += sines.length / total
                if progress is not None:
                    progress(done)
        names = {
            "inputs": [port.label for port in fmu.inputs],
            "outputs": [port.label for port in fmu.outputs],
            "name": name or fmu.path.stem.replace(".", "_"),
        }
        found = _result(table, plan, fmu.dt, sizes, names)
        _warn_of_settling(table, found, realisations, periods, bench.unused(longest) * dt)
        return found


def _result(
    table: list[list[Measured]], plan: list[_Sines], dt: float, sizes: Array, names: dict[str, Any]
) -> MeasuredFrequencyResponse:
    def over_frequency(field: str) -> Any:
        columns = [np.concatenate([getattr(one, field) for one in row]) for row in table]
        return np.moveaxis(np.array(columns), (0, 1, 2), (1, 2, 0))

    def worst(field: str) -> Array:
        return np.array([np.max([getattr(one, field) for one in row], axis=0) for row in table]).T

    return MeasuredFrequencyResponse(
        over_frequency("response"),
        np.concatenate([sines.omega(dt) for sines in plan]),
        dt,
        over_frequency("coherence"),
        np.sqrt(over_frequency("variance")),
        Distortion(worst("even"), worst("odd"), worst("noise")),
        sizes,
        **names,
    )


def _warn_of_settling(
    table: list[list[Measured]], found: MeasuredFrequencyResponse, realisations: int, periods: int, transient: float
) -> None:
    if periods < 3:
        return
    worst, where = 0.0, ""
    for row, label in zip(table, found.input_labels, strict=True):
        change, share = (np.concatenate([getattr(one, field) for one in row]) for field in ("change", "change_share"))
        for output, size in enumerate(np.sqrt(np.mean(change**2, axis=0))):
            if size > max(worst, _SETTLED) and is_settling(share[:, output], realisations, periods):
                worst, where = float(size), f"{found.output_labels[output]} from {label}"
    if where:
        warnings.warn(
            f"{found.name}: the response of {where} changes by {100.0 * worst:.2g} % from the first measured period to "
            f"the last: what went before has not died after {transient:.6g} s, or the output drifts. Give a longer "
            "transient (s), and settle (s) if the FMU is not at rest at its start values",
            stacklevel=3,
        )


def _check(method: str, periods: int, realisations: int, coupling_delay: int) -> None:
    if method not in get_args(Method):
        raise SystemRefusedError(f"method = {method!r}: one of {', '.join(get_args(Method))}")
    if periods < 1 or realisations < 1:
        raise SystemRefusedError(f"periods = {periods}, realisations = {realisations}: at least 1 each")
    if coupling_delay not in (0, 1):
        raise SystemRefusedError(f"coupling_delay = {coupling_delay}: 0 or 1")


def _plan(method: Method, dt: float, omega: Sequence[float] | Array | None, period: float | None) -> list[_Sines]:
    """The records to make, of rising frequency."""
    wanted = None if omega is None else np.unique(np.asarray(omega, np.float64))
    nyquist = math.pi / dt
    if wanted is not None and not (wanted.size and wanted[0] > 0.0 and wanted[-1] < nyquist):
        raise SystemRefusedError(
            f"omega: frequencies between 0 and {nyquist:.6g} rad/s are wanted, half the sampling rate of dt = {dt} s"
        )
    length = _length(dt, wanted, period)
    if wanted is None:
        bins = odd_bins(length, 1, length, _LINES)
    else:
        exact = wanted * length * dt / (2.0 * np.pi)
        bins = np.unique(2 * np.round((exact - 1.0) / 2.0).astype(np.int64) + 1)
    bins = bins[(bins >= 1) & (2 * bins < length)]
    if not bins.size:
        raise SystemRefusedError(f"period = {length * dt:.6g} s: too short for these frequencies; give a longer one")
    if method == "multisine":
        return [_Sines(length, bins)]
    return list(_stepped(dt, _Sines(length, bins).omega(dt) if wanted is None else wanted))


def _length(dt: float, wanted: Array | None, period: float | None) -> int:
    if period is not None:
        if not 4.0 * dt <= period < math.inf:
            raise SystemRefusedError(f"period = {period} s: at least four steps of {dt} s are wanted")
        return round(period / dt)
    if wanted is None:
        return _DEFAULT_PERIOD
    return max(4, math.ceil(_LOWEST_BIN * 2.0 * math.pi / (float(wanted[0]) * dt)))


def _stepped(dt: float, wanted: Array) -> Iterator[_Sines]:
    before = 0.0
    for omega in wanted:
        turns = max(_STEPPED_TURNS, math.ceil(_STEPPED_STEPS * omega * dt / (2.0 * math.pi)))
        sines = _Sines(max(2 * turns + 1, round(turns * 2.0 * math.pi / (omega * dt))), np.array([turns]))
        reached = float(sines.omega(dt)[0])
        if reached > before:
            before = reached
            yield sines


def _amplitudes(fmu: DrivenFmu, given: float | Mapping[str, float] | None) -> Array:
    names = [port.variable.name for port in fmu.inputs]
    if isinstance(given, Mapping):
        unknown = next((name for name in given if name not in names), None)
        if unknown is not None:
            raise SystemRefusedError(
                f"amplitude: no input that is moved is called {unknown!r}{did_you_mean(unknown, names)}"
            )
        by_name = given
    else:
        by_name = {} if given is None else dict.fromkeys(names, given)
    chosen = np.array([by_name.get(port.variable.name, _natural_amplitude(fmu, port.variable)) for port in fmu.inputs])
    for name, size, port in zip(names, chosen, fmu.inputs, strict=True):
        if port.variable.type != "Real":
            raise SystemRefusedError(
                f"{name} is of type {port.variable.type}: only real inputs have a frequency response"
            )
        if not 0.0 < size < math.inf:
            raise SystemRefusedError(f"amplitude of {name} = {size}: a positive number is wanted")
    return chosen


def _natural_amplitude(fmu: DrivenFmu, variable: Variable) -> float:
    if variable.minimum is not None and variable.maximum is not None:
        return _SHARE_OF_RANGE * (variable.maximum - variable.minimum)
    declared = next(v for v in fmu.interface.description.modelVariables if v.name == variable.name)
    return _SHARE_OF_RANGE * abs(float(declared.nominal)) if declared.nominal else 1.0


class _Bench:
    """Moves one input of an FMU at a time, from where it is; the steps go on and on."""

    def __init__(
        self,
        fmu: DrivenFmu,
        periods: int,
        realisations: int,
        transient: float | None,
        coupling_delay: int,
        chance: np.random.Generator,
    ) -> None:
        self._fmu = fmu
        self._periods, self._realisations = periods, realisations
        self._transient = transient
        self._coupling_delay = coupling_delay
        self._chance = chance
        self._steps = 0

    def rest(self, duration: float) -> None:
        """Run (s) with the inputs at their start values."""
        self._run(np.tile(self._fmu.start_inputs, (round(duration / self._fmu.dt), 1)))

    def unused(self, longest: int) -> int:
        """Steps before a record; `longest` is the longest record of all."""
        return longest if self._transient is None else round(self._transient / self._fmu.dt)

    def measure(self, place: int, size: float, sines: _Sines, longest: int) -> Measured:
        """The response to sines on one input; `longest` is the longest record of all, in steps."""
        unused = self.unused(longest)
        shape = (self._realisations, self._periods, sines.length)
        given = np.empty(shape)
        shown = np.empty((*shape, len(self._fmu.outputs)))
        for number in range(self._realisations):
            wave = size * multisine(sines.length, sines.bins, self._chance.uniform(0.0, 2.0 * np.pi, len(sines.bins)))
            given[number] = wave
            steps = np.arange(-unused, self._periods * sines.length) % sines.length
            inputs = np.tile(self._fmu.start_inputs, (len(steps), 1))
            inputs[:, place] += wave[steps]
            shown[number] = self._run(inputs)[unused:].reshape(shown[number].shape)
        return measured(given, shown, sines.bins)

    def _run(self, inputs: Array) -> Array:
        shown = self._fmu.run(self._steps, inputs, self._coupling_delay)
        self._steps += len(inputs)
        return shown
