"""The peers' filters on a synthetic image, timed on request: python peers.py WIDTH HEIGHT
Reads a line per run: `guided RADIUS`, `bilateral RADIUS` (OpenCV, 2 threads) or `oidn` (Open Image Denoise, Fast, with
albedo and normals). Answers each with the milliseconds of that run."""
import sys, time
import numpy as np

WIDTH, HEIGHT = int(sys.argv[1]), int(sys.argv[2])
y, x = np.mgrid[0:HEIGHT, 0:WIDTH].astype(np.float32)
guide = np.stack([(x // 64 + y // 64) % 2, x / WIDTH, y / HEIGHT], -1).astype(np.float32)
noise = np.random.default_rng(1).exponential(0.2, guide.shape)
source = (guide * 0.8 + 0.1 + noise).astype(np.float32)
normal = np.where((guide[..., :1] > 0), [0.0, 0.6, 0.8], [0.0, 0.0, 1.0]).astype(np.float32)
albedo = np.full_like(source, 0.5)


def opencv():
    import cv2

    cv2.setNumThreads(2)
    return cv2.ximgproc


def oidn():
    import mitsuba as mi

    mi.set_variant("scalar_rgb")
    import mitsuba_oidn

    return lambda: mitsuba_oidn.denoise(source, albedo, normal, hdr=True, quality=mitsuba_oidn.Quality.Fast)


def run(name, radius):
    if name == "guided":
        filters = opencv()
        return lambda: filters.guidedFilter(guide, source, radius, 0.01)
    if name == "bilateral":
        filters = opencv()
        return lambda: filters.jointBilateralFilter(guide, source, 2 * radius + 1, 0.1, radius / 2)
    return oidn()


runs = {}
for line in sys.stdin:
    words = line.split()
    if line not in runs:
        runs[line] = run(words[0], int(words[1]) if len(words) > 1 else 0)
    start = time.perf_counter()
    runs[line]()
    print(1e3 * (time.perf_counter() - start), flush=True)
