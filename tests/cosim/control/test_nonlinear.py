"""A model as a nonlinear system is the model itself, and pure."""

from __future__ import annotations

import copy
import sys
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest

from attitude_fmu.cosim.control import (
    LinearisationRefusedError,
    ModelSystem,
    model_nlsys,
    model_ss,
    operating_point,
)
from attitude_fmu.fmu_src.catalogue import entry, model_of
from attitude_fmu.models.noise import normals, stream_of
from attitude_fmu.models.record import defaults, flatten, leaves, unflatten
from attitude_fmu.models.system import Run

sys.path.insert(0, str(Path(__file__).parent))
from small_models import model

SENSOR = "AttitudeSensor_ADXRS450_ADXL355"


class Drawn:
    """The model's own normals as inputs of its system, step by step."""

    def __init__(self, run: Run, system: ModelSystem) -> None:
        self.run, self.system = run, system
        self.calls = dict.fromkeys([task.name for task in run.model.tasks], 0)

    def inputs(self, values: list[float], counts: list[int]) -> Any:
        """Inputs and the normals of the calls between the clocks' counts before and now."""
        run, system = self.run, self.system
        u = np.zeros(system.ninputs)
        u[: len(values)] = values
        labels = {label: i for i, label in enumerate(system.input_labels)}
        seed = int(run.model.seed(run.parameters))
        for task in run.model.tasks:
            clock = [one.name for one in run.model.clocks].index(task.clock)
            every = int(task.every(run.coefficients))
            if task.chosen(run.parameters) is None or not task.normals:
                continue
            first, last = counts[clock] // every, run.counts[clock] // every
            for turn, call in enumerate(range(first + 1, last + 1)):
                for draw, value in enumerate(normals((seed, stream_of(task.name)), call, task.normals)):
                    name = f"noise_{task.name}"
                    label = f"{name}[{turn + 1},{draw + 1}]"
                    u[labels[label if label in labels else f"{name}[{draw + 1}]"]] = value
        return u


@pytest.mark.parametrize(
    ("name", "dt", "moved"),
    [
        ("AttitudeSensor", 0.002, {"rate[1]": 0.3, "specific_force[2]": 1.0}),  # clocks that do not divide each other
        ("AttitudeSensor", 0.003, {"rate[1]": 0.3}),
        ("TripodGimbal", 0.001, {"motor_torque.yaw": 0.02}),
        ("GimbalController", 0.001, {"attitude_valid": 1.0, "euler.yaw": 0.1}),
    ],
)
def test_simulated_with_the_models_own_noise_it_is_the_model(name: str, dt: float, moved: dict[str, float]) -> None:
    source = model_of(entry(name))
    system = model_nlsys(source, dt)
    still = defaults(source.Inputs)
    values = [float(moved.get(leaf.name, leaf.start)) for leaf in leaves(source.Inputs)]
    run = Run(source, defaults(source.Parameters), still)
    drawn = Drawn(run, system)
    x = system.initial_state
    for k in range(60):
        before = list(run.counts)
        run.advance(unflatten(source.Inputs, values), (k + 1) * dt)
        u = drawn.inputs(values, before)
        x = system.dynamics(k * dt, x, u)
        expected = [float(value) for value in flatten(run.outputs())]
        np.testing.assert_allclose(system.output((k + 1) * dt, x, u), expected, rtol=1e-12, atol=1e-12)


def test_both_functions_are_pure() -> None:
    system = model_nlsys(SENSOR, 0.002)
    u = np.zeros(system.ninputs)
    u[: len(system.constant_inputs)] = system.constant_inputs
    first = system.dynamics(0.0, system.initial_state, u)
    shown = system.output(0.002, first, u)
    system.dynamics(0.0, first * 1.1, 0.5 * u)
    np.testing.assert_array_equal(system.output(0.002, first, u), shown)
    np.testing.assert_array_equal(system.dynamics(0.0, system.initial_state, u), first)


