"""Statistics as Prometheus scrapes them: by its own parser, by promtool where it is, and over HTTP."""

from __future__ import annotations

import asyncio
import json
import math
import shutil
import subprocess
import urllib.request
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from common.clock import NS_PER_S
from common.errors import TandemError
from common.link import open_link
from common.link.config import LinkConfig
from common.metrics.bus import BusMetrics
from common.metrics.master import MasterMetrics
from common.metrics.parts import Summary
from common.metrics.slave import CameraMetrics, OffsetMetrics, SlaveMetrics
from common.wire.codec import encode
from common.wire.messages import Statistics
from common.wire.topics import STATISTICS
from deploy.ops.metrics import rules
from deploy.ops.metrics.collector import StatisticsCollector
from deploy.ops.metrics.run import MetricsOptions, address, serve_metrics
from deploy.ops.metrics.table import BUCKETS_S, GUARD_STATES, TABLE, UP, MetricType, served_names
from slave.guard.states import State
from tests.deploy.ops.record.test_record import free_endpoint
from tests.published import guard_metrics, master_metrics, slave_metrics

exposition = pytest.importorskip("prometheus_client.exposition")
parser = pytest.importorskip("prometheus_client.parser")
ROBOT = "robot-1"
LATE = Summary(count=100, mean=40.0, p50=38.0, p99=90.0, max=120.0, bound=0.5)


def slave() -> SlaveMetrics:
    guard = guard_metrics(accepted=120, losses={"command": 2}, clamps={"velocity": 3}, dropped={"age": 1})
    return slave_metrics(
        guard=guard, one_way_ms=LATE, offset=OffsetMetrics(3.0, 0.5, trusted=True), stages_ms={"a→b": LATE}
    )


def master() -> MasterMetrics:
    bus = BusMetrics(up=True)
    nodes = {"left_hand": {"fresh": 900, "lost": 7}}
    return master_metrics(nodes=nodes, doubts={"left_hand": "frozen"}, buses={"suit": bus})


class Scraped:
    """Every sample of one scrape, by name and labels."""

    def __init__(self, collector: StatisticsCollector) -> None:
        from prometheus_client import CollectorRegistry

        registry = CollectorRegistry(auto_describe=False)
        registry.register(collector)
        self.text: str = exposition.generate_latest(registry).decode()
        self.families = list(parser.text_string_to_metric_families(self.text))
        self.samples = [sample for family in self.families for sample in family.samples]

    def value(self, name: str, **labels: str) -> float:
        found = [s.value for s in self.samples if s.name == name and labels.items() <= s.labels.items()]
        assert len(found) == 1, (name, labels, found)
        return float(found[0])

    def names(self) -> set[str]:
        return {sample.name for sample in self.samples}


@pytest.fixture
def collector() -> StatisticsCollector:
    made = StatisticsCollector(clock=lambda: 10 * NS_PER_S)
    for metrics in (slave(), master()):
        made.take(ROBOT, encode(Statistics(1, metrics)), 9 * NS_PER_S)
    return made


def test_values_and_units_are_what_the_processes_published(collector: StatisticsCollector) -> None:
    scraped = Scraped(collector)
    late = {"robot": ROBOT, "role": "slave", "stage": "one way"}
    assert scraped.value("tandem_latency_seconds", **late, quantile="0.99") == pytest.approx(0.09)
    assert scraped.value("tandem_latency_seconds_count", **late) == 100
    assert scraped.value("tandem_latency_seconds_sum", **late) == pytest.approx(4.0)
    assert scraped.value("tandem_one_way_bound_seconds", robot=ROBOT) == pytest.approx(0.0005)
    assert scraped.value("tandem_guard_state", state="track") == 1.0
    assert scraped.value("tandem_guard_state", state="hold") == 0.0
    assert scraped.value("tandem_holds_total", lost="command") == 2
    assert scraped.value("tandem_node_windows_total", node="left_hand", event="lost") == 7
    assert scraped.value("tandem_node_doubted", node="left_hand") == 1
    assert scraped.value("tandem_bus_up", bus="suit") == 1
    assert scraped.value(UP, role="master") == 1


