"""How far the robot's parts are from each other and from what stands around it, and what changes that.

One call of MuJoCo's collision pipeline finds every pair nearer than `REACH_M` beyond its margin. README.md
has what this costs, and what other ways cost.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
from numpy.typing import NDArray

from common.quaternion import Array
from common.skeleton import Skeleton
from slave.model.build import add_segments, unit_rates
from slave.model.capsules import capsules, links
from slave.model.pairs import groups, moving, pairs

REACH_M = 0.12
"""A pair further apart than its margin and this is not looked at."""

CLOSE_M = 0.05
"""The same, for a quicker look."""

Indices = NDArray[np.intp]


@dataclass(frozen=True, slots=True)
class Obstacle:
    """Something that is fixed to the base: a name, and what MuJoCo calls its shape, as attributes."""

    name: str
    geom: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class NearPairs:
    """The near pairs of one posture: K rows, some pairs twice (where one capsule lies along another)."""

    pair: Indices
    """(K,) places in `DistanceModel.names`."""
    distance_m: Array
    """(K,) between the surfaces; below 0 inside."""


@dataclass(frozen=True, slots=True)
class _Plan:
    """What of a robot among its obstacles is worked out once."""

    model: mujoco.MjModel
    hinges_per_joint: Array
    pair_of: Indices
    """(geoms, geoms): the pair's place, -1: none."""
    names: Sequence[tuple[str, str]]
    obstacle: Indices
    carries: Array
    kind: Indices
    levers_m: Array


class DistanceModel:
    """Distances at any joint angles."""

    def __init__(
        self, skeleton: Skeleton, obstacles: Sequence[Obstacle] = (), margins_m: Sequence[float] = ()
    ) -> None:
        """`obstacles` beside the robot's own stand, and the margin of the robot itself, then of each."""
        margins = tuple(margins_m) or (0.0,) * (1 + len(obstacles))
        plan = _plan(skeleton, tuple(obstacles), margins)
        close = copy.copy(plan.model)
        close.pair_margin += CLOSE_M - REACH_M
        close.pair_gap += CLOSE_M - REACH_M
        self._far, self._close = (plan.model, mujoco.MjData(plan.model)), (close, mujoco.MjData(close))
        self._data = self._far[1]
        self._hinges_per_joint, self._pair_of, self._carries = (
            plan.hinges_per_joint, plan.pair_of, plan.carries,
        )  # fmt: skip
        self.names = plan.names
        """(P,) what people call the two of every pair; the first is a part of the robot."""
        self.obstacle = plan.obstacle
        """(P,) place in `obstacles` of the one in each pair; -1: the robot's own parts, and its stand."""
        self.kind = plan.kind
        """(P,) the row in `levers_m` of each pair: pairs between which the same joints turn share one."""
        self.levers_m = plan.levers_m
        """(R, J) m a rad: how far each joint moves the two of such a pair relative to each other at most."""

    def near(self, position_rad: Array, close: bool = False) -> NearPairs:
        """Pairs nearer than `REACH_M` beyond their margins at joint angles (J,); `close`: than `CLOSE_M`."""
        model, data = self._close if close else self._far
        self._data = data
        data.qpos[:] = position_rad @ self._hinges_per_joint
        mujoco.mj_kinematics(model, data)
        mujoco.mj_collision(model, data)
        geom = data.contact.geom
        return NearPairs(self._pair_of[geom[:, 0], geom[:, 1]], data.contact.dist.copy())

    def gradient(self, rows: Indices) -> Array:
        """(rows, J): how fast distances of the newest `near` grow by each joint's rad/s.

        For the nearest points p on b and q on a, and the normal n from a to b:  d' = n · (p' - q').
        """
        contact = self._data.contact
        geom = contact.geom[rows]
        # the point midway between p and q does as well as either: they differ along n
        return self._along(
            rows, contact.frame[rows, :3], self._carries[geom[:, 1]] - self._carries[geom[:, 0]]
        )

    def towards(self, rows: Indices, direction: Array) -> Array:
        """(rows, J): how fast the robot's points nearest to obstacles go along `direction`, (rows, 3)."""
        return self._along(rows, direction, self._carries[self._data.contact.geom[rows]].max(axis=1))

    def velocity(self, rows: Indices, rate_rad_s: Array) -> Array:
        """(rows, 3) m/s: of the robot's points nearest to obstacles, at joint rates (J,)."""
        carried = self._carries[self._data.contact.geom[rows]].max(axis=1)
        axis, anchor = self._data.xaxis, self._data.xanchor
        turning = (rate_rad_s @ self._hinges_per_joint)[:, None] * axis
        # hinges with axes h through o that turn at w:  Σ w h x (p - o) = (Σ w h) x p - Σ w h x o
        out: Array = _cross(carried @ turning, self._data.contact.pos[rows])
        out -= carried @ _cross(turning, anchor)
        return out

    def _along(self, rows: Indices, direction: Array, carried: Array) -> Array:
        """A hinge with axis h through o moves p along n by  n · (h x (p - o)) = h · (p x n) - n · (h x o)."""
        axis, anchor = self._data.xaxis, self._data.xanchor
        turning = _cross(self._data.contact.pos[rows], direction) @ axis.T
        turning -= direction @ _cross(axis, anchor).T
        out: Array = (carried * turning) @ self._hinges_per_joint.T
        return out


_ZONE, _PART = "zone ", "part "


def _cross(a: Array, b: Array) -> Array:
    """Of rows of three; numpy's own takes four times as long."""
    out: Array = a[:, _AFTER] * b[:, _BEFORE] - a[:, _BEFORE] * b[:, _AFTER]
    return out


