"""The revocation list: read again when it changes; one that cannot be read leaves the old one in force."""

from __future__ import annotations

import os
from contextlib import AsyncExitStack
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from common.errors import LinkError
from common.link import open_link, open_session
from common.link.access import access_control, all_but
from common.link.config import AccessConfig, LinkConfig
from common.link.revoked import (
    MOST_BYTES,
    RevocationFile,
    parse_revoked,
    revoked_operators,
    write_revoked,
)
from common.link.revoking import to_cut
from common.link.roles import Role
from common.wire.topics import COMMAND, STATE
from deploy.certificates.folder import read_authority, write_pair
from deploy.certificates.make import new_identity
from deploy.harness.keys import MASTER, make_keys, tls_of
from tests.common.link.test_access import may
from tests.common.link.test_link import ROBOT, Heard, free_port, run, until

BEN, HUB = "operator:ben", "router:hub"


def test_a_line_is_a_name_and_the_rest_of_it_a_comment() -> None:
    text = "# revoked\n\n operator:ben  # stolen 2030-01-01\r\nrouter:hub\noperator:ben\n"
    assert parse_revoked(text, "f") == {BEN, HUB}
    assert parse_revoked("", "f") == frozenset()
    assert revoked_operators(frozenset({BEN, HUB})) == {"ben"}


@pytest.mark.parametrize("line", ["ben", "operator:", "nurse:ben", ":ben", "Operator:ben", "operator ben"])
def test_a_line_that_is_no_name_is_named(line: str) -> None:
    with pytest.raises(LinkError, match=rf"list.txt, line 3: expected role:name .*, not {line!r}"):
        parse_revoked(f"{BEN}\n# more\n{line}\n", "list.txt")


@given(st.text(max_size=40))
def test_any_text_is_a_list_or_a_link_error(text: str) -> None:
    try:
        names = parse_revoked(text, "f")
    except LinkError:
        return
    assert all(":" in name for name in names)


def later(path: Path, data: bytes) -> None:
    """Write it so that its time differs, however coarse the clock of the disk."""
    before_ns = path.stat().st_mtime_ns if path.exists() else 0
    path.write_bytes(data)
    os.utime(path, ns=(before_ns + 10**9, before_ns + 10**9))


def test_it_is_read_again_when_it_changes(tmp_path: Path) -> None:
    path = tmp_path / "revoked.txt"
    later(path, b"")
    listed = RevocationFile(path)
    assert listed.names == frozenset()
    later(path, f"{BEN}\n".encode())
    assert listed.look() == ""
    assert listed.names == {BEN}
    later(path, b"")
    assert listed.look() == ""
    assert listed.names == frozenset()


@pytest.mark.parametrize("bad", [b"operator:ben\nnonsense\n", b"\xff\xfe", b"x" * (MOST_BYTES + 1), None])
def test_one_that_cannot_be_read_any_more_leaves_the_old_one_in_force(
    bad: bytes | None, tmp_path: Path
) -> None:
    path = tmp_path / "revoked.txt"
    later(path, b"operator:ben\n")
    listed = RevocationFile(path)
    if bad is None:
        path.unlink()
    else:
        later(path, bad)
    assert str(path) in listed.look()
    assert listed.look() == "", "it is said once"
    assert listed.names == {BEN}
    later(path, b"router:hub\n")
    assert listed.look() == ""
    assert listed.names == {HUB}
    path.unlink()
    assert "cannot be read: No such file" in listed.look(), "and again when it happens again"


@pytest.mark.parametrize("there", [None, b"nonsense\n", b"\xff"])
def test_a_missing_or_bad_list_at_the_start_is_refused(there: bytes | None, tmp_path: Path) -> None:
    path = tmp_path / "revoked.txt"
    if there is not None:
        path.write_bytes(there)
    with pytest.raises(
        LinkError, match=r"revoked.txt.*: \[link\] revoked names it; an empty file revokes nobody"
    ):
        RevocationFile(path)


def test_names_are_added_once_and_what_stands_there_stays(tmp_path: Path) -> None:
    path = tmp_path / "revoked.txt"
    assert write_revoked(path, BEN, "today")
    path.write_text(path.read_text() + "# by hand, no newline")
    assert write_revoked(path, HUB, "today")
    before = path.read_text()
    assert not write_revoked(path, BEN, "today")
    assert path.read_text() == before
    assert "# by hand, no newline\n" in before
    assert parse_revoked(before, "f") == {BEN, HUB}
    assert list(tmp_path.iterdir()) == [path]
    path.write_text("nonsense")
    with pytest.raises(LinkError, match="line 1"):
        write_revoked(path, BEN, "today")
    assert path.read_text() == "nonsense"


