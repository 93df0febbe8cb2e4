"""What travels between master and suit, as the DBC describes it: SYNC out, answers in.

On CAN FD a node answers in one frame (NODE_SAMPLE), on classic CAN in three (NODE_ACC, NODE_GYR, NODE_MAG).
An `AnswerFormat` is one of the two, so that the rest of the code need not care which.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntFlag
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from common.can.frame import CanFrame
from common.errors import ConfigError, ConfigMistake
from common.quaternion import Array
from common.wire.messages import Mask
from master.suit.layout import AnswerLayout, LayoutError, Raw
from master.suit.nodes import NodeConfig

if TYPE_CHECKING:
    from cantools.database.can import Message

READINGS = tuple(f"{sensor}_{axis}" for sensor in ("ACC", "GYR", "MAG") for axis in "XYZ")
"""Order of a node's nine readings everywhere: accelerometer, gyro, magnetometer; x, y, z."""
FD_MESSAGES = ("NODE_SAMPLE",)
CLASSIC_MESSAGES = ("NODE_ACC", "NODE_GYR", "NODE_MAG")
NO_VALUE = -32768
"""Magnetometer counts of a sample without a magnetic reading."""
MAG_OVERFLOW = -4096
"""What the HMC5883L writes for an axis that overflowed (its data sheet, "Data Output X Registers")."""
LARGEST_ID = 0x7FF
TICK_MASK = 0xFFFF_FFFF
SHIPPED_DBC = Path(__file__).with_name("suit.dbc")
"""The description that comes with tandem."""


class NodeStatus(IntFlag):
    """Status bits of an answer."""

    FAULT = 1
    """The node's own check failed: its readings are not to be used."""
    SATURATED = 2
    """A reading is at the end of its range."""


@dataclass(frozen=True, slots=True)
class AnswerFormat:
    """How a node answers: the layouts of its frames, in the order of the readings they carry."""

    fd: bool
    parts: tuple[AnswerLayout, ...]
    """All of one shape; they differ by identifier and scale only."""
    scale: Array
    """SI per count of the nine readings, (9,)."""

    @property
    def length(self) -> int:
        """Data bytes of each frame."""
        return self.parts[0].length

    @property
    def readings_a_part(self) -> int:
        """Readings in each frame."""
        return len(READINGS) // len(self.parts)


class SuitProtocol:
    """Frames of the suit, laid out by a DBC."""

    def __init__(
        self, sync_id: int, fd: AnswerFormat, classic: AnswerFormat, source: Path | str = SHIPPED_DBC
    ) -> None:
        """`source`: the file that describes them, for messages."""
        self._source = source
        self.sync_id = sync_id
        self.fd = fd
        self.classic = classic
        self.acc_scale = float(fd.scale[0])
        """m/s² per count."""
        self.gyr_scale = float(fd.scale[3])
        """rad/s per count."""
        self.mag_scale = float(fd.scale[6])
        """µT per count."""

    @classmethod
    def load(cls, dbc_path: Path | str = SHIPPED_DBC) -> SuitProtocol:
        """Read the DBC. Raises ConfigError naming the message and signal that are not as expected."""
        messages = read_messages(dbc_path)
        try:
            sync = messages["SYNC"]
            if (sync.length, [(s.name, s.start, s.length) for s in sync.signals]) != (4, [("TICK", 0, 32)]):
                raise LayoutError("SYNC: expected 4 bytes, all of them TICK")
            fd = _format(messages, FD_MESSAGES, fd=True)
            classic = _format(messages, CLASSIC_MESSAGES, fd=False)
            if (fd.scale != classic.scale).any():
                raise LayoutError("NODE_SAMPLE: expected the factors of NODE_ACC, NODE_GYR and NODE_MAG")
            _apart(sync.frame_id, fd, classic)
        except KeyError as error:
            raise _mistake(dbc_path, f"a message {error}") from None
        except LayoutError as error:
            raise _mistake(dbc_path, str(error)) from None
        return cls(sync.frame_id, fd, classic, dbc_path)

    def identifiers(self, nodes: Sequence[NodeConfig], fd: Mapping[str, bool]) -> dict[tuple[str, int], str]:
        """What each identifier of each bus is, by bus and identifier.

        Each frame of a bus must have an 11-bit identifier of its own. Raises ConfigError naming both.

        A node's identifiers are those of the messages plus its number: with messages that lie close together
        two nodes may get the same, and only one of them would be heard.
        """
        taken = {(bus, self.sync_id): "SYNC" for bus in fd}
        mistakes = []
        for node in nodes:
            for part in self.answer_format(fd[node.bus]).parts:
                frame_id, what = part.base_id + node.id, f"{part.name} of node {node.id}"
                other = taken.setdefault((node.bus, frame_id), what)
                if other != what:
                    expected = f"identifiers that differ: {what} and {other} on bus {node.bus} have the same"
                    mistakes.append(ConfigMistake("dbc", f"{frame_id:#x}", expected))
                if frame_id > LARGEST_ID:
                    expected = f"at most {LARGEST_ID:#x} (11 bits) as the identifier of {what}"
                    mistakes.append(ConfigMistake("dbc", f"{frame_id:#x}", expected))
        if mistakes:
            raise ConfigError(self._source, mistakes)
        return taken

    def answer_format(self, fd: bool) -> AnswerFormat:
        """How nodes answer on a bus of that kind."""
        return self.fd if fd else self.classic

    def sync(self, tick: int) -> CanFrame:
        """The master's question: sample now, and answer with this tick. Classic on either kind of bus."""
        return CanFrame(self.sync_id, (tick & TICK_MASK).to_bytes(4, "little"), fd=False)

    def parse_sync(self, data: bytes) -> int:
        """The tick of a SYNC. Raises ValueError where the length is wrong."""
        if len(data) != 4:
            raise ValueError(f"a SYNC has 4 bytes, not {len(data)}")
        return int.from_bytes(data, "little")

    def encode_sample(self, node_id: int, raw: Raw, tick: int, status: int, fd: bool) -> list[CanFrame]:
        """The answer of a node: raw (9,) counts (ACC, GYR, MAG), in one frame on CAN FD, else in three."""
        form = self.answer_format(fd)
        step = form.readings_a_part
        frames = []
        for place, part in enumerate(form.parts):
            frame_id = part.base_id + node_id
            readings = raw[step * place : step * (place + 1)]
            frames.append(CanFrame(frame_id, part.encode(frame_id, readings, tick, status), fd))
        return frames


