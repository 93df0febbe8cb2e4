"""No part of the robot comes too near another or a zone, whatever is asked, and it can always leave."""

import numpy as np
import pytest

from common.quaternion import Array
from slave.guard.events import Rule
from slave.guard.zones import BoxZone, CapsuleZone, HalfSpaceZone, SphereZone, Zone, distance_model
from slave.limit import damper
from slave.limit.braking import Looks, way_to_stop
from tests.slave.limit.apart import (
    CROSSED,
    DT_S,
    LIMITS,
    MARGIN_M,
    NAMES,
    ON_THE_HEAD,
    SKELETON,
    SLACK_M,
    THROUGH_THE_CHEST,
    J,
    Robot,
    posture,
)

ZERO = np.zeros(J)
NO_ROWS = damper._Rows(np.empty((0, J)), np.empty(0))
FORWARD = posture(shoulder_pitch=85)
BED = BoxZone(name="bed", shape="box", center_m=[0.75, 0.0, 0.9], size_m=[0.6, 1.6, 0.3], yaw_deg=10.0)
HEAD = SphereZone(name="the patient's head", shape="sphere", center_m=[0.5, 0.25, 1.4], radius_m=0.12)
WALL = HalfSpaceZone(name="wall", shape="half_space", point_m=[0.45, 0.0, 0.0], free_side=[-1.0, 0.0, 0.0])
RAIL = CapsuleZone(name="rail", shape="capsule", from_m=[0.5, -0.8, 1.3], to_m=[0.5, 0.8, 1.3], radius_m=0.03)
INTO_ITSELF = pytest.mark.parametrize(
    "target", [CROSSED, ON_THE_HEAD, THROUGH_THE_CHEST], ids=["crossed", "on the head", "through the chest"]
)


@INTO_ITSELF
def test_it_keeps_apart_from_itself_and_can_leave(target: Array) -> None:
    robot = Robot()
    robot.go(target, 4.0)
    least_m, _ = robot.least_m()
    assert MARGIN_M - SLACK_M <= least_m < MARGIN_M + 0.01, "it came near, and not too near"
    assert np.abs(robot.limiter.velocity_rad_s).max() < 0.02, "it has come to rest"
    assert Rule.DISTANCE in {clamp.rule for clamp in robot.clamps}
    assert "is held off by the " in robot.damper.words
    assert robot.damper.words.endswith("cm from it: go back the way you came")
    robot.go(ZERO, 1.5)
    assert np.abs(robot.limiter.position_rad).max() < 0.01, "it has left"
    assert robot.damper.words == ""
    assert robot.least_m()[0] >= MARGIN_M - SLACK_M


@INTO_ITSELF
def test_without_the_damper_it_would_meet_itself(target: Array) -> None:
    robot = Robot(damped=False)
    robot.go(target, 1.0)
    assert robot.least_m()[0] < 0.0


@pytest.mark.parametrize("zone", [BED, HEAD, WALL, RAIL], ids=lambda zone: zone.name)
def test_it_keeps_apart_from_a_zone_and_can_leave(zone: Zone) -> None:
    robot, free = Robot([zone]), Robot(damped=False, zones=[zone])
    for each in (robot, free):
        each.go(FORWARD, 1.5)
    assert free.least_m()[1] < 0.0, "without the damper it is inside"
    _, (least_m,) = robot.least_m()
    assert 0.03 - SLACK_M <= least_m < 0.05
    assert f"is held off by the {zone.name}, 3 cm from it" in robot.damper.words
    robot.go(ZERO, 1.5)
    assert np.abs(robot.limiter.position_rad).max() < 0.01


