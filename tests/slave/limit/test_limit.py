"""The setpoint limiter: its promises for arbitrary targets, and what each rule is for."""

from dataclasses import replace

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given, settings

from common.quaternion import Array
from common.skeleton import load_skeleton
from common.wire.messages import Mask
from slave.encoders.counts import RAD_PER_COUNT
from slave.guard import GuardConfig
from slave.guard.events import Clamp, Rule
from slave.guard.limits import MotionLimits
from slave.limit import limit
from slave.limit.limit import SetpointLimiter

SKELETON = load_skeleton("nursing")
LIMITS = GuardConfig().limits(SKELETON)
JOINTS = len(SKELETON.joints)
MID = 0.5 * (LIMITS.lower_rad + LIMITS.upper_rad)
NONE = np.zeros(JOINTS, np.bool_)
DT = 0.005
EPS = 1e-9

shares = st.lists(st.floats(-3.0, 3.0), min_size=4, max_size=4).map(lambda x: np.resize(x, JOINTS))
"""Targets (J,) in half ranges from the middle: ±1 is at the limit, ±3 far beyond. Four values, in turn."""
steps_s = st.sampled_from([DT, DT, DT, DT, 0.0001, 0.001, 0.0047, 0.0093, 0.025])


def position(share: Array) -> Array:
    return MID + share * 0.5 * (LIMITS.upper_rad - LIMITS.lower_rad)


class Watched:
    """A limiter every step of which is checked."""

    def __init__(self, start: Array = MID) -> None:
        self.limiter = SetpointLimiter(SKELETON.joint_names, LIMITS)
        self.limiter.seat(start)
        self.low, self.high = np.minimum(start, LIMITS.lower_rad), np.maximum(start, LIMITS.upper_rad)
        self.clamps: list[Clamp] = []

    def step(
        self,
        target: Array,
        rate: Array | None = None,
        dt_s: float = DT,
        held: Mask = NONE,
        scale: float = 1.0,
    ) -> None:
        before = self.limiter
        p, v = before.position_rad, before.velocity_rad_s
        most_v, most_a = LIMITS.max_velocity_rad_s, LIMITS.max_acceleration_rad_s2
        if scale != 1.0:
            most_v, most_a = most_v * scale, most_a * scale
        rate = np.zeros(JOINTS) if rate is None else rate
        self.clamps += self.limiter.step(0, dt_s, target, rate, held, most_v, most_a)
        self.check(p, v, dt_s)

    def check(self, p: Array, v: Array, dt_s: float) -> None:
        q, w = self.limiter.position_rad, self.limiter.velocity_rad_s
        assert (np.abs(w) <= LIMITS.max_velocity_rad_s + EPS).all()
        assert (np.abs(w - v) <= LIMITS.max_acceleration_rad_s2 * dt_s + EPS).all()
        assert (q >= self.low).all()
        assert (q <= self.high).all()
        assert np.allclose(q - p, w * dt_s, rtol=0, atol=EPS)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(shares, shares, steps_s, st.integers(1, 30), st.booleans()), min_size=1, max_size=12)
)
def test_whatever_is_asked_no_limit_is_exceeded(
    course: list[tuple[Array, Array, float, int, bool]],
) -> None:
    watched = Watched()
    for share, rate, dt_s, count, slow in course:
        for _ in range(count):
            watched.step(position(share), rate * 5.0, dt_s, scale=0.1 if slow else 1.0)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(shares, st.lists(st.booleans(), min_size=3, max_size=3)), max_size=12))
def test_held_joints_keep_the_limits_too(course: list[tuple[Array, list[bool]]]) -> None:
    watched = Watched()
    for share, held in course:
        for _ in range(8):
            watched.step(position(share), held=np.resize(held, JOINTS))


