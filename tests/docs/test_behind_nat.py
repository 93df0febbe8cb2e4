"""The files of docs/behind-nat.md are such as tandem takes."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import pytest

from common.config.load import check_config
from common.link.config import LinkConfig

PAGE = (Path(__file__).parents[2] / "docs/behind-nat.md").read_text("utf-8")
BLOCKS = re.findall(r"```toml\n# ([^\n]+)\n(.*?)```", PAGE, re.DOTALL)
KEYS = {"ca": "keys/ca.pem", "certificate": "keys/own.pem", "key": "keys/own.key"}


@pytest.mark.parametrize(("name", "text"), BLOCKS, ids=[name for name, _ in BLOCKS])
def test_a_link_of_the_page_is_taken(name: str, text: str, tmp_path: Path) -> None:
    link = {"tls": KEYS, **tomllib.loads(text)["link"]}
    config = check_config(tmp_path / name.split()[0].strip(","), link, LinkConfig)
    assert config.mistakes() == []
    assert (config.mode == "client") == (not name.startswith("router"))


def test_there_are_some() -> None:
    assert len(BLOCKS) == 5
