"""`[link]`: where a session listens and connects, its keys, who may do what, and how topics travel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from common.config.section import RelativePath, Section
from common.errors import ConfigMistake
from common.link.endpoint import SECURE, check_endpoint, transport_of
from common.wire.topics import QUESTIONS, TOPICS, Priority, Topic

Endpoint = Annotated[str, AfterValidator(check_endpoint)]
NAME = r"^[A-Za-z0-9][A-Za-z0-9_.-]{0,47}$"
Name = Annotated[str, Field(pattern=NAME)]
"""Of a robot, a person or a router, as in its certificate. 48 characters, so that a role fits before it."""


class TlsConfig(Section):
    """`[link.tls]`: this host's certificate and key, and the authority that it trusts."""

    ca: RelativePath
    """The authority's certificate. A host without a certificate from it is refused."""
    certificate: RelativePath
    key: RelativePath


PATTERN = r"^[A-Za-z0-9*][A-Za-z0-9_.*-]{0,47}$"
Pattern = Annotated[str, Field(pattern=PATTERN)]
"""A robot's name, or a pattern of names of the list `robots`, such as `ward-*`."""


class AccessConfig(Section):
    """`[link.access]`: who may do what, by the names in the certificates. The same lines fit every host."""

    robots: list[Name] = Field(default_factory=list)
    """The robots that patterns in the tables stand for. Each robot proves its own name by its certificate, so
    each is listed; a robot that a table names itself need not be."""
    operators: dict[Name, list[Pattern]] = Field(default_factory=dict)
    """The robots that each operator may command, and whose video the operator receives."""
    observers: dict[Name, list[Pattern]] = Field(default_factory=dict)
    """The robots whose commands, states and statistics each observer receives, but not their video."""
    viewers: dict[Name, list[Pattern]] = Field(default_factory=dict)
    """The robots of which each viewer receives what an observer does, and their video."""
    routers: list[Name] = Field(default_factory=list)
    """Routers that may forward all of this. A router enforces these rules towards all other hosts."""

    @property
    def all_robots(self) -> list[str]:
        """Every robot that is listed or that the tables name, in the order of the file."""
        tables = (self.operators, self.observers, self.viewers)
        named = [one for table in tables for robots in table.values() for one in robots if "*" not in one]
        return list(dict.fromkeys([*self.robots, *named]))

    def names(self, table: Mapping[str, Sequence[str]], robot: str) -> list[str]:
        """Those of a table to whom it gives the robot."""
        return [name for name, robots in table.items() if any(fnmatchcase(robot, one) for one in robots)]

    def mistakes(self) -> list[ConfigMistake]:
        """Patterns that stand for no robot: whoever wrote them expects them to permit something."""
        known = self.all_robots
        return [
            ConfigMistake(f"link.access.{key}.{name}", one, "a pattern of a robot in link.access.robots")
            for key in ("operators", "observers", "viewers")
            for name, robots in getattr(self, key).items()
            for one in robots
            if "*" in one and not any(fnmatchcase(robot, one) for robot in known)
        ]


class TopicConfig(Section):
    """`[link.topics.NAME]`: quality of service of one topic, where it shall not be the table's."""

    reliable: bool | None = None
    """Whether a lost message is sent again: a live one is better replaced by the next."""
    priority: Annotated[Priority | None, Field(strict=False)] = None
    express: bool | None = None
    """Never waits to be sent together with others."""
    congestion: Literal["drop", "block"] = "drop"

    @model_validator(mode="after")
    def _never_blocks(self) -> Self:
        if self.congestion == "block":
            raise ValueError(
                'expected congestion = "drop": with "block" an outage of 5 s was measured to freeze '
                "the servo loop for 5 s; use drop: it discards only outdated messages"
            )
        return self

    def over(self, topic: Topic) -> Topic:
        """The topic with these values in place of its own."""
        return topic.with_quality(self.reliable, self.priority, self.express)


class TwinConfig(Section):
    """`[link.twin]`: a second path beside `[link]`'s, such as a cellular one beside Wi-Fi.

    All is sent on both, and what comes first counts. Both hosts need it.
    """

    listen: list[Endpoint] = Field(default_factory=list)
    connect: list[Endpoint] = Field(default_factory=list)


