"""A study on the workers of a Dask cluster: two of its own; `runner.address=` names those of a scheduler."""

import uavexp
from uavexp.__main__ import main

OUT = "study_on_dask"

if __name__ == "__main__":  # workers import this file
    main(
        [
            "strategy=mcr,tbr",
            "world=random_columns",
            "world.size_m=[9,6,3]",
            "vehicle=point_mass",
            "seed=100:102",
            "runner=dask",
            "runner.n_jobs=2",
            f"out={OUT}",
        ]
    )
    study = uavexp.read_study(OUT)
    print(study.trials[["cell", "seed", "outcome", "path_length_m", "replans"]].to_string())
