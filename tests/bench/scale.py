"""How time a frame and memory grow with the work: depth size, voxel size, length of the way, threads. scale.sh runs it.
Needs numpy and matplotlib. Writes docs/SCALE.md and its figure; each recording is simulated."""
import argparse
import csv
import os
import shutil
import sys

import numpy as np

import machine
from page import paragraph, sentence, table
from report import quantile
from systems import Failed, measure

SIZES = ("80x60", "160x120", "320x240", "640x480", "1280x720")
VOXELS = (0.04, 0.02, 0.01, 0.005)
WARM = 10  # frames that don't count
STRETCH_M = 1.0  # of the way, over which time is taken together
SPEED = 3  # times the usual pace
SHOWN_M = (1, 2, 3, 5, 10, 15, 20, 30, 40, 50, 60, 70, 80, 90, 100, 150, 200, 300, 500, 1000)  # stretches' ends

NOTES = """Time: median milliseconds of a step, and its 95th percentile. Surface: blocks in use at 2 KB and 16 bytes
each; the pool's bound is what the memory cap leaves for blocks. Resident: the most of the whole process, the OpenCL
runtime included.""".split("\n")

WAY_NOTES = """The camera walks at {pace:.1f} m/s, three times the usual pace, and turns as fast as that: the faster
it turns, the more a frame costs. At the bound `--when-full drop` lets the blocks seen longest ago make room (replay
keeps those in a file), `--when-full stop` takes no more surface: then the walk leaves the surface, is reckoned and
lost, and of the frames lost one in 30 is looked for. A line is the last metre before. Drift: of the position, in per
cent of the way, with the first pose laid on the truth.""".split("\n")


def log(text):
    print(f"scale: {text}", file=sys.stderr, flush=True)


def arguments():
    parser = argparse.ArgumentParser(prog="scale.sh BUILD", description=__doc__.splitlines()[0])
    parser.add_argument("--build", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--frames", type=int, default=150, help="of the room, a run (default 150)")
    parser.add_argument("--sizes", default=",".join(SIZES), help="of the depth frames")
    parser.add_argument("--voxels", default=",".join(map(str, VOXELS)), help="metres")
    parser.add_argument("--length", type=float, default=100, help="of the corridor, metres (default 100; at least 6)")
    parser.add_argument("--threads", default="1,2,4,8", help="as far as there are cores")
    parser.add_argument("--docs", default="docs", help="where SCALE.md goes (default docs)")
    options = parser.parse_args()
    if options.frames <= WARM:
        parser.error(f"--frames is more than {WARM}")
    return options


def poses(lines):
    """4x4 matrices of TUM lines."""
    x, y, z, w = (lines[:, 4:8] / np.linalg.norm(lines[:, 4:8], axis=1, keepdims=True)).T
    matrices = np.tile(np.eye(4), (len(lines), 1, 1))
    matrices[:, :3, :3] = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                                    [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                                    [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]]).transpose(2, 0, 1)
    matrices[:, :3, 3] = lines[:, 1:4]
    return matrices


def drifts(lines, truth):
    """The way truly walked to each frame, and how far off its position is, with the first pose laid on the truth."""
    nearest = np.abs(truth[:, 0][None, :] - lines[:, 0][:, None]).argmin(axis=1)
    found, true = poses(lines), poses(truth[nearest])
    found = true[0] @ np.linalg.inv(found[0]) @ found
    steps = np.linalg.norm(np.diff(true[:, :3, 3], axis=0), axis=1)
    return np.concatenate(([0], np.cumsum(steps))), np.linalg.norm(found[:, :3, 3] - true[:, :3, 3], axis=1)


