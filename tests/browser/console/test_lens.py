"""Where the page draws the robot over a picture: where MuJoCo, whose picture it is, draws it itself."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from common.metrics.lens import Lens
from common.metrics.tree import to_tree
from common.quaternion import Array
from common.skeleton import Skeleton, load_skeleton
from deploy.console.model.scene import scene
from slave.camera.lens import eye
from slave.model.build import build_model, unit_rates
from slave.model.capsules import capsules
from slave.model.capsules import links as body_links

NODE = shutil.which("node")
PAGE = Path(__file__).parents[3] / "deploy" / "console" / "page"
SCRIPT = """
const { bars } = await import(process.argv[1] + "/lens.js");
const fs = await import("node:fs");
const { lens, links, now, will, more_m, width, height } = JSON.parse(fs.readFileSync(0, "utf8"));
console.log(JSON.stringify(bars(lens, links, { now, will, more_m }, width, height)));
"""
WIDTH, HEIGHT = 640, 480
MOST_PX = 3.0
POSTURES_DEG = {
    "arms ahead": {"left_shoulder_pitch": 75.0, "right_shoulder_pitch": 60.0, "left_elbow_pitch": 30.0},
    "head turned and bowed": {"neck_yaw": 20.0, "neck_pitch": 25.0, "left_shoulder_pitch": 60.0},
}
pytestmark = pytest.mark.skipif(NODE is None, reason="no node here: apt install nodejs")


def drawn(lens: Lens, now: Array, will: Array, more_m: float, folder: Path) -> list[dict[str, Any]]:
    """What the page draws, by the page's own code."""
    links = scene(load_skeleton("nursing"))["links"]
    assert isinstance(links, list)
    (folder / "package.json").write_text('{"type": "module"}')
    for name in ("lens.js", "kinematics.js"):
        shutil.copy(PAGE / name, folder)
    given = {
        "lens": to_tree(lens), "links": links, "now": now.tolist(), "will": will.tolist(),
        "more_m": [more_m] * len(links), "width": WIDTH, "height": HEIGHT,
    }  # fmt: skip
    command = [str(NODE), "--input-type=module", "-e", SCRIPT, str(folder)]
    done = subprocess.run(command, input=json.dumps(given), capture_output=True, text=True, check=True)
    found: list[dict[str, Any]] = json.loads(done.stdout)
    return found


def posture(skeleton: Skeleton, degrees: dict[str, float]) -> Array:
    angles = np.array([math.radians(degrees.get(name, 0.0)) for name in skeleton.joint_names])
    within: Array = np.clip(angles, skeleton.lower_rad, skeleton.upper_rad)
    return within


def seen_alone(skeleton: Skeleton, angles: Array, bar: int) -> NDArray[np.bool_]:
    """(HEIGHT, WIDTH) where the model's own camera sees a capsule, all else hidden: a ray a pixel."""
    model = build_model(skeleton)
    shape = capsules(skeleton)
    body = model.body(body_links(skeleton)[shape[bar].segment].name)
    before = sum(each.segment == shape[bar].segment for each in shape[:bar])
    geom = int(body.geomadr[0]) + before
    model.geom_group[:] = 4
    model.geom_group[geom] = 0
    data = mujoco.MjData(model)
    data.qpos[:] = angles @ unit_rates(skeleton, model)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_camlight(model, data)
    camera = model.camera("head").id
    y, x = np.mgrid[0.5:HEIGHT, 0.5:WIDTH]
    # OpenGL's axes: x right, y up, looking along -z
    half = math.tan(0.5 * math.radians(float(model.cam_fovy[camera]))) / (0.5 * HEIGHT)
    rays = np.stack([(x - 0.5 * WIDTH) * half, (0.5 * HEIGHT - y) * half, -np.ones_like(x)], axis=-1)
    rays = rays.reshape(-1, 3) @ data.cam_xmat[camera].reshape(3, 3).T
    group = np.zeros(6, np.uint8)
    group[0] = 1
    hit, far_m = np.zeros(len(rays), np.int32), np.zeros(len(rays))
    mujoco.mj_multiRay(
        model, data, data.cam_xpos[camera], rays.ravel(), group, 1, -1, hit, far_m, None, len(rays), 10.0
    )
    there: NDArray[np.bool_] = hit.reshape(HEIGHT, WIDTH) == geom
    return there


def of_bar(bar: dict[str, Any]) -> NDArray[np.bool_]:
    """(HEIGHT, WIDTH) what a bar covers."""
    y, x = np.mgrid[0.5:HEIGHT, 0.5:WIDTH]
    a, b = np.array(bar["from"]), np.array(bar["to"])
    along = b - a
    share = np.clip(((x - a[0]) * along[0] + (y - a[1]) * along[1]) / max(float(along @ along), 1e-9), 0, 1)
    off = np.hypot(x - a[0] - share * along[0], y - a[1] - share * along[1])
    first, last = bar["radii"]
    covered: NDArray[np.bool_] = off <= first + share * (last - first)
    return covered


