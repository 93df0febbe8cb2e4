"""An imported robot as files: its profile and model, and a master's, a slave's and a suit's file."""

from __future__ import annotations

import math
import shutil
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from common.quaternion import Array
from common.skeleton import Segment, load_skeleton
from common.skeleton.load import OWN_FILE
from deploy.ops.profile.compiled import Compiled
from deploy.ops.profile.guess import Guess
from deploy.ops.profile.shapes import bars_of
from master.suit.protocol import SHIPPED_DBC

MODEL_FILE = "robot.xml"
MOST_DEG_S, UNKNOWN_DEG_S = 240.0, 120.0
"""Of a joint whose model tells a greater velocity, as fast as the nursing robot's shoulder; or tells none."""
_ACCELERATION_PER_VELOCITY = 6.0
_TORQUE_SHARE = 0.4
"""Of a motor's torque limit for acceleration at most, its rotor as heavy as the load."""
_LOADS = 20
"""Postures in which the load's inertia is looked at."""
_GRIP_DEG = 90.0
"""What the operator's fingers turn from open to closed."""
_ORDER = ("pelvis", "chest", "head") + tuple(
    f"{side}_{part}" for side in ("left", "right") for part in ("upper_arm", "forearm", "hand")
)


def write_robot(read: Compiled, guessed: Guess, place: Array, out: Path) -> list[str]:
    """Write all files into the folder `out`; returns what is guessed, line by line."""
    out.mkdir(parents=True, exist_ok=True)
    name = "".join(c if c.isalnum() or c in "_.-" else "_" for c in read.name)[:64] or "robot"
    (out / MODEL_FILE).write_text(read.mjcf, "utf-8")
    for file, content in read.assets.items():
        (out / "meshes").mkdir(exist_ok=True)
        (out / "meshes" / file).write_bytes(content)
    profile = _Profile(read, guessed, place)
    text = profile.text(name)
    (out / OWN_FILE).write_text(text, "utf-8")
    nodes = [segment for segment in _ORDER if segment in guessed.links]
    nodes += [f"{side}_fingers" for side in guessed.grips]
    shutil.copy(SHIPPED_DBC, out / "suit.dbc")
    for role, lines in _examples(nodes).items():
        (out / f"{role}.toml").write_text("\n".join(lines) + "\n", "utf-8")
    return profile.guesses


