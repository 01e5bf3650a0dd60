"""Times fathom beside other systems on the same frames; bench.sh sets up what it needs. Needs Python alone.

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
import machine
import report
from systems import Case, Failed, Fathom, Open3D

PROBE_FRAMES = 20
LEAST_FRAMES = 30
MARGIN = 1.25  # later frames take longer than the probe's: the surface grows


def log(text):
    print(f"bench: {text}", file=sys.stderr, flush=True)


def arguments():
    parser = argparse.ArgumentParser(prog="bench.sh BUILD", description=__doc__.splitlines()[0])
    parser.add_argument("--build", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--open3d", default="", help=argparse.SUPPRESS)  # the Python that has it
    parser.add_argument("--pairs", type=int, default=3, help="rounds of all systems (default 3)")
    parser.add_argument("--quick", action="store_true", help="one pair, about two minutes")
    parser.add_argument("--minutes", type=float, default=5.5, help="most time for all; frames are counted to fit it")
    parser.add_argument("--frames", type=int, default=0, help=f"frames a run instead, {frames.MOST} at most")
    parser.add_argument("--sizes", default="320x240,640x480", help="alignment resolutions")
    parser.add_argument("--threads", default="1,2", help="numbers of threads")
    parser.add_argument("--json", default="out/bench.json", help="where all figures go (default out/bench.json)")
    options = parser.parse_args()
    if options.quick:
        options.pairs, options.minutes = 1, min(options.minutes, 2)
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


def probe(systems, cases, folder, build):
    """A short run of each system at each size with most threads. Gives the systems that work, and for each case and
    system the seconds that a run takes whatever its length, and a frame."""
    short = frames.first(folder, min(PROBE_FRAMES, frames.available(folder)), build)
    working, fixed, each = [], 0.0, 0.0
    most = max(case.threads for case in cases)
    for system in systems:
        try:
            for size in dict.fromkeys(case.size for case in cases):
                log(f"warming up: {system.name}, {size}")
                run = system.run(Case(size, most), short, PROBE_FRAMES)
                a_frame = report.middle(run["ms"]["total"][PROBE_FRAMES // 2:]) or 0
                for case in cases:
                    if case.size == size:
                        fixed += max(0.0, run["wall_s"] - sum(run["ms"]["total"]) / 1e3)
                        each += a_frame / 1e3 * most / case.threads
            working.append(system)
        except Failed as failure:
            log(f"{system.name} left out: {failure}")
    return working, fixed, each


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
    """All runs. Stops after a pair when another would take too long, unless the number of frames was given."""
    runs = []
    for pair in range(1, options.pairs + 1):
        before = time.monotonic()
        run_pair(pair, systems, cases, folder, count, runs)
        now = time.monotonic()
        if not options.frames and pair < options.pairs and now - start + (now - before) > 60 * options.minutes:
            log(f"{options.pairs - pair} of {options.pairs} pairs left out: the {options.minutes:g} minutes are over")
            break
    return runs


def save(options, head, rows, runs):
    os.makedirs(os.path.dirname(options.json) or ".", exist_ok=True)
    runs = [{**run, "case": run["case"]._asdict()} for run in runs]
    with open(options.json + ".part", "w", encoding="utf-8") as file:
        json.dump({**head, "rows": rows, "runs": runs}, file, indent=1)
        file.write("\n")
    os.replace(options.json + ".part", options.json)


def main():
    options = arguments()
    start = time.monotonic()
    described = machine.describe(options.build)
    os.makedirs(os.path.join(options.build, "bench"), exist_ok=True)
    folder = frames.source(options.build, log)
    cases = cases_of(options)
    systems = [Open3D(options.build, options.open3d)] if options.open3d else []
    systems += [Fathom(options.build, True), Fathom(options.build, False)]
    systems, fixed, each = probe(systems, cases, folder, options.build)
    if not systems or not cases:
        log("nothing could be measured")
        return 1
    left = 60 * options.minutes - (time.monotonic() - start)
    count = frames_that_fit(options, left, fixed, each, frames.available(folder))
    runs = run_pairs(options, start, systems, cases, frames.first(folder, count, options.build), count)
    rows = [report.summarise(runs, case, system.name, Open3D.name) for case in cases for system in systems]
    rows = [row for row in rows if row["pairs"]]
    pairs = max((run["pair"] for run in runs), default=0)
    version = next((system.version for system in systems if system.name == Open3D.name), None)
    head = {"machine": described, "frames": {"source": os.path.basename(folder), "count": count, "warm": report.WARM},
            "voxel_m": 0.01, "pairs": pairs, "open3d": version, "seconds": round(time.monotonic() - start, 1)}
    save(options, head, rows, runs)
    print("\n".join(machine.lines(described)))
    print(f"frames: {head['frames']['source']}, the first {count}; voxel 1 cm; pairs: {pairs}; "
          f"Open3D {version or 'absent'}; {head['seconds']:.0f} s in all")
    print("\n".join(["", *report.table(rows), "", *report.NOTES, f"All figures: {options.json}"]))
    return 0 if rows else 1


if __name__ == "__main__":
    sys.exit(main())
