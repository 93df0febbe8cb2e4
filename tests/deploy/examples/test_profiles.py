"""The example files of every profile: they agree with their table and with each other."""

from __future__ import annotations

from typing import Any

import pytest

from common.config.load import load_config
from common.errors import ConfigError
from deploy.examples.profiles import example
from deploy.sim.suit.config import SuitConfig
from master.config import MasterConfig
from slave.config import SlaveConfig

PROFILES = ("nursing", "hand", "lower_limb")


@pytest.mark.parametrize("profile", PROFILES)
def test_the_three_files_of_a_profile_fit_together(profile: str) -> None:
    master = load_config(example("master", profile), MasterConfig)
    slave = load_config(example("slave", profile), SlaveConfig)
    suit = load_config(example("suit", profile), SuitConfig)
    assert master.profile == slave.profile == suit.profile == profile
    assert master.nodes == suit.nodes
    assert (master.capture.buses, master.capture.dbc) == (suit.buses, suit.dbc)
    assert master.commanded == [slave.robot] == [suit.robot]
    assert slave.guard.limits(slave.skeleton).lower_rad.shape == (len(slave.skeleton.joints),)


def test_a_glove_keeps_its_numbers_and_a_person_s_are_unique() -> None:
    nodes = {p: load_config(example("suit", p), SuitConfig).nodes for p in PROFILES}
    assert {name: nodes["nursing"][name] for name in nodes["hand"]} == nodes["hand"]
    person = nodes["nursing"] | nodes["lower_limb"]
    assert len({node.id for node in person.values()}) == len(person) == 43


def test_an_unknown_profile_names_those_there_are() -> None:
    with pytest.raises(
        ConfigError, match=r"profile = '\.\./hand': expected one of hand, lower_limb, nursing"
    ):
        example("master", "../hand")


@pytest.mark.parametrize(
    ("role", "override", "said"),
    [
        ("slave", "guard.joints.right_index.upper_deg=3.0", r"joints.right_index = .* a joint of hand"),
        (
            "slave",
            "guard.joints.right_index_pipj.upper_deg=120.0",
            r"guard.joints.right_index_pipj.upper_deg = 120.0: expected within the skeleton's 0 to 110",
        ),
        ("slave", "encoders.reversed=['left_elbow_pitch']", "expected a joint of the hand profile"),
        ("master", "nodes.chest={id=99, bus='suit'}", "nodes.chest = .*: expected a segment of the profile"),
        ("suit", "motion='bottle'", "motion = 'bottle': expected one of grasp, "),
        ("suit", "alignment.head=[1.0, 0.0, 0.0, 0.0]", "alignment.head = .*: expected a segment of"),
    ],
)  # fmt: skip
def test_what_another_profile_has_is_refused(role: str, override: str, said: str) -> None:
    models: dict[str, Any] = {"master": MasterConfig, "slave": SlaveConfig, "suit": SuitConfig}
    with pytest.raises(ConfigError, match=said):
        load_config(example(role, "hand"), models[role], [override])
