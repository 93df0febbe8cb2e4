"""The way that is foretold for a line that dies, and the limit on it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from common.clock import to_ns
from common.quaternion import Array
from common.skeleton import load_skeleton
from slave.guard.config import GuardConfig
from slave.guard.zones import BoxZone, CapsuleZone, HalfSpaceZone, SphereZone, Zone, distance_model
from slave.limit import blind
from slave.limit.blind import BlindDistance, Course
from slave.limit.limit import SetpointLimiter

SKELETON = load_skeleton("nursing")
LIMITS = GuardConfig().limits(SKELETON)
STEP_S = 0.005
TIMEOUT_S = 0.2
DECIDES_S = TIMEOUT_S + STEP_S
FREE = np.zeros(len(SKELETON.joints), np.bool_)
MIDDLE = 0.5 * (LIMITS.lower_rad + LIMITS.upper_rad)
ELBOW = SKELETON.joint_names.index("left_elbow_pitch")


class Robot:
    """A setpoint that follows swings of several joints at once; perfect servos."""

    def __init__(
        self, seed: int, most_cm: float | None = None, share: float = 0.5, zones: Sequence[Zone] = ()
    ) -> None:
        self.blind = BlindDistance(SKELETON, LIMITS, most_cm, zones=zones)
        self.limiter = SetpointLimiter(SKELETON.joint_names, LIMITS)
        self.limiter.slowed = self.blind.slowed
        self.limiter.seat(MIDDLE)
        draw = np.random.default_rng(seed)
        reach = 0.5 * (LIMITS.upper_rad - LIMITS.lower_rad)
        self._swing = reach * draw.uniform(-1.0, 1.0, len(MIDDLE)) * (draw.random(len(MIDDLE)) < share)
        self._per_s = draw.uniform(1.0, 9.0, len(MIDDLE))
        self.now_s = 0.0

    def target(self, at_ns: int) -> tuple[Array, Array]:
        angle = self._per_s * at_ns * 1e-9
        return MIDDLE + self._swing * np.sin(angle), self._swing * self._per_s * np.cos(angle)

    def step(self) -> None:
        self.now_s += STEP_S
        self.blind.allow(TIMEOUT_S)
        position, velocity = self.target(to_ns(self.now_s))
        self.limiter.step(
            0, STEP_S, position, velocity, FREE, LIMITS.max_velocity_rad_s, LIMITS.max_acceleration_rad_s2
        )

    def ends_m(self) -> Array:
        return self.blind.ends.at(self.limiter.position_rad)

    def foretold_m(self) -> Array:
        limiter = self.limiter
        course = Course(
            limiter.position_rad, limiter.velocity_rad_s, FREE,
            LIMITS.max_velocity_rad_s, LIMITS.max_acceleration_rad_s2,
        )  # fmt: skip
        self.blind.foretell(to_ns(self.now_s), DECIDES_S, limiter.position_rad, course, self.target)
        assert self.blind.newest is not None
        return self.blind.newest.way_m

    def gone_m(self) -> Array:
        """What the ends then really do: on to the decision, and brake."""
        begin, most = self.ends_m(), np.zeros(len(self.blind.ends.names))
        for k in range(round((DECIDES_S + 0.3) / STEP_S)):
            if k < round(DECIDES_S / STEP_S):
                self.step()
            else:
                self.limiter.stop(STEP_S)
            most = np.maximum(most, np.linalg.norm(self.ends_m() - begin, axis=1))
        assert self.limiter.at_rest
        return most


def outage(seed: int, most_cm: float | None = None) -> tuple[Array, Array]:
    """Foretold and gone, of each end."""
    robot = Robot(seed, most_cm)
    for _ in range(60 + 7 * (seed % 40)):
        robot.step()
    return robot.foretold_m(), robot.gone_m()


def test_what_is_foretold_is_never_less_and_little_more_than_what_happens() -> None:
    found = [outage(seed) for seed in range(40)]
    shares = np.concatenate([gone / foretold for foretold, gone in found])
    far = np.concatenate([foretold for foretold, _ in found]) > 0.03
    assert shares.max() <= 1.0
    assert far.sum() > 40
    assert np.percentile(shares[far], 5) >= 0.7


@pytest.mark.parametrize("most_m", [0.05, 0.1])
def test_no_hand_goes_farther_than_the_site_allows(most_m: float) -> None:
    found = [outage(seed, 100.0 * most_m) for seed in range(40)]
    assert max(gone.max() for _, gone in found) <= most_m
    assert max(foretold.max() for foretold, _ in found) <= 1.1 * most_m
    assert max(gone.max() for _, gone in found) > 0.5 * most_m, "slowed more than needed"


def test_without_the_limit_they_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(BlindDistance, "slowed", lambda self, position_rad, wish_rad_s, step_s: wish_rad_s)
    with pytest.raises(AssertionError):
        test_no_hand_goes_farther_than_the_site_allows(0.1)


def test_with_the_braking_left_out_it_foretells_too_little(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blind, "BRAKING_POSES", 0)
    with pytest.raises(AssertionError):
        test_what_is_foretold_is_never_less_and_little_more_than_what_happens()


def test_a_motion_below_the_limit_is_left_alone() -> None:
    slow = BlindDistance(SKELETON, LIMITS, 10.0)
    slow.allow(TIMEOUT_S)
    wish = np.zeros(len(MIDDLE))
    wish[ELBOW] = 0.2
    assert (slow.slowed(MIDDLE, wish, STEP_S) == wish).all()


def test_the_joints_of_one_arm_are_slowed_alike_and_the_other_arm_is_not() -> None:
    slow = BlindDistance(SKELETON, LIMITS, 5.0)
    slow.allow(TIMEOUT_S)
    wish = np.zeros(len(MIDDLE))
    left = [SKELETON.joint_names.index(f"left_{name}") for name in ("shoulder_pitch", "elbow_pitch")]
    right = SKELETON.joint_names.index("right_elbow_pitch")
    wish[left], wish[right] = 3.0, 0.1
    after = slow.slowed(MIDDLE, wish, STEP_S)
    assert after[left[0]] == after[left[1]] < 3.0
    assert after[right] == 0.1


def test_a_longer_time_until_the_guard_decides_allows_less_speed() -> None:
    slow = BlindDistance(SKELETON, LIMITS, 5.0)
    wish = np.zeros(len(MIDDLE))
    wish[ELBOW] = 4.0
    after = []
    for timeout_s in (0.2, 0.4):
        slow.allow(timeout_s)
        after.append(np.abs(slow.slowed(MIDDLE, wish, STEP_S)).max())
    assert after[1] < after[0]


HANDS_M = BlindDistance(SKELETON, LIMITS).ends.at(MIDDLE)
LEFT_M = HANDS_M[0].tolist()


def at_left_hand(**limits: object) -> SphereZone:
    """A place around the left hand's, which swings through it."""
    return SphereZone.model_validate(
        {"name": "head", "shape": "sphere", "center_m": LEFT_M, "radius_m": 0.08, **limits}
    )