def middle(mask: NDArray[np.bool_]) -> Array:
    rows, columns = np.nonzero(mask)
    return np.array([columns.mean(), rows.mean()])


@pytest.mark.parametrize("name", POSTURES_DEG)
def test_hands_and_fingers_are_drawn_where_the_picture_has_them(name: str, tmp_path: Path) -> None:
    skeleton = load_skeleton("nursing")
    angles, lens = posture(skeleton, POSTURES_DEG[name]), eye(skeleton, "head", WIDTH, HEIGHT)
    assert lens is not None
    found = drawn(lens, angles, angles, 0.0, tmp_path)
    bodies = [link.name for link in body_links(skeleton)]
    compared = 0
    for bar, capsule in enumerate(capsules(skeleton)):
        body = bodies[capsule.segment]
        mask = seen_alone(skeleton, angles, bar)
        edges = mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any()
        if mask.sum() < 30 or edges:
            continue
        own = [s for s in found if s["link"] == capsule.segment]
        best = min(float(np.abs(middle(of_bar(s)) - middle(mask)).max()) for s in own)
        assert best < MOST_PX, f"{body}: {best:.1f} px"
        compared += 1
    assert compared >= 10


def test_the_head_that_turns_away_takes_its_camera_with_it_and_not_the_hand(tmp_path: Path) -> None:
    skeleton = load_skeleton("nursing")
    lens = eye(skeleton, "head", WIDTH, HEIGHT)
    assert lens is not None
    will = posture(skeleton, {"left_shoulder_pitch": 60.0, "left_elbow_pitch": 40.0})
    turned = posture(skeleton, {"neck_yaw": 10.0})
    ahead, away = (drawn(lens, now, will, 0.0, tmp_path) for now in (np.zeros(len(will)), turned))
    hand = [link.name for link in body_links(skeleton)].index("left_hand")
    x = [next(s["from"][0] for s in found if s["link"] == hand) for found in (ahead, away)]
    # to the left: the hand goes to the right in the picture
    assert x[1] - x[0] == pytest.approx(lens.focal[0] * WIDTH * math.radians(10.0), rel=0.35)


def test_what_is_behind_the_camera_is_not_drawn_and_what_reaches_there_is_cut(tmp_path: Path) -> None:
    skeleton = load_skeleton("nursing")
    zero = np.zeros(len(skeleton.joints))
    behind = Lens("", (5.0, 0.0, 1.0), (0.5, -0.5, 0.5, -0.5), (0.9, 1.2), (0.5, 0.5))
    assert drawn(behind, zero, zero, 0.0, tmp_path) == []
    amid = Lens("", (0.0, 0.0, 1.0), (0.5, -0.5, 0.5, -0.5), (0.9, 1.2), (0.5, 0.5))
    points = [s[end] for s in drawn(amid, zero, zero, 0.0, tmp_path) for end in ("from", "to")]
    assert all(math.isfinite(value) for point in points for value in point)


def test_a_lens_that_bends_moves_what_is_far_from_the_middle(tmp_path: Path) -> None:
    """As OpenCV's model says: by k1 r² of its distance, towards the middle for a barrel."""
    skeleton = load_skeleton("nursing")
    angles = posture(skeleton, POSTURES_DEG["arms ahead"])
    straight = eye(skeleton, "head", WIDTH, HEIGHT)
    assert straight is not None
    bent = Lens(**{**to_tree(straight), "radial": (-0.2, 0.0)})  # type: ignore[arg-type]
    pairs = zip(
        drawn(straight, angles, angles, 0.0, tmp_path),
        drawn(bent, angles, angles, 0.0, tmp_path),
        strict=True,
    )
    compared = 0
    for a, b in pairs:
        x, y = (
            (a["from"][0] / WIDTH - 0.5) / straight.focal[0],
            (a["from"][1] / HEIGHT - 0.5) / straight.focal[1],
        )
        r2 = x * x + y * y
        if r2 > 0.5:
            continue
        assert b["from"][0] / WIDTH - 0.5 == pytest.approx((a["from"][0] / WIDTH - 0.5) * (1 - 0.2 * r2))
        compared += 1
    assert compared >= 2


def test_the_tube_is_as_wide_as_the_uncertainty_at_that_distance(tmp_path: Path) -> None:
    skeleton = load_skeleton("nursing")
    angles = posture(skeleton, POSTURES_DEG["arms ahead"])
    lens = eye(skeleton, "head", WIDTH, HEIGHT)
    assert lens is not None
    thin, thick = (drawn(lens, angles, angles, more_m, tmp_path) for more_m in (0.0, 0.02))
    assert all(s["wide"] == pytest.approx(s["radii"]) for s in thin)
    radius_m = {(c.segment, round(c.radius_m, 5)) for c in capsules(skeleton)}
    for bar in thick:
        grown = bar["wide"][0] / bar["radii"][0]
        own_m = [radius for link, radius in radius_m if link == bar["link"]]
        assert any(grown == pytest.approx((one_m + 0.02) / one_m, rel=1e-3) for one_m in own_m)
