"""Keys, endpoints, robots and versions: judged both ways, and read from real files, sockets and sessions."""

from __future__ import annotations

import asyncio
import socket
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from common.clock import monotonic_ns
from common.link import Link, open_session
from common.link.config import AccessConfig, LinkConfig, TlsConfig
from common.link.roles import Role
from common.metrics.parts import Software
from common.wire.codec import decode, encode
from common.wire.messages import ClockQuery, ClockReply, ControlReply, Statistics
from common.wire.presence import several_bear
from common.wire.topics import CLOCK, STATISTICS, STOP
from common.wire.version import software
from deploy.certificates.folder import stem, write_pair
from deploy.certificates.make import new_authority, new_identity
from deploy.ops.doctor.examine import others
from deploy.ops.doctor.judge.endpoints import judge_endpoint
from deploy.ops.doctor.judge.finding import Finding, Health
from deploy.ops.doctor.judge.keys import SOON_DAYS, judge_keys
from deploy.ops.doctor.judge.needs import Needs
from deploy.ops.doctor.judge.robots import CEILING_MS, OLDEST_MS, judge_robot
from deploy.ops.doctor.read.endpoints import EndpointFacts, EndpointState, knock, try_to_listen
from deploy.ops.doctor.read.keys import KeyFacts, read_keys
from deploy.ops.doctor.read.robots import EXCHANGES, RobotFacts, read_robots
from tests.link_times import times_over
from tests.published import slave_metrics

OURS = Software("1.2", 3, "1.10.2", "3.11")
WELL = KeyFacts("", "robot:robot-1", ("192.168.7.2",), 300.0)


def free_endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"


def by_check(findings: list[Finding]) -> dict[str, Health]:
    return {finding.check: finding.health for finding in findings}


def tls_of(folder: Path, days: float = 300.0) -> TlsConfig:
    now = datetime.now(UTC)
    authority = new_authority("test", now, timedelta(days=3650))
    ca, _ = write_pair(folder, "ca", authority)
    made = new_identity(authority, Role.ROBOT, "robot-1", ["127.0.0.1"], now, timedelta(days=days))
    certificate, key = write_pair(folder, stem(Role.ROBOT, "robot-1"), made)
    return TlsConfig(ca=ca, certificate=certificate, key=key)


def slave(tls: TlsConfig, access: bool = False) -> Needs:
    link = LinkConfig(listen=["tls/0.0.0.0:7447"], tls=tls, access=AccessConfig() if access else None)
    return Needs("slave", link=link, certified_as="robot:robot-1")


def test_real_keys_are_read(tmp_path: Path) -> None:
    tls = tls_of(tmp_path)
    facts = read_keys(tls, datetime.now(UTC))
    assert (facts.trouble, facts.common_name, facts.open_to_all) == ("", "robot:robot-1", False)
    assert "127.0.0.1" in facts.hosts
    assert 299.0 < facts.days_left <= 300.0
    assert set(by_check(judge_keys(slave(tls), facts)).values()) == {Health.OK}


def test_keys_that_prove_nothing_are_fatal(tmp_path: Path) -> None:
    tls = tls_of(tmp_path)
    expired = read_keys(tls, datetime.now(UTC) + timedelta(days=301))
    assert "expired" in expired.trouble
    tls.key.unlink()
    missing = read_keys(tls, datetime.now(UTC))
    assert "cannot be read" in missing.trouble
    for facts in (expired, missing):
        assert by_check(judge_keys(slave(tls), facts)) == {"certificate": Health.FAIL}


def test_a_key_that_everybody_can_read(tmp_path: Path) -> None:
    tls = tls_of(tmp_path)
    tls.key.chmod(0o640)
    assert not read_keys(tls, datetime.now(UTC)).open_to_all
    tls.key.chmod(0o644)
    facts = read_keys(tls, datetime.now(UTC))
    assert by_check(judge_keys(slave(tls), facts))["key"] is Health.WARN