@settings(max_examples=30, deadline=None)
@given(shares, shares)
def test_it_converges_on_a_target_that_stands(start: Array, share: Array) -> None:
    watched = Watched(LIMITS.reachable(position(start)))
    goal = LIMITS.reachable(position(share))
    for _ in range(500):
        watched.step(position(share))
    assert np.allclose(watched.limiter.position_rad, goal, rtol=0, atol=EPS)
    assert np.allclose(watched.limiter.velocity_rad_s, 0.0, rtol=0, atol=EPS)


@settings(max_examples=30, deadline=None)
@given(shares, shares, st.lists(st.floats(0.0045, 0.0055), min_size=8, max_size=8))
def test_after_a_jump_it_does_not_overshoot(start: Array, share: Array, jitter: list[float]) -> None:
    """From rest to rest, on a grid with 10 % jitter."""
    begin, goal = LIMITS.reachable(position(start)), LIMITS.reachable(position(share))
    watched = Watched(begin)
    for i in range(400):
        watched.step(goal, dt_s=jitter[i % 8])
        beyond = (watched.limiter.position_rad - goal) * np.sign(goal - begin)
        # what half a step's acceleration takes to stop: 0.3 mrad for the fastest finger
        assert (beyond <= LIMITS.max_acceleration_rad_s2 * DT**2 / 7).all()


@settings(max_examples=30, deadline=None)
@given(
    shares,
    st.floats(0.2, 3.0),
    steps_s.filter(lambda dt: 0.001 <= dt < 0.02),
)
def test_a_feasible_target_is_followed_without_any_lag(phase: Array, rate_hz: float, dt_s: float) -> None:
    """Sines that use up to 95 % of the velocity and acceleration limits, inside the range."""
    omega = 2 * np.pi * rate_hz
    half = 0.5 * (LIMITS.upper_rad - LIMITS.lower_rad)
    amplitude = 0.95 * np.minimum.reduce(
        [half, LIMITS.max_velocity_rad_s / omega, LIMITS.max_acceleration_rad_s2 / omega**2]
    )
    angle = phase * np.pi

    def target(i: int) -> tuple[Array, Array]:
        x = omega * i * dt_s + angle
        return MID + amplitude * np.sin(x), amplitude * omega * np.cos(x)

    start, speed = target(0)
    watched = Watched(start)
    watched.limiter.velocity_rad_s = speed
    for i in range(1, 200):
        watched.step(*target(i), dt_s=dt_s)
        assert np.allclose(watched.limiter.position_rad, target(i)[0], rtol=0, atol=EPS)
    assert not watched.clamps


def test_a_moving_target_is_caught_up_with_and_followed_exactly() -> None:
    watched = Watched(MID)
    rate = np.full(JOINTS, 0.3)
    for i in range(1, 100):
        watched.step(MID + 0.2 + rate * i * DT, rate)
        assert (watched.limiter.position_rad <= MID + 0.2 + rate * i * DT + EPS).all()
    assert np.allclose(watched.limiter.position_rad, MID + 0.2 + rate * i * DT, rtol=0, atol=EPS)


@pytest.mark.parametrize("speed", [0.5, 0.8, 1.0])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_joint_left_behind_stops_where_its_target_stops(speed: float, sign: float) -> None:
    """The target is 0.15 rad ahead and as fast as the joint may be, then brakes as hard as the joint can."""
    watched = Watched(MID)
    goal, rate, beyond = MID + sign * 0.15, sign * speed * LIMITS.max_velocity_rad_s, np.zeros(JOINTS)
    goals = [MID]
    for i in range(250):
        if i > 20:
            brake = LIMITS.max_acceleration_rad_s2 * DT
            rate = np.sign(rate) * np.maximum(np.abs(rate) - brake, 0.0)
        goal = LIMITS.reachable(goal + rate * DT)
        goals.append(goal)
        watched.step(goal, rate)
        farthest = np.max(sign * np.array(goals), axis=0)
        beyond = np.maximum(beyond, sign * watched.limiter.position_rad - farthest)
    # what half a step's acceleration takes to stop, twice: the target itself brakes in steps
    assert (beyond <= LIMITS.max_acceleration_rad_s2 * DT**2).all()


