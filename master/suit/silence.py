"""What to look at when a bus is open and no node on it answers. Pure: counters in, words out."""

from __future__ import annotations

from dataclasses import dataclass

from common.clock import NS_PER_S

AGAIN_NS = 30 * NS_PER_S
"""Until the same is said anew."""


@dataclass(frozen=True, slots=True)
class BusSigns:
    """Counters of one bus and its nodes, since the start."""

    up: bool
    fd: bool
    sync_id: int | None
    """None: its nodes run free."""
    received: int
    """Frames of any kind."""
    fresh: int
    """Sound answers of its nodes."""
    unknown_id: int
    bad_length: int
    bad_checksum: int
    bad_tick: int
    error_frames: int
    send_errors: int


def advice(before: BusSigns, now: BusSigns) -> str:
    """The likeliest cause first, of what was counted between the two; empty where nodes answer."""
    if not now.up or now.fresh > before.fresh:
        return ""

    def more(counter: str) -> bool:
        return bool(getattr(now, counter) > getattr(before, counter))

    kind = "CAN FD" if now.fd else "classic CAN"
    causes = []
    if more("bad_length"):
        causes.append(f"answers have the wrong length: the nodes may not speak {kind} (fd), or another DBC")
    if more("unknown_id"):
        causes.append("frames have identifiers of no configured node: compare the nodes' ids and the DBC")
    if more("bad_tick"):
        causes.append("answers bear the number of another tick: they are too late, or do not repeat SYNC's")
    if more("bad_checksum"):
        causes.append("checksums are wrong: another DBC, or damage on the way to the controller")
    if more("error_frames"):
        causes.append("the controller reports errors: bit rate, sample point, 120 Ω at both ends, wiring")
    if more("send_errors"):
        causes.append("SYNC is not acknowledged: no power, no other device on the bus, or another bit rate")
    if not causes:
        asked = "" if now.sync_id is None else f", and whether the nodes wait for SYNC {now.sync_id:#x}"
        causes.append(
            f"nothing is heard: the nodes' power and plug, the bit rate, 120 Ω at both ends, "
            f"fd (here {kind}){asked}"
        )
    return "no node answers; " + "; ".join(causes)


class SilenceWatch:
    """Asks once a second, and says what it finds at once and then seldom."""

    def __init__(self) -> None:
        self._before: dict[str, BusSigns] = {}
        self._logged: dict[str, tuple[str, int]] = {}

    def lines(self, buses: dict[str, BusSigns], now_ns: int) -> list[str]:
        """What to log now, a line a bus."""
        out = []
        for name, signs in buses.items():
            before = self._before.get(name)
            self._before[name] = signs
            words = advice(before, signs) if before is not None and before.up else ""
            logged, logged_ns = self._logged.get(name, ("", -AGAIN_NS))
            if not words:
                self._logged.pop(name, None)
            elif words != logged or now_ns - logged_ns >= AGAIN_NS:
                self._logged[name] = words, now_ns
                out.append(f"bus {name}: {words}")
        return out
