"""FMUs as nonlinear systems: faithful states, exact simulation, python-control's own operations, refusals."""

from __future__ import annotations

import gc
import math
import shutil
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import control as ct
import numpy as np
import pytest
from fmpy import extract, instantiate_fmu, read_model_description
from pendulum_building import build_pendulum

from attitude_fmu.cosim.control import FmuSystem, fmu_nlsys, refuse_algebraic_loop
from attitude_fmu.cosim.errors import LinearisationRefusedError, RunStoppedError, SystemRefusedError

STEP = 0.01
TIME = STEP * np.arange(200)
TORQUE = np.sin(3.0 * TIME) + 0.2

# --- simulation


def stepped(fmu: Path, name: str, values: np.ndarray, output: str, step: float) -> list[float]:
    """The output at each communication point by FMPy's own calls."""
    folder = extract(str(fmu))
    description = read_model_description(folder, validate=False)
    reference = {variable.name: variable.valueReference for variable in description.modelVariables}
    unit = instantiate_fmu(folder, description, "CoSimulation")
    unit.setupExperiment(startTime=0.0)
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    found = []
    for k, value in enumerate(values):
        found += unit.getReal([reference[output]])
        unit.setReal([reference[name]], [value])
        unit.doStep(k * step, step)
    unit.terminate()
    unit.freeInstance()
    shutil.rmtree(folder)
    return found


def test_a_foreign_fmu_runs_as_fmpy_runs_it(pendulum: Path) -> None:
    with fmu_nlsys(pendulum, STEP, "torque", "angle") as system:
        response = ct.input_output_response(system, TIME, TORQUE)
    assert np.array_equal(response.outputs, stepped(pendulum, "torque", TORQUE, "angle", STEP))


OURS = {
    "AttitudeSensor": ("rate[3]", "euler.yaw", 0.05),
    "TripodGimbal": ("motor_torque.yaw", "joint_rate.yaw", 0.05),
    "GimbalController": ("euler.yaw", "motor_torque.yaw", 0.05),
}


@pytest.mark.parametrize("kind", ["native", "python"])
@pytest.mark.parametrize("identifier", OURS)
def test_our_fmus_run_as_fmpy_runs_them(identifier: str, kind: str, dist: Path, python_dist: Path) -> None:
    name, output, size = OURS[identifier]
    fmu = (dist if kind == "native" else python_dist) / f"{identifier}.fmu"
    time = 1e-3 * np.arange(60)
    values = size * np.cos(40.0 * time)
    with fmu_nlsys(fmu, 1e-3, name, output) as system:
        response = ct.input_output_response(system, time, values)
    assert np.array_equal(response.outputs, stepped(fmu, name, values, output, 1e-3))


def test_a_foreign_slave_in_python_runs_in_closed_form(slave: Callable[..., Path]) -> None:
    with fmu_nlsys(slave("integrator"), STEP, "u", "x", {"x0": 0.5}) as system:
        response = ct.forced_response(system, TIME, TORQUE)
    expected = 0.5 + STEP * np.concatenate(([0.0], np.cumsum(TORQUE)[:-1]))
    assert response.outputs == pytest.approx(expected, abs=1e-13)


def test_a_loop_through_interconnect_is_that_of_the_difference_equation(slave: Callable[..., Path]) -> None:
    with fmu_nlsys(slave("integrator"), STEP, "u", "x", {"x0": 1.0}, name="plant") as plant:
        gain = ct.ss([], [], [], [[-2.0]], STEP, inputs=["x"], outputs=["u"], name="gain")
        loop = ct.interconnect([plant, gain], inputs=[], outputs=["x"])
        refuse_algebraic_loop(loop)
        response = ct.input_output_response(loop, TIME)
    assert response.outputs.ravel() == pytest.approx((1.0 - 2.0 * STEP) ** np.arange(200), rel=1e-12)


def test_feedback_goes_to_where_the_closed_form_has_it(pendulum: Path) -> None:
    with fmu_nlsys(pendulum, STEP, "torque", "angle") as system:
        loop = ct.feedback(system, ct.ss([], [], [], [[4.0]], STEP))
        response = ct.input_output_response(loop, STEP * np.arange(4000), 1.3)
    angle = response.outputs[-1]
    # at rest: torque = k (a) = 9 sin(a), torque = 1.3 - 4 a; 0.4/2 of damping leaves exp(-0.2 * 40)
    assert 1.3 - 4.0 * angle == pytest.approx(9.0 * math.sin(angle), abs=3e-3)


