"""Open Image Denoise on an EXR of Tallow's or of cornell_mitsuba.py's: python oidn.py NOISY.exr FOLDER
Prints QUALITY MILLISECONDS FILE per line, the time being the best of 5 after one that prepares the filter."""
import os, sys, time
import mitsuba as mi, numpy as np

mi.set_variant("scalar_rgb")
import mitsuba_oidn as oidn

RUNS = 5
parts = dict(mi.Bitmap(sys.argv[1]).split())


def plane(name):
    part = parts[name]
    names = [part.struct_()[i].name for i in range(part.channel_count())]
    values = np.array(part, dtype=np.float32)
    order = ["R", "G", "B"] if "R" in names else ["X", "Y", "Z"]
    return np.ascontiguousarray(np.stack([values[..., names.index(c)] for c in order], -1))


colour, albedo, normal = plane("<root>"), plane("albedo"), plane("N" if "N" in parts else "nn")
for name in ("High", "Balanced", "Fast"):
    quality = getattr(oidn.Quality, name)
    times = []
    for _ in range(RUNS + 1):
        start = time.perf_counter()
        out = oidn.denoise(colour, albedo, normal, hdr=True, quality=quality)
        times.append(1e3 * (time.perf_counter() - start))
    path = os.path.join(sys.argv[2], f"{os.path.basename(sys.argv[1])}-oidn-{name}.exr")
    mi.Bitmap(np.asarray(out)).write(path)
    print(name, f"{min(times[1:]):.2f}", path)