def test_the_rules_refuse_a_revoked_name_everything_and_others_nothing_more() -> None:
    access = AccessConfig(operators={"anna": ["r1"], "ben": ["r1"]}, routers=["hub"])
    whole, less = access_control(access), access_control(access, frozenset({BEN}))
    assert [rule for rule in less["rules"] if "operator:ben" in str(rule)] == []
    assert not any(BEN in policy["subjects"] for policy in less["policies"])
    for message, key in (("query", "tandem/r1/stop"), ("declare_subscriber", "tandem/r1/state")):
        assert may(BEN, message, key, table=whole)
        assert not may(BEN, message, key, table=less)
        assert may("operator:anna", message, key, table=less)
    bare = all_but(frozenset({BEN}))
    assert bare["default_permission"] == "allow"
    assert [policy["subjects"] for policy in bare["policies"]] == [[BEN]]
    messages = set(bare["rules"][0]["messages"])
    assert messages == {message for rule in whole["rules"] for message in rule["messages"]}


@pytest.mark.parametrize(
    ("connected", "revoked", "refused", "cut"),
    [
        ({BEN}, {BEN}, set(), {BEN}),  # at once
        ({HUB}, {BEN}, set(), set()),  # once ben connects
        ({BEN, HUB}, {BEN}, {BEN}, set()),  # its rules refuse ben already: it may stay connected
        ({BEN, HUB}, set(), {BEN}, {BEN}),  # pardoned
        ({HUB}, set(), {BEN}, set()),
        (set(), {BEN}, set(), set()),
    ],
)
def test_only_who_is_connected_and_treated_wrongly_is_a_reason_to_open_anew(
    connected: set[str], revoked: set[str], refused: set[str], cut: set[str]
) -> None:
    assert to_cut(frozenset(connected), frozenset(revoked), frozenset(refused)) == cut


def test_without_rules_the_revoked_alone_are_refused(tmp_path: Path) -> None:
    keys = make_keys(tmp_path, ["tls/127.0.0.1:1"], [ROBOT])
    authority, now = read_authority(keys), datetime.now(UTC)
    write_pair(
        keys, "operator-carl", new_identity(authority, Role.OPERATOR, "carl", [], now, timedelta(days=1))
    )
    listed = tmp_path / "revoked.txt"
    listed.write_text("operator:carl\n")
    endpoint = f"tls/127.0.0.1:{free_port()}"
    config = LinkConfig(listen=[endpoint], tls=tls_of(keys, Role.ROBOT, ROBOT), revoked=listed)

    async def test() -> None:
        async with open_session(config) as session, AsyncExitStack() as stack:
            told: list[frozenset[str]] = []
            session.watch_revoked(told.append)
            assert told == [frozenset({"operator:carl"})], "who is revoked is known before anybody connects"
            heard, commands = {"carl": Heard(), MASTER: Heard()}, Heard()
            robot = session.link(ROBOT)
            robot.subscribe(COMMAND, commands)
            put_state, puts = robot.publish(STATE), []
            for name in ("carl", MASTER):
                own = LinkConfig(connect=[endpoint], mode="client", tls=tls_of(keys, Role.OPERATOR, name))
                link = await stack.enter_async_context(open_link(own, ROBOT))
                await link.connected()
                link.subscribe(STATE, heard[name])
                puts.append((link.publish(COMMAND.of(name)), name.encode()))

            def everybody() -> None:
                put_state(b"state")
                for put, payload in puts:
                    put(payload)

            await until(lambda: len(heard[MASTER].payloads) >= 20 and len(commands.payloads) >= 20, everybody)
            assert heard["carl"].payloads == []
            assert set(commands.payloads) == {MASTER.encode()}

    run(test)


def test_without_certificates_there_is_nothing_to_revoke(tmp_path: Path) -> None:
    config = LinkConfig(listen=["tcp/127.0.0.1:7447"], revoked=tmp_path / "revoked.txt")
    (mistake,) = config.mistakes()
    assert mistake.key == "link.revoked"
