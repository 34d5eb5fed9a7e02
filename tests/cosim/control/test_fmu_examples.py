"""The examples in the docstrings of the modules that run FMUs."""

from __future__ import annotations

import doctest
from pathlib import Path
from types import ModuleType

import pytest

from attitude_fmu.cosim.control import fmu_systems, frequency


@pytest.mark.parametrize("module", [fmu_systems, frequency], ids=lambda module: module.__name__.rpartition(".")[2])
def test_examples_run_as_printed(
    module: ModuleType, dist: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "dist").symlink_to(dist, target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    failed, attempted = doctest.testmod(module)
    assert attempted >= 2
    assert not failed
