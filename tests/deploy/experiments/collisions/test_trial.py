"""A bounded sample of `tandem collisions`, and that it turns red without the damper."""

from __future__ import annotations

import pytest

from common.config.load import load_config
from deploy.examples.profiles import NURSING, example
from deploy.experiments.collisions.trial import CollisionTrial
from slave.config import SlaveConfig

ZONES = """guard.zones=[
  {name="bed", shape="box", center_m=[0.8, 0.0, 0.7], size_m=[0.7, 2.0, 0.4], margin_cm=4},
  {name="the patient's head", shape="sphere", center_m=[0.42, 0.3, 1.4], radius_m=0.12},
  {name="wall", shape="half_space", point_m=[0.0, 0.45, 0.0], free_side=[0.0, -1.0, 0.0]},
  {name="rail", shape="capsule", from_m=[0.45, -0.8, 1.0], to_m=[0.45, 0.8, 1.0], radius_m=0.02},
]""".replace("\n", "")


def trial(seed: int, *overrides: str, profile: str = NURSING, damped: bool = True) -> CollisionTrial:
    return CollisionTrial(load_config(example("slave", profile), SlaveConfig, overrides), seed, damped)


@pytest.mark.timeout(300)
def test_twenty_motions_among_zones() -> None:
    found = trial(1, ZONES).run(20)
    assert found.wrong == []
    assert len(found.kinds) == 5, "each kind was among them"
    assert found.held_back > 0.1 * found.ticks
    assert len(found.spare_m) == 5
    assert max(found.spare_m.values()) < 0.05, "it came near everything"


def test_the_legs_keep_apart_too() -> None:
    found = trial(3, profile="lower_limb").run(20)
    assert found.wrong == []
    assert found.held_back


def test_without_the_damper_it_collides() -> None:
    found = trial(1, ZONES, damped=False).run(20)
    assert [what for what, spare_m in found.spare_m.items() if spare_m < -0.05] == list(found.spare_m)
    assert found.wrong
