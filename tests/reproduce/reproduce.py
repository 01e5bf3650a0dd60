"""The paper's claims as experiments: measures, keeps raw results in BUILD/reproduce/*.json, and writes the page of all that
is there. Sections that aren't chosen keep the results they have."""
import argparse
import json
import os
import platform
import shutil
import sys
import textwrap
import time

import iterations
import outage
import reckoning
import strides
import surface
import verdict
import wall
from page import list_of, table
from runs import Failed, Runs, say, write_json

SECTIONS = {module.LETTER: module for module in (iterations, wall, outage, strides, reckoning, surface, verdict)}
HERE = os.path.dirname(os.path.abspath(__file__))
WIDTH = 125
ROOT = os.path.dirname(os.path.dirname(HERE))

HEAD = """# Results

Made by `make reproduce` (tests/reproduce/); the last section is tests/reproduce/history.md. Each other number stands beside the command that made it, or in a
list of commands below its table. The paper is M. Niessner, A. Dai, M. Fisher, "Combining Inertial Navigation and ICP for
Real-time 3D Surface Reconstruction", Eurographics 2014. Four ways are compared:

| way | options of `fathom replay` | meaning |
|---|---|---|
| paper, IMU | `--prior seed --against previous` | frame to frame; inertia is the seed only; what is ill-conditioned is rejected |
| paper, no IMU | `--prior seed --against previous --imu none --start previous` | the same, started at the last pose: ICP alone |
| fathom, IMU | (default) | against the surface; inertia's information enters the solution |
| fathom, no IMU | `--imu none` | the same, started at constant velocity |

ATE is the root mean square of the distances to the reference positions after the best rigid alignment, over all frames,
dead-reckoned ones included. "Tracked" counts frames that alignment was trusted on. Results don't depend on the number of
threads; times are not measured here (`make bench` does that: [SPEED.md](SPEED.md)).
"""
KITCHEN = """
"kitchen" is the first 500 frames of 7-Scenes RedKitchen (a real hand-held Kinect) with IMU samples simulated from the
reference poses, which are themselves good to about 25 mm: an ATE near that is as good as can be told. It is a recording folder
beside the source tree, `../shared/data/kitchen`, as are motion_slow and motion_combined (BROAD).
"""
NO_KITCHEN = """
The recordings of `../shared/data` were not there for {}; rows about them
(kitchen, motion_*) are left out there.
"""


def arguments():
    parser = argparse.ArgumentParser(prog="reproduce", description=__doc__)
    parser.add_argument("--build", default=os.path.join(ROOT, "build"), help="the build folder (default: build)")
    parser.add_argument("--sections", default=",".join(SECTIONS), help="which to measure anew, e.g. a,d; 'none': only the page")
    parser.add_argument("--shared", default=os.path.join(ROOT, "..", "shared", "data"), help="where kitchen and motion_* are")
    parser.add_argument("--docs", default=os.path.join(ROOT, "docs"), help="where RESULTS.md and results/ go")
    parser.add_argument("--results", help="where raw results are kept (default: BUILD/reproduce)")
    parser.add_argument("--lanes", type=int, default=2, help="runs at a time (default 2)")
    parser.add_argument("--tiny", action="store_true", help="short recordings: tries the machinery, says nothing about fathom")
    chosen = parser.parse_args()
    chosen.sections = [] if chosen.sections == "none" else [s.strip() for s in chosen.sections.split(",") if s.strip()]
    unknown = [s for s in chosen.sections if s not in SECTIONS]
    if unknown:
        parser.error(f"no section {list_of(unknown)}; there are {list_of(SECTIONS)}")
    return chosen


def processor():
    try:
        with open("/proc/cpuinfo") as file:
            return next(line.split(":", 1)[1].strip() for line in file if line.startswith("model name"))
    except (OSError, StopIteration):
        return platform.machine()


