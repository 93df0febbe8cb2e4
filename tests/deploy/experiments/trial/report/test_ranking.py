from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import ConfigError
from deploy.experiments.trial.cell.plan import CellKey, Setup
from deploy.experiments.trial.cell.result import Cell, CellStatus
from deploy.experiments.trial.report.ranking import rank, rankings
from deploy.experiments.trial.report.spread import Spread, rows, spread
from deploy.experiments.trial.report.targets import SetupLimit, judge
from deploy.experiments.trial.report.tasks import TASKS, Criterion, load_tasks
from deploy.report.tables import with_unit
from tests.deploy.experiments.trial.made_up import PLAN, cells

TASK = {task.name: task for task in load_tasks()}
finite = st.floats(-1e3, 1e3)


def with_values(setup: Setup, *repeats: dict[str, float | None]) -> list[Cell]:
    return [Cell(CellKey(setup, i + 1), CellStatus.DONE, values=v) for i, v in enumerate(repeats)]


def test_a_spread_is_the_median_and_the_range_of_what_is_known() -> None:
    assert spread([3.0, None, 1.0, 2.0]) == Spread(2.0, 1.0, 3.0, 3)
    assert spread([None, None]) is None


@given(st.lists(finite, min_size=1, max_size=9), st.lists(finite, min_size=1, max_size=9))
def test_spreads_overlap_where_neither_lies_wholly_beside_the_other(a: list[float], b: list[float]) -> None:
    one, other = spread(a), spread(b)
    assert one is not None
    assert other is not None
    assert one.overlaps(other) == other.overlaps(one) == (not (max(a) < min(b) or max(b) < min(a)))


@given(finite, finite, finite)
def test_a_criterion_scores_between_0_and_100_and_never_more_for_worse(
    v: float, good: float, bad: float
) -> None:
    if abs(good - bad) < 1e-6:
        return
    criterion = Criterion(figure="rmse_deg", weight=1.0, good=good, bad=bad)
    assert 0.0 <= criterion.score(v) <= 100.0
    assert criterion.score(good) == pytest.approx(100.0)
    assert criterion.score(bad) == pytest.approx(0.0, abs=1e-9)
    towards_bad = v + (bad - good)
    assert criterion.score(towards_bad) <= criterion.score(v)


def test_reaching_judges_the_place_and_holding_the_smoothness() -> None:
    plan = replace(PLAN, strategies=("latest", "interpolate", "predict"))
    found = {(r.task.name, r.profile): r for r in rankings(load_tasks(), rows(plan, cells(plan)))}
    reach, hand = found["reach", "4g"].best, found["hold-a-hand", "4g"].best
    assert reach is not None
    assert hand is not None
    assert reach.setup.strategy == "predict"
    assert hand.setup.strategy == "interpolate"


def test_what_the_repeats_do_not_tell_apart_is_said() -> None:
    tcp, udp = (Setup(t, "lan", "predict") for t in ("tcp", "udp"))
    close = with_values(tcp, {"roughness": 1.5}, {"roughness": 1.9}) + with_values(
        udp, {"roughness": 1.8}, {"roughness": 2.2}
    )
    apart = with_values(tcp, {"roughness": 1.5}, {"roughness": 1.6}) + with_values(
        udp, {"roughness": 1.8}, {"roughness": 2.2}
    )
    plan = replace(PLAN, profiles=("lan",), strategies=("predict",), repeat=2)
    closest = rank(TASK["hold-a-hand"], "lan", rows(plan, close)).verdict
    assert "do not separate it from udp with predict" in closest
    assert "do not separate" not in rank(TASK["hold-a-hand"], "lan", rows(plan, apart)).verdict


def test_one_stale_command_in_one_repeat_bars_a_setup() -> None:
    setup = Setup("tcp", "lan", "predict")
    fine: dict[str, float | None] = {"roughness": 1.0, "stale_accepted": 0.0}
    plan = replace(PLAN, transports=("tcp",), profiles=("lan",), strategies=("predict",))
    clean = rank(TASK["hold-a-hand"], "lan", rows(plan, with_values(setup, fine, fine, fine)))
    assert clean.best is not None
    foul = with_values(setup, fine, {**fine, "stale_accepted": 1.0}, fine)
    ranking = rank(TASK["hold-a-hand"], "lan", rows(plan, foul))
    assert ranking.best is None
    assert ranking.verdict == "no setup is fit"
    assert "stale accepted 1" in ranking.places[0].barred[0]


def test_a_setup_that_was_not_run_says_why() -> None:
    setup = Setup("unixsock-stream", "lan", "predict")
    plan = replace(PLAN, transports=(setup.transport,), profiles=("lan",), strategies=("predict",), repeat=1)
    found = rows(plan, [Cell(CellKey(setup, 1), CellStatus.IMPOSSIBLE, "does not cross hosts")])
    assert rank(TASK["reach"], "lan", found).places[0].barred == ["does not cross hosts"]
    assert rank(TASK["reach"], "lan", rows(plan, [])).places[0].barred == ["not run yet"]


