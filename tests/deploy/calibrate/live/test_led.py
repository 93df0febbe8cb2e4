"""The process behind the page of calibration: what it tells, from the first view to each node's outcome."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from deploy.calibrate.live.guide import View, ZeroPoseView
from deploy.calibrate.live.hints import HINTS
from deploy.calibrate.live.led import LedOrder, LedSession
from deploy.calibrate.live.told import outcome_told, to_name, view_told
from deploy.calibrate.live.window import NodeProgress
from deploy.console.files import FOLDERS
from deploy.sim.suit.suit import _wearer
from tests.deploy.calibrate.live.test_session import RATE_HZ, SLOW, loaded, sweeps

TRAY = {"attitudes": 1, "still_s": 0.5, "tumble_s": 60.0}


def order(folder: Path, **changes: Any) -> LedOrder:
    return LedOrder("master.toml", "/run/tap.sock", str(folder), ("mag",), **changes)


def test_an_order_comes_through_a_pipe_as_it_was() -> None:
    sent = order(Path("calibration"), overrides=("capture.rate_hz=50",), hemisphere="south")
    assert LedOrder.read(sent.line) == sent


def test_the_view_tells_each_node_and_how_far_the_zero_pose_is() -> None:
    nodes = [NodeProgress(0.5, "still", {"seconds": "1.5"}), NodeProgress(0.0, "silent")]
    view = View("zero_pose", 2, 3, "", "", nodes, ZeroPoseView(False, 0.0, 1.5, 3.0))
    told = view_told(view, ["pelvis", "head"], {"seconds": "3"})
    assert json.loads(json.dumps(told)) == told
    assert told["places"] == {"seconds": "3"}
    assert told["zero_pose"] == {"waits": False, "countdown_s": 0.0, "held_s": 1.5, "wanted_s": 3.0}
    assert told["nodes"] == [
        {"name": "pelvis", "share": 0.5, "hint": "still", "places": {"seconds": "1.5"}},
        {"name": "head", "share": 0.0, "hint": "silent", "places": {}},
    ]


def test_the_outcome_of_each_node_says_what_was_written_and_why_not() -> None:
    figures = {
        "imu": {"nodes": {"head": {}}, "refused": {"pelvis": "three attitudes"}},
        "mag": {},
        "align": {"refused": {"": "no zero pose"}},
    }
    told = outcome_told(figures)
    assert told == {
        "nodes": {"head": {"imu": ""}, "pelvis": {"imu": "three attitudes"}},
        "whole": ["align: no zero pose"],
    }


def test_files_that_the_master_does_not_read_are_named() -> None:
    nodes = {"head": {"imu": ""}, "pelvis": {"imu": "refused"}, "chest": {"imu": "no", "mag": ""}}
    files = {name: Path(f"/c/{name}.toml") for name in nodes}
    assert to_name(nodes, {}, files) == ["chest", "head"]
    assert to_name(nodes, {"head": files["head"], "chest": Path("/old/chest.toml")}, files) == ["chest"]


@pytest.mark.parametrize("hint", HINTS)
def test_the_page_says_in_english_what_the_command_line_says(hint: str) -> None:
    words = json.loads((FOLDERS["page"] / "en.json").read_text("utf-8"))
    assert words[f"calibrate.hint.{hint}"] == HINTS[hint]


@pytest.mark.long
def test_the_magnetometers_are_led_computed_and_told(tmp_path: Path) -> None:
    told: list[Mapping[str, Any]] = []
    config = loaded("master", *SLOW)
    suit = loaded("suit").model_copy(update={"motion": "tray", "grade": "raw", "seed": 7})
    suit = suit.model_copy(update={"tray": suit.tray.model_copy(update=TRAY)})
    wearer = _wearer(suit, config.skeleton)
    session = LedSession(order(tmp_path, tumble_s=5.0), config, told.append)
    session.begin()
    for tick in range(90 * RATE_HZ):
        session.suit._on_sweep(sweeps(wearer, tick))
        if tick % 20 == 0 and session.show():
            break
    session.end()
    session.compute()
    assert told[0]["view"]["step"] == "tumble"
    assert {node["hint"] for node in told[0]["view"]["nodes"]} == {"sees"}
    assert told[-2] == {"computing": True}
    outcome = told[-1]["outcome"]
    assert outcome["nodes"] == {name: {"mag": ""} for name in config.skeleton.segment_names}
    assert outcome["to_name"] == sorted(config.skeleton.segment_names)
    assert {path.stem for path in tmp_path.glob("*.toml")} == set(config.skeleton.segment_names)
