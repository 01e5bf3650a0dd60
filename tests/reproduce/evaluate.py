"""Errors of trajectories. A trajectory is an array of lines t tx ty tz qx qy qz qw (TUM), camera to world."""
import numpy as np


def read_trajectory(path):
    return np.loadtxt(path, comments="#", ndmin=2)


def rotations(quaternions):
    x, y, z, w = quaternions.T
    return np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
                     2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                     2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1).reshape(-1, 3, 3)


def matched(estimate, truth):
    """The truth at the estimate's stamps: the nearest line, at most 20 ms away."""
    place = np.clip(np.searchsorted(truth[:, 0], estimate[:, 0]), 1, len(truth) - 1)
    place -= estimate[:, 0] - truth[place - 1, 0] < truth[place, 0] - estimate[:, 0]
    near = np.abs(truth[place, 0] - estimate[:, 0]) <= 0.02
    return estimate[near], truth[place[near]]


def ate(estimate, truth):
    """Root mean square distance, metres, after the rigid alignment that makes it least (Horn 1987; by SVD)."""
    a, b = matched(estimate, truth)
    if len(a) < 3:
        return float("nan")
    a, b = a[:, 1:4] - a[:, 1:4].mean(0), b[:, 1:4] - b[:, 1:4].mean(0)
    u, _, v = np.linalg.svd(b.T @ a)
    turn = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ v))]) @ v
    return float(np.sqrt(((b - a @ turn.T) ** 2).sum(1).mean()))


def position_errors(estimate, truth):
    """Metres, frame by frame, with the first poses laid on each other: what a scan that started right has strayed."""
    a, b = matched(estimate, truth)
    first_a, first_b = rotations(a[:1, 4:])[0], rotations(b[:1, 4:])[0]
    own = (a[:, 1:4] - a[0, 1:4]) @ first_a
    true = (b[:, 1:4] - b[0, 1:4]) @ first_b
    return np.linalg.norm(own - true, axis=1)
