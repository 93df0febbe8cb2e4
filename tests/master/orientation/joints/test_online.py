"""The whole estimate: what a suit's joints make of a disturbed magnetic field, and of none at all."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from common.quaternion import IDENTITY, Array, angle_between, from_axis_angle, heading_turn, multiply
from common.skeleton import Skeleton, load_skeleton
from common.wire.messages import Mask
from deploy.sim.suit.motion import load_motion
from master.orientation.joints.online import OnlineConfig, OnlineHeadings

SECONDS = 16.5
LIMBS = [f"{side}_{limb}" for side in ("left", "right") for limb in ("forearm", "hand", "shank")]
TOOL = {"local": [{"nodes": LIMBS, "from_s": 5.0, "ramp_s": 1.0, "field_ut": [25.0, 0.0, -10.0]}]}
"""Known by the field's strength and dip."""
TURNED = {"local": [{"nodes": LIMBS, "from_s": 5.0, "ramp_s": 1.0, "turn_deg": 40.0}]}
CREEPING = {"local": [{"nodes": LIMBS, "from_s": 4.0, "ramp_s": 12.0, "turn_deg": 40.0}]}
"""Neither by these nor by a sudden change: only other nodes give them away."""
RAIL = {"dipole": [{"position_m": [0.6, 0.0, 0.7], "moment_a_m2": [0.0, 20.0, 0.0]}]}
"""There from the beginning; a zero pose tells the headings with which to begin."""

BENT = from_axis_angle([0.0, -1.0, 0.0], np.radians(80.0))
"""A forearm before the upper arm that hangs: its floating axis stands upright."""


def of_all(names: list[str], skeleton: Skeleton) -> Mask:
    return np.isin(skeleton.segment_names, names)


@pytest.mark.parametrize(
    ("profile", "motion", "disturbances", "joints"),
    [
        ("nursing", "bottle", (TOOL, CREEPING), ("elbow", "index")),
        ("lower_limb", "walk", (TURNED,), ("knee", "ankle")),
    ],
)
def test_a_disturbed_field_leaves_the_joints_as_they_were(
    wear: Any, profile: str, motion: str, disturbances: tuple[dict[str, Any], ...], joints: tuple[str, ...]
) -> None:
    skeleton = load_skeleton(profile)
    moves = load_motion(motion, skeleton)
    quiet = wear(skeleton, moves, SECONDS, constraints="online")
    assert quiet.rmse_deg(joints[0]) < 0.5
    for disturbance in disturbances:
        disturbed = wear(skeleton, moves, SECONDS, disturbance=disturbance, constraints="online")
        for joint in joints:
            assert disturbed.rmse_deg(joint) < 1.2 * quiet.rmse_deg(joint)
    off = wear(skeleton, moves, SECONDS, disturbance=disturbances[0], constraints="off")
    assert off.rmse_deg(joints[0]) > 3.0 * quiet.rmse_deg(joints[0])


def test_a_bed_s_rail_that_was_always_there(wear: Any, arms: Skeleton) -> None:
    sway = Sway(arms)
    # one degree askew, so that the alignment counts as known
    alignment = np.tile(from_axis_angle([0.0, 0.0, 1.0], np.radians(1.0)), (5, 1))
    keys = {"zero_pose_s": 1.0, "q_sensor_from_segment": alignment}
    quiet, online, off = (
        wear(arms, sway, 25.0, disturbance=room, constraints=constraints, **keys)
        for room, constraints in (({}, "online"), (RAIL, "online"), (RAIL, "off"))
    )
    assert online.rmse_deg("elbow") < 1.2 * quiet.rmse_deg("elbow")
    assert off.rmse_deg("elbow") > 2.0 * quiet.rmse_deg("elbow")


@pytest.mark.long
def test_arms_without_magnetometers_worn_askew(wear: Any, arms: Skeleton) -> None:
    """A zero pose gives the headings; the joints keep them while the gyros' biases drift."""
    askew = Rotation.random(5, rng=3).as_quat(scalar_first=True)
    phase = np.arange(15.0).reshape(5, 3)

    def bias(t_s: float) -> Array:
        drift: Array = np.radians(0.15) * np.sin(2.0 * np.pi * t_s / 100.0 + phase)
        return drift

    online, off = (
        wear(
            arms,
            Sway(arms),
            100.0,
            magnetometers=False,
            q_sensor_from_segment=askew,
            bias_rad_s=bias,
            zero_pose_s=1.0,
            constraints=constraints,
        )
        for constraints in ("online", "off")
    )
    thirds = [worn.rmse_deg("elbow", from_s=67.0) for worn in (online, off)]
    assert online.rmse_deg("elbow") < 1.5
    assert thirds[0] < 1.5
    assert thirds[1] > 4.0 * thirds[0]


