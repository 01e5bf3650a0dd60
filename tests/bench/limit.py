"""Kernels beside the machine's limit: runs tests/bench/limit.c for each case, and makes text of what it finds."""
import json
import os

from systems import VOXEL, Failed, measure, tool

MOST = 60  # frames: medians don't change with more

HEAD = ("kernel", "a frame", "MB", "M operations", "ms moved", "ms done", "bound by", "ms in a step", "times the limit",
        "ms cold", "times the limit")


def measure_case(build, case, folder, frames):
    out = os.path.join(build, "bench", "limit.json")
    measure([tool(build, "limit"), folder, "--frames", str(min(frames, MOST)), "--size", case.size, "--threads",
             str(case.threads), "--voxel", VOXEL, "--json", out], case.threads)
    with open(out, encoding="utf-8") as file:
        return {"size": case.size, "threads": case.threads, **json.load(file)}


def measure_limits(build, cases, folder, frames, log):
    found = []
    for case in cases:
        log(f"the machine's limit: {case.size}, {case.threads} threads")
        try:
            found.append(measure_case(build, case, folder, frames))
        except Failed as failure:
            log(f"the limit left out: {failure}")
    return found


def title(found):
    m = found["machine"]
    return (f"{found['size']}, {found['threads']} threads: read {m['read_gb_s']:.1f}, write {m['write_gb_s']:.1f}, copy "
            f"{m['copy_gb_s']:.1f} GB/s; fused multiply-adds: float8 {m['fma8_g_s']:.0f}, float16 {m['fma16_g_s']:.0f} G/s; "
            f"an empty kernel and a wait {1e3 * m['launch_ms']:.1f} us, one of twenty queued {1e3 * m['queued_ms']:.1f} us")


def number(value, decimals):
    return "-" if value is None else f"{value:.{decimals}f}"


def over(value, limit):
    return None if value is None or not limit else value / limit


def rows(found):
    """A row of text a kernel."""
    table = []
    for k in found["kernels"]:
        limit = None if k["ms_moved"] is None else max(k["ms_moved"], k["ms_done"])
        bound = "-" if limit is None else "bandwidth" if k["ms_moved"] > k["ms_done"] else "operations"
        table.append([k["kernel"], number(k["launches_a_frame"], 2), number(limit and 1e-6 * k["bytes"], 3),
                      number(limit and 1e-6 * k["operations"], 2), number(k["ms_moved"], 3), number(k["ms_done"], 3), bound,
                      number(k["ms_in_step"], 3), number(over(k["ms_in_step"], limit), 1), number(k["ms_cold"], 3),
                      number(over(k["ms_cold"], limit), 1)])
        if k["ms_warm"] is not None:
            table.append([k["kernel"] + ", again and again", "", "", "", "", "", "operations", number(k["ms_warm"], 3),
                          number(over(k["ms_warm"], k["ms_done"]), 1), "", ""])
    return table


def text(limits):
    lines = []
    for found in limits:
        body = [list(HEAD)] + rows(found)
        widths = [max(len(line[k]) for line in body) for k in range(len(HEAD))]
        lines.append(title(found))
        lines += ["  ".join(cell.ljust(width) if k in (0, 6) else cell.rjust(width)
                            for k, (cell, width) in enumerate(zip(line, widths))).rstrip() for line in body]
        lines.append("")
    return lines + NOTES if lines else lines


NOTES = """The limit is the longer of two times: for the bytes that a kernel must at least move once (at the bandwidth
of streams through buffers larger than the caches), and for the operations that it must at least do (at the rate of
fused multiply-adds; an operation is one lane's, a fused multiply-add is one). Both are counted from each frame's data
(tests/bench/stage_work.c); align_reduce counts its sums alone, neither projection nor gather; ray-casts count one step
a ray and the voxels about what it met. Times are the device's own, without the launch. Cold: the caches were
flushed before. Again and again: everything is in the caches, so only the operations bound it.""".split("\n")
