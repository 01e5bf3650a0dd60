"""(b) Figure 5: thirty-five frames of bare wall, three iterations with the IMU against twenty without."""
import numpy as np

import evaluate
import figures
from page import code, figure, millimetres, recordings, table, tracked
from runs import WAYS, flat

LETTER, TITLE = "b", "Across a bare wall (Section 4.3, Figure 5)"
BUDGET = {"IMU": 3, "no IMU": 20}
SEEDS = (1, 2, 3)
# The scene's bare stretch and the camera (examples/simulate/scene.h, simulate.c).
BARE_X, WALL_Y, FLOOR_Z, CEILING_Z = 1.2, 1.2, 0.0, 2.6
HALF_VIEW = (320.0 / 585, 240.0 / 585)


def bare_frames(recording):
    """Frames whose four corners all look at the bare stretch."""
    truth = recording.truth()
    x, y = HALF_VIEW
    rays = np.array([(i * x, j * y, 1) for i in (-1, 1) for j in (-1, 1)])
    depth_stamps = [float(line.split()[0]) for line in open(recording.folder + "/depth.txt") if line[0] not in "#\n"]
    bare = []
    for i, stamp in enumerate(depth_stamps):
        line = truth[np.argmin(np.abs(truth[:, 0] - stamp))]
        directions = rays @ evaluate.rotations(line[None, 4:])[0].T
        if (directions[:, 1] <= 1e-3).any():
            continue
        hits = line[1:4] + directions * ((WALL_Y - line[2]) / directions[:, 1])[:, None]
        if (np.abs(hits[:, 0]) < BARE_X).all() and (hits[:, 2] > FLOOR_Z).all() and (hits[:, 2] < CEILING_Z).all():
            bare.append(i)
    return bare


def measure(runs):
    cases, bare, jobs = [], {}, []
    for seed in SEEDS[:1] if runs.tiny else SEEDS:
        name = f"wall-35-{seed}"
        recording = runs.simulate(name, "wall", "--speed", "2", *([] if runs.tiny else ["--frames", "120"]), seed=seed)
        cases.append((f"simulated wall {seed}", recording, []))
        bare[cases[-1][0]] = bare_frames(recording)
    kitchen = runs.given("kitchen")
    if kitchen:
        cases.append(("kitchen with a wall", kitchen, ["--wall", "200:235"]))
        bare[cases[-1][0]] = list(range(200, 235))
    for case, recording, options in cases:
        for way, how in WAYS.items():
            budget = BUDGET[way.split(", ")[1]]
            jobs.append(((case, way), lambda r=recording, o=[*options, *how, "--iterations", f"0,0,{budget}"]:
                         runs.replay(r, o, ["state", "error", "t"])))
    return {"cases": [case for case, _, _ in cases], "made": [r.made_by for _, r, _ in cases], "bare": bare,
            "runs": flat(runs.all(jobs))}


def by_name(results):
    return {tuple(run["name"]): run for run in results["runs"]}


def strayed(run, bare):
    """What the position has strayed from just before the bare stretch to its end and to the recording's end, metres."""
    error = run["series"]["error"]
    if not bare:
        return float("nan"), error[-1]
    return error[min(bare[-1] + 1, len(error) - 1)], error[-1]


def draw(results, folder):
    runs = by_name(results)
    shown = [results["cases"][0]] + [case for case in results["cases"] if case.startswith("kitchen")]
    plot, axes = figures.panels(len(shown), 3.6, 9.6)
    for axis, case in zip(axes, shown):
        bare = results["bare"][case]
        most = 1000 * max(max(runs[case, way]["series"]["error"]) for way in WAYS)
        if bare:
            axis.axvspan(bare[0], bare[-1] + 1, color="0.85", label="bare wall only")
        for way in WAYS:
            error = [1000 * e for e in runs[case, way]["series"]["error"]]
            axis.plot(error, label=f"{way}, {BUDGET[way.split(', ')[1]]} iterations", **figures.line_style(way))
        axis.set(title=f"{case}: {len(bare)} bare frames", xlabel="frame", ylabel="position error, mm",
                 yscale="log", ylim=(0.5, 2 * most))
    figures.legend_below(plot, axes[0], columns=3, rows=2)
    plot.suptitle("Error of the position over the recording, from a true start")
    figures.save(plot, folder, "bare-wall")


def claims(results):
    runs = by_name(results)
    rows = []
    for kind in ("paper", "fathom"):
        better = [c for c in results["cases"]
                  if runs[c, f"{kind}, IMU"]["ate_rmse_m"] < runs[c, f"{kind}, no IMU"]["ate_rmse_m"]]
        word = "holds" if len(better) == len(results["cases"]) else "holds in part" if better else "does not hold"
        rows.append((f"3 iterations with the IMU cross a bare wall better than 20 without (Figure 5); {kind}'s way",
                     f"{word}: {len(better)} of {len(results['cases'])} recordings have the smaller ATE with the IMU"))
    return rows


def page(results, folder):
    draw(results, folder)
    runs = by_name(results)
    counts = [len(results["bare"][case]) for case in results["cases"] if case.startswith("simulated")]
    lines = [f"The simulated camera passes a bare wall faster than usual; {min(counts)} to {max(counts)} frames see nothing "
             f"else. In the kitchen 35 real frames are replaced by a rendered wall that stands across the view. Three "
             f"iterations a frame with the IMU, twenty without. *Strayed* is how far the position is off just after the bare "
             f"stretch, and at the recording's end, with the first poses laid on each other.", ""]
    lines += recordings(results["made"])
    rows = []
    for case in results["cases"]:
        bare = results["bare"][case]
        for way in WAYS:
            run = runs[case, way]
            after, last = strayed(run, bare)
            inside = run["series"]["state"][bare[0]:bare[-1] + 1] if bare else []
            rows.append((case, len(bare), way, millimetres(run["ate_rmse_m"]), millimetres(after), millimetres(last),
                         tracked(run), sum(state in ("reckoned", "lost") for state in inside), code(run["command"])))
    lines += table(("recording", "bare frames", "way", "ATE", "strayed after the wall", "at the end", "tracked",
                    "bare frames dead-reckoned", "command"), rows)
    lines += figure("bare-wall", "Position error across the bare wall")
    return lines
