"""What never came is counted by the messages' own numbers, whoever lost it."""

from __future__ import annotations

from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from common.clock import NS_PER_S
from common.recording import McapRecorder
from common.wire.codec import encode
from common.wire.messages import Command
from common.wire.numbering import Number, number_of
from common.wire.topics import COMMAND, STATE
from common.wire.video import VideoFrame, encode_frame
from deploy import cli
from deploy.recorded.contents import survey
from deploy.recorded.missing import STREAMS, Missing
from deploy.sim.world.world import VirtualWorld, WorldSettings
from tests.deploy.ops.record.numbered import command, state

STATE_NS = NS_PER_S // 50


def picture(number: int) -> bytes:
    return encode_frame(VideoFrame(number, 1, 2, 8, 8, b"\xff\xd8\xff\xd9"))


def missing(payloads: list[bytes], name: str = STATE.name, each_ns: int = STATE_NS) -> Missing:
    gaps = Missing(name)
    for i, payload in enumerate(payloads):
        gaps.take(payload, i * each_ns)
    return gaps


def test_the_number_and_who_counts_it_are_read_of_each_kind() -> None:
    assert number_of(command(41, lease=9)) == Number(9, 41)
    assert number_of(state(42, instance=8)) == Number(8, 42)
    assert number_of(picture(43)) == Number(0, 43)


def test_what_bears_no_number_is_not_called_whole() -> None:
    gaps = missing([b"statistics", b"", b"\xc1", b"TVID", state(1)[:-3], b"\x92\xa5state\x03"])
    assert (gaps.count, gaps.unreadable) == (None, 6)


@given(st.binary(max_size=200))
def test_no_payload_raises(payload: bytes) -> None:
    number_of(payload)


def test_a_recorder_that_was_stuck_for_44_s_misses_2200_states() -> None:
    gaps = Missing(STATE.name)
    numbers = [*range(1, 101), *range(2301, 2401)]
    for number in numbers:
        gaps.take(state(number), number * STATE_NS)
    assert gaps.count == 2200


def test_two_that_count_for_themselves_are_not_mixed_up() -> None:
    payloads = [state(n, instance=who) for n in range(1, 50) for who in (1, 2) if (n, who) != (20, 2)]
    assert missing(payloads).count == 1


def test_a_robot_that_starts_anew_is_no_gap() -> None:
    assert missing([*(state(n, instance=1) for n in range(900, 950)), state(1, 2), state(2, 2)]).count == 0


def test_a_gap_in_which_the_lease_was_taken_anew_counts() -> None:
    gaps, step_ns = Missing(COMMAND.name), NS_PER_S * 2 // 25
    for number in (*range(1, 51), *range(113, 120)):
        gaps.take(command(number, lease=5 if number <= 50 else 6), number * step_ns)
    assert gaps.count == 62
    # another master's first command, which no time explains, goes on from nothing
    gaps.take(command(9000, lease=7), 121 * step_ns)
    assert gaps.count == 62


def test_streams_are_forgotten_and_their_gaps_are_not() -> None:
    payloads = [state(n, instance=who) for who in range(1, STREAMS + 9) for n in (1, 3)]
    assert missing(payloads).count == STREAMS + 8


def test_what_a_robot_really_says_is_numbered_without_a_gap() -> None:
    run = VirtualWorld(WorldSettings())
    run.run(2.0)
    assert len(run.states) > 50
    assert missing([encode(s) for s in run.states]).count == 0
    commands: list[Command] = run.commands
    assert missing([encode(c) for c in commands], COMMAND.name, NS_PER_S * 2 // 25).count == 0


def test_the_file_shows_what_is_missing(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with McapRecorder(path, {"robot": "robot-1"}) as recorder:
        for number in (1, 2, 3, 9, 10):
            recorder.put("tandem/robot-1/state", state(number), number * STATE_NS)
        recorder.put("tandem/robot-1/statistics", b"no number", 0)
    topics = survey(path).topics
    assert topics["tandem/robot-1/state"].missing == 5
    assert topics["tandem/robot-1/statistics"].missing is None
    shown = CliRunner().invoke(cli.app, ["inspect", str(path)])
    assert "missing" in shown.output
    assert shown.exit_code == 0
