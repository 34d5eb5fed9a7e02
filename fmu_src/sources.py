"""The fingerprint of everything that an FMU is made of; and which Python sources go into one, under which names.

In an FMU of the Python kind the sources lie in a package named after the FMU and its fingerprint, because all FMUs of
a process share ``sys.modules``: another FMU, or another version of this one, must not be taken for it. Only what the
model imports goes in.
"""

from __future__ import annotations

import ast
import hashlib
import importlib.metadata
import importlib.util
import re
import sys
from collections.abc import Iterator
from importlib.machinery import ModuleSpec
from pathlib import Path
from typing import NamedTuple

import pythonfmu  # type: ignore[import-untyped]

from ..models.sensors.devices import origins
from .catalogue import Entry, Kind
from .errors import BuildError

_PACKAGE = "attitude_fmu"
_DISTRIBUTION = "attitude-fmu"
_SLAVE = "attitude_fmu.fmu_src.slave"
_HERE = Path(__file__).parent


class Sources(NamedTuple):
    """The Python sources of one FMU: package name in the FMU, name of its slave module, files by path, fingerprint."""

    package: str
    slave_module: str
    files: dict[str, bytes]
    fingerprint: str


def _spec(name: str) -> ModuleSpec | None:
    try:
        spec = importlib.util.find_spec(name)
    except ModuleNotFoundError:
        return None
    return spec if spec is not None and spec.origin is not None else None


def _imported(name: str, is_package: bool, tree: ast.AST) -> Iterator[str]:
    """Names of the modules of ours that a module may import: ``from a import b`` means a and perhaps a.b."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            up = node.level - (1 if is_package else 0)
            stem = name.rsplit(".", up)[0] if up else name
            base = (f"{stem}.{node.module}" if node.module else stem) if node.level else str(node.module)
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)


def _followed(name: str, is_package: bool, imported: list[str]) -> list[str]:
    """Which of its imports go into an FMU with a module: ours, and those of its own package.

    Raises `BuildError` where a user's module imports what does not: such an FMU would lack it, or hide its changes.
    """
    own = name.partition(".")[0] if "." in name or is_package else _PACKAGE
    followed = [other for other in imported if other.startswith((f"{_PACKAGE}.", f"{own}."))]
    if not name.startswith(f"{_PACKAGE}."):
        for other in imported:
            top = other.partition(".")[0]
            if top not in (_PACKAGE, own) and top not in sys.stdlib_module_names:
                raise BuildError(
                    f"module {name} imports {other}: a model may import the standard library, {_PACKAGE}.models and "
                    "its own package; put it there"
                )
    return followed


def _closure(roots: list[str]) -> dict[str, Path]:
    found: dict[str, Path] = {}
    waiting = list(roots)
    while waiting:
        name = waiting.pop()
        spec = None if name in found else _spec(name)
        if spec is None or spec.origin is None:
            continue
        found[name] = Path(spec.origin)
        is_package = spec.submodule_search_locations is not None
        try:
            tree = ast.parse(found[name].read_bytes())
        except SyntaxError as error:
            raise BuildError(f"module {name}: line {error.lineno}: {error.msg}") from error
        waiting += _followed(name, is_package, list(_imported(name, is_package, tree)))
        parent = name.rpartition(".")[0]
        waiting += [parent] if parent not in ("", _PACKAGE) else []
    return found


def _path_in_package(name: str, origin: Path) -> str:
    path = name.removeprefix(f"{_PACKAGE}.").replace(".", "/")
    return f"{path}/__init__.py" if origin.name == "__init__.py" else f"{path}.py"


def _files_below(folder: Path, name: str) -> Iterator[tuple[str, Path]]:
    for path in sorted(folder.rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            yield f"{name}/{path.relative_to(folder).as_posix()}", path


def _build_files(kind: Kind) -> Iterator[tuple[str, Path]]:
    """What an FMU is made with, besides the model."""
    for path in sorted(_HERE.iterdir()):
        if path.suffix in (".py", ".png"):
            yield f"fmu_src/{path.name}", path
    if kind == "python":
        yield from _files_below(Path(pythonfmu.__file__).parent, "pythonfmu")
    else:
        yield from _files_below(_HERE / "native", "fmu_src/native")


_TOOLS: dict[Kind, tuple[str, ...]] = {"python": ("casadi",), "native": ("casadi", "fmpy", "ziglang")}
"""Packages whose version decides on an FMU's bytes."""


