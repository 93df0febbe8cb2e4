"""What a demo found: the judged run of the first robot, a row for each robot, and why the run failed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from common.config.load import load_config
from common.metrics.master import MasterMetrics
from common.metrics.slave import CameraMetrics, SlaveMetrics
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.synergy import synergy_positions
from common.wire.messages import Mask
from deploy.examples.profiles import example
from deploy.experiments.demo.curves import Curves, curves
from deploy.experiments.demo.nearness import Nearness, nearness
from deploy.experiments.demo.options import DemoOptions
from deploy.experiments.demo.robots import RobotRow, robot_problems, robot_row
from deploy.harness.host import HostMetrics
from deploy.harness.observer import Observer
from deploy.harness.operator import HoldRecord
from deploy.harness.rig import Rig
from deploy.measure import Accuracy, FollowedMotion, SolvedSeries, TruthSeries, accuracy, motion
from deploy.measure.accuracy import JointAccuracy
from deploy.measure.replay import Comparison, arrivals, compare
from slave.config import SlaveConfig


@dataclass(frozen=True, slots=True)
class RunNotes:
    """What the operators and the reference loops noted during a run."""

    holds: Sequence[HoldRecord] = ()
    """Each time a robot held by itself."""
    host: HostMetrics | None = None
    """What the host itself missed; None where it was not measured."""
    problem: str = ""
    """Why an operator gave up; empty where none did."""


@dataclass(frozen=True, slots=True)
class DemoReport:
    """A judged run. Of several robots, motion, accuracy, video and `slave` are of the first."""

    options: DemoOptions
    notes: RunNotes
    statuses: Mapping[str, int | None]
    """How each process ended."""
    master: MasterMetrics | None
    slave: SlaveMetrics | None
    """None where the process left no metrics; so of `master`."""
    cpu_percent: Mapping[str, float]
    """Of one core, by process."""
    rss_mb: Mapping[str, float]
    video: CameraMetrics | None
    """The newest published while the robot tracked."""
    guards_seen: Sequence[str]
    accuracy: Accuracy
    synergies: Mapping[str, JointAccuracy | None]
    motion: FollowedMotion | None
    comparison: Comparison | None
    """With the other strategies, on the same commands; None where there is nothing to judge."""
    nearness: Nearness | None
    curves: Curves | None
    """What to draw; None where the robot never tracked."""
    robots: Mapping[str, RobotRow]
    problems: Sequence[str]
    """Why the run counts as failed, empty where it does not."""


def make_report(
    options: DemoOptions, rig: Rig, statuses: Mapping[str, int | None], notes: RunNotes | None = None
) -> DemoReport:
    """Judge a finished run from what was observed and what the processes counted."""
    notes = notes or RunNotes()
    observer, trace, children = rig.observer, rig.observer.trace, rig.children
    truth, solved, moved = trace.truth(), trace.solved(), trace.moved()
    followed = motion(truth, moved, trace.joint_names)
    slave_config = load_config(example("slave", options.profile), SlaveConfig)
    accepted = arrivals(observer.commands, observer.states)
    skeleton = load_skeleton(options.profile)
    robots = {
        robot: robot_row(one, children[slave], truth)
        for slave, (robot, one) in zip(rig.slaves, rig.observers.items(), strict=True)
    }
    master = children["master"].metrics(MasterMetrics)
    return DemoReport(
        options=options,
        notes=notes,
        statuses=statuses,
        master=master,
        slave=children[rig.slaves[0]].metrics(SlaveMetrics),
        cpu_percent={name: round(child.cpu_percent, 1) for name, child in children.items()},
        rss_mb={name: round(child.rss_mb, 1) for name, child in children.items()},
        video=observer.video,
        guards_seen=observer.guards_seen,
        accuracy=accuracy(truth, solved, trace.joint_names),
        synergies=_synergies(truth, solved, skeleton),
        motion=followed,
        comparison=compare(truth, moved, accepted, slave_config) if followed else None,
        nearness=nearness(truth, observer.states, skeleton, slave_config.guard.self_margin_cm / 100.0),
        curves=curves(truth, moved, skeleton),
        robots=robots,
        problems=_problems(statuses, master, observer, robots, notes.problem),
    )


def _problems(
    statuses: Mapping[str, int | None],
    master: MasterMetrics | None,
    observer: Observer,
    robots: Mapping[str, RobotRow],
    given_up: str,
) -> list[str]:
    """Why the run counts as failed."""
    problems = [f"{name} ended with status {status}" for name, status in statuses.items() if status != 0]
    if master is None:
        problems.append("the master left no metrics")
    if not observer.commands:
        problems.append("no command was observed: nothing was judged")
    for robot, row in robots.items():
        problems += robot_problems(robot, row)
    return [*problems, given_up] if given_up else problems


def _synergies(
    truth: TruthSeries, solved: SolvedSeries, skeleton: Skeleton
) -> Mapping[str, JointAccuracy | None]:
    """What a coarser robot, such as the nursing robot's hand, would receive; {} without one in the table."""
    if not skeleton.synergies:
        return {}
    position_rad = synergy_positions(skeleton, solved.position_rad)
    whole: Mask = np.repeat(solved.valid.all(axis=1, keepdims=True), position_rad.shape[1], axis=1)
    reduced = SolvedSeries(solved.tick, position_rad, whole)
    true = TruthSeries(truth.tick, truth.sampled_ns, synergy_positions(skeleton, truth.position_rad))
    names = [synergy.name for synergy in skeleton.synergies]
    return accuracy(true, reduced, names).joints
