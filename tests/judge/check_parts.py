"""The parts of make judge against cases whose outcome is known. Prints TAP; exits 1 when a case failed."""
import contextlib
import io
import os
import sys
import tempfile

sys.path.append(os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "reproduce"))

import numpy as np  # noqa: E402

import judge  # noqa: E402
import listing  # noqa: E402
import motion  # noqa: E402
import running  # noqa: E402
import table  # noqa: E402

number, failed = 0, 0


def check(good, text):
    global number, failed
    number += 1
    failed += not good
    print(f"{'ok' if good else 'not ok'} {number} - {text}")


def near(a, b, most=1e-6):
    return np.allclose(a, b, atol=most)


# ---- lists

def names_in(text, read=listing.read_runs):
    with tempfile.NamedTemporaryFile("w", suffix=".list") as file:
        file.write(text)
        file.flush()
        return read(file.name)


def refused(text, read=listing.read_runs):
    try:
        names_in(text, read)
    except listing.Wrong:
        return True
    return False


def lists():
    runs = names_in("# a comment\n+{a,b}/stride-{2,8}@{1..2}  rec-{1}-{3} --stride {2}  # another\nplain rec\n")
    check([run.name for run in runs][:3] == ["a/stride-2@1", "a/stride-2@2", "a/stride-8@1"] and len(runs) == 9,
          "lists: braces make a line for each")
    check(runs[7].recording == "rec-b-2" and runs[7].options == ["--stride", "8"], "lists: {N} is what the Nth became")
    check(runs[0].case == "a/stride-2" and runs[0].short and not runs[8].short, "lists: cases, and what is in the short form")
    check(refused("a rec\na rec\n") and refused("a\n") and refused("{a,b} rec {2}\n"),
          "lists: what is there twice or says too little is refused")
    check(refused("a found b\n", listing.read_recordings), "lists: a recording is given, simulated or rendered")
    own = listing.of_own(names_in("*/stride-2 * --stride 2\nkitchen kitchen\n"), ["mine", "yours"])
    check([(run.name, run.recording) for run in own] == [("mine/stride-2", "mine"), ("yours/stride-2", "yours")],
          "lists: * stands for each recording of one's own")
    here = os.path.dirname(os.path.abspath(__file__))
    recordings = {**listing.read_recordings(os.path.join(here, "recordings")), listing.ANY: None}
    check(all(run.recording in recordings for run in listing.read_runs(os.path.join(here, "runs"))),
          "lists: the project's own name recordings that it has")


# ---- motion

def quaternions(vectors):
    angle = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.hstack([vectors / np.maximum(angle, 1e-12) * np.sin(angle / 2), np.cos(angle / 2)])


def product(a, b):
    return np.hstack([a[:, 3:] * b[:, :3] + b[:, 3:] * a[:, :3] + np.cross(a[:, :3], b[:, :3]),
                      a[:, 3:] * b[:, 3:] - (a[:, :3] * b[:, :3]).sum(1, keepdims=True)])


def path(count=91, step=1 / 30):
    """A camera that moves and turns; TUM lines."""
    t = np.arange(count) * step
    turned = quaternions(np.stack([0.4 * t, 0.3 * np.sin(t), 0 * t], axis=1))
    return np.column_stack([t, 0.3 * np.sin(t), 0.2 * t, 0.1 * np.cos(2 * t), turned])


def judged(estimate, states=None, stats={}, truth=None, exact=True):
    states = np.array(["tracked"] * len(estimate)) if states is None else states
    return motion.judge(estimate, states, stats, motion.Truth(path() if truth is None else truth, exact))


def moved(lines, metres):
    """The lines, frame by frame so far off along x."""
    out = lines.copy()
    out[:, 1] += metres
    return out


def motions():
    lines = path()
    same = judged(lines)
    check(near([same["window_mm"], same["window_deg"]], 0, 1e-3) and same["wrong"] == 0 and same["windows"] == 61,
          "motion: the truth has no error in any window")
    turn = quaternions(np.array([[0.3, -0.8, 1.1]]))
    elsewhere = lines.copy()
    elsewhere[:, 1:4] = lines[:, 1:4] @ motion.evaluate.rotations(turn)[0].T + [1, 2, 3]
    elsewhere[:, 4:] = product(turn, lines[:, 4:])
    other = judged(elsewhere)
    check(near(other["window_mm"], 0, 1e-3) and near(other["window_deg"], 0, 1e-3), "motion: nor in a world of other axes")
    slide = judged(moved(lines, np.arange(91) * 0.001))
    check(29 < slide["window_mm"] < 31 and slide["wrong"] == 0,
          "motion: a slide of 1 mm a frame is 30 mm in a window and no wrong pose")
    jump = np.where(np.arange(91) >= 50, 0.04, 0)
    check(judged(moved(lines, jump))["wrong_at"] == [50], "motion: a jump of 4 cm is one wrong pose, at its frame")
    check(judged(moved(lines, jump), exact=False)["wrong"] == 0, "motion: and none against a reference that isn't exact")
    states = np.array(["tracked"] * 91, dtype=object)
    states[50:60] = "reckoned"
    check(judged(moved(lines, jump), states)["wrong_at"] == [60],
          "motion: a jump while dead reckoning is wrong where fusion goes on")
    back = judged(moved(lines, np.where((np.arange(91) >= 50) & (np.arange(91) < 60), 0.5, 0)), states)
    check(back["wrong"] == 0 and near(back["window_mm"], 0, 1e-3) and back["windows"] == 61 - 31 - 9,
          "motion: what dead reckoning errs between two right frames counts neither as wrong nor in windows")
    dense = path(181, 1 / 60)
    check(near(judged(lines, truth=dense[1:-1:2])["window_mm"], 0, 0.1),
          "motion: between lines of the truth it is interpolated")
    check(motion.judge(lines, states, {}, None)["window_mm"] is None, "motion: without truth nothing is said")
    check([list(pair) for pair in np.transpose(motion.windows(np.arange(5) * 32 / 30))] == [[0, 1], [1, 2], [2, 3], [3, 4]],
          "motion: at stride 32 a window is from frame to frame")
    half = motion.evaluate.rotations(quaternions(np.array([[0, 0, 3.0], [0.01, 0, 0], [0, 0, 0]])))
    check(near(motion.rotation_vectors(half), [[0, 0, 3.0], [0.01, 0, 0], [0, 0, 0]]), "motion: rotation vectors")


