"""The robot holds on a fault, stands, never moves without an engage, and follows again after it. Pure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from deploy.experiments.soak.files.events import SoakEvent, of_kind
from deploy.experiments.soak.files.happenings import (
    BlindWayMeasured,
    EngageAnswered,
    FaultBegun,
    FaultCourse,
    GuardChanged,
    RobotLeft,
)
from deploy.experiments.soak.judge.evidence import SoakEvidence, of_enough
from deploy.experiments.soak.judge.explain import unexplained_lefts
from deploy.measure.blind import LEAST_M
from deploy.measure.verdict import Outcome, Verdict, at_most

HOLD_S = 0.2 + 0.08
"""The guard's time-out for commands, two states of 20 ms, and 40 ms for the observer."""
STANDS_S = 0.21 + 0.3 + 0.04
"""As in the fault matrix, from the last state before the fault."""
STRAYS_DEG = 0.9
"""More than a standing robot is shaken by; see deploy/experiments/soak/motion.py."""
TRACK_S = 15.0
"""`guard.align_timeout_s`."""
MOVES_WITHIN_S, ANSWERED_WITHIN_S = 2.0, 1.0
"""An engaged robot is seen to move so soon; and so late after that comes the answer to its engagement."""
LEAST_CM = 100.0 * LEAST_M
MOVING = ("align", "track")


def guard(seen: SoakEvidence) -> list[Verdict]:
    """It holds on every fault that asks for it, stands, and never moves by itself."""
    must_hold = [what for what in seen.recovered if what.holds and what.heard]
    way_s = seen.network.way_s
    held = [(f.fault, _less_stalls(seen, f, f.held_s)) for f in must_hold]
    stood = [(f.fault, _less_stalls(seen, f, f.stands_s)) for f in must_hold]
    holds = unexplained_lefts(seen.events, seen.explained)
    explained_share = np.mean(seen.explained.accounted(seen.samples.at_s)) if len(seen.samples) else 0.0
    strayed = seen.samples["strayed_deg"]
    farthest = None if np.isnan(strayed).all() else float(np.nanmax(strayed))
    stray_why = "farthest joint, 0.7 s after it held and later"
    return [
        slowest("slowest hold after a fault", held, HOLD_S + way_s),
        slowest("slowest standstill after a fault", stood, STANDS_S + way_s),
        of_enough(
            at_most("unexplained holds", float(len(holds)), 0.0, why=_reasons(holds)),
            1.0 - float(explained_share),
        ),
        _needless_holds(seen),
        _moves_without_engage(seen),
        _blind(seen),
        at_most("moved while it held", farthest, STRAYS_DEG, "°", why=stray_why),
    ]


def _blind(seen: SoakEvidence) -> Verdict:
    """No hand went farther without commands than the robot had foretold."""
    found = [event.what for event in of_kind(seen.events, BlindWayMeasured)]
    excess = max((one.measured_cm - one.foretold_cm for one in found), default=None)
    shares = [one.measured_cm / one.foretold_cm for one in found if one.foretold_cm >= LEAST_CM]
    why = f"hands in outages: {len(found)}"
    if shares:
        low, middle, high = np.percentile(shares, (5, 50, 100)).tolist()
        why += f"; measured over foretold {low:.2f}, {middle:.2f}, {high:.2f} (5 %, median, most)"
    if excess is None:
        return Verdict("hands beyond what was foretold", Outcome.NOT_JUDGED, limit=0.0, unit="cm", why=why)
    return at_most("hands beyond what was foretold", max(excess, 0.0), 0.0, "cm", why=why)


def _needless_holds(seen: SoakEvidence) -> Verdict:
    needless = [
        what.fault
        for what in seen.recovered
        if not what.holds
        and what.held_s is not None
        and not seen.explained.accounts_for_hold(what.begun_s + what.held_s)
    ]
    why = ", ".join(sorted(set(needless)))
    return at_most("holds on a fault that requires none", float(len(needless)), 0.0, why=why)


def _moves_without_engage(seen: SoakEvidence) -> Verdict:
    """Moves without an engagement of their own. An engagement that led to none serves for no later move."""
    engaged_s = [e.at_s for e in of_kind(seen.events, EngageAnswered) if e.what.done]
    moved_s = [
        e.at_s
        for e in of_kind(seen.events, GuardChanged)
        if e.what.to in MOVING and e.what.from_ not in MOVING
    ]
    why = f"engaged {len(engaged_s)} times, began to move {len(moved_s)} times"
    unengaged = 0
    for at_s in moved_s:
        own = next((t for t in engaged_s if at_s - MOVES_WITHIN_S <= t <= at_s + ANSWERED_WITHIN_S), None)
        if own is None:
            unengaged += 1
        else:
            engaged_s.remove(own)
    return at_most("moves without being engaged", float(unengaged), 0.0, why=why)


def recovery(seen: SoakEvidence) -> list[Verdict]:
    """How soon commands flow and the robot follows again, after each kind of fault."""
    done = seen.recovered
    begun = len(of_kind(seen.events, FaultBegun))
    lost = [what for what in done if not what.done]
    failed = [f"{what.fault}: {what.failed}" for what in done if what.failed]
    under_way = " (one under way when the soak ended)" if begun > len(done) else ""
    verdicts = [
        at_most(
            "faults without recovery",
            float(len(lost)) if done else None,
            0.0,
            why=f"of {len(done)}{under_way}" if begun else "there was no fault",
        ),
        at_most("faults that could not be brought about", float(len(failed)), 0.0, why="; ".join(failed[:3])),
    ]
    limits = {what.fault: what.flow_limit_s for what in done if what.flow_limit_s is not None}
    for fault, limit_s in sorted(limits.items()):
        like = [(fault, what.flow_s) for what in done if what.fault == fault]
        verdicts.append(slowest(f"commands flow again after {fault}", like, limit_s))
    again = [(what.fault, what.track_s) for what in done if what.track_s is not None]
    return [*verdicts, slowest("slowest return to track once engaged", again, TRACK_S)]


def _less_stalls(seen: SoakEvidence, fault: FaultCourse, took_s: float | None) -> float | None:
    """A time from when the master can see the fault, without the host's stalls in it."""
    if took_s is None:
        return None
    still_s = seen.explained.still_s(fault.begun_s, fault.begun_s + took_s)
    return round(took_s - still_s - fault.notices_s, 3)


def slowest(name: str, times: Sequence[tuple[str, float | None]], limit_s: float) -> Verdict:
    """The longest time, s, of some faults by name. A missing one fails: what should have come did not."""
    if not times:
        return Verdict(name, Outcome.NOT_JUDGED, limit=limit_s, unit="s", why="no such fault")
    missing = [fault for fault, took_s in times if took_s is None]
    if missing:
        why = f"never after: {', '.join(missing)}"
        return Verdict(name, Outcome.FAILED, limit=limit_s, unit="s", why=why)
    took = sorted((took_s, fault) for fault, took_s in times if took_s is not None)
    longest_s, fault = took[-1]
    why = f"of {len(took)}, median {took[len(took) // 2][0]:.3g}; {fault}"
    return at_most(name, longest_s, limit_s, "s", why=why)


def _reasons(lefts: Sequence[SoakEvent[RobotLeft]]) -> str:
    return "; ".join(f"{e.at_s:.0f} s: {e.what.guard}: {e.what.reason}" for e in lefts[:3])
