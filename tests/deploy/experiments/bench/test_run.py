import io
import json
import math
from typing import Any

import pytest
from rich.console import Console

from deploy.experiments.bench import run
from deploy.experiments.bench.run import bench, core_percent
from deploy.experiments.bench.targets import BENCH
from deploy.experiments.bench.worker import BenchError
from deploy.measure.target import judge_targets


def quiet() -> Console:
    return Console(file=io.StringIO(), width=80)


def figures(median: float) -> dict[str, float]:
    return {"min": median, "median": median, "p99": median, "max": median, "count": 1}


def made_up() -> dict[str, Any]:
    return {
        "capture": {"nodes_36": {"cpu_us": figures(900.0)}, "nodes_8_classic": {"cpu_us": figures(400.0)}},
        "pipeline": {
            "nodes_36": {"orientation_us": figures(100.0)},
            "nodes_8": {"orientation_us": figures(50.0)},
            "joint_angles_us": figures(70.0),
            "codec_us": figures(10.0),
        },
        "robot": {"core_percent": 3.0},
        "link": {"over_bare_zenoh": 1.2},
    }


def test_percent_of_a_core_is_ticks_and_commands_at_their_rates() -> None:
    shares = core_percent(made_up())
    # 200 ticks of 1 ms and 12.5 commands of 80 µs in a second
    assert shares["master_36_nodes"] == pytest.approx(20.0 + 0.1)
    assert shares["master_8_classic_nodes"] == pytest.approx(9.0 + 0.1)
    assert shares["total"] == pytest.approx(23.1)


@pytest.mark.parametrize("missing", ["capture", "pipeline", "robot"])
def test_a_share_of_which_a_part_is_missing_is_not_known(missing: str) -> None:
    report = {**made_up(), missing: {}}
    assert core_percent(report)["total"] is None


def test_a_failed_bench_leaves_its_reason_and_the_others_their_figures(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(_: float) -> Any:
        raise BenchError("no such bus")

    good = made_up()
    steps = [
        run._Bench("sound", ("pipeline",), 1.0, lambda _: good["pipeline"]),
        run._Bench("unsound", ("capture", "nodes_36"), 1.0, fail),
        run._Bench("link", ("link",), 1.0, lambda _: good["link"]),
        run._Bench("robot", ("robot",), 1.0, lambda _: good["robot"]),
    ]
    monkeypatch.setattr(run, "BENCHES", steps)
    console = quiet()
    report: dict[str, Any] = bench(quick=True, console=console)
    assert report["failed"] == {"unsound": "no such bus"}
    assert {v["name"]: v["outcome"] for v in report["verdicts"]} == {
        "orientations of 36 nodes": "passed",
        "the same with ekf": "not judged",
        "25 joint angles": "passed",
        "encode + decode a command": "passed",
        "put → received / bare Zenoh": "passed",
        "the same over tcp, p99": "not judged",
        "tls, quic, quic-datagram / tcp, the worst": "not judged",
        "master, of one core": "not judged",
    }
    assert isinstance(console.file, io.StringIO)
    assert "unsound: no such bus" in console.file.getvalue()


@pytest.fixture(scope="module")
def measured() -> dict[str, Any]:
    return bench(quick=True, console=quiet())


@pytest.mark.bench
def test_every_bench_gives_its_figures(measured: dict[str, Any]) -> None:
    assert measured["failed"] == {}
    assert measured["quick"] is True
    assert all(v.measured is not None and math.isfinite(v.measured) for v in judge_targets(measured, BENCH))
    for found in spreads(measured):
        assert found["count"] > 0
        assert 0 < found["min"] <= found["median"] <= found["p99"] <= found["max"]
    json.dumps(measured, allow_nan=False)


@pytest.mark.bench
def test_the_figures_stand_in_a_sane_relation(measured: dict[str, Any]) -> None:
    pipeline, capture, link = measured["pipeline"], measured["capture"], measured["link"]
    period_us = 5000.0
    whole_tick = pipeline["nodes_36"]["decode_us"]["min"] + pipeline["nodes_36"]["orientation_us"]["min"]
    assert whole_tick + pipeline["joint_angles_us"]["min"] < 0.5 * period_us
    # numpy over all nodes at once: 4.5 times the nodes must not cost 4.5 times the time
    for step in ("decode_us", "orientation_us"):
        assert pipeline["nodes_36"][step]["min"] < 4.0 * pipeline["nodes_8"][step]["min"]
    assert pipeline["nodes_36"]["orientation_us"]["min"] > pipeline["nodes_8"]["orientation_us"]["min"]
    # receiving from a bus holds the decoding and more
    assert capture["nodes_36"]["cpu_us"]["min"] > pipeline["nodes_36"]["decode_us"]["min"]
    assert link["one_way_us"]["udp"]["min"] < link["one_way_us"]["tandem"]["min"]
    assert link["over_bare_zenoh"] < 4.0


def spreads(report: Any) -> list[dict[str, float]]:
    if not isinstance(report, dict):
        return []
    if "count" in report:
        return [report]
    return [found for part in report.values() for found in spreads(part)]