def test_each_camera_of_a_robot_is_served() -> None:
    good = CameraMetrics(1, 12.0, 3.0, 4.0, 5, 6.0, 7, 8, 9, Summary(0), Summary(0), Summary(0), "")
    made = StatisticsCollector(clock=lambda: 10 * NS_PER_S)
    told = slave_metrics(video=good, other_videos={"room": replace(good, fps=0.0, fault="unplugged")})
    made.take(ROBOT, encode(Statistics(1, told)), 9 * NS_PER_S)
    scraped = Scraped(made)
    assert scraped.value("tandem_video_pictures_per_second", camera="") == 12.0
    assert scraped.value("tandem_video_failed", camera="") == 0.0
    assert scraped.value("tandem_video_failed", camera="room") == 1.0


def test_a_process_that_fell_silent_has_no_values_but_that(collector: StatisticsCollector) -> None:
    for now_s, up in ((14, 1.0), (15, 0.0)):
        collector._clock = lambda now_s=now_s: now_s * NS_PER_S  # type: ignore[misc]  # bound now
        scraped = Scraped(collector)
        assert scraped.value(UP, role="slave") == up
        assert ("tandem_guard_state" in scraped.names()) == bool(up)


def test_an_offset_that_is_not_trusted_has_no_bound() -> None:
    made = StatisticsCollector(clock=lambda: 0)
    unknown = replace(slave(), offset=OffsetMetrics(0.0, 0.0, trusted=False))
    made.take(ROBOT, encode(Statistics(1, unknown)), 0)
    scraped = Scraped(made)
    assert "tandem_one_way_bound_seconds" not in scraped.names()
    assert scraped.value("tandem_clock_offset_trusted") == 0


def test_figures_of_one_master_that_commands_two_robots_are_served_once() -> None:
    made = StatisticsCollector(clock=lambda: 0)
    for robot in ("robot-1", "robot-2"):
        made.take(robot, encode(Statistics(1, master())), 0)
    assert Scraped(made).value("tandem_node_doubted", node="left_hand") == 1
    made.take(ROBOT, b"nonsense", 0)
    assert made.unreadable == 1


def test_two_robots_slaves_are_served_both() -> None:
    made = StatisticsCollector(clock=lambda: 0)
    for robot, missed in (("robot-1", 3), ("robot-2", 700)):
        late = replace(slave(), ticks=replace(slave().ticks, missed=missed))
        made.take(robot, encode(Statistics(1, late)), 0)
    scraped = Scraped(made)
    assert scraped.value("tandem_ticks_missed_total", robot="robot-1") == 3
    assert scraped.value("tandem_ticks_missed_total", robot="robot-2") == 700


def test_a_robot_that_never_spoke_is_silent() -> None:
    made = StatisticsCollector(clock=lambda: 0, robots=("robot-1", "robot-2"))
    made.take("robot-2", encode(Statistics(1, slave())), 0)
    scraped = Scraped(made)
    assert scraped.value(UP, robot="robot-1", role="slave") == 0
    assert scraped.value(UP, robot="robot-2", role="slave") == 1


def test_the_folder_of_recordings_is_watched(tmp_path: Path) -> None:
    made = StatisticsCollector(tmp_path, wall=lambda: 0)
    assert Scraped(made).value("tandem_recording_age_seconds") == math.inf
    gone = Scraped(StatisticsCollector(tmp_path / "unmounted", wall=lambda: 0))
    assert gone.value("tandem_recording_age_seconds") == math.inf
    assert "tandem_recording_free_bytes" not in gone.names()
    file = tmp_path / "a.mcap"
    file.write_bytes(b"x")
    changed_ns = file.stat().st_mtime_ns
    made._wall = lambda: changed_ns + 12 * NS_PER_S
    scraped = Scraped(made)
    assert scraped.value("tandem_recording_age_seconds") == pytest.approx(12.0)
    assert scraped.value("tandem_recording_free_bytes") > 0


