#!/usr/bin/env python3
"""Judges a build of fathom: the runs of tests/judge/runs over many recordings, one table, and what of it isn't as recorded.

Recordings are those of ../shared/data that are there, simulated and rendered ones, which are kept. A case's error is the median
of its starts. window: the largest error of motion over 1 s among windows that are tracked from end to end (the median of the
starts; worst: the largest). wrong: frames that were fused although they lie more than 3 cm or 2 degrees wrong relative to the
one fused before (on real recordings 10 cm, 5 degrees). nees: the error over 1 s squared in units of what was reported, over its
expectation; within_3: the share of windows within 3 sigma.
Better and worse are said beyond 3 % or 0.3 mm of a case's error and 1 % of its frames tracked and right (three times that where
a case is one run), 1 % and 0.2 % of all cases together.
Results are kept in BUILD/judge by build and run: what was broken off goes on where it stopped.
Exit status: 0 done; 1 something got worse than recorded, or a run failed; 2 wrong usage; 130 Ctrl-C."""
import argparse
import os
import re
import signal
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
sys.path.append(os.path.join(ROOT, "tests", "reproduce"))  # evaluate.py

import listing  # noqa: E402
import making  # noqa: E402
import running  # noqa: E402
import table  # noqa: E402
from making import say  # noqa: E402


def options():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", help="the build's folder")
    parser.add_argument("--only", metavar="REGEX", help="runs whose name it is found in")
    parser.add_argument("--short", action="store_true", help="those marked + only")
    parser.add_argument("--data", metavar="FOLDER", help="recordings of one's own: a folder of them, or one")
    parser.add_argument("--runs", metavar="FILE", default=os.path.join(HERE, "runs"), help="the list (tests/judge/runs)")
    parser.add_argument("--recordings", metavar="FILE", default=os.path.join(HERE, "recordings"), help="how each is had")
    parser.add_argument("--recorded", metavar="FILE", help="the table beside it (tests/judge/recorded; none with --data)")
    parser.add_argument("--record", action="store_true", help="write what was found into the recorded table")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="replays at a time, one thread each (2)")
    parser.add_argument("--each", action="store_true", help="a line of the table for each run, not for each case")
    parser.add_argument("--list", action="store_true", help="say what would be run")
    parser.add_argument("--tap", action="store_true", help="the outcome as TAP, held less closely")
    given = parser.parse_args()
    if given.recorded is None and not given.data:
        given.recorded = os.path.join(HERE, "recorded")
    if given.record and not given.recorded:
        parser.error("--record with --data wants a file: --recorded FILE")
    return given


def own_recordings(folder):
    """Names of the recordings in a folder, and the folder they are in."""
    folder = os.path.abspath(folder)
    if making.is_recording(folder):
        return os.path.dirname(folder), [os.path.basename(folder)]
    inside = sorted(os.listdir(folder)) if os.path.isdir(folder) else []
    names = [name for name in inside if making.is_recording(os.path.join(folder, name))]
    if not names:
        raise listing.Wrong(f"{folder}: no recording folder, and none in it")
    return folder, names


def chosen_runs(given):
    """The runs, how each recording is had, and the folder of those of one's own."""
    runs, how, own = listing.read_runs(given.runs), listing.read_recordings(given.recordings), None
    if given.data:
        own, names = own_recordings(given.data)
        runs, how = listing.of_own(runs, names), {name: ["given", name] for name in names}
    else:
        runs = [run for run in runs if run.recording != listing.ANY]
    for run in runs:
        if run.recording not in how:
            raise listing.Wrong(f"{given.runs}: {run.name}: no recording is called {run.recording}")
    runs = [run for run in runs if (run.short or not given.short) and re.search(given.only or "", run.name)]
    if not runs:
        raise listing.Wrong("no run has such a name")
    return runs, how, own


