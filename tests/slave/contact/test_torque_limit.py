"""What drives may give while the robot follows: what moving needs, and no more than a margin on top."""

from __future__ import annotations

import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import load_skeleton
from slave.contact.config import ContactConfig
from slave.contact.foretold import KEPT_S, LONGEST_S, ForetoldTorque
from slave.contact.torque_limit import MARGIN, TorqueLimit
from slave.contact.watch import ContactWatch
from slave.model.build import build_model
from slave.servos.mujoco.simulated import CYCLE_NS, SimulatedRobot

SKELETON = load_skeleton("nursing")
J = len(SKELETON.joints)
SHOULDER = SKELETON.joint_names.index("right_shoulder_pitch")
FINGERS = np.isinf(ContactWatch(SKELETON, ContactConfig()).floor_nm)
FLOOR_NM = ContactWatch(SKELETON, ContactConfig()).limit_floor_nm
REST = np.clip(np.zeros(J), SKELETON.lower_rad, SKELETON.upper_rad)
DT_S = 1e-9 * CYCLE_NS


class Limit:
    """Limits by what is foretold."""

    def __init__(self, config: ContactConfig) -> None:
        self._foretold = ForetoldTorque(SKELETON, config.drive_hz, build_model(SKELETON))
        self._limit = TorqueLimit(config)

    def step(self, dt_s: float, stand_rad: Array, setpoint_rad: Array, floor_nm: Array) -> Array | None:
        if not 0.0 < dt_s <= LONGEST_S:
            self._limit.forget()
        return self._limit.step(dt_s, *self._foretold.step(dt_s, stand_rad, setpoint_rad), floor_nm)

    def forget(self) -> None:
        self._foretold.forget()
        self._limit.forget()


def limit(drive_hz: float = 8.0, model_error: float = 0.15) -> Limit:
    return Limit(ContactConfig(drive_hz=drive_hz, model_error=model_error))


def raised(angle_rad: float) -> Array:
    out: Array = REST + np.eye(J)[SHOULDER] * angle_rad
    return out


def swing(t_s: float) -> Array:
    """Forth and back by the shoulder: up to 3 rad/s and 18 rad/s²."""
    return raised(0.5 - 0.5 * np.cos(6.0 * t_s))


class Follower:
    """The simulated robot follows; every cycle its drives get a setpoint and, where wanted, their limit."""

    def __init__(self, limited: bool) -> None:
        self.robot = SimulatedRobot(SKELETON)
        self.limit = limit() if limited else None
        self.given: list[Array] = []
        self.allowed: list[Array] = []
        self.position: list[Array] = []

    def follow(self, cycles: int, held: Array | None = None) -> None:
        """Along the swing; `held`: generalised force (hinges,) from outside."""
        for _ in range(cycles):
            setpoint = swing(1e-9 * self.robot.now_ns)
            if self.limit is not None:
                torque = self.limit.step(DT_S, self.robot.position_rad, setpoint, FLOOR_NM)
                assert torque is not None
                self.robot.limit_torque(torque)
                self.allowed.append(torque)
            self.robot.write(setpoint)
            self.robot._data.qfrc_applied[:] = 0.0 if held is None else held
            self.robot.advance(self.robot.now_ns + CYCLE_NS)
            self.given.append(self.robot.effort_nm.copy())
            self.position.append(self.robot.position_rad.copy())


def test_what_the_motion_needs_is_always_allowed() -> None:
    free, limited = Follower(limited=False), Follower(limited=True)
    for one in (free, limited):
        one.follow(500)
    most = np.abs(np.array(free.given)[:, SHOULDER]).max()
    assert most > 12.0
    apart = np.abs(np.array(free.position) - np.array(limited.position)).max()
    assert apart < np.radians(0.1)


def held_up() -> Array:
    """A force on the shoulder's hinge that stops the swing: 45 N m against it."""
    model = build_model(SKELETON)
    out = np.zeros(model.nv)
    out[model.joint("right_shoulder_pitch").dofadr[0]] = -45.0
    return out


def test_a_drive_that_is_held_up_pushes_no_harder_than_the_margin() -> None:
    free, limited = Follower(limited=False), Follower(limited=True)
    for one in (free, limited):
        one.follow(60)
        one.follow(60, held_up())
    # a limit is in force from the next cycle on; the one in which the force begins is integrated as a whole
    over = (np.array(limited.given)[1:, SHOULDER] - np.array(limited.allowed)[:-1, 1, SHOULDER])[60:]
    assert over.max() < 1e-6
    # and it does have to be held back, or the test would tell nothing
    assert over.max() > -1e-6
    assert np.array(free.given)[61:, SHOULDER].max() > np.array(limited.given)[61:, SHOULDER].max() + 15.0


