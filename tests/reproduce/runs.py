"""Runs of the fathom command: recordings are made once, replays go two at a time with one thread each (what comes out doesn't
depend on the number of threads)."""
import csv
import json
import os
import shutil
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import evaluate

TINY = ["--frames", "60", "--size", "160x120"]  # unless said otherwise, when only the machinery is tried
LONGEST_S = 900                                  # a run that takes longer hangs

# The paper aligns frame to frame, takes inertia as the seed only, rejects what is ill-conditioned, and without an IMU starts
# from the last pose. fathom's own way is its default settings.
WAYS = {"paper, IMU": ["--prior", "seed", "--against", "previous"],
        "paper, no IMU": ["--prior", "seed", "--against", "previous", "--imu", "none", "--start", "previous"],
        "fathom, IMU": [],
        "fathom, no IMU": ["--imu", "none"]}


class Failed(Exception):
    """A run could not be made; the text says why, in a line."""


class Recording:
    """name: as commands on the page call the folder; made_by: the command that made it, or None when it is a given one."""

    def __init__(self, name, folder, made_by=None, scene=None, seed=1):
        self.name, self.folder, self.made_by, self.scene, self.seed = name, folder, made_by, scene, seed

    def truth(self):
        return evaluate.read_trajectory(os.path.join(self.folder, "groundtruth.txt"))

    def frames(self):
        with open(os.path.join(self.folder, "depth.txt")) as file:
            return sum(1 for line in file if line.strip() and not line.startswith("#"))


def say(text):
    print(f"reproduce: {text}", file=sys.stderr, flush=True)


def number(text):
    try:
        return float(text)
    except ValueError:
        return text


class Runs:
    def __init__(self, build, shared, work, tiny=False, lanes=2):
        self.build, self.shared, self.work, self.tiny, self.lanes = build, shared, work, tiny, lanes
        self.recordings = {}
        self.section, self.started, self.count = "", time.monotonic(), 0
        self.lock = threading.Lock()
        os.makedirs(work, exist_ok=True)

    def begin(self, section):
        self.section, self.started, self.count = section, time.monotonic(), 0

    def process(self, command, stdin=None):
        try:
            done = subprocess.run(command, input=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=LONGEST_S)
        except subprocess.TimeoutExpired:
            raise Failed(f"{' '.join(command)}: no end after {LONGEST_S} s") from None
        except OSError as error:
            raise Failed(f"{command[0]}: {error.strerror}; run make") from None
        if done.returncode:
            last = (done.stderr.decode(errors="replace").strip().splitlines() or ["no message"])[-1]
            raise Failed(f"{' '.join(command)} ended with status {done.returncode}: {last}")
        return done.stdout

    def tool(self, name):
        return os.path.join(self.build, "tests", "reproduce", name)

    # ---- recordings ----

    def given(self, name):
        """A recording of the shared data; None where that isn't there."""
        folder = os.path.join(self.shared, name)
        have = os.path.exists(os.path.join(folder, "groundtruth.txt"))
        return Recording(name, folder) if have and not self.tiny else None

    def simulate(self, name, scene, *options, seed=1):
        """Once for each name. A folder among the options (--motion) is called by its own name on the page."""
        with self.lock:
            if name in self.recordings:
                return self.recordings[name]
        folder = os.path.join(self.work, name)
        shutil.rmtree(folder, ignore_errors=True)
        options = list(options) + (["--seed", str(seed)] if seed != 1 else [])
        shown = " ".join(["fathom simulate", scene, name] + [o.replace(self.shared + os.sep, "") for o in options])
        say(f"[{self.section}] {shown}")
        self.process([os.path.join(self.build, "fathom"), "simulate", scene, folder] + (TINY if self.tiny else []) + options)
        made = Recording(name, folder, shown, scene, seed)
        with self.lock:
            self.recordings[name] = made
        return made

    def forget(self, name):
        """Recordings are large; what no other section needs may go."""
        made = self.recordings.pop(name, None)
        if made:
            shutil.rmtree(made.folder, ignore_errors=True)

    # ---- replays ----

    def replay(self, recording, options=(), keep=(), look=None, outputs=("mesh",)):
        """A replay's figures: its command, its summary line, and of each frame what `keep` names (columns of --stats, or
        `error` for the way the position has strayed, metres). look(files) may look at the outputs (files["mesh"],
        files["picture"]); its answer is kept under "look"."""
        with self.lock:
            self.count += 1
            base = os.path.join(self.work, f"run-{self.section}{self.count}")
        files = {"stats": base + ".csv", "trajectory": base + ".txt"}
        if look:
            files.update({kind: base + {"mesh": ".ply", "picture": ".png"}[kind] for kind in outputs})
        written = [part for kind, path in files.items() for part in ("--" + kind, path)]
        out = self.process([os.path.join(self.build, "fathom"), "replay", recording.folder, "--threads", "1"] +
                           list(options) + written).decode()
        result = {"command": " ".join(["fathom replay", recording.name, *options])}
        for pair in out.strip().splitlines()[-1].split():
            key, value = pair.split("=")
            if not key.startswith("ms_"):
                result[key] = number(value)
        with open(files["stats"], newline="") as file:
            rows = list(csv.DictReader(file))
        result["series"] = {key: [number(row[key]) for row in rows] for key in keep if key != "error"}
        if "error" in keep:
            errors = evaluate.position_errors(evaluate.read_trajectory(files["trajectory"]), recording.truth())
            result["series"]["error"] = [round(float(e), 5) for e in errors]
        if look:
            result["look"] = look(files)
        for path in files.values():
            if os.path.exists(path):
                os.remove(path)
        return result

    def all(self, jobs):
        """Calls the jobs (name, function), two at a time; their results by name. Says how far it is."""
        jobs, results = list(jobs), {}

        def one(job):
            name, function = job
            results[name] = function()
            with self.lock:
                say(f"[{self.section}] {len(results)} of {len(jobs)}, {time.monotonic() - self.started:.0f} s: "
                    f"{name if isinstance(name, str) else ', '.join(map(str, name))}")

        with ThreadPoolExecutor(self.lanes) as pool:
            for _ in pool.map(one, jobs):
                pass
        return {name: results[name] for name, _ in jobs}


def flat(results):
    """Results whose names are tuples, as JSON has no such keys: a list of {"name": [...], ...}."""
    return [{"name": list(name), **result} for name, result in results.items()]


def write_json(path, value):
    with open(path + ".part", "w") as file:
        json.dump(value, file)
    os.replace(path + ".part", path)