def test_one_system_in_two_places_is_two_pendulums(pendulum: Path) -> None:
    with fmu_nlsys(pendulum, STEP, "torque", "angle", name="one") as one:
        with pytest.warns(UserWarning, match="duplicate"):
            both = ct.InterconnectedSystem((one, one), inplist=[(0, 0), (1, 0)], outlist=[(0, 0), (1, 0)])
        response = ct.input_output_response(both, TIME, np.vstack((TORQUE, -0.5 * TORQUE)))
        alone = [ct.input_output_response(one, TIME, u).outputs for u in (TORQUE, -0.5 * TORQUE)]
    assert np.array_equal(response.outputs, np.array(alone))


def test_whole_numbers_and_truths_are_floats(pendulum: Path) -> None:
    with fmu_nlsys(pendulum, STEP, ["double", "torque"], ["count", "rate"]) as system:
        given = np.vstack((np.arange(200) % 2, TORQUE))
        response = ct.input_output_response(system, TIME, given)
        assert system.output_labels == ["count", "rate"]
    assert np.array_equal(response.outputs[0], np.concatenate(([0.0], np.cumsum(1.0 + given[0])[:-1])))
    assert np.ptp(response.outputs[1]) > 0.1


def test_a_tunable_parameter_may_be_an_input(pendulum: Path) -> None:
    with fmu_nlsys(pendulum, STEP, ["torque", "damping"], "rate") as system:
        given = ct.input_output_response(system, TIME, [1.0, 8.0]).outputs[0]
    with fmu_nlsys(pendulum, STEP, "torque", "rate", {"damping": 8.0}) as system:
        assert np.array_equal(ct.input_output_response(system, TIME, 1.0).outputs, given)


def test_names_are_stems_or_labels_of_ones_own(dist: Path) -> None:
    with fmu_nlsys(
        dist / "AttitudeSensor.fmu", 1e-3, {"rate[3]": "r", "specific_force": "f"}, ["euler", "register.rate"]
    ) as sensor:
        assert sensor.input_labels == ["r", *(f"specific_force[{axis}]" for axis in (1, 2, 3))]
        assert sensor.output_labels[:4] == ["euler_yaw", "euler_pitch", "euler_roll", "register_rate[1]"]


# --- states are values


@pytest.fixture
def system(pendulum: Path) -> FmuSystem:
    return fmu_nlsys(pendulum, STEP, "torque", ["angle", "rate", "count"])


def test_the_same_state_and_input_lead_to_the_same_state(system: FmuSystem) -> None:
    first = system.dynamics(0.0, [0.0], [1.0])
    other = system.dynamics(0.0, [0.0], [2.0])
    assert np.array_equal(system.dynamics(0.0, [0.0], [1.0]), first)
    assert first != other
    assert np.array_equal(system.output(0.0, [0.0], [5.0]), [0.0, 0.0, 0.0])


def test_asking_in_any_order_gives_the_same_bits(system: FmuSystem) -> None:
    chance = np.random.default_rng(1)
    states = [np.zeros(1)]
    for _ in range(900):  # farther than states are kept
        states.append(system.dynamics(0.0, states[-1], chance.normal(size=1)))
    order = chance.permutation(len(states))[:150]
    scattered = {place: system.output(0.0, states[place], [0.0]) for place in order}
    straight = [system.output(0.0, state, [0.0]) for state in states]
    assert all(np.array_equal(scattered[place], straight[place]) for place in order)
    assert [row[2] for row in straight] == list(range(901))


def test_a_run_can_be_taken_up_anywhere(system: FmuSystem) -> None:
    whole = ct.input_output_response(system, TIME, TORQUE)
    rest = ct.input_output_response(system, TIME[:80], TORQUE[120:], X0=whole.states[0, 120:121])
    assert np.array_equal(rest.outputs, whole.outputs[:, 120:])
    assert np.array_equal(rest.states, whole.states[:, 120:])
    assert system.time(whole.states[0, 120]) == pytest.approx(120 * STEP)


def test_a_state_goes_as_bytes_to_another_instance(system: FmuSystem, pendulum: Path) -> None:
    whole = ct.input_output_response(system, TIME, TORQUE)
    data = system.state_bytes(whole.states[0, 77])
    with fmu_nlsys(pendulum, STEP, "torque", ["angle", "rate", "count"]) as other:
        start = other.state_from(data)
        rest = ct.input_output_response(other, TIME[:123], TORQUE[77:], X0=start)
        assert other.time(start) == pytest.approx(77 * STEP)
    assert np.array_equal(rest.outputs, whole.outputs[:, 77:])


