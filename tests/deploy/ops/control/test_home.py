"""`tandem home`: a person is told what the robot says, is asked, and only then confirms it. As a process."""

from __future__ import annotations

import asyncio
import socket
import sys
from dataclasses import dataclass, field
from typing import Any

import pytest

from common.link import open_link
from common.link.config import LinkConfig
from common.skeleton import load_skeleton
from common.wire.codec import decode, encode
from common.wire.messages import Action, ControlRequest
from common.wire.topics import CONTROL, STOP
from slave.guard import State
from tests.slave.guard.conftest import KEY, ROBOT, Rig

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("default_signals")]


UNKNOWN = dict.fromkeys(load_skeleton("nursing").joint_names, float("nan"))


def endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


@dataclass
class Dialogue:
    """What a person typed, and what came of it."""

    rig: Any
    asked: list[Action] = field(default_factory=list)
    status: int | None = None
    told: str = ""

    def answer(self, payload: bytes, _: int) -> bytes:
        request = decode(payload, ControlRequest)
        self.asked.append(request.action)
        reply = encode(self.rig.pipeline.control.answer(self.rig.guard, request, self.rig.now_ns))
        self.rig.step()
        return reply


def home(typed: str, *options: str, key: str = KEY, known: dict[str, float] | None = None) -> Dialogue:
    """Of a robot whose joints have one reading only, and were last known to stand there."""
    said = Dialogue(Rig(last_known_rad=UNKNOWN | (known or {})))
    said.rig.step()

    async def story() -> None:
        at = endpoint()
        async with open_link(LinkConfig(listen=[at]), ROBOT) as link:
            link.answer(CONTROL, said.answer)
            link.answer(STOP, said.answer)
            tandem = await asyncio.create_subprocess_exec(
                sys.executable, "-m", "deploy", "home", "--connect", at, "--robot", ROBOT, "--key", key,
                *options,
                stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE,
                stderr=asyncio.subprocess.STDOUT,
            )  # fmt: skip
            try:
                async with asyncio.timeout(30):
                    out, _ = await tandem.communicate(typed.encode())
            finally:
                if tandem.returncode is None:
                    tandem.kill()
            said.status, said.told = tandem.returncode, " ".join(out.decode().split())

    asyncio.run(story())
    return said


def test_who_says_yes_is_told_first_what_the_robot_says_and_it_holds() -> None:
    said = home("y\n")
    assert said.status == 0, said.told
    seen, question = said.told.index("left_elbow_pitch reads"), said.told.index("Does the robot stand so?")
    assert seen < question < said.told.index("joint positions are confirmed")
    assert said.rig.guard.state is State.HOLD
    assert said.asked == [Action.STATUS, Action.STATUS, Action.HOME]


@pytest.mark.parametrize("typed", ["n\n", "\n", ""])
def test_who_does_not_say_yes_confirms_nothing(typed: str) -> None:
    said = home(typed)
    assert said.status not in (0, None)
    assert Action.HOME not in said.asked
    assert said.rig.guard.state is State.BOOT
    if typed:
        assert "nothing was confirmed: the robot does not move" in said.told


def test_who_has_looked_already_is_not_asked() -> None:
    said = home("", "--yes")
    assert said.status == 0, said.told
    assert "Does the robot stand so?" not in said.told
    assert said.rig.guard.state is State.HOLD


def test_a_wrong_key_is_refused_in_words() -> None:
    said = home("y\n", key="another")
    assert said.status not in (0, None)
    assert f"{ROBOT}: home was refused: wrong reset key" in said.told
    assert said.rig.guard.state is State.BOOT


def test_a_robot_that_knows_where_it_stands_says_so() -> None:
    rig = Rig()
    known = dict(zip(rig.skeleton.joint_names, rig.measured.tolist(), strict=True))
    said = home("", "--yes", known=known)
    assert said.status not in (0, None)
    assert "home was refused: the joint positions are known already" in said.told
