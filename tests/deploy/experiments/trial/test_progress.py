from __future__ import annotations

import asyncio
import io
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from common.errors import TandemError
from deploy.experiments.trial.cell.folder import Folder
from deploy.experiments.trial.cell.plan import CellKey, TrialPlan
from deploy.experiments.trial.cell.result import Cell, CellStatus
from deploy.experiments.trial.progress import Progress, clock
from deploy.experiments.trial.run import Show, run_trial
from tests.deploy.experiments.trial.made_up import PLAN, cell

S = 1_000_000_000


def test_time_left_is_guessed_from_the_plan_then_from_the_cells() -> None:
    progress = Progress(PLAN, total=4)
    key = PLAN.cells()[0]
    assert progress.left_s(0) == 4 * 52.0, "20 s judged, an outage of 2 s and what is around them"
    progress.begin(key, 10 * S)
    progress.end(ran=True, failed=False, now_ns=40 * S)
    progress.begin(key, 40 * S)
    assert progress.left_s(40 * S) == 90.0
    assert progress.left_s(50 * S) == 80.0
    assert progress.left_s(500 * S) == 60.0, "a cell that takes long does not use up the others' time"
    progress.end(ran=False, failed=True, now_ns=500 * S)
    progress.end(ran=True, failed=False, now_ns=530 * S)
    progress.end(ran=True, failed=False, now_ns=530 * S)
    assert progress.left_s(600 * S) == 0.0


def test_a_cell_that_cannot_run_does_not_enter_the_time_left() -> None:
    progress = Progress(PLAN, total=3)
    progress.begin(PLAN.cells()[0], 0)
    progress.end(ran=False, failed=False, now_ns=1)
    assert progress.left_s(1) > 100.0


def test_a_clock_is_read_as_one() -> None:
    assert [clock(s) for s in (0.4, 59.6, 61, 3723)] == ["0:00", "1:00", "1:01", "1:02:03"]


def run(plan: TrialPlan, folder: Folder, act: dict[int, object]) -> tuple[Progress, list[CellKey], str]:
    """Run with made-up cells; `act` says what the n-th does: a status, "stop", or an error to raise."""
    out, ran = io.StringIO(), []

    async def story() -> Progress:
        stop = asyncio.Event()

        async def run_cell(_: TrialPlan, key: CellKey, stop: asyncio.Event, show: Show) -> Cell:
            ran.append(key)
            what = act.get(len(ran))
            show("following")
            if what == "stop":
                stop.set()
                raise TandemError("interrupted")
            if isinstance(what, CellStatus):
                return Cell(key, what, "so it was")
            if isinstance(what, TandemError):
                raise what
            return cell(key)

        return await run_trial(plan, folder, run_cell, stop, Console(file=out, width=200))

    return asyncio.run(story()), ran, out.getvalue()


def test_each_cell_is_on_disk_before_the_next_begins(tmp_path: Path) -> None:
    folder = Folder(tmp_path)
    progress, ran, _ = run(PLAN, folder, {4: "stop"})
    assert ran == PLAN.cells()[:4]
    assert set(folder.cells()) == set(ran[:3]), "the one that was interrupted is not there"
    assert (progress.done, progress.total) == (3, 24)
    progress, again, _ = run(PLAN, folder, {})
    assert again == PLAN.cells()[3:]
    assert progress.skipped == 3
    assert len(folder.cells()) == 24


def test_a_cell_that_fails_stops_nothing_and_is_tried_again_next_time(tmp_path: Path) -> None:
    folder, plan = Folder(tmp_path), replace(PLAN, repeat=1)
    progress, ran, said = run(plan, folder, {2: CellStatus.FAILED, 3: CellStatus.IMPOSSIBLE})
    assert progress.done == len(ran) == 8
    assert progress.failed == 1
    assert "so it was" in said
    assert "8 of 8 cells to run, about 6:56" in said
    _, again, _ = run(plan, folder, {})
    assert again == [ran[1]]


def test_an_error_that_is_no_interruption_is_not_swallowed(tmp_path: Path) -> None:
    with pytest.raises(TandemError, match="needs root"):
        run(PLAN, Folder(tmp_path), {1: TandemError("needs root")})
