"""What a soak is judged by: each function takes what was seen and gives its verdicts. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from common.quaternion import Array
from common.wire.messages import Mask
from deploy.experiments.soak.events import Event, of_kind
from deploy.experiments.soak.explain import LOST_PACKETS, Explained, unexplained_lefts
from deploy.experiments.soak.samples import Samples
from deploy.experiments.soak.windows import explained as in_windows
from deploy.measure.verdict import Status, Verdict, at_most, of_enough, of_most

HOLD_S = 0.2 + 0.08
"""The guard's time-out for commands, two states of 20 ms, and 40 ms for who watches."""
STANDS_S = 0.21 + 0.3 + 0.04
"""As in the fault matrix, from the last state before the fault."""
STRAYS_DEG = 0.9
"""Above what a robot that stands is shaken by; see deploy/experiments/soak/motion.py."""
AGE_MS = 300.0
"""`guard.max_age_s`, where no network needs a longer one: an accepted command is younger."""
MISSED_SHARE = 0.1
"""Percent of the ticks."""
TRACK_S = 15.0
"""`guard.align_timeout_s`."""
MOVES_WITHIN_S, ANSWERED_WITHIN_S = 2.0, 1.0
"""A robot that is engaged is seen to move so soon; and so late, after it is seen to, comes its answer."""
DATAGRAMS = frozenset(LOST_PACKETS)
RECORDER_LOSES_S = 1.0
COUNTED = {"lost": "lost", "late": "out of order", "repeated": "twice", "refused": "refused by the guard"}
"""Columns of what may befall a command, and in words."""


@dataclass(frozen=True, slots=True)
class Seen:
    """All that a soak left behind."""

    events: Sequence[Event]
    samples: Samples
    explained: Explained

    @property
    def quiet(self) -> Mask:
        """(N,) samples that no fault, start or stall of the host explains."""
        return ~in_windows(self.samples.at_s, self.explained.all)

    @property
    def network_alone(self) -> Mask:
        """(N,) samples that the network explains, and neither fault, start nor stall."""
        at_s, found = self.samples.at_s, self.explained
        return in_windows(at_s, found.network) & ~in_windows(at_s, (*found.faults, *found.stalls))

    def sum(self, column: str, of: Mask | None = None) -> float:
        """A counter's additions over all samples, or some."""
        values = self.samples[column]
        return float(np.nansum(values if of is None else values[of]))

    def told(self, column: str, of: Mask | None = None) -> float | None:
        """The same; None where no sample holds it: what nobody told is no zero."""
        values = self.samples[column]
        return None if np.isnan(values).all() else self.sum(column, of)

    @property
    def recovered(self) -> list[Mapping[str, Any]]:
        """What is told of each fault once it is over."""
        return [e.what for e in of_kind(self.events, "recovered") if e.what.get("fault")]

    def own(self, faults: Sequence[Mapping[str, Any]], key: str) -> list[Mapping[str, Any]]:
        """The faults with a time that began with them, or the master's sight of them, less stalls."""
        own: list[Mapping[str, Any]] = []
        for what in faults:
            took_s, begun_s = what.get(key), what["begun_s"]
            if took_s is not None:
                still_s = self.explained.still_s(begun_s, begun_s + took_s)
                took_s = round(took_s - still_s - what.get("notices_s", 0.0), 3)
            own.append({**what, key: took_s})
        return own

    @property
    def options(self) -> Mapping[str, Any]:
        """What the soak was asked for; empty where it did not begin."""
        begun = of_kind(self.events, "begin")
        return begun[0].what if begun else {}

    @property
    def network(self) -> Mapping[str, Any]:
        """What the network between two hosts does by its nature; empty where there is none."""
        found: Mapping[str, Any] = self.options.get("network") or {}
        return found


def commands(seen: Seen) -> list[Verdict]:
    """Lost, late, twice, refused; each outside of the windows that explain it, and none acted on too late."""
    all_ = seen.sum("sent")
    verdicts = []
    for column, name in COUNTED.items():
        # a lost datagram is one command, and the network tells how many it lost
        counted = column == "lost" and seen.options.get("transport") in DATAGRAMS
        judged = seen.quiet | (seen.network_alone if counted else False)
        sent = seen.sum("sent", judged)
        figure = seen.told(column, seen.quiet)
        if figure is not None and counted:
            figure += beyond_the_network(seen)
        note = f"{seen.sum(column):.0f} in all; {sent:.0f} of {all_:.0f} were sent outside of what explains"
        if column == "lost":
            note += f"; {seen.sum('overwritten'):.0f} waited too long in the slave itself"
        verdict = at_most("commands", f"{name}, unexplained", figure if sent else None, 0.0, note=note)
        verdicts.append(of_enough(verdict, sent / all_ if all_ else 0.0))
    ages = seen.samples["age_max_ms"]
    oldest = None if np.isnan(ages).all() else float(np.nanmax(ages))
    most_ms = 1e3 * seen.network.get("max_age_s", AGE_MS / 1e3)
    aged = at_most("commands", "oldest that was acted on", oldest, most_ms, "ms", "put → accepted")
    verdicts.append(of_most(aged, _known_share(ages, seen.quiet & (seen.samples["sent"] > 0.0))))
    return [_any_came(seen), *verdicts, _came_when_due(seen)]


