"""What a network does to packets, as data: the TOML files in `profiles/`, or one of your own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pydantic import Field

from common.config.load import load_config
from common.config.section import Section
from common.errors import ConfigError, ConfigMistake

PROFILES = Path(__file__).parent / "profiles"
PACKET_BITS = 1500 * 8
"""A full packet: a queue holds at least one."""


class Way(Section):
    """One direction of the link. In the file `[both]`, over which `[to_robot]` and `[to_operator]` win."""

    delay_ms: float = Field(0.0, ge=0, le=5000)
    """Mean time of a small packet over an idle link."""
    jitter_ms: float = Field(0.0, ge=0, le=1000)
    """Standard deviation of that time. It wanders, skewed towards late, and packets keep their order."""
    loss_percent: float = Field(0.0, ge=0, le=100)
    """The share of all packets that are lost, in the long run."""
    burst_packets: float | None = Field(None, ge=1, le=10_000)
    """Mean length of a bad period (Gilbert–Elliott); unset: each packet is lost or not by itself."""
    loss_in_burst_percent: float = Field(100.0, gt=0, le=100)
    """The share of packets that are lost in a bad period."""
    loss_between_percent: float = Field(0.0, ge=0, lt=100)
    """The share of packets that are lost in a good period."""
    reorder_percent: float = Field(0.0, ge=0, le=50)
    """The share of packets that are held back by `reorder_ms`, so that others pass them."""
    reorder_ms: float = Field(20.0, gt=0, le=1000)
    duplicate_percent: float = Field(0.0, ge=0, le=50)
    """The share of packets that arrive twice."""
    largest_bytes: int | None = Field(None, ge=68, le=65_535)
    """The largest IP packet: larger ones are dropped without an error, as behind a tunnel without ICMP."""
    rate_mbit: float | None = Field(None, gt=0, le=10_000)
    """Bits of IP packets per second; unset: as fast as the machine."""
    queue_ms: float = Field(100.0, gt=0, le=10_000)
    """How much waits before a link that is busy, as time at its rate. What comes to a full queue is lost."""

    @property
    def queue_bytes(self) -> int:
        """The queue of a link with a rate, bytes: at least one full packet."""
        if self.rate_mbit is None:
            return 0
        return round(max(self.queue_ms * self.rate_mbit * 1e3, PACKET_BITS) / 8)

    @property
    def share_in_bursts(self) -> float:
        """The share of packets that meet a bad period, so that `loss_percent` are lost."""
        low, high = self.loss_between_percent, self.loss_in_burst_percent
        return (self.loss_percent - low) / (high - low) if self.loss_percent else 0.0

    def contradictions(self, section: str) -> list[ConfigMistake]:
        """Between the keys of this way."""
        found = []
        if self.jitter_ms > self.delay_ms:
            found.append(("jitter_ms", self.jitter_ms, f"at most delay_ms, {self.delay_ms:g}"))
        if self.burst_packets is not None:
            low, high = self.loss_between_percent, self.loss_in_burst_percent
            if self.loss_percent and not low <= self.loss_percent < high:
                expected = f"from loss_between_percent, {low:g}, to below loss_in_burst_percent, {high:g}"
                found.append(("loss_percent", self.loss_percent, expected))
            elif self.burst_packets * (1.0 - self.share_in_bursts) < self.share_in_bursts:
                least = self.share_in_bursts / (1.0 - self.share_in_bursts)
                found.append(("burst_packets", self.burst_packets, f"{least:g} or more, to lose so much"))
        return [ConfigMistake(f"{section}.{key}", value, expected) for key, value, expected in found]


class Outage(Section):
    """A time in which nothing passes, either way."""

    at_s: float = Field(ge=0)
    """From when the profile is set."""
    for_s: float = Field(gt=0)


@dataclass(frozen=True, slots=True)
class Ways:
    """Both directions."""

    to_robot: Way
    to_operator: Way


class Profile(Section):
    """The whole file."""

    name: str = ""
    """The name; the file's name by default."""
    about: str = ""
    source: str = ""
    """Where the figures are from."""
    both: Way = Way()
    to_robot: Way = Way()
    """Only what differs from `both`, as the next: `ways` holds them whole."""
    to_operator: Way = Way()
    outages: list[Outage] = Field(default_factory=list)

    @property
    def ways(self) -> Ways:
        """Each direction with all its keys."""
        return Ways(_over(self.both, self.to_robot), _over(self.both, self.to_operator))

    def mistakes(self) -> list[ConfigMistake]:
        """Directions that contradict themselves, outages that overlap."""
        ways = self.ways
        found = ways.to_robot.contradictions("both")
        if found != ways.to_operator.contradictions("both"):  # else it is told once
            found = [
                *ways.to_robot.contradictions("to_robot"),
                *ways.to_operator.contradictions("to_operator"),
            ]
        over_s = 0.0
        for number, outage in enumerate(self.outages):
            if outage.at_s < over_s:
                expected = f"after the outage before it, at {over_s:g} s or later"
                found.append(ConfigMistake(f"outages.{number}.at_s", outage.at_s, expected))
            over_s = outage.at_s + outage.for_s
        return found


def _over(both: Way, one: Way) -> Way:
    return both.model_copy(update={key: getattr(one, key) for key in one.model_fields_set})


def profile_names() -> list[str]:
    """The names of the profiles that come with tandem, from the best network to the worst."""
    profiles = [(load_profile(path).ways.to_robot.delay_ms, path.stem) for path in PROFILES.glob("*.toml")]
    return [name for _, name in sorted(profiles)]


def load_profile(name_or_path: str | Path, overrides: Sequence[str] = ()) -> Profile:
    """A profile that comes with tandem, by its name, or any by its path, which ends in `.toml`.

    `overrides` such as `both.loss_percent=2.0` win over the file. Raises ConfigError.
    """
    path = Path(name_or_path)
    if path.suffix != ".toml":
        path = PROFILES / f"{name_or_path}.toml"
        if not path.is_file():
            known = ", ".join(profile_names())
            mistake = ConfigMistake(
                "profile", str(name_or_path), f"one of {known}, or a path to a .toml file"
            )
            raise ConfigError("network", [mistake])
    profile = load_config(path, Profile, overrides)
    return profile if profile.name else profile.model_copy(update={"name": path.stem})
