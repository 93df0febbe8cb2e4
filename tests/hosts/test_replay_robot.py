"""`tandem replay --robot`: a recorded motion moves a live simulated robot, at its own speed and faster."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from deploy.examples import profiles
from deploy.harness.host import HostWatch
from deploy.harness.spawn import finished
from tests.deploy.ops.replay.test_command import write
from tests.deploy.recorded.test_recompute import RecordedBench

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.live, pytest.mark.timeout(300)]
SLAVE = Path(profiles.__file__).parent / "slave.toml"
MOST_RMS_DEG = 12.0
"""Of the joint that is furthest off: the way from command to encoder takes a tenth of a second."""


@pytest.mark.parametrize("speed", [1.0, 2.0])
def test_the_robot_follows_the_recording(on_this_host: OnThisHost, tmp_path: Path, speed: float) -> None:
    bench = RecordedBench('motion="bottle"')
    bench.snapshot()
    bench.run(1400)
    bench.calls.flush()
    file = write(tmp_path / "morning.mcap", bench, bench.entries)

    async def story(host: HostWatch) -> None:
        arguments = ["replay", str(file), "--robot", str(SLAVE), "--speed", str(speed), "--json"]
        status, out, error = await finished([sys.executable, "-m", "deploy", *arguments])
        assert status == 0, error.decode()
        found = json.loads(out)
        assert found["seconds"] > 4.0
        assert found["followed"] > 0.9, found["holds"]
        assert max(found["rms_deg"].values()) < MOST_RMS_DEG * speed

    on_this_host(story)