def consistencies():
    random = np.random.default_rng(1)
    lines = path(3001)
    noisy = lines.copy()
    noisy[:, 1:4] += 0.002 * random.normal(size=(3001, 3))
    noisy[:, 4:] = product(lines[:, 4:], quaternions(np.radians(0.05) * random.normal(size=(3001, 3))))
    # the two poses' errors; that the first one's turn leads the way astray is little here
    stats = {name: np.full(3001, 2 ** 0.5 * (0.002 if name.endswith("_m") else 0.05)) for name in motion.SPAN_SIGMAS}
    figures = judged(noisy, stats=stats, truth=lines)
    check(0.9 < figures["nees"] < 1.1 and 0.97 < figures["within_3"] < 0.995,
          f"consistency: {figures['nees']:.2f} of errors that are as reported")
    half = {name: values / 2 for name, values in stats.items()}
    check(3.6 < judged(noisy, stats=half, truth=lines)["nees"] < 4.4, "consistency: four where half was reported")
    check(judged(noisy, truth=lines)["nees"] is None, "consistency: nothing is said where nothing was reported")


# ---- table

def case(**other):
    base = {"frames": 500, "tracked": 490, "reckoned": 10, "lost": 0, "wrong": 0, "ate_mm": 20.0, "window_mm": 10.0,
            "window_deg": 0.5, "nees": None, "within_3": None}
    return {**base, **other}


def verdicts(now, before, runs=5):
    return [verdict for verdict, _ in table.changes(table.summed("c", [now] * runs), table.summed("c", [before] * runs))]


def tables():
    five = table.summed("c", [case(ate_mm=ate, window_mm=ate) for ate in (1.0, 2.0, 3.0, 4.0, 50.0)])
    check(five["ate_mm"] == 3.0 and five["worst_mm"] == 50.0 and five["frames"] == 2500,
          "table: the median of errors, sums of counts, the worst window")
    with tempfile.TemporaryDirectory() as folder:
        name = os.path.join(folder, "recorded")
        table_cases = [five, table.summed("d", [case(ate_mm=None)])]
        judge.write_record(name, table_cases, ["d", "c"])
        check(table.read(name) == {row["case"]: row for row in table_cases}, "table: what is recorded is read again")
        judge.write_record(name, [table.summed("d", [case(ate_mm=7.0)])], ["d", "c"])
        check(table.read(name)["d"]["ate_mm"] == 7.0 and table.read(name)["c"] == five,
              "table: recording some cases leaves the others")
    check(verdicts(case(ate_mm=20.5), case()) == [] and verdicts(case(ate_mm=20.7), case()) == ["worse"],
          "table: 3 % is the margin of a median")
    check(verdicts(case(ate_mm=1.3), case(ate_mm=1.0)) == [] and verdicts(case(ate_mm=0.6), case(ate_mm=1.0)) == ["better"],
          "table: or 0.3 mm")
    check(verdicts(case(ate_mm=21.7), case(), 1) == [] and verdicts(case(ate_mm=21.9), case(), 1) == ["worse"],
          "table: one start is held less closely")
    check(verdicts(case(wrong=1), case()) == ["worse"] and verdicts(case(tracked=484), case()) == ["worse"],
          "table: a wrong pose, and frames lost")
    check(verdicts(case(window_mm=None), case()) == ["worse"] and verdicts(case(), case()) == [],
          "table: a figure that is gone; the same again")
    pair = [(table.summed("c", [case(ate_mm=now)]), table.summed("c", [case(ate_mm=before)]))
            for now, before in ((10.2, 10.0), (2040.0, 2000.0))]
    check(table.overall(pair) == [("worse",
          "mean error +2.0 %")] and table.overall([(b, a) for a, b in pair])[0][0] == "better",
          "table: of all cases 1 % counts")


def stores():
    with tempfile.TemporaryDirectory() as folder:
        name = os.path.join(folder, "results.jsonl")
        running.Results(name).keep("one", {"frames": 3})
        with open(name, "a") as file:
            file.write('{"key": "two", "fra')
        again = running.Results(name)
        again.keep("three", {"frames": 4})
        check(running.Results(name).known == {"one": {"frames": 3}, "three": {"frames": 4}},
              "results: a line broken off harms no other")
    processes = running.Processes()
    check(processes.run(["sh", "-c", "echo out; echo err >&2; exit 3"], 10)[:3] == (3, "out\n", "err\n"),
          "processes: status and what they say")
    check(processes.run(["sleep", "60"], 0.2)[0] == 124 and processes.run(["no-such-command"], 1)[0] == 127,
          "processes: one that hangs, one that isn't there")
    processes.stop()
    try:
        processes.run(["true"], 1)
        check(False, "processes: none begins after a stop")
    except running.Stopped:
        check(True, "processes: none begins after a stop")


with contextlib.redirect_stderr(io.StringIO()):
    for part in (lists, motions, consistencies, tables, stores):
        part()
sys.exit(failed != 0)
