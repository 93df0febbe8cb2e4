"""What is made of Zenoh's log. The lines are as Zenoh 1.10 writes them, without colours."""

from __future__ import annotations

from common.clock import to_ns
from common.link.refusals import MAX_KINDS, REPEAT_S, Refusals
from common.metrics.link import RefusalMetrics

AT = "2026-11-28T08:16:01.873954Z TRACE"
ACL = "zenoh::net::routing::interceptor::access_control:"
DROPPED = "zenoh::net::routing::interceptor: Msg intercepted!"
ZID = "7737329cd653489fe0a880642aa7d0c7"


def named(thread: int, who: str, what: str, verdict: str = "unauthorized", flow: str = "ingress") -> str:
    subject = f"Interface(lo)+CertCommonName({who})+Transport(Tls)+{ZID}"
    said = f"{ZID} on {subject} is {verdict} to {what} ({flow}) on tandem/r/command"
    return f"{AT} rx-1 ThreadId({thread}) {ACL} {said}"


def cached(thread: int, what: str, verdict: str = "unauthorized", zid: str = ZID) -> str:
    return (
        f"{AT} rx-1 ThreadId({thread}) {ACL} Using cached result: {zid} is {verdict} to {what} (ingress) "
        "on tandem/r/command"
    )


def dropped(thread: int) -> str:
    return f"{AT} rx-1 ThreadId({thread}) {DROPPED}"


def fed(*lines: str) -> Refusals:
    refusals = Refusals()
    for line in lines:
        refusals.feed(line, 0)
    return refusals


def test_what_was_dropped_is_told_by_name_kind_and_key() -> None:
    refusals = fed(named(1, "operator:ben", "Query"), cached(1, "Put"))
    assert refusals.feed(dropped(1), 0) == "operator:ben was refused: Put tandem/r/command (1 so far)"
    assert refusals.metrics() == RefusalMetrics(
        total=1, handshakes={}, messages={"operator:ben": {"Put tandem/r/command": 1}}
    )


def test_only_what_is_dropped_next_in_the_same_thread_counts() -> None:
    both = fed(cached(1, "Put"), cached(2, "Query"), dropped(2), dropped(3), dropped(2))
    assert both.metrics().messages == {ZID: {"Query tandem/r/command": 1}}
    # what might be asked later is looked up at once, and refuses nothing
    assert fed(named(1, "a:b", "Put"), cached(1, "Put", "authorized"), dropped(1)).counts.total() == 0
    # what is not sent to somebody is no attempt of his
    assert fed(named(1, "a:b", "Put", flow="egress"), dropped(1)).counts.total() == 0


def test_a_stranger_is_named_by_whoever_knows_him_even_afterwards() -> None:
    refusals = fed(cached(1, "Put"), dropped(1))
    refusals.learn(ZID, "observer:stranger")
    assert refusals.metrics().messages == {"observer:stranger": {"Put tandem/r/command": 1}}


def test_refused_handshakes_are_told_by_their_reason_alone() -> None:
    tls = "WARN acc-0 ThreadId(05) zenoh_link_tls::unicast: {}. Hint: increase the system open file limit."
    quic = 'WARN acc-0 ThreadId(05) x: QUIC acceptor failed: TransportError(Error {{ reason: "{}" }}) at a.rs'
    expired = "invalid peer certificate: certificate expired: verification time {} (UNIX), but it"
    ended = "WARN acc-0 ThreadId(6) x::tls::expiration: Closing {} link 1.2.3.4:5 => 1.2.3.4:6 : {}"
    gone = "remote certificate chain expired"
    refusals = fed(ended.format("TLS", gone), ended.format("QUIC", gone))
    assert refusals.metrics().handshakes == {gone: 2}
    refusals = fed(
        tls.format(expired.format(1)), tls.format(expired.format(2)), quic.format("peer sent no certificates")
    )
    assert refusals.metrics().handshakes == {
        "invalid peer certificate: certificate expired": 2, "peer sent no certificates": 1,
    }  # fmt: skip


def test_what_repeats_is_counted_always_and_said_now_and_then() -> None:
    refusals = Refusals()

    def again(now_ns: int) -> str | None:
        refusals.feed(cached(1, "Put"), now_ns)
        return refusals.feed(dropped(1), now_ns)

    assert again(0) is not None
    assert again(to_ns(REPEAT_S) - 1) is None
    said = again(to_ns(REPEAT_S))
    assert said is not None
    assert said.endswith("(3 so far)")


def test_a_flood_of_different_refusals_costs_no_memory() -> None:
    refusals = Refusals()
    for n in range(MAX_KINDS + 5):
        refusals.feed(cached(1, "Put", zid=f"{n:032x}"), 0)
        refusals.feed(dropped(1), 0)
        refusals.learn(f"{n:032x}", "somebody")
    assert (len(refusals.counts), refusals.more, len(refusals.names)) == (MAX_KINDS, 5, MAX_KINDS)
    assert refusals.metrics().total == MAX_KINDS + 5


def test_connected_peers_are_remembered_however_many_came_and_went() -> None:
    refusals = Refusals()
    refusals.learn(ZID, "operator:anna")
    for n in range(2 * MAX_KINDS):
        refusals.learn(f"{n:032x}", "observer:ward")
        refusals.went(f"{n:032x}")
    assert refusals.names[ZID] == "operator:anna"
    assert len(refusals.names) == MAX_KINDS
    assert f"{0:032x}" not in refusals.names
    assert f"{2 * MAX_KINDS - 1:032x}" in refusals.names, "what the last one did may yet be told"


def test_who_went_and_is_back_is_forgotten_no_sooner_than_others() -> None:
    refusals = Refusals()
    for session in (ZID, "b" * 32):
        refusals.learn(session, "operator:anna")
        refusals.went(session)
    refusals.learn(ZID, "operator:anna")
    for n in range(MAX_KINDS - 1):
        refusals.learn(f"{n:032x}", "observer:ward")
    assert ZID in refusals.names
    assert "b" * 32 not in refusals.names


def test_a_name_that_is_known_forgets_nobody() -> None:
    refusals = Refusals()
    for n in (*range(MAX_KINDS), *range(MAX_KINDS)):
        refusals.learn(f"{n:032x}", "observer:ward")
    assert len(refusals.names) == MAX_KINDS


def test_anything_else_is_let_be() -> None:
    assert fed("", "ThreadId(1)", "error", dropped(1), "\xff" * 1000).counts.total() == 0
