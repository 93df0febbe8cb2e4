"""One trial: a robot is brought to the state the fault begins in, the fault happens, the course is judged."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from common.wire.messages import Mask
from deploy.experiments.faults.fault import Fault, Reaction
from deploy.experiments.faults.limits import asked_beyond, moved_beyond
from deploy.experiments.faults.scene import TRIAL_S, Scene
from deploy.measure.stillness import STILL_RAD, Stillness, StoppingMotion, stillness
from slave.guard import State


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of a fault."""

    fault: Fault
    state: str
    reason: str
    """The guard's own words."""
    reacted_s: float | None
    """When the guard had reached the state that it was to end in."""
    figures: Stillness
    """Of the joints concerned."""
    strayed_rad: float | None
    """How far joints that were to go on were from where they would have been; None where none was to."""
    refused: dict[str, int]
    """Commands refused since the fault, by gate."""
    wrong: tuple[str, ...]
    """What should not have been; empty where all is as it must be."""


def run_trial(fault: Fault, **guard_options: Any) -> Outcome:
    """Try it, on a guard with some gates or watches taken out where `guard_options` says so."""
    scene = Scene(fault.setting, **guard_options)
    scene.to(fault.begins)
    scene.begin()
    fault.act(scene)
    if fault.lasts_s is not None:
        scene.run.run(fault.lasts_s)
        scene.undo()
    scene.run.run(TRIAL_S - (fault.lasts_s or 0.0))
    return _judge(fault, scene)


def _judge(fault: Fault, scene: Scene) -> Outcome:
    course, skeleton = scene.course(), scene.skeleton
    concerned = _concerned(fault, scene)
    refused = scene.refused() - scene.dropped_before
    reacted_s = scene.state_reached_s(fault.ends)
    strayed = _strayed_rad(fault, course, concerned)
    still_rad = STILL_RAD if fault.sway_deg is None else math.radians(fault.sway_deg)
    figures = stillness(course, skeleton, concerned, still_rad)
    wrong = [
        *_state_amiss(fault, scene, reacted_s),
        *_stillness_amiss(fault, figures),
        *asked_beyond(scene.asked(), skeleton),
        *moved_beyond(course, skeleton),
        *[f"{scene.foul} foul commands were accepted"] * bool(scene.foul),
        *[f"{what} was granted" for what in scene.granted],
        *[f"no command was refused by {gate}" for gate in sorted(fault.refused_by - refused.keys())],
    ]
    if strayed is not None and fault.strays_deg is not None and np.degrees(strayed) > fault.strays_deg:
        wrong.append(f"strayed by {np.degrees(strayed):.2f}°, at most {fault.strays_deg:g}°")
    return Outcome(
        fault, str(scene.guard.state), scene.guard.reason, reacted_s, figures, strayed,
        {gate: count for gate, count in refused.items() if count}, tuple(wrong),
    )  # fmt: skip


def _concerned(fault: Fault, scene: Scene) -> Mask:
    names = scene.skeleton.joint_names
    if fault.concerns is None:
        return np.ones(len(names), np.bool_)
    concerned = fault.concerns(scene)
    return np.array([name in concerned for name in names])


def _state_amiss(fault: Fault, scene: Scene, reacted_s: float | None) -> list[str]:
    if reacted_s is None:
        return [f"ended in {scene.guard.state} ({scene.guard.reason}), not in {fault.ends}"]
    if fault.reacts_s is not None and reacted_s > fault.reacts_s:
        return [f"in {fault.ends} after {reacted_s:.3f} s, at most {fault.reacts_s:g} s"]
    return []


def _stillness_amiss(fault: Fault, figures: Stillness) -> list[str]:
    if fault.stands_s is None:
        return []
    if figures.standstill_s is None:
        return [f"still moves at the end of the trial, {figures.peak_joint} foremost"]
    if figures.standstill_s > fault.stands_s:
        return [f"stands after {figures.standstill_s:.3f} s, at most {fault.stands_s:g} s"]
    return []


def _strayed_rad(fault: Fault, course: StoppingMotion, concerned: Mask) -> float | None:
    others = np.ones_like(concerned) if fault.reaction is Reaction.GOES_ON else ~concerned
    if fault.strays_deg is None or not others.any():
        return None
    gap = np.abs(course.encoder_rad - undisturbed().encoder_rad)[course.at_s >= 0.0]
    return float(gap[:, others].max())


@cache
def undisturbed() -> StoppingMotion:
    """The course without any fault, from `track`."""
    scene = Scene()
    scene.to(State.TRACK)
    scene.begin()
    scene.run.run(TRIAL_S)
    return scene.course()
