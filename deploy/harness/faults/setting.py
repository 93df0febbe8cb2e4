"""What differs from the usual scene of a trial: another suit or posture, more time before."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import date
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from common.config.sensor_calibration import Made
from common.quaternion import IDENTITY, Array
from common.skeleton import load_skeleton
from deploy.examples.profiles import NURSING
from deploy.sim.suit.motion import OperatorMotion
from master.calibrate.node_file import write_calibration


@dataclass(frozen=True, slots=True)
class Setting:
    """What differs from the usual scene."""

    lead_s: float = 0.0
    """So much longer the operator stands still at first; a multiple of the 0.08 s between two commands."""
    suit: tuple[str, ...] = ()
    """Overrides of the suit's example file."""
    master: tuple[str, ...] = ()
    """Overrides of the master's."""
    slave: tuple[str, ...] = ()
    """Overrides of the slave's."""
    aligned: bool = False
    """The nodes' alignment is known, so that a lean in the zero pose can be detected."""
    one_way_ms: float = 2.0
    """Of the link, until the fault."""
    patient: bool = False
    """Whether somebody may stand in the robot's way."""
    profile: str = NURSING
    """The robot's, the suit's and the master's."""
    motion: Callable[[], OperatorMotion] | None = None
    """The operator's motion, None for the usual reach."""

    @property
    def any_robot(self) -> bool:
        """Whether nothing in the scene is of the nursing robot alone: its postures, zones or thresholds."""
        own = (self.slave, self.patient, self.motion)
        return not any(own)


USUAL = Setting()


class Later:
    """A motion that begins later: until then its first posture."""

    def __init__(self, motion: OperatorMotion, lead_s: float) -> None:
        self._motion, self._lead_s = motion, lead_s
        self.period_s = motion.period_s + lead_s

    def state(self, t_s: ArrayLike) -> tuple[Array, Array, Array]:
        """Angles, rates and accelerations at that time."""
        return self._motion.state(np.maximum(0.0, np.asarray(t_s) - self._lead_s))


@contextmanager
def files(setting: Setting) -> Iterator[list[str]]:
    """The overrides of the master's file, and meanwhile the calibrations that they name."""
    if not setting.aligned:
        yield list(setting.master)
        return
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "straight.toml"
        made = Made(date=date.today(), recording="none: straight by construction", unit="rad")
        write_calibration(file, {"alignment": (IDENTITY, made)})
        names = load_skeleton(setting.profile).segment_names
        yield [*setting.master, *(f"nodes.{name}.calibration={json.dumps(str(file))}" for name in names)]
