"""The meetings on a terminal, and what they are judged by."""

from __future__ import annotations

from collections.abc import Sequence

from rich.table import Table

from deploy.experiments.contact.trials import Pair
from deploy.measure.verdict import Verdict, at_most
from deploy.report.tables import number, plain_table

JUDGED_M_S = 0.5
MOST_RATIO = 0.35
"""Of the peak force: what is asked where the patient is clamped and where he is free."""
MOST_DETECTION_MS = 50.0
NEVER_MS = float("inf")


def pairs_table(pairs: Sequence[Pair]) -> Table:
    """One row a meeting: forces and times without and with detection."""
    heads = ("m/s", "peak N", "with", "share", "ms", "touching", "pressing", "with")
    table = plain_table("what meets him", *heads)
    table.columns[0].no_wrap = True
    for one in pairs:
        met, without, seen = one.meeting, one.without, one.with_detection
        table.add_row(
            f"{met.place}, {'clamped' if met.clamped else 'free'}",
            f"{met.speed_m_s:g}",
            number(without.peak_n, 0),
            number(seen.peak_n, 0),
            number(one.ratio, 2),
            "–" if one.detection_s is None else number(1e3 * one.detection_s, 0),
            number(seen.touching_s, 2),
            number(without.pressing_n, 0),
            number(seen.pressing_n, 0),
        )
    table.caption = "ms: from threshold to stop; touching: s of 1.5, with; pressing: N at the end"
    return table


def judge(pairs: Sequence[Pair]) -> list[Verdict]:
    """Peak forces at 0.5 m/s, free and clamped; the slowest detection; what goes on pressing."""
    verdicts = []
    for clamped, who in ((False, "free"), (True, "clamped")):
        ratios = [
            one.ratio
            for one in pairs
            if one.meeting.clamped is clamped and one.meeting.speed_m_s == JUDGED_M_S
        ]
        verdicts.append(
            at_most(f"peak force with / without, {who}, 0.5 m/s", max(ratios, default=None), MOST_RATIO)
        )
        times = [
            NEVER_MS if one.detection_s is None else 1e3 * one.detection_s
            for one in pairs
            if one.meeting.clamped is clamped
        ]
        name = f"from threshold to stop, {who}"
        verdicts.append(at_most(name, max(times, default=None), MOST_DETECTION_MS, "ms"))
    pressing = [one.with_detection.pressing_n for one in pairs]
    verdicts.append(at_most("goes on pressing", max(pressing, default=None), 0.0, "N"))
    return verdicts
