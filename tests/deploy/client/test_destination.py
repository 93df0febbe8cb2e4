"""A person's command goes over both paths of the master's file, and listens on none."""

from __future__ import annotations

from pathlib import Path

from deploy.client.destination import destination

MASTER = Path(__file__).parents[3] / "deploy" / "examples" / "master.toml"
TWIN = ('link.twin={ listen = ["tcp/127.0.0.1:7999"], connect = ["tcp/10.64.0.9:7447"] }',)


def test_a_stop_goes_over_both_paths_of_the_file_and_listens_on_none() -> None:
    link = destination(None, None, master=MASTER, overrides=TWIN).link
    assert link.all_connect == ["tcp/127.0.0.1:7447", "tcp/10.64.0.9:7447"]
    assert link.all_listen == []


def test_another_endpoint_than_the_files_has_one_path() -> None:
    link = destination(["tcp/10.0.0.7:7447"], None, master=MASTER, overrides=TWIN).link
    assert link.all_connect == ["tcp/10.0.0.7:7447"]
    assert link.twin is None
