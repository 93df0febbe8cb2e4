"""The page places a robot's links as the skeleton's own kinematics do."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from common.quaternion import Array
from common.skeleton import load_skeleton
from common.skeleton.kinematics import orientations, origins
from common.skeleton.links import hinge_values, place_links
from common.skeleton.load import profile_names
from deploy.console.model.scene import scene
from slave.model.capsules import links

NODE = shutil.which("node")
MODULE = Path(__file__).parents[3] / "deploy" / "console" / "page" / "kinematics.js"
SCRIPT = """
const [{ placeLinks }, fs] = [await import(process.argv[1]), await import("node:fs")];
const { links, postures } = JSON.parse(fs.readFileSync(0, "utf8"));
console.log(JSON.stringify(postures.map((posture) => placeLinks(links, posture))));
"""


def placed_by_the_page(links_of_scene: object, postures: Array, folder: Path) -> tuple[Array, Array]:
    """Origins (T, L, 3) and orientations (T, L, 4) of a scene's links in postures (T, J)."""
    given = json.dumps({"links": links_of_scene, "postures": postures.tolist()})
    module = folder / "kinematics.mjs"
    shutil.copy(MODULE, module)
    command = [str(NODE), "--input-type=module", "-e", SCRIPT, str(module)]
    placed = json.loads(
        subprocess.run(command, input=given, capture_output=True, text=True, check=True).stdout
    )
    origin = np.array([[link["origin"] for link in posture] for posture in placed])
    return origin, np.array([[link["q"] for link in posture] for posture in placed])


@pytest.mark.skipif(NODE is None, reason="no node here: apt install nodejs")
@pytest.mark.parametrize("profile", profile_names())
def test_the_page_places_every_link_as_the_skeleton_does(profile: str, tmp_path: Path) -> None:
    skeleton = load_skeleton(profile)
    random = np.random.default_rng(1)
    postures = random.uniform(skeleton.lower_rad, skeleton.upper_rad, (20, len(skeleton.joints)))
    origin, q = placed_by_the_page(scene(skeleton)["links"], postures, tmp_path)
    wanted = place_links(links(skeleton), hinge_values(skeleton.joints, postures))
    for i, link in enumerate(links(skeleton)):
        np.testing.assert_allclose(origin[:, i], wanted[link.name][0], rtol=0, atol=1e-6)
        np.testing.assert_allclose(q[:, i], wanted[link.name][1], rtol=0, atol=1e-6)
    # and so do the formulas that the estimator uses, which are other ones
    by_segment = [[link.name for link in links(skeleton)].index(s.name) for s in skeleton.segments]
    q_segment = orientations(skeleton, postures)
    np.testing.assert_allclose(np.abs(np.sum(q[:, by_segment] * q_segment, axis=-1)), 1.0, rtol=0, atol=1e-9)
    np.testing.assert_allclose(origin[:, by_segment], origins(skeleton, q_segment), rtol=0, atol=1e-6)
