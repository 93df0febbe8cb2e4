"""The desk of calibration: one at a time, only while robots hold, and what its process says is shown."""

from __future__ import annotations

import asyncio
import json
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from common.config.console import CalibrationPageConfig
from common.errors import TandemError
from deploy.calibrate.live.guide import WHATS as LED_WHATS
from deploy.calibrate.live.led import LedOrder
from deploy.console import calibration
from deploy.console.calibration import WHATS, CalibrationDesk, CalibrationPlace
from tests.deploy.console.robots import ROBOT, state
from tests.deploy.console.served import Served, served

ECHO = """
import json, sys
order = sys.stdin.readline()
print(json.dumps({"view": {"order": json.loads(order)}}), flush=True)
for line in sys.stdin:
    print(json.dumps({"view": {"said": json.loads(line)}}), flush=True)
"""
"""Stands for the process: says back what it is told, until its input ends."""
COMPUTES = 'import sys; sys.stdin.readline(); print(\'{"outcome": {"nodes": {}}}\')'
HANGS = "import sys; print('{\"view\": {}}', flush=True); sys.stdin.read(); import signal; signal.pause()"
DIES = "raise SystemExit(3)"


def desk(folder: Path, script: str = ECHO) -> CalibrationDesk:
    config = CalibrationPageConfig(folder=folder, hemisphere="south")
    place = CalibrationPlace(Path("master.toml"), Path("tap.sock"), config, ("capture.rate_hz=50",))
    return CalibrationDesk(place, (sys.executable, "-c", script))


async def shows(one: CalibrationDesk, holds: Callable[[dict[str, Any]], object]) -> dict[str, Any]:
    """Waits until what is shown holds."""
    changed = asyncio.Event()
    one.on_shown = changed.set
    async with asyncio.timeout(90.0):
        while not holds(one.shown or {}):
            await changed.wait()
            changed.clear()
    assert one.shown is not None
    return one.shown


def run(story: Callable[[], Awaitable[None]]) -> None:
    asyncio.run(story())  # type: ignore[arg-type]  # a coroutine


def test_the_process_is_told_all_that_it_needs_and_a_person_words(tmp_path: Path) -> None:
    async def story() -> None:
        one = desk(tmp_path)
        assert "begins" in await one.act({"do": "begin", "what": ["align", "imu"]}, [])
        shown = await shows(one, lambda told: "order" in told.get("view", {}))
        order = LedOrder.read(json.dumps(shown["view"]["order"]))
        assert (order.what, order.hemisphere, order.countdown_s) == (("imu", "align"), "south", 5.0)
        assert (order.out, order.overrides) == (str(tmp_path), ("capture.rate_hz=50",))
        with pytest.raises(TandemError, match="under way already"):
            await one.act({"do": "begin", "what": ["imu"]}, [])
        await one.act({"do": "word"}, [])
        await shows(one, lambda told: told["view"].get("said") == {"do": "word"})
        await one.act({"do": "end"}, [])
        shown = await shows(one, lambda told: not told["under_way"])
        assert "ended by a person" in shown["error"]
        assert not one.under_way

    run(story)


def test_it_begins_only_while_robots_hold_and_ends_when_one_is_engaged(tmp_path: Path) -> None:
    async def story() -> None:
        one = desk(tmp_path)
        with pytest.raises(TandemError, match="robot-1 is engaged: disengage first"):
            await one.act({"do": "begin", "what": ["imu"]}, ["robot-1"])
        assert not one.under_way
        await one.act({"do": "begin", "what": ["imu"]}, [])
        one.watch([])
        assert one.under_way
        one.watch(["robot-1"])
        shown = await shows(one, lambda told: not told["under_way"])
        assert shown["error"].startswith("robot-1 was engaged")

    run(story)


def test_the_outcome_stays_shown_and_a_process_that_dies_is_said(tmp_path: Path) -> None:
    async def story() -> None:
        one = desk(tmp_path, COMPUTES)
        await one.act({"do": "begin", "what": ["mag"]}, [])
        shown = await shows(one, lambda told: told.get("under_way") is False)
        assert shown["outcome"] == {"nodes": {}}
        assert "error" not in shown
        dead = desk(tmp_path, DIES)
        await dead.act({"do": "begin", "what": ["mag"]}, [])
        shown = await shows(dead, lambda told: told.get("under_way") is False)
        assert "see the console's log" in shown["error"]

    run(story)


def test_a_process_that_hangs_with_its_output_open_is_killed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Else the console never ended, and robots could not be engaged again."""
    monkeypatch.setattr(calibration, "END_S", 0.0)

    async def story() -> None:
        one = desk(tmp_path, HANGS)
        await one.act({"do": "begin", "what": ["imu"]}, [])
        await shows(one, lambda told: "view" in told)
        async with asyncio.timeout(60.0):
            await one.close()
        assert not one.under_way

    run(story)


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"do": "dance"}, "expected begin, word or end"),
        ({"do": "begin", "what": ["legs"]}, "expected one or more of imu, mag, align"),
        ({"do": "begin", "what": []}, "expected one or more"),
        ({"do": "begin", "what": [{}]}, "expected one or more"),
        ({"do": "word"}, "no calibration is under way"),
        ({"do": "end"}, "no calibration is under way"),
    ],
)
def test_what_cannot_be_is_refused_in_words(tmp_path: Path, body: dict[str, object], words: str) -> None:
    async def story() -> None:
        with pytest.raises(TandemError, match=words):
            await desk(tmp_path).act(body, [])

    run(story)


def test_without_a_folder_it_says_what_is_missing() -> None:
    async def story() -> None:
        with pytest.raises(TandemError, match=r"\[console.calibration\] folder"):
            await CalibrationDesk().act({"do": "begin", "what": ["imu"]}, [])

    run(story)


def test_the_page_knows_the_parts_that_the_guide_knows() -> None:
    assert WHATS == LED_WHATS


def test_pages_act_by_their_role_see_it_and_nobody_engages_meanwhile(tmp_path: Path) -> None:
    async def story(console: Served) -> None:
        console.hub.calibrates(desk(tmp_path))
        begin = {"do": "begin", "what": ["imu"]}
        status, said = await console.post("/api/calibrate", begin)
        assert status == 401, said
        await console.log_in()
        console.models[ROBOT].on_state(state(1), 1, "tap")
        status, said = await console.post("/api/calibrate", begin)
        assert status == 409
        assert said["error"] == f"{ROBOT} is engaged: disengage first, so that the robot holds"
        console.models[ROBOT].on_state(state(2, guard="hold"), 2, "tap")
        page = await console.page()
        assert (await console.post("/api/calibrate", begin))[1]["done"]
        assert (await page.hear("calibration"))["what"] == ["imu"]
        status, said = await console.post("/api/act", {"act": "engage", "robot": ROBOT})
        assert (status, said["error"]) == (409, "the suit is being calibrated: end that first")
        other = await console.page()
        assert (await other.hear("calibration"))["under_way"]
        assert (await console.post("/api/calibrate", {"do": "end"}))[1]["done"]
        while (await page.hear("calibration"))["under_way"]:
            pass

    async def told() -> None:
        async with served() as console:
            await story(console)

    asyncio.run(told())
