"""The steps of a guided calibration, each pure: raw readings go in, what is still wanted comes out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from common.quaternion import Array
from deploy.calibrate.live.window import WINDOW_S, NodeProgress, ReadingsWindow

_SAME_REST_COS = float(np.cos(np.radians(2.0)))
_DISTINCT_COS = float(np.cos(np.radians(12.0)))
LEAST_SPREAD = 0.12
"""Smallest eigenvalue of the mean of u uᵀ over the attitudes: 1/3 where they lie evenly all around."""
_DIFFERENT_RAD_S = 0.8
_WORN_S = 1.5
_BENT_RAD_S = 0.4


class AttitudesStep:
    """Rest in many attitudes (paper B, 2.2.1): counts each node's distinct ones."""

    title = "Rest in many attitudes"

    def __init__(self, nodes: int, still_s: float, wanted: int) -> None:
        self.todo = (
            f"Lay all units in a tray. Put it down in {wanted} or more attitudes, on every face and on edges "
            f"between, upside down too; keep each for {still_s:g} s."
        )
        self._still_s = still_s + 2.0 * WINDOW_S
        self._wanted = wanted
        self._rest_s = np.zeros(nodes)
        self._rest_direction = np.zeros((nodes, 3))
        self._found: list[list[Array]] = [[] for _ in range(nodes)]
        self._counted = np.zeros(nodes, dtype=np.bool_)

    def add(self, window: ReadingsWindow) -> None:
        """Take the next window of readings."""
        norm = np.maximum(np.linalg.norm(window.mean[:, :3], axis=1, keepdims=True), 1e-9)
        direction = window.mean[:, :3] / norm
        same = np.sum(direction * self._rest_direction, axis=1) > _SAME_REST_COS
        goes_on = window.still & same
        begins = window.still & ~same
        self._rest_direction[begins] = direction[begins]
        self._rest_direction[~window.still] = 0.0
        self._rest_s = np.where(goes_on, self._rest_s + window.seconds, np.where(begins, window.seconds, 0.0))
        self._counted &= goes_on
        for i in np.flatnonzero((self._rest_s >= self._still_s) & ~self._counted):
            self._counted[i] = True
            found = self._found[i]
            if all(direction[i] @ other < _DISTINCT_COS for other in found):
                found.append(direction[i])

    def progress(self) -> list[NodeProgress]:
        """Every node, in order."""
        return [self._of(i) for i in range(len(self._found))]

    def _of(self, i: int) -> NodeProgress:
        found = self._found[i]
        count = {"found": str(len(found)), "wanted": str(self._wanted)}
        if len(found) >= self._wanted:
            if spread(np.array(found)) >= LEAST_SPREAD:
                return NodeProgress(1.0, "attitudes", {"found": str(len(found))})
            return NodeProgress(0.95, "alike", count)
        share = len(found) / self._wanted
        if self._counted[i]:
            return NodeProgress(share, "turn_on", count)
        if self._rest_s[i] > 0.0:
            left_s = max(0.0, self._still_s - self._rest_s[i])
            return NodeProgress(share, "keep_still", {**count, "left": f"{left_s:.1f}"})
        return NodeProgress(share, "lay_down", count)


def spread(directions: Array) -> float:
    """How evenly unit vectors (K, 3) lie around: 1/3 at best, 0 where all lie in one plane."""
    return float(np.linalg.eigvalsh(directions.T @ directions / len(directions))[0])


