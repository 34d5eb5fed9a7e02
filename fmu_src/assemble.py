"""One FMU put together, in a process of its own: pythonfmu's builder leaves traces in the process that calls it.

``python -m attitude_fmu.fmu_src.assemble '<catalogue entry as JSON>' <file>`` writes the FMU.
"""

from __future__ import annotations

import importlib
import json
import sys
import tempfile
import zipfile
from pathlib import Path

from pythonfmu import FmuBuilder  # type: ignore[import-untyped]

from ..models.errors import AttitudeFmuError
from ..models.system import Model
from .catalogue import Entry
from .description import model_description
from .documentation import EXTERNAL_DEPENDENCIES, index_page
from .sources import Sources, license_of, sources_of, version

_ICONS = Path(__file__).parent
_EPOCH = (1980, 1, 1, 0, 0, 0)


def _model(entry: Entry) -> Model:
    model: Model = importlib.import_module(entry.module).MODEL
    return model


def _by_pythonfmu(sources: Sources, folder: Path) -> dict[str, bytes]:
    """What pythonfmu's own builder makes of the sources."""
    for name, content in sources.files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    archive = FmuBuilder.build_FMU(
        folder / f"{sources.slave_module}.py", folder / "built", project_files=[folder / sources.package]
    )
    with zipfile.ZipFile(archive) as built:
        return {name: built.read(name) for name in built.namelist() if "__pycache__" not in name}


def _additions(entry: Entry, sources: Sources) -> dict[str, bytes]:
    model, ours = _model(entry), license_of()
    copyright_line = next((line for line in ours.splitlines() if line.startswith("Copyright")), None)
    icon = _ICONS / entry.icon
    return {
        "modelDescription.xml": model_description(model, entry, sources.guid, version(), copyright_line),
        "model.png": icon.read_bytes(),
        "documentation/index.html": index_page(model, entry, version()).encode(),
        "documentation/externalDependencies.txt": EXTERNAL_DEPENDENCIES.encode(),
        "documentation/licenses/license.txt": ours.encode(),
        "documentation/licenses/pythonfmu.txt": license_of("pythonfmu").encode(),
    }


def pack(content: dict[str, bytes], archive: Path) -> None:
    """Write an FMU whose bytes follow from its content alone: fixed order, dates and modes."""
    names = ["modelDescription.xml", *sorted(set(content) - {"modelDescription.xml"})]
    with zipfile.ZipFile(archive, "w") as fmu:
        for name in names:
            item = zipfile.ZipInfo(name, _EPOCH)
            item.compress_type = zipfile.ZIP_DEFLATED
            item.create_system = 3  # unix, whose modes follow
            item.external_attr = (0o100755 if name.startswith("binaries/") else 0o100644) << 16
            fmu.writestr(item, content[name], compresslevel=9)


def assemble(entry: Entry, archive: Path) -> None:
    """Make one FMU and write it to `archive`."""
    sources = sources_of(entry)
    additions = _additions(entry, sources)
    with tempfile.TemporaryDirectory(prefix="attitude_fmu_") as folder:
        content = _by_pythonfmu(sources, Path(folder))
    pack({**content, **additions}, archive)


if __name__ == "__main__":
    try:
        assemble(Entry(*json.loads(sys.argv[1])), Path(sys.argv[2]))
    except AttitudeFmuError as error:
        sys.exit(str(error))