def _known_share(values: Array, asked: Mask) -> float:
    """Of the samples (N,) asked for, those that hold a figure; 1 where none was asked for."""
    return float(np.isfinite(values[asked]).mean()) if asked.any() else 1.0


def _any_came(seen: Seen) -> Verdict:
    """Without a single command all else here is true of nothing."""
    sent, arrived = seen.sum("sent"), seen.sum("arrived")
    note = f"the master sent {sent:.0f}, the robot took {arrived:.0f}"
    none = float(sent == 0.0) + float(arrived == 0.0)
    return at_most("commands", "sides that saw none at all", none, 0.0, note=note)


def _came_when_due(seen: Seen) -> Verdict:
    """By time, not by number: where both sides stand still together nothing is sent and nothing is lost."""
    name = "due and never came, unexplained"
    if np.isnan(seen.samples["due"]).all():
        return at_most("commands", name, None, 0.0, note="the robot did not tell what was due")
    # what was due and did not come is why a robot leaves off, so that it did explains nothing here
    judged = ~in_windows(seen.samples.at_s, seen.explained.causes)
    due, all_ = seen.sum("due", judged), seen.sum("due")
    # within a second one may come late that was counted in the second before
    gone = max(0.0, seen.sum("gone", judged))
    note = f"{gone:.0f} of {due:.0f}; {seen.sum('gone'):.0f} of {all_:.0f} in all"
    return of_enough(
        at_most("commands", name, gone if due else None, 0.0, note=note), due / all_ if all_ else 0.0
    )


def beyond_the_network(seen: Seen) -> float:
    """Commands lost in each stretch of lossy seconds beyond its lost packets, but for faults and stalls."""
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


def guard(seen: Seen) -> list[Verdict]:
    """It holds on every fault that asks for it, stands, and never moves by itself."""
    done = seen.recovered
    must = [what for what in done if what["holds"] and what["heard"]]
    held, stood = seen.own(must, "held_s"), seen.own(must, "stands_s")
    idle = [
        what
        for what in done
        if not what["holds"]
        and what.get("held_s") is not None
        and not seen.explained.accounts_for_hold(what["begun_s"] + what["held_s"])
    ]
    lefts = unexplained_lefts(seen.events, seen.explained)
    engaged_s = [e.at_s for e in of_kind(seen.events, "engage") if e.what.get("done")]
    moved_s = [
        e.at_s
        for e in of_kind(seen.events, "guard")
        if e.what.get("to") in ("align", "track") and e.what.get("from") not in ("align", "track")
    ]
    strayed = seen.samples["strayed_deg"]
    way_s = seen.network.get("way_s", 0.0)
    return [
        _worst("guard", "holds on a fault, the slowest", held, "held_s", HOLD_S + way_s, "s"),
        _worst("guard", "stands after a fault, the slowest", stood, "stands_s", STANDS_S + way_s, "s"),
        of_enough(
            at_most("guard", "holds that nothing explains", float(len(lefts)), 0.0, note=_reasons(lefts)),
            _share(~seen.explained.accounted(seen.samples.at_s)),
        ),
        at_most(
            "guard", "holds on a fault that asks for none", float(len(idle)), 0.0,
            note=", ".join(sorted({what["fault"] for what in idle})),
        ),
        at_most(
            "guard", "began to move without being engaged", float(_unasked(moved_s, engaged_s)), 0.0,
            note=f"engaged {len(engaged_s)} times, began to move {len(moved_s)} times",
        ),
        at_most(
            "guard", "moved while it held",
            None if np.isnan(strayed).all() else float(np.nanmax(strayed)), STRAYS_DEG, "°",
            "farthest joint, 0.7 s after it held and later",
        ),
    ]  # fmt: skip


def recovery(seen: Seen) -> list[Verdict]:
    """How soon commands flow and the robot follows again, after each kind of fault."""
    done = seen.recovered
    begun = len(of_kind(seen.events, "fault"))
    lost = [what for what in done if not what["done"]]
    failed = [f"{what['fault']}: {what['failed']}" for what in done if what.get("failed")]
    unfinished = begun - len(done) and " (one under way when the soak ended)"
    verdicts = [
        at_most(
            "recovery", "faults after which it did not follow again", float(len(lost)) if done else None, 0.0,
            note=f"of {len(done)}{unfinished or ''}" if begun else "there was no fault",
        ),
        at_most(
            "recovery", "faults that could not be brought about", float(len(failed)), 0.0,
            note="; ".join(failed[:3]),
        ),
    ]  # fmt: skip
    limits = {what["fault"]: what["flow_limit_s"] for what in done if what["flow_limit_s"] is not None}
    for fault, limit in sorted(limits.items()):
        like = [what for what in done if what["fault"] == fault]
        verdicts.append(_worst("recovery", f"commands flow again after {fault}", like, "flow_s", limit, "s"))
    again = [what for what in done if what.get("track_s") is not None]
    verdicts.append(_worst("recovery", "follows again once engaged", again, "track_s", TRACK_S, "s"))
    return verdicts


