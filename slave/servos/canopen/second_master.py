"""A second master on a drives' bus: known by frames that only a master sends, and this one did not. Pure.

Two masters tell the drives different things, SYNC by SYNC, and mix up each other's SDO answers. CANopen has
one NMT master and one SDO client by default (CiA 301); the drives cannot tell one from another.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from common.clock import NS_PER_S
from slave.servos.canopen import pdo

GONE_NS = NS_PER_S
"""Unheard for so long it has gone, and a start or reset is possible again."""
_RPDOS = (0x200, 0x300, 0x400, 0x500)
_LSS = 0x7E5
"""LSS master to its slaves (CiA 305)."""


def master_s_frame(frame_id: int, nodes: Mapping[int, str], own_id: int) -> str | None:
    """What a frame is that only the master of these nodes (id: joint) sends, in words; None for any other."""
    if frame_id == pdo.NMT:
        return "NMT commands"
    if frame_id == pdo.SYNC:
        return "SYNC"
    if frame_id == _LSS:
        return "LSS commands"
    code, node = frame_id & 0x780, frame_id & 0x7F
    if code == pdo.HEARTBEAT and node == own_id:
        return f"heartbeats with the slave's own node id {own_id}"
    if code == pdo.SDO_REQUEST and node in nodes:
        return f"SDO requests to node {node} ({nodes[node]})"
    if code in _RPDOS and node in nodes:
        return f"targets (RPDO) for node {node} ({nodes[node]})"
    return None


class SecondMaster:
    """What was heard of another master, bus by bus."""

    def __init__(self, nodes: Mapping[str, Mapping[int, str]], own_id: int) -> None:
        """`nodes`: by bus, then by node id, the joint."""
        self._nodes = nodes
        self._own_id = own_id
        self._heard: dict[str, dict[str, None]] = {}
        self._last_ns: dict[str, int] = {}
        self.frames = 0

    def hear(self, bus: str, frame_id: int, now_ns: int) -> bool:
        """One frame that this side did not send. True: it is a master's."""
        nodes = self._nodes.get(bus)
        what = None if nodes is None else master_s_frame(frame_id, nodes, self._own_id)
        if what is None:
            return False
        self.frames += 1
        self._last_ns[bus] = now_ns
        self._heard.setdefault(bus, {}).setdefault(what)
        return True

    def speaks(self, now_ns: int) -> bool:
        """Whether one was heard within the last second."""
        return any(now_ns - last_ns < GONE_NS for last_ns in self._last_ns.values())

    def forget(self) -> None:
        """It has gone."""
        self._heard, self._last_ns = {}, {}

    @property
    def buses(self) -> Collection[str]:
        """Where one was heard."""
        return self._heard.keys()

    @property
    def words(self) -> str:
        """Who it is, by what it sends, and what to do; empty where none was heard."""
        if not self._heard:
            return ""
        parts = [f"bus {bus}: {_listed(list(kinds))}" for bus, kinds in self._heard.items()]
        return (
            f"a second master is on {'; '.join(parts)}, not sent by this slave; end the other program "
            "(a second slave, a configuration tool), then start or reset"
        )


def _listed(kinds: list[str], most: int = 3) -> str:
    more = f" and {len(kinds) - most} more kinds of frames" if len(kinds) > most else ""
    return ", ".join(kinds[:most]) + more
