"""A short soak with real processes and real faults: it comes back from each, and says so in its files."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from deploy.experiments.soak.files.events import of_kind, read_events
from deploy.experiments.soak.files.happenings import FaultBegun

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("default_signals")]

SOAK = [sys.executable, "-m", "deploy", "soak"]


def criteria(folder: Path) -> dict[str, dict[str, Any]]:
    tree = json.loads((folder / "report.json").read_text())
    return {f"{c['group']}: {c['name']}": c for c in tree["criteria"]}


@pytest.mark.timeout(300)
def test_it_comes_back_from_each_fault_and_judges_itself(tmp_path: Path) -> None:
    report = tmp_path / "report"
    faults = "master-kill,suit-kill,recorder-kill,disk-full,node-loss"
    options = ["--duration", "46s", "--every", "6", "--faults", faults, "--report", str(report)]
    ended = subprocess.run([*SOAK, *options], capture_output=True, text=True, timeout=280, check=False)
    said = ended.stdout + ended.stderr
    events = read_events(report)
    brought = {event.what.fault for event in of_kind(events, FaultBegun)}
    assert brought == set(faults.split(",")), said
    judged = criteria(report)
    # how soon and how many ticks is this machine's affair today; that it came back, and of whose will, is not
    for name in (
        "recovery: faults without recovery",
        "recovery: faults that could not be brought about",
        "guard: moves without being engaged",
        "guard: moved while it held",
        "recorder: recordings that cannot be read",
        "recorder: full disks that ended it or were not logged once",
        "loops: processes that ended by themselves",
    ):
        assert judged[name]["outcome"] == "passed", (judged[name], said)
    assert judged["memory: master's memory grows"]["outcome"] == "not judged"
    assert {path.name for path in report.iterdir()} >= {
        "report.json", "report.html", "soak.png", "events.jsonl", "samples.csv", "master.log", "recorder.log",
    }  # fmt: skip
    assert ended.returncode == any(c["outcome"] == "failed" for c in judged.values()), said


def test_interrupted_it_writes_its_report_and_ends_its_processes(tmp_path: Path) -> None:
    report = tmp_path / "report"
    options = ["--duration", "1h", "--faults", "none", "--report", str(report)]
    soak = subprocess.Popen(
        [*SOAK, *options], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True
    )
    try:
        followed(report, soak)
        os.killpg(soak.pid, signal.SIGINT)  # as a Ctrl-C in a terminal does
        said, _ = soak.communicate(timeout=60)
        with pytest.raises(ProcessLookupError):
            os.killpg(soak.pid, 0)
    finally:
        with suppress(ProcessLookupError):
            os.killpg(soak.pid, signal.SIGKILL)
        soak.communicate()
    assert "interrupted" in said
    assert json.loads((report / "report.json").read_text())["ended"] == "interrupted"
    assert (report / "soak.png").stat().st_size > 1000


def test_killed_it_is_judged_from_what_it_left(tmp_path: Path) -> None:
    report = tmp_path / "report"
    options = ["--duration", "1h", "--faults", "none", "--report", str(report)]
    soak = subprocess.Popen([*SOAK, *options], stdout=subprocess.DEVNULL, text=True, start_new_session=True)
    try:
        followed(report, soak)
    finally:
        os.killpg(soak.pid, signal.SIGKILL)
        soak.communicate()
    judged = subprocess.run([*SOAK, "--judge", str(report)], capture_output=True, text=True, check=False)
    assert "it was killed" in judged.stdout, judged.stderr
    assert json.loads((report / "report.json").read_text())["samples"] >= 1


def followed(report: Path, soak: subprocess.Popen[str]) -> None:
    """Until the robot follows and a sample of it has been written."""
    events, samples = report / "events.jsonl", report / "samples.csv"
    while soak.poll() is None:
        if events.exists() and '"event": "follows"' in events.read_text() and "track" in samples.read_text():
            return
        with pytest.raises(subprocess.TimeoutExpired):
            soak.wait(0.1)
    raise AssertionError(soak.stdout.read() if soak.stdout else "it ended")
