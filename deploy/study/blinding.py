"""Conditions that operator and experimenter know by codes alone: which transport runs is in a key.

Somebody who takes no part draws the key from a file of conditions. The study gets its codes, and a
commitment: the SHA-256 of the key's content with 32 random bytes, which nobody can try out. The commitment
stands in the protocol or in the trial's plan, and so below their seal: a key that is shown afterwards is the
one that was used, or it does not fit.
"""

from __future__ import annotations

import hashlib
import json
import os
import random
import re
import secrets
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field

from common.config.load import load_config
from common.config.section import Section
from common.errors import ConfigMistake, TandemError
from common.link.endpoint import TRANSPORTS, check_endpoint, transport_of

VERSION = 1
_FIRST = b"tandem blinding 1 "
_LETTERS, _DIGITS = "ABCDEFGHJKLMNPRTUVWXY", "23456789"
"""Without those that look alike."""
_NAMES = "|".join(sorted(TRANSPORTS, key=len, reverse=True))
_WORD = re.compile(rf"(?<![A-Za-z0-9_-])(?:{_NAMES})(?![A-Za-z0-9_-])(?:/[^\s,'\"\])]+)?", re.IGNORECASE)
HIDDEN = "(hidden)"


class BlindCondition(Section):
    """One `[[condition]]` of the file that a key is drawn from."""

    transport: str
    connect: list[Annotated[str, AfterValidator(check_endpoint)]] = Field(default_factory=list)
    """Where the master reaches the robot in this condition; `tandem trial` needs none."""


class BlindConditions(Section):
    """The whole file."""

    condition: list[BlindCondition] = Field(min_length=2, max_length=len(TRANSPORTS))

    def mistakes(self) -> list[ConfigMistake]:
        """Each transport once, known, and that of its endpoints."""
        found, seen = [], set[str]()
        for number, one in enumerate(self.condition):
            place = f"condition.{number}"
            if one.transport not in TRANSPORTS or one.transport in seen:
                expected = f"one of {', '.join(TRANSPORTS)}, each once"
                found.append(ConfigMistake(f"{place}.transport", one.transport, expected))
            seen.add(one.transport)
            for endpoint in one.connect:
                if transport_of(endpoint) != one.transport:
                    found.append(ConfigMistake(f"{place}.connect", endpoint, f"{one.transport}/host:port"))
        return found


@dataclass(frozen=True, slots=True)
class BlindKey:
    """Which code stands for which condition. It is not to be printed before the seal."""

    nonce: str
    conditions: Mapping[str, BlindCondition]

    @property
    def codes(self) -> tuple[str, ...]:
        """In their alphabetical order, which says nothing."""
        return tuple(sorted(self.conditions))

    @property
    def commitment(self) -> str:
        """What the study holds of this key."""
        return hashlib.sha256(_FIRST + self.text().encode()).hexdigest()

    def text(self) -> str:
        """The file's content, the same for the same key."""
        tree = {code: self.conditions[code].model_dump() for code in self.codes}
        return json.dumps({"version": VERSION, "nonce": self.nonce, "conditions": tree}, indent=1)

    def condition(self, code: str) -> BlindCondition:
        """The condition of a code. Raises TandemError for a code that it does not have."""
        if code not in self.conditions:
            raise TandemError(f"--condition {code}: expected one of {', '.join(self.codes)}")
        return self.conditions[code]


def draw_key(conditions: Path) -> BlindKey:
    """A new key for the conditions of a file. Raises ConfigError."""
    listed = load_config(conditions, BlindConditions).condition
    letters = random.SystemRandom().sample(_LETTERS, k=len(listed))
    codes = [letter + secrets.choice(_DIGITS) for letter in letters]
    return BlindKey(secrets.token_hex(32), dict(zip(codes, listed, strict=True)))


def write_key(key: BlindKey, path: Path) -> None:
    """Write it for its owner's eyes alone (mode 0600). Raises TandemError where a file is there already."""
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    except OSError as error:
        raise TandemError(f"{path}: the key cannot be written ({error.strerror})") from None
    with os.fdopen(descriptor, "w", encoding="utf-8") as stream:
        stream.write(key.text())


def read_key(path: Path, study: Path | None = None) -> BlindKey:
    """The key of a file. Raises TandemError where others may read it, or it lies in the study's folder."""
    if study is not None and path.resolve().is_relative_to(study.resolve()):
        raise TandemError(f"{path}: the key of a blinded study must not lie in its folder {study}")
    try:
        if path.stat().st_mode & 0o077:
            raise TandemError(f"{path}: others may read it; chmod 600 {path}")
        tree = json.loads(path.read_text("utf-8"))
        if tree["version"] != VERSION:
            raise ValueError(f"version {tree['version']}, this tandem knows {VERSION}")
        conditions = {code: BlindCondition(**one) for code, one in tree["conditions"].items()}
        return BlindKey(str(tree["nonce"]), conditions)
    except OSError as error:
        raise TandemError(f"{path}: cannot be read ({error.strerror})") from None
    except (ValueError, KeyError, TypeError, AttributeError):
        # the reason may quote the file
        raise TandemError(f"{path}: not a key of `tandem session blind`") from None


def check_key(key: BlindKey, path: Path, codes: Sequence[str], commitment: str) -> None:
    """Whether it is the study's. Raises TandemError where it is another one, or was changed."""
    if key.commitment != commitment or set(key.codes) != set(codes):
        raise TandemError(f"{path}: not the key of this study: its commitment is not {commitment}")


def hide_transports(text: str) -> str:
    """The text without names of transports, and without endpoints, which begin with one."""
    return _WORD.sub(HIDDEN, text)