def test_nan_in_a_state_survives(system: FmuSystem) -> None:
    broken = system.dynamics(0.0, [0.0], [math.nan])
    later = system.dynamics(0.0, system.dynamics(0.0, broken, [0.0]), [0.0])
    assert np.all(np.isnan(system.output(0.0, later, [0.0])[:2]))
    assert np.array_equal(system.output(0.0, later, [0.0])[2:], [3.0])
    assert np.array_equal(system.dynamics(0.0, [0.0], [math.nan]), broken)


def test_threads_that_share_a_system_take_turns(system: FmuSystem, pendulum: Path) -> None:
    time = STEP * np.arange(1500)
    given = np.random.default_rng(3).normal(size=(4, len(time)))
    with fmu_nlsys(pendulum, STEP, "torque", ["angle", "rate", "count"]) as other:
        alone = [ct.input_output_response(other, time, u).outputs for u in given]
    with ThreadPoolExecutor(len(given)) as pool:
        together = list(pool.map(lambda u: ct.input_output_response(system, time, u).outputs, given))
    assert all(np.array_equal(*pair) for pair in zip(together, alone, strict=True))


REMEMBERED = 40


@pytest.fixture
def forgetful(pendulum: Path) -> FmuSystem:
    return fmu_nlsys(pendulum, STEP, "torque", ["angle", "rate", "count"], remembered=REMEMBERED)


def test_a_long_run_takes_no_more_memory(forgetful: FmuSystem, system: FmuSystem) -> None:
    time = STEP * np.arange(3000)
    given = np.random.default_rng(4).normal(size=len(time))
    found = ct.input_output_response(forgetful, time, given)
    assert np.array_equal(found.outputs, ct.input_output_response(system, time, given).outputs)
    states = forgetful._states
    assert len(states._states) <= 2 * REMEMBERED + 1
    assert len(states._following) <= 2 * REMEMBERED
    assert len(states.fmu._saved) <= 2 * REMEMBERED + 1
    for back in range(REMEMBERED):
        assert np.array_equal(forgetful.output(0.0, found.states[:, -1 - back], [0.0]), found.outputs[:, -1 - back])
    assert np.array_equal(forgetful.output(0.0, [0.0], [0.0]), found.outputs[:, 0])
    with pytest.raises(SystemRefusedError, match=f"the last {REMEMBERED} that were used.*remembered="):
        forgetful.output(0.0, found.states[:, 100], [0.0])


def test_what_is_used_is_not_forgotten(forgetful: FmuSystem, system: FmuSystem) -> None:
    # a tree of states: going on from one of the 8 last leaves, 3 steps at a time, uses fewer than 40 states
    chance = np.random.default_rng(5)
    leaves = [(np.zeros(1), np.zeros(1))]
    for _ in range(600):
        state, same = leaves[chance.integers(len(leaves))]
        for u in chance.normal(size=(3, 1)):
            state, same = forgetful.dynamics(0.0, state, u), system.dynamics(0.0, same, u)
        assert np.array_equal(forgetful.output(0.0, state, [0.0]), system.output(0.0, same, [0.0]))
        leaves = [*leaves, (state, same)][-8:]
    assert len(forgetful._states._states) <= 2 * REMEMBERED + 1


def test_a_state_that_is_gone_on_from_again_and_again_stays(forgetful: FmuSystem) -> None:
    first = forgetful.dynamics(0.0, [0.0], [1.0])
    second = forgetful.dynamics(0.0, first, [2.0])
    third = forgetful.dynamics(0.0, second, [3.0])
    shown = forgetful.output(0.0, second, [0.0])
    for u in np.random.default_rng(6).normal(size=(5 * REMEMBERED, 1)):
        forgetful.dynamics(0.0, second, u)  # looked for by the FMU
        assert np.array_equal(forgetful.dynamics(0.0, second, [3.0]), third)  # known without it
    assert np.array_equal(forgetful.output(0.0, second, [0.0]), shown)
    assert np.array_equal(forgetful.dynamics(0.0, second, [3.0]), third)


def test_many_states_outlive_those_they_came_from(pendulum: Path, system: FmuSystem) -> None:
    # a chain, then a branch from each of its states, then the branches looked at: the chain is what is forgotten
    count = 200
    with fmu_nlsys(pendulum, STEP, "torque", ["angle", "rate", "count"], remembered=count) as bounded:
        found = []
        for one in (bounded, system):
            chain = [np.zeros(1)]
            for _ in range(count):
                chain.append(one.dynamics(0.0, chain[-1], [1.0]))
            branches = [one.dynamics(0.0, state, [5.0]) for state in chain[1:]]
            for branch in branches:
                one.output(0.0, branch, [0.0])
            one.dynamics(0.0, branches[-1], [0.0])  # one too many
            found.append([one.output(0.0, branch, [0.0]) for branch in branches[1:]])
        with pytest.raises(SystemRefusedError, match="that were used"):
            bounded.output(0.0, chain[1], [0.0])
    assert np.array_equal(*found)


