"""BIT* of OMPL (Gammell, Srinivasa and Barfoot 2015), an independent peer of `df_bitstar`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from uavexp.planner.find.ompl_planner import OmplPlanner
from uavexp.planner.find.sampling import require_whole


@dataclass(slots=True, kw_only=True)
class Bitstar(OmplPlanner):
    """OMPL's BITstar on the project's free space, smoothed."""

    algorithm: ClassVar[str] = "BITstar"
    option: ClassVar[str] = "bitstar"

    batch_samples: int = 100

    def __post_init__(self) -> None:
        OmplPlanner.__post_init__(self)
        require_whole(batch_samples=self.batch_samples)

    def settings(self) -> dict[str, float]:
        """OMPL's setters and what they are given."""
        return {"setSamplesPerBatch": self.batch_samples, "setRewireFactor": self.rewire_factor}
