"""Any co-simulation FMU that can save its state, as a nonlinear system of python-control.

    x[k+1] = F(x[k], u[k]),  y[k] = G(x[k])        one communication step of the FMU, dt long, its inputs held

The state of an FMU has no numbers that mean anything outside of it, so x is one number that stands for a whole state: 0
for the state after initialisation, others as they are reached. A number always means the same state, equal numbers are
equal states, and from the same number and input comes the same number again.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import control as ct  # type: ignore[import-untyped]
import numpy as np
from scipy.linalg import expm  # type: ignore[import-untyped]

from ..errors import LinearisationRefusedError, SystemRefusedError
from ..interface import Value
from .driven_fmu import Array, DrivenFmu, Signals
from .fmu_states import FmuStates


class FmuSystem(ct.NonlinearIOSystem):  # type: ignore[misc]
    """An FMU as `control.NonlinearIOSystem`; see `fmu_nlsys`. A context that frees the FMU.

    Threads may share it: they take turns, and go faster with a system each.

    >>> with fmu_nlsys("dist/TripodGimbal.fmu", 0.001, "motor_torque", "joint_rate") as gimbal:
    ...     state = gimbal.dynamics(0.0, [0.0], [0.0, 0.01, 0.0])
    ...     carried = gimbal.state_from(gimbal.state_bytes(state))
    ...     bool((gimbal.output(0.0, carried, [0.0] * 3) == gimbal.output(0.0, state, [0.0] * 3)).all())
    True
    >>> gimbal.output_labels
    ['joint_rate_yaw', 'joint_rate_pitch', 'joint_rate_roll']
    """

    def __init__(self, states: FmuStates, coupling_delay: int, name: str) -> None:
        self.coupling_delay = coupling_delay
        self._states = states

        count = len(states.fmu.inputs)

        def inputs_given(u: Any) -> Array:
            given = np.asarray(u, np.float64).reshape(-1)
            if len(given) != count:
                raise SystemRefusedError(f"{name}: {len(given)} inputs given, it has {count}")
            return given

        def update(_t: float, x: Any, u: Any, _params: Any) -> Array:
            given = inputs_given(u)
            with states.lock:
                return np.array([float(states.after(states.number_of(x), given))])

        def held(_t: float, x: Any, _u: Any, _params: Any) -> Array:
            with states.lock:
                return states.shown(states.number_of(x))

        def through(_t: float, x: Any, u: Any, _params: Any) -> Array:
            given = inputs_given(u)
            with states.lock:
                return states.shown(states.after(states.number_of(x), given))

        fmu = states.fmu
        super().__init__(
            update,
            held if coupling_delay else through,
            inputs=[port.label for port in fmu.inputs],
            outputs=[port.label for port in fmu.outputs],
            states=["state"],
            dt=fmu.dt,
            name=name,
        )

    def __enter__(self) -> FmuSystem:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """End and free the FMU, that of copies as well; the system cannot be used any more."""
        with self._states.lock:
            self._states.fmu.close()

    def time(self, x: Any) -> float:
        """The FMU's own time (s) in state `x`."""
        with self._states.lock:
            return self._states.time(self._states.number_of(np.atleast_1d(x)))

    def state_bytes(self, x: Any) -> bytes:
        """State `x` as bytes, which another system of the same FMU, in another process too, takes as its own.

        Raises `SystemRefusedError` if the FMU cannot serialise its state.
        """
        self._check_serializing()
        with self._states.lock:
            return self._states.serialized(self._states.number_of(np.atleast_1d(x)))

    def state_from(self, data: bytes) -> Array:
        """The state that `state_bytes` gave.

        Raises `SystemRefusedError` if the FMU cannot serialise its state, `RunStoppedError` if it refuses these bytes.
        """
        self._check_serializing()
        with self._states.lock:
            return np.array([float(self._states.restored(data))])

    def _check_serializing(self) -> None:
        fmu = self._states.fmu
        if not fmu.can_serialize:
            raise SystemRefusedError(
                f"{fmu.path.name} can save its state but not give it as bytes (canSerializeFMUstate is false); "
                "keep the system, whose states stay valid until it is closed"
            )

    def linearize(self, x0: Any, u0: Any = None, t: float = 0.0, params: Any = None, **kwargs: Any) -> ct.StateSpace:
        """The linear system dx/dt = A x + B u, y = C x + D u at state `x0` and inputs `u0`, sampled at dt.

        A to D are the FMU's own directional derivatives; between samples u is held, so that nothing is lost by
        sampling but what the FMU's solver loses. Other arguments name the system as in `control.ss`.

        Raises `LinearisationRefusedError` for an FMU that lists no derivatives of states, as most for co-simulation do
        (ours as well): their linear models come from `model_ss` or `fmu_frd`.
        """
        fmu = self._states.fmu
        derivatives = [unknown.variable for unknown in fmu.interface.description.derivatives or []]
        if not derivatives or not fmu.interface.description.coSimulation.providesDirectionalDerivative:
            raise LinearisationRefusedError(
                f"{self.name} cannot be linearised from outside: {fmu.path.name} "
                f"{'lists no derivatives of states' if not derivatives else 'provides no directional derivatives'}. "
                "For our own models take model_ss; for any FMU measure the response with fmu_frd"
            )
        start = np.atleast_1d(x0.states if isinstance(x0, ct.OperatingPoint) else x0)
        given = x0.inputs if u0 is None and isinstance(x0, ct.OperatingPoint) else u0
        held = fmu.start_inputs if given is None else np.broadcast_to(np.asarray(given, np.float64), self.ninputs)
        variables = fmu.interface.variables
        states = [variables[derivative.derivative.name] for derivative in derivatives]
        unknowns = [variables[derivative.name] for derivative in derivatives] + [port.variable for port in fmu.outputs]
        with self._states.lock:
            number = self._states.number_of(start)
            self._states.go_to(number)
            self._states.lose_place()
            fmu.set(self._states.time(number), held)
            whole = fmu.derivatives(unknowns, [*states, *(port.variable for port in fmu.inputs)])
        return _sampled(whole, [state.name for state in states], self, kwargs)


