"""What a person may choose on the command line, checked before anything is started."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from common.errors import ConfigError, ConfigMistake
from common.link.endpoint import TRANSPORTS
from deploy.sim.network import load_profile, profile_names
from slave.track.config import STRATEGIES

ALL = "all"


def strategies() -> list[str]:
    """The tracking strategies of the slave."""
    return list(STRATEGIES)


KNOWN: dict[str, Callable[[], Sequence[str]]] = {
    "--transports": lambda: TRANSPORTS,
    "--profiles": profile_names,
    "--strategies": strategies,
}


def choose(option: str, text: str) -> tuple[str, ...]:
    """The names in a comma-separated text, each once; `all` is all there are. Raises ConfigError."""
    known = list(KNOWN[option]())
    names = list(dict.fromkeys(word.strip() for word in text.split(",") if word.strip()))
    if names == [ALL]:
        return tuple(known)
    if not names:
        raise ConfigError("trial", [ConfigMistake(option, text, f"{ALL}, or some of {', '.join(known)}")])
    for name in names:
        if option == "--profiles":
            load_profile(name)  # of a file of one's own too
        elif name not in known:
            raise ConfigError("trial", [ConfigMistake(option, name, f"some of {', '.join(known)}")])
    return tuple(names)


def why_impossible(transport: str) -> str | None:
    """Why this transport cannot be run between two hosts; None where it can."""
    if transport == "unixsock-stream":
        return (
            "a unix socket is a file on one machine: it does not cross hosts, and between namespaces it "
            "would pass the emulated link by"
        )
    return None
