"""Everything that a soak recorded, in the form that its criteria read. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from common.wire.messages import Mask
from deploy.experiments.soak.files.events import AnyEvent, of_kind
from deploy.experiments.soak.files.happenings import FaultRecovered, NetworkNature, SoakBegun
from deploy.experiments.soak.files.samples import Samples
from deploy.experiments.soak.judge.explain import Explained, explanation
from deploy.experiments.soak.judge.windows import explained as in_windows
from deploy.measure.verdict import Verdict, unproven

LEAST_SHARE = 0.2
"""A soak with less than this share free of faults and stalls proves too little to pass."""


@dataclass(frozen=True, slots=True)
class SoakEvidence:
    """Events, samples, and what explains them."""

    events: Sequence[AnyEvent]
    samples: Samples
    explained: Explained

    @classmethod
    def of(cls, events: Sequence[AnyEvent], samples: Samples) -> SoakEvidence:
        """The evidence of a soak's two files."""
        return cls(events, samples, explanation(events, samples))

    @property
    def quiet(self) -> Mask:
        """(N,) samples outside of every fault, start, stall of the host and loss of the network."""
        return ~in_windows(self.samples.at_s, self.explained.all)

    @property
    def network_alone(self) -> Mask:
        """(N,) samples that the network explains, and neither fault, start nor stall."""
        at_s, found = self.samples.at_s, self.explained
        return in_windows(at_s, found.network) & ~in_windows(at_s, (*found.faults, *found.stalls))

    def sum(self, column: str, of: Mask | None = None) -> float:
        """A counter's additions over all samples, or some."""
        values = self.samples[column]
        return float(np.nansum(values if of is None else values[of]))

    def known_sum(self, column: str, of: Mask | None = None) -> float | None:
        """The same; None where no sample holds the counter: an unknown count is not zero."""
        return None if np.isnan(self.samples[column]).all() else self.sum(column, of)

    @property
    def recovered(self) -> list[FaultRecovered]:
        """The course of each fault that is over."""
        return [e.what for e in of_kind(self.events, FaultRecovered) if e.what.fault]

    @property
    def begun(self) -> SoakBegun:
        """What the soak was asked for; the defaults where it did not begin."""
        begun = of_kind(self.events, SoakBegun)
        return begun[0].what if begun else SoakBegun()

    @property
    def network(self) -> NetworkNature:
        """What the network between two hosts does by its nature."""
        return self.begun.network or NetworkNature()


def of_enough(verdict: Verdict, share: float) -> Verdict:
    """The verdict; not judged instead of passed where less than LEAST_SHARE could have failed."""
    if share >= LEAST_SHARE:
        return verdict
    why = f"only {100.0 * share:.0f} % of the run was free of faults and stalls"
    return unproven(verdict, why, verdict.measured)
