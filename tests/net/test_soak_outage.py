"""A soak between two hosts whose link goes away: the robot holds, and moves again only once it is engaged."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from deploy.experiments.soak.files.events import of_kind, read_events
from deploy.experiments.soak.files.happenings import FaultRecovered


@pytest.mark.timeout(200)
def test_an_outage_stops_the_robot_and_its_end_only_the_commands(tmp_path: Path) -> None:
    report = tmp_path / "report"
    options = ["--duration", "28s", "--every", "12", "--faults", "outage", "--profile", "4g"]
    soak = [sys.executable, "-m", "deploy", "soak", *options, "--report", str(report)]
    ended = subprocess.run(soak, capture_output=True, text=True, timeout=180, check=False)
    said = ended.stdout + ended.stderr
    outages = [event.what for event in of_kind(read_events(report), FaultRecovered) if event.what.fault]
    assert outages, said
    for outage in outages:
        assert outage.done, said
        assert outage.held_s is not None, said
        assert outage.engaged >= 1, said
    judged = {c["name"]: c for c in json.loads((report / "report.json").read_text())["criteria"]}
    assert judged["moves without being engaged"]["outcome"] == "passed", said
    assert judged["moved while it held"]["outcome"] == "passed", said
    # nothing old is acted on: what was under way when the link went away is refused, or young enough
    assert judged["oldest accepted command"]["outcome"] == "passed", said
    assert max(event.at_s for event in read_events(report)) < 120.0
