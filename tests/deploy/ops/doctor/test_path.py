"""Which sizes pass: judged from facts, and found over a real link."""

from __future__ import annotations

import asyncio
import socket

import pytest

from common.link import open_session
from common.link.config import LinkConfig
from common.wire.path_probe import answer_probe
from common.wire.topics import PATH
from deploy.ops.doctor.judge.finding import Health
from deploy.ops.doctor.judge.path import judge_path
from deploy.ops.doctor.read.path import SIZES, PathFacts, read_path

ALL = max(SIZES)


@pytest.mark.parametrize(
    ("there", "back", "health", "words"),
    [
        (ALL, ALL, Health.OK, "up to 16000 bytes pass both ways"),
        (1100, ALL, Health.WARN, "messages of more than 1100 bytes to the robot vanish"),
        (ALL, 1350, Health.WARN, "messages of more than 1350 bytes from the robot vanish"),
        (64, 1100, Health.FAIL, "commands and states do not pass safely"),
    ],
)
def test_what_does_not_pass_is_named_with_what_to_do(
    there: int, back: int, health: Health, words: str
) -> None:
    [finding] = judge_path(PathFacts("robot-1", there, back))
    assert finding.health is health
    assert words in finding.found
    assert ("quic" in finding.advice) == (health is not Health.OK)


def test_a_robot_that_answers_no_probe_is_not_judged() -> None:
    assert judge_path(PathFacts("robot-1", None, None)) == []


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port: int = probe.getsockname()[1]
        return port


def test_on_a_sound_link_every_size_passes() -> None:
    async def story() -> None:
        endpoint = f"tcp/127.0.0.1:{_free_port()}"

        async with open_session(LinkConfig(listen=[endpoint])) as session:
            session.link("robot-1").answer(PATH, lambda question, _: answer_probe(question))
            facts = await read_path(LinkConfig(connect=[endpoint]), "robot-1")
        assert facts == PathFacts("robot-1", ALL, ALL)

    asyncio.run(story())
