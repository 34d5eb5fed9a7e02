"""Random calls of several instances of an FMU, legal and illegal, each answer compared with the expected one.

``python sanitized_machine.py LIBRARY MODULE GUID JOURNAL SEQUENCES CALLS``. JOURNAL holds the calls of the sequence
that runs, for those who look at what is left of the process.
"""

from __future__ import annotations

import importlib
import math
import os
import struct
import sys
import zlib
from collections.abc import Callable, Sequence
from ctypes import byref, c_char_p, c_double, c_int, c_long, c_size_t, c_uint, c_void_p
from typing import Any, ClassVar

from fmi2_calls import C_TYPES, DISCARD, ERROR, FUNCTIONS, OK, Library, Unit, array
from hypothesis import HealthCheck, Phase, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, precondition, rule, run_state_machine_as_test
from sanitized_twin import HEAD_WORDS, Facts, Twin, essence

from attitude_fmu.fmu_src.interface import interface_of
from attitude_fmu.fmu_src.saved_state import INITIALISING, INSTANTIATED, STEPPING, STOPPED, TERMINATED

_MOST_UNITS, _MOST_STATES = 4, 6
_STATE_STALE = 4
_CUT = 800
_NAMES = ("unit", "100 % of %s%n", "größer", "x" * 3000)
_TOLERATED = ("ran away", "too short a period", "the derivative of", "(allowed: ")
_STAGE_AFTER = {
    "enter": ("EnterInitializationMode", INITIALISING),
    "leave": ("ExitInitializationMode", STEPPING),
    "terminate": ("Terminate", TERMINATED),
}
_CHANGES = (
    *("none", "bit", "cut", "longer", "empty"),
    *("word", "settable", "settable", "stage", "stale", "times", "times", "ticks"),
)
_KINDS = ("Real", "Integer", "Boolean", "String")

which = st.integers(0, 11)
picks = st.lists(st.tuples(st.sampled_from(["any"] * 3 + ["beyond"]), st.integers(0, 2**20)), max_size=4)
is_fitting = st.sampled_from([True, True, True, False])
manners = st.sampled_from(["start", "tame", "tame", "tame", "low", "high", "below", "above", "wild"])
amounts = st.lists(st.tuples(manners, st.floats(0, 1)), min_size=4, max_size=4)
wild_numbers = st.floats() | st.sampled_from(
    [math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 1e-320, -0.0, 0.5, 1e6, 1e9, -1e9, 4294967296.0, 1e300]
)
start_times = st.sampled_from([0.0, 0.0, -1.5, 3.25, 1e5, -1e6, 1e9, -1e9, 1.1e9, math.nan, math.inf, -math.inf])
sizes = st.sampled_from([1e-3, 1e-3, 0.0125, 0.02, 0.0073, 1e-9, 0.0, -0.0, -1e-3, math.nan, math.inf, 1e300, 5e-324])
offsets = st.sampled_from([0.0] * 8 + [5e-10, -5e-10, 1e-3, -1.0, math.nan])


class Saved:
    """A state that a unit gave away; `twin` is None once it was tampered with."""

    def __init__(self, place: c_void_p, twin: Twin | None) -> None:
        self.place, self.twin = place, twin


