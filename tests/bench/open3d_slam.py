"""Times Open3D's dense SLAM model on a recording, in a process of its own.

    python open3d_slam.py --size 320x240 [--threads N] [--frames N] FOLDER OUT.json     (OUT.json: see main)

The same work as fathom's step: each frame is tracked against the ray-cast model (from the second on) and fused, and
the model is ray-cast for the next. What isn't given below stays at Open3D's own default (point to plane; 6, 3, 1
iterations; truncation at 8 voxels). Depth alone: without colour Open3D does less. Frames are decoded, and for a smaller
size thinned to every Nth pixel, before anything is timed (fathom's own step starts from the full frame).

Open3D takes its threads from TBB since 0.20 and from OpenMP before. TBB looks at the cores that the process may use, so
whoever calls this confines the process to as many cores as it is to have threads; OMP_NUM_THREADS is set here too.
"""
import argparse
import json
import os
import sys
import time

import heap

STAGES = ("track", "fuse", "raycast")


def arguments():
    parser = argparse.ArgumentParser()
    parser.add_argument("folder")
    parser.add_argument("out")
    parser.add_argument("--size", default="640x480")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--frames", type=int, default=0, help="0: all")
    parser.add_argument("--voxel", type=float, default=0.01)
    parser.add_argument("--depth-min", type=float, default=0.3)
    parser.add_argument("--depth-max", type=float, default=5.0)
    return parser.parse_args()


def lines(path):
    """The fields of each line that isn't a comment."""
    with open(path, encoding="utf-8") as file:
        return [line.split() for line in file if line.strip() and not line.startswith("#")]


def depth_scale(folder):
    path = os.path.join(folder, "rig.txt")
    scales = [float(f[1]) for f in lines(path) if f[0] == "depth_scale"] if os.path.exists(path) else []
    return scales[0] if scales else 5000.0


def load(o3d, np, options):
    """Stamps, depth images in Open3D's form at the size asked for, and the intrinsic matrix that belongs to it."""
    folder = options.folder
    width, height = (int(n) for n in options.size.split("x"))
    listed = lines(os.path.join(folder, "depth.txt"))
    if options.frames:
        listed = listed[:options.frames]
    images, step = [], 1
    for _, name in listed:
        pixels = o3d.t.io.read_image(os.path.join(folder, name)).as_tensor().numpy()
        pixels = pixels.reshape(pixels.shape[0], pixels.shape[1])
        step = pixels.shape[1] // width
        if step < 1 or (pixels.shape[1], pixels.shape[0]) != (step * width, step * height):
            sys.exit(f"{name}: {pixels.shape[1]}x{pixels.shape[0]} isn't a whole number times {options.size}")
        thinned = pixels[::step, ::step].copy()
        thinned[thinned == 65535] = 0
        images.append(o3d.t.geometry.Image(o3d.core.Tensor(thinned[:, :, None])))
    fx, fy, cx, cy = (float(v) / step for v in lines(os.path.join(folder, "calibration.txt"))[0][:4])
    intrinsics = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    return [float(f[0]) for f in listed], images, intrinsics


def run(o3d, np, images, intrinsics, scale, options):
    """Poses (camera to world), milliseconds of each stage and of the whole step, and heap calls, frame by frame."""
    cpu = o3d.core.Device("CPU:0")
    slam = o3d.t.pipelines.slam
    matrix = o3d.core.Tensor(intrinsics)
    pose = o3d.core.Tensor.eye(4, o3d.core.float64, cpu)
    model = slam.Model(options.voxel, 16, 10000, pose, cpu)
    height, width = images[0].rows, images[0].columns
    scan, cast = slam.Frame(height, width, matrix, cpu), slam.Frame(height, width, matrix, cpu)
    scan.set_data("color", o3d.core.Tensor(np.zeros((0, 0, 3), np.uint8)))  # no pixels: Open3D then fuses depth alone
    ms = {name: [] for name in STAGES + ("total",)}
    poses, lost = [], None
    calls = heap.Calls()
    for i, image in enumerate(images):
        calls.start()
        start = time.perf_counter()
        scan.set_data_from_image("depth", image)
        if i > 0:
            try:
                found = model.track_frame_to_model(scan, cast, scale, options.depth_max)
                pose = pose @ found.transformation
            except RuntimeError as error:  # a singular system: it's lost
                lost = lost or f"frame {i}: {str(error).strip().splitlines()[-1]}"
                break
        tracked = time.perf_counter()
        model.update_frame_pose(i, pose)
        model.integrate(scan, scale, options.depth_max)
        fused = time.perf_counter()
        model.synthesize_model_frame(cast, scale, options.depth_min, options.depth_max)
        end = time.perf_counter()
        calls.end()
        for name, seconds in zip(ms, (tracked - start, fused - tracked, end - fused, end - start)):
            ms[name].append(1e3 * seconds)
        poses.append(pose.numpy().copy())
    return poses, ms, lost, calls.frames


def ate(np, stamps, poses, folder):
    """Root mean square distance from the true path after the best rigid alignment (Horn), as fathom replay takes it."""
    path = os.path.join(folder, "groundtruth.txt")
    if not os.path.exists(path) or len(poses) < 3:
        return None
    truth = np.array([[float(v) for v in f[:4]] for f in lines(path)])
    keep = [i for i, t in enumerate(stamps[:len(poses)]) if truth[0, 0] - 1e-3 <= t <= truth[-1, 0] + 1e-3]
    at = np.array([stamps[i] for i in keep])
    true = np.stack([np.interp(at, truth[:, 0], truth[:, k]) for k in (1, 2, 3)], 1)
    found = np.array([poses[i][:3, 3] for i in keep])
    true, found = true - true.mean(0), found - found.mean(0)
    u, _, vt = np.linalg.svd(true.T @ found)
    turn = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
    return float(np.sqrt(((true - found @ turn.T) ** 2).sum(1).mean()))


def main():
    options = arguments()
    os.environ["OMP_NUM_THREADS"] = str(options.threads)  # before Open3D is loaded
    import numpy as np
    import open3d as o3d
    o3d.utility.set_verbosity_level(o3d.utility.VerbosityLevel.Error)
    stamps, images, intrinsics = load(o3d, np, options)
    held_mb = sum(image.rows * image.columns for image in images) * 2 / 2 ** 20
    poses, ms, lost, calls = run(o3d, np, images, intrinsics, depth_scale(options.folder), options)
    with open(options.out, "w", encoding="utf-8") as file:
        json.dump({"version": o3d.__version__, "frames": len(poses), "lost": lost, "ms": ms, "heap": calls,
                   "held_mb": held_mb, "ate_rmse_m": ate(np, stamps, poses, options.folder)},
                  file)


if __name__ == "__main__":
    main()
