"""The angle of a hinge joint from the two nodes beside it, without magnetometers (paper C, section 4.1).

The gyros' difference about the axis, integrated, is right in the short term. In the long term both
accelerometers tell: reduced to the joint's centre they feel one and the same specific force, and the angle
between its two images in the plane of rotation is the joint's (Seel, Raisch and Schauer 2014, Eqs 10 to 16).
Single samples are drowned by the skin's shaking. So each image is first turned back by its own gyro's angle
about the axis, after which both are one and the same slow signal but for a constant phase, and a low-pass
takes off what they do not share. A Kalman filter of angle and drift fuses the two. Neither node's orientation
is in it: for a knee it is a reference that shares nothing with the solver but the readings.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from pydantic import Field

from common.config.section import Section
from common.quaternion import Array, cross, rotate
from common.skeleton import Skeleton


class HingeAngleConfig(Section):
    """How much each source is believed: the gyros within about a second, beyond it the accelerometers.

    A person who jogs is the measure of the defaults: a knee's angle is then within 3° of the one by both
    nodes' orientations (RMS), where single samples' forces, unsmoothed, end 40° off.
    """

    smooth_s: float = Field(default=1.0, gt=0.0)
    """Time constant of the forces' low-pass. Larger: steadier against shaking, slower to see a drift."""
    acceleration_noise: float = Field(default=0.05, gt=0.0)
    """Density of the reduced accelerations' error, m/s² √s, more than the sensors' own for what skin and
    levers add. Larger: the angle follows the gyros longer."""
    disagreement_s: float = Field(default=0.05, ge=0.0)
    """What the two nodes do not agree on is error, and lasts this long. Larger: motion counts for less."""
    rate_noise: float = Field(default=0.02, gt=0.0)
    """Density of the relative rate's error, rad/√s: of axes and gain above all. Larger: followed shorter."""
    drift_noise: float = Field(default=1e-4, ge=0.0)
    """Random walk of the gyros' drift, rad/s/√s."""
    first_drift_rad_s: float = Field(default=0.01, ge=0.0)
    """How large the drift may be at the start, one standard deviation."""
    first_angle_rad: float = Field(default=0.5, gt=0.0)
    """How wrong the first angle may be, which takes the node to stand still, one standard deviation."""


@dataclass(frozen=True, slots=True)
class Hinge:
    """K hinges and how the two nodes of each sit, in sensor frames; 1 is the near segment, 2 the far one.

    The leading shape may be empty: one hinge.
    """

    axis1: Array
    """(..., 3) unit axis about which segment 2 turns positively, seen by node 1."""
    axis2: Array
    """(..., 3) the same axis seen by node 2."""
    zero1: Array
    """(..., 3) a direction across the axis, seen by node 1 …"""
    zero2: Array
    """(..., 3) … which at angle 0 points the same way as this one, seen by node 2."""
    lever1_m: Array
    """(..., 3) from the joint's centre to node 1, seen by node 1."""
    lever2_m: Array
    """(..., 3) from the joint's centre to node 2, seen by node 2."""


def hinge_of(skeleton: Skeleton, segments: list[str], q_sensor_from_segment: Array) -> Hinge:
    """Hinges about the first axis of the named segments' joints, as table and alignment (N, 4) have them."""
    far = [skeleton.segment_names.index(name) for name in segments]
    near = skeleton.parents[far]
    q1, q2 = q_sensor_from_segment[near], q_sensor_from_segment[far]
    chosen = [skeleton.segments[i] for i in far]
    axis, zero = (np.array([s.axes[k] for s in chosen], dtype=np.float64) for k in (0, 1))
    origin_m = np.array([s.origin_m for s in chosen])
    node_m = np.array([s.node_m for s in skeleton.segments])
    return Hinge(
        axis1=rotate(q1, axis),
        axis2=rotate(q2, axis),
        zero1=rotate(q1, zero),
        zero2=rotate(q2, zero),
        lever1_m=rotate(q1, node_m[near] - origin_m),
        lever2_m=rotate(q2, node_m[far]),
    )


def force_at_joint(acc_m_s2: Array, gyr_rad_s: Array, gyr_change_rad_s2: Array, lever_m: Array) -> Array:
    """Specific force at the joint's centre, f − ω̇ × r − ω × (ω × r), sensor frame; shapes (..., 3)."""
    swing = cross(gyr_change_rad_s2, lever_m)
    return acc_m_s2 - swing - cross(gyr_rad_s, cross(gyr_rad_s, lever_m))


@dataclass(frozen=True, slots=True)
class ForceAngle:
    """What two forces say of the angle."""

    angle_rad: Array
    """(...) in [-π, π]."""
    across_m_s2: Array
    """(...) the force's part across the axis. What is along the axis says nothing of the angle."""
    disagreement_m_s2: Array
    """(...) by how much the two nodes differ on what does not depend on the angle."""


