from pathlib import Path
from typing import Literal

import pytest
from pydantic import Field

from common.config.load import load_config
from common.config.section import Section
from common.errors import ConfigError, ConfigMistake
from common.link.config import LinkConfig


class NodeSection(Section):
    id: int


class ExampleConfig(Section):
    robot: str
    rate_hz: float = 200.0
    filter: Literal["vqf", "mahony"] = "vqf"
    link: LinkConfig = LinkConfig()
    nodes: list[NodeSection] = Field(default_factory=list)

    def mistakes(self) -> list[ConfigMistake]:
        ids = [node.id for node in self.nodes]
        return [ConfigMistake("nodes", ids, "each id once")] if len(set(ids)) < len(ids) else []


def load(folder: Path, text: str, *overrides: str) -> ExampleConfig:
    path = folder / "master.toml"
    path.write_text(text, "utf-8")
    return load_config(path, ExampleConfig, overrides)


def lines_of_error(folder: Path, text: str, *overrides: str) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        load(folder, text, *overrides)
    return str(caught.value).splitlines()


def test_a_good_file_is_read(tmp_path: Path) -> None:
    text = 'robot = "r"\nrate_hz = 100\n[link]\nlisten = ["tcp/0.0.0.0:7447"]\n[[nodes]]\nid = 1\n'
    config = load(tmp_path, text)
    assert config.rate_hz == 100.0
    assert config.link.listen == ["tcp/0.0.0.0:7447"]
    assert config.nodes[0].id == 1


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("robot = 'r'\nrat_hz = 5", "rat_hz = 5: expected no such key (is it misspelt?)"),
        ("robot = 'r'\n[link]\nlistn = []", "link.listn = []: expected no such key (is it misspelt?)"),
        ("robot = 7", "robot = 7: expected a valid string"),
        ("robot = 'r'\nrate_hz = '200'", "rate_hz = '200': expected a valid number"),
        ("robot = 'r'\nrate_hz = nan", "rate_hz = nan: expected a finite number"),
        ("robot = 'r'\nfilter = 'ekf'", "filter = 'ekf': expected 'vqf' or 'mahony'"),
        ("rate_hz = 5.0", "robot = (not set): expected this key to be set"),
        ("robot = 'r'\n[[nodes]]\nid = 1.5", "nodes.0.id = 1.5: expected a valid integer"),
        ("robot = 'r'\nnodes = [{id = 4}, {id = 4}]", "nodes = [4, 4]: expected each id once"),
        (
            "robot = 'r'\n[link]\nconnect = ['tpc/1.2.3.4:7447']",
            "link.connect.0 = 'tpc/1.2.3.4:7447': expected a protocol out of tcp, udp, tls, quic, "
            "quic-datagram, ws, unixsock-stream, such as tcp/192.168.7.2:7447",
        ),
    ],
)
def test_a_mistake_names_file_key_value_and_what_was_expected(tmp_path: Path, text: str, line: str) -> None:
    lines = lines_of_error(tmp_path, text)
    assert len(lines) == 1
    assert lines[0].startswith(f"{tmp_path / 'master.toml'}: {line}")


def test_each_mistake_has_its_line(tmp_path: Path) -> None:
    assert len(lines_of_error(tmp_path, "robot = 7\nrate = 5\nfilter = ''")) == 3


def test_a_long_value_is_cut(tmp_path: Path) -> None:
    (line,) = lines_of_error(tmp_path, f"robot = ['{'x' * 500}']")
    assert len(line) < 300
    assert "…: expected a valid string" in line


def test_a_file_that_cannot_be_read(tmp_path: Path) -> None:
    for path, why in [
        (tmp_path / "none.toml", "a readable file (No such file or directory)"),
        (tmp_path, "a readable file (Is a directory)"),
    ]:
        with pytest.raises(ConfigError) as caught:
            load_config(path, ExampleConfig)
        assert str(caught.value) == f"{path}: file = {str(path)!r}: expected {why}"


def test_a_file_that_is_no_toml_or_no_text(tmp_path: Path) -> None:
    (line,) = lines_of_error(tmp_path, "robot = = 5")
    assert "expected valid TOML (Invalid value (at line 1, column 9))" in line
    path = tmp_path / "latin.toml"
    path.write_bytes(b"robot = '\xff'")
    with pytest.raises(ConfigError, match="expected UTF-8 text"):
        load_config(path, ExampleConfig)


def test_one_key_may_be_set_beside_the_file(tmp_path: Path) -> None:
    text = 'robot = "r"\n[[nodes]]\nid = 1\n'
    config = load(tmp_path, text, "rate_hz=50.0", 'link.listen=["ws/localhost:80"]', "nodes.0.id=9")
    assert (config.rate_hz, config.link.listen, config.nodes[0].id) == (50.0, ["ws/localhost:80"], 9)


def test_a_file_of_changes_stands_for_its_lines(tmp_path: Path) -> None:
    changes = tmp_path / "run.changes"
    changes.write_text('rate_hz=50.0\n\nlink.listen=["ws/localhost:80"]\n', "utf-8")
    config = load(tmp_path, 'robot = "r"\n', f"@{changes}", 'robot="s"')
    assert (config.rate_hz, config.link.listen, config.robot) == (50.0, ["ws/localhost:80"], "s")


@pytest.mark.parametrize(
    ("override", "line"),
    [
        ("@none.changes", "--set: --set = '@none.changes': expected section.key=value, or @FILE: a readable"),
        ("rate_hz", "--set: --set = 'rate_hz': expected section.key=value"),
        ("robot=r", "--set: robot = 'r': expected a TOML value; texts need quotes, as in"),
        ("robot.name=5", "--set: robot.name = '5': expected"),
        ("nodes.5.id=5", "--set: nodes.5.id = '5': expected 5 to be in the file"),
        ("rate=5", "/master.toml: rate = 5: expected no such key"),
    ],
)
def test_a_wrong_override_says_so(tmp_path: Path, override: str, line: str) -> None:
    (said,) = lines_of_error(tmp_path, 'robot = "r"\nnodes = []\n', override)
    assert line in said
