"""Sensors built with the parameters of a device as start values."""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fmpy.validation import validate_fmu
from fmu_instance import EVERY_KIND, Instance

from attitude_fmu.fmu_src.build import Order, build, build_all, is_stale
from attitude_fmu.fmu_src.catalogue import Kind, entry, model_of, with_device
from attitude_fmu.fmu_src.errors import BuildError
from attitude_fmu.models.record import defaults, flatten, leaves, with_defaults
from attitude_fmu.models.sensors.datasheet import CONFIDENCE, UNSURE
from attitude_fmu.models.sensors.devices import DEVICES, origins, parameters

DEVICE, PIECE = "ADIS16354_150", 3
NAME = "AttitudeSensor_ADIS16354_150_specimen_3"


@pytest.fixture(scope="module")
def imu(tmp_path_factory: pytest.TempPathFactory, kind: Kind) -> Path:
    """The FMU of one piece of an ADIS16354, of each kind."""
    return build("AttitudeSensor", tmp_path_factory.mktemp("dist"), kind, device=DEVICE, specimen=PIECE)


def page_of(fmu: Path) -> str:
    with zipfile.ZipFile(fmu) as archive:
        return archive.read("documentation/index.html").decode()


def row_of(page: str, name: str) -> str:
    return next(line for line in page.splitlines() if line.startswith(f"<tr><td>{name}</td>"))


def test_a_record_with_other_defaults_keeps_the_rest() -> None:
    model = model_of(entry("AttitudeSensor"))
    changed = with_defaults(model.Parameters, {"gyro.bias[2]": 0.5, "processor.period": 0.01})
    before, after = defaults(model.Parameters), defaults(changed)
    assert after == before._replace(
        gyro=before.gyro._replace(bias=(before.gyro.bias[0], 0.5, before.gyro.bias[2])),
        processor=before.processor._replace(period=0.01),
    )
    assert [leaf[:2] for leaf in leaves(changed)] == [leaf[:2] for leaf in leaves(model.Parameters)]
    assert len(flatten(defaults(model.Parameters))) == len(leaves(changed))


def test_it_is_called_after_device_and_piece_everywhere(imu: Path) -> None:
    assert imu.name == f"{NAME}.fmu"
    with zipfile.ZipFile(imu) as archive:
        assert f"binaries/linux64/{NAME}.so" in archive.namelist()
        description = archive.read("modelDescription.xml").decode()
    assert f'modelIdentifier="{NAME}"' in description
    assert 'description="Six-axis MEMS attitude sensor: one ADIS16354 at +-150 deg/s, 4 taps' in description
    assert validate_fmu(str(imu)) == []


def test_start_values_are_the_devices_in_the_description_and_in_the_running_model(
    imu: Path, load: Callable[..., Instance]
) -> None:
    instance = load(imu)
    for name, value in parameters(DEVICE, PIECE).items():
        start = instance.variables[name].start
        assert float({"true": "1", "false": "0"}.get(start, start)) == value, name
        assert instance[name] == value, name
    instance.initialise()
    assert instance["register.gyro_temperature"] == round((3.3 + instance["gyro.thermometer.error"]) / 0.1453)
    instance.step(30)
    instance.fmu.reset()
    assert instance["gyro.range"] == parameters(DEVICE)["gyro.range"]


def test_single_numbers_can_still_be_set(imu: Path, load: Callable[..., Instance]) -> None:
    instance = load(imu).initialise(**{"gyro.bias[1]": 0.25, "gyro.autonull": 2})
    assert instance["gyro.bias[1]"] == 0.25
    instance.step(5)


def test_guids_differ_from_piece_to_piece(tmp_path: Path) -> None:
    guids = set()
    for name in ("AttitudeSensor", "AttitudeSensor_ADIS16354_75", f"AttitudeSensor_{DEVICE}", NAME):
        fmu = build(name, tmp_path, "python")
        with zipfile.ZipFile(fmu) as archive:
            text = archive.read("modelDescription.xml").decode()
        guids.add(text.partition('guid="')[2].partition('"')[0])
    assert len(guids) == 4


def test_a_device_is_built_by_name_and_found_up_to_date(tmp_path: Path) -> None:
    events: list[tuple[str, str]] = []
    for _ in range(2):
        paths = build_all(tmp_path, [NAME], lambda *event: events.append(event), kind="python")
    assert [event for _, event in events] == ["building", "built", "up to date"]
    assert paths == [tmp_path / "python" / f"{NAME}.fmu"]
    assert not is_stale(with_device(entry("AttitudeSensor"), DEVICE, PIECE), tmp_path, "python")


def test_an_order_survives_its_way_to_another_process() -> None:
    order = Order(with_device(entry("AttitudeSensor"), DEVICE, PIECE), "native", ("linux64",))
    assert Order.from_json(order.to_json()) == order


