"""The Cornell box by Mitsuba with the AOVs of its documentation: python cornell_mitsuba.py SCENE.xml SPP FILE
256x256, depth 3. AOVs are left out at 256 samples per pixel and more, which are for references."""
import sys
import mitsuba as mi, numpy as np

mi.set_variant("llvm_ad_rgb")
SIZE, DEPTH, BATCH = 256, 3, 256
scene, spp, file = sys.argv[1], int(sys.argv[2]), sys.argv[3]
path = {"type": "path", "max_depth": DEPTH, "rr_depth": 10000}
aovs = {"type": "aov", "aovs": "albedo:albedo,nn:sh_normal,dd.y:depth,pos:position", "img": path}
integrator = mi.load_dict(aovs if spp < BATCH else path)
loaded = mi.load_file(scene, w=SIZE, h=SIZE, depth=DEPTH, spp=min(spp, BATCH))
if spp < BATCH:
    mi.render(loaded, integrator=integrator, spp=spp, seed=0)
    loaded.sensors()[0].film().write(file)
else:
    batches = spp // BATCH
    total = sum(np.array(mi.render(loaded, integrator=integrator, spp=BATCH, seed=100 + i)) for i in range(batches))
    mi.Bitmap((total / batches).astype(np.float32)).write(file)
