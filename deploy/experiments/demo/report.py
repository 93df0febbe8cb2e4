"""What a demo found: judged figures, and one plain tree for machines and tables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from common.config.load import load_config
from common.metrics.master import CommandedMetrics, MasterMetrics
from common.metrics.slave import SlaveMetrics
from common.metrics.tree import to_tree
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.synergy import synergy_positions
from common.wire.messages import Mask
from deploy.examples.profiles import example
from deploy.experiments.demo.curves import Curves, curves
from deploy.experiments.demo.options import DemoOptions
from deploy.experiments.demo.plain import tree_or_none, trees
from deploy.experiments.demo.robots import robot_problems, robot_row
from deploy.harness.observer import Observer
from deploy.harness.rig import ROBOT, Rig
from deploy.measure import Accuracy, FollowedMotion, SolvedSeries, TruthSeries, accuracy, motion
from deploy.measure.estimated import LEAST_ESTIMATED
from deploy.measure.replay import MOST_S, Comparison, arrivals, compare
from slave.config import SlaveConfig

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


REPLAYED = (
    f"the last {MOST_S:g} s (at most) of the run's accepted commands, replayed on the virtual robot by each "
    "strategy; rmse_over_latest is the real robot's RMSE over the same instants, over that of latest"
)


@dataclass(frozen=True, slots=True)
class RunNotes:
    """What the operators and the reference loops noted during a run."""

    holds: list[dict[str, Any]] = field(default_factory=list)
    """Each time a robot held by itself, as `operator.Operator.row` gives it."""
    host: dict[str, Any] = field(default_factory=dict)
    """What the host itself missed; {} where it was not measured."""
    problem: str = ""
    """Why an operator gave up; empty where none did."""


@dataclass(frozen=True, slots=True)
class DemoReport:
    """The judged figures of the first robot, and the JSON tree of all."""

    accuracy: Accuracy
    motion: FollowedMotion | None
    comparison: Comparison | None
    """With the other strategies, on the same commands; None where there is nothing to judge."""
    curves: Curves | None
    """What to draw; None where the robot never tracked."""
    tree: dict[str, Any]
    problems: list[str]
    """Why the run counts as failed, empty where it does not."""


def make_report(
    options: DemoOptions, rig: Rig, statuses: dict[str, int | None], notes: RunNotes | None = None
) -> DemoReport:
    """Judge a finished run from what was observed and what the processes counted."""
    notes = notes or RunNotes()
    observer, trace, master = rig.observer, rig.observer.trace, rig.children["master"].metrics(MasterMetrics)
    truth, solved, moved = trace.truth(), trace.solved(), trace.moved()
    solved_right = accuracy(truth, solved, trace.joint_names)
    moved_right = motion(truth, moved, trace.joint_names)
    slave_config = load_config(example("slave", options.profile), SlaveConfig)
    accepted = arrivals(observer.commands, observer.states)
    compared = compare(truth, moved, accepted, slave_config) if moved_right else None
    skeleton = load_skeleton(options.profile)
    robots = {
        robot: robot_row(one, rig.children[slave], truth)
        for slave, (robot, one) in zip(rig.slaves, rig.observers.items(), strict=True)
    }
    problems = _problems(statuses, master, observer, robots)
    problems += [notes.problem] if notes.problem else []
    tree = {
        "options": options.tree(),
        "host": notes.host,
        "holds": notes.holds,
        **_of_processes(rig, master),
        **_motion_tree(moved_right, compared),
        **_accuracy_tree(solved_right),
        "synergies": _synergies(truth, solved, skeleton),
        "one_way_plus_lag_ms": _answers_within(
            rig.children[rig.slaves[0]].metrics(SlaveMetrics), moved_right
        ),
        "encoders_read": dict(moved_right.read) if moved_right else {},
        # the newest published while it tracked: at its end nobody is left to see anything
        "video": tree_or_none(observer.video),
        "guards_seen": observer.guards_seen,
        "robots": robots,
        "exit_status": statuses,
        "problems": problems,
    }
    return DemoReport(solved_right, moved_right, compared, curves(truth, moved, skeleton), tree, problems)


def _problems(
    statuses: Mapping[str, int | None],
    master: MasterMetrics | None,
    observer: Observer,
    robots: Mapping[str, Mapping[str, Any]],
) -> list[str]:
    """Why the run counts as failed."""
    problems = [f"{name} ended with status {status}" for name, status in statuses.items() if status != 0]
    if master is None:
        problems.append("the master left no metrics")
    if not observer.commands:
        problems.append("no command was observed: nothing was judged")
    for robot, row in robots.items():
        problems += robot_problems(robot, row)
    return problems


def _first_slave(rig: Rig) -> SlaveMetrics | None:
    return rig.children[rig.slaves[0]].metrics(SlaveMetrics)


def _of_processes(rig: Rig, master: MasterMetrics | None) -> dict[str, Any]:
    """What the processes counted; of several robots the first one's."""
    slave = _first_slave(rig)
    of_robot = master.robots.get(ROBOT) if master else None
    return {
        "ticks": tree_or_none(master and master.ticks),
        "slave_ticks": tree_or_none(slave and slave.ticks),
        "commands": _commands(of_robot, slave),
        "states_missing": of_robot.robot.missing if of_robot else None,
        "stages_ms": trees(slave.stages_ms if slave else {}),
        "frames_in_to_put_ms": tree_or_none(master and master.frames_in_to_put_ms),
        "end_to_end_ms": tree_or_none(slave and slave.end_to_end_ms),
        "one_way_ms": _one_way(slave),
        "round_trip_ms": tree_or_none(of_robot and of_robot.round_trip_ms),
        "cpu_percent": {name: round(child.cpu_percent, 1) for name, child in rig.children.items()},
        "rss_mb": {name: round(child.rss_mb, 1) for name, child in rig.children.items()},
        "guard": tree_or_none(slave and slave.guard),
        "nodes": master.nodes if master else None,
        "buses": master.buses if master else None,
        "servos": tree_or_none(slave and slave.servos),
    }


