"""Controllers of python-control as FMUs: the response, the names, what is refused."""

from __future__ import annotations

import re
import shutil
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest
from fmpy import extract, instantiate_fmu, read_model_description
from fmpy.validation import validate_fmu

from attitude_fmu.cosim.control.export import controller_of, to_fmu
from attitude_fmu.cosim.errors import ExportRefusedError
from attitude_fmu.cosim.master import Order, simulate
from attitude_fmu.cosim.system import Component, System, connect
from attitude_fmu.fmu_src.build import build_all
from attitude_fmu.fmu_src.catalogue import KINDS
from attitude_fmu.models.linear_controller import linear_controller
from attitude_fmu.models.record import defaults, flatten, leaves, unflatten
from attitude_fmu.models.system import Run

DT = 0.01
CLOSE = 1e-12
"""Of the largest output: what the response may differ by."""


def random_system(seed: int, n: int, p: int, m: int) -> control.StateSpace:
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n))
    A *= rng.uniform(0.3, 0.99) / max(np.abs(np.linalg.eigvals(A)).max(initial=1e-9), 1e-9)
    B, C, D = rng.standard_normal((n, m)), rng.standard_normal((p, n)), rng.standard_normal((p, m))
    return control.ss(A, B, C, D, DT)


def response(system: Any, u: np.ndarray, **options: Any) -> np.ndarray:
    """The model's outputs, run in Python."""
    model = linear_controller(controller_of(system, **options))
    run = Run(model, defaults(model.Parameters), model.Inputs())
    rest, found = flatten(model.Inputs())[len(u) :], []
    for k, now in enumerate(u.T):
        run.advance(unflatten(model.Inputs, [*map(float, now), *rest]), (k + 1) * run.coefficients.period)
        found.append(flatten(run.outputs())[:-1])
    return np.array(found).T


def forced(system: Any, u: np.ndarray, **options: Any) -> np.ndarray:
    T = np.arange(u.shape[1]) * system.dt
    return np.asarray(control.forced_response(system, T, u, squeeze=False, **options).outputs)


def assert_same(found: np.ndarray, wanted: np.ndarray) -> None:
    assert np.abs(found - wanted).max() <= CLOSE * np.abs(wanted).max()


class Unit:
    """An FMU in FMPy."""

    def __init__(self, fmu: Path) -> None:
        self.folder = extract(str(fmu))
        self.description = read_model_description(self.folder)
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.booleans = {v.name for v in self.description.modelVariables if v.type == "Boolean"}
        self.fmu = instantiate_fmu(self.folder, self.description, "CoSimulation")
        self.fmu.setupExperiment(startTime=0.0)
        self.time = 0

    def set(self, **values: Any) -> None:
        self.set_all(values)

    def set_all(self, values: dict[str, Any]) -> None:
        for name, value in values.items():
            call = self.fmu.setBoolean if name in self.booleans else self.fmu.setReal
            call([self.references[name]], [value])

    def begin(self) -> Unit:
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def step(self) -> list[float]:
        """One period; the outputs."""
        self.fmu.doStep(self.time * DT, DT)
        self.time += 1
        return self.read("output")

    def read(self, causality: str) -> list[float]:
        names = [v for v in self.description.modelVariables if v.causality == causality and v.type == "Real"]
        return list(self.fmu.getReal([v.valueReference for v in names]))

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)


Load = Callable[[Path], Unit]


@pytest.fixture
def load() -> Iterator[Load]:
    loaded: list[Unit] = []

    def _load(fmu: Path) -> Unit:
        loaded.append(Unit(fmu))
        return loaded[-1]

    yield _load
    for unit in loaded:
        unit.close()


SYSTEM = random_system(12, 12, 3, 4)


