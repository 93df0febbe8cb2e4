"""From a URDF or MJCF to a profile: what is found, what is guessed, and what is refused in one line."""

from __future__ import annotations

import re
import shutil
from pathlib import Path
from xml.etree import ElementTree as ET

import mujoco
import numpy as np
import pytest
from typer.testing import CliRunner

from common.config.load import load_config
from common.errors import ConfigError, TandemError
from common.skeleton import Skeleton, load_skeleton
from common.skeleton.links import hinge_values, place_links
from deploy.cli import app
from deploy.examples.profiles import example
from deploy.measure import motion
from deploy.ops.profile.check import checked, worn
from deploy.ops.profile.compiled import compiled
from deploy.sim.suit.config import SuitConfig
from deploy.sim.world.world import VirtualWorld, WorldSettings
from master.config import MasterConfig
from slave.config import SlaveConfig
from slave.contact.config import ContactConfig
from slave.contact.thresholds import angles_of, thresholds_nm
from slave.model.build import build_model, unit_rates
from slave.model.capsules import capsules
from slave.model.pairs import pairs
from tests.robots.imported import FILES, ROBOTS, imported


@pytest.fixture(params=FILES)
def folder(request: pytest.FixtureRequest) -> Path:
    """The folder of one of the robots that are not ours."""
    return imported(str(request.param))


@pytest.fixture
def skeleton(folder: Path) -> Skeleton:
    return load_skeleton(str(folder))


def test_both_arms_are_found_with_their_hands(skeleton: Skeleton) -> None:
    arms = {
        f"{side}_{part}" for side in ("left", "right") for part in ("upper_arm", "forearm", "hand", "fingers")
    }
    assert arms <= set(skeleton.segment_names)
    assert {"left_grip", "right_grip"} <= set(skeleton.joint_names)
    turns = {s.name: len(s.turns) for s in skeleton.segments}
    assert [turns[f"left_{part}"] for part in ("upper_arm", "forearm", "hand")] == [3, 2, 2]


def test_every_guess_is_named_until_it_is_confirmed(skeleton: Skeleton) -> None:
    followed = {s.name for s in skeleton.segments if s.link}
    assert followed | set(skeleton.joint_names) <= set(skeleton.unconfirmed) | {"chest"}


def test_the_links_stand_where_the_model_has_them(skeleton: Skeleton) -> None:
    """Two ways to the same places: the table's formulas, and the model that the slave simulates."""
    model = build_model(skeleton)
    data, rates = mujoco.MjData(model), unit_rates(skeleton, model)
    random = np.random.default_rng(3)
    for position in random.uniform(skeleton.lower_rad, skeleton.upper_rad, (10, len(skeleton.joints))):
        data.qpos[:] = position @ rates
        mujoco.mj_kinematics(model, data)
        placed = place_links(skeleton.own_links, hinge_values(skeleton.joints, position))
        for link in skeleton.own_links:
            np.testing.assert_allclose(placed[link.name][0], data.body(link.name).xpos, atol=1e-6)
            same = abs(placed[link.name][1] @ data.body(link.name).xquat)
            assert same == pytest.approx(1.0, abs=1e-9)


def test_the_slave_simulates_the_model_itself(folder: Path, skeleton: Skeleton) -> None:
    own, simulated = mujoco.MjModel.from_xml_path(str(folder / "robot.xml")), build_model(skeleton)
    np.testing.assert_allclose(simulated.body_mass, own.body_mass)
    np.testing.assert_allclose(simulated.body_inertia, own.body_inertia)
    assert simulated.ngeom == own.ngeom


def test_the_bars_hold_the_shapes(skeleton: Skeleton) -> None:
    """Every corner of a box is within its link's capsules."""
    model = build_model(skeleton)
    bars = {link.name: link.bars for link in skeleton.own_links}
    boxes = [g for g in range(model.ngeom) if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_BOX]
    assert boxes
    for g in boxes:
        turn = np.empty(9)
        mujoco.mju_quat2Mat(turn, model.geom_quat[g])
        for sign in np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T:
            corner = model.geom_pos[g] + turn.reshape(3, 3) @ (sign * model.geom_size[g])
            apart = []
            for bar in bars[model.body(model.geom_bodyid[g]).name]:
                begin, along = np.array(bar.from_m), np.subtract(bar.to_m, bar.from_m)
                share = np.clip((corner - begin) @ along / (along @ along), 0.0, 1.0)
                apart.append(np.linalg.norm(corner - begin - share * along) - bar.radius_m)
            assert min(apart) < 1e-4


