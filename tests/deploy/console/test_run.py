"""How the console starts: where it may listen, with which keys, and what it refuses before it serves."""

from __future__ import annotations

import asyncio
import socket
import ssl
from datetime import UTC, datetime, timedelta
from pathlib import Path

import aiohttp
import pytest

from common.config.console import PAGE_KEYS, ConsoleConfig
from common.config.load import check_config
from common.errors import ConfigError, TandemError
from common.link.config import LinkConfig
from common.link.roles import Role
from deploy.certificates.folder import stem, write_pair
from deploy.certificates.make import new_authority, new_identity
from deploy.client.destination import Destination
from deploy.console.model.robot import Side
from deploy.console.options import ConsoleChoices, console_options
from deploy.console.persons import Persons
from deploy.console.run import ConsoleOptions, run_console
from deploy.console.session import PageRole, Person
from deploy.examples.profiles import example
from deploy.harness.endpoints import free_port
from tests.deploy.console.robots import OPERATOR, ROBOT, SKELETON


def config(**keys: object) -> ConsoleConfig:
    return check_config(Path("test.toml"), keys, ConsoleConfig)


@pytest.mark.parametrize("listen", ["127.0.0.1:8080", "localhost:0", "[::1]:8080", "127.5.0.1:1"])
def test_on_this_host_it_needs_no_keys(listen: str) -> None:
    assert config(listen=listen).on_this_host_only


@pytest.mark.parametrize("listen", ["0.0.0.0:8080", "192.168.7.3:8080", "[::]:8080"])
def test_where_others_reach_it_it_needs_keys(listen: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="certificate"):
        config(listen=listen)
    assert not config(listen=listen, certificate=str(tmp_path / "console.pem")).on_this_host_only


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("listen", "8080"),
        ("listen", "host:port"),
        ("listen", "1.2.3.4:99999"),
        ("names", ["a b"]),
        ("port", 80),
    ],
)
def test_what_is_no_address_is_a_mistake_of_the_file(key: str, value: object) -> None:
    with pytest.raises(ConfigError, match=key):
        config(**{key: value})


@pytest.mark.parametrize("key", PAGE_KEYS)
def test_a_key_that_stops_or_engages_is_no_deadman(key: str) -> None:
    with pytest.raises(ConfigError, match="deadman_key"):
        config(deadman_key=key)
    assert config(deadman_key="F9").deadman_key == "F9"


def options(chosen: ConsoleConfig, said: list[str]) -> ConsoleOptions:
    link = LinkConfig(listen=[f"tcp/127.0.0.1:{free_port('tcp')}"])
    return ConsoleOptions(Destination(link, (ROBOT,), OPERATOR), SKELETON, chosen, on_ready=said.append)


async def address(said: list[str], of: str) -> str:
    """What it printed for a role, once it serves."""
    async with asyncio.timeout(20.0):
        while not (found := [line for line in said if line.startswith(of)]):  # noqa: ASYNC110
            await asyncio.sleep(0.01)
    return found[-1].removeprefix(of).split()[0]


def test_it_prints_addresses_serves_and_ends() -> None:
    async def story() -> None:
        said: list[str] = []
        stop = asyncio.Event()
        running = asyncio.create_task(run_console(options(config(listen="127.0.0.1:0"), said), stop))
        page = await address(said, "operator: ")
        url, _, token = page.partition("/#token=")
        async with aiohttp.ClientSession(cookie_jar=aiohttp.CookieJar(unsafe=True)) as http:
            async with http.get(f"{url}/api/setup") as response:
                setup = await response.json()
            assert (setup["robot"], setup["zones_known"], setup["deadman"]) == (ROBOT, False, None)
            sent = {"json": {"token": token}, "headers": {"Origin": url}}
            async with http.post(f"{url}/api/login", **sent) as response:  # type: ignore[arg-type]  # as keywords
                assert response.status == 200
        newer = await address(said, "operator: ")
        assert newer != page, "the next token is printed once this one is used"
        stop.set()
        await running

    asyncio.run(story())


def test_new_tokens_are_printed_before_the_last_ones_are_too_old(monkeypatch: pytest.MonkeyPatch) -> None:
    async def story() -> None:
        monkeypatch.setattr("deploy.console.run.TOKEN_S", 0.01)
        said: list[str] = []
        stop = asyncio.Event()
        running = asyncio.create_task(run_console(options(config(listen="127.0.0.1:0"), said), stop))
        async with asyncio.timeout(20.0):
            while sum(line.startswith("operator: ") for line in said) < 3:  # noqa: ASYNC110
                await asyncio.sleep(0.01)
        stop.set()
        await running
        assert len(set(said)) == len(said)

    asyncio.run(story())


def test_beyond_this_host_it_serves_https_with_the_keys_of_tandem_keys(tmp_path: Path) -> None:
    now, valid = datetime.now(UTC), timedelta(days=1)
    authority = new_authority("test", now, valid)
    write_pair(tmp_path, "ca", authority)
    name = stem(Role.OPERATOR, "ward-3")
    write_pair(tmp_path, name, new_identity(authority, Role.OPERATOR, "ward-3", ["127.0.0.1"], now, valid))

    async def story() -> None:
        said: list[str] = []
        stop = asyncio.Event()
        chosen = config(listen="0.0.0.0:0", names=["127.0.0.1"], certificate=str(tmp_path / f"{name}.pem"))
        running = asyncio.create_task(run_console(options(chosen, said), stop))
        url = (await address(said, "console: ")).rstrip("/")
        assert url.startswith("https://127.0.0.1:")
        trusted = ssl.create_default_context(cafile=str(tmp_path / "ca.pem"))
        async with aiohttp.ClientSession(connector=aiohttp.TCPConnector(ssl=trusted)) as http:
            async with http.get(url) as response:
                assert response.status == 200
            async with http.get(f"{url}/api/setup") as response:
                assert response.status == 401, "the patient's home is for those who log in"
        stop.set()
        await running

    asyncio.run(story())


