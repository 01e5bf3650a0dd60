"""Compares ranges and defaults in the comments of fathom.h's fathom_config with `fathom info --settings` on stdin: says what
differs and exits 1. Usage: fathom info --settings | python3 settings_header.py lib/fathom.h"""
import re
import sys

NUMBER = r"[+-]?\d+(?:\.\d+)?(?:e[+-]?\d+)?"


def fields(header):
    """Names and comment of each declaration: the comment stands above it, or behind it."""
    body = header[header.index("/* All settings."):header.index("} fathom_config;")]
    body = body[body.index("{") + 1:]
    above = ""
    for comment, code in re.findall(r"/\*(.*?)\*/|([^/]+)", body, re.S):
        if comment:
            above = " ".join(comment.replace("\n", " ").replace(" * ", " ").split())
            if declared and not fresh_line:
                yield declared, above
                declared, above = [], ""
            continue
        declared = []
        for line in code.split(";")[:-1]:
            if declared and above:
                yield declared, above
                above = ""
            names = re.sub(r"^.*?\w+ (?=[*\w])", "", line.strip().replace("const ", ""), count=1, flags=re.S)
            declared = [re.sub(r"\[.*|[*\s]", "", name) for name in names.split(",")]
        fresh_line = "\n" in code.rsplit(";", 1)[-1]
        if declared and fresh_line and above:
            yield declared, above
            declared, above = [], ""


def default_of(comment):
    """The default's numbers or word."""
    found = re.search(r"[Dd]efault (.*)", comment)
    if not found:
        return None
    text = re.split(r"[:;(.](?:\s|$)", found[1])[0]
    word = re.match(r"FATHOM_\w+_([A-Z]+)|(true|false|NULL)", text)
    if word:
        return [word[1].lower() if word[1] else {"true": "on", "false": "off", "NULL": "default"}[word[2]]]
    return [float(n) for n in re.findall(NUMBER, text)] or None


def same(a, b):
    try:
        return abs(float(a) - float(b)) < 1e-9 * max(1, abs(float(b)))
    except ValueError:
        return a == b


def main():
    rows = [line.split(None, 4) for line in sys.stdin][1:]
    wrong, compared = [], 0
    for names, comment in fields(open(sys.argv[1], encoding="utf-8").read()):
        mine = [r for n in names for r in rows if re.match(re.escape(n) + r"(?![\w])", r[0])]
        default = default_of(comment)
        if not mine or "." in mine[0][0]:
            continue
        if default and len(default) == len(mine):
            compared += 1
            wrong += [f"{r[0]}: default {r[3]} in the table, {d} in the header" for r, d in zip(mine, default) if not same(r[3], d)]
        low_high = re.search(rf"({NUMBER})\.\.({NUMBER})", comment)
        if low_high and ".." in mine[0][2]:
            compared += 1
            low, high = mine[0][2].split(",")[-1].split("..")
            if not (same(low, low_high[1]) and same(high, low_high[2])):
                wrong.append(f"{mine[0][0]}: range {mine[0][2]} in the table, {low_high[0]} in the header")
    print("\n".join(wrong + [f"{compared} compared"]))
    return 1 if wrong or compared < 80 else 0


sys.exit(main())
