#!/usr/bin/env python3
"""Images of a scene file of Tallow by Mitsuba 3 (`llvm_ad_rgb`, `path`), with and without Open Image Denoise, and their times: what
`tallow cost --points` puts beside its own.

  PEERS/venv/bin/python tools/bench/real/rival.py SCENE.toml -o FOLDER --width W --height H --max-depth D [--spp LIST] [--seeds N]

PEERS is the folder that $TALLOW_DATA/peers/setup.sh installed into (run `. PEERS/env.sh` first). Writes FOLDER/points.csv and the
images beside it. Milliseconds are wall time without start-up: everything is rendered once before. Denoised points take the time of
a render with albedo and normals, and of the filter."""
import argparse
import csv
import random
import time
from pathlib import Path

import mitsuba_scene
import drjit as dr
import mitsuba as mi
import mitsuba_oidn as oidn
import numpy as np

QUALITIES = ("Fast", "High")


def timed(work):
    begun = time.perf_counter()
    result = work()
    dr.eval(result)
    dr.sync_thread()
    return result, 1e3 * (time.perf_counter() - begun)


class Rival:
    def __init__(self, args):
        self.scene = mitsuba_scene.load(args.scene, args.width, args.height)
        path = {"type": "path", "max_depth": args.max_depth, "rr_depth": 100000}
        self.path = mi.load_dict(path)
        self.layers = mi.load_dict({"type": "aov", "aovs": "albedo:albedo,nn:sh_normal", "img": path})
        self.folder = Path(args.output)
        self.rows = []

    def render(self, integrator, spp, seed):
        return timed(lambda: mi.render(self.scene, integrator=integrator, spp=spp, seed=seed))

    def keep(self, filter_name, spp, seed, ms, pixels):
        file = self.folder / f"{filter_name.replace(' ', '-')}-{spp}-{seed}.exr"
        mi.Bitmap(np.ascontiguousarray(pixels, dtype=np.float32)).write(str(file))
        self.rows.append(["Mitsuba llvm_ad_rgb", filter_name, spp, seed, f"{ms:.3f}", file.name])

    def measure(self, spp, seed):
        image, ms = self.render(self.path, spp, seed)
        self.keep("none", spp, seed, ms, np.array(image)[..., :3])
        image, ms = self.render(self.layers, spp, seed)
        whole = np.array(image, dtype=np.float32)
        names = ["R", "G", "B", *(name for name in self.layers.aov_names() if not name.startswith("img."))]
        plane = lambda prefix: np.ascontiguousarray(
            np.stack([whole[..., i] for i, name in enumerate(names) if name.startswith(prefix)], -1))
        colour, albedo, normal = np.ascontiguousarray(whole[..., :3]), plane("albedo"), plane("nn")
        for quality in QUALITIES:
            filtered, filter_ms = timed(
                lambda: oidn.denoise(colour, albedo, normal, hdr=True, quality=getattr(oidn.Quality, quality)))
            self.keep(f"oidn {quality}", spp, seed, ms + filter_ms, filtered)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("-o", "--output", required=True)
    parser.add_argument("--width", type=int, required=True)
    parser.add_argument("--height", type=int, required=True)
    parser.add_argument("--max-depth", type=int, required=True)
    parser.add_argument("--spp", default="1,2,4,8,16,32,64,128,256")
    parser.add_argument("--seeds", type=int, default=5)
    args = parser.parse_args()
    Path(args.output).mkdir(parents=True, exist_ok=True)
    spp = [int(n) for n in args.spp.split(",")]
    rival = Rival(args)
    for n in spp:
        rival.measure(n, 999)  # compiles
    rival.rows.clear()
    runs = [(n, seed) for n in spp for seed in range(args.seeds)]
    random.Random(0).shuffle(runs)
    for n, seed in runs:
        rival.measure(n, seed)
    with open(rival.folder / "points.csv", "w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["method", "filter", "spp", "seed", "ms", "image"])
        table.writerows(sorted(rival.rows, key=lambda row: (row[1], row[2], row[3])))


if __name__ == "__main__":
    main()