class _Profile:
    """robot.toml, and what in it is guessed."""

    def __init__(self, read: Compiled, guessed: Guess, place: Array) -> None:
        self._read, self._model, self._guess, self._place = read, read.model, guessed, place
        self.guesses: list[str] = []
        self._names: list[str] = []
        self._able_rad_s2 = _accelerations(read.model)

    def text(self, name: str) -> str:
        """The whole file."""
        segments, joints = self._segments(), self._joints()
        head = [
            f"# Made by `tandem profile import {self._read.path.name}`. Look at the lines that end in",
            "# `# guessed` and at `tandem profile check`, mend what is wrong, then empty `unconfirmed`. Till",
            "# then only the simulated robot follows this profile. The keys: docs/extending.md, own robot.",
            f'name = "{name}"',
            f'model = "{MODEL_FILE}"            # what the slave simulates',
            "unconfirmed = [",
            *(f'    "{what}",' for what in self._names),
            "]",
        ]
        return "\n".join([*head, *segments, *joints, *self._links()]) + "\n"

    def _guessed(self, name: str, line: str) -> None:
        self.guesses.append(f"{name}: {line}")
        if name not in self._names:
            self._names.append(name)

    def _segments(self) -> list[str]:
        lines = ["", "# the operator's segments, one worn node each, and the robot's link that follows it"]
        people = _people()
        for name in _ORDER:
            if name not in self._guess.links:
                continue
            link = self._guess.links[name]
            self._guessed(name, f"followed by {link or 'the ground'}: {self._guess.why[name]}")
            parent = "chest" if people[name].parent == "chest" and name != "chest" else people[name].parent
            if name == "chest" and "pelvis" in self._guess.links:
                parent = "pelvis"
            lines += ["", *_segment(people[name], name, parent)]
            if link is not None:
                lines.append(f'link = "{link}"                # guessed')
        for side in self._guess.grips:
            lines += ["", *_segment(people[f"{side}_middle_proximal"], f"{side}_fingers", f"{side}_hand")]
            lines.append(f'angles = "{side}_closing _ _"')
        return lines

    def _joints(self) -> list[str]:
        lines = ["", "# the robot's joints; zero_deg: where each stands in the operator's zero pose"]
        turned = {j: s for s, group in self._guess.groups.items() for j in group}
        for j in sorted(turned):
            name = self._model.joint(j).name
            low, high = np.degrees(self._model.jnt_range[j])
            told = self._read.velocity_rad_s.get(name)
            velocity = UNKNOWN_DEG_S if told is None else min(MOST_DEG_S, math.degrees(told))
            able = math.degrees(self._able_rad_s2[j])
            lines += ["", *self._joint(name, float(low), float(high), velocity, able)]
            lines.append(f"zero_deg = {math.degrees(self._place[j]) + 0.0:.1f}                # guessed")
            moved = self._moved([j], 1.0)
            if len(moved) > 1:
                lines.append(f"hinges = {_table(moved)}")
            speed = f", {UNKNOWN_DEG_S:g}°/s (the model tells no velocity)" * (told is None)
            self._guessed(name, f"at {math.degrees(self._place[j]) + 0.0:.1f}° in the zero pose{speed}")
        for side, grips in self._guess.grips.items():
            lines += ["", *self._grip(side, grips)]
        return lines

    def _grip(self, side: str, grips: Sequence[int]) -> list[str]:
        slides = self._model.jnt_type[grips[0]] == mujoco.mjtJoint.mjJNT_SLIDE
        name = f"{side}_grip"
        moved: dict[str, float] = {}
        for j in grips:
            low, high = (float(v) for v in self._model.jnt_range[j])
            far = high if abs(high) > abs(low) else low
            moved |= self._moved([j], far / math.radians(_GRIP_DEG))
        way = "open" if slides else "closed"
        self._guessed(name, f"{', '.join(moved)}: {way} at the far end of their range, shut or open at 0")
        lines = [*self._joint(name, 0.0, _GRIP_DEG, MOST_DEG_S), f"hinges = {_table(moved)}"]
        lines.append(f"drives = {{ {side}_closing = {-1.0 if slides else 1.0} }}                # guessed")
        return [*lines, f"zero_deg = {_GRIP_DEG if slides else 0.0}"]

    def _joint(
        self, name: str, low: float, high: float, velocity: float, able: float = math.inf
    ) -> list[str]:
        return [
            "[[joint]]",
            f'name = "{name}"',
            f"lower_deg = {low:.3f}",
            f"upper_deg = {high:.3f}",
            f"max_velocity_deg_s = {velocity:.1f}",
            f"max_acceleration_deg_s2 = {min(able, _ACCELERATION_PER_VELOCITY * velocity):.1f}   # guessed",
        ]

    def _moved(self, joints: Sequence[int], ratio: float) -> dict[str, float]:
        """Hinges by their ratios: these, and those that mimic them."""
        moved = {self._model.joint(j).name: ratio for j in joints}
        for name, (first, share) in self._read.follows.items():
            if first in moved:
                moved[name] = share * moved[first]
        return moved

    def _links(self) -> list[str]:
        model = self._model
        lines = [
            "",
            "# the robot's bodies as in its model: for avoidance; bars are capsules around their shapes",
        ]
        for body in range(1, model.nbody):
            first, count = int(model.body_jntadr[body]), int(model.body_jntnum[body])
            lines += [
                "",
                "[[link]]",
                f'name = "{model.body(body).name}"',
                f'parent = "{model.body(model.body_parentid[body]).name}"',
                f"origin_m = {_numbers(model.body_pos[body])}",
                f"q_parent_from_link = {_numbers(model.body_quat[body])}",
            ]
            if count:
                lines += ["hinges = [", *(f"    {self._hinge(j)}," for j in range(first, first + count)), "]"]
            bars = bars_of(model, body)
            if bars:
                lines += ["bars = ["]
                for bar in bars:
                    ends = f"from_m = {_numbers(bar.from_m)}, to_m = {_numbers(bar.to_m)}"
                    lines.append(f"    {{ {ends}, radius_m = {bar.radius_m:.4g} }},")
                lines.append("]")
        return lines

    def _hinge(self, joint: int) -> str:
        model = self._model
        slides = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
        axis, anchor = _numbers(model.jnt_axis[joint]), _numbers(model.jnt_pos[joint])
        more = f", anchor_m = {anchor}" * bool(model.jnt_pos[joint].any()) + ", slides = true" * bool(slides)
        return f'{{ name = "{model.joint(joint).name}", axis = {axis}{more} }}'


