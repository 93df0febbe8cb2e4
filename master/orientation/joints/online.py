"""The suit's headings online: gyros for the short term, joints and magnetometers for the long."""

from __future__ import annotations

import math

import numpy as np
from pydantic import Field

from common.config.section import Section
from common.quaternion import Array, conjugate, heading_rad, heading_turn, multiply, rotate
from common.skeleton import Skeleton
from common.wire.messages import Mask
from master.orientation.joints.constraints import JointConstraints
from master.orientation.joints.contradicted import ContradictedJoints
from master.orientation.joints.field import MagneticHeadings
from master.orientation.joints.headings import Headings, Indices
from master.suit.doubt import NodeDoubt, Weight

EVERY = 16
"""Ticks from one correction to the next."""
_LARGEST = 3.0
"""Standard deviations beyond which a joint's error counts no more than in proportion (Huber)."""


class OnlineConfig(Section):
    """`[estimation.online]`: what is believed of joints, magnetometers and gyros.

    Joints and fields err for a while, not at random from one tick to the next: each comes with the time for
    which it keeps its error, and counts as one measurement in twice that time.
    """

    joint_sd_deg: float = Field(default=2.0, gt=0.0, le=90.0, allow_inf_nan=False)
    """How far a joint turns about an axis about which it should not, degrees: alignment, skin, anatomy.
    Larger: joints correct more slowly, and wrong ones do less harm."""
    joint_memory_s: float = Field(default=1.0, gt=0.0, allow_inf_nan=False)
    """For how long it keeps that error, s."""
    magnetic_sd_deg: float = Field(default=1.5, gt=0.0, le=90.0, allow_inf_nan=False)
    """How far an undisturbed magnetometer's north is off, degrees. Larger: magnetometers count for less."""
    magnetic_memory_s: float = Field(default=10.0, gt=0.0, allow_inf_nan=False)
    """For how long it keeps that error, s."""
    disturbance_memory_s: float = Field(default=30.0, gt=0.0, allow_inf_nan=False)
    """Time constant with which a disturbance of the field is forgotten, s."""
    walk_deg_sqrt_s: float = Field(default=0.2, gt=0.0, allow_inf_nan=False)
    """Random walk of a gyro's heading: degrees after a second, ten times that after a hundred. Larger: joints
    and magnetometers correct faster, and disturb more."""
    drift_deg_s: float = Field(default=0.05, gt=0.0, allow_inf_nan=False)
    """Steady drift of a gyro's heading at the start, degrees/s: what its filter's bias estimate leaves."""
    drift_walk_deg_s_sqrt_s: float = Field(default=0.01, gt=0.0, allow_inf_nan=False)
    """How that drift changes: a random walk, degrees/s after a second."""
    start_sd_deg: float = Field(default=10.0, gt=0.0, le=180.0, allow_inf_nan=False)
    """Of the heading with which a node begins, by its magnetometer or as it was when it was lost."""
    zero_pose_sd_deg: float = Field(default=2.0, gt=0.0, le=90.0, allow_inf_nan=False)
    """Of the heading that a zero pose gives."""


def constrains(joints: JointConstraints, nodes: Mask) -> Mask:
    """(M,) the pairs of axes between two of the nodes, mask (N,)."""
    out: Mask = nodes[joints.child] & nodes[joints.parent]
    return out