def loops(seen: Seen) -> list[Verdict]:
    """Ticks that were missed while neither a fault nor the host can be blamed; links lost likewise."""
    quiet = seen.quiet & ~(np.nan_to_num(seen.samples["host_still_ms"]) > 0.0)
    verdicts = []
    for name in ("master", "slave"):
        ticks, missed = seen.sum(f"{name}_ticks", quiet), seen.told(f"{name}_missed", quiet)
        share, note = None, "nobody told"
        if missed is not None and ticks:
            share = 100.0 * missed / ticks
            note = f"{missed:.0f} of {ticks:.0f}; {seen.sum(f'{name}_missed'):.0f} in all"
        what = f"ticks the {name} missed, unexplained"
        verdicts.append(at_most("loops", what, share, MISSED_SHARE, "%", note))
    lost = seen.told("times_lost", seen.quiet)
    verdicts.append(
        at_most(
            "loops",
            "times the master lost the robot, unexplained",
            lost,
            0.0,
            note=f"{seen.sum('times_lost'):.0f} in all",
        )
    )
    ends = of_kind(seen.events, "ended")
    words = "; ".join(f"{e.what['process']}: {e.what['words']}" for e in ends[:2])
    verdicts.append(at_most("loops", "processes that ended by themselves", float(len(ends)), 0.0, note=words))
    return verdicts


def _share(of: Mask) -> float:
    return float(np.mean(of)) if len(of) else 1.0


def ending(seen: Seen) -> list[Verdict]:
    """It did what it was to do, and every process ended when it was asked to."""
    ends = [e.what for e in of_kind(seen.events, "end")]
    if not ends:
        return [Verdict("soak", "ended by an error", Status.NOT_JUDGED, None, 0.0, note="it was killed")]
    unclean = {name: status for name, status in ends[-1]["status"].items() if status not in (0, None)}
    words = ", ".join(f"{name}: {status}" for name, status in unclean.items())
    note = ends[-1]["how"]
    return [
        at_most("soak", "ended by an error", float(ends[-1]["error"]), 0.0, note=note),
        at_most("soak", "processes that did not end in order", float(len(unclean)), 0.0, note=words),
    ]


def recordings(seen: Seen) -> list[Verdict]:
    """What the recorder's files hold after it was killed, and after its disk was full."""
    told = [e.what for e in of_kind(seen.events, "recording")]
    killed = [what for what in told if what["after"] == "kill"]
    full = [what for what in told if what["after"] == "disk full"]
    if not told:
        return []
    unreadable = [what for what in told if not what["readable"]]
    verdicts = [
        at_most(
            "recorder", "recordings that cannot be read", float(len(unreadable)), 0.0,
            note=f"of {len(told)}" + "".join(f"; {what['why_not']}" for what in unreadable[:1]),
        )
    ]  # fmt: skip
    if killed:
        verdicts.append(
            _worst("recorder", "lost when it was killed", killed, "lost_s", RECORDER_LOSES_S, "s")
        )
    if full:
        wrong = [what for what in full if not what["lived"] or what["said"] != 1]
        verdicts.append(
            at_most(
                "recorder", "full disks that it did not live through, saying so once", float(len(wrong)), 0.0,
                note=f"of {len(full)}",
            )
        )  # fmt: skip
    return verdicts


def _worst(
    group: str, name: str, done: Sequence[Mapping[str, Any]], key: str, limit: float, unit: str
) -> Verdict:
    """The largest figure. One that is missing fails: what should have come did not."""
    if not done:
        return Verdict(group, name, Status.NOT_JUDGED, None, limit, unit, "no such fault")
    missing = [what["fault"] for what in done if what.get(key) is None and "fault" in what]
    if missing:
        return Verdict(group, name, Status.FAIL, None, limit, unit, f"never after: {', '.join(missing)}")
    worst = max(done, key=lambda what: what[key])
    values = sorted(what[key] for what in done)
    note = f"of {len(done)}, median {values[len(values) // 2]:.3g}"
    if "fault" in worst:
        note += f"; {worst['fault']}"
    return at_most(group, name, float(worst[key]), limit, unit, note)


def _unasked(moved_s: Sequence[float], engaged_s: Sequence[float]) -> int:
    """Moves without an engagement of their own. One that led to none serves for no later move."""
    left, unasked = list(engaged_s), 0
    for at_s in moved_s:
        own = next((t for t in left if at_s - MOVES_WITHIN_S <= t <= at_s + ANSWERED_WITHIN_S), None)
        if own is None:
            unasked += 1
        else:
            left.remove(own)
    return unasked


def _reasons(lefts: Sequence[Event]) -> str:
    return "; ".join(f"{e.at_s:.0f} s: {e.what.get('guard')}: {e.what.get('reason')}" for e in lefts[:3])


CRITERIA: Sequence[Callable[[Seen], list[Verdict]]] = (ending, commands, guard, recovery, loops, recordings)
"""In the order of the report; growth and drift are in deploy/experiments/soak/growth.py."""
