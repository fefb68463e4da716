"""Two policies in the same worlds, compared as the reports do: pair by pair, with intervals."""

import uavexp
from uavexp.__main__ import main

OUT = "compare_policies"

if __name__ == "__main__":  # flights run in processes of their own
    main(
        ["strategy=mcr,tbr", "world=random_columns", "world.size_m=[9,6,3]", "vehicle=point_mass",
         "seed=100:103", f"out={OUT}"]
    )  # fmt: skip
    study = uavexp.read_study(OUT)
    print(study)
    print(study.trials.groupby("cell")[["success", "replans", "path_length_m"]].mean())
    for metric in ("replans", "min_clearance_m", "path_length_m"):
        print(study.compare("mcr", "tbr", metric))
    print("three worlds are an example, no result: p cannot fall below 0.25")
