"""One question to a robot from the command line: engage, disengage, estop, reset, status."""

from __future__ import annotations

from pathlib import Path

from common.config import LinkConfig, check_config
from common.control import ask_control
from common.errors import LinkTimeoutError
from common.link import open_link
from common.messages import Action, ControlReply, ControlRequest
from common.topics import CONTROL


async def ask_robot(
    robot: str, action: Action, connect: list[str], operator: str = "", key: str = ""
) -> ControlReply:
    """Ask the robot at one of the endpoints.

    Raises ConfigError for an endpoint that is none, LinkError when the robot does not answer.
    """
    config = check_config(Path("command line"), {"connect": connect}, LinkConfig)
    async with open_link(config, robot) as link:
        try:
            await link.connected(CONTROL)
        except LinkTimeoutError:
            where = ", ".join(connect)
            raise LinkTimeoutError(
                f"{robot} does not answer at {where}: is `tandem slave` running, with that robot name, "
                "and listening there?"
            ) from None
        request = ControlRequest(robot, action, operator, key)
        return await ask_control(lambda payload: link.ask(CONTROL, payload), request)
