"""(g) The verdict: how its measures tell right alignments from wrong ones, on frames whose pose is known."""
import csv
import os
import re

import figures
from page import code, figure, percent, recordings, table
from runs import Failed

LETTER, TITLE = "g", "The verdict (Section 2, last paragraph)"
KINDS = {"tracked": "tracked, as it is", "aligned": "aligned from a misalignment", "injected": "a misalignment, as it is"}
# Column: what it is called, whether more is better, its setting.
MEASURES = {"agreement": ("agreement", True, "min_agreement"), "see_through": ("see-through", False, "max_see_through"),
            "rms_m": ("rms", False, "max_rms_m"), "overlap": ("overlap", True, "min_overlap"),
            "sigma_m": ("sigma", False, "max_sigma_m")}
NUMBERS = (*MEASURES, "off_m", "off_deg", "injected_m", "injected_deg", "condition", "sigma_rad", "visible")
SCENES = [("room-1", "room", ["--speed", "2", "--frames", "180"], 1), ("room-2", "room", ["--speed", "3", "--frames", "120"], 2),
          ("wall-1", "wall", ["--speed", "2", "--frames", "120"], 1)]


def defaults():
    """The settings as docs/SETTINGS.md has them, a row each: name, unit, range, default, meaning."""
    path = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "docs", "SETTINGS.md")
    with open(path) as file:
        return {name: float(value) for name, value in
                re.findall(r"^\| `([\w\[\].]+)` \|[^|]*\|[^|]*\| ([-+0-9.e]+) \|", file.read(), flags=re.M)}


def measure(runs):
    jobs, made = [], []

    def add(recording, real, options):
        def judge():
            out = runs.process([runs.tool("verdict"), recording.folder, *options]).decode()
            rows = [{**{k: row[k] for k in ("kind", "label", "verdict")}, "frame": int(row["frame"]),
                     **{k: float(row[k]) for k in NUMBERS}} for row in csv.DictReader(out.splitlines())]
            return {"command": " ".join(["build/tests/reproduce/verdict", recording.name, *options]), "real": real,
                    "name": recording.name, "rows": rows, "defaults": defaults()}
        jobs.append((recording.name, judge))

    kitchen = runs.given("kitchen")
    if kitchen:
        add(kitchen, True, ["--stride", "2", "--each", "3", "--within", "0.06"])
    for name, scene, options, seed in SCENES[:1] if runs.tiny else SCENES:
        recording = runs.simulate(f"verdict-{name}", scene, *([] if runs.tiny else options), seed=seed)
        made.append(recording.made_by)
        add(recording, False, ["--each", "20" if runs.tiny else "2" if name == "room-2" else "3"])
    done = runs.all(jobs)
    if not any(run["rows"] for run in done.values()):
        raise Failed("there was no frame to judge at: none was tracked surely")
    return {"made": made, "runs": list(done.values())}


def labelled(results, real):
    rows = [row for run in results["runs"] if run["real"] == real for row in run["rows"]]
    return [[row for row in rows if row["label"] == label] for label in ("right", "wrong")]


def accepted(rows):
    return sum(row["verdict"] == "tracking" for row in rows)


def curve(right, wrong, column, more):
    """Shares of wrong and of right ones accepted, for each threshold."""
    sign = -1 if more else 1
    values = sorted([(sign * row[column], 1, 0) for row in right] + [(sign * row[column], 0, 1) for row in wrong])
    points, good, bad = [(0.0, 0.0)], 0, 0
    for i, (value, is_right, is_wrong) in enumerate(values):
        good, bad = good + is_right, bad + is_wrong
        if i + 1 == len(values) or values[i + 1][0] != value:
            points.append((bad / len(wrong), good / len(right)))
    return points


