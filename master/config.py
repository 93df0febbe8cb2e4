"""The master's TOML file: which robot, which nodes on which buses, how to estimate, where to send."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from common.can.config import BusConfig
from common.clock_sync.config import ClockConfig
from common.config.console import ConsoleConfig
from common.config.section import RelativePath, Section
from common.errors import ConfigError, ConfigMistake
from common.link.config import LinkConfig
from common.link.voice_config import VoiceConfig
from common.process.realtime import ProcessConfig
from common.recording.config import RecordingConfig
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.load import ProfileName
from common.tap.config import TapConfig, socket_mistakes
from master.alarms.config import AlarmsConfig
from master.capture.config import SuitSection
from master.capture.rate import USUAL_HZ, CaptureRate
from master.capture.source import suit_mistakes
from master.comfort.config import ZeroPoseAgainConfig
from master.comfort.scaling import scaling_mistakes
from master.deadman.config import CanButton, ClutchConfig, ConsoleHold, DeadmanConfig, Pedal
from master.orientation.config import EstimationConfig
from master.orientation.filters import filter_mistakes
from master.suit.nodes import NodeConfig, wiring_mistakes
from master.suit.plausibility_config import PlausibilityConfig
from master.suit.protocol import SHIPPED_DBC

RobotName = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]{1,64}$")]
RobotPattern = Annotated[str, Field(pattern=r"^[A-Za-z0-9_.*-]{1,64}$")]
"""A robot's name, or a pattern of names such as `*` or `ward-*`."""


def _one_or_more(value: object) -> object:
    """`robots = "*"` is short for `robots = ["*"]`."""
    return [value] if isinstance(value, str) else value


class CaptureConfig(Section):
    """`[capture]`: how the nodes are polled."""

    rate_hz: int = Field(200, ge=10, le=1000)
    """SYNC frames a second."""
    command_hz: Literal["auto"] | Annotated[float, Field(ge=0.2, le=1000.0)] = USUAL_HZ
    """Commands a second: 12.5, 25, 50, or "auto", as the robots' lines allow (docs/command-rate.md)."""
    decimation: int | None = Field(None, ge=1, le=1000)
    """In place of `command_hz`: one tick in this many yields a command, 200 / 16 = 12.5 Hz."""
    lost_after: int = Field(20, ge=1, le=10_000)
    """Missed ticks in a row after which a node counts as lost."""
    dbc: RelativePath = SHIPPED_DBC
    """The DBC file that describes the frames of nodes that answer SYNC, and the buttons'."""
    plausibility: PlausibilityConfig = PlausibilityConfig()
    buses: list[BusConfig] = Field(min_length=1)

    @property
    def rate(self) -> CaptureRate:
        """Ticks a second, and which of them decide."""
        return CaptureRate(self.rate_hz, self.command_hz, self.decimation)


class OperatorConfig(Section):
    """`[operator]`: the person who commands."""

    name: str = Field(min_length=1, max_length=64)
    deadman: DeadmanConfig
    """What must be held while the robot follows. There is no default, so that a person decides it."""
    clutch: ClutchConfig | None = None
    """Released, the robot stands while the operator repositions himself. None: there is none."""
    zero_pose_again: ZeroPoseAgainConfig = ZeroPoseAgainConfig()
    scaling: dict[str, Annotated[float, Field(ge=0.1, le=1.0)]] = Field(default_factory=dict)
    """By joint group, the share of the operator's motion that the robot makes; see comfort/scaling.py."""

    def mistakes(self) -> list[ConfigMistake]:
        """Deadman and clutch must be two switches; a socket must be possible where it is named."""
        one, other = self.deadman, self.clutch
        if isinstance(one, ConsoleHold):
            return socket_mistakes("operator.deadman.socket", one.socket)
        if (
            isinstance(one, Pedal)
            and isinstance(other, Pedal)
            and (one.device, one.key) == (other.device, other.key)
        ):
            return [ConfigMistake("operator.clutch.key", other.key, "another key than the deadman's")]
        if isinstance(one, CanButton) and isinstance(other, CanButton) and one.signal == other.signal:
            return [
                ConfigMistake("operator.clutch.signal", other.signal, "another signal than the deadman's")
            ]
        return []


