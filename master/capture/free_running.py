"""Nodes that know no SYNC: their frames in, and at each tick what all of them read at one instant. Pure.

frame, frame, … ─▶ samples ─ clock line ─▶ history ─ at the instant ─▶ readings of all nodes
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from common.clock import NS_PER_S
from common.errors import ConfigError, ConfigMistake
from common.quaternion import Array
from common.wire.messages import Mask
from master.capture.bits import IntegerField
from master.capture.clock_line import ClockLines
from master.capture.decode import LayoutDecoder
from master.capture.history import Instant, SampleHistory
from master.capture.layout import MappedLayout
from master.capture.parts import COUNTER, MAG, STAMP, Part
from master.capture.route import Destination, Route
from master.suit.doubt import NodeDoubt, Weight
from master.suit.health import NodeCounters
from master.suit.nodes import NodeConfig

_MARGIN_S = 0.002
"""Of the delay beyond the slowest node's period: a frame is late by so much at times."""
LONGEST_DELAY_S = 0.045
SLOWEST_HZ = 25.0
_SLOWEST_S = 1.0 / SLOWEST_HZ
_SLEW = 0.2
"""Share of a tick by which the instant may be moved against the tick, until the delay is as wanted."""
_HELD_SHARE = 0.05
_FORGET = 0.995


