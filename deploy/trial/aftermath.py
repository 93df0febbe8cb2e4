"""What became of the robot in the scripted outage and after it. Pure."""

from __future__ import annotations

from common.clock import NS_PER_S, to_ns
from deploy.trial.recording import Outage, Recording, counts, echoes

MOVING = ("align", "track")
LEFT_S = 0.5
"""After the cut for longer than this, a robot that still moves has not noticed: its time-out is 0.2 s."""


def aftermath(after: Recording, outage: Outage, max_age_s: float) -> dict[str, float | None]:
    """The outage's figures; `after` is what was heard from the cut on."""
    states = after.states
    sampled_ns = {c.sequence: c.stamps.sampled_ns for c in after.commands}
    accepted = {n: e for n, e in echoes(states).items() if e.accepted_ns > outage.back_ns}
    stale = sum(
        e.accepted_ns - sampled_ns[n] > to_ns(max_age_s) for n, e in accepted.items() if n in sampled_ns
    )
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
    refused = counts(after).get("dropped", {})
    return {
        "held_s": None if held_ns is None else (held_ns - outage.cut_ns) / NS_PER_S,
        "flow_s": None if flow_ns is None else (flow_ns - outage.back_ns) / NS_PER_S,
        "stale_accepted": float(stale),
        "stale_refused": float(refused.get("age", 0)),
        "moved_alone": float(alone),
        "ready_s": None if outage.ready_ns is None else (outage.ready_ns - outage.back_ns) / NS_PER_S,
        "track_again_s": (again_ns[0] - act_ns) / NS_PER_S if again_ns and act_ns is not None else None,
    }
