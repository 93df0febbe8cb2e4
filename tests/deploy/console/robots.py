"""Messages of a robot and its master, for the console's tests."""

from __future__ import annotations

from typing import Any

import numpy as np

from common.clock import to_ns
from common.skeleton import load_skeleton
from common.wire.lease import lease_id
from common.wire.messages import Command, CommandEcho, CommandStamps, RobotState
from common.wire.video import VideoFrame
from deploy.console.model.robot import TAP, RobotModel, Side, Whose

ROBOT, OPERATOR, LEASE = "robot-1", "nurse-1", 77
SKELETON = load_skeleton("nursing")
J = len(SKELETON.joints)
OFFSET_NS, BOUND_NS = to_ns(100.0), to_ns(0.0005)
"""The master's clock minus the robot's."""
JPEG = b"\xff\xd8" + b"picture" + b"\xff\xd9"


def state(number: int = 1, at_s: float = 1.0, **changes: Any) -> RobotState:
    """What the robot says at a time of the master's clock."""
    own_ns = to_ns(at_s) - OFFSET_NS
    given: dict[str, Any] = {
        "robot": ROBOT, "sequence": number, "sent_ns": own_ns, "encoder_ns": own_ns, "guard": "track",
        "reason": "follows nurse-1", "operator": OPERATOR, "encoder_valid": np.ones(J, np.bool_),
        "position_rad": np.zeros(J), "setpoint_rad": np.zeros(J), "echo": None,
        "master_offset_ns": OFFSET_NS, "offset_bound_ns": BOUND_NS, "lease_id": lease_id(LEASE),
        "instance": 5,
    }  # fmt: skip
    return RobotState(**{**given, **changes})


def command(number: int, sampled_s: float, put_s: float, **changes: Any) -> Command:
    """What the master sends."""
    stamps = CommandStamps(to_ns(sampled_s), to_ns(sampled_s), to_ns(put_s), to_ns(put_s))
    given: dict[str, Any] = {
        "robot": ROBOT, "lease": LEASE, "sequence": number, "tick": 16 * number, "stamps": stamps,
        "deadman_held": True, "valid": np.ones(J, np.bool_), "position_rad": np.full(J, 0.25),
        "velocity_rad_s": np.zeros(J),
    }  # fmt: skip
    return Command(**{**given, **changes})


def echo(number: int, put_s: float, received_s: float, written_s: float) -> CommandEcho:
    """What the robot says of a command, all in s of the master's clock."""
    received_ns, written_ns = (to_ns(s) - OFFSET_NS for s in (received_s, written_s))
    return CommandEcho(number, to_ns(put_s), received_ns, received_ns, written_ns)


def frame(number: int, captured_s: float) -> VideoFrame:
    """A picture that was taken at a time of the master's clock."""
    own_ns = to_ns(captured_s + 200.0) - OFFSET_NS - to_ns(200.0)
    return VideoFrame(number, max(own_ns, 0), max(own_ns, 0), 320, 240, JPEG)


def model(side: Side = Side.OPERATOR, robot: str = ROBOT) -> RobotModel:
    """Of a robot of which nothing was heard yet."""
    return RobotModel(robot, SKELETON, Whose(OPERATOR, side))


def heard(at_s: float = 1.0, **changes: Any) -> RobotModel:
    """Of a robot whose state came at that time."""
    made = model()
    made.on_state(state(at_s=at_s, **changes), to_ns(at_s), TAP)
    return made