def test_names_follow_the_conventions() -> None:
    for metric in TABLE:
        assert metric.name.startswith("tandem_")
        assert not metric.name.endswith("_total")
        assert metric.help.endswith((".", "…"))
        assert not {"robot", "role", "quantile", "le"} & set(metric.labels)
        if metric.unit == "s":
            assert metric.name.endswith("_seconds")
        if metric.unit == "bytes":
            assert metric.name.endswith("_bytes")
    assert len({metric.name for metric in TABLE}) == len(TABLE)
    assert set(GUARD_STATES) == {str(state) for state in State}


def test_what_the_table_says_is_what_is_served(collector: StatisticsCollector) -> None:
    """Each metric of the table with all its labels; else a panel would stay empty for ever."""
    scraped = Scraped(collector)
    assert scraped.names() <= served_names()
    kinds = {family.name: family.type for family in scraped.families}
    for metric in TABLE:
        assert kinds[metric.name] == metric.type.value
        for sample in scraped.samples:
            if sample.name == metric.full_name:
                of_robot = metric.by_robot or sample.labels["role"] == "slave"
                master = sample.labels["role"] == "master"
                expected = {"role", *metric.labels, *(["robot"] if of_robot else [])}
                expected |= {"operator"} if master else set()
                assert sample.labels.keys() - {"quantile"} == expected


def test_dashboard_and_alerts_are_made_from_the_table_and_name_nothing_else() -> None:
    assert rules.ALERTS_FILE.read_text("utf-8") == rules.alerts(), "python -m deploy.ops.metrics.rules"
    assert rules.DASHBOARD_FILE.read_text("utf-8") == rules.dashboard(), "python -m deploy.ops.metrics.rules"
    panels = json.loads(rules.dashboard())["panels"]
    queried = " ".join(target["expr"] for panel in panels for target in panel["targets"])
    alerted = " ".join(rule.expression for rule in rules.ALERTS)
    assert rules.named_in(queried) | rules.named_in(alerted) <= served_names()
    assert len(panels) == len([metric for metric in TABLE if metric.drawn]) > 8
    counters = {metric.full_name for metric in TABLE if metric.type is MetricType.COUNTER}
    for panel in panels:
        [target] = panel["targets"]
        if rules.named_in(target["expr"]) & counters:
            assert target["expr"].startswith(("rate(", "increase(")), "a counter is drawn by its growth"


def test_a_planted_name_would_be_found() -> None:
    assert not rules.named_in("rate(tandem_dances_total[1m])") <= served_names()


def test_the_rules_are_yaml_with_what_prometheus_asks_for() -> None:
    [group] = yaml.safe_load(rules.alerts())["groups"]
    assert {rule["alert"] for rule in group["rules"]} == {rule.name for rule in rules.ALERTS}
    for rule in group["rules"]:
        assert rule["labels"]["severity"] in ("critical", "warning")
        assert rule.keys() == {"alert", "expr", "for", "labels", "annotations"}


needs_promtool = pytest.mark.skipif(
    shutil.which("promtool") is None, reason="no promtool: apt install prometheus"
)


@needs_promtool
def test_promtool_takes_the_rules_and_finds_a_planted_mistake(tmp_path: Path) -> None:
    def check(path: Path) -> int:
        return subprocess.run(
            ["promtool", "check", "rules", str(path)], capture_output=True, check=False
        ).returncode

    assert check(rules.ALERTS_FILE) == 0
    (tmp_path / "bad.yaml").write_text(rules.alerts().replace("== 0", "=== 0"))
    assert check(tmp_path / "bad.yaml") != 0


