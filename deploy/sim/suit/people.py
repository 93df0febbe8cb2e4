"""Real people's motion, from a recording of their joint angles; not part of tandem.

The file (npz) holds `joints` (names), `rate_hz`, `labels`, `subjects`, and for clip n
`c{n:03d}_position_rad` (T, joints). Some of the people are held out: tandem's prediction was tuned on
`TUNED_ON` alone, and is judged on all others.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field

from common.config.section import RelativePath, Section
from common.errors import ConfigError, ConfigMistake
from common.quaternion import Array
from common.skeleton import Skeleton

FILE = "motion_cmu.npz"
FOLDER = "TANDEM_DATA"
"""Environment variable that names the folder with `FILE`, where no file is named."""
TUNED_ON = ("cmu01", "cmu02")
Who = Literal["held out", "tuned on"]
STILL_S, THERE_S, BETWEEN_S = 3.5, 2.0, 1.5
"""A motion begins in the zero pose; then to the first posture, and from each clip to the next."""
_EASE_S = 0.5
_SHORTEST_S = 2.5
_CORNER_S = 0.05
_MARGIN_RAD = np.radians(1.0)


class PeopleConfig(Section):
    """`[people]` of the suit's file: for the motion `capture`."""

    file: RelativePath | None = None
    """The recording of people's joint angles; None: `motion_cmu.npz` in the folder that TANDEM_DATA names."""
    slower: float = Field(default=1.0, ge=0.5, le=10.0)
    """How many times slower than recorded."""
    who: Who = "held out"
    """Of whom: people on whom the prediction was not tuned, or the others."""


@dataclass(frozen=True, slots=True)
class Clip:
    """One unbroken recording of one person."""

    label: str
    subject: str
    rate_hz: float
    position_rad: Array
    """(T, J) of the skeleton's joints, within their limits."""


def load_clips(config: PeopleConfig, skeleton: Skeleton) -> list[Clip]:
    """The clips of those people, at their natural speed. Raises ConfigError with the reason."""
    path = _found(config.file)
    try:
        with np.load(path, allow_pickle=False) as data:
            return _clips(dict(data), config.who, skeleton)
    except (OSError, ValueError, KeyError) as error:
        expected = "joints, rate_hz, labels, subjects and c000_position_rad …, as docs/trials.md says"
        raise ConfigError(str(path), [ConfigMistake("people.file", str(error), expected)]) from None


def _found(file: Path | None) -> Path:
    if file is None:
        folder = os.environ.get(FOLDER)
        if folder is None:
            expected = f"a recording of people's joint angles (npz), or {FOLDER} to name the folder of {FILE}"
            raise ConfigError("motion capture", [ConfigMistake("people.file", "nothing", expected)])
        file = Path(folder) / FILE
    if not file.is_file():
        raise ConfigError("motion capture", [ConfigMistake("people.file", str(file), "a file that is there")])
    return file


def _clips(data: dict[str, NDArray[np.generic]], who: Who, skeleton: Skeleton) -> list[Clip]:
    names, labels = data["joints"].tolist(), data["labels"].tolist()
    columns = [skeleton.joint_names.index(name) for name in names]
    rate_hz = float(data["rate_hz"])
    found = []
    for i, (label, subject) in enumerate(zip(labels, data["subjects"].tolist(), strict=True)):
        recorded = np.asarray(data[f"c{i:03d}_position_rad"], dtype=np.float64)
        if (subject in TUNED_ON) != (who == "tuned on") or len(recorded) < _SHORTEST_S * rate_hz:
            continue
        position = np.tile(_inside(skeleton, skeleton.zero_rad), (len(recorded), 1))
        position[:, columns] = recorded
        found.append(Clip(label, subject, rate_hz, _rounded(_inside(skeleton, position), rate_hz)))
    if not found:
        raise ValueError(f"no clip of {_SHORTEST_S:g} s or more of people {who}")
    return found


def _inside(skeleton: Skeleton, position_rad: Array) -> Array:
    lower, upper = skeleton.lower_rad + _MARGIN_RAD, skeleton.upper_rad - _MARGIN_RAD
    out: Array = np.clip(position_rad, lower, upper)
    return out


