"""What video does to commands and states on a link of 1 Mbit/s each way; each run in a process of its own."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import pytest


def run(video: str, seconds: float, *more: str) -> dict[str, Any]:
    command = [
        sys.executable,
        "-m",
        "tests.slave.camera.video_bench",
        video,
        "--seconds",
        str(seconds),
        *more,
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    measured: dict[str, Any] = json.loads(done.stdout)
    return measured


def test_video_delays_no_command_and_hardly_a_state() -> None:
    without, beside, unheld = (run(video, 2.5) for video in ("off", "controlled", "uncontrolled"))
    assert beside["video"]["fps"] > 1
    assert beside["command_ms"]["p50"] < 1.5 * without["command_ms"]["p50"]
    # a state may wait for one picture: 30 ms of it, and what came before it was known
    assert beside["state_ms"]["p50"] < without["state_ms"]["p50"] + 60
    assert unheld["state_ms"]["p50"] > without["state_ms"]["p50"] + 300


def test_of_three_cameras_one_that_freezes_leaves_the_others_and_the_commands_alone() -> None:
    frozen = run(
        "controlled", 6.0, "--kb-s", "12500", "--cameras", "3", "--rate", "25", "--kb", "60", "--freeze"
    )
    assert frozen["still_s"]["camera2"] > 2.0
    assert max(frozen["still_s"]["camera0"], frozen["still_s"]["camera1"]) < 1.0
    assert min(frozen["fps"]["camera0"], frozen["fps"]["camera1"]) > 2.0 * frozen["fps"]["camera2"]


@pytest.mark.bench
def test_commands_p99_with_video_is_at_most_half_as_much_again() -> None:
    without, beside = run("off", 20.0), run("controlled", 20.0)
    assert beside["command_ms"]["p99"] <= 1.5 * without["command_ms"]["p99"]
