"""A robot's URDF or MJCF as MuJoCo's own compiler reads it, or a line that says what is wrong."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import mujoco

from common.errors import ConfigError, ConfigMistake
from deploy.ops.profile.meshes import take_meshes

HINGED = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))


@dataclass(frozen=True, slots=True)
class Compiled:
    """The robot as read."""

    path: Path
    name: str
    model: mujoco.MjModel
    mjcf: str
    """The same as MJCF; its meshes lie in the folder `meshes`."""
    assets: dict[str, bytes]
    """Their files, by name."""
    follows: dict[str, tuple[str, float]]
    """Joints that mimic another: that one's name, and the ratio to it."""
    velocity_rad_s: dict[str, float]
    """Of the joints for which the file tells a velocity limit."""
    notes: tuple[str, ...]
    """What was read in a way that a person should know."""


def compiled(path: Path, fix_base: bool = False) -> Compiled:
    """Read a robot. `fix_base`: take away the free joint of a base that floats.

    Raises ConfigError, a line a mistake.
    """
    text = _text(path)
    urdf = text.tag == "robot"
    notes: list[str] = []
    assets: dict[str, bytes] = {}
    if urdf:
        assets, wrong, notes = take_meshes(path, text)
        wrong = [*_wrong_urdf(text), *wrong]
        if wrong:
            raise ConfigError(path, wrong)
    try:
        if urdf:
            spec = mujoco.MjSpec.from_string(ET.tostring(text, encoding="unicode"), assets=assets)
        else:
            spec = mujoco.MjSpec.from_file(str(path))
            assets = _gathered(path, spec)
        # links that are fixed to others keep their names
        spec.compiler.fusestatic = False
        notes += _without_base(path, spec, fix_base)
        _name_all(spec)
        model = spec.compile()
    except (ValueError, OSError) as error:
        raise ConfigError(path, [_explained(str(error), urdf)]) from None
    wrong = [*_wrong_joints(model), *_wrong_equalities(model)]
    if wrong:
        raise ConfigError(path, wrong)
    spec.meshdir = spec.texturedir = "meshes"
    notes += _massless(text if urdf else None)
    velocities = _velocities(text) if urdf else {}
    name = text.get("name") or text.get("model") or path.stem
    return Compiled(path, name, model, spec.to_xml(), assets, _mimics(model), velocities, tuple(notes))


def _gathered(path: Path, spec: mujoco.MjSpec) -> dict[str, bytes]:
    """The files of an MJCF's meshes and textures, each renamed to where it will lie."""
    assets: dict[str, bytes] = {}
    wrong = []
    for elements, folder in ((spec.meshes, spec.meshdir), (spec.textures, spec.texturedir)):
        for element in elements:
            if not element.file:
                continue
            file = path.parent / folder / element.file
            if not file.is_file():
                expected = f"a file at {file}: copy it there, or mend the model's meshdir"
                wrong.append(ConfigMistake("mesh.file", element.file, expected))
                continue
            assets[file.name] = file.read_bytes()
            element.file = str(file.resolve())
    if wrong:
        raise ConfigError(path, wrong)
    return assets


def _name_all(spec: mujoco.MjSpec) -> None:
    for i, body in enumerate(spec.bodies[1:], 1):
        body.name = body.name or f"body_{i}"
    for i, joint in enumerate(spec.joints, 1):
        joint.name = joint.name or f"joint_{i}"


def _velocities(robot: ET.Element) -> dict[str, float]:
    told = {joint.get("name", ""): joint.find("limit") for joint in robot.iter("joint")}
    found = {name: float(limit.get("velocity", 0.0)) for name, limit in told.items() if limit is not None}
    return {name: velocity for name, velocity in found.items() if velocity > 0.0}


def _text(path: Path) -> ET.Element:
    try:
        root = ET.fromstring(path.read_text("utf-8"))
    except OSError as error:
        raise _mistake(path, "file", path.name, f"a readable file ({error.strerror})") from None
    except (ET.ParseError, UnicodeDecodeError) as error:
        raise _mistake(path, "file", path.name, f"well-formed XML ({error})") from None
    if root.tag not in ("robot", "mujoco"):
        expected = "a URDF (<robot>) or an MJCF (<mujoco>); run xacro or the SDF converter first"
        raise _mistake(path, "file", f"<{root.tag}>", expected)
    if any("xacro" in str(e.tag) for e in root.iter()):
        raise _mistake(path, "file", "xacro", "plain URDF: run `xacro FILE > robot.urdf` first")
    return root


