"""Careless changes, one at a time, in a copy of the tree: does a unit test see each of them?

    python3 tests/mutants/mutants.py BUILD [--count N] [--seed N] [--jobs N] [--minutes N] [--only TEXT] [--list]

Changes come from changes.txt (written by hand, all of them) and are drawn by a seed from the source lines of lib/, opencl/ and
drivers/ until there are N in all. Each is made in a copy below BUILD/mutants, the unit tests that enter the changed function (gcov
says which those are) are built and run until one fails (or crashes, or hangs), and the line is put back. Results are kept in
BUILD/mutants/results.jsonl as they come, keyed by the change itself, so that a run that was stopped goes on where it was; a file
whose code changed since is tried again, a survivor by the tests that have changed since (by all of them with --only).
The end prints the share that was caught, and the survivors; changes that are no fault (equivalent.txt) are counted apart.
"""
import argparse
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time

from operators import mutations

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
FOLDERS = ("lib/", "opencl/", "drivers/")
SHARES = {"lib/": 0.6, "opencl/": 0.15, "drivers/": 0.25}  # of the drawn ones


def tracked():
    listed = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True, check=True)
    return [f for f in listed.stdout.split("\n") if f and os.path.exists(os.path.join(ROOT, f))]


def sources():
    return [f for f in tracked() if f.startswith(FOLDERS) and f.endswith((".c", ".cpp", ".cl")) and not f.startswith("lib/selftest/")]


def read(path):
    with open(path, encoding="utf-8") as f:
        return f.read()


def code_digest(path):
    """Of a file's code: comments and the layout of its lines may change."""
    code = re.sub(r"/\*.*?\*/|//[^\n]*", " ", read(os.path.join(ROOT, path)), flags=re.S)
    return hashlib.sha256("".join(code.split()).encode()).hexdigest()


def rows(name):
    """Rows of a table beside this script: blocks separated by blank lines, '#' lines are comments."""
    text = "\n".join(line for line in read(os.path.join(HERE, name)).split("\n") if not line.startswith("#"))
    return [block.strip("\n").split("\n") for block in re.split(r"\n\s*\n", text) if block.strip()]


class Change:
    """One change: a file, the text that goes, what stands there instead, and what its user would get."""

    def __init__(self, path, before, after, what, hand, at=None):
        self.path, self.before, self.after, self.what, self.hand, self.at = path, before, after, what, hand, at
        self.key = hashlib.sha256("\0".join([path, before, after]).encode()).hexdigest()[:12]

    def apply(self, text):
        """The changed text; None where the text that goes doesn't stand there, or stands there more than once."""
        if self.at is not None:
            lines = text.split("\n")
            if lines[self.at] != self.before:
                return None
            lines[self.at] = self.after
            return "\n".join(lines)
        return text.replace(self.before, self.after) if text.count(self.before) == 1 else None

    def show(self):
        return f"{self.path}: {self.what}\n    - {self.before.strip()}\n    + {self.after.strip()}"


def by_hand():
    changes = []
    for block in rows("changes.txt"):
        path, what = block[0].split(": ", 1)
        before = "\n".join(line[2:] for line in block[1:] if line.startswith("- "))
        after = "\n".join(line[2:] for line in block[1:] if line.startswith("+ "))
        changes.append(Change(path, before, after, what, True))
    return changes


def drawn(count, seed):
    """Distinct changes by the operators, one a line: each line's rank is a hash of the seed and of its text, so that an edit
    elsewhere draws the same ones again."""
    rank = lambda *words: hashlib.sha256("\0".join([str(seed), *words]).encode()).hexdigest()
    changes = []
    for folder, share in SHARES.items():
        places = {}
        for path in sources():
            if path.startswith(folder):
                for at, line in enumerate(read(os.path.join(ROOT, path)).split("\n")):
                    if mutations(line):
                        places.setdefault((path, line), at)
        for path, line in sorted(places, key=lambda place: rank(*place))[:round(count * share)]:
            what, after = min(mutations(line), key=lambda m: rank(path, *m))
            changes.append(Change(path, line, after, f"line {places[path, line] + 1}, {what}", False, places[path, line]))
    return sorted(changes, key=lambda change: rank(change.key))


