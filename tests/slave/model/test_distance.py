"""Distances, which pairs are looked at, and what each joint does to them, against closed formulas."""

import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import load_skeleton
from deploy.measure.apart import Distances
from slave.guard.zones import BoxZone, CapsuleZone, HalfSpaceZone, SphereZone, Zone, distance_model
from slave.model.distance import REACH_M, DistanceModel, NearPairs
from slave.model.pairs import groups

SKELETON = load_skeleton("nursing")
J = len(SKELETON.joints)
ZONES: list[Zone] = [
    BoxZone(
        name="bed",
        shape="box",
        center_m=[0.55, 0.1, 1.0],
        size_m=[0.3, 0.4, 0.3],
        yaw_deg=30.0,
        margin_cm=0.0,
    ),
    SphereZone(name="head", shape="sphere", center_m=[0.4, -0.5, 1.3], radius_m=0.12, margin_cm=0.0),
    CapsuleZone(
        name="rail",
        shape="capsule",
        from_m=[0.3, 0.5, 1.2],
        to_m=[0.3, 0.9, 1.2],
        radius_m=0.1,
        margin_cm=0.0,
    ),
    HalfSpaceZone(name="wall", shape="half_space", point_m=[-0.3, 0.0, 0.0], free_side=[2.0, 0.0, 0.0]),
]


def postures(count: int, seed: int) -> Array:
    rng = np.random.default_rng(seed)
    return rng.uniform(SKELETON.lower_rad, SKELETON.upper_rad, (count, J))


def nearest(model: DistanceModel, near: NearPairs, owner: int) -> float:
    return float(near.distance_m[model.obstacle[near.pair] == owner].min(initial=np.inf))


def test_distances_are_those_of_closed_formulas() -> None:
    model, judge = distance_model(SKELETON, 0.0, ZONES), Distances(SKELETON, ZONES)
    course = postures(150, seed=2)
    own, zones = judge.own_m(course), judge.to_zones_m(course)
    compared = 0
    for k, posture in enumerate(course):
        near = model.near(posture)
        for owner, expected in enumerate((own[k], *zones[k]), start=-1):
            if 0.0 < expected < REACH_M:
                assert nearest(model, near, owner) == pytest.approx(
                    expected, abs=1e-5
                )  # MuJoCo's boxes: iterated
                compared += 1
            elif expected >= REACH_M:
                assert nearest(model, near, owner) >= REACH_M
            elif expected <= 0.0:
                assert nearest(model, near, owner) <= 1e-9
    assert compared > 100


def test_gradients_are_those_of_finite_differences() -> None:
    model = distance_model(SKELETON, 0.0, ZONES)
    rng, step, compared = np.random.default_rng(5), 1e-6, 0
    for posture in postures(20, seed=6):
        rate = rng.normal(size=J)
        ahead, behind = (model.near(posture + h * rate) for h in (step, -step))
        near = model.near(posture)
        gradient = model.gradient(np.arange(len(near.pair)))
        once, counts = np.unique(near.pair, return_counts=True)
        for k in np.flatnonzero(np.isin(near.pair, once[counts == 1]) & (near.distance_m > 1e-3)).tolist():
            pair = near.pair[k]
            apart = [each.distance_m[each.pair == pair] for each in (ahead, behind)]
            if all(len(each) == 1 for each in apart):
                expected = (apart[0][0] - apart[1][0]) / (2.0 * step)
                assert gradient[k] @ rate == pytest.approx(expected, abs=1e-3)
                compared += 1
    assert compared > 100


def test_no_pair_changes_faster_than_its_levers_say() -> None:
    model = distance_model(SKELETON, 0.0, ZONES)
    for posture in postures(60, seed=8):
        near = model.near(posture)
        gradient = np.abs(model.gradient(np.arange(len(near.pair))))
        assert (gradient <= model.levers_m[model.kind[near.pair]] + 1e-9).all()


def test_a_hand_is_one_group_and_what_hangs_together_is_no_pair() -> None:
    group = dict(zip(SKELETON.segment_names, groups(SKELETON), strict=True))
    assert group["left_index_distal"] == group["left_thumb_proximal"] == group["left_hand"] == "left_hand"
    assert group["left_forearm"] == "left_forearm"
    names = {tuple(sorted(pair)) for pair in distance_model(SKELETON, 2.0, []).names}
    for near in (
        ("chest", "head"),
        ("chest", "left upper arm"),
        ("left forearm", "left hand"),
        ("chest", "stand"),
    ):
        assert near not in names
    for apart in (
        ("left hand", "right hand"), ("head", "left hand"), ("chest", "left forearm"), ("left hand", "stand"),
        ("left forearm", "right forearm"), ("left hand", "left upper arm"),
    ):  # fmt: skip
        assert apart in names


def test_a_hand_alone_has_nothing_to_meet_and_legs_have_each_other() -> None:
    assert distance_model(load_skeleton("hand"), 2.0, []).names == []
    legs = distance_model(load_skeleton("lower_limb"), 2.0, []).names
    assert ("right shank", "left thigh") in legs
    assert ("right foot", "left foot") in legs


def test_no_pair_comes_together_faster_than_its_closing_speed() -> None:
    """Whichever joints turn, how fast; a body that is moved as a whole does not make the bound useless."""
    model, rng, step_s = distance_model(SKELETON, 0.0, ZONES), np.random.default_rng(4), 1e-5
    tight = 0.0
    for posture in postures(40, seed=7):
        rate = rng.normal(0.0, 1.0, J) * (rng.random(J) < 0.3)
        model.pose(posture)
        most_m_s = model.closing_m_s(rate)
        before, after = (model.near(posture + share * rate * step_s) for share in (0.0, 1.0))
        first, then = (np.full(len(model.names), np.inf) for _ in range(2))
        np.minimum.at(first, before.pair, before.distance_m)
        np.minimum.at(then, after.pair, after.distance_m)
        both = np.isfinite(first) & np.isfinite(then)
        closing_m_s = (first[both] - then[both]) / step_s
        assert (closing_m_s <= most_m_s[both] + 1e-3).all()
        tight = max(tight, float((closing_m_s / np.maximum(most_m_s[both], 1e-9)).max()))
    assert tight > 0.5