@pytest.mark.parametrize("posture", ["elbow_pitch", "shoulder_pitch", "shoulder_roll"])
def test_the_robot_takes_the_operators_posture(skeleton: Skeleton, posture: str) -> None:
    """What both arms reach is reached, by the right joints and in the right direction."""
    found = worn(skeleton, posture, {posture: 60.0, "elbow_pitch": 60.0})
    assert max(found.left_deg.values()) < 0.01
    model = build_model(skeleton)
    data = mujoco.MjData(model)
    data.qpos[:] = found.position_rad @ unit_rates(skeleton, model)
    mujoco.mj_kinematics(model, data)
    link = {s.name: s.link for s in skeleton.segments}
    for side in (1.0, -1.0):
        name = "left" if side > 0 else "right"
        hand = data.body(link[f"{name}_hand"]).xpos - data.body(link[f"{name}_upper_arm"]).xpos
        if posture == "shoulder_roll":
            assert side * hand[1] > 0.0
        else:
            assert hand[0] > 0.1


@pytest.mark.parametrize(
    ("role", "kind"), [("master", MasterConfig), ("slave", SlaveConfig), ("suit", SuitConfig)]
)
def test_its_processes_run_before_other_load_as_those_of_the_examples_do(
    folder: Path, role: str, kind: type[MasterConfig | SlaveConfig | SuitConfig]
) -> None:
    """Without it a busy host cost 9 % of the slave's ticks, and a false protective stop."""
    own = load_config(example(role, str(folder)), kind)
    assert own.process.realtime_priority == load_config(example(role), kind).process.realtime_priority > 0


def test_the_check_tells_which_push_each_joint_notices(skeleton: Skeleton) -> None:
    found = checked(skeleton)
    noticed = {one.name: one.noticed_nm for one in found.courses}
    model = build_model(skeleton)
    config = ContactConfig()
    floors = thresholds_nm(skeleton, model, config, angles_of(config, drives=False)).min(axis=0)
    assert [noticed[name] for name in skeleton.joint_names] == pytest.approx(floors.tolist())
    assert "no push is noticed below" in found.dull


def test_no_parts_touch_in_the_zero_pose(skeleton: Skeleton) -> None:
    assert checked(skeleton).touching == []


def test_what_is_there_is_not_replaced_without_a_word(folder: Path) -> None:
    command = ["profile", "import", str(ROBOTS / FILES[0]), "--out", str(folder)]
    before = (folder / "robot.toml").read_text("utf-8")
    done = CliRunner().invoke(app, command)
    assert isinstance(done.exception, TandemError)
    assert "--overwrite" in str(done.exception)
    assert (folder / "robot.toml").read_text("utf-8") == before


URDF = (ROBOTS / "upper_body.urdf").read_text("utf-8")
MJCF = (ROBOTS / "arm_pair.xml").read_text("utf-8")
ELBOW = '<limit lower="-1.0472" upper="2.0944" effort="25" velocity="37"/>'