def gone_inside_m(zone: Zone, margin_m: float) -> list[float]:
    """How far the left hand goes within a margin of the zone in each of 40 outages, on its whole way."""
    out = []
    for seed in range(40):
        robot = Robot(seed, zones=[zone])
        for _ in range(60 + 7 * (seed % 40)):
            robot.step()
        ends = [robot.ends_m()[0]]
        for k in range(round((DECIDES_S + 0.3) / STEP_S)):
            if k < round(DECIDES_S / STEP_S):
                robot.step()
            else:
                robot.limiter.stop(STEP_S)
            ends.append(robot.ends_m()[0])
        way = np.array(ends)
        inside = zone.distance_m(0.5 * (way[1:] + way[:-1])) <= margin_m
        out.append(float(np.linalg.norm(np.diff(way, axis=0), axis=1)[inside].sum()))
    return out


@pytest.mark.parametrize(
    ("limits", "margin_m"), [({"enter": True}, 0.0), ({"margin_cm": 4.0}, 0.04)], ids=["may enter", "margin"]
)
def test_within_a_zone_no_hand_goes_farther_than_the_zone_allows(
    limits: dict[str, object], margin_m: float
) -> None:
    gone_m = gone_inside_m(at_left_hand(max_blind_cm=4.0, **limits), margin_m)
    assert max(gone_m) <= 0.04
    assert max(gone_m) > 0.02, "slowed more than needed"


