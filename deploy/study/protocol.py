"""A study's protocol: a TOML file with its steps, in their order."""

from __future__ import annotations

import hashlib
import re
from pathlib import Path

from pydantic import Field

from common.config.load import load_config
from common.config.section import Section
from common.errors import ConfigMistake, TandemError
from deploy.study.questionnaire import questionnaire_names

CODE = re.compile(r"[A-Za-z0-9]{2,16}")
COMMITMENT = re.compile(r"[0-9a-f]{64}")


class ProtocolStep(Section):
    """One `[[step]]`."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,40}$")
    text: dict[str, str]
    """What the person is told, by language: en, zh."""
    seconds: float | None = Field(default=None, gt=0.0)
    """How long it is meant to last; None: as long as it takes."""
    questionnaire: str | None = None
    """What the subject answers on the page in this step: nasa-tlx, sus."""


class StudyProtocol(Section):
    """The whole file."""

    name: str = Field(pattern=r"^[A-Za-z0-9_-]{1,40}$")
    version: str
    signed: bool = False
    """Whether a session's seal must bear a signature, so that one without it fails."""
    blinded: bool = False
    """Whether operator and experimenter know the conditions by codes alone: see `tandem session blind`."""
    conditions: list[str] = Field(default_factory=list)
    """The conditions' codes: each subject goes through all steps in each, in a balanced order."""
    commitment: str = ""
    """What stands for the key of the codes: printed with it."""
    step: list[ProtocolStep] = Field(min_length=1)

    def mistakes(self) -> list[ConfigMistake]:
        """Each step's name once; questionnaires that there are."""
        names = [step.name for step in self.step]
        twice = sorted({name for name in names if names.count(name) > 1})
        wrong = [ConfigMistake("step.name", name, "a name that no other step has") for name in twice]
        expected = f"one of {', '.join(questionnaire_names())}"
        for asked in (step.questionnaire for step in self.step):
            if asked is not None and asked not in questionnaire_names():
                wrong.append(ConfigMistake("step.questionnaire", asked, expected))
        return wrong + self._wrong_blinding()

    def _wrong_blinding(self) -> list[ConfigMistake]:
        if not self.blinded:
            unused = [name for name in ("conditions", "commitment") if getattr(self, name)]
            return [ConfigMistake(name, getattr(self, name), "blinded = true beside it") for name in unused]
        wrong = []
        if len(set(self.conditions)) < 2 or not all(CODE.fullmatch(code) for code in self.conditions):
            expected = "two codes or more, as `tandem session blind` printed them"
            wrong.append(ConfigMistake("conditions", self.conditions, expected))
        if not COMMITMENT.fullmatch(self.commitment):
            expected = "64 digits, as `tandem session blind` printed them"
            wrong.append(ConfigMistake("commitment", self.commitment, expected))
        return wrong


def load_protocol(path: Path) -> tuple[StudyProtocol, str]:
    """The protocol, and the SHA-256 of its file. Raises ConfigError."""
    protocol = load_config(path, StudyProtocol)
    return protocol, hashlib.sha256(path.read_bytes()).hexdigest()


def check_code(what: str, code: str) -> str:
    """A subject's or session's code. Raises TandemError where it looks like a name."""
    if not CODE.fullmatch(code):
        raise TandemError(f"{what} {code!r}: expected a code of 2 to 16 letters and digits, never a name")
    return code
