"""On which keys ROS 2 nodes hear and see each other over Zenoh: rmw_zenoh's, and the DDS bridge's. Pure.

rmw_zenoh: docs/design.md of ros2/rmw_zenoh (topic and liveliness key expressions, attachment). The DDS
bridge: liveliness_mgt.rs of eclipse-zenoh/zenoh-plugin-ros2dds.
"""

from __future__ import annotations

import hashlib
import re
import struct
from dataclasses import dataclass

GID_BYTES = 16
_ATTACHMENT = struct.Struct(f"<qqB{GID_BYTES}s")
_DEFAULT_DEPTH = 10
_NODE_ID = 0
"""There is one node in the session."""


@dataclass(frozen=True, slots=True)
class RosTopic:
    """A topic that is published: reliable, volatile, the last `depth` kept, as ROS 2 does by default."""

    name: str
    """Fully qualified, such as /robot_1/joint_states."""
    kind: str
    """Such as sensor_msgs/msg/JointState."""
    type_hash: str
    """RIHS01_…"""
    depth: int = _DEFAULT_DEPTH


def ros_name(text: str) -> str:
    """A name as ROS permits it: letters, digits and underscores, no digit first."""
    name = re.sub(r"[^A-Za-z0-9_]", "_", text)
    return f"r_{name}" if name[:1].isdigit() else name


def dds_type(kind: str) -> str:
    """sensor_msgs/msg/JointState ▸ sensor_msgs::msg::dds_::JointState_."""
    package, middle, name = kind.split("/")
    return f"{package}::{middle}::dds_::{name}_"


def data_key(domain: int, topic: RosTopic) -> str:
    """Where rmw_zenoh publishes and hears a topic."""
    return f"{domain}/{topic.name.strip('/')}/{dds_type(topic.kind)}/{topic.type_hash}"


def node_token(domain: int, session: str, node: str) -> str:
    """The liveliness token that shows a node of no namespace and no enclave."""
    return f"@ros2_lv/{domain}/{session}/{_NODE_ID}/{_NODE_ID}/NN/%/%/{node}"


def publisher_token(domain: int, session: str, entity: int, node: str, topic: RosTopic) -> str:
    """The liveliness token that shows a node's publisher."""
    name = topic.name.replace("/", "%")
    # a value that is ROS's default stands empty: reliability, durability, history, then times
    quality = f"::,{topic.depth}:,:,:,,"
    of_node = f"@ros2_lv/{domain}/{session}/{_NODE_ID}/{entity}/MP/%/%/{node}"
    return f"{of_node}/{name}/{dds_type(topic.kind)}/{topic.type_hash}/{quality}"


def publisher_gid(token: str) -> bytes:
    """A number of 16 bytes that only this publisher has; rmw_zenoh takes another hash of the token."""
    return hashlib.blake2b(token.encode(), digest_size=GID_BYTES).digest()


def attachment(sequence: int, stamp_ns: int, gid: bytes) -> bytes:
    """What goes with each message: its number, when it was published (ns since 1970), by whom."""
    return _ATTACHMENT.pack(sequence, stamp_ns, GID_BYTES, gid)


def dds_bridge_key(topic: RosTopic) -> str:
    """Where zenoh-bridge-ros2dds hears a topic."""
    return topic.name.strip("/")


def dds_bridge_tokens(session: str, topic: RosTopic) -> tuple[str, str]:
    """The tokens from which the DDS bridge learns of this process and of its publisher."""
    key, kind = dds_bridge_key(topic).replace("/", "§"), topic.kind.replace("/", "§")
    # keyless; reliable (1), volatile (0), keep last (0)
    quality = f":1:0:0,{topic.depth}"
    return f"@/{session}/@ros2_lv", f"@/{session}/@ros2_lv/MP/{key}/{kind}/{quality}"
