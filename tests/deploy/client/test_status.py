"""A robot's status: from what it sends, as plain values and as a table."""

from __future__ import annotations

import asyncio
import io
import json
import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rich.console import Console

from common.metrics.parts import Summary
from common.metrics.slave import DueMetrics, LeaseMetrics, ServoMetrics
from common.metrics.tree import to_tree
from common.skeleton import load_skeleton
from common.skeleton.load import profile_names
from common.wire.codec import encode
from common.wire.messages import BaseAttitude, RobotState
from common.wire.topics import Topic
from deploy.client.answer import RobotAnswer
from deploy.client.efforts import by_joint
from deploy.client.heard import Heard, HeardOfAll, decode_state
from deploy.client.status import OffsetStatus, RobotStatus, robot_status
from deploy.client.status_table import status_table
from tests.link_times import times_over
from tests.published import master_metrics, slave_metrics


def state(joints: int = 25, bound_ns: int = 40_000) -> RobotState:
    zeros, valid = np.zeros(joints), np.ones(joints, np.bool_)
    valid[3] = False
    base = BaseAttitude(1, math.radians(90.0), None, 0.0, math.radians(2.0))
    return RobotState(
        "robot-1", 1, 1, 1, "track", "follows anna", "anna", valid, zeros, zeros, None, 5_000_000, bound_ns,
        {"left_elbow": "over-current"}, base, 9,
    )  # fmt: skip


def status(heard: Heard) -> RobotStatus:
    return robot_status(RobotAnswer("robot-1", True, "follows anna", "track"), heard)


def heard() -> Heard:
    metrics = slave_metrics(
        lease=LeaseMetrics("anna", 9, 61.2, 0.1),
        end_to_end_ms=Summary(5, p99=31.25),
    )
    return Heard(state(), metrics)


def test_a_status_is_json_and_tells_all() -> None:
    said = json.loads(json.dumps(to_tree(status(heard()))))
    assert (said["guard"], said["reason"], said["operator"]) == ("track", "follows anna", "anna")
    assert said["faults"] == {"left_elbow": "over-current"}
    assert said["encoders_invalid"] == 1
    assert said["base"] == {
        "tilt_deg": 2.0,
        "inclination_deg": 90.0,
        "azimuth_deg": None,
        "tool_face_deg": 0.0,
    }
    assert said["offset_ms"] == {"offset": 5.0, "bound": 0.04, "trusted": True}
    assert said["lease"]["held_s"] == 61.2


def test_what_a_dead_line_would_do_is_told_by_hand_and_so_are_the_times_in_force() -> None:
    metrics = slave_metrics(times=times_over(400.0).metrics())
    said = status(Heard(replace(state(), blind_m=(0.061, 0.004), blind_s=0.41), metrics))
    assert said.blind == "if the line died now: left hand ≤ 6.1 cm, right hand ≤ 0.4 cm in 0.41 s"
    told = rendered({"robot-1": said})
    words = " ".join(told.split())
    assert "if the line died now: left hand" in words
    assert "commands may be 0.60 s old" in words
    assert "ceiling (max_age_ceiling_s) is 0.60 s" in words
    assert status(heard()).blind is None


def test_an_offset_that_is_not_trusted_has_no_bound() -> None:
    said = status(Heard(state(bound_ns=-1)))
    assert said.offset_ms == OffsetStatus(5.0, None, False)


def test_what_the_operator_does_not_hold_is_said_in_words() -> None:
    told = heard()
    told.take(master=master_metrics(switches={"deadman": "released", "clutch": "held"}))
    said = status(told)
    assert said.switches == {"deadman": "released", "clutch": "held"}
    words = rendered({"robot-1": said})
    assert "robot-1: deadman: released" in words
    assert "clutch" not in words


