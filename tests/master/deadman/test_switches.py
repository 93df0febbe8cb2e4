"""A pedal in the master's process: every commanded robot is told the same, and at once."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from common.config.load import load_config
from common.wire.codec import decode
from common.wire.messages import Command
from common.wire.topics import COMMAND, Topic
from deploy.sim.suit.buttons import DEADMAN, Buttons
from master import app
from master.config import MasterConfig
from master.joint_angles.sample import JointAngleSample
from master.suit.protocol import SHIPPED_DBC
from tests.common.inputs.pseudo import CLUTCH, PEDAL, Socket, socket

__all__ = ["socket"]
EXAMPLE = Path(__file__).parents[3] / "deploy" / "examples" / "master.toml"
WITH_PEDAL = 'operator.deadman={source="pedal",device="/dev/input/by-id/pedal",key="KEY_B"}'
WITH_CLUTCH = 'operator.clutch={source="pedal",device="/dev/input/by-id/pedal",key="KEY_C"}'
WITH_BUTTON = 'operator.deadman={source="can",bus="suit",signal="DEADMAN"}'
ROBOTS = ("one", "two", "three")
Grips = list[tuple[bool, bool]]
"""Of commands: deadman held, clutch out."""


class Link:
    def __init__(self) -> None:
        self.commands: list[Command] = []

    def publish(self, topic: Topic) -> Callable[[bytes], None]:
        return self._put if topic.rate_hz == COMMAND.rate_hz else lambda payload: None

    def _put(self, payload: bytes) -> None:
        self.commands.append(decode(payload, Command, 25))

    def subscribe(self, *_: object, **__: object) -> None: ...

    def subscribe_keys(self, *_: object, **__: object) -> None: ...

    def watch_presence(self, *_: object) -> None: ...

    def counters(self) -> dict[str, object]:
        return {}


class Session:
    paths = ""
    overheard = None

    def __init__(self) -> None:
        self.links = {name: Link() for name in ROBOTS}

    def link(self, name: str) -> Link:
        return self.links[name]

    async def told(self, commands: int) -> None:
        """Turns of the loop until every robot got so many, or the test's own time is up."""
        while len(self.grips()) < commands:  # noqa: ASYNC110 (a command is no event of the loop's own)
            await asyncio.sleep(0)

    def grips(self) -> Grips:
        """What all robots were told; each the same."""
        each = [[(c.deadman_held, c.clutch_out) for c in link.commands] for link in self.links.values()]
        assert each[0] == each[1] == each[2]
        return each[0]


POSTURE = JointAngleSample(1, 0, 0, np.zeros(25), np.zeros(25), np.ones(25, np.bool_))


@contextmanager
def mastering(*overrides: str) -> Iterator[tuple[app.Master, Session]]:
    """A master whose switches are read, on a running loop."""
    robots = ["robots=" + str(list(ROBOTS)).replace("'", '"')]
    session: Any = Session()
    master = app.Master(load_config(EXAMPLE, MasterConfig, [*robots, *overrides]), session)
    master._switches.start(master._send_at_once, master._on_zero_pose_key)
    try:
        yield master, session
    finally:
        master._switches.close()


def test_a_release_reaches_every_robot_at_once_with_the_newest_posture(socket: Socket) -> None:
    pedal = socket.plug_in()

    async def story() -> None:
        with mastering(WITH_PEDAL) as (master, session):
            master._send(POSTURE)
            pedal.press()
            master._send(POSTURE)
            assert session.grips() == [(False, False), (True, False)]
            pedal.release()
            await session.told(3)  # no posture comes: the event alone
            master._send(POSTURE)
            assert session.grips()[2:] == [(False, False), (False, False)]
            sequences = [c.sequence for c in session.links["one"].commands]
            assert sequences == [1, 2, 3, 4]

    asyncio.run(story())


