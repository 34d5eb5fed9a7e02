from __future__ import annotations

from collections.abc import Callable
from typing import Any

import every_kind
import pytest

from attitude_fmu.fmu_src.failure import FailedCall
from attitude_fmu.fmu_src.interface import interface_of
from attitude_fmu.fmu_src.slave import ModelSlave

REFERENCES = {variable.name: variable.value_reference for variable in interface_of(every_kind.MODEL).variables}


class _Slave(ModelSlave):
    model = every_kind.MODEL
    fingerprint = "0" * 64


def _set(name: str, value: float) -> Callable[[Any], Any]:
    return lambda slave: slave.set_real([REFERENCES[name]], [value])


def _break(slave: Any) -> None:
    slave.set_integer([REFERENCES["choice"], REFERENCES["steps"]], [2, 10])
    slave.do_step(0.0, 1e-3)


def _lose(slave: Any) -> None:
    slave._values = None
    slave.get_real([0])


CASES: dict[str, tuple[Callable[[Any], Any], str]] = {
    "out of range": (_set("temperature", 25.0), "{0}.temperature = 25 K: too small, kelvin wanted (allowed: "),
    "fixed": (_set("period", 2e-3), "{0}.period = 0.002 s: fixed, can be set only before the end of initialisation ("),
    "disagreeing": (
        lambda slave: (_set("lower", 2.0)(slave), slave.do_step(0.0, 1e-3)),
        "{0}.lower = 2: more than 100 %% of the gain %%s %%d (allowed: ",
    ),
    "no such variable": (lambda slave: slave.get_real([4711]), "{0}: there is no variable with value reference 4711"),
    "output": (_set("shown.rate[1]", 1.0), "{0}: shown.rate[1] cannot be set: its causality is output"),
    "wrong time": (lambda slave: slave.enter_initialization_mode(), "{0}: fmi2EnterInitializationMode refused: "),
    "failed step": (_break, "{0}: task sample at t = 0.001 s: float division by zero"),
    "our own mistake": (_lose, "{0}: TypeError: "),
}


def _message(instance: str, call: Callable[[Any], Any]) -> str:
    slave = _Slave(instance_name=instance)
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    with pytest.raises(FailedCall) as caught:
        call(slave)
    return repr(caught.value)


@pytest.mark.parametrize("instance", ["i", "shown", "period", "there", "TypeError", "unit 1", "ümlaut"])
@pytest.mark.parametrize("case", CASES)
def test_every_message_begins_with_the_instance_once(case: str, instance: str) -> None:
    call, beginning = CASES[case]
    message = _message(instance, call)
    assert message.startswith(beginning.format(instance))
    assert message.removeprefix(instance) == _message("Q", call).removeprefix("Q")
