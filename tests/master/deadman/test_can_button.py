"""A button on CAN: held only by frames that are fresh, whole and on time."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.clock import to_ns
from common.errors import ConfigError
from deploy.sim.suit.buttons import DEADMAN, Buttons
from master.deadman.can_button import CanButtonState, load_button
from master.deadman.config import CanButton
from master.suit.crc import frame_crc
from master.suit.protocol import SHIPPED_DBC

BUS = "suit"
CONFIG = CanButton(source="can", bus=BUS, signal=DEADMAN)


class Wired:
    """The simulated node, and the master's end."""

    def __init__(self) -> None:
        self.node = Buttons(SHIPPED_DBC)
        self.button = load_button(CONFIG, SHIPPED_DBC, {}, "operator.deadman")
        self.node.pressed.add(DEADMAN)

    def send(self, now_ns: int, bus: str = BUS) -> bool:
        frame = self.node.frame()
        return self.button.frame(bus, frame.id, frame.data, now_ns)


@pytest.fixture
def wired() -> Wired:
    return Wired()


def test_it_is_unknown_until_heard_and_follows_its_frames(wired: Wired) -> None:
    assert wired.button.at(0) is None
    assert "not been heard" in wired.button.words
    assert wired.send(0)
    assert (wired.button.at(0), wired.button.words) == (True, "")
    wired.node.pressed.clear()
    wired.send(0)
    assert (wired.button.at(0), wired.button.releases) == (False, 1)


def test_it_is_released_by_silence_from_the_last_arrival_on(wired: Wired) -> None:
    wired.send(0)
    assert wired.button.at(to_ns(0.1)) is True
    assert wired.button.at(to_ns(0.1) + 1) is None
    assert "no good frame BUTTONS for 0.1 s on suit" in wired.button.words
    wired.send(to_ns(0.2))
    assert (wired.button.at(to_ns(0.2)), wired.button.releases) == (True, 1)


def test_a_gap_counts_though_nobody_looked_meanwhile(wired: Wired) -> None:
    wired.send(0)
    wired.send(to_ns(0.2))
    assert (wired.button.at(to_ns(0.2)), wired.button.releases) == (True, 1)


def test_a_failed_bus_releases_it_at_once_and_another_bus_does_not(wired: Wired) -> None:
    wired.send(0)
    wired.button.bus_down("other")
    assert wired.button.at(0) is True
    wired.button.bus_down(BUS)
    assert wired.button.at(0) is None


def test_frames_of_others_are_left_to_them(wired: Wired) -> None:
    assert not wired.send(0, bus="other")
    assert not wired.button.frame(BUS, 0x105, b"\1\1\1", 0)
    assert wired.button.at(0) is None


def test_a_frame_that_is_repeated_does_not_hold_it(wired: Wired) -> None:
    frame = wired.node.frame()
    for at_s in (0.0, 0.05, 0.1, 0.15):
        assert wired.button.frame(BUS, frame.id, frame.data, to_ns(at_s))
    assert wired.button.at(to_ns(0.15)) is None
    assert wired.button.refused == 3


@pytest.mark.parametrize(
    "change",
    [lambda data: data[:2], lambda data: data + b"\0", lambda data: b"", lambda data: data[:2] + b"\0"],
    ids=["short", "long", "empty", "crc"],
)
def test_a_wrong_frame_changes_nothing(wired: Wired, change: object) -> None:
    assert callable(change)
    wired.send(0)
    frame = wired.node.frame()
    assert wired.button.frame(BUS, frame.id, change(frame.data), to_ns(0.09))
    assert wired.button.at(to_ns(0.1)) is True
    assert wired.button.at(to_ns(0.11)) is None
    assert wired.button.refused == 1


def load(text: str, tmp_path: Path, taken: dict[tuple[str, int], str] | None = None) -> CanButtonState:
    dbc = tmp_path / "own.dbc"
    dbc.write_text(f'VERSION ""\nBU_: N\n{text}\n', "utf-8")
    return load_button(
        CanButton(source="can", bus=BUS, message="GLOVE", signal="THUMB"),
        dbc,
        taken or {},
        "operator.deadman",
    )


def test_another_makers_frame_has_neither_counter_nor_check(tmp_path: Path) -> None:
    button = load('BO_ 800 GLOVE: 2 N\n SG_ THUMB : 9|1@1+ (1,0) [0|1] "" N', tmp_path)
    for at_s in (0.0, 0.1):
        assert button.frame(BUS, 800, b"\0\2", to_ns(at_s))
    assert button.at(to_ns(0.2)) is True
    button.frame(BUS, 800, b"\0\1", to_ns(0.2))
    assert button.at(to_ns(0.2)) is False


@pytest.mark.parametrize(
    ("text", "taken", "words"),
    [
        ("BO_ 800 OTHER: 2 N\n SG_ THUMB : 9|1@1+ (1,0) [0|1] \"\" N", {}, "message = 'GLOVE'.*: OTHER"),
        ("BO_ 800 GLOVE: 2 N\n SG_ PINKY : 9|1@1+ (1,0) [0|1] \"\" N", {}, "signal = 'THUMB'.*GLOVE: PINKY"),
        ("BO_ 2147484448 GLOVE: 2 N\n SG_ THUMB : 9|1@1+ (1,0) [0|1] \"\" N", {}, "11-bit identifier"),
        (
            "BO_ 261 GLOVE: 2 N\n SG_ THUMB : 9|1@1+ (1,0) [0|1] \"\" N",
            {(BUS, 261): "NODE_SAMPLE of node 5"},
            "0x105 is NODE_SAMPLE of node 5",
        ),
        (
            "BO_ 800 GLOVE: 2 N\n SG_ THUMB : 9|1@1+ (1,0) [0|1] \"\" N\n"
            " SG_ CRC : 0|8@1+ (1,0) [0|255] \"\" N",
            {},
            "its CRC in the last byte",
        ),
    ],
)  # fmt: skip
def test_a_dbc_without_the_button_is_refused_in_words(
    tmp_path: Path, text: str, taken: dict[tuple[str, int], str], words: str
) -> None:
    with pytest.raises(ConfigError, match=words) as raised:
        load(text, tmp_path, taken)
    assert "operator.deadman." in str(raised.value)


def test_the_simulated_node_sends_what_the_dbc_describes() -> None:
    node = Buttons(SHIPPED_DBC)
    node.pressed.add("CLUTCH")
    first, second = node.frame(), node.frame()
    assert first.id == 0x90
    assert (first.data[0], second.data[0]) == (2, 2)
    assert second.data[1] == first.data[1] + 1
    assert frame_crc(0x90, second.data[:2]) == second.data[2]
