"""Everything of the left worn on the right is told, by limits or by where the joints' centres lie."""

from pathlib import Path

import pytest

from common.skeleton import load_skeleton
from master.calibrate.alignment import find_alignment
from master.calibrate.alignment_files import of_profile
from master.calibrate.recording import NodeRecording, load_recordings
from tests.master.calibrate.worn import wear


def exchanged(nodes: dict[str, NodeRecording]) -> dict[str, NodeRecording]:
    def other(name: str) -> str:
        if name.startswith("left_"):
            return name.replace("left_", "right_", 1)
        return name.replace("right_", "left_", 1)

    return {name: nodes[other(name)] for name in nodes}


def check(nodes: dict[str, NodeRecording], profile: str) -> None:
    found = find_alignment(exchanged(nodes), load_skeleton(profile))
    assert found.nodes == {}
    assert any("left and right seem to be exchanged" in why for why in found.refused.values())


@pytest.mark.parametrize("profile", ["nursing", "lower_limb"])
def test_exchanged_sides_are_refused(profile: str) -> None:
    check(wear(profile, 2).nodes, profile)


@pytest.mark.parametrize("profile", ["nursing", "lower_limb"])
@pytest.mark.long
def test_a_real_person_s_too(profile: str, real_person: Path) -> None:
    units = load_recordings(real_person)
    check(of_profile(units, load_skeleton(profile)), profile)
