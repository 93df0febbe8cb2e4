"""Which link follows which segment of the operator: guessed from names and from the tree, to be confirmed."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import mujoco

from common.errors import ConfigMistake
from deploy.ops.profile.compiled import Compiled

_WORDS = {
    "leg": r"hip|knee|ankle|leg|foot|thigh|shank|calf|shin|toe|wheel",
    "head": r"head|neck",
    "grip": r"finger|gripper|jaw|thumb|index|middle|ring|little|pinky|knuckle|fingers|grip",
}
_SHARES = {3: (3, 0, 0), 4: (3, 1, 0), 5: (3, 2, 0), 6: (3, 2, 1), 7: (3, 2, 2), 8: (3, 2, 3)}
"""Of an arm of so many joints without an elbow by name: those of upper arm, forearm and hand."""
_ARM = 3
"""An arm has at least so many turning joints."""


@dataclass(slots=True)
class Guess:
    """What an import found out, and what it could not."""

    links: dict[str, str | None] = field(default_factory=dict)
    """The link that follows each segment; None: the ground."""
    why: dict[str, str] = field(default_factory=dict)
    """By segment: from what it was guessed."""
    groups: dict[str, list[int]] = field(default_factory=dict)
    """The hinges (joint ids) that turn each segment."""
    grips: dict[str, list[int]] = field(default_factory=dict)
    """By side: what opens and closes the hand."""
    left_out: dict[str, str] = field(default_factory=dict)
    """Joints that no segment moves, with the reason."""


def guess(read: Compiled) -> Guess:
    """The arms, the trunk and the head of a robot. Without an arm: an empty guess."""
    model = read.model
    found = Guess()
    arms = _arms(read)
    if not arms:
        return found
    if len(arms) == 1:
        (chain,) = arms.values()
        trunk = int(model.body_parentid[model.jnt_bodyid[chain[0]]])
    else:
        trunk = _shared([_path_bodies(model, int(model.jnt_bodyid[chain[-1]])) for chain in arms.values()])
    _guess_trunk(read, trunk, found)
    for side, chain in arms.items():
        carried = _path_bodies(model, trunk)
        _guess_arm(read, side, [j for j in chain if model.jnt_bodyid[j] not in carried], found)
    used = {j for group in (*found.groups.values(), *found.grips.values()) for j in group}
    for j in range(model.njnt):
        name = model.joint(j).name
        if j not in used and name not in read.follows:
            kind = next((k for k in _WORDS if _has(model, j, k)), "")
            why = {"leg": "tandem drives upper bodies", "grip": "the hand's closing moves others already"}
            found.left_out[name] = why.get(kind, "no segment of the operator moves it") + ": rigid at 0"
    return found


def shared_hinges(read: Compiled, found: Guess) -> list[ConfigMistake]:
    """Joints that follow another one, and turn a segment by themselves too: two would drive one hinge."""
    expected = (
        "a joint that turns by itself, as trunk, arm and head need. Take the mimic (MJCF: the equality) out "
        "of the file if the joint has its own motor; if it has none, make it fixed"
    )
    return [
        ConfigMistake(f"joint.{name}.mimic", f"{read.follows[name][0]}, and it turns the {segment}", expected)
        for segment, group in found.groups.items()
        for name in (read.model.joint(j).name for j in group)
        if name in read.follows
    ]


def _guess_trunk(read: Compiled, trunk: int, found: Guess) -> None:
    model = read.model
    name = model.body(trunk).name if trunk else None
    hinges = [j for b in _path_bodies(model, trunk) for j in _hinges(model, b)]
    turning = [j for j in hinges if not _has(model, j, "leg")]
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    if any(abs(data.xaxis[j, 2]) > 0.7 for j in turning):
        first = int(model.body_parentid[model.jnt_bodyid[turning[0]]])
        found.links["pelvis"] = model.body(first).name if first else None
        found.why["pelvis"] = "the trunk turns about the vertical: against the pelvis, which needs a node too"
        found.groups["pelvis"] = []
    found.links["chest"], found.groups["chest"] = name, turning
    found.why["chest"] = "the last link that both arms hang on" if name else "the arms hang on the ground"
    heads = [
        j
        for j in range(model.njnt)
        if _has(model, j, "head") and trunk in _path_bodies(model, int(model.jnt_bodyid[j])) + [0]
    ]
    if heads:
        found.links["head"] = model.body(model.jnt_bodyid[heads[-1]]).name
        found.why["head"], found.groups["head"] = "its name", heads


def _guess_arm(read: Compiled, side: str, chain: Sequence[int], found: Guess) -> None:
    model = read.model
    named = [i for i, j in enumerate(chain) if "elbow" in model.joint(j).name.lower()]
    if named and named[0] > 0:
        first = named[0]
        fore = min(2, len(chain) - first)
        shares, why = (first, fore, len(chain) - first - fore), "the elbow's name"
    else:
        shares = _SHARES.get(len(chain), (3, 2, max(0, len(chain) - 5)))
        why = f"{len(chain)} joints, as {' + '.join(str(n) for n in shares if n)} from the shoulder outwards"
    begin = 0
    for part, share in zip(("upper_arm", "forearm", "hand"), shares, strict=True):
        if not share:
            continue
        group = list(chain[begin : begin + share])
        begin += share
        found.links[f"{side}_{part}"] = model.body(model.jnt_bodyid[group[-1]]).name
        found.why[f"{side}_{part}"], found.groups[f"{side}_{part}"] = why, group
    end = int(model.jnt_bodyid[chain[-1]])
    grips = [
        j
        for j in range(model.njnt)
        if end in _path_bodies(model, int(model.jnt_bodyid[j])) and j not in chain
    ]
    leaders = [j for j in grips if model.joint(j).name not in read.follows]
    if leaders and f"{side}_hand" in found.links:
        # slides open from 0 upwards, hinges close: the kind that there is more of
        slides = [j for j in leaders if model.jnt_type[j] == mujoco.mjtJoint.mjJNT_SLIDE]
        turning = [j for j in leaders if j not in slides]
        found.grips[side] = slides if len(slides) >= len(turning) else turning


def _arms(read: Compiled) -> dict[str, list[int]]:
    """By side, the turning joints from the root outwards of its longest limb that is no leg and no head."""
    model = read.model
    parents = set(model.body_parentid[1:].tolist())
    best: dict[str, list[int]] = {}
    for leaf in (b for b in range(1, model.nbody) if b not in parents):
        chain = [j for b in _path_bodies(model, leaf) for j in _hinges(model, b)]
        if any(_has(model, j, kind) for j in chain for kind in ("leg", "head")):
            continue
        chain = [
            j
            for j in chain
            if not _has(model, j, "grip")
            and model.jnt_type[j] == mujoco.mjtJoint.mjJNT_HINGE
            and model.joint(j).name not in read.follows
        ]
        if len(chain) < _ARM:
            continue
        side = _side(model, chain[-1])
        if len(chain) > len(best.get(side, [])):
            best[side] = chain
    return best


def _side(model: mujoco.MjModel, joint: int) -> str:
    """By name, else by where it stands; an arm in the middle is a right one."""
    body = model.body(model.jnt_bodyid[joint]).name
    for name in (model.joint(joint).name.lower(), body.lower()):
        for side in ("left", "right"):
            if re.search(rf"{side}|(^|[_\W]){side[0]}([_\W]|$)", name):
                return side
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    return "left" if data.xanchor[joint, 1] > 0.02 else "right"


def _has(model: mujoco.MjModel, joint: int, kind: str) -> bool:
    return re.search(_WORDS[kind], model.joint(joint).name.lower()) is not None


def _hinges(model: mujoco.MjModel, body: int) -> list[int]:
    first = int(model.body_jntadr[body])
    return list(range(first, first + int(model.body_jntnum[body])))


def _path_bodies(model: mujoco.MjModel, body: int) -> list[int]:
    """From the root's child down to the body; none for the ground."""
    out: list[int] = []
    while body > 0:
        out.insert(0, body)
        body = int(model.body_parentid[body])
    return out


def _shared(paths: Sequence[Sequence[int]]) -> int:
    """The last body on all paths; 0, the ground, where there is none."""
    last = 0
    for bodies in zip(*paths, strict=False):
        if len(set(bodies)) > 1:
            break
        last = bodies[0]
    return last