class LinkConfig(Section):
    """`[link]`: Zenoh endpoints, such as `tcp/192.168.7.2:7447`, `tls/…`, `quic/…`, `unixsock-stream/…`."""

    listen: list[Endpoint] = Field(default_factory=list)
    """Where other sessions may connect to this one."""
    connect: list[Endpoint] = Field(default_factory=list)
    """Which sessions to connect to; they may start later, or again."""
    mode: Literal["peer", "client"] = "peer"
    """`peer`: directly to each other. `client`: through the routers at `connect`, the first that answers."""
    open_timeout_s: float = Field(default=1.5, ge=0.1, le=30.0)
    """How long opening a connection may take: three round trips of the line over tcp and quic, four over tls,
    and a margin. Over 150 ms each way that was measured to be 0.93, 0.96 and 1.25 s. Over a slower line no
    connection comes about; much longer than needed, it delays the return after an outage."""
    tcp_congestion_control: str | None = Field(default=None, pattern=r"^[a-z0-9_-]{1,15}$")
    """Of this process's tcp, tls and ws connections, such as `cubic`; unset: the host's. Set it on both
    hosts: each decides how it sends."""
    tls: TlsConfig | None = None
    revoked: RelativePath | None = None
    """A list of certificates' names that are refused before they expire; it is read again while running."""
    access: AccessConfig | None = None
    twin: TwinConfig | None = None
    topics: dict[str, TopicConfig] = Field(default_factory=dict)

    def quality(self, topic: Topic) -> Topic:
        """The topic as it shall travel here."""
        override = self.topics.get(topic.name)
        return topic if override is None else override.over(topic)

    def mistakes(self) -> list[ConfigMistake]:
        """Keys that do not fit each other; what of the installed Zenoh cannot work as asked."""
        return [
            *self._mode_mistakes(), *self._security_mistakes(), *self._topic_mistakes(),
            *self._twin_mistakes(),
        ]  # fmt: skip

    @property
    def second(self) -> LinkConfig | None:
        """The link of the second path; None where there is one path."""
        if self.twin is None:
            return None
        ends = {"listen": self.twin.listen, "connect": self.twin.connect, "twin": None}
        return self.model_copy(update=ends)

    @property
    def all_listen(self) -> list[str]:
        """Where sessions may connect to, on every path."""
        return [*self.listen, *(self.twin.listen if self.twin else ())]

    @property
    def all_connect(self) -> list[str]:
        """What is connected to, on every path."""
        return [*self.connect, *(self.twin.connect if self.twin else ())]

    def _twin_mistakes(self) -> list[ConfigMistake]:
        second = self.second
        if second is None:
            return []
        if self.mode == "client":
            return [ConfigMistake("link.twin", "…", 'mode = "peer": two paths lead straight to the robot')]
        if not (second.listen or second.connect):
            return [ConfigMistake("link.twin", "…", "an endpoint under listen or connect")]
        shared = {*self.listen, *self.connect} & {*second.listen, *second.connect}
        same = [ConfigMistake("link.twin", end, "an endpoint that [link] does not have") for end in shared]
        return same + [
            ConfigMistake(f"link.twin.{each.key.removeprefix('link.')}", each.value, each.expected)
            for each in second._security_mistakes()
            if each.key.startswith(("link.listen", "link.connect"))
        ]

    def _mode_mistakes(self) -> list[ConfigMistake]:
        if self.mode == "client" and self.listen:
            return [
                ConfigMistake("link.listen", self.listen, 'nothing with mode = "client": it only connects')
            ]
        if self.mode == "client" and not self.connect:
            return [ConfigMistake("link.connect", self.connect, "a router's endpoint with mode = 'client'")]
        return []

    def _security_mistakes(self) -> list[ConfigMistake]:
        ends = [("listen", e) for e in self.listen] + [("connect", e) for e in self.connect]
        secure = [(key, e) for key, e in ends if transport_of(e) in SECURE]
        open_ends = [(key, e) for key, e in ends if transport_of(e) not in SECURE]
        if secure and self.tls is None:
            where, end = secure[0]
            what = "the keys for it under [link.tls]: ca, certificate, key (make them with `tandem keys`)"
            return [ConfigMistake(f"link.{where}", end, what)]
        if self.revoked is not None and self.tls is None:
            what = "[link.tls] beside it: without certificates there is none to revoke"
            return [ConfigMistake("link.revoked", str(self.revoked), what)]
        if self.access is not None and self.tls is None:
            what = "[link.tls] beside it: certificates prove who is at the other end"
            return [ConfigMistake("link.access", "…", what)]
        if self.access is not None:
            what = f"one of {', '.join(SECURE)}, as there is [link.access]: others do not prove who connects"
            return [
                *(ConfigMistake(f"link.{key}", end, what) for key, end in open_ends),
                *self.access.mistakes(),
            ]
        return []

    def _topic_mistakes(self) -> list[ConfigMistake]:
        adjustable = [name for name in TOPICS if name != "alive"]
        found = [
            ConfigMistake(f"link.topics.{name}", "…", f"one of the topics {', '.join(adjustable)}")
            for name in self.topics
            if name not in adjustable
        ]
        for name in QUESTIONS:
            if name in self.topics and self.topics[name].reliable is False:
                what = "true: a question and its answer are always reliable"
                found.append(ConfigMistake(f"link.topics.{name}.reliable", False, what))
        return found
