from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from fmu_instance import EVERY_KIND, Instance

from attitude_fmu.fmu_src.build import build
from attitude_fmu.fmu_src.catalogue import KINDS, Entry, Kind

Built = Callable[[Entry, Kind], Path]


@pytest.fixture(scope="session")
def dist(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the FMUs that the tests share."""
    return tmp_path_factory.mktemp("dist")


@pytest.fixture(scope="session")
def built(dist: Path) -> Built:
    """Gives the FMU of an entry and kind, built when first asked for."""
    return cache(lambda entry, kind: build(entry, dist, kind))


@pytest.fixture(scope="session", params=KINDS)
def kind(request: pytest.FixtureRequest) -> Kind:
    chosen: Kind = request.param
    return chosen


@pytest.fixture(scope="session")
def fmu(built: Built, kind: Kind) -> Path:
    """EveryKind.fmu of each kind."""
    return built(EVERY_KIND, kind)


@pytest.fixture(scope="session")
def python_fmu(built: Built) -> Path:
    return built(EVERY_KIND, "python")


@pytest.fixture(scope="session")
def native_fmu(built: Built) -> Path:
    return built(EVERY_KIND, "native")


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