class Progress:
    """On a terminal one line that changes; else a line now and then."""

    def __init__(self, count):
        self.count, self.done, self.made = count, 0, 0
        self.start = self.said = time.monotonic()
        self.terminal, self.lock = sys.stderr.isatty(), threading.Lock()

    def step(self, name, new):
        with self.lock:
            self.done += 1
            self.made += new
            now = time.monotonic()
            if now - self.said < (0.2 if self.terminal else 30) and self.done < self.count:
                return
            self.said = now
            spent = now - self.start
            left = f", about {(self.count - self.done) * spent / self.made / 60:.0f} min left" if self.made > 9 else ""
            text = f"judge: {self.done} of {self.count}, {spent:.0f} s{left}: {name}"
            if self.terminal:
                sys.stderr.write("\r" + text[:118].ljust(118) + ("\n" if self.done == self.count else ""))
                sys.stderr.flush()
            else:
                print(text, file=sys.stderr, flush=True)


def all_figures(runs, how, replays, jobs):
    """Figures by run name; what was left out, by reason: names of runs. Stops at Ctrl-C, with what there is."""
    found, absent, lock = {}, {}, threading.Lock()
    progress = Progress(len(runs))

    def one(run):
        before = len(replays.results.known)
        try:
            found[run.name] = replays.figures(run, how[run.recording])
        except making.Missing as error:
            with lock:
                absent.setdefault(f"{run.recording}: {error}", []).append(run.name)
        except running.Stopped:
            return
        except (OSError, ValueError, KeyError, IndexError) as error:
            found[run.name] = {"failed": f"{type(error).__name__}: {error}"}
        progress.step(run.name, len(replays.results.known) > before)

    stopped = False
    with ThreadPoolExecutor(jobs) as pool:
        futures = [pool.submit(one, run) for run in runs]
        try:
            for future in futures:
                future.result()
        except KeyboardInterrupt:
            stopped = True
            for future in futures:
                future.cancel()
            replays.processes.stop()
    return found, absent, stopped


def in_cases(runs, found, each):
    """Cases all of whose runs are there and didn't fail, as lines of the table."""
    by_case = {}
    for run in runs:
        by_case.setdefault(run.name if each else run.case, []).append(run)
    return [table.summed(name, [found[run.name] for run in members]) for name, members in by_case.items()
            if all("frames" in found.get(run.name, {}) for run in members)]


def write_record(path, cases, all_names):
    """Rows of this time replace those of the same name; the order is that of the list; what isn't in the list goes."""
    rows = table.read(path) if os.path.exists(path) else {}
    rows.update({case["case"]: case for case in cases})
    with open(path + ".part", "w") as file:
        file.write("# make judge JUDGE=--record writes this; tests/judge/judge.py --help says what the columns are\n")
        file.write("\n".join(table.text([rows[name] for name in all_names if name in rows])) + "\n")
    os.replace(path + ".part", path)


def compared(given, cases):
    """Cases that the recorded table has, in pairs; what of them is beyond the margins: (better or worse, case, words)."""
    before = table.read(given.recorded) if given.recorded and os.path.exists(given.recorded) else {}
    pairs = [(case, before[case["case"]]) for case in cases if before.get(case["case"], {}).get("runs") == case["runs"]]
    said = [(verdict, now["case"], words) for now, old in pairs for verdict, words in table.changes(now, old, given.tap)]
    together = [] if given.tap else table.overall(pairs)
    return pairs, said + [(verdict, f"all {len(pairs)} cases", words) for verdict, words in together]


def failures(runs, found):
    return [(run, found[run.name]["failed"]) for run in runs if "failed" in found.get(run.name, {})]


