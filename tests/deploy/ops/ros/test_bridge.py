"""The bridge between real sessions: ROS hears the robot; nothing that ROS sends reaches the robot."""

from __future__ import annotations

import ast
import asyncio
import inspect
import socket
import struct
from collections.abc import Callable, Coroutine
from typing import Any

import numpy as np
import pytest
import zenoh

import deploy.ops.ros.bridge
import deploy.ops.ros.publishers
from common.link import open_link
from common.link.access import access_control
from common.link.config import AccessConfig, LinkConfig
from common.skeleton import load_skeleton
from common.wire.codec import encode
from common.wire.messages import RobotState
from common.wire.topics import COMMAND, CONTROL, STATE, STOP, keyframe
from deploy.ops.ros.bridge import BridgeOptions, bridge
from deploy.ops.ros.publishers import KeyFormat
from tests.deploy.ros.decoded import JointState, read
from tests.robots.imported import imported

WAIT_S = 30.0


def free_endpoint() -> str:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{taken.getsockname()[1]}"


def state(sequence: int, joints: int) -> bytes:
    valid, zeros = np.ones(joints, np.bool_), np.zeros(joints)
    return encode(
        RobotState(
            "robot-1", sequence, sequence, sequence, "hold", "", "", valid, zeros + 0.25, zeros, None, 0, 1
        )
    )


def router(endpoint: str) -> zenoh.Session:
    settings = {
        "mode": "router",
        "listen/endpoints": f'["{endpoint}"]',
        "scouting/multicast/enabled": "false",
    }
    config = zenoh.Config()
    for key, value in settings.items():
        config.insert_json5(key, value if value[0] in "[ft" else f'"{value}"')
    return zenoh.open(config)


async def until(
    done: Callable[[], bool], publish: Callable[[bytes], None] | None = None, joints: int = 25
) -> None:
    """Look fifty times a second, and publish a state of so many joints each time."""
    for sequence in range(1, round(50 * WAIT_S)):
        if done():
            return
        if publish is not None:
            publish(state(sequence, joints))
        await asyncio.sleep(0.02)
    raise AssertionError("it never came about")


def run(story: Callable[[], Coroutine[Any, Any, None]]) -> None:
    async def bounded() -> None:
        await asyncio.wait_for(story(), 2.0 * WAIT_S)

    asyncio.run(bounded())


@pytest.mark.parametrize("own", [None, "arm_pair.xml"])
def test_ros_hears_the_robot_and_cannot_speak_to_it(own: str | None) -> None:
    skeleton = load_skeleton("nursing" if own is None else str(imported(own)))
    joints_of_robot = len(skeleton.joints)
    to_robot, to_ros = free_endpoint(), free_endpoint()
    ros = router(to_ros)
    heard: list[tuple[str, bytes, bytes]] = []
    ros.declare_subscriber(
        "0/**",
        lambda s: heard.append(
            (str(s.key_expr), s.payload.to_bytes(), s.attachment.to_bytes() if s.attachment else b"")
        ),
    )

    async def story() -> None:
        commands: list[bytes] = []
        asked: list[bytes] = []
        stop = asyncio.Event()
        options = BridgeOptions(
            LinkConfig(connect=[to_robot]), "robot-1", skeleton, LinkConfig(connect=[to_ros], mode="client")
        )
        async with open_link(LinkConfig(listen=[to_robot]), "robot-1") as robot:
            robot.subscribe(COMMAND, lambda payload, _: commands.append(payload))
            robot.answer(CONTROL, lambda payload, _: asked.append(payload) or b"")  # type: ignore[func-returns-value]
            publish = robot.publish(STATE)
            told = asyncio.create_task(bridge(options, stop, lambda _: None))
            await until(lambda: any("joint_targets" in key for key, _, _ in heard), publish, joints_of_robot)
            tokens = [str(r.ok.key_expr) for r in ros.liveliness().get("@ros2_lv/**") if r.ok]
            for key in (COMMAND.of("nurse-1"), CONTROL.of("nurse-1"), STOP, STATE):
                ros.put(key.key_for("robot-1"), b"move")
                assert not [r for r in ros.get(key.key_for("robot-1"), timeout=0.3) if r.ok], (
                    "nobody answers there"
                )
            # after what was put, another state has passed: what could pass would have
            before = len(heard)
            await until(lambda: len(heard) >= before + 3, publish, joints_of_robot)
            stop.set()
            sent = await told
            assert commands == []
            assert asked == []
            assert sent["/robot_1/joint_states"] >= 2
            check(tokens)

    def check(tokens: list[str]) -> None:
        joints = [one for one in heard if "joint_states" in one[0]]
        key, payload, attached = joints[0]
        head, _, type_hash = key.rpartition("/")
        assert head == "0/robot_1/joint_states/sensor_msgs::msg::dds_::JointState_"
        message = read(JointState, payload)
        assert message.name == list(skeleton.joint_names)
        np.testing.assert_allclose(message.position, 0.25)
        numbers = [struct.unpack("<qqB16s", one[2]) for one in joints]
        assert [n[0] for n in numbers] == list(range(numbers[0][0], numbers[0][0] + len(numbers)))
        assert {(n[2], n[3]) for n in numbers} == {(16, numbers[0][3])}
        assert attached
        assert any(token.endswith("/0/0/NN/%/%/tandem_bridge") for token in tokens)
        named = "/MP/%/%/tandem_bridge/%robot_1%joint_states/sensor_msgs::msg::dds_::JointState_/"
        assert any(f"{named}{type_hash}/::,10:,:,:,," in token for token in tokens)

    try:
        run(story)
    finally:
        ros.close()


