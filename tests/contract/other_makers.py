"""Frames of other makers' nodes as a text file: time in ns, identifier and data in hexadecimal."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from common.can.frame import CanFrame


@dataclass(frozen=True)
class OtherMakers:
    """Frames in the order in which they are on the bus."""

    at_ns: list[int]
    frames: list[CanFrame]

    @classmethod
    def read(cls, path: Path) -> OtherMakers:
        """The frames of a file."""
        rows = [line.split() for line in path.read_text("utf-8").splitlines()]
        frames = [CanFrame(int(frame_id, 16), bytes.fromhex(data), fd=False) for _, frame_id, data in rows]
        return cls([int(at) for at, _, _ in rows], frames)

    def write(self, path: Path) -> None:
        """One line a frame."""
        rows = zip(self.at_ns, self.frames, strict=True)
        text = "".join(f"{at} {frame.id:x} {frame.data.hex()}\n" for at, frame in rows)
        path.write_text(text, "utf-8")
