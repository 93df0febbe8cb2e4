"""How a master comes to hold a robot's lease, and notices that it does not any more. Pure."""

from __future__ import annotations

from common.clock import to_ns
from common.wire.lease import lease_id
from common.wire.messages import Action, ControlReply, ControlRequest, SaidOfRobot

RETRY_S = 0.25
"""Between two claims: a restarted master waits out the lease of its predecessor (1 s)."""
GRACE_S = 0.5
"""State messages under way when the claim was granted still tell the old holder."""


class LeaseKeeper:
    """Claims once the robot is heard, keeps the token, drops it when the robot names another lease."""

    def __init__(self, robot: str, operator: str, clock: int = 0) -> None:
        """`clock`: the number by which this master asks for the slave's clock (`MasterExchange.asker`)."""
        self._robot = robot
        self._operator = operator
        self._clock = clock
        self._next_claim_ns = 0
        self._granted_ns = 0
        self.token = 0
        self.lost_ns = 0
        """When the lease was lost last; 0: never."""
        self.instance = 0
        """Which of the processes of that name granted the lease."""
        self.answer = "the robot has not been asked yet"

    def request(self, now_ns: int) -> ControlRequest | None:
        """Build the claim to send now, if one is due."""
        if self.token or now_ns < self._next_claim_ns:
            return None
        self._next_claim_ns = now_ns + to_ns(RETRY_S)
        return ControlRequest(self._robot, Action.CLAIM, self._operator, clock=self._clock)

    def on_reply(self, reply: ControlReply, now_ns: int) -> None:
        """Take the robot's answer to a claim."""
        self.answer = reply.text
        if reply.done:
            self.token, self.instance = reply.lease, reply.instance
            self._granted_ns = now_ns

    def holds(self, state: SaidOfRobot) -> bool:
        """Whether the robot says that this master's lease is the live one; another's may bear its name."""
        return self.token != 0 and state.instance == self.instance and state.lease_id == lease_id(self.token)

    def on_state(self, state: SaidOfRobot, now_ns: int) -> None:
        """Notice a lease that was lost: it is claimed anew, but only a person engages again."""
        settled = now_ns - self._granted_ns > to_ns(GRACE_S)
        if self.token and settled and not self.holds(state):
            self.token, self.lost_ns = 0, now_ns
            self.answer = f"the lease was lost to {self._other(state.operator)}"

    def _other(self, operator: str) -> str:
        if operator == self._operator:
            return f"another master of {operator}"
        return operator or "nobody"
