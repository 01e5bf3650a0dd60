"""Figures of the runs, and the table of them."""
from statistics import median

from systems import KINDS, STAGES

WARM = 10  # frames from the first that don't count: caches, first allocations, a model that is still empty


def quantile(values, share):
    """Between the two nearest values, as fathom replay takes it."""
    values = sorted(values)
    place = share * (len(values) - 1)
    below = int(place)
    above = min(below + 1, len(values) - 1)
    return values[below] + (place - below) * (values[above] - values[below])


def figures(run):
    """What is kept of a run: median, 95th percentile and mean of the whole, means of the stages, which add up to it, and
    what isn't time."""
    ms = {stage: values[WARM:] for stage, values in run["ms"].items()}
    kept = {key: value for key, value in run.items() if key != "ms"}
    total = ms["total"]
    return {**kept, "ms_median": median(total) if total else None, "ms_p95": quantile(total, 0.95) if total else None,
            "ms_mean": {stage: sum(values) / len(values) if values else None for stage, values in ms.items()}}


def middle(values):
    values = [value for value in values if value is not None]
    return median(values) if values else None


def summarise(runs, case, system):
    """One row of the table: medians over the pairs, and the ratio to the system it is compared with pair by pair."""
    mine = {run["pair"]: run for run in runs if run["case"] == case and run["system"] == system.name}
    theirs = {run["pair"]: run for run in runs if run["case"] == case and run["system"] == system.against}
    above = {pair: run["ms_p95"] if system.quantity == "p95" else run["ms_median"] for pair, run in mine.items()}
    ratios = [above[pair] / theirs[pair]["ms_median"] for pair in sorted(mine)
              if pair in theirs and above[pair] and theirs[pair]["ms_median"]]
    every = list(mine.values())
    return {"kind": system.kind, "size": case.size, "threads": case.threads, "system": system.name,
            "against": system.against, "quantity": system.quantity, "pairs": len(every),
            "ms_median": middle(run["ms_median"] for run in every), "ms_p95": middle(run["ms_p95"] for run in every),
            "ms_mean": {stage: middle(run["ms_mean"].get(stage) for run in every) for stage in STAGES},
            "resident_mb": middle(run["resident_mb"] for run in every),
            "arena_mb": middle(run.get("arena_mb") for run in every),
            "ate_rmse_m": middle(run["ate_rmse_m"] for run in every),
            "frames": middle(run["frames"] for run in every), "lost": middle(run["lost"] for run in every),
            "cores": middle(run["cores"] for run in every),
            "ratio": {"median": middle(ratios), "least": min(ratios, default=None), "most": max(ratios, default=None)}}


COLUMNS = ("size", "threads", "system", "median", "95 %", "mean", "maps", "track", "alloc", "fuse", "cast", "MB", "ATE cm",
           "lost", "heap", "cores", "ratio")


def number(value, decimals):
    return "-" if value is None else f"{value:.{decimals}f}"


def ratio_text(ratio):
    if ratio["median"] is None:
        return ""
    return f"{ratio['median']:.3f} ({ratio['least']:.3f} to {ratio['most']:.3f})"


def cells(row):
    """A row's figures as text, one a column."""
    ms = row["ms_mean"]
    ate = None if row["ate_rmse_m"] is None else 100 * row["ate_rmse_m"]
    stages = [number(ms[stage], 2) for stage in STAGES if stage != "total"]
    return [row["size"], str(row["threads"]), row["system"], number(row["ms_median"], 1), number(row["ms_p95"], 1),
            number(ms["total"], 1), *stages,
            number(row["resident_mb"], 0), number(ate, 2), number(row["lost"], 0), number(row["heap"], 0),
            number(row["cores"], 2), ratio_text(row["ratio"])]


def of_kind(rows, kind):
    return [row for row in rows if row["kind"] == kind]


def against(rows):
    """What the ratios of rows of a kind are to."""
    return next((row["against"] for row in rows if row["against"]), None)


def text_table(rows):
    """A table for each kind, a blank line between the cases."""
    text = []
    for kind in KINDS:
        chosen = of_kind(rows, kind)
        if not chosen:
            continue
        body = [list(COLUMNS)] + [cells(row) for row in chosen]
        widths = [max(len(line[k]) for line in body) for k in range(len(COLUMNS))]
        other = against(chosen)
        text += ["", f"{kind}" + (f"; ratio: to {other}, a pair at a time" if other else "")]
        last = None
        for line in body:
            if last not in (None, "size") and line[0:2] != last_case:
                text.append("")
            last, last_case = line[0], line[0:2]
            text.append("  ".join(cell.ljust(width) if k in (0, 2, len(COLUMNS) - 1) else cell.rjust(width)
                                  for k, (cell, width) in enumerate(zip(line, widths))).rstrip())
    return text


def summary(head):
    taken = head["frames"]
    return (f"frames: {taken['source']}, the first {taken['count']}; voxel 1 cm; pairs: {head['pairs']}; "
            f"{', '.join(head['others']) or 'no other system'}; {head['seconds']:.0f} s in all")


NOTES = """Milliseconds a frame over a run's frames after the first 10, then the median over the pairs; stages are
means, which add up to the whole one's. Threads: cores that the process is confined to, too. maps: within track for
Open3D. alloc: within fuse for a whole step. MB: most resident memory of the process, less the frames it holds decoded.
heap: calls of malloc, free and their kin a frame, counted in a run of its own; for fathom those from its own code (the
OpenCL runtime makes others). cores: kept busy, over the whole process; with one thread, below 0.9 tells that it was
disturbed. fathom is given the full frame and aligns at the size; the others are given the size. Open3D fuses depth
alone here (with colour it is slower). "All frames" is the whole recording; its ratio is of its 95th percentile to
Open3D's median. Frame to frame: maps and alignment of `fathom replay --against previous --start previous --imu none`.
Given poses: each block of each frame is fused (a step takes turns where the camera has hardly moved).""".split("\n")
