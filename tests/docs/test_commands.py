"""Every `tandem …` command that a page shows exists, with the options that it is shown with."""

import re
from typing import Any

import pytest
import typer.main

from deploy.cli import app

from .test_pages import PAGES, ROOT

CODE = re.compile(r"^```\w*\n(.*?)^```$|`([^`\n]+)`", re.MULTILINE | re.DOTALL)
COMMAND = re.compile(r"^tandem ([a-z][^#\n]*)", re.MULTILINE)


def unknown(text: str) -> list[str]:
    """Commands and options in a page's code that `tandem` does not have."""
    root: Any = typer.main.get_command(app)
    wrong = []
    for shown in COMMAND.findall("\n".join("".join(code) for code in CODE.findall(text))):
        words, command = shown.split(), root
        while words and words[0] in getattr(command, "commands", {}):
            command = command.commands[words.pop(0)]
        if command is root:
            wrong.append(shown)
            continue
        leaves = [command, *getattr(command, "commands", {}).values()]
        known = {option for leaf in leaves for p in leaf.params for option in (*p.opts, *p.secondary_opts)}
        wrong += [
            f"{shown}: {w}"
            for w in re.findall(r"(?<= )--[a-z-]+", f" {shown}")
            if w not in known | {"--help"}
        ]
    return wrong


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_the_commands_of_a_page_exist(page: Any) -> None:
    if page.name != "CHANGELOG.md":
        assert unknown(page.read_text("utf-8")) == []


def test_a_planted_command_and_a_planted_option_are_found() -> None:
    assert unknown("`tandem dance now` and `tandem demo --profile hand --dance`") == [
        "dance now",
        "demo --profile hand --dance: --dance",
    ]