def _rounded(position_rad: Array, rate_hz: float) -> Array:
    """A joint that meets a limit stops within some ms, not at once."""
    from scipy.ndimage import convolve1d

    window = np.hanning(2 * max(round(_CORNER_S * rate_hz / 2.0), 1) + 3)[1:-1]
    out: Array = convolve1d(position_rad, window / window.sum(), axis=0, mode="nearest")
    return out


class PeopleMotion:
    """Clips one after the other, from the zero pose and back to it; smooth, as a worn suit needs it."""

    def __init__(self, clips: Sequence[Clip], skeleton: Skeleton, slower: float = 1.0) -> None:
        rest = _inside(skeleton, skeleton.zero_rad)
        rate_hz = clips[0].rate_hz
        rows = [np.tile(rest, (round(STILL_S * rate_hz), 1))]
        for clip in clips:
            eased = _eased(clip.position_rad, rate_hz, slower)
            lasts_s = THERE_S if len(rows) == 1 else BETWEEN_S
            rows += [_between(rows[-1][-1], eased[0], round(lasts_s * rate_hz)), eased]
        rows.append(_between(rows[-1][-1], rest, round(THERE_S * rate_hz)))
        position = np.concatenate(rows)
        position[-1] = position[0]
        self.period_s = (len(position) - 1) / rate_hz
        self._course = spline(position, rate_hz, periodic=True)

    def state(self, t_s: ArrayLike) -> tuple[Array, Array, Array]:
        """Position rad, velocity rad/s and acceleration rad/s², (..., J), at times (...)."""
        t = np.mod(np.asarray(t_s, dtype=np.float64), self.period_s)
        return self._course(t, 0), self._course(t, 1), self._course(t, 2)


def load_people(config: PeopleConfig, skeleton: Skeleton) -> PeopleMotion:
    """The motion `capture`. Raises ConfigError."""
    return PeopleMotion(load_clips(config, skeleton), skeleton, config.slower)


class ClipSpline:
    """A cubic spline: position or a derivative of it, (..., J), at times (...)."""

    def __init__(self, position_rad: Array, rate_hz: float, periodic: bool) -> None:
        from scipy.interpolate import CubicSpline

        time_s = np.arange(len(position_rad)) / rate_hz
        self.lasts_s = float(time_s[-1])
        self._spline = CubicSpline(time_s, position_rad, bc_type="periodic" if periodic else "not-a-knot")

    def __call__(self, t_s: ArrayLike, derivative: int = 0) -> Array:
        """At times within the recording."""
        out: Array = np.asarray(self._spline(np.asarray(t_s, dtype=np.float64), derivative))
        return out


def spline(position_rad: Array, rate_hz: float, *, periodic: bool = False) -> ClipSpline:
    """A smooth course through rows (T, J)."""
    return ClipSpline(position_rad, rate_hz, periodic)


def _eased(position_rad: Array, rate_hz: float, slower: float) -> Array:
    """A clip so much slower, that begins and ends at rest: its own time starts and stops gently."""
    course = spline(position_rad, rate_hz / slower)
    ease_s = min(_EASE_S, 0.5 * course.lasts_s)
    # easing takes half of its time longer at either end
    whole_s = course.lasts_s + ease_s
    time_s = np.linspace(0.0, whole_s, round(whole_s * rate_hz))
    x, left_s = np.minimum(time_s, ease_s) / ease_s, np.minimum(time_s[-1] - time_s, ease_s)
    y = left_s / ease_s
    begin = ease_s * x**3 * (1.0 - 0.5 * x) + np.maximum(time_s - ease_s, 0.0)
    own_s = np.where(y < 1.0, course.lasts_s - ease_s * y**3 * (1.0 - 0.5 * y), begin)
    return course(np.clip(own_s, 0.0, course.lasts_s))


def _between(here: Array, there: Array, count: int) -> Array:
    u = (np.arange(1, count + 1) / (count + 1))[:, None]
    out: Array = here + (there - here) * u**3 * (10.0 + u * (6.0 * u - 15.0))
    return out
