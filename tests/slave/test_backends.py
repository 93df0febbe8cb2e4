"""A backend is added by an entry point; several may drive one robot; the contract finds mistakes."""

from __future__ import annotations

import importlib
import re
import sys
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType, SimpleNamespace

import numpy as np
import pytest
import tomlkit
from pydantic import Field

from common.config.load import check_config, load_config
from common.errors import ConfigError, RobotError, TandemError
from common.metrics.slave import ServoMetrics
from common.quaternion import Array
from common.skeleton import Skeleton, load_skeleton
from slave.backends import BACKENDS, ServosConfig
from slave.config import SlaveConfig
from slave.encoders.counts import EncoderConfig, Encoders
from slave.servos import EncoderReading, Servos
from slave.servos.absent.config import AbsentConfig
from slave.servos.absent.servos import AbsentServos
from slave.servos.backend import Backend, BackendConfig
from slave.servos.canopen.config import CanopenConfig
from slave.servos.contract import Subject, check
from slave.servos.entry_points import GROUP, own_place
from slave.servos.mixed import MixedServos, ServoPart
from slave.servos.servos import LimitsTorque
from slave.servos.shares import part_of

HAND = load_skeleton("hand")


class Ideal:
    """Servos that are at once where they are sent."""

    def __init__(self, skeleton: Skeleton, encoders: EncoderConfig) -> None:
        self._encoders = Encoders(skeleton, encoders)
        self._setpoint = np.zeros(len(skeleton.joints))
        self._read_ns = 0
        self._running = False

    def start(self) -> None:
        if self._running:
            raise RobotError("runs already")
        self._running = True

    def write(self, position_rad: Array) -> None:
        if position_rad.shape != self._setpoint.shape or not np.isfinite(position_rad).all():
            raise ValueError(f"setpoints must be {len(self._setpoint)} finite angles")
        self._setpoint = position_rad.copy()

    def read(self) -> EncoderReading:
        self._read_ns += 1
        counts = self._encoders.counts(self._setpoint)
        return EncoderReading(self._read_ns, counts, np.ones(len(counts), np.bool_))

    def faults(self) -> Mapping[str, str]:
        return {}

    def quick_stop(self, stop: bool) -> None: ...

    def metrics(self) -> ServoMetrics:
        return ServoMetrics()

    def stop(self) -> None:
        self._running = False


class IdealConfig(BackendConfig):
    port: int = Field(ge=1)


IDEAL = Backend(IdealConfig, lambda config, skeleton, encoders, _: Ideal(skeleton, encoders), remembers=False)

