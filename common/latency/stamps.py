"""The stamps of one command, from the operator's posture to the encoder that followed. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate, pairwise

from common.clock_sync import Offset

STAGES = (
    "sampled→frames in",
    "frames in→joint angles",
    "joint angles→put",
    "put→received",
    "received→accepted",
    "accepted→written",
    "written→moved",
)
"""Between neighbouring stamps of a Passage. Only `put→received` crosses from one clock to the other."""


@dataclass(frozen=True, slots=True)
class Passage:
    """One command's stamps, from the operator's posture to the encoder that followed."""

    sampled_ns: int
    """Master's clock, as the next three."""
    frames_in_ns: int
    angles_ns: int
    put_ns: int
    """Right before the command is encoded, since it is in the command: `put→received` holds the encoding."""
    received_ns: int
    """Slave's clock, as the next three. In the link's thread, before the loop wakes."""
    accepted_ns: int
    """The loop took it up, and the gates then let it pass: to judge it is part of `accepted→written`."""
    written_ns: int
    """The first setpoint after that was handed to the servos."""
    moved_ns: int
    """The first encoder reading after that which differs; a robot that moves already differs at once."""

    def stages_ns(self, offset: Offset) -> list[int]:
        """How long each of STAGES took. `offset` is the master's clock minus the slave's.

        All stamps are brought onto the master's clock. An offset that is off can put a stamp before the
        one it follows; it is then moved up to it and the next stage is the shorter, so that the stages still
        add up to the whole.
        """
        on_slave = (self.received_ns, self.accepted_ns, self.written_ns, self.moved_ns)
        on_master = (self.sampled_ns, self.frames_in_ns, self.angles_ns, self.put_ns)
        stamps = accumulate((*on_master, *map(offset.remote_ns, on_slave)), max)
        return [after - before for before, after in pairwise(stamps)]