def measure(chosen, results):
    """Measures the chosen sections; the letters of those that failed."""
    work, failed = os.path.join(results, "work"), []
    shutil.rmtree(work, ignore_errors=True)
    runs = Runs(os.path.abspath(chosen.build), os.path.abspath(chosen.shared), work, chosen.tiny, chosen.lanes)
    version = runs.process([os.path.join(runs.build, "fathom"), "--version"]).decode().split("\n")[0]
    for letter in chosen.sections:
        start = time.monotonic()
        runs.begin(letter)
        try:
            measured = SECTIONS[letter].measure(runs)
        except Failed as error:
            say(f"[{letter}] failed: {error}")
            failed.append(letter)
            continue
        write_json(os.path.join(results, letter + ".json"), {
            "version": version, "processor": processor(), "tiny": chosen.tiny, "shared": runs.given("kitchen") is not None,
            "seconds": time.monotonic() - start, "results": measured})
        say(f"[{letter}] done in {time.monotonic() - start:.0f} s")
    shutil.rmtree(work, ignore_errors=True)
    return failed


def wrapped(line):
    """Prose gets the width of the other documents; tables, code and figures stay."""
    prose = len(line) > WIDTH and line[0] not in "|#!`-"
    return textwrap.fill(line, WIDTH, break_long_words=False, break_on_hyphens=False) if prose else line


def assemble(results, docs):
    kept = {}
    for letter in SECTIONS:
        path = os.path.join(results, letter + ".json")
        if os.path.exists(path):
            with open(path) as file:
                kept[letter] = json.load(file)
    pictures = os.path.join(docs, "results")
    os.makedirs(pictures, exist_ok=True) # other pages' pictures are there, too
    lines = HEAD.splitlines()
    if any(k["shared"] for k in kept.values()):
        lines += KITCHEN.splitlines()
    without = [letter for letter, k in kept.items() if not k["shared"]]
    if without:
        lines += NO_KITCHEN.format(list_of(f'section {letter}' for letter in without)).splitlines()
    made_on = dict.fromkeys(f"{k['version']}, {k['processor']}" for k in kept.values())
    lines += ["", f"Measured with {'; '.join(made_on)}." if made_on else "Nothing has been measured yet.", ""]
    if any(k["tiny"] for k in kept.values()):
        lines += ["**Some of this was made with --tiny: it tries the machinery and says nothing about fathom.**", ""]
    missing = [letter for letter in SECTIONS if letter not in kept]
    if missing:
        lines += [f"Not measured yet: {list_of(f'section {letter}' for letter in missing)} "
                  f"(`make reproduce SECTIONS={','.join(missing)}`).", ""]
    rows = [(claim, verdict, f"({letter})") for letter, k in kept.items()
            for claim, verdict in SECTIONS[letter].claims(k["results"])]
    if rows:
        lines += ["## The claims in short", "", "Each verdict is worked out from the numbers below.", ""]
        lines += table(("claim", "here", "section"), rows)
    for letter, k in kept.items():
        lines += [f"## ({letter}) {SECTIONS[letter].TITLE}", ""] + SECTIONS[letter].page(k["results"], pictures)
        lines += [f"`make reproduce SECTIONS={letter}` makes this section.", ""]
    with open(os.path.join(HERE, "history.md"), encoding="utf-8") as file:
        lines += file.read().splitlines()
    path = os.path.join(docs, "RESULTS.md")
    with open(path + ".part", "w") as file:
        file.write("\n".join(map(wrapped, lines)).rstrip() + "\n")
    os.replace(path + ".part", path)
    say(f"wrote {os.path.relpath(path)}")


def main():
    chosen = arguments()
    results = os.path.abspath(chosen.results or os.path.join(chosen.build, "reproduce"))
    os.makedirs(results, exist_ok=True)
    start = time.monotonic()
    try:
        failed = measure(chosen, results) if chosen.sections else []
    except Failed as error:
        say(str(error))
        return 1
    assemble(results, chosen.docs)
    say(f"{time.monotonic() - start:.0f} s in all")
    return 1 if failed else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
