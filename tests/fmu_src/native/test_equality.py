"""The two kinds of an FMU are one model: driven alike, every variable is the same to the last bit."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import every_kind
import pytest
from fmpy.fmi1 import FMICallException
from fmu_instance import EVERY_KIND, Instance
from random_records import reconciled, settable_near
from refused_calls import REFUSED

from attitude_fmu.fmu_src.build import build
from attitude_fmu.fmu_src.catalogue import CATALOGUE, KINDS, Entry, Kind
from attitude_fmu.fmu_src.units import completed
from attitude_fmu.models.errors import AttitudeFmuError
from attitude_fmu.models.record import Boolean, Enumeration, Leaf, Real, defaults, leaves, unflatten
from attitude_fmu.models.system import Model, Run, check_rules

Load = Callable[[Path], Instance]
Built = Callable[[Entry, Kind], Path]
Values = dict[str, Any]

CASES = 9
"""Each choice of each parameter comes up in them, for none has more."""

START_TIMES = (0.0, 5.25, -3.0, 1e5)
STEPS: tuple[tuple[int, Callable[[random.Random], float]], ...] = (
    (40, lambda _: 1e-3),
    (30, lambda chance: chance.choice((0.0, 1e-4, 7.3e-3, chance.uniform(0.0, 0.01)))),
    (5, lambda _: 0.06),
)
"""How many communication steps a run has, and their lengths in s."""

SOONER: dict[str, Values] = {
    "AttitudeSensor": {"alignment.duration": 0.03, "solver.fusion.rest_time": 0.05, "filter.divider": 3},
    "TripodGimbal": {
        "shutter.start": 0.02,
        "shutter.period": 0.15,
        "press.force": 2.0,
        "press.start": 0.02,
        "knock.start": 0.05,
    },
    "Turntable": {
        **{f"profile.row[{row}].duration": 0.02 for row in (1, 2, 3)},
        **{
            f"axis.{axis}.{limit}_limit": 50.0
            for axis in ("outer", "middle", "inner")
            for limit in ("rate", "acceleration")
        },
        **{f"{noise}.rms[{axis}]": 0.01 for noise in ("tilt", "shaking") for axis in (1, 2, 3)},
        "profile.tolerance": 0.01,
        "shock.start": 0.02,
        "shock.peak[1]": 5.0,
        "shock.pulses": 3,
        "shock.period": 0.05,
    },
}
"""Centres of random parameters with which everything comes up within a short run, in every other case."""


@pytest.fixture(params=[EVERY_KIND, *CATALOGUE], ids=lambda entry: entry.identifier)
def entry(request: pytest.FixtureRequest) -> Entry:
    chosen: Entry = request.param
    return chosen


def _pair(built: Built, load: Load, entry: Entry) -> tuple[Instance, Instance]:
    native, python = (load(built(entry, kind)) for kind in KINDS)
    return native, python


def _choice(leaf: Leaf, case: int, place: int) -> int | None:
    """The choices of an enumeration or a switch in turn, in ever other combinations with those of the others."""
    if isinstance(leaf.fact, Boolean):
        return (case + place * (case // 2)) % 2
    if isinstance(leaf.fact, Enumeration):
        count = len(leaf.fact.items)
        return 1 + (case + place * (case // count)) % count
    return None


def _runs(model: Model, parameters: Values) -> bool:
    try:
        Run(model, unflatten(model.Parameters, parameters.values()), defaults(model.Inputs))
    except AttitudeFmuError:
        return False
    return True


def _parameters(model: Model, case: int, chance: random.Random) -> Values:
    centres = SOONER.get(model.name, {}) if case % 2 else {}
    while True:
        found = {}
        for place, leaf in enumerate(leaves(model.Parameters)):
            choice = _choice(leaf, case, place)
            centre = centres.get(leaf.name, leaf.start)
            found[leaf.name] = settable_near(leaf, centre, chance) if choice is None else choice
        together = reconciled(model, list(found.values()))
        if together is not None and _runs(model, dict(zip(found, together, strict=True))):
            return dict(zip(found, together, strict=True))


def _tuned(model: Model, parameters: Values, chance: random.Random) -> Values:
    """Other values of tunable parameters that go together with the rest."""
    tunable = [leaf for leaf in leaves(model.Parameters) if leaf.fact.tunable]
    changes = {leaf.name: settable_near(leaf, parameters[leaf.name], chance) for leaf in tunable}
    try:
        check_rules(model, unflatten(model.Parameters, (parameters | changes).values()), "")
    except AttitudeFmuError:
        return {}
    return changes


def _signal(leaf: Leaf, chance: random.Random) -> float:
    """A value as large as the quantity usually is; some are beyond what the real part takes, none of what is legal."""
    fact = leaf.fact
    if not isinstance(fact, Real) or chance.random() < 0.1:
        return settable_near(leaf, leaf.start, chance)
    moved = leaf.start + 0.3 * (completed(fact).nominal or 1.0) * chance.gauss(0.0, 1.0)
    return min(max(moved, -1e300 if fact.min is None else fact.min), 1e300 if fact.max is None else fact.max)


def _set(unit: Instance, values: Values) -> None:
    for name, value in values.items():
        unit[name] = value


def _signals(unit: Instance, model: Model, chance: random.Random) -> None:
    _set(unit, {leaf.name: _signal(leaf, chance) for leaf in leaves(model.Inputs)})


def _run(unit: Instance, model: Model, case: int) -> Iterator[dict[str, str]]:
    """One random run of an instance, and all its variables ever and again."""
    chance = random.Random(f"{model.name} {case}")
    parameters = _parameters(model, case, chance)
    time = chance.choice(START_TIMES)
    if chance.random() < 0.5:
        yield unit.bits()
    unit.fmu.setupExperiment(startTime=time)
    _set(unit, parameters)
    unit.fmu.enterInitializationMode()
    for _ in range(2):
        _signals(unit, model, chance)
        yield unit.bits()
    unit.fmu.exitInitializationMode()
    yield from _steps(unit, model, parameters, time, chance, *STEPS[case % len(STEPS)])


def _steps(
    unit: Instance,
    model: Model,
    parameters: Values,
    time: float,
    chance: random.Random,
    count: int,
    length: Callable[[random.Random], float],
) -> Iterator[dict[str, str]]:
    saved = (unit.serialised(), time, parameters)
    for _ in range(count):
        if chance.random() < 0.6:
            _signals(unit, model, chance)
        if chance.random() < 0.2:
            changes = _tuned(model, parameters, chance)
            _set(unit, changes)
            parameters = parameters | changes
            yield unit.bits()
        if chance.random() < 0.1:
            saved = (unit.serialised(), time, parameters)
        if chance.random() < 0.1:
            data, time, parameters = saved
            unit.restore(data)
            yield unit.bits()
        step = length(chance)
        try:
            unit.fmu.doStep(time, step)
        except FMICallException:
            yield {"the step": "refused", **unit.bits()}
            return
        time += step
        yield unit.bits()


@pytest.mark.parametrize("case", range(CASES))
def test_both_kinds_show_the_same_bits(built: Built, load: Load, entry: Entry, case: int) -> None:
    model = import_module(entry.module).MODEL
    native, python = _pair(built, load, entry)
    for round_ in range(2):  # the second time as reset leaves them
        runs = (_run(unit, model, case + CASES * round_) for unit in (native, python))
        for one, other in zip(*runs, strict=True):
            assert {name: bits for name, bits in one.items() if bits != other.get(name)} == {}
        for unit in (native, python):
            unit.fmu.reset()


# --- refusals


@pytest.mark.parametrize("case", REFUSED)
def test_bad_calls_are_refused_with_the_same_text_and_counted_alike(built: Built, load: Load, case: str) -> None:
    units = _pair(built, load, EVERY_KIND)
    call, _ = REFUSED[case]
    reasons = [unit.initialise().step(3).refusal(lambda unit=unit: call(unit)) for unit in units]
    assert reasons[0] == reasons[1]
    assert [unit["refused_calls"] for unit in units] == [1, 1]


def _stopped(unit: Instance) -> None:
    unit.initialise(choice=2, steps=10)
    unit.refusal(unit.step)


def _terminated(unit: Instance) -> None:
    unit.initialise().step(1)
    unit.fmu.terminate()


STAGES: dict[str, Callable[[Instance], Any]] = {
    "instantiated": lambda unit: None,
    "initialising": lambda unit: unit.fmu.enterInitializationMode(),
    "stepping": lambda unit: unit.initialise(),
    "disagreeing": lambda unit: unit.initialise().__setitem__("lower", 2.0),
    "stopped": _stopped,
    "terminated": _terminated,
}

CALLS: dict[str, Callable[[Instance], Any]] = {
    "setup": lambda unit: unit.fmu.setupExperiment(startTime=0.0),
    "endless start": lambda unit: unit.fmu.setupExperiment(startTime=1e12),
    "enter": lambda unit: unit.fmu.enterInitializationMode(),
    "exit": lambda unit: unit.fmu.exitInitializationMode(),
    "step": lambda unit: unit.step(1),
    "input": lambda unit: unit.__setitem__("rate[1]", 1.0),
    "fixed": lambda unit: unit.__setitem__("shape", 2),
    "tunable": lambda unit: unit.__setitem__("inverted", True),
    "nothing": lambda unit: unit.fmu.setReal([], []),
    "all": lambda unit: unit.bits(),
    "none": lambda unit: unit.fmu.getReal([]),
    "save": lambda unit: unit.serialised(),
    "restore": lambda unit: unit.restore(unit.serialised()),
    "terminate": lambda unit: unit.fmu.terminate(),
    "reset": lambda unit: unit.fmu.reset(),
}


def _outcome(unit: Instance, call: Callable[[Instance], Any]) -> str:
    unit.log.clear()
    try:
        call(unit)
    except FMICallException:
        return unit.log[-1].rpartition("\n")[2]
    return "taken"


def _outcomes(unit: Instance, *calls: Callable[[Instance], Any]) -> list[str]:
    return [*(_outcome(unit, call) for call in calls), str(unit["refused_calls"])]


@pytest.mark.parametrize("stage", STAGES)
def test_each_stage_takes_the_same_calls(built: Built, load: Load, stage: str) -> None:
    units = _pair(built, load, EVERY_KIND)
    refused = 0
    for name, call in CALLS.items():
        outcomes = []
        for unit in units:
            unit.fmu.reset()
            STAGES[stage](unit)
            outcomes.append((_outcome(unit, call), unit["refused_calls"]))
        assert outcomes[0] == outcomes[1], name
        refused += outcomes[0][0] != "taken"
    assert refused > 1


def test_a_state_whose_parameters_disagree_is_saved_restored_and_refused_alike(built: Built, load: Load) -> None:
    found = []
    for unit in _pair(built, load, EVERY_KIND):
        STAGES["disagreeing"](unit)
        data = unit.serialised()
        outcomes = _outcomes(
            unit,
            lambda unit: unit.__setitem__("lower", 0.0),
            lambda unit: unit.step(1),
            lambda unit, data=data: unit.restore(data),  # type: ignore[misc]
            lambda unit: unit.step(1),
            lambda unit: unit["shown.square"],
            lambda unit: unit["lower"],
            lambda unit: unit.__setitem__("gain", 3.0),
            lambda unit: unit.step(1),
        )
        found.append((outcomes, unit.bits()))
    assert found[0] == found[1]
    refused = "EveryKind.lower = 2: more than 100 % of the gain %s %d (allowed: 1 or less)"
    assert found[0][0] == ["taken"] * 3 + [refused] * 2 + ["taken"] * 3 + ["2"]


# --- numbers at their limits


FAR = (1e308, -1e308, 1e160, -1e160)


def _far(unit: Instance, name: str, value: float, is_late: bool) -> list[str]:
    """What a short run answers with one variable far off, set before or after initialisation, the inputs not at 0."""
    unit.fmu.reset()
    inputs = [v for v in unit.variables.values() if v.causality == "input" and v.type == "Real" and v.name != name]
    for i, one in enumerate(inputs):
        unit[one.name] = float(one.start) + 0.01 * (i % 7 - 2)

    def change(unit: Instance) -> None:
        unit[name] = value

    steps = [lambda unit, i=i: unit.step(1, start=i * 1e-3) for i in range(3)]
    begin = [lambda unit: unit.initialise(), steps[0]]
    calls = [*begin, change] if is_late else [change, *begin]
    return _outcomes(unit, *calls, *steps[1:], lambda unit: unit.bits())


@pytest.mark.parametrize("is_late", [False, True])
def test_numbers_that_run_away_are_refused_at_the_same_call_with_the_same_text(
    built: Built, load: Load, entry: Entry, is_late: bool
) -> None:
    units = _pair(built, load, entry)
    variables = [v for v in units[0].variables.values() if v.causality in ("parameter", "input") and v.type == "Real"]
    ran_away = set()
    for variable in variables:
        is_limited = variable.min is not None and variable.max is not None
        for value in FAR[:1] if is_limited else FAR:
            native, python = (_far(unit, variable.name, value, is_late) for unit in units)
            assert native == python, (variable.name, value)
            ran_away |= {text for text in native if "ran away" in text}
    assert bool(ran_away) == (entry.identifier in ("EveryKind", "AttitudeSensor"))


@pytest.fixture(scope="module")
def unlimited_fmus(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Both kinds of a variant of EveryKind whose integers know no limits."""
    folder = tmp_path_factory.mktemp("unlimited")
    source = Path(every_kind.__file__).read_text()
    for limited in ('Integer("key of all noise", min=0)', 'Integer("counts added to the register", min=-9, max=9, '):
        assert limited in source
        source = source.replace(limited, limited.partition(", m")[0] + (")" if limited.endswith(")") else ", "))
    (folder / "unlimited_model.py").write_text(source)
    with pytest.MonkeyPatch.context() as place:
        place.syspath_prepend(str(folder))
        return [build(Entry("Unlimited", "unlimited_model"), folder, kind) for kind in KINDS]


