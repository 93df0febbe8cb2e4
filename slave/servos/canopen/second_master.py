"""A second master on a drives' bus: known by frames that only a master sends, and this one did not. Pure.

Two masters send the drives different commands, SYNC by SYNC, and mix up each other's SDO answers. CANopen has
one NMT master and one SDO client by default (CiA 301); the drives cannot distinguish two.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

from common.clock import NS_PER_S
from slave.servos.canopen import pdo

GONE_NS = NS_PER_S
"""A second master that is silent for this time is gone: a start or reset is possible again."""
_LSS = 0x7E5
"""LSS master to its slaves (CiA 305)."""


def master_s_frame(frame_id: int, nodes: Mapping[int, str], own_id: int) -> tuple[str, str] | None:
    """What only the master of these nodes (id: joint) sends, and to which of them; None for any other frame.

    In words; the second are empty for a frame to all.
    """
    if frame_id == pdo.NMT:
        return "NMT commands", ""
    if frame_id == pdo.SYNC:
        return "SYNC", ""
    if frame_id == _LSS:
        return "LSS commands", ""
    code, node = frame_id & 0x780, frame_id & 0x7F
    if code == pdo.HEARTBEAT and node == own_id:
        return f"heartbeats with the slave's own node id {own_id}", ""
    if code == pdo.SDO_REQUEST and node in nodes:
        return "SDO requests to", f"node {node} ({nodes[node]})"
    if code in pdo.RPDOS and node in nodes:
        return "targets (RPDO) for", f"node {node} ({nodes[node]})"
    return None


class SecondMaster:
    """What was heard of another master, bus by bus."""

    def __init__(self, nodes: Mapping[str, Mapping[int, str]], own_id: int) -> None:
        """`nodes`: by bus, then by node id, the joint."""
        self._nodes = nodes
        self._own_id = own_id
        self._heard: dict[str, dict[str, list[str]]] = {}
        """The addressed nodes, by bus and then by kind of frame."""
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
        kind, node = what
        nodes_heard = self._heard.setdefault(bus, {}).setdefault(kind, [])
        if node and node not in nodes_heard:
            nodes_heard.append(node)
        return True

    def speaks(self, now_ns: int) -> bool:
        """Whether a second master was heard within the last second."""
        return any(now_ns - last_ns < GONE_NS for last_ns in self._last_ns.values())

    def forget(self) -> None:
        """Forget the second master."""
        self._heard, self._last_ns = {}, {}

    @property
    def buses(self) -> Collection[str]:
        """The buses on which a second master was heard."""
        return self._heard.keys()

    @property
    def words(self) -> str:
        """The other master, by what it sends, and what to do; empty if there is none."""
        if not self._heard:
            return ""
        parts = [f"bus {bus}: {_listed(kinds)}" for bus, kinds in self._heard.items()]
        return (
            f"a second master is on {'; '.join(parts)}, not sent by this slave; end the other program "
            "(a second slave, a configuration tool), then start or reset"
        )


def _listed(kinds: Mapping[str, list[str]]) -> str:
    """SYNC and the like first, then kinds with the nodes they went to: the first, and how many more."""
    parts = [kind for kind, nodes in kinds.items() if not nodes]
    for kind, nodes in kinds.items():
        if nodes:
            parts.append(f"{kind} {nodes[0]}" + (f" and {len(nodes) - 1} more" if len(nodes) > 1 else ""))
    return ", ".join(parts)
