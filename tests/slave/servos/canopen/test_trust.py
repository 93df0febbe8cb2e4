"""A drive's word is not taken for the truth: every verdict here is on the plant's true joint angle."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import Skeleton
from deploy.sim.drives.faults import DriveFault
from deploy.sim.drives.peer import DrivePeer
from slave.encoders.counts import EncoderConfig
from slave.encoders.uncommanded import ASTRAY_RAD
from slave.guard import GuardConfig
from slave.limit.limit import SetpointLimiter
from slave.model import build
from slave.servos.canopen.cia402 import Power
from slave.servos.canopen.config import CanopenConfig
from slave.servos.canopen.setup_run import SetupRun
from slave.servos.canopen.start_check import LAST_KNOWN_RAD, SLACK_RAD, JointPlace, refusal
from slave.servos.canopen.status_bits import FOLLOWS, GOOD, LIMITED, REMOTE, VOLTAGE, wrong_bits
from slave.servos.canopen.watch import DriveWatch
from tests.slave.servos.canopen.conftest import Wired

ELBOW = "left_elbow_pitch"
READY = VOLTAGE | REMOTE


def standing(
    elbow_deg: float, config: CanopenConfig | None = None, encoders: EncoderConfig | None = None
) -> Wired:
    """A robot whose elbow stands at an angle, not started yet."""
    wired = Wired(config, encoders)
    stands = np.zeros(25)
    stands[wired.index(ELBOW)] = np.radians(elbow_deg)
    wired.peer = DrivePeer(
        wired.config,
        wired.skeleton,
        encoders or EncoderConfig(),
        wired._to_slave,
        wired.now_ns,
        position_rad=stands,
    )
    return wired


def moved_deg(wired: Wired, joint: str = ELBOW) -> float:
    """How far a joint truly was from where it began, at most."""
    course = np.array(wired.positions)[:, wired.index(joint)]
    return float(np.degrees(np.abs(course - course[0]).max()))


def wrong_from_the_start(fault: DriveFault, elbow_deg: float = 40.0) -> Wired:
    wired = standing(elbow_deg)
    wired.happen(ELBOW, fault)
    wired.start()
    wired.run(1.0)
    return wired


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (DriveFault.LOST_TURNS, "0.0°, its output encoder 40"),
        (DriveFault.WRONG_ZERO, "reports 70.0°, its output encoder 40"),
        (DriveFault.WRONG_GEAR, "reports 79.9°, its output encoder 40"),
        (DriveFault.REVERSED, "reports -40.0°, its output encoder 40"),
        (DriveFault.ENCODER_ZERO, "reports 40.0°, its output encoder 0.0°"),
        (DriveFault.DOUBLE_ID, "two drives have its id"),
        (
            DriveFault.WRONG_MODE,
            "object 6061:0 is 0x1: the mode asked for, cyclic synchronous position (8)",
        ),
        (DriveFault.LIMIT_ACTIVE, "is not ready: a limit of its own is active"),
        (DriveFault.LOCAL, "is not ready: it is under local control"),
        (DriveFault.NOT_FOLLOWING, "is enabled, but it does not follow its target (bit 12)"),
        (DriveFault.NO_VOLTAGE, "is enabled, but its motor stage has no voltage (statusword bit 4)"),
    ],
)
def test_a_drive_that_is_wrong_at_the_start_is_named_and_moves_nothing(fault: DriveFault, said: str) -> None:
    wired = wrong_from_the_start(fault)
    wired.until(lambda: wired.drives.failed, 5.0)
    assert said in wired.drives.faults[ELBOW]
    assert not wired.drives.running
    assert wired.drives.failed
    # a setpoint of the guard's, who sits at the encoder, changes nothing
    wired.setpoint = wired.read_rad()
    wired.run(1.0)
    assert moved_deg(wired) < 0.3
    assert wired.peer.drives[wired.index(ELBOW)].state is not Power.ENABLED


def test_which_zero_would_agree_is_told() -> None:
    wired = wrong_from_the_start(DriveFault.LOST_TURNS)
    increments = round(-65536 * 40.0 / 360.0)
    told = int(wired.drives.faults[ELBOW].rpartition("= ")[2])
    assert told == pytest.approx(increments, abs=65536 / 4096)


@pytest.mark.parametrize("beyond_deg", [0.0, 3.0, 20.0])
def test_a_drive_beyond_its_software_limit_is_not_enabled(beyond_deg: float) -> None:
    plain = CanopenConfig()
    drives = plain.drives_of(Wired().skeleton)
    drives[ELBOW] = drives[ELBOW].model_copy(update={"upper_deg": 40.0 - beyond_deg})
    wired = standing(40.0, plain.model_copy(update={"drives": drives}))
    wired.start()
    wired.run(1.0)
    assert wired.drives.running == (beyond_deg == 0.0)
    assert moved_deg(wired) < 0.3
    if beyond_deg:
        assert f"stands at 40.0°, {beyond_deg:.1f}° beyond its software limits" in wired.drives.faults[ELBOW]


@pytest.mark.parametrize("rest_s", [0.0, 0.1, 0.5, 2.0])
def test_a_drive_that_moves_by_itself_in_hold_is_stopped_within_50_ms(rest_s: float) -> None:
    wired = standing(20.0)
    wired.up()
    wired.setpoint = wired.read_rad() if rest_s else None
    wired.run(rest_s)
    before, at_s = len(wired.positions), wired.now_ns / 1e9
    wired.happen(ELBOW, DriveFault.RUNS_AWAY)
    wired.until(lambda: ELBOW in wired.drives.faults, 0.5)
    course = np.array(wired.positions)[before - 1 :, wired.index(ELBOW)]
    began = int(np.flatnonzero(np.abs(course - course[0]) > np.radians(0.5))[0])
    assert (wired.now_ns / 1e9 - at_s) - began * 0.004 <= 0.05
    wired.run(1.0)
    assert "by itself" in wired.drives.faults[ELBOW]
    assert wired.peer.drives[wired.index(ELBOW)].state is Power.QUICK_STOP
    # and braked on its ramp
    assert moved_deg(wired) < 8.0
    assert moved_deg(wired, "right_elbow_pitch") < 0.5


def stopped_after_s(wired: Wired, elbow_rad_s: float, others_rad_s: float) -> float:
    """A drive runs away at 60 degrees a second while setpoints move: from when it is evident to its stop."""
    wired.up()
    rate = np.full(25, others_rad_s)
    rate[wired.index(ELBOW)] = elbow_rad_s
    wired.setpoint = wired.read_rad()
    wired.run(0.5)  # until the drives have joined it
    sent = [wired.setpoint[wired.index(ELBOW)]]
    evident_ns = 0
    for i in range(150):
        if i == 50:
            wired.happen(ELBOW, DriveFault.RUNS_AWAY)
        wired.setpoint = wired.setpoint + rate * 0.004
        sent.append(wired.setpoint[wired.index(ELBOW)])
        wired.run(0.004)
        stands, lately = wired.positions[-1][wired.index(ELBOW)], sent[-31:]
        if not evident_ns and max(min(lately) - stands, stands - max(lately)) > ASTRAY_RAD:
            evident_ns = wired.now_ns
        if ELBOW in wired.drives.faults:
            assert "against its setpoint" in wired.drives.faults[ELBOW]
            assert list(wired.drives.faults) == [ELBOW]
            # the drive may be found out before, at the margin
            return max(wired.now_ns - evident_ns, 0) / 1e9 if evident_ns else 0.0
    return np.inf


@pytest.mark.parametrize("elbow_rad_s", [0.0, 0.1, -0.1, -0.5, -1.0])
def test_a_drive_that_moves_against_its_setpoint_stops_within_50_ms(
    elbow_rad_s: float,
) -> None:
    wired = standing(20.0)
    assert stopped_after_s(wired, elbow_rad_s, 0.2) <= 0.05
    wired.run(1.0)
    assert wired.peer.drives[wired.index(ELBOW)].state is Power.QUICK_STOP


def test_without_the_astray_window_a_drive_moves_on(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("slave.encoders.uncommanded.ASTRAY_RAD", 9.0)
    assert stopped_after_s(standing(20.0), -0.1, 0.2) == np.inf


@pytest.mark.parametrize(
    "fault", [DriveFault.REVERSED, DriveFault.WRONG_GEAR, DriveFault.ENCODER_ZERO, DriveFault.POSITION_STUCK]
)
def test_what_cannot_be_seen_at_zero_is_seen_at_the_first_degrees(fault: DriveFault) -> None:
    wired = wrong_from_the_start(fault, elbow_deg=0.0)
    assert wired.drives.running
    wired.setpoint = np.zeros(25)
    wired.setpoint[wired.index(ELBOW)] = 0.6
    wired.run(2.0)
    assert wired.drives.faults[ELBOW]
    assert moved_deg(wired) < 5.0


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (DriveFault.NOT_FOLLOWING, "it does not follow its target (bit 12)"),
        (DriveFault.LIMIT_ACTIVE, "a limit of its own is active"),
        (DriveFault.LOCAL, "under local control"),
        (DriveFault.NO_VOLTAGE, "has no voltage"),
        # the other one says that it has started
        (DriveFault.DOUBLE_ID, "has restarted"),
    ],
)
def test_an_enabled_drive_that_does_not_obey_stops_within_50_ms(fault: DriveFault, said: str) -> None:
    wired = standing(20.0)
    wired.up()
    wired.run(0.5)
    wired.happen(ELBOW, fault)
    wired.run(0.068)
    assert said in wired.drives.faults[ELBOW]


def test_a_warning_is_told_and_stops_nothing() -> None:
    wired = standing(20.0)
    wired.up()
    wired.happen(ELBOW, DriveFault.WARNS)
    wired.run(0.1)
    assert dict(wired.drives.warnings) == {ELBOW: "its drive warns: something is about to fail (bit 7)"}
    assert wired.drives.running


def test_two_joints_with_one_id_in_the_drives_are_two_drives() -> None:
    """As somebody wires them: the slave's file says 5 and 6, and both are set to 5."""
    wired = Wired()
    drives = wired.config.drives_of(wired.skeleton)
    names = list(drives)
    one, other = names[3], names[4]
    drives[other] = drives[other].model_copy(update={"id": drives[one].id, "bus": drives[one].bus})
    wrongly = wired.config.model_copy(update={"drives": drives})
    wired.peer = DrivePeer(wrongly, wired.skeleton, EncoderConfig(), wired._to_slave, wired.now_ns)
    wired.start()
    wired.run(1.0)
    assert "two drives have its id" in wired.drives.faults[one]
    assert "does not answer" in wired.drives.faults[other]
    assert moved_deg(wired, one) < 0.3


