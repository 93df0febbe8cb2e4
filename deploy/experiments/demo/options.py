"""What a person may choose of a demo, and what it changes in the processes' files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from common.config.load import load_config
from common.errors import TandemError
from common.skeleton import load_skeleton
from deploy.examples.profiles import NURSING, example
from deploy.sim.drives.mixture import mixture
from deploy.sim.suit.config import SuitConfig
from master.config import MasterConfig
from slave.config import SlaveConfig

HOME_KEY = "demo-posture"
"""The reset key of a demo's robot whose posture a person has to confirm."""
RECORDED = ("master", "slave")
"""The processes whose taps are recorded."""


@dataclass(frozen=True, slots=True)
class DemoOptions:
    """What the command line chose."""

    profile: str = NURSING
    seconds: float = 20.0
    transport: str = "tcp"
    replay: Path | None = None
    motion: str | None = None
    """None: the one in the profile's example file."""
    slower: float = 1.0
    """How many times slower than recorded the motion `capture` is played."""
    strategy: str = "predict"
    filter: str = "vqf"
    seed: int = 1
    robots: int = 1
    """How many robots follow the one operator; several show no pictures of their cameras."""
    servos: Literal["mujoco", "canopen", "makers"] = "mujoco"
    """`canopen`: simulated drives in a process of their own, on two CAN buses; `makers`: of five makers."""
    camera: bool = True
    """Whether the robot shows what it sees."""
    console: bool = False
    """Whether `tandem console` runs beside the master."""
    listen: str | None = None
    """Where it serves its page; None: at its usual port if that is free, else at any."""
    keep: bool = False
    """Whether all goes on until Ctrl-C; nothing is judged then."""
    record: Path | None = None
    """The folder into which master and first robot are recorded; None: they are not."""

    def overrides(self) -> dict[str, list[str]]:
        """What it changes in the processes' files."""
        suit = [f"seed={self.seed}"]
        if self.motion is not None:
            suit.append(f'motion="{self.motion}"')
        if self.slower != 1.0:
            suit.append(f"people.slower={self.slower}")
        master = [f'estimation.filter="{self.filter}"']
        if self.replay is not None or self._begins_in_the_zero_pose():
            # zeroed there, as the paper's reference was
            master.append("estimation.zero_pose_s=1.0")
        if self.replay is not None:
            suit.append(f'replay="{self.replay.resolve()}"')
        camera = "robot" if self.camera and self.robots == 1 else "off"
        slave = [f'track.strategy="{self.strategy}"', f'camera.source="{camera}"']
        if self.robots > 1:
            # robots have hosts of their own; here, with priority, they would starve the processes that watch
            slave.append("process.realtime_priority=0")
        overrides = {"slave": slave, "suit": suit, "master": master}
        if self.servos != "mujoco":
            slave.append('servos.backend="canopen"')
            overrides["drives"] = []
        if self.servos == "makers":
            # drives without an encoder at the joint: a person confirms where the robot stands
            override = mixture(load_skeleton(self.profile)).override
            slave += [override, f'guard.reset_key="{HOME_KEY}"']
            overrides["drives"].append(override)
        return overrides

    def command_options(self) -> dict[str, Sequence[str]]:
        """What it adds to the processes' command lines."""
        return {"drives": mixture(load_skeleton(self.profile)).arguments} if self.servos == "makers" else {}

    @property
    def home_key(self) -> str:
        """With which the robot's posture is confirmed; empty: nobody needs to."""
        return HOME_KEY if self.servos == "makers" else ""

    def _begins_in_the_zero_pose(self) -> bool:
        """A simulated operator moves as the robot can: where its elbow is never straight, hers is not."""
        robot = load_skeleton(self.profile)
        return bool(((robot.lower_rad <= robot.zero_rad) & (robot.zero_rad <= robot.upper_rad)).all())

    def check(self) -> None:
        """Read the files as the processes will. Raises TandemError for what cannot be run."""
        if self.robots > 1 and (self.replay or self.record or self.servos != "mujoco"):
            expected = "the simulated operator and MuJoCo, unrecorded: omit --replay, --record and --servos"
            raise TandemError(f"--robots {self.robots}: several robots need {expected}")
        taken = self.recordings_there()
        if taken:
            expected = "a folder without recordings of an earlier demo"
            raise TandemError(f"--record {self.record}: {taken[0].name} is there; expected {expected}")
        overrides = self.overrides()
        for role, model in (("suit", SuitConfig), ("slave", SlaveConfig), ("master", MasterConfig)):
            load_config(example(role, self.profile), model, overrides[role])

    def recordings_there(self) -> list[Path]:
        """What a recording of this demo would overwrite."""
        files = [] if self.record is None else [self.record / f"{name}.mcap" for name in RECORDED]
        return [file for file in files if file.exists()]

    def tree(self) -> dict[str, object]:
        """A report's `options`."""
        motion = self.motion or load_config(example("suit", self.profile), SuitConfig).motion
        return {
            "profile": self.profile,
            "seconds": self.seconds,
            "transport": self.transport,
            "motion": motion if self.replay is None else self.replay.name,
            "strategy": self.strategy,
            "filter": self.filter,
            "seed": self.seed,
            "servos": self.servos,
            "robots": self.robots,
        }
