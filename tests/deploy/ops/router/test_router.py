"""The router's file, and what becomes of it for a site's own zenohd."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import zenoh
from typer.testing import CliRunner

from common.config.load import load_config
from common.errors import ConfigError
from common.link.router import RouterConfig
from deploy.cli import app
from deploy.ops.router.run import zenohd_configuration

SECURED = """
name = "router-1"
[link]
listen = ["tls/0.0.0.0:7448", "quic-datagram/0.0.0.0:7448"]
connect = ["tls/10.0.0.9:7448"]
[link.tls]
ca = "ca.pem"
certificate = "router.pem"
key = "router.key"
[link.access]
operators = { anna = ["robot-1"] }
routers = ["router-2"]
"""


def written(folder: Path, text: str) -> Path:
    file = folder / "router.toml"
    file.write_text(text, "utf-8")
    return file


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[link]\nlisten = []", "link.listen = []: expected an endpoint where masters and robots connect"),
        ('[link]\nmode = "client"\nconnect = ["tcp/h:1"]', "link.mode = 'client': expected no mode"),
        ('name = "a/b"\n[link]\nlisten = ["tcp/h:1"]', "name = 'a/b'"),
        ('[link]\nlisten = ["tls/h:1"]', "expected the keys for it under [link.tls]"),
    ],
)
def test_mistakes_in_its_file_are_told(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config(written(tmp_path, text), RouterConfig)
    assert said in str(caught.value)


def test_zenohd_gets_the_same_endpoints_keys_and_rules(tmp_path: Path) -> None:
    file, out = written(tmp_path, SECURED), tmp_path / "zenohd.json5"
    result = CliRunner().invoke(app, ["router", str(file), "--zenohd", str(out)])
    assert result.exit_code == 0, result.output
    text = out.read_text("utf-8")
    assert text.startswith("// Made by `tandem router --zenohd` for router-1")
    settings = zenoh.Config.from_json5(text)  # Zenoh itself refuses a key that it does not know
    assert json.loads(settings.get_json("mode")) == "router"
    listen = json.loads(settings.get_json("listen/endpoints"))
    assert "quic/0.0.0.0:7448?rel=0" in str(listen)
    assert json.loads(settings.get_json("access_control/default_permission")) == "deny"
    names = re.findall(r"(?:operator|robot|router):[a-z0-9-]+", settings.get_json("access_control/subjects"))
    assert set(names) == {"operator:anna", "robot:robot-1", "router:router-2"}
    tls = json.loads(settings.get_json("transport/link/tls"))
    assert tls["enable_mtls"]
    assert tls["listen_private_key"] == str(tmp_path / "router.key")


def test_zenohd_finds_the_keys_wherever_it_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    written(tmp_path, SECURED)
    monkeypatch.chdir(tmp_path)
    [file] = Path().glob("*.toml")
    assert CliRunner().invoke(app, ["router", str(file), "--zenohd", "zenohd.json5"]).exit_code == 0
    settings = zenoh.Config.from_json5(Path("zenohd.json5").read_text("utf-8"))
    assert json.loads(settings.get_json("transport/link/tls"))["listen_private_key"] == str(
        tmp_path / "router.key"
    )


def test_without_rules_none_are_made_up(tmp_path: Path) -> None:
    config = load_config(written(tmp_path, '[link]\nlisten = ["tcp/127.0.0.1:1"]'), RouterConfig)
    settings = json.loads(json.dumps(zenohd_configuration(config)))
    assert settings["mode"] == "router"
    assert "access_control" not in settings
    assert "tls" not in settings["transport"]["link"]


def test_the_example_is_one_that_the_router_takes() -> None:
    config = load_config(Path("deploy/examples/router.toml"), RouterConfig)
    assert config.link.listen == ["tcp/0.0.0.0:7448"]