def test_a_release_that_the_loop_has_not_seen_is_in_the_very_next_command(socket: Socket) -> None:
    pedal = socket.plug_in()

    async def story() -> None:
        with mastering(WITH_PEDAL) as (master, session):
            pedal.press()
            master._send(POSTURE)
            pedal.release()
            pedal.press()
            master._send(POSTURE)
            master._send(POSTURE)
            assert [held for held, _ in session.grips()] == [True, False, True]

    asyncio.run(story())


def test_a_pedal_that_is_not_there_is_not_held_and_the_status_says_so() -> None:
    async def story() -> None:
        with mastering(WITH_PEDAL.replace("/dev/input/by-id/pedal", "no such pedal")) as (master, session):
            master._send(POSTURE)
            assert session.grips() == [(False, False)]
            assert "no input device is named 'no such pedal'" in master.metrics().switches["deadman"]

    asyncio.run(story())


def test_an_unplugged_pedal_reaches_every_robot_at_once(socket: Socket) -> None:
    pedal = socket.plug_in()

    async def story() -> None:
        with mastering(WITH_PEDAL, WITH_CLUTCH) as (master, session):
            pedal.press()
            pedal.press(CLUTCH)
            master._send(POSTURE)
            pedal.unplug()
            await session.told(2)
            assert session.grips() == [(True, False), (False, True)]
            assert "has gone" in master.metrics().switches["deadman"]

    asyncio.run(story())


def test_the_clutch_is_a_second_key_of_one_device(socket: Socket) -> None:
    pedal = socket.plug_in()

    async def story() -> None:
        with mastering(WITH_PEDAL, WITH_CLUTCH) as (master, session):
            pedal.press(PEDAL)
            pedal.press(CLUTCH)
            master._send(POSTURE)
            pedal.release(CLUTCH)
            await session.told(2)
            pedal.press(CLUTCH)
            master._send(POSTURE)
            assert session.grips() == [(True, False), (True, True), (True, False)]

    asyncio.run(story())


def test_a_third_key_of_the_same_pedal_asks_for_the_zero_pose(
    socket: Socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    pedal = socket.plug_in()
    key = 'operator.zero_pose_again.key={device="/dev/input/by-id/pedal",key="KEY_C"}'
    asked: list[str] = []

    async def story() -> None:
        with mastering(WITH_PEDAL, key, "estimation.zero_pose_s=1.0") as (master, session):
            monkeypatch.setattr(master._pipeline.zero_pose, "ask", lambda by, _: asked.append(by))
            pedal.press()
            pedal.press(CLUTCH)  # taken by the look before a command, not by the loop
            master._send(POSTURE)
            assert asked == ["KEY_C"]
            assert session.grips() == [(True, False)]
            pedal.release(CLUTCH)
            master._send(POSTURE)
            pedal.press(CLUTCH)
            while len(asked) == 1:  # noqa: ASYNC110 (nothing else tells it)
                await asyncio.sleep(0)

    asyncio.run(story())


def test_a_button_on_can_is_told_and_lost_at_once() -> None:
    node = Buttons(SHIPPED_DBC)

    async def story() -> None:
        with mastering(WITH_BUTTON) as (master, session):

            def send() -> None:
                frame = node.frame()
                master._on_frame("suit", frame.id, frame.data, master._switches._clock())

            send()
            node.pressed.add(DEADMAN)
            send()
            master._send(POSTURE)
            node.pressed.clear()
            send()
            assert [held for held, _ in session.grips()] == [True, False]
            node.pressed.add(DEADMAN)
            send()
            master._send(POSTURE)
            master._on_bus("suit", False)
            assert [held for held, _ in session.grips()] == [True, False, True, False]
            assert not master._pipeline.poll.bus_health["suit"].unknown_id

    asyncio.run(story())


@pytest.mark.parametrize("overrides", [(), (WITH_PEDAL,)])
def test_what_is_always_held_is_written_out(socket: Socket, overrides: tuple[str, ...]) -> None:
    socket.plug_in()

    async def story() -> None:
        with mastering(*overrides) as (master, session):
            master._send(POSTURE)
            assert [held for held, _ in session.grips()] == [not overrides]

    asyncio.run(story())
