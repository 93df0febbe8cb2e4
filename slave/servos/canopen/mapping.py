"""Which of a drive's PDOs carry what, and where in their bytes (CiA 301, mapping parameters). Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from slave.servos.canopen import pdo

INVALID, NO_RTR = 0x8000_0000, 0x4000_0000
"""Bits of a PDO's COB-ID (1400h:1, 1800h:1): it does not exist; no remote request for it."""
RPDOS, TPDOS = range(0x1400, 0x1404), range(0x1800, 0x1804)
"""Communication parameters; a PDO's mapping is 200h further on."""
MOST_ENTRIES = 4
"""A fixed PDO with more is not used."""
_ID_BITS = 0x7FF
_SENT_AS_ZERO = (0x60B1, 0x60B2)
"""Velocity and torque offsets: without effect at 0."""
_MODE_BYTE = 0x6060_0008
_CONTROLWORD, _STATUSWORD, _POSITION = 0x6040_0010, 0x6041_0010, 0x6064_0020
TARGETS = {8: 0x607A_0020, 7: 0x60C1_0120}
"""Where a mode takes its target: target position, or the interpolation data record."""

Held = Mapping[tuple[int, int], int]
"""What was read of a drive, by index and subindex, unsigned."""


@dataclass(frozen=True, slots=True)
class Slice:
    """Some bytes of one identifier's frames."""

    frame_id: int
    at: int
    size: int
    frame_bytes: int

    def of(self, data: bytes) -> bytes:
        """The bytes; empty where the frame is of another length."""
        return data[self.at : self.at + self.size] if len(data) == self.frame_bytes else b""


@dataclass(frozen=True, slots=True)
class DrivePdos:
    """The PDOs of one drive."""

    rpdo_id: int
    template: bytes
    """Of the RPDO: what stands besides controlword and target."""
    controlword_at: int
    target_at: int
    tpdo_id: int
    tpdo_bytes: int
    statusword_at: int
    position_at: int
    encoder_at: int | None
    """None: it tells no encoder of the joint's own."""
    effort: Slice | None = None
    inputs: Slice | None = None
    limit_id: int | None = None
    """Of the RPDO that takes the torque limit; None: it takes none."""

    def rpdo(self, controlword_and_target: bytes) -> bytes:
        """The RPDO's data, from two bytes and four."""
        if len(self.template) == pdo.RPDO_BYTES and self.target_at == 2:
            return controlword_and_target
        out = bytearray(self.template)
        out[self.controlword_at : self.controlword_at + 2] = controlword_and_target[:2]
        out[self.target_at : self.target_at + 4] = controlword_and_target[2:]
        return bytes(out)

    def answer(self, data: bytes) -> bytes | None:
        """Statusword, encoder word and position, 8 bytes, from the TPDO's; None where its length is wrong."""
        if len(data) != self.tpdo_bytes:
            return None
        if self.encoder_at == 2 and self.position_at == 4 and self.tpdo_bytes == pdo.TPDO_BYTES:
            return data
        encoder = bytes(2) if self.encoder_at is None else data[self.encoder_at : self.encoder_at + 2]
        status, position = self.statusword_at, self.position_at
        return data[status : status + 2] + encoder + data[position : position + 4]


def mapped(node_id: int, mode: int, encoder: int | None) -> DrivePdos:
    """The PDOs of a drive that takes a mapping: the first ones, as in `rpdo_mapping` and `tpdo_mapping`."""
    has = encoder is not None
    return DrivePdos(
        pdo.RPDO1 + node_id, bytes(pdo.RPDO_BYTES), 0, 2, pdo.TPDO1 + node_id, 8 if has else 6, 0,
        4 if has else 2, 2 if has else None,
        Slice(pdo.TPDO2 + node_id, 0, pdo.EFFORT_BYTES, pdo.EFFORT_BYTES),
        Slice(pdo.TPDO3 + node_id, 0, pdo.INPUTS_BYTES, pdo.INPUTS_BYTES),
    )  # fmt: skip


