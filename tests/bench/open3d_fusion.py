"""Times Open3D's VoxelBlockGrid alone on a recording, at the poses of groundtruth.txt, in a process of its own.

    python open3d_fusion.py --size 320x240 [--threads N] [--frames N] FOLDER OUT.json

Blocks of 16 voxels and truncation at 8 voxels, as in Open3D's dense SLAM. What open3d_slam.py says of threads and of
decoded frames goes for this one too.
"""
import json
import os
import time

import heap
from open3d_slam import arguments, depth_scale, lines, load


def poses(np, folder, stamps):
    """World to camera at each stamp: the nearest line of groundtruth.txt."""
    truth = np.array([[float(v) for v in f[:8]] for f in lines(os.path.join(folder, "groundtruth.txt"))])
    found = []
    for stamp in stamps:
        x, y, z, w = truth[np.abs(truth[:, 0] - stamp).argmin(), 4:8]
        turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                         [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                         [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = turn, truth[np.abs(truth[:, 0] - stamp).argmin(), 1:4]
        found.append(np.linalg.inv(matrix))
    return found


def run(o3d, images, intrinsics, extrinsics, scale, options):
    """Milliseconds of the choice of blocks, of fusion and of both, frame by frame; heap calls."""
    core = o3d.core
    cpu, matrix = core.Device("CPU:0"), core.Tensor(intrinsics)
    grid = o3d.t.geometry.VoxelBlockGrid(("tsdf", "weight"), (core.float32, core.float32), ((1), (1)), options.voxel,
                                         16, 10000, cpu)
    ms = {"allocate": [], "fuse": [], "total": []}
    calls = heap.Calls()
    for image, extrinsic in zip(images, extrinsics):
        calls.start()
        start = time.perf_counter()
        at = core.Tensor(extrinsic)
        blocks = grid.compute_unique_block_coordinates(image, matrix, at, scale, options.depth_max)
        chosen = time.perf_counter()
        grid.integrate(blocks, image, matrix, at, scale, options.depth_max)
        end = time.perf_counter()
        calls.end()
        for name, seconds in zip(ms, (chosen - start, end - chosen, end - start)):
            ms[name].append(1e3 * seconds)
    return ms, calls.frames


def main():
    options = arguments()
    os.environ["OMP_NUM_THREADS"] = str(options.threads)  # before Open3D is loaded
    import numpy as np
    import open3d as o3d
    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    stamps, images, intrinsics = load(o3d, np, options)
    held_mb = sum(image.rows * image.columns for image in images) * 2 / 2 ** 20
    ms, calls = run(o3d, images, intrinsics, poses(np, options.folder, stamps), depth_scale(options.folder), options)
    with open(options.out, "w", encoding="utf-8") as file:
        json.dump({"version": o3d.__version__, "frames": len(images), "ms": ms, "heap": calls, "held_mb": held_mb,
                   "lost": 0, "ate_rmse_m": None}, file)


if __name__ == "__main__":
    main()