def test_a_port_that_is_taken_and_keys_that_are_not_there_are_said(tmp_path: Path) -> None:
    async def story(chosen: ConsoleConfig) -> None:
        await run_console(options(chosen, []), asyncio.Event())

    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(TandemError, match="cannot listen there"):
            asyncio.run(story(config(listen=f"127.0.0.1:{port}")))
    with pytest.raises(TandemError, match="no HTTPS"):
        asyncio.run(story(config(certificate=str(tmp_path / "none.pem"))))


def test_what_the_command_line_leaves_out_comes_from_the_masters_file(tmp_path: Path) -> None:
    chosen = ConsoleChoices(
        master=example("master"),
        listen="127.0.0.1:0",
        slave=example("slave"),
        overrides=[
            f'tap.socket="{tmp_path / "tap.sock"}"',
            f'operator.deadman={{source="console",socket="{tmp_path / "deadman.sock"}"}}',
            'console.language="zh"',
        ],
    )
    found = console_options(chosen, lambda _: None)
    assert found.where.robots == ("robot-1",)
    assert found.tap == tmp_path / "tap.sock"
    assert (found.deadman, found.deadman_socket) == ("console", tmp_path / "deadman.sock")
    assert (found.config.language, found.config.port) == ("zh", 0)
    assert found.zones is not None
    with pytest.raises(TandemError, match="which robot"):
        console_options(ConsoleChoices(connect=["tcp/127.0.0.1:7447"]), lambda _: None)


def test_beside_the_robot_the_slaves_file_is_enough(tmp_path: Path) -> None:
    chosen = ConsoleChoices(
        slave=example("slave"),
        overrides=[f'tap.socket="{tmp_path / "tap.sock"}"', 'link.listen=["tcp/0.0.0.0:7447"]'],
    )
    found = console_options(chosen, lambda _: None)
    assert (found.side, found.where.robots, found.where.operator) == (Side.ROBOT, ("robot-1",), "")
    assert found.where.link.connect == ["tcp/127.0.0.1:7447"]
    assert found.where.link.listen == []
    assert found.tap == tmp_path / "tap.sock"


def test_a_persons_certificate_stands_for_the_token_until_it_is_revoked(tmp_path: Path) -> None:
    now, valid = datetime.now(UTC), timedelta(days=1)
    authority, foreign = new_authority("test", now, valid), new_authority("other", now, valid)
    write_pair(tmp_path, "ca", authority)
    for of, name in ((authority, "ward-3"), (authority, "eve"), (authority, OPERATOR), (foreign, "forged")):
        host = ["127.0.0.1"] if name == "ward-3" else []
        identity = new_identity(of, Role.OPERATOR, OPERATOR if of is foreign else name, host, now, valid)
        write_pair(tmp_path, name, identity)
    chosen = config(certificate=str(tmp_path / "ward-3.pem"), authority=str(tmp_path / "ca.pem"))

    async def asks(url: str, shows: str | None) -> int:
        trusted = ssl.create_default_context(cafile=str(tmp_path / "ca.pem"))
        if shows is not None:
            trusted.load_cert_chain(tmp_path / f"{shows}.pem", tmp_path / f"{shows}.key")
        connector = aiohttp.TCPConnector(ssl=trusted)
        async with aiohttp.ClientSession(connector=connector) as http:
            body = {"act": "mark", "robot": "robot-1"}
            headers = {"Origin": url}
            async with http.post(f"{url}/api/act", json=body, headers=headers) as response:
                status = response.status
            async with http.post(f"{url}/api/act", json=body, headers={"Origin": "https://evil"}) as response:
                assert response.status == 403, "a browser shows its certificate to pages of others too"
            return status

    async def story() -> None:
        said: list[str] = []
        stop = asyncio.Event()
        running = asyncio.create_task(run_console(options(chosen, said), stop))
        url = (await address(said, "console: ")).rstrip("/")
        assert await asks(url, None) == 401
        assert await asks(url, OPERATOR) == 200
        assert await asks(url, OPERATOR) == 200
        assert await asks(url, "eve") == 401, "another operator's certificate is none of this console's"
        with pytest.raises((aiohttp.ClientError, ssl.SSLError, ConnectionError)):
            await asks(url, "forged")
        stop.set()
        await running

    asyncio.run(story())


def test_a_revoked_certificate_ends_its_session_and_an_expired_session_begins_anew() -> None:
    entered: list[Person] = []

    def enter(person: Person) -> str:
        entered.append(person)
        return f"secret {len(entered)}"

    persons = Persons({"observer:ward": "viewer", "operator:eng": "engineer"}, "nurse-1")
    assert persons.of("operator:nurse-1") == Person(PageRole.OPERATOR, "nurse-1")
    assert persons.of("observer:ward") == Person(PageRole.VIEWER, "ward")
    assert persons.of("operator:nurse-2") is None
    assert persons.secret("operator:nurse-2", lambda _: True, enter) == ""
    assert persons.secret("operator:eng", lambda _: True, enter) == "secret 1"
    assert persons.secret("operator:eng", lambda _: True, enter) == "secret 1"
    assert persons.secret("operator:eng", lambda _: False, enter) == "secret 2"
    assert persons.revoke(frozenset({"operator:eng"})) == ["secret 2"]
    assert persons.secret("operator:eng", lambda _: True, enter) == ""


def test_certificates_of_persons_need_https() -> None:
    with pytest.raises(ConfigError, match=r"console\.certificate"):
        config(authority="ca.pem")