def draw(results, folder):
    plot, axes = figures.panels(2, 4.6, 9.6, sharey=True)
    for axis, real, title in ((axes[0], False, "simulated"), (axes[1], True, "real (kitchen)")):
        right, wrong = labelled(results, real)
        if not right or not wrong:
            axis.set(title=f"{title}: not measured")
            continue
        least = 0.3 / len(wrong)  # where no wrong one is accepted, at the left edge of a logarithmic axis
        for place, (column, (name, more, setting)) in enumerate(MEASURES.items()):
            default = results["runs"][0]["defaults"][setting]
            points = curve(right, wrong, column, more)
            colour = figures.MORE[place]
            axis.step([max(x, least) for x, _ in points], [y for _, y in points], where="post", color=colour,
                      linestyle=("-", "--", "-.", ":", (0, (5, 1, 1, 1, 1, 1)))[place], label=f"{name} alone")
            keeps = [[(row[column] >= default if more else row[column] <= default) for row in rows] for rows in (wrong, right)]
            axis.plot(max(sum(keeps[0]) / len(wrong), least), sum(keeps[1]) / len(right), marker=figures.MARKERS[place],
                      color=colour, linestyle="none", label=f"{name} at its default")
        kept = [[row for row in rows if row["verdict"] == "tracking"] for rows in (right, wrong)]
        points = [(x * len(kept[1]) / len(wrong), y * len(kept[0]) / len(right)) for x, y in curve(*kept, "see_through", False)] \
            if all(kept) else []
        axis.step([max(x, least) for x, _ in points], [y for _, y in points], where="post", color="#000000", linewidth=1,
                  label="the whole, less see-through")
        axis.plot(max(accepted(wrong) / len(wrong), least), accepted(right) / len(right), marker="*", markersize=14,
                  color="#000000", linestyle="none", label="the whole verdict", zorder=5)
        axis.set(xscale="log", xlim=(least / 1.3, 1.1), ylim=(0.6, 1.01), title=f"{title}: {len(right)} right, {len(wrong)} wrong",
                 xlabel="wrong alignments accepted, share (left edge: none)")
        figures.plain(axis.xaxis)
    axes[0].set(ylabel="right alignments accepted, share")
    axes[1].yaxis.set_tick_params(labelleft=True)
    shown = next((a for a in axes if a.get_legend_handles_labels()[0]), axes[0])
    figures.legend_below(plot, shown, columns=4, rows=3)
    figures.save(plot, folder, "verdict")


def shares(rows):
    return f"{accepted(rows)} of {len(rows)} ({percent(accepted(rows) / len(rows))})" if rows else "-"


def claims(results):
    rows = []
    for real, name in ((False, "simulated"), (True, "real")):
        right, wrong = labelled(results, real)
        if right and wrong:
            rows.append((f"Thresholds separate right alignments from wrong ones (Section 2): {name} frames",
                         f"right accepted: {shares(right)}; wrong accepted: {shares(wrong)}"))
    return rows


def page(results, folder):
    draw(results, folder)
    count = sum(len(rows) for real in (False, True) for rows in labelled(results, real))
    lines = [f"{count} labelled candidates. At frames whose tracked pose lies near the truth, before they are fused, that pose is "
             "judged, and so are misalignments injected from it (3 to 30 cm, 2 to 20 degrees or both, log-uniform; "
             "tests/reproduce/verdict.c): as they are, and aligned from there with the whole budget and a covariance of that size. "
             "Right ends within 1 cm and 0.7 degrees of the tracked pose, wrong is 3 cm or 2 degrees off or more; what lies between "
             "is left out. (Tracked poses are accepted by choice of the frames; aligned ones are not.) The curves vary one threshold with the other tests away; the star is all of them in their order, and the black "
             "line is that with a smaller `max_see_through`.", ""]
    lines += recordings(results["made"])
    body = []
    for run in results["runs"]:
        for kind, name in KINDS.items():
            rows = [row for row in run["rows"] if row["kind"] == kind]
            right, wrong = ([row for row in rows if row["label"] == label] for label in ("right", "wrong"))
            body.append((run["name"], name, shares(right), shares(wrong), code(run["command"])))
    lines += table(("recording", "candidate", "right, accepted", "wrong, accepted", "command"), body)
    reasons = {}
    for run in results["runs"]:
        for row in run["rows"]:
            if row["label"] != "between":
                reasons.setdefault(row["verdict"], {"right": 0, "wrong": 0})[row["label"]] += 1
    lines += table(("verdict", "right", "wrong"), [(name, n["right"], n["wrong"]) for name, n in sorted(reasons.items())])
    lines += figure("verdict", "Right against wrong alignments accepted, by threshold")
    return lines
