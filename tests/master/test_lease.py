"""The master claims once, keeps its token, and notices that it has lost the lease."""

from __future__ import annotations

import numpy as np

from common.clock import NS_PER_S, to_ns
from common.wire.lease import lease_id
from common.wire.messages import Action, ControlReply, RobotState
from master.lease import GRACE_S, RETRY_S, LeaseKeeper


def state(operator: str, token: int = 0) -> RobotState:
    zeros = np.zeros(25)
    return RobotState(
        "r", 1, 1, 1, "hold", "", operator, np.ones(25, np.bool_), zeros, zeros, None, 0, 1,
        lease_id=lease_id(token),
    )  # fmt: skip


def test_the_claim_names_the_clock_that_will_stamp_the_commands() -> None:
    request = LeaseKeeper("r", "nurse", clock=7).request(0)
    assert request is not None
    assert request.clock == 7


def granted(now_ns: int = NS_PER_S) -> LeaseKeeper:
    keeper = LeaseKeeper("r", "nurse")
    assert keeper.request(now_ns) is not None
    keeper.on_reply(ControlReply(True, "hold", "yours", lease=7), now_ns)
    return keeper


def test_it_claims_under_its_name() -> None:
    request = LeaseKeeper("r", "nurse").request(0)
    assert request is not None
    assert (request.action, request.operator, request.robot) == (Action.CLAIM, "nurse", "r")


def test_a_refused_claim_is_repeated_but_not_hammered() -> None:
    keeper = LeaseKeeper("r", "nurse")
    assert keeper.request(0) is not None
    keeper.on_reply(ControlReply(False, "track", "other holds the lease"), 1)
    assert keeper.token == 0
    assert "other" in keeper.answer
    assert keeper.request(to_ns(RETRY_S) - 1) is None
    assert keeper.request(to_ns(RETRY_S)) is not None


def test_a_granted_lease_is_kept() -> None:
    keeper = granted()
    keeper.on_state(state("nurse", token=7), 10 * NS_PER_S)
    assert keeper.token == 7
    assert keeper.request(20 * NS_PER_S) is None


def test_states_under_way_at_the_grant_do_not_drop_it() -> None:
    keeper = granted()
    keeper.on_state(state(""), NS_PER_S + to_ns(GRACE_S))
    assert keeper.token == 7


def test_a_lost_lease_is_noticed_and_claimed_anew() -> None:
    keeper = granted()
    keeper.on_state(state(""), NS_PER_S + to_ns(GRACE_S) + 1)
    assert keeper.token == 0
    assert "lost to nobody" in keeper.answer
    assert keeper.request(5 * NS_PER_S) is not None


def test_the_loser_to_another_master_of_the_same_name_notices() -> None:
    keeper = granted()
    assert keeper.holds(state("nurse", token=7))
    assert not keeper.holds(state("nurse", token=8))
    keeper.on_state(state("nurse", token=8), 10 * NS_PER_S)
    assert keeper.token == 0
    assert "another master of nurse" in keeper.answer


def test_who_holds_no_lease_holds_none_that_is_free() -> None:
    assert not LeaseKeeper("r", "nurse").holds(state(""))