@pytest.mark.parametrize(
    ("text", "old", "new", "message"),
    [
        (
            URDF,
            '<box size="0.1 0.1 0.1"/>',
            '<mesh filename="package://lost/hip.stl"/>',
            r"hip\.stl'.*copy the meshes",
        ),
        (
            URDF,
            '<box size="0.1 0.1 0.1"/>',
            '<mesh filename="{here}/hip.dae"/>',
            r"hip\.dae'.*STL or OBJ: convert",
        ),
        (
            URDF,
            'name="left_elbow_joint" type="revolute"',
            'name="left_elbow_joint" type="continuous"',
            r"left_elbow_joint\.limit = .*give it a range",
        ),
        (
            URDF,
            'name="waist_yaw_joint" type="revolute"',
            'name="waist_yaw_joint" type="floating"',
            r"waist_yaw_joint\.type = 'floating'.*fix the base",
        ),
        (
            URDF,
            ELBOW,
            ELBOW + '<mimic joint="waist_yaw_joint" offset="0.2"/>',
            r"mimic\.offset = '0\.2'.*shift the zero",
        ),
        (
            URDF,
            '<parent link="left_elbow_link"/><child link="left_wrist_roll_link"/>',
            '<parent link="left_elbow_link"/><child link="right_wrist_roll_link"/>',
            r"closed loop",
        ),
        (URDF, "</robot>", "", r"well-formed XML"),
        (MJCF, 'range="-3.0718 -0.0698"', 'limited="false"', r"left_joint4\.limit.*give it a range"),
        (
            MJCF,
            '<body name="left_arm0"',
            '<body name="b"><freejoint name="fly"/><geom size="0.1"/></body><body name="left_arm0"',
            r"fly of b.*--fix-base",
        ),
        (
            MJCF,
            "</equality>",
            '<connect body1="left_arm7" body2="right_arm7" anchor="0 0 0"/></equality>',
            r"closed loop",
        ),
        (
            MJCF,
            'joint2="left_jaw_joint1"',
            'joint2="left_jaw_joint1" polycoef="0.01 1 0 0 0"',
            r"by a ratio alone",
        ),
        (MJCF, 'mass="0.05"', 'mass="0"', r"body\.left_jaw1 = .*<inertial>"),
        ("<sdf/>", "", "", r"a URDF .* or an MJCF"),
    ],
)
def test_a_robot_that_cannot_be_read_is_refused_in_words(
    tmp_path: Path, text: str, old: str, new: str, message: str
) -> None:
    (tmp_path / "hip.dae").write_text("", "utf-8")
    assert old in text
    file = tmp_path / ("robot.urdf" if "<robot" in text else "robot.xml")
    file.write_text(text.replace(old, new.format(here=tmp_path) if "{here}" in new else new, 1), "utf-8")
    with pytest.raises(ConfigError) as caught:
        compiled(file)
    lines = str(caught.value).splitlines()
    assert any(re.search(message, line) for line in lines), lines
    assert all(line.startswith(str(file)) for line in lines), lines


def test_a_base_that_floats_is_held_on_demand(tmp_path: Path) -> None:
    text = MJCF.replace("<worldbody>", '<worldbody><body name="all"><freejoint/>', 1)
    (tmp_path / "robot.xml").write_text(text.replace("</worldbody>", "</body></worldbody>", 1), "utf-8")
    with pytest.raises(ConfigError, match="--fix-base"):
        compiled(tmp_path / "robot.xml")
    read = compiled(tmp_path / "robot.xml", fix_base=True)
    assert "held where it stands" in read.notes[0]
    assert read.model.nv == 18


def test_a_mimic_joint_is_moved_with_the_one_it_follows(tmp_path: Path) -> None:
    shutil.copy(ROBOTS / "arm_pair.xml", tmp_path / "robot.xml")
    read = compiled(tmp_path / "robot.xml")
    assert read.follows["left_jaw_joint2"] == ("left_jaw_joint1", 1.0)


def test_a_trunk_joint_that_follows_another_one_is_refused_before_anything_is_written(
    tmp_path: Path,
) -> None:
    file, out = tmp_path / "robot.urdf", tmp_path / "own"
    robot = ET.fromstring(URDF)
    roll = robot.find("joint[@name='waist_roll_joint']")
    assert roll is not None
    ET.SubElement(roll, "mimic", joint="waist_pitch_joint", multiplier="0.5")
    file.write_text(ET.tostring(robot, encoding="unicode"), "utf-8")
    done = CliRunner().invoke(app, ["profile", "import", str(file), "--out", str(out)])
    assert isinstance(done.exception, ConfigError)
    (line,) = str(done.exception).splitlines()
    assert re.search(
        r"robot\.urdf: joint\.waist_roll_joint\.mimic = .*waist_pitch_joint.*turns the chest", line
    )
    assert "make it fixed" in line
    assert not out.exists()


def one_arm(file: Path, hand: bool) -> Path:
    """The right arm alone, with its gripper or without."""
    robot = ET.fromstring(MJCF)
    world, mimics = robot.find("worldbody"), robot.find("equality")
    assert world is not None
    assert mimics is not None
    world.remove(world.findall("body")[0])
    mimics.remove(mimics[0])
    if not hand:
        robot.remove(mimics)
        (holder,) = (
            body for body in world.iter("body") if body.find("body[@name='right_gripper']") is not None
        )
        holder.remove(holder.findall("body")[0])
    file.write_text(ET.tostring(robot, encoding="unicode"), "utf-8")
    return file