def test_two_boot_ups_of_one_id_are_two_drives() -> None:
    wired = Wired()
    wired.drives.start(wired.now_ns)
    for _ in range(2):
        wired.drives.on_frame("left", 0x701, b"\x00", wired.now_ns)
    assert "two drives have its id" in wired.drives.faults["neck_yaw"]


def test_a_drive_that_took_a_while_to_change_its_mode_is_taken() -> None:
    wired = standing(20.0)
    wired.happen(ELBOW, DriveFault.WRONG_MODE)
    wired.start()
    wired.run(0.2)
    wired.happen(ELBOW, DriveFault.NONE)
    wired.until(lambda: wired.drives.running, 1.0)


def test_a_release_checks_again() -> None:
    """A drive whose count was lost while it was switched off for the e-stop."""
    wired = standing(20.0)
    wired.up()
    wired.drives.stop()
    wired.run(0.5)
    wired.happen(ELBOW, DriveFault.LOST_TURNS)
    wired.setpoint = wired.read_rad()
    wired.drives.release(wired.now_ns)
    wired._flush()
    wired.run(1.0)
    assert "its output encoder" in wired.drives.faults[ELBOW]
    assert moved_deg(wired) < 0.5


def flung() -> Wired:
    """One joint after the other is sent to and fro as fast as the guard lets it."""
    wired = standing(20.0)
    wired.up()
    skeleton, limits = wired.skeleton, GuardConfig().limits(wired.skeleton)
    limiter = SetpointLimiter(skeleton.joint_names, limits)
    limiter.seat(wired.read_rad())
    rng, target = np.random.default_rng(3), limiter.position_rad.copy()
    for i in range(1, 3000):
        if i % 60 == 1:
            joint = rng.integers(25)
            target[joint] = rng.uniform(skeleton.lower_rad[joint], skeleton.upper_rad[joint])
        limiter.step(
            i * 4_000_000, 0.004, target, np.zeros(25), np.zeros(25, np.bool_),
            limits.max_velocity_rad_s, limits.max_acceleration_rad_s2,
        )  # fmt: skip
        wired.setpoint = limiter.position_rad
        wired.run(0.004)
    return wired