def still(one: Limit, seconds: float = 1.0) -> Array:
    """The limits of a robot that has stood in `raised(1.0)` for long."""
    torque = None
    for _ in range(round(seconds / 0.005)):
        torque = one.step(0.005, raised(1.0), raised(1.0), FLOOR_NM)
    assert torque is not None
    return torque


def test_the_margin_is_a_quarter_more_than_what_is_noticed() -> None:
    low, high = still(limit(model_error=0.1))[:, ~FINGERS]
    needed = 0.5 * (low + high)
    assert abs(needed[SHOULDER]) > 5.0
    assert 0.5 * (high - low) == pytest.approx(MARGIN * (FLOOR_NM[~FINGERS] + 0.1 * np.abs(needed)))
    assert MARGIN > 1.0


def test_what_it_needs_to_stand_is_gravity() -> None:
    robot = SimulatedRobot(SKELETON, position_rad=raised(1.0))
    robot.write(raised(1.0))
    robot.advance(2_000_000_000)
    for _ in range(500):
        robot.advance(robot.now_ns + CYCLE_NS)
    low, high = still(limit())[:, ~FINGERS]
    assert 0.5 * (low + high) == pytest.approx(robot.effort_nm[~FINGERS], abs=0.05)


def test_what_it_needs_to_stand_is_allowed_while_the_arm_speeds_up_downwards() -> None:
    """A drive whose slave dies in that moment has to hold the arm with what it was told last."""
    one = limit(drive_hz=100.0, model_error=0.0)
    still(one)
    stands_nm = 0.5 * still(limit(model_error=0.0))[:, SHOULDER].sum()
    margin_nm = MARGIN * FLOOR_NM[SHOULDER]
    assert abs(stands_nm) > 5.0
    falls = -np.sign(stands_nm)
    for step in range(20):
        torque = one.step(
            0.005, raised(1.0), raised(1.0 + falls * 0.5 * 20.0 * (0.005 * step) ** 2), FLOOR_NM
        )
    assert torque is not None
    low, high = torque[:, SHOULDER]
    assert low <= stands_nm - 0.5 * margin_nm
    assert high >= stands_nm + 0.5 * margin_nm
    # and the motion needs less than that, or the test would tell nothing
    assert (high - low) > 2.0 * margin_nm + 2.0


def test_fingers_are_not_limited() -> None:
    low, high = still(limit())[:, FINGERS]
    assert (low == -np.inf).all()
    assert (high == np.inf).all()


def test_switched_off_it_limits_nothing() -> None:
    off = Limit(ContactConfig(torque_limit=False))
    assert off.step(0.005, REST, raised(1.0), FLOOR_NM) is None


@pytest.mark.parametrize(("later_s", "wide"), [(KEPT_S - 0.001, True), (KEPT_S + 0.004, False)])
def test_what_was_needed_a_moment_ago_is_still_allowed(later_s: float, wide: bool) -> None:
    one = limit(drive_hz=100.0)
    still(one)
    one.step(0.005, REST, raised(1.05), FLOOR_NM)
    for _ in range(10):
        after = one.step(0.1 * later_s, REST, raised(1.05), FLOOR_NM)
    assert after is not None
    # to come to rest after the step took far more for a moment
    assert bool(after[0, SHOULDER] < -1000.0) is wide


@pytest.mark.parametrize(("gap_s", "anew"), [(LONGEST_S, False), (LONGEST_S + 0.001, True), (0.0, True)])
def test_after_a_gap_it_begins_where_the_joints_stand(gap_s: float, anew: bool) -> None:
    one = limit()
    still(one)
    torque = one.step(gap_s, REST, REST, FLOOR_NM)
    fresh = limit().step(0.005, REST, REST, FLOOR_NM)
    assert torque is not None
    assert fresh is not None
    assert bool(torque[:, SHOULDER] == pytest.approx(fresh[:, SHOULDER])) is anew


def test_what_is_forgotten_does_not_count() -> None:
    one = limit()
    still(one)
    one.forget()
    torque, fresh = (x.step(0.005, REST, REST, FLOOR_NM) for x in (one, limit()))
    assert torque is not None
    assert torque == pytest.approx(fresh)
