"""A copy of a recording for others: motion and sensors, no pictures, no names, no dates, no hosts.

Only what is listed here gets into the copy, each message written anew from its fields: texts that the robot
or a person wrote are left out, as a name may stand in any. Motion itself can identify a person: the copy is
pseudonymised, not anonymous.
"""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import secrets
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from common.clock import NS_PER_S
from common.errors import CodecError, RecordingError, TandemError
from common.recording import Entry, McapRecorder, RecordingStream
from common.skeleton import Skeleton
from common.wire.codec import decode, encode
from common.wire.messages import Command, RobotState
from common.wire.sender import operator_of
from deploy.study.marks import MARK_TOPIC, NOW_TOPIC, MarkKind
from deploy.study.pseudonyms import LETTERS
from master.journal.calls import FRAMES
from slave.tap import TICK

DAY_NS = 86_400 * NS_PER_S
KEPT_METADATA = ("profile", "rate_hz", "study_protocol", "study_protocol_version", "study_protocol_sha256")
SHARING = "sharing"
"""What the subject must have consented to, where a session was recorded."""
WAIT_S = 0.002


class ShareKey:
    """A secret by which the same person gets the same code, and the same shift of dates, in each copy."""

    def __init__(self, path: Path) -> None:
        """Read it, or make a new one (mode 0600). Raises TandemError where it is none, or open to others."""
        try:
            if not path.exists():
                descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
                with os.fdopen(descriptor, "w", encoding="ascii") as stream:
                    stream.write(secrets.token_hex(32) + "\n")
            if path.stat().st_mode & 0o077:
                raise TandemError(f"{path}: others may read it; chmod 600 {path}")
            self._key = bytes.fromhex(path.read_text("ascii").strip())
        except OSError as error:
            raise TandemError(f"{path}: cannot be read or made ({error.strerror})") from None
        except ValueError:
            raise TandemError(f"{path}: no key for sharing; name another file") from None
        if len(self._key) < 16:
            raise TandemError(f"{path}: no key for sharing; name another file")

    def code(self, kind: str, name: str) -> str:
        """Six letters in place of a name."""
        number = int.from_bytes(self._digest(kind, name)[:8])
        return "".join(LETTERS[number // len(LETTERS) ** i % len(LETTERS)] for i in range(6))

    def shift_ns(self, subject: str) -> int:
        """By how much dates go back: one to ten years, in whole days."""
        return (365 + int.from_bytes(self._digest("date", subject)[:8]) % 3286) * DAY_NS

    def _digest(self, kind: str, name: str) -> bytes:
        return hmac.digest(self._key, f"{kind}\0{name}".encode(), hashlib.sha256)


class _Copier:
    """Makes each message anew; None for one that is left out."""

    def __init__(self, key: ShareKey, skeleton: Skeleton) -> None:
        self._key = key
        self._joints = len(skeleton.joints)
        self.names: set[str] = set()
        """Names that were replaced."""
        self.kept: Counter[str] = Counter()
        self.left_out: Counter[str] = Counter()

    def copy(self, entry: Entry) -> tuple[str, bytes] | None:
        """Topic and content in the copy."""
        made = self._made(entry)
        (self.left_out if made is None else self.kept)[entry.topic.rpartition("/")[2]] += 1
        return made

    def _made(self, entry: Entry) -> tuple[str, bytes] | None:
        if entry.topic in (FRAMES, TICK):
            return entry.topic, entry.payload
        if entry.topic == NOW_TOPIC:
            told = json.loads(entry.payload)
            subject = self._key.code("subject", told["subject"])
            now = {"subject": subject, "session": told["session"], "step": told["step"]}
            return NOW_TOPIC, json.dumps(now).encode()
        if entry.topic == MARK_TOPIC:
            told = json.loads(entry.payload)
            free = told["kind"] not in (MarkKind.STEP, MarkKind.ANSWERS)
            mark = {"kind": told["kind"], "text": "" if free else told["text"]}
            return MARK_TOPIC, json.dumps({**mark, "monotonic_ns": told["monotonic_ns"]}).encode()
        try:
            return self._message(entry)
        except CodecError:
            return None

    def _message(self, entry: Entry) -> tuple[str, bytes] | None:
        match entry.topic.split("/"):
            case ["tandem", robot, "state"]:
                state = decode(entry.payload, RobotState, self._joints)
                self.names |= {robot, state.robot, state.operator} - {""}
                operator = self._key.code("operator", state.operator) if state.operator else ""
                code = self._key.code("robot", state.robot)
                plain = replace(
                    state, robot=code, operator=operator, reason="", faults={}, instance=0, resting=()
                )
                return f"tandem/{self._key.code('robot', robot)}/state", encode(plain)
            case ["tandem", robot, "operator", _, "command"]:
                command = decode(entry.payload, Command, self._joints)
                operator = operator_of(entry.topic) or ""
                self.names |= {robot, command.robot, operator} - {""}
                bare = replace(command, robot=self._key.code("robot", command.robot), doubt="", lease=1)
                of = f"{self._key.code('robot', robot)}/operator/{self._key.code('operator', operator)}"
                return f"tandem/{of}/command", encode(bare)
        return None


def write_share(source: Path, out: Path, skeleton: Skeleton, key: ShareKey) -> str:
    """Write the copy; what is in it, in words.

    Raises TandemError where the subject has not consented to sharing, or a name got into the copy.
    """
    head = _consented(source)
    person = head.get("study_subject", source.stem)
    subject, shift_ns = key.code("subject", person), key.shift_ns(person)
    metadata = {name: head[name] for name in KEPT_METADATA if name in head}
    derived = hashlib.sha256(source.read_bytes()).hexdigest()
    metadata |= {"shared_subject": subject, "derived_from_sha256": derived}
    copier = _Copier(key, skeleton)
    wall = _WallClock()
    with McapRecorder(out, metadata, wall=wall.read) as recorder:
        try:
            for entry in RecordingStream(source):
                made = copier.copy(entry)
                if made is not None:
                    wall.now_ns = entry.wall_ns - shift_ns
                    _put(recorder, made, entry.monotonic_ns)
        except BaseException:  # a part of a copy, in which nobody looked for names
            out.unlink(missing_ok=True)
            raise
    if recorder.counters.failed:
        raise TandemError(f"{out}: cannot be written: {recorder.counters.failed}")
    _check(out, copier.names)
    kept = ", ".join(f"{count} {name}" for name, count in sorted(copier.kept.items()))
    gone = ", ".join(sorted(copier.left_out)) or "nothing"
    return f"subject {subject}: {kept}; left out: {gone}"


class _WallClock:
    """The time of day that the copy's next message bears."""

    def __init__(self) -> None:
        self.now_ns = 0

    def read(self) -> int:
        """As the recorder asks."""
        return self.now_ns


def _put(recorder: McapRecorder, made: tuple[str, bytes], monotonic_ns: int) -> None:
    """Hand it over, and wait where the disk is slower than this process."""
    while not recorder.put(*made, monotonic_ns) and not recorder.counters.failed:
        time.sleep(WAIT_S)


def _consented(source: Path) -> Mapping[str, str]:
    """The head of a recording that may be shared.

    Raises TandemError where a subject has not consented: of the session that it was made for, or of one that
    was under way while a recorder ran for good.
    """
    stream = RecordingStream(source)
    scopes = [json.loads(entry.payload).get("scope") for entry in stream if entry.topic == NOW_TOPIC]
    head = stream.metadata
    if head is None:
        raise RecordingError(f"{source}: not a recording of tandem")
    if "study_scope" in head:
        scopes = [head["study_scope"].split()]
    if not all(isinstance(scope, list) and SHARING in scope for scope in scopes):
        raise TandemError(
            f"{source}: its subject has not consented to sharing (`tandem session start --scope {SHARING}`)"
        )
    return head


def _check(out: Path, names: set[str]) -> None:
    """Raise TandemError, and remove the copy, where a name that was replaced still stands in it."""
    stream = RecordingStream(out)
    wanted = sorted(name for name in names if len(name) > 2)
    for entry in stream:
        said = entry.topic.encode() + b" " + entry.payload
        found = [name for name in wanted if name.encode() in said]
        if found:
            out.unlink()
            raise TandemError(f"{out}: {found[0]} would stand in it, in {entry.topic}: nothing was written")
