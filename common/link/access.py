"""`[link.access]` as Zenoh's access control: a message that no rule allows is refused. Pure.

Flows are named from this host's side: `ingress` comes from the subject, `egress` goes to it. A publisher of a
key must also receive its subscribers' declarations, or it would send nothing. Subjects are common names of
certificates. A robot hears every operator's key by one declaration with a wildcard, which each operator
receives; what an operator sends is allowed on the operator's own keys alone. Likewise a list of robots hears
all summaries by one declaration; each listener is sent those of its own robots alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypedDict

from common.link.config import AccessConfig
from common.link.roles import Role, common_name
from common.wire.presence import operator_alive_key
from common.wire.topics import (
    ALIVE,
    CALL,
    CLOCK,
    COMMAND,
    CONTROL,
    KEYFRAME,
    OPERATOR_VOICE,
    PATH,
    STATE,
    STATISTICS,
    STOP,
    SUMMARY,
    TRUTH,
    VIDEO,
    VOICE,
    Topic,
)

HEARD = (COMMAND, STATE, STATISTICS, SUMMARY, TRUTH)
"""Topics that an observer of a robot receives; viewers and operators receive the video too."""
_WAYS = {
    "put": ((("put", "delete"), "ingress"),),
    "hears": ((("declare_subscriber",), "egress"),),
    "may hear": ((("declare_subscriber",), "ingress"),),
    "hear": ((("declare_subscriber",), "ingress"), (("put", "delete"), "egress")),
    "query": ((("query",), "ingress"), (("reply",), "egress")),
    "answers": ((("declare_queryable",), "egress"),),
    "answer": ((("declare_queryable", "reply"), "ingress"), (("query",), "egress")),
    "live": ((("liveliness_token",), "ingress"),),
    "watch": (
        (("declare_liveliness_subscriber", "liveliness_query"), "ingress"),
        (("liveliness_token",), "egress"),
    ),
    "watched": ((("declare_liveliness_subscriber", "liveliness_query"), "egress"),),
}
"""Each permission for a key, as Zenoh's messages and their direction."""
_PUBLISH = ("put", "hears")
_ASK = ("query", "answers")
_ALL = (*_PUBLISH, "hear", *_ASK, "answer", "live", "watch", "watched")


class AccessRule(TypedDict):
    """One entry of Zenoh's `access_control.rules`."""

    id: str
    permission: str
    flows: list[str]
    messages: list[str]
    key_exprs: list[str]


class AccessSubject(TypedDict):
    """One host, by the common name of its certificate."""

    id: str
    cert_common_names: list[str]


class AccessPolicy(TypedDict):
    """Which rules apply to which subjects."""

    rules: list[str]
    subjects: list[str]


class AccessControl(TypedDict):
    """Zenoh's `access_control`."""

    enabled: bool
    default_permission: str
    rules: list[AccessRule]
    subjects: list[AccessSubject]
    policies: list[AccessPolicy]


def all_but(revoked: frozenset[str]) -> AccessControl:
    """Zenoh's `access_control` without [link.access]: every certificate may do everything but the revoked."""
    messages = sorted({message for way in _WAYS.values() for each, _ in way for message in each})
    names = sorted(revoked)
    return {
        "enabled": True,
        "default_permission": "allow",
        "rules": [{
            "id": "revoked", "permission": "deny", "flows": ["ingress", "egress"], "messages": messages,
            "key_exprs": ["**"],
        }],
        "subjects": [{"id": name, "cert_common_names": [name]} for name in names],
        "policies": [{"rules": ["revoked"], "subjects": names}],
    }  # fmt: skip


def access_control(access: AccessConfig, revoked: frozenset[str] = frozenset()) -> AccessControl:
    """Zenoh's `access_control`: rules, subjects and policies for [link.access], less the revoked."""
    table = _AccessRules(revoked)
    for router in access.routers:
        table.allow([common_name(Role.ROUTER, router)], _ALL, ["tandem/**", SUMMARY.key_for("**")])
    for robot in access.all_robots:
        _robot(table, access, robot)
    everyone = sorted(named(access))
    # every named host may see who is present, and may stop a robot
    table.allow(everyone, ("watch", "watched"), [_alive("*", "**"), f"{operator_alive_key('*')}/**"])
    table.allow(everyone, ("hears", "may hear"), [SUMMARY.key_for("*")])
    for name in access.operators:
        table.allow([common_name(Role.OPERATOR, name)], ("live",), [f"{operator_alive_key(name)}/**"])
    table.allow(everyone, _ASK, [STOP.key_for("*")])
    return table.zenoh()


