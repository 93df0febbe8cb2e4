import pytest

from common.link.endpoint import MAX_SOCKET_PATH, check_endpoint, for_zenoh, transport_of


@pytest.mark.parametrize(
    "endpoint",
    [
        "tcp/192.168.7.2:7447", "udp/[::1]:7447", "ws/robot.local:1", "tls/0.0.0.0:65535#dscp=0x2e",
        "quic/10.0.0.1:7447?rel=0", "quic-datagram/h:1", "unixsock-stream/run/tandem/link",
        "unixsock-stream/" + "x" * MAX_SOCKET_PATH,
    ],
)  # fmt: skip
def test_a_good_endpoint_is_returned(endpoint: str) -> None:
    assert check_endpoint(endpoint) == endpoint


@pytest.mark.parametrize(
    ("endpoint", "why"),
    [
        ("", "a protocol out of tcp, udp"),
        ("tcp", "a protocol out of"),
        ("192.168.7.2:7447", "a protocol out of"),
        ("TCP/1.2.3.4:7447", "a protocol out of"),
        ("serial//dev/ttyS0", "a protocol out of"),
        ("unixpipe/x", "unixpipe is not in Zenoh's Python package"),
        ("quic-datagram/1.2.3.4:7447?rel=1", "expected quic/ with rel=1"),
        ("tcp/1.2.3.4", "tcp/host:port"),
        ("tcp/:7447", "tcp/host:port"),
        ("tcp/1.2.3.4:", "a port of 1 to 65535"),
        ("tcp/1.2.3.4:0", "a port of 1 to 65535"),
        ("udp/1.2.3.4:65536", "a port of 1 to 65535"),
        ("ws/1.2.3.4:٧", "a port of 1 to 65535"),
        ("tcp/1.2.3.4:-1", "a port of 1 to 65535"),
        ("unixsock-stream/", "a path of 1 to 107 bytes"),
        ("unixsock-stream/" + "x" * (MAX_SOCKET_PATH + 1), "a path of 1 to 107 bytes"),
    ],
)
def test_a_bad_endpoint_is_refused_with_what_was_expected(endpoint: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        check_endpoint(endpoint)


@pytest.mark.parametrize(
    ("endpoint", "zenohs", "transport"),
    [
        ("tcp/h:1", "tcp/h:1", "tcp"),
        ("quic/h:1", "quic/h:1", "quic"),
        ("quic/h:1?rel=0", "quic/h:1?rel=0", "quic-datagram"),
        ("quic/h:1?rel=1#x=rel=0", "quic/h:1?rel=1#x=rel=0", "quic"),
        ("quic-datagram/h:1", "quic/h:1?rel=0", "quic-datagram"),
        ("quic-datagram/h:1?multistream=0#dscp=46", "quic/h:1?multistream=0;rel=0#dscp=46", "quic-datagram"),
    ],
)
def test_datagrams_are_quic_in_zenohs_words(endpoint: str, zenohs: str, transport: str) -> None:
    assert for_zenoh(check_endpoint(endpoint)) == zenohs
    assert transport_of(endpoint) == transport