def test_a_wrong_heading_is_found_by_a_bent_elbow(arms: Skeleton) -> None:
    """Both arms held ahead, elbows bent: the forearms' floating axes stand upright."""
    online = OnlineHeadings(OnlineConfig(), arms, 200.0)
    nodes, field = np.ones(5, dtype=np.bool_), np.full((5, 3), np.nan)
    truth = np.stack([IDENTITY, IDENTITY, BENT, IDENTITY, BENT])
    wrong = multiply(heading_turn(np.radians([0.0, 0.0, 8.0, 0.0, -8.0])), truth)
    for _ in range(500):
        online.correct(wrong, field, np.tile(IDENTITY, (5, 1)), nodes)
    q = multiply(online.turn, wrong)
    for upper, fore in ((1, 2), (3, 4)):
        between = angle_between(multiply(q[upper], BENT), q[fore])
        assert np.degrees(between) < 0.2


@pytest.mark.parametrize("left_usable", [True, False])
def test_a_node_that_is_not_usable_neither_corrects_nor_is_corrected(
    arms: Skeleton, left_usable: bool
) -> None:
    online = OnlineHeadings(OnlineConfig(), arms, 200.0)
    others = ["chest", "left_upper_arm", "right_upper_arm", "right_forearm"]
    usable = of_all([*others, "left_forearm"] if left_usable else others, arms)
    # elbows bent, as above: a heading shows
    q = np.stack([IDENTITY, IDENTITY, BENT, IDENTITY, BENT])
    q = multiply(heading_turn(np.radians([0.0, 0.0, 8.0, 0.0, 0.0])), q)
    for _ in range(50):
        online.correct(q, np.full((5, 3), np.nan), np.tile(IDENTITY, (5, 1)), usable)
    turned = angle_between(online.turn, np.tile(IDENTITY, (5, 1)))
    assert turned[[0, 3, 4]].max() < 1e-7
    assert (turned[1:3] > 0.01).all() if left_usable else turned[1:3].max() < 1e-7


def test_an_error_no_heading_explains_counts_like_a_small_one(arms: Skeleton) -> None:
    """Of headings known to 2° from a zero pose, one cannot be 60° off: then the alignment is wrong."""
    found_rad = []
    for off_deg in (6.0, 60.0):
        online = OnlineHeadings(OnlineConfig(), arms, 200.0)
        nodes, alignment = np.ones(5, dtype=np.bool_), np.tile(IDENTITY, (5, 1))
        online.stand(nodes, np.zeros(5), alignment, np.full((5, 3), np.nan))
        q = np.stack([IDENTITY, IDENTITY, BENT, IDENTITY, BENT])
        q = multiply(heading_turn(np.radians([0.0, 0.0, off_deg, 0.0, 0.0])), q)
        online.correct(q, np.full((5, 3), np.nan), alignment, nodes)
        found_rad.append(angle_between(online.turn, alignment)[2])
    assert found_rad[0] > 1e-4
    assert found_rad[1] < 3.0 * found_rad[0]


def test_a_returning_node_begins_with_its_heading_or_its_field_s(arms: Skeleton) -> None:
    online = OnlineHeadings(OnlineConfig(), arms, 200.0)
    one = of_all(["left_forearm"], arms)
    held = multiply(heading_turn(np.full(5, 0.7)), np.tile(IDENTITY, (5, 1)))
    online.lose(one, held)
    online.find(one, np.tile(IDENTITY, (5, 1)), np.full(5, np.nan))
    assert angle_between(online.turn, heading_turn(0.7 * one)).max() < 1e-7
    online.find(one, np.tile(IDENTITY, (5, 1)), np.full(5, -0.4))
    assert angle_between(online.turn, heading_turn(-0.4 * one)).max() < 1e-7
    assert np.degrees(np.sqrt(online._headings.variance[2])) == pytest.approx(10.0)


class Sway:
    """Stands for 3.5 s, then all joints swing without a rest."""

    period_s = float("inf")

    def __init__(self, skeleton: Skeleton) -> None:
        rng = np.random.default_rng(0)
        self._middle = 0.5 * (skeleton.lower_rad + skeleton.upper_rad)
        self._reach = 0.3 * (skeleton.upper_rad - skeleton.lower_rad)
        self._speed = rng.uniform(0.5, 1.5, len(self._middle))
        self._phase = rng.uniform(0.0, 6.0, len(self._middle))

    def state(self, t_s: float) -> tuple[Array, Array, Array]:
        u = np.clip((t_s - 3.5) / 3.0, 0.0, 1.0)
        rise = (u**3 * (10.0 - 15.0 * u + 6.0 * u**2), 10.0 * (u * (1.0 - u)) ** 2)
        bend = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / 9.0
        swing = self._reach * np.sin(self._speed * t_s + self._phase)
        rate = self._speed * self._reach * np.cos(self._speed * t_s + self._phase)
        push = -(self._speed**2) * swing
        at = self._middle + swing
        return rise[0] * at, rise[0] * rate + rise[1] * at, rise[0] * push + 2.0 * rise[1] * rate + bend * at
