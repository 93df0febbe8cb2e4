"""What a TOML says of the simulated suit."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from common.can.config import BusConfig
from common.config.section import RelativePath, Section
from common.errors import ConfigError, ConfigMistake
from common.link.config import LinkConfig
from common.process.realtime import ProcessConfig
from common.skeleton import load_skeleton
from common.skeleton.load import ProfileName
from deploy.sim.suit.disturbance import DisturbanceConfig
from deploy.sim.suit.faults import FaultsConfig
from deploy.sim.suit.imperfections import GradeName
from deploy.sim.suit.motion import motion_mistakes
from deploy.sim.suit.people import PeopleConfig
from deploy.sim.suit.tray import TrayConfig
from master.suit.nodes import NodeConfig, wiring_mistakes
from master.suit.protocol import SHIPPED_DBC

QuaternionList = Annotated[list[float], Field(min_length=4, max_length=4)]


class FieldConfig(Section):
    """`[field]`: the earth's magnetic field where the operator stands."""

    strength_ut: float = Field(default=50.0, gt=0.0, le=100.0)
    """µT; the earth's is 25 to 65."""
    dip_deg: float = Field(default=60.0, ge=-90.0, le=90.0)
    """Angle below the horizon, degrees; negative south of the magnetic equator."""


class SuitConfig(Section):
    """The whole file of `tandem suit`. Buses and nodes are as in the master's file."""

    robot: str = Field(default="robot-1", pattern=r"^[A-Za-z0-9_.-]{1,64}$")
    """Under whose name the truth is published."""
    profile: ProfileName = "nursing"
    """The skeleton that wears it."""
    dbc: RelativePath = SHIPPED_DBC
    """Description of the frames."""
    buses: list[BusConfig] = Field(min_length=1)
    nodes: dict[str, NodeConfig]
    """The nodes by segment; segments without a node stay silent."""
    motion: str = "bottle"
    """What the operator does: `bottle`, `grasp`, `walk` (each of one profile), `calibration_pose`, `sweep`,
    `postures` (a person's, from one to the next);
    to calibrate: `tray` (all units in it are turned about), `move_joints` (the zero pose, then every joint
    moves), `calibration` (the tray once, then move_joints); `capture` (real people, `[people]`). Not used
    with `replay`."""
    people: PeopleConfig = PeopleConfig()
    tray: TrayConfig = TrayConfig()
    seed: int = Field(default=0, ge=0)
    """Decides the units' errors, their noise and the faults."""
    grade: GradeName = "calibrated"
    """How good the sensors are: `ideal` (quantised only), `calibrated`, `raw` (as delivered)."""
    field: FieldConfig = FieldConfig()
    disturbance: DisturbanceConfig = DisturbanceConfig()
    alignment: dict[str, QuaternionList] = Field(default={})
    """q_segment_from_sensor (wxyz) of nodes that sit askew, by segment; others are aligned with it."""
    faults: FaultsConfig = FaultsConfig()
    replay: RelativePath | None = None
    """A recording (npz) to play instead of the motion: no magnetometers then, and no truth."""
    process: ProcessConfig = ProcessConfig()
    link: LinkConfig = LinkConfig()
    """Where the truth is published; not at all where it names no endpoint."""

    def mistakes(self) -> list[ConfigMistake]:
        """Names that nothing has, ids used twice, quaternions that are no rotation."""
        mistakes = wiring_mistakes(self.nodes, self.buses, "buses") + self.link.mistakes()
        for name, q in self.alignment.items():
            if not abs(math.hypot(*q) - 1.0) < 1e-3:
                mistakes.append(ConfigMistake(f"alignment.{name}", q, "a quaternion (wxyz) of length 1"))
        mistakes += self.faults.unknown_nodes(list(self.nodes))
        try:
            skeleton = load_skeleton(self.profile)
        except ConfigError as error:
            return mistakes + error.mistakes
        if self.replay is None:
            mistakes += motion_mistakes(self.motion, skeleton.name)
        mistakes += [
            ConfigMistake(
                "disturbance.local.nodes", name, f"a segment of the profile {skeleton.name}, or all"
            )
            for name in self.disturbance.unknown_nodes(list(skeleton.segment_names))
        ]
        for key, names in (("nodes", self.nodes), ("alignment", self.alignment)):
            mistakes += [
                ConfigMistake(f"{key}.{name}", name, f"a segment of the profile {skeleton.name}")
                for name in names
                if name not in skeleton.segment_names
            ]
        return mistakes
