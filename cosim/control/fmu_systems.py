"""Any co-simulation FMU that can save its state, as a nonlinear system of python-control.

    x[k+1] = F(x[k], u[k]),  y[k] = G(x[k])        one communication step of the FMU, dt long, its inputs held

The state of an FMU has no numbers that mean anything outside of it, so x is one number that stands for a whole state: 0
for the state after initialisation, others as they are reached. A number always means the same state, equal numbers are
equal states, and from the same number and input comes the same number again.
"""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import control as ct  # type: ignore[import-untyped]
import numpy as np
from scipy.linalg import expm  # type: ignore[import-untyped]

from ..errors import LinearisationRefusedError, SystemRefusedError
from ..interface import Value
from .driven_fmu import Array, DrivenFmu, Signals

START = 0
"""The number of the state after initialisation."""

_SPACING = 16
"""Steps between two states that are saved as a run goes; those between are had again by stepping."""
_RECENT = 64
"""Saved states beside the ones that stay."""
_STAYING = 16 * _SPACING
"""Steps between two saved states that stay."""

_numbers = itertools.count(START + 1)
"""Of all systems, so that none takes another's state for its own."""


class _State(NamedTuple):
    """How a state came about: from which, with which inputs, after how many steps. Without `parent` it stays saved."""

    parent: int | None
    given: bytes
    steps: int


class FmuStates:
    """The states that an FMU has been in, by number.

    Each is known by the inputs that led to it. Some are saved; to go back to another, the nearest saved one before it
    is loaded and the steps since are done again, which gives the same bits.
    """

    def __init__(self, fmu: DrivenFmu) -> None:
        self.fmu = fmu
        self._states = {START: _State(None, b"", 0)}
        self._following: dict[tuple[int, bytes], int] = {}
        self._recent: deque[int] = deque()
        self._here: int | None = START
        fmu.save(START, fmu.start_time)
        self._check_restoring()

    def __deepcopy__(self, memo: dict[int, Any]) -> FmuStates:
        # a copied system asks the same instance, which knows whose state is wanted
        return self

    def number_of(self, x: Any) -> int:
        """The number in a state vector.

        Raises `SystemRefusedError` if it is none of this FMU's states.
        """
        value = float(x[0])
        number = int(value) if value.is_integer() else -1
        if number not in self._states:
            raise SystemRefusedError(
                f"{self.fmu.name}: x = {value:.17g} is none of its states: a state is a number that stands for a saved "
                "state of the FMU, 0 for the one after initialisation; it cannot be moved a little, nor be another "
                "system's. Linear models come from model_ss (our models) or fmu_frd (any FMU)"
            )
        return number

    def after(self, number: int, given: Array) -> int:
        """The state one step later."""
        key = (number, given.tobytes())
        found = self._following.get(key)
        if found is not None:
            return found
        self.go_to(number)
        steps = self._states[number].steps
        self._step(steps, given)
        new = next(_numbers)
        self._states[new] = _State(number, key[1], steps + 1)
        self._following[key] = self._here = new
        if (steps + 1) % _SPACING == 0:
            self._save(new)
        return new

    def shown(self, number: int) -> Array:
        """The outputs in a state."""
        self.go_to(number)
        return self.fmu.shown(self.time(number))

    def go_to(self, number: int) -> None:
        """Bring the FMU into a state."""
        if self._here == number:
            return
        way = []
        place = number
        while place != self._here and not self.fmu.is_saved(place):
            way.append(place)
            parent = self._states[place].parent
            assert parent is not None  # or it would be saved
            place = parent
        if place != self._here:
            self._here = None
            self.fmu.load(place, self.time(place))
        for place in reversed(way):
            _, given, steps = self._states[place]
            self._step(steps - 1, np.frombuffer(given))
        self._here = number
        if len(way) > 1:
            # what is come back to once is come back to again; a run that is repeated goes on in ways of one step
            self._save(number)

    def time(self, number: int) -> float:
        """The FMU's time (s) in a state."""
        return self.fmu.start_time + self._states[number].steps * self.fmu.dt

    def lose_place(self) -> None:
        """Forget where the FMU is, because it has been touched."""
        self._here = None

    def serialized(self, number: int) -> bytes:
        """A state as bytes, after its number of steps."""
        self.go_to(number)
        self._save(number)
        return self._states[number].steps.to_bytes(8, "little") + self.fmu.serialized(number)

    def restored(self, data: bytes) -> int:
        """The state that bytes are."""
        new = next(_numbers)
        self.fmu.keep(new, data[8:])
        self._states[new] = _State(None, b"", int.from_bytes(data[:8], "little"))
        return new

    def _step(self, steps: int, given: Array) -> None:
        self._here = None
        self.fmu.step(self.fmu.start_time + steps * self.fmu.dt, given)

    def _save(self, number: int) -> None:
        if self.fmu.is_saved(number):
            return
        self.fmu.save(number, self.time(number))
        if self._states[number].steps % _STAYING == 0:
            return
        self._recent.append(number)
        if len(self._recent) > _RECENT:
            self.fmu.forget(self._recent.popleft())

    def _check_restoring(self) -> None:
        """Two steps, back, and the same two steps again."""
        runs = []
        for _ in range(2):
            self._here = None
            self.fmu.load(START, self.fmu.start_time)
            runs.append(self.fmu.run(0, np.tile(self.fmu.start_inputs, (2, 1)), coupling_delay=0))
        self.fmu.load(START, self.fmu.start_time)
        self._here = START
        wrong = np.flatnonzero(np.any((runs[0] != runs[1]) & ~(np.isnan(runs[0]) & np.isnan(runs[1])), axis=0))
        if wrong.size:
            raise SystemRefusedError(
                f"{self.fmu.path.name} does not come back to its saved state: "
                f"{self.fmu.outputs[wrong[0]].variable.name} goes on differently. It keeps something that it does not "
                "save (a slave made with pythonfmu saves its registered variables only); mend the FMU, or take fmu_frd"
            )


