"""The page's calibration with its real process, at the tap of a master that is played by its calls."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from common.config.console import CalibrationPageConfig
from common.tap.sender import TapSender
from deploy.console.calibration import CalibrationDesk, CalibrationPlace
from deploy.examples.profiles import EXAMPLES
from master.calibrate.recording import load_recordings
from master.journal.calls import FRAMES
from tests.deploy.console.test_calibration import shows
from tests.deploy.recorded.test_recompute import RecordedBench

pytestmark = pytest.mark.live
TICKS = 600


async def play(path: Path, messages: list[bytes]) -> None:
    """Put frames on a tap until cancelled, five times as fast as a suit."""
    sender = TapSender(path, lambda: b"")
    sender.open()
    try:
        while True:
            for message in messages:
                sender.put(FRAMES, message)
                await asyncio.sleep(0.002)
    finally:
        sender.close()


def test_it_is_led_at_the_tap_and_keeps_what_was_recorded(tmp_path: Path) -> None:
    bench = RecordedBench()
    bench.run(TICKS)
    bench.calls.flush()
    messages = [entry.payload for entry in bench.entries if entry.topic == FRAMES]
    tap, folder = tmp_path / "master.sock", tmp_path / "calibration"
    place = CalibrationPlace(EXAMPLES / "master.toml", tap, CalibrationPageConfig(folder=folder))

    async def story() -> None:
        playing = asyncio.create_task(play(tap, messages))
        desk = CalibrationDesk(place)
        try:
            await lead(desk)
        finally:
            await desk.close()
            playing.cancel()
            await asyncio.gather(playing, return_exceptions=True)

    async def lead(desk: CalibrationDesk) -> None:
        await asyncio.sleep(0)  # the tap is there
        await desk.act({"do": "begin", "what": ["imu", "align"]}, [])
        shown = await shows(desk, lambda told: "view" in told or "error" in told)
        view = shown["view"]
        assert (view["step"], view["steps"]) == ("attitudes", 4)
        wanted = ("keep_still", "lay_down")
        await shows(desk, lambda told: all(node["hint"] in wanted for node in told["view"]["nodes"]))
        await desk.act({"do": "word"}, [])
        await shows(desk, lambda told: told["view"]["step"] in ("wear", "zero_pose"))
        await desk.act({"do": "end"}, [])
        shown = await shows(desk, lambda told: not told["under_way"])
        assert shown["error"].startswith("ended by a person")

    asyncio.run(story())
    nodes = load_recordings(folder / "tray.mcap")
    assert set(nodes) == set(bench.config.skeleton.segment_names)


def test_a_master_that_is_not_there_is_said(tmp_path: Path) -> None:
    config = CalibrationPageConfig(folder=tmp_path / "calibration")
    place = CalibrationPlace(EXAMPLES / "master.toml", tmp_path / "none.sock", config)

    async def story() -> None:
        desk = CalibrationDesk(place)
        await desk.act({"do": "begin", "what": ["mag"]}, [])
        shown = await shows(desk, lambda told: told.get("under_way") is False)
        assert "no tap there" in shown["error"]

    asyncio.run(story())
