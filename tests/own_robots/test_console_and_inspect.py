"""The page's kinematics and `tandem inspect` take a robot that is not ours, by the folder of its profile."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from common.skeleton import load_skeleton
from common.skeleton.links import hinge_values, place_links
from deploy.cli import app
from deploy.console.model.scene import scene
from slave.model.capsules import links
from tests.browser.console.test_kinematics import NODE, placed_by_the_page
from tests.own_robots.test_export import angles_of, recorded
from tests.robots.imported import FILES, imported


@pytest.mark.skipif(NODE is None, reason="no node here: apt install nodejs")
@pytest.mark.parametrize("file", FILES)
def test_the_page_places_every_link_of_it(file: str, tmp_path: Path) -> None:
    skeleton = load_skeleton(str(imported(file)))
    postures = np.random.default_rng(1).uniform(
        skeleton.lower_rad, skeleton.upper_rad, (20, len(skeleton.joints))
    )
    origin, q = placed_by_the_page(scene(skeleton)["links"], postures, tmp_path)
    wanted = place_links(links(skeleton), hinge_values(skeleton.joints, postures))
    for i, link in enumerate(links(skeleton)):
        np.testing.assert_allclose(origin[:, i], wanted[link.name][0], rtol=0, atol=1e-6)
        np.testing.assert_allclose(q[:, i], wanted[link.name][1], rtol=0, atol=1e-6)


@pytest.mark.parametrize("file", FILES)
def test_inspect_draws_it(file: str, tmp_path: Path) -> None:
    profile = str(imported(file))
    recording = recorded(tmp_path / "own.mcap", angles_of(load_skeleton(profile)))
    words = ["inspect", str(recording), "--profile", profile, "--plots", str(tmp_path / "plots")]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output or done.exception
    assert list((tmp_path / "plots").glob("*.png"))
    assert "other joints" not in done.output


@pytest.mark.parametrize("file", FILES)
def test_another_robots_profile_is_told_in_a_line(file: str, tmp_path: Path) -> None:
    recording = recorded(tmp_path / "own.mcap", angles_of(load_skeleton(str(imported(file)))))
    done = CliRunner().invoke(app, ["inspect", str(recording)])
    words = " ".join(done.output.split())
    assert "other joints than the profile nursing (25): give the robot's own as --profile FOLDER" in words
