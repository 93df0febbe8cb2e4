"""The rules that Zenoh is given: read back as "may this name do this with this key", in either direction."""

from __future__ import annotations

import json
import random
from fnmatch import fnmatchcase

import pytest
import zenoh

from common.link.access import AccessControl, access_control, named, operators_of, robot_chunk
from common.link.config import AccessConfig
from common.wire.presence import ProcessPresence

ACCESS = AccessConfig(
    operators={"anna": ["r1", "r2"], "ben": ["r2"]},
    observers={"screen": ["r1"]},
    viewers={"chief": ["r1"]},
    routers=["hub"],
)
RULES = access_control(ACCESS)


def may(who: str, message: str, key: str, flow: str = "ingress", table: AccessControl = RULES) -> bool:
    """As Zenoh decides: a rule's key must include the message's."""
    mine = {rule for policy in table["policies"] if who in policy["subjects"] for rule in policy["rules"]}
    return any(
        rule["id"] in mine and message in rule["messages"] and flow in rule["flows"]
        and any(zenoh.KeyExpr(each).includes(zenoh.KeyExpr(key)) for each in rule["key_exprs"])
        for rule in table["rules"]
    )  # fmt: skip


COMMANDS = {("operator:anna", "r1"), ("operator:anna", "r2"), ("operator:ben", "r2"), ("router:hub", "r1")}
EVERYBODY = sorted(named(ACCESS))


def test_everybody_is_known_by_role_and_name() -> None:
    assert EVERYBODY == [
        "observer:chief", "observer:screen", "operator:anna", "operator:ben", "robot:r1", "robot:r2",
        "router:hub",
    ]  # fmt: skip
    assert RULES["default_permission"] == "deny"
    assert RULES["enabled"]


@pytest.mark.parametrize("robot", ["r1", "r2"])
@pytest.mark.parametrize("who", [*EVERYBODY, "observer:nobody", "operator:r1", "robot:anna"])
def test_the_table(who: str, robot: str) -> None:
    key = f"tandem/{robot}"
    router = who == "router:hub"
    operator = who in {"operator:anna"} | ({"operator:ben"} if robot == "r2" else set())
    observer = robot == "r1" and who in {"observer:screen", "observer:chief"}
    viewer = robot == "r1" and who == "observer:chief"
    itself = who == f"robot:{robot}"
    own = who.removeprefix("operator:") if operator else ""
    for name in ("anna", "ben", "%61nna", "-", "*"):
        assert may(who, "put", f"{key}/operator/{name}/command") == (name == own or router)
        assert may(who, "query", f"{key}/operator/{name}/control") == (name == own or router)
    assert may(who, "declare_subscriber", f"{key}/operator/*/command", "egress") == (operator or router)
    assert may(who, "declare_queryable", f"{key}/operator/*/control", "egress") == (operator or router)
    assert may(who, "put", f"{key}/state") == (itself or router)
    assert may(who, "put", f"{key}/video/head") == (itself or router)
    assert may(who, "declare_subscriber", f"{key}/video/head") == (operator or viewer or router)
    assert may(who, "put", f"{key}/video/head", "egress") == (operator or viewer or router)
    for name in ("anna", "ben", "-"):
        assert may(who, "put", f"{key}/operator/{name}/voice") == (name == own or router)
    assert may(who, "declare_subscriber", f"{key}/operator/*/voice") == (itself or router)
    assert may(who, "put", f"{key}/voice") == (itself or router)
    # what is said at the robot is for its operators: no viewer, no observer
    assert may(who, "declare_subscriber", f"{key}/voice") == (operator or router)
    assert may(who, "put", f"{key}/voice", "egress") == (operator or router)
    for camera in ("head", "wrist"):
        assert may(who, "put", f"{key}/keyframe/{camera}") == (operator or viewer or router)
        assert may(who, "declare_subscriber", f"{key}/keyframe/{camera}") == (itself or router)
    assert may(who, "declare_subscriber", f"{key}/state") == (operator or observer or router)
    assert may(who, "declare_subscriber", f"{key}/operator/*/command") == (
        operator or observer or itself or router
    )
    assert may(who, "declare_queryable", f"{key}/operator/*/control") == (itself or router)
    assert may(who, "query", f"{key}/clock") == (operator or router)
    assert may(who, "query", f"{key}/stop") == (who in EVERYBODY), "anyone who is named may stop a robot"
    assert may(who, "declare_queryable", f"{key}/stop") == (itself or router)
    assert may(who, "liveliness_token", f"{key}/alive/slave") == (itself or router)
    assert may(who, "liveliness_token", f"{key}/alive/master") == (operator or router)
    assert may(who, "declare_liveliness_subscriber", "tandem/*/alive/slave") == (who in EVERYBODY)
    assert may(who, "declare_subscriber", "tandem-summary/*") == (who in EVERYBODY)
    assert may(who, "put", f"tandem-summary/{robot}") == (itself or router)
    assert may(who, "put", f"tandem-summary/{robot}", "egress") == (operator or observer or router), (
        "a list hears of its own robots alone"
    )
    assert may(who, "query", f"{key}/call") == (itself or router)
    assert may(who, "declare_queryable", f"{key}/call") == (itself or router)
    for name in ("anna", "ben"):
        shown = f"tandem/-/operator/{name}/alive/1/4-1/here"
        assert may(who, "liveliness_token", shown) == (who == f"operator:{name}" or router)
        assert may(who, "liveliness_token", shown, "egress") == (who in EVERYBODY)
    assert not may(who, "declare_subscriber", "tandem/**") or router
    assert not may(who, "put", f"{key}/operator/{own or 'anna'}/control") or router
    assert not may(who, "put", f"{key}/command") or router, "the key of versions before 4"


