from pathlib import Path

import pytest

from common.config import LinkConfig
from common.errors import ConfigError
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


@pytest.mark.parametrize("transport", ["carrier-pigeon", "", "TCP", "quic"])
def test_a_transport_that_the_demo_does_not_know(transport: str, tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=rf"--transport = '{transport}': expected one of tcp, udp, ws, unix"
    ):
        local_endpoints(transport, tmp_path)