def test_what_the_operator_s_side_doubts_is_said_by_node() -> None:
    told = heard()
    told.take(master=master_metrics(doubts={"left_forearm": "its gyro is 5°/s off"}))
    said = status(told)
    assert said.node_doubts == {"left_forearm": "its gyro is 5°/s off"}
    assert "robot-1: node left_forearm: its gyro is 5°/s off" in rendered({"robot-1": said})


def test_with_a_lease_it_waits_for_the_master_s_figures_too() -> None:
    told = heard()
    told.take(state=state())
    assert not told.all.is_set()
    told.take(master=master_metrics())
    assert told.all.is_set()


def test_commands_that_were_due_are_counted_beside_both_figures() -> None:
    metrics = slave_metrics(
        due=DueMetrics(1000, 62),
        one_way_ms=Summary(938, p99=0.5),
        one_way_corrected_ms=Summary(1000, p99=4200.0),
    )
    said = status(Heard(state(), metrics))
    assert said.due == DueMetrics(1000, 62)
    shown = " ".join(rendered({"robot-1": said}).split())
    assert "62 of 1000 commands were not there when they were due" in shown
    assert "one way p99 0.5 ms, 4200.0 ms with them" in shown
    assert "due" not in rendered({"robot-1": status(heard())})


def test_a_robot_that_told_nothing_is_said_to_have_told_nothing() -> None:
    said = robot_status(RobotAnswer("robot-1", False, "does not answer"), Heard())
    assert said.answers is False
    assert said.faults is None
    shown = rendered({"robot-1": said})
    assert "no answer" in shown
    assert "robot-1: does not answer" in shown


def test_the_table_fits_and_says_faults_in_words() -> None:
    shown = rendered({"robot-1": status(heard()), "robot-2": status(Heard())})
    assert max(map(len, shown.splitlines())) <= 80
    row = next(line for line in shown.splitlines() if line.split()[:1] == ["robot-1"])
    assert row.split() == ["robot-1", "track", "anna", "61", "2.0", "0.040", "31.2", "2"]
    assert "robot-1: left_elbow: over-current" in shown
    assert "robot-1: encoders not heard: 1" in shown


@pytest.mark.parametrize("profile", profile_names())
def test_states_of_any_profile_are_understood(profile: str) -> None:
    decoded = decode_state(encode(state(len(load_skeleton(profile).joints))))
    assert decoded is not None
    assert decoded.lease_id == 9


def test_what_is_no_state_is_none() -> None:
    assert decode_state(b"garbage") is None
    assert decode_state(encode(state(joints=7))[:-20]) is None


def test_the_state_of_a_robot_of_ones_own_is_read_too() -> None:
    decoded = decode_state(encode(state(joints=7)))
    assert decoded is not None
    assert len(decoded.position_rad) == 7


def test_it_waits_until_both_have_come() -> None:
    async def story() -> None:
        heard = Heard()
        heard.take(metrics=slave_metrics())
        assert not heard.all.is_set()
        heard.take(state=replace(state(), operator=""))
        assert heard.all.is_set()

    asyncio.run(story())


def rendered(robots: dict[str, RobotStatus]) -> str:
    out = io.StringIO()
    Console(file=out, width=80).print(status_table(robots))
    return out.getvalue()


def test_one_of_two_of_a_name_is_shown_with_its_place() -> None:
    answer = RobotAnswer("robot-1", True, "waits", "hold", 7, "room 1")
    said = robot_status(answer, heard(), namesakes=1)
    assert (said.instance, said.place, said.namesakes) == (7, "room 1", 1)
    shown = rendered({"robot-1 00000007": said})
    assert "another robot has the same name; this one is at room 1" in " ".join(shown.split())


class Topics:
    """A link that hands over what is said on it."""

    def __init__(self) -> None:
        self.hear: dict[str, Callable[[bytes, int], None]] = {}

    def subscribe(self, topic: Topic, on_payload: Callable[[bytes, int], None]) -> None:
        self.hear[topic.name] = on_payload