class Runs:
    def __init__(self, options):
        self.build, self.frames = options.build, options.frames
        self.fathom = os.path.join(options.build, "fathom")
        self.work = os.path.join(options.build, "bench", "scale")
        self.cores = len(os.sched_getaffinity(0))
        shutil.rmtree(self.work, ignore_errors=True)
        os.makedirs(self.work)

    def simulate(self, scene, name, *extra):
        folder = os.path.join(self.work, name)
        if not os.path.exists(folder):
            log(f"simulating {name}")
            measure([self.fathom, "simulate", scene, folder, *extra], self.cores)
        return folder

    def replay(self, folder, *extra, threads=None):
        """Milliseconds, blocks and the way walked, frame by frame; what the run took."""
        threads = threads or self.cores
        stats, way = os.path.join(self.work, "stats.csv"), os.path.join(self.work, "way.txt")
        log(f"{os.path.basename(folder)} {' '.join(extra)}, {threads} threads")
        output, measured = measure([self.fathom, "replay", folder, "--stats", stats, "--trajectory", way, "--threads",
                                    str(threads), *extra], threads)
        with open(stats, encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        truth = np.loadtxt(os.path.join(folder, "groundtruth.txt"))
        walked, drift = drifts(np.loadtxt(way), truth)
        summary = dict(field.split("=", 1) for field in output.strip().splitlines()[-1].split())
        ms = [float(row["ms_total"]) for row in rows]
        return {"ms": ms, "blocks": [int(row["blocks"]) for row in rows], "walked": walked,
                "drift": drift, "states": [row["state"] for row in rows],
                "median": float(np.median(ms[WARM:])), "p95": quantile(ms[WARM:], 0.95),
                "tracked": int(summary["tracked"]), "frames": len(rows), "ate": float(summary["ate_rmse_m"]),
                "arena_mb": float(summary["arena_mb"]), "resident_mb": measured["resident_mb"]}


def surface_mb(blocks):
    return blocks * (2048 + 16) / 2 ** 20


def row_of(what, run):
    return [what, f"{run['median']:.1f}", f"{run['p95']:.1f}", f"{surface_mb(run['blocks'][-1]):.1f}",
            f"{run['arena_mb']:.0f}", f"{run['resident_mb']:.0f}", f"{1000 * run['ate']:.1f}",
            f"{run['tracked']} of {run['frames']}"]


def columns(first):
    return [first, "median", "95 %", "surface MB", "library MB", "resident MB", "ATE mm", "tracked"]


def by_size(runs, sizes):
    found = []
    for size in sizes:
        folder = runs.simulate("room", f"room-{size}", "--frames", str(runs.frames), "--still", "0", "--size", size)
        found.append((size, runs.replay(folder, "--voxel", "0.01")))
    return found


def by_voxel(runs, voxels):
    folder = runs.simulate("room", "room-640x480", "--frames", str(runs.frames), "--still", "0")
    return [(voxel, runs.replay(folder, "--voxel", str(voxel), "--memory", "512")) for voxel in voxels]


def by_threads(runs, threads):
    folder = runs.simulate("room", "room-640x480", "--frames", str(runs.frames), "--still", "0")
    return [(n, runs.replay(folder, "--voxel", "0.01", threads=n)) for n in threads if n <= runs.cores]


def stretches(run):
    """By metre of the way: its end, median and 95th percentile of the time, blocks, tracked of frames, drift at its end."""
    found = []
    for at in np.arange(0, run["walked"][-1], STRETCH_M):
        chosen = [i for i in range(WARM, run["frames"]) if at <= run["walked"][i] < at + STRETCH_M]
        if not chosen:
            continue
        ms = [run["ms"][i] for i in chosen]
        tracked = sum(run["states"][i] == "tracked" for i in chosen)
        found.append({"to": at + STRETCH_M, "median": float(np.median(ms)), "p95": quantile(ms, 0.95),
                      "blocks": run["blocks"][chosen[-1]], "tracked": tracked, "frames": len(chosen),
                      "drift": run["drift"][chosen[-1]]})
    return found


def by_length(runs, length):
    """One long walk, with either setting of what happens at the pool's bound."""
    folder = runs.simulate("corridor", "corridor", "--length", f"{length + 1:g}", "--size", "320x240", "--speed",
                           str(SPEED))
    return [(when, runs.replay(folder, "--voxel", "0.01", "--when-full", when)) for when in ("drop", "stop")]


def panel(axes, label, x, median, p95, memory, names=None):
    axes.plot(x, median, "o-", color="tab:blue", markersize=3, label="median")
    axes.plot(x, p95, ":", color="tab:blue", label="95th percentile")
    axes.set_xlabel(label)
    axes.set_ylabel("ms a frame", color="tab:blue")
    axes.set_ylim(0, 1.25 * max(p95))
    other = axes.twinx()
    other.plot(x, memory, "s-", color="tab:orange", markersize=3)
    other.set_ylabel("surface, MB", color="tab:orange")
    other.set_ylim(0, 1.25 * max(memory))
    if names:
        axes.set_xticks(x, names)
    axes.legend(fontsize=7, loc="upper left")


def way_panel(axes, walks):
    other = axes.twinx()
    for (when, run), dashes in zip(walks, ("-", ":")):
        parts = stretches(run)
        at = [part["to"] for part in parts]
        axes.plot(at, [part["median"] for part in parts], dashes, color="tab:blue", label=f"median, {when}")
        other.plot(at, [surface_mb(part["blocks"]) for part in parts], dashes, color="tab:orange")
    axes.set_xlabel("way walked, m")
    axes.set_ylabel("ms a frame", color="tab:blue")
    axes.set_ylim(bottom=0)
    other.set_ylabel("surface, MB", color="tab:orange")
    other.set_ylim(bottom=0)
    axes.legend(fontsize=7, loc="lower right")


def draw(path, sizes, voxels, walks, threads):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    figure, all_axes = pyplot.subplots(2, 2, figsize=(10, 7))

    def runs_panel(axes, label, found, name):
        panel(axes, label, range(len(found)), [run["median"] for _, run in found], [run["p95"] for _, run in found],
              [surface_mb(run["blocks"][-1]) for _, run in found], [name(what) for what, _ in found])

    runs_panel(all_axes[0][0], "depth frame", sizes, str)
    runs_panel(all_axes[0][1], "voxel, mm", voxels, lambda voxel: f"{1000 * voxel:g}")
    way_panel(all_axes[1][0], walks)
    runs_panel(all_axes[1][1], "threads", threads, str)
    figure.tight_layout()
    os.makedirs(os.path.dirname(path), exist_ok=True)
    figure.savefig(path, dpi=90)


def way_lines(options, walks):
    pace = walks[0][1]["walked"][-1] / walks[0][1]["frames"] * 30
    lines = [f"## Length of the way: simulated corridor of {options.length:g} m, 320x240, 1 cm", "",
             *paragraph([note.format(pace=pace) for note in WAY_NOTES])]
    for when, run in walks:
        rows = [[f"{part['to']:.0f}", f"{part['median']:.1f}", f"{part['p95']:.1f}", f"{surface_mb(part['blocks']):.1f}",
                 f"{part['tracked']} of {part['frames']}", f"{100 * part['drift'] / part['to']:.2f}"]
                for part in stretches(run) if round(part["to"]) in SHOWN_M]
        lines += table([f"metres, {when}", "median", "95 %", "surface MB", "tracked", "drift %"], rows)
    return lines + table(columns("the whole walk"), [row_of(when, run) for when, run in walks])


def write(options, described, sizes, voxels, walks, threads):
    lines = ["# Cost as the work grows", "", "Made by `make bench-scale` (tests/bench/scale.py); not written by hand.", "",
             *[sentence(line)[:-1] + "  " for line in machine.lines(described)], "", *paragraph(NOTES),
             "![Time and memory against depth size, voxel size, way and threads](results/scale.png)", "",
             f"## Depth size: simulated room, {options.frames} frames, 1 cm, alignment at most 320 wide", "",
             *table(columns("depth"), [row_of(size, run) for size, run in sizes]),
             "## Voxel size: the same at 640x480, up to 512 MB", "",
             *table(columns("voxel"), [row_of(f"{1000 * voxel:g} mm", run) for voxel, run in voxels]),
             "## Threads: the same at 1 cm", "", *table(columns("threads"), [row_of(str(n), run) for n, run in threads]),
             *way_lines(options, walks)]
    path = os.path.join(options.docs, "SCALE.md")
    with open(path + ".part", "w", encoding="utf-8") as file:
        file.write("\n".join(lines).rstrip("\n") + "\n")
    os.replace(path + ".part", path)
    print("\n".join(lines))


def main():
    options = arguments()
    described = machine.describe(options.build)
    runs = Runs(options)
    try:
        sizes = by_size(runs, options.sizes.split(","))
        voxels = by_voxel(runs, [float(voxel) for voxel in options.voxels.split(",")])
        threads = by_threads(runs, [int(n) for n in options.threads.split(",")])
        walks = by_length(runs, options.length)
    except Failed as failure:
        log(failure)
        return 1
    draw(os.path.join(options.docs, "results", "scale.png"), sizes, voxels, walks, threads)
    write(options, described, sizes, voxels, walks, threads)
    shutil.rmtree(runs.work, ignore_errors=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
