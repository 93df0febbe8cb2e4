"""Whoever sits in another's place is named, whichever two it is; a suit worn as said is not."""

import itertools
from pathlib import Path

import numpy as np
import pytest

from common.skeleton import Skeleton, load_skeleton
from master.calibrate.alignment_files import of_profile
from master.calibrate.neighbours import Fits, check_order, fit_pairs
from master.calibrate.oriented import moving, orient
from master.calibrate.recording import NodeRecording, load_recordings
from master.calibrate.zero_pose import find_zero_pose
from tests.master.calibrate.worn import wear


def fits_of(nodes: dict[str, NodeRecording], skeleton: Skeleton) -> tuple[Fits, list[tuple[int, int]]]:
    names = [n for n in skeleton.segment_names if n in nodes]
    suit = orient(nodes, names)
    units, _ = moving(suit, find_zero_pose(suit.gyr_rad_s, suit.rate_hz))
    links = [
        (names.index(s.parent), names.index(s.name))
        for s in skeleton.segments
        if s.name in names and s.parent in names
    ]
    return fit_pairs(names, units), links


def check_every_pair(fits: Fits, links: list[tuple[int, int]]) -> None:
    assert check_order(fits, links).verdict == "agrees"
    for a, b in itertools.combinations(range(len(fits.names)), 2):
        order = list(range(len(fits.names)))
        order[a], order[b] = b, a
        found = check_order(Fits(fits.names, fits.misfit_m_s2[np.ix_(order, order)]), links)
        assert found.contradicts
        assert found.advice.startswith(f"{fits.names[a]} and {fits.names[b]} seem to be exchanged")


@pytest.mark.parametrize("profile", ["nursing", "lower_limb"])
@pytest.mark.parametrize("seed", range(3))
def test_any_two_nodes_of_a_suit_that_are_exchanged_are_named(profile: str, seed: int) -> None:
    worn = wear(profile, seed)
    check_every_pair(*fits_of(worn.nodes, worn.skeleton))


@pytest.mark.parametrize("profile", ["nursing", "lower_limb"])
def test_any_two_nodes_of_a_real_person_too(profile: str, real_person: Path) -> None:
    skeleton = load_skeleton(profile)
    nodes = of_profile(load_recordings(real_person), skeleton)
    check_every_pair(*fits_of(nodes, skeleton))


def test_a_suit_of_which_nothing_moved_is_not_judged() -> None:
    none = Fits(("a", "b", "c"), np.full((3, 3), np.nan))
    assert check_order(none, [(0, 1), (1, 2)]).verdict == "not judged"