def test_a_jump_is_answered_by_acceleration_cruise_and_braking() -> None:
    watched = Watched(LIMITS.lower_rad)
    speeds = []
    for _ in range(300):
        watched.step(LIMITS.upper_rad)
        speeds.append(watched.limiter.velocity_rad_s[3])
    most_v, most_a = LIMITS.max_velocity_rad_s[3], LIMITS.max_acceleration_rad_s2[3]
    rising = most_v / most_a / DT
    assert np.allclose(np.diff(speeds[: int(rising)]), most_a * DT)
    assert speeds.count(most_v) > 50
    assert speeds[-1] == pytest.approx(0.0)
    # time-optimal but for a few steps: way / v + v / a
    way = LIMITS.upper_rad[3] - LIMITS.lower_rad[3]
    arrived = next(i for i in range(300) if sum(speeds[:i]) * DT > way - 1e-4)
    assert arrived * DT < way / most_v + most_v / most_a + 5 * DT


def test_held_joints_brake_and_stay_and_the_others_go_on() -> None:
    watched = Watched(LIMITS.lower_rad)
    held = NONE.copy()
    held[::2] = True
    for _ in range(20):
        watched.step(LIMITS.upper_rad)
    for _ in range(60):
        watched.step(LIMITS.upper_rad, held=held)
    still = watched.limiter.position_rad
    assert (watched.limiter.velocity_rad_s[::2] == 0.0).all()
    for _ in range(10):
        watched.step(LIMITS.upper_rad, held=held)
    assert np.array_equal(watched.limiter.position_rad[::2], still[::2])
    assert watched.limiter.position_rad[3] > still[3]


def test_stop_brakes_at_the_acceleration_limit_to_standstill() -> None:
    watched = Watched(LIMITS.lower_rad)
    for _ in range(40):
        watched.step(LIMITS.upper_rad)
    speed = watched.limiter.velocity_rad_s
    for _ in range(100):
        p, v = watched.limiter.position_rad, watched.limiter.velocity_rad_s
        watched.limiter.stop(DT)
        watched.check(p, v, DT)
        expected = np.maximum(speed - LIMITS.max_acceleration_rad_s2 * DT, 0.0)
        assert np.allclose(watched.limiter.velocity_rad_s, expected)
        speed = expected
    assert watched.limiter.at_rest
    still = watched.limiter.position_rad
    watched.limiter.stop(DT)
    assert watched.limiter.position_rad is still


def test_a_joint_beyond_its_limit_does_not_jump_and_moves_back() -> None:
    start = MID.copy()
    start[5] = LIMITS.upper_rad[5] + 0.1
    watched = Watched(start)
    outward = LIMITS.upper_rad + 1.0
    last = start[5]
    for _ in range(200):
        watched.step(outward)
        assert watched.limiter.position_rad[5] <= last
        last = watched.limiter.position_rad[5]
    assert last == pytest.approx(LIMITS.upper_rad[5])
    for _ in range(200):
        watched.step(MID)
    assert watched.limiter.position_rad[5] == pytest.approx(MID[5])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_that_reads_a_count_beyond_its_limit_is_held_at_the_limit(sign: float) -> None:
    end = LIMITS.upper_rad if sign > 0.0 else LIMITS.lower_rad
    limiter = SetpointLimiter(SKELETON.joint_names, LIMITS)
    limiter.seat(end + sign * (RAD_PER_COUNT - EPS))
    assert (limiter.position_rad == end).all()
    further = end + sign * (RAD_PER_COUNT + EPS)
    limiter.seat(further)
    assert (limiter.position_rad == further).all(), "the joint would jump to its limit"


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_setpoint_that_yields_stops_at_the_limit(sign: float) -> None:
    end = LIMITS.upper_rad if sign > 0.0 else LIMITS.lower_rad
    watched = Watched(end - sign * 0.01)
    watched.limiter.yield_to(end + sign * 0.05)
    assert (watched.limiter.position_rad == end).all()
    beyond = end + sign * 0.1
    watched.limiter.seat(beyond)
    watched.limiter.yield_to(end + sign * 0.2)
    assert (watched.limiter.position_rad == beyond).all(), "it went further beyond"
    watched.limiter.yield_to(end + sign * 0.06)
    assert np.allclose(watched.limiter.position_rad, end + sign * 0.06), "it may come back"