def test_the_bridge_has_no_way_to_send_to_a_robot() -> None:
    """No publisher, question or answer on the robot's side; no subscriber or answer on the side of ROS."""
    sources = [inspect.getsource(m) for m in (deploy.ops.ros.bridge, deploy.ops.ros.publishers)]
    used = {node.attr for s in sources for node in ast.walk(ast.parse(s)) if isinstance(node, ast.Attribute)}
    assert "subscribe" in used
    forbidden = {"publish", "ask", "ask_all", "ask_stamped", "answer", "answer_keys", "declare_subscriber"}
    forbidden |= {"declare_queryable", "declare_querier", "get"} - {"get"}
    assert used & forbidden == set()
    topics = {
        name.name
        for s in sources
        for node in ast.walk(ast.parse(s))
        if isinstance(node, ast.ImportFrom) and node.module == "common.wire.topics"
        for name in node.names
    }
    assert topics == {"STATE", "video"}


def test_an_observers_certificate_gives_it_no_right_to_command() -> None:
    """The lines of docs/ros.md: the bridge may hear; puts only everyone's stop and a wish for a picture."""
    access = AccessConfig(operators={"nurse-1": ["robot-1"]}, viewers={"ros": ["robot-1"]})
    rules: Any = access_control(access)
    mine = {
        p for policy in rules["policies"] if "observer:ros" in policy["subjects"] for p in policy["rules"]
    }
    for rule in rules["rules"]:
        if rule["id"] in mine and {"put", "query"} & set(rule["messages"]) and "ingress" in rule["flows"]:
            assert rule["key_exprs"] in ([STOP.key_for("*")], [keyframe("*").key_for("robot-1")])


def test_keys_for_the_dds_bridge() -> None:
    to_ros = free_endpoint()
    ros = router(to_ros)
    heard: list[str] = []
    ros.declare_subscriber("**", lambda s: heard.append(str(s.key_expr)))

    async def story() -> None:
        options = BridgeOptions(
            LinkConfig(listen=[free_endpoint()]), "robot-1", load_skeleton("nursing"),
            LinkConfig(connect=[to_ros], mode="client"), keys=KeyFormat.ROS2DDS,
        )  # fmt: skip
        stop = asyncio.Event()
        told = asyncio.create_task(bridge(options, stop, lambda _: None))
        await until(lambda: "diagnostics" in heard)
        tokens = [str(r.ok.key_expr) for r in ros.liveliness().get("@/*/@ros2_lv/**") if r.ok]
        assert any("/MP/diagnostics/diagnostic_msgs§msg§DiagnosticArray/" in token for token in tokens)
        stop.set()
        await told

    try:
        run(story)
    finally:
        ros.close()
