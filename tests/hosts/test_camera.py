"""The camera's process killed while the robot tracks: the motion goes on, and the picture comes back."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import psutil
import pytest

from common.clock import to_ns
from common.metrics.slave import CameraMetrics
from deploy.harness.host import HostWatch
from deploy.harness.rig import Rig, open_rig
from deploy.harness.start import start_tracking

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(400)]
SEEN_S = 1.0
"""How long the robot is watched after the kill."""


def camera_process(rig: Rig) -> psutil.Process:
    usage = rig.children["slave"]._usage
    assert usage is not None
    (camera,) = (c for c in usage.children() if "slave.camera" in " ".join(c.cmdline()))
    return camera


def ages(video: CameraMetrics | None) -> int:
    return 0 if video is None else video.action_to_observation_ms.count


def test_a_killed_camera_changes_one_word_in_the_state_and_nothing_else(
    on_this_host: OnThisHost,
) -> None:
    async def story(host: HostWatch) -> None:
        async with open_rig(
            overrides={"slave": ['camera.source="robot"', "guard.max_video_age_s=0.0"]}
        ) as rig:
            observer = rig.observer
            await start_tracking(rig)
            assert observer.state is not None
            if "no OpenGL" in observer.state.faults.get("camera", ""):
                pytest.skip(observer.state.faults["camera"])

            observer.recording = True
            # pictures come, and the operator's commands say which he had seen
            await rig.until(lambda: ages(observer.video) > 0, 20.0, "an age of what the operator saw")
            camera_process(rig).kill()
            await rig.until(lambda: "camera" in observer.state.faults, 5.0, "word of the camera")  # type: ignore[union-attr]
            killed_ns = observer.sent_ns
            await rig.until(lambda: observer.sent_ns > killed_ns + to_ns(SEEN_S), 5.0, "a second of states")

            def moved_rad() -> float:
                since = [s.setpoint_rad for s in observer.states if s.sent_ns >= killed_ns]
                return float(np.ptp(since, axis=0).max())

            # it goes on following: the setpoint is where the operator moves it, who stands still now and then
            await rig.until(lambda: moved_rad() > np.radians(1.0), 15.0, "motion after the camera died")
            assert {s.guard for s in observer.states if s.sent_ns >= killed_ns} == {"track"}
            await rig.until(lambda: "camera" not in observer.state.faults, 20.0, "the camera again")  # type: ignore[union-attr]

    on_this_host(story)