def test_before_the_joints_are_read_the_setpoint_is_within_limits_that_do_not_contain_zero() -> None:
    limits = replace(LIMITS, lower_rad=np.full(JOINTS, 0.2), upper_rad=np.full(JOINTS, 0.4))
    assert (SetpointLimiter(SKELETON.joint_names, limits).position_rad == 0.2).all()


def test_a_joint_beyond_its_limit_has_no_room_outwards() -> None:
    beyond = LIMITS.upper_rad + 0.1
    motion = limit.LimiterStep(
        beyond, np.zeros(JOINTS), DT, LIMITS, LIMITS.max_velocity_rad_s, LIMITS.max_acceleration_rad_s2
    )
    low, high = dict(limit.RULES)[Rule.POSITION](motion)
    assert (high == 0.0).all()
    assert (low < 0.0).all()


@pytest.mark.parametrize("rate", [3.0, -3.0])
def test_a_target_beyond_the_limit_counts_as_standing_at_the_limit(rate: float) -> None:
    """Its velocity there says nothing of where the joint may go."""
    watched = Watched()
    for _ in range(300):
        watched.step(LIMITS.upper_rad + 1.0, np.full(JOINTS, rate))
    assert np.allclose(watched.limiter.position_rad, LIMITS.upper_rad, rtol=0, atol=EPS)


def test_gentle_maxima_bound_speeding_up_and_cruise() -> None:
    watched = Watched(LIMITS.lower_rad)
    for _ in range(200):
        v = watched.limiter.velocity_rad_s
        watched.step(LIMITS.upper_rad, scale=0.1)
        w = watched.limiter.velocity_rad_s
        assert (np.abs(w) <= 0.1 * LIMITS.max_velocity_rad_s + EPS).all()
        assert (np.abs(w) - np.abs(v) <= 0.1 * LIMITS.max_acceleration_rad_s2 * DT + EPS).all()


def test_gentle_maxima_do_not_carry_a_fast_joint_through_a_limit() -> None:
    watched = Watched(LIMITS.lower_rad)
    while watched.limiter.position_rad[3] < LIMITS.upper_rad[3] - 0.25:
        watched.step(LIMITS.upper_rad)
    for _ in range(400):
        watched.step(LIMITS.upper_rad + 1.0, scale=0.01)


def test_no_time_no_motion() -> None:
    watched = Watched(LIMITS.lower_rad)
    before = watched.limiter.position_rad
    watched.step(LIMITS.upper_rad, dt_s=0.0)
    watched.limiter.stop(0.0)
    assert watched.limiter.position_rad is before


def test_setpoints_cannot_be_written_from_outside() -> None:
    watched = Watched()
    for _ in range(2):
        with pytest.raises(ValueError, match="read-only"):
            watched.limiter.position_rad += 1.0
        watched.step(LIMITS.upper_rad)


# what is told of clamps


def one(clamps: list[Clamp], joint: str, rule: Rule) -> Clamp:
    (clamp,) = [c for c in clamps if c.joint == joint and c.rule is rule]
    return clamp


def test_a_target_beyond_the_limit_is_reported_once_with_both_angles() -> None:
    watched = Watched()
    target = MID.copy()
    target[4] = LIMITS.upper_rad[4] + 0.3
    for _ in range(100):
        watched.step(target)
    clamp = one(watched.clamps, SKELETON.joint_names[4], Rule.POSITION)
    assert (clamp.asked, clamp.given) == pytest.approx((target[4], LIMITS.upper_rad[4]))
    watched.step(MID)
    watched.step(target)
    assert len([c for c in watched.clamps if c.rule is Rule.POSITION]) == 2


