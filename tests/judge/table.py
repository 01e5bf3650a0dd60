"""The table of cases, its record, and what differs between the two."""
import math
import statistics

# Of MEASURE: the median of the starts may be worse by 3 % or 0.3 mm, 1 % fewer frames tracked and right; all cases together by
# 1 % and 0.2 %. A case of one start has no median: three times as much, as five starts of one case spread.
SHARE, LEAST_MM, FEWER = 0.03, 0.3, 0.01
ONE_START = 3
MEAN, FEWER_ALL = 0.01, 0.002

COLUMNS = ("case", "runs", "frames", "tracked", "reckoned", "lost", "wrong", "ate_mm", "window_mm", "window_deg", "worst_mm",
           "nees", "within_3")
COUNTS = COLUMNS[1:7]
SHOWN = ("tracked", "frames", "wrong", "ate_mm", "window_mm")  # where a line has no room for all
DIGITS = {"ate_mm": 2, "window_mm": 1, "window_deg": 2, "worst_mm": 1, "nees": 2, "within_3": 3}


def middle(values):
    values = [value for value in values if value is not None]
    return statistics.median(values) if values else None


def summed(name, results):
    """A case of these runs: counts summed; of errors the median, and the worst window."""
    case = {"case": name, "runs": len(results)}
    for count in COUNTS[1:]:
        case[count] = sum(result[count] for result in results)
    for error in ("ate_mm", "window_mm", "window_deg", "nees", "within_3"):
        case[error] = middle(result[error] for result in results)
    case["worst_mm"] = max((result["window_mm"] for result in results if result["window_mm"] is not None), default=None)
    # as it is written, so that what is compared is what is recorded
    return {key: value if value is None or key not in DIGITS else round(value, DIGITS[key]) for key, value in case.items()}


def cell(name, value):
    if value is None or isinstance(value, float) and math.isnan(value):
        return "-"
    return f"{value:.{DIGITS[name]}f}" if name in DIGITS else str(value)


def text(cases):
    """Aligned columns, a line a case."""
    rows = [COLUMNS] + [[cell(name, case[name]) for name in COLUMNS] for case in cases]
    wide = [max(len(row[i]) for row in rows) for i in range(len(COLUMNS))]
    return ["  ".join([row[0].ljust(wide[0])] + [value.rjust(width) for value, width in zip(row[1:], wide[1:])])
            for row in rows]


def read(path):
    """A recorded table: cases by name."""
    cases = {}
    with open(path) as file:
        rows = [line.split() for line in file if line.strip() and not line.startswith("#")]
    for row in rows[1:]:
        case = dict(zip(rows[0], row))
        for name in COLUMNS[1:]:
            value = case.get(name, "-")
            case[name] = None if value == "-" else int(value) if name in COUNTS else float(value)
        cases[case["case"]] = case
    return cases


def right(case):
    return case["tracked"] - case["wrong"]


def changes(now, before, loosely=False):
    """What of a case is beyond the margins: (better or worse, words). loosely: as if it had one start."""
    found = []
    wider = 1 if now["runs"] > 1 and not loosely else ONE_START

    def compare(what, new, old, margin, unit, less_is_better=True):
        if new is None or old is None:
            if new is not old:
                new, old = ("-" if value is None else value for value in (new, old))
                found.append(("worse" if new == "-" else "better", f"{what} {new} (was {old})"))
        elif abs(new - old) > margin + 1e-9:
            better = (new < old) == less_is_better
            found.append(("better" if better else "worse", f"{what} {new:g}{unit} (was {old:g})"))

    if now["frames"] != before["frames"]:
        found.append(("other", f"{now['frames']} frames (was {before['frames']})"))
    for name, what in (("ate_mm", "error"), ("window_mm", "error over 1 s")):
        compare(what, now[name], before[name], wider * max(LEAST_MM, SHARE * (before[name] or 0)), " mm")
    compare("tracked and right", right(now), right(before), wider * FEWER * right(before), "", less_is_better=False)
    compare("wrong poses", now["wrong"], before["wrong"], 0, "")
    return found


def totals(cases):
    return {count: sum(case[count] for case in cases) for count in COUNTS}


def overall(pairs):
    """Of all cases, now and before: (better or worse, words) beyond the margins. The mean is of ratios, so that a case that is
    lost by metres doesn't outweigh all others, and below a millimetre nothing counts."""
    found = []
    ratios = [math.log(max(now["ate_mm"], 1) / max(before["ate_mm"], 1)) for now, before in pairs
              if now["ate_mm"] is not None and before["ate_mm"] is not None]
    if ratios:
        mean = math.exp(sum(ratios) / len(ratios)) - 1
        if abs(mean) > MEAN:
            found.append(("worse" if mean > 0 else "better", f"mean error {100 * mean:+.1f} %"))
    new, old = (sum(right(pair[i]) for pair in pairs) for i in (0, 1))
    if abs(new - old) > FEWER_ALL * old:
        found.append(("worse" if new < old else "better", f"{new} frames tracked and right (was {old})"))
    return found
