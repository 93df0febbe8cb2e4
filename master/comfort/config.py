"""`[operator]` keys that make a whole day in the suit bearable."""

from __future__ import annotations

from collections.abc import Sequence

from pydantic import Field

from common.config.section import Section
from common.errors import ConfigMistake
from common.inputs.config import KeyConfig


class ZeroPoseAgainConfig(Section):
    """`[operator.zero_pose_again]`: how the operator asks for another zero pose, and the robot holds."""

    tap_node: str | None = None
    """Two taps on this node ask for it, and while it counts down call it off; None: no taps."""
    tap_m_s2: float = Field(default=20.0, ge=10.0, le=100.0)
    """How hard a tap is at least, m/s² beyond gravity."""
    key: KeyConfig | None = None
    """A pedal or button that asks for it, as two taps do; `tandem inputs` shows its name. None: no key."""
    countdown_s: float = Field(default=5.0, ge=1.0, le=60.0)
    """From asking until the pose begins."""
    give_up_s: float = Field(default=15.0, ge=1.0, le=120.0)
    """So long a good pose is waited for after the countdown; then the old one stays."""

    @property
    def wanted(self) -> bool:
        """Whether there is any way to ask."""
        return self.tap_node is not None or self.key is not None

    def mistakes_for(self, segments: Sequence[str], zero_pose_s: float) -> list[ConfigMistake]:
        """A node that there is not, and a pose that nobody takes."""
        key, out = "operator.zero_pose_again", []
        if self.tap_node is not None and self.tap_node not in segments:
            out.append(ConfigMistake(f"{key}.tap_node", self.tap_node, f"one of {', '.join(segments)}"))
        if self.wanted and zero_pose_s == 0.0:
            expected = "more than 0, as operator.zero_pose_again takes that pose again"
            out.append(ConfigMistake("estimation.zero_pose_s", zero_pose_s, expected))
        return out