def test_a_target_that_would_hit_the_limit_is_reported_with_its_stop() -> None:
    watched = Watched()
    rate = np.zeros(JOINTS)
    rate[4] = LIMITS.max_velocity_rad_s[4]
    target = MID.copy()
    while not watched.clamps or watched.clamps[-1].rule is not Rule.POSITION:
        target[4] = min(target[4] + rate[4] * DT, LIMITS.upper_rad[4])
        watched.step(target, rate)
    assert watched.clamps[-1].joint == SKELETON.joint_names[4]
    assert watched.clamps[-1].asked > LIMITS.upper_rad[4]
    assert watched.clamps[-1].given == LIMITS.upper_rad[4]


def test_velocity_and_acceleration_are_told_in_their_own_units() -> None:
    watched = Watched(LIMITS.lower_rad)
    target = LIMITS.lower_rad.copy()
    target[4] = LIMITS.upper_rad[4]
    watched.step(target)
    velocity = one(watched.clamps, SKELETON.joint_names[4], Rule.VELOCITY)
    acceleration = one(watched.clamps, SKELETON.joint_names[4], Rule.ACCELERATION)
    assert velocity.asked > velocity.given == LIMITS.max_velocity_rad_s[4]
    assert acceleration.asked > acceleration.given == pytest.approx(LIMITS.max_acceleration_rad_s2[4])
    assert len(watched.clamps) == 2


def test_braking_of_held_joints_is_not_a_clamp() -> None:
    watched = Watched(LIMITS.lower_rad)
    for _ in range(20):
        watched.step(LIMITS.upper_rad)
    told = len(watched.clamps)
    assert told
    assert watched.limiter.clamped.any()
    for _ in range(20):
        watched.step(LIMITS.upper_rad, held=~NONE)
    assert not watched.limiter.clamped.any()
    assert len(watched.clamps) == told


# each rule taken out


@pytest.fixture(params=[rule for rule, _ in limit.RULES])
def missing(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Rule:
    rule: Rule = request.param
    monkeypatch.setattr(limit, "RULES", tuple(r for r in limit.RULES if r[0] is not rule))
    return rule


def test_without_any_one_rule_its_promise_is_broken(missing: Rule) -> None:
    """Only the promise whose rule is missing: a jump, and a target that hits the limit at full speed."""
    broken = set()
    for course in ("jump", "hit"):
        limiter = SetpointLimiter(SKELETON.joint_names, LIMITS)
        limiter.seat(MID)
        p, v = limiter.position_rad, limiter.velocity_rad_s
        target, rate = MID, np.zeros(JOINTS)
        for _ in range(150):
            if course == "jump":
                target = LIMITS.upper_rad
            else:
                rate = 2.0 * LIMITS.max_velocity_rad_s
                target = np.minimum(target + rate * DT, LIMITS.upper_rad)
            limiter.step(0, DT, target, rate, NONE, LIMITS.max_velocity_rad_s, LIMITS.max_acceleration_rad_s2)
            q, w = limiter.position_rad, limiter.velocity_rad_s
            if (np.abs(w) > LIMITS.max_velocity_rad_s + EPS).any():
                broken.add(Rule.VELOCITY)
            if (np.abs(w - v) > LIMITS.max_acceleration_rad_s2 * DT + EPS).any():
                broken.add(Rule.ACCELERATION)
            if not np.allclose(q - p, w * DT, rtol=0, atol=EPS):
                broken.add(Rule.POSITION)  # ran into the wall: the last clip, not braking, stopped it
            p, v = q, w
    assert broken == {missing}


def test_scaled_limits_are_tighter() -> None:
    half = GuardConfig(velocity_scale=0.5, acceleration_scale=0.25).limits(SKELETON)
    assert isinstance(half, MotionLimits)
    assert np.allclose(half.max_velocity_rad_s, 0.5 * LIMITS.max_velocity_rad_s)
    assert np.allclose(half.max_acceleration_rad_s2, 0.25 * LIMITS.max_acceleration_rad_s2)
