"""Fly one trial from Python; draw where it flew and how near it came."""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

import uavexp

trial = uavexp.fly(
    strategy="mcr", world="rooms", vehicle="point_mass", seed=100, **{"world.size_m": [12, 9, 3]}
)
print(trial)
print(
    f"flown {trial.metrics['path_length_m']:.1f} m, shortest {trial.world.difficulty.shortest_path_m:.1f} m"
)

steps, shortest = trial.log.steps, trial.world.shortest_path
figure, (plan, time) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
walls = trial.log.mapped_m[abs(trial.log.mapped_m[:, 2] - 1.2) < 0.3]
plan.plot(walls[:, 0], walls[:, 1], ".", color="0.7", ms=1, label="mapped at flight height")
plan.plot(shortest[:, 0], shortest[:, 1], "k--", lw=1, label="shortest")
plan.plot(steps.position_m[:, 0], steps.position_m[:, 1], label="flown")
for replan in trial.log.replans:
    plan.plot(*replan.position_m[:2], "r^", ms=4)
plan.set(xlabel="x [m]", ylabel="y [m]", aspect="equal", title="red: a plan was asked for")
plan.legend(fontsize=7)
time.plot(steps.time_s, steps.clearance_m)
time.set(xlabel="time [s]", ylabel="clearance [m]", ylim=(0, None))
figure.savefig("fly_and_plot.png", dpi=120)
print("fly_and_plot.png")
