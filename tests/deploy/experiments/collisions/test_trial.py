"""A bounded sample of `tandem collisions`, and that it turns red without the damper."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from common.config.load import load_config
from common.errors import ConfigError
from common.quaternion import Array
from deploy.examples.profiles import NURSING, example
from deploy.experiments.collisions.operator import HOME, INTO_ITSELF, motions
from deploy.experiments.collisions.progress import RunProgress
from deploy.experiments.collisions.report import CollisionReport
from deploy.experiments.collisions.trial import CollisionTrial
from deploy.measure.apart import Distances
from slave.config import SlaveConfig
from slave.limit.limit import SetpointLimiter

ZONES = """guard.zones=[
  {name="bed", shape="box", center_m=[0.8, 0.0, 0.7], size_m=[0.7, 2.0, 0.4], margin_cm=4},
  {name="the patient's head", shape="sphere", center_m=[0.42, 0.3, 1.4], radius_m=0.12},
  {name="wall", shape="half_space", point_m=[0.0, 0.45, 0.0], free_side=[0.0, -1.0, 0.0]},
  {name="rail", shape="capsule", from_m=[0.45, -0.8, 1.0], to_m=[0.45, 0.8, 1.0], radius_m=0.02},
]""".replace("\n", "")


def trial(*overrides: str, profile: str = NURSING, damped: bool = True) -> CollisionTrial:
    return CollisionTrial(load_config(example("slave", profile), SlaveConfig, overrides), damped)


@pytest.mark.timeout(300)
def test_forty_motions_among_zones() -> None:
    found = trial(ZONES).run(1, 0, 40)
    assert found.wrong == []
    assert found.motions == 40
    assert found.held_back > 0.1 * found.ticks
    assert len(found.spare_m) == 5
    assert found.spare_m["the robot"] < 0.05, "it came near itself"


def test_the_legs_keep_apart_too() -> None:
    found = trial(profile="lower_limb").run(3, 0, 120)
    assert found.wrong == []
    assert found.held_back


def test_without_the_damper_it_collides() -> None:
    found = trial(damped=False).run(1, 0, 60)
    assert found.spare_m["the robot"] < -0.05
    assert found.wrong


def test_the_operator_has_each_kind_and_every_part_is_another() -> None:
    config = load_config(example("slave", NURSING), SlaveConfig)
    limits, names = config.guard.limits(config.skeleton), config.skeleton.joint_names
    home = np.zeros(len(names))
    ways = [
        list(islice(motions(np.random.default_rng((1, part)), names, limits, home), 1000)) for part in (0, 1)
    ]
    assert {one.kind for one in ways[0]} == {HOME, "anywhere", *INTO_ITSELF}
    assert any(one.line_dies for one in ways[0])
    assert not np.array_equal(ways[0][0].position_rad, ways[1][0].position_rad)
    goals = {one.position_rad.tobytes() for one in ways[0] if one.kind != HOME}
    assert len(goals) == sum(one.kind != HOME for one in ways[0]), "each goal is a fresh one"


class Barred(SetpointLimiter):
    """Never lets the robot come all the way home: a stand-in for a wall that closes behind it."""

    def _move(self, velocity_rad_s: Array, dt_s: float) -> None:
        after = self.position_rad + velocity_rad_s * dt_s
        comes = (np.abs(after) < 0.05) & (np.abs(self.position_rad) >= 0.05)
        super()._move(np.where(comes, 0.0, velocity_rad_s), dt_s)


def test_a_robot_that_cannot_be_led_back_is_trapped(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("deploy.experiments.collisions.trial.SetpointLimiter", Barred)
    monkeypatch.setattr("deploy.experiments.collisions.operator.HOME_EVERY", 2)
    monkeypatch.setattr("deploy.experiments.collisions.operator.MOST_IN_A_ROW", 3)
    monkeypatch.setattr("deploy.experiments.collisions.trial.WAITS_S", 0.5)
    found = trial(damped=False).run(1, 0, 5)
    assert found.stuck == found.trapped > 0
    assert any("led back" in line for line in found.wrong)


def test_parts_add_up_in_any_order_and_a_run_goes_on_from_its_file(tmp_path: Path) -> None:
    run: dict[str, object] = {"robot": "a", "seed": 1}
    parts = [trial().run(1, part, 3) for part in range(2)]
    sums = []
    for order in ((0, 1), (1, 0)):
        progress = RunProgress(run, tmp_path / f"{order[0]}.json")
        for part in order:
            again = RunProgress(run, tmp_path / f"{order[0]}.json")
            again.resume()
            again.add(part, parts[part])
        progress.resume()
        assert progress.done == {0, 1}
        sums.append(progress.found)
    assert sums[0] == sums[1]
    assert sums[0].motions == 6
    assert sums[0].ticks == parts[0].ticks + parts[1].ticks


@pytest.mark.parametrize("content", ["{", "[]", '{"run": {"robot": "b"}, "parts": [], "found": {}}'])
def test_a_file_that_is_no_progress_is_refused(tmp_path: Path, content: str) -> None:
    file = tmp_path / "run.json"
    file.write_text(content)
    with pytest.raises(ConfigError, match="--resume"):
        RunProgress({"robot": "a"}, file).resume()


def test_the_file_of_another_run_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "run.json"
    RunProgress({"robot": "a"}, file).add(0, CollisionReport())
    with pytest.raises(ConfigError, match="has robot 'a', and this run has 'b'"):
        RunProgress({"robot": "b"}, file).resume()


@pytest.mark.parametrize(
    ("found", "wrong"),
    [
        (CollisionReport(spare_m={"bed": -0.0021}), "bed came 2.1 mm"),
        (CollisionReport(spare_m={"bed": -0.0019}), ""),
        (CollisionReport(beyond_limits=1), "limits were exceeded in 1 ticks"),
        (CollisionReport(stuck=3), ""),
        (CollisionReport(stuck=3, trapped=1), "led back"),
    ],
)
def test_what_counts_as_wrong(found: CollisionReport, wrong: str) -> None:
    assert bool(found.wrong) == bool(wrong)
    assert wrong in "; ".join(found.wrong)


def test_the_distances_on_a_way_are_those_of_its_postures() -> None:
    """Leaving out what cannot come near changes nothing."""
    config = load_config(example("slave", NURSING), SlaveConfig, [ZONES])
    limits, draw = config.guard.limits(config.skeleton), np.random.default_rng(5)
    distances, came_near = Distances(config.skeleton, config.guard.zones), 0
    for _ in range(12):
        a, b = draw.uniform(limits.lower_rad, limits.upper_rad, (2, len(limits.lower_rad)))
        course = a + np.linspace(0.0, 0.3, 40)[:, None] * (b - a)
        own_m, zones_m = distances.on_the_way_m(course)
        # midway a point is on the line between its places, which is 0.1 mm off the arc
        assert own_m == pytest.approx(min(0.12, distances.own_m(course).min()), abs=1e-3)
        np.testing.assert_allclose(
            zones_m, np.minimum(0.12, distances.to_zones_m(course).min(axis=0)), atol=1e-3
        )
        came_near += own_m < 0.12
    assert came_near > 2
