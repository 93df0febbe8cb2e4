"""Holds a drive's EDS against what the slave will ask of it, before anything is opened."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

from common.errors import ConfigMistake
from slave.servos.canopen.drive_config import DriveSettings
from slave.servos.canopen.eds import Eds, EdsError, read_eds
from slave.servos.canopen.mapping import TARGETS
from slave.servos.canopen.sdo import Read
from slave.servos.canopen.setup import SetupPlan
from slave.servos.canopen.setup_checks import SetupRefusedError

_NEEDED = {(0x6040, 0): "controlword", (0x6041, 0): "statusword", (0x6064, 0): "actual position"}

eds_of = lru_cache(maxsize=64)(read_eds)
"""A file, read once: 25 drives often share one of 5000 lines."""


def eds_mistakes(drives: Iterable[tuple[str, DriveSettings]]) -> list[ConfigMistake]:
    """Drives, by joint, that cannot be used by what their EDS says, and files that are none."""
    mistakes = []
    for joint, settings in drives:
        path: Path | None = settings.eds
        if path is None:
            continue
        key = f"servos.canopen.drives.{joint}.eds"
        try:
            checked(settings, eds_of(path))
        except EdsError as error:
            mistakes.append(ConfigMistake(key, str(path), str(error)))
        except SetupRefusedError as error:
            mistakes.append(ConfigMistake(key, str(path), f"a drive that can be used; this one {error}"))
    return mistakes


def checked(settings: DriveSettings, eds: Eds) -> SetupPlan:
    """Go through the set-up as a drive of this EDS would answer. Raises SetupRefusedError."""
    plan = SetupPlan(settings, eds)
    held: dict[tuple[int, int], int] = {}
    lacks: dict[str, str] = {}
    transfers = plan.begin()
    while transfers:
        for transfer in transfers:
            if transfer.part_of in lacks:
                continue
            refusal, place = eds.refusal(transfer), (transfer.index, transfer.subindex)
            optional = isinstance(transfer, Read) and transfer.optional
            if refusal and transfer.part_of and not optional:
                lacks[transfer.part_of] = refusal
            elif refusal and not optional:
                raise SetupRefusedError(f"refuses its configuration: {refusal}")
            elif isinstance(transfer, Read) and (value := eds.value(place, settings.drive.id)) is not None:
                held[place] = value
        transfers = plan.then(held, lacks)
    target, encoder = TARGETS[plan.mode], settings.drive.encoder
    needed = {**_NEEDED, (target >> 16, target >> 8 & 0xFF): "target of its mode"}
    if encoder is not None:
        needed[encoder, 0] = "encoder at the joint, as this file names it"
    for (index, sub), name in needed.items():
        if (index, sub) not in eds.entries:
            raise SetupRefusedError(f"has no {name} ({index:04X}h:{sub}): name the drive's own EDS")
    return plan