class Test:
    """A unit test: its folder, its program's digest (of its source), seconds, and the functions that it enters."""

    def __init__(self, folder, digest, seconds, enters):
        self.folder, self.digest, self.seconds, self.enters = folder, digest, seconds, enters
        self.passes = None  # on the tree as it is, until it was asked


def lines_of(change):
    """First and last line (from 1) of what a change takes away."""
    if change.at is not None:
        return change.at + 1, change.at + 1
    text = read(os.path.join(ROOT, change.path))
    first = text[:max(0, text.find(change.before))].count("\n") + 1
    return first, first + change.before.count("\n")


def can_see(change, test):
    """Does a test run the changed lines' function? Of lines outside functions: any of the file. Kernels: whatever launches some.
    A test that can't be built for coverage may see anything."""
    if test.enters is None:
        return True
    if change.path.endswith(".cl"):
        return bool(test.enters.get("lib/cl/launch.c"))
    first, last = lines_of(change)
    digest, functions = test.enters.get(change.path, ["", []])
    within = [f for f in functions if f[0] <= last and first <= f[1]] if digest == digest_of(change.path) else []
    return any(f[2] for f in (within or functions))


def tests_for(change, known, caught):
    """The unit tests that can see a change, the likeliest first: those that caught others in the same file, its own folder's,
    then the rest from the quickest on."""
    folder = change.path.split("/")[0 if not change.path.startswith("lib/") else 1]
    own = {"opencl": ("cl", "map"), "frame": ("cl", "frame"), "step.c": ("api", "tracking")}.get(folder, (folder,))
    order = lambda n: ((change.path, n) not in caught, known[n].folder not in own, known[n].seconds)
    return sorted((n for n in known if can_see(change, known[n])), key=order)


