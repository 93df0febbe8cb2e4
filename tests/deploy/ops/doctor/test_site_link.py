"""The site's own files and keys over a real mutual TLS link: the doctor at the operator reaches the robot."""

from __future__ import annotations

import asyncio
import shutil
import socket
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from common.clock import monotonic_ns
from common.config.load import load_config
from common.link import open_session
from common.link.roles import Role
from common.wire.codec import decode, encode
from common.wire.messages import ClockQuery, ClockReply, ControlReply
from common.wire.topics import CLOCK, STOP
from deploy import cli
from deploy.certificates.folder import stem, write_pair
from deploy.certificates.make import new_authority, new_identity
from deploy.ops.doctor.examine import keys, others
from deploy.ops.doctor.judge.finding import Finding, Health
from deploy.ops.doctor.judge.needs import needs_of
from master.suit.protocol import SHIPPED_DBC
from slave.config import SlaveConfig

SITE = Path(cli.__file__).parent / "examples" / "site"


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """The files as they are shipped, but for the address, with the keys that they name."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    for file in SITE.glob("*.toml"):
        text = file.read_text("utf-8").replace("192.168.7.2:7447", f"127.0.0.1:{port}")
        (tmp_path / file.name).write_text(text.replace("0.0.0.0:7447", f"127.0.0.1:{port}"), "utf-8")
    shutil.copy(SHIPPED_DBC, tmp_path)
    now, valid = datetime.now(UTC), timedelta(days=365)
    (tmp_path / "keys").mkdir()
    (tmp_path / "keys" / "revoked.txt").write_text("", "utf-8")
    authority = new_authority("test", now, valid)
    write_pair(tmp_path / "keys", "ca", authority)
    for role, name, hosts in ((Role.ROBOT, "robot-1", ["127.0.0.1"]), (Role.OPERATOR, "nurse-1", [])):
        pair = new_identity(authority, role, name, hosts, now, valid)
        write_pair(tmp_path / "keys", stem(role, name), pair)
    return tmp_path


async def examined(site: Path) -> Sequence[Finding]:
    """What the operator's doctor finds, with a robot that answers at the robot's own endpoint."""

    def clock(payload: bytes, received_ns: int) -> bytes:
        return encode(ClockReply(decode(payload, ClockQuery).asked_ns, received_ns, monotonic_ns()))

    needs = needs_of(site / "operator.toml")
    async with open_session(load_config(site / "robot.toml", SlaveConfig).link) as session:
        robot = session.link("robot-1")
        robot.answer(STOP, lambda *_: encode(ControlReply(True, "hold", "not engaged")))
        robot.answer(CLOCK, clock)
        return [*keys(needs), *await others(needs)]


def test_the_doctor_reaches_the_robot_with_the_operator_s_keys(site: Path) -> None:
    found = {finding.check: finding for finding in asyncio.run(examined(site))}
    for check in ("certificate's name", "certificate's time", "robot-1", "robot-1: clock"):
        assert found[check].health is Health.OK, found[check]
    assert found["certificate's name"].found == "operator:nurse-1"


def test_another_authority_s_operator_is_not_let_in(site: Path) -> None:
    now, valid = datetime.now(UTC), timedelta(days=365)
    stranger = new_authority("stranger", now, valid)
    pair = new_identity(stranger, Role.OPERATOR, "nurse-1", [], now, valid)
    for kind in ("pem", "key"):
        (site / "keys" / f"operator-nurse-1.{kind}").unlink()
    write_pair(site / "keys", "operator-nurse-1", pair)
    found = {finding.check: finding for finding in asyncio.run(examined(site))}
    assert found["certificate"].health is Health.FAIL
    assert "not from the authority" in found["certificate"].found
    assert "robot-1" not in found
    assert found["link"].health is Health.FAIL