def test_a_figure_nobody_has_counts_for_nobody_else_as_0() -> None:
    tcp, udp = (Setup(t, "lan", "predict") for t in ("tcp", "udp"))
    plan = replace(PLAN, profiles=("lan",), strategies=("predict",), repeat=1)
    no_outage = rank(TASK["watch"], "lan", rows(plan, with_values(tcp, {"tracked": 100.0})))
    assert no_outage.places[0].score == Spread(100.0, 100.0, 100.0, 1)
    both = with_values(tcp, {"tracked": 100.0, "flow_s": 0.3}) + with_values(udp, {"tracked": 100.0})
    by_setup = {p.setup: p.score for p in rank(TASK["watch"], "lan", rows(plan, both)).places}
    assert by_setup[tcp] == Spread(100.0, 100.0, 100.0, 1)
    assert by_setup[udp] == Spread(50.0, 50.0, 50.0, 1)


@pytest.mark.parametrize(("value", "met"), [(0.4, True), (0.4001, False)])
def test_a_limit_is_kept_up_to_its_very_edge_by_the_median(value: float, met: bool) -> None:
    setup = Setup("tcp", "4g", "predict")
    repeats = with_values(
        setup, {"rmse_over_latest": 0.1}, {"rmse_over_latest": value}, {"rmse_over_latest": 0.9}
    )
    [judged] = judge(rows(PLAN, repeats), [SetupLimit("rmse_over_latest", 0.4, "predict", "4g")])
    assert judged.passed is met
    assert judged.measured == value


def test_a_limit_of_each_repeat_is_missed_by_one() -> None:
    counts: list[dict[str, float | None]] = [{"stale_accepted": v} for v in (0.0, 0.0, 1.0)]
    repeats = with_values(Setup("tcp", "4g", "predict"), *counts)
    [judged] = judge(rows(PLAN, repeats), [SetupLimit("stale_accepted", 0.0, each=True)])
    assert judged.passed is False


def test_commands_that_never_flow_again_miss_the_limit() -> None:
    setup, limits = Setup("tcp", "4g", "predict"), [SetupLimit("flow_s", 1.5)]
    back: dict[str, float | None] = {"flow_s": 0.5, "moved_alone": 0.0}
    never = back | {"flow_s": None}
    [once] = judge(rows(PLAN, with_values(setup, back, never, back)), limits)
    [mostly] = judge(rows(PLAN, with_values(setup, never, back, never)), limits)
    assert (once.passed, once.measured) == (True, 0.5)
    assert (mostly.passed, with_unit(mostly.measured)) == (False, "never")
    assert judge(rows(PLAN, with_values(setup, {"rmse_deg": 1.0}, {"rmse_deg": 1.0})), limits) == []


def test_a_repeat_that_failed_meets_no_target_it_was_asked_of() -> None:
    setup = Setup("tcp", "4g", "predict")
    good: dict[str, float | None] = {"roughness": 1.0, "flow_s": 0.5}
    failed = [Cell(CellKey(setup, n), CellStatus.FAILED, "the robot is not heard") for n in (2, 3)]
    limits = [
        SetupLimit("roughness", 3.0, "predict"),
        SetupLimit("flow_s", 1.5),
        SetupLimit("roughness", 3.0, "latest"),
    ]
    some = judge(rows(PLAN, with_values(setup, good) + failed), limits)
    assert [(j.passed, j.measured) for j in some] == [(False, 1.0), (False, 0.5)]
    assert {j.why for j in some} == {"worst: tcp with predict over 4g; 2 failed"}
    none = judge(rows(PLAN, failed), limits)
    assert [(j.passed, j.why, j.measured) for j in none] == 2 * [(False, "2 failed", None)]
    without_outage = judge(rows(PLAN, failed), limits, outage=False)
    assert [j.name for j in without_outage] == [limits[0].words], (
        "an outage's target is not asked of a trial without"
    )
    impossible = [Cell(CellKey(setup, 1), CellStatus.IMPOSSIBLE, "does not cross hosts")]
    assert judge(rows(PLAN, impossible), limits) == []


def test_a_robot_that_never_followed_misses_the_following_limit() -> None:
    repeats = with_values(Setup("tcp", "4g", "predict"), {"tracked": 0.0}, {"tracked": 0.0})
    [judged] = judge(rows(PLAN, repeats), [SetupLimit("roughness", 3.0, "predict", "4g")])
    assert judged.passed is False


def test_a_limit_of_another_network_is_not_asked() -> None:
    repeats = with_values(Setup("tcp", "lan", "predict"), {"rmse_over_latest": 0.9})
    assert judge(rows(PLAN, repeats), [SetupLimit("rmse_over_latest", 0.4, "predict", "4g")]) == []


def test_a_task_that_asks_for_no_figure_of_ours_is_refused_by_name(tmp_path: Path) -> None:
    file = tmp_path / "tasks.toml"
    file.write_text(TASKS.read_text("utf-8").replace('"roughness"', '"rufness"', 1), "utf-8")
    with pytest.raises(ConfigError, match=r"tasks\.0\.criteria\.\d\.figure.*rufness"):
        load_tasks(file)
    file.write_text(
        TASKS.read_text("utf-8").replace("good = 1.0, bad = 10.0", "good = 1.0, bad = 1.0"), "utf-8"
    )
    with pytest.raises(ConfigError, match="another value than good"):
        load_tasks(file)