def test_who_still_slides_is_not_sent_back() -> None:
    robot = Robot([WALL])
    robot.go(FORWARD, 0.3)
    assert "is held off by the wall" in robot.damper.words
    assert np.abs(robot.limiter.velocity_rad_s).max() > 0.1
    assert "go back" not in robot.damper.words


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_wherever_the_robot_got_to_it_can_be_led_back_the_way_it_came(seed: int) -> None:
    """Among four tight zones the straight way home may be barred; its own way never is."""
    robot, draw = Robot([BED, HEAD, WALL, RAIL]), np.random.default_rng(seed)
    way = [robot.limiter.position_rad]
    for place in (FORWARD, CROSSED, ON_THE_HEAD, FORWARD):
        goal = LIMITS.reachable(place + draw.normal(0.0, 0.3, J))
        for _ in range(80):
            robot.go(goal, DT_S)
            way.append(robot.limiter.position_rad)
    waited = 0
    for shown in (*way[::-1], *[ZERO] * 400):
        while np.abs(robot.limiter.position_rad - shown).max() > 0.1 and waited < 800:
            robot.go(shown, DT_S)
            waited += 1
        robot.go(shown, DT_S)
    assert np.abs(robot.limiter.position_rad).max() < 0.01
    own_m, zones_m = robot.least_m()
    assert own_m >= MARGIN_M - SLACK_M
    assert (zones_m >= 0.03 - SLACK_M).all()


def test_a_stop_at_any_moment_has_room() -> None:
    """Braking looks at nothing: the damper has left room for it before."""
    for after in range(4, 60, 4):
        robot = Robot([WALL])
        robot.go(CROSSED if after % 8 else FORWARD, after * DT_S)
        robot.stop()
        own_m, (wall_m,) = robot.least_m()
        assert own_m >= MARGIN_M - SLACK_M
        assert wall_m >= 0.03 - SLACK_M


def test_a_held_joint_is_an_obstacle_that_does_not_move() -> None:
    held = np.array([name.startswith("left") for name in NAMES])
    robot = Robot(start=0.6 * FORWARD)
    before = robot.limiter.position_rad[held]
    robot.go(CROSSED, 1.0, held=held)
    assert (robot.limiter.position_rad[held] == before).all()
    assert robot.least_m()[0] >= MARGIN_M - SLACK_M


def test_late_steps_keep_apart_too() -> None:
    robot, rng = Robot(), np.random.default_rng(4)
    for k in range(6):
        target = CROSSED if k % 2 else ON_THE_HEAD
        for _ in range(30):
            robot.go(target, dt := float(rng.choice([0.002, 0.005, 0.0093, 0.025])), dt_s=dt)
    assert robot.least_m()[0] >= MARGIN_M - SLACK_M


def test_where_nothing_is_near_nothing_changes() -> None:
    robot, free = Robot(), Robot(damped=False)
    rng = np.random.default_rng(1)
    for _ in range(8):
        share = rng.uniform(0.0, 0.5, J)
        target = posture(shoulder_roll=25.0) + share * posture(
            elbow_pitch=90, shoulder_pitch=60, wrist_yaw=40
        )
        for each in (robot, free):
            each.go(target, 0.3)
        np.testing.assert_array_equal(robot.limiter.position_rad, free.limiter.position_rad)


def test_what_stands_inside_a_margin_may_only_leave() -> None:
    """A zone was put there, or the robot was moved by hand: it may stay, and part, and come no nearer."""
    robot = Robot()
    robot.go(ON_THE_HEAD, 1.0)
    begin = robot.limiter.position_rad + 0.04 * (ON_THE_HEAD - robot.limiter.position_rad)
    (begin_m,) = robot.distances.own_m(begin[None])
    assert begin_m < MARGIN_M - 0.003
    robot = Robot(start=begin)
    robot.go(begin, 0.5)
    assert (robot.limiter.position_rad == begin).all(), "it may stay: nothing moves by itself"
    robot.go(ON_THE_HEAD, 0.5)
    robot.go(ZERO, 1.5)
    assert np.abs(robot.limiter.position_rad).max() < 0.01
    assert robot.least_m()[0] >= begin_m - 1e-4


def test_a_zone_limits_the_speed_of_what_is_inside() -> None:
    slow = SphereZone(
        name="bedside", shape="sphere", center_m=[0.45, 0.0, 1.3], radius_m=0.4, enter=True, max_speed_m_s=0.2
    )
    ticks, fast = 0, 0.0
    robot = Robot([slow])
    body = distance_model(SKELETON, 2.0, [slow])
    for _ in range(1000):
        robot.go(FORWARD, DT_S)
        near = body.near(robot.limiter.position_rad)
        rows = np.flatnonzero((body.obstacle[near.pair] == 0) & (near.distance_m <= 0.0))
        if len(rows):
            ticks += 1
            speed = np.linalg.norm(body.velocity(rows, robot.limiter.velocity_rad_s), axis=1)
            fast = max(fast, float(speed.max()))
    assert ticks > 100
    assert 0.15 < fast <= 0.2 * 1.05
    assert np.abs(robot.limiter.position_rad - FORWARD).max() < 0.2, "it goes on, slowly"


