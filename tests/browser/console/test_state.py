"""Which state the page shows, at its boundaries, without a browser."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

NODE = shutil.which("node")
MODULE = Path(__file__).parents[3] / "deploy" / "console" / "page" / "state.js"
pytestmark = pytest.mark.skipif(NODE is None, reason="no node here: apt install nodejs")
SCRIPT = """
const [module, fs] = [await import(process.argv[1]), await import("node:fs")];
const [name, given] = JSON.parse(fs.readFileSync(0, "utf8"));
console.log(JSON.stringify(module[name](...given)));
"""
VIEW = {"heard": "tap", "guard": "track", "situation": "follows", "reason": "follows nurse-1",
        "operator": "nurse-1", "lease": "ours", "master": True, "deadman": True, "stop": None}  # fmt: skip
SEEN = {"sinceFrame_s": 0.02, "sinceOpen_s": 9.0, "hello": {"may": {"act": True}}, "view": VIEW, "setup": {}}


def ask(tmp_path: Path, name: str, *given: Any) -> Any:
    # node reads a module by its ending
    module = tmp_path / "state.mjs"
    shutil.copy(MODULE, module)
    command = [str(NODE), "--input-type=module", "-e", SCRIPT, str(module)]
    asked = json.dumps([name, given])
    done = subprocess.run(command, input=asked, capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    ("changes", "wanted"),
    [
        ({}, "follows"),
        ({"sinceFrame_s": 0.5}, "follows"),
        ({"sinceFrame_s": 0.501}, "no_contact"),
        ({"sinceFrame_s": None, "sinceOpen_s": 1.9, "view": None}, "connecting"),
        ({"sinceFrame_s": None, "sinceOpen_s": 2.1, "view": None}, "no_contact"),
        ({"view": {**VIEW, "heard": "none"}}, "no_robot"),
        ({"view": {**VIEW, "situation": "silent"}}, "no_robot"),
        ({"view": {**VIEW, "situation": "starting", "guard": "boot"}}, "starting"),
        ({"view": {**VIEW, "situation": "aligns", "guard": "align"}}, "aligns"),
        ({"view": {**VIEW, "situation": "stopped", "guard": "estop"}}, "stopped"),
        ({"view": {**VIEW, "situation": "repositions", "guard": "clutch"}}, "clutch"),
        ({"hello": {"role": "nobody"}, "view": None, "sinceFrame_s": 9.0, "open": True}, "locked"),
        ({"hello": {"role": "nobody"}, "view": None, "sinceFrame_s": 9.0, "open": False}, "no_contact"),
        ({"view": {**VIEW, "situation": "other_operator", "lease": "other"}}, "other"),
        ({"view": {**VIEW, "situation": "a word of a newer console"}}, "starting"),
    ],
)
def test_one_state(tmp_path: Path, changes: dict[str, Any], wanted: str) -> None:
    assert ask(tmp_path, "situation", {**SEEN, **changes})["id"] == wanted


@pytest.mark.parametrize(
    ("changes", "setup", "doubt", "act"),
    [
        ({}, {}, "", "do.holds"),
        ({}, {}, "zero pose not taken", "do.holds.doubt"),
        ({"deadman": False}, {"deadman": "pedal"}, "", "do.holds.deadman"),
        ({"deadman": False}, {"deadman": "console"}, "", "do.holds.key"),
    ],
)
def test_what_to_do_while_it_holds(
    tmp_path: Path, changes: dict[str, Any], setup: dict[str, Any], doubt: str, act: str
) -> None:
    view = {**VIEW, "situation": "holds", "guard": "hold", **changes}
    assert ask(tmp_path, "situation", {**SEEN, "view": view, "setup": setup, "doubt": doubt})["act"] == act


@pytest.mark.parametrize(("since_s", "stale"), [(0.39, False), (0.41, True)])
def test_a_picture_older_than_half_a_second_is_stale(tmp_path: Path, since_s: float, stale: bool) -> None:
    found = ask(tmp_path, "picture", {"age_ms": 90.0, "bound_ms": 1.0}, 10.0, since_s, 0.5)
    assert found["stale"] is stale


@pytest.mark.parametrize(("since_s", "stale"), [(0.5, False), (0.51, True)])
def test_a_picture_of_unknown_age_is_not_said_to_be_new(tmp_path: Path, since_s: float, stale: bool) -> None:
    found = ask(tmp_path, "picture", {"age_ms": None, "bound_ms": None}, 10.0, since_s, 0.5)
    assert (found["known"], found["age_s"], found["stale"]) == (False, since_s, stale)


@pytest.mark.parametrize(
    ("stop", "confirmed"),
    [(None, False), ({}, False), ({"since_s": 0.2}, True), ({"since_s": 0.21}, False)],
)
def test_an_older_stop_confirms_no_later_press(
    tmp_path: Path, stop: dict[str, Any] | None, confirmed: bool
) -> None:
    assert ask(tmp_path, "confirms", stop, 0.2) is confirmed


def test_lights_of_a_stop(tmp_path: Path) -> None:
    def lights(state: str, stop: dict[str, Any] | None, asked: str | None) -> list[bool]:
        given = {**VIEW, "stop": stop}
        return [light["on"] for light in ask(tmp_path, "stopLights", state, given, asked)["lights"]]

    going = {"asked_s": 0.0, "robot_s": None, "stands_s": None, "failed": ""}
    assert lights("follows", None, None) == [False, False, False]
    assert lights("follows", None, "sending") == [False, False, False]
    assert lights("follows", None, "sent") == [True, False, False]
    assert lights("follows", going, "sent") == [True, False, False]
    assert lights("stopped", {**going, "robot_s": 0.02}, "sent") == [True, True, False]
    assert lights("stopped", {**going, "robot_s": 0.02, "stands_s": 0.3}, "sent") == [True, True, True]
    # what the robot said before is not known to be so any more
    assert lights("no_contact", {**going, "robot_s": 0.02, "stands_s": 0.3}, "sent") == [True, False, False]


@pytest.mark.parametrize(
    ("state", "asked", "failed", "why"),
    [
        ("follows", None, "", ""),
        ("follows", "not_sent", "", "not_sent"),
        ("no_contact", None, "", "no_contact"),
        ("no_contact", "not_sent", "", "not_sent"),
        ("follows", "sent", "robot-1 does not answer", "failed"),
    ],
)
def test_a_stop_that_could_not_be_sent(
    tmp_path: Path, state: str, asked: str | None, failed: str, why: str
) -> None:
    stop = {"asked_s": 0.0, "robot_s": None, "stands_s": None, "failed": failed} if failed else None
    found = ask(tmp_path, "stopLights", state, {**VIEW, "stop": stop}, asked)
    assert found["failed"] == why
    assert found["dead"] is (state == "no_contact" or asked == "not_sent")


def test_no_two_states_have_the_same_figure() -> None:
    lines = MODULE.read_text("utf-8").partition("export const SHAPES = {")[2].partition("};")[0]
    figures = [part.rsplit('"', 1)[-1] for part in lines.replace(", ", "\n").split("\n") if '"' in part]
    paths = [part.split('"')[1] for part in lines.replace(", ", "\n").split("\n") if part.count('"') == 2]
    assert len(paths) > 15
    assert len(set(paths)) == len(paths), figures
