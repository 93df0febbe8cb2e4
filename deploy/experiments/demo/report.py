"""What a demo found, as one plain tree for machines and tables."""

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
from deploy.harness.rig import ROBOT, Rig
from deploy.measure import Accuracy, Motion, SolvedSeries, TruthSeries, accuracy, motion
from deploy.measure.baseline import MOST_S, Comparison, arrivals, compare
from deploy.measure.estimated import LEAST_ESTIMATED
from deploy.sim.suit.config import SuitConfig
from slave.config import SlaveConfig

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    from deploy.experiments.demo.run import DemoOptions


REPLAYED = (
    f"the last {MOST_S:g} s (at most) of the run's accepted commands, replayed on the virtual robot by each "
    "strategy; rmse_over_latest is the real robot's RMSE over the same instants, over that of latest"
)


@dataclass(frozen=True, slots=True)
class Seen:
    """What the operator and the bare loops saw."""

    holds: list[dict[str, Any]] = field(default_factory=list)
    """Each time the robot held by itself, as `operator.Operator.row` tells it."""
    host: dict[str, Any] = field(default_factory=dict)
    """What the host itself missed; {} where it was not measured."""
    problem: str = ""
    """Why the operator gave up, empty where he did not."""


@dataclass(frozen=True, slots=True)
class Report:
    """Judged figures, and the JSON tree made of them."""

    accuracy: Accuracy
    motion: Motion | None
    comparison: Comparison | None
    """With the other strategies, on the same commands; None where there is nothing to judge."""
    curves: Curves | None
    """What to draw; None where the robot never tracked."""
    tree: dict[str, Any]
    problems: list[str] = field(default_factory=list)
    """Why the run counts as failed, empty where it does not."""


def make_report(
    options: DemoOptions, rig: Rig, statuses: dict[str, int | None], seen: Seen | None = None
) -> Report:
    """Judge a finished run from what was observed and what the processes counted."""
    observer, children = rig.observer, rig.children.values()
    seen = seen or Seen()
    names = observer.trace.joint_names
    skeleton = load_skeleton(options.profile)
    truth, solved, moved = observer.trace.truth(), observer.trace.solved(), observer.trace.moved()
    solved_right = accuracy(truth, solved, names)
    moved_right = motion(truth, moved, names)
    slave_config = load_config(example("slave", options.profile), SlaveConfig)
    accepted = arrivals(observer.commands, observer.states)
    compared = compare(truth, moved, accepted, slave_config) if moved_right else None
    by_role = {child.role: child for child in children}
    master = by_role["master"].metrics(MasterMetrics)
    slave = by_role["slave"].metrics(SlaveMetrics)
    of_robot = master.robots.get(ROBOT) if master else None
    problems = [f"{role} ended with status {status}" for role, status in statuses.items() if status != 0]
    problems += [
        f"{role} left no figures" for role, one in (("master", master), ("slave", slave)) if one is None
    ]
    if slave is not None and not slave.guard.received:
        problems.append("no command reached the robot: nothing below was judged")
    if not observer.commands:
        problems.append("no command was observed: nothing below was judged")
    if "track" not in observer.guards_seen:
        problems.append("the robot never reached track")
    if seen.problem:
        problems.append(seen.problem)
    tree = {
        "options": {
            "profile": options.profile,
            "seconds": options.seconds,
            "transport": options.transport,
            "motion": _what_moved(options),
            "strategy": options.strategy,
            "filter": options.filter,
            "seed": options.seed,
            "servos": options.servos,
        },
        "ticks": tree_or_none(master and master.ticks),
        "host": seen.host,
        "holds": seen.holds,
        "commands": _commands(of_robot, slave),
        "states_missing": of_robot.robot.missing if of_robot else None,
        "stages_ms": trees(slave.stages_ms if slave else {}),
        "frames_in_to_put_ms": tree_or_none(master and master.frames_in_to_put_ms),
        "end_to_end_ms": tree_or_none(slave and slave.end_to_end_ms),
        "one_way_ms": _one_way(slave),
        "round_trip_ms": tree_or_none(of_robot and of_robot.round_trip_ms),
        "one_way_plus_lag_ms": _answers_within(slave, moved_right),
        "motion_lag_ms": moved_right.lag_ms if moved_right else None,
        "motion": _motion(moved_right),
        "motion_by_strategy": _motion_by_strategy(compared),
        "motion_by_strategy_is": REPLAYED,
        "rmse_over_latest": compared.rmse_over_latest if compared else None,
        "accuracy": _accuracy(solved_right),
        "estimated": dict(solved_right.estimated),
        "estimated_fast": dict(solved_right.estimated_fast),
        "encoders_read": dict(moved_right.read) if moved_right else {},
        "worst_joint": _worst_joint(solved_right),
        "synergies": _synergies(truth, solved, skeleton),
        "eta_percent": solved_right.eta_percent,
        "table_1": _table_1(solved_right),
        # the newest told while it tracked: at its end nobody is left to see anything
        "video": tree_or_none(observer.video),
        "cpu_percent": {child.role: round(child.cpu_percent, 1) for child in children},
        "rss_mb": {child.role: round(child.rss_mb, 1) for child in children},
        "guard": tree_or_none(slave and slave.guard),
        "guards_seen": observer.guards_seen,
        "nodes": master.nodes if master else None,
        "buses": master.buses if master else None,
        "servos": tree_or_none(slave and slave.servos),
        "slave_ticks": tree_or_none(slave and slave.ticks),
        "exit_status": statuses,
        "problems": problems,
    }
    drawn = curves(truth, moved, skeleton)
    return Report(solved_right, moved_right, compared, drawn, tree, problems)


