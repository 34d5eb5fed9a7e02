"""The examples in the docstrings run and give what they say."""

from __future__ import annotations

import doctest
import importlib

import pytest


@pytest.mark.parametrize("name", ["continuous", "linear", "noise", "nonlinear"])
def test_the_examples_of_a_module_run(name: str) -> None:
    module = importlib.import_module(f"attitude_fmu.cosim.control.{name}")
    found = doctest.testmod(module)
    assert found.attempted > 0
    assert found.failed == 0


def test_the_example_of_the_operating_point_runs() -> None:
    # the package's function of this name hides the module
    from attitude_fmu.cosim.control import operating_point

    globs = {"operating_point": operating_point}
    examples = doctest.DocTestFinder().find(operating_point, globs=globs)
    results = [doctest.DocTestRunner().run(example) for example in examples]
    assert sum(result.attempted for result in results) > 0
    assert sum(result.failed for result in results) == 0