def test_states_from_bytes_are_bounded_as_well(forgetful: FmuSystem) -> None:
    state = forgetful.dynamics(0.0, [0.0], [1.0])
    data, shown = forgetful.state_bytes(state), forgetful.output(0.0, state, [0.0])
    for _ in range(300):
        restored = forgetful.state_from(data)
    assert len(forgetful._states.fmu._saved) <= 2 * REMEMBERED + 1
    assert np.array_equal(forgetful.output(0.0, restored, [0.0]), shown)


def test_start_time_is_the_fmus(slave: Callable[..., Path]) -> None:
    with fmu_nlsys(slave("integrator"), STEP, "u", "last_time", start_time=5.0) as late:
        response = ct.input_output_response(late, TIME, TORQUE)
    assert response.outputs[1:] == pytest.approx(5.0 + TIME[:-1], abs=1e-12)


def test_without_delay_an_output_follows_its_input_at_once(pendulum: Path) -> None:
    held, through = (
        ct.input_output_response(fmu_nlsys(pendulum, STEP, "torque", "rate", coupling_delay=delay), TIME, TORQUE)
        for delay in (1, 0)
    )
    assert np.array_equal(through.outputs[:-1], held.outputs[1:])


def test_it_is_freed_with_the_last_that_refers_to_it(pendulum: Path) -> None:
    system = fmu_nlsys(pendulum, STEP)
    folder = system._states.fmu._slave.fmu.unzipDirectory
    assert Path(folder).is_dir()
    del system
    gc.collect()
    assert not Path(folder).is_dir()


# --- linearised


@pytest.mark.parametrize("delay", [0, 1])
def test_linearised_exactly_by_its_own_derivatives(pendulum: Path, delay: int) -> None:
    outputs = ["angle", "rate", "load"]
    with fmu_nlsys(pendulum, STEP, "torque", outputs, coupling_delay=delay) as system:
        rest = ct.input_output_response(system, STEP * np.arange(6000), 3.0).states[:, -1]
        linear = ct.linearize(system, rest, 3.0)
        small = 1e-5 * np.random.default_rng(2).normal(size=300)
        time = STEP * np.arange(300)
        moved = ct.input_output_response(system, time, 3.0 + small, X0=rest).outputs
        level = ct.input_output_response(system, time, 3.0, X0=rest).outputs
    expected = ct.forced_response(linear, time, small).outputs
    # what is left is of second order: 9/2 sin(a) da^2, and the subtraction's rounding
    assert np.max(np.abs(moved - level - expected), axis=1) / np.max(np.abs(expected), axis=1) == pytest.approx(
        0.0, abs=1e-5
    )
    assert linear.input_labels == ["torque"]
    assert linear.output_labels == outputs
    assert linear.state_labels[:2] == ["angle", "rate"]


def test_ours_are_not_linearised_from_outside(dist: Path) -> None:
    with (
        fmu_nlsys(dist / "TripodGimbal.fmu", 1e-3) as gimbal,
        pytest.raises(LinearisationRefusedError, match="lists no derivatives.*model_ss.*fmu_frd"),
    ):
        ct.linearize(gimbal, 0.0, 0.0)


def test_a_loop_with_an_fmu_is_not_linearised_by_differences(system: FmuSystem) -> None:
    loop = ct.feedback(system, ct.ss([], [], [], [[1.0, 0.0, 0.0]], STEP))
    with pytest.raises(SystemRefusedError, match="none of its states.*model_ss"):
        ct.linearize(loop, 0.0, 0.0)


# --- refusals


def refusal(path: Path, dt: float = STEP, **settings: object) -> str:
    with pytest.raises(SystemRefusedError) as caught:
        fmu_nlsys(path, dt, **settings)  # type: ignore[arg-type]
    return str(caught.value)


def test_an_fmu_without_saved_states_is_refused(slave: Callable[..., Path]) -> None:
    text = refusal(slave("integrator", saves=False))
    assert "cannot save its state" in text
    assert "fmu_frd" in text


