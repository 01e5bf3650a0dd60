"""The systems that are timed. Each runs in a process of its own, confined to as many cores as it gets threads.

A system has a name, the work it does (kind: systems of one kind are compared), the name of the one that it is compared
with (against: None for that one itself), quantity ("median" or "p95": what of it is divided by the other's median), and
run(case, folder, frames, heap), which gives a dict:

    ms            {stage: [milliseconds, frame by frame]}, with "total" for the whole
    frames        that were taken; lost: how many of them weren't tracked
    ate_rmse_m    or None
    resident_mb   the most memory of the process that was ever resident, less the decoded frames it holds for the timing
    wall_s        of the whole process, start to end
    cores         processor time over wall time: below the number of threads where it waits or others are busy
    heap          calls of the heap a frame, with heap=True: from our own code for fathom, from all for the others; else
                  None. The counter costs time, so such a run isn't timed
"""
import csv
import json
import os
import subprocess
import threading
import time
from collections import namedtuple

Case = namedtuple("Case", "size threads")
STAGES = ("maps", "track", "allocate", "fuse", "raycast", "total")
STEP, FUSION, ALIGNMENT = "whole step", "fusion alone", "alignment alone"
KINDS = (STEP, FUSION, ALIGNMENT)
LONGEST_S = 900  # a process that takes longer hangs
VOXEL = "0.01"


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


def tool(build, name):
    return os.path.join(build, "tests", "bench", name)


def counting(build, heap):
    """The environment that a process counts its heap calls in."""
    return {"LD_PRELOAD": tool(build, "libheap_count.so")} if heap else {}


def settled(calls):
    """A frame's calls, once the first half is over."""
    late = calls[len(calls) // 2:]
    return sum(late) / len(late) if late else None


class Fathom:
    """fathom replay. `whole`: over the whole recording, for its 95th percentile."""
    kind, against = STEP, "Open3D dense SLAM"

    def __init__(self, build, imu, whole=None):
        self.name = ("fathom, IMU" if imu else "fathom, no IMU") + (", all frames" if whole else "")
        self.options = [] if imu else ["--imu", "none"]
        self.quantity = "p95" if whole else "median"
        self.whole = whole
        self.build = build
        self.stats = os.path.join(build, "bench", "stats.csv")

    def heap(self, settings, folder, frames):
        output, _ = measure([tool(self.build, "heap"), folder, "--frames", str(frames), *settings], 1)
        return json.loads(output)["own"]

    def run(self, case, folder, frames, heap=False):
        settings = ["--size", case.size, "--threads", str(case.threads), "--voxel", VOXEL, *self.options]
        command = [os.path.join(self.build, "fathom"), "replay", folder if heap or not self.whole else self.whole,
                   "--stats", self.stats, *settings]
        output, measured = measure(command, case.threads)
        summary = dict(field.split("=", 1) for field in output.strip().splitlines()[-1].split())
        with open(self.stats, encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        columns = {"maps": "ms_maps", "track": "ms_align", "fuse": "ms_fuse", "raycast": "ms_raycast",
                   "total": "ms_total"}
        ms = {stage: [float(row[column]) for row in rows] for stage, column in columns.items()}
        ate = float(summary["ate_rmse_m"])
        return {"ms": ms, "frames": len(rows), "lost": int(summary["reckoned"]) + int(summary["lost"]),
                "ate_rmse_m": None if ate != ate else ate, "arena_mb": float(summary["arena_mb"]),
                "heap": self.heap(settings[:4], folder, frames) if heap else None, **measured}


class FathomAlignment(Fathom):
    """Each frame with the one before, from the last pose on: what FastICPOdometry does. Of the step, maps and alignment
    are taken; that the frame is also fused is left out."""
    kind, against = ALIGNMENT, "OpenCV FastICPOdometry"

    def __init__(self, build):
        super().__init__(build, False)
        self.name = "fathom, frame to frame"
        self.options += ["--against", "previous", "--start", "previous"]

    def run(self, case, folder, frames, heap=False):
        run = super().run(case, folder, frames, heap)
        ms = run["ms"]
        totals = [maps + track for maps, track in zip(ms["maps"], ms["track"])]
        return {**run, "ms": {"maps": ms["maps"], "track": ms["track"], "total": totals}}


class FathomFusion:
    name, kind, against, quantity = "fathom, given poses", FUSION, "Open3D VoxelBlockGrid", "median"

    def __init__(self, build):
        self.build = build

    def run(self, case, folder, frames, heap=False):
        output, measured = measure([tool(self.build, "fusion"), folder, "--size", case.size, "--threads",
                                    str(case.threads), "--voxel", VOXEL], case.threads)
        found = json.loads(output)
        ms = {stage: found[stage] for stage in ("maps", "allocate", "fuse")}
        ms["total"] = [sum(parts) for parts in zip(*ms.values())]
        return {"ms": ms, "frames": found["frames"], "lost": frames - found["frames"], "ate_rmse_m": None,
                "arena_mb": found["arena_mb"], "heap": None, **measured}


class Open3D:
    """Its dense SLAM."""
    name, kind, against, quantity, script = "Open3D dense SLAM", STEP, None, "median", "open3d_slam.py"

    def __init__(self, build, python):
        self.build, self.python = build, python
        self.out = os.path.join(build, "bench", "open3d.json")
        self.version = None

    def run(self, case, folder, frames, heap=False):
        script = os.path.join(os.path.dirname(os.path.abspath(__file__)), self.script)
        command = [self.python, script, "--size", case.size, "--threads", str(case.threads), "--voxel", VOXEL, folder,
                   self.out]
        _, measured = measure(command, case.threads, counting(self.build, heap))
        with open(self.out, encoding="utf-8") as file:
            found = json.load(file)
        self.version = "Open3D " + found["version"]
        measured["resident_mb"] -= found["held_mb"]
        return {"ms": found["ms"], "frames": found["frames"], "lost": frames - found["frames"],
                "ate_rmse_m": found["ate_rmse_m"], "heap": settled(found["heap"]), **measured}


class Open3DFusion(Open3D):
    """Its voxel grid alone."""
    name, kind, script = "Open3D VoxelBlockGrid", FUSION, "open3d_fusion.py"


class OpenCV:
    name, kind, against, quantity = "OpenCV FastICPOdometry", ALIGNMENT, None, "median"

    def __init__(self, build):
        self.build = build
        self.version = None

    def run(self, case, folder, frames, heap=False):
        output, measured = measure([tool(self.build, "odometry"), folder, case.size, str(case.threads), str(frames)],
                                   case.threads, counting(self.build, heap))
        found = json.loads(output)
        self.version = "OpenCV " + found["version"]
        width, height = (int(n) for n in case.size.split("x"))
        measured["resident_mb"] -= found["frames"] * width * height * 4 / 2 ** 20
        totals = [maps + track for maps, track in zip(found["maps"], found["track"])]
        return {"ms": {"maps": found["maps"], "track": found["track"], "total": totals}, "frames": found["frames"],
                "lost": found["lost"], "ate_rmse_m": found.get("ate_rmse_m"),
                "heap": settled(found["heap"]), **measured}
