"""What the page is told of a robot, from messages and the time."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from common.clock import to_ns
from common.metrics.parts import Summary
from common.metrics.slave import CameraMetrics, DueMetrics
from common.wire.lease import lease_id
from common.wire.video import VideoFrame
from deploy.console.model.robot import LINK, SILENT_S, TAP, RobotModel, Side
from deploy.console.model.stopped import CONFIRM_S
from deploy.console.viewers import pack
from deploy.measure.ahead import Foretold, RobotAhead
from tests.deploy.console.robots import (
    BOUND_NS,
    JPEG,
    LEASE,
    OPERATOR,
    J,
    command,
    echo,
    frame,
    heard,
    model,
    state,
)
from tests.published import NOTHING, guard_metrics, master_metrics, slave_metrics

CAMERA = CameraMetrics(0, 0.0, 0.0, 0.0, 0, 0.0, 0, 0, 0, NOTHING, NOTHING, NOTHING, "no OpenGL")


def view(of: RobotModel, at_s: float) -> dict[str, Any]:
    """As the page reads it."""
    out: dict[str, Any] = json.loads(pack(of.view(to_ns(at_s))))
    return out


def facts(of: RobotModel, at_s: float) -> dict[str, Any]:
    out: dict[str, Any] = json.loads(pack(of.facts(to_ns(at_s))))
    return out


def test_before_anything_is_heard_the_page_knows_that_it_knows_nothing() -> None:
    shown = view(model(), 1.0)
    assert (shown["heard"], shown["situation"], shown["target"]) == ("none", "silent", None)
    assert "guard" not in shown


def test_a_robot_is_silent_after_half_a_second_and_not_before() -> None:
    robot = heard(1.0)
    assert view(robot, 1.0 + SILENT_S)["situation"] == "follows"
    late = view(robot, 1.0 + SILENT_S + 1e-6)
    assert (late["heard"], late["situation"]) == ("none", "silent")
    assert facts(robot, 2.0)["events"][-1]["text"] == "the robot is not heard"
    robot.on_state(state(2, at_s=3.0), to_ns(3.0), LINK)
    assert view(robot, 3.0)["heard"] == "link"


@pytest.mark.parametrize(
    ("guard", "operator", "situation"),
    [
        ("boot", "", "starting"),
        ("hold", "nurse-1", "holds"),
        ("align", "nurse-1", "aligns"),
        ("track", "nurse-1", "follows"),
        ("clutch", "nurse-1", "repositions"),
        ("estop", "nurse-2", "stopped"),
        ("track", "nurse-2", "other_operator"),
    ],
)
def test_each_state_has_its_word(guard: str, operator: str, situation: str) -> None:
    assert view(heard(guard=guard, operator=operator), 1.0)["situation"] == situation


def test_joints_that_are_not_known_are_null() -> None:
    valid = np.ones(J, np.bool_)
    valid[3] = False
    torque = np.full(J, 1.234)
    torque[1] = np.nan
    robot = heard(encoder_valid=valid, external_nm=torque)
    robot.on_command(command(1, 0.9, 0.95, valid=valid), to_ns(1.0))
    shown = view(robot, 1.0)
    assert shown["encoder"][2:5] == [0.0, None, 0.0]
    assert shown["target"][2:5] == [0.25, None, 0.25]
    assert shown["external_nm"][:3] == [1.23, None, 1.23]


def test_a_master_that_fell_silent_has_no_target() -> None:
    robot = heard()
    robot.on_command(command(1, 0.9, 0.95), to_ns(1.0))
    assert view(robot, 2.0)["deadman"] is True
    shown = view(robot, 2.1)
    assert (shown["master"], shown["target"], shown["deadman"]) == (False, None, None)


def test_the_lease_is_ours_only_if_it_is_the_masters_own() -> None:
    robot = heard()
    assert view(robot, 1.0)["lease"] == "ours"
    robot.on_command(command(1, 0.9, 0.95, lease=78), to_ns(1.0))
    assert view(robot, 1.0)["lease"] == "other"
    robot.on_state(state(2, operator="", lease_id=0), to_ns(1.0), TAP)
    assert view(robot, 1.0)["lease"] == "none"


def test_lateness_is_from_sampling_to_the_servos_with_its_bound() -> None:
    robot = model()
    robot.on_command(command(4, sampled_s=1.0, put_s=1.002), to_ns(1.002))
    robot.on_state(state(at_s=1.05, echo=echo(4, 1.002, 1.040, 1.043)), to_ns(1.09), TAP)
    latency = view(robot, 1.1)["latency"]
    assert latency == {
        "ms": 43.0, "bound_ms": 0.5, "trusted": True, "one_way_ms": 38.0, "round_trip_ms": 78.0
    }  # fmt: skip
    assert view(robot, 3.2)["latency"]["ms"] is None, "old"


def test_lateness_by_a_clock_that_is_not_trusted_is_not_told() -> None:
    robot = model()
    robot.on_command(command(4, 1.0, 1.002), to_ns(1.002))
    robot.on_state(state(at_s=1.05, echo=echo(4, 1.002, 1.040, 1.043), offset_bound_ns=-1), to_ns(1.09), TAP)
    latency = view(robot, 1.1)["latency"]
    assert (latency["ms"], latency["one_way_ms"], latency["trusted"]) == (None, None, False)
    assert latency["round_trip_ms"] == 78.0, "on one clock"


def test_the_last_minute_is_the_median_of_each_second() -> None:
    robot = model()
    for n in range(70 * 5):
        put_s = 10.0 + 0.2 * n
        robot.on_command(command(n, put_s - 0.002, put_s), to_ns(put_s))
        late_s = 0.04 if n % 5 else 1.0  # one of five is an outlier
        told = state(n, at_s=put_s + late_s, echo=echo(n, put_s, put_s + late_s, put_s + late_s))
        robot.on_state(told, to_ns(put_s + 0.05), TAP)
    minute = facts(robot, 80.0)["latency"]["minute"]
    assert 58 <= len(minute) <= 60
    assert {value for _, value, _ in minute} == {42.0}
    assert minute[0][0] >= -61.0
    assert minute == sorted(minute)


def test_a_picture_is_as_old_as_its_capture_by_the_robots_clock() -> None:
    robot = heard(201.0)
    robot.on_command(command(1, 200.9, 200.9), to_ns(200.9))
    assert robot.on_picture("head", frame(1, 200.9), to_ns(201.0))
    assert not robot.on_picture("head", frame(1, 200.9), to_ns(201.0)), "twice"
    assert robot.pictures.newest["head"].frame.body == JPEG
    assert view(robot, 201.0)["video"]["head"]["age_ms"] == pytest.approx(100.0)
    assert view(robot, 201.0)["video"]["head"]["bound_ms"] == pytest.approx(BOUND_NS / 1e6)
    assert not view(robot, 201.4)["video"]["head"]["stale"]
    assert view(robot, 201.41)["video"]["head"]["stale"]


def test_a_picture_whose_age_nobody_knows_is_stale_by_its_arrival() -> None:
    robot = model(side=Side.ELSEWHERE)
    robot.on_picture("head", frame(1, 200.9), to_ns(1.0))
    assert view(robot, 1.5)["video"]["head"] == {"age_ms": None, "bound_ms": None, "fps": 0.5, "stale": False}
    assert view(robot, 1.51)["video"]["head"]["stale"]


def test_one_camera_that_freezes_does_not_freeze_the_others() -> None:
    robot = heard(201.0)
    robot.on_picture("head", frame(1, 200.9), to_ns(201.0))
    robot.on_picture("hand", frame(1, 200.9), to_ns(201.0))
    robot.on_picture("hand", frame(2, 201.9), to_ns(202.0))
    robot.on_state(state(2, at_s=202.0), to_ns(202.0), TAP)
    video = view(robot, 202.0)["video"]
    assert (video["head"]["stale"], video["hand"]["stale"]) == (True, False)


def test_the_three_lights_of_a_stop_come_one_after_the_other() -> None:
    robot = heard(1.0)
    robot.asked_to_stop(1, "nurse-1", to_ns(1.0))
    assert view(robot, 1.0)["stop"]["robot_s"] is None
    moving = np.zeros(J)
    for n in range(100):
        at_s = 1.02 + 0.02 * n
        moving[4] += 0.01 if at_s < 1.4 else 0.0
        told = state(2 + n, at_s=at_s, guard="estop", reason="stopped by nurse-1", position_rad=moving.copy())
        robot.on_state(told, to_ns(at_s), TAP)
    stop = view(robot, 3.0)["stop"]
    assert stop["robot_s"] == pytest.approx(0.02)
    assert stop["stands_s"] == pytest.approx(0.4 + 0.3, abs=0.05), "still for 0.3 s after the last motion"
    assert stop["text"] == "stopped by nurse-1"
    robot.on_state(state(500, at_s=4.0, guard="hold"), to_ns(4.0), TAP)
    assert view(robot, 4.0)["stop"] is None, "it was reset"


def test_a_robot_that_moves_on_is_never_said_to_stand() -> None:
    robot = heard(1.0)
    robot.asked_to_stop(1, "nurse-1", to_ns(1.0))
    for n in range(100):
        slow = np.full(J, np.radians(0.6) * 0.02 * n)
        told = state(2 + n, at_s=1.0 + 0.02 * n, guard="estop", position_rad=slow)
        robot.on_state(told, to_ns(1.0 + 0.02 * n), TAP)
    assert view(robot, 3.0)["stop"]["stands_s"] is None


@pytest.mark.parametrize("valid", [False, None])
def test_encoders_that_are_not_read_do_not_stand(valid: bool | None) -> None:
    robot = heard(1.0)
    robot.asked_to_stop(1, "nurse-1", to_ns(1.0))
    for n in range(100):
        at_s = 1.0 + 0.02 * n
        mask = np.full(J, n % 2 == 0 if valid is None else valid)  # None: it comes and goes
        robot.on_state(state(2 + n, at_s=at_s, guard="estop", encoder_valid=mask), to_ns(at_s), TAP)
    assert view(robot, 3.0)["stop"]["stands_s"] is None


def test_what_the_encoders_said_before_the_stop_is_no_standstill() -> None:
    robot = model()
    for n in range(50):
        robot.on_state(state(1 + n, at_s=1.0 + 0.02 * n), to_ns(1.0 + 0.02 * n), TAP)
    robot.asked_to_stop(1, "nurse-1", to_ns(2.0))
    frozen = state(99, at_s=1.98, guard="estop")
    robot.on_state(frozen, to_ns(2.1), TAP)
    assert view(robot, 2.1)["stop"]["stands_s"] is None
    robot.on_state(state(100, at_s=2.12, guard="estop"), to_ns(2.12), TAP)
    assert view(robot, 2.2)["stop"]["stands_s"] == pytest.approx(0.12)


def test_a_stop_that_no_state_told_of_is_not_the_next_one() -> None:
    robot = heard(1.0)
    stop = robot.asked_to_stop(1, "nurse-1", to_ns(1.0))
    stop.robot_ns = to_ns(1.5)
    assert robot.asked_to_stop(2, "nurse-1", to_ns(1.5 + CONFIRM_S)) is stop
    again = robot.asked_to_stop(3, "nurse-1", to_ns(1.5 + CONFIRM_S) + 1)
    assert again is not stop
    assert again.robot_ns is None
    again.failed = "no answer"
    assert robot.asked_to_stop(4, "nurse-1", to_ns(3.0), under_way=True) is again


def test_a_robot_that_is_stopped_has_one_stop_until_it_is_reset() -> None:
    robot = heard(1.0)
    first = robot.asked_to_stop(1, "nurse-1", to_ns(1.0))
    assert robot.asked_to_stop(2, "somebody", to_ns(1.1)) is first, "the same stop, under way"
    robot.on_state(state(2, at_s=1.2, guard="estop"), to_ns(1.2), TAP)
    assert robot.asked_to_stop(3, "somebody", to_ns(1.3)) is first
    assert view(robot, 1.4)["stop"]["robot_s"] == pytest.approx(0.2)
    robot.on_state(state(3, at_s=1.5, guard="hold"), to_ns(1.5), TAP)
    assert robot.asked_to_stop(4, "somebody", to_ns(1.6)) is not first
    failed = robot.asked_to_stop(5, "somebody", to_ns(1.7))
    failed.failed = "no answer"
    assert robot.asked_to_stop(6, "somebody", to_ns(1.8)) is not failed


def test_a_state_that_left_before_the_stop_ends_none() -> None:
    robot = heard(1.0)
    stop = robot.asked_to_stop(1, "nurse-1", to_ns(1.0))
    stop.robot_ns = to_ns(1.003)  # its answer came
    robot.on_state(state(2, at_s=1.001), to_ns(1.004), TAP)
    assert robot.stop is stop
    robot.on_state(state(3, at_s=0.9, guard="estop"), to_ns(0.9), TAP)
    assert not stop.in_state, "older than the asking"


def test_a_command_that_was_not_written_yet_has_no_lateness() -> None:
    robot = model()
    robot.on_command(command(4, 201.0, 201.002), to_ns(201.002))
    not_written = replace(echo(4, 201.002, 201.040, 201.043), written_ns=0)
    robot.on_state(state(at_s=201.05, echo=not_written), to_ns(201.09), TAP)
    latency = view(robot, 201.1)["latency"]
    assert (latency["ms"], latency["one_way_ms"]) == (None, 38.0)


def test_a_command_that_is_told_of_before_it_is_written_has_its_lateness_once_it_is() -> None:
    robot = model()
    robot.on_command(command(4, 201.0, 201.002), to_ns(201.002))
    whole = echo(4, 201.002, 201.040, 201.043)
    robot.on_state(state(at_s=201.041, echo=replace(whole, written_ns=0)), to_ns(201.08), TAP)
    robot.on_state(state(2, at_s=201.06, echo=whole), to_ns(201.09), TAP)
    assert view(robot, 201.1)["latency"]["ms"] == 43.0


def test_commands_that_are_not_written_are_in_no_figure_of_the_minute() -> None:
    robot = model()
    for n in range(300):
        put_s = 201.0 + 0.1 * n
        holds = 100 <= n < 200
        robot.on_command(command(n, put_s - 0.002, put_s), to_ns(put_s))
        told = echo(n, put_s, put_s + 0.01, put_s + 0.04)
        told = replace(told, written_ns=0) if holds else told
        robot.on_state(state(n, at_s=put_s + 0.04, echo=told), to_ns(put_s + 0.05), TAP)
    minute = facts(robot, 231.5)["latency"]["minute"]
    late = [value for _, value, _ in minute]
    assert set(late) == {42.0, None}, "never the way of 10 ms alone"
    assert 9 <= late.count(None) <= 11, "a curve has its gap"


def test_stages_of_a_robot_that_fell_silent_are_not_shown() -> None:
    robot = heard(1.0)
    robot.on_robot(slave_metrics(stages_ms={"put→received": Summary(1)}), to_ns(1.0))
    assert facts(robot, 4.0)["latency"]["stages"]
    assert not facts(robot, 4.1)["latency"]["stages"]


def test_a_limit_that_is_met_every_second_is_one_event() -> None:
    robot = heard(1.0)
    for second in range(40):
        met = second if second < 15 else 15 if second < 30 else second
        robot.on_robot(slave_metrics(guard=guard_metrics(clamps={"velocity": met})), to_ns(1.0 + second))
    clamps = [event for event in facts(robot, 41.0)["events"] if event["what"] == "clamp"]
    assert [event["age_s"] for event in clamps] == [39.0, 10.0]


def test_a_camera_from_which_nothing_came_is_shown() -> None:
    robot = heard(1.0)
    assert view(robot, 1.0)["video"] == {}
    robot.on_robot(slave_metrics(video=CAMERA), to_ns(1.0))
    assert view(robot, 1.0)["video"]["head"]["age_ms"] is None
    assert view(robot, 1.0)["video"]["head"]["stale"]


def test_holds_clamps_and_losses_are_events() -> None:
    robot = heard(1.0)
    robot.on_robot(slave_metrics(), to_ns(1.0))
    robot.on_state(state(2, at_s=1.1, guard="hold", reason="commands are late"), to_ns(1.1), TAP)
    robot.on_robot(
        slave_metrics(guard=guard_metrics(clamps={"velocity": 3}, losses={"command": 1})), to_ns(2.0)
    )
    events = facts(robot, 2.0)["events"]
    assert [event["what"] for event in events] == ["state", "hold", "clamp", "loss"]
    assert events[1] == {"id": 2, "age_s": 0.9, "what": "hold", "text": "hold: commands are late"}
    assert events[2]["text"] == "the motion is limited: velocity"


@pytest.mark.parametrize(("missing", "word"), [(0, "good"), (1, "fair"), (10, "poor")])
def test_the_link_is_judged_by_the_last_second_alone(missing: int, word: str) -> None:
    robot = heard(1.0)
    robot.on_robot(slave_metrics(due=DueMetrics(1000, 500)), to_ns(1.0))
    assert facts(robot, 1.0)["link"]["word"] == "unknown"
    robot.on_robot(slave_metrics(due=DueMetrics(1050, 500 + missing)), to_ns(2.0))
    assert facts(robot, 2.0)["link"]["word"] == word
    assert facts(robot, 5.1)["link"]["word"] == "unknown", "old"


def test_figures_of_a_robot_that_started_anew_are_compared_with_nothing() -> None:
    robot = heard(1.0)
    robot.on_robot(slave_metrics(instance=1, guard=guard_metrics(clamps={"velocity": 3})), to_ns(1.0))
    robot.on_robot(slave_metrics(instance=2, guard=guard_metrics(clamps={"velocity": 9})), to_ns(2.0))
    assert [event["what"] for event in facts(robot, 2.0)["events"]] == ["state"]


def test_the_masters_figures_reach_the_page_and_grow_old() -> None:
    robot = heard(1.0)
    robot.on_master(master_metrics(nodes={"left_hand": {"fresh": 200}}), to_ns(1.0))
    shown = facts(robot, 1.0)
    assert shown["switches"] == {"deadman": "always held"}
    assert {n["name"]: n["level"] for n in shown["nodes"]}["left_hand"] == "ok"
    old = facts(robot, 4.1)
    assert old["switches"] == {}
    assert {n["level"] for n in old["nodes"]} == {"unknown"}


def test_a_latency_that_creeps_is_an_alarm_once_long_before_a_hold() -> None:
    robot = model()
    for second in range(700):
        put_s, late_s = 10.0 + second, 0.04 + 0.00002 * second
        told = state(second, at_s=put_s + late_s, echo=echo(second, put_s, put_s + late_s, put_s + late_s))
        robot.on_state(told, to_ns(put_s + 0.1), TAP)
        view(robot, put_s + 0.1)
    shown = facts(robot, put_s + 0.1)
    assert shown["latency"]["creep"]["alarm"] is True
    assert shown["latency"]["creep"]["ms_per_min"] == pytest.approx(1.2)
    alarms = [event for event in shown["events"] if event["what"] == "alarm"]
    assert len(alarms) == 1
    assert "12 ms in ten minutes" in alarms[0]["text"]


def test_beside_the_robot_both_read_one_clock() -> None:
    robot = model(side=Side.ROBOT)
    own = state(at_s=301.0)
    robot.on_state(own, own.sent_ns, TAP)
    taken = VideoFrame(1, own.sent_ns - to_ns(0.1), own.sent_ns, 320, 240, JPEG)
    robot.on_picture("head", taken, own.sent_ns)
    shown = json.loads(pack(robot.view(own.sent_ns)))
    assert (shown["situation"], shown["video"]["head"]["age_ms"]) == ("follows", 100.0)
    assert shown["video"]["head"]["bound_ms"] == 0.0


def test_another_operators_clock_dates_nothing_here() -> None:
    robot = heard(201.0)
    robot.on_picture("head", frame(1, 200.9), to_ns(201.0))
    assert robot.offset(to_ns(201.0)) is None, "whose clock it is was not heard yet"
    robot.on_command(command(1, 200.9, 200.9), to_ns(200.9))
    assert robot.offset(to_ns(201.0)) is not None
    others = {"operator": "nurse-2", "lease_id": lease_id(LEASE + 1), "master_offset_ns": to_ns(5000.0)}
    late = echo(7, 201.0, 201.0, 201.0)
    robot.on_state(state(2, 201.02, echo=late, **others), to_ns(201.02), TAP)
    assert robot.offset(to_ns(201.02)) is None
    seen = view(robot, 201.02)
    assert seen["video"]["head"]["age_ms"] is None
    assert seen["latency"]["round_trip_ms"] is None
    robot.on_state(state(3, 201.04, operator=OPERATOR, lease_id=0), to_ns(201.04), TAP)
    assert robot.offset(to_ns(201.04)) is None, "nobody holds the lease: whose clock is it?"


def test_the_robots_own_console_needs_no_offset() -> None:
    robot = model(Side.ROBOT)
    offset = robot.offset(to_ns(1.0))
    assert offset is not None
    assert offset.offset_ns == 0


@pytest.mark.parametrize(("way_ms", "foretold"), [(19.9, False), (20.0, True)])
def test_the_robot_is_foretold_on_a_long_line_only(
    way_ms: float, foretold: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = heard()
    robot.on_command(command(1, 0.9, 0.95), to_ns(1.0))
    found = Foretold(to_ns(1.0), np.zeros(J), np.zeros(J), np.zeros(J), to_ns(0.03))
    monkeypatch.setattr(RobotAhead, "way_ns", property(lambda _: to_ns(way_ms / 1e3)))
    monkeypatch.setattr(RobotAhead, "foretell", lambda _, now_ns: found)
    shown = view(robot, 1.0)["ahead"]
    assert (shown is not None) is foretold
