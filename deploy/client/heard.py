"""What robots of one name send, kept by robot process: the newest state, the figures of the last second."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field

from common.errors import CodecError
from common.link import Link
from common.metrics.master import MasterMetrics
from common.metrics.slave import SlaveMetrics
from common.wire.codec import decode, state_joints
from common.wire.messages import RobotState, Statistics
from common.wire.topics import STATE, STATISTICS


@dataclass(slots=True)
class Heard:
    """What one robot sent while it was listened to."""

    state: RobotState | None = None
    metrics: SlaveMetrics | None = None
    master: MasterMetrics | None = None
    """Of the master that commands it."""
    all: asyncio.Event = field(default_factory=asyncio.Event)
    """Set when there is nothing more to wait for."""

    def take(
        self,
        state: RobotState | None = None,
        metrics: SlaveMetrics | None = None,
        master: MasterMetrics | None = None,
    ) -> None:
        """Keep what is newer."""
        self.state, self.metrics = state or self.state, metrics or self.metrics
        self.master = master or self.master
        if self.state is None or self.metrics is None:
            return
        # without a lease there may be no master to tell anything
        if self.master is not None or not self.state.operator:
            self.all.set()


class HeardOfAll:
    """What each robot of one name says from now on, by instance."""

    def __init__(self, link: Link) -> None:
        self._heard: dict[int, Heard] = {}
        self._master: MasterMetrics | None = None
        link.subscribe(STATE, self._on_state)
        link.subscribe(STATISTICS, self._on_statistics)

    def of(self, instance: int) -> Heard:
        """The messages of one robot process, by its instance number."""
        if instance not in self._heard:
            self._heard[instance] = Heard(master=self._master)
        return self._heard[instance]

    def _on_state(self, payload: bytes, _: int) -> None:
        state = decode_state(payload)
        if state is not None:
            self.of(state.instance).take(state=state)

    def _on_statistics(self, payload: bytes, _: int) -> None:
        try:
            statistics = decode(payload, Statistics)
        except CodecError:
            return
        if isinstance(statistics.metrics, SlaveMetrics):
            self.of(statistics.metrics.instance).take(metrics=statistics.metrics)
        else:
            # the master's metrics do not name the robot process that it commands
            self._master = statistics.metrics
            for heard in self._heard.values():
                heard.take(master=statistics.metrics)


def decode_state(payload: bytes) -> RobotState | None:
    """A state of a robot of any profile; None where it is none."""
    try:
        return decode(payload, RobotState, state_joints(payload))
    except CodecError:
        return None
