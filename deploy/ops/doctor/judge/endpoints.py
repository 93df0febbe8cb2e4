"""What it means that an endpoint answers, or does not. Pure."""

from __future__ import annotations

from common.link.endpoint import transport_of
from deploy.ops.doctor.judge.finding import Finding, fail, ok, warn
from deploy.ops.doctor.read.endpoints import EndpointFacts, EndpointState

_FIREWALL = "is the host on, the address right, and the port open in its firewall?"


def judge_endpoint(facts: EndpointFacts) -> Finding:
    """One that this host connects to, or listens at."""
    match facts.answer:
        case EndpointState.ACCEPTS:
            found = "a process listens there"
            if transport_of(facts.endpoint) == "tls":  # the knock ended before a handshake
                found += ", and counts this knock as a refused handshake"
            return ok(f"connect {facts.endpoint}", found)
        case EndpointState.NOT_ASKED:
            return ok(
                f"connect {facts.endpoint}", "this transport cannot be tested alone; see the robot's own row"
            )
        case EndpointState.REFUSED:
            advice = "start the other side (`systemctl status tandem-slave@robot`), or correct the port"
            return fail(f"connect {facts.endpoint}", "no process listens there", advice)
        case EndpointState.SILENT:
            return fail(f"connect {facts.endpoint}", "no answer at all", _FIREWALL)
        case EndpointState.UNKNOWN:
            return fail(f"connect {facts.endpoint}", "no such host, or no way to it", _FIREWALL)
        case EndpointState.FREE:
            return ok(f"listen {facts.endpoint}", "free")
        case EndpointState.TAKEN:
            advice = "well, if that is this file's own process, running; else choose another port"
            return warn(f"listen {facts.endpoint}", "in use", advice)
        case EndpointState.FORBIDDEN:
            return fail(f"listen {facts.endpoint}", "not permitted", "choose a port above 1023")
        case EndpointState.FOREIGN:
            advice = "listen at an address of this host (`ip address`), or at 0.0.0.0"
            return fail(f"listen {facts.endpoint}", "not an address of this host", advice)
