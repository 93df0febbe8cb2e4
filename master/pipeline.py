"""From CAN frames to joint angles and commands, without a clock, a bus or a link.

poll ▸ calibrate ▸ low-pass ▸ orientation ▸ (each deciding tick) joint angles ▸ command
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace

import numpy as np

from common.can.frame import CanFrame
from common.clock import to_s
from common.skeleton import Skeleton
from common.wire.messages import Command, CommandStamps, Mask
from master.capture.source import SuitSource, counts_of, suit_source
from master.comfort.arm_load import ArmLoadMeter
from master.comfort.scaling import MotionScaling
from master.comfort.zero_pose_again import ZeroPoseConduct
from master.config import MasterConfig
from master.deadman.grip import Grip
from master.joint_angles.beyond import BeyondReach
from master.joint_angles.sample import JointAngleSample
from master.joint_angles.solver import JointSolver
from master.joint_angles.without_node import SegmentsWithoutNode
from master.orientation.estimator import Estimator
from master.suit.double_tap import DoubleTap, TapLimits
from master.suit.doubt import Doubts, NodeDoubt, Weight, refusal, together
from master.suit.nodes import NodeConfig
from master.suit.plausibility import PlausibilityWatch
from master.suit.protocol import SuitProtocol
from master.suit.sweep import Sweep

NO_NODE = NodeConfig(id=1, bus="none")
"""Stands for the node of a segment that has none; nothing ever comes from it."""
MOST_BRIDGED = 20
"""Ticks (0.1 s). After a longer stall the motion in between is unknown."""


class MasterPipeline:
    """State of the nodes and filters between ticks."""

    def __init__(self, config: MasterConfig, protocol: SuitProtocol) -> None:
        self.skeleton: Skeleton = config.skeleton
        names, fd = self.skeleton.segment_names, {bus.name: bus.fd for bus in config.capture.buses}
        nodes: Sequence[NodeConfig] = [config.nodes.get(name, NO_NODE) for name in names]
        self.poll: SuitSource = suit_source(
            names, config.nodes, config.suit, protocol, config.capture.lost_after, fd
        )
        self.estimator = Estimator(
            config.estimation, nodes, config.capture.rate_hz, skeleton=self.skeleton, fused=self.poll.fused
        )
        facing_rad = math.radians(config.estimation.zero_pose_heading_deg)
        self._without_node = SegmentsWithoutNode(self.skeleton, config.suit.without_node, facing_rad)
        self.solver = JointSolver(self.skeleton)
        self.beyond_reach = BeyondReach(self.skeleton.segment_names)
        self.warnings: list[str] = []
        """Messages to the operator about the last joint angles."""
        again = config.operator.zero_pose_again
        self.zero_pose = ZeroPoseConduct(again, self.estimator, self.skeleton.segment_names)
        self.arm_load = ArmLoadMeter(self.skeleton)
        self.said: list[str] = []
        """What to say to the operator with the last joint angles, each line with a sound."""
        self._tapped = None if again.tap_node is None else self.skeleton.segment_names.index(again.tap_node)
        self._taps = DoubleTap(TapLimits(blow_m_s2=again.tap_m_s2))
        self._angles_ns: int | None = None
        scale, top, derived = counts_of(self.poll, protocol)
        self.plausibility = PlausibilityWatch(
            config.capture.plausibility, len(nodes), config.capture.rate_hz, scale, self.estimator.affine,
            top, derived,
        )  # fmt: skip
        self._disbelieved: Mask = np.zeros(len(nodes), np.bool_)
        self._decimation = config.capture.rate.usual
        self._rate_hz = config.capture.rate_hz
        self._window_open = False
        self.last_sweep: Sweep | None = None
        """The newest tick's readings, before the filters."""
        self._decided_tick = -1
        self._parts: tuple[Callable[[], Doubts], ...] = (self._of_suit, self._of_estimator)
        self.doubts: Doubts = {}
        """Nodes whose readings were doubted when joint angles were last computed."""

    def tick(self, tick: int, now_ns: int) -> tuple[CanFrame, JointAngleSample | None]:
        """Open a tick: the SYNC frame for `poll.sync_buses`, and joint angles if a window closed with it.

        That is the last window if it was still open; or this one, if no node is asked and all run free.
        """
        angles = self.close(now_ns) if self._window_open else None
        self._window_open = True
        sync = self.poll.open_window(tick, now_ns)
        return sync, angles if self.poll.waits else self.close(now_ns)

    def frame(self, bus: str, frame_id: int, data: bytes, now_ns: int) -> bool:
        """Take one frame; True when every node that is not lost has answered this tick."""
        return self.poll.on_frame(bus, frame_id, data, now_ns) and self._window_open

    def frames(self, bus: str, frames: list[tuple[int, bytes, int]]) -> None:
        """Take frames of a bus of which none is awaited: identifier, data, arrival in ns."""
        self.poll.on_frames(bus, frames)

    def bus_down(self, bus: str) -> None:
        """Count the nodes of a failed bus as lost: their joints are invalid until they answer again."""
        self.poll.bus_down(bus)

    @property
    def decimation(self) -> int:
        """One tick in so many yields a command."""
        return self._decimation

    def set_decimation(self, ticks: int) -> None:
        """From now on one tick in so many decides; two commands are never further apart than the larger."""
        self._decimation = ticks

    def ask_zero_pose(self, by: str, now_ns: int) -> None:
        """The operator asks for the zero pose to be taken again; `by` says how, in words."""
        self.zero_pose.ask(by, now_ns)

    def node_counts(self) -> dict[str, dict[str, int]]:
        """The counters of each node that are not zero, by segment."""
        figures = self.poll.figures()
        return {
            name: {counter: count for counter, count in asdict(health).items() if count}
            | figures.get(row, {})
            for row, (name, health) in enumerate(
                zip(self.skeleton.segment_names, self.poll.health, strict=True)
            )
        }

    def close(self, now_ns: int) -> JointAngleSample | None:
        """Take the tick's answers through the filters; the joint angles if this tick decides."""
        self._window_open = False
        sweep = self.poll.close_window(now_ns)
        sweep = self.plausibility.take(sweep, self.poll.readings, self.poll.saturated)
        clashing = self.poll.doubted
        if clashing.any():
            sweep = replace(sweep, lost=sweep.lost | clashing)
        sweeps = [*bridged(self.last_sweep, sweep), sweep]
        dt_s = _spacing_s(self.last_sweep, sweep, len(sweeps))
        for each in sweeps:
            self.estimator.update(each, dt_s, each.q_world_from_sensor)
        self.last_sweep = sweep
        self._watch_taps(sweep)
        # after a missed deciding tick the next one decides, so that no command is missing
        disbelieved, before = self.plausibility.doubted | clashing, self._disbelieved
        self._disbelieved = disbelieved
        # a doubted node is reported at once: otherwise its joint would be driven for another period
        period = sweep.tick // self._decimation, self._decided_tick // self._decimation
        if period[0] == period[1] and not (disbelieved & ~before).any():
            return None
        self._decided_tick = sweep.tick
        return self._joint_angles(sweep)

    def _watch_taps(self, sweep: Sweep) -> None:
        node = self._tapped
        if node is None or not sweep.fresh[node]:
            return
        if self._taps.take(sweep.acc_m_s2[node], sweep.gyr_rad_s[node], sweep.sampled_ns):
            self.zero_pose.ask(f"two taps on {self.skeleton.segment_names[node]}", sweep.sampled_ns)

    def _joint_angles(self, sweep: Sweep) -> JointAngleSample:
        posture = self.estimator.posture()
        self.doubts = together(*(part() for part in self._parts))
        filled, rate_rad_s, known_nodes = self._without_node.fill(
            posture.q_world_from_segment, posture.rate_rad_s, posture.valid & self._believed()
        )
        q = filled
        if not known_nodes.all():
            # the solver must not remember a node that is lost or doubted
            q = np.where(known_nodes[:, None], q, np.nan)
        before_ns, self._angles_ns = self._angles_ns, sweep.sampled_ns
        elapsed_s = math.inf if before_ns is None else to_s(sweep.sampled_ns - before_ns)
        position, velocity = self.solver.solve(q, rate_rad_s, elapsed_s)
        position, velocity = self._without_node.settle(position, velocity)
        self.warnings = self.beyond_reach.note(sweep.sampled_ns, self.solver.short_rad)
        # a joint is known only if the nodes on both its segments are
        missing = self.skeleton.joint_needs_node @ ~known_nodes
        known = np.isfinite(position) & np.isfinite(velocity) & (~missing | self._without_node.still)
        self.said = self.zero_pose.step(sweep.sampled_ns)
        self.said += self.arm_load.take(sweep.sampled_ns, filled, known_nodes)
        hold = self.zero_pose.hold
        if hold:
            known = np.zeros_like(known)
        return JointAngleSample(
            tick=sweep.tick,
            sampled_ns=sweep.sampled_ns,
            frames_in_ns=sweep.frames_in_ns,
            position_rad=np.where(known, position, 0.0),
            velocity_rad_s=np.where(known, velocity, 0.0),
            valid=known,
            doubt=hold or (refusal(self.doubts) if self.doubts else ""),
            period_ms=round(1e3 * self._decimation / self._rate_hz),
        )

    def _of_suit(self) -> Doubts:
        clashes, implausible = self.poll.doubts(), self.plausibility.doubts()
        if not (clashes or implausible):
            return {}
        return together(self._named(clashes), self._named(implausible))

    def _of_estimator(self) -> Doubts:
        return self._named(self.estimator.doubts())

    def _named(self, doubts: Mapping[int, NodeDoubt]) -> Doubts:
        names = self.skeleton.segment_names
        return {names[node]: doubt for node, doubt in doubts.items()}

    def _believed(self) -> Mask:
        """(N,) False for nodes whose doubt makes their joints invalid."""
        names = self.skeleton.segment_names
        if not self.doubts:
            return np.ones(len(names), np.bool_)
        no_doubt = NodeDoubt("", Weight.NOTED)
        return np.array([self.doubts.get(name, no_doubt).weight < Weight.INVALID for name in names])


