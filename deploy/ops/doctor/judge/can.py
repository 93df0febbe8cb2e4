"""Whether each CAN bus is there, up, fast enough for what hangs on it, and well. Pure."""

from __future__ import annotations

from collections.abc import Mapping

from deploy.ops.doctor.judge.finding import Finding, fail, ok, warn
from deploy.ops.doctor.judge.needs import BusNeed
from deploy.ops.doctor.read.can import CanInterface
from slave.servos.canopen.load import configured_bitrate, too_much

BUSY = 0.8
"""Share of its time that a bus may be occupied before late answers are to be expected."""
# ISO 11898-1, standard identifiers, with the stuff bits that are to be expected of random data
_CLASSIC_BITS = 125.0
"""A frame of 8 bytes; three of them are one node's answer."""
_FD_SLOW_BITS, _FD_FAST_BITS = 32.0, 245.0
"""A frame of 24 bytes: identifier, acknowledge and gap at the slow rate, the rest at the fast one."""
_FRAMES_OF_A_NODE = 3


def judge_buses(needs: tuple[BusNeed, ...], found: Mapping[str, CanInterface]) -> list[Finding]:
    """One finding a bus, in the file's order."""
    return [_judge(need, found) for need in needs]


def judge_interfaces(found: Mapping[str, CanInterface]) -> list[Finding]:
    """What there is, where no file says what is needed."""
    if not found:
        return [ok("CAN interfaces", "none")]
    return [
        ok(f"CAN interface {at.name}", _words(at) if at.up else f"{at.name} is down") for at in found.values()
    ]


def share_of_time(need: BusNeed, bitrate: int, data_bitrate: int) -> float:
    """The share of the bus's time that its nodes' answers occupy: 1 is all of it."""
    if need.bus.fd:
        answer_s = _FD_SLOW_BITS / bitrate + _FD_FAST_BITS / (data_bitrate or bitrate)
    else:
        answer_s = _FRAMES_OF_A_NODE * _CLASSIC_BITS / bitrate
    return need.nodes * answer_s * need.rate_hz


def _judge(need: BusNeed, found: Mapping[str, CanInterface]) -> Finding:
    bus = need.bus
    check = f"bus {bus.name}"
    if bus.interface != "socketcan":
        return ok(check, f"{bus.interface} {bus.channel}: no interface of the kernel, opened at the start")
    at = found.get(bus.channel)
    if at is None:
        there = ", ".join(sorted(found)) or "none"
        return fail(
            check,
            f"no CAN interface {bus.channel} (there: {there})",
            "plug the adapter in; its name is shown by `ip link`; give it a lasting one by a udev rule",
        )
    if not at.up:
        return fail(check, f"{at.name} is down", f"systemctl enable --now tandem-can@{at.name}")
    if bus.fd and not at.fd:
        return fail(
            check,
            f"{at.name} carries classic CAN only, but the file sets fd = true",
            f"set it up with `dbitrate 5000000 fd on` (tandem-can@{at.name}), or set fd = false",
        )
    return _judge_running(check, need, at)


def _judge_running(check: str, need: BusNeed, at: CanInterface) -> Finding:
    words = _words(at)
    if at.state in ("BUS-OFF", "ERROR-PASSIVE", "STOPPED"):
        advice = "look at the wiring, 120 Ω at both ends, and that all speak at this bit rate"
        judge = fail if at.state == "BUS-OFF" else warn
        return judge(check, f"{words}: {at.state.lower()}", advice)
    if need.drives:
        return _judge_drives(check, need, at)
    if not (need.nodes and at.bitrate):
        return ok(check, words)
    share = share_of_time(need, at.bitrate, at.data_bitrate)
    words += f"; {need.nodes} nodes take {100 * share:.0f} % of it"
    if share <= BUSY:
        return ok(check, words)
    advice = "raise the (data) bit rate, use CAN FD, or spread the nodes over two buses"
    return fail(check, words, advice) if share > 1.0 else warn(check, words, advice)


def _judge_drives(check: str, need: BusNeed, at: CanInterface) -> Finding:
    bitrate = at.bitrate or configured_bitrate(need.bus)
    share = need.bits_per_s / bitrate
    words = (
        f"{_words(at)}; {need.drives} drives at {need.rate_hz:g} Hz put {need.bits_per_s / 1e6:.2f} Mbit/s "
        f"on it, {100 * share:.0f} % of it"
    )
    if too := too_much(need.drives, round(need.rate_hz), need.bits_per_s, bitrate):
        return fail(check, words, too)
    if share > BUSY:
        return warn(check, words, "answers may come late: lower sync_hz, or use more buses")
    return ok(check, words)


def _words(at: CanInterface) -> str:
    speed = " / ".join(f"{rate / 1e6:g} Mbit/s" for rate in (at.bitrate, at.data_bitrate) if rate)
    return f"{at.name} is up, {'CAN FD' if at.fd else 'classic CAN'}{', ' if speed else ''}{speed}"