def rpdo_mapping(mode: int) -> tuple[int, ...]:
    """Entries of 1600h (index, subindex, bits)."""
    return _CONTROLWORD, TARGETS[mode]


def tpdo_mapping(encoder: int | None) -> tuple[int, ...]:
    """Entries of 1A00h."""
    word = () if encoder is None else (encoder << 16 | 0x0010,)
    return _STATUSWORD, *word, _POSITION


@dataclass(frozen=True, slots=True)
class FixedPdo:
    """One PDO as a drive has it."""

    index: int
    """Of its communication parameters."""
    cob_id: int
    entries: tuple[int, ...]

    @property
    def frame_id(self) -> int:
        """Its identifier."""
        return self.cob_id & _ID_BITS

    @property
    def size(self) -> int:
        """Bytes."""
        return sum(entry & 0xFF for entry in self.entries) // 8

    def at(self, wanted: int) -> int | None:
        """The byte at which an entry begins; None where it is not mapped, or not at a whole byte."""
        bits = 0
        for entry in self.entries:
            if entry == wanted:
                return None if bits % 8 else bits // 8
            bits += entry & 0xFF
        return None


def fixed_pdos(held: Held, indices: Sequence[int]) -> list[FixedPdo]:
    """The PDOs whose mapping was read."""
    out = []
    for index in indices:
        count = held.get((index + 0x200, 0), 0)
        entries = tuple(held.get((index + 0x200, sub), 0) for sub in range(1, min(count, MOST_ENTRIES) + 1))
        if count <= MOST_ENTRIES and entries and (index, 1) in held:
            out.append(FixedPdo(index, held[index, 1], entries))
    return out


def chosen(held: Held, mode: int, encoder: int | None) -> tuple[FixedPdo | None, FixedPdo | None]:
    """The RPDO that takes controlword and target and nothing that matters besides; the TPDO of the answer."""
    harmless = {_CONTROLWORD, TARGETS[mode], _MODE_BYTE}
    rpdos = [
        one
        for one in fixed_pdos(held, RPDOS)
        if None not in (one.at(_CONTROLWORD), one.at(TARGETS[mode]))
        and all(entry in harmless or entry >> 16 in _SENT_AS_ZERO for entry in one.entries)
    ]
    wanted = tpdo_mapping(encoder)
    tpdos = [one for one in fixed_pdos(held, TPDOS) if all(one.at(entry) is not None for entry in wanted)]
    return (rpdos[0] if rpdos else None), (tpdos[0] if tpdos else None)


def as_it_is(
    rpdo: FixedPdo, tpdo: FixedPdo, others: Sequence[FixedPdo], mode: int, encoder: int | None, effort: int
) -> DrivePdos:
    """The PDOs of a drive with these. `others`: all its TPDOs; `effort`: the object that tells it."""
    template = bytearray(rpdo.size)
    mode_at = rpdo.at(_MODE_BYTE)
    if mode_at is not None:
        template[mode_at] = mode
    encoder_at = None if encoder is None else tpdo.at(encoder << 16 | 0x0010)
    return DrivePdos(
        rpdo.frame_id, bytes(template), rpdo.at(_CONTROLWORD) or 0, rpdo.at(TARGETS[mode]) or 0,
        tpdo.frame_id, tpdo.size, tpdo.at(_STATUSWORD) or 0, tpdo.at(_POSITION) or 0, encoder_at,
        where(others, effort << 16 | 0x0010), where(others, pdo.INPUTS_MAPPING[0]),
    )  # fmt: skip


def where(tpdos: Sequence[FixedPdo], entry: int) -> Slice | None:
    """Where a drive tells an entry."""
    for one in tpdos:
        at = one.at(entry)
        if at is not None:
            return Slice(one.frame_id, at, (entry & 0xFF) // 8, one.size)
    return None