REFUSED: list[tuple[dict[str, Any], str]] = [
    (
        {"values": {"gyro.filter": 3}},
        r"gyro\.range = 2\.6.*SENS/AVG of an ADIS16354 offers .*\+-150 deg/s with 4 taps",
    ),
    ({"values": {"gyro.range": -1.0}}, r"gyro\.range = -1 rad/s: too small"),
    ({"values": {"gyro.gain": 1.0}}, r"no parameter 'gyro\.gain'"),
    ({"values": {"gyro.noise_densty": 1.0}}, r"no parameter 'gyro\.noise_densty'; did you mean gyro\.noise_density"),
    ({"values": {"gyro.range": "wide"}}, r"gyro\.range = 'wide': not a number \(allowed: 0\.001 rad/s or more\)"),
    ({"values": {"gyro.filter": "fir"}}, r"gyro\.filter = 'fir': not a choice \(allowed: 1 cic, "),
    ({"device": "ADIS16355"}, r"there is no device called ADIS16355; there are ADXRS450_ADXL355, "),
    ({"specimen": -1}, r"there is no specimen -1"),
    ({"device": None, "specimen": 2}, r"specimen 2 of which device\?"),
]


@pytest.mark.parametrize(("wrong", "why"), REFUSED)
def test_what_does_not_go_together_is_refused_at_build(tmp_path: Path, wrong: dict[str, Any], why: str) -> None:
    with pytest.raises(BuildError, match=why):
        build("AttitudeSensor", tmp_path, "python", **{"device": DEVICE, **wrong})
    assert not list(tmp_path.rglob("*.fmu"))


@pytest.mark.parametrize(
    "name", [DEVICE, f"My{NAME}", "AttitudeSensor_", f"{NAME}x", f"AttitudeSensor_{DEVICE}_specimen_"]
)
def test_names_that_only_look_like_a_device_are_refused(name: str) -> None:
    with pytest.raises(BuildError, match=f"there is no FMU called {name}; there are AttitudeSensor, "):
        entry(name)


def test_what_is_no_sensor_takes_no_device(tmp_path: Path) -> None:
    with pytest.raises(BuildError, match="TripodGimbal is no sensor, it cannot be a ADIS16354_150"):
        build("TripodGimbal", tmp_path, device=DEVICE)
    with pytest.raises(BuildError, match="there is no FMU called TripodGimbal_ADIS16354_150"):
        build("TripodGimbal_ADIS16354_150", tmp_path)


def test_own_values_make_another_file_and_take_names_of_choices(tmp_path: Path, load: Callable[..., Instance]) -> None:
    taps = dict.fromkeys(("gyro.filter", "accelerometer.filter"), "bartlett_16")
    plain = build("AttitudeSensor", tmp_path, "python", device=DEVICE)
    paths = [
        build("AttitudeSensor", tmp_path, "python", device=DEVICE, values=values)
        for values in (taps, {**taps, "gyro.noise_density": 1e-3}, dict(reversed(taps.items())))
    ]
    assert len({plain, *paths}) == 3
    assert paths[0] == paths[2]
    instance = load(paths[0])
    assert (instance["gyro.filter"], instance["accelerometer.filter"]) == (6, 6)


def test_own_values_start_any_model(tmp_path: Path, load: Callable[..., Instance]) -> None:
    fmu = build(EVERY_KIND, tmp_path, values={"gain": 2.5, "noise.seed": 7})
    instance = load(fmu)
    assert (instance["gain"], instance["noise.seed"]) == (2.5, 7)


def test_the_reference_page_shows_source_and_confidence_of_each_number(imu: Path) -> None:
    page = page_of(imu)
    for name, origin in origins(DEVICE).items():
        row = row_of(page, name)
        assert f"[{origin.confidence}]" in row, name
        assert ("(?)" in row) == (origin.confidence in UNSURE), name
    assert "<td>(?) 0.225 mg/rtHz: the part&#x27;s sheet, not seen [recalled]</td>" in row_of(
        page, "accelerometer.noise_density"
    )
    assert "this piece&#x27;s; all pieces: +-0.25 deg/s (sigma)" in row_of(page, "gyro.bias[1]")
    for name in CONFIDENCE:
        assert f"<b>{name}</b>" in page
    assert DEVICES[DEVICE].description in page


def test_a_number_of_ones_own_is_not_ascribed_to_the_sheet(tmp_path: Path) -> None:
    page = page_of(build("AttitudeSensor", tmp_path, "python", device=DEVICE, values={"gyro.noise_density": 1e-3}))
    assert "<td>chosen when this FMU was built</td>" in row_of(page, "gyro.noise_density")


def test_pages_of_models_without_sheets_have_no_sources(native_fmu: Path) -> None:
    assert "<th>source</th>" not in page_of(native_fmu)
