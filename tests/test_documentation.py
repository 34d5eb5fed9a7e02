"""Every Python example of README and docs runs as printed."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from attitude_fmu.fmu_src.build import build_all

ROOT = Path(__file__).parents[1]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").glob("*.md")])


FILE_NAME = re.compile(r"# (\w+\.py)\n")
"""First line of an example that the reader is told to save."""


def examples() -> list[tuple[str, str]]:
    found = []
    for page in PAGES:
        blocks = re.findall(r"^( *)```python\n(.*?)^ *```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
        found += [
            (f"{page.name}-{number}", re.sub(rf"^{indent}", "", code, flags=re.MULTILINE))
            for number, (indent, code) in enumerate(blocks, 1)
        ]
    return found


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as a reader has it: the FMUs built, and the examples that are files saved."""
    place = tmp_path_factory.mktemp("reader")
    build_all(place / "dist")
    for _, code in examples():
        if name := FILE_NAME.match(code):
            (place / name[1]).write_text(code, encoding="utf-8")
    return place


@pytest.mark.parametrize("code", [pytest.param(code, id=name) for name, code in examples()])
def test_example_runs_as_printed(code: str, folder: Path) -> None:
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_every_heading_that_a_page_links_to_exists() -> None:
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        headings = {re.sub(r"\W+", "-", line.lower()) for line in re.findall(r"^#+ (.+)$", text, re.MULTILINE)}
        for target in re.findall(r"\]\(#([^)]+)\)", text):
            assert target in headings, f"{page.name} links to #{target}"


def test_every_page_that_a_page_links_to_exists() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name} links to {target}"
