"""What the robot did in the scripted outage and after it. Pure."""

from __future__ import annotations

from collections.abc import Mapping

from common.clock import NS_PER_MS, NS_PER_S, to_ns
from common.metrics.slave import SlaveMetrics
from common.wire.messages import CommandEcho
from deploy.experiments.trial.cell.recording import (
    CellMessages,
    ScriptedOutage,
    counts,
    echoes,
    oldest_allowed_s,
    published,
)

MOVING = ("align", "track")
LEFT_S = 0.5
"""A robot that still moves this long after the cut has not noticed it: its time-out is 0.2 s."""

PUBLISHES_NS = 20 * NS_PER_MS
"""The slave counts for its statistics at most so long after their time stamp."""


def aftermath(after: CellMessages, outage: ScriptedOutage, max_age_s: float) -> dict[str, float | None]:
    """The outage's figures; `after` holds the messages from the cut on. None: not known."""
    states, max_age_s = after.states, oldest_allowed_s(after, max_age_s)
    accepted = {n: e for n, e in echoes(states).items() if e.accepted_ns > outage.back_ns}
    until_ns = outage.act_ns if outage.act_ns is not None else max((s.sent_ns for s in states), default=0)
    noticed_ns = outage.cut_ns + to_ns(LEFT_S)
    alone = any(s.guard in MOVING for s in states if noticed_ns < s.sent_ns < until_ns)
    act_ns = outage.act_ns
    tracks_ns = [s.sent_ns for s in states if s.guard == "track"]
    again_ns = [at_ns for at_ns in tracks_ns if act_ns is not None and at_ns > act_ns]
    # a robot that held before the cut did not hold for it
    moved = bool(states) and states[0].guard in MOVING
    held_ns = next((s.sent_ns for s in states if moved and s.guard == "hold"), None)
    flow_ns = min((e.accepted_ns for e in accepted.values()), default=None)
    counted = len(published(after.statistics, SlaveMetrics)) > 1
    return {
        "held_s": None if held_ns is None else (held_ns - outage.cut_ns) / NS_PER_S,
        "flow_s": None if flow_ns is None else (flow_ns - outage.back_ns) / NS_PER_S,
        "stale_accepted": _stale_accepted(after, outage, max_age_s, accepted) if counted and states else None,
        "stale_refused": float(counts(after).get("dropped", {}).get("age", 0)) if counted else None,
        "moved_alone": float(alone) if states else None,
        "ready_s": None if outage.ready_ns is None else (outage.ready_ns - outage.back_ns) / NS_PER_S,
        "track_again_s": (again_ns[0] - act_ns) / NS_PER_S if again_ns and act_ns is not None else None,
    }


def _stale_accepted(
    after: CellMessages, outage: ScriptedOutage, max_age_s: float, accepted: Mapping[int, CommandEcho]
) -> float | None:
    """None where a command was accepted that the recording does not hold: its age is not known."""
    sampled_ns = {c.sequence: c.stamps.sampled_ns for c in after.commands}
    if not accepted.keys() <= sampled_ns.keys():
        return None
    seen = sum(e.accepted_ns - sampled_ns[n] > to_ns(max_age_s) for n, e in accepted.items())
    return float(seen + _stale_unseen(after, outage, max_age_s))


def _stale_unseen(after: CellMessages, outage: ScriptedOutage, max_age_s: float) -> int:
    """How many commands without an echo were accepted stale, at the least.

    Of a burst between two states only the last is echoed. The slave's counter shows that there were others,
    but not which: they count as the freshest that are possible, accepted as early as possible.
    """
    unseen = _accepted_unseen(after)
    sampled_ns = {c.sequence: c.stamps.sampled_ns for c in after.commands}
    newest, before_ns = min(sampled_ns, default=0) - 1, outage.back_ns
    youngest_ns: list[int] = []
    for state in sorted(after.states, key=lambda s: s.sent_ns):
        if state.echo is not None:
            if state.echo.accepted_ns > outage.back_ns:
                between = range(newest + 1, state.echo.sequence)
                youngest_ns += [before_ns - sampled_ns[n] for n in between if n in sampled_ns]
            newest = state.echo.sequence
        before_ns = max(state.sent_ns, outage.back_ns)
    return sum(age_ns > to_ns(max_age_s) for age_ns in sorted(youngest_ns)[:unseen])


def _accepted_unseen(after: CellMessages) -> int:
    """Accepted by the slave's counter and echoed by no state, between its first and last statistics."""
    counted = [(s.sent_ns, s.metrics.guard.accepted) for s in published(after.statistics, SlaveMetrics)]
    if len(counted) < 2:
        return 0
    (from_ns, before), (until_ns, accepted) = counted[0], counted[-1]
    found = echoes(after.states).values()
    seen = sum(from_ns < e.accepted_ns <= until_ns + PUBLISHES_NS for e in found)
    return max(0, accepted - before - seen)
