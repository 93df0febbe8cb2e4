"""The simulated suit without I/O: a SYNC in, the nodes' answers and the truth out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from common.can.config import BusConfig
from common.clock import to_s
from common.quaternion import IDENTITY, Array
from common.skeleton import Skeleton, load_skeleton
from common.wire.messages import Truth
from deploy.sim.suit.config import SuitConfig
from deploy.sim.suit.disturbance import Disturbance, DisturbanceConfig
from deploy.sim.suit.encode import BatchEncoder
from deploy.sim.suit.faults import Faults, NodeAnswer, Outgoing
from deploy.sim.suit.imperfections import Counts, Imperfections, quantise
from deploy.sim.suit.motion import OperatorMotion, load_motion
from deploy.sim.suit.replay import Replay, load_replay
from deploy.sim.suit.sensors import IdealSensors, earth_field_ut
from deploy.sim.suit.tray import Tray
from deploy.sim.suit.wrong_readings import WrongReadings
from master.suit.nodes import NodeConfig
from master.suit.number import tick_of
from master.suit.protocol import NO_VALUE, NodeStatus, SuitProtocol

Bits = NDArray[np.int64]
_OTHER_AXES = [1, 2, 0, 4, 5, 3, 7, 8, 6]


@dataclass(frozen=True, slots=True)
class SuitAnswer:
    """What one SYNC brings about."""

    frames: list[Outgoing]
    truth: Truth | None
    """None where a recording is played: its truth is unknown."""


@dataclass(frozen=True, slots=True)
class Wearing:
    """The wearer of the suit at one instant."""

    readings: Array
    """(N, 9) what the sensors read, before quantisation."""
    joints: tuple[Array, Array] | None
    """True positions and velocities, (J,) each."""


class Wearer(Protocol):
    """The wearer of the suit: a simulated operator, or a recording of a real one."""

    @property
    def magnetic(self) -> bool:
        """Whether the readings include a magnetometer's."""

    @property
    def noisy(self) -> bool:
        """Whether the readings have a sensor's noise; else the converter's last bit is made to move."""

    def at(self, t_s: float) -> Wearing:
        """The instant `t_s` after the first SYNC."""


class SimulatedOperator:
    """Makes a motion in the earth's field, wearing sensors of some grade."""

    magnetic = True

    def __init__(self, motion: OperatorMotion, sensors: IdealSensors, imperfections: Imperfections) -> None:
        self._motion = motion
        self._sensors = sensors
        self._imperfections = imperfections
        self.noisy = imperfections.noisy

    def at(self, t_s: float) -> Wearing:
        """The motion at that time; draws new noise at each call."""
        position, velocity, acceleration = self._motion.state(t_s)
        readings = self._sensors.read(position, velocity, acceleration, t_s)
        return Wearing(self._imperfections.apply(readings), (position, velocity))


class CalibratingOperator:
    """Turns all units about in their tray, and may put them on afterwards."""

    magnetic = True

    def __init__(
        self, tray: Tray, field_ut: Array, imperfections: Imperfections, then: Wearer | None = None
    ) -> None:
        """Without `then` the tray is turned for ever."""
        self._tray = tray
        self._field_ut = field_ut
        self._imperfections = imperfections
        self._then = then
        self.noisy = imperfections.noisy

    def at(self, t_s: float) -> Wearing:
        """The tray at that time, or the wearer once the units are worn; a tray has no joints."""
        if self._then is not None and t_s >= self._tray.period_s:
            return self._then.at(t_s - self._tray.period_s)
        return Wearing(self._imperfections.apply(self._tray.readings(t_s, self._field_ut)), None)


class RecordedOperator:
    """A recording of a real person, or one that was made up; no error is added but the last bit's."""

    magnetic = False
    noisy = False

    def __init__(self, replay: Replay) -> None:
        self._replay = replay

    def at(self, t_s: float) -> Wearing:
        """The recording at that time."""
        return Wearing(self._replay.readings(t_s), None)


