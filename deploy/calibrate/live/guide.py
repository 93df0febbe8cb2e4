"""What the person is to do now, which node still wants what: a state machine on the readings' own time.

    attitudes ▸ tumble ▸ wear ▸ zero pose ▸ move joints ▸ done

Parts that were not asked for are left out. Pure: readings go in, the view comes out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from common.quaternion import Array
from deploy.calibrate.live.steps import AttitudesStep, MoveJointsStep, TumbleStep, WearStep, ZeroPoseStep
from deploy.calibrate.live.window import WINDOW_S, NodeProgress, ReadingsWindow, Step, summed_up

What = Literal["imu", "mag", "align"]
WHATS: tuple[What, ...] = ("imu", "mag", "align")
StepName = Literal["attitudes", "tumble", "wear", "zero_pose", "move_joints", "done"]
_SILENT_S = 2.0


@dataclass(frozen=True, slots=True)
class GuideOptions:
    """How much is asked for."""

    what: tuple[What, ...] = WHATS
    still_s: float = 3.0
    """Length of a rest, seconds; the paper has 10."""
    attitudes: int = 20
    coverage: float = 0.85
    """Share of all directions that a magnetometer must have seen."""
    tumble_s: float = 30.0
    """At least so long."""
    zero_pose_s: float = 3.0
    move_joints_s: float = 20.0
    """So long must every joint have moved."""
    by_word: bool = False
    """The zero pose begins when the person says so,"""
    countdown_s: float = 0.0
    """and so many seconds later: who wears the suit may not reach a key and stand at once."""


@dataclass(frozen=True, slots=True)
class ZeroPoseView:
    """How far the zero pose is."""

    waits: bool
    """The person has still to say that they stand."""
    countdown_s: float
    """Until the pose is to be held."""
    held_s: float
    """For which all nodes were at rest by now."""
    wanted_s: float


@dataclass(frozen=True, slots=True)
class View:
    """What to show."""

    step: StepName
    number: int
    """Of the step, from 1."""
    steps: int
    title: str
    todo: str
    nodes: list[NodeProgress]
    zero_pose: ZeroPoseView | None = None
    """In that step."""

    @property
    def share(self) -> float:
        """0 to 1, of this step, over all nodes."""
        return sum(node.share for node in self.nodes) / max(len(self.nodes), 1)


class Guide:
    """Takes a suit's raw readings in blocks of any length."""

    def __init__(
        self, magnetometer: Sequence[bool], parents: Sequence[int], rate_hz: float, options: GuideOptions
    ) -> None:
        """For N nodes: which have a magnetometer, and the row of the node each hangs on (-1: none)."""
        self._options = options
        self._parents = parents
        self._rate_hz = rate_hz
        self._count = len(magnetometer)
        self._names = _steps(options.what)
        self._at = 0
        self._tumble = TumbleStep(self._count, magnetometer, options.coverage, options.tumble_s)
        self._zero_pose = ZeroPoseStep(self._count, options.zero_pose_s, options.by_word, options.countdown_s)
        self._step = self._begin(self._names[0])
        self._readings: list[Array] = []
        self._held = 0
        self._silent_s = np.zeros(self._count)
        self._skip = False

    @property
    def step(self) -> StepName:
        """Which step is on."""
        return self._names[self._at]

    @property
    def zero_pose_s(self) -> tuple[float, float]:
        """When the zero pose was held, in seconds since that step began."""
        return self._zero_pose.zero_pose_s

    def word(self) -> None:
        """The person pressed Enter: "I stand" in the zero pose; elsewhere "that is enough, go on"."""
        if self.step == "zero_pose":
            self._zero_pose.word()
        elif self.step != "done":
            self._skip = True

    def add(self, readings: Array) -> None:
        """Take readings (K, N, 9) in the order of the wire, raw; NaN where a node did not answer."""
        self._readings.append(readings)
        self._held += len(readings)
        width = max(2, round(WINDOW_S * self._rate_hz))
        if self._held < width:
            return
        all_ = np.concatenate(self._readings)
        whole = len(all_) // width * width
        for begin in range(0, whole, width):
            self._take(summed_up(all_[begin : begin + width], self._rate_hz))
        self._readings = [all_[whole:]]
        self._held = len(all_) - whole

    def view(self) -> View:
        """What the person is to do now."""
        step = self._step
        steps = len(self._names) - 1
        if step is None:
            return View("done", steps, steps, "Done", "Thank you. Now it is computed.", [])
        nodes = step.progress()
        for i in np.flatnonzero(self._silent_s >= _SILENT_S):
            nodes[i] = NodeProgress(0.0, "silent")
        pose = self._zero_pose
        shown = ZeroPoseView(pose.waits, pose.countdown_s, pose.held_s, self._options.zero_pose_s)
        zero_pose = shown if self.step == "zero_pose" else None
        return View(self.step, self._at + 1, steps, step.title, step.todo, nodes, zero_pose)

    def _take(self, window: ReadingsWindow) -> None:
        if self._step is None:
            return
        self._silent_s = np.where(window.answered, 0.0, self._silent_s + window.seconds)
        self._step.add(window)
        if self.step == "attitudes":
            self._tumble.listen(window)
        if self._skip or self._over():
            self._skip = False
            self._at += 1
            self._step = self._begin(self.step)

    def _over(self) -> bool:
        """Silent nodes are not waited for, unless all are."""
        assert self._step is not None
        speaking = self._silent_s < _SILENT_S
        done = np.array([node.share >= 1.0 for node in self._step.progress()])
        return bool(speaking.any() and done[speaking].all())

    def _begin(self, name: StepName) -> Step | None:
        o = self._options
        match name:
            case "attitudes":
                return AttitudesStep(self._count, o.still_s, o.attitudes)
            case "tumble":
                return self._tumble
            case "wear":
                return WearStep(self._count)
            case "zero_pose":
                return self._zero_pose
            case "move_joints":
                return MoveJointsStep(self._parents, o.move_joints_s, self._zero_pose.bias_rad_s)
            case "done":
                return None


def _steps(what: Sequence[What]) -> list[StepName]:
    names: list[StepName] = []
    if "imu" in what:
        names.append("attitudes")
    if "mag" in what:
        names.append("tumble")
    if "align" in what:
        names += ["wear", "zero_pose", "move_joints"]
    return [*names, "done"]
