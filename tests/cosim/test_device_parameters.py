"""Devices as parameter sets: in a system, as .ssv files, and in other masters."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from other_master import rows_of

from attitude_fmu.cosim.devices import device_parameters, write_device
from attitude_fmu.cosim.errors import ResultsError
from attitude_fmu.cosim.master import simulate
from attitude_fmu.cosim.ssp import SSC, SSV, read_ssv, write_ssp
from attitude_fmu.cosim.system import Component, ParameterSet, System, check, start_values
from attitude_fmu.fmu_src.build import build
from attitude_fmu.models.errors import AttitudeFmuError
from attitude_fmu.models.sensors.devices import DEVICES, parameters

STEP, STEPS = 1e-3, 200
READ = [
    ("sensor.register.rate[1]", "Integer"),
    ("sensor.register.acceleration[3]", "Integer"),
    ("sensor.register.gyro_temperature", "Integer"),
    ("sensor.rate_measured[2]", "Real"),
]


@pytest.fixture(scope="module")
def sensor(tmp_path_factory: pytest.TempPathFactory) -> System:
    fmu = build("AttitudeSensor", tmp_path_factory.mktemp("dist"))
    return System("bench", (Component("sensor", fmu),), stop_time=STEPS * STEP)


@pytest.mark.parametrize("device", DEVICES)
@pytest.mark.parametrize("specimen", [0, 1])
def test_every_value_survives_the_round_trip(sensor: System, tmp_path: Path, device: str, specimen: int) -> None:
    path = write_device(tmp_path / "device.ssv", device, specimen)
    read = start_values(sensor.with_set(read_ssv(path)), check(sensor))
    assert {port.variable: value for port, value in read.items()} == parameters(device, specimen)


def test_the_set_names_the_device_and_its_piece() -> None:
    assert device_parameters("ADIS16354_75").name == "ADIS16354_75"
    assert device_parameters("ADIS16354_75", 4).name == "ADIS16354_75_specimen_4"
    assert "imu.gyro.range" in device_parameters("ADIS16354_75", component="imu").values
    assert "gyro.range" in device_parameters("ADIS16354_75", component="").values


def test_an_unknown_device_is_refused() -> None:
    with pytest.raises(
        AttitudeFmuError,
        match=r"no device called .ADIS16355.; did you mean ADIS16354_75 or .*devices: ADXRS450_ADXL355, ",
    ):
        device_parameters("ADIS16355")


def test_a_folder_is_no_file_to_write_to(tmp_path: Path) -> None:
    with pytest.raises(ResultsError, match="it is a folder; name a file"):
        write_device(tmp_path, "ADIS16354_75")


def test_the_file_gives_units_and_defines_them(tmp_path: Path) -> None:
    root = etree.parse(write_device(tmp_path / "device.ssv", "ADIS16354_75", component="")).getroot()
    values = {p.get("name"): p[0] for p in root.iter(f"{{{SSV}}}Parameter")}
    assert values["gyro.range"].get("unit") == "rad/s"
    assert values["accelerometer.bias[2]"].get("unit") == "m/s2"
    assert values["supply.nominal"].get("unit") == "V"
    assert values["gyro.nonlinearity"].get("unit") is None
    defined = {unit.get("name") for unit in root.iter(f"{{{SSC}}}Unit")}
    assert {value.get("unit") for value in values.values()} - {None} == defined


def test_a_device_changes_the_sensor_as_its_numbers_say(sensor: System, tmp_path: Path) -> None:
    mine = sensor.with_set(read_ssv(write_device(tmp_path / "imu.ssv", "ADIS16354_300")))
    quiet = {f"sensor.{part}.{term}": 0.0 for part in ("gyro", "accelerometer") for term in ("noise_density",)}
    before = simulate(sensor, step=STEP).results
    after = simulate(mine.with_values("quiet", quiet), step=STEP).results
    # 1 g at 256000 LSB/g with the board's 16 mg and 1.1 %, within the nonlinearity of 0.1 % of 524288 LSB and four
    # times the noise of 0.3 mg; at 0.4672 mg/LSB within 0.2 % of 3639 LSB and half a step
    assert before["sensor.register.acceleration[3]"][-1] == pytest.approx(256_000 * 1.027, abs=525 + 308)
    assert after["sensor.register.acceleration[3]"][-1] == pytest.approx(1000.0 / 0.4672, abs=7.3 + 0.5)
    # 25 degC and self-heating, to half a step
    assert before["sensor.register.gyro_temperature"][-1] == pytest.approx(5.0 * (25.0 + 4.5 - 45.0), abs=0.5)
    assert after["sensor.register.gyro_temperature"][-1] == pytest.approx(3.3 / 0.1453, abs=0.5)


def test_a_later_set_overrides_one_number(sensor: System) -> None:
    mine = sensor.with_set(device_parameters("ADIS16354_150", 3)).with_values("own", {"sensor.gyro.bias[2]": 0.01})
    found = {port.variable: value for port, value in start_values(mine, check(mine)).items()}
    assert found == {**parameters("ADIS16354_150", 3), "gyro.bias[2]": 0.01}


def _bound(ssp: Path, file: Path, target: Path) -> Path:
    """The archive with its one parameter set replaced by a file."""
    with zipfile.ZipFile(ssp) as source, zipfile.ZipFile(target, "w") as copy:
        for name in source.namelist():
            copy.writestr(name, file.read_bytes() if name.endswith(".ssv") else source.read(name))
    return target


@pytest.mark.parametrize("master", ["libcosim", "ecos"])
@pytest.mark.parametrize("device", ["ADXRS453_ADXL355", "ADIS16354_150"])
def test_other_masters_apply_the_file(sensor: System, tmp_path: Path, device: str, master: str) -> None:
    # neither sets an enumeration: the filter of an ADIS16354 must be the FMU's own
    fmu = build("AttitudeSensor", tmp_path, device=device) if device.startswith("ADIS") else sensor.components[0].fmu
    bench = System("bench", (Component("sensor", fmu),), stop_time=sensor.stop_time)
    mine = bench.with_set(device_parameters(device, 3))
    ours = simulate(mine, step=STEP, order="jacobi").results
    file = write_device(tmp_path / "device.ssv", device, 3, component="")
    name = mine.parameter_sets[0].name
    placeholder = bench.with_set(ParameterSet(name, {"sensor.seed": 1}))
    ssp = _bound(write_ssp(placeholder, tmp_path / "plain.ssp"), file, tmp_path / "bench.ssp")
    rows = rows_of(master, ssp, name, STEP, STEPS, READ)
    for column, (signal, _) in enumerate(READ):
        assert np.array_equal(rows[1:, column], ours[signal][1:].astype(float)), signal
