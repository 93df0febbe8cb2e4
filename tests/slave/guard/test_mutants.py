"""Take one protection away, and a story must notice: each gate, watch, condition, limit, transition and more.

The lists are read from the guard itself. A gate, watch, condition, rule or transition that is added without a
story in `scenarios.py` survives here, and that fails.
"""

from __future__ import annotations

import hmac
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import pytest

from slave.encoders import agreement, uncommanded
from slave.guard import (
    admit,
    align,
    body,
    challenge,
    config,
    control,
    elapsed,
    engage,
    guard,
    joints,
    lease,
    limits,
    placed,
    plausible,
    resting,
    states,
    tilt,
    times,
    watchdog,
)
from slave.limit import damper, limit, pace
from slave.track import tracker

from .scenarios import SCENARIOS

Patch = Callable[[pytest.MonkeyPatch], dict[str, Any]]
"""Takes the protection away; returns what to give to the guard instead of its defaults."""


@dataclass(frozen=True)
class Mutant:
    name: str
    patch: Patch


def without(sequence: tuple[Any, ...], one: Any) -> tuple[Any, ...]:
    return tuple(item for item in sequence if item is not one)


def listed() -> Iterator[Mutant]:
    """What stands in the guard's own lists."""
    for gate in admit.GATES:
        yield Mutant(f"gate {gate.name}", partial(lacking, "gates", admit.GATES, gate))
    for option, watches in (
        ("arrival_watches", watchdog.ARRIVAL_WATCHES),
        ("body_watches", watchdog.BODY_WATCHES),
    ):
        for watch in watches:
            yield Mutant(f"watch {watch.name}", partial(lacking, option, watches, watch))
    for condition in engage.CONDITIONS:
        left: object = without(engage.CONDITIONS, condition)
        name = f"condition {condition.__name__}"
        yield Mutant(name, partial(replaced, owner=engage, name="CONDITIONS", by=left))
    for rule in limit.RULES:
        left = without(limit.RULES, rule)
        yield Mutant(f"rule {rule[0]}", partial(replaced, owner=limit, name="RULES", by=left))
    for (before, event), after in states.TRANSITIONS.items():
        if before is not after:  # an e-stop in e-stop changes nothing, listed or not
            yield Mutant(f"({before}, {event})", partial(less, key=(before, event)))


def lacking(option: str, parts: tuple[Any, ...], one: Any, _: pytest.MonkeyPatch) -> dict[str, Any]:
    return {option: without(parts, one)}


def replaced(monkeypatch: pytest.MonkeyPatch, owner: Any, name: str, by: Any) -> dict[str, Any]:
    monkeypatch.setattr(owner, name, by)
    return {}


def less(monkeypatch: pytest.MonkeyPatch, key: Any) -> dict[str, Any]:
    rest = {pair: after for pair, after in states.TRANSITIONS.items() if pair != key}
    return replaced(monkeypatch, states, "TRANSITIONS", rest)


def nothing(*_: Any, **__: Any) -> None:
    """Nothing is amiss."""


def free_for_all(self: lease.Lease, operator: str, now_ns: int) -> int:
    self.operator, self.token = operator, 5000 + len(operator)
    return self.token


FORGET = times.LinkTimes.forget


def begin_only(self: times.LinkTimes) -> None:
    if not hasattr(self, "_sequence"):
        FORGET(self)


def unbounded_s(self: elapsed.StepTime, now_ns: int) -> float:
    before_ns, self._stepped_ns = self._stepped_ns, now_ns
    return 0.0 if before_ns is None else (now_ns - before_ns) * 1e-9


def forgiving(self: guard.Guard, operators: frozenset[str], now_ns: int) -> None:
    self._commands.revoked = operators


