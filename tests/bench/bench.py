"""Times fathom beside other systems on the same frames, and its kernels beside the machine's limit; bench.sh sets up what
it needs. Needs Python alone.

All systems take turns (A B C, A B C, ...), once round all cases is a pair; ratios are taken within a pair, so that what
slows the machine for a while slows both. A short round goes before: it builds kernels and caches, and tells how many
frames fit in the time.
"""
import argparse
import json
import os
import sys
import time

import frames
import limit
import machine
import page
import report
from systems import (Case, Failed, Fathom, FathomAlignment, FathomFusion, Open3D, Open3DFusion, OpenCV, tool)

PROBE_FRAMES = 20
LEAST_FRAMES = 30
MARGIN = 1.25  # later frames take longer than the probe's: the surface grows


def log(text):
    print(f"bench: {text}", file=sys.stderr, flush=True)


def arguments():
    parser = argparse.ArgumentParser(prog="bench.sh BUILD", description=__doc__.splitlines()[0])
    parser.add_argument("--build", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--open3d", default="", help=argparse.SUPPRESS)  # the Python that has it
    parser.add_argument("--pairs", type=int, default=5, help="rounds of all systems (default 5)")
    parser.add_argument("--quick", action="store_true", help="one pair, about four minutes")
    parser.add_argument("--minutes", type=float, default=15, help="most time for all; frames are counted to fit it")
    parser.add_argument("--frames", type=int, default=0, help=f"frames a run instead, {frames.MOST} at most")
    parser.add_argument("--sizes", default="320x240,640x480", help="alignment resolutions")
    parser.add_argument("--threads", default="1,2", help="numbers of threads")
    parser.add_argument("--folder", default="", help="a recording folder (default the kitchen, else a simulated room)")
    parser.add_argument("--systems", default="", help="only those whose names hold one of these words, e.g. Open3D,given")
    parser.add_argument("--results", nargs="?", const="docs/SPEED.md", default="",
                        help="writes the tables into a page (default docs/SPEED.md)")
    parser.add_argument("--json", default="out/bench.json", help="where all figures go (default out/bench.json)")
    options = parser.parse_args()
    if options.quick:
        options.pairs, options.minutes = 1, min(options.minutes, 4)
    if options.pairs < 1 or options.frames < 0 or 0 < options.frames <= report.WARM:
        parser.error(f"--pairs is at least 1, --frames more than {report.WARM}")
    return options


def cases_of(options):
    cores = len(os.sched_getaffinity(0))
    threads = [int(n) for n in options.threads.split(",")]
    for n in threads:
        if n > cores:
            log(f"{n} threads left out: there are {cores} cores")
    return [Case(size, n) for size in options.sizes.split(",") for n in threads if n <= cores]


def systems_of(options, folder):
    """Those that may be had here, what is compared with before the others."""
    build = options.build
    systems = [Open3D(build, options.open3d)] if options.open3d else []
    systems += [Fathom(build, True), Fathom(build, False), Fathom(build, True, whole=folder)]
    systems += [Open3DFusion(build, options.open3d)] if options.open3d else []
    systems += [FathomFusion(build)]
    systems += [OpenCV(build)] if os.path.exists(tool(build, "odometry")) else []
    systems += [FathomAlignment(build)]
    words = [word for word in options.systems.split(",") if word]
    return [system for system in systems if not words or any(word in system.name for word in words)]


def probe(systems, cases, folder, build):
    """A short run of each system at each size with most threads, which counts its calls of the heap. Gives the systems
    that work, for each case and system the seconds that a run takes whatever its length, and a frame, and the calls."""
    short = frames.first(folder, min(PROBE_FRAMES, frames.available(folder)), build)
    working, fixed, each, heap = [], 0.0, 0.0, {}
    most = max(case.threads for case in cases)
    for system in systems:
        try:
            for size in dict.fromkeys(case.size for case in cases):
                log(f"warming up: {system.name}, {size}")
                run = system.run(Case(size, most), short, PROBE_FRAMES, heap=True)
                heap[system.name, size] = run["heap"]
                a_frame = report.middle(run["ms"]["total"][PROBE_FRAMES // 2:]) or 0
                for case in cases:
                    if case.size == size:
                        a_case = a_frame / 1e3 * most / case.threads
                        whole = getattr(system, "whole", None)
                        fixed += max(0.0, run["wall_s"] - sum(run["ms"]["total"]) / 1e3)
                        fixed += a_case * MARGIN * frames.count(folder) if whole else 0
                        each += 0 if whole else a_case
            working.append(system)
        except Failed as failure:
            log(f"{system.name} left out: {failure}")
    return working, fixed, each, heap


def frames_that_fit(options, left_s, fixed, each, most):
    if options.frames:
        return min(options.frames, most)
    fit = int((left_s / options.pairs - fixed) / (each * MARGIN)) if each else most
    if fit < LEAST_FRAMES:
        log(f"only {max(fit, 0)} frames fit into {options.minutes:g} minutes: taking {LEAST_FRAMES}, "
            "and as many pairs as there is time for")
    return max(min(LEAST_FRAMES, most), min(fit, most))


def run_pair(pair, systems, cases, folder, count, runs):
    for case in cases:
        for system in systems:
            log(f"pair {pair}: {case.size}, {case.threads} threads, {system.name}")
            try:
                run = report.figures(system.run(case, folder, count))
            except Failed as failure:
                log(f"{system.name}: {failure}")
                continue
            runs.append({"pair": pair, "case": case, "system": system.name, **run})


def run_pairs(options, start, systems, cases, folder, count):
    """All runs. Stops after a pair when another would take too long, unless the number of frames was given; says so."""
    runs = []
    for pair in range(1, options.pairs + 1):
        before = time.monotonic()
        run_pair(pair, systems, cases, folder, count, runs)
        now = time.monotonic()
        if not options.frames and pair < options.pairs and now - start + (now - before) > 60 * options.minutes:
            log(f"{options.pairs - pair} of {options.pairs} pairs left out: the {options.minutes:g} minutes are over")
            break
    return runs


def save(options, head, rows, runs, limits):
    os.makedirs(os.path.dirname(options.json) or ".", exist_ok=True)
    runs = [{**run, "case": run["case"]._asdict()} for run in runs]
    with open(options.json + ".part", "w", encoding="utf-8") as file:
        json.dump({**head, "rows": rows, "limits": limits, "runs": runs}, file, indent=1)
        file.write("\n")
    os.replace(options.json + ".part", options.json)


def main():
    options = arguments()
    start = time.monotonic()
    described = machine.describe(options.build)
    os.makedirs(os.path.join(options.build, "bench"), exist_ok=True)
    folder = options.folder or frames.source(options.build, log)
    cases = cases_of(options)
    systems, fixed, each, heap = probe(systems_of(options, folder), cases, folder, options.build)
    if not systems or not cases:
        log("nothing could be measured")
        return 1
    left = 60 * options.minutes - (time.monotonic() - start)
    count = frames_that_fit(options, left, fixed, each, frames.available(folder))
    short = frames.first(folder, count, options.build)
    runs = run_pairs(options, start, systems, cases, short, count)
    rows = [{**report.summarise(runs, case, system), "heap": heap.get((system.name, case.size))}
            for case in cases for system in systems]
    rows = [row for row in rows if row["pairs"]]
    limits = limit.measure_limits(options.build, cases, short, count, log)
    pairs = max((run["pair"] for run in runs), default=0)
    versions = list(dict.fromkeys(filter(None, (getattr(system, "version", None) for system in systems))))
    head = {"machine": described, "frames": {"source": os.path.basename(folder), "count": count, "warm": report.WARM},
            "voxel_m": 0.01, "pairs": pairs, "others": versions, "seconds": round(time.monotonic() - start, 1)}
    save(options, head, rows, runs, limits)
    print("\n".join(machine.lines(described)))
    print("\n".join([report.summary(head), *report.text_table(rows), "", *report.NOTES, "", *limit.text(limits),
                     f"All figures: {options.json}"]))
    if options.results:
        page.write(options.results, described, head, rows, limits)
    return 0 if rows else 1


if __name__ == "__main__":
    sys.exit(main())
