"""The robot that will be: where it is by now, while its newest state is as old as the line is long. Pure.

A copy of the slave's own tracker is given the operator's commands when each must have reached the robot. What
that tracker did since the newest state was measured, less the servos' lag, is added to the measured angles:

    robot now = encoders(t) + T(now − lag) − T(t − lag)

A joint that does not follow the tracker (a limit holds it, it rests, the robot stands) is foretold to stay.
The uncertainty is learnt from what came true: the 95th percentile of each joint's last errors.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from dataclasses import dataclass

import numpy as np

from common.clock import NS_PER_MS, NS_PER_S, to_s
from common.latency.one_way import master_offset, one_way_ns, round_trip_ns
from common.quaternion import Array
from common.skeleton import Skeleton
from common.wire.messages import Command, Mask, RobotState
from slave.track.config import TrackConfig, make_tracker

FOLLOWS = "track"
OFF_RAD = float(np.radians(20.0))
"""A joint whose setpoint is further from the tracker does not follow it."""
LEAST_TUBE_RAD = float(np.radians(0.1))
"""One count of a 12-bit encoder, and a little."""
FIRST_TUBE_RAD = float(np.radians(5.0))
"""Before enough has come true."""
SHARE = 0.95
_GRID_NS = 20 * NS_PER_MS
"""As states come. At half of it the console worked a seventh more and foretold no better."""
_TICK_NS = 5 * NS_PER_MS
"""A setpoint is read back at the next tick."""
_KEPT = 500
"""Errors of each joint, 10 s of states."""
_ENOUGH = 50
_LONGEST_NS = 2 * NS_PER_S
"""Of a history, and of a state's age beyond which nothing is foretold."""
_RENEW_NS = NS_PER_S


@dataclass(frozen=True, slots=True)
class Foretold:
    """The robot at one instant."""

    at_ns: int
    """Master's clock."""
    position_rad: Array
    """(J,)"""
    tube_rad: Array
    """(J,) half-width within which a joint is with 95 %."""
    known_rad: Array
    """(J,) the newest measured angles at that instant."""
    ahead_ns: int
    """How old those are."""


@dataclass(frozen=True, slots=True)
class AheadScore:
    """What was foretold against what the encoders said later, over all joints while the robot followed."""

    count: int
    """Encoder readings that were foretold."""
    ahead_ms: float
    """Mean age of the newest state, by which it was foretold ahead."""
    rms_deg: float
    held_rms_deg: float
    """The same of the newest state as it is: what a page without this shows."""
    inside_percent: float
    """Of joints that were within their tube."""


class RobotAhead:
    """One robot. All times are ns of the master's clock."""

    def __init__(self, skeleton: Skeleton, config: TrackConfig | None = None) -> None:
        """`config`: the slave's `[track]`."""
        config = config or TrackConfig()
        self._lower, self._upper = skeleton.lower_rad, skeleton.upper_rad
        self._tracker = make_tracker(config)
        self._lag_ns = round(config.servo_lag_s * NS_PER_S) + _TICK_NS
        self._way_ns: int | None = None
        self._sent: deque[Command] = deque(maxlen=64)
        self._targets = _History()
        self._state: RobotState | None = None
        self._read_ns = 0
        self._foretold: deque[Foretold] = deque(maxlen=256)
        self._readings: deque[tuple[int, RobotState]] = deque(maxlen=256)
        """Encoders that wait for what is foretold of the instant after them."""
        self._tube = _Tube(len(skeleton.joints))
        self._scored = _Scored()
        self._scored_ns = 0

    @property
    def way_ns(self) -> int | None:
        """How long commands take to the robot, by the newest state; None where that is not known."""
        return self._way_ns

    def on_command(self, command: Command) -> None:
        """A command was put on the link."""
        self._sent.append(command)

    def on_state(self, state: RobotState, arrived_ns: int) -> None:
        """A state came: it is where the robot was, and judges what was foretold."""
        offset, echo = master_offset(state), state.echo
        if not offset.trusted:
            return
        if echo is not None:
            way_ns = one_way_ns(echo.put_ns, echo.received_ns, offset)
            self._way_ns = round_trip_ns(state, echo, arrived_ns) // 2 if way_ns is None else max(0, way_ns)
        read_ns = offset.remote_ns(state.encoder_ns)
        if self._state is not None and read_ns <= self._read_ns:
            return
        self._state, self._read_ns = state, read_ns
        if state.guard != FOLLOWS:
            self._tracker.reset()
            self._targets.clear()
            self._foretold.clear()
            self._readings.clear()
            return
        self._readings.append((read_ns, state))

    def foretell(self, now_ns: int) -> Foretold | None:
        """Where the robot is by now; None where nothing is known, or it does not follow."""
        state = self._state
        self._advance(now_ns)
        if state is None or state.guard != FOLLOWS or not 0 <= now_ns - self._read_ns <= _LONGEST_NS:
            return None
        position = state.position_rad.copy()
        then, now = self._targets.at(self._read_ns - self._lag_ns), self._targets.at(now_ns - self._lag_ns)
        asked = self._targets.at(self._read_ns)
        if then is not None and now is not None and asked is not None:
            follows = np.abs(state.setpoint_rad - asked) < OFF_RAD
            position = np.clip(position + np.where(follows, now - then, 0.0), self._lower, self._upper)
        tube = self._tube.now(now_ns)
        found = Foretold(now_ns, position, tube, state.position_rad, now_ns - self._read_ns)
        self._foretold.append(found)
        while self._readings and self._readings[0][0] < now_ns:
            read_ns, read = self._readings.popleft()
            self._judge(read, read_ns)
        return found

    def score(self) -> AheadScore | None:
        """All that came true so far; None before the first."""
        return self._scored.score()

    def _advance(self, now_ns: int) -> None:
        """Give the tracker the commands that have reached the robot by then, and note what it does."""
        way_ns = self._way_ns
        if way_ns is None or self._state is None or self._state.guard != FOLLOWS:
            return
        begin_ns = self._targets.last_ns or now_ns - _GRID_NS
        for at_ns in range(max(begin_ns + _GRID_NS, now_ns - _LONGEST_NS), now_ns + 1, _GRID_NS):
            while self._sent and (came_ns := self._sent[0].stamps.put_ns + way_ns) <= at_ns:
                command = self._sent.popleft()
                still = self._state.setpoint_rad
                position = np.where(command.valid, command.position_rad, still)
                velocity = np.where(command.valid, command.velocity_rad_s, 0.0)
                came_ns = max(came_ns, at_ns - _GRID_NS)
                self._tracker.accept(command.stamps.sampled_ns, came_ns, position, velocity)
            target = self._tracker.target(at_ns)
            if target is not None:
                self._targets.add(at_ns, target.position_rad)

    def _judge(self, state: RobotState, read_ns: int) -> None:
        foretold = self._foretold
        i = bisect_right(foretold, read_ns, key=lambda each: each.at_ns)
        if not 0 < i < len(foretold):
            return
        before, after = foretold[i - 1], foretold[i]
        share = (read_ns - before.at_ns) / (after.at_ns - before.at_ns)
        position = state.position_rad
        error = position - (before.position_rad + share * (after.position_rad - before.position_rad))
        held = position - (before.known_rad + share * (after.known_rad - before.known_rad))
        valid = state.encoder_valid
        self._tube.add(np.where(valid, np.abs(error), np.nan))
        self._scored.add(error[valid], held[valid], np.abs(error[valid]) <= after.tube_rad[valid], after)


