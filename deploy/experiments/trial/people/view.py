"""The people trial on the terminal, and as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Table

from common.skeleton import Skeleton
from deploy.experiments.trial.people.study import RATES_HZ, SLOWER, Row, rows, running, verdicts
from deploy.measure.verdict import Verdict, counts, verdict_table
from deploy.report.tables import plain_table
from deploy.sim.suit.people import PeopleConfig, load_clips

FILE = "people.json"


def run_people_trial(
    people: PeopleConfig, skeleton: Skeleton, strategies: Sequence[str], slower: float | None, seed: int,
    folder: Path, console: Console,
) -> list[Verdict]:  # fmt: skip
    """Follow the people with each strategy over each line, print and write what was found."""
    clips = load_clips(people, skeleton)
    seconds = sum(len(clip.position_rad) / clip.rate_hz for clip in clips)
    who = ", ".join(sorted({clip.subject for clip in clips}))
    console.print(
        f"{len(clips)} clips, {seconds:.0f} s, of {who} ({people.who}); virtual clock, servo of 8 Hz"
    )
    speeds = SLOWER if slower is None else (slower,)
    done = list(rows(clips, skeleton, strategies, speeds, seed))
    for title in dict.fromkeys(map(_line, done)):
        console.print(_table(title, [row for row in done if _line(row) == title]))
    runners = running(clips)
    ran = [*rows(runners, skeleton, ("latest", "predict"), (1.0,), seed)] if runners else []
    judged = verdicts(done, _running_ratio(ran))
    if "predict" in strategies:
        console.print(verdict_table("predict, 25 commands a second", judged))
        console.print(counts(judged))
    folder.mkdir(parents=True, exist_ok=True)
    tree = {"people": who, "rows": [row.tree() for row in done], "targets": [one.tree() for one in judged]}
    (folder / FILE).write_text(json.dumps(tree, indent=1), "utf-8")
    console.print(f"report: {folder / FILE}", highlight=False, soft_wrap=True)
    return judged


def _line(row: Row) -> str:
    poor = f", {100 * row.line.loss:g} % lost, jitter" if row.line.loss else ""
    speed = "natural speed" if row.slower == 1.0 else f"{row.slower:g} × slower"
    return f"{speed}, {1e3 * row.line.one_way_s:.0f} ms one way{poor}"


def _table(title: str, of_line: Sequence[Row]) -> Table:
    """One line's rows: all that fits on 80 columns."""
    table = plain_table(
        "strategy", "Hz", "/ latest", "no limits", "RMSE °", "rough", "over °", "most °", "still °",
        title=title,
    )  # fmt: skip
    for row in of_line:
        f = row.found
        table.add_row(
            row.strategy, f"{row.line.rate_hz:g}",
            f"{row.over_latest:.2f}", f"{row.unlimited_over_latest:.2f}",
            f"{f.rmse_deg:.2f}", f"{f.roughness:.2f}", f"{f.overshoot_deg:.1f}",
            f"{f.largest_overshoot_deg:.0f}", f"{f.still_deg:.2f}",
        )  # fmt: skip
    return table


def _running_ratio(done: Sequence[Row]) -> float | None:
    """The worst of `predict` over lines and rates."""
    ratios = [row.over_latest for row in done if row.strategy == "predict" and row.line.rate_hz in RATES_HZ]
    return max(ratios, default=None)