def _accelerations(model: mujoco.MjModel) -> Array:
    """(njnt,) rad/s² that each joint's torque limit allows under its heaviest load; else infinite."""
    data, random = mujoco.MjData(model), np.random.default_rng(0)
    full, heaviest = np.empty((model.nv, model.nv)), np.zeros(model.nv)
    for _ in range(_LOADS):
        data.qpos[:] = random.uniform(model.jnt_range[:, 0], model.jnt_range[:, 1])
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, full)
        heaviest = np.maximum(heaviest, np.diag(full))
    limit = np.where(model.jnt_actfrclimited, np.abs(model.jnt_actfrcrange).min(axis=1), np.inf)
    out: Array = _TORQUE_SHARE * limit / (2.0 * np.maximum(heaviest, 1e-6))
    return out


def _people() -> dict[str, Segment]:
    """The segments of a person, by name: those of the nursing profile, and the pelvis."""
    segments = {segment.name: segment for segment in load_skeleton("nursing").segments}
    legs = {segment.name: segment for segment in load_skeleton("lower_limb").segments}
    return segments | {"pelvis": legs["pelvis"]}


def _segment(person: Segment, name: str, parent: str) -> list[str]:
    signs = [("-" if sum(axis) < 0 else "") + "xyz"[[abs(a) for a in axis].index(1)] for axis in person.axes]
    human = [
        ["flexion", "abduction", "rotation"][k] if turns else "_" for k, turns in enumerate(person.human)
    ]
    lines = [
        "[[segment]]",
        f'name = "{name}"',
        f'parent = "{parent}"',
        f'axes = "{" ".join(signs)}"',
        f'human = "{" ".join(human)}"',
        f"origin_m = {_numbers(person.origin_m)}",
        f"node_m = {_numbers(person.node_m)}",
    ]
    group = name.replace("upper_arm", "arm") if "upper_arm" in name or name.endswith("_hand") else None
    return [*lines, *([f'group = "{group}"'] if group else [])]


def _examples(nodes: Sequence[str]) -> dict[str, list[str]]:
    bus = [
        'name = "suit"',
        'interface = "udp_multicast"       # hardware: "socketcan", channel = "can0", options = {}',
        'channel = "239.74.163.2"',
        "fd = true",
        "options = { port = 43113, hop_limit = 0 }",
    ]
    process = [
        "", "[process]",
        "realtime_priority = 20            # SCHED_FIFO where the host permits it, otherwise a log line", "",
    ]  # fmt: skip
    worn = ["", "[nodes]", *(f'{name} = {{ id = {i + 1}, bus = "suit" }}' for i, name in enumerate(nodes))]
    return {
        "master": [
            'robots = ["robot-1"]', f'profile = "{OWN_FILE}"', "", "[operator]", 'name = "nurse-1"',
            'deadman = { source = "always_held" }   # for the simulated robot; a pedal for a real one',
            *process, "[capture]", 'dbc = "suit.dbc"', "", "[[capture.buses]]", *bus, "",
            "[link]", 'connect = ["tcp/127.0.0.1:7447"]', *worn,
        ],
        "slave": [
            'robot = "robot-1"', f'profile = "{OWN_FILE}"', *process,
            "[link]", 'listen = ["tcp/0.0.0.0:7447"]', "", "[camera]", 'source = "robot"',
        ],
        "suit": [
            f'profile = "{OWN_FILE}"', 'motion = "postures"           # or "sweep": joint by joint', *process,
            "[[buses]]", *bus, *worn,
        ],
    }  # fmt: skip


def _numbers(values: Sequence[float] | Array) -> str:
    return "[" + ", ".join(repr(round(float(v), 9) + 0.0) for v in values) + "]"


def _table(ratios: dict[str, float]) -> str:
    return "{ " + ", ".join(f"{name} = {ratio:.8g}" for name, ratio in ratios.items()) + " }"