PARTS: tuple[tuple[Any, str, Any], ...] = (
    (admit.Situation, "age_ns", lambda *_: 0),
    (times, "GROWS", 100.0),
    (times, "REPEATED", 1),
    (times, "USUAL", 0.99),
    (times.LinkTimes, "forget", begin_only),
    (config.GuardConfig, "age_ceiling_s", 10.0),
    (config.GuardConfig, "timeout_ceiling_s", 10.0),
    (watchdog.EncoderLife, "silence", nothing),
    (tilt, "base_loss", nothing),
    (body.Body, "estop", None),
    (guard.Guard, "still_pressed", nothing),
    (body.Body, "also", lambda self, drives: body.Body({**drives, **self.drives}, self.base)),
    (engage, "holder_only", nothing),
    (control, "holder_only", nothing),
    (control, "revocation", nothing),
    (guard.Guard, "revoke", forgiving),
    (guard.Guard, "offer", lambda self, operator, now_ns: self.lease.offer(operator, now_ns)),
    (control.Control, "_no_successor", nothing),
    (lease.Lease, "lapse_offer", lambda *_: ""),
    (lease.Lease, "withdraw", nothing),
    (hmac, "compare_digest", lambda *_: True),
    (challenge.Challenges, "refusal", nothing),
    (lease.Lease, "lapse", lambda *_: False),
    (lease.Lease, "claim", free_for_all),
    (limit.SetpointLimiter, "stop", nothing),
    (limits.MotionLimits, "reachable", lambda _, position_rad: position_rad),
    (align.AlignProgress, "done", lambda *_: True),
    (align.AlignProgress, "overdue", nothing),
    (
        pace.Pace,
        "tracking",
        lambda self, *_: (self._limits.max_velocity_rad_s, self._limits.max_acceleration_rad_s2),
    ),
    (damper.DistanceDamper, "limit", lambda _, step: step.wish_rad_s),
    (damper.DistanceDamper, "overdue", None),
    (plausible.EncoderPlausibility, "judge", lambda *_: []),
    (plausible.EncoderPlausibility, "_jumps", lambda self, *_: np.zeros(len(self._names), np.bool_)),
    (plausible.EncoderPlausibility, "too_many", nothing),
    (plausible.EncoderPlausibility, "unsettled", nothing),
    (plausible.EncoderPlausibility, "trust", nothing),
    (plausible.Past, "span", lambda self, _: (self._low.min(0) - 9.0, self._high.max(0) + 9.0)),
    (agreement.EncoderAgreement, "judge", nothing),
    (placed.Placement, "unplaced", nothing),
    (uncommanded.UncommandedMotion, "judge", lambda self, *_, **__: np.zeros(len(self._names), np.bool_)),
    (uncommanded.UncommandedMotion, "_for_long", lambda self, *_: np.zeros(len(self._names), np.bool_)),
    (joints.JointReadings, "strayed", nothing),
    (resting.RestingJoints, "rest", nothing),
    (elapsed.StepTime, "elapsed_s", unbounded_s),
    (guard.Guard, "_clutch", nothing),
    (guard.Guard, "_believed", lambda self: np.ones_like(self._commands.valid)),
    (tracker.TrackTarget, "finite", True),
)
"""What stands in no list: owner, its attribute, and what it does once it is taken away."""


def parts() -> Iterator[Mutant]:
    for owner, name, by in PARTS:
        yield Mutant(
            f"{owner.__name__.rpartition('.')[2]}.{name}",
            partial(replaced, owner=owner, name=name, by=by),
        )


MUTANTS = [*listed(), *parts()]


def notices(mutant: Mutant, make_rig: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> str | None:
    """The first story that fails on it; the one named after it is told first."""
    options = mutant.patch(monkeypatch)

    def make(config: Any = None) -> Any:
        return make_rig(config, **options)

    for name in sorted(SCENARIOS, key=lambda name: name != mutant.name):
        try:
            with np.errstate(all="ignore"):
                SCENARIOS[name](make)
        except Exception:
            return name
    return None


LONG = {"GuardConfig.timeout_ceiling_s"}
"""Stories of more than 3 s: the link must become slower and slower."""


def marked(value: Mutant | str, name: str) -> object:
    return pytest.param(value, id=name, marks=[pytest.mark.long] * (name in LONG))


@pytest.mark.parametrize("mutant", [marked(m, m.name) for m in MUTANTS])
def test_a_guard_that_lacks_it_is_noticed(
    mutant: Mutant, make_rig: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    noticed = notices(mutant, make_rig, monkeypatch)
    assert noticed is not None, f"no story in scenarios.py notices that the guard lacks: {mutant.name}"
    assert noticed == mutant.name, "the story named after it should be the one"


@pytest.mark.parametrize("name", [marked(name, name) for name in SCENARIOS])
def test_the_guard_as_it_is_passes_every_story(name: str, make_rig: Callable[..., Any]) -> None:
    SCENARIOS[name](make_rig)


@pytest.mark.timeout(300)  # every story in one test
@pytest.mark.long
def test_a_new_gate_without_a_story_would_survive(
    make_rig: Callable[..., Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    gates = (*admit.GATES, admit.Gate("new", "it is new", lambda *_: None))
    useless = Mutant("gate new", lambda _: {"gates": without(gates, gates[-1])})
    assert notices(useless, make_rig, monkeypatch) is None