def test_an_empty_table_lets_nobody_do_anything() -> None:
    table = access_control(AccessConfig())
    assert table["rules"] == table["policies"] == table["subjects"] == []
    assert table["default_permission"] == "deny"


def test_each_shows_itself_in_both_forms_and_everybody_may_see_it() -> None:
    for who, robot, role, own in (("robot:r1", "r1", "slave", True), ("operator:ben", "r1", "master", False)):
        for presence in (
            ProcessPresence(robot, role),
            ProcessPresence(robot, role, 7, 3, "1.0", "host, tls/10.0.0.2:7447"),
        ):
            assert may(who, "liveliness_token", presence.key) is own
    assert may("operator:anna", "liveliness_token", ProcessPresence("r1", "master", 7, 3, "1.0", "host").key)
    for who in EVERYBODY:
        assert may(who, "declare_liveliness_subscriber", "tandem/*/alive/**")
        assert may(who, "liveliness_token", ProcessPresence("r1", "slave", 7, 3, "1.0", "host").key, "egress")


def test_a_pattern_stands_for_the_listed_robots() -> None:
    access = AccessConfig(robots=["ward-1", "ward-2", "home-1"], operators={"anna": ["ward-*"], "ben": ["*"]})
    rules = access_control(access)
    for robot, by in (("ward-1", {"anna", "ben"}), ("ward-2", {"anna", "ben"}), ("home-1", {"ben"})):
        assert may(f"robot:{robot}", "put", f"tandem/{robot}/state", table=rules)
        for name in ("anna", "ben"):
            key = f"tandem/{robot}/operator/{name}/command"
            assert may(f"operator:{name}", "put", key, table=rules) == (name in by)
    for robot, operator in (("other", "ben"), ("home-1", "anna"), ("ward-1/x", "anna")):
        key = f"tandem/{robot}/operator/{operator}/command"
        received = {
            who for who in [*named(access), f"robot:{robot}"] if may(who, "put", key, "egress", rules)
        }
        heard = {who for who in received if who.startswith("robot:")}
        sent = may(f"operator:{operator}", "put", key, table=rules)
        assert not (sent and heard), "a robot that is not listed hears nobody, also where a pattern fits it"
    assert operators_of(access, "ward-2") == {"anna", "ben"}
    assert access.mistakes() == []


def test_a_pattern_of_no_listed_robot_is_a_mistake() -> None:
    (mistake,) = AccessConfig(robots=["home-1"], operators={"anna": ["ward-*", "home-*"]}).mistakes()
    assert (mistake.key, mistake.value) == ("link.access.operators.anna", "ward-*")


def test_a_pattern_in_a_key_fits_the_names_that_it_fits_in_the_file() -> None:
    draw = random.Random(14)
    fitting = 0
    for _ in range(4000):
        pattern = draw.choice("ab*") + "".join(draw.choices("ab-.*", k=draw.randrange(6)))
        name = draw.choice("ab") + "".join(draw.choices("ab-.", k=draw.randrange(6)))
        key = zenoh.KeyExpr(f"tandem/{robot_chunk(pattern)}/state")
        fits = fnmatchcase(name, pattern)
        fitting += fits
        assert key.includes(zenoh.KeyExpr(f"tandem/{name}/state")) == fits, (pattern, name)
        assert not key.includes(zenoh.KeyExpr(f"tandem/{name}/{name}/state"))
    assert fitting > 400


def size(robots: int, nurses: int) -> int:
    """Bytes of Zenoh's rules for so many robots, and nurses who each command the ward `robot-*`."""
    access = AccessConfig(
        robots=[f"robot-{i:04}" for i in range(robots)],
        operators={f"nurse-{i:04}": ["robot-*", "home-*"] for i in range(nurses)},
        routers=["hub"],
    )
    return len(json.dumps(access_control(access)))


def test_the_rules_grow_with_robots_plus_nurses() -> None:
    for_robots, for_nurses = size(1000, 1) - size(1, 1), size(1, 50) - size(1, 1)
    product = size(1000, 50) - size(1, 1) - for_robots - for_nurses
    # the numbers in the rules' names grow longer
    assert abs(product) < 0.01 * size(1000, 50)
    assert size(1000, 50) < 3_000_000


def test_an_overlapping_pattern_adds_nothing_and_a_revoked_nurse_of_a_group_may_nothing() -> None:
    access = AccessConfig(robots=["ward-1"], operators={"anna": ["*", "ward-*"], "ben": ["ward-*", "*"]})
    rules = access_control(access, frozenset({"operator:ben"}))
    key = "tandem/ward-1/operator/anna/command"
    assert [key for rule in rules["rules"] for key in rule["key_exprs"] if "ward-$*" in key] == []
    assert may("operator:anna", "put", key, table=rules)
    assert not may("operator:ben", "put", "tandem/ward-1/operator/ben/command", table=rules)
    assert not may("operator:ben", "declare_subscriber", "tandem/ward-1/state", table=rules)
