"""The states that an FMU has been in, each known by a number.

A number always means the same state, and from the same number and inputs comes the same number again.
"""

from __future__ import annotations

import itertools
from collections import deque
from threading import RLock
from typing import Any, NamedTuple

import numpy as np

from ..errors import SystemRefusedError
from .driven_fmu import Array, DrivenFmu

START = 0
"""The number of the state after initialisation."""

_SPACING = 16
"""Steps between two states that are saved as a run goes; those between are had again by stepping."""
_RECENT = 64
"""Saved states beside the ones that stay."""
_STAYING = 16 * _SPACING
"""Steps between two saved states that stay."""

_numbers = itertools.count(START + 1)
"""Of all systems, so that none takes another's state for its own. Counted, not drawn: to a large number a small change,
as numerical linearisation makes it, is none, and would not be refused."""


class _State(NamedTuple):
    """How a state came about: from which, with which inputs, after how many steps. Without `parent` it stays saved."""

    parent: int | None
    given: bytes
    steps: int


class FmuStates:
    """The states that an FMU has been in, by number.

    Each is known by the inputs that led to it. Some are saved; to go back to another, the nearest saved one before it
    is loaded and the steps since are done again, which gives the same bits. The `remembered` states that were used
    last are known, and up to as many more.

    There is one instance, which is in one state at a time: hold `lock` from asking for a number to having the answer.
    """

    def __init__(self, fmu: DrivenFmu, remembered: int) -> None:
        self.fmu = fmu
        self.lock = RLock()
        self._remembered = remembered
        self._states = {START: _State(None, b"", 0)}  # in the order of their last use
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
                f"system's, nor be older than the last {self._remembered} that were used (fmu_nlsys(..., remembered=) "
                "for more). Linear models come from model_ss (our models) or fmu_frd (any FMU)"
            )
        return number

    def after(self, number: int, given: Array) -> int:
        """The state one step later."""
        key = (number, given.tobytes())
        found = self._following.get(key)
        if found is not None:
            self._used(found)
            return found
        self.go_to(number)
        steps = self._states[number].steps
        self._step(steps, given)
        new = next(_numbers)
        self._states[new] = _State(number, key[1], steps + 1)
        self._following[key] = self._here = new
        if (steps + 1) % _SPACING == 0:
            self._save(new)
        self._bound()
        return new

    def shown(self, number: int) -> Array:
        """The outputs in a state."""
        self.go_to(number)
        return self.fmu.shown(self.time(number))

    def go_to(self, number: int) -> None:
        """Bring the FMU into a state."""
        if self._here == number:
            return
        self._used(number)
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
        self._bound()
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
            oldest = self._recent.popleft()
            if self._states[oldest].parent is not None:
                self.fmu.forget(oldest)

    def _used(self, number: int) -> None:
        self._states[number] = self._states.pop(number)

    def _bound(self) -> None:
        """Where there are too many, forget all but the states used last; those of them whose parent goes stay saved."""
        if len(self._states) <= 2 * self._remembered + 1:
            return
        old = set(itertools.islice(self._states, len(self._states) - self._remembered)) - {START}
        for number in [number for number, state in self._states.items() if number not in old and state.parent in old]:
            self.go_to(number)
            if not self.fmu.is_saved(number):
                self.fmu.save(number, self.time(number))
            self._states[number] = _State(None, b"", self._states[number].steps)
        self._following = {
            key: number for key, number in self._following.items() if key[0] not in old and number not in old
        }
        self._recent = deque(number for number in self._recent if number not in old)
        self._states = {number: state for number, state in self._states.items() if number not in old}
        for number in old:
            self.fmu.forget(number)

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