def test_what_cannot_be_computed_in_time_brakes_and_then_holds() -> None:
    robot = Robot()
    robot.go(FORWARD, 0.05)
    now = iter(range(0, 10**12, damper.BUDGET_NS + 1))
    robot.damper.clock = lambda: next(now)
    speed = np.abs(robot.limiter.velocity_rad_s)
    robot.go(FORWARD, DT_S)
    slower = np.maximum(speed - LIMITS.max_acceleration_rad_s2 * DT_S, 0.0)
    np.testing.assert_allclose(np.abs(robot.limiter.velocity_rad_s), slower, atol=1e-12)
    assert robot.damper.overdue is None
    robot.go(FORWARD, damper.MOST_LATE * DT_S)
    assert robot.damper.overdue is not None


def test_just_in_time_is_in_time() -> None:
    robot = Robot()
    now = [0]

    def clock() -> int:
        now[0] += damper.BUDGET_NS
        return now[0] if now[0] == damper.BUDGET_NS else 2 * damper.BUDGET_NS

    robot.damper.clock = clock
    robot.go(FORWARD, DT_S)
    assert robot.limiter.velocity_rad_s.any()


# each part taken out


def test_without_room_to_brake_a_twist_at_full_speed_collides(monkeypatch: pytest.MonkeyPatch) -> None:
    out, across = (posture(shoulder_pitch=60, shoulder_yaw=yaw, elbow_pitch=90) for yaw in (80, -80))
    spare_m = []
    for taken in (False, True):
        if taken:
            monkeypatch.setattr(damper.DistanceDamper, "_cut", lambda *_: None)
        robot = Robot([WALL], start=out)
        robot.go(across, 1.0)
        own_m, (wall_m,) = robot.least_m()
        spare_m.append(min(own_m - MARGIN_M, wall_m - 0.03))
    assert spare_m[0] >= -SLACK_M
    assert spare_m[1] < -0.02


def test_without_the_damping_a_hand_comes_fast_to_the_margin(monkeypatch: pytest.MonkeyPatch) -> None:
    fastest_m_s = []
    for taken in (False, True):
        if taken:
            monkeypatch.setattr(damper.DistanceDamper, "_damping", lambda *_: NO_ROWS)
        robot = Robot([WALL])
        robot.go(FORWARD, 1.0)
        spare_m = robot.distances.to_zones_m(np.array(robot.course[::4]))[:, 0] - 0.03
        closing_m_s = -np.diff(spare_m) / DT_S
        fastest_m_s.append(closing_m_s[spare_m[:-1] < 0.05].max())
    assert fastest_m_s[0] <= 0.05 / damper.TIME_CONSTANT_S
    assert fastest_m_s[1] > 1.3 * fastest_m_s[0]


def test_without_its_part_a_zone_does_not_slow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(damper.DistanceDamper, "_slowed", lambda _, near, fastest, step: (step, None))
    with pytest.raises(AssertionError):
        test_a_zone_limits_the_speed_of_what_is_inside()


def test_a_step_right_after_the_last_one_costs_no_more_than_any_other() -> None:
    """A late tick and the next one may be a nanosecond apart: the way to standstill is as long as ever."""
    speed = LIMITS.max_velocity_rad_s
    brake = LIMITS.max_acceleration_rad_s2
    way_rad = way_to_stop(speed, brake, 1e-9).gone_rad
    assert len(way_rad) <= 1.0 + float((speed / brake).max()) / 0.001
    continuous = speed**2 / (2.0 * brake)
    assert np.abs(way_rad[-1] - continuous).max() <= 0.5 * 0.001 * float(speed.max()) + 1e-6