@pytest.mark.parametrize("hand", [True, False])
@pytest.mark.long
def test_a_single_arm_follows_too(tmp_path: Path, hand: bool) -> None:
    file, out = one_arm(tmp_path / "arm.xml", hand), tmp_path / "own"
    done = CliRunner().invoke(app, ["profile", "import", str(file), "--out", str(out)])
    assert done.exit_code == 0, done.output
    skeleton = load_skeleton(str(out))
    assert len(skeleton.joints) == 7 + hand
    assert not any(name.startswith("left") for name in skeleton.segment_names)
    run = VirtualWorld(WorldSettings(one_way_ns=500_000, profile=str(out)))
    run.engage()
    run.run(8.0)
    assert run.slave.guard.state == "track", run.slave.guard.reason
    moved = motion(run.trace.truth(), run.moved(), run.trace.joint_names)
    assert moved is not None
    assert max(joint.rmse_deg for joint in moved.joints.values()) < 1.0


def test_a_robot_without_an_arm_is_refused_in_words(tmp_path: Path) -> None:
    (tmp_path / "cart.xml").write_text(
        "<mujoco><worldbody><body name='cart'><geom size='0.1'/></body></worldbody></mujoco>", "utf-8"
    )
    done = CliRunner().invoke(
        app, ["profile", "import", str(tmp_path / "cart.xml"), "--out", str(tmp_path / "o")]
    )
    assert isinstance(done.exception, TandemError)
    assert "no arm found" in str(done.exception)
    assert not (tmp_path / "o").exists()


def test_meshes_are_gathered_and_their_shape_is_held(tmp_path: Path) -> None:
    """A mesh named by its package, in a folder above; one to look at, of a format that is not read."""
    package = tmp_path / "tall_robot"
    (package / "meshes").mkdir(parents=True)
    (package / "urdf").mkdir()
    corners = [(x, y, z) for x in (-0.05, 0.05) for y in (-0.03, 0.03) for z in (-0.1, 0.1)]
    faces = ["1 2 4 3", "5 6 8 7", "1 2 6 5", "3 4 8 7", "1 3 7 5", "2 4 8 6"]
    lines = [f"v {x} {y} {z}" for x, y, z in corners] + [f"f {face}" for face in faces]
    (package / "meshes/hip.obj").write_text("\n".join(lines), "utf-8")
    mesh = '<mesh filename="package://tall_robot/meshes/hip.obj"/>'
    picture = (
        '</collision><visual><geometry><mesh filename="package://tall_robot/hip.dae"/></geometry></visual>'
    )
    text = URDF.replace('<box size="0.1 0.1 0.1"/>', mesh, 1).replace("</collision>", picture, 1)
    (package / "urdf/robot.urdf").write_text(text, "utf-8")
    read = compiled(package / "urdf/robot.urdf")
    assert set(read.assets) == {"hip.obj"}
    assert "1 shapes to look at" in read.notes[0]
    out = tmp_path / "own"
    done = CliRunner().invoke(app, ["profile", "import", str(package / "urdf/robot.urdf"), "--out", str(out)])
    assert done.exit_code == 0, done.output
    assert (out / "meshes/hip.obj").is_file()
    (hip,) = load_skeleton(str(out)).own_links[0].bars
    assert hip.radius_m == pytest.approx(np.hypot(0.05, 0.03), abs=0.01)
    assert build_model(load_skeleton(str(out))).nmesh == 1


def test_parts_that_no_joint_moves_are_not_kept_apart() -> None:
    """The two bases stand where they stand, however near."""
    skeleton = load_skeleton(str(imported("arm_pair.xml")))
    of_bar = [capsule.segment for capsule in capsules(skeleton)]
    kept = {frozenset(skeleton.own_links[of_bar[bar]].name for bar in pair) for pair in pairs(skeleton)}
    assert frozenset({"left_arm0", "right_arm0"}) not in kept
    assert frozenset({"left_arm7", "right_arm0"}) in kept
