"""Controllers of python-control as FMUs.

`to_fmu` writes a system's matrices down as the data of a `linear_controller`, in a module of its own that the FMU
carries, and builds it like any other model.
"""

from __future__ import annotations

import keyword
import os
import re
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from sys import path as search_path
from typing import Any

import control  # type: ignore[import-untyped]
import numpy as np

from attitude_fmu.fmu_src.build import Platforms, build
from attitude_fmu.fmu_src.catalogue import Entry, Kind
from attitude_fmu.models.linear_controller import NO_LIMIT, Controller, Signal

from ..errors import ExportRefusedError, ResultsError
from .conditioning import Array, anti_windup_gain, bumpless_gain
from .realisation import discrete_state_space
from .signal_names import Named, check_keys, check_names, matching, named, unit_of

Limit = float | tuple[float | None, float | None]
"""The largest magnitude, or the smallest and the largest value, None where there is none."""

Numbers = float | Sequence[float]

_MODULE = "controller_data"
_RESERVED = (
    *("A", "B", "C", "D", "anti_windup_gain", "bumpless_gain", "initial_state", "input_offset", "output_offset"),
    *("lower_limit", "upper_limit", "enabled", "reset", "tracking", "saturated", "refused_calls"),
    *("coefficient", "state"),
)
_RESERVED_STATES = ("output", "enabled")


def to_fmu(
    sys: Any,
    path: Path | str,
    kind: Kind = "native",
    *,
    platforms: Platforms = "host",
    name: str | None = None,
    **options: Any,
) -> Path:
    """Write a linear controller as an FMU into the file `path`, whole or not at all; gives the path.

    `sys` is a ``control.StateSpace`` or ``TransferFunction``, of one or several inputs and outputs. `kind` is
    "native", compiled for the host's or "all" `platforms`, or "python": same variables, same bits. The model is called
    `name`, else like the file. `options` are those of `controller_of`.

    Tick k = 1, 2, ... is at ``start + k dt``. It reads the inputs that hold then and gives y[k-1] of
    ``control.forced_response`` for what it reads until the next tick: of a StateSpace to 1e-12 of the largest output,
    of a TransferFunction as closely as the two realisations agree, whose rounding grows with poles that lie close
    together. A master that sets the inputs of t[k] and steps dt finds at t[k+1] the response to them: the FMU is
    K(z) / z to a Jacobi master of step dt.

    Raises `ExportRefusedError` for a system or options that make no controller, `BuildError`, and `ResultsError` for
    a file that cannot be written.

    >>> import control
    >>> integral = control.tf([0.2], [1, -1], 0.01, inputs="speed error [rad/s]")
    >>> to_fmu(integral, "out/SpeedIntegral.fmu", outputs="torque [N.m]", limits=0.5).name
    'SpeedIntegral.fmu'
    """
    target = Path(path)
    identifier = _identifier(target)
    controller = controller_of(sys, name=name or target.stem, **options)
    entry = Entry(identifier, _MODULE, step_size=controller.period, about=_about(controller))
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".attitude_fmu_", dir=target.parent) as place:
            folder = Path(place)
            (folder / f"{_MODULE}.py").write_text(_module_text(controller), encoding="utf-8")
            with _importable(folder):
                built = build(entry, folder, kind, platforms)
            os.replace(built, target)
    except OSError as error:
        raise ResultsError(f"{target} could not be written: {error.strerror or error}") from error
    return target