class TumbleStep:
    """Turn about freely for the magnetometer: counts the cells of the sphere that each node has seen.

    The attitudes' readings count too, so this step listens from the beginning.
    """

    title = "Turn about freely"
    todo = (
        "Away from iron, turn the tray slowly about every way, as if to show each of its sides to each wall, "
        "to the ceiling and to the floor."
    )
    _CELLS = 60
    _LEAST_UT = 10.0
    """Half the range of an axis; the earth's field is 25 to 65 µT."""

    def __init__(self, nodes: int, magnetometer: Sequence[bool], wanted_share: float, least_s: float) -> None:
        self._has = list(magnetometer)
        self._wanted = wanted_share
        self._least_s = least_s
        self._seconds = 0.0
        self._seen: list[Array] = []
        self._cells = sphere_cells(self._CELLS)
        self._nodes = nodes

    def listen(self, window: ReadingsWindow) -> None:
        """Take readings of another step."""
        field = np.where(window.answered[:, None], window.mean[:, 6:9], np.nan)
        if np.isfinite(field).any():
            self._seen.append(field)

    def add(self, window: ReadingsWindow) -> None:
        """Take the next window of readings."""
        self._seconds += window.seconds
        self.listen(window)

    def progress(self) -> list[NodeProgress]:
        """Every node, in order."""
        field = np.array(self._seen).reshape(-1, self._nodes, 3)
        return [self._of(i, field[:, i]) for i in range(self._nodes)]

    def _of(self, i: int, field: Array) -> NodeProgress:
        if not self._has[i]:
            return NodeProgress(1.0, "no_magnetometer")
        covered = self._coverage(field[np.isfinite(field).all(axis=1)])
        percent = {"percent": f"{100.0 * covered:.0f}"}
        share = covered / self._wanted
        if self._least_s > 0.0:
            share = min(share, self._seconds / self._least_s)
        if share >= 1.0:
            return NodeProgress(1.0, "seen", percent)
        return NodeProgress(share, "sees", {**percent, "wanted": f"{100.0 * self._wanted:.0f}"})

    def _coverage(self, field: Array) -> float:
        if len(field) < 2:
            return 0.0
        low, high = field.min(axis=0), field.max(axis=0)
        half = 0.5 * (high - low)
        # without this, noise about one direction would look like a sphere
        if half.min() < max(self._LEAST_UT, 0.5 * half.max()):
            return 0.0
        u = (field - 0.5 * (low + high)) / half
        u /= np.maximum(np.linalg.norm(u, axis=1, keepdims=True), 1e-9)
        return len(np.unique(np.argmax(u @ self._cells.T, axis=1))) / self._CELLS


def sphere_cells(count: int) -> Array:
    """Directions (count, 3) spread evenly over the sphere (a Fibonacci spiral)."""
    k = np.arange(count)
    z = 1.0 - (2.0 * k + 1.0) / count
    azimuth = k * np.pi * (3.0 - np.sqrt(5.0))
    radius = np.sqrt(1.0 - z**2)
    return np.stack([radius * np.cos(azimuth), radius * np.sin(azimuth), z], axis=1)


class WearStep:
    """Put the suit on: over once the units no longer turn as one."""

    title = "Put the suit on"
    todo = "Fix every unit on its segment, then move arms, hands and legs about."

    def __init__(self, nodes: int) -> None:
        self._nodes = nodes
        self._seconds = 0.0

    def add(self, window: ReadingsWindow) -> None:
        """Take the next window of readings."""
        # deviation within the window: the gyros' biases are not known yet, but steady
        turning = np.linalg.norm(window.deviation[:, 3:6], axis=1)[window.answered]
        rate = np.linalg.norm(window.mean[:, 3:6], axis=1)[window.answered]
        if len(rate) and max(np.ptp(turning), np.ptp(rate)) > _DIFFERENT_RAD_S:
            self._seconds += window.seconds

    def progress(self) -> list[NodeProgress]:
        """Every node, in order."""
        share = min(1.0, self._seconds / _WORN_S)
        return [NodeProgress(share, "worn" if share >= 1.0 else "not_worn")] * self._nodes