@pytest.fixture(scope="module")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A limited controller of order 12 as both kinds."""
    folder = tmp_path_factory.mktemp("controllers")
    X0 = [0.1 * i for i in range(12)]
    return {
        kind: to_fmu(SYSTEM, folder / kind / "Twelve.fmu", kind, limits={"y": (-8.0, 6.0)}, X0=X0, u0=0.1, y0=0.2)
        for kind in KINDS
    }


@pytest.mark.parametrize("n", range(13))
@pytest.mark.parametrize(("p", "m"), [(1, 1), (2, 3)])
def test_response_is_that_of_forced_response(n: int, p: int, m: int) -> None:
    system = random_system(100 * n + p, n, p, m)
    rng = np.random.default_rng(n)
    u, X0 = rng.standard_normal((m, 300)), rng.standard_normal(n)
    wanted = forced(system, u, X0=X0) if n else system.D @ u
    assert_same(response(system, u, X0=X0 if n else 0.0), wanted)


@pytest.mark.parametrize("n", range(1, 13))
def test_transfer_function_gives_the_response_of_forced_response(n: int) -> None:
    # poles apart from each other: polynomials tell close ones too badly for 1e-12, in python-control's form or in ours
    rng = np.random.default_rng(n)
    angles = np.pi * (np.arange(n // 2) + rng.uniform(0.2, 0.8, n // 2)) / max(n // 2, 1)
    pairs = rng.uniform(0.4, 0.95, n // 2) * np.exp(1j * angles)
    poles = [*pairs, *pairs.conj(), *rng.uniform(-0.9, 0.9, n % 2)]
    system = control.tf(rng.standard_normal(n + 1), np.poly(poles).real, DT)
    u = rng.standard_normal((1, 300))
    assert_same(response(system, u), forced(system, u))


def test_transfer_matrix_gives_the_sum_of_its_elements() -> None:
    numerators = [[[0.1], [1.0, -0.2]], [[1.0, 2.0, 0.5], [0.0]]]
    denominators = [[[1.0, -1.0], [1.0, -0.5]], [[1.0, 0.2, 0.1], [1.0]]]
    system = control.tf(numerators, denominators, DT)
    u = np.random.default_rng(2).standard_normal((2, 200))
    wanted = np.array(
        [
            sum(forced(control.tf(numerators[i][j], denominators[i][j], DT), u[j : j + 1])[0] for j in range(2))
            for i in range(2)
        ]
    )
    assert_same(response(system, u), wanted)


def test_elements_with_one_denominator_share_their_states() -> None:
    both = control.tf([[[0.01], [0.02]]], [[[1.0, -1.0], [1.0, -1.0]]], DT)
    assert controller_of(both).A == ((1.0,),)


@pytest.mark.parametrize("method", ["tustin", "zoh", "backward_diff"])
def test_continuous_system_is_sampled_as_python_control_does(method: str) -> None:
    continuous = control.tf([20.0, 4.0], [1.0, 3.0, 0.0], inputs="error", outputs="torque")
    u = np.random.default_rng(3).standard_normal((1, 300))
    wanted = forced(control.sample_system(control.ss(continuous), DT, method), u)
    assert_same(response(continuous, u, dt=DT, method=method), wanted)


def test_estimator_with_the_plants_b_is_not_misled_by_the_limits() -> None:
    # x - xhat follows (A - L C)^k, whatever the limits cut
    A, B, C = np.array([[1.0, DT], [0.0, 1.0]]), np.array([[0.5 * DT**2], [DT]]), np.array([[1.0, 0.0]])
    K = control.dlqr(A, B, np.diag([100.0, 1.0]), np.array([[0.01]]))[0]
    L = control.place(A.T, C.T, [0.6, 0.7]).T
    lqg = control.ss(A - B @ K - L @ C, L, -K, 0.0, DT)
    model = linear_controller(controller_of(lqg, limits=1.0, anti_windup=B))
    run, x, rest = Run(model, defaults(model.Parameters), model.Inputs()), np.array([1.0, 0.0]), [True, False, 0.0]
    wanted, cuts = x, 0
    for k in range(100):
        run.advance(unflatten(model.Inputs, [float(C[0] @ x), *rest]), (k + 1) * DT)
        y, is_cut = flatten(run.outputs())
        cuts += is_cut
        x, wanted = A @ x + B[:, 0] * y, (A - L @ C) @ wanted
        assert x - flatten(run.state)[:2] == pytest.approx(wanted, abs=1e-12)
    assert 10 < cuts < 100


def test_prewarped_sampling_keeps_the_response_at_its_frequency() -> None:
    omega, continuous = 150.0, control.tf([1.0, 20.0], [1.0, 300.0])
    found = controller_of(continuous, dt=DT, prewarp_frequency=omega)
    sampled = control.ss(found.A, found.B, found.C, found.D, DT)
    assert sampled(np.exp(1j * omega * DT)) == pytest.approx(continuous(1j * omega), rel=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_fmu_gives_the_response_of_forced_response(fmus: dict[str, Path], load: Load, kind: str) -> None:
    u = np.random.default_rng(1).standard_normal((4, 200))
    unit = load(fmus[kind])
    unit.set_all(
        {f"{side}_limit.y[{i}]": sign * 1e9 for side, sign in (("lower", -1), ("upper", 1)) for i in (1, 2, 3)}
    )
    unit.begin()
    found = []
    for now in u.T:
        unit.set_all({f"u[{i + 1}]": float(value) for i, value in enumerate(now)})
        found.append(unit.step())
    wanted = forced(SYSTEM, u - 0.1, X0=[0.1 * i for i in range(12)]) + 0.2
    assert_same(np.array(found).T, wanted)


def busy(unit: Unit, count: int, seed: int = 0) -> list[list[float]]:
    """Outputs and state while everything that can be set changes."""
    rng, found = np.random.default_rng(seed), []
    for k in range(count):
        signals = {f"u[{i}]": float(rng.standard_normal()) for i in range(1, 5)}
        tracked = {f"tracking.y[{i}]": float(rng.standard_normal()) for i in range(1, 4)}
        switches = {"enabled": bool(rng.random() < 0.7), "reset": bool(rng.random() < 0.05)}
        unit.set_all(signals | tracked | switches)
        if k % 10 == 9:
            unit.set_all({"upper_limit.y[2]": float(rng.uniform(0.5, 6.0)), "A[3,4]": float(rng.uniform(-0.1, 0.1))})
        found.append([*unit.step(), *unit.read("local")])
    return found


def test_both_kinds_give_the_same_bits(fmus: dict[str, Path], load: Load) -> None:
    native, python = (busy(load(fmus[kind]).begin(), 200) for kind in KINDS)
    assert native == python


@pytest.mark.parametrize("kind", KINDS)
def test_saved_state_goes_on_to_the_bit(fmus: dict[str, Path], load: Load, kind: str) -> None:
    unit = load(fmus[kind]).begin()
    busy(unit, 40)
    state, time = unit.fmu.getFMUstate(), unit.time
    after = busy(unit, 40, seed=1)
    unit.fmu.setFMUstate(state)
    unit.fmu.freeFMUstate(state)
    unit.time = time
    assert busy(unit, 40, seed=1) == after


@pytest.mark.parametrize("kind", KINDS)
def test_tuned_limit_holds_from_the_next_tick(fmus: dict[str, Path], load: Load, kind: str) -> None:
    unit = load(fmus[kind]).begin()
    busy(unit, 10)
    unit.set_all({"enabled": True, "reset": False, "u[1]": 1e6, "lower_limit.y[3]": 0.5, "upper_limit.y[3]": 0.5})
    assert unit.step()[2] == 0.5


@pytest.mark.parametrize("kind", KINDS)
def test_enabling_makes_no_jump(fmus: dict[str, Path], load: Load, kind: str) -> None:
    unit = load(fmus[kind])
    unit.set(enabled=False)
    unit.begin()
    tracked = [0.5, -1.5, 2.5]
    unit.set_all({f"tracking.y[{i + 1}]": value for i, value in enumerate(tracked)} | {"u[2]": 0.7})
    assert [unit.step() for _ in range(20)] == [tracked] * 20
    unit.set(enabled=True)
    assert unit.step() == pytest.approx(tracked, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_fmu_is_valid(fmus: dict[str, Path], kind: str) -> None:
    assert validate_fmu(str(fmus[kind])) == []


def test_same_system_gives_the_same_bytes(fmus: dict[str, Path], tmp_path: Path) -> None:
    X0 = [0.1 * i for i in range(12)]
    again = to_fmu(SYSTEM, tmp_path / "Twelve.fmu", limits={"y": (-8.0, 6.0)}, X0=X0, u0=0.1, y0=0.2)
    assert again.read_bytes() == fmus["native"].read_bytes()
    assert [path.name for path in tmp_path.iterdir()] == ["Twelve.fmu"]


def test_python_kind_carries_the_data(fmus: dict[str, Path]) -> None:
    with zipfile.ZipFile(fmus["python"]) as fmu:
        (name,) = [name for name in fmu.namelist() if name.endswith("/controller_data.py")]
        assert repr(float(SYSTEM.A[0, 0])) in fmu.read(name).decode()


def test_labels_become_legal_names_and_units() -> None:
    system = control.ss(
        0.5 * np.eye(2),
        np.ones((2, 4)),
        np.eye(2),
        0.0,
        DT,
        inputs=["rate error [rad/s]", "lambda", "gyro[0]", "gyro[1]"],
        outputs=["torque_x", "torque_y"],
        states=["integral", "lag"],
    )
    controller = controller_of(system, units={"gyro": "rad/s", "torque_x": "N.m"}, limits={"torque_y": 2.0})
    assert [(one.name, one.unit) for one in controller.inputs] == [
        ("rate_error", "rad/s"),
        ("lambda_", "1"),
        ("gyro[1]", "rad/s"),
        ("gyro[2]", "rad/s"),
    ]
    assert [(one.unit, one.upper) for one in controller.outputs] == [("N.m", np.finfo(float).max), ("1", 2.0)]
    shown = {leaf.name for leaf in leaves(linear_controller(controller).State)}
    assert {"integral", "lag", "output.torque_x"} <= shown


def test_given_names_may_be_structured() -> None:
    names = ["motor_torque.yaw", "motor_torque.pitch"]
    system = control.ss(0.5, [[1.0, 2.0]], [[1.0], [2.0]], 0.0, DT)
    controller = controller_of(
        system, inputs=["euler.yaw", "euler.pitch"], outputs=names, units={"motor_torque": "N.m"}
    )
    outputs = leaves(linear_controller(controller).Outputs)
    assert [(leaf.name, leaf.fact.unit) for leaf in outputs[:2]] == [(name, "N.m") for name in names]


INTEGRAL = control.ss(1.0, 1.0, 1.0, 0.0, DT)
LAG = control.tf([1.0], [1.0, 1.0])


@pytest.mark.parametrize(
    ("system", "options", "message"),
    [
        (LAG, {}, "the system is continuous: give dt=, in s"),
        (INTEGRAL, {"dt": 0.02}, "dt = 0.02 s, but the system's sampling time is 0.01 s; leave dt out"),
        (control.ss(1, 1, 1, 0, True), {}, "has no sampling time: give dt="),
        (control.ss(1, 1, 1, 0, None), {"dt": DT}, r"timebase is unspecified \(dt=None\)"),
        (LAG, {"dt": 1e-9}, "dt = 1e-09 s: too short"),
        (LAG, {"dt": DT, "method": "bogus"}, "cannot be sampled by 'bogus' at dt = 0.01 s"),
        (control.ss(20, 1, 1, 0), {"dt": 0.1}, "cannot be sampled by 'tustin' at dt = 0.1 s"),
        (
            control.ss(-100, 1, 1, 0),
            {"dt": 0.1, "method": "euler"},
            "is stable, sampled by 'euler' at dt = 0.1 s it is",
        ),
        (control.tf([1, 0, 0], [1, 1], DT), {}, r"from u\[0\] to y\[0\] is improper .* add a filter pole"),
        (control.ss(np.nan, 1, 1, 0, DT), {}, "the matrix A has entries that are no finite real numbers"),
        (control.tf([np.nan], [1, 0.5], DT), {}, "coefficients that are no finite numbers"),
        (control.frd([1, 2, 3], [1, 2, 3]), {}, "a FrequencyResponseData is no linear system with states"),
        (INTEGRAL, {"inputs": "enabled"}, "the input enabled has a name that the FMU needs for itself; give other"),
        (INTEGRAL, {"outputs": "Torque [N.m]"}, "the output Torque has a name that the FMU needs"),
        (INTEGRAL, {"inputs": "v", "outputs": "v"}, "the output v collides with the input v; give other names"),
        (INTEGRAL, {"inputs": ["a", "b"]}, r"2 names were given for 1 signals \(u\[0\]\)"),
        (INTEGRAL, {"units": {"z": "m"}}, r"units: there is no signal z \(signals: u\[1\], y\[1\]\)"),
        (INTEGRAL, {"units": {"u": "furlong"}}, r"units: u\[1\]: unit 'furlong'"),
        (INTEGRAL, {"limits": (1.0, 0.0)}, r"limits of y\[1\]: 1 is not below 0"),
        (INTEGRAL, {"limits": "high"}, r"limits of y\[1\] = 'high': give the largest magnitude"),
        (INTEGRAL, {"anti_windup": "some"}, "give 'conditioned', 'none' or a matrix"),
        (INTEGRAL, {"anti_windup": [[1.0, 2.0]]}, r"finite numbers of shape \(1, 1\) are wanted"),
        (control.tf([1], [1, -1], DT), {"anti_windup": [[1.0]]}, "turn it into a StateSpace first"),
        (INTEGRAL, {"X0": [1.0, 2.0]}, "X0 has 2 numbers, 1 are wanted"),
        (INTEGRAL, {"u0": np.nan}, "u0 = nan: not finite"),
    ],
)
def test_what_makes_no_controller_is_refused(system: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(ExportRefusedError, match=message):
        controller_of(system, **options)


@pytest.mark.parametrize("name", ["Controller.zip", "1st.fmu", "lambda.fmu"])
def test_file_name_that_is_no_model_name_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(ExportRefusedError, match=f"{re.escape(name)}: an FMU's file is called like its model"):
        to_fmu(INTEGRAL, tmp_path / name)


@pytest.mark.parametrize(("order", "delay"), [("jacobi", 1), ("gauss-seidel", 0)])
def test_gimbal_and_sensor_are_driven_by_an_exported_controller(
    sensor_dist: Path, tmp_path: Path, order: Order, delay: int
) -> None:
    # joints held by PD with a little of the sensor's attitude
    axes = ("yaw", "pitch", "roll")
    inertia, omega = np.diag([0.0079, 0.0056, 0.0023]), 2.0 * np.pi * 8.0  # of the default TripodGimbal
    D = np.hstack([-inertia * omega**2, -2.0 * inertia * omega, -0.01 * np.eye(3)])
    joints, rates, euler = ([f"{group}.{axis}" for axis in axes] for group in ("joint", "joint_rate", "euler"))
    torques = [f"motor_torque.{axis}" for axis in axes]
    controller = to_fmu(
        control.ss([], [], [], D),
        tmp_path / "Hold.fmu",
        dt=1e-3,
        inputs=[*joints, *rates, *euler],
        outputs=torques,
        units={"joint": "rad", "joint_rate": "rad/s", "euler": "rad", "motor_torque": "N.m"},
        limits=0.5,
    )
    (plant,) = build_all(sensor_dist, ["TripodGimbal"])
    system = System(
        "held",
        (
            Component("plant", plant),
            Component("sensor", sensor_dist / "AttitudeSensor.fmu"),
            Component("controller", controller),
        ),
        (
            *connect("plant", "sensor", "rate[:3]", "specific_force[:3]", "temperature"),
            *connect("plant", "controller", *joints, *rates),
            *connect("sensor", "controller", *euler),
            *connect("controller", "plant", *torques),
        ),
    )
    results = simulate(system, stop_time=0.5, order=order).results
    held = [f"plant.{name}" for name in [*joints, *rates]] + [f"sensor.{name}" for name in euler]
    u = np.array([results[name] for name in held])
    y = np.array([results[f"controller.{name}"] for name in torques])
    assert 0.0 < np.abs(y).max() < 0.5
    assert_same(y[:, 1:], D @ u[:, 1 - delay : u.shape[1] - delay])
    assert np.abs(u[:3]).max() < np.deg2rad(1.0)
