"""The systems that are timed. Each runs in a process of its own, confined to as many cores as it gets threads.

A system has a name and run(case, folder, frames), which gives a dict:

    ms            {stage: [milliseconds, frame by frame]}, with "total" for the whole step
    frames        that were taken; lost: how many of them weren't tracked
    ate_rmse_m    or None
    resident_mb   the most memory of the process that was ever resident, less the decoded frames it holds for the timing
    wall_s        of the whole process, start to end
    cores         processor time over wall time: below the number of threads where it waits or others are busy

To add one (fusion alone, odometry alone): a class with these two, and its name in bench.py's list.
"""
import csv
import json
import os
import subprocess
import threading
import time
from collections import namedtuple

Case = namedtuple("Case", "size threads")
STAGES = ("maps", "track", "fuse", "raycast", "total")
LONGEST_S = 900  # a process that takes longer hangs


class Failed(Exception):
    """A system could not be run; the text says why, in a line."""


def measure(command, threads, environment=None):
    """Runs a command on the first `threads` cores we may use; its standard output, and what the kernel counted."""
    cores = sorted(os.sched_getaffinity(0))[:threads]
    start = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                               env={**os.environ, **(environment or {})},
                               preexec_fn=lambda: os.sched_setaffinity(0, cores))
    guard = threading.Timer(LONGEST_S, process.kill)
    guard.start()
    errors = []
    drain = threading.Thread(target=lambda: errors.append(process.stderr.read()))
    drain.start()
    output = process.stdout.read()
    drain.join()
    _, status, usage = os.wait4(process.pid, 0)
    guard.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    wall = time.monotonic() - start
    if process.returncode:
        last = (errors[0].strip().splitlines() or ["no message"])[-1]
        raise Failed(f"{os.path.basename(command[0])} ended with status {process.returncode}: {last}")
    return output, {"wall_s": wall, "cores": (usage.ru_utime + usage.ru_stime) / wall,
                    "resident_mb": usage.ru_maxrss / 1024}


class Fathom:
    def __init__(self, build, imu):
        self.name = "fathom, IMU" if imu else "fathom, no IMU"
        self.imu = imu
        self.program = os.path.join(build, "fathom")
        self.stats = os.path.join(build, "bench", "stats.csv")

    def run(self, case, folder, frames):
        command = [self.program, "replay", folder, "--stats", self.stats, "--size", case.size, "--threads",
                   str(case.threads), "--voxel", "0.01"] + ([] if self.imu else ["--imu", "none"])
        output, measured = measure(command, case.threads)
        summary = dict(field.split("=", 1) for field in output.strip().splitlines()[-1].split())
        with open(self.stats, encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        columns = {"maps": "ms_maps", "track": "ms_align", "fuse": "ms_fuse", "raycast": "ms_raycast",
                   "total": "ms_total"}
        ate = float(summary["ate_rmse_m"])
        return {"ms": {stage: [float(row[column]) for row in rows] for stage, column in columns.items()},
                "frames": len(rows), "lost": int(summary["reckoned"]) + int(summary["lost"]),
                "ate_rmse_m": None if ate != ate else ate, "arena_mb": float(summary["arena_mb"]), **measured}


class Open3D:
    name = "Open3D dense SLAM"

    def __init__(self, build, python):
        self.python = python
        self.script = os.path.join(os.path.dirname(os.path.abspath(__file__)), "open3d_slam.py")
        self.out = os.path.join(build, "bench", "open3d.json")
        self.version = None

    def run(self, case, folder, frames):
        command = [self.python, self.script, "--size", case.size, "--threads", str(case.threads), folder, self.out]
        _, measured = measure(command, case.threads)
        with open(self.out, encoding="utf-8") as file:
            found = json.load(file)
        self.version = found["version"]
        measured["resident_mb"] -= found["held_mb"]
        return {"ms": found["ms"], "frames": found["frames"], "lost": frames - found["frames"],
                "ate_rmse_m": found["ate_rmse_m"], **measured}
