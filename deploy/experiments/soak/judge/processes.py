"""The loops keep their ticks, the processes live and end in order, the recorder loses little. Pure."""

from __future__ import annotations

import numpy as np

from deploy.experiments.soak.files.events import of_kind
from deploy.experiments.soak.files.happenings import ProcessEnded, RecordingChecked, SoakEnded
from deploy.experiments.soak.judge.evidence import SoakEvidence
from deploy.experiments.soak.judge.robot import slowest
from deploy.measure.verdict import Verdict, at_most

MISSED_SHARE = 0.1
"""Percent of the ticks."""
RECORDER_LOSES_S = 1.0


def loops(seen: SoakEvidence) -> list[Verdict]:
    """Ticks missed and links lost while neither a fault nor the host explains them; processes that ended."""
    quiet = seen.quiet & ~(np.nan_to_num(seen.samples["host_still_ms"]) > 0.0)
    verdicts = []
    for name in ("master", "slave"):
        ticks, missed = seen.sum(f"{name}_ticks", quiet), seen.known_sum(f"{name}_missed", quiet)
        percent, why = None, "not published"
        if missed is not None and ticks:
            percent = 100.0 * missed / ticks
            why = f"{missed:.0f} of {ticks:.0f}; {seen.sum(f'{name}_missed'):.0f} in all"
        verdicts.append(at_most(f"ticks the {name} missed, unexplained", percent, MISSED_SHARE, "%", why=why))
    lost = seen.known_sum("times_lost", seen.quiet)
    in_all = f"{seen.sum('times_lost'):.0f} in all"
    ends = of_kind(seen.events, ProcessEnded)
    words = "; ".join(f"{e.what.process}: {e.what.words}" for e in ends[:2])
    return [
        *verdicts,
        at_most("times the master lost the robot, unexplained", lost, 0.0, why=in_all),
        at_most("processes that ended by themselves", float(len(ends)), 0.0, why=words),
    ]


def ending(seen: SoakEvidence) -> list[Verdict]:
    """It did what it was to do, and every process ended when it was asked to."""
    ends = [e.what for e in of_kind(seen.events, SoakEnded)]
    if not ends:
        return [at_most("ended by an error", None, 0.0, why="it was killed")]
    unclean = {name: status for name, status in ends[-1].status.items() if status not in (0, None)}
    words = ", ".join(f"{name}: {status}" for name, status in unclean.items())
    return [
        at_most("ended by an error", float(ends[-1].error), 0.0, why=ends[-1].how),
        at_most("processes with a bad exit status", float(len(unclean)), 0.0, why=words),
    ]


def recordings(seen: SoakEvidence) -> list[Verdict]:
    """What the recorder's files hold after it was killed, and after its disk was full."""
    found = [e.what for e in of_kind(seen.events, RecordingChecked)]
    if not found:
        return []
    unreadable = [what for what in found if not what.readable]
    why = f"of {len(found)}" + "".join(f"; {what.why_not}" for what in unreadable[:1])
    verdicts = [at_most("recordings that cannot be read", float(len(unreadable)), 0.0, why=why)]
    killed = [("recorder-kill", what.lost_s) for what in found if what.after == "kill"]
    if killed:
        verdicts.append(slowest("lost by a kill", killed, RECORDER_LOSES_S))
    full = [what for what in found if what.after == "disk full"]
    if full:
        wrong = [what for what in full if not what.lived or what.said != 1]
        name = "full disks that ended it or were not logged once"
        verdicts.append(at_most(name, float(len(wrong)), 0.0, why=f"of {len(full)}"))
    return verdicts
