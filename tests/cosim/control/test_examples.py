"""The examples in the docstrings run and give what they say, and whatever is public has one, here or in the docs."""

from __future__ import annotations

import doctest
import importlib
import inspect
import re
import typing
from pathlib import Path

import pytest

from attitude_fmu.cosim import control

ROOT = Path(__file__).parents[3]
WITH_EXAMPLES = {
    path.stem: text
    for path in sorted((ROOT / "cosim" / "control").glob("*.py"))
    if ">>> " in (text := path.read_text(encoding="utf-8"))
}


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_the_examples_of_a_module_run(name: str, dist: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    module = importlib.import_module(f"{control.__name__}.{name}")
    (tmp_path / "dist").symlink_to(dist, target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    failed, attempted = doctest.testmod(module)
    assert attempted == len(re.findall(r"^ *>>> ", WITH_EXAMPLES[name], re.MULTILINE))
    assert not failed


def exampled() -> set[str]:
    """Words of all examples that are run: of docstrings here, of the docs by test_documentation."""
    docs = (ROOT / "docs" / "control.md").read_text(encoding="utf-8")
    examples = re.findall(r"^```python\n(.*?)^```", docs, re.DOTALL | re.MULTILINE)
    for text in WITH_EXAMPLES.values():
        examples += re.findall(r"^ *(?:>>>|\.\.\.) (.*)", text, re.MULTILINE)
    return set(re.findall(r"\w+", " ".join(examples)))


@pytest.mark.parametrize("name", control.__all__)
def test_what_is_public_has_an_example(name: str) -> None:
    # a class is seen at work where a function that gives it is
    public = [getattr(control, other) for other in control.__all__]
    makers = [
        function.__name__
        for function in public
        if inspect.isfunction(function) and typing.get_type_hints(function).get("return") is getattr(control, name)
    ]
    assert {name, *makers} & exampled()