def bridged(last: Sweep | None, now: Sweep) -> list[Sweep]:
    """Readings on a straight line for the ticks that were missed between two sweeps, oldest first.

    The filters count time in ticks: without this a missed tick would lose what the operator turned in it.
    """
    if last is None or not 1 < now.tick - last.tick <= MOST_BRIDGED + 1:
        return []
    gap = now.tick - last.tick
    return [_between(last, now, i / gap) for i in range(1, gap)]


def _spacing_s(last: Sweep | None, now: Sweep, steps: int) -> float | None:
    """Time from one of the sweeps to the next, so many `steps` from `last` to `now`; None: the nominal one.

    A SYNC that goes out late is sampled late, and an operator who turns at 400°/s has turned 0.4° in a
    millisecond. Beyond what is bridged nobody knows how far.
    """
    if last is None or now.tick - last.tick != steps:
        return None
    return to_s(now.sampled_ns - last.sampled_ns) / steps


def _between(last: Sweep, now: Sweep, share: float) -> Sweep:
    return replace(
        now,
        acc_m_s2=last.acc_m_s2 + share * (now.acc_m_s2 - last.acc_m_s2),
        gyr_rad_s=last.gyr_rad_s + share * (now.gyr_rad_s - last.gyr_rad_s),
        # not the magnetometer: between a reading and a missing one there is nothing to interpolate
        fresh=last.fresh & now.fresh,
    )


