"""The tube round the foretold robot: as thick as its joints are uncertain, at their distance."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from common.skeleton import load_skeleton
from deploy.console.model.scene import scene
from slave.model.capsules import links as body_links

NODE = shutil.which("node")
PAGE = Path(__file__).parents[3] / "deploy" / "console" / "page"
SCRIPT = """
const { tubes } = await import(process.argv[1] + "/ahead.js");
const { placeLinks } = await import(process.argv[1] + "/kinematics.js");
const fs = await import("node:fs");
const { links, postures } = JSON.parse(fs.readFileSync(0, "utf8"));
const found = postures.map(({ angles, tube }) => tubes(links, placeLinks(links, angles), tube));
console.log(JSON.stringify(found));
"""
pytestmark = pytest.mark.skipif(NODE is None, reason="no node here: apt install nodejs")


def radii(tubes_rad: list[list[float]], tmp_path: Path) -> list[list[float]]:
    links = scene(load_skeleton("nursing"))["links"]
    (tmp_path / "package.json").write_text('{"type": "module"}')
    for name in ("ahead.js", "kinematics.js"):
        shutil.copy(PAGE / name, tmp_path)
    postures = [{"angles": [0.0] * len(tube), "tube": tube} for tube in tubes_rad]
    command = [str(NODE), "--input-type=module", "-e", SCRIPT, str(tmp_path)]
    given = json.dumps({"links": links, "postures": postures})
    done = subprocess.run(command, input=given, capture_output=True, text=True, check=True)
    found: list[list[float]] = json.loads(done.stdout)
    return found


def test_it_grows_along_the_arm_and_with_the_uncertainty(tmp_path: Path) -> None:
    skeleton = load_skeleton("nursing")
    joint = next(i for i, name in enumerate(skeleton.joint_names) if "left_shoulder" in name)
    count = len(skeleton.joints)
    one = [math.radians(2.0) if j == joint else 0.0 for j in range(count)]
    names = [link.name for link in body_links(skeleton)]
    none, small, twice = radii([[0.0] * count, one, [2 * each for each in one]], tmp_path)
    assert set(none) == {0.0}
    arm = [small[i] for i, name in enumerate(names) if name.startswith("left_")]
    assert sorted(arm)[-1] == max(small)
    assert 0.005 < max(small) < 0.05  # 2° at an arm's length
    np.testing.assert_allclose(twice, 2 * np.array(small), atol=1e-9)
    others = [small[i] for i, name in enumerate(names) if name.startswith("right_")]
    assert set(others) == {0.0}
