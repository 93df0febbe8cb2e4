"""The people trial on the terminal, and as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from rich.console import Console

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
    table = plain_table(
        "line", "Hz", "strategy", "/ latest", "no limits", "RMSE °", "rough", "over °", "most °", "still °"
    )
    done: list[Row] = []
    for row in rows(clips, skeleton, strategies, speeds, seed):
        done.append(row)
        f, line = row.found, row.line
        poor = f", {100 * line.loss:g} % lost, jitter" if line.loss else ""
        table.add_row(
            f"1 / {row.slower:g}, {1e3 * line.one_way_s:.0f} ms{poor}", f"{line.rate_hz:g}", row.strategy,
            f"{row.over_latest:.2f}", f"{row.unlimited_over_latest:.2f}",
            f"{f.rmse_deg:.2f}", f"{f.roughness:.2f}", f"{f.overshoot_deg:.1f}",
            f"{f.largest_overshoot_deg:.0f}", f"{f.still_deg:.2f}",
        )  # fmt: skip
    console.print(table)
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


def _running_ratio(done: Sequence[Row]) -> float | None:
    """The worst of `predict` over lines and rates."""
    ratios = [row.over_latest for row in done if row.strategy == "predict" and row.line.rate_hz in RATES_HZ]
    return max(ratios, default=None)
