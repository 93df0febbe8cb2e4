from datetime import UTC, datetime
from pathlib import Path

import pytest

from common.config import LinkConfig
from common.endpoint import SECURE
from common.errors import ConfigError
from common.link.certificates import check_tls
from common.link_config import TlsConfig
from deploy.rig.endpoints import TRANSPORTS, Endpoints, local_endpoints


def fields(endpoints: Endpoints) -> list[str]:
    return [*endpoints.robots, endpoints.master, endpoints.observer]


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_each_of_many_robots_has_its_own(transport: str, tmp_path: Path) -> None:
    endpoints = local_endpoints(transport, tmp_path, robots=8)
    assert len(set(fields(endpoints))) == 8 + 2
    assert endpoints.observing.connect == [*endpoints.robots, endpoints.master]


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_every_process_has_a_door_of_its_own_that_a_file_may_name(transport: str, tmp_path: Path) -> None:
    endpoints = local_endpoints(transport, tmp_path)
    assert endpoints.robots[0].startswith(f"{transport}/")
    assert endpoints.master.startswith(f"{transport}/")
    assert len(set(fields(endpoints))) == 3
    assert LinkConfig(listen=fields(endpoints)).listen == fields(endpoints)
    assert 1 <= endpoints.can_port <= 65535


def test_nothing_is_reached_from_outside(tmp_path: Path) -> None:
    for transport in ("tcp", "udp", "ws"):
        assert all("/127.0.0.1:" in endpoint for endpoint in fields(local_endpoints(transport, tmp_path)))
    unix = local_endpoints("unixsock-stream", tmp_path)
    assert unix.robots == (f"unixsock-stream/{tmp_path}/robot-1.sock",)


def test_the_observer_hears_both_sides_and_has_a_door_for_the_truth(tmp_path: Path) -> None:
    endpoints = local_endpoints("tcp", tmp_path)
    assert endpoints.observing.listen == [endpoints.observer]
    assert endpoints.observing.connect == [*endpoints.robots, endpoints.master]


@pytest.mark.parametrize("transport", ["carrier-pigeon", "", "TCP", "vsock"])
def test_a_transport_that_the_demo_does_not_know(transport: str, tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError,
        match=rf"--transport = '{transport}': expected one of tcp, udp, tls, quic, quic-datagram, ws, unix",
    ):
        local_endpoints(transport, tmp_path)


@pytest.mark.parametrize("transport", TRANSPORTS)
def test_a_secure_transport_has_keys_for_everybody_and_no_other_has_any(
    transport: str, tmp_path: Path
) -> None:
    endpoints = local_endpoints(transport, tmp_path, robots=2)
    if transport not in SECURE:
        assert endpoints.keys is None
        assert endpoints.observing.tls is None
        return
    assert endpoints.keys is not None
    stems = ("robot-robot-1", "robot-robot-2", "operator-nurse-1", "observer-rig", "router-router-1")
    for stem in stems:
        own = (endpoints.keys / f"{stem}.pem", endpoints.keys / f"{stem}.key")
        check_tls(TlsConfig(ca=endpoints.keys / "ca.pem", certificate=own[0], key=own[1]), datetime.now(UTC))
    assert endpoints.observing.mistakes() == []


def test_through_a_router_the_observer_asks_only_there(tmp_path: Path) -> None:
    endpoints = local_endpoints("udp", tmp_path, routed=True)
    assert endpoints.router.startswith("udp/127.0.0.1:")
    assert endpoints.observing.connect == [endpoints.router]
