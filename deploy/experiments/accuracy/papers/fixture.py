"""What the experiments share: motions of a fixture, and what simulated units on it read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from common.quaternion import Array, conjugate, multiply, rotate, to_rotation_vector
from common.skeleton import Joint, Segment, Skeleton
from common.skeleton.kinematics import orientations, origins
from common.wire.messages import Mask
from deploy.sim.suit.imperfections import Imperfections, quantise
from deploy.sim.suit.motion import OperatorMotion
from deploy.sim.suit.sensors import CHANNELS, GRAVITY_M_S2, earth_field_ut
from master.suit.protocol import SHIPPED_DBC, SuitProtocol

FIELD_UT = earth_field_ut(50.0, 60.0)
DIFFERENCE_S = 5e-4
"""Step of the central differences."""


@dataclass(frozen=True, slots=True)
class SensorTake:
    """What N units read during one motion, beside what was so. One tick is one reading."""

    rate_hz: float
    samples: Array
    """(T, 3, N, 3) raw accelerometer m/s², gyro rad/s, magnetometer µT, each in its sensor's frame."""
    position_rad: Array
    """(T, J) true joint angles."""
    q_world_from_segment: Array
    """(T, S, 4) true orientations."""

    @property
    def t_s(self) -> Array:
        """(T,)."""
        return np.arange(len(self.samples)) / self.rate_hz


@dataclass(frozen=True, slots=True)
class Tick:
    """One tick of a take, as the estimator reads it."""

    acc_m_s2: Array
    gyr_rad_s: Array
    mag_ut: Array
    fresh: Mask
    lost: Mask


@dataclass(frozen=True, slots=True)
class Wave:
    """A part of a joint's movement: amplitude_rad · sin(2π f t + phase)."""

    amplitude_rad: float
    frequency_hz: float
    phase_rad: float = 0.0


class Waves:
    """Sums of sines a joint, blended in from standing still between `still_s` and `still_s + ramp_s`."""

    def __init__(
        self,
        joint_names: Sequence[str],
        waves: Mapping[str, Sequence[Wave]],
        still_s: float = 0.0,
        ramp_s: float = 2.0,
    ) -> None:
        self.period_s = float("inf")
        self._still_s, self._ramp_s = still_s, ramp_s
        most = max(len(w) for w in waves.values())
        table = np.zeros((3, len(joint_names), most))
        for joint, parts in waves.items():
            for k, wave in enumerate(parts):
                table[:, joint_names.index(joint), k] = (
                    wave.amplitude_rad,
                    2.0 * np.pi * wave.frequency_hz,
                    wave.phase_rad,
                )
        self._amplitude, self._pulse, self._phase = table

    def state(self, t_s: ArrayLike) -> tuple[Array, Array, Array]:
        """Position rad, velocity rad/s and acceleration rad/s², (..., J), at times (...)."""
        t = np.asarray(t_s, dtype=np.float64)[..., None]
        angle = self._pulse * t[..., None] + self._phase
        sine, cosine = self._amplitude * np.sin(angle), self._amplitude * np.cos(angle)
        g = np.sum(sine, axis=-1)
        g1 = np.sum(self._pulse * cosine, axis=-1)
        g2 = np.sum(-(self._pulse**2) * sine, axis=-1)
        u = np.clip((t - self._still_s) / self._ramp_s, 0.0, 1.0)
        rest = 1.0 - u
        w = u**3 * (10.0 + u * (6.0 * u - 15.0))
        w1 = 30.0 * (u * rest) ** 2 / self._ramp_s
        w2 = 60.0 * u * rest * (rest - u) / self._ramp_s**2
        return w * g, w1 * g + w * g1, w2 * g + 2.0 * w1 * g1 + w * g2


def free_joint(name: str) -> Joint:
    """A joint without limits."""
    return Joint(name, -np.inf, np.inf, np.inf, np.inf, {name: 1.0})


def turntable(lever_m: float = 0.0) -> Skeleton:
    """One body that turns every way, by the joints `yaw`, `pitch` and `roll`; the units sit on it.

    `lever_m`: how far ahead of the place it turns about.
    """
    body = Segment(
        "body",
        "world",
        ((0, 0, 1), (0, 1, 0), (1, 0, 0)),
        ("yaw", "pitch", "roll"),
        (0.0, 0.0, 1.0),
        (lever_m, 0.0, 0.0),
    )
    return Skeleton("turntable", (body,), tuple(free_joint(j) for j in ("yaw", "pitch", "roll")))


def record(
    skeleton: Skeleton,
    motion: OperatorMotion,
    seconds: float,
    rate_hz: float,
    units: Imperfections,
    on_segment: Sequence[int],
    q_segment_from_sensor: Array | None = None,
) -> SensorTake:
    """What the units read while the motion is made; `on_segment` (N,) says where each of them sits.

    `q_segment_from_sensor` (S, 4): how they sit; None: aligned.
    """
    t_s = np.arange(round(seconds * rate_hz)) / rate_hz
    ideal = ideal_readings(skeleton, motion, t_s, q_segment_from_sensor)
    samples = read_by(units, ideal[:, list(on_segment)])
    position_rad = motion.state(t_s)[0]
    return SensorTake(rate_hz, samples, position_rad, orientations(skeleton, position_rad))


def read_by(units: Imperfections, ideal: Array) -> Array:
    """What units read, (T, 3, N, 3), and send in whole counts, for what they should read, (T, N, 9)."""
    scale = _count_values()
    counts, _ = quantise(units.apply(ideal), scale)
    return (counts * scale).reshape(*ideal.shape[:-1], 3, 3).swapaxes(1, 2)


def ideal_readings(
    skeleton: Skeleton, motion: OperatorMotion, t_s: Array, q_segment_from_sensor: Array | None = None
) -> Array:
    """(T, S, 9): as `IdealSensors` reads them, all times at once.

    By central differences of the kinematics: at walking within 0.0005 m/s² and 0.0001 rad/s, a tenth of a
    count.
    """
    steps = (-DIFFERENCE_S, 0.0, DIFFERENCE_S)
    before, q, after = (orientations(skeleton, motion.state(t_s + step)[0]) for step in steps)
    node_m = np.array([segment.node_m for segment in skeleton.segments])
    place_before, place, place_after = (
        origins(skeleton, each) + rotate(each, node_m) for each in (before, q, after)
    )
    force = (place_before - 2.0 * place + place_after) / DIFFERENCE_S**2 + [0.0, 0.0, GRAVITY_M_S2]
    rate = to_rotation_vector(multiply(conjugate(before), after)) / (2.0 * DIFFERENCE_S)
    to_segment = conjugate(q)
    field = rotate(to_segment, np.broadcast_to(FIELD_UT, force.shape))
    in_segment = np.stack([rotate(to_segment, force), rate, field], axis=-2)
    if q_segment_from_sensor is not None:
        in_segment = rotate(conjugate(q_segment_from_sensor)[:, None], in_segment)
    out: Array = in_segment.reshape(*in_segment.shape[:-2], CHANNELS)
    return out


def ticks(take: SensorTake) -> list[Tick]:
    """The take's readings one tick at a time; every unit answers."""
    count = take.samples.shape[2]
    fresh, lost = np.ones(count, dtype=np.bool_), np.zeros(count, dtype=np.bool_)
    return [Tick(acc, gyr, mag, fresh, lost) for acc, gyr, mag in take.samples]


@cache
def _count_values() -> Array:
    """The value of one count of each channel, (9,), as on the wire."""
    scale: Array = SuitProtocol.load(SHIPPED_DBC).fd.scale
    return scale