class _History:
    """Targets over time."""

    def __init__(self) -> None:
        self._at_ns: deque[int] = deque(maxlen=_LONGEST_NS // _GRID_NS)
        self._targets: deque[Array] = deque(maxlen=_LONGEST_NS // _GRID_NS)

    @property
    def last_ns(self) -> int:
        """0 where there is none."""
        return self._at_ns[-1] if self._at_ns else 0

    def add(self, at_ns: int, target: Array) -> None:
        self._at_ns.append(at_ns)
        self._targets.append(target)

    def at(self, at_ns: int) -> Array | None:
        """Between the two beside that instant; None before the first."""
        i = bisect_right(self._at_ns, at_ns)
        if not i or i == len(self._at_ns):
            return self._targets[-1] if i else None
        share = (at_ns - self._at_ns[i - 1]) / (self._at_ns[i] - self._at_ns[i - 1])
        target: Array = self._targets[i - 1] + share * (self._targets[i] - self._targets[i - 1])
        return target

    def clear(self) -> None:
        self._at_ns.clear()
        self._targets.clear()


class _Tube:
    """The percentile of each joint's last errors."""

    def __init__(self, joints: int) -> None:
        self._errors: deque[Array] = deque(maxlen=_KEPT)
        self._width: Array = np.full(joints, FIRST_TUBE_RAD)
        self._renewed_ns = -_RENEW_NS

    def add(self, error_rad: Array) -> None:
        self._errors.append(error_rad)

    def now(self, now_ns: int) -> Array:
        if len(self._errors) >= _ENOUGH and now_ns - self._renewed_ns >= _RENEW_NS:
            self._renewed_ns = now_ns
            errors = np.array(self._errors)
            known = np.isfinite(errors).any(axis=0)
            width = np.quantile(np.nan_to_num(errors), SHARE, axis=0)
            self._width = np.where(known, np.maximum(width, LEAST_TUBE_RAD), FIRST_TUBE_RAD)
        return self._width


class _Scored:
    def __init__(self) -> None:
        self._count = self._values = self._inside = 0
        self._ahead_s = self._squares = self._held_squares = 0.0

    def add(self, error: Array, held: Array, inside: Mask, foretold: Foretold) -> None:
        self._count += 1
        self._values += len(error)
        self._inside += int(np.count_nonzero(inside))
        self._squares += float(error @ error)
        self._held_squares += float(held @ held)
        self._ahead_s += to_s(foretold.ahead_ns)

    def score(self) -> AheadScore | None:
        if not self._values:
            return None
        return AheadScore(
            count=self._count,
            ahead_ms=1000.0 * self._ahead_s / self._count,
            rms_deg=float(np.degrees(np.sqrt(self._squares / self._values))),
            held_rms_deg=float(np.degrees(np.sqrt(self._held_squares / self._values))),
            inside_percent=100.0 * self._inside / self._values,
        )
