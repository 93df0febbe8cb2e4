"""The newest statistics as Prometheus scrapes them (extra `metrics`)."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from common.clock import Clock, monotonic_ns, to_s, wall_ns
from common.errors import CodecError
from common.metrics.master import MasterMetrics
from common.metrics.parts import Summary
from common.metrics.slave import SlaveMetrics
from common.wire.codec import decode
from common.wire.messages import Statistics
from deploy.ops.metrics.one_way import OneWayBuckets
from deploy.ops.metrics.table import (
    BESIDE,
    ONE_WAY,
    RECORDING_AGE,
    RECORDING_FREE,
    TABLE,
    UP,
    HeardStatistics,
    MetricType,
    ServedMetric,
    ServedSample,
    is_fresh,
)

if TYPE_CHECKING:
    from prometheus_client.core import Metric

QUANTILES = {"0.5": "p50", "0.99": "p99"}


class StatisticsCollector:
    """Takes statistics in the event loop; scraped by the server's thread, which sees whole entries only."""

    def __init__(
        self,
        recordings: Path | None = None,
        clock: Clock = monotonic_ns,
        wall: Clock = wall_ns,
        robots: Sequence[str] = (),
    ) -> None:
        """`robots`: whose slaves are to speak, also where none of them was ever heard."""
        self._robots = tuple(robots)
        self._newest: dict[tuple[str, str, str], HeardStatistics] = {}
        self._one_way: dict[str, OneWayBuckets] = {}
        """By robot, since this process began."""
        self._recordings = recordings
        self._clock, self._wall = clock, wall
        self.unreadable = 0

    def take(self, robot: str, payload: bytes, arrived_ns: int) -> None:
        """One message of a robot's statistics topic."""
        try:
            metrics = decode(payload, Statistics).metrics
        except CodecError:
            self.unreadable += 1
            return
        role = "master" if isinstance(metrics, MasterMetrics) else "slave"
        if isinstance(metrics, SlaveMetrics):
            recent = (*metrics.one_way_recent_us, *metrics.one_way_missing_recent_us)
            # another object each time, as the server's thread may be reading the last one
            self._one_way[robot] = self._one_way.get(robot, OneWayBuckets()).with_more(recent)
        one = HeardStatistics(robot, role, metrics, arrived_ns)
        self._newest[robot, role, one.operator] = one

    def collect(self) -> Iterator[Metric]:
        """What is known now. A process that has been silent for 5 s has `tandem_up` 0 and no other value."""
        heard, now_ns = list(self._newest.values()), self._clock()
        fresh = [one for one in heard if is_fresh(one, now_ns)]
        # a slave that never spoke is silent too: this process may have begun after it failed
        spoke = {one.robot for one in heard if one.role == "slave"}
        up = [({"robot": robot, "role": "slave"}, 0.0) for robot in self._robots if robot not in spoke]
        up += [({"robot": one.robot, **one.labels}, float(one in fresh)) for one in heard]
        yield self._beside(UP, up)
        for metric in TABLE:
            yield _family(metric, fresh)
        yield self._one_way_family([one.robot for one in fresh if one.role == "slave"])
        if self._recordings is not None:
            yield from self._of_recordings(self._recordings)

    def _one_way_family(self, robots: list[str]) -> Metric:
        from prometheus_client.core import Metric

        family = Metric(ONE_WAY, BESIDE[ONE_WAY], "histogram")
        for robot in robots:
            labels, buckets = {"robot": robot, "role": "slave"}, self._one_way[robot]
            for edge, count in buckets.cumulative():
                family.add_sample(f"{ONE_WAY}_bucket", {**labels, "le": edge}, count)
            family.add_sample(f"{ONE_WAY}_count", labels, buckets.count)
            family.add_sample(f"{ONE_WAY}_sum", labels, buckets.sum_s)
        return family

    def _beside(self, name: str, samples: list[tuple[dict[str, str], float]]) -> Metric:
        from prometheus_client.core import Metric

        family = Metric(name, BESIDE[name], "gauge")
        for labels, value in samples:
            family.add_sample(name, labels, value)
        return family

    def _of_recordings(self, folder: Path) -> Iterator[Metric]:
        times_ns = []
        for path in folder.glob("*.mcap"):
            with suppress(OSError):  # it has been removed meanwhile
                times_ns.append(path.stat().st_mtime_ns)
        # without a recording, or without its disk, an alert on the age must still fire
        age_s = to_s(self._wall() - max(times_ns)) if times_ns else math.inf
        yield self._beside(RECORDING_AGE, [({}, age_s)])
        with suppress(OSError):  # the disk has gone
            yield self._beside(RECORDING_FREE, [({}, float(shutil.disk_usage(folder).free))])


def _family(metric: ServedMetric, heard: list[HeardStatistics]) -> Metric:
    from prometheus_client.core import Metric

    family = Metric(metric.name, metric.help, metric.type.value)
    done: set[tuple[str, ...]] = set()
    for one in heard:
        labels = one.labels
        if metric.by_robot or one.role == "slave":
            labels["robot"] = one.robot
        for sample in metric.take(one.metrics):
            of_sample = {**labels, **sample.labels}
            # one master sends each robot the same figures of itself; each robot has a slave of its own
            key = tuple(of_sample.values())
            if key not in done:
                done.add(key)
                _add(family, metric, sample, of_sample)
    return family


def _add(family: Metric, metric: ServedMetric, sample: ServedSample, labels: dict[str, str]) -> None:
    value = sample.value
    if not isinstance(value, Summary):
        family.add_sample(metric.full_name, labels, value)
        return
    for quantile, name in QUANTILES.items():
        percentile = getattr(value, name)
        if percentile is not None:
            family.add_sample(metric.name, {**labels, "quantile": quantile}, percentile / 1e3)
    family.add_sample(f"{metric.name}_count", labels, value.count)
    family.add_sample(f"{metric.name}_sum", labels, value.total / 1e3)
    assert metric.type is MetricType.SUMMARY