def _version_of(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        raise BuildError(f"the package {distribution}, which FMUs are built with, is not installed") from None


def version() -> str:
    """Version of this package."""
    return _version_of(_DISTRIBUTION)


def license_of(distribution: str = _DISTRIBUTION) -> str:
    """Licence text of an installed distribution."""
    metadata = importlib.metadata.distribution(distribution)
    for name in ("licenses/LICENSE", "LICENSE", "licenses/LICENSE.txt", "LICENSE.txt"):
        text = metadata.read_text(name)
        if text:
            return text
    beside = Path(str(metadata.locate_file("LICENSE")))  # an editable install seen from its own folder
    if beside.is_file():
        return beside.read_text(encoding="utf-8")
    raise BuildError(f"the installed package {distribution} has no licence text")


def _model_files(entry: Entry) -> dict[str, Path]:
    if _spec(entry.module) is None:
        raise BuildError(f"{entry.identifier}: there is no module {entry.module}")
    return _closure([_SLAVE, entry.module])


def fingerprint_of(entry: Entry, kind: Kind) -> str:
    """Hash of everything that an FMU is made of, as it is on disk now."""
    tools = [_version_of(tool) for tool in _TOOLS[kind]]
    sheets = origins(entry.device) if entry.device else {}
    digest = hashlib.sha256(repr((kind, tuple(entry), sheets, version(), license_of(), tools)).encode())
    for name, path in [*sorted(_model_files(entry).items()), *_build_files(kind)]:
        content = path.read_bytes()
        digest.update(f"{name}\0{len(content)}\0".encode())
        digest.update(content)
    return digest.hexdigest()


def guid_of(fingerprint: str) -> str:
    """The fingerprint as FMI GUID."""
    f = fingerprint
    return f"{{{f[:8]}-{f[8:12]}-{f[12:16]}-{f[16:20]}-{f[20:32]}}}"


def _slave_file(entry: Entry, package: str, fingerprint: str) -> str:
    module = f"{package}.{entry.module.removeprefix(f'{_PACKAGE}.')}"
    model, starts = "MODEL", ""
    if entry.starts:
        rows = "".join(f"    {name!r}: {value!r},\n" for name, value in entry.starts)
        model, starts = (
            "MODEL._replace(Parameters=with_defaults(MODEL.Parameters, STARTS))",
            f"\nSTARTS = {{\n{rows}}}\n",
        )
    return f'''"""{entry.identifier}: what pythonfmu loads. The model is {module.replace(".", "/")}.py."""

from {package}.fmu_src.slave import ModelSlave
from {package}.models.record import with_defaults
from {module} import MODEL
{starts}

class {entry.identifier}(ModelSlave):
    model = {model}
    fingerprint = "{fingerprint}"

    def __init__(self, **arguments):  # the wrapper needs a method here: see fmu_src/slave.py
        super().__init__(**arguments)
'''


def _moved(source: bytes, entry: Entry, package: str) -> bytes:
    """A module's text with its imports of us, and of the model's own package, turned to the package in the FMU."""
    text = re.sub(rf"\b{_PACKAGE}(?=\.)".encode(), package.encode(), source)
    own, is_in_package, _ = entry.module.partition(".")
    if own == _PACKAGE or not is_in_package:
        return text
    for statement, becomes in (
        (rf"^(\s*from\s+)({own})(?=[.\s])", rf"\1{package}.\2"),
        (rf"^(\s*import\s+)({own})((?:\.\w+)*\s+as\s)", rf"\1{package}.\2\3"),
        (rf"^(\s*import\s+)({own})((?:\.\w+)*)(?=\s*$)", rf"\1{package}.\2\3; from {package} import \2"),
    ):
        text = re.sub(statement.encode(), becomes.encode(), text, flags=re.MULTILINE)
    return text


def sources_of(entry: Entry) -> Sources:
    """The Python sources of one FMU as they are on disk now."""
    fingerprint = fingerprint_of(entry, "python")
    snake = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", entry.identifier).lower()
    package = f"{snake}_{fingerprint[:12]}"
    files = {
        f"{package}/{_path_in_package(name, origin)}": _moved(origin.read_bytes(), entry, package)
        for name, origin in _model_files(entry).items()
    }
    files[f"{package}/__init__.py"] = f'"""Sources of {entry.identifier}, version {version()}."""\n'.encode()
    slave_module = f"{package}_slave"
    files[f"{slave_module}.py"] = _slave_file(entry, package, fingerprint).encode()
    return Sources(package, slave_module, dict(sorted(files.items())), fingerprint)
