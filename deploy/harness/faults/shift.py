"""What an operator does over a shift: an arm rests, the zero pose is taken again while the robot follows."""

from __future__ import annotations

from common.skeleton.groups import joint_groups
from common.wire.messages import Action
from deploy.harness.faults.fault import BRAKED_S, NOTICED_S
from deploy.harness.faults.scene import Scene
from deploy.harness.faults.setting import Setting
from deploy.harness.faults.virtual import holds, holds_joints

ARM = "right_arm"
"""The reaching arm, with its hand."""
WORN = Setting(aligned=True, lead_s=1.6, master=("estimation.zero_pose_s=1.0",))


def _rest(scene: Scene) -> None:
    scene.run.ask(Action.REST, groups=(ARM,))


def _arm(scene: Scene) -> set[str]:
    joints = joint_groups(scene.skeleton)[ARM]
    return {name for name, rests in zip(scene.skeleton.joint_names, joints, strict=True) if rests}


def _zero_pose_again(scene: Scene) -> None:
    scene.run.take_zero_pose_again()


SHIFT = (
    holds_joints(
        name="arm rested",
        done="The operator lets the reaching arm rest (`tandem rest`), and goes on moving it.",
        robot="Holds the arm and its hand; the others follow. `tandem status` names what rests.",
        person="`tandem take-up`: the arm comes back slowly, then follows.",
        act=_rest,
        concerns=_arm, strays_deg=1.0, sway_deg=1.0, stands_s=BRAKED_S,
    ),
    holds(
        name="zero pose taken again while the robot follows",
        done="The operator asks for another zero pose by a key while the robot follows.",
        robot="Brakes and stands; engage is refused while the operator stands in the pose.",
        person="Stand still until the pose is taken, or refused and the old one stays; then engage.",
        act=_zero_pose_again, setting=WORN,
        # the joints brake with the first command in which none is valid; the robot holds by the time-out
        reacts_s=0.08 + NOTICED_S, stands_s=0.08 + BRAKED_S, held_by={"valid"},
    ),
)  # fmt: skip
