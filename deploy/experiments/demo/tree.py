"""A demo's report as plain values, for JSON and for the targets."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING

from common.metrics.master import CommandedMetrics
from common.metrics.slave import SlaveMetrics
from common.metrics.tree import to_tree
from deploy.experiments.demo.report import DemoReport
from deploy.harness.rig import ROBOT
from deploy.measure import Accuracy, FollowedMotion
from deploy.measure.estimated import LEAST_ESTIMATED
from deploy.measure.replay import MOST_S, Comparison

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Tree = dict[str, object]

REPLAYED = (
    f"the last {MOST_S:g} s (at most) of the run's accepted commands, replayed on the virtual robot by each "
    "strategy; rmse_over_latest is the real robot's RMSE over the same instants, over that of latest"
)


def report_tree(report: DemoReport) -> Tree:
    """All of it."""
    notes, moved = report.notes, report.motion
    return {
        "options": report.options.tree(),
        "host": {} if notes.host is None else to_tree(notes.host),
        "holds": [to_tree(hold) for hold in notes.holds],
        **_of_processes(report),
        **motion_tree(moved, report.comparison),
        **accuracy_tree(report.accuracy),
        "synergies": _joint_rows(report.synergies),
        "nearness": _tree_or_none(report.nearness),
        "one_way_plus_lag_ms": _answers_within(report.slave, moved),
        "encoders_read": dict(moved.read) if moved else {},
        "video": _tree_or_none(report.video),
        "guards_seen": list(report.guards_seen),
        "robots": _trees(report.robots),
        "exit_status": dict(report.statuses),
        "problems": list(report.problems),
    }


def _of_processes(report: DemoReport) -> Tree:
    """What the processes counted; of several robots the first one's."""
    master, slave = report.master, report.slave
    of_robot = master.robots.get(ROBOT) if master else None
    return {
        "ticks": _tree_or_none(master and master.ticks),
        "slave_ticks": _tree_or_none(slave and slave.ticks),
        "commands": _commands(of_robot, slave),
        "states_missing": of_robot.robot.missing if of_robot else None,
        "stages_ms": _trees(slave.stages_ms if slave else {}),
        "frames_in_to_put_ms": _tree_or_none(master and master.frames_in_to_put_ms),
        "end_to_end_ms": _tree_or_none(slave and slave.end_to_end_ms),
        "one_way_ms": _one_way(slave),
        "round_trip_ms": _tree_or_none(of_robot and of_robot.round_trip_ms),
        "cpu_percent": dict(report.cpu_percent),
        "rss_mb": dict(report.rss_mb),
        "guard": _tree_or_none(slave and slave.guard),
        "nodes": master.nodes if master else None,
        "buses": _trees(master.buses) if master else None,
        "servos": _tree_or_none(slave and slave.servos),
    }


def _tree_or_none(metrics: DataclassInstance | None) -> Tree | None:
    return None if metrics is None else to_tree(metrics)


def _trees(parts: Mapping[str, DataclassInstance]) -> Tree:
    return {name: to_tree(part) for name, part in parts.items()}


def _commands(of_robot: CommandedMetrics | None, slave: SlaveMetrics | None) -> Tree:
    return {
        "sent": of_robot.commands_sent if of_robot else None,
        "received": slave.guard.received if slave else None,
        "accepted": slave.guard.accepted if slave else None,
        "dropped": slave.guard.dropped if slave else None,
        "due": slave.due.expected if slave else None,
        "missing": max(0, slave.due.missing - slave.commands.late) if slave else None,
    }


def _one_way(slave: SlaveMetrics | None) -> Tree:
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


def motion_tree(judged: FollowedMotion | None, compared: Comparison | None) -> Tree:
    """How the robot moved, and how it would have moved by each strategy."""
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


def accuracy_tree(judged: Accuracy) -> Tree:
    """How right the joint angles are."""
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
