"""What a host needs for its role, taken from its TOML file: the rest of the doctor knows no file."""

from __future__ import annotations

import tomllib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path

from common.can.config import BusConfig
from common.clock_sync.config import ClockConfig
from common.config.load import load_config
from common.errors import TandemError
from common.link.config import LinkConfig
from common.link.roles import Role, common_name
from common.link.router import RouterConfig
from common.skeleton import Skeleton
from deploy.sim.suit.config import SuitConfig
from master.capture.source import suit_source
from master.config import MasterConfig
from master.deadman.config import SwitchConfig
from master.suit.protocol import SuitProtocol
from slave.config import SlaveConfig
from slave.servos.backend import BackendConfig
from slave.servos.canopen.config import CanopenConfig
from slave.servos.dynamixel.config import DynamixelConfig
from slave.stop_inputs.config import EstopConfig

GENERAL = "host"
"""The role where no file is given."""


class CameraNeed(StrEnum):
    """Where a slave's pictures come from."""

    OFF = "off"
    DRAWN = "robot"
    V4L2 = "v4l2"


@dataclass(frozen=True, slots=True)
class BusNeed:
    """One CAN bus and what goes over it."""

    bus: BusConfig
    nodes: int = 0
    """Sensor nodes that answer each tick; 0 where others hang on it."""
    rate_hz: float = 0.0
    drives: int = 0
    """A robot's drives, each commanded and read at every SYNC …"""
    bits_per_s: float = 0.0
    """… and what they put on the bus, heartbeats included."""


@dataclass(frozen=True, slots=True)
class Needs:
    """What one host must provide."""

    role: str = GENERAL
    buses: tuple[BusNeed, ...] = ()
    realtime_priority: int = 0
    serial_ports: tuple[str, ...] = ()
    servos: DynamixelConfig | None = None
    """The servos on a serial bus, which is one of the ports."""
    no_effort: dict[str, str] = field(default_factory=dict)
    """Why the file lets no effort be known of a joint."""
    not_driven: dict[str, str] = field(default_factory=dict)
    """Joints without a servo, in words."""
    camera: CameraNeed = CameraNeed.OFF
    camera_device: str = ""
    other_cameras: tuple[tuple[str, CameraNeed, str], ...] = ()
    """Name, source and device of those beside it."""
    link: LinkConfig = field(default_factory=LinkConfig)
    clock: ClockConfig | None = None
    estop: EstopConfig | None = None
    """A slave's emergency stop inputs."""
    simulated: bool = False
    """Whether its robot is simulated."""
    reset_key: bool = False
    robots: tuple[str, ...] = ()
    """Whom it commands."""
    operator: str = ""
    switches: dict[str, SwitchConfig] = field(default_factory=dict)
    """What the operator holds: `deadman`, and `clutch` if there is one."""
    certified_as: str = ""
    """The common name that its certificate should have; empty where none is known."""


def needs_of(path: Path, overrides: Sequence[str] = ()) -> Needs:
    """The needs of a master's, slave's, suit's or router's file, known by its keys. Raises ConfigError."""
    keys = _keys(path)
    if "capture" in keys or "operator" in keys:
        return _of_master(load_config(path, MasterConfig, overrides))
    if "buses" in keys or "motion" in keys:
        return _of_suit(load_config(path, SuitConfig, overrides))
    if keys <= set(RouterConfig.model_fields):
        return _of_router(load_config(path, RouterConfig, overrides))
    return _of_slave(load_config(path, SlaveConfig, overrides))


def _keys(path: Path) -> set[str]:
    try:
        return set(tomllib.loads(path.read_text("utf-8")))
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise TandemError(f"{path}: expected a readable TOML file ({reason})") from None


def _of_master(config: MasterConfig) -> Needs:
    fd = {bus.name: bus.fd for bus in config.capture.buses}
    names, protocol = config.skeleton.segment_names, SuitProtocol.load(config.capture.dbc)
    suit_source(names, config.nodes, config.suit, protocol, config.capture.lost_after, fd)
    nodes = Counter(node.bus for node in config.nodes.values())
    return Needs(
        role="master",
        buses=tuple(BusNeed(bus, nodes[bus.name], config.capture.rate_hz) for bus in config.capture.buses),
        realtime_priority=config.process.realtime_priority,
        link=config.link,
        clock=config.clock,
        robots=tuple(config.commanded),
        operator=config.operator.name,
        switches={"deadman": config.operator.deadman}
        | ({} if config.operator.clutch is None else {"clutch": config.operator.clutch}),
        certified_as=common_name(Role.OPERATOR, config.operator.name),
    )


def _of_slave(config: SlaveConfig) -> Needs:
    skeleton, ports = config.skeleton, []
    dynamixel = config.servos.used(DynamixelConfig)
    if dynamixel is not None:
        ports.append(dynamixel.port)
    canopen = config.servos.used(CanopenConfig)
    if config.base.source == "serial":
        ports.append(config.base.port)
    return Needs(
        role="slave",
        buses=() if canopen is None else _of_drives(canopen, _share(config, CanopenConfig)),
        servos=dynamixel,
        realtime_priority=config.process.realtime_priority,
        serial_ports=tuple(ports),
        estop=config.estop,
        simulated=config.servos.simulated,
        reset_key=bool(config.guard.reset_key),
        no_effort=config.servos.no_effort(skeleton),
        not_driven=config.servos.not_driven(skeleton),
        camera=CameraNeed(config.camera.source),
        camera_device=config.camera.device,
        other_cameras=tuple((one.name, CameraNeed(one.source), one.device) for one in config.camera.others),
        link=config.link,
        clock=config.clock,
        certified_as=common_name(Role.ROBOT, config.robot),
    )


def _share(config: SlaveConfig, kind: type[BackendConfig]) -> Skeleton:
    return config.servos.share(kind, config.skeleton, config.encoders).skeleton


def _of_drives(canopen: CanopenConfig, skeleton: Skeleton) -> tuple[BusNeed, ...]:
    loads = canopen.load(skeleton)
    return tuple(
        BusNeed(bus, rate_hz=canopen.sync_hz, drives=loads[bus.name][0], bits_per_s=loads[bus.name][1])
        for bus in canopen.buses
    )


def _of_suit(config: SuitConfig) -> Needs:
    return Needs(role="suit", buses=tuple(map(BusNeed, config.buses)))


def _of_router(config: RouterConfig) -> Needs:
    return Needs(role="router", link=config.link, certified_as=common_name(Role.ROUTER, config.name))
