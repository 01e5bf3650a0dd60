"""Recordings that make judge replays: given ones, those that fathom simulate makes, and those that the shared tool renders.
What is made is kept, and made anew when it would come out differently."""
import fcntl
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import threading

import motion

LONGEST_S = 1800  # to make one; longer: it hangs
PACKAGES = (["numpy", "scipy", "opencv-python-headless", "open3d-cpu"],  # wheels for x86-64 only
            ["numpy", "scipy", "opencv-python-headless", "open3d"])


class Missing(Exception):
    """A recording isn't there, or can't be made here; the text says why."""


def say(text):
    print(f"judge: {text}", file=sys.stderr, flush=True)


def sha(*texts):
    return hashlib.sha256("\0".join(texts).encode()).hexdigest()[:16]


def sha_of(path):
    with open(path, "rb") as file:
        return hashlib.sha256(file.read()).hexdigest()[:16]


def sha_of_code(binary, work, processes):
    """Without what debugging information says: a comment more makes no other build."""
    bare = os.path.join(work, f"stripped-{os.getpid()}")
    try:
        status = processes.run(["objcopy", "--strip-all", "--remove-section=.note.gnu.build-id", binary, bare], 60)[0]
        return sha_of(binary if status else bare)
    finally:
        if os.path.exists(bare):
            os.remove(bare)


def sha_of_folder(folder):
    """Of a small recording: all its files."""
    return sha(*(os.path.relpath(os.path.join(at, name), folder) + sha_of(os.path.join(at, name))
                 for at, _, names in sorted(os.walk(folder)) for name in sorted(names)))


def is_recording(folder):
    return any(os.path.exists(os.path.join(folder, name)) for name in ("depth.txt", "camera_matrix.csv"))


class Recording:
    """id changes when what is in it does."""

    def __init__(self, folder, id, truth):
        self.folder, self.id, self.truth = folder, id, truth


