"""Faults of who commands: a colleague without the lease, a certificate that is revoked."""

from __future__ import annotations

from dataclasses import replace

from common.link.roles import Role, common_name
from common.wire.codec import encode
from common.wire.messages import Action
from deploy.harness.faults.fault import AT_ONCE_S, BRAKED_S
from deploy.harness.faults.scene import Scene, turned
from deploy.harness.faults.virtual import goes_on, holds


def _colleague(scene: Scene) -> None:
    for action in (Action.CLAIM, Action.ENGAGE, Action.DISENGAGE, Action.HANDOVER, Action.RELEASE):
        scene.ask(action, "nurse-2")

    def command() -> None:
        for token in (0, scene.newest().lease):
            stolen = turned(replace(scene.newest(), lease=token))
            scene.command(encode(stolen), sender="nurse-2")

    scene.each_period = command


def _revoked(scene: Scene) -> None:
    operator = scene.run.master_config.operator.name
    scene.run.slave.on_revoked(frozenset({common_name(Role.OPERATOR, operator)}), scene.run.slave_ns)

    def ask() -> None:
        for action in (Action.CLAIM, Action.ENGAGE):
            scene.ask(action, operator)

    scene.each_period = ask


OPERATORS = (
    goes_on(
        name="operator of the same robot without the lease",
        done="A colleague who may command this robot too sends requests, and commands with the lease of the "
        "operator, which everybody sees who receives commands.",
        robot="Follows its operator. The lease is worth nothing on the colleague's own key, "
        "and the colleague's certificate permits no other.",
        person="Nothing; or the operator hands the robot over (`tandem handover --to NAME`).",
        act=_colleague,
        strays_deg=0.0, refused_by={"operator", "lease"}, held_by={"operator"},
    ),
    holds(
        name="certificate revoked while tracking",
        done="The operator's certificate is put on the revocation list; the operator's master goes on and "
        "claims the robot again.",
        robot="Ends the operator's lease, brakes all joints and stands, and says why. It refuses all that "
        "comes on the operator's key but a stop. The operator's sessions are cut within some two seconds.",
        person="Another operator claims and engages. For the first, make a certificate under a new name.",
        act=_revoked,
        reacts_s=AT_ONCE_S, stands_s=AT_ONCE_S + BRAKED_S, refused_by={"revoked"}, held_by={"revoked"},
    ),
)  # fmt: skip
