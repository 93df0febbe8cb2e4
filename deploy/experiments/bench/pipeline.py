"""What one tick of the master costs, step by step, on frames made beforehand: nothing here waits."""

from __future__ import annotations

import itertools
import time
from collections.abc import Sequence

import numpy as np

from common.can.frame import CanFrame
from common.process.heap import freeze_heap
from common.skeleton import load_skeleton
from common.skeleton.kinematics import orientations
from common.wire.codec import decode, encode
from common.wire.messages import Command, CommandStamps
from deploy.measure.timing import Figures, spread_us, time_calls
from master.joint_angles.solver import JointSolver
from master.orientation.config import EstimationConfig
from master.orientation.estimator import Estimator
from master.suit.nodes import NodeConfig
from master.suit.plausibility import BLOCK, PlausibilityWatch
from master.suit.plausibility_config import PlausibilityConfig
from master.suit.poll import Poll
from master.suit.protocol import SuitProtocol
from master.suit.sweep import Sweep

BUS = "suit"
RATE_HZ = 200
LOST_AFTER = 20
PREPARED_TICKS = 32


_SPACING_S = 1.01 / RATE_HZ
"""Between two ticks: on a real host never quite the nominal period, which would cost a little less."""


def nodes(count: int) -> list[NodeConfig]:
    """That many nodes on one bus."""
    return [NodeConfig(id=number, bus=BUS) for number in range(1, count + 1)]


def pipeline(seconds: float) -> dict[str, object]:
    """µs of every step, one after another in this process."""
    return {
        "nodes_36": ticks(0.3 * seconds, 36),
        "nodes_8": ticks(0.1 * seconds, 8),
        "nodes_36_mahony": ticks(0.15 * seconds, 36, filter_name="mahony"),
        "nodes_36_ekf": ticks(0.15 * seconds, 36, filter_name="ekf"),
        "plausibility_us": plausibility(0.05 * seconds, 36),
        "joint_angles_us": joint_angles(0.1 * seconds),
        "joint_angles_beyond_us": joint_angles(0.05 * seconds, beyond=True),
        "codec_us": codec(0.15 * seconds),
    }


def ticks(seconds: float, count: int, fd: bool = True, filter_name: str = "vqf") -> dict[str, object]:
    """µs a tick: `decode_us` from frames to SI units, `orientation_us` to calibrate, low-pass and filter."""
    protocol = SuitProtocol.load()
    poll = Poll(nodes(count), protocol, LOST_AFTER, {BUS: fd})
    estimator = Estimator(EstimationConfig(filter=filter_name), nodes(count), RATE_HZ)
    prepared = [answers(protocol, count, tick, fd) for tick in range(PREPARED_TICKS)]
    for tick, frames in enumerate(prepared):  # the first ticks find the nodes and start the filters
        _sweep(poll, estimator, tick, frames)
    freeze_heap()
    decode_ns: list[int] = []
    orientation_ns: list[int] = []
    end_ns = time.perf_counter_ns() + round(seconds * 1e9)
    while time.perf_counter_ns() < end_ns:
        for tick, frames in enumerate(prepared):
            decoded, oriented = _sweep(poll, estimator, tick, frames)
            decode_ns.append(decoded)
            orientation_ns.append(oriented)
    return {"decode_us": spread_us(decode_ns), "orientation_us": spread_us(orientation_ns)}


def plausibility(seconds: float, count: int) -> Figures:
    """µs a tick to judge whether that many nodes lie, at rest; over the two ways a judgement takes turns."""
    scale = SuitProtocol.load().fd.scale
    watch = PlausibilityWatch(PlausibilityConfig(), count, RATE_HZ, scale)
    rest = np.array([0.0, 0.0, 9.81, 0.0, 0.0, 0.0, 0.0, 20.0, -43.0])
    noise = np.repeat([0.04, 0.02, 0.3], 3) * np.random.default_rng(0).normal(size=(64, count, 9))
    readings = np.rint((rest + noise) / scale) * scale
    yes, no = np.ones(count, np.bool_), np.zeros(count, np.bool_)
    sweeps = itertools.cycle(
        Sweep(tick, round((tick + 1) * 1e9 / RATE_HZ), 0, r[:, :3], r[:, 3:6], r[:, 6:], yes, no)
        for tick, r in zip(range(4096), itertools.cycle(readings), strict=False)
    )
    rows = itertools.cycle(readings)
    return time_calls(lambda: watch.take(next(sweeps), next(rows), no), seconds, batch=2 * BLOCK)


def answers(protocol: SuitProtocol, count: int, tick: int, fd: bool) -> list[CanFrame]:
    """What that many nodes, moving gently, answer at a tick."""
    rng = np.random.default_rng(tick)
    frames: list[CanFrame] = []
    for number in range(1, count + 1):
        # gravity on z, some tens of °/s, and a field to the north and down
        si = np.array([0.0, 0.0, 9.81, 0.0, 0.0, 0.0, 0.0, 20.0, -43.0])
        si += rng.normal(0.0, [0.2] * 3 + [0.5] * 3 + [0.5] * 3)
        raw = np.clip(np.rint(si / protocol.fd.scale), -32767, 32767).astype(np.int16)
        frames += protocol.encode_sample(number, raw, tick, 0, fd)
    return frames


def joint_angles(seconds: float, beyond: bool = False) -> Figures:
    """µs to compute all joint angles and their velocities once.

    The operator goes to and fro about the middle of the robot's range; or `beyond`, where trunk, head, both
    shoulders and both forearms cannot be followed, and must be projected each time.
    """
    skeleton = load_skeleton("nursing")
    solver = JointSolver(skeleton)
    sway = 0.02 * np.sin(np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False))[:, None]
    position = 0.5 * (skeleton.lower_rad + skeleton.upper_rad) + sway
    if beyond:
        position = skeleton.upper_rad + 0.35 + sway
    postures = itertools.cycle(orientations(skeleton, position))
    rate = np.random.default_rng(0).normal(size=(len(skeleton.segments), 3))
    return time_calls(lambda: solver.solve(next(postures), rate), seconds)


def codec(seconds: float) -> Figures:
    """µs to encode a command and decode it again."""
    command = example_command()
    joints = len(command.position_rad)
    return time_calls(lambda: decode(encode(command), Command, joints), seconds, batch=10)


def example_command() -> Command:
    """A command such as the master sends."""
    count = len(load_skeleton("nursing").joints)
    angles = np.linspace(-1.0, 1.0, count)
    now_ns = time.monotonic_ns()
    stamps = CommandStamps(now_ns, now_ns, now_ns, now_ns)
    return Command("robot-1", 1 << 40, 1000, 16000, stamps, True, np.ones(count, np.bool_), angles, angles)


def _sweep(poll: Poll, estimator: Estimator, tick: int, frames: Sequence[CanFrame]) -> tuple[int, int]:
    begin_ns = time.perf_counter_ns()
    poll.open_window(tick, begin_ns)
    for frame in frames:
        poll.on_frame(BUS, frame.id, frame.data, begin_ns)
    sweep = poll.close_window(begin_ns)
    decoded_ns = time.perf_counter_ns()
    estimator.update(sweep, _SPACING_S)
    return decoded_ns - begin_ns, time.perf_counter_ns() - decoded_ns
