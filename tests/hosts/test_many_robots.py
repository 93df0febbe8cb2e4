"""One operator, three robots in processes: each with its own lease, guard, zero counts and limits."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
import pytest

from common.quaternion import Array
from common.wire.messages import Action, RobotState
from deploy.harness.engage import until_tracking
from deploy.harness.host import HostWatch
from deploy.harness.rig import Rig, open_rig
from deploy.harness.start import start_all

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(600)]

ELBOW = "right_elbow_pitch"
ZERO_COUNTS = 1000
OWN_LIMIT_DEG = 20.0
OVERRIDES = {
    "master": ["estimation.zero_pose_s=1.0"],
    # three robots share this machine's cores: half the turns are enough to follow
    "slave": ["loop.rate_hz=100"],
    # calibrated otherwise, so its encoders show other counts for the same angles
    "slave-2": [f"encoders.zero_counts.{ELBOW}={ZERO_COUNTS}", f'encoders.reversed=["{ELBOW}"]'],
    # a limit of its own
    "slave-3": [f"guard.joints.{ELBOW}.upper_deg={OWN_LIMIT_DEG}"],
}


def unexplained(states: list[RobotState], host: HostWatch) -> list[str]:
    """Why the robot held each time that no host stall came just before."""
    held = [b for a, b in pairwise(states) if (a.guard, b.guard) in (("track", "hold"), ("align", "hold"))]
    return [s.reason for s in held if not host.lost_before(s.sent_ns).explains_hold]


def states(rig: Rig) -> dict[str, RobotState]:
    heard = {robot: observer.state for robot, observer in rig.observers.items()}
    return {robot: state for robot, state in heard.items() if state is not None}


def test_a_fault_on_one_robot_does_not_affect_the_others(
    on_this_host: OnThisHost,
) -> None:
    async def story(host: HostWatch) -> None:
        async with open_rig(overrides=OVERRIDES, robots=3) as rig:
            await start_all(rig)
            assert len({state.lease_id for state in states(rig).values()}) == 3

            # a subset: two of the three
            for robot in ("robot-1", "robot-2"):
                await until_tracking(rig, robot)
            await one_more_second(rig)
            assert {r: s.guard for r, s in states(rig).items()} == {
                "robot-1": "track",
                "robot-2": "track",
                "robot-3": "hold",
            }
            await until_tracking(rig, "robot-3")
            watch(rig)
            for _ in range(6):
                for robot in rig.observers:
                    await until_tracking(rig, robot)  # where the host has held one up
                await one_more_second(rig)

            # one is stopped, one dies: the third goes on, its commands are not late
            await rig.control(Action.ESTOP, robot="robot-2")
            await rig.children["slave-3"].kill()
            first = rig.observers["robot-1"]
            since = len(first.states)
            await one_more_second(rig, 2.0)
            await host.known(first.sent_ns)
            assert unexplained(first.states[since - 1 :], host) == []
            assert states(rig)["robot-2"].guard == "estop"
            await rig.until(
                lambda: "robot-3: the robot is silent" in rig.children["master"].log_text(), 5.0, "word"
            )

            # each engages anew by itself
            await rig.start("slave-3")
            await rig.until(lambda: rig.observers["robot-3"].ready, 60.0, "readiness of the new slave")
            assert rig.observers["robot-3"].guard == "hold"
            await until_tracking(rig, "robot-3")
            await host.known(first.sent_ns)
            assert unexplained(first.states[since - 1 :], host) == []
            judge(rig)

    on_this_host(story)


def watch(rig: Rig) -> None:
    for observer in rig.observers.values():
        observer.recording = True


async def one_more_second(rig: Rig, seconds: float = 1.0) -> None:
    """By the first robot's own clock."""
    observer = rig.observer
    until_ns = observer.sent_ns + round(seconds * 1e9)
    await rig.until(lambda: observer.sent_ns > until_ns, seconds + 10.0, "states of robot-1")


def judge(rig: Rig) -> None:
    """Robot 2's own zero and direction make no difference to its angles; robot 3 keeps its own limit."""
    first, second, third = (elbow_deg(rig, robot) for robot in rig.observers)
    assert third[1].max() < OWN_LIMIT_DEG + 1.0
    assert first[1].max() > OWN_LIMIT_DEG + 10.0
    # one host, one clock; each robot's own ticks are up to 5 ms apart from the other's
    gap_deg = second[1] - np.interp(second[0], *first)
    assert np.sqrt(np.mean(gap_deg**2)) < 1.0


def elbow_deg(rig: Rig, robot: str) -> tuple[Array, Array]:
    """When the robot's encoders were read while it tracked, ns, and what its elbow's showed, °."""
    joint = rig.skeleton.joint_names.index(ELBOW)
    tracked = [state for state in rig.observers[robot].states if state.guard == "track"]
    assert len(tracked) > 50, f"{robot} hardly tracked"
    return (
        np.array([state.encoder_ns for state in tracked], np.float64),
        np.degrees([state.position_rad[joint] for state in tracked]),
    )
