"""From raw readings to the segments' orientations: calibrate ▸ low-pass ▸ filter ▸ posture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np

from common.errors import ConfigError
from common.quaternion import Array, conjugate, from_rotation_vector, heading_rad, multiply, rotate
from common.skeleton import Skeleton
from common.wire.messages import Mask
from master.orientation.affine import ACC, GYR, MAG, Calibration, apply, load_calibration
from master.orientation.config import EstimationConfig
from master.orientation.filters import FilterBank
from master.orientation.fused import FUSED
from master.orientation.heading import HeadingMemory
from master.orientation.heading_watch import constrained, watch_of
from master.orientation.joints.online import EVERY, OnlineHeadings
from master.orientation.liveness import Changes, Liveness
from master.orientation.lowpass import LowPass
from master.orientation.zero_pose import ZeroPose, ZeroPoseLimits
from master.orientation.zero_pose_again import ZeroPoseAgain
from master.suit.doubt import NodeDoubt, Weight

_GRAVITY_M_S2 = 9.81


class Node(Protocol):
    """The part of a node's configuration that the estimator reads."""

    @property
    def filter(self) -> str | None:
        """Its own filter's name, or None."""

    @property
    def calibration(self) -> Path | None:
        """Its calibration file, or None."""


class Readings(Protocol):
    """One tick of all N nodes, raw but in SI units, sensor frame; what is not fresh is the last known."""

    @property
    def acc_m_s2(self) -> Array:
        """(N, 3)."""

    @property
    def gyr_rad_s(self) -> Array:
        """(N, 3)."""

    @property
    def mag_ut(self) -> Array:
        """(N, 3), a row of NaN where there is no magnetometer."""

    @property
    def fresh(self) -> Mask:
        """(N,)."""

    @property
    def lost(self) -> Mask:
        """(N,)."""


class _Headings(Protocol):
    """What turns the filters' orientations about the vertical; see `OnlineHeadings`."""

    turn: Array

    def lose(self, nodes: Mask, q: Array, /) -> None: ...

    def find(self, nodes: Mask, q: Array, magnetic_rad: Array, /) -> None: ...

    def stand(self, nodes: Mask, correction_rad: Array, q: Array, mag_ut: Array, /) -> None: ...

    def due(self) -> bool: ...

    def correct(self, q: Array, mag_ut: Array, alignment: Array, usable: Mask, /) -> None: ...


@dataclass(frozen=True, slots=True)
class Posture:
    """The operator at the newest tick."""

    q_world_from_segment: Array
    """(N, 4)."""
    rate_rad_s: Array
    """(N, 3), each segment's in its own frame."""
    valid: Mask
    """(N,) False while a node is lost or its filter settles."""