def test_a_certificate_for_another_name_or_for_no_host(tmp_path: Path) -> None:
    tls = tls_of(tmp_path)
    other = KeyFacts("", "robot:robot-2", (), 300.0)
    assert by_check(judge_keys(slave(tls), other))["certificate's name"] is Health.WARN
    checks = by_check(judge_keys(slave(tls, access=True), other))
    assert checks["certificate's name"] is Health.FAIL  # access control would refuse it
    assert checks["certificate's hosts"] is Health.FAIL


def test_the_days_that_are_left() -> None:
    for days, health in ((SOON_DAYS, Health.OK), (SOON_DAYS - 0.01, Health.WARN)):
        facts = KeyFacts("", "robot:robot-1", ("h",), days)
        assert by_check(judge_keys(Needs("slave"), facts))["certificate's time"] is health


def test_a_link_without_keys_is_open_to_all() -> None:
    assert by_check(judge_keys(Needs("slave"), None)) == {"certificate": Health.OK}
    link = LinkConfig(listen=["tcp/0.0.0.0:7447"])
    assert by_check(judge_keys(Needs("slave", link=link), None)) == {"certificate": Health.WARN}


def test_knocking_at_a_door_that_is_open_and_at_one_that_is_not() -> None:
    with socket.socket() as door:
        door.bind(("127.0.0.1", 0))
        door.listen()
        endpoint = f"tcp/127.0.0.1:{door.getsockname()[1]}"
        assert asyncio.run(knock(endpoint)).answer is EndpointState.ACCEPTS
        assert try_to_listen(endpoint).answer is EndpointState.TAKEN
    assert asyncio.run(knock(endpoint)).answer is EndpointState.REFUSED
    assert try_to_listen(endpoint).answer is EndpointState.FREE
    assert asyncio.run(knock("udp/127.0.0.1:9")).answer is EndpointState.NOT_ASKED
    assert try_to_listen("udp/127.0.0.1:0".replace(":0", ":47447")).answer in (
        EndpointState.FREE,
        EndpointState.TAKEN,
    )
    assert asyncio.run(knock("tcp/no-such-host.invalid:7447")).answer is EndpointState.UNKNOWN
    assert try_to_listen("tcp/192.0.2.1:7447").answer is EndpointState.FOREIGN


@pytest.mark.parametrize("answer", EndpointState)
def test_every_answer_is_judged_with_what_to_do(answer: EndpointState) -> None:
    finding = judge_endpoint(EndpointFacts("tcp/h:1", answer))
    well = answer in (EndpointState.ACCEPTS, EndpointState.NOT_ASKED, EndpointState.FREE)
    assert (finding.health is Health.OK) == well
    assert bool(finding.advice) != well


def test_a_secure_knock_counts_as_a_refused_handshake() -> None:
    counts = {e: "refused handshake" in judge_endpoint(EndpointFacts(e, EndpointState.ACCEPTS)).found for e in
              ("tls/h:1", "tcp/h:1", "ws/h:1")}  # fmt: skip
    assert counts == {"tls/h:1": True, "tcp/h:1": False, "ws/h:1": False}


def robot(trips: tuple[float, ...] = (10.0,) * EXCHANGES, **others: object) -> RobotFacts:
    given = {"software": OURS, "asked": EXCHANGES, **others}
    return RobotFacts("robot-1", "hold", "not engaged", trips, **given)  # type: ignore[arg-type]


def test_a_robot_that_is_well() -> None:
    assert set(by_check(judge_robot(robot(), OURS)).values()) == {Health.OK}


@pytest.mark.parametrize(
    ("trips", "health"),
    [
        ((OLDEST_MS,) * EXCHANGES, Health.OK),
        ((OLDEST_MS,) * (EXCHANGES - 1), Health.WARN),  # one was lost
        ((*(10.0,) * (EXCHANGES - 1), OLDEST_MS * 1.01), Health.WARN),
        ((CEILING_MS,) * EXCHANGES, Health.WARN),
        ((1.01 * CEILING_MS,) * EXCHANGES, Health.FAIL),
        ((), Health.FAIL),
    ],
)
def test_a_way_that_is_too_long_for_the_guard(trips: tuple[float, ...], health: Health) -> None:
    assert by_check(judge_robot(robot(trips), OURS))["robot-1: round trip"] is health