def _sampled(whole: Array, states: list[str], system: FmuSystem, names: dict[str, Any]) -> ct.StateSpace:
    """The sampled system of [[A, B], [C, D]]; what goes straight through waits for the step as everything does."""
    order, inputs = len(states), system.ninputs
    names.pop("copy_names", None)
    transition = expm(np.vstack((whole[:order], np.zeros((inputs, order + inputs)))) * system.dt)
    A, B = transition[:order, :order], transition[:order, order:]
    C, D = whole[order:, :order], whole[order:, order:]
    if not system.coupling_delay:
        C, D = C @ A, C @ B + D
    elif np.any(D):
        A = np.block([[A, np.zeros((order, inputs))], [np.zeros((inputs, order + inputs))]])
        B, C, D = np.vstack((B, np.eye(inputs))), np.hstack((C, D)), np.zeros_like(D)
        states = states + [f"held {label}" for label in system.input_labels]
    named = {"inputs": system.input_labels, "outputs": system.output_labels, "states": states, **names}
    return ct.ss(A, B, C, D, system.dt, **named)


def fmu_nlsys(
    path: Path | str,
    dt: float,
    inputs: Signals = None,
    outputs: Signals = None,
    parameters: Mapping[str, Value] | None = None,
    name: str | None = None,
    *,
    coupling_delay: int = 1,
    start_time: float = 0.0,
    remembered: int = 100_000,
) -> FmuSystem:
    """x[k+1] = F(x[k], u[k]), y[k] = G(x[k]): a co-simulation FMU with steps of `dt` (s).

    `inputs` and `outputs` are names of variables, a stem for all its scalars, or a mapping to labels of your own; all
    inputs and outputs by default. Tunable parameters may be inputs, and whatever can be read may be an output; whole
    numbers and truths become floats. `parameters` are values by name, of parameters and of inputs at the start. The
    FMU is freed by ``close()``, at the end of a ``with`` block, or with the system.

    `coupling_delay` 1: outputs at t show what inputs before t have done, as between FMUs in a master of Jacobi order;
    there is no direct feedthrough, and no algebraic loop. 0: outputs after the step that begins at t; they follow the
    input at once, and a loop needs something in it that does not.

    Times of simulations are not looked at: a state carries its own time, that of state 0 is `start_time` (s). State 0
    and at least the `remembered` states that were used last can be come back to; each takes about 0.5 kB, and older
    ones are forgotten where there are twice as many.

    Raises `SystemRefusedError` for an FMU that cannot save its state or does not come back to it, a name that is not
    there (with what is spelt like it) or a dt that the FMU does not take; `RunStoppedError` when the FMU fails.

    >>> import control, numpy
    >>> with fmu_nlsys("dist/TripodGimbal.fmu", 0.001, inputs="motor_torque", outputs="euler") as gimbal:
    ...     time = numpy.arange(100) * gimbal.dt
    ...     response = control.input_output_response(gimbal, time, numpy.full((3, 100), 0.01))
    >>> response.outputs.shape
    (3, 100)
    """
    if coupling_delay not in (0, 1):
        raise SystemRefusedError(
            f"coupling_delay = {coupling_delay}: 0 or 1; more steps of delay are a system of their own, in series: "
            f"control.tf([1], [1, 0], {dt})"
        )
    if remembered < 1:
        raise SystemRefusedError(f"remembered = {remembered}: at least 1 state, the one that a simulation goes on from")
    fmu = DrivenFmu(path, dt, inputs, outputs, parameters, start_time)
    try:
        if not fmu.can_restore:
            raise SystemRefusedError(
                f"{fmu.path.name} cannot save its state (canGetAndSetFMUstate is false), which python-control's pure "
                "functions need; export it with saved states, or measure its response with fmu_frd, which needs none"
            )
        return FmuSystem(FmuStates(fmu, remembered), coupling_delay, name or fmu.path.stem.replace(".", "_"))
    except BaseException:
        fmu.close()
        raise