def looks_at(
    apart_m: Array,
    spare_m: Array,
    stride_m: Array,
    parts: int,
    found_m: Array | None = None,
    suspect: int | None = None,
) -> list[int]:
    """The moments at which a way is looked at, where looks find `found_m` (K, R), else as at first."""
    looks = Looks(apart_m, spare_m, stride_m, parts, hope_m=0.02)
    moments: list[int] = []
    k = looks.next(suspect)
    while k is not None:
        assert k not in moments
        moments.append(k)
        looks.saw(k, spare_m if found_m is None else found_m[k])
        k = looks.next()
    return moments


def test_between_two_looks_no_kind_goes_further_than_their_spares_and_its_stride() -> None:
    """Whatever the looks find; the next setpoint is always looked at, and few looks are in vain."""
    rng = np.random.default_rng(3)
    count = 0
    for _ in range(200):
        apart_m = np.cumsum(rng.uniform(0.0, 0.02, (40, 4)) * rng.uniform(0.0, 1.0, 4), axis=0)
        spare_m, stride_m = rng.uniform(0.001, 0.03, 4), rng.uniform(0.014, 0.04, 4)
        found_m = rng.uniform(0.0, 0.03, (40, 4)) * (rng.random((40, 1)) < 0.7)
        suspect = None if rng.random() < 0.5 else int(rng.integers(0, 60))
        looks = sorted(looks_at(apart_m, spare_m, stride_m, 2, found_m, suspect))
        count += len(looks)
        if (apart_m[1] > spare_m).any():
            assert 1 in looks
        before_m, left_m, last = np.zeros(4), spare_m, -1
        for k in looks:
            gone_m = apart_m[k] - before_m
            assert k == last + 1 or (gone_m <= left_m + stride_m + found_m[k] + 1e-12).all()
            before_m, left_m, last = apart_m[k], found_m[k], k
        assert last == 39 or (apart_m[-1] - before_m <= left_m).all()
    assert count < 200 * 14


def test_a_way_on_which_nothing_can_come_too_near_is_not_looked_at() -> None:
    apart_m = np.cumsum(np.full((10, 1), 0.01), axis=0)
    none = np.zeros(1)
    assert looks_at(apart_m, np.array([0.1001]), none, 1) == []
    assert looks_at(apart_m, np.array([0.0999]), none, 1) == [9]
    # the next setpoint, too, only where it could be too near
    assert looks_at(apart_m, np.array([0.009]), np.array([0.2]), 1) == [0, 9]
    # and where the way was not free the last time is looked at first
    assert looks_at(apart_m, np.array([0.009]), np.array([0.2]), 1, suspect=5) == [5, 0, 9]


def test_where_less_is_found_than_was_hoped_for_it_looks_in_between() -> None:
    apart_m = np.cumsum(np.full((10, 1), 0.01), axis=0)
    spare_m, stride_m = np.array([0.021]), np.array([0.01])
    assert looks_at(apart_m, spare_m, stride_m, 1) == [4, 9]
    found_m = np.full((10, 1), 0.021)
    found_m[4] = 0.0
    assert looks_at(apart_m, spare_m, stride_m, 1, found_m)[:2] == [4, 2]


def test_a_thin_part_is_looked_at_so_often_that_nothing_slips_through_between_two_looks() -> None:
    """Two round parts pass each other evenly, at their margin at both looks: how far inside are they?"""
    model = distance_model(SKELETON, 100.0 * MARGIN_M, [RAIL, BED, HEAD])
    margin_m = np.array([MARGIN_M, RAIL.margin_m, BED.margin_m, HEAD.margin_m])[1 + model.obstacle]
    stride_m = damper.strides_m(model, margin_m)[model.kind]
    round_m = model.radius_m + margin_m
    inside_m = round_m - np.sqrt(round_m**2 - (0.5 * stride_m) ** 2)
    assert inside_m.max() <= 1.02 * damper.DIP_M
    assert inside_m.max() >= 0.5 * damper.DIP_M, "no oftener than needed"
    assert stride_m.max() > 1.5 * stride_m.min(), "thick parts are looked at less often"


def test_bent_ways_and_planes_have_strides_too() -> None:
    model = distance_model(SKELETON, 100.0 * MARGIN_M, [WALL])
    margin_m = np.array([MARGIN_M, WALL.margin_m])[1 + model.obstacle]
    assert np.isfinite(damper.strides_m(model, margin_m)).all()