def report(given, runs, found, absent, cases):
    """Prints the table, and what differs from the recorded one; true when nothing got worse."""
    print("\n".join(table.text(in_cases(runs, found, True) if given.each else cases)) + "\n")
    for run in runs if given.each else []:
        if found.get(run.name, {}).get("wrong"):
            print(f"wrong   {run.name}: frames {' '.join(map(str, found[run.name]['wrong_at']))}")
    wrong = [f"{case['case']} {case['wrong']}" for case in cases if case["wrong"]]
    if wrong:
        print(f"wrong poses  {', '.join(wrong)}")
    pairs, said = compared(given, cases)
    failed = failures(runs, found)
    for verdict, name, words in said:
        print(f"{verdict:6}  {name}: {words}")
    for run, why in failed:
        print(f"failed  {run.name}: {why}")
    for why, names in absent.items():
        print(f"left out  {why} ({len(names)} runs)")
    verdicts = [verdict for verdict, _, _ in said]
    if given.recorded:
        new = len(cases) - len(pairs)
        print(f"{len(pairs)} cases beside the recorded table: {verdicts.count('worse')} worse, "
              f"{verdicts.count('better')} better" + (f"; {new} that it doesn't have" if new else ""))
    spent = sum(found[run.name].get("cpu_s", 0) for run in runs if run.name in found)
    print(" ".join(f"{name}={value}" for name, value in table.totals(cases).items()) + f" cpu_min={spent / 60:.1f}")
    return "worse" not in verdicts and not failed


def report_tap(given, runs, found, absent, cases):
    """A line a case: none failed, none is worse than recorded beyond the margins of one start (another processor rounds in its
    own way)."""
    pairs, said = compared(given, cases)
    left_out = {name: why for why, names in absent.items() for name in names}
    recorded = {now["case"] for now, _ in pairs}
    wrong = {}
    for verdict, name, words in said:
        if verdict == "worse":
            wrong.setdefault(name, []).append(words)
    for run, why in failures(runs, found):
        wrong.setdefault(run.case, []).append(f"{run.name}: {why}")
    by_name = {case["case"]: case for case in cases}
    for number, name in enumerate(dict.fromkeys(run.case for run in runs), 1):
        reasons = [left_out[run.name] for run in runs if run.case == name and run.name in left_out]
        if not reasons and name not in recorded:
            reasons = ["the recorded table doesn't have it"]
        case = by_name.get(name)
        figures = case and " (" + ", ".join(f"{what} {table.cell(what, case[what])}" for what in table.SHOWN) + ")"
        if name in wrong:
            print(f"not ok {number} - {name}: no worse than recorded{figures or ''}")
            print("\n".join(f"#   {words}" for words in wrong[name]))
        else:
            skip = f" # SKIP {reasons[0]}" if reasons else ""
            print(f"ok {number} - {name}: no worse than recorded{figures or ''}{skip}")
    return not wrong


def main():
    given = options()
    try:
        runs, how, own = chosen_runs(given)
    except (listing.Wrong, OSError, re.error) as error:
        print(f"judge: {error}", file=sys.stderr)
        return 2
    if given.list:
        for run in runs:
            print(run.name, "fathom replay", run.recording, *run.options)
        return 0
    build = os.path.abspath(given.build)
    if not os.access(os.path.join(build, "fathom"), os.X_OK):
        print(f"judge: {build}/fathom isn't built; run make", file=sys.stderr)
        return 2
    work = os.path.join(build, "judge")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C
    processes = running.Processes()
    made = making.Making(build, os.path.join(ROOT, "..", "shared"), os.path.join(work, "recordings"), processes, own)
    processes.output([made.fathom, "info", "--plan"])  # the kernels are built first, and once
    replays = running.Replays(made, processes, work)
    found, absent, stopped = all_figures(runs, how, replays, max(1, given.jobs))
    if stopped:
        say("stopped; what is done is kept, and the same command goes on from there")
        return 130
    cases = in_cases(runs, found, False)
    good = (report_tap if given.tap else report)(given, runs, found, absent, cases)
    if given.record:
        names = [run.case for run in (runs if own else listing.read_runs(given.runs))]
        write_record(given.recorded, [case for case in cases if case["runs"] == names.count(case["case"])], list(dict.fromkeys(names)))
        return 0
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
