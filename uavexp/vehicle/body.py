"""What every vehicle is: a box of some mass, and limits that may be asked of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from uavexp.errors import require
from uavexp.geometry import GRAVITY_MPS2
from uavexp.parameters import between
from uavexp.types import Limits


def require_flyable_drag(name: str, drag_kgpm: float, mass_kg: float, max_speed_mps: float) -> None:
    """Refuse a drag c |v| v that at full speed is more than the weight: nothing that hovers flies against it.

    Args:
        name: the parameter that it comes from.
        drag_kgpm: c, kg/m.
        mass_kg: of the vehicle.
        max_speed_mps: of the vehicle.

    Raises:
        ConfigError: says what is allowed.
    """
    most_kgpm = mass_kg * GRAVITY_MPS2 / max_speed_mps**2
    require(
        drag_kgpm <= most_kgpm,
        f"{name} is too large: a drag of {drag_kgpm:.4g} kg/m is more than the weight at max_speed_mps = "
        f"{max_speed_mps:g}; at most {most_kgpm:.3g} kg/m can be flown",
    )


@dataclass(slots=True, kw_only=True)
class Body:
    """Parameters that every vehicle has; no state."""

    mass_kg: Annotated[float, between(0.01, 100)] = 0.75  # kg; paper 4
    length_m: Annotated[float, between(0.01, 5)] = 0.32  # m, body box along x; paper 1
    width_m: Annotated[float, between(0.01, 5)] = 0.32  # m, body box along y; paper 1
    height_m: Annotated[float, between(0.01, 5)] = 0.12  # m, body box along z; paper 1
    max_speed_mps: Annotated[float, between(0.05, 50)] = 2.5  # m/s; paper 1
    max_acceleration_mps2: Annotated[float, between(0.05, 100)] = 2.5  # m/s^2 [ours]
    max_body_rate_radps: Annotated[float, between(0.05, 100)] = (
        2.0  # rad/s, of each axis; paper 1 (axes [ours])
    )

    @property
    def limits(self) -> Limits:
        """What may be asked of it."""
        return Limits(
            max_speed_mps=self.max_speed_mps,
            max_acceleration_mps2=self.max_acceleration_mps2,
            max_body_rate_radps=self.max_body_rate_radps,
            body_size_m=(self.length_m, self.width_m, self.height_m),
        )
