"""Whether the other side will believe this host, and for how long. Pure."""

from __future__ import annotations

from deploy.ops.doctor.judge.finding import Finding, fail, ok, warn
from deploy.ops.doctor.judge.needs import Needs
from deploy.ops.doctor.read.keys import KeyFacts

SOON_DAYS = 30.0
_NEW = "make it anew with `tandem keys make`"


def judge_keys(needs: Needs, facts: KeyFacts | None) -> list[Finding]:
    """`facts`: None where the file names no keys."""
    if facts is None:
        return [_without(needs)]
    if facts.trouble:
        advice = "correct [link.tls]; `tandem keys show FOLDER` lists the certificates"
        return [fail("certificate", facts.trouble, advice)]
    return [_name(needs, facts), _time(facts), *_hosts(needs, facts), *_key(facts)]


def _without(needs: Needs) -> Finding:
    if not (needs.link.listen or needs.link.connect):
        return ok("certificate", "the file names no endpoint")
    return warn(
        "certificate",
        "none: the link is neither encrypted nor authenticated",
        "on a network that is not yours alone: `tandem keys`, then tls/ or quic/ endpoints and [link.tls]",
    )


def _name(needs: Needs, facts: KeyFacts) -> Finding:
    check = "certificate's name"
    if not needs.certified_as or facts.common_name == needs.certified_as:
        return ok(check, facts.common_name)
    found = f"{facts.common_name}, and the file says {needs.certified_as}"
    advice = f"name the right files in [link.tls], or `tandem keys make KEYS {needs.certified_as}`"
    # without access control any certificate of the authority is let in
    return (warn if needs.link.access is None else fail)(check, found, advice)


def _time(facts: KeyFacts) -> Finding:
    found = f"{facts.days_left:.0f} days left"
    if facts.days_left >= SOON_DAYS:
        return ok("certificate's time", found)
    advice = f"{_NEW} before it ends: links then end too, and the robot holds"
    return warn("certificate's time", found, advice)


def _hosts(needs: Needs, facts: KeyFacts) -> list[Finding]:
    if not needs.link.listen:
        return []
    check = "certificate's hosts"
    if facts.hosts:
        return [ok(check, ", ".join(facts.hosts))]
    return [fail(check, "none, so no other host can connect to it", f"{_NEW} and --host ADDRESS")]


def _key(facts: KeyFacts) -> list[Finding]:
    if not facts.open_to_all:
        return []
    return [warn("key", "every user of this host can read it", "chown root:tandem KEY; chmod 640 KEY")]
