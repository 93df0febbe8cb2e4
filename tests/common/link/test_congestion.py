"""Which congestion control a process's tcp sockets use is the setting's, also for what it accepts later."""

from __future__ import annotations

import socket

import pytest

from common.errors import LinkError
from common.link.congestion import check_congestion_control, set_congestion_control


def _algorithm(one: socket.socket) -> str:
    return one.getsockopt(socket.IPPROTO_TCP, socket.TCP_CONGESTION, 16).rstrip(b"\0").decode()


def test_what_is_open_and_what_is_accepted_later_use_it() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        assert set_congestion_control("reno") >= 1
        with socket.create_connection(server.getsockname()) as there:
            here, _ = server.accept()
            with here:
                assert _algorithm(here) == "reno", "as the socket that accepted it"
            set_congestion_control("reno")
            assert _algorithm(there) == "reno"


def test_one_that_the_kernel_lacks_is_refused_with_what_to_do() -> None:
    check_congestion_control("reno")
    with pytest.raises(LinkError, match=r"link.tcp_congestion_control = 'nosuch'.*modprobe tcp_nosuch"):
        check_congestion_control("nosuch")
