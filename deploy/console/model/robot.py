"""One robot as the page shows it: takes what is heard of it, gives the page's messages. Pure."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import StrEnum

import numpy as np

from common.clock import NS_PER_MS, NS_PER_S, to_ns, to_s
from common.clock_sync import Offset
from common.latency.one_way import master_offset
from common.metrics.master import MasterMetrics
from common.metrics.slave import SlaveMetrics
from common.skeleton import Skeleton
from common.wire.lease import lease_id
from common.wire.messages import Command, RobotState
from common.wire.stop import STOPPED
from common.wire.video import VideoFrame
from deploy.console.model.events import EventList
from deploy.console.model.figures import RobotFigures
from deploy.console.model.lateness import LatenessLog
from deploy.console.model.nodes import NodeWatch
from deploy.console.model.pictures import CameraFeeds
from deploy.console.model.standstill import Standstill
from deploy.console.model.stopped import StopShown
from deploy.console.model.values import ms, rounded
from deploy.measure.ahead import RobotAhead

SILENT_S = 0.5
"""Without a state for so long this console does not know what the robot does."""
COMMAND_SILENT_S = 1.0
LATENESS_SILENT_NS = 2 * NS_PER_S
FORETOLD_FROM_NS = 20 * NS_PER_MS
"""One way. On a quicker line the state is hardly older than the page's own pictures of it, and foretelling it
is a third of the console's work."""
CAMERA = "head"
TAP, LINK = "tap", "link"
"""Whence a state came: from the master on this host, or from the robot itself."""
_SITUATIONS = {
    "boot": "starting", "hold": "holds", "align": "aligns", "track": "follows", "clutch": "repositions",
    STOPPED: "stopped",
}  # fmt: skip


class Side(StrEnum):
    """Where a console runs."""

    OPERATOR = "operator"
    """On the master's host."""
    ROBOT = "robot"
    """On the slave's host."""
    ELSEWHERE = "elsewhere"


@dataclass(frozen=True, slots=True)
class Whose:
    """For whom the console stands."""

    operator: str
    """The operator's name; empty: nobody's."""
    side: Side
    """Whose host the console runs on, and so whose clock it reads."""