class ZeroPoseStep:
    """Stand in the zero pose: all nodes at rest at once."""

    title = "Stand in the zero pose"
    todo = "Stand upright, look ahead, arms hanging, palms facing the thighs, fingers straight. Keep still."

    def __init__(self, nodes: int, zero_pose_s: float, wait_for_word: bool, countdown_s: float = 0.0) -> None:
        """With `wait_for_word` the zero pose counts only once the person says so, and `countdown_s` later."""
        self._wanted_s = zero_pose_s
        self._confirmed = not wait_for_word
        self._countdown_s = countdown_s
        self._left_s = 0.0
        if wait_for_word:
            self.todo += " Press Enter as you begin."
        self._rest_s = 0.0
        self._past_s = 0.0
        self._still = np.zeros(nodes, dtype=np.bool_)
        self._mean_rates: list[Array] = []
        self._nodes = nodes

    def word(self) -> None:
        """The person says: I stand. Said again while it counts down: call it off."""
        called_off = self._confirmed and self._left_s > 0.0
        self._left_s = 0.0 if called_off or self._confirmed else self._countdown_s
        self._confirmed = not called_off

    @property
    def waits(self) -> bool:
        """Whether the person has still to say that they stand."""
        return not self._confirmed

    @property
    def countdown_s(self) -> float:
        """Seconds until the pose is to be held; 0 where it is now, or nobody has asked."""
        return max(0.0, self._left_s)

    @property
    def held_s(self) -> float:
        """Seconds for which all nodes have been at rest."""
        return self._rest_s

    def add(self, window: ReadingsWindow) -> None:
        """Take the next window of readings."""
        self._past_s += window.seconds
        if self._rest_s >= self._wanted_s:
            return
        self._still = window.still | ~window.answered
        counts = self._confirmed and self._left_s <= 0.0
        self._left_s = max(0.0, self._left_s - window.seconds)
        if counts and self._still.all() and window.answered.any():
            self._rest_s += window.seconds
            self._mean_rates.append(window.mean[:, 3:6])
        else:
            self._rest_s = 0.0
            self._mean_rates.clear()
        self.zero_pose_s = (self._past_s - self._rest_s, self._past_s)
        """From when until when, since the step began."""

    @property
    def bias_rad_s(self) -> Array:
        """(N, 3) what the gyros read at rest."""
        if not self._mean_rates:
            return np.zeros((self._nodes, 3))
        out: Array = np.mean(self._mean_rates, axis=0)
        return out

    def progress(self) -> list[NodeProgress]:
        """Every node, in order."""
        share = min(1.0, self._rest_s / self._wanted_s)
        return [
            NodeProgress(share, "still", {"seconds": f"{self._rest_s:.1f}"})
            if still
            else NodeProgress(share, "moves")
            for still in self._still.tolist()
        ]


class MoveJointsStep:
    """Move every joint: counts the seconds in which the two units of each turned differently."""

    title = "Move every joint"
    todo = (
        "Bend elbows, knees and every finger joint through their range, again and again, while the whole "
        "limb moves about; bow and turn."
    )

    def __init__(self, parents: Sequence[int], wanted_s: float, bias_rad_s: Array) -> None:
        """`parents` (N,) rows; -1 where there is none that was recorded."""
        self._parents = np.asarray(parents)
        self._wanted_s = wanted_s
        self._bias = bias_rad_s
        self._seconds = np.zeros(len(parents))

    def add(self, window: ReadingsWindow) -> None:
        """Take the next window of readings."""
        mean = window.mean[:, 3:6] - self._bias
        # what a unit turned in the window, to and fro included
        rate = np.sqrt(np.sum(mean**2 + window.deviation[:, 3:6] ** 2, axis=1))
        difference = np.abs(rate - rate[self._parents])
        # two units that turn as fast about different axes bend as well, which the norms do not tell
        sideways = 0.5 * np.minimum(rate, rate[self._parents])
        bent = (np.maximum(difference, sideways) > 0.5 * _BENT_RAD_S) & window.answered
        self._seconds[bent] += window.seconds

    def progress(self) -> list[NodeProgress]:
        """Every node, in order."""
        return [
            self._of(seconds, alone)
            for seconds, alone in zip(self._seconds.tolist(), (self._parents < 0).tolist(), strict=True)
        ]

    def _of(self, seconds: float, alone: bool) -> NodeProgress:
        if alone:  # it hangs on no other: the joints on it tell how it sits
            return NodeProgress(1.0, "neighbours")
        if seconds >= self._wanted_s:
            return NodeProgress(1.0, "moved")
        places = {"seconds": f"{seconds:.0f}", "wanted": f"{self._wanted_s:.0f}"}
        return NodeProgress(seconds / self._wanted_s, "moving", places)
