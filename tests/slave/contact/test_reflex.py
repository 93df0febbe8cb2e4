"""How far, how fast and which way the setpoint goes after contact."""

from __future__ import annotations

import numpy as np
import pytest

from common.skeleton import load_skeleton
from common.wire.messages import Mask
from slave.contact.config import ContactConfig, Reflex
from slave.contact.reflex import AFTER_NS, LEAD_S, MOST_M, REBOUND_NS, SLOW_RAD_S, ContactReflex
from slave.contact.watch import ContactWatch
from slave.guard.config import GuardConfig
from slave.limit.limit import SetpointLimiter

SKELETON = load_skeleton("nursing")
SHOULDER = SKELETON.joint_names.index("left_shoulder_pitch")
TICK_NS = 5_000_000
NOBODY = np.zeros(25, np.bool_)
LAG_RAD = 0.03


class Raised:
    """An arm that was raised by 0.4 rad in 0.5 s, its joints `LAG_RAD` behind, and is pushed from then on."""

    def __init__(self, config: ContactConfig, turned_rad: float = 0.4) -> None:
        self.watch = ContactWatch(SKELETON, config)
        self.reflex = ContactReflex(config, self.watch, SKELETON.joint_names)
        self.limiter = SetpointLimiter(SKELETON.joint_names, GuardConfig().limits(SKELETON))
        self.now_ns = 0
        self.begin = np.clip(np.zeros(25), SKELETON.lower_rad, SKELETON.upper_rad)
        self.stand = self.begin.copy()
        for share in np.linspace(0.0, 1.0, 100):
            self.now_ns += TICK_NS
            self.stand[SHOULDER] = share * turned_rad
            self._see()
            self.reflex.followed(self.now_ns, self.stand)
        self.limiter.seat(self.stand + np.eye(25)[SHOULDER] * LAG_RAD)
        self.watch.finding = "pushed"

    def _see(self) -> None:
        """The watch's kinematics, as after a reading of these angles."""
        for k in range(3):
            self.watch.observer.update(self.now_ns - (2 - k) * 1_000_000, self.stand.copy(), np.zeros(25))

    def step(self, ticks: int, doubted: Mask = NOBODY) -> list[float]:
        """The shoulder's setpoint after each tick in hold; empty where the reflex does nothing."""
        course = []
        for _ in range(ticks):
            self.now_ns += TICK_NS
            if self.reflex.step(self.now_ns, 0.005, self.stand, self.limiter, doubted):
                course.append(float(self.limiter.position_rad[SHOULDER]))
        return course


def test_hold_leaves_the_setpoint_to_the_brakes() -> None:
    assert Raised(ContactConfig(reflex=Reflex.HOLD)).step(10) == []


@pytest.mark.parametrize("reflex", [Reflex.RETREAT, Reflex.FLOAT])
def test_the_first_step_gives_up_the_drives_lead(reflex: Reflex) -> None:
    course = Raised(ContactConfig(reflex=reflex)).step(1)
    assert course[0] == pytest.approx(0.4, abs=1e-3)


@pytest.mark.parametrize("reflex", [Reflex.RETREAT, Reflex.FLOAT])
def test_an_arm_that_is_pushed_beyond_its_limit_gets_its_setpoint_at_the_limit(reflex: Reflex) -> None:
    robot = Raised(ContactConfig(reflex=reflex), turned_rad=float(SKELETON.upper_rad[SHOULDER]) - 0.01)
    robot.limiter.seat(np.minimum(robot.limiter.position_rad, SKELETON.upper_rad))
    robot.stand[SHOULDER] = SKELETON.upper_rad[SHOULDER] + 0.05
    course = robot.step(20)
    assert course
    assert max(course) <= SKELETON.upper_rad[SHOULDER]


def test_it_goes_back_slowly_and_stops_once_it_is_free_and_a_little_farther() -> None:
    robot = Raised(ContactConfig(retreat_m=0.02))
    pressed = robot.step(60)
    robot.watch.finding = None
    free = robot.step(400)
    course = np.array([*pressed, *free])
    assert (np.diff(course) <= 1e-9).all()
    assert np.abs(np.diff(course)).max() <= SLOW_RAD_S * 0.005 + 1e-9
    arm_m = 0.7
    assert 0.01 < (pressed[-1] - free[-1]) * arm_m < 0.03
    assert free[-1] == free[-100]


def test_it_never_goes_back_farther_than_its_most() -> None:
    course = Raised(ContactConfig()).step(1000)
    assert 0.4 - course[-1] < MOST_M / 0.5
    assert course[-1] == course[-100]


def test_it_never_goes_back_farther_than_it_came() -> None:
    robot = Raised(ContactConfig(retreat_m=0.2), turned_rad=0.05)
    course = robot.step(1000)
    assert min(course) >= robot.begin[SHOULDER] - 1e-9
    assert course[-1] == pytest.approx(robot.begin[SHOULDER], abs=2e-3)


@pytest.mark.parametrize(("later_ns", "stops"), [(REBOUND_NS + 3 * TICK_NS, True), (REBOUND_NS // 2, False)])
def test_where_it_meets_something_on_its_way_back_it_stops(later_ns: int, stops: bool) -> None:
    robot = Raised(ContactConfig(retreat_m=0.2, retreat_m_s=0.05))
    robot.step(20)
    robot.watch.finding = None
    robot.step(later_ns // TICK_NS)
    robot.watch.finding = "pushed"
    course = robot.step(40)
    assert (course[20] == course[-1]) is stops


def test_a_doubted_joint_stays_where_it_is() -> None:
    robot = Raised(ContactConfig())
    doubted = np.eye(25, dtype=np.bool_)[SHOULDER]
    course = robot.step(200, doubted)
    assert course[-1] == pytest.approx(0.4 + LAG_RAD)


def test_somebody_who_comes_long_after_the_motion_moves_nothing() -> None:
    robot = Raised(ContactConfig())
    robot.now_ns += AFTER_NS
    assert robot.step(5) == []


def test_an_estop_ends_it() -> None:
    robot = Raised(ContactConfig())
    robot.step(5)
    robot.reflex.cancel()
    assert robot.step(5) == []


def test_floating_gives_way_to_a_push_and_stands_without_one() -> None:
    robot = Raised(ContactConfig(reflex=Reflex.FLOAT))
    pushed = robot.watch.observer._poles
    pushed[2, :, 0, SHOULDER] = -1.2 * robot.watch.threshold_nm[SHOULDER]
    course = robot.step(100)
    assert course[-1] < course[0] - 0.05
    assert np.abs(np.diff(course)).max() <= SLOW_RAD_S * 0.005 + 1e-9
    pushed[2, :, 0, SHOULDER] = -0.4 * robot.watch.threshold_nm[SHOULDER]
    rest = robot.step(200)
    assert rest[-1] == rest[-50]


@pytest.mark.parametrize(("lead", "yields"), [(0.99, True), (1.01, False)])
def test_a_joint_that_seems_further_from_its_setpoint_than_any_drive_lags_is_not_followed(
    lead: float, yields: bool
) -> None:
    """A drive whose own angle is wrong: to seat the setpoint there would fling the joint."""
    arm = Raised(ContactConfig())
    most_rad = LEAD_S * arm.limiter.limits.max_velocity_rad_s[SHOULDER]
    arm.limiter.seat(arm.stand + np.eye(25)[SHOULDER] * lead * most_rad)
    assert bool(arm.step(3)) is yields
