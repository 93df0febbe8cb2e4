"""What the slave hands to local readers: each tick, and the guard's state to whoever may not know it."""

from __future__ import annotations

from pathlib import Path

import msgpack
import numpy as np
import pytest

from common.config.load import load_config
from common.errors import ConfigError, RecordingError
from slave.config import SlaveConfig
from slave.tap import GUARD, TICK, RobotTick, SlaveTap, decode_tick, encode_tick

EXAMPLE = Path(__file__).parents[2] / "deploy/examples/slave.toml"


class Readers:
    def __init__(self) -> None:
        self.read, self.behind = True, False
        self.heard: list[tuple[str, bytes]] = []

    def put(self, topic: str, payload: bytes, stamp_ns: int | None = None) -> None:
        self.heard.append((topic, payload))

    def put_snapshot(self, topic: str, payload: bytes) -> None:
        self.behind = False
        self.heard.append((topic, payload))

    def take(self) -> list[str]:
        topics = [topic for topic, _ in self.heard]
        self.heard = []
        return topics


def tick(now_ns: int = 5) -> RobotTick:
    angles = np.linspace(-1.0, 1.0, 25)
    return RobotTick(now_ns, now_ns - 1, True, angles, angles / 3, angles > 0.0, angles / 7)


def test_a_tick_comes_back_bit_for_bit() -> None:
    before, after = tick(), decode_tick(encode_tick(tick()))
    assert (after.now_ns, after.read_ns, after.ready) == (5, 4, True)
    for one, other in zip(
        (before.setpoint_rad, before.position_rad, before.valid, before.target_rad),
        (after.setpoint_rad, after.position_rad, after.valid, after.target_rad),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)


def test_a_tick_without_a_target_and_one_of_the_version_before_are_read() -> None:
    version, *fields, _ = msgpack.unpackb(encode_tick(tick()))
    assert decode_tick(msgpack.packb([version, *fields, None])).target_rad is None
    assert decode_tick(msgpack.packb([1, *fields])).target_rad is None


@pytest.mark.parametrize(
    "nonsense", [b"", b"\xc1", msgpack.packb([1, 2]), msgpack.packb([9, 5, 4, True, b"", b"", b""])]
)
def test_a_tick_of_another_version_is_refused(nonsense: bytes) -> None:
    with pytest.raises(RecordingError):
        decode_tick(nonsense)


def test_the_guard_is_told_once_a_change_and_to_who_was_behind() -> None:
    readers = Readers()
    tap = SlaveTap(readers)
    tap.tick(tick(), "hold", "started")
    assert readers.take() == [GUARD, TICK]
    tap.tick(tick(), "hold", "started")
    assert readers.take() == [TICK]
    tap.tick(tick(), "hold", "no command for 0.20 s")
    assert readers.take() == [GUARD, TICK]
    readers.behind = True
    tap.tick(tick(), "hold", "no command for 0.20 s")
    assert readers.take() == [GUARD, TICK]
    assert not readers.behind


def test_without_readers_nothing_is_encoded() -> None:
    readers = Readers()
    readers.read = False
    SlaveTap(readers).tick(tick(), "hold", "")
    assert readers.take() == []


def test_the_file_names_the_socket(tmp_path: Path) -> None:
    config = load_config(EXAMPLE, SlaveConfig, (f'tap.socket="{tmp_path}/s.sock"',))
    assert config.tap.socket == tmp_path / "s.sock"
    with pytest.raises(ConfigError, match="folder that exists"):
        load_config(EXAMPLE, SlaveConfig, ('tap.socket="/no/such/folder/s.sock"',))