def _commands(of_robot: CommandedMetrics | None, slave: SlaveMetrics | None) -> dict[str, Any]:
    return {
        "sent": of_robot.commands_sent if of_robot else None,
        "received": slave.guard.received if slave else None,
        "accepted": slave.guard.accepted if slave else None,
        "dropped": slave.guard.dropped if slave else None,
        "due": slave.due.expected if slave else None,
        "missing": max(0, slave.due.missing - slave.commands.late) if slave else None,
    }


def _one_way(slave: SlaveMetrics | None) -> dict[str, Any]:
    if slave is None:
        return {**dict.fromkeys(("p50", "p99", "corrected", "missing", "bound")), "trusted": False}
    return {
        "p50": slave.one_way_ms.p50,
        "p99": slave.one_way_ms.p99,
        "corrected": to_tree(slave.one_way_corrected_ms),
        "missing": slave.due.missing,
        "bound": slave.offset.bound_ms,
        "trusted": slave.offset.trusted,
    }


def _answers_within(slave: SlaveMetrics | None, judged: FollowedMotion | None) -> float | None:
    """How late the robot answers, in ms: the slowest of 100 commands, and how far the motion lags.

    `end_to_end_ms` ends at the first change of any encoder, which a robot that moves already shows at once.
    The lag holds a usual one-way time already, so this is rather too much than too little.
    """
    p99 = slave.one_way_corrected_ms.p99 if slave else None
    lag_ms = judged.lag_ms if judged else None
    return None if p99 is None or lag_ms is None else p99 + max(0.0, lag_ms)


def _motion_tree(judged: FollowedMotion | None, compared: Comparison | None) -> dict[str, Any]:
    replayed = compared.replayed if compared else {}
    return {
        "motion": _motion(judged),
        "motion_lag_ms": judged.lag_ms if judged else None,
        "motion_by_strategy": {
            strategy: {**_motion(one), "lag_ms": one.lag_ms} for strategy, one in replayed.items()
        },
        "motion_by_strategy_is": REPLAYED,
        "rmse_over_latest": compared.rmse_over_latest if compared else None,
    }


def _motion(judged: FollowedMotion | None) -> dict[str, float | None]:
    return {
        "rmse_deg": judged.rmse_deg if judged else None,
        "aligned_rmse_deg": judged.aligned_rmse_deg if judged else None,
        "roughness": judged.roughness if judged else None,
    }


def _accuracy_tree(judged: Accuracy) -> dict[str, Any]:
    return {
        "accuracy": _joint_rows(judged.joints),
        "table_1": _joint_rows(judged.fast),
        "estimated": dict(judged.estimated),
        "estimated_fast": dict(judged.estimated_fast),
        "worst_joint": _worst_joint(judged),
        "eta_percent": judged.eta_percent,
    }


def _joint_rows(rows: Mapping[str, DataclassInstance | None]) -> dict[str, dict[str, float] | None]:
    return {name: None if row is None else asdict(row) for name, row in rows.items()}


def _worst_joint(judged: Accuracy) -> dict[str, float]:
    """The largest figures of any joint, which need not be one and the same joint's."""
    rows = [row for row in judged.joints.values() if row is not None]
    if not rows or any(share < LEAST_ESTIMATED for share in judged.estimated.values()):
        return {}
    return {key: max(getattr(row, key) for row in rows) for key in ("mae_deg", "rmse_deg", "max_deg")}


def _synergies(truth: TruthSeries, solved: SolvedSeries, skeleton: Skeleton) -> dict[str, Any]:
    """What a coarser robot, such as the nursing robot's hand, would receive; {} without one in the table."""
    if not skeleton.synergies:
        return {}
    position_rad = synergy_positions(skeleton, solved.position_rad)
    whole: Mask = np.repeat(solved.valid.all(axis=1, keepdims=True), position_rad.shape[1], axis=1)
    reduced = SolvedSeries(solved.tick, position_rad, whole)
    true = TruthSeries(truth.tick, truth.sampled_ns, synergy_positions(skeleton, truth.position_rad))
    names = [synergy.name for synergy in skeleton.synergies]
    return _joint_rows(accuracy(true, reduced, names).joints)