@pytest.mark.parametrize(
    ("one_way_ms", "health", "words"),
    [(150.0, Health.OK, "one way 0.15 s"), (400.0, Health.FAIL, "ceiling (max_age_ceiling_s) is 0.60 s")],
)
def test_the_guards_times_are_told_with_the_ceiling_that_a_line_exceeds(
    one_way_ms: float, health: Health, words: str
) -> None:
    found = judge_robot(robot(times=times_over(one_way_ms).metrics()), OURS)
    [finding] = [one for one in found if one.check == "robot-1: guard's times"]
    assert finding.health is health
    assert words in finding.found


@pytest.mark.parametrize(
    ("theirs", "health"),
    [
        (OURS, Health.OK),
        (replace(OURS, python="3.13"), Health.OK),
        (replace(OURS, tandem="1.3"), Health.WARN),
        (replace(OURS, zenoh="1.9"), Health.WARN),
        (replace(OURS, schema=4), Health.FAIL),
        (None, Health.WARN),
    ],
)
def test_two_hosts_with_other_software(theirs: Software | None, health: Health) -> None:
    finding = judge_robot(robot(software=theirs), OURS)[-1]
    assert (finding.check, finding.health) == ("robot-1: versions", health)


def test_a_robot_that_does_not_answer_or_in_another_schema() -> None:
    [silent] = judge_robot(RobotFacts("robot-1", "", "does not answer at tcp/h:1"), OURS)
    assert (silent.check, silent.health) == ("robot-1", Health.FAIL)
    [other] = judge_robot(RobotFacts("robot-1", "", "schema version 3, expected 2"), OURS)
    assert (other.check, other.health) == ("robot-1: versions", Health.FAIL)
    [two] = judge_robot(RobotFacts("robot-1", "", several_bear("robot-1", ["room 1", "room 2"])), OURS)
    assert (two.check, two.health) == ("robot-1: names", Health.FAIL)
    assert "room 1 and room 2" in two.found


def a_robot_answers(link: Link, software_: Software) -> None:
    def clock(payload: bytes, received_ns: int) -> bytes:
        query = decode(payload, ClockQuery)
        return encode(ClockReply(query.asked_ns, received_ns, monotonic_ns()))

    link.answer(STOP, lambda *_: encode(ControlReply(True, "hold", "not engaged")))
    link.answer(CLOCK, clock)
    put = link.publish(STATISTICS)

    async def tell() -> None:
        while True:
            put(encode(Statistics(monotonic_ns(), slave_metrics(software=software_))))
            await asyncio.sleep(0.05)

    link.told = asyncio.create_task(tell())  # type: ignore[attr-defined]


def test_a_robot_is_asked_over_a_real_link() -> None:
    endpoint = free_endpoint()

    async def story() -> tuple[list[RobotFacts], list[Finding]]:
        async with open_session(LinkConfig(listen=[endpoint])) as session:
            link = session.link("robot-1")
            a_robot_answers(link, software())
            config = LinkConfig(connect=[endpoint])
            facts = await read_robots(config, ["robot-1"], "nurse-1")
            found = await others(Needs("master", link=config, robots=("robot-1",), operator="nurse-1"))
            link.told.cancel()  # type: ignore[attr-defined]
        return facts, list(found)

    [facts], found = asyncio.run(story())
    assert (facts.guard, facts.text) == ("hold", "not engaged")
    assert len(facts.round_trips_ms) == facts.asked == EXCHANGES
    assert min(facts.round_trips_ms) > 0.0
    # both ends are this host, so the offset is known to be 0
    assert abs(facts.offset_ms) <= facts.bound_ms
    assert facts.software == software()
    checks = by_check(found)
    assert checks[f"connect {endpoint}"] is checks["robot-1: versions"] is Health.OK


def test_a_robot_that_is_not_there_is_one_row_of_the_report() -> None:
    needs = Needs("master", link=LinkConfig(connect=[free_endpoint()]), robots=("robot-1",))
    checks = by_check(list(asyncio.run(others(needs))))
    assert list(checks.values()) == [Health.FAIL, Health.FAIL]
