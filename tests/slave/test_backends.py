"""A backend is added by one line in the table; the contract finds what it does wrong."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from pydantic import Field

from common.config.load import check_config
from common.errors import ConfigError, RobotError
from common.metrics.slave import ServoMetrics
from common.quaternion import Array
from common.skeleton import Skeleton, load_skeleton
from slave.backends import BACKENDS, Backend, ServosConfig
from slave.encoders.counts import EncoderConfig, Encoders
from slave.servos import EncoderReading, Servos
from slave.servos.backend import BackendConfig
from slave.servos.canopen.config import CanopenConfig
from tests.slave.servos.contract import Subject, check

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


def subject(servos: Servos) -> Subject:
    return Subject(servos, HAND, EncoderConfig(), pass_time=lambda: None, most_turns=10)


def load(servos: dict[str, object]) -> ServosConfig:
    return check_config(Path("slave.toml"), servos, ServosConfig)


def test_a_line_in_the_table_adds_a_backend(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(BACKENDS, "ideal", IDEAL)
    config = load({"backend": "ideal", "ideal": {"port": 3}})
    assert config.section(IdealConfig).port == 3
    assert not config.entry.remembers
    check(subject(config.open(HAND, EncoderConfig())))


@pytest.mark.parametrize(
    ("servos", "said"),
    [
        ({"ideal": {"port": 0}}, "ideal.port = 0: expected greater than or equal to 1"),
        ({"ideal": {"port": 1, "bord": 2}}, "ideal.bord = 2: expected no such key"),
        ({"steam": {}}, "steam = {}: expected no such key"),
        ({"backend": "steam"}, "backend = 'steam': expected 'mujoco', 'canopen', 'dynamixel' or 'ideal'"),
        ({"canopen": {"sync_hz": 1}}, "canopen.sync_hz = 1: expected greater than or equal to 10"),
    ],
)
def test_a_mistake_names_the_key_in_the_section(
    monkeypatch: pytest.MonkeyPatch, servos: dict[str, object], said: str
) -> None:
    monkeypatch.setitem(BACKENDS, "ideal", IDEAL)
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
