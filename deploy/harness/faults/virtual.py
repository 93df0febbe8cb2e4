"""Faults that are tried on the virtual clock: bring the robot to a state, act, and judge the course."""

from __future__ import annotations

import math
from collections.abc import Callable, Set
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np

from common.wire.messages import Mask
from deploy.examples.profiles import NURSING
from deploy.harness.faults.begun import BegunScenes
from deploy.harness.faults.fault import FaultRow, Reaction
from deploy.harness.faults.judge import (
    FaultOutcome,
    asked_beyond,
    brakes_longer_s,
    moved_beyond,
    standing_amiss,
)
from deploy.harness.faults.scene import Scene
from deploy.harness.faults.setting import USUAL, Setting
from deploy.measure.stillness import STILL_RAD, StoppingMotion, stillness
from slave.guard import State

TRIAL_S = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class VirtualFault(FaultRow):
    """A row that is tried on the virtual clock."""

    act: Callable[[Scene], None]
    """Brings the fault about, in a robot that follows a reaching operator unless `begins` says otherwise."""
    begins: State = State.TRACK
    ends: State = State.HOLD
    """The guard's state afterwards."""
    lasts_s: float | None = None
    """After this long `act` is undone; None: not within the trial."""
    setting: Setting = USUAL
    """What differs from the usual scene from its beginning on."""
    concerns: Callable[[Scene], Set[str]] | None = None
    """The joints that are to stand; None: all."""
    sway_deg: float | None = None
    """How far a joint that stands may be shaken by those that go on; None: two counts of its encoder."""
    yields: bool = False
    """The setpoint may be put where the joints stand, in one step; the joints keep their limits."""
    also: Callable[[Scene], list[str]] | None = None
    """What else may be wrong at the end of the trial."""
    refused_by: Set[str] = frozenset()
    """The gates that must have refused commands; `codec` is the decoder before them."""
    otherwise: VirtualFault | None = None
    """Another reaction that is as safe: of this row only what the robot is to do counts."""
    held_by: Set[str] = frozenset()
    """The gates, watches and rules of the guard that hold the fault off: without them the row must fail."""


holds = partial(VirtualFault, reaction=Reaction.HOLDS)
holds_joints = partial(VirtualFault, reaction=Reaction.HOLDS_JOINTS, ends=State.TRACK)
goes_on = partial(VirtualFault, reaction=Reaction.GOES_ON, ends=State.TRACK)
follows_limited = partial(VirtualFault, reaction=Reaction.LIMITED, ends=State.TRACK)
stops = partial(VirtualFault, reaction=Reaction.STOPS, ends=State.ESTOP)


def try_on_virtual_clock(
    fault: VirtualFault, without: Set[str] = frozenset(), scenes: BegunScenes | None = None
) -> FaultOutcome:
    """Try it on a guard. `without`: names of the gates and watches that this guard lacks.

    `scenes`: where a scene that has begun is copied from, for a guard that lacks nothing.
    """
    if scenes is not None and not without:
        scene = scenes.begun(fault.setting, fault.begins)
    else:
        scene = Scene(fault.setting, without)
        scene.to(fault.begins)
    scene.begin()
    fault.act(scene)
    if fault.lasts_s is not None:
        scene.run.run(fault.lasts_s)
        scene.undo()
    scene.run.run(TRIAL_S - (fault.lasts_s or 0.0))
    outcome = _judge(fault, scene)
    if outcome.wrong and fault.otherwise is not None:
        other = _judge(replace(fault.otherwise, setting=fault.setting), scene)
        outcome = outcome if other.wrong else replace(other, fault=fault)
    return outcome


def _judge(fault: VirtualFault, scene: Scene) -> FaultOutcome:
    course, skeleton = scene.course(), scene.skeleton
    concerned = _concerned(fault, scene)
    refused = scene.refused() - scene.dropped_before
    reacted_s = scene.state_reached_s(fault.ends)
    strayed = _strayed_rad(fault, course, concerned)
    still_rad = STILL_RAD if fault.sway_deg is None else math.radians(fault.sway_deg)
    seen = stillness(course, skeleton, concerned, still_rad)
    wrong = [
        *_state_amiss(fault, scene, reacted_s),
        *standing_amiss(fault, seen, brakes_longer_s(skeleton)),
        *([] if fault.yields else asked_beyond(scene.asked(), skeleton)),
        *moved_beyond(course, skeleton),
        *[f"{scene.foul} foul commands were accepted"] * bool(scene.foul),
        *[f"{what} was granted" for what in scene.granted],
        *(fault.also(scene) if fault.also else ()),
        *[f"no command was refused by {gate}" for gate in sorted(fault.refused_by - refused.keys())],
    ]
    if strayed is not None and fault.strays_deg is not None and np.degrees(strayed) > fault.strays_deg:
        wrong.append(f"strayed by {np.degrees(strayed):.2f}°, at most {fault.strays_deg:g}°")
    return FaultOutcome(
        fault, str(scene.guard.state), scene.guard.reason, seen, tuple(wrong),
        reacted_s=reacted_s, strayed_rad=strayed,
        refused={gate: count for gate, count in refused.items() if count},
    )  # fmt: skip


def _concerned(fault: VirtualFault, scene: Scene) -> Mask:
    names = scene.skeleton.joint_names
    if fault.concerns is None:
        return np.ones(len(names), np.bool_)
    concerned = fault.concerns(scene)
    return np.array([name in concerned for name in names])


def _state_amiss(fault: VirtualFault, scene: Scene, reacted_s: float | None) -> list[str]:
    if reacted_s is None:
        return [f"ended in {scene.guard.state} ({scene.guard.reason}), not in {fault.ends}"]
    if fault.reacts_s is not None and reacted_s > fault.reacts_s:
        return [f"in {fault.ends} after {reacted_s:.3f} s, at most {fault.reacts_s:g} s"]
    return []


def _strayed_rad(fault: VirtualFault, course: StoppingMotion, concerned: Mask) -> float | None:
    others = np.ones_like(concerned) if fault.reaction is Reaction.GOES_ON else ~concerned
    if fault.strays_deg is None or not others.any():
        return None
    gap = np.abs(course.encoder_rad - undisturbed(fault.setting.profile).encoder_rad)[course.at_s >= 0.0]
    return float(gap[:, others].max())


@cache
def undisturbed(profile: str = NURSING) -> StoppingMotion:
    """The course of a robot without any fault, from `track`."""
    scene = Scene(Setting(profile=profile))
    scene.to(State.TRACK)
    scene.begin()
    scene.run.run(TRIAL_S)
    return scene.course()