def controller_of(
    sys: Any,
    *,
    name: str = "Controller",
    dt: float | None = None,
    method: str = "tustin",
    prewarp_frequency: float | None = None,
    inputs: Sequence[str] | str | None = None,
    outputs: Sequence[str] | str | None = None,
    units: Mapping[str, str] | None = None,
    limits: Limit | Mapping[str, Limit] | None = None,
    anti_windup: Any = "conditioned",
    X0: Numbers = 0.0,
    u0: Numbers = 0.0,
    y0: Numbers = 0.0,
) -> Controller:
    """The data of a controller: y = y0 + K(z) (u - u0) within limits; `linear_controller` makes it a model.

    =====================  ===========================================================================================
    `dt`                   s; for a continuous `sys`, which is sampled by `method`, one of ``control.sample_system``,
                           with `prewarp_frequency` (rad/s), and for one without a sampling time (dt=True)
    `inputs`, `outputs`    structured FMI names; without them legal names are made of the labels of `sys`
    `units`                by name, by label, or by the record or vector that a signal lies in; a unit at the end of a
                           name or label, as in ``torque [N.m]``, is read; without either 1
    `limits`               of the outputs: of all, or by name as `units`
    `anti_windup`          "conditioned" (`anti_windup_gain`), "none", or the matrix L, states x outputs, of
                           ``x+ = A x + B u + L (y - v)``, where v is the output before its limits; for a state
                           estimator with feedback, ``xhat+ = F xhat + G z, y = -K xhat``, L is the plant's B
    `X0`                   state at the start and after a reset
    `u0`, `y0`             operating point
    =====================  ===========================================================================================

    Raises `ExportRefusedError`.

    >>> import control
    >>> lead = control.tf([10, 1], [0.1, 1])
    >>> controller_of(lead, dt=0.01, limits=(0, None), units={"y": "N.m"}).outputs[0].unit
    'N.m'
    """
    system = discrete_state_space(sys, dt, method, prewarp_frequency)
    A, B, C, D = (np.asarray(matrix, float) for matrix in (system.A, system.B, system.C, system.D))
    u, y = named(_labels(inputs, system.input_labels)), named(_labels(outputs, system.output_labels))
    given_units = units or {}
    check_keys(given_units, [*u, *y], "units")
    check_keys(limits if isinstance(limits, Mapping) else (), y, "limits")
    of_inputs = _signals("input", u, _numbers(u0, len(u), "u0"), given_units)
    of_outputs = [
        _limited(signal, matching(label, limits) if isinstance(limits, Mapping) else limits)
        for signal, label in zip(_signals("output", y, _numbers(y0, len(y), "y0"), given_units), y, strict=True)
    ]
    states = _signals("state", named(system.state_labels), _numbers(X0, len(A), "X0"), {})
    check_names({"input": of_inputs, "output": of_outputs}, _RESERVED)
    check_names({"state": states}, _RESERVED_STATES)
    return Controller(
        name,
        f"Discrete linear controller of order {len(A)}, {_count(u, 'input')}, {_count(y, 'output')}, "
        f"every {system.dt:.9g} s",
        float(system.dt),
        tuple(of_inputs),
        tuple(of_outputs),
        tuple(states),
        _rows(A),
        _rows(B),
        _rows(C),
        _rows(D),
        _rows(_anti_windup(anti_windup, A, B, C, D, isinstance(sys, control.TransferFunction))),
        _rows(bumpless_gain(A, C)),
    )


def _count(signals: Sequence[Named], what: str) -> str:
    return f"{len(signals)} {what}{'s' if len(signals) > 1 else ''}"


def _labels(given: Sequence[str] | str | None, own: Sequence[str]) -> Sequence[str]:
    if given is None:
        return own
    labels = [given] if isinstance(given, str) else list(given)
    if len(labels) != len(own):
        raise ExportRefusedError(f"{len(labels)} names were given for {len(own)} signals ({', '.join(own)})")
    return labels


def _numbers(given: Numbers, size: int, what: str) -> list[float]:
    try:
        values = np.asarray(given, float)
    except (TypeError, ValueError):
        raise ExportRefusedError(f"{what} = {given!r}: not a number for each of {size} signals") from None
    if values.ndim and values.size != size:
        raise ExportRefusedError(f"{what} has {values.size} numbers, {size} are wanted, or one for all")
    if not np.isfinite(values).all():
        raise ExportRefusedError(f"{what} = {given!r}: not finite numbers")
    return [float(value) for value in np.broadcast_to(values.reshape(-1) if values.ndim else values, size)]