def test_without_the_zone_s_own_limit_it_does() -> None:
    assert max(gone_inside_m(at_left_hand(enter=True, max_speed_m_s=5.0), 0.0)) > 0.08


def test_outside_of_a_zone_hands_are_not_slowed_by_it() -> None:
    far = [HANDS_M[0][0], HANDS_M[0][1], HANDS_M[0][2] + 5.0]
    slow = BlindDistance(SKELETON, LIMITS, zones=[at_left_hand(enter=True, max_blind_cm=1.0, center_m=far)])
    slow.allow(TIMEOUT_S)
    wish = 0.5 * LIMITS.max_velocity_rad_s
    assert (slow.slowed(MIDDLE, wish, STEP_S) == wish).all()
    here = BlindDistance(SKELETON, LIMITS, zones=[at_left_hand(enter=True, max_blind_cm=1.0)])
    here.allow(TIMEOUT_S)
    after = here.slowed(MIDDLE, wish, STEP_S)
    right = here.ends.moved_by[1] & ~here.ends.moved_by[0]
    assert (after[right] == wish[right]).all()
    assert (after[ELBOW] < wish[ELBOW]).all()


@pytest.mark.parametrize(
    "zone",
    [
        BoxZone(name="z", shape="box", center_m=[0.5, 0.1, 0.9], size_m=[0.6, 1.4, 0.3], yaw_deg=25.0),
        CapsuleZone(name="z", shape="capsule", from_m=[0.4, -0.5, 1.2], to_m=[0.6, 0.4, 1.0], radius_m=0.05),
        SphereZone(name="z", shape="sphere", center_m=[0.4, 0.2, 1.3], radius_m=0.1),
        HalfSpaceZone(name="z", shape="half_space", point_m=[0.6, 0.0, 0.0], free_side=[-2.0, 0.3, 0.1]),
    ],
    ids=lambda zone: zone.shape,
)
def test_distances_of_points_are_those_that_mujoco_finds(zone: Zone) -> None:
    """The middle of the gap to a part is half the gap away from the zone."""
    model = distance_model(SKELETON, 0.0, [zone])
    draw = np.random.default_rng(5)
    compared = 0
    for _ in range(60):
        posture = LIMITS.reachable(draw.normal(0.0, 0.8, len(MIDDLE)))
        near = model.near(posture)
        rows = np.flatnonzero(model.obstacle[near.pair] == 0)
        contact = model._data.contact
        for row in rows[near.distance_m[rows] > 0.01]:
            middle, half = contact.pos[row], 0.5 * near.distance_m[row]
            assert zone.distance_m(middle[None])[0] == pytest.approx(half, abs=1e-4)
            compared += 1
    assert compared > 20


@pytest.mark.parametrize(
    ("profile", "names"),
    [("nursing", {"left_hand", "right_hand"}), ("lower_limb", {"left_foot", "right_foot"})],
)
def test_the_ends_of_a_robot(profile: str, names: set[str]) -> None:
    skeleton = load_skeleton(profile)
    assert set(BlindDistance(skeleton, GuardConfig().limits(skeleton)).ends.names) == names


def test_of_a_hand_that_no_joint_moves_the_fingers_are_the_ends() -> None:
    skeleton = load_skeleton("hand")
    ends = BlindDistance(skeleton, GuardConfig().limits(skeleton)).ends
    assert "right_hand" not in ends.names
    assert len(ends.names) == 5
    assert ends.moved_by.any(axis=1).all()