class SimulatedSuit:
    """Answers each SYNC for all its nodes; deterministic for the same seed and the same SYNCs.

    Time runs from the first SYNC: the wearer begins when the master begins to ask.
    """

    def __init__(
        self,
        skeleton: Skeleton,
        nodes: dict[str, NodeConfig],
        buses: Sequence[BusConfig],
        protocol: SuitProtocol,
        wearer: Wearer,
        faults: Faults,
    ) -> None:
        self.faults = faults
        self._wearer = wearer
        self._groups = [_group(skeleton, nodes, bus, protocol) for bus in buses]
        self._without_field = np.array(
            [
                not (wearer.magnetic and name in nodes and nodes[name].magnetometer)
                for name in skeleton.segment_names
            ]
        )
        self._scale = protocol.fd.scale
        self._first_sync_ns: int | None = None
        self._random = np.random.default_rng([len(nodes), 4])
        self._wrong_readings = WrongReadings(skeleton.segment_names, self._scale, seed=len(nodes))

    def on_sync(self, number: int, now_ns: int) -> SuitAnswer:
        """The answers of all nodes on all buses to the SYNC of that number, which they receive `now_ns`.

        The truth bears the tick to which the number belongs: so do the commands.
        """
        if self._first_sync_ns is None:
            self._first_sync_ns = now_ns
        t_ns = now_ns - self._first_sync_ns
        instant = self._wearer.at(to_s(t_ns))
        counts, status = self._counts(instant.readings)
        counts, status = self._wrong_readings.apply(
            self.faults.config.wrong_reading, counts, status, to_s(t_ns)
        )
        answers = self._answers(number, counts, status)
        twins = self.faults.twins(t_ns) if self.faults.config.twin else set()
        if twins is None or twins:
            # another person: the same readings about other axes
            others = self._answers(number, counts[:, _OTHER_AXES], status)
            answers += [answer for answer in others if twins is None or answer.node in twins]
        truth = None if instant.joints is None else Truth(tick_of(number), now_ns, *instant.joints)
        return SuitAnswer(self.faults.apply(answers, t_ns), truth)

    def _counts(self, readings: Array) -> tuple[Counts, Bits]:
        """Counts (N, 9) and status bits (N,)."""
        readings[self._without_field, 6:] = 0.0
        counts, saturated = quantise(readings, self._scale, None if self._wearer.noisy else self._random)
        counts[self._without_field, 6:] = NO_VALUE
        return counts, np.where(saturated, int(NodeStatus.SATURATED), 0)

    def _answers(self, tick: int, counts: Counts, status: Bits) -> list[NodeAnswer]:
        return [
            NodeAnswer(name, group.bus, frames)
            for group in self._groups
            for name, frames in zip(
                group.names,
                group.encoder.encode(counts[group.rows], tick, status[group.rows]),
                strict=True,
            )
        ]


@dataclass(frozen=True, slots=True)
class _Group:
    """The nodes of one bus."""

    bus: str
    names: list[str]
    rows: NDArray[np.intp]
    encoder: BatchEncoder


def _group(
    skeleton: Skeleton, nodes: dict[str, NodeConfig], bus: BusConfig, protocol: SuitProtocol
) -> _Group:
    names = [name for name in skeleton.segment_names if name in nodes and nodes[name].bus == bus.name]
    return _Group(
        bus=bus.name,
        names=names,
        rows=np.array([skeleton.segment_names.index(name) for name in names], dtype=np.intp),
        encoder=BatchEncoder(protocol.answer_format(bus.fd), [nodes[name].id for name in names]),
    )


def build_suit(
    config: SuitConfig, protocol: SuitProtocol, motion: OperatorMotion | None = None
) -> SimulatedSuit:
    """The suit that a configuration describes, worn in another motion where one is given.

    Raises ConfigError; opens nothing but files.
    """
    skeleton = load_skeleton(config.profile)
    protocol.identifiers(list(config.nodes.values()), {bus.name: bus.fd for bus in config.buses})
    faults = Faults(config.faults, config.seed)
    wearer = _wearer(config, skeleton, motion)
    return SimulatedSuit(skeleton, config.nodes, config.buses, protocol, wearer, faults)


def _wearer(config: SuitConfig, skeleton: Skeleton, motion: OperatorMotion | None = None) -> Wearer:
    if config.replay is not None:
        return RecordedOperator(load_replay(config.replay, skeleton, config.nodes))
    alignment = np.array([config.alignment.get(name, IDENTITY) for name in skeleton.segment_names])
    field_ut = earth_field_ut(config.field.strength_ut, config.field.dip_deg)
    disturbance = None
    if config.disturbance != DisturbanceConfig():
        disturbance = Disturbance(config.disturbance, skeleton.segment_names, field_ut)
    imperfections = Imperfections(config.grade, len(skeleton.segments), config.seed)
    worn = SimulatedOperator(
        motion or load_motion(config.motion, skeleton, config.people),
        IdealSensors(skeleton, field_ut, alignment, disturbance),
        imperfections,
    )
    if config.motion not in ("tray", "calibration"):
        return worn
    tray = Tray(config.tray, len(skeleton.segments), config.seed)
    then = worn if config.motion == "calibration" else None
    return CalibratingOperator(tray, field_ut, imperfections, then)