class CommandWriter:
    """Writes joint angles into the numbered commands of one lease."""

    def __init__(self, robot: str, scaling: MotionScaling | None = None) -> None:
        self._robot = robot
        self._scaling = scaling
        self._sequence = 0
        self.sent = 0

    def write(
        self,
        angles: JointAngleSample,
        lease: int,
        grip: Grip,
        angles_ns: int,
        put_ns: int,
        seen: tuple[int, int] = (0, 0),
    ) -> Command:
        """The command to put now. The sequence never restarts within a process, so no lease sees it fall.

        `seen`: number and arrival of the newest video frame that the operator had when he moved so.
        """
        self._sequence += 1
        self.sent += 1
        stamps = CommandStamps(angles.sampled_ns, angles.frames_in_ns, angles_ns, put_ns)
        posture = angles.position_rad, angles.velocity_rad_s
        position_rad, velocity_rad_s = (
            posture if self._scaling is None else self._scaling.scale(*posture, angles.valid)
        )
        return Command(
            robot=self._robot,
            lease=lease,
            sequence=self._sequence,
            tick=angles.tick,
            stamps=stamps,
            deadman_held=grip.deadman_held,
            valid=angles.valid,
            position_rad=position_rad,
            velocity_rad_s=velocity_rad_s,
            seen_frame=seen[0],
            seen_ns=seen[1],
            doubt=angles.doubt,
            clutch_out=grip.clutch_out,
            period_ms=angles.period_ms,
        )
