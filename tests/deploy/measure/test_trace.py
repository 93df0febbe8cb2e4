import numpy as np

from common.wire.messages import Command, CommandStamps, RobotState, Truth
from deploy.measure import Trace, accuracy, motion

NAMES = ("left_elbow_pitch", "neck_yaw")


def test_messages_become_series_in_the_order_they_came() -> None:
    trace = Trace(NAMES)
    for tick in range(3):
        angles = np.array([0.1 * tick, 0.0])
        trace.add(Truth(tick, tick * 5_000_000, angles, angles))
    trace.add(command(tick=2))
    trace.add(state("align", encoder_ns=7))
    trace.add(state("track", encoder_ns=8))
    assert trace.truth().tick.tolist() == [0, 1, 2]
    assert trace.truth().position_rad[:, 0].tolist() == [0.0, 0.1, 0.2]
    assert trace.solved().tick.tolist() == [2]
    assert trace.solved().valid.tolist() == [[True, False]]
    assert trace.moved().encoder_ns.tolist() == [7, 8]
    assert trace.moved().tracking.tolist() == [False, True]
    assert trace.moved().valid.dtype == np.bool_


def test_an_empty_trace_can_be_judged() -> None:
    trace = Trace(NAMES)
    assert accuracy(trace.truth(), trace.solved(), NAMES).overall is None
    assert motion(trace.truth(), trace.moved(), NAMES) is None


def command(tick: int) -> Command:
    two = np.array([0.2, 0.3])
    return Command("r", 1, 1, tick, CommandStamps(0, 0, 0, 0), True, np.array([True, False]), two, two)


def state(guard: str, encoder_ns: int) -> RobotState:
    two = np.array([0.2, 0.3])
    valid = np.array([True, True])
    return RobotState("r", 1, 0, encoder_ns, guard, "", "", valid, two, two, None, 0, 0)