def named(access: AccessConfig) -> set[str]:
    """The common name of every host in [link.access]."""
    people = [(Role.OPERATOR, access.operators), (Role.OBSERVER, access.observers | access.viewers)]
    of_people = {common_name(role, name) for role, table in people for name in table}
    robots = {common_name(Role.ROBOT, robot) for robot in access.all_robots}
    return of_people | robots | {common_name(Role.ROUTER, router) for router in access.routers}


def operators_of(access: AccessConfig | None, robot: str) -> frozenset[str] | None:
    """The operators who may command a robot; None: there are no rules, so whoever reaches it."""
    return None if access is None else frozenset(access.names(access.operators, robot))


def _robot(table: _AccessRules, access: AccessConfig, robot: str) -> None:
    me = [common_name(Role.ROBOT, robot)]
    commanding = access.names(access.operators, robot)
    operators = [common_name(Role.OPERATOR, name) for name in commanding]
    viewers = [common_name(Role.OBSERVER, name) for name in access.names(access.viewers, robot)]
    observers = [common_name(Role.OBSERVER, name) for name in access.names(access.observers, robot)]
    video = _key(VIDEO, robot).rpartition("/")[0] + "/*"
    keyframe = _key(KEYFRAME, robot).rpartition("/")[0] + "/*"
    table.allow(me, _PUBLISH, [*(_key(topic, robot) for topic in (STATE, STATISTICS, SUMMARY)), video])
    table.allow(me, ("hear",), [_key(COMMAND, robot), keyframe])
    table.allow(me, ("answer",), [_key(topic, robot) for topic in (CONTROL, STOP, CLOCK, PATH, CALL)])
    # a person at the robot calls from the robot's own host, by the robot's certificate
    table.allow(me, _ASK, [_key(CALL, robot)])
    # the operators and the person at the robot talk; nobody else hears them
    table.allow(me, _PUBLISH, [_key(VOICE, robot)])
    table.allow(me, ("hear",), [_key(OPERATOR_VOICE, robot)])
    table.allow(operators, ("hear",), [_key(VOICE, robot)])
    table.allow(operators, ("hears",), [_key(OPERATOR_VOICE, robot)])
    # who may see the pictures may ask for one that stands alone
    table.allow([*operators, *viewers], _PUBLISH, [keyframe])
    table.allow(me, ("live",), [_alive(robot, "slave/**")])
    table.allow(operators, _PUBLISH, [_key(STATISTICS, robot), _key(TRUTH, robot)])
    table.allow(operators, ("hears",), [_key(COMMAND, robot)])
    table.allow(operators, ("answers",), [_key(CONTROL, robot)])
    for name in commanding:
        operator = [common_name(Role.OPERATOR, name)]
        own = [_key(topic.of(name), robot) for topic in (COMMAND, OPERATOR_VOICE)]
        table.allow(operator, ("put",), own)
        table.allow(operator, ("query",), [_key(CONTROL.of(name), robot)])
    table.allow(operators, ("hear",), [*(_key(topic, robot) for topic in HEARD), video])
    table.allow(operators, _ASK, [_key(CLOCK, robot), _key(PATH, robot)])
    table.allow(operators, ("live",), [_alive(robot, "master/**")])
    table.allow([*observers, *viewers], ("hear",), [_key(topic, robot) for topic in HEARD])
    table.allow(viewers, ("hear",), [video])


def _key(topic: Topic, robot: str) -> str:
    return topic.key_for(robot)


def _alive(robot: str, role: str) -> str:
    return f"{ALIVE.key_for(robot)}/{role}"


class _AccessRules:
    """The rules so far, each with the subjects to which it applies."""

    def __init__(self, revoked: frozenset[str]) -> None:
        self._revoked = revoked
        self.subjects: set[str] = set()
        self._rules: list[AccessRule] = []
        self._applies: list[list[str]] = []

    def allow(self, names: Iterable[str], ways: Iterable[str], keys: list[str]) -> None:
        names = [name for name in names if name not in self._revoked]
        if not names:
            return
        self.subjects.update(names)
        for way in ways:
            for messages, flow in _WAYS[way]:
                self._rules.append({
                    "id": f"{len(self._rules)}-{way}-{flow}", "permission": "allow", "flows": [flow],
                    "messages": list(messages), "key_exprs": keys,
                })  # fmt: skip
                self._applies.append(names)

    def zenoh(self) -> AccessControl:
        return {
            "enabled": True,
            "default_permission": "deny",
            "rules": self._rules,
            "subjects": [{"id": name, "cert_common_names": [name]} for name in sorted(self.subjects)],
            "policies": [
                {"rules": [rule["id"]], "subjects": names}
                for rule, names in zip(self._rules, self._applies, strict=True)
            ],
        }