@pytest.fixture
def unlimited(unlimited_fmus: list[Path], load: Load) -> tuple[Instance, Instance]:
    native, python = map(load, unlimited_fmus)
    return native, python


LEAST = -(2**31)


def test_the_least_integer_is_set_read_saved_and_restored(unlimited: tuple[Instance, Instance]) -> None:
    for unit in unlimited:
        unit.initialise(**{"noise.seed": LEAST, "shift": LEAST})
        data = unit.serialised()
        unit["shift"] = 2**31 - 1
        unit.restore(data)
        assert (unit["noise.seed"], unit["shift"], unit["shown.count"]) == (LEAST, LEAST, LEAST)
        unit.step(1)
        assert unit["shown.count"] == LEAST + 1


def test_a_whole_number_that_is_no_fmi_integer_is_refused_alike(unlimited: tuple[Instance, Instance]) -> None:
    found = [
        _outcomes(unit.initialise(shift=2**31 - 1), lambda unit: unit.step(1), lambda unit: unit["shown.count"])
        for unit in unlimited
    ]
    assert found[0] == found[1] == ["taken", "Unlimited.shown.count = 2147483648 does not fit into an integer", "1"]


def test_a_negative_seed_gives_the_same_noise(unlimited: tuple[Instance, Instance]) -> None:
    noises = []
    for seed in (-1, LEAST, 1):
        for unit in unlimited:
            unit.fmu.reset()
            unit.initialise(**{"noise.seed": seed}).step(20)
        native, python = (unit.bits() for unit in unlimited)
        assert native == python
        noises.append(native["shown.rate[1]"])
    assert len(set(noises)) == 3
