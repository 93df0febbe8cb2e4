"""Two ends of a conversation on a virtual clock: who is heard, who is muted, and that nothing is kept."""

from __future__ import annotations

import numpy as np
import pytest

from common.clock import NS_PER_MS, NS_PER_S
from deploy.ops.voice.end import HEARD_NS, VoiceEnd
from deploy.ops.voice.jitter import FRAME_NS
from deploy.ops.voice.opus import FRAME, Samples, silence


class Plain:
    """A codec that keeps one number."""

    def encode(self, samples: Samples) -> bytes:
        return int(samples[0]).to_bytes(2, "little", signed=True)

    def decode(self, body: bytes) -> Samples:
        return tone(int.from_bytes(body, "little", signed=True))

    def conceal(self) -> Samples:
        return tone(-1)


def tone(value: int) -> Samples:
    return np.full(FRAME, value, np.int16)


def end(operator: str, muted: bool = False) -> VoiceEnd:
    return VoiceEnd(operator, stream=3 if operator else 4, codec=(Plain(), Plain()), muted=muted)


def talk(
    nurse: VoiceEnd, robot: VoiceEnd, seconds: float, holder: str = "anna", from_ns: int = 0
) -> list[int]:
    """What the robot's speaker gives, the number of each frame; the nurse says 1, 2, 3 …"""
    heard = []
    frames = round(seconds * NS_PER_S / FRAME_NS)
    for i in range(1, frames + 1):
        now_ns = from_ns + i * FRAME_NS
        for one in (nurse, robot):
            one.on_holder(holder, now_ns)
        sent = nurse.capture(tone(i), now_ns)
        if sent is not None:
            robot.on_payload(sent, "anna", now_ns)
        back = robot.capture(tone(i), now_ns)
        if back is not None:
            nurse.on_payload(back, "", now_ns)
        heard.append(int(robot.play(now_ns)[0]))
    return heard


def test_the_operator_with_the_lease_is_heard_in_order() -> None:
    nurse, robot = end("anna"), end("")
    heard = [one for one in talk(nurse, robot, 2.0) if one > 0]
    assert heard == list(range(1, len(heard) + 1))
    assert len(heard) > 95
    assert robot.shown(100 * FRAME_NS).other == "talks"
    assert robot.foreign == nurse.foreign == 0


@pytest.mark.parametrize("holder", ["", "ben"])
def test_without_the_lease_nobody_sends_and_nobody_is_heard(holder: str) -> None:
    nurse, robot = end("anna"), end("")
    assert set(talk(nurse, robot, 1.0, holder)) == {0}
    assert nurse.capture(tone(5), NS_PER_S) is None
    assert nurse.shown(NS_PER_S).partner == ""


def test_another_operator_is_not_heard_and_is_counted() -> None:
    robot, ben = end(""), end("ben")
    robot.on_holder("anna", 0)
    ben.on_holder("ben", 0)  # as one who lies to itself
    for i in range(1, 20):
        sent = ben.capture(tone(i), i * FRAME_NS)
        assert sent is not None
        robot.on_payload(sent, "ben", i * FRAME_NS)
        assert not robot.play(i * FRAME_NS).any()
    assert robot.foreign == 19


def test_who_does_not_hear_the_robot_any_more_sends_nothing() -> None:
    """At the boundary: a state this old says no longer who holds the lease."""
    nurse = end("anna")
    nurse.on_holder("anna", 0)
    assert nurse.capture(tone(1), HEARD_NS - 1) is not None
    assert nurse.capture(tone(1), HEARD_NS) is None


def test_a_muted_end_sends_no_sound_and_both_see_it() -> None:
    nurse, robot = end("anna", muted=True), end("")
    assert set(talk(nurse, robot, 1.0)) == {0}
    assert robot.shown(NS_PER_S).other == "muted"
    assert nurse.shown(NS_PER_S).muted
    nurse.muted = False
    assert any(talk(nurse, robot, 1.0, from_ns=NS_PER_S))
    assert robot.shown(2 * NS_PER_S).other == "talks"
    assert robot.shown(2 * NS_PER_S + HEARD_NS).other == "silent"


def test_muting_ends_what_waits_at_the_other_end() -> None:
    nurse, robot = end("anna"), end("")
    talk(nurse, robot, 1.0)
    nurse.muted = True
    assert set(talk(nurse, robot, 1.0, from_ns=NS_PER_S)[15:]) == {0}


def test_a_new_holder_does_not_hear_the_old_one_s_words() -> None:
    nurse, robot = end("anna"), end("")
    talk(nurse, robot, 1.0)
    robot.on_holder("ben", NS_PER_S + FRAME_NS)
    assert robot.jitter.waiting == 0
    assert not robot.play(NS_PER_S + 2 * FRAME_NS).any()


def test_what_is_lost_is_concealed_and_counted_garbage_is_counted() -> None:
    nurse, robot = end("anna"), end("")
    talk(nurse, robot, 1.0)
    base = NS_PER_S
    for i in range(1, 11):
        now_ns = base + i * FRAME_NS
        for one in (nurse, robot):
            one.on_holder("anna", now_ns)
        sent = nurse.capture(tone(i), now_ns)
        assert sent is not None
        if i != 5:
            robot.on_payload(sent, "anna", now_ns)
        robot.play(now_ns)
    assert robot.concealed == 1
    robot.on_payload(b"garbage", "anna", base + 11 * FRAME_NS)
    assert robot.undecodable == 1
    assert (silence() == 0).all()
    assert NS_PER_MS * 20 == FRAME_NS
