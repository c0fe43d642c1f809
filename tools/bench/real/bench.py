#!/usr/bin/env python3
"""Whole renders of real scenes, by Tallow and by Mitsuba 3 (`llvm_ad_rgb`, `path`), in turn on the same cores.

  TALLOW_DATA=../shared PEERS/venv/bin/python tools/bench/real/bench.py [--tallow BINARY]... [--scenes NAMES] [--rounds N]

PEERS is the folder that $TALLOW_DATA/peers/setup.sh installed into (run `. PEERS/env.sh` first). Several binaries are compared
with the first one. Start-up is kept out: Mitsuba renders once before it is timed, and Tallow's wall time is the difference
between two renders. Device time is that of all passes of the longer one. Rates by processor time count the seconds of
all cores, as if they had been busy all the time: other processes disturb them least. `layers` renders all layers of an EXR
file, otherwise radiance alone. Image means tell whether all render the same."""
import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[3]
# Name: (where its scene file comes from, width, height, depth, samples a pixel).
SCENES = {
    "bare-sponza": ("convert", 640, 360, 4, 8),
    "crytek-sponza": ("convert", 640, 360, 4, 4),
    "stanford-dragon": ("convert", 512, 512, 4, 8),
    "pine-grove": ("convert", 640, 480, 4, 8),
    "cornell-box": ("scenes", 512, 512, 3, 32),
    "bust": ("scenes", 480, 640, 4, 16),
    "grass": ("scenes", 640, 360, 4, 16),
}


def scene_file(name, folder):
    if SCENES[name][0] == "scenes":
        return ROOT / "scenes" / name / "scene.toml"
    convert = ["cargo", "run", "--quiet", "--release", "--locked", "--example", "convert", "--", name, "-o", folder]
    subprocess.run(convert, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    return Path(folder) / f"{name}.toml"


def processor_seconds(who):
    """Seconds that all cores worked, over their number."""
    used = resource.getrusage(who)
    return (used.ru_utime + used.ru_stime) / len(os.sched_getaffinity(0))


class Tallow:
    def __init__(self, binary, scene, shape, output):
        width, height, depth, self.spp = shape
        self.megapixels = width * height * 1e-6
        self.command = [binary, "render", scene, "--width", width, "--height", height, "--max-depth", depth]
        self.output = output
        self.render(1)  # fills the pipeline cache

    def render(self, spp, *more):
        words = [*self.command, "--spp", spp, "-o", self.output, "--json", *more]
        begun = processor_seconds(resource.RUSAGE_CHILDREN)
        summary = json.loads(subprocess.run([str(w) for w in words], check=True, capture_output=True).stdout)
        return {**summary, "processor": processor_seconds(resource.RUSAGE_CHILDREN) - begun}

    def rates(self):
        """Megasamples a second by wall, processor and device time."""
        one, three = self.render(self.spp), self.render(3 * self.spp)
        between = [2 * self.spp * self.megapixels / (three[key] - one[key]) for key in ("seconds", "processor")]
        return *between, 3 * self.spp * self.megapixels / (1e-3 * three["gpu_ms"])

    def mean(self):
        import mitsuba as mi
        return np.array(mi.Bitmap(str(self.output)))[..., :3].mean()


class Mitsuba:
    def __init__(self, scene, shape):
        import mitsuba as mi
        import mitsuba_scene
        width, height, depth, self.spp = shape
        self.mi, self.samples = mi, width * height * self.spp
        self.scene = mitsuba_scene.load(scene, width, height)
        self.path = mi.load_dict({"type": "path", "max_depth": depth, "rr_depth": 100000})
        self.seed, self.means = 0, []
        self.rates()

    def rates(self):
        import drjit as dr
        self.seed += 1
        begun, busy = time.perf_counter(), processor_seconds(resource.RUSAGE_SELF)
        image = self.mi.render(self.scene, integrator=self.path, spp=self.spp, seed=self.seed)
        dr.eval(image)
        dr.sync_thread()
        seconds = time.perf_counter() - begun, processor_seconds(resource.RUSAGE_SELF) - busy
        self.means.append(np.array(image).mean())
        return [self.samples / s * 1e-6 for s in seconds]

    def mean(self):
        return np.mean(self.means)


def compare(name, binaries, rounds, folder):
    _, *shape = SCENES[name]
    scene = scene_file(name, folder)
    sides = {"Mitsuba": Mitsuba(scene, shape)}
    for i, binary in enumerate(binaries):
        of = "" if len(binaries) == 1 else f" {i}"
        sides[f"Tallow{of}"] = Tallow(binary, scene, shape, Path(folder) / f"{i}.hdr")
        sides[f"Tallow{of}, layers"] = Tallow(binary, scene, shape, Path(folder) / f"{i}.exr")
    seen = {side: [] for side in sides}
    for _ in range(rounds):
        for side, renderer in sides.items():
            seen[side].append(renderer.rates())
    medians = {side: [statistics.median(column) for column in zip(*rates)] for side, rates in seen.items()}
    for side, rates in medians.items():
        columns = "".join(f"{rate:9.3f}" for rate in rates).ljust(27)
        of = [side.replace(f" {i}", " 0") for i in range(1, len(binaries))]
        first = next((s for s in of if s != side), side)
        ratios = [rates[1] / medians["Mitsuba"][1], rates[1] / medians[first][1]]
        print(f"{name:16} {side:18}{columns}" + "".join(f"{r:9.3f}" for r in ratios) + f"{sides[side].mean():11.5f}", flush=True)


def count(name, binary, folder):
    """What a path does, counted."""
    _, *shape = SCENES[name]
    tallow = Tallow(binary, scene_file(name, folder), shape, Path(folder) / "count.hdr")
    summary = tallow.render(4, "--counters")
    print(f"{name:16}", *(f"{key} {value / summary['traced']:.2f}" for key, value in summary["counters"].items()), flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tallow", action="append", metavar="BINARY", help="default: target/release/tallow")
    parser.add_argument("--scenes", default=",".join(SCENES), help="default: %(default)s")
    parser.add_argument("--rounds", type=int, default=3)
    args = parser.parse_args()
    data = os.environ.get("TALLOW_DATA", "")
    if not os.path.isdir(data):
        sys.exit("TALLOW_DATA names no folder of outside data")
    os.environ["TALLOW_DATA"] = os.path.abspath(data)  # cargo is started in another folder
    binaries = args.tallow or [str(ROOT / "target/release/tallow")]
    names = args.scenes.split(",")
    with tempfile.TemporaryDirectory() as folder:
        columns = ("wall", "processor", "device", "/Mitsuba", "/first", "mean")
        print(f"{'Msamples/s':16} {'':18}{columns[0]:>9}{columns[1]:>9}{columns[2]:>9}{columns[3]:>9}{columns[4]:>9}{columns[5]:>11}")
        for name in names:
            compare(name, binaries, args.rounds, folder)
        print("\nof a path:")
        for name in names:
            count(name, binaries[-1], folder)


if __name__ == "__main__":
    main()
