"""`tandem voice` over real links, without a sound card: sessions of the slave and both persons."""

from __future__ import annotations

import asyncio
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from common.link import open_link
from common.link.config import LinkConfig
from common.link.voice_config import VoiceConfig
from common.skeleton import load_skeleton
from common.wire.codec import encode
from common.wire.messages import RobotState
from common.wire.topics import STATE
from deploy import cli
from deploy.client.destination import Destination
from deploy.ops.voice.command import Conversation, TalkingPlace
from deploy.ops.voice.opus import FRAME, RATE_HZ
from tests.common.link.test_link import free_endpoint, run

ROBOT = "robot-1"
CONFIG = VoiceConfig(enabled=True, starts="open", echo_cancelling=False)
TONE = (6000 * np.sin(2 * np.pi * 300 * np.arange(FRAME) / RATE_HZ)).astype(np.int16)


def place(link: LinkConfig, operator: str) -> TalkingPlace:
    where = Destination(link, (ROBOT,), operator, operator)
    return TalkingPlace(Path("file.toml"), CONFIG, where, operator, load_skeleton("nursing"))


def state(operator: str) -> bytes:
    zeros, valid = np.zeros(25), np.ones(25, np.bool_)
    return encode(RobotState(ROBOT, 1, 1, 1, "track", "", operator, valid, zeros, zeros, None, 0, 1))


@pytest.mark.live
def test_both_hear_each_other_while_the_lease_is_held() -> None:
    pytest.importorskip("av", reason="the extra `voice` is not installed")
    slave_end, voice_end = free_endpoint(), free_endpoint()

    async def talk() -> None:
        robot_link = LinkConfig(connect=[slave_end], listen=[voice_end])
        nurse_link = LinkConfig(connect=[slave_end, voice_end])
        async with (
            open_link(LinkConfig(listen=[slave_end]), ROBOT) as slave,
            open_link(robot_link, ROBOT) as at_robot,
            open_link(nurse_link, ROBOT) as at_nurse,
        ):
            await at_robot.connected()
            await at_nurse.connected()
            put = slave.publish(STATE)
            robot, nurse = (
                Conversation(place(robot_link, ""), at_robot),
                Conversation(place(nurse_link, "anna"), at_nurse),
            )
            heard = {"robot": 0, "nurse": 0}
            async with asyncio.timeout(25):
                while min(heard.values()) < 20:
                    put(state("anna"))
                    for name, one in (("robot", robot), ("nurse", nurse)):
                        heard[name] += int(np.abs(one.turn(TONE)).max() > 1000)
                    await asyncio.sleep(0.02)
            assert "you are heard (Enter changes it); the other end talks" in nurse.words()
            assert "you are heard" in robot.words()

    run(talk)


def test_it_is_off_by_default_and_says_what_to_set(tmp_path: Path) -> None:
    example = Path(cli.__file__).parent / "examples" / "slave.toml"
    result = CliRunner().invoke(cli.app, ["voice", "--slave", str(example)])
    assert result.exit_code != 0
    assert "[voice] enabled = true" in str(result.exception)


def test_one_side_must_be_named() -> None:
    result = CliRunner().invoke(cli.app, ["voice"])
    assert "--master or by --slave" in str(result.exception)


class GoneTerminal:
    """Says what a terminal does whose other end was closed."""

    def __init__(self, fails: bool) -> None:
        self._lines = ["\n"]
        self._fails = fails

    def readline(self) -> str:
        """One line that was pressed before; then nothing."""
        line = self._lines.pop() if self._lines else ""
        if not line and self._fails:
            raise OSError(5, "Input/output error")
        return line


@pytest.mark.parametrize("fails", [False, True])
def test_a_terminal_that_has_gone_mutes_and_never_opens_the_microphone(
    monkeypatch: pytest.MonkeyPatch, fails: bool
) -> None:
    """It can be read at once, again and again: each time would be taken for Enter."""
    pytest.importorskip("av", reason="the extra `voice` is not installed")

    async def story() -> None:
        async with open_link(LinkConfig(listen=[free_endpoint()]), ROBOT) as link:
            one = Conversation(place(LinkConfig(), ""), link)
            one.end.muted = True
            monkeypatch.setattr("sys.stdin", GoneTerminal(fails))
            pressed = [(one.on_line(), one.end.muted) for _ in range(4)]
            assert pressed == [(True, False), *[(False, True)] * 3]

    run(story)
