"""Whether the access rules and the revocation list permit this host what it is there for. Pure."""

from __future__ import annotations

from common.link.access import named
from common.link.config import AccessConfig
from common.link.roles import Role, role_of
from deploy.ops.doctor.judge.finding import Finding, fail, ok, warn
from deploy.ops.doctor.judge.needs import Needs
from deploy.ops.doctor.read.revoked import RevocationFacts

ACCESS, REVOKED = "access rules", "revoked"


def judge_access(needs: Needs, own: str, revoked: RevocationFacts | None) -> list[Finding]:
    """`own`: the common name in this host's certificate; `revoked`: None where the file names no list."""
    return [_rules(needs, own), _list(own, revoked)]


def _rules(needs: Needs, own: str) -> Finding:
    access = needs.link.access
    if access is None:
        return warn(
            ACCESS,
            "none: anyone with a certificate of this authority may command every robot",
            "name operators and their robots under [link.access], the same lines on every host",
        )
    if own not in named(access):
        return fail(ACCESS, f"they do not name {own}, so it may do nothing", "name it under [link.access]")
    missing = [robot for robot in needs.robots if own not in _operators(access, robot)]
    if missing:
        robots = ", ".join(missing)
        return fail(ACCESS, f"{own} may not command {robots}", "name the robot beside it under operators")
    role, name = role_of(own)
    if role is Role.ROBOT:
        operators = _operators(access, name)
        if not operators:
            return warn(ACCESS, "nobody may command this robot", "name it beside an operator")
        return ok(ACCESS, f"commanded by {', '.join(operators)}")
    return ok(ACCESS, f"they name {own}")


def _operators(access: AccessConfig, robot: str) -> list[str]:
    return [f"{Role.OPERATOR}:{name}" for name in access.names(access.operators, robot)]


def _list(own: str, revoked: RevocationFacts | None) -> Finding:
    if revoked is None:
        advice = 'to refuse a stolen key before it expires: `tandem keys revoke`, and [link] revoked = "…"'
        return ok(REVOKED, "no list", advice)
    if revoked.trouble:
        return fail(REVOKED, revoked.trouble, "copy the list of `tandem keys revoke` there")
    if own in revoked.names:
        return fail(REVOKED, f"this host's own certificate, {own}", "use one under another name")
    return ok(REVOKED, ", ".join(sorted(revoked.names)) or "nobody")
