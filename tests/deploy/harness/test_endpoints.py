from datetime import UTC, datetime
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import pytest
from cryptography.x509 import IPAddress, SubjectAlternativeName, load_pem_x509_certificate

from common.errors import ConfigError
from common.link.certificates import check_tls
from common.link.config import LinkConfig, TlsConfig
from common.link.endpoint import SECURE, TRANSPORTS
from deploy.harness.endpoints import Endpoints, local_endpoints, network_endpoints
from deploy.sim.network import EmulatedHost, Network


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
def test_a_secure_transport_has_keys_for_all_and_no_other_has(transport: str, tmp_path: Path) -> None:
    endpoints = local_endpoints(transport, tmp_path, robots=2)
    if transport not in SECURE:
        assert endpoints.keys is None
        assert endpoints.observing.tls is None
        return
    assert endpoints.keys is not None
    stems = ("robot-robot-1", "robot-robot-2", "operator-nurse-1", "router-router-1")
    for stem in stems:
        own = (endpoints.keys / f"{stem}.pem", endpoints.keys / f"{stem}.key")
        check_tls(TlsConfig(ca=endpoints.keys / "ca.pem", certificate=own[0], key=own[1]), datetime.now(UTC))
    assert endpoints.observing.mistakes() == []


def test_through_a_router_the_observer_asks_only_there(tmp_path: Path) -> None:
    endpoints = local_endpoints("udp", tmp_path, routed=True)
    assert endpoints.router.startswith("udp/127.0.0.1:")
    assert endpoints.observing.connect == [endpoints.router]


HOSTS = cast(
    Network,
    SimpleNamespace(
        operator=EmulatedHost("operator", "o", "198.18.0.1", "198.19.1.2", "198.19.1.1"),
        robot=EmulatedHost("robot", "r", "198.18.0.2", "198.19.1.6", "198.19.1.5"),
    ),
)


def test_on_two_hosts_the_robot_is_on_the_link_and_the_observer_is_not(tmp_path: Path) -> None:
    endpoints = network_endpoints("udp", HOSTS, tmp_path, robots=2)
    assert endpoints.robots == ("udp/198.18.0.2:7448", "udp/198.18.0.2:7449")
    assert endpoints.listening(1) == ["udp/198.18.0.2:7449", "tcp/198.19.1.6:7549"]
    watching = [*endpoints.observing.connect, *endpoints.observing.listen]
    assert len(watching) == 4
    assert all(endpoint.startswith("tcp/198.19.1.") for endpoint in watching)


def test_on_two_hosts_keys_are_good_for_every_address(tmp_path: Path) -> None:
    endpoints = network_endpoints("quic", HOSTS, tmp_path)
    assert endpoints.observing.connect == ["tls/198.19.1.6:7548", "tls/198.19.1.2:7547"]
    assert endpoints.keys is not None
    robot = load_pem_x509_certificate((endpoints.keys / "robot-robot-1.pem").read_bytes())
    names = robot.extensions.get_extension_for_class(SubjectAlternativeName).value
    assert {"198.18.0.2", "198.19.1.6"} <= set(map(str, names.get_values_for_type(IPAddress)))


def test_on_two_hosts_the_router_is_the_operator_s(tmp_path: Path) -> None:
    endpoints = network_endpoints("tcp", HOSTS, tmp_path, routed=True)
    assert endpoints.router == "tcp/198.18.0.1:7447"
    assert endpoints.observing.connect == ["tcp/198.19.1.2:7447"]


def test_a_unix_socket_reaches_no_other_host(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"transport = 'unixsock-stream': expected one of tcp.*file of one"):
        network_endpoints("unixsock-stream", HOSTS, tmp_path)
