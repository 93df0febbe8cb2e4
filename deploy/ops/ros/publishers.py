"""Publishes on the ROS side, in a Zenoh session of its own that hears nothing. The adapter of Zenoh there."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from enum import StrEnum

import zenoh

from common.clock import monotonic_ns
from common.log.throttle import LogThrottle
from deploy.ros.keys import (
    RosTopic,
    attachment,
    data_key,
    dds_bridge_key,
    dds_bridge_tokens,
    node_token,
    publisher_gid,
    publisher_token,
)

log = logging.getLogger(__name__)
_FIRST_ENTITY = 1
"""0 is the node's."""


class KeyFormat(StrEnum):
    """Who listens on the ROS side."""

    RMW_ZENOH = "rmw_zenoh"
    ROS2DDS = "ros2dds"


@dataclass(slots=True)
class _RosPublisher:
    publisher: zenoh.Publisher
    gid: bytes
    sequence: int = 0


class RosPublishers:
    """The publishers of one node; each is declared and shown by a token with its first message."""

    def __init__(self, session: zenoh.Session, node: str, domain: int, keys: KeyFormat) -> None:
        self._session, self._node, self._domain, self._keys = session, node, domain, keys
        self._id = str(session.info.zid())
        self._publishers: dict[RosTopic, _RosPublisher] = {}
        self._tokens: dict[str, zenoh.LivelinessToken] = {}
        self._throttle = LogThrottle()
        self.sent: dict[str, int] = {}
        """Messages by topic."""
        if keys is KeyFormat.RMW_ZENOH:
            self._show(node_token(domain, self._id, node))

    def put(self, topic: RosTopic, payload: bytes, wall_ns: int) -> None:
        """Publish a message; it never blocks, and failures are logged once a second."""
        try:
            one = self._publishers.get(topic) or self._declare(topic)
            one.sequence += 1
            one.publisher.put(payload, attachment=attachment(one.sequence, wall_ns, one.gid))
        except zenoh.ZError as error:
            if self._throttle.passes(monotonic_ns()):
                log.warning("%s: not published: %s", topic.name, error)
        else:
            self.sent[topic.name] = self.sent.get(topic.name, 0) + 1

    def _declare(self, topic: RosTopic) -> _RosPublisher:
        if self._keys is KeyFormat.RMW_ZENOH:
            key = data_key(self._domain, topic)
            entity = _FIRST_ENTITY + len(self._publishers)
            tokens = [publisher_token(self._domain, self._id, entity, self._node, topic)]
        else:
            key = dds_bridge_key(topic)
            tokens = list(dds_bridge_tokens(self._id, topic))
        publisher = self._session.declare_publisher(
            key, congestion_control=zenoh.CongestionControl.DROP, reliability=zenoh.Reliability.RELIABLE
        )
        for token in tokens:
            self._show(token)
        one = _RosPublisher(publisher, publisher_gid(tokens[-1]))
        self._publishers[topic] = one
        return one

    def _show(self, token: str) -> None:
        if token not in self._tokens:
            self._tokens[token] = self._session.liveliness().declare_token(token)
