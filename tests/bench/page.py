"""docs/SPEED.md: the bench's tables as a page."""
import os
import textwrap

import limit
import machine
import report
from systems import KINDS

HEAD = """# Speed

Made by `make bench BENCH=--results` (tests/bench/); the last section is tests/bench/history.md. Everything else here was measured in one run, systems
taking turns; absolute times don't carry over to other machines, ratios do better. Compare within one run only.
"""


def table(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return lines + ["| " + " | ".join(row) + " |" for row in rows] + [""]


def paragraph(lines):
    return [*textwrap.wrap(" ".join(lines), 124, break_on_hyphens=False), ""]


def sentence(text):
    return text[0].upper() + text[1:] + "."


def compared(rows):
    lines = []
    for kind in KINDS:
        chosen = report.of_kind(rows, kind)
        if not chosen:
            continue
        other = report.against(chosen)
        lines += [f"## {kind.capitalize()}", ""]
        lines += [f"Ratio: to {other}, pair by pair: median, and least to most.", ""] if other else []
        lines += table(report.COLUMNS, [report.cells(row) for row in chosen])
    return lines


def limits_text(limits):
    lines = ["## The machine's limit", "", *paragraph(limit.NOTES)] if limits else []
    for found in limits:
        lines += [f"### {found['size']}, {found['threads']} threads", "",
                  *paragraph([sentence(limit.title(found).split(": ", 1)[1])])]
        lines += table(limit.HEAD, limit.rows(found))
    return lines


def history():
    """What was measured while the kernels were made, written by hand in history.md."""
    with open(os.path.join(os.path.dirname(os.path.abspath(__file__)), "history.md"), encoding="utf-8") as file:
        return file.read()


def write(path, described, head, rows, limits):
    lines = [HEAD, *[sentence(line)[:-1] + "  " for line in machine.lines(described)],
             sentence(report.summary(head)), "", *compared(rows), *paragraph(report.NOTES), *limits_text(limits), history()]
    with open(path + ".part", "w", encoding="utf-8") as file:
        file.write("\n".join(lines).rstrip("\n") + "\n")
    os.replace(path + ".part", path)
