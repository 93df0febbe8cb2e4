"""The tap over real sockets: a reader that stalls, dies or comes late never holds the sender up."""

from __future__ import annotations

import asyncio
import contextlib
import stat
from collections.abc import Awaitable, Callable
from pathlib import Path

import msgpack
import pytest

from common.config.load import load_config
from common.config.section import Section
from common.errors import CodecError, ConfigError, ConfigMistake, TandemError
from common.tap.config import TapConfig
from common.tap.message import GREETING, TapMessage, decode, encode, encode_choice
from common.tap.reader import AT_ONCE, TapReader
from common.tap.sender import READERS, TapSender, open_tap

Story = Callable[[TapSender], Awaitable[None]]


def run(path: Path, story: Story) -> None:
    async def whole() -> None:
        sender = TapSender(path, lambda: msgpack.packb({"role": "test"}))
        sender.open()
        try:
            await story(sender)
        finally:
            sender.close()

    asyncio.run(whole())


async def accepted(sender: TapSender, readers: int) -> None:
    """Let the loop take in those who connect."""
    for _ in range(10_000):
        if sender.count + sender.turned_away == readers:
            return
        await asyncio.sleep(0)
    raise AssertionError(f"{sender.count} of {readers} were let in")


def test_a_reader_hears_who_sends_and_then_each_message(tmp_path: Path) -> None:
    async def story(sender: TapSender) -> None:
        with TapReader(sender.path) as reader:
            await accepted(sender, 1)
            sender.put("a/topic", b"bytes", 17)
            first, second = await reader.read(), await reader.read()
            assert (first.topic, msgpack.unpackb(first.payload)) == (GREETING, {"role": "test"})
            assert second[1:] == ("a/topic", 17, b"bytes")
            assert reader.missed == 0

    run(tmp_path / "tap", story)


def test_a_reader_of_a_busy_tap_lets_others_run_every_few_messages(tmp_path: Path) -> None:
    """Else a page, a stop key or a deadline of the same process waits until the tap is quiet."""

    async def story(sender: TapSender) -> None:
        with TapReader(sender.path) as reader:
            await accepted(sender, 1)
            for _ in range(10):
                sender.put("a/topic", b"bytes", 17)
            turns = 0

            async def other() -> None:
                nonlocal turns
                while True:
                    turns += 1
                    await asyncio.sleep(0)

            beside = asyncio.create_task(other())
            for _ in range(10):
                await reader.read()
            beside.cancel()
            assert turns >= 10 // AT_ONCE

    run(tmp_path / "tap", story)


def test_a_reader_that_stalls_is_refused_at_once_and_knows_what_it_missed(tmp_path: Path) -> None:
    async def story(sender: TapSender) -> None:
        with TapReader(sender.path) as slow, TapReader(sender.path) as quick:
            await accepted(sender, 2)
            await quick.read()
            for number in range(3000):
                sender.put("t", number.to_bytes(1200, "big"))
                assert int.from_bytes((await quick.read()).payload, "big") == number
            assert sender.refused > 1000, "nothing was queued without end"
            assert quick.missed == 0
            await slow.read()
            heard = 0
            while heard + slow.missed < 3000 - sender.refused:
                await slow.read()
                heard += 1
            sender.put("t", b"last")
            assert (await slow.read()).payload == b"last"
            assert slow.missed == sender.refused

    run(tmp_path / "tap", story)


def test_a_reader_is_owed_a_snapshot_at_its_start_and_after_a_refusal(tmp_path: Path) -> None:
    async def story(sender: TapSender) -> None:
        assert not sender.behind
        with TapReader(sender.path) as reader:
            await accepted(sender, 1)
            assert sender.behind
            sender.put_snapshot("snapshot", bytes(300_000))
            assert not sender.behind
            await reader.read()
            assert len((await reader.read()).payload) == 300_000, "a whole suit's snapshot fits"
            while not sender.refused:
                sender.put("t", bytes(1200))
            assert not sender.behind, "it stands still: no snapshot is taken for it"
            await reader.read()
            sender.put("t", b"")
            assert sender.behind
            sender.put_snapshot("snapshot", b"")
            assert not sender.behind

    run(tmp_path / "tap", story)


def test_a_reader_that_dies_is_let_go(tmp_path: Path) -> None:
    async def story(sender: TapSender) -> None:
        with TapReader(sender.path):
            await accepted(sender, 1)
        assert sender.read
        sender.put("t", b"")
        assert not sender.read

    run(tmp_path / "tap", story)


def test_one_reader_too_many_is_turned_away(tmp_path: Path) -> None:
    async def story(sender: TapSender) -> None:
        readers = [TapReader(sender.path) for _ in range(READERS)]
        await accepted(sender, READERS)
        with TapReader(sender.path) as late:
            await accepted(sender, READERS + 1)
            with pytest.raises(TandemError, match="too many"):
                await late.read()
        assert (sender.count, sender.turned_away) == (READERS, 1)
        for reader in readers:
            reader.close()

    run(tmp_path / "tap", story)


def test_only_the_owner_and_the_group_may_read_and_the_socket_goes_with_the_process(tmp_path: Path) -> None:
    path = tmp_path / "tap"

    async def story(sender: TapSender) -> None:
        assert stat.S_IMODE(sender.path.stat().st_mode) == 0o660

    run(path, story)
    assert not path.exists()
    with pytest.raises(TandemError, match=r"\[tap\] socket"):
        TapReader(path)


