"""How hard the robot may press in a zone, in newtons at the contact."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from common.config.load import load_config
from common.errors import ConfigError
from common.link.config import LinkConfig
from common.quaternion import Array
from common.skeleton import load_skeleton
from slave.config import SlaveConfig
from slave.contact.config import ContactConfig
from slave.contact.watch import ContactWatch
from slave.contact.zone_force import RELEASE, TOUCHES_M, ZoneForces
from slave.encoders.counts import Encoders
from slave.guard.config import GuardConfig
from slave.model.body import BodyModel
from slave.pipeline import SlavePipeline
from slave.servos.servos import EncoderReading

SKELETON = load_skeleton("nursing")
NAMES, SEGMENTS = SKELETON.joint_names, SKELETON.segment_names
BODY = BodyModel(SKELETON)
THRESHOLD_NM = ContactWatch(SKELETON, ContactConfig()).threshold_nm
LIMIT_N = 60.0
RADIUS_M = 0.05


def posture() -> Array:
    """Both arms ahead, elbows bent."""
    out = np.zeros(len(NAMES))
    for side, sign in (("left", 1.0), ("right", 1.0)):
        out[NAMES.index(f"{side}_shoulder_pitch")] = 0.6 * sign
        out[NAMES.index(f"{side}_elbow_pitch")] = 0.9
    return np.clip(out, SKELETON.lower_rad, SKELETON.upper_rad)


POSTURE = posture()


def side_of(segment: str) -> Array:
    """The point amid a right segment's outer side, base frame."""
    at = BODY.at(POSTURE)
    capsule = next(c for c in BODY.capsules if SEGMENTS[c.segment] == segment)
    out: Array = np.mean(at.ends_m(capsule), axis=0) - [0.0, capsule.radius_m, 0.0]
    return out


def push(segment: str, force_n: Array) -> Array:
    """(J,) torques of a force there."""
    jacobian = BODY.at(POSTURE).jacobian(SEGMENTS.index(segment), side_of(segment))
    out: Array = jacobian.T @ force_n
    return out


def beside(segment: str, away_m: float = 0.0, radius_m: float = RADIUS_M) -> list[float]:
    """The centre of a sphere that a segment touches from inside, or that is so far from it."""
    out: list[float] = (side_of(segment) - [0.0, radius_m + away_m, 0.0]).tolist()
    return out


HER_SHOULDER: dict[str, Any] = {
    "name": "her shoulder", "shape": "sphere", "center_m": beside("right_hand"), "radius_m": RADIUS_M,
    "enter": True, "max_force_n": LIMIT_N,
}  # fmt: skip


def forces(**zone: Any) -> ZoneForces:
    return ZoneForces(SKELETON, GuardConfig.model_validate({"zones": [{**HER_SHOULDER, **zone}]}).zones)


@pytest.mark.parametrize("direction", np.eye(3).tolist())
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("share", "stops"), [(0.95, False), (1.05, True)])
def test_at_the_limit(direction: list[float], sign: float, share: float, stops: bool) -> None:
    zone = forces()
    zone.look(POSTURE, push("right_hand", share * sign * LIMIT_N * np.array(direction)), THRESHOLD_NM)
    assert (zone.finding is not None) is stops


def test_it_says_what_presses_where_and_how_hard() -> None:
    zone = forces()
    zone.look(POSTURE, push("right_hand", np.array([80.0, 0.0, 0.0])), THRESHOLD_NM)
    assert zone.finding is not None
    assert "in the zone her shoulder: more than 60 N" in zone.finding
    assert zone.finding.startswith("right hand presses with ")
    assert 75.0 < float(zone.finding.split(" with ")[1].split()[0]) < 85.0


def test_it_lasts_until_the_force_is_well_below() -> None:
    zone = forces()
    for share, lasts in ((1.1, True), (RELEASE + 0.05, True), (RELEASE - 0.05, False), (0.9, False)):
        zone.look(POSTURE, push("right_hand", np.array([share * LIMIT_N, 0.0, 0.0])), THRESHOLD_NM)
        assert (zone.finding is not None) is lasts


@pytest.mark.parametrize(("beyond_m", "counts"), [(TOUCHES_M - 0.002, True), (TOUCHES_M + 0.002, False)])
def test_only_within_the_zone(beyond_m: float, counts: bool) -> None:
    """A zone on the outer side of the hand, its surface so far from it."""
    zone = forces(center_m=beside("right_hand", beyond_m))
    zone.look(POSTURE, push("right_hand", np.array([0.0, 0.0, 100.0])), THRESHOLD_NM)
    assert (zone.finding is not None) is counts


