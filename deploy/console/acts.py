"""What a person asks of a robot on the page, sent the way the command line sends it, answered in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from common.link import Link
from common.wire.messages import Action
from common.wire.together import TOGETHER
from deploy.client.answer import RobotAnswer
from deploy.client.ask import ask
from deploy.client.destination import Destination
from deploy.console.session import Person

ACTS = {
    action.value: action
    for action in (
        Action.ENGAGE, Action.DISENGAGE, Action.REST, Action.TAKE_UP, Action.HANDOVER, Action.RESET,
        Action.HOME, Action.TAKE, Action.RELEASE,
    )
}  # fmt: skip
"""What `/api/act` takes; the stop goes its own way, without a role."""
MARK = "mark"
"""A line that a person adds to the events: no request to a robot."""
OF_THE_LIST = (Action.TAKE, Action.RELEASE)
"""What may be asked of a robot that this console only lists."""
MOVES = (Action.ENGAGE, Action.TAKE_UP)
"""After these a robot follows the suit."""
_MOST_GROUPS = 16
_LONGEST = 128


class ActRefusedError(Exception):
    """The request is not one, or this person may not make it."""

    def __init__(self, status: int, words: str) -> None:
        super().__init__(words)
        self.status = status
        """Of HTTP."""


@dataclass(frozen=True, slots=True)
class ActRequest:
    """One act, well formed."""

    action: Action
    robot: str
    key: str = ""
    """The reset key; for `handover` the operator who shall take the robot."""
    groups: tuple[str, ...] = ()


def read_act(
    body: object, robots: tuple[str, ...], person: Person, lists: Callable[[str], bool] = lambda _: False
) -> ActRequest:
    """The act of a request's body. Raises ActRefusedError with the words for the person.

    `lists`: whether the console's list has a robot that it has not opened.
    """
    if not isinstance(body, dict):
        raise ActRefusedError(400, "expected an object")
    action = ACTS.get(_text(body, "act"))
    if action is None:
        raise ActRefusedError(400, f"no such act: expected one of {', '.join(ACTS)}")
    robot = _text(body, "robot")
    if action not in OF_THE_LIST or not lists(robot):
        robot = _robot(body, robots)
    may_act(person)
    key = _text(body, "to" if action is Action.HANDOVER else "key")
    if not key and action in (Action.RESET, Action.HOME, Action.HANDOVER):
        raise ActRefusedError(400, "to whom?" if action is Action.HANDOVER else "the robot's key is missing")
    if action is Action.ENGAGE:
        key = TOGETHER if body.get("together") is True else ""
    groups = body.get("groups", [])
    if not isinstance(groups, list) or not all(isinstance(each, str) for each in groups):
        raise ActRefusedError(400, "groups: expected a list of joint groups")
    if action in (Action.REST, Action.TAKE_UP) and not 0 < len(groups) <= _MOST_GROUPS:
        raise ActRefusedError(400, "which joint groups?")
    return ActRequest(action, robot, key, tuple(groups))


def read_mark(body: dict[str, object], robots: tuple[str, ...], person: Person) -> tuple[str, str]:
    """Robot and words of a mark. Raises ActRefusedError."""
    robot = _robot(body, robots)
    may_act(person)
    return robot, _text(body, "text") or "mark"


def _robot(body: Mapping[str, object], robots: tuple[str, ...]) -> str:
    robot = _text(body, "robot") or robots[0]
    if robot not in robots:
        raise ActRefusedError(400, f"no such robot here: expected one of {', '.join(robots)}")
    return robot


def may_act(person: Person) -> None:
    """Raises ActRefusedError where this person may do no more than stop."""
    if not person.role.acts:
        status = 403 if person.name else 401
        raise ActRefusedError(status, "log in first: this is for an operator or an engineer. Anyone may stop")


async def carry_out(request: ActRequest, link: Link, where: Destination) -> RobotAnswer:
    """Ask the robot. Where several bear its name, what the first answers, with all of their words."""
    answers = await ask(
        link, replace(where, robots=(request.robot,)), request.action, request.key, request.groups
    )
    words = "; ".join(dict.fromkeys(answer.text for answer in answers))
    return replace(answers[0], done=all(answer.done for answer in answers), text=words)


def _text(body: Mapping[str, object], name: str) -> str:
    value = body.get(name, "")
    if not isinstance(value, str) or len(value) > _LONGEST:
        raise ActRefusedError(400, f"{name}: expected a short text")
    return value
