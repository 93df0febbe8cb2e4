"""What is written as it goes is read back, also where the writer was killed in the middle of a line."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from common.errors import TandemError
from deploy.experiments.soak.files.events import EventFile, of_kind, read_events
from deploy.experiments.soak.files.happenings import GuardChanged, HostStalled
from deploy.experiments.soak.files.log import SHOWN, SoakLog
from deploy.experiments.soak.files.samples import SampleFile, header, read_samples
from tests.deploy.experiments.soak.conftest import happened

PROCESSES = ["master", "soak"]


def test_samples_come_back_column_by_column(tmp_path: Path) -> None:
    file = SampleFile(tmp_path, PROCESSES)
    file.add({"at_s": 1.0, "guard": "track", "lost": 2.0, "master_life": 1.0, "round_trip_ms": math.nan})
    file.add({"at_s": 2.0, "guard": "hold", "master_life": 2.0, "round_trip_ms": 0.75, "slave_ticks": 1.5e8})
    file.close()
    samples = read_samples(tmp_path)
    assert len(samples) == 2
    assert samples.processes == PROCESSES
    np.testing.assert_array_equal(samples["lost"], [2.0, np.nan])
    np.testing.assert_array_equal(samples["round_trip_ms"], [np.nan, 0.75])
    np.testing.assert_array_equal(samples["master_life"], [1.0, 2.0])
    assert samples["slave_ticks"][1] == 1.5e8
    assert set(samples.columns) == set(header(PROCESSES)) - {"guard"}


def test_a_row_cut_in_half_is_left_out(tmp_path: Path) -> None:
    file = SampleFile(tmp_path, PROCESSES)
    for at_s in (1.0, 2.0):
        file.add({"at_s": at_s})
    file.close()
    path = tmp_path / "samples.csv"
    path.write_text(path.read_text()[:-20])
    assert read_samples(tmp_path).at_s.tolist() == [1.0]


def test_rows_are_on_disk_before_the_file_is_closed(tmp_path: Path) -> None:
    samples, events = SampleFile(tmp_path, PROCESSES), EventFile(tmp_path)
    samples.add({"at_s": 1.0})
    events.add(happened(0.5, "fault", {"fault": "suit-kill"}))
    assert len(read_samples(tmp_path)) == 1
    assert len(read_events(tmp_path)) == 1
    samples.close()
    events.close()


def test_events_come_back_and_a_torn_last_line_is_left_out(tmp_path: Path) -> None:
    events = [
        happened(0.5, "fault", {"fault": "suit-kill"}),
        happened(1.25, "guard", {"to": "hold", "reason": "für"}),
    ]
    file = EventFile(tmp_path)
    for event in events:
        file.add(event)
    file.close()
    with (tmp_path / "events.jsonl").open("a") as torn:
        torn.write('{"at_s": 3, "eve')
    assert read_events(tmp_path) == events
    assert of_kind(events, GuardChanged) == events[1:]


@pytest.mark.parametrize("content", ["", "a,b\n1,2\n"])
def test_what_is_no_soak_s_is_refused(tmp_path: Path, content: str) -> None:
    (tmp_path / "samples.csv").write_text(content)
    with pytest.raises(TandemError, match="not the samples of a soak"):
        read_samples(tmp_path)
    with pytest.raises(TandemError, match=r"events\.jsonl: cannot be read"):
        read_events(tmp_path)


def test_the_log_keeps_only_the_newest_events_and_counts_all(tmp_path: Path) -> None:
    now_ns = iter(range(0, 10**12, 10**9)).__next__
    log = SoakLog(tmp_path, PROCESSES, now_ns)
    for _ in range(50):
        log.add(HostStalled(still_ms=30.0))
    log.close()
    assert len(log.newest) == SHOWN
    assert log.counts == {"still": 50}
    assert [event.at_s for event in read_events(tmp_path)] == [float(i) for i in range(1, 51)]
