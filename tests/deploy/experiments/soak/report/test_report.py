"""The report of a made-up soak: everything in it, and nothing fetched from elsewhere."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from deploy.experiments.soak.files.events import AnyEvent, EventFile
from deploy.experiments.soak.files.samples import SampleFile
from deploy.experiments.soak.judge.judge import JudgedSoak, judge_soak
from deploy.experiments.soak.report.plots import decimated, with_gaps
from deploy.experiments.soak.report.write import write_report
from deploy.measure.verdict import verdict_table
from tests.deploy.experiments.soak.conftest import STORY, happened

LEFT_OUT = happened(0.0, "begin", {"transport": "tcp", "seed": 4, "left_out": {"outage": "no <network>"}})


def judged(folder: Path, *more: AnyEvent) -> JudgedSoak:
    events, samples = EventFile(folder), SampleFile(folder, ["master", "slave", "soak"])
    for event in (LEFT_OUT, *STORY[1:], *more):
        events.add(event)
    for second in range(1, 200):
        row: dict[str, float | str] = {
            "at_s": second,
            "guard": "track",
            "sent": 12.5,
            "one_way_p50_ms": 0.4 + 0.01 * (second % 7),
        }
        row |= {f"{name}_life": 1 for name in ("master", "slave", "soak")}
        row |= {f"{name}_rss_mb": 90.0 for name in ("master", "slave", "soak")}
        samples.add(row | ({"lost": 2.0} if second == 150 else {}))
    events.close()
    samples.close()
    return judge_soak(folder)


def test_the_json_says_all(tmp_path: Path) -> None:
    write_report(
        judged(tmp_path, happened(199.0, "end", {"how": "it ran its time", "error": False, "status": {}})),
        tmp_path,
    )
    tree = json.loads((tmp_path / "report.json").read_text())
    assert tree["verdict"] == "failed"
    assert tree["ended"] == "it ran its time"
    assert tree["options"]["left_out"] == {"outage": "no <network>"}
    [lost] = [c for c in tree["criteria"] if c["name"] == "lost, unexplained"]
    assert (lost["outcome"], lost["measured"], lost["limit"]) == ("failed", 2.0, 0.0)
    assert tree["faults"][0]["flow_s"] == 4.0


def test_the_page_opens_offline_and_holds_the_picture(tmp_path: Path) -> None:
    write_report(judged(tmp_path), tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert (tmp_path / "soak.png").read_bytes().startswith(b"\x89PNG")
    assert "data:image/png;base64," in page
    assert "http" not in page
    assert "no &lt;network&gt;" in page
    assert "master-kill" in page
    assert "it was killed, so its end is unknown" in page


def test_the_table_has_a_row_a_criterion(tmp_path: Path) -> None:
    result = judged(tmp_path)
    console = Console(width=200, record=True)
    with console.capture() as shown:
        console.print(verdict_table("criterion", result.verdicts))
    words = " ".join(shown.get().split())
    assert all(verdict.name in words for verdict in result.verdicts)


@pytest.mark.parametrize("count", [10, 1500, 1501, 30_000])
def test_long_curves_keep_their_peaks(count: int) -> None:
    values = np.zeros(count)
    values[count // 2] = 50.0
    at, medians, most = decimated(np.arange(count, dtype=float), values)
    assert len(at) == len(medians) == min(count, 1500)
    assert most.max() == 50.0


def test_a_curve_is_broken_where_nothing_was_measured() -> None:
    at, values = with_gaps(np.array([0.0, 1.0, 2.0, 9.0, 10.0]), np.array([5.0, np.nan, 6.0, 7.0, 8.0]), 4.0)
    assert at.tolist() == [0.0, 2.0, 2.0, 9.0, 10.0]
    np.testing.assert_array_equal(values, [5.0, 6.0, np.nan, 7.0, 8.0])
