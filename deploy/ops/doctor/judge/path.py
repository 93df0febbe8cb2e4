"""Whether the way to a robot carries what control needs, and what pictures and statistics need. Pure."""

from __future__ import annotations

from common.wire.state_form import CONTROL_BYTES
from deploy.ops.doctor.judge.finding import Finding, fail, ok, warn
from deploy.ops.doctor.read.path import SIZES, PathFacts

_ADVICE = (
    "use quic, which finds the path's size and copes, or set the tunnel's MTU on both hosts, or "
    "`sysctl net.ipv4.tcp_mtu_probing=1` on both hosts for tcp, tls and ws"
)


def judge_path(facts: PathFacts) -> list[Finding]:
    """Nothing where the robot answers no probe."""
    if facts.there_bytes is None or facts.back_bytes is None:
        return []
    check = f"{facts.robot}: path"
    least = min(facts.there_bytes, facts.back_bytes)
    if least >= max(SIZES):
        return [ok(check, f"messages of up to {max(SIZES)} bytes pass both ways")]
    words = (
        f"messages of more than {facts.there_bytes} bytes to the robot" * (facts.there_bytes < max(SIZES)),
        f"messages of more than {facts.back_bytes} bytes from the robot" * (facts.back_bytes < max(SIZES)),
    )
    found = f"{' and '.join(filter(None, words))} vanish on the way (the next size tried was {_next(least)})"
    if least < CONTROL_BYTES:
        return [fail(check, f"{found}: commands and states do not pass safely", _ADVICE)]
    return [warn(check, f"{found}: pictures and statistics stall tcp, and commands with them", _ADVICE)]


def _next(passed: int) -> int:
    return next(size for size in SIZES if size > passed)
