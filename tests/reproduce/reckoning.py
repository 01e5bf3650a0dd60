"""(e) How far dead reckoning strays over 0.1 to 5 s: gyroscope only, with translation, by the grade of the IMU."""
import os

import figures
from page import code, degrees, figure, millimetres, quantile, recordings, table
from runs import Failed

LETTER, TITLE = "e", "Drift of dead reckoning (Section 3.2, Section 4.1)"
SEEDS = (1, 2, 3)
GRADES = ("ideal", "consumer", "phone")
FRAMES, FROM_S = 600, 8  # twenty seconds; asked from this second on, as long as the longest horizon fits
MODES = {"no IMU": ["--imu", "none"], "gyroscope only": ["--translation", "off"], "with translation": []}
REAL = ("motion_slow", "motion_combined")


def measure(runs):
    tool, jobs, made = runs.tool("drift"), [], []
    start = ["--from", "0.5" if runs.tiny else str(FROM_S), "--every", "0.2" if runs.tiny else "0.25"]

    def ask(recording, options, shown):
        out = runs.process([tool, recording.folder, *options, *start]).decode()
        command = " ".join(["build/tests/reproduce/drift", recording.name, *shown, *start])
        return {"command": command, "lines": [[float(v) for v in line.split()] for line in out.splitlines()]}

    def add(name, recording, options=(), shown=None):
        jobs.append((name, lambda: ask(recording, list(options), list(options if shown is None else shown))))

    frames = ["--frames", str(210 if runs.tiny else FRAMES)]
    size = ["--size", "160x120" if runs.tiny else "320x240"]
    for seed in SEEDS[:1] if runs.tiny else SEEDS:
        base = runs.simulate(f"drift-{seed}", "room", *frames, *size, seed=seed)
        made.append(base.made_by)
        add(("room, consumer", "no IMU", seed), base, MODES["no IMU"])
        for grade in GRADES:
            # The same path and noise of the depth; only the samples differ, so the smallest pictures will do.
            imu = runs.simulate(f"drift-{seed}-{grade}", "room", *frames, "--size", "16x16", "--imu-grade", grade, seed=seed)
            made.append(imu.made_by)
            file = ["--imu", os.path.join(imu.folder, "imu.txt")]
            shown = ["--imu", f"{imu.name}/imu.txt"]
            for mode in ("gyroscope only", "with translation"):
                add((f"room, {grade}", mode, seed), base, file + MODES[mode], shown + MODES[mode])
    for name in REAL:
        motion = runs.given(name)
        if motion:
            real = runs.simulate(f"drift-{name}", "room", "--motion", motion.folder, *frames, *size)
            made.append(real.made_by)
            for mode, options in MODES.items():
                add((f"{name}, real IMU", mode, 0), real, options)
    done = runs.all(jobs)
    if not any(run["lines"] for run in done.values()):
        raise Failed("dead reckoning could be asked for nowhere: nothing was tracked for long enough")
    return {"made": made, "seeds": list(SEEDS),
            "runs": [{"imu": imu, "mode": mode, "seed": seed, **run} for (imu, mode, seed), run in done.items()]}


def combined(results):
    """(imu, mode) to {horizon: ([position errors], [rotation errors], [paths])} over all seeds."""
    answers = {}
    for run in results["runs"]:
        horizons = answers.setdefault((run["imu"], run["mode"]), {})
        for _, horizon, path, _, position, rotation in run["lines"]:
            for values, value in zip(horizons.setdefault(horizon, ([], [], [])), (position, rotation, path)):
                values.append(value)
    return answers


def draw(results, folder):
    answers = combined(results)
    plot, axes = figures.panels(2, 4.8, 9.6)
    simulated = [key for key in answers if key[0].startswith("room")]
    real = [key for key in answers if not key[0].startswith("room")]
    order = simulated + real
    sources = list(dict.fromkeys(imu for imu, _ in order))
    horizons = sorted({t for answer in answers.values() for t in answer})
    lines = {"no IMU": ":", "gyroscope only": "--", "with translation": "-"}
    for imu, mode in order:
        answer = answers[imu, mode]
        times = sorted(answer)
        place = sources.index(imu)
        style = dict(color=figures.MORE[place], marker=figures.MARKERS[place], linestyle=lines[mode], label=f"{imu}: {mode}")
        if mode == "no IMU" and imu.startswith("room"):
            style.update(color="0.45", marker="x", label="room: no IMU")
        axes[0].plot(times, [1000 * quantile(answer[t][0], 0.5) for t in times], **style)
        axes[1].plot(times, [quantile(answer[t][1], 0.5) for t in times], **style)
    axes[0].set(ylabel="position error, mm (median)")
    axes[1].set(ylabel="rotation error, degrees (median)")
    for axis in axes:
        axis.set(xlabel="dead reckoning for, s", xscale="log", yscale="log")
        axis.set_xticks(horizons, [f"{t:g}" for t in horizons])
        axis.minorticks_off()
    figures.legend_below(plot, axes[0], columns=3, rows=-(-len(order) // 3))
    plot.suptitle("Drift of dead reckoning after tracking, many places of each recording")
    figures.save(plot, folder, "drift")


def claims(results):
    answers = combined(results)
    rows = []
    for imu in dict.fromkeys(imu for imu, _ in answers):
        pair = [answers.get((imu, mode), {}).get(1.0) for mode in ("gyroscope only", "with translation")]
        if all(pair) and imu != "room, ideal":
            without, with_it = (quantile(p[0], 0.5) for p in pair)
            rows.append((f"The accelerometer's translation is too poor to be useful (Section 4.1): {imu}, 1 s",
                         f"{'not so here' if with_it < without else 'holds'}: {millimetres(with_it)} with it, "
                         f"{millimetres(without)} at constant velocity (medians)"))
    return rows


def page(results, folder):
    draw(results, folder)
    answers = combined(results)
    lines = [f"After {FROM_S} s of tracking, every quarter of a second, `fathom_inertial_estimate` is asked for the way of the next 0.1 "
             f"to 5 s, and the answer is compared with the truth (tests/reproduce/drift.c). Without an IMU velocity and turning "
             f"rate are held; with the gyroscope only (`--translation off`, the paper's choice) the velocity is. Grades as "
             f"`fathom simulate` has them; the seeds are {', '.join(map(str, results['seeds']))}. motion_* are a "
             f"real IMU in a real hand, in a rendered room. Median, and the 90th percentile in brackets.", ""]
    lines += recordings(results["made"])
    times = sorted({t for horizons in answers.values() for t in horizons})
    for which, title, form in ((0, "position error after", millimetres), (1, "rotation error after", degrees)):
        rows = []
        for (imu, mode), horizons in answers.items():
            cells = [f"{form(quantile(horizons[t][which], 0.5))} ({form(quantile(horizons[t][which], 0.9))})"
                     if t in horizons else "-" for t in times]
            rows.append((imu.replace("room, consumer", "room") if mode == "no IMU" else imu, mode,
                         len(horizons.get(times[0], ([],))[0]), *cells))
        lines += table((title, "mode", "places", *(f"{t:g} s" for t in times)), rows)
    lines += ["Commands (the first seed's; the others have the same with their own folders):", ""]
    for run in results["runs"]:
        if run["seed"] in (0, results["seeds"][0]):
            imu = "room" if run["mode"] == "no IMU" and run["seed"] else run["imu"]
            lines.append(f"- {imu}, {run['mode']}: {code(run['command'])}")
    lines.append("")
    lines += figure("drift", "Drift of dead reckoning by time")
    return lines