def si_readings(raw: Raw, scale: Array, without_mag: Mask | None) -> Array:
    """Counts (n, 9) in SI units, `scale` (9,); NaN where there is no magnetic reading.

    `without_mag` (n,): nodes that have no magnetometer; None: each has one.
    """
    values: Array = raw * scale
    mag = raw[:, 6:]
    blank = (mag == NO_VALUE) | (mag == MAG_OVERFLOW)
    # no power or an open bus: a field of exactly nothing on three axes
    blank |= ((mag == 0) | (mag == -1)).all(axis=1)[:, None]
    if without_mag is not None or blank.any():
        # two thirds of a field are no direction: one blank axis blanks all three
        blanked = blank.any(axis=1)
        values[blanked if without_mag is None else blanked | without_mag, 6:] = np.nan
    return values


def read_messages(path: Path | str) -> dict[str, Message]:
    """The messages of a DBC by name. Raises ConfigError."""
    import cantools  # only here: it is slow to import, and nothing but the layout needs it

    database = cantools.database.can.Database()
    try:
        database.add_dbc_file(path)
    except OSError as error:
        raise _mistake(path, f"a readable DBC ({error.strerror})") from None
    except Exception as error:  # its parser raises errors of several libraries
        raise _mistake(path, f"a DBC that cantools can read ({error})") from None
    return {message.name: message for message in database.messages}


def _format(messages: dict[str, Message], names: tuple[str, ...], fd: bool) -> AnswerFormat:
    step = len(READINGS) // len(names)
    parts = []
    for place, name in enumerate(names):
        message = messages[name]
        if message.is_fd != fd:
            raise LayoutError(f"{name}: expected VFrameFormat StandardCAN{'_FD' if fd else ''}")
        parts.append(AnswerLayout(message, READINGS[step * place : step * (place + 1)]))
    first = parts[0]
    for part in parts[1:]:
        if not part.same_shape(first):
            raise LayoutError(f"{part.name}: expected TICK, STATUS and CRC where {first.name} has them")
    return AnswerFormat(fd, tuple(parts), np.concatenate([part.scale for part in parts]))


def _apart(sync_id: int, *forms: AnswerFormat) -> None:
    """Messages of one bus need identifiers of their own, whatever the nodes' numbers."""
    for form in forms:
        names = {sync_id: "SYNC"}
        for part in form.parts:
            other = names.setdefault(part.base_id, part.name)
            if other != part.name:
                raise LayoutError(f"{part.name}: expected an identifier that {other} does not have")


def _mistake(path: Path | str, expected: str) -> ConfigError:
    return ConfigError(path, [ConfigMistake("dbc", Path(path).name, expected)])
