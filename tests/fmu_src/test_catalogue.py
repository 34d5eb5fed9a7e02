"""The FMUs of the catalogue, whatever they model."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from fmu_instance import Instance

from attitude_fmu.fmu_src.catalogue import CATALOGUE, Entry, Kind

Load = Callable[..., Instance]
COMMON = 0.73
"""s, a whole number of every communication step below."""


@pytest.fixture(scope="module", params=CATALOGUE, ids=lambda entry: entry.identifier)
def archive(request: pytest.FixtureRequest, built: Callable[[Entry, Kind], Path], kind: Kind) -> Path:
    return built(request.param, kind)


def test_communication_steps_of_any_length_give_the_same_bits(archive: Path, load: Load) -> None:
    shown = []
    for length in (1e-3, 5e-3, 7.3e-3, 10e-3):
        unit = load(archive).initialise()
        for part in (1, 2):
            unit.step(round(COMMON / length), length, start=(part - 1) * COMMON)
            shown.append((part, unit.bits()))
    assert all(bits == shown[part - 1][1] for part, bits in shown)


def test_a_saved_state_goes_on_in_another_instance(archive: Path, load: Load) -> None:
    one, other = load(archive).initialise(), load(archive)
    one.step(20)
    other.restore(one.serialised())
    for unit in (one, other):
        unit.step(20, start=20e-3)
    assert other.bits() == one.bits()


def test_reset_is_like_new(archive: Path, load: Load) -> None:
    fresh, used = load(archive), load(archive)
    used.initialise().step(5)
    used.fmu.reset()
    for unit in (fresh, used):
        unit.initialise().step(20)
    assert used.bits() == fresh.bits()
