"""One question to a robot from the command line: engage, disengage, estop, reset, status."""

from __future__ import annotations

from common.codec import decode, encode
from common.config import LinkConfig
from common.link import open_link
from common.messages import Action, ControlReply, ControlRequest
from common.topics import CONTROL


async def ask_robot(
    robot: str, action: Action, connect: list[str], operator: str = "", key: str = ""
) -> ControlReply:
    """Ask the robot at one of the endpoints. Raises LinkError when it does not answer."""
    async with open_link(LinkConfig(connect=connect), robot) as link:
        await link.connected(CONTROL)
        reply = await link.ask(CONTROL, encode(ControlRequest(robot, action, operator, key)))
        return decode(reply, ControlReply)
