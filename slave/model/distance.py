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

CLOSE_M = 0.02
"""The same, for the quickest look."""

_REACHES_M = (CLOSE_M, 0.05, REACH_M)
"""A look takes the least of these that is enough: the fewer pairs it finds, the less it costs."""

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
    reach_m: float
    """All other pairs are further apart than this beyond their margins."""


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
    radius_m: Array


class _Speeds:
    """How fast the two of every pair come together at most, by their velocities in one posture."""

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model, self._data = model, data
        self._rate, self._twist, self._place = data.qvel, data.cvel, data.geom_xpos
        self._body: Indices = model.geom_bodyid.astype(np.intp)
        self._origin, self._root = data.subtree_com, model.body_rootid.astype(np.intp).take(self._body)
        self._first: Indices = model.pair_geom1.astype(np.intp)
        self._second: Indices = model.pair_geom2.astype(np.intp)
        # what is fixed does not turn: a plane has no radius
        self._radius_m: Array = np.where(self._body > 0, model.geom_rbound, 0.0)

    def closing_m_s(self, hinge_rad_s: Array) -> Array:
        """(P,): the sum of both's top speeds: of the centre, and how fast other points turn about it."""
        self._rate[:] = hinge_rad_s
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_comVel(self._model, self._data)
        twist = self._twist.take(self._body, 0)
        turning = twist[:, :3]
        moving = cross(turning, self._place - self._origin.take(self._root, 0))
        moving += twist[:, 3:]
        top = np.sqrt(np.einsum("ij,ij->i", moving, moving))
        top += self._radius_m * np.sqrt(np.einsum("ij,ij->i", turning, turning))
        out: Array = top.take(self._first)
        out += top.take(self._second)
        return out


