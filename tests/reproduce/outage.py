"""(c) Figure 1: the lens is covered for a while and the camera comes back to what it knows."""
import os
import shutil

import matplotlib.image
import numpy as np

import figures
import mesh
from page import code, figure, millimetres, percent, recordings, table
from runs import WAYS

LETTER, TITLE = "c", "Outage and return (Section 3.2, Figure 1)"
SOON = 10        # frames after the outage within which a camera that has found back is tracked
TRUE_M = 0.04    # and its position is then off by at most this: the kitchen's reference is good to 25 mm
PICTURES = "outage-{}.npy"


def cases(runs):
    """name, recording, first frame of the outage, first after it."""
    room = runs.simulate("room", "room")
    start = room.frames() // 3
    end = min(start + 35, room.frames() // 2)
    yield f"room, {(end - start) / 30:.1f} s", room, start, end
    kitchen = runs.given("kitchen")
    if kitchen:
        yield "kitchen, 1.2 s", kitchen, 200, 235
        yield "kitchen, 2.3 s", kitchen, 200, 270


def take(files):
    """The mesh as arrays, and the picture, made smaller."""
    picture = matplotlib.image.imread(files["picture"])[:, :, :3]
    height, width = picture.shape[0] // 3 * 3, picture.shape[1] // 3 * 3
    small = picture[:height, :width].reshape(height // 3, 3, width // 3, 3, 3).mean((1, 3))
    return {"mesh": mesh.read_ply(files["mesh"]), "picture": small}


def measure(runs):
    chosen, jobs = list(cases(runs)), []
    for way, how in WAYS.items():
        whole = {}
        for _, recording, _, _ in chosen:
            whole[recording.name] = recording
        for recording in whole.values():
            jobs.append(((recording.name, way), lambda r=recording, o=how: runs.replay(
                r, o, look=lambda files: {"mesh": mesh.read_ply(files["mesh"])})))
        for case, recording, start, end in chosen:
            jobs.append(((case, way), lambda r=recording, o=[*how, "--outage", f"{start}:{end}"]:
                         runs.replay(r, o, ["state", "error"], take, ("mesh", "picture"))))
    done = runs.all(jobs)
    pictures = os.path.join(os.path.dirname(runs.work), "pictures")
    shutil.rmtree(pictures, ignore_errors=True)
    os.makedirs(pictures)
    looks = {name: run.pop("look") for name, run in done.items()}
    compared = []
    for case, recording, start, end in chosen:
        for way in WAYS:
            run, whole = done[case, way], done[recording.name, way]
            compared.append({"case": case, "way": way, "start": start, "end": end, "whole_ate": whole["ate_rmse_m"],
                             "whole_command": whole["command"],
                             "mesh": mesh.compare(looks[case, way]["mesh"], looks[recording.name, way]["mesh"]), **run})
            place = f"{chosen.index((case, recording, start, end))}-{list(WAYS).index(way)}"
            np.save(os.path.join(pictures, PICTURES.format(place)), (255 * looks[case, way]["picture"]).astype(np.uint8))
    return {"made": sorted({r.made_by for _, r, _, _ in chosen if r.made_by}), "cases": [c for c, _, _, _ in chosen],
            "pictures": pictures, "runs": compared}


def found_after(run):
    """Frames from the outage's end to the first that is tracked; None when none is."""
    for i, state in enumerate(run["series"]["state"][run["end"]:]):
        if state == "tracked":
            return i
    return None


def came_back(run):
    """Tracked soon after, and in the right place for the rest: the median error is small."""
    after = found_after(run)
    rest = run["series"]["error"][run["end"] + SOON:]
    return after is not None and after < SOON and bool(rest) and float(np.median(rest)) <= TRUE_M


def draw_errors(results, folder):
    plot, axes = figures.panels(len(results["cases"]), 3.5, 10.5, sharey=True)
    most = 1000 * max(max(run["series"]["error"]) for run in results["runs"])
    for axis, case in zip(axes, results["cases"]):
        for run in (run for run in results["runs"] if run["case"] == case):
            if run["way"] == "paper, IMU":
                axis.axvspan(run["start"], run["end"], color="0.85", label="lens covered")
            axis.plot([1000 * e for e in run["series"]["error"]], label=run["way"], **figures.line_style(run["way"]))
        axis.set(title=case, xlabel="frame", yscale="log", ylim=(0.5, 2 * most))
    axes[0].set_ylabel("position error, mm")
    figures.legend_below(plot, axes[0], columns=5)
    plot.suptitle("Error of the position around an outage, from a true start")
    figures.save(plot, folder, "outage-error")


def draw_pictures(results, folder):
    case = len(results["cases"]) - 1
    plot, axes = figures.panels(len(WAYS), 2.5, 10.5)
    for axis, (place, way) in zip(axes, enumerate(WAYS)):
        axis.imshow(np.load(os.path.join(results["pictures"], PICTURES.format(f"{case}-{place}"))))
        axis.set(title=way, xticks=[], yticks=[])
        axis.grid(False)
        axis.spines[:].set_visible(False)
    plot.suptitle(f"{results['cases'][case]}: the surface and the camera's way (blue tracked, orange reckoned, red lost)")
    figures.save(plot, folder, "outage-mesh")


def claims(results):
    rows = []
    for kind in ("paper", "fathom"):
        counts = {}
        for imu in ("IMU", "no IMU"):
            counts[imu] = [run["case"] for run in results["runs"] if run["way"] == f"{kind}, {imu}" and came_back(run)]
        total = len(results["cases"])
        word = "holds" if len(counts["IMU"]) == total else "holds in part" if counts["IMU"] else "does not hold"
        rows.append((f"Dead reckoning brings tracking back after an outage (Section 3.2, Figure 1); {kind}'s way",
                     f"{word}: back in place after {len(counts['IMU'])} of {total} outages with the IMU, "
                     f"{len(counts['no IMU'])} without"))
    return rows


def page(results, folder):
    draw_errors(results, folder)
    draw_pictures(results, folder)
    lines = [f"Frames arrive blank, as if the lens were covered, while the camera goes on moving. *Back* is how many frames after "
             f"the outage the first one is tracked; *in place*: tracked within {SOON} frames, and the median position error of the "
             f"rest is at most {1000 * TRUE_M:.0f} mm. The last columns compare the mesh with the same way's mesh without an outage: the "
             f"median distance of its corners from that surface, how many of them have none within "
             f"{1000 * mesh.REACH_M:.0f} mm, and how much of that surface is there (within 20 mm).", ""]
    lines += recordings(results["made"])
    rows = []
    for run in results["runs"]:
        after = found_after(run)
        rows.append((run["case"], run["way"], "never" if after is None else f"{after + 1}",
                     "yes" if came_back(run) else "no", millimetres(run["series"]["error"][run["end"] - 1]),
                     millimetres(run["ate_rmse_m"]), millimetres(run["whole_ate"]), millimetres(run["mesh"]["median_m"]),
                     percent(run["mesh"]["astray"]), percent(run["mesh"]["covered"]), code(run["command"])))
    lines += table(("outage", "way", "back, frames", "in place", "strayed at its end", "ATE", "ATE without outage", "mesh, median",
                    "astray", "there", "command"), rows)
    lines += ["*ATE without outage* and the mesh compared with come from the same command without `--outage`.", ""]
    lines += figure("outage-error", "Position error over the recordings, the outage shaded")
    lines += figure("outage-mesh", "The surfaces after the longest outage")
    return lines
