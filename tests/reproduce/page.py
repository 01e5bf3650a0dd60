"""Pieces of docs/RESULTS.md."""
import math


def millimetres(metres):
    if metres is None or not math.isfinite(metres):
        return "-"
    mm = 1000 * metres
    return f"{mm:.2f} mm" if mm < 1 else f"{mm:.1f} mm" if mm < 100 else f"{mm:.0f} mm"


def percent(share):
    text = f"{100 * share:.1f}"
    return ("100" if text == "100.0" and share >= 1 else "> 99.9" if text == "100.0" else text) + " %"


def degrees(angle):
    return f"{angle:.3f}°" if angle < 0.1 else f"{angle:.2f}°"


def tracked(result):
    return f"{result['tracked']:.0f} of {result['frames']:.0f}"


def complete(result):
    return result["tracked"] == result["frames"]


def code(text):
    return f"`{text}`"


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return lines + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows] + [""]


def figure(name, what):
    return [f"![{what}](results/{name}.png)", ""]


def quantile(values, share):
    """Between the two nearest values."""
    values = sorted(values)
    place = share * (len(values) - 1)
    below = int(place)
    above = min(below + 1, len(values) - 1)
    return values[below] + (place - below) * (values[above] - values[below])


def recordings(made):
    """The commands that made a section's recordings."""
    made = [command for command in made if command]
    return ["Recordings made for this:", "", "```", *made, "```", ""] if made else []


def list_of(words):
    words = list(words)
    return words[0] if len(words) == 1 else ", ".join(words[:-1]) + " and " + words[-1]
