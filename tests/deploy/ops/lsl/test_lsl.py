"""What goes into LSL is received by LSL's own inlets: values, stamps, units, events."""

from __future__ import annotations

import asyncio
import time
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from common.clock import NS_PER_MS, monotonic_ns
from common.link import open_link
from common.link.config import LinkConfig
from common.skeleton import load_skeleton
from common.wire.codec import encode
from common.wire.messages import Command, CommandEcho, CommandStamps, RobotState
from common.wire.topics import STATE
from deploy.ops.lsl.outlets import LslPublisher
from deploy.ops.lsl.run import publish_lsl
from tests.deploy.ops.record.test_record import free_endpoint

pylsl = pytest.importorskip("pylsl")
NURSING = load_skeleton("nursing")
FOUND_S = 20.0
ANGLES = np.linspace(-0.5, 0.5, 25)


def state(number: int, **changes: Any) -> RobotState:
    valid = np.ones(25, np.bool_)
    valid[3] = False
    made = RobotState(
        "robot-1", number, 50 * NS_PER_MS, 45 * NS_PER_MS, "track", "follows nurse-1", "nurse-1",
        valid, ANGLES + number, ANGLES + number + 0.01,
        CommandEcho(number, *(ms * NS_PER_MS for ms in (10, 30, 31, 35))), NS_PER_MS, 200_000,
    )  # fmt: skip
    return replace(made, **changes)


def inlet(robot: str, name: str) -> Any:
    found = pylsl.resolve_byprop("source_id", f"tandem:{robot}:{robot}_{name}", timeout=FOUND_S)
    assert found, f"no stream {robot}_{name} was found"
    made = pylsl.StreamInlet(found[0])
    made.open_stream(timeout=FOUND_S)
    return made


def pulled(stream: Any) -> tuple[list[Any], float]:
    sample, at_s = stream.pull_sample(timeout=FOUND_S)
    assert sample is not None
    return sample, at_s


def test_joints_targets_latency_and_events_arrive_as_they_were_sent() -> None:
    robot = "robot-lsl-1"
    publisher = LslPublisher(robot, NURSING)
    streams = {name: inlet(robot, name) for name in ("joints", "targets", "operator", "latency", "markers")}
    for number in (1, 2):
        arrived_ns = monotonic_ns()
        before_s = pylsl.local_clock()
        publisher.state(encode(state(number)), arrived_ns)
        joints, at_s = pulled(streams["joints"])
        assert np.isnan(joints[3])
        np.testing.assert_allclose(np.delete(joints, 3), np.delete(ANGLES + number, 3), atol=1e-6)
        assert at_s == pytest.approx(before_s - 0.005, abs=0.02), "read 5 ms before it was sent"
        targets, same_s = pulled(streams["targets"])
        np.testing.assert_allclose(targets, ANGLES + number + 0.01, atol=1e-6)
        assert same_s == at_s
        late, _ = pulled(streams["latency"])
        assert late == pytest.approx([0.021, 0.0002])
    stamps = CommandStamps(1, 2, 3, 4)
    command = Command("robot-1", 7, 1, 1, stamps, True, np.ones(25, np.bool_), ANGLES, np.zeros(25))
    publisher.command(encode(command), monotonic_ns())
    np.testing.assert_allclose(pulled(streams["operator"])[0], ANGLES, atol=1e-6)
    publisher.state(encode(state(3, guard="hold", faults={"left_wrist_yaw": "hot"})), monotonic_ns())
    publisher.state(encode(state(4, guard="hold")), monotonic_ns())
    events = [pulled(streams["markers"])[0][0] for _ in range(4)]
    assert events == ["guard track", "guard hold", "fault left_wrist_yaw", "well left_wrist_yaw"]
    assert not any("nurse" in event for event in events)
    publisher.state(b"nonsense", 0)
    assert publisher.unreadable == 1


def test_channels_bear_their_names_and_units() -> None:
    robot = "robot-lsl-2"
    publisher = LslPublisher(robot, NURSING)
    info = inlet(robot, "joints").info(FOUND_S)
    assert (info.channel_count(), info.nominal_srate(), info.type()) == (25, 50.0, "MoCap")
    channel = info.desc().child("channels").child("channel")
    labels, units = [], []
    while not channel.empty():
        labels.append(channel.child_value("label"))
        units.append(channel.child_value("unit"))
        channel = channel.next_sibling()
    assert labels == list(NURSING.joint_names)
    assert set(units) == {"radians"}
    assert publisher.sent["joints"] == 0


def test_lsl_and_tandem_read_clocks_that_differ_and_stamps_are_carried_over() -> None:
    publisher = LslPublisher("robot-lsl-3", NURSING)
    here_s = publisher._lsl_s(monotonic_ns())
    assert here_s == pytest.approx(time.clock_gettime(time.CLOCK_MONOTONIC), abs=0.01)
    assert publisher._lsl_s(monotonic_ns() - 100 * NS_PER_MS) == pytest.approx(here_s - 0.1, abs=0.01)


def test_a_robot_on_the_link_comes_out_of_lsl() -> None:
    async def story() -> float:
        endpoint, stop, told = free_endpoint(), asyncio.Event(), list[str]()
        async with open_link(LinkConfig(listen=[endpoint]), "robot-1") as robot:
            put = robot.publish(STATE)
            publishing = asyncio.create_task(
                publish_lsl(LinkConfig(connect=[endpoint]), "robot-1", NURSING, stop, told.append)
            )
            joints = await asyncio.to_thread(inlet, "robot-1", "joints")
            async with asyncio.timeout(FOUND_S):
                sample = None
                while sample is None:
                    put(encode(state(7)))
                    sample, _ = joints.pull_sample(timeout=0.0)
                    await asyncio.sleep(0.01)
            stop.set()
            sent = await publishing
            assert sent["joints"] >= 1
        return float(sample[0])

    assert asyncio.run(story()) == pytest.approx(ANGLES[0] + 7)