def test_the_socket_of_a_killed_process_is_taken_over_and_that_of_a_living_one_is_not(tmp_path: Path) -> None:
    async def story(sender: TapSender) -> None:
        with pytest.raises(TandemError, match="another process listens"):
            TapSender(sender.path, bytes).open()
        left = sender.path.rename(tmp_path / "left")
        sender.close()
        assert left.is_socket()
        again = TapSender(left, bytes)
        again.open()
        again.close()

    run(tmp_path / "tap", story)


def test_a_file_that_lies_there_is_kept_and_named(tmp_path: Path) -> None:
    path = tmp_path / "tap"
    path.write_text("a person's")
    with pytest.raises(TandemError, match="no socket"):
        TapSender(path, bytes).open()
    assert path.read_text() == "a person's"


def test_no_tap_is_opened_unless_it_is_named() -> None:
    assert open_tap(TapConfig(), {}) is None


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ('"no/such/folder/tap.sock"', "folder that exists"),
        (f'"{"x" * 120}"', "at most 100 bytes"),
        ("3", "a path, in quotes"),
    ],
)
def test_a_path_that_no_socket_can_have_is_a_mistake_of_the_file(
    tmp_path: Path, text: str, expected: str
) -> None:
    class File(Section):
        tap: TapConfig

        def mistakes(self) -> list[ConfigMistake]:
            return self.tap.mistakes()

    file = tmp_path / "x.toml"
    file.write_text(f"[tap]\nsocket = {text}\n")
    with pytest.raises(ConfigError, match=expected):
        load_config(file, File)


def test_a_message_comes_back_and_nonsense_is_refused() -> None:
    message = TapMessage(3, "topic", 5, b"payload")
    assert decode(encode(message)) == message
    for nonsense in (b"", b"\xff", msgpack.packb([1, "t", 2]), msgpack.packb([1, b"t", 2, b""])):
        with pytest.raises(CodecError):
            decode(nonsense)


def test_a_reader_that_chose_its_topics_gets_those_and_is_owed_no_snapshot(tmp_path: Path) -> None:
    async def story(sender: TapSender) -> None:
        with TapReader(sender.path, ["tandem/"]) as reader:
            await accepted(sender, 1)
            while sender.read:  # noqa: ASYNC110
                await asyncio.sleep(0)
            assert not sender.behind
            for number in range(3):
                sender.put("suit/frames", b"frames", number)
                sender.put("tandem/robot-1/state", b"state", number)
            sender.put_snapshot("suit/snapshot", b"snapshot")
            assert (await reader.read()).topic == GREETING
            heard = [await reader.read() for _ in range(3)]
            assert {message.topic for message in heard} == {"tandem/robot-1/state"}
            assert reader.missed == 0, "numbers count what was wanted"
            with TapReader(sender.path) as other:
                await accepted(sender, 2)
                assert sender.read
                sender.put("suit/frames", b"frames")
                assert [(await other.read()).topic for _ in range(2)] == [GREETING, "suit/frames"]

    run(tmp_path / "tap", story)


def test_a_reader_that_chose_topics_which_never_come_is_let_go_when_it_dies(tmp_path: Path) -> None:
    async def story(sender: TapSender) -> None:
        with TapReader(sender.path, ["never/"]) as reader:
            await accepted(sender, 1)
            await reader.read()
        for _ in range(1000):
            if not sender.count:
                return
            await asyncio.sleep(0)
        raise AssertionError("it keeps its place for ever")

    run(tmp_path / "tap", story)


def test_a_reader_that_is_gone_before_it_is_let_in_changes_nothing(tmp_path: Path) -> None:
    async def story(sender: TapSender) -> None:
        raised: list[object] = []
        asyncio.get_running_loop().set_exception_handler(lambda _, context: raised.append(context))
        TapReader(sender.path).close()
        for _ in range(100):
            await asyncio.sleep(0)
        assert (sender.count, raised) == (0, [])

    run(tmp_path / "tap", story)


def test_a_reader_that_goes_on_sending_is_let_go(tmp_path: Path) -> None:
    async def story(sender: TapSender) -> None:
        with TapReader(sender.path, ["a"]) as reader:
            await accepted(sender, 1)
            for _ in range(1000):
                with contextlib.suppress(OSError):
                    reader._socket.send(encode_choice(["b"]))
                if not sender.count:
                    return
                await asyncio.sleep(0)
        raise AssertionError("its floods would keep the loop")

    run(tmp_path / "tap", story)


@pytest.mark.parametrize("choice", [b"nonsense", b"\x05", msgpack.packb([5])])
def test_a_reader_that_sends_nonsense_is_let_go(tmp_path: Path, choice: bytes) -> None:
    async def story(sender: TapSender) -> None:
        with TapReader(sender.path) as reader:
            await accepted(sender, 1)
            reader._socket.send(choice)
            while sender.count:  # noqa: ASYNC110
                await asyncio.sleep(0)
            sender.put("a", b"b")
            assert (await reader.read()).topic == GREETING
            with pytest.raises(TandemError, match="ended"):
                await reader.read()

    run(tmp_path / "tap", story)
