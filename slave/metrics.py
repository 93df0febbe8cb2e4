"""What a slave counted and measured, for statistics, tables and reports."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from common.clock import to_ms
from common.clock_sync import SlaveExchange
from common.metrics.lens import Lens
from common.metrics.link import TopicCounters
from common.metrics.parts import Ticks
from common.metrics.slave import CameraMetrics, OffsetMetrics, ServoMetrics, SlaveMetrics
from common.process.heap import heap_in_use
from common.wire.version import software
from slave.config import SlaveConfig
from slave.pipeline import SlavePipeline
from slave.servos import LimitsTorque, Servos


def slave_metrics(
    pipeline: SlavePipeline,
    now_ns: int,
    *,
    ticks: Ticks,
    base: Mapping[str, int],
    servos: ServoMetrics,
    video: CameraMetrics | None,
    other_videos: dict[str, CameraMetrics],
    lenses: dict[str, Lens],
    link: dict[str, TopicCounters],
    paths: str = "",
) -> SlaveMetrics:
    """The pipeline's own figures, with those of the loop and the devices around it."""
    guard, traffic = pipeline.guard, pipeline.traffic
    return SlaveMetrics(
        software=software(),
        heap=heap_in_use(),
        instance=pipeline.instance,
        ticks=ticks,
        guard=guard.counters.metrics(str(guard.state), guard.reason),
        lease=guard.lease.metrics(now_ns),
        stages_ms=traffic.journeys.budget.summary(),
        end_to_end_ms=traffic.journeys.budget.total(),
        one_way_ms=traffic.one_way.summary(),
        one_way_corrected_ms=traffic.due.corrected.summary(),
        commands=traffic.arrivals.metrics(),
        due=traffic.due.metrics(),
        early=traffic.one_way.clamped,
        unmoved=traffic.journeys.unmoved,
        offset=_offset(pipeline.clock, now_ns),
        undecodable=dict(pipeline.unread.counts),
        base=dict(base),
        servos=servos,
        video=video,
        other_videos=other_videos,
        lenses=lenses,
        link=link,
        paths=paths,
        contact_from="" if pipeline.contact.missing(now_ns) else pipeline.contact.dull,
        times=guard.times.metrics(),
        rate=traffic.rate.metrics(),
    )


def servo_metrics(servos: Servos, config: SlaveConfig) -> ServoMetrics:
    """The backend's, and which drives may push harder than moving needs."""
    metrics = servos.metrics()
    if not config.contact.torque_limit:
        return replace(metrics, unlimited="contact.torque_limit is switched off")
    if not isinstance(servos, LimitsTorque):
        backend = ", ".join(config.servos.names)
        return replace(metrics, unlimited=f"tandem cannot limit the torque of {backend} servos")
    return replace(metrics, no_torque_limit=dict(servos.no_torque_limit))


def _offset(clock: SlaveExchange, now_ns: int) -> OffsetMetrics:
    best, round_trip = clock.estimate(now_ns), clock.estimator.estimate(now_ns)
    return OffsetMetrics(
        to_ms(best.offset_ns),
        to_ms(best.bound_ns),
        best.trusted,
        source=clock.best.source,
        words=clock.best.words,
        round_trip_bound_ms=to_ms(round_trip.bound_ns),
        contradictions=clock.best.contradictions,
        clock_steps=clock.own_steps,
    )