def angle_of_forces(hinge: Hinge, force1_m_s2: Array, force2_m_s2: Array) -> ForceAngle:
    """The angle at which both nodes feel one and the same force, (..., 3) at the joint's centre, m/s²."""
    frame1, frame2 = _frames(hinge)
    return _compared(np.stack([_into(frame1, force1_m_s2), _into(frame2, force2_m_s2)]))


def _frames(hinge: Hinge) -> Array:
    """(2, ..., 3, 3): for both nodes, rows along the axis, along the zero direction across it, and third."""
    axis, zero = np.stack([hinge.axis1, hinge.axis2]), np.stack([hinge.zero1, hinge.zero2])
    third = cross(axis, zero)
    third = third / np.linalg.norm(third, axis=-1, keepdims=True)
    return np.stack([axis, cross(third, axis), third], axis=-2)


def _into(frame: Array, vector: Array) -> Array:
    """A vector (..., 3) in the axes of a frame (..., 3, 3)."""
    out: Array = (frame @ vector[..., None])[..., 0]
    return out


def _compared(forces_m_s2: Array) -> ForceAngle:
    """The angle from both nodes' forces in their frames' axes, (2, ..., 3)."""
    along, x, y = np.moveaxis(forces_m_s2, -1, 0)
    across = np.hypot(x, y)
    return ForceAngle(
        # the difference of the two polar angles, in one atan2
        angle_rad=np.arctan2(y[0] * x[1] - x[0] * y[1], x[0] * x[1] + y[0] * y[1]),
        across_m_s2=np.minimum(across[0], across[1]),
        disagreement_m_s2=np.hypot(along[0] - along[1], across[0] - across[1]),
    )


def _turned(forces_m_s2: Array, phase_rad: Array) -> Array:
    """Forces in their frames' axes (..., 3), turned about the first axis by phases (...)."""
    c, s = np.cos(phase_rad), np.sin(phase_rad)
    along, x, y = np.moveaxis(forces_m_s2, -1, 0)
    return np.stack([along, c * x - s * y, s * x + c * y], axis=-1)


class HingeAngle:
    """The fused angle of K hinges, sample by sample, evenly spaced."""

    def __init__(self, config: HingeAngleConfig, hinge: Hinge, rate_hz: float) -> None:
        self._rate_hz = rate_hz
        self._frames = _frames(hinge)
        self._lever_m = np.stack([hinge.lever1_m, hinge.lever2_m])
        self._share = -np.expm1(-1.0 / (config.smooth_s * rate_hz))
        self._fusion = _Fusion(config, 1.0 / rate_hz)
        self._gyr: list[Array] = []
        """The newest rates of both nodes, (2, K, 3) each, oldest first, three at most."""
        self._acc = np.empty(0)
        self._phase = np.zeros(self._lever_m.shape[:-1])
        """(2, K) how far each node has turned about the axis."""
        self._smooth = np.empty(0)
        """(2, K, 3) low-passed forces in the frames' axes, turned back by these phases."""

    @property
    def drift_rad_s(self) -> Array:
        """(K,) by how much the rate is found to read too high."""
        return self._fusion.drift

    @property
    def deviation_rad(self) -> Array:
        """(K,) standard deviation of the angle."""
        out: Array = np.sqrt(self._fusion.p_angle)
        return out

    def update(self, gyr1_rad_s: Array, acc1_m_s2: Array, gyr2_rad_s: Array, acc2_m_s2: Array) -> Array:
        """Take one sample, (K, 3) each, rad/s and m/s², sensor frames; returns the angle, (K,) rad.

        The angle goes on past ±π. NaN stands for a missing sample: the rate before it is held, 0 before any.
        """
        gyr, acc = np.stack([gyr1_rad_s, gyr2_rad_s]), np.stack([acc1_m_s2, acc2_m_s2])
        gyr = np.where(np.isnan(gyr), self._gyr[-1] if self._gyr else 0.0, gyr)
        self._gyr = [*self._gyr[-2:], gyr]
        if len(self._gyr) == 1:
            self._smooth = self._forces(gyr, acc, np.zeros_like(gyr))
            self._fusion.start(_compared(self._smooth))
        # the sample before this one is judged only now: a rate's change is taken across its neighbours
        if len(self._gyr) == 3:
            change = 0.5 * self._rate_hz * (gyr - self._gyr[0])
            self._add(self._forces(self._gyr[1], self._acc, change))
            self._fusion.correct(self._seen())
        if len(self._gyr) > 1:
            about_axis = 0.5 * np.sum(self._frames[..., 0, :] * (self._gyr[-2] + gyr), axis=-1)
            self._phase = self._phase + about_axis / self._rate_hz
            self._phase[1] -= self._fusion.drift / self._rate_hz
            self._fusion.predict(about_axis[1] - about_axis[0])
        self._acc = acc
        return self._fusion.angle

    def _forces(self, gyr: Array, acc: Array, change: Array) -> Array:
        return _into(self._frames, force_at_joint(acc, gyr, change, self._lever_m))

    def _add(self, forces: Array) -> None:
        turned = _turned(forces, self._phase)
        # both or none, or else they would no longer be the same signal
        known, begun = (np.isfinite(each).all(axis=(0, -1), keepdims=True) for each in (turned, self._smooth))
        smooth = np.where(begun, self._smooth + self._share * (turned - self._smooth), turned)
        self._smooth = np.where(known, smooth, self._smooth)

    def _seen(self) -> ForceAngle:
        """The angle by the forces, brought from the turned-back frames to the present ones."""
        seen = _compared(self._smooth)
        return replace(seen, angle_rad=seen.angle_rad + self._phase[1] - self._phase[0])


