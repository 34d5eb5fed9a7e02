from __future__ import annotations

import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
import pythonfmu
from fmu_instance import EVERY_KIND, Instance

from attitude_fmu.fmu_src import build as building
from attitude_fmu.fmu_src import sources
from attitude_fmu.fmu_src.build import build, build_all, folder_of, is_stale
from attitude_fmu.fmu_src.catalogue import CATALOGUE, KINDS, Entry, Kind
from attitude_fmu.fmu_src.errors import BuildError
from attitude_fmu.fmu_src.native import compile as compiling
from attitude_fmu.fmu_src.native.compile import host_platform
from attitude_fmu.fmu_src.sources import fingerprint_of, guid_of, sources_of

Built = Callable[[Entry, Kind], Path]

SOURCE = Path(__file__).with_name("every_kind.py")
COMMAND = Path(__file__).parents[2] / "build_fmu.py"


def _names(archive: Path) -> list[str]:
    with zipfile.ZipFile(archive) as fmu:
        return fmu.namelist()


@pytest.fixture
def own_model(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[Entry, Path]:
    """A copy of the test model that may be changed."""
    source = tmp_path / "own_model.py"
    source.write_text(SOURCE.read_text())
    monkeypatch.syspath_prepend(str(tmp_path))
    return Entry("OwnModel", "own_model"), source


def test_the_same_sources_give_the_same_bytes_anywhere(fmu: Path, kind: Kind, tmp_path: Path) -> None:
    again = build(EVERY_KIND, tmp_path / "a folder with blanks" / "dist", kind)
    assert again.read_bytes() == fmu.read_bytes()


def test_where_the_source_lies_does_not_matter(kind: Kind, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entry, archives = Entry("MovedModel", "moved_model"), []
    for folder in (tmp_path / "here", tmp_path / "somewhere else"):
        folder.mkdir()
        shutil.copy(SOURCE, folder / "moved_model.py")
        with monkeypatch.context() as place:
            place.syspath_prepend(str(folder))
            archives.append(build(entry, folder, kind))
    assert archives[0].read_bytes() == archives[1].read_bytes()


def test_a_changed_source_changes_the_guid_and_the_module_names(
    own_model: tuple[Entry, Path], kind: Kind, tmp_path: Path
) -> None:
    entry, source = own_model
    before = sources_of(entry)
    build(entry, tmp_path / "dist", kind)
    assert not is_stale(entry, tmp_path / "dist", kind)
    source.write_text(source.read_text().replace("0.9", "0.8"))
    after = sources_of(entry)
    assert is_stale(entry, tmp_path / "dist", kind)
    assert guid_of(before.fingerprint) != guid_of(after.fingerprint)
    assert before.package != after.package
    assert before.slave_module != after.slave_module


@pytest.mark.parametrize(
    ("changed", "stale"),
    [
        ("fmu_src/description.py", KINDS),
        ("fmu_src/fmu.png", KINDS),
        ("fmu_src/native/runtime/noise.c", ("native",)),
        ("pythonfmu/fmi2slave.py", ("python",)),
    ],
)
def test_what_it_is_built_with_changes_the_guid(
    built: Built, dist: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changed: str, stale: tuple[Kind, ...]
) -> None:
    for kind in KINDS:
        built(EVERY_KIND, kind)
    for name, folder in (("fmu_src", sources._HERE), ("pythonfmu", Path(pythonfmu.__file__).parent)):
        shutil.copytree(folder, tmp_path / name)
    monkeypatch.setattr(sources, "_HERE", tmp_path / "fmu_src")
    monkeypatch.setattr(pythonfmu, "__file__", str(tmp_path / "pythonfmu" / "__init__.py"))
    assert not any(is_stale(EVERY_KIND, dist, kind) for kind in KINDS)
    with (tmp_path / changed).open("ab") as file:
        file.write(b"\n")
    assert tuple(kind for kind in KINDS if is_stale(EVERY_KIND, dist, kind)) == stale


def test_a_native_fmu_without_a_platform_that_is_wanted_is_stale(native_fmu: Path) -> None:
    assert not is_stale(EVERY_KIND, native_fmu.parent, "native", "host")
    assert is_stale(EVERY_KIND, native_fmu.parent, "native", "all")


def test_the_kinds_differ_in_their_guid_and_lie_apart(built: Built) -> None:
    native, python = (built(EVERY_KIND, kind) for kind in KINDS)
    assert python == native.parent / "python" / native.name
    assert fingerprint_of(EVERY_KIND, "native") != fingerprint_of(EVERY_KIND, "python")


@pytest.mark.parametrize("own", [False, True])
def test_files_in_the_current_folder_hide_no_module(
    fmu: Path, kind: Kind, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, own: bool
) -> None:
    folder = tmp_path / "users"
    folder.mkdir()
    for name in ("random", "xml", "logging", "lxml", "zipfile"):
        (folder / f"{name}.py").write_text("raise SystemExit('the wrong module')")
    shutil.copy(SOURCE, folder / "users_model.py")
    monkeypatch.chdir(folder)
    if own:  # an interactive session, whose own folder counts
        monkeypatch.setattr(building.sys, "path", ["", *sys.path])
        assert build(Entry("UsersModel", "users_model"), tmp_path, kind).is_file()
    else:
        assert build(EVERY_KIND, tmp_path, kind).read_bytes() == fmu.read_bytes()


def test_another_models_source_does_not_change_it() -> None:
    files = sources_of(EVERY_KIND).files
    assert not [name for name in files if "attitude_sensor" in name or "tripod" in name]


def test_a_missing_or_broken_archive_is_stale(kind: Kind, tmp_path: Path) -> None:
    assert is_stale(EVERY_KIND, tmp_path, kind)
    folder_of(tmp_path, kind).mkdir(exist_ok=True)
    (folder_of(tmp_path, kind) / "EveryKind.fmu").write_bytes(b"PK, but not really")
    assert is_stale(EVERY_KIND, tmp_path, kind)


_HOST = host_platform()
CONTENT: dict[Kind, tuple[str, ...]] = {
    "native": (
        f"binaries/{_HOST.folder}/EveryKind{_HOST.suffix}",
        "sources/buildDescription.xml",
        "sources/fmu.c",
        "sources/model.c",
        "sources/model.h",
    ),
    "python": (
        "binaries/linux64/EveryKind.so",
        "binaries/win64/EveryKind.dll",
        "documentation/licenses/pythonfmu.txt",
        "resources/slavemodule.txt",
    ),
}


def test_it_contains_what_fmi_asks_for(fmu: Path, kind: Kind) -> None:
    names = _names(fmu)
    assert names[0] == "modelDescription.xml"
    for wanted in (
        "documentation/externalDependencies.txt",
        "documentation/index.html",
        "documentation/licenses/license.txt",
        "model.png",
        *CONTENT[kind],
    ):
        assert wanted in names
    assert not [name for name in names if "__pycache__" in name or "\\" in name]


def test_the_native_kind_carries_no_python_and_the_python_kind_no_c(built: Built) -> None:
    native, python = (_names(built(EVERY_KIND, kind)) for kind in KINDS)
    assert not [name for name in native if name.endswith(".py") or name.startswith("resources/")]
    assert not [name for name in python if name.endswith((".c", ".h"))]


def test_binaries_are_executable(fmu: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        for item in archive.infolist():
            assert item.external_attr >> 16 == (0o100755 if item.filename.startswith("binaries/") else 0o100644)


def test_the_reference_page_names_every_variable(fmu: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        page = archive.read("documentation/index.html").decode()
    for name in ("noise.density", "mounting[3,3]", "shown.level", "coefficient.sigma", "state.ticks"):
        assert f"<td>{name}</td>" in page


def test_the_reference_page_tells_axes_signs_and_choices(fmu: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        page = " ".join(archive.read("documentation/index.html").decode().split())
    assert "Body axes b are right, forward, up" in page
    assert "a positive rate about the up axis makes yaw fall" in page
    assert "<td>shown.level</td><td></td><td></td><td>1 low: low<br>2 high: high</td>" in page
    assert "<td>1 lag: first-order lag<br>2 mean: mean with the last value</td>" in page
    assert "<td>true rate (forward)</td>" in page
    assert "<td>state.filtered[1]</td><td>rad/s (deg/s)</td>" in page


def test_the_reference_page_is_in_groups(fmu: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        page = archive.read("documentation/index.html").decode()
    places = [
        page.index(text)
        for text in (
            ">Axes, signs and units</h2>",
            ">Inputs</h2>",
            ">Outputs</h2>",
            ">Parameters</h2>",
            "<td>gain</td>",
            ">noise</h3>",
            "<td>noise.seed</td>",
            ">Calculated parameters</h2>",
            ">State</h2>",
        )
    ]
    assert places == sorted(places)


def test_the_reference_page_begins_with_its_contents(fmu: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        page = archive.read("documentation/index.html").decode()
    links = re.findall(r'<a href="#([^"]+)">([^<]+)</a>', page)
    assert page.rindex("<a href") < page.index("<h2")
    assert [(name, text) for _, name, text in re.findall(r'<h([23]) id="([^"]+)">([^<]+)</h', page)] == links
    assert {"Inputs", "Parameters", "noise"} <= {text for _, text in links}


def test_the_reference_page_shows_start_values_in_display_units(fmu: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        page = archive.read("documentation/index.html").decode()
    assert "<td>temperature</td><td>K (degC)</td><td>298.15 (25 degC)</td>" in page
    assert "<td>gain</td><td>(%)</td><td>1 (100 %)</td>" in page.replace("<td> (", "<td>(")
    assert "<td>rate[1]</td><td>rad/s (deg/s)</td><td>0</td>" in page


def test_sources_in_the_fmu_import_nothing_of_the_installed_package(python_fmu: Path) -> None:
    with zipfile.ZipFile(python_fmu) as archive:
        for name in archive.namelist():
            if name.endswith(".py") and "/pythonfmu/" not in name:
                text = archive.read(name).decode()
                assert "attitude_fmu." not in text, name


def test_many_may_build_at_once(fmu: Path, kind: Kind, tmp_path: Path) -> None:
    with ThreadPoolExecutor(3) as pool:
        paths = list(pool.map(lambda _: build(EVERY_KIND, tmp_path, kind), range(3)))
    assert {path.read_bytes() for path in paths} == {fmu.read_bytes()}
    assert [path.name for path in folder_of(tmp_path, kind).iterdir()] == ["EveryKind.fmu"]


def test_a_model_that_does_not_build_leaves_the_old_fmu(own_model: tuple[Entry, Path], tmp_path: Path) -> None:
    entry, source = own_model
    dist = tmp_path / "dist"
    before = build(entry, dist).read_bytes()
    source.write_text(source.read_text().replace('"K"', '"degF"'))
    with pytest.raises(BuildError, match="degF"):
        build(entry, dist)
    assert (dist / "OwnModel.fmu").read_bytes() == before
    assert len(list(dist.iterdir())) == 1


@pytest.mark.parametrize("blocked", ["dist", "dist/EveryKind.fmu/x"])
def test_a_place_that_cannot_be_written_is_named(tmp_path: Path, blocked: str) -> None:
    place = tmp_path / blocked
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_text("in the way")
    before = sorted(tmp_path.rglob("*"))
    with pytest.raises(BuildError, match=r"dist.EveryKind\.fmu could not be written: \w+"):
        build(EVERY_KIND, tmp_path / "dist")
    assert sorted(tmp_path.rglob("*")) == before


def test_the_command_names_a_place_that_it_cannot_write(tmp_path: Path) -> None:
    (tmp_path / "dist").write_text("in the way")
    command = [sys.executable, str(COMMAND), "AttitudeSensor", "--dist", str(tmp_path / "dist")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "AttitudeSensor.fmu could not be written" in done.stderr
    assert "Traceback" not in done.stderr


def test_an_unknown_name_is_refused_with_the_known_ones(tmp_path: Path) -> None:
    with pytest.raises(BuildError, match="AttitudeSensor"):
        build_all(tmp_path, ["Attitude"])


def test_the_command_names_what_it_could_not_build() -> None:
    done = subprocess.run([sys.executable, str(COMMAND), "Nothing"], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("there is no FMU called Nothing; there are AttitudeSensor")


def test_the_command_warns_when_it_builds_from_other_sources(tmp_path: Path) -> None:
    command = shutil.copy(COMMAND, tmp_path)
    done = subprocess.run([sys.executable, command, "Nothing"], capture_output=True, text=True, check=False)
    warning, refusal = done.stderr.splitlines()
    assert warning == f"warning: building from {COMMAND.parent}, not from {tmp_path}: pip install -e . there"
    assert refusal.startswith("there is no FMU called Nothing")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (None, "there is no module wrong_model"),
        ("1 / 0", "module wrong_model: ZeroDivisionError: division by zero"),
        ("\ndef (", "module wrong_model: line 2: invalid syntax"),
        ("x = 1", "module wrong_model: AttributeError: module 'wrong_model' has no attribute 'MODEL'"),
        ("MODEL = 3", "module wrong_model: its MODEL is no Model of attitude_fmu.models.system"),
    ],
)
def test_a_module_that_is_no_model_is_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str | None, told: str
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    if text is not None:
        (tmp_path / "wrong_model.py").write_text(text)
    with pytest.raises(BuildError) as caught:
        build(Entry("Wrong", "wrong_model"), tmp_path / "dist")
    assert str(caught.value).startswith("Wrong could not be built: ")
    assert str(caught.value).endswith(told)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("statement", ["import my_helper", "from my_helper import FACTOR"])
def test_a_helper_module_beside_the_model_is_refused_with_both_names(
    own_model: tuple[Entry, Path], tmp_path: Path, statement: str
) -> None:
    entry, source = own_model
    (tmp_path / "my_helper.py").write_text("FACTOR = 0.9\n")
    source.write_text(source.read_text().replace("from math import inf", f"from math import inf\n{statement}"))
    with pytest.raises(BuildError, match=r"module own_model imports my_helper[.\w]*: .*put it there$"):
        build(entry, tmp_path / "dist")


HELPED = {"rate[1]": 2.0, "temperature": 310.0}


def _packaged(folder: Path, statement: str = "from .my_helper import FACTOR") -> tuple[Entry, Path]:
    """The test model in a package of its own, with a factor in a helper module there, which `statement` imports."""
    package = folder / "my_package"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("from .my_helper import FACTOR as SAME\n")
    (package / "my_helper.py").write_text("FACTOR = 0.8\n")
    text = SOURCE.read_text()
    assert "scale(0.9, x.filtered)" in text
    text = text.replace("scale(0.9, x.filtered)", "scale(FACTOR, x.filtered)")
    (package / "my_model.py").write_text(text.replace("from math import inf", f"from math import inf\n{statement}"))
    return Entry("MyModel", "my_package.my_model"), package / "my_helper.py"


@pytest.fixture
def place(tmp_path: Path) -> Iterator[pytest.MonkeyPatch]:
    """The folder as one where modules are found, until it is undone; packages from there are forgotten then."""
    with pytest.MonkeyPatch.context() as context:
        context.syspath_prepend(str(tmp_path))
        yield context
    _forget()


def _forget() -> None:
    """Looking for a module in a package imports the package."""
    for name in [name for name in sys.modules if name.partition(".")[0] == "my_package"]:
        del sys.modules[name]


def test_a_model_in_a_package_of_its_own_is_stale_when_a_helper_there_changes(
    tmp_path: Path, place: pytest.MonkeyPatch, kind: Kind, load: Callable[..., Instance]
) -> None:
    entry, helper = _packaged(tmp_path)
    before = load(build(entry, tmp_path, kind)).initialise(**HELPED).step(20)
    assert not is_stale(entry, tmp_path, kind)
    helper.write_text("FACTOR = 0.7\n")
    assert is_stale(entry, tmp_path, kind)
    after = load(build(entry, tmp_path, kind)).initialise(**HELPED).step(20)
    assert before["shown.rate[1]"] != after["shown.rate[1]"]


@pytest.mark.parametrize(
    "statement",
    [
        "from .my_helper import FACTOR",
        "from my_package.my_helper import FACTOR",
        "from my_package import my_helper\nFACTOR = my_helper.FACTOR",
        "import my_package.my_helper\nFACTOR = my_package.my_helper.FACTOR",
        "import my_package.my_helper as helper\nFACTOR = helper.FACTOR",
        "from . import SAME as FACTOR",
    ],
)
def test_a_helper_goes_into_the_fmu_with_its_model(
    python_fmu: Path, load: Callable[..., Instance], tmp_path: Path, place: pytest.MonkeyPatch, statement: str
) -> None:
    fmu = build(_packaged(tmp_path, statement)[0], tmp_path, "python")
    place.undo()
    _forget()
    shutil.rmtree(tmp_path / "my_package")
    helped, plain = (load(one).initialise(**HELPED).step(20) for one in (fmu, python_fmu))
    assert helped["shown.rate[1]"] != plain["shown.rate[1]"]


@pytest.mark.parametrize("case", ["a home that cannot be written", "a cache of its own", "headers of its own"])
def test_the_users_environment_changes_no_byte(
    native_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, case: str
) -> None:
    if case == "a home that cannot be written":
        (tmp_path / "file").write_text("")  # below it not even root can make a folder
        for name in ("HOME", "XDG_CACHE_HOME"):
            monkeypatch.setenv(name, str(tmp_path / "file" / name))
        monkeypatch.delenv("ZIG_GLOBAL_CACHE_DIR", raising=False)
    elif case == "a cache of its own":
        monkeypatch.setenv("ZIG_GLOBAL_CACHE_DIR", str(tmp_path / "cache"))
    else:
        (tmp_path / "math.h").write_text("#error the wrong header\n")
        for name in ("CPATH", "C_INCLUDE_PATH"):
            monkeypatch.setenv(name, str(tmp_path))
    assert build(EVERY_KIND, tmp_path).read_bytes() == native_fmu.read_bytes()
    assert (tmp_path / "cache").exists() == (case == "a cache of its own")


def test_the_compiler_hears_of_no_headers_of_the_users(monkeypatch: pytest.MonkeyPatch) -> None:
    tell = "import os, sys; sys.exit(' '.join(sorted(os.environ)))"
    monkeypatch.setattr(compiling, "compiler", lambda: [sys.executable, "-c", tell])
    for name in ("CPATH", "C_INCLUDE_PATH", "LIBRARY_PATH", "SDKROOT"):
        monkeypatch.setenv(name, "somewhere")
    with pytest.raises(BuildError) as told:
        compiling.compile_all({}, [compiling.host_platform()])
    heard = set(str(told.value).split())
    assert "ZIG_LOCAL_CACHE_DIR" in heard
    assert not heard & {"CPATH", "C_INCLUDE_PATH", "LIBRARY_PATH", "SDKROOT"}


def test_only_stale_fmus_are_built(tmp_path: Path) -> None:
    name = CATALOGUE[0].identifier
    events: list[tuple[str, str]] = []
    for _ in range(2):
        paths = build_all(tmp_path, [name], lambda *event: events.append(event))
    assert events == [(name, "building"), (name, "built"), (name, "up to date")]
    assert paths == [tmp_path / f"{name}.fmu"]
