"""Figures of the runs, and the table of them."""
from statistics import median

from systems import STAGES

WARM = 10  # frames from the first that don't count: caches, first allocations, a model that is still empty


def quantile(values, share):
    """Between the two nearest values, as fathom replay takes it."""
    values = sorted(values)
    place = share * (len(values) - 1)
    below = int(place)
    above = min(below + 1, len(values) - 1)
    return values[below] + (place - below) * (values[above] - values[below])


def figures(run):
    """What is kept of a run: medians of the stages, the 95th percentile of the step, and what isn't time."""
    ms = {stage: values[WARM:] for stage, values in run["ms"].items()}
    kept = {key: value for key, value in run.items() if key != "ms"}
    return {**kept, "ms_median": {stage: median(values) if values else None for stage, values in ms.items()},
            "ms_p95": quantile(ms["total"], 0.95) if ms["total"] else None}


def middle(values):
    values = [value for value in values if value is not None]
    return median(values) if values else None


def summarise(runs, case, name, against):
    """One row of the table: medians over the pairs, and the ratio to the system called `against` pair by pair."""
    mine = {run["pair"]: run for run in runs if run["case"] == case and run["system"] == name}
    theirs = {run["pair"]: run for run in runs if run["case"] == case and run["system"] == against}
    ratios = [mine[pair]["ms_median"]["total"] / theirs[pair]["ms_median"]["total"] for pair in sorted(mine)
              if name != against and pair in theirs
              and mine[pair]["ms_median"]["total"] and theirs[pair]["ms_median"]["total"]]
    every = list(mine.values())
    return {"size": case.size, "threads": case.threads, "system": name, "pairs": len(every),
            "ms_median": {stage: middle(run["ms_median"].get(stage) for run in every) for stage in STAGES},
            "ms_p95": middle(run["ms_p95"] for run in every),
            "resident_mb": middle(run["resident_mb"] for run in every),
            "arena_mb": middle(run.get("arena_mb") for run in every),
            "ate_rmse_m": middle(run["ate_rmse_m"] for run in every),
            "frames": middle(run["frames"] for run in every), "lost": middle(run["lost"] for run in every),
            "cores": middle(run["cores"] for run in every),
            "ratio": {"median": middle(ratios), "least": min(ratios, default=None), "most": max(ratios, default=None)}}


def number(value, decimals, width):
    return ("-" if value is None else f"{value:.{decimals}f}").rjust(width)


HEAD = (f"{'size':8} {'thr':>3} {'system':18} {'median':>7} {'95 %':>7} | {'maps':>6} {'track':>6} {'fuse':>6} "
        f"{'cast':>6} | {'MB':>5} {'ATE cm':>6} {'lost':>4} {'cores':>5} | of Open3D, a pair at a time")


def row_text(row):
    ms, ratio = row["ms_median"], row["ratio"]
    compared = ""
    if ratio["median"] is not None:
        compared = f"{ratio['median']:.2f} ({ratio['least']:.2f} to {ratio['most']:.2f})"
    ate = None if row["ate_rmse_m"] is None else 100 * row["ate_rmse_m"]
    stages = " ".join(number(ms[stage], 1, 6) for stage in STAGES if stage != "total")
    return (f"{row['size']:8} {row['threads']:3} {row['system']:18} {number(ms['total'], 1, 7)} "
            f"{number(row['ms_p95'], 1, 7)} | {stages} | {number(row['resident_mb'], 0, 5)} {number(ate, 2, 6)} "
            f"{number(row['lost'], 0, 4)} {number(row['cores'], 2, 5)} | {compared}").rstrip()


def table(rows):
    """The rows, a blank line between the cases."""
    text, last = [HEAD, "-" * len(HEAD)], None
    for row in rows:
        case = (row["size"], row["threads"])
        if last not in (None, case):
            text.append("")
        last = case
        text.append(row_text(row))
    return text


NOTES = ("Milliseconds a frame; medians over a run's frames after the first 10, then over the pairs. thr: threads, and",
         "cores the process is confined to. maps: within track for Open3D. MB: most resident memory of the process,",
         "less the frames Open3D holds decoded. fathom is given the full frame and aligns at the size; Open3D is given",
         "the size. Open3D fuses depth alone here (with colour it is slower). cores: kept busy, over the whole process;",
         "with one thread, below 0.9 tells that it was disturbed.")
