"""Which node on which bus turns which joint. Drives are numbered in the order of the joints. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from common.skeleton import Skeleton
from slave.servos.canopen import pdo
from slave.servos.canopen.cia402 import CYCLIC_SYNCHRONOUS_POSITION
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.mapping import DrivePdos, mapped

Outgoing = tuple[str, int, bytes | None]
"""Bus name, identifier, data; None: a remote request."""
START, STOP, PRE_OPERATIONAL = 0x01, 0x02, 0x80
"""NMT commands."""
BOOTED, OPERATIONAL = 0x00, 0x05
"""NMT states in a heartbeat."""


class DriveWiring:
    """The identifiers that each drive sends and hears, and the frames to it."""

    def __init__(self, config: CanopenConfig, skeleton: Skeleton) -> None:
        self.joints = skeleton.joint_names
        self.where = [(drive.bus, drive.id) for drive in config.drives_of(skeleton).values()]
        """Bus and node id of each drive."""
        self._buses = [bus.name for bus in config.buses]
        self.pdos = [
            mapped(drive.id, CYCLIC_SYNCHRONOUS_POSITION, drive.encoder)
            for drive in config.drives_of(skeleton).values()
        ]
        """The PDOs of each drive; other ones once it is known that its mapping cannot be changed."""
        self._beat = pdo.HEARTBEAT + config.node_id
        self._by_answer: dict[tuple[str, int], int] = {}
        self._guarded: set[int] = set()
        for i, own in enumerate(self.pdos):
            self.connect(i, own, guarded=False)
        self._by_node = {where: i for i, where in enumerate(self.where)}

    def connect(self, drive: int, pdos: DrivePdos, guarded: bool) -> None:
        """From now on a drive has these PDOs; `guarded`: it has no heartbeat and is asked for its state."""
        bus = self.where[drive][0]
        self._by_answer.pop((bus, self.pdos[drive].tpdo_id), None)
        self._by_answer[bus, pdos.tpdo_id] = drive
        self.pdos[drive] = pdos
        self._guarded.discard(drive)
        self._guarded |= {drive} if guarded else set()

    def answering(self, bus: str, frame_id: int) -> int | None:
        """The drive whose answer to SYNC has this identifier, or None."""
        return self._by_answer.get((bus, frame_id))

    def sending(self, bus: str, frame_id: int) -> int | None:
        """The drive that sends this identifier, whatever for, or None."""
        return self._by_node.get((bus, frame_id & 0x7F))

    def on_bus(self, bus: str) -> dict[int, str]:
        """The joints on a bus by node id."""
        rows = zip(self.where, self.joints, strict=True)
        return {node: joint for (name, node), joint in rows if name == bus}

    def nmt(self, drive: int, command: int) -> Outgoing:
        """An NMT command to one drive."""
        bus, node = self.where[drive]
        return bus, pdo.NMT, bytes([command, node])

    def sdo(self, drive: int, data: bytes) -> Outgoing:
        """An SDO request to one drive."""
        bus, node = self.where[drive]
        return bus, pdo.SDO_REQUEST + node, data

    def heartbeats(self) -> list[Outgoing]:
        """The slave's own, one a bus, and a request to each drive that is guarded instead."""
        beats: list[Outgoing] = [(bus, self._beat, bytes([OPERATIONAL])) for bus in self._buses]
        asked = (self.where[drive] for drive in sorted(self._guarded))
        return beats + [(bus, pdo.HEARTBEAT + node, None) for bus, node in asked]

    def syncs(self) -> list[Outgoing]:
        """SYNC, one a bus."""
        return [(bus, pdo.SYNC, b"") for bus in self._buses]

    def limits(self, data: Mapping[int, bytes], seen: Sequence[bool]) -> list[Outgoing]:
        """Each drive's torque limit, by drive, of those drives that are `seen`."""
        rows = ((self.where[i][0], self.pdos[i].limit_id, part) for i, part in data.items() if seen[i])
        return [(bus, limit_id, part) for bus, limit_id, part in rows if limit_id is not None]

    def targets(self, data: Sequence[bytes], seen: Sequence[bool]) -> list[Outgoing]:
        """Each drive's target, of those drives that are `seen`."""
        rows = zip(self.where, self.pdos, data, seen, strict=True)
        return [(bus, own.rpdo_id, own.rpdo(part)) for (bus, _), own, part, send in rows if send]
