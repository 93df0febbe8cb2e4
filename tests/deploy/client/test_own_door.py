"""A process beside the slave reaches it without standing at its doors."""

from __future__ import annotations

from pathlib import Path

from common.link.config import LinkConfig, TwinConfig
from deploy.client.own_door import own_doors


def test_it_connects_where_the_slave_listens_and_listens_nowhere() -> None:
    second = TwinConfig(listen=["tcp/127.0.0.1:7448"])
    slave = LinkConfig(listen=["tcp/0.0.0.0:7447"], twin=second)
    where = own_doors(Path("slave.toml"), slave, "robot-1")
    assert where.robots == ("robot-1",)
    assert where.link.all_connect == ["tcp/127.0.0.1:7447"]
    assert where.link.all_listen == [], "the slave itself listens there: a second listener fails"