_AFTER, _BEFORE = [1, 2, 0], [2, 0, 1]


def _shown(model: mujoco.MjModel, geom: int, part: dict[str, str]) -> str:
    """What a person calls the part or obstacle of a geom."""
    name: str = model.geom(geom).name
    if name.startswith(_PART):
        body: str = model.body(model.geom_bodyid[geom]).name
        return part[body].replace("_", " ")
    return name.removeprefix(_ZONE)


@lru_cache(maxsize=16)
def _plan(skeleton: Skeleton, obstacles: tuple[Obstacle, ...], margins_m: tuple[float, ...]) -> _Plan:
    model = _compiled(skeleton, obstacles, margins_m)
    hinges_per_joint = unit_rates(skeleton, model)
    first, second = model.pair_geom1, model.pair_geom2
    pair_of = np.full((model.ngeom, model.ngeom), -1, np.intp)
    pair_of[first, second] = pair_of[second, first] = np.arange(model.npair)
    part = {link.name: group for link, group in zip(links(skeleton), groups(skeleton), strict=True)}
    shown = [_shown(model, geom, part) for geom in range(model.ngeom)]
    # what is further out in the tree comes first, and what is fixed to the base last
    both = np.sort(np.stack([first, second], axis=1), axis=1)[:, ::-1].tolist()
    zones = {obstacle.name: i for i, obstacle in enumerate(obstacles)}
    owner = np.array([zones.get(model.geom(g).name.removeprefix(_ZONE), -1) for g in range(model.ngeom)])
    carries = _carries(model)
    one_side = (carries[first] != 0.0) ^ (carries[second] != 0.0)
    concerned = (one_side.astype(np.float64) @ (hinges_per_joint != 0.0).T) > 0.0
    joints, kind = np.unique(concerned, axis=0, return_inverse=True)
    levers = _levers_m(skeleton, model, hinges_per_joint)
    levers_m = np.zeros(joints.shape)
    np.maximum.at(levers_m, kind, np.where(concerned, np.maximum(levers[first], levers[second]), 0.0))
    return _Plan(
        model, hinges_per_joint, pair_of, names=[(shown[a], shown[b]) for a, b in both],
        obstacle=np.maximum(owner[first], owner[second]), carries=carries, kind=kind, levers_m=levers_m,
    )  # fmt: skip


def _compiled(
    skeleton: Skeleton, obstacles: tuple[Obstacle, ...], margins_m: tuple[float, ...]
) -> mujoco.MjModel:
    """The robot as bare capsules, the obstacles, and the pairs as contacts that begin at their reach."""
    root = ET.Element("mujoco", model=skeleton.name)
    ET.SubElement(root, "compiler", angle="radian")
    ET.SubElement(root, "size", memory="4M")
    # only the pairs below count
    ET.SubElement(ET.SubElement(root, "default"), "geom", contype="0", conaffinity="0")
    world = ET.SubElement(root, "worldbody")
    bodies = add_segments(world, skeleton)
    geoms = [geom for link in links(skeleton) for geom in bodies[link.name].findall("geom")]
    for i, geom in enumerate(geoms):
        geom.set("name", f"{_PART}{i}")
    contact = ET.SubElement(root, "contact")

    def watch(a: str, b: str, margin_m: float) -> None:
        reach = f"{margin_m + REACH_M!r}"
        ET.SubElement(contact, "pair", geom1=a, geom2=b, margin=reach, gap=reach)

    own, *others = margins_m
    for a, b in pairs(skeleton):
        watch(f"{_PART}{a}", f"{_PART}{b}", own)
    free = moving(skeleton)
    for i, post in enumerate(skeleton.stand):
        # as a bar with round ends: the flat ends of a cylinder would cost far more, and shield nothing
        name, line = f"stand {i}" if i else "stand", (*post.from_m, *post.to_m)
        fromto = " ".join(map(repr, line))
        ET.SubElement(world, "geom", name=name, type="capsule", fromto=fromto, size=f"{post.radius_m!r}")
        for a in free:
            watch(f"{_PART}{a}", name, own)
    for obstacle, margin_m in zip(obstacles, others, strict=True):
        ET.SubElement(world, "geom", dict(obstacle.geom), name=_ZONE + obstacle.name)
        for a in range(len(geoms)):
            watch(f"{_PART}{a}", _ZONE + obstacle.name, margin_m)
    return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))


def _carries(model: mujoco.MjModel) -> Array:
    """(geoms, H): 1 where the hinge moves the geom."""
    carries = np.zeros((model.nbody, model.nv))
    for body in range(1, model.nbody):
        carries[body] = carries[model.body_parentid[body]]
        first = model.body_jntadr[body]
        carries[body, first : first + model.body_jntnum[body]] = 1.0
    out: Array = carries[model.geom_bodyid]
    return out


def _levers_m(skeleton: Skeleton, model: mujoco.MjModel, hinges_per_joint: Array) -> Array:
    """(geoms, J): how far a rad of each joint moves any point of a geom at most, whatever the posture."""
    levers = np.zeros((model.ngeom, model.nv))
    for i, capsule in enumerate(capsules(skeleton)):
        geom = model.geom(f"{_PART}{i}").id
        # the farthest point from the segment's joint, then from each joint above it
        far = max(float(np.linalg.norm(capsule.from_m)), float(np.linalg.norm(capsule.to_m)))
        far += capsule.radius_m
        body = model.geom_bodyid[geom]
        while body > 0:
            first = model.body_jntadr[body]
            levers[geom, first : first + model.body_jntnum[body]] = far
            far += float(np.linalg.norm(model.body_pos[body]))
            body = model.body_parentid[body]
    out: Array = levers @ np.abs(hinges_per_joint).T
    return out