def _wrong_urdf(robot: ET.Element) -> list[ConfigMistake]:
    """What MuJoCo would read in silence or refuse in words of its own."""
    wrong = []
    children: dict[str, str] = {}
    for joint in robot.iter("joint"):
        name, kind = joint.get("name", "?"), joint.get("type")
        child = joint.find("child")
        link = "?" if child is None else child.get("link", "?")
        if link in children:
            expected = (
                f"one parent for each link, and it hangs on {children[link]} too: a closed loop; "
                "take the joint out, the mechanism counts as one joint"
            )
            wrong.append(ConfigMistake(f"joint.{name}.child", link, expected))
        children.setdefault(link, name)
        if kind in ("floating", "planar"):
            expected = "revolute, prismatic or fixed: fix the base to the world"
            wrong.append(ConfigMistake(f"joint.{name}.type", kind, expected))
        if kind == "continuous":
            wrong.append(_unlimited(name))
        mimic = joint.find("mimic")
        if mimic is not None and float(mimic.get("offset", 0.0)) != 0.0:
            expected = "0: shift the zero of the joint, so that it follows by a multiplier alone"
            wrong.append(ConfigMistake(f"joint.{name}.mimic.offset", mimic.get("offset"), expected))
    return wrong


def _without_base(path: Path, spec: mujoco.MjSpec, fix_base: bool) -> list[str]:
    free = [joint for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE]
    if free and not fix_base:
        expected = (
            "a robot whose base is fixed: with --fix-base it is held where it stands, or take the "
            "free joint out of the file"
        )
        raise _mistake(path, "joint", f"{free[0].name or 'free joint'} of {free[0].parent.name}", expected)
    for joint in free:
        spec.delete(joint)
    for key in list(spec.keys):
        spec.delete(key)
    return ["the base floats: it is held where it stands"] if free else []


def _wrong_joints(model: mujoco.MjModel) -> list[ConfigMistake]:
    wrong = []
    for j in range(model.njnt):
        joint = model.joint(j)
        if model.jnt_type[j] not in HINGED:
            expected = "hinges and slides: write a ball joint as three hinges"
            wrong.append(ConfigMistake(f"joint.{joint.name}.type", "ball", expected))
        elif not model.jnt_limited[j]:
            wrong.append(_unlimited(joint.name))
    return wrong


def _unlimited(name: str) -> ConfigMistake:
    expected = (
        "limits: give it a range, within one turn either way (cables end somewhere), and its type revolute"
    )
    return ConfigMistake(f"joint.{name}.limit", None, expected)


def _wrong_equalities(model: mujoco.MjModel) -> list[ConfigMistake]:
    wrong = []
    for e in range(model.neq):
        name = model.equality(e).name or f"number {e + 1}"
        kind = mujoco.mjtEq(model.eq_type[e])
        data = model.eq_data[e]
        if kind in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD):
            expected = "a tree: a closed loop; take it out, the mechanism counts as one joint"
            wrong.append(ConfigMistake(f"equality.{name}", kind.name, expected))
        elif kind != mujoco.mjtEq.mjEQ_JOINT or data[0] or data[2:5].any() or not data[1]:
            expected = "a joint that follows another one by a ratio alone (polycoef 0 RATIO 0 0 0)"
            wrong.append(ConfigMistake(f"equality.{name}", kind.name, expected))
    return wrong


def _mimics(model: mujoco.MjModel) -> dict[str, tuple[str, float]]:
    return {
        model.joint(model.eq_obj1id[e]).name: (
            model.joint(model.eq_obj2id[e]).name,
            float(model.eq_data[e, 1]),
        )
        for e in range(model.neq)
        if model.eq_obj2id[e] >= 0
    }


def _massless(urdf: ET.Element | None) -> list[str]:
    if urdf is None:
        return []
    bare = [link.get("name", "?") for link in urdf.iter("link") if link.find("inertial") is None]
    heavy = [name for name in bare if urdf.find(f"link[@name='{name}']/collision") is not None]
    if not heavy:
        return []
    return [f"{', '.join(heavy)}: no <inertial>: as heavy as water in the collision shape's volume"]


def _explained(message: str, urdf: bool) -> ConfigMistake:
    """MuJoCo's error in one line, with what to do where it is a usual one."""
    first = " ".join(message.split())
    name = message.partition("Element name '")[2].partition("'")[0]
    if "mass and inertia of moving bodies" in message:
        expected = "a mass: give it an <inertial> (mass and inertia), or a collision shape to take it from"
        return ConfigMistake(f"link.{name}.inertial" if urdf else f"body.{name}", None, expected)
    if "mesh" in message.lower() or "opening file" in message.lower():
        return ConfigMistake("mesh", first, "meshes as STL or OBJ, where the file says that they lie")
    return ConfigMistake("file", first, "what MuJoCo's compiler accepts")


def _mistake(path: Path, key: str, value: object, expected: str) -> ConfigError:
    return ConfigError(path, [ConfigMistake(key, value, expected)])
