"""Algebraic loops are told by name, and only where there are some: python-control runs what is not refused."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import control as ct
import numpy as np
import pytest
from small_models import model

from attitude_fmu.cosim.control import FmuSystem, fmu_nlsys, model_nlsys, refuse_algebraic_loop
from attitude_fmu.cosim.errors import SystemRefusedError

STEP = 0.01


def gain(value: float, name: str, dt: float = STEP) -> ct.StateSpace:
    return ct.ss([], [], [], [[value]], dt, name=name)


@pytest.fixture(params=[0, 1])
def swing(pendulum: Path, request: pytest.FixtureRequest) -> Iterator[FmuSystem]:
    with fmu_nlsys(pendulum, STEP, "torque", "rate", name="swing", coupling_delay=request.param) as made:
        yield made


def test_an_algebraic_loop_is_told_by_name(pendulum: Path) -> None:
    with fmu_nlsys(pendulum, STEP, "torque", "rate", name="swing", coupling_delay=0) as swing:
        gain = ct.ss([], [], [], [[3.0]], STEP, name="brake")
        with pytest.raises(SystemRefusedError, match=r"swing\.torque.*coupling_delay=1.*control\.tf") as caught:
            refuse_algebraic_loop(ct.feedback(swing, gain))
        assert "brake.u[0]" in str(caught.value)
        refuse_algebraic_loop(ct.feedback(swing, ct.tf([3.0], [1.0, 0.0], STEP)))
        refuse_algebraic_loop(ct.series(gain, swing))


def judged_as_python_control_does(system: ct.InterconnectedSystem) -> bool:
    """Whether it is refused; what is not, python-control runs, and what is, it stops at."""
    time = system.dt * np.arange(5)
    try:
        refuse_algebraic_loop(system)
    except SystemRefusedError:
        with pytest.raises(RuntimeError, match="algebraic loop"):
            ct.input_output_response(system, time, np.ones((system.ninputs, 5)))
        return True
    ct.input_output_response(system, time, np.ones((system.ninputs, 5)))
    return False


def test_an_fmu_within_an_interconnection_is_looked_at(swing: FmuSystem) -> None:
    nested = ct.series(ct.series(gain(1.0, "inner"), swing), gain(1.0, "outer"))
    assert judged_as_python_control_does(ct.feedback(nested, gain(0.5, "brake"))) == (swing.coupling_delay == 0)


def test_a_loop_within_an_interconnection_is_told_by_name(swing: FmuSystem) -> None:
    inner = ct.feedback(swing, gain(0.5, "brake"))
    outer = ct.feedback(ct.series(gain(1.0, "amplifier"), inner), ct.tf([1.0], [1.0, 0.0], STEP))
    refused = judged_as_python_control_does(outer)
    assert refused == (swing.coupling_delay == 0)
    if refused:
        with pytest.raises(SystemRefusedError, match=r"swing\.torque") as caught:
            refuse_algebraic_loop(outer)
        assert "brake.u[0]" in str(caught.value)
        assert "amplifier" not in str(caught.value)


def test_two_ways_through_an_interconnection_are_kept_apart() -> None:
    # y1 = u1 at once, y2 = u2 a step later: a loop from y2 to u1 and from y1 to u2 has a step in it
    late = ct.nlsys(lambda t, x, u, p: u, lambda t, x, u, p: x, inputs=1, outputs=1, states=1, dt=STEP, name="late")
    shift = ct.tf([1.0], [1.0, 0.0], STEP, name="shift")
    for slow, refused in ((shift, False), (late, True)):  # of a function nothing is known
        ports = [(0, 0), (1, 0)]
        pair = ct.InterconnectedSystem((gain(1.0, "quick"), slow), inplist=ports, outlist=ports)
        crossed = ct.feedback(pair, ct.ss([], [], [], [[0.0, 0.5], [0.5, 0.0]], STEP, name="cross"))
        if refused:
            with pytest.raises(SystemRefusedError):
                refuse_algebraic_loop(crossed)
        else:
            refuse_algebraic_loop(crossed)


def test_our_models_and_bare_states_answer_after_the_step() -> None:
    ours = model_nlsys(model(), 1.0, inputs="level", outputs="value", noise=False, name="probe")
    bare = ct.nlsys(lambda t, x, u, p: 0.5 * x + u, None, inputs=1, states=1, dt=1.0, name="bare")
    for part in (ours, bare):
        assert not judged_as_python_control_does(ct.feedback(part, gain(0.5, "brake", 1.0)))
