from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fmu_instance import EVERY_KIND, Instance

from attitude_fmu.fmu_src.build import build


@pytest.fixture(scope="session")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """EveryKind.fmu."""
    return build(EVERY_KIND, tmp_path_factory.mktemp("dist"), "python")


@pytest.fixture
def load() -> Iterator[Callable[..., Instance]]:
    """Loads an FMU; every instance is freed at the end, which also shows that freeing does not crash."""
    loaded: list[Instance] = []

    def _load(archive: Path, **arguments: Any) -> Instance:
        loaded.append(Instance(archive, **arguments))
        return loaded[-1]

    yield _load
    for instance in loaded:
        instance.close()