def test_where_it_may_not_enter_the_margin_counts() -> None:
    pushed = push("right_hand", np.array([0.0, 0.0, 100.0]))
    for margin_cm, counts in ((6.0, True), (3.0, False)):
        zone = forces(center_m=beside("right_hand", 0.05), enter=False, margin_cm=margin_cm)
        zone.look(POSTURE, pushed, THRESHOLD_NM)
        assert (zone.finding is not None) is counts


def test_a_joint_whose_torque_is_unknown_is_left_out() -> None:
    pushed = push("right_hand", np.array([0.0, 0.0, 1.1 * LIMIT_N]))
    pushed[NAMES.index("right_wrist_yaw")] = np.nan
    zone = forces()
    zone.look(POSTURE, pushed, THRESHOLD_NM)
    assert zone.finding is not None
    zone.look(POSTURE, None, THRESHOLD_NM)
    assert zone.finding is None


def test_of_two_parts_in_a_zone_the_one_that_explains_the_torques_counts() -> None:
    """The hand is deeper in it, but a force there would turn the joints otherwise."""
    zone = forces(center_m=side_of("right_hand").tolist(), radius_m=0.4)
    zone.look(POSTURE, push("right_forearm", np.array([0.0, 80.0, 0.0])), THRESHOLD_NM)
    assert zone.finding is not None
    assert "right forearm" in zone.finding


@pytest.mark.parametrize(("thresholds", "tells"), [(0.95, False), (1.05, True)])
def test_a_direction_in_which_the_limit_is_within_the_noise_says_nothing(
    thresholds: float, tells: bool
) -> None:
    torque_nm = push("right_hand", np.array([0.0, 0.0, LIMIT_N]))
    only = np.full(25, np.nan)
    shoulder = NAMES.index("right_shoulder_pitch")
    only[shoulder] = 1.5 * torque_nm[shoulder]
    jacobian = BODY.at(POSTURE).jacobian(SEGMENTS.index("right_hand"), side_of("right_hand"))
    most_nm = LIMIT_N * float(np.linalg.norm(jacobian[:, shoulder]))
    zone = forces()
    zone.look(POSTURE, only, np.full(25, most_nm / thresholds))
    assert (zone.finding is not None) is tells


def test_the_pipeline_stops_and_counts_one_contact(monkeypatch: pytest.MonkeyPatch) -> None:
    guard = GuardConfig.model_validate({"zones": [HER_SHOULDER]})
    pipeline = SlavePipeline(SlaveConfig(robot="robot-1", link=LinkConfig(), guard=guard))
    seen: list[Array] = []
    monkeypatch.setattr(pipeline.zone_forces, "look", lambda at, *_: seen.append(at))
    counts, now_ns = Encoders(SKELETON).counts(SKELETON.lower_rad * 0.0), 0

    def run(ticks: int) -> str | None:
        nonlocal now_ns
        for _ in range(ticks):
            now_ns += 5_000_000
            reading = EncoderReading(now_ns, counts, np.ones(25, np.bool_), effort_nm=np.full(25, np.nan))
            pipeline.tick(now_ns, reading)
        return pipeline._body.contact

    assert run(10) is None
    assert len(seen) == 10
    pipeline.zone_forces.finding = "presses too hard"
    assert run(10) == "presses too hard"
    assert pipeline.contact.count == 1


@pytest.mark.parametrize(
    ("backend", "limit", "said"),
    [
        ("", "max_force_n = 65.0", None),
        (
            "",
            "max_force_n = 5.0",
            r"guard\.zones\.0\.max_force_n = 5\.0: expected .*greater than or equal to 10",
        ),
        ("", "", r"guard\.zones\.0\.enter = True: expected max_speed_m_s with it, or max_force_n"),
        (
            '[servos]\nbackend = "canopen"\n[servos.canopen]\ntell_effort = false',
            "max_force_n = 65.0",
            r"guard\.zones\.0\.max_force_n = 65\.0: expected drives that tell their effort",
        ),
    ],
)
def test_as_a_site_writes_it(tmp_path: Path, backend: str, limit: str, said: str | None) -> None:
    file = tmp_path / "slave.toml"
    file.write_text(
        f'robot = "robot-1"\n[link]\nlisten = ["tcp/127.0.0.1:7447"]\n{backend}\n[[guard.zones]]\n'
        'name = "patient"\nshape = "sphere"\ncenter_m = [0.6, 0.0, 0.9]\nradius_m = 0.1\nenter = true\n'
        f"{limit}\n",
        "utf-8",
    )
    if said is None:
        assert load_config(file, SlaveConfig).guard.zones[0].max_force_n == 65.0
        return
    with pytest.raises(ConfigError, match=said):
        load_config(file, SlaveConfig)
