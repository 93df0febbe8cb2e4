"""No single flipped bit holds the robot or shows; a base that falls is told, in bounded time."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
import pytest

from common.clock import NS_PER_S
from common.wire.messages import BaseAttitude
from slave.attitude.config import BaseConfig
from slave.attitude.frame import FrameAngles, FrameParser, decode, encode
from slave.attitude.port import of_frame
from slave.attitude.vote import Vote, median
from slave.guard.config import GuardConfig
from slave.guard.tilt import base_loss

BEGAN_NS = 10**12
GUARD = GuardConfig()
AHEAD = BaseConfig(source="serial", port="x")
UP = BaseConfig(source="serial", port="x", axis="up")
Course = Callable[[float], FrameAngles]
"""Seconds to a frame."""


def standing(_: float) -> FrameAngles:
    return FrameAngles(900, 1234, 0)


def turning(at_s: float) -> FrameAngles:
    """Within the limit, azimuth and tool-face through 0: 60°/s and 20°/s."""
    return FrameAngles(
        round(900 + 50 * math.sin(4.0 * at_s)),
        round(600 * at_s) % 3600,
        round(70 * math.sin(3.0 * at_s)) % 3600,
    )


class Wire:
    """What a slave makes of bytes, frame by frame."""

    def __init__(self, config: BaseConfig, rate_hz: float) -> None:
        self.parser, self.vote = FrameParser(), Vote(math.radians(config.most_deg_s))
        self.config, self.rate_hz = config, rate_hz
        self.told: BaseAttitude | None = None
        self.now_ns = BEGAN_NS
        self.sent = 0

    def send(self, data: bytes) -> str | None:
        """Why the guard holds after these bytes, asked until just before the next frame."""
        self.sent += 1
        self.now_ns = BEGAN_NS + round(self.sent / self.rate_hz * NS_PER_S)
        for angles in self.parser.feed(data):
            heard = self.vote.hear(angles, self.now_ns)
            found = None if heard is None else of_frame(heard.angles, heard.came_ns, self.config)
            self.told = found or self.told
        later_ns = self.now_ns + round(0.99 / self.rate_hz * NS_PER_S)
        return base_loss(self.told, self.now_ns, GUARD) or base_loss(self.told, later_ns, GUARD)


def flipped(frame: bytes, bit: int) -> bytes:
    out = bytearray(frame)
    out[bit // 8] ^= 1 << bit % 8
    return bytes(out)


def off_deg(a: BaseAttitude, b: BaseAttitude) -> float:
    """The largest difference of what is published."""
    pairs = [(a.inclination_rad, b.inclination_rad), (a.tilt_rad, b.tilt_rad)]
    pairs += [
        (x, y)
        for x, y in ((a.azimuth_rad, b.azimuth_rad), (a.tool_face_rad, b.tool_face_rad))
        if x is not None and y is not None
    ]
    return max(abs(math.degrees(math.remainder(x - y, 2.0 * math.pi))) for x, y in pairs)


@pytest.mark.parametrize("rate_hz", [10.0, 50.0])
@pytest.mark.parametrize("course", [standing, turning])
def test_no_single_flipped_bit_holds_the_robot_or_shows(course: Course, rate_hz: float) -> None:
    count = 16
    sent = [encode(course(i / rate_hz)) for i in range(count)]
    truth = [of_frame(course(i / rate_hz), BEGAN_NS, AHEAD) for i in range(count)]
    for bit in range(56):
        for at in range(4, 8):
            wire = Wire(AHEAD, rate_hz)
            for i, frame in enumerate(sent):
                held = wire.send(flipped(frame, bit) if i == at else frame)
                if i < 3:
                    continue
                assert held is None, (bit, at, i, held)
                assert wire.told is not None
                middle = truth[i - 1]
                assert middle is not None
                most_deg = 0.0 if course is standing else 60.0 / rate_hz
                if bit < 8 and i >= at:
                    most_deg *= 2.0  # that frame was lost
                assert off_deg(wire.told, middle) <= most_deg + 0.11, (bit, at, i)


def test_most_flipped_bits_look_sound_to_a_reader_of_single_frames() -> None:
    """Or the test above would show nothing: the frames taken, and those that alone would hold the robot."""
    frame = encode(standing(0.0))
    found = [decode(flipped(frame, bit)) for bit in range(8, 56)]
    assert sum(f is not None for f in found) >= 28
    attitudes = [of_frame(f, BEGAN_NS, AHEAD) for f in found if f is not None]
    assert sum(base_loss(a, BEGAN_NS, GUARD) is not None for a in attitudes) >= 5


@pytest.mark.parametrize("rate_hz", [5.0, 10.0, 50.0, 100.0])
@pytest.mark.parametrize("deg_s", [1.0, 30.0, 310.0, 3000.0])
@pytest.mark.parametrize("config", [AHEAD, UP])
def test_a_base_that_falls_holds_the_robot_within_two_frames(
    config: BaseConfig, deg_s: float, rate_hz: float
) -> None:
    def course(at_s: float) -> FrameAngles:
        lean = min(900.0, 10.0 * deg_s * max(0.0, at_s - 1.0))
        return FrameAngles(round(lean), None, 0) if config is UP else FrameAngles(900, 0, round(lean) % 3600)

    wire = Wire(config, rate_hz)
    beyond_s = 1.0 + GUARD.max_tilt_deg / deg_s
    for i in range(round((beyond_s + 2.0) * rate_hz)):
        at_s = i / rate_hz
        held = wire.send(encode(course(at_s)))
        if at_s < 3.0 / rate_hz:
            continue
        if at_s < beyond_s:
            assert held is None, (at_s, held)
        elif held:
            # resolution of the frame's tenths, and the frames it waited for
            slow = deg_s <= config.most_deg_s
            within_s = (2.0 / rate_hz if slow else 5.0 / rate_hz) + 0.05 / deg_s
            within_s = min(within_s, GUARD.base_timeout_s + 1.0 / rate_hz)
            assert at_s - beyond_s <= within_s + 1e-9
            return
    pytest.fail("the robot was never held")


def test_a_fall_with_every_seventh_frame_spoiled_is_held_all_the_same() -> None:
    rng = np.random.default_rng(3)
    wire, rate_hz = Wire(AHEAD, 50.0), 50.0
    held_s = None
    for i in range(120):
        lean = 10.0 * 200.0 * max(0.0, i / rate_hz - 1.0)
        frame = encode(FrameAngles(900, 0, round(min(lean, 900.0))))
        if i % 7 == 6:
            frame = flipped(frame, int(rng.integers(8, 56)))
        if wire.send(frame) is not None and i > 3:
            held_s = i / rate_hz
            break
    assert held_s is not None
    assert 1.05 <= held_s <= 1.05 + 4.0 / rate_hz


def test_frames_that_go_on_contradicting_each_other_are_silence() -> None:
    wire = Wire(AHEAD, 50.0)
    for _ in range(10):
        wire.send(encode(standing(0.0)))
    held = None
    for i in range(40):
        before = wire.told
        held = held or wire.send(encode(FrameAngles(900, 0, (400 + 1300 * i) % 3600)))
        assert wire.told is not None
        assert before is not None
        # no more than the base can turn within three frames
        assert abs(wire.told.tilt_rad - before.tilt_rad) < math.radians(AHEAD.most_deg_s * 0.04 + 0.4)
    assert held is not None


def test_nothing_is_told_before_three_frames_and_a_gap_begins_anew() -> None:
    vote = Vote(10.0)
    angles = FrameAngles(900, 0, 0)
    told = [vote.hear(angles, BEGAN_NS + i * NS_PER_S // 10) for i in range(4)]
    assert [frame is not None for frame in told] == [False, False, True, True]
    assert told[2] is not None
    assert told[2].came_ns == BEGAN_NS + NS_PER_S // 10
    assert vote.hear(angles, BEGAN_NS + 5 * NS_PER_S) is None


def test_the_median_is_angle_by_angle_and_round_the_circle() -> None:
    three = [FrameAngles(1, 3599, None), FrameAngles(900, 3, None), FrameAngles(5, 1800, 7)]
    for a, b, c in itertools.permutations(three):
        assert median(a, b, c) == FrameAngles(5, 3, None)
    assert median(FrameAngles(0, 5, 1), FrameAngles(0, None, 1), FrameAngles(0, 7, 1)).azimuth == 7


def test_360_is_0() -> None:
    assert decode(bytes.fromhex("FF090036003600")) == FrameAngles(900, 0, 0)
    assert decode(bytes.fromhex("FF090036013600")) is None
    assert decode(bytes.fromhex("FF090036003601")) is None