@dataclass(frozen=True, slots=True)
class HingeTrack:
    """What `HingeAngle` says at each of T samples."""

    angle_rad: Array
    """(T,), past ±π where the joint went there."""
    deviation_rad: Array
    """(T,) one standard deviation."""
    drift_rad_s: Array
    """(T,)."""


def hinge_angles(
    config: HingeAngleConfig,
    hinge: Hinge,
    rate_hz: float,
    gyr1_rad_s: Array,
    acc1_m_s2: Array,
    gyr2_rad_s: Array,
    acc2_m_s2: Array,
) -> HingeTrack:
    """A whole recording, (T, 3) each, of one hinge, its vectors (3,): the online angle at each sample."""
    hinges = Hinge(*(getattr(hinge, name)[None] for name in Hinge.__slots__))
    online = HingeAngle(config, hinges, rate_hz)
    out = np.empty((3, len(gyr1_rad_s)))
    samples = zip(*(r[:, None] for r in (gyr1_rad_s, acc1_m_s2, gyr2_rad_s, acc2_m_s2)), strict=True)
    for t, sample in enumerate(samples):
        out[:, t] = online.update(*sample)[0], online.deviation_rad[0], online.drift_rad_s[0]
    return HingeTrack(*out)


class _Fusion:
    """Kalman filter of K angles and of their rates' drifts, its 2 × 2 algebra written out."""

    def __init__(self, config: HingeAngleConfig, period_s: float) -> None:
        self._config, self._period_s = config, period_s

    def start(self, seen: ForceAngle) -> None:
        """Begin at what the accelerometers say."""
        known = np.isfinite(seen.angle_rad)
        self.angle = np.where(known, seen.angle_rad, 0.0)
        self.drift = np.zeros_like(self.angle)
        self.p_angle = np.where(known, self._config.first_angle_rad, np.pi) ** 2
        self.p_both = np.zeros_like(self.angle)
        self.p_drift = np.full_like(self.angle, self._config.first_drift_rad_s**2)

    def correct(self, seen: ForceAngle) -> None:
        """Take in what the accelerometers say of the present angle."""
        config = self._config
        noise = config.acceleration_noise**2 + config.disagreement_s * seen.disagreement_m_s2**2
        # information, not variance: that of no force across the axis is 0 and needs no exception
        weight = np.nan_to_num(seen.across_m_s2**2 * self._period_s / noise)
        gain = weight / (1.0 + weight * self.p_angle)
        error = np.nan_to_num(_wrapped(seen.angle_rad - self.angle))
        self.angle = self.angle + gain * self.p_angle * error
        self.drift = self.drift + gain * self.p_both * error
        self.p_drift = self.p_drift - gain * self.p_both**2
        self.p_both = self.p_both * (1.0 - gain * self.p_angle)
        self.p_angle = self.p_angle * (1.0 - gain * self.p_angle)

    def predict(self, rate_rad_s: Array) -> None:
        """Go on by one period at that rate."""
        dt, config = self._period_s, self._config
        self.angle = self.angle + dt * (rate_rad_s - self.drift)
        grown = dt * (dt * self.p_drift - 2.0 * self.p_both + config.rate_noise**2)
        self.p_angle = self.p_angle + grown
        self.p_both = self.p_both - dt * self.p_drift
        self.p_drift = self.p_drift + dt * config.drift_noise**2


def _wrapped(angle_rad: Array) -> Array:
    out: Array = np.remainder(angle_rad + np.pi, 2.0 * np.pi) - np.pi
    return out