class RobotModel:
    """What was heard of one robot. Times are ns of this host's monotonic clock."""

    def __init__(self, robot: str, skeleton: Skeleton, whose: Whose) -> None:
        self.robot = robot
        self.joints = len(skeleton.joints)
        self.whose = whose
        self.events = EventList()
        self.lateness = LatenessLog()
        self.pictures = CameraFeeds()
        self.ahead = RobotAhead(skeleton)
        self.figures = RobotFigures(NodeWatch(skeleton.segment_names), self.events)
        self.stop: StopShown | None = None
        self._still = Standstill()
        self._state: RobotState | None = None
        self._state_ns = 0
        self._source = ""
        self._command: Command | None = None
        self._command_ns = 0
        self._said: tuple[str, str] = "", ""
        self._was_silent = True
        self._creeps = False

    def on_state(self, state: RobotState, arrived_ns: int, source: str) -> None:
        """A state came, from the tap or from the link."""
        self._state, self._state_ns, self._source = state, arrived_ns, source
        read_anew = self._still.add(state.encoder_ns, state.position_rad, state.encoder_valid)
        masters_clock = self.whose.side is Side.OPERATOR and source == TAP and self._commands(state)
        self.lateness.on_state(state, arrived_ns, masters_clock)
        if self._foretells:
            self.ahead.on_state(state, arrived_ns)
        self._was_silent = False
        if (state.guard, state.reason) != self._said:
            self._said = state.guard, state.reason
            what = {STOPPED: "stop", "hold": "hold"}.get(state.guard, "state")
            self.events.add(what, f"{state.guard}: {state.reason}", arrived_ns)
        self._light(state, arrived_ns, read_anew)

    def on_command(self, command: Command, sent_ns: int) -> None:
        """The master sent a command."""
        self._command, self._command_ns = command, sent_ns
        self.lateness.on_command(command)
        self.ahead.on_command(command)

    def on_picture(self, camera: str, frame: VideoFrame, arrived_ns: int) -> bool:
        """A picture came; False where it is not newer."""
        return self.pictures.add(camera, frame, arrived_ns)

    def on_master(self, metrics: MasterMetrics, now_ns: int) -> None:
        """The figures of a second of this operator's master; another operator's are not shown as them."""
        if self.whose.operator and metrics.operator not in ("", self.whose.operator):
            return
        self.figures.on_master(metrics, now_ns)

    def on_robot(self, metrics: SlaveMetrics, now_ns: int) -> None:
        """The robot's figures of a second."""
        self.figures.on_robot(metrics, now_ns)

    def asked_to_stop(self, number: int, by: str, now_ns: int, under_way: bool = False) -> StopShown:
        """Somebody asked for a stop: the page shows what comes of it.

        Until the robot leaves the stop it stays the same one. What failed begins anew, unless the robot is
        still being asked (`under_way`); so does one that was acknowledged while no state told of it.
        """
        stop = self.stop
        failed = stop is not None and bool(stop.failed) and not under_way
        if stop is None or failed or stop.unconfirmed(now_ns):
            stop = self.stop = StopShown(number, by, now_ns)
            self.events.add("stop", f"{by} asked to stop the robot", now_ns)
        return stop

    @property
    def guard(self) -> str:
        """The guard's state of the newest state; empty before the first."""
        return "" if self._state is None else self._state.guard

    def silent(self, now_ns: int) -> bool:
        """Whether nothing is known of the robot now."""
        return self._state is None or now_ns - self._state_ns > to_ns(SILENT_S)

    def master_heard(self, now_ns: int) -> bool:
        """Whether the master lives, as far as this console sees."""
        return self._command is not None and now_ns - self._command_ns <= to_ns(COMMAND_SILENT_S)

    def offset(self, now_ns: int) -> Offset | None:
        """The clock of this host minus the robot's; None where it is not known.

        A robot measures the clock of the master that holds its lease. Another operator's runs on another
        host, so that its offset says nothing of this one.
        """
        if self.whose.side is Side.ROBOT:
            return Offset(0, 0, trusted=True)
        if self._state is None or self.whose.side is Side.ELSEWHERE or self.silent(now_ns):
            return None
        if not self._commands(self._state):
            return None
        return master_offset(self._state)

    def view(self, now_ns: int) -> dict[str, object]:
        """The page's message `view`, less what is the page's own."""
        state, silent = self._state, self.silent(now_ns)
        if silent and not self._was_silent:
            self._was_silent = True
            self.events.add("link", "the robot is not heard", now_ns)
        self._look_for_creep(now_ns)
        out: dict[str, object] = {
            "robot": self.robot,
            "heard": "none" if silent else self._source,
            "situation": self._situation(silent),
            "master": self.master_heard(now_ns),
            "stop": None if self.stop is None else self.stop.shown(now_ns),
            "latency": self._latency(now_ns),
            "video": self._video(now_ns),
            "ahead": self._ahead(now_ns),
            **self._commanded(now_ns),
        }
        if state is not None:
            out |= {
                "silent_s": round(to_s(now_ns - self._state_ns), 3),
                "state_n": state.sequence,
                "guard": state.guard,
                "reason": state.reason,
                "operator": state.operator,
                "lease": self._lease(state),
                "resting": list(state.resting),
                "limited": [] if state.clamped is None else np.flatnonzero(state.clamped).tolist(),
                "encoder": rounded(state.position_rad, state.encoder_valid),
                "setpoint": rounded(state.setpoint_rad),
                "external_nm": None if state.external_nm is None else rounded(state.external_nm, digits=2),
            }
        return out

    def facts(self, now_ns: int) -> dict[str, object]:
        """The page's message `facts`, less what is the console's own."""
        state, command = self._state, self._command
        efforts = None if state is None or state.effort_nm is None else rounded(state.effort_nm, digits=2)
        base = None if state is None else state.base
        fresh = command is not None and self.master_heard(now_ns)
        creep = self.lateness.creep.look(now_ns)
        shown = self.figures.shown(now_ns)
        return {
            "robot": self.robot,
            "latency": {
                "minute": self.lateness.seconds(now_ns),
                "stages": self.figures.stages(now_ns),
                "creep": None if creep is None else creep.shown(),
            },
            "ahead": None if (score := self.ahead.score()) is None else asdict(score),
            "effort_nm": efforts,
            "faults": {} if state is None else state.faults,
            "events": self.events.shown(now_ns),
            "doubt": command.doubt if fresh and command is not None else "",
            "base": None if base is None else {"tilt_deg": round(float(base.tilt_rad) * 57.29578, 2)},
            **shown,
        }

    def _video(self, now_ns: int) -> dict[str, dict[str, object]]:
        """A camera from which nothing came is shown too, by the name that it usually has."""
        shown = self.pictures.shown(self.offset(now_ns), now_ns)
        if shown or not self.figures.has_camera:
            return shown
        return {CAMERA: {"age_ms": None, "bound_ms": None, "fps": 0.0, "stale": True}}

    @property
    def _foretells(self) -> bool:
        """Whether commands and states are heard on the master's own clock."""
        return self.whose.side is Side.OPERATOR and self._source == TAP

    def _ahead(self, now_ns: int) -> dict[str, object] | None:
        """Where the robot is by now; None where it cannot be foretold."""
        way_ns = self.ahead.way_ns
        if not self._foretells or way_ns is None or way_ns < FORETOLD_FROM_NS:
            return None
        if self.silent(now_ns) or not self.master_heard(now_ns):
            return None
        found = self.ahead.foretell(now_ns)
        if found is None:
            return None
        position, tube = rounded(found.position_rad), rounded(found.tube_rad)
        return {"position": position, "tube": tube, "ahead_ms": ms(found.ahead_ns, 1)}

    def _look_for_creep(self, now_ns: int) -> None:
        creep = self.lateness.creep.look(now_ns)
        creeps = creep is not None and creep.alarm
        if creep is not None and creeps and not self._creeps:
            self.events.add("alarm", creep.words, now_ns)
        self._creeps = creeps

    def _light(self, state: RobotState, now_ns: int, read_anew: bool) -> None:
        """The lights of the stop that is under way. `read_anew`: the state has a new reading of encoders."""
        stop = self.stop
        if stop is None or now_ns < stop.asked_ns:
            return
        if state.guard != STOPPED:
            # a state may have left before the stop came; after one that said "stopped" it means a reset
            if stop.in_state:
                self.stop = None
            return
        stop.in_state = True
        if stop.robot_ns is None:
            stop.robot_ns, stop.failed = now_ns, ""
        if not stop.text:
            stop.text = state.reason
        if stop.stands_ns is None and read_anew and self._still.stands:
            stop.stands_ns = now_ns

    def _situation(self, silent: bool) -> str:
        if self._state is None or silent:
            return "silent"
        state = self._state
        word = _SITUATIONS.get(state.guard, "holds")
        others = bool(self.whose.operator) and state.operator not in ("", self.whose.operator)
        return "other_operator" if others and word not in ("stopped", "starting") else word

    def _commands(self, state: RobotState) -> bool:
        """Whether the robot's lease is that of this host's master, by the commands that it sends."""
        lease = 0 if self._command is None else self._command.lease
        return bool(lease) and lease_id(lease) == state.lease_id

    def _lease(self, state: RobotState) -> str:
        if not state.operator:
            return "none"
        if self._command is not None and self._command.lease:
            return "ours" if lease_id(self._command.lease) == state.lease_id else "other"
        return "ours" if state.operator == self.whose.operator or not self.whose.operator else "other"

    def _commanded(self, now_ns: int) -> dict[str, object]:
        command = self._command if self.master_heard(now_ns) else None
        if command is None:
            return {"deadman": None, "clutch_out": False, "target": None}
        return {
            "deadman": command.deadman_held,
            "clutch_out": command.clutch_out,
            "target": rounded(command.position_rad, command.valid),
        }

    def _latency(self, now_ns: int) -> dict[str, object]:
        one = self.lateness.newest
        if one is None or now_ns - self.lateness.newest_ns > LATENESS_SILENT_NS:
            return {"ms": None, "bound_ms": None, "trusted": False, "one_way_ms": None, "round_trip_ms": None}
        return {
            "ms": ms(one.whole_ns),
            "bound_ms": ms(one.bound_ns),
            "trusted": one.bound_ns is not None,
            "one_way_ms": ms(one.one_way_ns),
            "round_trip_ms": ms(one.round_trip_ns),
        }
