"""A soak that never was: rows and events made up, to be judged."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

from common.quaternion import Array
from deploy.experiments.soak.files.events import AnyEvent, SoakEvent
from deploy.experiments.soak.files.happenings import happening
from deploy.experiments.soak.files.samples import Samples, header
from deploy.experiments.soak.judge.evidence import SoakEvidence


def happened(at_s: float, kind: str, what: Mapping[str, Any] | None = None) -> AnyEvent:
    """As it is read from a line of the file."""
    return SoakEvent(at_s, happening(kind, what or {}))


PROCESSES = ["master", "slave", "recorder", "soak"]
Make = Callable[..., SoakEvidence]

FAULT = {
    "fault": "master-kill", "number": 0, "holds": True, "heard": True, "begun_s": 100.0, "flow_limit_s": 15.0,
}  # fmt: skip
RECOVERED = {
    **FAULT, "held_s": 0.22, "stands_s": 0.4, "done": True, "flow_s": 4.0, "ready_s": 4.1, "track_s": 3.0,
    "engaged": 1,
}  # fmt: skip
STORY = (
    happened(0.0, "begin", {"transport": "tcp", "seed": 1, "left_out": {}}),
    happened(3.0, "guard", {"from": "", "to": "hold"}),
    happened(4.0, "engage", {"done": True}),
    happened(4.1, "guard", {"from": "hold", "to": "align"}),
    happened(5.0, "guard", {"from": "align", "to": "track"}),
    happened(5.0, "follows", {}),
    happened(100.0, "fault", FAULT),
    happened(100.2, "guard", {"from": "track", "to": "hold"}),
    happened(106.0, "engage", {"done": True}),
    happened(106.1, "guard", {"from": "hold", "to": "align"}),
    happened(109.0, "recovered", RECOVERED),
)
"""One start, one fault, nothing wrong."""


@pytest.fixture
def make() -> Make:
    """Makes a soak of so many seconds; columns given are functions of time, or values."""

    def made(seconds: int = 600, events: tuple[AnyEvent, ...] = STORY, **columns: Any) -> SoakEvidence:
        at_s = np.arange(1.0, seconds + 1.0)
        table: dict[str, Array] = {
            name: np.full(seconds, np.nan) for name in header(PROCESSES) if name != "guard"
        }
        table["at_s"] = at_s
        usual = {
            "sent": 12.5,
            "arrived": 12.5,
            "due": 12.5,
            "gone": 0.0,
            "master_ticks": 200.0,
            "slave_ticks": 200.0,
            "one_way_p50_ms": 0.5,
        }
        told = ("lost", "late", "repeated", "refused", "times_lost", "master_missed", "slave_missed")
        usual |= dict.fromkeys(told, 0.0)
        usual |= {f"{name}_life": 1.0 for name in PROCESSES}
        usual |= {f"{name}_{what}": 20.0 for name in PROCESSES for what in ("rss_mb", "fds", "threads")}
        usual |= {f"{name}_in_use_mb": 20.0 for name in ("master", "slave")}
        usual |= {f"{name}_blocks": 3e5 for name in ("master", "slave")}
        for name, value in {**usual, **columns}.items():
            table[name] = np.broadcast_to(value(at_s) if callable(value) else value, seconds).astype(float)
        samples = Samples(table)
        return SoakEvidence.of(events, samples)

    return made
