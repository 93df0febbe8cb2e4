"""The Zenoh configuration of a link, as data. Each value is there because a measured fault asks for it."""

from __future__ import annotations

from common.link.access import access_control, all_but
from common.link.config import LinkConfig, TlsConfig
from common.link.endpoint import for_zenoh


def zenoh_configuration(
    config: LinkConfig, mode: str = "", revoked: frozenset[str] = frozenset()
) -> dict[str, object]:
    """The configuration of a session that listens and connects only where [link] says.

    `mode` in place of the configuration's own: `router`, which no master or slave is. `revoked`: common names
    of certificates whose holders may do nothing.
    """
    settings = _endpoints_and_timing(config, mode or config.mode)
    if config.access is not None:
        settings["access_control"] = access_control(config.access, revoked)
    elif revoked:
        settings["access_control"] = all_but(revoked)
    return settings


def _link(config: LinkConfig) -> dict[str, object]:
    link: dict[str, object] = {"tx": {"lease": 1000, "keep_alive": 4}}
    if config.tls is not None:
        link["tls"] = _tls(config.tls)
    if config.access is not None:
        # other transports prove no identity
        link["protocols"] = ["tls", "quic"]
    return link


def _tls(tls: TlsConfig) -> dict[str, object]:
    # the same block serves quic; both sides show a certificate
    # absolute: a zenohd that reads them from a file of its own runs elsewhere
    ca, certificate, key = (str(path.absolute()) for path in (tls.ca, tls.certificate, tls.key))
    return {
        "root_ca_certificate": ca,
        "enable_mtls": True,
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
        "listen_certificate": certificate,
        "listen_private_key": key,
        "connect_certificate": certificate,
        "connect_private_key": key,
    }


def _endpoints_and_timing(config: LinkConfig, mode: str) -> dict[str, object]:
    open_ms = round(1e3 * config.open_timeout_s)
    return {
        "mode": mode,
        # nothing is found by chance: endpoints are explicit
        "scouting": {"multicast": {"enabled": False}, "gossip": {"enabled": False}},
        # set even where empty: by default a peer listens on every interface
        "listen": {"endpoints": [for_zenoh(end) for end in config.listen]},
        "connect": {
            "endpoints": [for_zenoh(end) for end in config.connect],
            # a client waits for its router itself, and tries each: see session
            "timeout_ms": open_ms if mode == "client" else -1,
            "exit_on_failure": False,  # the other side may start later, or again
            # an attempt that an outage swallowed lasts open_timeout_s; the next must not wait long as well
            "retry": {"period_init_ms": 100, "period_max_ms": 200, "period_increase_factor": 1.5},
        },
        "open": {"return_conditions": {"connect_scouted": False}},  # else open() waits 0.5 s for a peer
        "timestamping": {"enabled": False},
        "transport": {
            # a black hole is noticed within a second, and no old message is delivered after it
            "unicast": {"open_timeout": open_ms, "accept_timeout": open_ms},
            "link": _link(config),
            # else payloads of 3 kB and more pass between processes of one host beside the link under test
            "shared_memory": {"enabled": False},
        },
    }
