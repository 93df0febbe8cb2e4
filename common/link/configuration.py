"""The Zenoh configuration of a link, as data. Each value is there because a measured fault asks for it."""

from __future__ import annotations

from typing import Any

from common.config import LinkConfig


def zenoh_configuration(config: LinkConfig) -> dict[str, Any]:
    """The configuration of a session that listens and connects only where it is told to."""
    return {
        "mode": "peer",
        # nothing is found by chance: endpoints are explicit
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        # told explicitly even where empty: by default a peer listens on every interface
        "listen": {"endpoints": config.listen},
        "connect": {
            "endpoints": config.connect,
            "timeout_ms": -1,
            "exit_on_failure": False,  # the other side may start later, or again
            "retry": {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5},
        },
        "open": {"return_conditions": {"connect_scouted": False}},  # else open() waits 0.5 s for a peer
        "timestamping": {"enabled": False},
        "transport": {
            # a black hole is noticed within a second, and no old message is delivered after it
            "unicast": {"open_timeout": 1000, "accept_timeout": 1000},
            "link": {"tx": {"lease": 1000, "keep_alive": 4}},
            # else payloads of 3 kB and more pass between processes of one host beside the link under test
            "shared_memory": {"enabled": False},
        },
    }
