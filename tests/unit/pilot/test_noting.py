"""What is kept of a planning request, against an independent library."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import directed_hausdorff

from uavexp.pilot.noting import _path_change_m


@pytest.mark.parametrize("counts", [(1, 1), (1, 300), (256, 7), (257, 300), (1500, 40)])
def test_the_change_of_a_path_is_its_one_sided_hausdorff_distance(counts: tuple[int, int]) -> None:
    rng = np.random.default_rng(4)
    old_m, new_m = (rng.uniform(0.0, 5.0, (count, 3)) for count in counts)
    assert _path_change_m(old_m, new_m) == pytest.approx(directed_hausdorff(old_m, new_m)[0], abs=1e-12)