def test_an_fmu_that_saves_only_a_part_is_refused(slave: Callable[..., Path], tmp_path: Path) -> None:
    source = tmp_path / "forgetful.py"
    source.write_text(
        "from pythonfmu import *\n"
        "class Forgetful(Fmi2Slave):\n"
        "    def __init__(self, **kwargs):\n"
        "        super().__init__(**kwargs)\n"
        "        self.y, self._hidden = 0.0, 0.0\n"
        "        self.register_variable(Real('y', causality=Fmi2Causality.output))\n"
        "    def do_step(self, current_time, step_size):\n"
        "        self._hidden += 1.0\n"
        "        self.y = self._hidden\n"
        "        return True\n"
    )
    assert "does not come back to its saved state: y goes on differently" in refusal(
        slave("forgetful", source=tmp_path)
    )


@pytest.mark.parametrize("dt", [0, -0.01, True, math.nan, math.inf])
def test_a_sampling_time_that_is_none_is_refused(pendulum: Path, dt: float) -> None:
    assert "sampled system" in refusal(pendulum, dt)


def test_an_fmu_of_one_step_size_wants_that(tmp_path: Path) -> None:
    fmu = build_pendulum(tmp_path / "fixed", canHandleVariableCommunicationStepSize="false")
    assert "takes steps of 0.01 s only; give dt=0.01" in refusal(fmu, 0.02)
    fmu_nlsys(fmu, 0.01).close()


def test_two_sampling_times_do_not_go_together(pendulum: Path, system: FmuSystem) -> None:
    with fmu_nlsys(pendulum, 0.02, "torque", "angle") as slow, pytest.raises(ValueError, match="timebase"):
        ct.series(slow, system)


def test_times_that_are_not_dt_apart_are_refused(system: FmuSystem) -> None:
    with pytest.raises(ValueError, match="sampling time"):
        ct.input_output_response(system, 2.0 * TIME, TORQUE)


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ({"inputs": "torqe"}, "no input 'torqe'; did you mean torque"),
        ({"outputs": ["angle", "anglee"]}, "no output 'anglee'; did you mean angle"),
        ({"inputs": "angle"}, "no input 'angle'"),
        ({"parameters": {"dampin": 1.0}}, "did you mean damping"),
        ({"parameters": {"damping": "much"}}, "damping = much: not a finite number"),
        ({"outputs": {"angle": "y", "rate": "y"}}, "two outputs are called y"),
        ({"coupling_delay": 2}, "control.tf([1], [1, 0], 0.01)"),
        ({"remembered": 0}, "at least 1 state"),
    ],
)
def test_names_and_values_that_are_not_there_are_refused(
    pendulum: Path, settings: dict[str, object], reason: str
) -> None:
    assert reason in refusal(pendulum, **settings)


@pytest.mark.parametrize("x", [0.5, -1.0, 1e9, math.nan])
def test_numbers_that_are_no_states_are_refused(system: FmuSystem, x: float) -> None:
    with pytest.raises(SystemRefusedError, match="none of its states"):
        system.dynamics(0.0, [x], [0.0])


def test_another_systems_state_is_refused(system: FmuSystem, pendulum: Path) -> None:
    with fmu_nlsys(pendulum, STEP, "torque", "angle") as other:
        state = other.dynamics(0.0, [0.0], [0.0])
        with pytest.raises(SystemRefusedError, match="none of its states"):
            system.output(0.0, state, [0.0])


def test_a_closed_system_says_so(pendulum: Path) -> None:
    system = fmu_nlsys(pendulum, STEP, "torque", "angle")
    system.close()
    system.close()
    with pytest.raises(SystemRefusedError, match="Pendulum is closed; make the system anew"):
        system.dynamics(0.0, [0.0], [0.0])


def test_an_input_that_the_fmu_refuses_leaves_the_system_whole(dist: Path) -> None:
    with fmu_nlsys(dist / "AttitudeSensor.fmu", 1e-3, "temperature", "euler") as sensor:
        state = sensor.dynamics(0.0, [0.0], [300.0])
        before = sensor.output(0.0, state, [300.0])
        with pytest.raises(RunStoppedError, match="temperature = 25 K"):
            sensor.dynamics(0.0, state, [25.0])
        assert np.array_equal(sensor.output(0.0, state, [300.0]), before)
        sensor.dynamics(0.0, state, [300.0])


def test_a_whole_number_is_wanted_where_one_goes(pendulum: Path) -> None:
    with (
        fmu_nlsys(pendulum, STEP, "double", "count") as system,
        pytest.raises(SystemRefusedError, match="double = 0.5"),
    ):
        system.dynamics(0.0, [0.0], [0.5])
