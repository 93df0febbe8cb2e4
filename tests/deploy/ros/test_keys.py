"""The keys are those of the published examples (docs/design.md of ros2/rmw_zenoh)."""

import struct

from deploy.ros.keys import (
    RosTopic,
    attachment,
    data_key,
    dds_bridge_key,
    dds_bridge_tokens,
    node_token,
    publisher_gid,
    publisher_token,
    ros_name,
)

STRING_HASH = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"


def chatter(name: str = "/chatter", depth: int = 7) -> RosTopic:
    return RosTopic(name, "std_msgs/msg/String", STRING_HASH, depth)


def test_data_keys_of_the_design_document() -> None:
    assert data_key(0, chatter()) == f"0/chatter/std_msgs::msg::dds_::String_/{STRING_HASH}"
    assert (
        data_key(0, chatter("/robot1/chatter"))
        == f"0/robot1/chatter/std_msgs::msg::dds_::String_/{STRING_HASH}"
    )


def test_liveliness_tokens_of_the_design_document() -> None:
    listener = "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener"
    assert node_token(2, "aac3178e146ba6f1fc6e6a4085e77f21", "listener") == listener
    talker = (
        "@ros2_lv/2/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/"
        f"std_msgs::msg::dds_::String_/{STRING_HASH}/::,7:,:,:,,"
    )
    assert publisher_token(2, "8b20917502ee955ac4476e0266340d5c", 10, "talker", chatter()) == talker


def test_the_hash_is_the_published_one() -> None:
    from deploy.ros.cdr import type_hash

    assert type_hash("std_msgs/msg/String") == STRING_HASH


def test_the_attachment_is_laid_out_as_documented() -> None:
    """8 bytes number, 8 bytes time, both little-endian; 1 byte length of the gid, always 16; 16 bytes gid."""
    gid = bytes(range(16))
    sent = attachment(5, 1_700_000_000_123_456_789, gid)
    assert len(sent) == 33
    assert sent[:8] == (5).to_bytes(8, "little")
    assert struct.unpack("<q", sent[8:16]) == (1_700_000_000_123_456_789,)
    assert sent[16] == 16
    assert sent[17:] == gid


def test_gids_differ_and_last() -> None:
    tokens = [publisher_token(0, "ab", k, "n", chatter()) for k in range(3)]
    assert len({publisher_gid(token) for token in tokens}) == 3
    assert publisher_gid(tokens[0]) == publisher_gid(tokens[0])
    assert len(publisher_gid(tokens[0])) == 16


def test_keys_of_the_dds_bridge() -> None:
    topic = chatter("/robot_1/chatter", 10)
    assert dds_bridge_key(topic) == "robot_1/chatter"
    plugin, publisher = dds_bridge_tokens("aac3178e", topic)
    assert plugin == "@/aac3178e/@ros2_lv"
    assert publisher == "@/aac3178e/@ros2_lv/MP/robot_1§chatter/std_msgs§msg§String/:1:0:0,10"


def test_names_are_such_as_ros_permits() -> None:
    assert ros_name("robot-1") == "robot_1"
    assert ros_name("7th.robot") == "r_7th_robot"
