"""(d) Faster motion by leaving out frames: error and completeness over stride 1 to 32."""
from matplotlib.ticker import FixedLocator, NullLocator

import figures
import mesh
from page import complete, figure, millimetres, percent, recordings, table, tracked
from runs import WAYS, flat

LETTER, TITLE = "d", "Error and completeness by the distance between frames (Section 3.1)"
STRIDES = (1, 2, 4, 8, 12, 16, 24, 32)
GOOD_M = 0.05  # all frames tracked and an ATE within this: the stride is managed


def measure(runs):
    chosen = [("room", runs.simulate("room", "room"))]
    kitchen = runs.given("kitchen")
    if kitchen:
        chosen.insert(0, ("kitchen", kitchen))
    compared = {}
    for case, recording in chosen:
        reference = {}

        def look(files, reference=reference):
            return mesh.compare(mesh.read_ply(files["mesh"]), reference["mesh"])

        def look_first(files, reference=reference):
            reference["mesh"] = mesh.read_ply(files["mesh"])
            return look(files, reference)

        # the first run's mesh is what the others' are compared with
        first = runs.all([((case, "fathom, IMU", 1), lambda: runs.replay(recording, [], look=look_first))])
        jobs = [((case, way, stride), lambda r=recording, o=[*how, "--stride", str(stride)]: runs.replay(r, o, look=look))
                for stride in STRIDES for way, how in WAYS.items() if (way, stride) != ("fathom, IMU", 1)]
        compared.update({**first, **runs.all(jobs)})
    return {"cases": [case for case, _ in chosen], "made": [r.made_by for _, r in chosen], "runs": flat(compared)}


def by_name(results):
    return {tuple(run["name"]): run for run in results["runs"]}


def draw(results, folder):
    runs = by_name(results)
    for case in results["cases"]:
        plot, axes = figures.panels(3, 3.4, 10.5)
        for way in WAYS:
            line = [runs[case, way, stride] for stride in STRIDES]
            style = figures.line_style(way, markers=True)
            axes[0].plot(STRIDES, [1000 * run["ate_rmse_m"] for run in line], label=way, **style)
            axes[1].plot(STRIDES, [100 * run["tracked"] / run["frames"] for run in line], **style)
            axes[2].plot(STRIDES, [100 * run["look"]["covered"] for run in line], **style)
        axes[0].set(yscale="log", ylabel="trajectory error (ATE), mm")
        axes[1].set(ylabel="frames tracked, %", ylim=(-3, 103))
        axes[2].set(ylabel="surface that is there, %", ylim=(-3, 103))
        for axis in axes:
            axis.set(xlabel="stride: every Nth frame", xscale="log")
            axis.xaxis.set_major_locator(FixedLocator(STRIDES))
            axis.xaxis.set_minor_locator(NullLocator())
            axis.set_xticklabels([str(s) for s in STRIDES])
        figures.legend_below(plot, axes[0])
        plot.suptitle(f"{case}: error and completeness by stride (30 frames a second over N)")
        figures.save(plot, folder, f"stride-{case}")


def managed(runs, case, way):
    """The largest stride up to which all are managed; 0: none."""
    most = 0
    for stride in STRIDES:
        run = runs[case, way, stride]
        if not (complete(run) and run["ate_rmse_m"] <= GOOD_M):
            break
        most = stride
    return most


def claims(results):
    runs = by_name(results)
    rows = []
    for kind in ("paper", "fathom"):
        most = {(case, imu): managed(runs, case, f"{kind}, {imu}") for case in results["cases"] for imu in ("IMU", "no IMU")}
        further = [case for case in results["cases"] if most[case, "IMU"] > most[case, "no IMU"]]
        same = all(most[case, "IMU"] == most[case, "no IMU"] for case in results["cases"])
        word = ("holds" if len(further) == len(results["cases"]) else "holds in part" if further else
                "no difference here" if same else "does not hold")
        found = "; ".join(f"{case}: " + (f"up to stride {most[case, 'IMU']}" if most[case, "IMU"] else "no stride") + " with, " +
                          (f"{most[case, 'no IMU']}" if most[case, "no IMU"] else "none") + " without"
                          for case in results["cases"])
        rows.append((f"The IMU carries tracking over larger motion between frames (Section 3.1); {kind}'s way",
                     f"{word}: {found}"))
    return rows


def page(results, folder):
    draw(results, folder)
    runs = by_name(results)
    lines = [f"Stride N takes every Nth frame of a recording at 30 a second. Each cell: ATE over all frames; frames tracked where "
             f"not all were; the share of the surface that is there: how much of the mesh that fathom makes of every frame with "
             f"the IMU has a corner of this run's within 20 mm. The summary calls a stride managed when all frames are "
             f"tracked and the ATE is at most {1000 * GOOD_M:.0f} mm.", ""]
    lines += recordings(results["made"])
    for case in results["cases"]:
        rows = []
        for stride in STRIDES:
            row = [stride]
            for way in WAYS:
                run = runs[case, way, stride]
                missing = "" if complete(run) else f", {tracked(run)}"
                row.append(f"{millimetres(run['ate_rmse_m'])}{missing}, {percent(run['look']['covered'])}")
            rows.append(row)
        lines += table([f"{case}, stride", *WAYS], rows)
        lines += ["Commands, N being the stride:", ""]
        lines += [f"- {way}: `{' '.join(['fathom replay', case, *WAYS[way], '--stride N'])}`" for way in WAYS] + [""]
        lines += figure(f"stride-{case}", f"{case}: error and completeness by stride")
    return lines
