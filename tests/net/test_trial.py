"""A small trial over two hosts made of namespaces: run, gone on with, interrupted."""

from __future__ import annotations

import asyncio
import csv
import io
import json
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from deploy.harness.host import HostWatch

if TYPE_CHECKING:
    from tests.conftest import OnThisHost

pytestmark = [pytest.mark.timeout(600), pytest.mark.usefixtures("default_signals")]
TRIAL = (sys.executable, "-m", "deploy", "trial")
PLAN = ("--transports", "tcp,unixsock-stream", "--profiles", "4g", "--strategies", "predict", "--repeat", "1",
        "--seconds", "8", "--outage", "1")  # fmt: skip


def run(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*TRIAL, *arguments], capture_output=True, text=True, timeout=200, check=False)


def test_a_trial_measures_says_why_not_and_goes_on(tmp_path: Path, on_this_host: OnThisHost) -> None:
    async def story(_: HostWatch) -> None:
        folder = Path(tempfile.mkdtemp(dir=tmp_path)) / "report"  # of this try
        first = await asyncio.to_thread(run, *PLAN, "--report", str(folder))
        assert first.returncode == 0, first.stdout + first.stderr
        measured_well(folder)
        await asyncio.to_thread(goes_on, folder)

    on_this_host(story)


def measured_well(folder: Path) -> None:
    compared = json.loads((folder / "report.json").read_text("utf-8"))["compared"]
    measured = compared["setups"]["4g/tcp/predict"]
    assert measured["repeats_done"] == 1, measured["why_not"]
    figures = {name: spread["median"] for name, spread in measured["figures"].items()}
    assert abs(figures["true_one_way_p50_ms"] - 27.0) < 20.0, (
        "the profile's delay, on a machine that may be busy"
    )
    assert abs(figures["one_way_p50_ms"] - figures["true_one_way_p50_ms"]) < figures["one_way_bound_ms"] + 5.0
    assert figures["accepted"] > 50.0
    assert figures["rmse_deg"] > 0.0
    assert figures["flow_s"] > 0.0
    assert figures["stale_accepted"] == 0.0
    assert figures["moved_alone"] == 0.0
    assert figures["up_kb_s"] > 1.0
    assert "does not cross hosts" in compared["setups"]["4g/unixsock-stream/predict"]["why_not"][0]
    [line] = [r for r in csv.DictReader(io.StringIO((folder / "cells.csv").read_text("utf-8")))
              if r["status"] == "done"]  # fmt: skip
    assert line["transport"] == "tcp"


def goes_on(folder: Path) -> None:
    compared = json.loads((folder / "report.json").read_text("utf-8"))["compared"]
    written = {f: f.stat().st_mtime_ns for f in (folder / "cells").iterdir()}
    began = time.monotonic()
    again = run(*PLAN, "--report", str(folder))
    assert again.returncode == 0, again.stderr
    assert {f: f.stat().st_mtime_ns for f in (folder / "cells").iterdir()} == written, "nothing was run again"
    assert time.monotonic() - began < 60.0
    assert json.loads((folder / "report.json").read_text("utf-8"))["compared"] == compared

    other = run(*PLAN[:-1], "0", "--report", str(folder))
    assert other.returncode == 1
    assert "outage s was 1.0, is 0.0" in other.stderr


def test_an_interrupted_trial_writes_the_report_of_what_is_there(tmp_path: Path) -> None:
    folder = tmp_path / "report"
    with subprocess.Popen(
        [*TRIAL, *PLAN, "--report", str(folder)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as trial:
        try:
            while not (folder / "plan.json").exists() and trial.poll() is None:
                time.sleep(0.05)
            trial.send_signal(signal.SIGINT)
            out, err = trial.communicate(timeout=60)
        finally:
            trial.kill()
    assert trial.returncode == 1, out + err
    assert "run the same command again to continue" in err
    assert "Traceback" not in err
    assert "This report is incomplete" in (folder / "report.html").read_text("utf-8")
