"""(f) The mesh against the truth, on simulated scenes whose surface is known in closed form."""
import numpy as np

import evaluate
import figures
import mesh
from page import code, figure, millimetres, percent, recordings, table, tracked
from runs import WAYS, flat

LETTER, TITLE = "f", "The mesh against the true surface"
SCENES = {"room": [], "wall": [], "desk": [], "corridor": ["--length", "8"]}
CORRIDOR_M = "8"
FAR_M = 0.02       # a corner further from the true surface than this is wrong
SAME = 0.005       # shares of wrong corners that differ by less are the same
BINS_MM = [0, 0.25, 0.5, 0.75, 1, 1.5, 2, 3, 4, 6, 8, 12, 16, 24, 32, 64, 1e9]


def against_truth(runs, recording, files):
    """Distances of the mesh's corners from the true surface, through the first frame's true pose."""
    vertices, _ = mesh.read_ply(files["mesh"])
    first = recording.truth()[0]
    points = vertices @ evaluate.rotations(first[None, 4:])[0].T + first[1:4]
    raw = runs.process([runs.tool("scene_distance"), recording.scene, str(recording.seed), CORRIDOR_M],
                       np.ascontiguousarray(points).tobytes())
    distances = np.abs(np.frombuffer(raw))
    if not len(distances):
        return {"corners": 0}
    shares = np.histogram(1000 * distances, BINS_MM)[0].cumsum() / len(distances)
    return {"corners": len(distances), "median_m": float(np.median(distances)), "p95_m": float(np.quantile(distances, 0.95)),
            "wrong": float((distances > FAR_M).mean()), "shares": [float(s) for s in shares]}


def measure(runs):
    jobs, made = [], []
    for scene, options in SCENES.items():
        noisy = runs.simulate(scene, scene, *options)
        clean = runs.simulate(f"{scene}-clean", scene, *options, "--clean")
        made += [noisy.made_by, clean.made_by]
        runs_of = [("without noise", "fathom, IMU", clean)] + [("a Kinect's noise", way, noisy) for way in WAYS]
        for noise, way, recording in runs_of:
            jobs.append(((scene, noise, way), lambda r=recording, o=WAYS[way]: runs.replay(
                r, o, look=lambda files: against_truth(runs, r, files))))
    return {"made": made, "runs": flat(runs.all(jobs))}


def by_name(results):
    return {tuple(run["name"]): run for run in results["runs"]}


def draw(results, folder):
    runs = by_name(results)
    plot, axes = figures.panels(len(SCENES), 3.3, 10.5, sharey=True)
    for axis, scene in zip(axes, SCENES):
        for (name, noise, way), run in runs.items():
            if name != scene or not run["look"]["corners"]:
                continue
            style = figures.line_style(way)
            if noise == "without noise":
                style.update(color="black", linestyle=":")
            axis.plot(BINS_MM[1:-1], [100 * s for s in run["look"]["shares"][:-1]],
                      label=f"{way}, {noise}" if noise == "without noise" else way, **style)
        axis.set(title=scene, xlabel="distance from the true surface, mm", xscale="log", ylim=(0, 101))
        axis.set_xticks([0.25, 1, 4, 16, 64], ["0.25", "1", "4", "16", "64"])
        axis.minorticks_off()
    axes[0].set_ylabel("corners of the mesh\nwithin that distance, %")
    figures.legend_below(plot, axes[-1], columns=5)
    plot.suptitle("Corners of the mesh by their distance from the true surface, cumulative")
    figures.save(plot, folder, "mesh-error")


def claims(results):
    runs = by_name(results)
    rows = []
    for kind in ("paper", "fathom"):
        wrong = {(s, imu): runs[s, "a Kinect's noise", f"{kind}, {imu}"]["look"].get("wrong", 1)
                 for s in SCENES for imu in ("IMU", "no IMU")}
        better = [s for s in SCENES if wrong[s, "IMU"] <= wrong[s, "no IMU"] + SAME]
        word = "holds" if len(better) == len(SCENES) else "holds in part" if better else "does not hold"
        rows.append((f"The IMU makes the reconstruction no worse anywhere; {kind}'s way",
                     f"{word}: on {len(better)} of {len(SCENES)} simulated scenes no more of the mesh is wrong with it "
                     f"(shares that differ by less than {percent(SAME)} count as the same)"))
    return rows


def page(results, folder):
    draw(results, folder)
    lines = [f"The scenes are unions of solids whose signed distance is known exactly, so each corner of a mesh has a true error "
             f"(tests/reproduce/scene_distance.c). The mesh is put into the scene by the first frame's true pose, so that drift of "
             f"the camera counts. *Wrong* is the share of corners more than {1000 * FAR_M:.0f} mm off. 1 cm voxels.", ""]
    lines += recordings(results["made"])
    rows = []
    for run in results["runs"]:
        scene, noise, way = run["name"]
        look = run["look"]
        rows.append((scene, noise, way, *([millimetres(look["median_m"]), millimetres(look["p95_m"]), percent(look["wrong"])]
                                          if look["corners"] else ["-"] * 3),
                     millimetres(run["ate_rmse_m"]), tracked(run), code(run["command"])))
    lines += table(("scene", "depth", "way", "median", "95 % within", "wrong", "ATE", "tracked", "command"), rows)
    lines += figure("mesh-error", "Corners of the mesh by their distance from the true surface")
    return lines