class Copy:
    """A copy of the tree with a build of its own, and a worker's view of it."""

    def __init__(self, folder):
        self.folder = folder
        files = set(tracked())
        for name in files:
            target = os.path.join(folder, name)
            source = os.path.join(ROOT, name)
            if os.path.exists(target) and read_bytes(target) == read_bytes(source):
                continue
            os.makedirs(os.path.dirname(target), exist_ok=True)
            shutil.copy2(source, target)
            os.utime(target)
        shared = os.path.join(os.path.dirname(folder), "shared")
        if not os.path.exists(shared) and os.path.isdir(os.path.join(ROOT, "..", "shared")):
            os.symlink(os.path.realpath(os.path.join(ROOT, "..", "shared")), shared)
        self.environment = dict(os.environ, XDG_CACHE_HOME=os.path.join(folder, "cache"), CMOCKA_MESSAGE_OUTPUT="TAP")

    def make(self, *targets, build="build", flags=("OPTIMISE=-O1",)):
        command = ["make", "-s", f"BUILD={build}", *flags, *targets]
        return subprocess.run(command, cwd=self.folder, capture_output=True, text=True, env=self.environment)

    def passes(self, name, limit, build="build", **environment):
        """Runs one unit test. False when it fails, crashes, takes more than limit seconds of processor time, or hangs: a machine
        that is busy with other things makes nothing fail."""
        process = subprocess.Popen(["sh", "-c", f'ulimit -t {round(limit)}; exec "$0"', os.path.join(build, "tests", name)],
                                   cwd=self.folder, env=dict(self.environment, **environment), stdin=subprocess.DEVNULL,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        try:
            return process.wait(6 * limit) == 0
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            return False

    def enters(self, name):
        """Of each source file its digest and its functions: [first line, last line, whether the test runs it]. Only those that the test's
        program ends with count: a process that is killed says nothing. None: it fails when it is built so (counting takes heap)."""
        made = self.make(f"cover/tests/{name}", build="cover", flags=("OPTIMISE=-O1 --coverage", "LDFLAGS=--coverage"))
        data = os.path.join(self.folder, "counts", name)
        shutil.rmtree(data, ignore_errors=True)
        os.makedirs(data)
        if made.returncode != 0 or not self.passes(name, 1200, "cover", GCOV_PREFIX=data):
            print(f"mutants: {name} fails when built for coverage", file=sys.stderr)
            return None
        counts = [os.path.join(at, f) for at, _, files in os.walk(data) for f in files if f.endswith(".gcda")]
        for path in counts:
            shutil.copy(path[len(data):-5] + ".gcno", path[:-5] + ".gcno")
        said = subprocess.run(["gcov", "--json-format", "--stdout", *counts], cwd=self.folder, capture_output=True, text=True)
        shutil.rmtree(data)
        found = {}
        for line in said.stdout.split("\n"):
            for file in json.loads(line)["files"] if line.startswith("{") else []:
                if file["file"].startswith(FOLDERS):
                    functions = found.setdefault(file["file"], [digest_of(file["file"]), []])[1]
                    functions.extend([f["start_line"], f["end_line"], f["execution_count"] > 0] for f in file["functions"])
        return found

    def sound(self, name, known, path, good, text):
        """Whether a test that failed passes on the tree as it is; each is asked once."""
        if known[name].passes is None:
            write(path, good)
            if self.make(f"build/tests/{name}").returncode != 0 or not self.passes(name, 2 * known[name].seconds + 10):
                print(f"mutants: {name} fails on the tree as it is, so it can tell nothing; run it by hand", file=sys.stderr)
                os._exit(1)
            known[name].passes = True
            write(path, text)
        return True

    def tries(self, change, known, caught, unchanged):
        """What became of a change: ('caught', by), ('survived', ''), ('gone', why) or ('unbuilt', why). `unchanged`: the tests'
        digests that it survived before."""
        path = os.path.join(self.folder, change.path)
        if not os.path.exists(path):
            return "gone", "no such file"
        good = read(path)
        text = change.apply(good)
        if text is None:
            return "gone", "the text that goes isn't there, or more than once"
        try:
            write(path, text)
            for name in tests_for(change, known, caught):
                if unchanged.get(name) == known[name].digest:
                    continue
                made = self.make(f"build/tests/{name}")
                if made.returncode != 0:
                    return "unbuilt", (made.stderr.strip().split("\n") or [""])[0]
                if not self.passes(name, 2 * known[name].seconds + 10) and self.sound(name, known, path, good, text):
                    return "caught", name
            return "survived", ""
        finally:
            write(path, good)


def read_bytes(path):
    with open(path, "rb") as f:
        return f.read()


def digest_of(path):
    return hashlib.sha256(read_bytes(os.path.join(ROOT, path))).hexdigest()[:16]


def write(path, text):
    with open(path, "w", encoding="utf-8") as f:
        f.write(text)


def measure(copy, kept):
    """The unit tests; what is known of those whose source hasn't changed since is kept."""
    known, before = {}, json.loads(read(kept)) if os.path.exists(kept) else {}
    for path in tracked():
        found = re.fullmatch(r"tests/unit/(\w+)/(test_\w+)\.c", path)
        if not found:
            continue
        name, digest = found.group(2), digest_of(path)
        if before.get(name, {}).get("digest") != digest:
            made = copy.make(f"build/tests/{name}")
            if made.returncode != 0:
                sys.exit(f"mutants: {name} doesn't build: {made.stderr[-800:]}")
            start = time.monotonic()
            if not copy.passes(name, 600):
                sys.exit(f"mutants: {name} fails on the tree as it is, so it can tell nothing; run it by hand")
            seconds = round(time.monotonic() - start, 1)
            before[name] = {"digest": digest, "seconds": seconds, "enters": copy.enters(name)}
            write(kept, json.dumps(before))
            print(f"mutants: {name} passes, {seconds} s", file=sys.stderr, flush=True)
        known[name] = Test(found.group(1), digest, before[name]["seconds"], before[name]["enters"])
    return known


def report(changes, results, equivalent):
    """Prints the figures and the survivors; returns the share that was caught."""
    done = [(c, results[c.key]) for c in changes if c.key in results]
    fate = lambda word: [c for c, r in done if r["fate"] == word]
    survived = [c for c in fate("survived") if c.key not in equivalent]
    same = [c for c in fate("survived") if c.key in equivalent]
    caught, counted = fate("caught"), len(fate("caught")) + len(survived)
    for c in fate("gone"):
        if c.hand:
            print(f"a row of changes.txt no longer fits: {c.show()}")
    if same:
        print("\nNo fault (equivalent.txt):")
        for c in same:
            print(f"  {c.key} {c.show()}\n    {equivalent[c.key]}")
    if survived:
        print("\nSurvived:")
        for c in survived:
            print(f"  {c.key} {c.show()}")
    share = len(caught) / counted if counted else 0
    print(f"\n{len(caught)} of {counted} caught ({100 * share:.1f} %), {len(survived)} survived, {len(same)} equivalent, "
          f"{len(fate('unbuilt'))} didn't build, {sum(c.key not in results for c in changes)} not tried yet")
    return share


def main():
    parser = argparse.ArgumentParser(description="Makes careless changes in a copy of the tree; do the unit tests see them?")
    parser.add_argument("build", help="the build folder; copies and results go to BUILD/mutants")
    parser.add_argument("--count", type=int, default=240, help="changes in all, those of changes.txt among them (240)")
    parser.add_argument("--seed", type=int, default=1, help="of the drawn ones (1)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="copies that work side by side (one a processor)")
    parser.add_argument("--minutes", type=float, default=120, help="stops then; a later run goes on (120)")
    parser.add_argument("--only", default="", help="changes whose file, text or key contains this")
    parser.add_argument("--list", action="store_true", help="prints the changes and makes none")
    options = parser.parse_args()

    hand = by_hand()
    changes = hand + drawn(max(0, options.count - len(hand)), options.seed)
    changes = [c for c in changes if options.only in c.key or options.only in c.show()]
    if options.list:
        print("\n".join(f"{c.key} {c.show()}" for c in changes))
        return 0
    work = os.path.join(os.path.abspath(options.build), "mutants")
    kept = os.path.join(work, "results.jsonl")
    os.makedirs(work, exist_ok=True)
    results = {}
    if os.path.exists(kept):
        for line in read(kept).split("\n"):
            row = json.loads(line) if line.strip() else None
            if row:
                results[row["key"]] = row
    state = {c.path: code_digest(c.path) for c in changes if os.path.exists(os.path.join(ROOT, c.path))}
    # a survivor may be caught by a test that has come since; what was caught stays caught while its file is the same
    waiting = [c for c in changes if c.key not in results or results[c.key]["file"] != state.get(c.path) or
               results[c.key]["fate"] == "survived"]
    equivalent = {block[0].split()[0]: " ".join(block[1:]).strip() for block in rows("equivalent.txt")}
    # those written by hand have had tests written for them; what is no fault takes longest, as every test passes
    waiting.sort(key=lambda c: (c.key in equivalent, c.hand))
    end = time.monotonic() + 60 * options.minutes
    if waiting:
        copies = [Copy(os.path.join(work, str(i), "tree")) for i in range(max(1, options.jobs))]
        known = measure(copies[0], os.path.join(work, "tests.json"))
        lock = threading.Lock()
        caught = {}
        for row in results.values():
            if row["fate"] == "caught":
                caught[row["path"], row["by"]] = True

        def work_off(copy):
            while time.monotonic() < end:
                with lock:
                    if not waiting:
                        return
                    change = waiting.pop(0)
                old = results.get(change.key, {})
                same = old.get("file") == state.get(change.path) and not options.only
                fate, by = copy.tries(change, known, caught, old.get("survived", {}) if same else {})
                row = {"key": change.key, "fate": fate, "by": by, "path": change.path, "file": state.get(change.path),
                       "change": change.show()}
                if fate == "survived":
                    row["survived"] = {name: known[name].digest for name in known}
                with lock:
                    if fate == "caught":
                        caught[change.path, by] = True
                    results[change.key] = row
                    with open(kept, "a", encoding="utf-8") as f:
                        f.write(json.dumps(row) + "\n")
                    print(f"mutants: {fate} {by}: {change.show()}", file=sys.stderr, flush=True)

        threads = [threading.Thread(target=work_off, args=(copy,), daemon=True) for copy in copies]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    return 0 if report(changes, results, equivalent) >= 0.95 else 1


if __name__ == "__main__":
    sys.exit(main())
