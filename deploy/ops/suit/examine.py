"""What ten seconds of a suit's readings say of each node: rate, loss, units, axes, still or frozen. Pure.

A vector that stands still in the world, such as gravity, turns in a node's frame by du/dt = u × ω. So a
gyroscope whose axes, signs or unit are wrong is seen against the accelerometer, once the node is turned.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from common.quaternion import Array, cross
from common.wire.messages import Mask

_G_M_S2 = 9.80665
_BLOCK = 10
"""Ticks that are averaged to see gravity turn."""
_STILL_RAD_S = math.radians(5.0)
_MOST_LOST = 0.02
_FROZEN_SHARE = 0.5
_ENOUGH_RAD = 1.0
"""Gravity must turn so far about each of two axes before the gyro is judged."""
_EXPLAINS = 0.5
_LETTERS = "xyz"


@dataclass(frozen=True, slots=True)
class Observed:
    """What was seen of one node in some seconds."""

    readings: Array
    """(T, 9) in SI, by tick."""
    fresh: Mask
    """(T,)"""
    rate_hz: float
    counts: Mapping[str, int]
    """Its counters that are not zero."""
    jitter_ms: float | None
    fused: bool = False
    """It gives an orientation; readings may follow from it."""
    stalled_s: float = 0.0
    """For so long this host was stalled: what did not come then is not the node's fault."""


@dataclass(frozen=True, slots=True)
class NodeFinding:
    """One node."""

    name: str
    rate_hz: float
    jitter_ms: float | None
    lost_share: float
    gravity_m_s2: float | None
    """Median specific force while still; None where it never was."""
    motion: str
    """silent, frozen, still or moving."""
    axes: str
    """right, not judged, or the gyro's axes as they should be."""
    troubles: tuple[str, ...]
    """What is wrong, each with what to do; empty where nothing is."""


def examine(name: str, seen: Observed, tick_s: float) -> NodeFinding:
    """Judge one node."""
    fresh = seen.readings[seen.fresh]
    if not len(fresh):
        counts = ", ".join(f"{count} {what}" for what, count in seen.counts.items() if what != "lost")
        words = "nothing is heard of it: its power, its plug, its id and its layout"
        trouble = f"{words} ({counts})" if counts else words
        return NodeFinding(name, 0.0, None, 1.0, None, "silent", "not judged", (trouble,))
    lost = _lost_share(seen)
    gravity = _gravity(fresh)
    motion = _motion(fresh)
    axes, wrong_axes = (
        ("not judged", "") if seen.fused or motion == "frozen" else _axes(seen.readings, tick_s)
    )
    troubles = []
    if motion == "frozen":
        troubles.append("it repeats one reading: its sensor hangs, or nothing drives its bus")
    if lost > _MOST_LOST:
        troubles.append(f"{100.0 * lost:.1f} % of its samples are lost: bus load, wiring, its own rate")
    if gravity is not None and abs(gravity / _G_M_S2 - 1.0) > 0.1:
        troubles.append(_wrong_gravity(gravity))
    if wrong_axes:
        troubles.append(wrong_axes)
    if seen.counts.get("bad_checksum", 0):
        troubles.append(f"{seen.counts['bad_checksum']} frames have a wrong checksum")
    if seen.counts.get("incomplete", 0) > _MOST_LOST * len(fresh):
        troubles.append(f"{seen.counts['incomplete']} samples lacked a frame: see the layout's `first`")
    return NodeFinding(name, seen.rate_hz, seen.jitter_ms, lost, gravity, motion, axes, tuple(troubles))


def _lost_share(seen: Observed) -> float:
    missing = seen.counts.get("missing")
    if missing is not None:
        lost = max(missing - seen.rate_hz * seen.stalled_s, 0.0)
        return lost / max(lost + seen.rate_hz * len(seen.fresh) / 200.0, 1.0)
    # before its first answer a node was not lost, but not there
    first = int(np.argmax(seen.fresh))
    return float(1.0 - seen.fresh[first:].mean())


