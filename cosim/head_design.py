"""The stabilised head designed for one sensor: both controllers, their loops, and the FMUs made of them.

What goes from here to tables and pictures is numbers only, so that it can be worked out in processes of their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

import control  # type: ignore[import-untyped]
import numpy as np

from attitude_fmu.models.gimbal_controller import Parameters

from .control.conditioning import Array
from .control.delays import Delay, delay_budget, register_response
from .control.export import to_fmu
from .control.head_lqg import lqg_design
from .control.head_models import (
    AXES,
    LINE,
    READINGS,
    TORQUE,
    Clocks,
    PlantModel,
    held_motion,
    moving_friction,
    plant_model,
    sensor_model,
)
from .control.head_pid import pid_controller, pid_design
from .control.margins import Margins
from .control.operating_point import OperatingPoint
from .control.responses import Complex
from .control.stabilised_head import (
    CAUSES,
    Controller,
    Head,
    Loop,
    check_gusts,
    closed_loop,
    exposure_jitter,
    grid,
    head_of,
)

UNITS = {"rate_measured": "rad/s", "specific_force_measured": "m/s2", "joint": "rad", TORQUE: "N.m"}
"""Of a controller's signals."""

SIGNALS = (
    *[f"{reading}[{i}]" for reading in READINGS for i in (1, 2, 3)],
    *[f"joint.{axis}" for axis in AXES],
)
"""What controllers may read: gyros, accelerometers, encoders."""

_DIGITS = 12
"""Of an operating point's readings, the rest is what solving for it leaves."""

TORQUE_LIMIT = Parameters().torque_limit.yaw
"""N.m; of the motors."""


class Sensor(NamedTuple):
    """A sensor to design for: how it is called in tables, its FMU, and parameters that differ from that FMU's own."""

    label: str
    fmu: str
    parameters: Mapping[str, float]


class Design(NamedTuple):
    """One controller: its loop in numbers, and its FMU.

    Jitters (rad) and densities (rad2/Hz, frequencies x axes) are of yaw, pitch and roll. `whole` is the jitter of the
    controller before its reduction to `order` states, `own_radius` its largest eigenvalue.
    """

    kind: str
    fmu: Path
    inputs: tuple[str, ...]
    order: int
    own_radius: float
    jitter: Array
    whole: Array
    causes: Mapping[str, Array]
    spectrum: Array
    single: Complex
    compliance: Array
    margins: tuple[Margins, ...]
    disk: Array


class Designs(NamedTuple):
    """All of a sensor: the held head's predicted jitter, both controllers, the delays on the way of the pitch rate."""

    sensor: Sensor
    clocks: Clocks
    frequencies: Array
    held: Array
    held_spectrum: Array
    free_compliance: Array
    controllers: tuple[Design, ...]
    delays: tuple[Delay, ...]


def design_head(
    sensors: tuple[Sensor, ...], clocks: Clocks, plant_parameters: Mapping[str, float], folder: Path
) -> list[Designs]:
    """Design for sensors of the same clocks, and write the controllers into a folder.

    Raises `LinearisationRefusedError` where the models or their loops allow none, `BuildError` from building FMUs.
    """
    f = grid(clocks)
    at_rest = plant_model(clocks, plant_parameters)
    held = held_motion(at_rest, clocks, f)
    # a head that holds its line of sight turns its joints by what it would else swing
    friction = moving_friction(at_rest.point, f, held)
    plant = plant_model(clocks, {**plant_parameters, **friction.parameters})
    found = []
    for sensor in sensors:
        model = sensor_model(sensor.fmu, clocks, sensor.parameters, plant.point)
        head = head_of(plant, model, clocks, friction)
        pid = pid_controller(pid_design(head), clocks.period)
        lqg = lqg_design(head, friction)
        loops = {"PID": (pid, closed_loop(head, pid), None), "LQG": (lqg.controller, lqg.loop, lqg.whole)}
        designs = tuple(
            _design(kind, controller, loop, whole, plant, folder / f"{kind.title()}_{sensor.label}.fmu")
            for kind, (controller, loop, whole) in loops.items()
        )
        register = register_response(model, clocks, {**sensor.parameters}, f)
        delays = delay_budget(head, AXES.index("pitch"), designs[-1].margins[1].crossover, register)
        motion = exposure_jitter(held, head)
        found.append(Designs(sensor, clocks, f, motion, held, _free_compliance(head), designs, tuple(delays)))
    return found


def _free_compliance(head: Head) -> Array:
    """|angle/torque| (rad/N.m) of each axis with the motors off: frequencies x axes."""
    return np.abs(np.diagonal(head.mean.torque[:, LINE], axis1=1, axis2=2))


def _design(kind: str, controller: Controller, loop: Loop, whole: Loop | None, plant: PlantModel, path: Path) -> Design:
    check_gusts(loop.head, controller)
    fmu, inputs = _exported(controller, plant.point, path)
    causes = {cause: loop.jitter(cause) for cause in CAUSES}
    return Design(
        kind,
        fmu,
        inputs,
        len(controller.A),
        float(np.abs(np.linalg.eigvals(controller.A)).max()),
        loop.jitter(),
        (whole or loop).jitter(),
        causes,
        loop.spectrum,
        loop.single,
        np.abs(np.diagonal(loop.responses.by_torque, axis1=1, axis2=2)),
        loop.margins,
        loop.disk,
    )


def _exported(controller: Controller, point: OperatingPoint, path: Path) -> tuple[Path, tuple[str, ...]]:
    """The controller as an FMU about the plant's operating point, with the inputs that it uses."""
    A, B, C, D, anti_windup = controller
    used = np.flatnonzero(np.any(B != 0.0, axis=0) | np.any(D != 0.0, axis=0))
    at = np.array([*point.outputs.rate, *point.outputs.specific_force, *point.outputs.joint])
    inputs = tuple(SIGNALS[i] for i in used)
    system = control.ss(A, B[:, used], C, D[:, used], point.dt, remove_useless_states=False)
    to_fmu(
        system,
        path,
        inputs=inputs,
        outputs=[f"{TORQUE}.{axis}" for axis in AXES],
        units={name: unit for name, unit in UNITS.items() if any(one.startswith(name) for one in (*inputs, TORQUE))},
        limits=TORQUE_LIMIT,
        anti_windup=anti_windup,
        u0=np.round(at[used], _DIGITS).tolist(),
        y0=list(point.inputs.motor_torque),
    )
    return path, inputs