@needs_promtool
def test_promtool_finds_nothing_wrong_with_what_is_served(collector: StatisticsCollector) -> None:
    judged = subprocess.run(
        ["promtool", "check", "metrics"],
        input=Scraped(collector).text,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (judged.returncode, judged.stdout + judged.stderr) == (0, "")


def test_it_is_scraped_over_http_while_a_robot_speaks() -> None:
    async def story() -> str:
        endpoint, stop = free_endpoint(), asyncio.Event()
        ports: asyncio.Queue[int] = asyncio.Queue()
        options = MetricsOptions(LinkConfig(connect=[endpoint]), (ROBOT,), "127.0.0.1", 0)
        async with open_link(LinkConfig(listen=[endpoint]), ROBOT) as robot:
            put = robot.publish(STATISTICS)
            serving = asyncio.create_task(serve_metrics(options, stop, ports.put_nowait))
            port = await ports.get()
            async with asyncio.timeout(20.0):
                while True:
                    put(encode(Statistics(1, slave())))
                    text = await asyncio.to_thread(read, port)
                    if "tandem_guard_state{" in text:
                        break
            stop.set()
            await serving
        return text

    def read(port: int) -> str:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5) as answer:
            return str(answer.read().decode())

    text = asyncio.run(story())
    assert 'tandem_guard_state{robot="robot-1",role="slave",state="track"} 1.0' in text


@pytest.mark.parametrize("listen", ["9464", "host:", "host:x", "host:70000"])
def test_an_address_that_is_none_is_refused(listen: str) -> None:
    with pytest.raises(TandemError, match="HOST:PORT"):
        address(listen)
    assert address("[::1]:9464") == ("::1", 9464)
    assert not math.isnan(address("127.0.0.1:9464")[1])


def test_two_masters_of_one_robot_do_not_overwrite_each_other() -> None:
    made = StatisticsCollector(clock=lambda: 0)
    for operator, lost in (("nurse-1", 7), ("nurse-2", 11)):
        of = replace(master(), operator=operator, nodes={"left_hand": {"lost": lost}})
        made.take(ROBOT, encode(Statistics(1, of)), 0)
    scraped = Scraped(made)
    for operator, lost in (("nurse-1", 7), ("nurse-2", 11)):
        assert scraped.value("tandem_node_windows_total", operator=operator, event="lost") == lost
        assert scraped.value(UP, operator=operator, robot=ROBOT) == 1


def test_one_way_times_are_a_histogram_of_which_any_window_has_its_percentile() -> None:
    made = StatisticsCollector(clock=lambda: 0)
    early = replace(slave(), one_way_recent_us=(400_000,) * 100)
    made.take(ROBOT, encode(Statistics(1, early)), 0)
    before = Scraped(made)
    assert before.value("tandem_one_way_seconds_bucket", le="0.3") == 0
    assert before.value("tandem_one_way_seconds_bucket", le="0.5") == 100
    later = replace(slave(), one_way_recent_us=(20_000, 20_001), one_way_missing_recent_us=(160_000,))
    made.take(ROBOT, encode(Statistics(1, later)), 0)
    after = Scraped(made)
    grown = {
        le: after.value("tandem_one_way_seconds_bucket", le=le)
        - before.value("tandem_one_way_seconds_bucket", le=le)
        for le in ("0.01", "0.02", "0.035", "0.15", "0.2", "+Inf")
    }
    assert grown == {"0.01": 0, "0.02": 1, "0.035": 2, "0.15": 2, "0.2": 3, "+Inf": 3}
    assert after.value("tandem_one_way_seconds_count") == 103
    assert after.value("tandem_one_way_seconds_sum") == pytest.approx(40.0 + 0.200001)


def test_the_alert_of_late_commands_looks_at_a_window_and_its_limit_is_an_edge() -> None:
    [late] = [rule for rule in rules.ALERTS if rule.name == "TandemLate"]
    assert "rate(tandem_one_way_seconds_bucket[1m])" in late.expression
    assert float(late.expression.rpartition(" ")[2]) in BUCKETS_S