Install = Callable[[dict[str, str]], None]


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Install:
    """Make packages with these entry points installed, one each."""

    def make(points: dict[str, str]) -> None:
        for i, (name, value) in enumerate(points.items()):
            place = tmp_path / str(i)
            info = place / f"package_{i}-1.0.dist-info"
            info.mkdir(parents=True)
            (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: package-{i}\nVersion: 1.0\n")
            (info / "entry_points.txt").write_text(f"[tandem.servos]\n{name.strip()} = {value}\n")
            monkeypatch.syspath_prepend(place)
        monkeypatch.setitem(sys.modules, "acme", SimpleNamespace(BACKEND=IDEAL, WRONG=3))

    return make


def subject(servos: Servos) -> Subject:
    return Subject(servos, HAND, EncoderConfig(), pass_time=lambda: None, most_turns=10)


def load(servos: dict[str, object]) -> ServosConfig:
    return check_config(Path("slave.toml"), servos, ServosConfig)


def test_an_entry_point_adds_a_backend(install: Install) -> None:
    install({"ideal": "acme:BACKEND"})
    config = load({"backend": "ideal", "ideal": {"port": 3}})
    assert config.section(IdealConfig).port == 3
    assert not config.remembers
    check(subject(config.open(HAND, EncoderConfig())))


@pytest.mark.parametrize(
    ("servos", "said"),
    [
        ({"ideal": {"port": 0}}, "ideal.port = 0: expected greater than or equal to 1"),
        ({"ideal": {"port": 1, "bord": 2}}, "ideal.bord = 2: expected no such key"),
        ({"steam": {}}, "steam = {}: expected no such key"),
        (
            {"backend": "steam"},
            "backend = 'steam': expected 'mujoco', 'canopen', 'dynamixel', 'absent' or 'ideal'",
        ),
        ({"canopen": {"sync_hz": 1}}, "canopen.sync_hz = 1: expected greater than or equal to 10"),
    ],
)
def test_a_mistake_names_the_key_in_the_section(
    install: Install, servos: dict[str, object], said: str
) -> None:
    install({"ideal": "acme:BACKEND"})
    with pytest.raises(ConfigError) as raised:
        load(servos)
    assert said in str(raised.value)


def test_a_required_section_is_asked_for_only_with_its_backend() -> None:
    assert load({}).mistakes_for(HAND, EncoderConfig()) == []
    (mistake,) = load({"backend": "dynamixel"}).mistakes_for(HAND, EncoderConfig())
    assert mistake.key == "servos.dynamixel"
    assert mistake.expected == "a section with port and ids"
    assert load({}).section(CanopenConfig) == CanopenConfig()


class Late(Ideal):
    def read(self) -> EncoderReading:
        self._read_ns -= 2
        return super().read()


class Deaf(Ideal):
    def write(self, position_rad: Array) -> None: ...


class Silent(Ideal):
    def read(self) -> EncoderReading:
        reading = super().read()
        return EncoderReading(reading.read_ns, reading.counts, ~reading.valid)


@pytest.mark.parametrize("kind", [Late, Deaf, Silent])
def test_the_contract_finds_servos_that_break_it(kind: type[Ideal]) -> None:
    with pytest.raises(AssertionError):
        check(subject(kind(HAND, EncoderConfig())))


def payload(**section: object) -> ServosConfig:
    return ServosConfig.model_validate({"payload": {"left_hand": section}})


def test_a_payload_is_of_a_segment_of_the_robot() -> None:
    servos = payload(mass_kg=0.5, center_m=[0.0, 0.0, -0.08])
    assert servos.mistakes_for(load_skeleton("nursing"), EncoderConfig()) == []
    (mistake,) = servos.mistakes_for(HAND, EncoderConfig())
    assert mistake.key == "servos.payload.left_hand"
    assert "a segment of the hand profile" in mistake.expected
    assert ServosConfig().payload == {}


@pytest.mark.parametrize(
    "wrong",
    [
        {"mass_kg": 0.0, "center_m": [0.0, 0.0, 0.0]},
        {"mass_kg": 10.1, "center_m": [0.0, 0.0, 0.0]},
        {"mass_kg": 1.0, "center_m": [0.0, 0.0]},
        {"mass_kg": 1.0, "center_m": [0.0, 0.0, 1.1]},
        {"mass_kg": 1.0},
    ],
)
def test_a_payload_that_cannot_be_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match="payload"):
        payload(**wrong)


# the packages that offer backends