def _gravity(readings: Array) -> float | None:
    still = np.linalg.norm(readings[:, 3:6] - np.median(readings[:, 3:6], axis=0), axis=1) < _STILL_RAD_S
    if still.mean() < 0.1:
        return None
    return float(np.median(np.linalg.norm(readings[still, :3], axis=1)))


def _wrong_gravity(gravity: float) -> str:
    for unit, factor in (("g", 1.0), ("mg", 1e3)):
        if abs(gravity / factor - 1.0) < 0.15:
            return f'gravity reads {gravity:.3g} m/s²: its unit looks like {unit}; write unit = "{unit}"'
    for unit, factor in (("m/s^2", _G_M_S2**2), ("m/s^2", 1e-3 * _G_M_S2**2)):
        if abs(gravity / factor - 1.0) < 0.15:
            return f'gravity reads {gravity:.3g} m/s²: it is scaled twice; write unit = "{unit}"'
    return f"gravity reads {gravity:.3g} m/s², not 9.8: range, factor or unit of its accelerometer"


def _motion(readings: Array) -> str:
    if len(readings) > 20:
        same = (np.diff(readings[:, :6], axis=0) == 0.0).all(axis=1)
        if same.mean() > _FROZEN_SHARE:
            return "frozen"
    spread = np.linalg.norm(readings[:, 3:6].std(axis=0))
    return "still" if spread < _STILL_RAD_S else "moving"


def _axes(readings: Array, tick_s: float) -> tuple[str, str]:
    """Whether the gyro turns as gravity does, and what is wrong where it does not."""
    blocks = len(readings) // _BLOCK
    mean = readings[: blocks * _BLOCK].reshape(blocks, _BLOCK, 9).mean(axis=1)
    known = np.isfinite(mean[:, :6]).all(axis=1)
    mean = mean[known]
    if len(mean) < 4:
        return "not judged", ""
    up = mean[:, :3] / np.maximum(np.linalg.norm(mean[:, :3], axis=1, keepdims=True), 1e-9)
    step = np.diff(up, axis=0)
    middle = 0.5 * (up[1:] + up[:-1])
    rate = mean[:, 3:6] - np.median(mean[:, 3:6], axis=0) * (mean[:, 3:6].std(axis=0) < 0.02)
    turn = 0.5 * (rate[1:] + rate[:-1]) * _BLOCK * tick_s
    seen = cross(step, middle)  # the part of the turn that gravity shows, by the accelerometer
    spread = np.sort(np.linalg.eigvalsh(seen.T @ seen))
    if spread[1] < _ENOUGH_RAD**2 / 25.0 or np.abs(seen).sum() < 2.0 * _ENOUGH_RAD:
        return "not judged", ""
    best, words = math.inf, ""
    scale = 1.0
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            shown = cross(middle, turn[:, order] * np.array(signs))
            size = float((shown * shown).sum())
            factor = float((shown * step).sum()) / size if size > 0.0 else 0.0
            off = float(((step - factor * shown) ** 2).sum())
            if factor > 0.0 and off < best - 1e-12:
                best, scale = off, factor
                words = " ".join(
                    f"{'-' if s < 0 else ''}{_LETTERS[i]}" for i, s in zip(order, signs, strict=True)
                )
    if best > (1.0 - _EXPLAINS) * float((step * step).sum()):
        return "not judged", ""
    if words != "x y z":
        return words, (
            f'its gyroscope turns against gravity: its axes look like "{words}" of the accelerometer\'s; '
            "correct `axes`, or the signs"
        )
    if abs(scale * 180.0 / math.pi - 1.0) < 0.3:
        return "right", 'its gyroscope reads 57 times what gravity turns: write unit = "deg/s"'
    if abs(scale * math.pi / 180.0 - 1.0) < 0.3:
        return "right", 'its gyroscope reads a 57th of what gravity turns: write unit = "rad/s"'
    if not 0.7 < scale < 1.4:
        return "right", f"its gyroscope reads {1.0 / scale:.2g} times what gravity turns: unit or range"
    return "right", ""
