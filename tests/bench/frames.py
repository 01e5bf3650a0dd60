"""The recording that the bench runs on: the first frames of a real one, or of a simulated room."""
import os
import shutil
import subprocess

KITCHEN = "../shared/data/kitchen"
MOST = 300  # Open3D is lost on the kitchen near frame 450


def lines(path):
    """The lines that aren't comments."""
    with open(path, encoding="utf-8") as file:
        return [line for line in file if line.strip() and not line.startswith("#")]


def source(build, log):
    """The folder the frames come from: the kitchen, else a simulated room that is kept in the build."""
    if os.path.exists(os.path.join(KITCHEN, "depth.txt")):
        return KITCHEN
    room = os.path.join(build, "bench", "room")
    if not os.path.exists(os.path.join(room, "ready")):
        log(f"no {KITCHEN}: simulating a room")
        subprocess.run([os.path.join(build, "fathom"), "simulate", "room", room, "--frames", str(MOST), "--force"],
                       check=True, stdout=subprocess.DEVNULL)
        open(os.path.join(room, "ready"), "w", encoding="utf-8").close()
    return room


def first(folder, count, build):
    """A recording folder with the first `count` frames: a depth.txt of its own, the rest is links to `folder`."""
    short = os.path.join(build, "bench", f"first-{count}")
    shutil.rmtree(short, ignore_errors=True)
    os.makedirs(short)
    with open(os.path.join(short, "depth.txt"), "w", encoding="utf-8") as file:
        file.writelines(lines(os.path.join(folder, "depth.txt"))[:count])
    for name in ("depth", "calibration.txt", "rig.txt", "imu.txt", "groundtruth.txt"):
        target = os.path.abspath(os.path.join(folder, name))
        if os.path.exists(target):
            os.symlink(target, os.path.join(short, name))
    return short


def count(folder):
    return len(lines(os.path.join(folder, "depth.txt")))


def available(folder):
    return min(MOST, count(folder))
