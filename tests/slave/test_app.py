"""The slave's loop with a link and servos that are not there, on ticks that are given."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from types import MappingProxyType
from typing import Any, ClassVar, Literal

import numpy as np
import pytest

from common.clock import to_ns
from common.clock_sync import Offset
from common.link.config import LinkConfig
from common.metrics.slave import ServoMetrics, SlaveMetrics
from common.process.notify import Notifier
from common.process.pacing import DueTick, TickGrid
from common.quaternion import Array
from common.wire.codec import decode
from common.wire.messages import Command, CommandStamps, Statistics
from common.wire.topics import Topic
from slave import app
from slave.camera.config import CameraConfig, CamerasConfig
from slave.config import SlaveConfig
from slave.contact.config import ContactConfig
from slave.limit.limit import Setpoint
from slave.servos import EncoderReading

LIMIT_NM = np.stack([np.full(25, -1.0), np.full(25, 1.0)])


class FakeLink:
    paths = ""

    def __init__(self) -> None:
        self.put: dict[str, int] = {}

    def publish(
        self, topic: Topic, on_wanted: Callable[[bool], None] | None = None
    ) -> Callable[[bytes], None]:
        def put(_: bytes) -> None:
            self.put[topic.name] = self.put.get(topic.name, 0) + 1

        return put

    def subscribe(self, *_: object) -> None: ...

    def subscribe_keys(self, *_: object) -> None: ...

    def answer(self, *_: object) -> None: ...

    def answer_keys(self, *_: object) -> None: ...

    def watch_presence(self, *_: object) -> None: ...


class StillServos:
    def faults(self) -> dict[str, str]:
        return {}

    def read(self) -> EncoderReading:
        return EncoderReading(0, np.zeros(25, np.int64), np.zeros(25, np.bool_))


def test_a_loop_that_misses_every_second_tick_still_sends_the_state(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def odd_ticks(grid: TickGrid) -> AsyncIterator[DueTick]:
        for tick in range(1, 41, 2):
            yield DueTick(tick, grid.origin_ns, 1)

    monkeypatch.setattr(app, "ticks", odd_ticks)
    link: Any = FakeLink()
    servos: Any = StillServos()
    config = SlaveConfig(robot="robot-1", link=LinkConfig(listen=["tcp/127.0.0.1:7447"]))
    asyncio.run(app.Slave(config, link, servos)._drive())
    assert link.put == {"state": 40 // config.loop.state_every, "summary": 1}


def test_a_button_that_is_pressed_at_the_start_stops_the_drives_in_the_first_tick(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def one_tick(grid: TickGrid) -> AsyncIterator[DueTick]:
        yield DueTick(1, grid.origin_ns, 0)

    class Braking(StillServos):
        asked: ClassVar[list[bool]] = []

        def quick_stop(self, stop: bool) -> None:
            self.asked.append(stop)

    class Pressed:
        def read(self, now_ns: int) -> dict[str, str]:
            return {"red button": "gpio line STOP: pressed, or its wire is broken"}

    monkeypatch.setattr(app, "ticks", one_tick)
    link: Any = FakeLink()
    servos: Any = Braking()
    stops: Any = Pressed()
    config = SlaveConfig(robot="robot-1", link=LinkConfig(listen=["tcp/127.0.0.1:7447"]))
    slave = app.Slave(config, link, servos, stops=stops)
    asyncio.run(slave._drive())
    assert Braking.asked == [True]
    guard = slave._pipeline.guard
    assert guard.state == "estop"  # from boot: no encoder has been read yet
    assert "red button" in guard.reason


def test_each_one_way_is_told_once(monkeypatch: pytest.MonkeyPatch) -> None:
    words: list[Any] = []

    class Keeping(FakeLink):
        def publish(
            self, topic: Topic, on_wanted: Callable[[bool], None] | None = None
        ) -> Callable[[bytes], None]:
            def keep(payload: bytes) -> None:
                metrics = decode(payload, Statistics).metrics
                assert isinstance(metrics, SlaveMetrics)
                words.append(metrics.one_way_recent_us)

            return keep

        def counters(self) -> dict[str, object]:
            return {}

    class Plain(StillServos):
        def metrics(self) -> ServoMetrics:
            return ServoMetrics()

    async def two_seconds(grid: TickGrid) -> AsyncIterator[DueTick]:
        for tick in range(2):
            yield DueTick(tick, grid.origin_ns, 0)

    monkeypatch.setattr(app, "ticks", two_seconds)
    link: Any = Keeping()
    servos: Any = Plain()
    slave = app.Slave(
        SlaveConfig(robot="robot-1", link=LinkConfig(listen=["tcp/127.0.0.1:7447"])), link, servos
    )
    slave._pipeline.traffic.one_way.record(3_000_000)
    asyncio.run(slave._publish_statistics())
    assert words == [(3000,), ()]


@pytest.mark.parametrize(
    ("limits", "on", "said"),
    [
        (True, True, ""),
        (True, False, "contact.torque_limit is switched off"),
        (False, True, "tandem cannot limit the torque of mujoco servos"),
    ],
)
def test_torque_limits_reach_drives_that_take_them_and_others_are_named(
    monkeypatch: pytest.MonkeyPatch, limits: bool, on: bool, said: str
) -> None:
    written: list[str] = []

    class Plain(StillServos):
        def metrics(self) -> ServoMetrics:
            return ServoMetrics()

        def quick_stop(self, stop: bool) -> None: ...

        def write(self, position_rad: Array) -> None:
            written.append("setpoint")

    class Limiting(Plain):
        no_torque_limit = MappingProxyType({"neck_yaw": "its drive takes none"})

        def limit_torque(self, torque_nm: Array | None) -> None:
            assert torque_nm is LIMIT_NM
            written.append("limit")

    class Pipeline:
        def tick(self, *_: object) -> Setpoint:
            return Setpoint(np.zeros(25), np.zeros(25), LIMIT_NM)

    async def one_tick(grid: TickGrid) -> AsyncIterator[DueTick]:
        yield DueTick(1, grid.origin_ns, 0)

    monkeypatch.setattr(app, "ticks", one_tick)
    link: Any = FakeLink()
    link.counters = dict
    servos: Any = Limiting() if limits else Plain()
    contact = ContactConfig(torque_limit=on)
    config = SlaveConfig(robot="robot-1", link=LinkConfig(listen=["tcp/127.0.0.1:7447"]), contact=contact)
    slave = app.Slave(config, link, servos)
    monkeypatch.setattr(slave._pipeline, "tick", Pipeline().tick)
    asyncio.run(slave._drive())
    assert written == (["limit", "setpoint"] if limits else ["setpoint"])
    metrics = slave.metrics().servos
    assert metrics.unlimited == said
    assert metrics.no_torque_limit == ({"neck_yaw": "its drive takes none"} if limits and on else {})


class StuckServos(StillServos):
    """The third reading never comes; here it raises, so that the test can go on."""

    def __init__(self, beats: list[int]) -> None:
        self.read_after: list[int] = []
        self._beats = beats

    def read(self) -> EncoderReading:
        self.read_after.append(len(self._beats))
        if len(self.read_after) == 3:
            raise TimeoutError
        return super().read()


def test_the_servo_loop_feeds_the_watchdog_at_the_end_of_each_tick(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def some_ticks(grid: TickGrid) -> AsyncIterator[DueTick]:
        for tick in range(1, 6):
            yield DueTick(tick, grid.origin_ns, 0)

    beats: list[int] = []

    class Counting(Notifier):
        def beat(self, now_ns: int) -> None:
            beats.append(now_ns)

    monkeypatch.setattr(app, "ticks", some_ticks)
    link: Any = FakeLink()
    stuck = StuckServos(beats)
    servos: Any = stuck
    config = SlaveConfig(robot="robot-1", link=LinkConfig(listen=["tcp/127.0.0.1:7447"]))
    slave = app.Slave(config, link, servos, notifier=Counting())
    with pytest.raises(TimeoutError):
        asyncio.run(slave._drive())
    assert stuck.read_after == [0, 1, 2]
    assert len(beats) == 2  # the tick that hung did not count


def camera_slave(source: Literal["off", "robot"], *beside: CameraConfig) -> app.Slave:
    link: Any = FakeLink()
    servos: Any = StillServos()
    config = SlaveConfig(
        robot="robot-1",
        link=LinkConfig(listen=["tcp/127.0.0.1:7447"]),
        camera=CamerasConfig(source=source, others=list(beside)),
    )
    return app.Slave(config, link, servos)


def command(seen_frame: int, lease: int = 1) -> Command:
    none, zero = np.ones(25, np.bool_), np.zeros(25)
    return Command("robot-1", lease, 1, 1, CommandStamps(0, 0, 0, 0), True, none, zero, zero, seen_frame, 0)


def test_the_age_of_the_picture_that_the_operator_has_reaches_the_guard(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now_ns = to_ns(1000.0)
    monkeypatch.setattr(app, "monotonic_ns", lambda: now_ns)
    slave = camera_slave("robot")
    most_s = slave._config.guard.max_video_age_s
    (camera,), accepted = slave._cameras.feeds, slave._pipeline.on_accepted
    assert accepted is not None
    offset = Offset(0, 0, trusted=True)
    camera.sight.sent(7, now_ns, now_ns)
    accepted(command(0), now_ns, offset)
    now_ns += to_ns(2.0 * most_s)
    assert slave._body().video is None, "no picture has come to the operator"
    camera.sight.sent(8, now_ns, now_ns)
    accepted(command(8), now_ns, offset)
    now_ns += to_ns(most_s)
    assert slave._body().video is None
    now_ns += 1
    assert "picture" in (slave._body().first_fault or "")
    accepted(command(0, lease=2), now_ns, offset)
    assert slave._body().video is None, "another operator, who has none"


def test_the_camera_that_stands_still_is_named_and_one_that_nobody_relies_on_holds_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now_ns = to_ns(1000.0)
    monkeypatch.setattr(app, "monotonic_ns", lambda: now_ns)
    room = CameraConfig(source="robot", name="room", relied_on=False)
    slave = camera_slave("robot", CameraConfig(source="robot", name="hand"), room)
    head, hand, beside = slave._cameras.feeds
    accepted = slave._pipeline.on_accepted
    assert accepted is not None
    offset = Offset(0, 0, trusted=True)
    for number, feed in enumerate((head, hand, beside), start=7):
        feed.sight.sent(number, now_ns, now_ns)
        accepted(command(number), now_ns, offset)
    now_ns += to_ns(2.0 * slave._config.guard.max_video_age_s)
    head.sight.sent(20, now_ns, now_ns)
    accepted(command(20), now_ns, offset)
    assert (slave._body().video or "").startswith("camera hand: the operator's newest picture is")
    hand.sight.sent(21, now_ns, now_ns)
    accepted(command(21), now_ns, offset)
    assert slave._body().video is None


def test_a_robot_without_a_camera_waits_for_no_picture() -> None:
    slave = camera_slave("off")
    assert slave._cameras.feeds == []
    assert slave._body().video is None
