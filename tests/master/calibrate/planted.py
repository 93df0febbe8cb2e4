"""Sessions with one planted error each: what people and hardware do wrong, drawn by a seed."""

from __future__ import annotations

import math
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from common.errors import TandemError
from common.quaternion import Array, angle_between, conjugate, from_axis_angle, normalise, rotate
from master.calibrate.alignment import SuitAlignment, find_alignment
from master.calibrate.recording import NodeRecording
from tests.master.calibrate.worn import Worn, wear

Nodes = dict[str, NodeRecording]
Plant = Callable[[Nodes, str, np.random.Generator], Nodes]


@dataclass(frozen=True)
class Planted:
    """A session, what is wrong with it, and with which nodes."""

    kind: str
    said: str
    worn: Worn
    """The truth; its nodes are the spoilt ones."""


def session(seed: int) -> Planted:
    """Arms on even seeds, legs on odd ones; the kinds in turn."""
    random = np.random.default_rng([seed, 77])
    worn = wear("nursing" if seed % 2 == 0 else "lower_limb", 1000 + seed)
    kind = list(KINDS)[(seed // 2) % len(KINDS)]
    name = str(random.choice(list(worn.nodes)))
    before = worn.nodes
    nodes = KINDS[kind](dict(before), name, random)
    touched = [n for n in nodes if nodes[n] is not before[n]]
    return Planted(kind, f"{kind} {', '.join(touched)}", replace(worn, nodes=nodes))


def _sound(nodes: Nodes, _name: str, _random: np.random.Generator) -> Nodes:
    return nodes


def _gyro(nodes: Nodes, name: str, change: Callable[[Array], Array]) -> Nodes:
    return {**nodes, name: replace(nodes[name], gyr_rad_s=change(nodes[name].gyr_rad_s))}


def _negated(nodes: Nodes, name: str, random: np.random.Generator) -> Nodes:
    signs = np.ones(3)
    signs[random.integers(3)] = -1.0
    return _gyro(nodes, name, lambda gyr: gyr * signs)


def _exchanged(nodes: Nodes, name: str, random: np.random.Generator) -> Nodes:
    order = [[1, 0, 2], [0, 2, 1], [2, 1, 0], [1, 2, 0]][random.integers(4)]
    return _gyro(nodes, name, lambda gyr: gyr[:, order])


def _clipped(nodes: Nodes, _name: str, random: np.random.Generator) -> Nodes:
    """Of the whole suit, at a share of what the fastest axis reaches."""
    fastest = max(float(np.abs(n.gyr_rad_s).max()) for n in nodes.values())
    limit = float(random.uniform(0.25, 0.8)) * fastest
    return {
        k: replace(n, gyr_rad_s=np.clip(n.gyr_rad_s, -limit, limit))
        if np.abs(n.gyr_rad_s).max() > limit
        else n
        for k, n in nodes.items()
    }


def _swapped(nodes: Nodes, name: str, random: np.random.Generator) -> Nodes:
    other = str(random.choice([n for n in nodes if n != name]))
    return {**nodes, name: nodes[other], other: nodes[name]}


def _slipped(nodes: Nodes, name: str, random: np.random.Generator) -> Nodes:
    unit = nodes[name]
    axis = normalise(random.normal(size=3))
    at = round(float(random.uniform(0.25, 0.9)) * len(unit.gyr_rad_s))
    turn = from_axis_angle(axis, math.radians(float(random.uniform(10.0, 60.0))))
    acc, gyr = unit.acc_m_s2.copy(), unit.gyr_rad_s.copy()
    acc[at:], gyr[at:] = rotate(turn, acc[at:]), rotate(turn, gyr[at:])
    return {**nodes, name: replace(unit, acc_m_s2=acc, gyr_rad_s=gyr)}


def _late(nodes: Nodes, name: str, random: np.random.Generator) -> Nodes:
    unit, by = nodes[name], int(random.integers(4, 40))
    acc, gyr = (np.concatenate([v[:1].repeat(by, axis=0), v[:-by]]) for v in (unit.acc_m_s2, unit.gyr_rad_s))
    return {**nodes, name: replace(unit, acc_m_s2=acc, gyr_rad_s=gyr)}


def _degrees(nodes: Nodes, name: str, random: np.random.Generator) -> Nodes:
    chosen = list(nodes) if random.random() < 0.5 else [name]
    for one in chosen:
        nodes = _gyro(nodes, one, np.degrees)
    return nodes


def _in_g(nodes: Nodes, name: str, random: np.random.Generator) -> Nodes:
    chosen = list(nodes) if random.random() < 0.5 else [name]
    return nodes | {n: replace(nodes[n], acc_m_s2=nodes[n].acc_m_s2 / 9.80665) for n in chosen}


def _sides(nodes: Nodes, _name: str, _random: np.random.Generator) -> Nodes:
    """Everything of the left worn on the right."""
    other = {n: n.replace("left_", "RIGHT").replace("right_", "left_") for n in nodes}
    return {n: nodes[o.replace("RIGHT", "right_")] for n, o in other.items()}


KINDS: dict[str, Plant] = {
    "sound": _sound,
    "gyro axis negated": _negated,
    "gyro axes exchanged": _exchanged,
    "gyro clipped": _clipped,
    "two nodes exchanged": _swapped,
    "slip": _slipped,
    "late clock": _late,
    "gyro in deg/s": _degrees,
    "accelerometer in g": _in_g,
    "sides exchanged": _sides,
}


@dataclass(frozen=True)
class Covered:
    """One written node."""

    name: str
    error_deg: float
    sigma_deg: float

    @property
    def inside(self) -> bool:
        """Whether the real error is within the stated 95 %."""
        return self.error_deg <= 1.96 * self.sigma_deg


def covered(worn: Worn, found: SuitAlignment) -> list[Covered]:
    """Every written node's whole error of rotation, as it sat in the zero pose."""
    return [
        Covered(
            name,
            math.degrees(
                float(angle_between(node.q_sensor_from_segment, conjugate(worn.q_segment_from_sensor[name])))
            ),
            math.degrees(node.sigma_rad),
        )
        for name, node in found.nodes.items()
    ]


def count(seeds: Iterable[int]) -> dict[str, Counter[str]]:
    """By kind: sessions, nodes refused, nodes written, and written ones whose error is within 95 %."""
    out: dict[str, Counter[str]] = {kind: Counter() for kind in KINDS}
    for seed in seeds:
        planted = session(seed)
        counts = out[planted.kind]
        counts["sessions"] += 1
        try:
            found = find_alignment(planted.worn.nodes, planted.worn.skeleton)
        except TandemError:
            counts["refused"] += len(planted.worn.nodes)
            continue
        written = covered(planted.worn, found)
        counts["refused"] += len(found.refused)
        counts["written"] += len(written)
        counts["covered"] += sum(node.inside for node in written)
    return out


if __name__ == "__main__":
    totals = count(range(int(sys.argv[1]), int(sys.argv[2])))
    for kind, counts in totals.items():
        sys.stdout.write(f"{kind:22s} {dict(counts)}\n")
    sys.stdout.write(f"all {dict(sum(totals.values(), Counter()))}\n")