@pytest.fixture
def weak_wrists(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drives that do not withstand what the other joints do to theirs: the arm throws the wrist."""
    loads = build._loads

    def by_nobody(skeleton: Skeleton, model: mujoco.MjModel) -> tuple[Array, Array, Array]:
        inertia, gravity, by_others = loads(skeleton, model)
        return inertia, gravity, np.zeros_like(by_others)

    monkeypatch.setattr(build, "_loads", by_nobody)


def test_drives_that_are_sent_to_and_fro_at_their_limits_are_believed() -> None:
    assert dict(flung().drives.faults) == {}


@pytest.mark.usefixtures("weak_wrists")
def test_a_thrown_wrist_is_believed() -> None:
    assert dict(flung().drives.faults) == {}


@pytest.mark.usefixtures("weak_wrists")
def test_without_the_patience_a_thrown_wrist_would_be_stopped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("slave.servos.canopen.watch._PATIENCE", None)
    assert "against its setpoint" in flung().drives.faults["right_wrist_yaw"]


# without what holds it off, each comes true


def test_without_the_start_check_a_lost_count_moves_the_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("slave.servos.canopen.watch.refusal", lambda *_: "")
    monkeypatch.setattr(DriveWatch, "judge", lambda *_: {})
    wired = wrong_from_the_start(DriveFault.LOST_TURNS)
    wired.setpoint = wired.read_rad()
    wired.run(4.0)
    assert moved_deg(wired) > 30.0


def test_without_the_watch_a_runaway_runs_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(DriveWatch, "judge", lambda *_: {})
    wired = standing(20.0)
    wired.up()
    wired.happen(ELBOW, DriveFault.RUNS_AWAY)
    wired.run(0.5)
    assert moved_deg(wired) > 12.0


def test_without_counting_answers_two_drives_of_one_id_look_alike(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(DriveWatch, "answered", lambda *_: "")
    monkeypatch.setattr(SetupRun, "answers_twice", lambda *_: False)
    assert "two drives" not in wrong_from_the_start(DriveFault.DOUBLE_ID).drives.faults.get(ELBOW, "")


@pytest.mark.parametrize("kept", ["answered", "answers_twice"])
def test_either_way_alone_finds_two_drives_of_one_id(monkeypatch: pytest.MonkeyPatch, kept: str) -> None:
    if kept != "answered":
        monkeypatch.setattr(DriveWatch, "answered", lambda *_: "")
    else:
        monkeypatch.setattr(SetupRun, "answers_twice", lambda *_: False)
    assert "two drives" in wrong_from_the_start(DriveFault.DOUBLE_ID).drives.faults[ELBOW]


# boundaries


def place(**changes: object) -> JointPlace:
    good: dict[str, object] = {
        "drive_rad": 0.5, "encoder_rad": 0.5, "last_known_rad": None, "limits_rad": (-1.0, 1.0),
        "increments_per_rad": 1e4, "zero_increments": 0,
    }  # fmt: skip
    return JointPlace(**(good | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize("sign", [1, -1])
def test_each_check_at_its_boundary(sign: int) -> None:
    window = np.radians(2.0)
    assert not refusal(place(encoder_rad=0.5 + sign * (window - 1e-9)), READY)
    assert refusal(place(encoder_rad=0.5 + sign * (window + 1e-9)), READY)
    at = sign * (1.0 + SLACK_RAD)
    assert not refusal(place(drive_rad=at - sign * 1e-9, encoder_rad=at), READY)
    assert refusal(place(drive_rad=at + sign * 1e-9, encoder_rad=at), READY)
    blind = {"encoder_rad": None}
    assert not refusal(place(**blind, last_known_rad=0.5 + sign * (LAST_KNOWN_RAD - 1e-9)), READY)
    assert "repair the encoder" in refusal(
        place(**blind, last_known_rad=0.5 + sign * (LAST_KNOWN_RAD + 1e-9)), READY
    )
    assert "repair the encoder" in refusal(place(**blind), READY)


@pytest.mark.parametrize("bit", [VOLTAGE, REMOTE, LIMITED, FOLLOWS])
def test_each_bit_alone_is_a_reason(bit: int) -> None:
    assert wrong_bits(GOOD) == ""
    assert wrong_bits(GOOD ^ bit)
    # before it is enabled a drive need neither follow nor have voltage
    assert bool(wrong_bits(READY & ~FOLLOWS ^ bit, enabled=False)) == (bit in (REMOTE, LIMITED))
