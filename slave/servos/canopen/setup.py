"""What each drive is told before it may move, by SDO, and what follows where its maker left something out.

Asked in stages, as later questions depend on earlier answers: who it is and which modes it has; its settings;
what takes the place of refused ones; its mode. Pure.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from slave.servos.canopen import setup_checks as checks
from slave.servos.canopen.drive_config import DriveSettings, EffortSource, TorqueLimitBy
from slave.servos.canopen.eds import Eds
from slave.servos.canopen.mapping import (
    INVALID,
    MOST_ENTRIES,
    NO_RTR,
    RPDOS,
    TPDOS,
    DrivePdos,
    Held,
    as_it_is,
    chosen,
    fixed_pdos,
    mapped,
    rpdo_mapping,
    tpdo_mapping,
)
from slave.servos.canopen.pdo import (
    CURRENT,
    INPUTS_MAPPING,
    LIMITS,
    RPDO1,
    RPDO2,
    TORQUE,
    TPDO1,
    TPDO2,
    TPDO3,
)
from slave.servos.canopen.sdo import Read, Transfer, Write
from slave.servos.canopen.setup_checks import (
    ANSWER,
    BEAT,
    EFFORT,
    EFFORT_PDO,
    GUARDING,
    INPUTS,
    LIMIT,
    LOSS,
    MAPPING,
    MODES,
    PERIOD,
    QUICK_STOP,
    WIDE_PERIOD,
    WRONG_LENGTH,
    SetupRefusedError,
)  # fmt: skip

_EVERY_SYNC = 1
RATED_TORQUE, POLARITY = (0x6076, 0), (0x607E, 0)
_QUICK_STOP_AND_STAY = 6
"""605Ah: slow down on the quick stop ramp, then hold. Never let go."""
_ON_ABORT_QUICK_STOP = 3
"""6007h: a lost connection is answered by a quick stop."""
_MILLISECONDS = -3
_MODE_TRIES = 150
"""Three seconds: some drives show interpolated position only after 200 SYNCs."""
_HOMING, _HOMED = 6, 0x1000


class SetupPlan:
    """The transfers to one drive, stage by stage."""

    def __init__(self, settings: DriveSettings, eds: Eds | None = None) -> None:
        self._settings, self._eds = settings, eds
        self.begin()

    def begin(self) -> list[Transfer]:
        """The first transfers; whatever was before is forgotten."""
        self.mode: int = self._settings.drive.mode or 8
        self.pdos: DrivePdos = mapped(self._settings.drive.id, self.mode, self._settings.drive.encoder)
        self.guarded = False
        """Whether node guarding takes the place of heartbeats."""
        self.left_out: list[str] = []
        """What the drive lacks that it may lack, in words."""
        self._stages = iter((self._basics, self._replacements, self._fixed, self._last))
        return list(self._identity())

    def then(self, held: Held, lacks: Mapping[str, str]) -> list[Transfer]:
        """The next transfers; none: the drive is set up. Raises SetupRefusedError."""
        for stage in self._stages:
            transfers = list(stage(held, lacks))
            if transfers:
                return transfers
        crosses = {"607Dh": "its range crosses 2³¹ increments"} if self._settings.crosses else {}
        self.left_out = checks.left_out({**lacks, **crosses})
        return []

    def refusal(self, transfer: Transfer) -> str:
        """Why the drive refuses a transfer, as its EDS says; empty where it does not say so."""
        return "" if self._eds is None else self._eds.refusal(transfer)

    # the stages

    def _identity(self) -> Iterator[Transfer]:
        yield Read(0x1000, 0, 0, 0, "its type", optional=True)
        # whatever it says: two drives of one id differ in it, so that both their answers get through
        yield from (Read(0x1018, sub, 0, 0, "its identity", optional=True) for sub in (1, 2, 3, 4))
        yield Read(*MODES, 0, 0, "its modes", optional=True)
        if self._settings.drive.homed:
            yield Write(0x6060, 0, 1, _HOMING)
            yield Read(
                0x6061, 0, 0xFF, _HOMING, "homing mode (6), to see whether it is homed,", again=_MODE_TRIES
            )
            yield Read(0x6041, 0, _HOMED, _HOMED, "homed since it was switched on (bit 12; home it first)")

    def _basics(self, held: Held, lacks: Mapping[str, str]) -> Iterator[Transfer]:
        checks.check_identity(held, self._eds)
        self.mode = checks.choose_mode(held, self._settings.drive.mode, self._eds)
        drive, times = self._settings.drive, self._settings.times
        self.pdos = mapped(drive.id, self.mode, drive.encoder)
        yield Write(0x1016, 1, 4, times.node_id << 16 | times.dead_ms, BEAT)
        yield Write(0x1017, 0, 2, times.drive_heartbeat_ms, BEAT)
        # what another master may have stored: a SYNC with a counter, and a time-out of the targets' PDO
        yield Write(0x1019, 0, 1, 0, "1019h")
        yield Write(0x1400, 5, 2, 0, "1400h:5")
        # some drives interpolate by it instead of 60C2h
        yield Write(0x1006, 0, 4, 1000 * times.period_ms, "1006h")
        yield from _pdo(0x1400, RPDO1 + drive.id, rpdo_mapping(self.mode), part_of=MAPPING)
        yield from _pdo(0x1800, TPDO1 + drive.id | NO_RTR, tpdo_mapping(drive.encoder), part_of=MAPPING)
        if self._settings.tells_inputs:
            yield from _pdo(0x1802, TPDO3 + drive.id | NO_RTR, INPUTS_MAPPING, part_of=INPUTS)
        yield Write(0x6007, 0, 2, _ON_ABORT_QUICK_STOP, LOSS)
        yield Write(0x605A, 0, 2, _QUICK_STOP_AND_STAY, QUICK_STOP)
        yield Write(0x6060, 0, 1, self.mode)
        yield Write(0x6065, 0, 4, self._settings.window, "6065h")
        yield Write(0x6066, 0, 2, times.following_error_ms, "6065h")
        if not self._settings.crosses:
            yield Write(0x607D, 1, 4, self._settings.lower, "607Dh")
            yield Write(0x607D, 2, 4, self._settings.upper, "607Dh")
        yield Write(0x6085, 0, 4, self._settings.ramp, "6085h")
        yield Write(0x60C2, 1, 1, times.period_ms, PERIOD)
        yield Write(0x60C2, 2, 1, _MILLISECONDS, PERIOD)
        yield from self._effort()

    def _effort(self) -> Iterator[Transfer]:
        drive = self._settings.drive
        if drive.effort is EffortSource.NONE:
            return
        entry = _told(drive.effort)
        yield Read(entry, 0, 0, 0, "its effort", part_of=EFFORT)
        yield Read(*RATED_TORQUE, 0, 0, "its rated torque", optional=True, part_of=EFFORT)
        yield Read(*POLARITY, 0, 0, "its polarity", optional=True, part_of=EFFORT)
        every = self._settings.times.effort_syncs
        cob_id, mapping = TPDO2 + drive.id | NO_RTR, (entry << 16 | 0x0010,)
        yield from _pdo(0x1801, cob_id, mapping, every=every, part_of=EFFORT_PDO)

    def _replacements(self, held: Held, lacks: Mapping[str, str]) -> Iterator[Transfer]:
        checks.check_holding(lacks, self._settings.drive.holds_itself)
        if BEAT in lacks:
            yield from self._node_guarding()
        if WRONG_LENGTH in lacks.get(PERIOD, ""):
            yield Write(0x60C2, 1, 2, self._settings.times.period_ms, WIDE_PERIOD)
            yield Write(0x60C2, 2, 1, _MILLISECONDS, WIDE_PERIOD)
        if MAPPING not in lacks:
            yield from self._torque_limit()
            return
        # an identifier that cannot be changed does not mean that the entries cannot
        yield from _entries(0x1400, rpdo_mapping(self.mode), "entries of RPDO 1")
        yield from _entries(0x1800, tpdo_mapping(self._settings.drive.encoder), "entries of TPDO 1")
        for index in (*RPDOS, *TPDOS):
            part = f"PDO {index:04X}h"
            yield Read(index, 1, 0, 0, "its identifier", part_of=part)
            subs = range(MOST_ENTRIES + 1)
            yield from (Read(index + 0x200, sub, 0, 0, "its mapping", part_of=part) for sub in subs)

    def _torque_limit(self) -> Iterator[Transfer]:
        drive = self._settings.drive
        if drive.torque_limit is TorqueLimitBy.NONE or drive.most_torque_percent is None:
            return
        objects = LIMITS[drive.torque_limit.value]
        if drive.effort is EffortSource.NONE:
            yield Read(*RATED_TORQUE, 0, 0, "its rated torque", optional=True, part_of=LIMIT)
        # a slave that died may have left less
        most = round(10.0 * drive.most_torque_percent)
        yield from (Write(index, 0, 2, most, LIMIT) for index in objects)
        yield from _pdo(
            0x1401, RPDO2 + drive.id, tuple(index << 16 | 0x0010 for index in objects), part_of=LIMIT
        )

    def _node_guarding(self) -> Iterator[Transfer]:
        times = self._settings.times
        yield Write(0x100C, 0, 2, times.heartbeat_ms, GUARDING)
        yield Write(0x100D, 0, 1, min(255, -(-times.dead_ms // times.heartbeat_ms)), GUARDING)

    def _fixed(self, held: Held, lacks: Mapping[str, str]) -> Iterator[Transfer]:
        checks.check_life(lacks)
        checks.check_period(lacks, self.mode, self._settings.times.period_ms)
        self.guarded = BEAT in lacks
        if MAPPING not in lacks:
            return
        drive = self._settings.drive
        rpdo, tpdo = chosen(held, self.mode, drive.encoder)
        if rpdo is None or tpdo is None:
            raise SetupRefusedError(
                f"does not take a PDO mapping ({lacks[MAPPING]}), and none of its own "
                + (
                    "takes controlword and target"
                    if rpdo is None
                    else "tells statusword and position together"
                )
                + ": map them in PDO 1 with its maker's tool"
            )
        tpdos = fixed_pdos(held, TPDOS)
        self.pdos = as_it_is(rpdo, tpdo, tpdos, self.mode, drive.encoder, _told(drive.effort))
        told = {one.frame_id for one in (self.pdos.effort, self.pdos.inputs) if one is not None}
        for one in (rpdo, tpdo):
            if one.cob_id & INVALID:
                yield Write(one.index, 1, 4, one.cob_id & ~INVALID)
        yield Write(rpdo.index, 2, 1, _EVERY_SYNC, "target at SYNC")
        yield Write(rpdo.index, 5, 2, 0, "time-out of its RPDO")
        yield Write(tpdo.index, 2, 1, _EVERY_SYNC, ANSWER)
        for one in tpdos:
            if one.frame_id in told and one.index != tpdo.index:
                if one.cob_id & INVALID:
                    yield Write(one.index, 1, 4, one.cob_id & ~INVALID, f"PDO {one.index:04X}h on")
                yield Write(one.index, 2, 1, _EVERY_SYNC, f"PDO {one.index:04X}h at SYNC")
            elif one.index != tpdo.index and not one.cob_id & INVALID:
                yield Write(one.index, 1, 4, one.cob_id | INVALID, f"PDO {one.index:04X}h off")

    def _last(self, held: Held, lacks: Mapping[str, str]) -> Iterator[Transfer]:
        checks.check_answer(lacks)
        if not self.no_limit(lacks) and self._settings.drive.torque_limit is not TorqueLimitBy.NONE:
            self.pdos = replace(self.pdos, limit_id=RPDO2 + self._settings.drive.id)
        checks.check_inputs(lacks, self._settings.tells_inputs, self.pdos.inputs is not None)
        if self.mode == 7:
            yield Write(0x60C0, 0, 2, 0, "linear interpolation")
        names = {8: "cyclic synchronous position (8)", 7: "interpolated position (7)"}
        # the last: a drive may take a while to change its mode
        expected = f"the mode asked for, {names[self.mode]},"
        yield Read(0x6061, 0, 0xFF, self.mode, expected, again=_MODE_TRIES)

    def no_effort(self, lacks: Mapping[str, str]) -> str:
        """Why the drive tells no effort; empty where it does."""
        return lacks.get(EFFORT, "") or (lacks.get(EFFORT_PDO, "") if self._untold(lacks) else "")

    def no_limit(self, lacks: Mapping[str, str]) -> str:
        """Why the drive takes no torque limit; empty where it does, or is not asked to."""
        return lacks.get(LIMIT, "") or ("its PDOs cannot be mapped anew" if MAPPING in lacks else "")

    def _untold(self, lacks: Mapping[str, str]) -> bool:
        return MAPPING not in lacks or self.pdos.effort is None


def _told(source: EffortSource) -> int:
    return CURRENT if source is EffortSource.CURRENT else TORQUE


def _pdo(
    index: int, cob_id: int, mapping: tuple[int, ...], *, every: int = _EVERY_SYNC, part_of: str
) -> list[Transfer]:
    """CiA 301's order for a new mapping: off, no entries, the entries, their number, on."""
    return [
        Write(index, 1, 4, cob_id | INVALID, part_of),
        Write(index, 2, 1, every, part_of),
        *_entries(index, mapping, part_of),
        Write(index, 1, 4, cob_id, part_of),
    ]


def _entries(index: int, mapping: tuple[int, ...], part_of: str) -> list[Transfer]:
    entries = index + 0x200
    return [
        Write(entries, 0, 1, 0, part_of),
        *(Write(entries, sub, 4, entry, part_of) for sub, entry in enumerate(mapping, 1)),
        Write(entries, 0, 1, len(mapping), part_of),
    ]