class OnlineHeadings:
    """One heading correction for each of N nodes, on top of their filters without magnetometer.

    Each 16th tick the joints' constraints and the magnetometers correct all headings together. Where joints
    tell enough, magnetic disturbances do not come in; where they do not (ball joints, axes that stand
    upright), the gyros carry the heading over a disturbance for as long as they can.
    """

    def __init__(
        self, config: OnlineConfig, skeleton: Skeleton, rate_hz: float, aligned: Mask | None = None
    ) -> None:
        """Joints between two nodes that are `aligned` (N,) count; None: every joint counts."""
        count = len(skeleton.segments)
        self._config = config
        self._rate_hz = rate_hz
        self._joints = JointConstraints(skeleton)
        self._counts = constrains(self._joints, np.ones(count, np.bool_) if aligned is None else aligned)
        self._contradicted = ContradictedJoints(len(self._joints))
        self._names = skeleton.segment_names
        self._rows = np.arange(len(self._joints))
        self._field = MagneticHeadings(count, config.disturbance_memory_s)
        self._start = math.radians(config.start_sd_deg) ** 2
        self._drift = math.radians(config.drift_deg_s) ** 2
        self._headings = Headings(np.full(count, self._start), np.full(count, self._drift))
        self._held = np.full((count, 4), np.nan)
        self._ticks = 0
        self.turn: Array = heading_turn(np.zeros(count))
        """(N, 4) the corrections as rotations of the world."""

    def lose(self, nodes: Mask, q_inertial_from_sensor: Array) -> None:
        """Keep the orientations (N, 4), as the filters give them, of nodes that were trusted until now."""
        self._held[nodes] = multiply(self.turn[nodes], q_inertial_from_sensor[nodes])

    def find(self, nodes: Mask, q_inertial_from_sensor: Array, magnetic_rad: Array) -> None:
        """Begin with nodes that have settled: with the heading their filter found by its magnetometer.

        `magnetic_rad` (N,) leads to it from `q_inertial_from_sensor` (N, 4). Without one (NaN) they begin
        with the heading they had.
        """
        before = heading_rad(multiply(self._held, conjugate(q_inertial_from_sensor)))
        magnetic = magnetic_rad - self._field.north_rad
        theta = np.where(np.isfinite(magnetic), magnetic, np.nan_to_num(before))
        self._field.restart(nodes)
        self._headings.set(nodes, theta, self._start)
        self._headings.restart_drift(nodes, self._drift)
        self._turn()

    def stand(self, nodes: Mask, correction_rad: Array, q_inertial_from_sensor: Array, mag_ut: Array) -> None:
        """Take the headings that a zero pose gives some nodes: by `correction_rad` (N,) from those so far."""
        theta = self._headings.theta_rad + np.where(nodes, correction_rad, 0.0)
        self._headings.set(nodes, theta, math.radians(self._config.zero_pose_sd_deg) ** 2)
        self._field.set_north(nodes, theta, rotate(q_inertial_from_sensor, mag_ut))
        self._turn()

    def due(self) -> bool:
        """One tick passes; True where it is time to correct."""
        self._ticks += 1
        return self._ticks % EVERY == 0

    def correct(self, q_inertial_from_sensor: Array, mag_ut: Array, alignment: Array, usable: Mask) -> None:
        """Takes the filters' orientations (N, 4), calibrated fields (N, 3), `q_sensor_from_segment` (N, 4).

        Nodes that are not `usable` (N,) neither correct nor are corrected.
        """
        config, headings = self._config, self._headings
        dt_s = EVERY / self._rate_hz
        headings.drift(
            dt_s,
            math.radians(config.walk_deg_sqrt_s) ** 2,
            math.radians(config.drift_walk_deg_s_sqrt_s) ** 2,
        )
        information, gain = self._from_field(rotate(q_inertial_from_sensor, mag_ut), usable, dt_s)
        if len(self._joints):
            q = multiply(multiply(self.turn, q_inertial_from_sensor), alignment)
            of_joints, gain_of_joints = self._from_joints(q, usable, dt_s)
            information += of_joints
            gain += gain_of_joints
        headings.correct(information, gain)
        self._turn()

    def _from_field(self, mag_world_ut: Array, usable: Mask, dt_s: float) -> tuple[Array, Array]:
        """Information (N, N) and gain (N,) of the magnetometers."""
        config, headings = self._config, self._headings
        field = np.where(usable[:, None], mag_world_ut, np.nan)
        away, disturbed = self._field.measure(field, headings.theta_rad, headings.variance, dt_s)
        share = dt_s / (2.0 * config.magnetic_memory_s)
        weight = share / (math.radians(config.magnetic_sd_deg) ** 2 + disturbed)
        return np.diag(weight), weight * away

    def _from_joints(self, q_world_from_segment: Array, usable: Mask, dt_s: float) -> tuple[Array, Array]:
        """Information (N, N) and gain (N,) of the joints."""
        config, joints, rows = self._config, self._joints, self._rows
        error, slope = joints.measure(q_world_from_segment)
        variance = math.radians(config.joint_sd_deg) ** 2
        foretold = variance + slope**2 * self._headings.variance_between(joints.child, joints.parent)
        trust = np.minimum(1.0, _LARGEST * np.sqrt(foretold) / np.maximum(np.abs(error), 1e-12))
        both = constrains(joints, usable) & self._counts
        trust[~both] = 0.0
        self._contradicted.add(error, both, dt_s)
        weight = trust * (dt_s / (2.0 * config.joint_memory_s) / variance)
        matrix = np.zeros((len(joints), len(usable)))
        matrix[rows, joints.child] = slope
        matrix[rows, joints.parent] = -slope
        weighted = matrix.T * weight
        return weighted @ matrix, -(weighted @ error)

    def doubts(self) -> dict[int, NodeDoubt]:
        """Nodes, by number, that keep turning as their joint cannot: what holds them may hold them wrong."""
        joints, found = self._joints, self._contradicted
        return {
            int(joints.child[k]): NodeDoubt(
                f"turns by {found.degrees(k):.0f}° against {self._names[joints.parent[k]]} about an axis "
                "about which the joint cannot: its alignment, zero pose or heading is wrong, or it slipped. "
                "Take the zero pose again, or `tandem calibrate align`",
                Weight.NOTED,
            )
            for k in np.flatnonzero(found.now).tolist()
        }

    def uncertainty_rad(self, parents: Indices) -> Array:
        """Standard deviation (N,) of each heading against its parent's, `parents` (N,); a root's own."""
        nodes = np.arange(len(parents))
        between = self._headings.variance_between(nodes, parents)
        out: Array = np.sqrt(np.where(parents >= 0, between, self._headings.variance))
        return out

    def _turn(self) -> None:
        self.turn = heading_turn(self._headings.theta_rad)
