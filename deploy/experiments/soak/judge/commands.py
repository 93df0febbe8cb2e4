"""Commands lost, late, doubled, refused or too old, outside of what explains them. Pure."""

from __future__ import annotations

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask
from deploy.experiments.soak.judge.evidence import SoakEvidence, of_enough
from deploy.experiments.soak.judge.explain import LOST_PACKETS
from deploy.experiments.soak.judge.windows import explained as in_windows
from deploy.measure.estimated import LEAST_ESTIMATED
from deploy.measure.verdict import Verdict, at_most, unproven

AGE_MS = 300.0
"""`guard.max_age_s`, where no network needs a longer one: an accepted command is younger."""
DATAGRAMS = frozenset(LOST_PACKETS)
COUNTED = {
    "lost": "lost",
    "late": "out of order",
    "repeated": "duplicated",
    "refused": "refused by the guard",
}
"""Columns of what may happen to a command, and the words for it."""


def commands(seen: SoakEvidence) -> list[Verdict]:
    """Lost, late, twice, refused, too old, and due but never there."""
    return [
        _any_came(seen),
        *(_counted(seen, column) for column in COUNTED),
        _oldest(seen),
        _came_when_due(seen),
    ]


def _any_came(seen: SoakEvidence) -> Verdict:
    """Without a single command all else here is true of nothing."""
    sent, arrived = seen.sum("sent"), seen.sum("arrived")
    why = f"the master sent {sent:.0f}, the robot took {arrived:.0f}"
    return at_most("sides without a single command", float(sent == 0.0) + float(arrived == 0.0), 0.0, why=why)


def _counted(seen: SoakEvidence, column: str) -> Verdict:
    all_ = seen.sum("sent")
    # a lost datagram is one command, and the network counts how many packets it lost
    datagrams = column == "lost" and seen.begun.transport in DATAGRAMS
    sent = seen.sum("sent", seen.quiet | seen.network_alone if datagrams else seen.quiet)
    count = seen.known_sum(column, seen.quiet)
    if count is not None and datagrams:
        count += beyond_the_network(seen)
    why = f"{seen.sum(column):.0f} in all; {sent:.0f} of {all_:.0f} were sent outside of faults and stalls"
    if column == "lost":
        why += f"; {seen.sum('overwritten'):.0f} waited too long in the slave itself"
    verdict = at_most(f"{COUNTED[column]}, unexplained", count if sent else None, 0.0, why=why)
    return of_enough(verdict, sent / all_ if all_ else 0.0)


def beyond_the_network(seen: SoakEvidence) -> float:
    """Commands lost in each stretch of lossy seconds beyond its lost packets, without faults and stalls."""
    at_s = seen.samples.at_s
    lost, gone = (np.nan_to_num(seen.samples[name]) for name in ("lost", "link_lost"))
    gone = gone + np.nan_to_num(seen.samples["link_out"])
    lossy = in_windows(at_s, seen.explained.network)
    stretch = np.cumsum(np.diff(lossy, prepend=False))  # odd within one, even between two
    beyond = 0.0
    for number in np.unique(stretch[lossy]):
        here = stretch == number
        beyond += max(0.0, float(lost[here & seen.network_alone].sum() - gone[here].sum()))
    return beyond


def _oldest(seen: SoakEvidence) -> Verdict:
    ages = seen.samples["age_max_ms"]
    oldest = None if np.isnan(ages).all() else float(np.nanmax(ages))
    limit_s = seen.network.max_age_s
    most_ms = AGE_MS if limit_s is None else 1e3 * limit_s
    verdict = at_most("oldest accepted command", oldest, most_ms, "ms", why="put → accepted")
    share = _known_share(ages, seen.quiet & (seen.samples["sent"] > 0.0))
    if share >= LEAST_ESTIMATED:
        return verdict
    return unproven(verdict, f"known for only {100.0 * share:.0f} % of the samples", None)


def _known_share(values: Array, asked: Mask) -> float:
    """The share of the samples (N,) asked for that hold a value; 1 where none was asked for."""
    return float(np.isfinite(values[asked]).mean()) if asked.any() else 1.0


def _came_when_due(seen: SoakEvidence) -> Verdict:
    """By time, not by number: when both sides stall together, nothing is sent and nothing is lost."""
    name = "due but never arrived, unexplained"
    if np.isnan(seen.samples["due"]).all():
        return at_most(name, None, 0.0, why="the robot did not publish it")
    # a command that did not come when due is why a robot holds, so that it held explains nothing here
    judged = ~in_windows(seen.samples.at_s, seen.explained.causes)
    due, all_ = seen.sum("due", judged), seen.sum("due")
    # a command may come late that was counted in the second before
    gone = max(0.0, seen.sum("gone", judged))
    why = f"{gone:.0f} of {due:.0f}; {seen.sum('gone'):.0f} of {all_:.0f} in all"
    return of_enough(at_most(name, gone if due else None, 0.0, why=why), due / all_ if all_ else 0.0)
