"""The stages of a master's recording: nodes, fused, solved. They are computed again from its frames."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from common.clock import NS_PER_S
from common.quaternion import Array, conjugate, multiply, to_rotation_vector
from common.skeleton import Skeleton
from common.skeleton.kinematics import relative_orientations
from common.wire.messages import Mask
from deploy.ops.inspect.jitter.bands import Signal
from deploy.ops.inspect.jitter.sound import sound
from deploy.recorded.files import entries_of, head_of, snapshot_ns
from deploy.recorded.recompute import Replay
from deploy.recorded.recorded_config import recorded_config
from master.pipeline import MasterPipeline


class _Gathered:
    """Rows of one replay, tick by tick, from an instant on: filters before it only learn."""

    def __init__(self, from_ns: int) -> None:
        self._from_ns = from_ns
        self.tick_ns: list[int] = []
        self.gyr_rad_s: list[Array] = []
        self.answered: list[Mask] = []
        self.q: list[Array] = []
        self.fused: list[Mask] = []

    def look(self, pipeline: MasterPipeline) -> None:
        """After a tick: what its nodes said, and how the segments stand by the filters."""
        sweep = pipeline.last_sweep
        if (
            sweep is None
            or sweep.sampled_ns < self._from_ns
            or (self.tick_ns and sweep.sampled_ns <= self.tick_ns[-1])
        ):
            return
        posture = pipeline.estimator.posture()
        self.tick_ns.append(sweep.sampled_ns)
        self.gyr_rad_s.append(sweep.gyr_rad_s.copy())
        self.answered.append(~sweep.lost)
        self.q.append(posture.q_world_from_segment)
        self.fused.append(posture.valid)


def operator_stages(files: Sequence[Path], from_ns: int, until_ns: int, wall_less_ns: int) -> list[Signal]:
    """Nodes, fused and solved between two instants of the recording's monotonic clock.

    `wall_less_ns`: time of day less that clock. Raises RecordingError where nothing can be computed again.
    """
    gathered = _Gathered(from_ns)
    with recorded_config(head_of(files[0]), files[0].name) as config:
        replay = Replay(config, look=gathered.look)
        begin_ns = snapshot_ns(files, from_ns)
        pairs = [
            (pair.recorded.sampled_ns, pair.recorded.position_rad, pair.recorded.valid)
            for pair in replay.pairs(entries_of(files, begin_ns, until_ns))
        ]
        skeleton = config.skeleton
    if len(gathered.tick_ns) < 2 or len(pairs) < 2:
        return []
    time_s = _seconds(gathered.tick_ns, wall_less_ns)
    nodes = sound(
        "nodes", skeleton.segment_names, time_s, _integral(time_s, np.array(gathered.gyr_rad_s)),
        np.array(gathered.answered),
    )  # fmt: skip
    q, fused_valid = np.array(gathered.q), np.array(gathered.fused)
    jointed, parents = _jointed(skeleton)
    relative = multiply(conjugate(q[:, parents]), q[:, jointed])
    names = tuple(skeleton.segment_names[i] for i in jointed)
    fused_between = sound(
        "fused", names, time_s, _turned(relative), fused_valid[:, parents] & fused_valid[:, jointed]
    )
    fused = sound("fused", skeleton.segment_names, time_s, _turned(q), fused_valid, fused_between)
    solved_s = _seconds([at for at, _, _ in pairs], wall_less_ns)
    position, valid = np.array([p for _, p, _ in pairs]), np.array([v for _, _, v in pairs])
    moved = _turned(relative_orientations(skeleton, position)[:, jointed])
    every = np.repeat(np.all(valid, axis=1, keepdims=True), len(jointed), axis=1)
    solved_between = sound("solved", names, solved_s, moved, every)
    solved = sound("solved", skeleton.joint_names, solved_s, position, valid, solved_between)
    return [signal for signal in (nodes, fused, solved) if signal is not None]


def _seconds(times_ns: Sequence[int], wall_less_ns: int) -> Array:
    return np.array([(at + wall_less_ns) / NS_PER_S for at in times_ns])


def _integral(time_s: Array, rate: Array) -> Array:
    """(T, N, 3) rates to angles (T, N, 3) about the node's own axes."""
    steps = np.diff(time_s, prepend=time_s[0])[:, None, None]
    return np.asarray(np.cumsum(rate * steps, axis=0))


def _turned(q: Array) -> Array:
    """(T, N, 4) orientations to the angles turned so far about the segment's own axes, (T, N, 3)."""
    with np.errstate(invalid="ignore"):
        steps = to_rotation_vector(multiply(conjugate(q[:-1]), q[1:]))
    # an orientation that is not known yet turns nothing; it is not valid either
    steps = np.nan_to_num(steps)
    return np.concatenate([np.zeros_like(steps[:1]), np.cumsum(steps, axis=0)])


def _jointed(skeleton: Skeleton) -> tuple[list[int], list[int]]:
    """Segments that a joint moves against their parent, and these parents."""
    by_segment = np.abs(skeleton.angles_from_joints).reshape(len(skeleton.segments), -1)
    jointed = np.flatnonzero((skeleton.parents >= 0) & (by_segment.sum(axis=1) > 0.0))
    return jointed.tolist(), skeleton.parents[jointed].tolist()