def test_python_control_simulates_and_connects_it() -> None:
    """A probe under proportional feedback, in python-control, step by step by hand."""
    probe = model_nlsys(model(), 1.0, {"step": 0.25}, inputs="level", outputs="value", noise=False, name="probe")
    gain = control.ss([], [], [], [[0.5]], 1.0, inputs="error", outputs="level", name="gain")
    difference = control.summing_junction(["wanted", "-value_reading"], "error", dt=1.0)
    loop = control.interconnect([probe, gain, difference], inputs="wanted", outputs="value_reading")
    time = np.arange(12.0)
    found = control.input_output_response(loop, time, np.ones(12), probe.initial_state).outputs
    lag, shown, expected = 0.0, 0.0, []
    for _ in time:
        expected.append(shown)
        lag = 0.8**4 * lag + (1.0 - 0.8**4) * 0.5 * (1.0 - shown)
        shown = 0.25 * np.floor(lag / 0.25 + 0.5)
    np.testing.assert_allclose(np.squeeze(found), expected, atol=1e-12)


def test_copies_and_several_places_in_a_loop_do_not_disturb_each_other() -> None:
    probe = model_nlsys(model(), 1.0, {"step": 1e-6}, inputs="level", outputs="value", noise=False, name="probe")
    time, u = np.arange(8.0), np.ones(8)
    alone = control.input_output_response(probe, time, u, probe.initial_state).outputs
    for twin in (probe.copy(), copy.deepcopy(probe)):
        np.testing.assert_array_equal(control.input_output_response(twin, time, u, probe.initial_state).outputs, alone)
    both = control.InterconnectedSystem((probe, probe), inplist=[(0, 0), (1, 0)], outlist=[(0, 0), (1, 0)])
    start = np.tile(probe.initial_state, 2)
    found = control.input_output_response(both, time, np.vstack([u, 3.0 * u]), start).outputs
    np.testing.assert_array_equal(found[0], alone)
    np.testing.assert_allclose(found[1], 3.0 * alone, atol=4e-6)  # quantisers of 1e-6


def test_a_loop_of_two_of_them_is_the_loop_of_their_linear_models() -> None:
    probe = model_nlsys(model(), 1.0, {"step": 1e-9}, inputs="level", outputs="value", noise=False, name="probe")
    linear = model_ss(model(), 1.0, {"step": 1e-9}, inputs="level", outputs="value")
    time, u = np.arange(12.0), np.ones(12)
    loop = control.feedback(probe, probe)
    found = control.input_output_response(loop, time, u, np.tile(probe.initial_state, 2)).outputs
    expected = control.forced_response(control.feedback(linear, linear), time, u).outputs
    np.testing.assert_allclose(found, expected, atol=12e-9)  # a quantiser of 1e-9 each step


def test_its_linearisation_is_exact_where_finite_differences_see_a_quantiser() -> None:
    point = operating_point(SENSOR, 0.002)
    system = model_nlsys(SENSOR, 0.002, operating_point=point, inputs="rate", outputs="rate_measured")
    u = np.zeros(system.ninputs)
    whole = control.linearize(system, system.initial_state, u, t=0.0)
    assert whole.nstates == system.nstates
    reduced = model_ss(SENSOR, 0.002, operating_point=point, inputs="rate", outputs="rate_measured")
    for z in np.exp(2j * np.pi * 0.002 * np.array([0.5, 20.0, 200.0])):
        np.testing.assert_allclose(whole(z)[:, :3], reduced(z), rtol=1e-9, atol=1e-12)
    blind = control.NonlinearIOSystem.linearize(system, system.initial_state, u)
    assert not np.allclose(blind(z)[:, :3], reduced(z), rtol=0.1)


def test_the_noise_inputs_are_in_the_linearisation() -> None:
    system = model_nlsys(model(), 1.0, {"noise": 0.3}, inputs="level", outputs="value")
    whole = control.linearize(system, system.initial_state, np.zeros(system.ninputs))
    column = system.input_labels.index("noise_read[1]")
    row = system.state_labels.index("shown")
    assert whole.B[row, column] == pytest.approx(0.3)
    assert control.linearize(system, system.initial_state, copy_names=True).input_labels == system.input_labels


def test_unknown_signals_are_refused() -> None:
    with pytest.raises(LinearisationRefusedError, match="no output of Probe called valu; did you mean value"):
        model_nlsys(model(), 1.0, outputs="valu")
