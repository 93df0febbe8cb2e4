"""`[link.access]` as Zenoh's access control: a message that no rule allows is refused. Pure.

Flows are named from this host's side: `ingress` comes from the subject, `egress` goes to it. A publisher of a
key must also receive its subscribers' declarations, or it would send nothing. Subjects are common names of
certificates. A robot hears every operator's key by one declaration with a wildcard, which each operator
receives; what an operator sends is allowed on the operator's own keys alone. Likewise a list of robots hears
all summaries by one declaration; each listener is sent those of its own robots alone.

The rules grow with robots + people, not with their product: a robot's rules name the robot alone, a person's
rules name that person's patterns (`ward-*` is `ward-$*` in a key), and people with the same patterns share
all rules but those of their own keys. A pattern's key also fits names that are not listed; no subject bears
such a name, so nobody may hear or answer there.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
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
_SEEN = (VIDEO, KEYFRAME)
"""Topics with a key for each camera: the rules are for all cameras."""


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
    table.allow(
        [common_name(Role.ROUTER, router) for router in access.routers],
        _ALL,
        ["tandem/**", SUMMARY.key_for("**")],
    )
    for robot in access.all_robots:
        _robot(table, robot)
    for names, patterns in _alike(access.operators):
        _operators(table, names, _places(patterns))
    for names, patterns in _alike(access.observers):
        _observers(table, names, _places(patterns))
    for names, patterns in _alike(access.viewers):
        _viewers(table, names, _places(patterns))
    everyone = sorted(named(access))
    # every named host may see who is present, and may stop a robot
    table.allow(everyone, ("watch", "watched"), [_alive("*", "**"), f"{operator_alive_key('*')}/**"])
    table.allow(everyone, ("hears", "may hear"), [SUMMARY.key_for("*")])
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


def robot_chunk(pattern: str) -> str:
    """The part of a key that fits the robots of a pattern, and no `/`: `ward-*` is `ward-$*`."""
    chunk = re.sub(r"\*+", "$*", pattern)
    return "*" if chunk == "$*" else chunk


def _robot(table: _AccessRules, robot: str) -> None:
    me, here = [common_name(Role.ROBOT, robot)], [robot]
    # the operators and the person at the robot talk; nobody else hears them
    table.allow(me, _PUBLISH, _keys(here, STATE, STATISTICS, SUMMARY, VIDEO, VOICE))
    table.allow(me, ("hear",), _keys(here, COMMAND, KEYFRAME, OPERATOR_VOICE))
    table.allow(me, ("answer",), _keys(here, CONTROL, STOP, CLOCK, PATH, CALL))
    # a person at the robot calls from the robot's own host, by the robot's certificate
    table.allow(me, _ASK, _keys(here, CALL))
    table.allow(me, ("live",), [_alive(robot, "slave/**")])


def _operators(table: _AccessRules, names: Sequence[str], robots: Sequence[str]) -> None:
    """Rules of operators who may command the same robots."""
    operators = [common_name(Role.OPERATOR, name) for name in names]
    table.allow(operators, _PUBLISH, _keys(robots, STATISTICS, TRUTH, KEYFRAME))
    table.allow(operators, ("hears",), _keys(robots, COMMAND, OPERATOR_VOICE))
    table.allow(operators, ("hear",), _keys(robots, *HEARD, VIDEO, VOICE))
    table.allow(operators, ("answers",), _keys(robots, CONTROL))
    table.allow(operators, _ASK, _keys(robots, CLOCK, PATH))
    table.allow(operators, ("live",), [_alive(robot, "master/**") for robot in robots])
    for name, operator in zip(names, operators, strict=True):
        table.allow([operator], ("put",), _keys(robots, COMMAND.of(name), OPERATOR_VOICE.of(name)))
        table.allow([operator], ("query",), _keys(robots, CONTROL.of(name)))
        table.allow([operator], ("live",), [f"{operator_alive_key(name)}/**"])


def _observers(table: _AccessRules, names: Sequence[str], robots: Sequence[str]) -> None:
    observers = [common_name(Role.OBSERVER, name) for name in names]
    table.allow(observers, ("hear",), _keys(robots, *HEARD))


def _viewers(table: _AccessRules, names: Sequence[str], robots: Sequence[str]) -> None:
    viewers = [common_name(Role.OBSERVER, name) for name in names]
    table.allow(viewers, ("hear",), _keys(robots, *HEARD, VIDEO))
    # who may see the pictures may ask for one that stands alone
    table.allow(viewers, _PUBLISH, _keys(robots, KEYFRAME))


def _alike(table: Mapping[str, Sequence[str]]) -> list[tuple[list[str], frozenset[str]]]:
    """The names of a table of [link.access], those with the same patterns together."""
    groups: dict[frozenset[str], list[str]] = {}
    for name, patterns in table.items():
        groups.setdefault(frozenset(patterns), []).append(name)
    return [(names, patterns) for patterns, names in groups.items()]


def _places(patterns: Iterable[str]) -> list[str]:
    """The parts of a key for the robots of the patterns; one that another includes adds nothing."""
    chunks = {robot_chunk(pattern) for pattern in patterns}
    return ["*"] if "*" in chunks else sorted(chunks)


def _keys(robots: Sequence[str], *topics: Topic) -> list[str]:
    return [_key(topic, robot) for topic in topics for robot in robots]


def _key(topic: Topic, robot: str) -> str:
    key = topic.key_for(robot)
    return f"{key.rpartition('/')[0]}/*" if topic in _SEEN else key


def _alive(robot: str, role: str) -> str:
    return f"{ALIVE.key_for(robot)}/{role}"


class _AccessRules:
    """The rules so far, by those to whom they apply."""

    def __init__(self, revoked: frozenset[str]) -> None:
        self._revoked = revoked
        self._rules: list[AccessRule] = []
        self._applying: dict[tuple[str, ...], list[str]] = {}

    def allow(self, names: Iterable[str], ways: Iterable[str], keys: list[str]) -> None:
        """Permit each way with each key. Nobody and no key: no rule, as Zenoh takes none that is empty."""
        subjects = tuple(name for name in names if name not in self._revoked)
        if not subjects or not keys:
            return
        for way in ways:
            for messages, flow in _WAYS[way]:
                identity = f"{len(self._rules)}-{way}-{flow}"
                self._rules.append({
                    "id": identity, "permission": "allow", "flows": [flow], "messages": list(messages),
                    "key_exprs": keys,
                })  # fmt: skip
                self._applying.setdefault(subjects, []).append(identity)

    def zenoh(self) -> AccessControl:
        names = sorted({name for subjects in self._applying for name in subjects})
        return {
            "enabled": True,
            "default_permission": "deny",
            "rules": self._rules,
            "subjects": [{"id": name, "cert_common_names": [name]} for name in names],
            "policies": [
                {"rules": rules, "subjects": list(subjects)} for subjects, rules in self._applying.items()
            ],
        }
