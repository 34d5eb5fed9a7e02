"""Any model as a pythonfmu slave: set, step, get, reset, save and restore.

Answers to what pythonfmu 0.7's C++ wrapper does (errors: see `failure`):

* ``_fmu_state_to_bytes`` and ``_fmu_state_from_bytes`` are called on the class, where no instance can be protected
  from an exception, so they never raise: damaged bytes are refused by fmi2SetFMUstate. Nor does the constructor raise.
* At each fmi2Instantiate it runs the slave's file a second time and drops a reference to the module's namespace;
  a class with a method of its own brings one, so every slave's file must define a method.
* It never frees the class which that makes (2.5 kB at each fmi2Instantiate, as for any slave of pythonfmu's).
* It leaves the resources folder in ``sys.path``; taken out here, so that a later FMU finds its own modules.

Setting, stepping and getting cost little: plans for lists of value references (`ports`), outputs computed once a
step and only when asked for.
"""

from __future__ import annotations

import sys
from typing import Any, ClassVar, NoReturn

from pythonfmu import Fmi2Slave  # type: ignore[import-untyped]

from ..models.errors import ModelStoppedError, ValueRefusedError, digits
from ..models.record import Leaf, allowed, flatten, refusal, unflatten
from ..models.system import LATEST_TIME, Model, Run, Snapshot
from .errors import CallRefusedError, InterfaceError
from .failure import guarded
from .interface import interface_of
from .ports import BOOLEAN, COEFFICIENTS, EVERYTHING, INTEGER, OUTPUTS, REAL, STATE, Ports, Writing
from .saved_state import (
    INITIALISING,
    INSTANTIATED,
    STAGES,
    STEPPING,
    STOPPED,
    TERMINATED,
    TIME_ROUNDING,
    TIME_SLACK,
    DamagedState,
    SavedState,
    from_bytes,
    to_bytes,
)

_INT32 = (-(2**31), 2**31 - 1)


