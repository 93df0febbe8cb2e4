"""A person's acts over tls, with a certificate of his own or the master's, at a robot with rules."""

from __future__ import annotations

import asyncio
import socket
from pathlib import Path

import pytest
from typer.testing import CliRunner

from common.errors import ConfigError, LinkError, TandemError
from common.link import open_link
from common.link.certificates import check_operator
from common.link.config import AccessConfig, LinkConfig
from common.link.roles import Role
from common.wire.codec import decode, encode
from common.wire.messages import Action, ControlReply, ControlRequest
from common.wire.stop import StopAnswer, pack_stop_answer, read_stop
from common.wire.topics import CONTROL, STOP
from deploy import cli
from deploy.certificates.folder import stem
from deploy.client.answer import RobotAnswer
from deploy.client.ask import ask_robots
from deploy.client.destination import destination
from deploy.client.stop import stop_robots
from deploy.harness.keys import make_keys, tls_of

ACCESS = AccessConfig(operators={"nurse-1": ["robot-1"]}, routers=["router-1"])


@pytest.fixture(name="keys", scope="module")
def some_keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_keys(tmp_path_factory.mktemp("keys"), ["tls/127.0.0.1:1"], ["robot-1", "robot-2"])


def endpoint() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tls/127.0.0.1:{probe.getsockname()[1]}"


def asked(at: str, keys: Path, who: str, *actions: Action) -> list[RobotAnswer]:
    async def story() -> list[RobotAnswer]:
        config = LinkConfig(listen=[at], tls=tls_of(keys, Role.ROBOT, "robot-1"), access=ACCESS)
        async with open_link(config, "robot-1") as robot:

            def answer(payload: bytes, _: int) -> bytes:
                if read_stop(payload) is not None:
                    return pack_stop_answer(StopAnswer(True, "estop", ""))
                return encode(
                    ControlReply(True, str(decode(payload, ControlRequest).action), "", challenge=1)
                )

            robot.answer(CONTROL, answer)
            robot.answer(STOP, answer)
            where = destination([at], ["robot-1"], "nurse-1", certificate=keys / f"{who}.pem")
            return [(await ask_robots(where, action))[0] for action in actions]

    return asyncio.run(story())


def test_an_operator_engages_and_whoever_is_not_named_does_not(keys: Path) -> None:
    (engaged,) = asked(endpoint(), keys, "operator-nurse-1", Action.ENGAGE)
    assert (engaged.done, engaged.guard) == (True, "engage")
    (stopped,) = asked(endpoint(), keys, "robot-robot-1", Action.ESTOP)
    assert (stopped.done, stopped.guard) == (True, "estop")
    (refused,) = asked(endpoint(), keys, "robot-robot-2", Action.ENGAGE)
    assert not refused.done
    assert "Check also that [link.access] permits your certificate" in refused.text


def test_a_secure_endpoint_asks_who_you_are() -> None:
    with pytest.raises(TandemError, match=r"a certificate is needed there: name yours by --certificate"):
        destination(["tls/127.0.0.1:1"], ["robot-1"])
    assert destination(["tcp/127.0.0.1:1"], ["robot-1"]).link.tls is None


def test_the_master_s_file_lends_its_keys_but_no_doors_or_rules(keys: Path, tmp_path: Path) -> None:
    example = Path("deploy/examples/master.toml").read_text("utf-8")
    own = tls_of(keys, Role.OPERATOR, "nurse-1")
    ends = '["tls/10.0.0.1:1"]\nmode = "client"'
    text = example.replace('["tcp/127.0.0.1:7447"]', ends, 1).replace(
        "[nodes] ",
        f'[link.tls]\nca = "{own.ca}"\ncertificate = "{own.certificate}"\nkey = "{own.key}"\n'
        '[link.access]\noperators = { nurse-1 = ["robot-1"] }\n[nodes] ',
        1,
    )
    (tmp_path / "master.toml").write_text(text)
    link = destination(None, None, master=tmp_path / "master.toml").link
    assert (link.connect, link.listen, link.mode) == (["tls/10.0.0.1:1"], [], "client")
    assert link.tls == own
    assert link.access is None
    other = tls_of(keys, Role.ROBOT, "robot-1").certificate
    assert destination(None, None, master=tmp_path / "master.toml", certificate=other).link.tls == tls_of(
        keys, Role.ROBOT, "robot-1"
    )


def test_a_certificate_alone_is_no_key(keys: Path, tmp_path: Path) -> None:
    lonely = tmp_path / f"{stem(Role.OPERATOR, 'nurse-1')}.pem"
    lonely.write_bytes((keys / lonely.name).read_bytes())

    async def story() -> None:
        await ask_robots(destination(["tls/127.0.0.1:1"], ["r"], "a", certificate=lonely), Action.STATUS)

    with pytest.raises(LinkError, match=r"ca\.pem cannot be read \(No such file"):
        asyncio.run(story())


def test_an_endpoint_that_is_none_is_still_told(keys: Path) -> None:
    with pytest.raises(ConfigError, match="expected a protocol out of"):
        destination(["tsl/127.0.0.1:1"], ["r"], certificate=keys / "operator-nurse-1.pem")


def test_with_rules_a_robot_is_seen_and_stopped_by_those_named(keys: Path) -> None:
    at = endpoint()

    async def story() -> list[RobotAnswer]:
        config = LinkConfig(listen=[at], tls=tls_of(keys, Role.ROBOT, "robot-1"), access=ACCESS)
        async with open_link(config, "robot-1") as robot:
            robot.answer(STOP, lambda *_: pack_stop_answer(StopAnswer(True, "estop", "stopped", 7)))
            robot.declare_alive("slave", 7, [at])
            where = destination([at], [], "nurse-1", certificate=keys / "operator-nurse-1.pem")
            return await stop_robots(where, everyone=True, within_s=5.0)

    (answer,) = asyncio.run(story())
    assert (answer.robot, answer.done, answer.instance) == ("robot-1", True, 7)


def test_the_certificate_tells_who_the_operator_is(keys: Path) -> None:
    own = keys / "operator-nurse-1.pem"

    def of(operator: str, certificate: Path) -> tuple[str, str]:
        where = destination(["tls/127.0.0.1:1"], ["robot-1"], operator, certificate=certificate)
        return where.operator, where.claimed

    assert of("", own) == ("nurse-1", "")
    assert of("nurse-2", own) == ("nurse-1", "nurse-2")
    assert of("nurse-2", keys / "robot-robot-1.pem") == ("nurse-2", "nurse-2")
    assert of("nurse-2", keys / "absent.pem") == ("nurse-2", "nurse-2")
    at = ["--connect", "tls/127.0.0.1:1", "--robot", "robot-1", "--certificate", str(own)]
    engaged = CliRunner().invoke(cli.app, ["engage", *at, "--operator", "nurse-2"])
    assert isinstance(engaged.exception, TandemError)
    assert "your certificate is that of operator nurse-1, not of nurse-2" in str(engaged.exception)


def test_a_master_commands_under_the_name_in_its_certificate(keys: Path) -> None:
    link = LinkConfig(
        connect=["tls/127.0.0.1:1"], tls=tls_of(keys, Role.OPERATOR, "nurse-1"), access=AccessConfig()
    )
    check_operator(link, "nurse-1")
    for name in ("nurse-2", "Nurse-1", ""):
        with pytest.raises(
            LinkError, match=rf"is the certificate of operator:nurse-1, expected operator:{name}:"
        ):
            check_operator(link, name)
    check_operator(link.model_copy(update={"access": None}), "nurse-2")