def test_pyproject_names_the_backends_that_tandem_knows_without_being_installed() -> None:
    text = (Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8")
    points = tomllib.loads(text)["project"]["entry-points"][GROUP]
    assert points == {name: own_place(name) for name in BACKENDS}
    for point in points.values():
        module, _, attribute = point.partition(":")
        assert getattr(importlib.import_module(module), attribute) in BACKENDS.values()


@pytest.mark.parametrize(
    ("points", "said"),
    [
        ({"ideal": "acme:NOTHING"}, "servo backend 'ideal' cannot be loaded from acme:NOTHING"),
        (
            {"ideal": "acme.nowhere:BACKEND"},
            "'ideal' cannot be loaded from acme.nowhere:BACKEND",
        ),
        ({"ideal": "acme:WRONG"}, "servo backend 'ideal': expected a Backend at acme:WRONG, not 3"),
        ({"mujoco": "acme:BACKEND"}, "two packages offer the servo backend 'mujoco'"),
        (
            {"ideal": "acme:BACKEND", "ideal ": "other:BACKEND"},
            "two packages offer the servo backend 'ideal'",
        ),
    ],
)
def test_a_package_that_cannot_be_used_is_named(install: Install, points: dict[str, str], said: str) -> None:
    install(points)
    with pytest.raises(TandemError, match=re.escape(said)):
        load({"backend": "ideal"}).open(HAND, EncoderConfig())


def test_a_broken_package_does_not_disturb_other_robots(install: Install) -> None:
    install({"broken": "acme.nowhere:BACKEND"})
    assert load({"backend": "canopen"}).mistakes_for(load_skeleton("nursing"), EncoderConfig()) == []


# several backends

NURSING = load_skeleton("nursing")
NO_WAIST = {"mujoco": ["[!w]*"], "absent": ["waist_*"]}


@pytest.mark.parametrize(
    ("servos", "said"),
    [
        ({"joints": {"steam": ["*"]}}, "joints = {'steam': ['*']}: expected 'mujoco', 'canopen'"),
        (
            {"joints": {"mujoco": ["wing_*"]}},
            "servos.joints.mujoco = 'wing_*': expected a joint",
        ),
        ({"joints": {"mujoco": ["*"], "absent": ["neck_yaw"]}}, "mujoco drives this one too"),
        (
            {"joints": {"mujoco": ["left_*", "right_*", "neck_*"]}},
            '"absent" for one without a servo: waist_pitch',
        ),
        ({"joints": {"mujoco": ["*"]}, "backend": "mujoco"}, "either one backend for the whole robot"),
        (
            {
                "joints": {"mujoco": ["[!w]*"], "absent": ["waist_*"]},
                "absent": {"angle_deg": {"waist_pitch": 99}},
            },
            "servos.absent.angle_deg.waist_pitch = 99.0: expected within",
        ),
        (
            {
                "joints": {"mujoco": ["[!w]*"], "absent": ["waist_*"]},
                "absent": {"angle_deg": {"neck_yaw": 9}},
            },
            "expected a joint that is listed as absent",
        ),
        (
            {"joints": {"dynamixel": ["*"]}},
            "servos.dynamixel = (not set): expected a section with port and ids",
        ),
    ],
)
def test_a_mistake_in_the_shares_is_told_with_its_key(
    tmp_path: Path, servos: dict[str, dict[str, object]], said: str
) -> None:
    file = tmp_path / "slave.toml"
    document = tomlkit.document()
    document.update({"robot": "r", "link": {"listen": ["tcp/127.0.0.1:1"]}, "servos": servos})
    file.write_text(tomlkit.dumps(document))
    with pytest.raises(ConfigError, match=re.escape(said)):
        load_config(file, SlaveConfig)


class Faulty(Ideal):
    """With a torque at each joint, a drive's own angle, and a fault."""

    said: dict[str, str]
    started: list[str]

    def start(self) -> None:
        super().start()
        self.started.append("faulty")

    def read(self) -> EncoderReading:
        reading = super().read()
        return replace(reading, effort_nm=self._setpoint + 1.0, drive_rad=self._setpoint.copy())

    def faults(self) -> Mapping[str, str]:
        return self.said

    def stop(self) -> None:
        super().stop()
        self.started.append("stopped")


class WillNot(Ideal):
    def start(self) -> None:
        raise RobotError("no power")


def mixed(*servos: Ideal) -> MixedServos:
    """Hands of 14 joints: the first half by one kind of servos, the rest by another."""
    each = enumerate(zip(servos, HALVES, strict=True))
    return MixedServos(HAND.joint_names, [ServoPart(f"kind{i}", one, joints) for i, (one, joints) in each])


HALVES = np.array_split(np.arange(len(HAND.joints)), 2)


def half(kind: type[Ideal], i: int) -> Ideal:
    own, encoders = part_of(HAND, EncoderConfig(), [HAND.joint_names[j] for j in HALVES[i]])
    return kind(own, encoders)


def test_several_backends_keep_the_contract_of_one() -> None:
    check(subject(mixed(half(Ideal, 0), half(Ideal, 1))))


def test_a_reading_is_put_together_and_as_old_as_its_oldest_part() -> None:
    faulty = half(Faulty, 1)
    servos = mixed(half(Ideal, 0), faulty)
    assert isinstance(faulty, Faulty)
    faulty._read_ns = 100
    reading = servos.read()
    assert reading.read_ns == 1
    assert reading.stamp_error_ns == 100
    assert reading.effort_nm is not None
    assert reading.drive_rad is not None
    assert np.isnan(reading.effort_nm[HALVES[0]]).all()
    assert np.isnan(reading.drive_rad[HALVES[0]]).all()
    assert (reading.effort_nm[HALVES[1]] == 1.0).all()
    assert (reading.drive_rad[HALVES[1]] == 0.0).all()
    assert mixed(half(Ideal, 0), half(Ideal, 1)).read().effort_nm is None


class Limiting(Ideal):
    """Takes torque limits, but for one joint."""

    no_torque_limit = MappingProxyType({HAND.joint_names[HALVES[0][1]]: "its drive takes none"})
    torque_nm: Array | None = None

    def limit_torque(self, torque_nm: Array | None) -> None:
        self.torque_nm = torque_nm


def test_torque_limits_reach_the_backends_that_take_them_and_the_others_are_named() -> None:
    taking = half(Limiting, 0)
    assert isinstance(taking, Limiting)
    servos = mixed(taking, half(Ideal, 1))
    assert isinstance(servos, LimitsTorque)
    most_nm = np.arange(float(len(HAND.joints)))
    servos.limit_torque(np.stack((-most_nm, most_nm)))
    assert taking.torque_nm is not None
    np.testing.assert_array_equal(taking.torque_nm, [-most_nm[HALVES[0]], most_nm[HALVES[0]]])
    servos.limit_torque(None)
    assert taking.torque_nm is None
    with pytest.raises(ValueError, match="torque limits must be"):
        servos.limit_torque(np.stack((-most_nm, most_nm))[:, :3])
    said = servos.no_torque_limit
    assert said[HAND.joint_names[HALVES[0][1]]] == "its drive takes none"
    for joint in HALVES[1]:
        assert said[HAND.joint_names[joint]].startswith("tandem cannot limit the torque of ")
    assert len(said) == 1 + len(HALVES[1])


def test_a_fault_of_one_backend_is_a_fault_of_the_robot() -> None:
    faulty = half(Faulty, 1)
    assert isinstance(faulty, Faulty)
    faulty.said = {"left_thumb": "hot"}
    assert mixed(half(Ideal, 0), faulty).faults() == {"left_thumb": "hot"}


def test_where_one_backend_does_not_start_the_others_are_let_go_and_it_is_named() -> None:
    faulty = half(Faulty, 0)
    assert isinstance(faulty, Faulty)
    faulty.started = []
    with pytest.raises(RobotError, match=r"^kind1: no power$"):
        mixed(faulty, half(WillNot, 1)).start()
    assert faulty.started == ["faulty", "stopped"]
    assert not faulty._running


def test_the_backend_that_needs_ticks_is_started_last() -> None:
    config = load({"joints": {"canopen": ["[!w]*"], "absent": ["waist_*"]}})
    servos = config.open(NURSING, EncoderConfig())
    assert isinstance(servos, MixedServos)
    assert [part.name for part in servos._parts] == ["absent", "canopen"]
    assert config.bus_lag_s == pytest.approx(0.03)
    assert config.remembers
    assert config.share(CanopenConfig, NURSING, EncoderConfig()).skeleton.joint_names == tuple(
        name for name in NURSING.joint_names if name != "waist_pitch"
    )


def test_absent_servos_keep_still_and_say_so() -> None:
    config = AbsentConfig(angle_deg={"waist_pitch": 5.0})
    own, encoders = part_of(NURSING, EncoderConfig(zero_counts={"waist_pitch": 7}), ["waist_pitch"])
    servos = AbsentServos(config, own, encoders, clock=lambda: 5)
    before = servos.read()
    servos.start()
    with pytest.raises(RobotError):
        servos.start()
    servos.write(np.array([0.3]))
    assert (servos.read().counts == before.counts).all()
    assert servos.metrics().not_driven == {
        "waist_pitch": "has no servo; the file states that it stands at 5.0°"
    }
