"""Drives as makers build them: which objects they have, which of them are fixed, and how they answer.

After public manuals and descriptions, in outline. Where a manual was not at hand, a list holds what drives of
that kind are known to lack. None was compared with a device.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from common.clock import NS_PER_MS
from common.errors import ConfigError, ConfigMistake
from common.skeleton import Skeleton
from deploy.sim.drives.traits import GUARDING, INTERPOLATED, MORE_PDOS, ReadForm, Traits
from slave.servos.canopen import pdo
from slave.servos.canopen.mapping import INVALID

Maker = Callable[[int], Traits]
"""What the drive of a node id is like."""
_OF_TANDEM = frozenset({pdo.ENCODER, 0x2010})
_CONTROLWORD, _STATUSWORD = 0x6040_0010, 0x6041_0010


def _presets(device: int, vendor: int, product: int, modes: int | None) -> dict[tuple[int, int], int]:
    told = {} if modes is None else {(0x6502, 0): modes}
    return {(0x1000, 0): device, (0x1018, 1): vendor, (0x1018, 2): product, **told}


def _mapped(index: int, cob_id: int, *entries: int) -> dict[tuple[int, int], int]:
    """A PDO as it is after a start: its entries, its identifier, sent by events."""
    mapping = {(index + 0x200, sub): entry for sub, entry in enumerate(entries, 1)}
    return {**mapping, (index + 0x200, 0): len(entries), (index, 1): cob_id, (index, 2): 255}


def epos(node_id: int) -> Traits:
    """In the manner of maxon EPOS4: modes 1, 3, 6, 8, 9, 10; no time of the following error, no 1006h."""
    return Traits(
        lacks=_OF_TANDEM | GUARDING | INTERPOLATED | {0x1006, 0x1019, 0x6066, 0x6078, 0x607E},
        presets=_presets(0x0002_0192, 0xFB, 0x6050_0000, 0x3A5),
        always_set=1 << 15,  # "position referenced to home position"
    )


def interpolating(node_id: int) -> Traits:
    """In the manner of isel IMD20, by pages 92 to 108 of its manual.

    Interpolated position alone, 60C2h:1 of 16 bits, identifiers that cannot be changed, node guarding and no
    heartbeat, no 607Dh, and a while until the mode is there (as Festo CMMP).
    """
    parameters = frozenset({0x1400, 0x1401, 0x1402, 0x1403, 0x1800, 0x1801, 0x1802, 0x1803})
    return Traits(
        lacks=_OF_TANDEM | {0x1016, 0x1017, 0x6007, 0x605A, 0x607D, 0x6076, 0x6077, 0x6078},
        fixed_ids=parameters,
        presets={
            **_presets(0x0002_0192, 0x31, 0x00DC_8112, 0x65),
            **_mapped(0x1400, pdo.RPDO1 + node_id, _CONTROLWORD),
            **_mapped(0x1800, pdo.TPDO1 + node_id, _STATUSWORD),
        },
        wide_period=True,
        mode_after_syncs=30,
    )


def fixed(node_id: int) -> Traits:
    """With the static mapping of CiA DSP 402, as ERL's PCS drives: PDO 3 has target and position.

    An older firmware, without 6502h, 607Dh, 6085h and torque. A tool has stored a time-out of its RPDO.
    """
    parameters = {
        **_mapped(0x1400, 0x200 + node_id, _CONTROLWORD),
        **_mapped(0x1401, 0x300 + node_id, _CONTROLWORD, 0x6060_0008),
        **_mapped(0x1402, 0x400 + node_id, _CONTROLWORD, 0x607A_0020),
        **_mapped(0x1403, 0x500 + node_id, _CONTROLWORD, 0x60FF_0020),
        **_mapped(0x1800, 0x180 + node_id, _STATUSWORD),
        **_mapped(0x1801, 0x280 + node_id, _STATUSWORD, 0x6061_0008),
        **_mapped(0x1802, 0x380 + node_id, _STATUSWORD, 0x6064_0020),
        **_mapped(0x1803, INVALID | 0x480 + node_id, _STATUSWORD, 0x606C_0020),
    }
    return Traits(
        lacks=_OF_TANDEM | GUARDING | INTERPOLATED
        | {0x1006, 0x6007, 0x6065, 0x6066, 0x607D, 0x607E, 0x6085, 0x60C2, 0x6076, 0x6077, 0x6078, 0x6502},
        read_only=frozenset(range(0x1600, 0x1604)) | frozenset(range(0x1A00, 0x1A04)),
        presets={**_presets(0x0192, 0x2A, 0x64, None), **parameters, (0x1402, 5): 10},
        knows_16=False,
    )  # fmt: skip


def segmented(node_id: int) -> Traits:
    """Slow at SDO, and segmented however short the answer; modes 1 to 8; up 3 s late, and says so twice."""
    return Traits(
        lacks=_OF_TANDEM | {0x1006, 0x605A, 0x6078},
        presets=_presets(0x0004_0192, 0x26C, 0x1, 0xEF),
        read_form=ReadForm.SEGMENTED,
        answers_after_ns=30 * NS_PER_MS,
        boots_after_ns=3000 * NS_PER_MS,
        boots_again_after_ns=400 * NS_PER_MS,
    )


def reserved_bits(node_id: int) -> Traits:
    """Bits 8 and 9 of the statusword are reserved, as in Beckhoff's EL72x1; a type of 0; not homed.

    Its makers' bits 14 and 15 are set, and another master has left it waiting for a SYNC with a counter.
    """
    return Traits(
        lacks=_OF_TANDEM | GUARDING | INTERPOLATED | MORE_PDOS | {0x1006, 0x607D, 0x607E},
        presets={**_presets(0, 0x2, 0x1C20_3052, 0x780), (0x1019, 0): 240},
        never_set=1 << 9,
        always_set=3 << 14,
        homed=False,
    )


def without_position_mode(node_id: int) -> Traits:
    """An inverter: velocity and torque only."""
    return replace(epos(node_id), presets=_presets(0x0001_0192, 0xFB, 1, 0x0E))


def deaf(node_id: int) -> Traits:
    """Notices nobody's death: neither heartbeats nor node guarding."""
    return replace(epos(node_id), lacks=epos(node_id).lacks | {0x1016})


MAKERS = {
    "epos": epos, "interpolating": interpolating, "fixed": fixed, "segmented": segmented,
    "reserved-bits": reserved_bits,
}  # fmt: skip
"""The drives that can be used, by a name for the command line."""


def maker_of(text: str, skeleton: Skeleton) -> tuple[str, Maker]:
    """Read `JOINT=KIND`, such as `left_elbow_pitch=fixed`. Raises ConfigError."""
    joint, _, kind = text.partition("=")
    if joint not in skeleton.joint_names:
        expected = f"a joint of the {skeleton.name} profile before the ="
    elif kind not in MAKERS:
        expected = f"after the = one of {', '.join(MAKERS)}"
    else:
        return joint, MAKERS[kind]
    raise ConfigError("tandem drives", [ConfigMistake("--maker", text, expected)])