def _signals(kind: str, names: Sequence[Named], offsets: Sequence[float], units: Mapping[str, str]) -> list[Signal]:
    return [
        Signal(
            one.name,
            "1" if kind == "state" else unit_of(one, units),
            kind if one.label == one.name else f"{kind} {one.label}",
            offset,
        )
        for one, offset in zip(names, offsets, strict=True)
    ]


def _limited(signal: Signal, limit: Any) -> Signal:
    """The output with its limits."""
    if limit is None:
        return signal
    try:
        low, high = limit if isinstance(limit, Sequence) else (-limit, limit)
        low, high = (-NO_LIMIT if low is None else float(low), NO_LIMIT if high is None else float(high))
    except (TypeError, ValueError):
        raise ExportRefusedError(
            f"limits of {signal.name} = {limit!r}: give the largest magnitude, or (lower, upper) with None for none"
        ) from None
    if not low <= high:
        raise ExportRefusedError(f"limits of {signal.name}: {low:.9g} is not below {high:.9g}")
    return signal._replace(lower=max(low, -NO_LIMIT), upper=min(high, NO_LIMIT))


def _anti_windup(wanted: Any, A: Array, B: Array, C: Array, D: Array, is_ours: bool) -> Array:
    shape = (len(A), len(C))
    if isinstance(wanted, str):
        if wanted not in ("conditioned", "none"):
            raise ExportRefusedError(f"anti_windup = {wanted!r}: give 'conditioned', 'none' or a matrix")
        return anti_windup_gain(A, B, C, D) if wanted == "conditioned" else np.zeros(shape)
    if is_ours:
        raise ExportRefusedError(
            "anti_windup is a matrix, but the states of a transfer function are chosen here; turn it into a "
            "StateSpace first (control.ss), whose states you know"
        )
    try:
        gain = np.asarray(wanted, float)
    except (TypeError, ValueError):
        gain = np.empty(0)
    if gain.shape != shape or not np.isfinite(gain).all():
        raise ExportRefusedError(f"anti_windup: finite numbers of shape {shape} are wanted, states x outputs")
    return gain


def _rows(matrix: Array) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(value) for value in row) for row in matrix)


def _identifier(target: Path) -> str:
    name = re.sub(r"\W", "_", target.stem, flags=re.ASCII)
    if target.suffix != ".fmu" or not name.isidentifier() or keyword.iskeyword(name):
        raise ExportRefusedError(
            f"{target.name}: an FMU's file is called like its model, a letter first, and ends in .fmu; for instance "
            "RateController.fmu"
        )
    return name


def _about(controller: Controller) -> str:
    return (
        "Each tick reads the inputs that hold then, and what it gives holds until the next: seen by a master that "
        f"steps {controller.period:.9g} s, the FMU is K(z) / z. While it is not enabled, the outputs follow what is "
        "tracked; when it is, they go on from there. While reset holds, the state has its initial value at each tick. "
        "Where a limit cuts an output, the state is led by the anti-windup gain. Whoever changes the matrices changes "
        "the two gains with them."
    )


def _module_text(controller: Controller) -> str:
    """A module with the data; repr of a float reads back to the last bit."""
    lines = []
    for field, value in controller._asdict().items():
        rows = "".join(f"            {row!r},\n" for row in value) if isinstance(value, tuple) else ""
        lines.append(f"        {field}=(\n{rows}        ),\n" if rows else f"        {field}={value!r},\n")
    return f'''"""{controller.description}: its data. Written by attitude-fmu."""

from attitude_fmu.models.linear_controller import Controller, Signal, linear_controller

MODEL = linear_controller(
    Controller(
{"".join(lines)}    )
)
'''


@contextmanager
def _importable(folder: Path) -> Iterator[None]:
    """Modules in the folder are found first, by this process and those that it starts."""
    search_path.insert(0, str(folder))
    try:
        yield
    finally:
        search_path.remove(str(folder))
