"""Meshes: reading them, and how far one lies from another."""
import itertools

import numpy as np

REACH_M = 0.03    # beyond, there is no counterpart
SAMPLE = 20000    # points that stand for a mesh; drawn with a fixed seed


def read_ply(path):
    """Vertices and normals of a PLY written by `fathom replay --mesh`."""
    with open(path, "rb") as file:
        count = 0
        for line in iter(lambda: file.readline().decode("ascii").split(), ["end_header"]):
            if line[:2] == ["element", "vertex"]:
                count = int(line[2])
        data = np.fromfile(file, "<f4", 6 * count).reshape(-1, 6).astype(float)
    return data[:, :3], data[:, 3:]


def sample(points, count=SAMPLE):
    if len(points) <= count:
        return points
    return points[np.sort(np.random.default_rng(1).choice(len(points), count, replace=False))]


def _keys(cells):
    cells = cells.astype(np.int64) + (1 << 20)
    return cells[:, 0] << 42 | cells[:, 1] << 21 | cells[:, 2]


def nearest(points, others, reach=REACH_M):
    """For each point the index of the nearest of the others, and the distance; -1 and inf beyond the reach."""
    best, index = np.full(len(points), np.inf), np.full(len(points), -1)
    if not len(points) or not len(others):
        return index, best
    keys = _keys(np.floor(others / reach))
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    cells = np.floor(points / reach)
    for step in itertools.product((-1, 0, 1), repeat=3):
        wanted = _keys(cells + step)
        start, end = np.searchsorted(keys, wanted, "left"), np.searchsorted(keys, wanted, "right")
        active = np.flatnonzero(start < end)
        while len(active):
            candidate = order[start[active]]
            distance = np.linalg.norm(points[active] - others[candidate], axis=1)
            closer = distance < best[active]
            best[active[closer]], index[active[closer]] = distance[closer], candidate[closer]
            start[active] += 1
            active = active[start[active] < end[active]]
    index[best > reach] = -1
    best[best > reach] = np.inf
    return index, best


def compare(mesh, reference):
    """How a mesh lies to a reference mesh in the same frame: its corners' distance to the reference's surface (to the plane
    through the nearest corner), and the share of the reference that it has (a corner within 2 cm)."""
    points = sample(mesh[0])
    index, _ = nearest(points, reference[0])
    there = index >= 0
    planes = np.abs(((points[there] - reference[0][index[there]]) * reference[1][index[there]]).sum(1))
    distances = np.full(len(points), np.inf)
    distances[there] = planes
    wanted = sample(reference[0])
    _, back = nearest(wanted, mesh[0])
    return {"median_m": float(np.median(distances)) if len(points) else float("inf"),
            "astray": float(1 - there.mean()) if len(points) else 1.0,
            "covered": float((back <= 0.02).mean()) if len(wanted) else 0.0}
