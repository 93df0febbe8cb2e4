"""What the two hosts of a trial say to each other, and what the robot's host refuses."""

from __future__ import annotations

import asyncio
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import CodecError, TandemError
from common.wire.codec import MAX_PAYLOAD
from deploy.examples.profiles import example
from deploy.experiments.trial.remote import talk
from deploy.experiments.trial.remote.operator import robots_host
from deploy.experiments.trial.remote.serve import RobotHost, ServeOptions

START = talk.Start(transport="udp", strategy="predict", max_age_s=0.3)


@pytest.mark.parametrize(
    "request_",
    [
        START,
        talk.Look(),
        talk.Engage(operator="nurse-1"),
        talk.Record(),
        talk.EndRecording(),
        talk.Page(first=100),
        talk.Stop(),
    ],
)
def test_a_request_arrives_as_it_was_sent(request_: talk.Request) -> None:
    assert talk.read_request(talk.pack(request_)) == request_


def test_an_answer_arrives_as_it_was_sent() -> None:
    answer = talk.TalkAnswer(guard="hold", taking=True, total=7, states=[b"\x00\xff"], cpu_percent=12.5)
    assert talk.read_answer(talk.pack(answer)) == answer


@given(st.binary(max_size=200))
def test_garbage_is_refused_by_a_clear_error_alone(payload: bytes) -> None:
    for read in (talk.read_request, talk.read_answer):
        with suppress(CodecError):  # the only error it may raise
            assert read(payload) is not None


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"do": "reboot"}, "does not match any of the expected tags"),
        ({"transport": 7}, "transport"),
        ({"max_age_s": "long"}, "max_age_s"),
        ({"max_age_s": float("nan")}, "max_age_s"),
        ({"set": "guard.joints={}"}, "set"),
    ],
)
def test_a_request_that_is_none_names_what_is_wrong(change: dict[str, object], words: str) -> None:
    import msgpack

    with pytest.raises(CodecError, match=words):
        talk.read_request(msgpack.packb({**START.model_dump(), **change}))


def test_what_is_too_long_is_not_even_read() -> None:
    with pytest.raises(CodecError, match="at most"):
        talk.read_answer(bytes(MAX_PAYLOAD + 1))


def asked(tmp_path: Path, *requests: talk.Request, payload: bytes | None = None) -> talk.TalkAnswer:
    async def story() -> talk.TalkAnswer:
        host = RobotHost(ServeOptions(example("slave"), "tcp/127.0.0.1:1", max_age_s=0.5), tmp_path)
        answer = b""
        for one in requests:
            answer = host.on_request(talk.pack(one), 0)
        if payload is not None:
            answer = host.on_request(payload, 0)
        return talk.read_answer(answer)

    return asyncio.run(story())


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"transport": "carrier-pigeon"}, "expected one of tcp"),
        ({"transport": "unixsock-stream"}, "does not leave this host"),
        ({"strategy": "guess"}, "expected one of"),
        ({"max_age_s": 0.51}, "allows up to 0.5 s"),
        ({"max_age_s": 0.0}, "allows up to 0.5 s"),
    ],
)
def test_a_slave_that_may_not_be_started_is_not(
    tmp_path: Path, change: dict[str, object], words: str
) -> None:
    answer = asked(tmp_path, START.model_copy(update=change))
    assert not answer.taken
    assert words in answer.fault
    assert not answer.busy


@pytest.mark.parametrize(
    "act", [talk.Engage(operator="nurse-1"), talk.Record(), talk.EndRecording(), talk.Stop()]
)
def test_without_a_slave_there_is_nothing_to_act_on(tmp_path: Path, act: talk.Request) -> None:
    answer = asked(tmp_path, act)
    assert (answer.taken, answer.fault) == (False, "no slave is running")


def test_looking_and_paging_are_always_answered(tmp_path: Path) -> None:
    assert asked(tmp_path, talk.Look()).port == 0
    assert asked(tmp_path, talk.Page(first=5)).states == []
    answer = asked(tmp_path, payload=b"garbage")
    assert not answer.taken
    assert "not understood" in answer.fault


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (TandemError("engage was refused: still braking"), "engage was refused: still braking"),
        (OSError(24, "Too many open files"), "the robot's host failed: [Errno 24] Too many open files"),
        (AssertionError(), "the robot's host failed: AssertionError"),
    ],
)
def test_a_failed_act_is_reported_once_and_blames_nothing_later(
    tmp_path: Path, error: Exception, words: str
) -> None:
    async def refused() -> None:
        raise error

    async def story() -> list[str]:
        host = RobotHost(ServeOptions(example("slave"), "tcp/127.0.0.1:1"), tmp_path)
        host._begin(refused())
        answers = []
        for _ in range(3):
            answers.append(talk.read_answer(host.on_request(talk.pack(talk.Look()), 0)))
            await asyncio.sleep(0)
        assert [answer.busy for answer in answers] == [True, False, False]
        return [answer.fault for answer in answers]

    assert asyncio.run(story()) == ["", words, ""]


def test_a_robot_with_access_rules_serves_no_trial(tmp_path: Path) -> None:
    site = example("slave").parent / "site" / "robot.toml"
    with pytest.raises(TandemError, match=r"robot\.toml.*under \[link\.access\]"):
        RobotHost(ServeOptions(site, "tls/127.0.0.1:1"), tmp_path)


@pytest.mark.parametrize(
    ("endpoint", "host"),
    [
        ("tcp/192.168.7.2:7440", "192.168.7.2"),
        ("tls/[::1]:7440", "[::1]"),
        ("tcp/robot.local:1?x=1", "robot.local"),
    ],
)
def test_the_robot_is_where_its_host_answers(endpoint: str, host: str) -> None:
    assert robots_host(endpoint) == host
