"""Replays, their figures, and where those are kept: a line of JSON a run, by what it depends on."""
import csv
import json
import os
import signal
import subprocess
import tempfile
import threading
import time

import numpy as np

import motion
from making import Missing, sha, sha_of

LONGEST_S = 900  # a run that takes longer hangs


class Stopped(Exception):
    """Ctrl-C."""


class Processes:
    """Those in flight, so that all can be ended."""

    def __init__(self):
        self.lock, self.flying, self.stopped = threading.Lock(), set(), False

    def run(self, command, longest_s):
        """Status, stdout, stderr, and the seconds of a processor that it took."""
        with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
            with self.lock:
                if self.stopped:
                    raise Stopped
                try:
                    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=err,
                                               start_new_session=True)
                except OSError as error:
                    return 127, "", f"{command[0]}: {error.strerror}", 0.0
                self.flying.add(process.pid)
            spent = self.ended(process, time.monotonic() + longest_s)
            if self.stopped:
                raise Stopped
            if spent is None:
                return 124, "", f"no end after {longest_s} s", longest_s
            said = []
            for file in (out, err):
                file.seek(0)
                said.append(file.read().decode(errors="replace"))
            return process.returncode, *said, spent

    def ended(self, process, latest):
        """Waits; its seconds of a processor, or None when it had to be killed. wait4 tells them of one child."""
        late = False
        while True:
            pid, status, usage = os.wait4(process.pid, os.WNOHANG)
            if pid:
                break
            if time.monotonic() > latest and not late:
                late = True
                os.killpg(process.pid, signal.SIGKILL)
            time.sleep(0.02)
        with self.lock:
            self.flying.discard(process.pid)
        process.returncode = os.waitstatus_to_exitcode(status)
        return None if late else usage.ru_utime + usage.ru_stime

    def output(self, command):
        return self.run(command, LONGEST_S)[1]

    def stop(self):
        with self.lock:
            self.stopped = True
            for pid in self.flying:
                os.killpg(pid, signal.SIGTERM)


class Results:
    """Figures by key; each is on disk as soon as it is known."""

    def __init__(self, path):
        self.path, self.lock, self.known = path, threading.Lock(), {}
        if os.path.exists(path):
            with open(path) as file:
                for line in file:
                    try:
                        found = json.loads(line)
                        self.known[found.pop("key")] = found
                    except (ValueError, KeyError):
                        pass  # broken off in the middle
            with open(path, "rb+") as file:
                if file.seek(0, os.SEEK_END):
                    file.seek(-1, os.SEEK_END)
                    if file.read(1) != b"\n":
                        file.write(b"\n")

    def keep(self, key, figures):
        with self.lock:
            self.known[key] = figures
            with open(self.path, "a") as file:
                file.write(json.dumps({"key": key, **figures}) + "\n")


class Replays:
    def __init__(self, making, processes, work):
        self.making, self.processes, self.work = making, processes, work
        self.measure = sha_of(motion.__file__)
        self.results = Results(os.path.join(work, "results.jsonl"))

    def key(self, recording, options):
        limits = repr(recording.truth and recording.truth.limits())
        return sha(self.making.binary, self.measure, recording.id, limits, *options)

    def figures(self, run, how):
        """A run's figures, from an earlier time if it was made by this build; raises Missing. What failed is tried anew."""
        absent = self.making.offers("replay", run.options)
        if absent:
            raise Missing(f"this fathom replay has no {absent}")
        recording = self.making.get(run.recording, how)
        key = self.key(recording, run.options)
        if key not in self.results.known:
            figures = {"name": run.name, **self.replay(run, recording)}
            if "failed" in figures:
                return figures
            self.results.keep(key, figures)
        return self.results.known[key]

    def replay(self, run, recording):
        base = os.path.join(self.work, f"run-{os.getpid()}-{sha(run.name)}")
        stats, trajectory = base + ".csv", base + ".txt"
        try:
            command = [self.making.fathom, "replay", recording.folder, "--threads", "1", *run.options]
            status, out, err, spent = self.processes.run(command + ["--stats", stats, "--trajectory", trajectory], LONGEST_S)
            if status:
                return {"failed": (err.strip().splitlines() or [f"status {status}"])[-1]}
            figures = {"cpu_s": round(spent, 2)}
            summary = dict(pair.split("=") for pair in out.strip().splitlines()[-1].split())
            figures.update({name: int(summary[name]) for name in ("frames", "tracked", "reckoned", "lost")})
            ate = 1000 * float(summary["ate_rmse_m"])
            figures["ate_mm"] = None if np.isnan(ate) else round(ate, 3)
            states, columns = read_stats(stats)
            figures.update(motion.judge(motion.evaluate.read_trajectory(trajectory), states, columns, recording.truth))
            return figures
        finally:
            for path in (stats, trajectory):
                if os.path.exists(path):
                    os.remove(path)


def read_stats(path):
    """States, and the other columns by name."""
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    names = [name for name in (rows[0] if rows else []) if name in motion.SPAN_SIGMAS]
    return (np.array([row["state"] for row in rows]),
            {name: np.array([float(row[name] or "nan") for row in rows]) for name in names})
