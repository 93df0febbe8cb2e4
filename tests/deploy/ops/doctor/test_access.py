"""The doctor on access rules and the revocation list: each way in which a host would be refused is named."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.link.config import AccessConfig, LinkConfig
from deploy.ops.doctor.judge.access import ACCESS, REVOKED, judge_access
from deploy.ops.doctor.judge.finding import Finding, Health
from deploy.ops.doctor.judge.needs import Needs
from deploy.ops.doctor.read.revoked import RevocationFacts, read_revoked

RULES = AccessConfig(operators={"anna": ["r1"], "ben": ["r2"]}, observers={"screen": ["r3"]}, routers=["hub"])


def judged(own: str, robots: tuple[str, ...] = (), access: AccessConfig | None = RULES) -> Finding:
    needs = Needs("master", link=LinkConfig(access=access), robots=robots)
    rules, _ = judge_access(needs, own, None)
    assert rules.check == ACCESS
    return rules


@pytest.mark.parametrize(
    ("own", "robots", "health", "words"),
    [
        ("operator:anna", ("r1",), Health.OK, "they name operator:anna"),
        ("operator:anna", ("r1", "r2"), Health.FAIL, "operator:anna may not command r2"),
        ("operator:carl", ("r1",), Health.FAIL, "do not name operator:carl"),
        ("observer:anna", (), Health.FAIL, "do not name observer:anna"),
        ("robot:r1", (), Health.OK, "commanded by operator:anna"),
        ("robot:r3", (), Health.WARN, "nobody may command this robot"),
        ("robot:r9", (), Health.FAIL, "do not name robot:r9"),
        ("router:hub", (), Health.OK, "they name router:hub"),
        ("", (), Health.FAIL, "so it may do nothing"),
    ],
)
def test_whether_the_rules_permit_a_host_its_work(
    own: str, robots: tuple[str, ...], health: Health, words: str
) -> None:
    finding = judged(own, robots)
    assert finding.health is health
    assert words in finding.found


def test_without_rules_everybody_commands() -> None:
    assert judged("operator:anna", access=None).health is Health.WARN


def test_the_list_is_read_and_one_s_own_name_on_it_is_fatal(tmp_path: Path) -> None:
    needs = Needs("slave", link=LinkConfig(access=RULES))

    def revoked(facts: RevocationFacts | None) -> Finding:
        _, finding = judge_access(needs, "robot:r1", facts)
        assert finding.check == REVOKED
        return finding

    listed = tmp_path / "revoked.txt"
    assert revoked(None).health is Health.OK
    assert revoked(None).advice
    assert revoked(read_revoked(listed)).health is Health.FAIL
    listed.write_text("operator:ben\n")
    assert revoked(read_revoked(listed)) == Finding(REVOKED, Health.OK, "operator:ben")
    listed.write_text("robot:r1\n")
    assert revoked(read_revoked(listed)).health is Health.FAIL
    listed.write_text("nonsense\n")
    assert "line 1" in revoked(read_revoked(listed)).found
