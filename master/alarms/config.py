"""`[alarms]` of the master's TOML file."""

from __future__ import annotations

from pydantic import Field

from common.config.section import Section


class AlarmsConfig(Section):
    """How the operator hears what she may not see."""

    off: bool = False
    """True: no tone is ever played."""
    volume: float = Field(0.5, gt=0.0, le=1.0)
    """Share of the sound card's full scale."""
    device: str | int | None = None
    """Name of the sound card, a part of it, or its number (`tandem alarms` lists them); None: the default."""
    pause_s: float = Field(120.0, ge=10.0, le=600.0)
    """How long `tandem pause-alarms` silences what is sounding."""
