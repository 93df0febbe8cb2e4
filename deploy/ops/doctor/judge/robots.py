"""Whether a robot is reached, fast enough for its guard, and runs the same software. Pure."""

from __future__ import annotations

from statistics import median

from common.metrics.parts import Software
from deploy.ops.doctor.judge.finding import Finding, fail, ok, warn
from deploy.ops.doctor.read.robots import RobotFacts
from slave.guard.config import GuardConfig

OLDEST_MS = 1000.0 * GuardConfig().max_age_s
"""Up to this age a guard as it is shipped takes every command."""
CEILING_MS = 1000.0 * GuardConfig().max_age_ceiling_s
"""The most that it allows over a long line."""
_NAMESAKES = "robots have the name"
_SCHEMA = "schema version"
"""In the words of the codec, where the two sides' messages differ."""


def judge_robot(facts: RobotFacts, ours: Software) -> list[Finding]:
    """Reached, time, clock, versions; only the first where it did not answer."""
    name = facts.name
    if not facts.guard:
        if _SCHEMA in facts.text:
            return [fail(f"{name}: versions", facts.text, "install the same tandem on both hosts")]
        if _NAMESAKES in facts.text:
            return [fail(f"{name}: names", facts.text, "until then neither can be engaged")]
        return [fail(name, facts.text, "on its host: `tandem doctor` with its own file, and its log")]
    reached = ok(name, f"answers: {facts.guard}: {facts.text}")
    return [reached, _time(facts), *_times(facts), *_clock(facts), _versions(facts, ours)]


def _time(facts: RobotFacts) -> Finding:
    check = f"{facts.name}: round trip"
    trips = facts.round_trips_ms
    if not trips:
        return fail(check, "none of the exchanges was answered", "the link is too slow, or loses too much")
    middle = median(trips)
    lost = facts.asked - len(trips)
    words = f"{min(trips):.2f} / {middle:.2f} / {max(trips):.2f} ms (least, median, most of {len(trips)})"
    words += f", {lost} lost" if lost else ""
    # the guard adds to the way the bound of the clocks' offset, half a round trip
    ceiling_ms = CEILING_MS if facts.times is None else 1e3 * facts.times.max_age_ceiling_s
    advice = (
        f"a command that may be older than {ceiling_ms:g} ms is refused: use a shorter way or a faster "
        "network, or raise [guard] max_age_ceiling_s at the robot"
    )
    if middle > ceiling_ms:
        return fail(check, words, advice)
    if max(trips) > OLDEST_MS or lost:
        return warn(check, words, f"{advice}; `tandem trial` compares transports")
    return ok(check, words)


def _times(facts: RobotFacts) -> list[Finding]:
    if facts.times is None:
        return []
    check = f"{facts.name}: guard's times"
    if facts.times.beyond:
        return [fail(check, facts.times.beyond, "a better line, or a higher ceiling in [guard] at the robot")]
    return [ok(check, facts.times.words)]


def _clock(facts: RobotFacts) -> list[Finding]:
    if not facts.round_trips_ms:
        return []
    check = f"{facts.name}: clock"
    words = f"offset {facts.offset_ms:+.3f} ms ± {facts.bound_ms:.3f} ms: measured, so the two need not agree"
    words += f"; {facts.clock_words}" if facts.clock_words else ""
    if facts.clock_refuted:
        return [
            warn(check, words, "`chronyc tracking` and `chronyc sources` on both hosts: one of them is wrong")
        ]
    return [ok(check, words)]


def _versions(facts: RobotFacts, ours: Software) -> Finding:
    check = f"{facts.name}: versions"
    theirs = facts.software
    if theirs is None:
        advice = "it runs an older tandem, or its statistics may not be heard: see [link.access]"
        return warn(check, "the robot does not report its version", advice)
    parts = {
        "tandem": (theirs.tandem, ours.tandem),
        "schema": (theirs.schema, ours.schema),
        "zenoh": (theirs.zenoh, ours.zenoh),
    }
    other = [f"{part} {there} there, {here} here" for part, (there, here) in parts.items() if there != here]
    if not other:
        return ok(check, ", ".join(f"{part} {here}" for part, (_, here) in parts.items()) + " on both")
    judge = fail if theirs.schema != ours.schema else warn
    return judge(check, "; ".join(other), "install the same tandem on both hosts")
