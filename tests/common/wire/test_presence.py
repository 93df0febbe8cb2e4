"""A token tells who is there, in two forms that every version reads."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.wire.codec import VERSION
from common.wire.presence import ProcessPresence, present, read_presence, several_bear

KEY = "tandem/robot-1/alive/slave/0abcdef1/3-1.2.3/host, tcp%2F10.0.0.2:7447"


def test_the_keys_are_as_they_always_were() -> None:
    place = "host, tcp/10.0.0.2:7447"
    assert ProcessPresence("robot-1", "slave", 0xABCDEF1, 3, "1.2.3", place).key == KEY
    assert ProcessPresence("robot-1", "slave").key == "tandem/robot-1/alive/slave"


def test_a_later_version_may_add_to_it() -> None:
    presence = read_presence(f"{KEY}/more")
    assert presence is not None
    assert (presence.instance, presence.schema, presence.place) == (0xABCDEF1, 3, "host, tcp/10.0.0.2:7447")


@pytest.mark.parametrize(
    "key", ["", "tandem", "other/r/alive/slave", "tandem/r/state", f"{KEY}".replace("0abc", "xyz"),
            "tandem/r/alive/slave/0abcdef1", "tandem/r/alive/slave/0abcdef1/v/p",
            # a stranger's: no link has such a robot, so whoever acted on it would fail
            "tandem/a b/alive/slave", "tandem/-/alive/slave/0abcdef1/5-1/p",
            f"tandem/{65 * 'r'}/alive/slave"],
)  # fmt: skip
def test_what_is_no_token_is_none(key: str) -> None:
    assert read_presence(key) is None


@given(st.text(max_size=300))
def test_any_host_s_name_makes_a_key(name: str) -> None:
    name = name.encode("utf-8", "replace").decode()
    key = ProcessPresence("r", "slave", 1, 3, name, name).key
    assert not set("*$#?") & set(key)
    assert "//" not in key
    assert read_presence(key) is not None


def test_it_tells_where_it_is() -> None:
    shown = present("r", "slave", 5, ["tcp/10.0.0.2:7447"])
    assert "tcp/10.0.0.2:7447" in shown.place
    assert "00000005" in shown.words


def test_two_of_a_name_are_told_by_place_in_one_order() -> None:
    assert several_bear("r", ["b", "a"]) == several_bear("r", ["a", "b"])
    assert "2 robots have the name r: a and b" in several_bear("r", ["a", "b"])


def test_another_version_is_named_with_its_place_and_the_own_is_not() -> None:
    assert present("r", "slave", 5, ["tcp/10.0.0.2:7447"]).other_version == ""
    assert ProcessPresence("r", "slave").other_version == ""  # the short form tells no version
    said = ProcessPresence("r", "master", 5, VERSION + 1, "9.9", "host, 10.0.0.3").other_version
    assert "the master at host, 10.0.0.3 (instance 00000005) runs tandem 9.9" in said
    assert f"schema {VERSION + 1}" in said
    assert f"with schema {VERSION}" in said
