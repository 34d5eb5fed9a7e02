"""Loops of signals that all need each other within one step."""

from __future__ import annotations

from graphlib import CycleError, TopologicalSorter
from typing import Any

import control as ct  # type: ignore[import-untyped]
import numpy as np
from numpy.typing import NDArray

from ..errors import SystemRefusedError
from .fmu_systems import FmuSystem
from .nonlinear import ModelSystem

Truths = NDArray[np.bool_]


def refuse_algebraic_loop(system: ct.InputOutputSystem) -> None:
    """Raise `SystemRefusedError` if signals run in a circle through systems that all answer within the step.

    python-control finds that out in the first step of a simulation, and does not say where. Interconnections within
    the interconnection are looked into. Of a nonlinear system with an output function, unless it is one of ours, it is
    assumed that every output answers every input at once.

    >>> import control
    >>> from attitude_fmu.cosim.control import fmu_nlsys
    >>> with fmu_nlsys("dist/TripodGimbal.fmu", 0.001, "motor_torque.yaw", {"joint.yaw": "angle"}) as gimbal:
    ...     refuse_algebraic_loop(control.feedback(gimbal, 10.0))  # the gimbal answers after the step: no loop
    """
    _answers(system)


def _answers_within(system: ct.InterconnectedSystem) -> Truths:
    """Which outputs (rows) of an interconnection answer which of its inputs at once.

    With u = M w + K y of the parts and y = F u, where F is what the parts answer: u = (1 + KF + KFKF + ...) M w.
    """
    answered = _parts(system)
    onward = (system.connect_map != 0.0) @ answered
    order = _order(system, onward)
    reached = system.input_map != 0.0
    for place in order:
        reached[place] |= onward[place] @ reached
    return np.asarray((system.output_map != 0.0) @ np.vstack((answered @ reached, reached)))


def _order(system: ct.InterconnectedSystem, onward: Truths) -> list[int]:
    """The inputs of all parts, each after those that it follows within the step."""
    graph: dict[int, list[int]] = {place: np.flatnonzero(row).tolist() for place, row in enumerate(onward)}
    try:
        return list(TopologicalSorter(graph).static_order())
    except CycleError as error:
        names = [f"{part.name}.{label}" for part in system.syslist for label in part.input_labels]
        raise SystemRefusedError(
            f"algebraic loop: {' -> '.join(names[place] for place in error.args[1])}. Each of these answers its input "
            "within the same step. Make an FMU among them with coupling_delay=1, as a master of Jacobi order has it, "
            f"or put one step of delay in: control.tf([1], [1, 0], {system.dt})"
        ) from None


def _parts(system: ct.InterconnectedSystem) -> Truths:
    """Which outputs of all parts (rows) answer which inputs of theirs at once."""
    found = np.zeros(system.connect_map.shape[::-1], np.bool_)
    row = column = 0
    for part in system.syslist:
        found[row : row + part.noutputs, column : column + part.ninputs] = _answers(part)
        row, column = row + part.noutputs, column + part.ninputs
    return found


def _answers(part: Any) -> Truths | bool:
    if isinstance(part, FmuSystem):
        return not part.coupling_delay
    if isinstance(part, ModelSystem):
        return False
    if isinstance(part, ct.StateSpace):
        return np.asarray(part.D != 0.0)
    if isinstance(part, ct.InterconnectedSystem):
        return _answers_within(part)
    return part.outfcn is not None