class FmuSystem(ct.NonlinearIOSystem):  # type: ignore[misc]
    """An FMU as `control.NonlinearIOSystem`; see `fmu_nlsys`. A context that frees the FMU."""

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
            return np.array([float(states.after(states.number_of(x), inputs_given(u)))])

        def held(_t: float, x: Any, _u: Any, _params: Any) -> Array:
            return states.shown(states.number_of(x))

        def through(_t: float, x: Any, u: Any, _params: Any) -> Array:
            return states.shown(states.after(states.number_of(x), inputs_given(u)))

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
        self._states.fmu.close()

    def time(self, x: Any) -> float:
        """The FMU's own time (s) in state `x`."""
        return self._states.time(self._states.number_of(np.atleast_1d(x)))

    def state_bytes(self, x: Any) -> bytes:
        """State `x` as bytes, which another system of the same FMU, in another process too, takes as its own.

        Raises `SystemRefusedError` if the FMU cannot serialise its state.
        """
        self._check_serializing()
        return self._states.serialized(self._states.number_of(np.atleast_1d(x)))

    def state_from(self, data: bytes) -> Array:
        """The state that `state_bytes` gave.

        Raises `SystemRefusedError` if the FMU cannot serialise its state, `RunStoppedError` if it refuses these bytes.
        """
        self._check_serializing()
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
        number = self._states.number_of(start)
        self._states.go_to(number)
        self._states.lose_place()
        fmu.set(self._states.time(number), held)
        variables = fmu.interface.variables
        states = [variables[derivative.derivative.name] for derivative in derivatives]
        unknowns = [variables[derivative.name] for derivative in derivatives] + [port.variable for port in fmu.outputs]
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
) -> FmuSystem:
    """x[k+1] = F(x[k], u[k]), y[k] = G(x[k]): a co-simulation FMU with steps of `dt` (s).

    `inputs` and `outputs` are names of variables, a stem for all its scalars, or a mapping to labels of your own; all
    inputs and outputs by default. Tunable parameters may be inputs, and whatever can be read may be an output; whole
    numbers and truths become floats. `parameters` are values by name, of parameters and of inputs at the start. The
    FMU is freed by ``close()``, at the end of a ``with`` block, or with the system.

    `coupling_delay` 1: outputs at t show what inputs before t have done, as between FMUs in a master of Jacobi order;
    there is no direct feedthrough, and no algebraic loop. 0: outputs after the step that begins at t; they follow the
    input at once, and a loop needs something in it that does not.

    Times of simulations are not looked at: a state carries its own time, that of state 0 is `start_time` (s).

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
    fmu = DrivenFmu(path, dt, inputs, outputs, parameters, start_time)
    try:
        if not fmu.can_restore:
            raise SystemRefusedError(
                f"{fmu.path.name} cannot save its state (canGetAndSetFMUstate is false), which python-control's pure "
                "functions need; export it with saved states, or measure its response with fmu_frd, which needs none"
            )
        return FmuSystem(FmuStates(fmu), coupling_delay, name or fmu.path.stem.replace(".", "_"))
    except BaseException:
        fmu.close()
        raise


def refuse_algebraic_loop(system: ct.InterconnectedSystem) -> None:
    """Raise `SystemRefusedError` if signals run in a circle through systems that all answer within the step.

    python-control finds that out in the first step of a simulation, and does not say where. Of a nonlinear system of
    another kind it is assumed that every output answers every input at once.

    >>> import control
    >>> with fmu_nlsys("dist/TripodGimbal.fmu", 0.001, "motor_torque.yaw", {"joint.yaw": "angle"}) as gimbal:
    ...     refuse_algebraic_loop(control.feedback(gimbal, 10.0))  # the gimbal answers after the step: no loop
    """
    within = _answering(system)
    # for each input, the inputs that reach it through one subsystem
    onward = (system.connect_map != 0.0) @ within.T
    graph = {place: set(np.flatnonzero(before)) for place, before in enumerate(onward)}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        names = [f"{part.name}.{label}" for part in system.syslist for label in part.input_labels]
        raise SystemRefusedError(
            f"algebraic loop: {' -> '.join(names[place] for place in error.args[1])}. Each of these answers its input "
            "within the same step. Make an FMU among them with coupling_delay=1, as a master of Jacobi order has it, "
            f"or put one step of delay in: control.tf([1], [1, 0], {system.dt})"
        ) from None


def _answering(system: ct.InterconnectedSystem) -> Array:
    """1 where a subsystem's output answers its input at once: rows are all inputs, columns all outputs."""
    found = np.zeros(system.connect_map.shape)
    row = column = 0
    for part in system.syslist:
        block = np.ones((part.noutputs, part.ninputs))
        if isinstance(part, FmuSystem):
            block[:] = 0.0 if part.coupling_delay else 1.0
        elif isinstance(part, ct.StateSpace):
            block = (part.D != 0.0).astype(np.float64)
        found[row : row + part.ninputs, column : column + part.noutputs] = block.T
        row, column = row + part.ninputs, column + part.noutputs
    return found