class FreeNodes:
    """State of n free-running nodes, which stand at `rows` among all N nodes."""

    def __init__(
        self,
        nodes: Mapping[int, NodeConfig],
        layouts: Sequence[MappedLayout],
        extra: int,
        delay_s: float | None,
    ) -> None:
        """`nodes` by row, with the layout of each; `extra` rows after them get samples by `put`.

        Raises ConfigError where a frame could be of two nodes.
        """
        count = len(nodes) + extra
        self.rows = np.array(list(nodes), np.intp)
        """(n,) of each node among all."""
        self.each_tick = NodeCounters(len(nodes))
        """The counters that each tick adds to; `counters` has the others too."""
        self.routes: dict[tuple[str, int], Route] = {}
        self.identifiers: dict[tuple[str, int], str] = {}
        self._straight: dict[str, dict[int, Destination]] = {}
        """Of each bus the identifiers that tell alone whose frame it is."""
        self._decoders: list[LayoutDecoder] = []
        self._offsets: list[NDArray[np.intp]] = []
        self._bus_of_node = [node.bus for node in nodes.values()]
        self._open_routes(list(nodes.values()), layouts)
        spare = np.zeros(extra)
        self._clock = ClockLines(
            np.concatenate([[layout.stamp_wrap_s for layout in layouts], spare]),
            np.concatenate([[layout.counter_wrap for layout in layouts], spare]),
            np.concatenate([[1.0 / (layout.config.rate_hz or np.nan) for layout in layouts], spare + np.nan]),
        )
        yes = np.ones(extra, np.bool_)
        measured = np.array([layout.config.accelerometer is not None for layout in layouts], np.bool_)
        turning = np.array([layout.config.gyroscope is not None for layout in layouts], np.bool_)
        self._period_s = self._clock.periods_s
        self._history = SampleHistory(count, np.concatenate([measured, yes]), np.concatenate([turning, yes]))
        self._latency_s = [1e-3 * layout.config.latency_ms for layout in layouts]
        self._without_mag = np.array([not node.magnetometer for node in nodes.values()], np.bool_)
        self._some_without_mag = bool(self._without_mag.any())
        self._wanted_delay_s = delay_s
        self.delay_s = 0.0 if delay_s is None else delay_s
        """How far the instants lie before the ticks."""
        self._begin_ns: int | None = None
        self._tick_s = math.nan
        self._now_s = 0.0
        self._held_share = np.zeros(len(nodes))

    def _open_routes(self, nodes: Sequence[NodeConfig], layouts: Sequence[MappedLayout]) -> None:
        """One decoder for all nodes of a layout whose frames have one shape, and the way to it."""
        decoders: dict[tuple[str, tuple[object, ...]], tuple[list[int], MappedLayout]] = {}
        for place, (node, layout) in enumerate(zip(nodes, layouts, strict=True)):
            parts = layout.by_node[node.id].parts
            key = (layout.name, tuple(map(_shape, parts)))
            decoders.setdefault(key, ([], layout))[0].append(place)
        mistakes = []
        for places, layout in decoders.values():
            decoder = LayoutDecoder(layout, layout.by_node[nodes[places[0]].id], places)
            self._decoders.append(decoder)
            for number, place in enumerate(places):
                node = nodes[place]
                sends = layout.by_node[node.id]
                for index, part in enumerate(sends.parts):
                    frame_id = part.frame_id + sends.step
                    what = f"{part.message.name} of node {node.id} ({layout.name})"
                    fields, values = self._told_apart(layout, node, part)
                    route = self.routes.setdefault((node.bus, frame_id), Route())
                    if not route.add(fields, values, (decoder, number * decoder.parts + index)):
                        other = self.identifiers[node.bus, frame_id]
                        expected = (
                            f"identifiers that differ: {what} and {other} on bus {node.bus} have the same"
                        )
                        mistakes.append(ConfigMistake("nodes", f"{frame_id:#x}", expected))
                    self.identifiers.setdefault((node.bus, frame_id), what)
        if mistakes:
            raise ConfigError(layouts[0].config.dbc, mistakes)
        for (bus, frame_id), route in self.routes.items():
            if route.only is not None:
                self._straight.setdefault(bus, {})[frame_id] = route.only

    @staticmethod
    def _told_apart(
        layout: MappedLayout, node: NodeConfig, part: Part
    ) -> tuple[dict[str, IntegerField], tuple[int, ...]]:
        told = dict(part.selects)
        if layout.config.number_signal is not None:
            told[layout.config.number_signal] = node.id
        signals = {signal.name: signal for signal in part.message.signals}
        return {name: IntegerField(signals[name]) for name in told}, tuple(told.values())

    def frames(self, bus: str, frames: Sequence[tuple[int, bytes, int]]) -> list[tuple[int, bytes, int]]:
        """Take frames of one bus: identifier, data, arrival in ns. Returns those that it does not know.

        Those of which there are far too many too: `Route.frame` counts them.
        """
        straight, rest = self._straight.get(bus, {}), []
        for frame in frames:
            frame_id, data, at_ns = frame
            to = straight.get(frame_id)
            if to is None or not to[0].frame(to[1], data, at_ns):
                rest.append(frame)
        return rest

    def put(self, rows: NDArray[np.intp], at_ns: int, readings: Array) -> None:
        """Readings (m, 9) of the `extra` nodes with numbers `rows` (m,), sampled exactly then."""
        values = np.full((len(rows), 13), np.nan)
        values[:, :9] = readings
        self._history.put((rows + len(self.rows)).tolist(), [self._s(at_ns)] * len(rows), values)

    def at_tick(self, tick_ns: int, now_ns: int) -> tuple[int, Instant]:
        """Take what has come; the instant that stands for the tick, ns, and what all nodes read there."""
        self._take()
        self._period_s, self._now_s = self._clock.periods_s, self._s(now_ns)
        tick_s = self._s(tick_ns)
        self._move_delay(tick_s)
        instant_s = tick_s - self.delay_s
        instant = self._history.at(instant_s, self._period_s)
        free = len(self.rows)
        if self._some_without_mag:
            instant.values[:free][self._without_mag, MAG] = np.nan
        self._held_share *= _FORGET
        if instant.held.any():
            held = instant.held[:free]
            self.each_tick.held += held
            self._held_share += (1.0 - _FORGET) * held
        return tick_ns - round(self.delay_s * NS_PER_S), instant

    def _take(self) -> None:
        clock = self._clock
        for decoder in self._decoders:
            samples = decoder.take()
            if samples is None:
                continue
            rows, values, begin_ns = samples.rows, samples.values, self._begin
            arrival_s = [1e-9 * (at_ns - begin_ns) for at_ns in samples.arrival_ns]
            stamps, counts = values[:, STAMP].tolist(), values[:, COUNTER].tolist()
            times_s = clock.take(rows, arrival_s, stamps, counts)
            latency_s = self._latency_s
            times_s = [time_s - latency_s[row] for row, time_s in zip(rows, times_s, strict=True)]
            self._history.put(rows, times_s, values[:, :13])

    @property
    def counters(self) -> NodeCounters:
        """All counters of the nodes, in their order."""
        counters, clock, free = self.each_tick, self._clock, slice(0, len(self.rows))
        counters.missing, counters.resets = clock.missing[free], clock.resets[free]
        counters.duplicates, counters.overtaken = clock.duplicates[free], clock.overtaken[free]
        counters.rate_changes = clock.rate_changes[free]
        for decoder in self._decoders:
            counters.incomplete[decoder.nodes] = decoder.incomplete
            counters.bad_length[decoder.nodes] = decoder.short
        return counters

    def _move_delay(self, tick_s: float) -> None:
        step_s, self._tick_s = tick_s - self._tick_s, tick_s
        if self._wanted_delay_s is not None:
            return
        since_s = tick_s - 1.0
        # not those that are polled
        nodes = zip(self._period_s[: len(self.rows)], self._history.newest_s(), strict=False)
        # a period that is not known yet is NaN, and below nothing
        known = [period_s for period_s, newest_s in nodes if period_s < _SLOWEST_S and newest_s > since_s]
        wanted_s = min(_MARGIN_S + max(known, default=0.0), LONGEST_DELAY_S)
        most_s = math.inf if math.isnan(step_s) else _SLEW * abs(step_s)
        self.delay_s += min(max(wanted_s - self.delay_s, -most_s), most_s)

    @property
    def _begin(self) -> int:
        if self._begin_ns is None:
            raise RuntimeError("no tick has begun")
        return self._begin_ns

    def begin(self, now_ns: int) -> None:
        """The first tick: times are counted from here."""
        if self._begin_ns is None:
            self._begin_ns = now_ns

    def _s(self, at_ns: int) -> float:
        return 1e-9 * (at_ns - self._begin)

    @property
    def age_s(self) -> Array:
        """(n,) of each node's newest sample at the last tick; inf before the first."""
        return self._now_s - np.array(self._history.newest_s()[: len(self.rows)])

    @property
    def rate_hz(self) -> Array:
        """(n,) samples a second; NaN until it is known."""
        return 1.0 / self._clock.period_s[: len(self.rows)]

    @property
    def jitter_s(self) -> Array:
        """(n,) by how much arrivals are late, on average."""
        return self._clock.jitter_s[: len(self.rows)]

    def bus_down(self, bus: str) -> Mask:
        """(n,) the nodes of a failed bus, whose samples are forgotten."""
        gone = np.array([name == bus for name in self._bus_of_node], np.bool_)
        all_gone = np.concatenate([gone, np.zeros(len(self._clock.period_s) - len(gone), np.bool_)])
        self._clock.lose(all_gone)
        for decoder in self._decoders:
            decoder.drop(gone[decoder.nodes])
        return gone

    def doubts(self) -> dict[int, NodeDoubt]:
        """What is wrong with which node, by its row among all."""
        out = {}
        for place, row in enumerate(self.rows.tolist()):
            rate_hz = float(self.rate_hz[place])
            if rate_hz < SLOWEST_HZ:
                words = f"sends {rate_hz:.0f} samples a second: at least {SLOWEST_HZ:.0f} are needed"
                out[row] = NodeDoubt(words, Weight.INVALID)
            elif self._held_share[place] > _HELD_SHARE:
                share = 100.0 * self._held_share[place]
                words = (
                    f"its last sample is held over in {share:.0f} % of the ticks: it sends too seldom or late"
                )
                out[row] = NodeDoubt(words, Weight.NOTED)
        return out


def _shape(part: Part) -> tuple[object, ...]:
    """Parts of one shape are read by one decoder."""
    return (part.message.length, *((
        each.channel, each.factor, each.signal.start, each.signal.length, each.signal.byte_order,
        each.signal.is_signed, each.signal.is_float, each.signal.conversion.scale,
        each.signal.conversion.offset,
    ) for each in part.mapped))  # fmt: skip