class Calls(RuleBasedStateMachine):
    """Several instances and saved states of one library."""

    library: ClassVar[Library]
    facts: ClassVar[Facts]
    guid: ClassVar[bytes]
    journal: ClassVar[int]

    def __init__(self) -> None:
        super().__init__()
        self.units: list[Unit] = []
        self.twins: list[Twin] = []
        self.probes: list[c_void_p] = []
        self.states: list[Saved] = []
        self.looks = False
        os.ftruncate(self.journal, 0)
        os.lseek(self.journal, 0, os.SEEK_SET)

    # one call and all that has to hold around it

    def note(self, line: str) -> None:
        os.write(self.journal, f"{line}\n".encode())

    def allocations(self) -> int:
        return c_long.in_dll(self.library.loaded, "outstanding_allocations").value

    def content(self, i: int) -> bytes:
        unit = self.units[i]
        return unit.serialised(unit.save(self.probes[i]))

    def shown(self, i: int) -> list[list[Any]]:
        """All values that a host can read, except for the counted refusals.

        Not in every sequence, because reading calculates what would otherwise wait.
        """
        if not self.looks:
            return []
        unit, twin = self.units[i], self.twins[i]
        readable = [set(self.facts.of_kind[kind]) - {self.facts.interface.refused} for kind in _KINDS[:3]]
        answers = [unit.get(kind, sorted(references)) for kind, references in zip(_KINDS, readable, strict=False)]
        twin.refused += sum(status == ERROR for status, _ in answers)
        return [values for status, values in answers if status == OK]

    def check(
        self,
        i: int,
        legal: bool,
        change: Callable[[], None],
        name: str,
        *arguments: Any,
        note: str = "",
        can_run_away: bool = False,
        is_wild: bool = False,
    ) -> bool:
        """Make a call; whether it was taken."""
        unit, twin = self.units[i], self.twins[i]
        shown = self.shown(i)
        self.note(f"{name} of {i} {note}")
        before, logged = self.facts.layout.read(self.content(i)), len(unit.log)
        status = unit.call(name, *arguments)
        after = self.facts.layout.read(self.content(i))
        texts = [text for status_of_text, _, text in unit.log[logged:] if status_of_text == ERROR]
        ran_away = legal and status == ERROR and (twin.is_wild or is_wild) and can_run_away
        if ran_away and twin.logs_errors and unit.has_log and len(twin.name) < _CUT:  # else the reason is cut off
            assert any(reason in text for text in texts for reason in _TOLERATED), texts
        assert status == (OK if legal and not ran_away else ERROR), (name, note, legal, texts)
        if status == OK:
            assert not texts, texts
            change()
        else:
            self._check_refusal(i, texts, ran_away and name == "DoStep" and after.stage == STOPPED)
            assert essence(after, self.facts) == essence(before, self.facts), (name, note)
            assert self.shown(i) == shown, (name, note)
        self._check_moment(i)
        return status == OK

    def _check_refusal(self, i: int, texts: Sequence[str], is_stopped: bool) -> None:
        unit, twin = self.units[i], self.twins[i]
        twin.refused += 1
        if is_stopped:
            twin.stage = STOPPED
        if unit.has_log and twin.logs_errors:
            assert len(texts) == 1, texts
            assert texts[0].startswith(twin.name[: len(texts[0])]), texts
        else:
            assert not texts, texts

    def _check_moment(self, i: int) -> None:
        twin, moment = self.twins[i], self.facts.layout.read(self.content(i))
        assert (moment.stage, moment.start_time, moment.time) == (twin.stage, twin.start_time, twin.time)
        assert list(moment.values[: self.facts.settable]) == twin.values
        assert moment.values[self.facts.interface.refused] == twin.refused
        if not twin.is_wild and twin.stage >= STEPPING:
            assert moment.ticks == twin.ticks

    # what the picks of hypothesis stand for

    def references(self, chosen: Sequence[tuple[str, int]], pool: Sequence[int], fits: bool) -> list[int]:
        beyond = (len(self.facts.variables), 2**31, 2**32 - 1)
        if fits:
            return [pool[number % len(pool)] for _, number in chosen] if pool else []
        return [
            number % len(self.facts.variables) if manner == "any" else beyond[number % 3] for manner, number in chosen
        ]

    def amount(self, kind: str, reference: int, amount: tuple[str, float], wild: float) -> tuple[float, bool]:
        """A value for a variable, and whether it is a wild one."""
        manner, part = amount
        low, high = self.facts.limits[reference] if reference < self.facts.settable else (-1.0, 1.0)
        variable = self.facts.variables[min(reference, len(self.facts.variables) - 1)]
        start = float(variable.start or 0.0)
        tame = min(max((0.5 + part) * start or 0.1 * part, low), high)
        value = {"start": start, "tame": tame, "low": low, "high": high, "wild": wild}.get(manner, 0.0)
        is_wild = manner not in ("start", "tame")
        if kind == "Real":
            beyond = {"below": math.nextafter(low, -math.inf), "above": math.nextafter(high, math.inf)}
            return beyond.get(manner, value), is_wild
        whole = {"below": low - 1, "above": high + 1, "tame": round(tame)}.get(manner, value)
        return max(min(int(whole) if math.isfinite(whole) else 0, 2**31 - 1), -(2**31)), is_wild

    def unit_at(self, number: int) -> int:
        return number % len(self.units)

    # life

    @initialize(
        reads=st.booleans(),
        looks=st.booleans(),
        stage=st.sampled_from([INSTANTIATED, STEPPING, STEPPING]),
        start_time=start_times,
    )
    def begin(self, reads: bool, looks: bool, stage: int, start_time: float) -> None:
        self.begin_allocations = self.allocations()
        self.looks = looks
        self.make(1, True, True, 0)
        if reads:
            self.get_everything(0)
        if stage == STEPPING:
            self.go_on(0, start_time)

    @precondition(lambda self: len(self.units) < _MOST_UNITS)
    @rule(name=st.integers(0, 4), is_ours=is_fitting, logging=st.booleans(), host=st.integers(0, 5))
    def make(self, name: int, is_ours: bool, logging: bool, host: int) -> None:
        text = ("", *_NAMES)[name] if host else _NAMES[name % 4]
        self.note(f"Instantiate {text[:20]!r} {is_ours=} {logging=} {host=}")
        unit = Unit(
            self.library,
            text.encode(),
            self.guid if is_ours else b"{0}",
            kind=0 if host == 5 else 1,
            resources=(None, b"", b"file:///no/such/%zz#[]")[host % 3],
            has_host=host != 1,
            has_logger=host != 2,
            logging=logging,
        )
        assert (unit.handle is not None) == (bool(text) and is_ours and host != 5)
        if unit.handle is not None:
            self.units.append(unit)
            self.twins.append(Twin(self.facts, text))
            self.probes.append(unit.save())

    @rule(i=which)
    @precondition(lambda self: len(self.units) > 1)
    def free(self, i: int) -> None:
        i = self.unit_at(i)
        self.note(f"FreeInstance {i}")
        self.units[i].drop(self.probes.pop(i))
        self.units.pop(i).free()
        self.twins.pop(i)

    def _setup(self, i: int, start_time: float) -> None:
        twin = self.twins[i]

        def change() -> None:
            twin.start_time = twin.time = start_time

        legal = twin.may("SetupExperiment") and abs(start_time) <= 1e9
        self.check(i, legal, change, "SetupExperiment", 0, 0.0, start_time, 0, 0.0, note=str(start_time))

    def _enter_stage(self, i: int, name: str, stage: int) -> None:
        twin = self.twins[i]
        is_exit = name == "ExitInitializationMode"
        legal = twin.may(name) and (not is_exit or twin.obeys_rules())
        self.check(i, legal, lambda: setattr(twin, "stage", stage), name, can_run_away=is_exit)

    def _reset(self, i: int) -> None:
        self.check(i, True, self.twins[i].begin_anew, "Reset")

    @rule(i=which, call=st.sampled_from(["setup", "enter", "leave", "terminate", "reset"]), start_time=start_times)
    def change_stage(self, i: int, call: str, start_time: float) -> None:
        i = self.unit_at(i)
        if call == "setup":
            self._setup(i, start_time)
        elif call == "reset":
            self._reset(i)
        else:
            self._enter_stage(i, *_STAGE_AFTER[call])

    @rule(i=which, start_time=start_times)
    def go_on(self, i: int, start_time: float) -> None:
        """To where it can be stepped."""
        i = self.unit_at(i)
        twin = self.twins[i]
        if twin.stage >= STOPPED:
            self._reset(i)
        if twin.stage == INSTANTIATED:
            self._setup(i, start_time)
            self._enter_stage(i, *_STAGE_AFTER["enter"])
        if twin.stage == INITIALISING:
            self._enter_stage(i, *_STAGE_AFTER["leave"])

    @rule(i=which, size=sizes, offset=offsets)
    def step(self, i: int, size: float, offset: float) -> None:
        i = self.unit_at(i)
        twin = self.twins[i]
        time = twin.time + offset
        size = min(size, 2e-3) if twin.is_wild and size < 1.0 else size
        self.check(
            i,
            twin.may_step(time, size),
            lambda: twin.advance(time + size),
            "DoStep",
            time,
            size,
            1,
            note=f"{time!r} {size!r}",
            can_run_away=True,
        )

    # values

    def _settable(self, i: int, kind: str, ignores_stage: bool = False) -> list[int]:
        is_late = self.twins[i].stage == STEPPING and not ignores_stage
        return [
            reference
            for reference in self.facts.of_kind[kind]
            if reference < self.facts.settable
            and not (is_late and self.facts.variables[reference].variability == "fixed")
        ]

    def _set(self, i: int, kind: str, references: list[int], values: list[Any], is_wild: bool) -> None:
        twin = self.twins[i]
        stored = [float(bool(value)) if kind == "Boolean" else float(value) for value in values]
        sent = array(C_TYPES[kind], [b"text"] * len(values) if kind == "String" else values)

        def change() -> None:
            twin.store(references, stored)
            twin.is_wild |= is_wild

        legal = not references if kind == "String" else twin.may_set(kind, references, stored)
        name, note = f"Set{kind}", f"{references} {values}"
        self.check(i, legal, change, name, array(c_uint, references), len(references), sent, note=note)

    @rule(i=which, kind=st.sampled_from(_KINDS), chosen=picks, fits=is_fitting, amounts=amounts, wild=wild_numbers)
    def set(
        self,
        i: int,
        kind: str,
        chosen: list[tuple[str, int]],
        fits: bool,
        amounts: list[tuple[str, float]],
        wild: float,
    ) -> None:
        i = self.unit_at(i)
        references = self.references(chosen, self._settable(i, kind, wild < -1.0), fits)
        if fits:
            amounts = [(manner if manner in ("start", "low", "high") else "tame", part) for manner, part in amounts]
        valued = [self.amount(kind, r, amount, wild) for r, amount in zip(references, amounts, strict=False)]
        self._set(i, kind, references, [value for value, _ in valued], any(is_wild for _, is_wild in valued))

    @rule(
        i=which,
        manner=st.sampled_from(["high", "low", "start"]),
        kinds=st.sets(st.sampled_from(_KINDS[:3]), min_size=1),
    )
    def set_all(self, i: int, manner: str, kinds: set[str]) -> None:
        """Everything that can be set to the end of its range, and a step that may well run away."""
        i = self.unit_at(i)
        for kind in sorted(kinds):
            references = self._settable(i, kind)
            values = [self.amount(kind, reference, (manner, 0.0), 0.0)[0] for reference in references]
            self._set(i, kind, references, values, manner != "start")
        self.step(i, 1e-3, 0.0)

    @rule(i=which, kind=st.sampled_from(_KINDS), chosen=picks, fits=is_fitting)
    def get(self, i: int, kind: str, chosen: list[tuple[str, int]], fits: bool) -> None:
        self._get(self.unit_at(i), kind, self.references(chosen, self.facts.of_kind[kind], fits))

    @rule(i=which)
    def get_everything(self, i: int) -> None:
        for kind in ("Real", "Integer", "Boolean"):
            self._get(self.unit_at(i), kind, self.facts.of_kind[kind])

    def _get(self, i: int, kind: str, references: list[int]) -> None:
        twin = self.twins[i]
        legal = not references if kind == "String" else twin.may_get(kind, references)
        count = len(references)
        values = array(C_TYPES[kind], [None if kind == "String" else -77] * count)
        places, note = array(c_uint, references), str(references[:9])
        before = twin.refused
        if not self.check(i, legal, int, f"Get{kind}", places, count, values, note=note, can_run_away=True):
            return
        for reference, value in zip(references, values, strict=True):
            assert math.isfinite(value)
            if reference < self.facts.settable:
                assert value == twin.values[reference]
            if reference == self.facts.interface.refused:
                assert before <= value <= twin.refused  # looking round may be refused as well

    @rule(i=which, unknowns=picks, knowns=picks, fits=is_fitting, seeds=st.lists(wild_numbers, min_size=4, max_size=4))
    def derive(
        self, i: int, unknowns: list[tuple[str, int]], knowns: list[tuple[str, int]], fits: bool, seeds: list[float]
    ) -> None:
        i, interface = self.unit_at(i), self.facts.interface
        reals = self.facts.of_kind["Real"]
        computed = [r for r in reals if interface.outputs.start <= r < interface.state.start]
        targets = self.references(unknowns, computed, fits)
        sources = self.references(knowns, [r for r in reals if r < self.facts.settable], fits)
        self.check(
            i,
            self.twins[i].may_derive(targets, sources),
            int,
            "GetDirectionalDerivative",
            *(array(c_uint, targets), len(targets), array(c_uint, sources), len(sources)),
            *(array(c_double, seeds[: len(sources)]), array(c_double, [0.0] * len(targets))),
            note=f"{targets} {sources}",
            can_run_away=True,
            is_wild=any(not abs(seed) <= 1.0 for seed in seeds[: len(sources)]),
        )

    @rule(
        i=which,
        chosen=picks,
        fits=is_fitting,
        orders=st.lists(st.sampled_from([1] * 12 + [0, 2, -1]), min_size=4, max_size=4),
        slopes=st.lists(st.floats(-1.0, 1.0) | wild_numbers, min_size=4, max_size=4),
    )
    def slope(self, i: int, chosen: list[tuple[str, int]], fits: bool, orders: list[int], slopes: list[float]) -> None:
        i, twin = self.unit_at(i), self.twins[self.unit_at(i)]
        inputs = self.facts.interface.inputs
        pool = [r for r in self.facts.of_kind["Real"] if inputs.start <= r < inputs.stop]
        references = self.references(chosen, pool, fits)
        count = len(references)

        def change() -> None:
            twin.set_slopes(references, slopes[:count])
            twin.is_wild |= any(abs(slope) > 1.0 for slope in slopes[:count])

        legal = twin.may_slope(references, orders[:count], slopes[:count])
        sent = array(c_int, orders[:count]), array(c_double, slopes[:count])
        name, note = "SetRealInputDerivatives", f"{references} {slopes[:count]}"
        self.check(i, legal, change, name, array(c_uint, references), count, *sent, note=note)

    def ask_for_what_is_not_offered(self, i: int, count: int) -> None:
        sent = array(c_uint, [0] * count), count, array(c_int, [1] * count), array(c_double, [0.0] * count)
        self.check(i, count == 0, int, "GetRealOutputDerivatives", *sent)
        self.check(i, False, int, "CancelStep")

    def ask_for_status(self, i: int, kind: int) -> None:
        unit, twin = self.units[i], self.twins[i]
        real, whole, pointer = c_double(), c_int(7), c_char_p()
        assert unit.call("GetRealStatus", kind, byref(real)) == (OK if kind == 2 else DISCARD)
        assert kind != 2 or real.value == twin.time
        assert unit.call("GetBooleanStatus", kind, byref(whole)) == (OK if kind == 3 else DISCARD)
        assert kind != 3 or whole.value == 0
        for name, place in (("GetStatus", whole), ("GetIntegerStatus", whole), ("GetStringStatus", pointer)):
            assert unit.call(name, kind, byref(place)) == DISCARD

    @rule(i=which, on=st.booleans(), wanted=st.lists(st.integers(0, 4), max_size=3))
    def log(self, i: int, on: bool, wanted: list[int]) -> None:
        i = self.unit_at(i)
        known = ["logAll", "logEvents", "logStatusError", "logAll"]
        categories = [(*known, "logNothing %s")[number] for number in wanted]
        twin = self.twins[i]

        def change() -> None:
            if not categories or {"logAll", "logStatusError"} & set(categories):
                twin.logs_errors = on

        legal = all(category in known for category in categories)
        sent = array(c_char_p, [category.encode() for category in categories])
        self.check(i, legal, change, "SetDebugLogging", on, len(categories), sent, note=str(categories))

    # states

    @precondition(lambda self: len(self.states) < _MOST_STATES)
    @rule(i=which)
    def save(self, i: int) -> None:
        i = self.unit_at(i)
        self.note(f"GetFMUstate of {i}")
        self.states.append(Saved(self.units[i].save(), self.twins[i].copied()))

    @precondition(lambda self: self.states)
    @rule(i=which, j=which)
    def save_again(self, i: int, j: int) -> None:
        i, saved = self.unit_at(i), self.states[j % len(self.states)]
        self.note(f"GetFMUstate of {i} over an old one")
        self.units[i].save(saved.place)
        saved.twin = self.twins[i].copied()

    @precondition(lambda self: self.states)
    @rule(i=which, j=which)
    def restore(self, i: int, j: int) -> None:
        i, saved = self.unit_at(i), self.states[j % len(self.states)]
        twin, state = self.twins[i], saved.twin
        if state is None:
            self._restore_tampered(i, saved)
        else:
            note = f"state {j % len(self.states)}"
            self.check(i, True, lambda: twin.go_back(state), "SetFMUstate", saved.place, note=note)

    def _restore_tampered(self, i: int, saved: Saved) -> None:
        """It is refused, or what it says is within all limits."""
        unit, twin = self.units[i], self.twins[i]
        self.note(f"SetFMUstate of {i}, tampered with")
        before = essence(self.facts.layout.read(self.content(i)), self.facts)
        status = unit.call("SetFMUstate", saved.place)
        moment = self.facts.layout.read(self.content(i))
        if status == ERROR:
            twin.refused += 1
            assert essence(moment, self.facts) == before
        else:
            twin.adopt(moment)
            self._check_sanity(moment)
        self._check_moment(i)

    def _check_sanity(self, moment: Any) -> None:
        assert moment.stage in range(5)
        assert moment.is_sloped in (0, 1)
        assert moment.stale in range(8)
        assert moment.stage not in (STEPPING, STOPPED) or not moment.stale & _STATE_STALE
        assert moment.stage >= STEPPING or moment.time == moment.start_time
        assert max(abs(moment.time), abs(moment.start_time)) <= 1e9
        for value, variable, (low, high) in zip(moment.values, self.facts.variables, self.facts.limits, strict=False):
            assert low <= value <= high, variable.name
            assert variable.kind == "Real" or value == int(value), variable.name

    @precondition(lambda self: self.states)
    @rule(i=which, j=which)
    def drop(self, i: int, j: int) -> None:
        i, saved = self.unit_at(i), self.states.pop(j % len(self.states))
        self.note(f"FreeFMUstate of {i}")
        self.units[i].drop(saved.place)
        self.units[i].drop(saved.place)  # NULL now

    def use_no_state(self, i: int, _number: int) -> None:
        self.check(i, False, int, "SetFMUstate", None)
        for name, arguments in (
            ("GetFMUstate", (None,)),
            ("SerializedFMUstateSize", (None, byref(c_size_t()))),
            ("SerializeFMUstate", (None, None, 0)),
            ("DeSerializeFMUstate", (b"", 0, None)),
        ):
            assert self.units[i].call(name, *arguments) == ERROR

    @precondition(lambda self: 0 < len(self.states) < _MOST_STATES)
    @rule(
        i=which,
        j=which,
        place=st.integers(0, 2**16),
        change=st.sampled_from(_CHANGES),
        word=wild_numbers | st.integers(-(2**63), 2**63 - 1) | st.integers(-1, 9),
        goes_on=st.booleans(),
    )
    def carry_over(self, i: int, j: int, place: int, change: str, word: float, goes_on: bool) -> None:
        """Serialise a state, spoil the bytes, make a state of them again and perhaps go on from it."""
        i, saved = self.unit_at(i), self.states[j % len(self.states)]
        content = bytearray(self.units[i].serialised(saved.place))
        self.note(
            f"SerializeFMUstate of {i}, state {j % len(self.states)}; "
            f"DeSerializeFMUstate after {change} {place} {word!r}"
        )
        words = len(content) // 8 - 1
        changed = self._changed_word(change, place, words)
        if changed is not None:
            struct.pack_into("<q" if isinstance(word, int) else "<d", content, 8 * changed, word)
            struct.pack_into("<Q", content, 8 * words, zlib.crc32(content[: 8 * words]))
        if change == "bit":
            content[place % len(content)] ^= 1 << place % 8
        cut = {"cut": content[: place % len(content)], "longer": content + b"\0" * 8, "empty": b""}
        received = bytes(cut.get(change, content))
        unit, before = self.units[i], self.allocations()
        status, state = unit.deserialised(received)
        is_damaged = change in ("bit", *cut) or (changed is not None and changed < HEAD_WORDS)
        assert status == (ERROR if is_damaged else OK)
        if is_damaged:
            self.twins[i].refused += 1
            assert state.value is None
            assert self.allocations() == before
        elif changed is None:
            self.states.append(Saved(state, saved.twin))
        else:
            self.states.append(Saved(state, None))
        self._check_moment(i)
        if goes_on and not is_damaged:
            self.restore(i, len(self.states) - 1)
            self.step(i, 1e-3, 0.0)
            self.step(i, 0.0, 0.0)

    def _changed_word(self, change: str, place: int, words: int) -> int | None:
        ticks_at = words - 5 - self.facts.layout.clocks
        first, count = {
            "word": (0, words),
            "stage": (words - 3, 1),
            "stale": (words - 1, 1),
            "settable": (HEAD_WORDS, self.facts.settable),
            "times": (words - 5, 2),
            "ticks": (ticks_at, self.facts.layout.clocks),
        }.get(change, (0, 0))
        return first + place % count if count else None

    @rule(i=which, size=st.sampled_from([1e-3, 0.0125, 0.0]))
    def replay(self, i: int, size: float) -> None:
        """A step taken twice from the same state ends in the same one, to the last bit."""
        i = self.unit_at(i)
        unit, twin = self.units[i], self.twins[i]
        size = min(size, 2e-3) if twin.is_wild else size
        before, state = twin.copied(), unit.save()
        ends = []
        for _ in range(2):
            self.step(i, size, 0.0)
            ends.append(essence(self.facts.layout.read(self.content(i)), self.facts))
            self.check(i, True, lambda: twin.go_back(before), "SetFMUstate", state, note="back")
        assert ends[0] == ends[1]
        unit.drop(state)

    # the host at its worst

    @rule(i=which, what=st.integers(0, 5), number=st.integers(0, 3))
    def do_something_odd(self, i: int, what: int, number: int) -> None:
        oddities = (
            self.ask_for_what_is_not_offered,
            self.ask_for_status,
            self.use_no_state,
            self.call_without_component,
            self.run_out_of_memory,
            self.leave_out_an_array,
        )
        oddities[what](self.unit_at(i), number)

    def call_without_component(self, _i: int, _number: int) -> None:
        self.note("all functions without a component")
        for name in FUNCTIONS:
            status = getattr(self.library, name)(None, *self.library.nothing(name))
            assert status == (None if name == "FreeInstance" else ERROR), name

    def leave_out_an_array(self, i: int, number: int) -> None:
        """Each array of each function that takes some, with a count of one, and the number-th of them NULL."""
        unit, twin = self.units[i], self.twins[i]
        places, orders, reals = array(c_uint, [0]), array(c_int, [1]), array(c_double, [1.0])
        calls: list[tuple[str, list[Any], list[int]]] = [
            ("SetDebugLogging", [1, 1, None], [2]),
            ("GetDirectionalDerivative", [places, 1, places, 1, reals, reals], [0, 2, 4, 5]),
            ("SetRealInputDerivatives", [places, 1, orders, reals], [0, 2, 3]),
            ("GetString", [places, 1, None], [0]),
            ("SetString", [places, 1, None], [0]),
        ]
        for kind in _KINDS[:3]:
            values = array(C_TYPES[kind], [1])
            calls += [(f"{verb}{kind}", [places, 1, values], [0, 2]) for verb in ("Get", "Set")]
        for name, arguments, arrays in calls:
            left_out = arrays[number % len(arrays)]
            sent = [None if place == left_out else argument for place, argument in enumerate(arguments)]
            logged = len(unit.log)
            self.check(i, False, int, name, *sent, note=f"without its argument {left_out}")
            if unit.has_log and twin.logs_errors and len(twin.name) < _CUT and twin.may(name):
                # among what the looking round afterwards may log
                said = [text for _, _, text in unit.log[logged:]]
                assert f"{twin.name}: an array is missing (NULL)" in said, (name, left_out)

    def run_out_of_memory(self, i: int, _number: int) -> None:
        unit, before = self.units[i], self.allocations()
        self.note(f"no memory, {i}")
        content = self.content(i)
        switch = c_int.in_dll(self.library.loaded, "allocations_fail")
        switch.value = 1
        try:
            assert Unit(self.library, b"late", self.guid).handle is None
            state = c_void_p()
            assert unit.call("GetFMUstate", byref(state)) == ERROR
            assert unit.deserialised(content)[0] == ERROR
        finally:
            switch.value = 0
        self.twins[i].refused += 2
        assert state.value is None
        assert self.allocations() == before

    def teardown(self) -> None:
        if not self.units:
            return
        for saved in self.states:
            self.units[0].drop(saved.place)
        for unit, probe in zip(self.units, self.probes, strict=True):
            unit.drop(probe)
            unit.free()
        assert self.allocations() == self.begin_allocations


def main(library: str, module: str, guid: str, journal: str, sequences: str, calls: str) -> None:
    model = importlib.import_module(module).MODEL
    Calls.library, Calls.guid = Library(library), guid.encode()
    Calls.facts = Facts(model, interface_of(model))
    Calls.journal = os.open(journal, os.O_CREAT | os.O_WRONLY, 0o644)
    run_state_machine_as_test(
        Calls,
        settings=settings(
            max_examples=int(sequences),
            stateful_step_count=int(calls),
            deadline=None,
            database=None,
            derandomize=True,
            phases=[Phase.generate],  # the journal shows the calls; making them fewer would take minutes
            report_multiple_bugs=False,
            suppress_health_check=list(HealthCheck),
        ),
    )


if __name__ == "__main__":
    main(*sys.argv[1:])