class DistanceModel:
    """Distances at any joint angles."""

    def __init__(
        self, skeleton: Skeleton, obstacles: Sequence[Obstacle] = (), margins_m: Sequence[float] = ()
    ) -> None:
        """`obstacles` beside the robot's own stand, and the margin of the robot itself, then of each."""
        margins = tuple(margins_m) or (0.0,) * (1 + len(obstacles))
        plan = _plan(skeleton, tuple(obstacles), margins)
        self._models = {reach_m: _reaching(plan.model, reach_m) for reach_m in _REACHES_M}
        self._model, self._data = plan.model, mujoco.MjData(plan.model)
        # views of arrays are fetched once: each access would build a new one
        self._hinge, self._axis, self._anchor = self._data.qpos, self._data.xaxis, self._data.xanchor
        self._speeds = _Speeds(plan.model, self._data)
        self._hinges_per_joint, self._carries = plan.hinges_per_joint, plan.carries
        self._joints_of_hinges = np.ascontiguousarray(plan.hinges_per_joint.T)
        self._pair_of, self._geoms = plan.pair_of.ravel(), len(plan.pair_of)
        self._geom: Indices = np.empty((0, 2), np.intp)
        """(K, 2) the two of each row of the newest `near`."""
        self._moment: Array | None = None
        """(H, 3) anchor x axis of every hinge in the posture of the newest `near`; None: not computed yet."""
        self.names = plan.names
        """(P,) what people call the two of every pair; the first is a part of the robot."""
        self.obstacle = plan.obstacle
        """(P,) place in `obstacles` of the one in each pair; -1: the robot's own parts, and its stand."""
        self.kind = plan.kind
        """(P,) the row in `levers_m` of each pair: pairs between which the same joints turn share one."""
        self.levers_m = plan.levers_m
        """(R, J) m a rad: how far each joint moves the two of such a pair relative to each other at most."""
        self.radius_m = plan.radius_m
        """(P,) sum of the radii of the two of each pair: 0 for the edges of a box, inf for a plane."""

    def near(self, position_rad: Array, reach_m: float = REACH_M) -> NearPairs:
        """Pairs nearer than `reach_m`, or somewhat more, beyond their margins at joint angles (J,).

        No look reaches further than `REACH_M`.
        """
        self.pose(position_rad)
        return self.near_here(reach_m)

    def pose(self, position_rad: Array) -> None:
        """Go to joint angles (J,)."""
        self._hinge[:] = position_rad @ self._hinges_per_joint
        mujoco.mj_kinematics(self._model, self._data)
        self._moment = None

    def closing_m_s(self, rate_rad_s: Array) -> Array:
        """(P,) how fast the two of each pair come together at most, here, at joint rates (J,)."""
        return self._speeds.closing_m_s(rate_rad_s @ self._hinges_per_joint)

    def near_here(self, reach_m: float = REACH_M) -> NearPairs:
        """The same as `near`, in the posture of the last `pose`."""
        reach_m = next((one for one in _REACHES_M if one >= reach_m), REACH_M)
        mujoco.mj_collision(self._models[reach_m], self._data)
        contact = self._data.contact
        self._geom = geom = contact.geom.astype(np.intp)
        pair = self._pair_of.take(geom[:, 0] * self._geoms + geom[:, 1])
        return NearPairs(pair, contact.dist.copy(), reach_m)

    def gradient(self, rows: Indices) -> Array:
        """(rows, J): how fast distances of the newest `near` grow by each joint's rad/s.

        For the nearest points p on b and q on a, and the normal n from a to b:  d' = n · (p' - q').
        """
        geom = self._geom.take(rows, 0)
        carried = self._carries.take(geom[:, 1], 0)
        carried -= self._carries.take(geom[:, 0], 0)
        # the point midway between p and q does as well as either: they differ along n
        return self._along(rows, self._data.contact.frame[rows, :3], carried)

    def towards(self, rows: Indices, direction: Array) -> Array:
        """(rows, J): how fast the robot's points nearest to obstacles go along `direction`, (rows, 3)."""
        return self._along(rows, direction, self._carried(rows))

    def velocity(self, rows: Indices, rate_rad_s: Array) -> Array:
        """(rows, 3) m/s: of the robot's points nearest to obstacles, at joint rates (J,)."""
        carried = self._carried(rows)
        turning = rate_rad_s @ self._hinges_per_joint
        # hinges with axes h through o that turn at w:  Σ w h x (p - o) = (Σ w h) x p + Σ w (o x h)
        out = cross(carried @ (turning[:, None] * self._axis), self._data.contact.pos.take(rows, 0))
        out += carried @ (turning[:, None] * self._moments())
        return out

    def _carried(self, rows: Indices) -> Array:
        """(rows, H): 1 where the hinge moves the robot's part of a pair with an obstacle."""
        geom = self._geom.take(rows, 0)
        return np.maximum(self._carries.take(geom[:, 0], 0), self._carries.take(geom[:, 1], 0))

    def _moments(self) -> Array:
        if self._moment is None:
            self._moment = cross(self._anchor, self._axis)
        return self._moment

    def _along(self, rows: Indices, direction: Array, carried: Array) -> Array:
        """A hinge with axis h through o moves p along n by  n · (h x (p - o)) = h · (p x n) + n · (o x h)."""
        turning = cross(self._data.contact.pos.take(rows, 0), direction) @ self._axis.T
        turning += direction @ self._moments().T
        turning *= carried
        out: Array = turning @ self._joints_of_hinges
        return out


_ZONE, _PART = "zone ", "part "


_AFTER, _BEFORE = np.array([1, 2, 0]), np.array([2, 0, 1])


def cross(a: Array, b: Array) -> Array:
    """Cross products of rows (N, 3); numpy's own takes six times as long."""
    out: Array = a.take(_AFTER, 1) * b.take(_BEFORE, 1)
    out -= a.take(_BEFORE, 1) * b.take(_AFTER, 1)
    return out


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
        radius_m=_radius_m(model)[first] + _radius_m(model)[second],
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


def _reaching(model: mujoco.MjModel, reach_m: float) -> mujoco.MjModel:
    """The model whose pairs begin at another reach."""
    out = copy.copy(model)
    out.pair_margin += reach_m - REACH_M
    out.pair_gap += reach_m - REACH_M
    return out


def _radius_m(model: mujoco.MjModel) -> Array:
    """(geoms,) by how much each is round: the radius of a capsule or sphere, 0 of a box, inf of a plane."""
    kind = model.geom_type
    out: Array = np.where(kind == mujoco.mjtGeom.mjGEOM_BOX, 0.0, model.geom_size[:, 0])
    return np.where(kind == mujoco.mjtGeom.mjGEOM_PLANE, np.inf, out)


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
