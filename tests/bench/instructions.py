"""Sums a callgrind profile by stage, and compares it with the record; instructions.sh runs it.

    python3 instructions.py PROFILE RECORD TOOLCHAIN [--update|--check]

A stage is a kernel with what it calls (PoCL compiles each into an object of its own), a file of the library, Eigen's
functions that aren't inlined, or the runtime: all other objects. The record has a section for each toolchain; stages of
less than a thousandth of all are put together, for a change there means little.
"""
import os
import re
import sys

GROWTH = 0.10  # that a stage may grow by
LEAST = 0.001  # of all: a stage by itself


def stage_of(obj, file):
    if obj.endswith(".so") and "/instructions/pocl/" in obj:
        return "kernel " + os.path.splitext(os.path.basename(obj))[0]
    if os.path.basename(obj) != "fathom":
        return "runtime"
    if "Eigen" in file or "/include/" in file:
        return "host Eigen"
    return "host " + os.path.splitext(os.path.basename(file))[0]


def profile(path):
    """Instructions by stage: what functions spend themselves (https://valgrind.org/docs/manual/cl-format.html)."""
    names, counts = {}, {}
    obj = file = ""
    after_call = False

    def name(kind, text):  # "(3) text" names 3, "(3)" means it
        number, rest = re.fullmatch(r"(\(\d+\))\s*(.*)", text).groups()
        if rest:
            names[kind, number] = rest
        return names[kind, number]

    with open(path, encoding="utf-8") as lines:
        for line in lines:
            key, equals, value = line.rstrip("\n").partition("=")
            if equals and key in ("ob", "cob"):
                named = name("ob", value)
                obj = named if key == "ob" else obj
            elif equals and key in ("fl", "fi", "fe", "cfi", "cfl"):
                named = name("fl", value)
                file = named if key == "fl" else file  # of the function, also where others are inlined in it
            elif key == "calls":
                after_call = True  # the next line is what the called function spent
            elif line[0].isdigit() or line[0] in "+-*":
                if not after_call:
                    stage = stage_of(obj, file)
                    counts[stage] = counts.get(stage, 0) + int(line.split()[-1])
                after_call = False
    return counts


def put_together(counts):
    least = LEAST * sum(counts.values())
    kept = {stage: count for stage, count in counts.items() if count >= least}
    rest = sum(counts.values()) - sum(kept.values())
    return dict(sorted(kept.items(), key=lambda item: -item[1])) | {"the rest": rest}


def read_record(path):
    """{toolchain: {stage: count}}"""
    record, section = {}, None
    if os.path.exists(path):
        with open(path, encoding="utf-8") as lines:
            for line in lines:
                text = line.strip()
                if text.startswith("["):
                    section = record.setdefault(text.strip("[]"), {})
                elif text and not text.startswith("#"):
                    count, stage = text.split(None, 1)
                    section[stage] = int(count)
    return record


def write_record(path, record):
    with open(path + ".part", "w", encoding="utf-8") as file:
        file.write("# Instructions by stage, a section for each toolchain; written by make instructions, held by\n"
                   "# tests/e2e/instructions.sh: a stage that grows by more than a tenth needs a new record.\n")
        for toolchain, counts in record.items():
            file.write(f"\n[{toolchain}]\n")
            file.writelines(f"{count:12} {stage}\n" for stage, count in counts.items())
    os.replace(path + ".part", path)


def check(counts, recorded):
    """TAP, a line a stage of the record and one for what is new. True when nothing has grown."""
    good, number = True, 0
    for stage, before in recorded.items():
        number += 1
        now = counts.get(stage, 0)
        grown = now > (1 + GROWTH) * before
        good = good and not grown
        print(f"{'not ok' if grown else 'ok'} {number} - {stage}: {now} instructions, {before} recorded"
              + (f" (by {100 * (now / before - 1):+.1f} %)" if before else ""))
        if now < (1 - GROWTH) * before:
            print("#   fallen: make instructions would hold that")
    new = [stage for stage in counts if stage not in recorded]
    print(f"{'not ok' if new else 'ok'} {number + 1} - no stage that isn't recorded" + "".join(f", {s}" for s in new))
    return good and not new


def main():
    path, record_path, toolchain = sys.argv[1:4]
    mode = sys.argv[4] if len(sys.argv) > 4 else ""
    raw = profile(path)
    record = read_record(record_path)
    if mode == "--check":
        if toolchain not in record:
            print(f"ok 1 - instruction counts # SKIP no record for {toolchain}")
            return 0
        recorded = record[toolchain]
        # small stages are those that the record doesn't name
        counts = {stage: raw.get(stage, 0) for stage in recorded if stage != "the rest"}
        known = sum(counts.values())
        large = LEAST * 2 * sum(raw.values())
        counts |= {stage: count for stage, count in raw.items() if stage not in recorded and count >= large}
        counts["the rest"] = sum(raw.values()) - sum(counts.values())
        if not known:
            print("not ok 1 - instruction counts: the profile has none of the recorded stages")
            return 1
        return 0 if check(counts, recorded) else 1
    counts = put_together(raw)
    if mode == "--update":
        record[toolchain] = counts
        write_record(record_path, record)
    print(f"[{toolchain}]")
    for stage, count in counts.items():
        print(f"{count:12} {stage}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
