"""What `[link]` may say: keys that fit each other, quality of service, and who is named."""

from __future__ import annotations

from pathlib import Path

import pytest

from common.config.load import load_config
from common.config.section import Section
from common.errors import ConfigError
from common.link.config import LinkConfig
from common.wire.topics import COMMAND, CONTROL, VIDEO, Priority, video

TLS = '[link.tls]\nca = "ca.pem"\ncertificate = "me.pem"\nkey = "me.key"\n'


class File(Section):
    link: LinkConfig

    def mistakes(self):  # type: ignore[no-untyped-def]
        return self.link.mistakes()


def link(folder: Path, text: str) -> LinkConfig:
    (folder / "some.toml").write_text("[link]\n" + text, "utf-8")
    return load_config(folder / "some.toml", File).link


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('listen = ["tls/0.0.0.0:1"]', "link.listen = 'tls/0.0.0.0:1': expected the keys for it under"),
        ('connect = ["quic-datagram/h:1"]', "link.connect = 'quic-datagram/h:1': expected the keys"),
        ('connect = ["quic/h:1?rel=0"]', "make them with `tandem keys`"),
        ('connect = ["tcp/h:1"]\n[link.access]', "expected [link.tls] beside it"),
        (
            f'listen = ["tls/h:1", "tcp/h:2"]\n{TLS}[link.access]',
            "link.listen = 'tcp/h:2': expected one of tls",
        ),
        ('mode = "client"', "link.connect = []: expected a router's endpoint"),
        ('mode = "client"\nconnect = ["tcp/h:1"]\nlisten = ["tcp/h:2"]', "expected nothing with mode"),
        ('mode = "router"\nlisten = ["tcp/h:2"]', "link.mode = 'router': expected 'peer' or 'client'"),
        ("[link.topics.comand]", "link.topics.comand = '…': expected one of the topics command, state"),
        ("[link.topics.alive]", "expected one of the topics"),
        ("[link.topics.clock]\nreliable = false", "always reliable"),
        ('[link.topics.video]\ncongestion = "block"', "freeze the servo loop for 5 s"),
        ('[link.topics.command]\npriority = "urgent"', "'real_time', 'interactive_high'"),
        ('[link.access]\noperators = { "a:b" = ["r"] }', "link.access.operators.a:b"),
    ],
)
def test_what_does_not_fit_is_refused_with_what_would(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(ConfigError) as caught:
        link(tmp_path, text)
    assert said in str(caught.value)
    assert len(caught.value.mistakes) == 1


def test_keys_lie_beside_the_file(tmp_path: Path) -> None:
    tls = link(tmp_path, 'listen = ["tls/h:1", "quic/h:1", "quic-datagram/h:2"]\n' + TLS).tls
    assert tls is not None
    assert (tls.ca, tls.key) == (tmp_path / "ca.pem", tmp_path / "me.key")


def test_every_robot_that_somebody_has_to_do_with_is_known(tmp_path: Path) -> None:
    text = TLS + '[link.access]\noperators = { a = ["r1", "r2"], b = ["r2"] }\nviewers = { c = ["r3"] }'
    access = link(tmp_path, text).access
    assert access is not None
    assert access.all_robots == ["r1", "r2", "r3"]


def test_a_topic_travels_as_the_file_says_and_else_as_the_table_does(tmp_path: Path) -> None:
    text = (
        '[link.topics.command]\npriority = "data_high"\nreliable = true\n[link.topics.video]\nexpress = true'
    )
    config = link(tmp_path, text)
    tuned = config.quality(COMMAND)
    assert (tuned.priority, tuned.reliable, tuned.express) == (Priority.DATA_HIGH, True, COMMAND.express)
    assert tuned.key == COMMAND.key
    assert config.quality(CONTROL) is CONTROL
    assert config.quality(video("left")).express is not VIDEO.express
    assert config.quality(video("left")).key == video("left").key