class Estimator:
    """State of all nodes between ticks."""

    def __init__(
        self,
        config: EstimationConfig,
        nodes: Sequence[Node],
        rate_hz: float,
        calibration: Calibration | None = None,
        skeleton: Skeleton | None = None,
        fused: Mask | None = None,
    ) -> None:
        """Without a `calibration` the files that the nodes name are read. Raises ConfigError.

        Without a `skeleton` of the nodes there are no constraints. `fused` (N,): they give orientations.
        """
        mistakes = config.mistakes_at(rate_hz)
        if mistakes:
            raise ConfigError("configuration", mistakes)
        count = len(nodes)
        if calibration is None:
            calibration = load_calibration([node.calibration for node in nodes])
        self.affine: Array = calibration.affine
        """(3, N, 3, 4), what is applied to accelerometers, gyros and magnetometers."""
        self._samples = np.empty((3, count, 3))
        self._lowpass = LowPass(config.cutoffs_hz, config.order, rate_hz, count)
        names = [node.filter or config.filter for node in nodes]
        if fused is not None:
            names = [FUSED if given else name for name, given in zip(names, fused, strict=True)]
        self._bank = FilterBank(names, config.filter_sections, rate_hz)
        self._liveness = Liveness(count, math.ceil(config.settle_s * rate_hz))
        self._heading: _Headings = HeadingMemory(count)
        self._q_of_filters = self._bank.q_world_from_sensor
        if skeleton is not None and constrained(config, skeleton, calibration.aligned):
            aligned = calibration.aligned if config.constraints == "auto" else None
            self._heading = OnlineHeadings(config.online, skeleton, rate_hz, aligned)
            self._q_of_filters = self._bank.q_inertial_from_sensor
        self.heading_watch = watch_of(config, skeleton, rate_hz, self._heading)
        self._aligned = calibration.aligned
        self._pose_of = partial(
            ZeroPose,
            ticks=math.ceil(config.zero_pose_s * rate_hz),
            facing_rad=math.radians(config.zero_pose_heading_deg),
            aligned=calibration.aligned,
            limits=ZeroPoseLimits(
                math.radians(config.zero_pose_turn_deg_s), math.radians(config.zero_pose_lean_deg)
            ),
        )
        self._zero_pose = self._pose_of(calibration.q_sensor_from_segment)
        self.standing_again: ZeroPoseAgain | None = None
        """The zero pose that is being taken again; see `stand_again`."""
        self._gyr_rad_s = np.zeros((count, 3))
        self._gyr_before_rad_s = np.zeros((count, 3))
        self._rate_hz = rate_hz
        self._late_ticks = self._lowpass.delays_s[GYR] * rate_hz
        # the filters hold each reading for the period before it, which leads by half of it on average
        self._advance_s: Array = np.full((count, 1), self._lowpass.delays_s[GYR] - 0.5 / rate_hz)
        if fused is not None:
            self._advance_s[fused] = 0.0  # an orientation that is given is not low-passed

    def update(
        self, readings: Readings, dt_s: float | None = None, q_world_from_sensor: Array | None = None
    ) -> None:
        """Take one tick, `dt_s` after the one before, None: the nominal period; (N, 4) of `fused` nodes."""
        if q_world_from_sensor is not None:
            self._bank.give(q_world_from_sensor)
        samples = self._samples
        samples[ACC], samples[GYR], samples[MAG] = readings.acc_m_s2, readings.gyr_rad_s, readings.mag_ut
        was_valid = self._liveness.settled
        changes = self._liveness.update(readings.fresh, readings.lost)
        if changes is not self._liveness.unchanged:
            self._follow(changes, was_valid)
        np.copyto(self._gyr_before_rad_s, self._gyr_rad_s)  # the low-pass writes into the same memory again
        # absurd readings may overflow here; the filters leave them out
        with np.errstate(over="ignore", invalid="ignore"):
            filtered = self._lowpass.update(apply(self.affine, samples))
        self._gyr_rad_s = filtered[GYR]
        self._bank.update(filtered[GYR], filtered[ACC], filtered[MAG], dt_s)
        spoilt = self._bank.spoilt
        if spoilt is not None:
            # a low-pass would pass it on for a long time
            self._lowpass.restart(spoilt)
            self._gyr_rad_s = np.where(spoilt[:, None], self._bank.bias_rad_s(), self._gyr_rad_s)
            self._gyr_before_rad_s[spoilt] = self._gyr_rad_s[spoilt]
        if changes is not self._liveness.unchanged and changes.settled.any():
            self._find(changes.settled, np.isfinite(filtered[MAG, :, 0]))
        if not self._zero_pose.known.all():
            self._stand(filtered[MAG])
        if self.standing_again is not None and not self.standing_again.taken.any():
            self._stand_again(self.standing_again, filtered[MAG])
        if self._heading.due():
            self._correct(self._heading, self._q_of_filters(), filtered[MAG])
        elif self._beside is not None and self._beside.due():
            self._correct(self._beside, self._bank.q_inertial_from_sensor(), filtered[MAG])

    def _follow(self, changes: Changes, was_valid: Mask) -> None:
        """Nodes came, went or settle: what is not there idles, and what came starts anew."""
        if changes.went.any():
            self._heading.lose(changes.went & was_valid, self._q_of_filters())
            if self._beside is not None:
                self._beside.lose(changes.went & was_valid, self._bank.q_inertial_from_sensor())
        if not self._liveness.alive.all():
            self._idle(~self._liveness.alive)
        if changes.came.any():
            self._lowpass.restart(changes.came)
            self._bank.restart(changes.came)

    @property
    def _beside(self) -> OnlineHeadings | None:
        return None if self.heading_watch is None else self.heading_watch.beside

    def _correct(self, headings: _Headings, q: Array, mag_ut: Array) -> None:
        usable = self._liveness.settled & self._zero_pose.known
        headings.correct(q, mag_ut, self._zero_pose.q_sensor_from_segment, usable)
        if self.heading_watch is not None:
            used = multiply(self._heading.turn, self._q_of_filters())
            self.heading_watch.look(used, self._bank.q_inertial_from_sensor(), usable, EVERY / self._rate_hz)

    def _take_pose(self, nodes: Mask, correction_rad: Array, mag_ut: Array) -> None:
        """Turn the headings of some nodes, mask (N,), by what a zero pose found (N,)."""
        used = multiply(self._heading.turn, self._q_of_filters())
        if self.heading_watch is not None:
            inertial = self._bank.q_inertial_from_sensor()
            # a heading that the pose does not turn stays where the magnetometer has it
            self.heading_watch.stand(nodes, used, correction_rad, inertial, mag_ut)
        self._heading.stand(nodes, correction_rad, self._q_of_filters(), mag_ut)

    def _find(self, settled: Mask, magnetic: Mask) -> None:
        """Give nodes that have settled their heading."""
        q = self._q_of_filters()
        between = multiply(self._bank.q_world_from_sensor(), conjugate(q))
        self._heading.find(settled, q, np.where(magnetic, heading_rad(between), np.nan))
        if self._beside is not None:
            q = self._bank.q_inertial_from_sensor()
            between = multiply(self._bank.q_world_from_sensor(), conjugate(q))
            self._beside.find(settled, q, np.where(magnetic, heading_rad(between), np.nan))

    def _stand(self, mag_ut: Array) -> None:
        """One tick of the zero pose."""
        rate = self._rate_of_sensors()
        # a finger's unit with a bias of 20°/s would refuse the whole suit's pose for ever
        believed = self._liveness.settled & ~self._bank.undecided()
        done = self._zero_pose.add(self._oriented(rate), believed, rate)
        # apart: the heading of an alignment found now is the magnetometer's own
        for nodes in (done & self._aligned, done & ~self._aligned):
            if nodes.any():
                self._take_pose(nodes, self._zero_pose.correction_rad, mag_ut)

    @property
    def has_zero_pose(self) -> bool:
        """Whether every node that is heard has its zero pose."""
        settled = self._liveness.settled
        return bool(settled.any()) and not (settled & ~self._zero_pose.known).any()

    def stand_again(self) -> ZeroPoseAgain:
        """Take the zero pose again from now on, until `drop_again`. The old one stays until then."""
        pose = self._pose_of(self._zero_pose.q_sensor_from_segment, posed_before=True)
        self.standing_again = ZeroPoseAgain(pose)
        return self.standing_again

    def drop_again(self) -> None:
        """Take no zero pose any more; what there is stands."""
        self.standing_again = None

    def _stand_again(self, again: ZeroPoseAgain, mag_ut: Array) -> None:
        rate = self._rate_of_sensors()
        # a node without its first pose, or whose gyro is not to be believed yet, takes no part
        asked = self._liveness.settled & self._zero_pose.known & ~self._bank.undecided()
        if not again.add(self._oriented(rate), asked, rate):
            return
        taken = again.taken[:, None]
        before, after = self._zero_pose.q_sensor_from_segment, again.q_sensor_from_segment
        self._zero_pose.q_sensor_from_segment = np.where(taken, after, before)
        # a new alignment holds its node's heading; that of the others is turned
        correction = np.where(self._aligned, again.moved_rad, 0.0)
        for nodes in (again.taken & self._aligned, again.taken & ~self._aligned):
            if nodes.any():
                self._take_pose(nodes, correction, mag_ut)

    def doubts(self) -> dict[int, NodeDoubt]:
        """Doubts about nodes, by their number."""
        joints = self._heading.doubts() if isinstance(self._heading, OnlineHeadings) else {}
        filters = self._bank.doubts()
        drifted = {} if self.heading_watch is None else self.heading_watch.doubts()
        asked = self._liveness.settled.copy()
        # a node whose joints are invalid gains nothing from a pose: the others need not wait for it
        asked[[node for node, doubt in filters.items() if doubt.weight >= Weight.INVALID]] = False
        return {**drifted, **joints, **filters, **self._zero_pose.doubts(asked)}

    def posture(self) -> Posture:
        """The segments at the instant the newest tick sampled.

        The low-pass's delay is made good: in the orientations by the rate, in the rate by its slope.
        """
        rate = self._rate_of_sensors()
        now_rad_s = rate + self._late_ticks * (self._gyr_rad_s - self._gyr_before_rad_s)
        alignment = self._zero_pose.q_sensor_from_segment
        return Posture(
            q_world_from_segment=multiply(self._oriented(rate), alignment),
            rate_rad_s=rotate(conjugate(alignment), now_rad_s),
            valid=self._liveness.settled & self._zero_pose.known,
        )

    def _idle(self, nodes: Mask) -> None:
        """Silent nodes are taken to rest, so that no filter integrates an old rate."""
        self._samples[ACC, nodes] = (0.0, 0.0, _GRAVITY_M_S2)
        self._samples[GYR, nodes] = 0.0
        self._samples[MAG, nodes] = np.nan

    def _rate_of_sensors(self) -> Array:
        return self._gyr_rad_s - self._bank.bias_rad_s()

    def _oriented(self, rate_rad_s: Array) -> Array:
        """The filters' orientations brought forward over the delay of the gyro's low-pass, (N, 4)."""
        q = multiply(self._heading.turn, self._q_of_filters())
        return multiply(q, from_rotation_vector(self._advance_s * rate_rad_s))
