"""One FMU put together, in a process of its own: pythonfmu's builder leaves traces in the process that calls it.

``python -m attitude_fmu.fmu_src.assemble '<order as JSON>' <file>`` writes the FMU.
"""

from __future__ import annotations

import sys
import tempfile
import zipfile
from pathlib import Path

from pythonfmu import FmuBuilder  # type: ignore[import-untyped]

from ..models.errors import AttitudeFmuError
from .build import Order
from .catalogue import Entry, model_of
from .description import build_description, model_description
from .documentation import external_dependencies, index_page
from .errors import BuildError
from .native.c_code import model_source
from .native.compile import PLATFORMS, compile_all
from .sources import Sources, fingerprint_of, guid_of, license_of, sources_of, version
from .trace import Trace, trace

_HERE = Path(__file__).parent
_EPOCH = (1980, 1, 1, 0, 0, 0)


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


def _python_content(entry: Entry) -> dict[str, bytes]:
    with tempfile.TemporaryDirectory(prefix="attitude_fmu_") as folder:
        content = _by_pythonfmu(sources_of(entry), Path(folder))
    return {**content, "documentation/licenses/pythonfmu.txt": license_of("pythonfmu").encode()}


def c_sources(traced: Trace, fingerprint: str) -> dict[str, bytes]:
    """The C files of a model's FMU by name: the runtime, and model.c."""
    files = {path.name: path.read_bytes() for path in sorted((_HERE / "native" / "runtime").glob("*.[ch]"))}
    return {**files, "model.c": model_source(traced, guid_of(fingerprint), fingerprint).encode()}


def _native_content(order: Order, traced: Trace, fingerprint: str) -> dict[str, bytes]:
    identifier = order.entry.identifier
    sources = c_sources(traced, fingerprint)
    wanted = [platform for platform in PLATFORMS if platform.folder in order.platforms]
    libraries = compile_all(sources, wanted)
    return {
        **{f"sources/{name}": content for name, content in sources.items()},
        "sources/buildDescription.xml": build_description(order.entry),
        **{f"binaries/{one.folder}/{identifier}{one.suffix}": libraries[one.folder] for one in wanted},
    }


def _common_content(order: Order, traced: Trace, fingerprint: str) -> dict[str, bytes]:
    entry, kind, ours = order.entry, order.kind, license_of()
    copyright_line = next((line for line in ours.splitlines() if line.startswith("Copyright")), None)
    guid = guid_of(fingerprint)
    return {
        "modelDescription.xml": model_description(traced, entry, kind, guid, version(), copyright_line),
        "model.png": (_HERE / entry.icon).read_bytes(),
        "documentation/index.html": index_page(traced.model, entry, kind, version()).encode(),
        "documentation/externalDependencies.txt": external_dependencies(kind).encode(),
        "documentation/licenses/license.txt": ours.encode(),
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


def assemble(order: Order, archive: Path) -> None:
    """Make one FMU and write it to `archive`."""
    fingerprint = fingerprint_of(order.entry, order.kind)
    traced = trace(model_of(order.entry))
    if fingerprint != fingerprint_of(order.entry, order.kind):
        raise BuildError("its sources were changed while it was built; build it again")
    common = _common_content(order, traced, fingerprint)
    own = _python_content(order.entry) if order.kind == "python" else _native_content(order, traced, fingerprint)
    pack({**own, **common}, archive)


if __name__ == "__main__":
    try:
        assemble(Order.from_json(sys.argv[1]), Path(sys.argv[2]))
    except AttitudeFmuError as error:
        sys.exit(str(error))