def _what_moved(options: DemoOptions) -> str:
    if options.replay is not None:
        return options.replay.name
    return options.motion or load_config(example("suit", options.profile), SuitConfig).motion


def tree_or_none(metrics: DataclassInstance | None) -> dict[str, Any] | None:
    """Plain values; None where the process did not publish them."""
    return None if metrics is None else to_tree(metrics)


def trees(parts: Mapping[str, DataclassInstance]) -> dict[str, Any]:
    """Plain values of each."""
    return {name: to_tree(part) for name, part in parts.items()}


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


def _answers_within(slave: SlaveMetrics | None, judged: Motion | None) -> float | None:
    """How late the robot answers, in ms: the slowest of 100 commands, and how far the motion lags.

    `end_to_end_ms` ends at the first change of any encoder, which a robot that moves already shows at once.
    The lag holds a usual one-way time already, so this is rather too much than too little.
    """
    p99 = slave.one_way_corrected_ms.p99 if slave else None
    lag_ms = judged.lag_ms if judged else None
    return None if p99 is None or lag_ms is None else p99 + max(0.0, lag_ms)


def _motion(judged: Motion | None) -> dict[str, float | None]:
    return {
        "rmse_deg": judged.rmse_deg if judged else None,
        "aligned_rmse_deg": judged.aligned_rmse_deg if judged else None,
        "roughness": judged.roughness if judged else None,
    }


def _motion_by_strategy(compared: Comparison | None) -> dict[str, dict[str, float | None]]:
    if compared is None:
        return {}
    return {
        strategy: {**_motion(judged), "lag_ms": judged.lag_ms}
        for strategy, judged in compared.replayed.items()
    }


def _accuracy(judged: Accuracy) -> dict[str, dict[str, float] | None]:
    return {name: None if row is None else asdict(row) for name, row in judged.joints.items()}


def _worst_joint(judged: Accuracy) -> dict[str, float]:
    """The largest figures of any joint, which need not be one and the same joint's."""
    rows = [row for row in judged.joints.values() if row is not None]
    if not rows or any(share < LEAST_ESTIMATED for share in judged.estimated.values()):
        return {}
    return {key: max(getattr(row, key) for row in rows) for key in ("mae_deg", "rmse_deg", "max_deg")}


def _synergies(truth: TruthSeries, solved: SolvedSeries, skeleton: Skeleton) -> dict[str, Any]:
    """What a coarser robot, such as the nursing robot's hand, would be told; {} without one in the table."""
    if not skeleton.synergies:
        return {}
    position_rad = synergy_positions(skeleton, solved.position_rad)
    whole: Mask = np.repeat(solved.valid.all(axis=1, keepdims=True), position_rad.shape[1], axis=1)
    told = SolvedSeries(solved.tick, position_rad, whole)
    true = TruthSeries(truth.tick, truth.sampled_ns, synergy_positions(skeleton, truth.position_rad))
    return _accuracy(accuracy(true, told, [synergy.name for synergy in skeleton.synergies]))


def _table_1(judged: Accuracy) -> dict[str, dict[str, float] | None]:
    return {name: None if row is None else asdict(row) for name, row in judged.fast.items()}