def test_what_two_of_a_name_say_is_not_mixed() -> None:
    link: Any = Topics()
    told = HeardOfAll(link)
    for instance, reason in ((1, "one"), (2, "other"), (1, "one")):
        link.hear["state"](encode(replace(state(), instance=instance, reason=reason)), 0)
    assert [getattr(told.of(instance).state, "reason", None) for instance in (1, 2, 3)] == [
        "one",
        "other",
        None,
    ]


def test_efforts_are_told_by_joint_and_who_tells_none_is_named() -> None:
    effort_nm = np.zeros(25)
    effort_nm[[4, 6, 10]] = 12.34, -20.0, math.nan
    external_nm = np.full(25, math.nan)
    external_nm[4] = 3.21
    metrics = slave_metrics(
        servos=ServoMetrics(
            no_effort={"left_thumb": "so", "left_index": "so", "neck_yaw": "its drive is old"}
        )
    )
    said = status(Heard(replace(state(), effort_nm=effort_nm, external_nm=external_nm), metrics))
    names = load_skeleton("nursing").joint_names
    told = json.loads(json.dumps(to_tree(said)))["effort_nm"]
    assert (told[names[4]], told[names[6]], told[names[10]]) == (12.34, -20.0, None)
    shown = " ".join(rendered({"robot-1": said}).split())
    assert f"effort: {names[6]} -20.0, {names[4]} +12.3, {names[0]} +0.0 N m (the largest)" in shown
    assert f"from outside: {names[4]} +3.2 N m" in shown
    assert "no contact detection: left_thumb, left_index tell no effort: so" in shown
    assert "no contact detection: neck_yaw tells no effort: its drive is old" in shown


@pytest.mark.parametrize("why", ["", "contact.torque_limit is switched off"])
def test_drives_that_push_as_hard_as_they_can_are_said(why: str) -> None:
    said = status(Heard(state(), slave_metrics(servos=ServoMetrics(unlimited=why))))
    shown = " ".join(rendered({"robot-1": said}).split())
    assert (f"drives push as hard as they can: {why}" in shown) is bool(why)


def test_below_which_force_no_push_is_noticed_is_said() -> None:
    said = status(Heard(state(), slave_metrics(contact_from="no push is noticed below 31 N at the elbow")))
    assert "contact: no push is noticed below 31 N at the elbow" in rendered({"robot-1": said})
    assert "contact:" not in rendered({"robot-1": status(heard())})


def test_the_joints_whose_drives_take_no_torque_limit_are_said_with_the_reason() -> None:
    why = {"neck_yaw": "its drive is old", "left_thumb": "not asked", "left_index": "not asked"}
    said = status(Heard(state(), slave_metrics(servos=ServoMetrics(no_torque_limit=why))))
    shown = " ".join(rendered({"robot-1": said}).split())
    assert "the drive of neck_yaw may push as hard as it can: its drive is old" in shown
    assert "the drives of left_thumb, left_index may push as hard as they can: not asked" in shown
    assert json.loads(json.dumps(to_tree(said)))["no_torque_limit"] == why


def test_a_robot_whose_drives_tell_nothing_has_no_efforts() -> None:
    said = status(heard())
    assert (said.effort_nm, said.external_nm) == (None, None)
    assert "effort" not in rendered({"robot-1": said})


@pytest.mark.parametrize(("joints", "first"), [(14, "right_thumb_mpj"), (7, "joint 0")])
def test_torques_bear_the_names_of_the_profile_with_so_many_joints(joints: int, first: str) -> None:
    told = by_joint(np.zeros(joints))
    assert told is not None
    assert next(iter(told)).startswith(first)


def test_an_offer_of_the_robot_is_shown_to_both() -> None:
    offered = LeaseMetrics("anna", 9, 61.2, 0.1, offered_to="ben", offer_left_s=41.4)
    shown = rendered({"robot-1": status(Heard(state(), slave_metrics(lease=offered)))})
    assert "ben may take over within 41 s" in shown
    assert "take over" not in rendered({"robot-1": status(heard())})
