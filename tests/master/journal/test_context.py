"""What a recording says of its master: files by their content, sockets by their path alone."""

from __future__ import annotations

import json
from pathlib import Path

from common.config.load import load_config
from deploy.examples.profiles import example
from deploy.recorded.recorded_config import recorded_config
from master.config import MasterConfig
from master.deadman.config import ConsoleHold
from master.journal.context import CONFIG, describe


def test_a_master_whose_deadman_is_held_on_a_page_is_described_and_read_back(tmp_path: Path) -> None:
    socket = tmp_path / "deadman.sock"
    override = f'operator.deadman={{source="console",socket="{socket}"}}'
    config = load_config(example("master"), MasterConfig, [override])
    metadata = describe(config)
    assert json.loads(metadata[CONFIG])["operator"]["deadman"]["socket"] == str(socket)
    with recorded_config(metadata, "test.mcap") as read:
        assert read.operator.deadman == ConsoleHold(source="console", socket=socket)