class Making:
    """kept: the folder for what is made; shared: ../shared; children: processes in flight, for Ctrl-C."""

    def __init__(self, build, shared, kept, processes, own=None):
        self.build, self.shared, self.kept, self.processes, self.own = build, shared, kept, processes, own
        os.makedirs(kept, exist_ok=True)
        self.fathom = os.path.join(build, "fathom")
        self.binary = sha_of_code(self.fathom, kept, processes)
        self.locks, self.lock = {}, threading.Lock()
        self.found, self.help = {}, {}

    def offers(self, command, options):
        """None, or the first of the options that the command doesn't have."""
        with self.lock:
            if command not in self.help:
                self.help[command] = self.processes.output([self.fathom, command, "--help"])
        known = set(re.findall(r"--[a-z-]+", self.help[command]))
        return next((word for word in options if word.startswith("--") and word not in known), None)

    def get(self, name, how):
        """The recording, made when it isn't there yet; raises Missing."""
        with self.lock:
            mine = self.locks.setdefault(name, threading.Lock())
        with mine:
            if name not in self.found:
                try:
                    self.found[name] = getattr(self, how[0])(name, *how[1:])
                except Missing as error:
                    self.found[name] = error
            if isinstance(self.found[name], Missing):
                raise self.found[name]
            return self.found[name]

    # ---- given

    def given(self, name, folder, *sigma):
        path = os.path.join(self.own or os.path.join(self.shared, "data"), folder)
        if not is_recording(path):
            raise Missing(f"{folder} isn't there" if not self.own else f"{folder} is no recording folder")
        rows, about = motion.read_truth(path), [0.0, 0.0, 0.0]
        if sigma:
            about = ([0.0, 0.0, float(sigma[1].rstrip("%")) / 100] if sigma[1].endswith("%") else
                     [float(sigma[1]) / 1000, float(sigma[2]), 0.0])
        stamps = [f"{entry} {os.stat(os.path.join(path, entry)).st_size} {os.stat(os.path.join(path, entry)).st_mtime_ns}"
                  for entry in sorted(os.listdir(path)) if os.path.isfile(os.path.join(path, entry))]
        truth = None if rows is None else motion.Truth(rows, False, *about)
        return Recording(path, sha(os.path.abspath(path), *stamps), truth)

    # ---- made

    def keep(self, name, id, make):
        """The kept folder, made by make(folder) unless one of this id is there. Another judge may be at it, too."""
        folder = os.path.join(self.kept, name)
        mark = os.path.join(folder, "made")
        with open(folder + ".lock", "w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not (os.path.exists(mark) and open(mark).read().strip() == id):
                say(f"making {name}")
                for old in (folder, folder + ".part"):
                    shutil.rmtree(old, ignore_errors=True)
                make(folder + ".part")
                with open(os.path.join(folder + ".part", "made"), "w") as file:
                    file.write(id + "\n")
                os.rename(folder + ".part", folder)
        return Recording(folder, id, motion.Truth(motion.read_truth(folder), True))

    def run(self, command):
        status, _, said, _ = self.processes.run(command, LONGEST_S)
        if status:
            raise Missing((said.strip().splitlines() or [f"status {status}"])[-1])

    def simulate(self, name, scene, *options):
        options = [option.replace("{data}", os.path.join(self.shared, "data")) for option in options]
        absent = self.offers("simulate", options)
        if absent:
            raise Missing(f"this fathom simulate has no {absent}")
        for along, folder in zip(options, options[1:]):
            if along == "--motion" and not os.path.exists(os.path.join(folder, "groundtruth.txt")):
                raise Missing(f"{os.path.basename(folder)} isn't there")
        command = [self.fathom, "simulate", scene]
        return self.keep(name, self.probe(name, command, options),
                         lambda folder: self.run(command + [folder, "--threads", "1", *options]))

    def probe(self, name, command, options):
        """Does this build simulate what another did? The same recording, as small pictures, says so."""
        path = os.path.join(self.kept, "probes.json")
        key = sha(self.binary, *command[1:], *options)
        with self.lock:
            known = json.load(open(path)) if os.path.exists(path) else {}
        if key in known:
            return known[key]
        folder = os.path.join(self.kept, f"probe-{name}-{os.getpid()}")
        shutil.rmtree(folder, ignore_errors=True)
        self.run(command + [folder, "--threads", "1", *options, "--size", "80x60"])
        id = sha(*command[1:], *options, sha_of_folder(folder))
        shutil.rmtree(folder)
        with self.lock:
            known = json.load(open(path)) if os.path.exists(path) else {}
            known[key] = id
            with open(path + ".part", "w") as file:
                json.dump(known, file)
            os.replace(path + ".part", path)
        return id

    def render(self, name, source, *options):
        tool = os.path.join(self.shared, "tools", "render_motion.py")
        source = os.path.join(self.shared, "data", source)
        for path in (tool, os.path.join(source, "groundtruth.txt")):
            if not os.path.exists(path):
                raise Missing(f"{os.path.relpath(path, self.shared)} isn't there")

        def make(folder):
            python = self.environment()
            os.makedirs(folder)
            for entry in os.listdir(source):
                shutil.copyfile(os.path.join(source, entry), os.path.join(folder, entry))
            self.run([python, tool, folder, *options])

        return self.keep(name, sha(sha_of(tool), sha_of_folder(source), *options), make)

    def environment(self):
        """A Python with what the tool needs, made once; a finished one has a mark."""
        with self.lock:
            mine = self.locks.setdefault("environment", threading.Lock())
        with mine:
            folder = os.path.join(os.path.dirname(self.kept), "venv")
            python = os.path.join(folder, "bin", "python")
            if not os.path.exists(os.path.join(folder, "ready")):
                say(f"making {folder} with Open3D for the other room (once; about a gigabyte)")
                shutil.rmtree(folder, ignore_errors=True)
                self.run([sys.executable, "-m", "venv", folder])
                pip = [python, "-m", "pip", "install", "-q", "--disable-pip-version-check", "--retries", "1", "--timeout", "20"]
                try:
                    self.run(pip + PACKAGES[0])
                except Missing:
                    self.run(pip + PACKAGES[1])
                self.run([python, "-c", "import cv2, open3d, scipy"])
                open(os.path.join(folder, "ready"), "w").close()
            return python
