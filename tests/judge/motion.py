"""What a trajectory's motion is worth: its error over a second, that error in units of what was reported, and wrong poses.

A window reaches from a frame back to the last one that is at least a second older, as span_* of --stats does. Its error is
what turns the true motion into the estimated one, in the present camera's axes. Everything here compares motions, never
places, so nothing has to be aligned, and drift that nobody can help doesn't hide a slide."""
import os

import numpy as np

import evaluate

SPAN_S = 1.0
SLACK_S = 1e-4                # stamps are rounded
SPAN_SIGMAS = [f"span_sigma_{axis}" for axis in ("x_m", "y_m", "z_m", "rx_deg", "ry_deg", "rz_deg")]
FUSED = ("first", "tracked")
LONGEST_GAP_S = 0.25          # between two lines of the truth that a pose may be interpolated from
SAME_S = 0.001                # stamps that differ by less are the same


class Truth:
    """rows: TUM lines. exact: simulated or measured far better than fathom's errors. The reference's own error over a
    second, metres and degrees, or as a share of the way."""

    def __init__(self, rows, exact, sigma_m=0.0, sigma_deg=0.0, sigma_way=0.0):
        self.rows, self.exact = rows, exact
        self.sigma_m, self.sigma_deg, self.sigma_way = sigma_m, sigma_deg, sigma_way
        self.wrong_m, self.wrong_deg = (0.03, 2.0) if exact else (0.1, 5.0)

    def limits(self):
        return self.wrong_m, self.wrong_deg, self.sigma_m, self.sigma_deg, self.sigma_way


def read_truth(folder):
    """TUM lines of a recording's groundtruth.txt, or of a Stray Scanner folder's odometry.csv; None without either."""
    path = os.path.join(folder, "groundtruth.txt")
    if os.path.exists(path):
        return evaluate.read_trajectory(path)
    path = os.path.join(folder, "odometry.csv")
    if os.path.exists(path):
        return np.loadtxt(path, delimiter=",", skiprows=1, ndmin=2)[:, [0, 2, 3, 4, 5, 6, 7, 8]]
    return None


def at(rows, stamps):
    """Positions and rotations at the stamps, between the two nearest lines; and where there are such lines."""
    after = np.clip(np.searchsorted(rows[:, 0], stamps), 1, len(rows) - 1)
    a, b = rows[after - 1], rows[after]
    gap = np.maximum(b[:, 0] - a[:, 0], 1e-9)
    share = np.clip((stamps - a[:, 0]) / gap, 0, 1)
    between = (a[:, 0] <= stamps) & (stamps <= b[:, 0]) & (gap <= LONGEST_GAP_S)
    there = between | (np.minimum(np.abs(stamps - a[:, 0]), np.abs(stamps - b[:, 0])) <= SAME_S)
    share = np.where(between, share, np.round(share))[:, None]
    turn = np.where((a[:, 4:] * b[:, 4:]).sum(1, keepdims=True) < 0, -b[:, 4:], b[:, 4:])
    q = a[:, 4:] * (1 - share) + turn * share  # lines are close: as good as on the sphere
    return (a[:, 1:4] * (1 - share) + b[:, 1:4] * share,
            evaluate.rotations(q / np.linalg.norm(q, axis=1, keepdims=True)), there)


def rotation_vectors(r):
    """Radians; exact up to half a turn."""
    axis = np.stack([r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]], axis=1) / 2
    sine = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(sine, (np.trace(r, axis1=1, axis2=2) - 1) / 2)
    scale = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-9), 1.0)
    flat = (sine <= 1e-9) & (angle > 1)  # half a turn: about an axis that doesn't matter
    return np.where(flat[:, None], [np.pi, 0, 0], axis * scale[:, None])


def relative(positions, turns, a, b):
    """Motions from poses a to poses b: inv(M_a) M_b."""
    back = turns[a].transpose(0, 2, 1)
    return np.einsum("nij,nj->ni", back, positions[b] - positions[a]), back @ turns[b]


def errors(estimate, truth, a, b):
    """Six columns: metres along and degrees about the axes of camera b, by which the estimated motion differs."""
    p, r = relative(*estimate, a, b)
    q, s = relative(*truth, a, b)
    back = s.transpose(0, 2, 1)
    return np.hstack([np.einsum("nij,nj->ni", back, p - q), np.degrees(rotation_vectors(back @ r))])


def windows(stamps):
    """Pairs: the last frame at least a second back, and the frame."""
    first = np.searchsorted(stamps, stamps - SPAN_S + SLACK_S, side="right") - 1
    frames = np.flatnonzero(first >= 0)
    return first[frames], frames


def wrong_frames(estimate, truth, known, states, limits):
    """Frames fused although they lie wrong relative to the frame fused before them."""
    fused = np.flatnonzero(np.isin(states, FUSED) & known)
    if len(fused) < 2:
        return np.array([], int)
    e = errors(estimate, truth, fused[:-1], fused[1:])
    bad = (np.linalg.norm(e[:, :3], axis=1) > limits.wrong_m) | (np.linalg.norm(e[:, 3:], axis=1) > limits.wrong_deg)
    return fused[1:][bad]


def consistency(error, stats, frames, way, truth):
    """Mean of the error squared in units of the reported variance, six degrees of freedom, over its expectation (1 is
    right, above is too sure); the share of windows that lie within 3 sigma along all six."""
    if not set(SPAN_SIGMAS) <= set(stats):
        return None, None
    sigma = np.stack([stats[name][frames] for name in SPAN_SIGMAS], axis=1)
    own = np.concatenate([np.repeat(np.hypot(truth.sigma_m, truth.sigma_way * way)[:, None], 3, 1),
                          np.full((len(way), 3), truth.sigma_deg)], axis=1)
    given = np.isfinite(sigma).all(1) & (sigma > 0).all(1)
    if not given.any():
        return None, None
    units = (error / np.hypot(sigma, own))[given]
    return float((units ** 2).sum(1).mean() / 6), float((np.abs(units) <= 3).all(1).mean())


def judge(trajectory, states, stats, truth):
    """trajectory: TUM lines of all frames; states: of each; stats: columns of --stats by name. A dict of figures, None where
    there is nothing to say; window_at is the last frame of the worst window, wrong_at the first twenty wrong ones."""
    figures = dict.fromkeys(("window_mm", "window_deg", "nees", "within_3"))
    figures.update(wrong=0, wrong_at=[], windows=0, window_at=None)
    if truth is None:
        return figures
    estimate = trajectory[:, 1:4], evaluate.rotations(trajectory[:, 4:])
    *true, known = at(truth.rows, trajectory[:, 0])
    wrong = wrong_frames(estimate, true, known, states, truth)
    figures.update(wrong=len(wrong), wrong_at=[int(i) for i in wrong[:20]])
    a, b = windows(trajectory[:, 0])
    both = known[a] & known[b]
    a, b = a[both], b[both]
    if not len(a):
        return figures
    error = errors(estimate, true, a, b)
    way = np.linalg.norm(relative(*true, a, b)[0], axis=1)
    figures["nees"], figures["within_3"] = consistency(error, stats, b, way, truth)
    unsure = np.concatenate([[0], np.cumsum(~np.isin(states, FUSED))])
    whole = unsure[b + 1] == unsure[a]
    figures["windows"] = int(whole.sum())
    if whole.any():
        away, turned = (np.linalg.norm(part, axis=1) for part in np.hsplit(error[whole], 2))
        figures.update(window_mm=float(1000 * away.max()), window_deg=float(turned.max()),
                       window_at=int(b[whole][away.argmax()]))
    return figures
