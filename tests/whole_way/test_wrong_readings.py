"""A node with wrong readings is named, nobody engages on it, and who is engaged holds its joints alone."""

from __future__ import annotations

import pytest

from common.wire.messages import Action
from deploy.sim.world.world import VirtualWorld, WorldSettings
from tests.whole_way.runs import engaged

NODE = "right_forearm"
HELD = {"right_elbow_pitch", "right_elbow_roll", "right_wrist_yaw"}


def lying(kind: str, from_s: float, more: str = "") -> WorldSettings:
    lie = f'faults.wrong_reading=[{{node="{NODE}",kind="{kind}",from_s={from_s}{more}}}]'
    return WorldSettings(overrides={"suit": [lie]})


@pytest.mark.parametrize(
    ("kind", "more", "words"),
    [("frozen", "", "frozen"), ("stuck", ",axis=1", "stuck"), ("zero", "", "reads zero")],
)
def test_engage_is_refused_with_words_that_name_the_node(kind: str, more: str, words: str) -> None:
    run = VirtualWorld(lying(kind, 3.0, more))
    run.run(6.0)
    assert run.slave.clock.estimator.estimate(run.slave_ns).trusted
    reply = run.ask(Action.ENGAGE)
    assert not reply.done
    assert NODE in reply.text
    assert words in reply.text
    assert run.slave.guard.state == "hold"


def test_once_the_node_is_mended_the_robot_can_be_engaged() -> None:
    run = engaged(lying("frozen", 1.0, ",until_s=2.0"))
    assert run.slave.guard.state == "track"


def test_who_is_engaged_goes_on_with_every_other_joint() -> None:
    run = VirtualWorld(lying("frozen", 15.0))
    run.run(6.0)
    assert run.ask(Action.ENGAGE).done
    run.run(20.0, until=lambda: run.slave.guard.state == "track")
    run.run(16.0 - 1e-9 * run.now_ns + 1.0)
    names = run.slave_config.skeleton.joint_names
    invalid = {name for name, valid in zip(names, run.commands[-1].valid, strict=True) if not valid}
    assert invalid == HELD
    assert NODE in run.commands[-1].doubt
    assert run.slave.guard.state == "track", run.slave.guard.reason