class ModelSlave(Fmi2Slave):  # type: ignore[misc]
    """One instance of a model; a subclass names the model and the fingerprint of its sources."""

    model: ClassVar[Model]
    fingerprint: ClassVar[str]
    _ports_of_class: ClassVar[Ports | None] = None

    def __init__(self, **arguments: Any) -> None:
        super().__init__(**arguments)
        if "logger" in arguments:  # made by the wrapper; pythonfmu's builder takes its own path back
            while self.resources in sys.path:
                sys.path.remove(self.resources)
        self._ports = self._make_ports()
        self._values = [*self._ports.starts, *[0.0] * self._ports.computed]
        self._real_readings = self._ports.readings[REAL]
        self._run: Run | None = None
        self._inputs: Any = None
        self._parameters_changed = False
        self._stage = INSTANTIATED
        self._stale = EVERYTHING
        self._start_time = 0.0
        self._time = 0.0

    @classmethod
    def _make_ports(cls) -> Ports:
        if cls._ports_of_class is None:
            cls._ports_of_class = Ports(interface_of(cls.model))
        return cls._ports_of_class

    # the life of an instance

    def count_refusal(self) -> None:
        """One more call was refused (`failure`)."""
        self._values[self._ports.interface.refused] += 1

    def _refuse_call(self, call: str) -> NoReturn:
        raise CallRefusedError(f"{call} refused: {STAGES[self._stage]}")

    @guarded
    def setup_experiment(self, start_time: float, *_stop_time_and_tolerance: float | None) -> None:
        if self._stage != INSTANTIATED:
            self._refuse_call("fmi2SetupExperiment")
        if not abs(start_time) <= LATEST_TIME:
            raise CallRefusedError(f"the start time is {digits(start_time)} s (allowed: up to {digits(LATEST_TIME)} s)")
        self._start_time = self._time = start_time
        self._run = None

    @guarded
    def enter_initialization_mode(self) -> None:
        if self._stage != INSTANTIATED:
            self._refuse_call("fmi2EnterInitializationMode")
        self._stage = INITIALISING

    @guarded
    def exit_initialization_mode(self) -> None:
        if self._stage != INITIALISING:
            self._refuse_call("fmi2ExitInitializationMode")
        self._current_run()
        self._stage = STEPPING

    @guarded
    def do_step(self, current_time: float, step_size: float) -> bool:
        self._check_step(current_time, step_size)
        run = self._current_run()
        if self._inputs is None:
            self._inputs = unflatten(self.model.Inputs, self._values[self._ports.interface.inputs])
        until = current_time + step_size
        self._stale |= OUTPUTS | STATE
        self._stage = STOPPED  # unless the step succeeds
        state, counts = run.state, tuple(run.counts)
        try:
            run.advance(self._inputs, until)
        except BaseException:
            run.restore(Snapshot(tuple(flatten(state)), counts))
            raise
        self._stage = STEPPING
        self._time = max(until, self._time)
        return True

    @guarded
    def terminate(self) -> None:
        self._stage = TERMINATED  # at any time: hosts that clean up after an error do not ask

    def _check_step(self, current_time: float, step_size: float) -> None:
        if self._stage != STEPPING:
            self._refuse_call("fmi2DoStep")
        if not (step_size >= 0.0 and current_time + step_size <= LATEST_TIME):
            raise CallRefusedError(
                f"a step of {digits(step_size)} s from t = {digits(current_time)} s "
                f"(allowed: forwards, up to {digits(LATEST_TIME)} s)"
            )
        if not abs(current_time - self._time) <= TIME_SLACK * min(step_size, 1.0) + TIME_ROUNDING:
            raise CallRefusedError(
                f"a step from t = {digits(current_time)} s, but the FMU stands at t = {digits(self._time)} s"
            )

    def _parameters(self, values: list[Any]) -> Any:
        return unflatten(self.model.Parameters, values[self._ports.interface.parameters])

    def _fixed(self, values: list[Any]) -> list[Any]:
        """The values of the parameters that cannot be tuned."""
        parameters = self._ports.interface.variables[self._ports.interface.parameters]
        return [values[v.value_reference] for v in parameters if v.variability == "fixed"]

    def _current_run(self) -> Run:
        """The run with all that was set until now."""
        if self._run is None:
            inputs = unflatten(self.model.Inputs, self._values[self._ports.interface.inputs])
            self._run = Run(self.model, self._parameters(self._values), inputs, self._start_time, self.instance_name)
        elif self._parameters_changed:
            self._run.tune(self._parameters(self._values))
        self._parameters_changed = False
        return self._run

    # set

    @guarded
    def set_real(self, vrs: list[int], values: list[float]) -> None:
        self._set(REAL, vrs, values)

    @guarded
    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        self._set(INTEGER, vrs, values)

    @guarded
    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        self._set(BOOLEAN, vrs, values)

    @guarded
    def set_string(self, vrs: list[int], values: list[str]) -> None:
        self._ports.variables(("String",), tuple(vrs))

    def _set(self, kinds: tuple[str, ...], vrs: list[int], values: list[Any]) -> None:
        references = tuple(vrs)
        plan = self._ports.writings[kinds].get(references) or self._ports.writing(kinds, references)
        for low, value, high in zip(plan.low, values, plan.high, strict=True):
            if not low <= value <= high:
                self._refuse(plan, values)
        if self._stage > STEPPING:
            self._refuse_call("setting values")
        if not plan.inputs_only and self._stage == STEPPING:
            self._allow_tuning(plan, values)
        stored = self._values
        for reference, cast, value in zip(references, plan.casts, values, strict=True):
            stored[reference] = cast(value)
        self._inputs = None
        if self._stage < STEPPING:
            self._run = None  # initial state and outputs follow from what is set
            self._stale = EVERYTHING

    def _allow_tuning(self, plan: Writing, values: list[Any]) -> None:
        for variable, value in zip(plan.variables, values, strict=True):
            if variable.variability == "fixed":
                raise ValueRefusedError(
                    f"{self.instance_name}.{variable.name}",
                    value,
                    variable.fact.unit,
                    "fixed, can be set only before the end of initialisation",
                    allowed(variable.fact),
                )
        self._parameters_changed = True
        self._stale |= OUTPUTS | COEFFICIENTS

    def _refuse(self, plan: Writing, values: list[Any]) -> None:
        for variable, value in zip(plan.variables, values, strict=True):
            error = refusal(Leaf(variable.name, variable.fact, None), value, self.instance_name)
            if error is not None:
                raise error

    # get

    @guarded
    def get_real(self, vrs: list[int]) -> list[float]:
        references = tuple(vrs)
        plan = self._real_readings.get(references) or self._ports.reading(REAL, references)
        if plan.needs & self._stale:
            self._compute(plan.needs)
        return plan.take(self._values)

    @guarded
    def get_integer(self, vrs: list[int]) -> list[int]:
        values = self._get(INTEGER, vrs)
        whole = [int(value) for value in values]
        if whole != values or (whole and not (min(whole) >= _INT32[0] and max(whole) <= _INT32[1])):
            self._refuse_whole(vrs, values)
        return whole

    def _refuse_whole(self, vrs: list[int], values: list[Any]) -> NoReturn:
        reference, value = next(
            (reference, value)
            for reference, value in zip(vrs, values, strict=True)
            if value != int(value) or not _INT32[0] <= value <= _INT32[1]
        )
        name = f"{self.instance_name}.{self._ports.interface.variables[reference].name}"
        raise ModelStoppedError(f"{name} = {digits(value)} does not fit into an integer")

    @guarded
    def get_boolean(self, vrs: list[int]) -> list[bool]:
        return [bool(value) for value in self._get(BOOLEAN, vrs)]

    @guarded
    def get_string(self, vrs: list[int]) -> list[str]:
        self._ports.variables(("String",), tuple(vrs))
        return []

    def _get(self, kinds: tuple[str, ...], vrs: list[int]) -> list[Any]:
        references = tuple(vrs)
        plan = self._ports.readings[kinds].get(references) or self._ports.reading(kinds, references)
        if plan.needs & self._stale:
            self._compute(plan.needs)
        return plan.take(self._values)

    def _compute(self, needs: int) -> None:
        run, interface, needs = self._current_run(), self._ports.interface, needs & self._stale
        if needs & OUTPUTS:
            self._store(interface.outputs, run.shown())
        if needs & COEFFICIENTS:
            self._store(interface.coefficients, flatten(run.coefficients))
        if needs & STATE:
            self._store(interface.state, flatten(run.state))
        self._stale &= ~needs

    def _store(self, place: slice, scalars: list[Any]) -> None:
        if len(scalars) != place.stop - place.start:
            raise InterfaceError(f"the model gave {len(scalars)} scalars for {place.stop - place.start} variables")
        self._values[place] = scalars

    # save and restore

    @guarded
    def _get_fmu_state(self) -> SavedState:
        # as it stands: parameters that disagree are refused when they come to act, not here
        snapshot = Snapshot((), ()) if self._run is None or self._stage < STEPPING else self._run.snapshot()
        return SavedState(
            self.fingerprint,
            self._stage,
            self._start_time,
            self._time,
            tuple(self._values[: self._ports.interface.inputs.stop]),
            *snapshot,
        )

    @guarded
    def _set_fmu_state(self, saved: SavedState | DamagedState) -> None:
        if isinstance(saved, DamagedState):
            raise CallRefusedError(f"saved state refused: {saved.reason}")
        if saved.fingerprint[:32] != self.fingerprint[:32] or len(saved.settable) != len(self._ports.starts):
            raise CallRefusedError("saved state refused: another FMU or version saved it")
        settable = [cast(value) for cast, value in zip(self._ports.casts, saved.settable, strict=True)]
        self._run = self._restored(saved, settable) if saved.stage >= STEPPING else None
        self._values[: len(settable)] = settable
        self._inputs = None
        self._parameters_changed = self._run is not None and self._run.parameters != self._parameters(settable)
        self._stage, self._start_time, self._time = saved.stage, saved.start_time, saved.time
        self._stale = EVERYTHING

    def _restored(self, saved: SavedState, settable: list[Any]) -> Run:
        run = self._run
        is_same = run is not None and run.start_time == saved.start_time
        if run is None or not (is_same and self._fixed(settable) == self._fixed(self._values)):
            inputs = unflatten(self.model.Inputs, settable[self._ports.interface.inputs])
            run = Run(self.model, self._parameters(settable), inputs, saved.start_time, self.instance_name)
        run.restore(Snapshot(saved.state, saved.counts))
        return run

    @staticmethod
    def _fmu_state_to_bytes(state: SavedState | DamagedState) -> bytes:
        return to_bytes(state) if isinstance(state, SavedState) else b""

    @staticmethod
    def _fmu_state_from_bytes(state: bytes) -> SavedState | DamagedState:
        return from_bytes(state)