class MasterConfig(Section):
    """The whole file."""

    robots: Annotated[list[RobotPattern], BeforeValidator(_one_or_more)] = Field(default_factory=list)
    """Robots to command, by the names in the slaves' files. Each has its own lease and guard. Robots of a
    pattern, such as "*", are watched, and commanded once `tandem take` asks for them; whom an operator may
    command is what [link.access] says."""
    robot: RobotName | None = None
    """Short for `robots` with one name."""
    profile: ProfileName = "nursing"
    """The skeleton profile of all robots: they are commanded the same joint angles."""
    operator: OperatorConfig
    capture: CaptureConfig
    estimation: EstimationConfig = EstimationConfig()
    nodes: dict[str, NodeConfig]
    suit: SuitSection = SuitSection()
    link: LinkConfig
    clock: ClockConfig = ClockConfig()
    process: ProcessConfig = ProcessConfig()
    alarms: AlarmsConfig = AlarmsConfig()
    tap: TapConfig = TapConfig()
    recording: RecordingConfig = RecordingConfig()
    voice: VoiceConfig = VoiceConfig()
    console: ConsoleConfig = ConsoleConfig()

    @property
    def commanded(self) -> list[str]:
        """The names of the robots to command from the start."""
        return [name for name in self._named if "*" not in name]

    @property
    def watched(self) -> list[str]:
        """Patterns of the robots to watch, and to command when they are taken."""
        return [name for name in self._named if "*" in name]

    @property
    def _named(self) -> list[str]:
        return self.robots if self.robot is None else [self.robot]

    @property
    def skeleton(self) -> Skeleton:
        """The robot's table."""
        return load_skeleton(self.profile)

    def mistakes(self) -> list[ConfigMistake]:
        """Nodes and buses must agree with the profile and with each other."""
        try:
            skeleton = self.skeleton
        except ConfigError as error:
            return error.mistakes
        return [
            *self._robot_mistakes(),
            *self._switch_mistakes(),
            *self.capture.rate.mistakes(),
            *wiring_mistakes(self.nodes, self.capture.buses, "capture.buses"),
            *node_mistakes(self.nodes, skeleton, self.suit.without_node),
            *suit_mistakes(self.nodes, self.suit, self.capture.buses, skeleton.segment_names),
            *self.operator.zero_pose_again.mistakes_for(skeleton.segment_names, self.estimation.zero_pose_s),
            *scaling_mistakes(self.operator.scaling, skeleton),
            *self.estimation.mistakes_at(self.capture.rate_hz),
            *self.link.mistakes(),
            *self.tap.mistakes(),
            *self.recording.mistakes_with(self.tap.socket),
            *self.console.mistakes(),
        ]

    def _switch_mistakes(self) -> list[ConfigMistake]:
        buses = [bus.name for bus in self.capture.buses]
        switches = {"deadman": self.operator.deadman, "clutch": self.operator.clutch}
        return self.operator.mistakes() + [
            ConfigMistake(
                f"operator.{name}.bus", switch.bus, f"a bus of [[capture.buses]]: {', '.join(buses)}"
            )
            for name, switch in switches.items()
            if isinstance(switch, CanButton) and switch.bus not in buses
        ]

    def _robot_mistakes(self) -> list[ConfigMistake]:
        if self.robot is not None and self.robots:
            return [ConfigMistake("robot", self.robot, "only one of robot and robots")]
        if not self._named:
            return [ConfigMistake("robots", self.robots, "the name of at least one robot, or a pattern")]
        twice = [name for i, name in enumerate(self._named) if name in self._named[:i]]
        return [ConfigMistake("robots", name, "each robot once") for name in twice]


def node_mistakes(
    nodes: dict[str, NodeConfig], skeleton: Skeleton, without: Mapping[str, str]
) -> list[ConfigMistake]:
    """Segments without a node and without a word about it, nodes without a segment, unknown filters."""
    missing = [name for name in skeleton.segment_names if name not in nodes and name not in without]
    foreign = [name for name in nodes if name not in skeleton.segment_names]
    named = [(name, node.filter) for name, node in nodes.items() if node.filter is not None]
    return [
        *(mistake for n, own in named for mistake in filter_mistakes(f"nodes.{n}.filter", own)),
        *(
            ConfigMistake(
                f"nodes.{n}",
                None,
                f"a node, as {skeleton.name} has one there, or a word in suit.without_node",
            )
            for n in missing
        ),
        *(ConfigMistake(f"nodes.{n}", n, f"a segment of the profile {skeleton.name}") for n in foreign),
    ]
