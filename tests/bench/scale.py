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

NOTES = """Time: median milliseconds of a step, and its 95th percentile. Surface: blocks in use at 2 KB and 16 bytes
each; the pool's bound is what the memory cap leaves for blocks. Resident: the most of the whole process, the OpenCL
runtime included.""".split("\n")


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
        places = np.loadtxt(way)[:, 1:4]
        walked = np.concatenate(([0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))))
        summary = dict(field.split("=", 1) for field in output.strip().splitlines()[-1].split())
        ms = [float(row["ms_total"]) for row in rows]
        return {"ms": ms, "blocks": [int(row["blocks"]) for row in rows], "walked": walked,
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


def by_length(runs, length):
    """One long walk, cut into stretches."""
    folder = runs.simulate("corridor", "corridor", "--length", f"{length:g}", "--size", "320x240", "--speed", "3")
    run = runs.replay(folder, "--voxel", "0.01")
    stretches = []
    for at in np.arange(0, run["walked"][-1], STRETCH_M):
        chosen = [i for i in range(WARM, run["frames"]) if at <= run["walked"][i] < at + STRETCH_M]
        if chosen:
            ms = [run["ms"][i] for i in chosen]
            stretches.append((at + STRETCH_M, float(np.median(ms)), quantile(ms, 0.95), run["blocks"][chosen[-1]]))
    return run, stretches


def panel(axes, label, x, median, p95, memory, names=None):
    axes.plot(x, median, "o-", color="tab:blue", markersize=3, label="median")
    axes.plot(x, p95, ":", color="tab:blue", label="95th percentile")
    axes.set_xlabel(label)
    axes.set_ylabel("ms a frame", color="tab:blue")
    axes.set_ylim(bottom=0)
    other = axes.twinx()
    other.plot(x, memory, "s-", color="tab:orange", markersize=3)
    other.set_ylabel("surface, MB", color="tab:orange")
    other.set_ylim(bottom=0)
    if names:
        axes.set_xticks(x, names)
    axes.legend(fontsize=7, loc="upper left")


def draw(path, sizes, voxels, stretches, threads):
    import matplotlib
    matplotlib.use("Agg")
    from matplotlib import pyplot
    figure, all_axes = pyplot.subplots(2, 2, figsize=(10, 7))

    def runs_panel(axes, label, found, name):
        panel(axes, label, range(len(found)), [run["median"] for _, run in found], [run["p95"] for _, run in found],
              [surface_mb(run["blocks"][-1]) for _, run in found], [name(what) for what, _ in found])

    runs_panel(all_axes[0][0], "depth frame", sizes, str)
    runs_panel(all_axes[0][1], "voxel, mm", voxels, lambda voxel: f"{1000 * voxel:g}")
    at, median, p95, blocks = zip(*stretches)
    panel(all_axes[1][0], "way walked, m", at, median, p95, [surface_mb(count) for count in blocks])
    runs_panel(all_axes[1][1], "threads", threads, str)
    figure.tight_layout()
    os.makedirs(os.path.dirname(path), exist_ok=True)
    figure.savefig(path, dpi=90)


def write(options, described, sizes, voxels, walk, stretches, threads):
    lines = ["# Cost as the work grows", "", "Made by `make bench-scale` (tests/bench/scale.py); not written by hand.", "",
             *[sentence(line)[:-1] + "  " for line in machine.lines(described)], "", *paragraph(NOTES),
             "![Time and memory against depth size, voxel size, way and threads](results/scale.png)", "",
             f"## Depth size: simulated room, {options.frames} frames, 1 cm, alignment at most 320 wide", "",
             *table(columns("depth"), [row_of(size, run) for size, run in sizes]),
             "## Voxel size: the same at 640x480, up to 512 MB", "",
             *table(columns("voxel"), [row_of(f"{1000 * voxel:g} mm", run) for voxel, run in voxels]),
             "## Threads: the same at 1 cm", "", *table(columns("threads"), [row_of(str(n), run) for n, run in threads]),
             f"## Length of the way: simulated corridor of {options.length:g} m, 320x240, 1 cm", ""]
    few = [stretches[i] for i in np.unique(np.geomspace(1, len(stretches), min(12, len(stretches))).astype(int) - 1)]
    lines += table(["metres", "median", "95 %", "surface MB"],
                   [[f"{at:.0f}", f"{median:.1f}", f"{p95:.1f}", f"{surface_mb(blocks):.1f}"]
                    for at, median, p95, blocks in few])
    lines += table(columns("the whole walk"), [row_of(f"{walk['walked'][-1]:.0f} m", walk)])
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
        walk, stretches = by_length(runs, options.length)
    except Failed as failure:
        log(failure)
        return 1
    draw(os.path.join(options.docs, "results", "scale.png"), sizes, voxels, stretches, threads)
    write(options, described, sizes, voxels, walk, stretches, threads)
    shutil.rmtree(runs.work, ignore_errors=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
