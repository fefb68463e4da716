"""BIT* of OMPL (Gammell, Srinivasa and Barfoot 2015), an independent peer of `tree`."""

from __future__ import annotations

from typing import ClassVar

from uavexp.parameters import Count, option
from uavexp.planner.find.ompl import Ompl


@option
class OmplBitstar(Ompl):
    """OMPL's BITstar on the project's free space."""

    algorithm: ClassVar[str] = "BITstar"

    batch_samples: Count = 100  # samples of a batch (paper 4)

    def settings(self) -> dict[str, float]:
        """OMPL's setters and what they are given."""
        return {"setSamplesPerBatch": self.batch_samples, "setRewireFactor": self.rewire_factor}
