"""Every file that a site starts from can be read, and says what the others say."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import pytest
import yaml

from common.config.load import load_config
from common.errors import LinkError
from common.link.router import RouterConfig
from common.process.runtime import SHUTDOWN_S
from deploy import cli
from deploy.client.destination import destination
from deploy.ops.router.run import zenohd_configuration
from deploy.report.panels import PANELS
from deploy.sim.suit.config import SuitConfig
from master.config import MasterConfig
from slave.config import SlaveConfig

DEPLOY = Path(cli.__file__).parent
EXAMPLES = DEPLOY / "examples"
MODELS: dict[str, Any] = {
    "master": MasterConfig, "slave": SlaveConfig, "suit": SuitConfig, "router": RouterConfig,
    "operator": MasterConfig, "robot": SlaveConfig,
}  # fmt: skip
SITE = EXAMPLES / "site"


def compose() -> dict[str, Any]:
    tree: dict[str, Any] = yaml.safe_load((DEPLOY / "ops" / "compose.yaml").read_text("utf-8"))
    return tree


@pytest.mark.parametrize(
    "path", sorted(p for p in EXAMPLES.rglob("*.toml") if p.stem in MODELS), ids=lambda p: str(p.name)
)
def test_every_example_is_a_whole_configuration(path: Path) -> None:
    assert load_config(path, MODELS[path.stem]).link is not None


def test_no_example_is_left_out() -> None:
    other = {path.name for path in EXAMPLES.rglob("*.toml") if path.stem not in MODELS}
    # a part of a slave's file, and a study's protocol
    assert other == {"dynamixel.toml", "cup.toml"}


def test_a_site_s_three_files_agree() -> None:
    operator = load_config(SITE / "operator.toml", MasterConfig)
    robot = load_config(SITE / "robot.toml", SlaveConfig)
    router = load_config(SITE / "router.toml", RouterConfig)
    assert operator.link.access == robot.link.access == router.link.access
    assert operator.commanded == [robot.robot]
    assert robot.link.access is not None
    assert robot.link.access.operators == {operator.operator.name: [robot.robot]}
    assert robot.link.access.routers == [router.name]
    names = [str(c.link.tls.certificate.name) for c in (operator, robot, router) if c.link.tls]
    assert names == ["operator-nurse-1.pem", "robot-robot-1.pem", "router-router-1.pem"]
    assert {c.link.tls.ca for c in (operator, robot, router) if c.link.tls} == {SITE / "keys" / "ca.pem"}


def test_a_zenohd_gets_the_same_keys_and_rules_and_no_revoked_names(tmp_path: Path) -> None:
    listed = tmp_path / "revoked.txt"
    config = load_config(SITE / "router.toml", RouterConfig, [f'link.revoked="{listed}"'])
    with pytest.raises(LinkError, match=r"revoked.txt cannot be read"):
        zenohd_configuration(config)
    listed.write_text("operator:nurse-1\n")
    written = json.loads(json.dumps(zenohd_configuration(config)))
    assert "operator:nurse-1" not in json.dumps(written)
    assert written["mode"] == "router"
    assert written["listen"]["endpoints"] == ["tls/0.0.0.0:7448"]
    assert written["access_control"]["enabled"] is True
    assert written["access_control"]["default_permission"] == "deny"


def test_a_person_at_the_operator_s_host_has_keys_but_no_door() -> None:
    where = destination(None, None, master=SITE / "operator.toml")
    assert where.link.tls is not None
    assert where.link.tls.certificate == SITE / "keys" / "operator-nurse-1.pem"
    assert where.link.listen == []
    assert (where.robots, where.operator) == (("robot-1",), "nurse-1")
    elsewhere = destination(["tls/10.0.0.9:7447"], None, master=SITE / "operator.toml")
    assert (elsewhere.link.connect, elsewhere.link.tls) == (["tls/10.0.0.9:7447"], where.link.tls)


def test_containers_run_commands_and_files_that_exist() -> None:
    for service in compose()["services"].values():
        command, file = service["command"]
        model = MODELS[command]
        assert load_config(SITE / Path(file).name, model).link is not None
        assert Path(file).parent == Path("/etc/tandem")


def test_containers_get_what_the_units_get_and_no_more() -> None:
    units = {"robot": "tandem-slave@.service", "operator": "tandem-master@.service"}
    for name, service in compose()["services"].items():
        assert service["network_mode"] == "host"  # the CAN interfaces are the host's
        assert service["cap_drop"] == ["ALL"]
        assert "cap_add" not in service
        assert service["read_only"] is True
        assert float(service["stop_grace_period"].removesuffix("s")) > SHUTDOWN_S
        if name in units:
            unit = (DEPLOY / "ops" / "systemd" / units[name]).read_text("utf-8")
            [priority] = re.findall(r"^LimitRTPRIO=(\d+)$", unit, re.MULTILINE)
            assert service["ulimits"]["rtprio"] == int(priority)
            assert service["mem_limit"] == service["memswap_limit"]  # as MemorySwapMax=0


def test_the_image_is_built_from_files_that_there_are() -> None:
    build = compose()["x-tandem"]["build"]
    root = (DEPLOY / "ops" / build["context"]).resolve()
    lines = (root / build["dockerfile"]).read_text("utf-8").splitlines()
    words = {line.split()[0] for line in lines if line and not line.startswith((" ", "#"))}
    assert {"FROM", "USER", "ENTRYPOINT", "STOPSIGNAL"} <= words
    project = tomllib.loads((root / "pyproject.toml").read_text("utf-8"))["project"]
    [version] = set(re.findall(r"^FROM python:(3\.\d+)", "\n".join(lines), re.MULTILINE))
    assert version == project["requires-python"].removeprefix(">=").partition(",")[0]


def test_the_deployment_page_names_commands_and_files_that_there_are() -> None:
    page = (DEPLOY.parent / "docs" / "deployment.md").read_text("utf-8")
    commands = {str(c.name) for c in cli.app.registered_commands} | set(PANELS["Judge"])
    groups = {str(g.name): g.typer_instance for g in cli.app.registered_groups}
    named = re.findall(r"(?:^|`)tandem ([a-z]+)(?: ([a-z]+))?", page, re.MULTILINE)
    assert len(named) > 10
    for command, second in named:
        assert command in commands or command in groups, command
        group = groups.get(command)
        if second and group is not None:
            assert second in {str(getattr(c.callback, "__name__", "")) for c in group.registered_commands}
    for file in re.findall(r"\$D/([\w./@-]+)", page):
        assert (DEPLOY / file).exists() or any(DEPLOY.glob(f"{file}*")), file
