//! Tests renders whose indirect light is traced for pixels a stride apart: what is traced is that of a whole render, to the bit, and
//! filters fill in the rest.
use crate::support::{self, assert_silent, gpu};
use std::path::Path;
use tallow::denoise::filter::{Method, find};
use tallow::denoise::{Filtered, Noisy, Recipe};
use tallow::gpu::Gpu;
use tallow::layout::{PixelLight, PixelStats, vec3};
use tallow::render::settings::{Settings, Split};
use tallow::render::{Job, Outputs, Renderer};
use tallow::scene::{Loaded, Scene};

/// A sphere on a floor below a sky, a lamp and a point light.
fn scene(change: impl Fn(&mut Settings)) -> Loaded {
    let text = "[camera]\nposition = [0.0, 2.0, 5.0]\ntarget = [0.0, 0.5, 0.0]\nfov = 45.0\n[film]\nwidth = 33\nheight = 18\n\
         [environment]\nradiance = 0.5\n[render]\nspp = 4\nmax_depth = 5\n\
         [[light]]\ntype = 'point'\nposition = [2.0, 3.0, 1.0]\nintensity = 8.0\n\
         [[material]]\nname = 'lamp'\ncolor = 0\nemission = 2\n[[material]]\nname = 'grey'\ncolor = 0.6\n\
         [[material]]\nname = 'glass'\ntype = 'dielectric'\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'grey'\ntransform = { rotate = [-90.0, 0.0, 0.0], scale = 6.0 }\n\
         [[mesh]]\nshape = 'cube'\nmaterial = 'grey'\ntransform = { scale = 0.5, translate = [-1.0, 0.5, 0.0] }\n\
         [[mesh]]\nshape = 'sphere'\nmaterial = 'glass'\ntransform = { scale = 0.5, translate = [0.8, 0.5, 0.5] }\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'lamp'\ntransform = { rotate = [90.0, 0.0, 0.0], translate = [-1.0, 3.0, 0.0] }\n";
    Scene::parse(Path::new("stride.toml"), text).map(|scene| scene.with(change)).unwrap()
}

/// The statistics that are left, and the rays that were traced.
fn rendered(gpu: &Gpu, scene: &Loaded, paths_at_once: u32) -> (Vec<PixelStats>, Vec<PixelLight>, u64) {
    let outputs = Outputs { counters: true, ..Outputs::FILTERED };
    let renderer = Renderer::new(gpu, scene, &scene.settings, outputs).unwrap();
    let job = Job { paths_at_once, ..Job::new(&renderer) };
    job.run_to_end(&mut tallow::gpu::FrameResources::new(gpu).unwrap()).unwrap();
    let tile = &renderer.film().tiles[0];
    (tile.stats.read().unwrap(), tile.light.read().unwrap(), renderer.counters().unwrap().rays())
}

#[test]
fn what_is_traced_is_that_of_a_whole_render() {
    let gpu = gpu();
    for split in [Split::Soft, Split::Indirect] {
        let (whole, light, rays) = rendered(&gpu, &scene(|s| s.split = split), u32::MAX);
        for (stride, paths_at_once) in [(2, u32::MAX), (3, 100), (8, u32::MAX)] {
            let sparse = scene(|s| (s.split, s.indirect_stride) = (split, stride));
            let (found, direct, fewer) = rendered(&gpu, &sparse, paths_at_once);
            let mut lacking = 0;
            for i in 0..found.len() {
                let traced = (i as u32 % 33).is_multiple_of(stride) && (i as u32 / 33).is_multiple_of(stride);
                assert_eq!((direct[i].direct, direct[i].albedo), (light[i].direct, light[i].albedo), "{stride}: {i}");
                if traced {
                    assert_eq!((found[i], direct[i]), (whole[i], light[i]), "{stride}: pixel {i}");
                } else {
                    // Samples that pass over the key light, as beside a sky, bring nothing here, and count in direct light as the others.
                    let (mean, kept) = (found[i].mean, light[i].direct);
                    let within = |c: usize| mean[c] <= kept[c] * 1.00001 && mean[c] >= kept[c] * 0.24;
                    assert!((0..3).all(within), "{stride}: pixel {i}: {mean:?} {kept:?}");
                    let kept_alone = mean == kept && direct[i].indirect_m2 == 0.0;
                    assert!(split == Split::Soft || kept_alone, "{stride}: pixel {i}: {mean:?} {kept:?}");
                    lacking += usize::from(whole[i].mean != light[i].direct);
                }
            }
            assert!(lacking > 30, "control: {lacking} pixels lack light");
            let share = fewer as f64 / rays as f64;

            assert!(share < 0.97, "{stride}, {split:?}: {share} of the rays");
        }
    }
    assert_silent(&gpu);
}

/// Pixels that get samples by their noise keep the mean light of those that get them evenly: what a path rarely finds is not missed
/// because pixels around, which trace none of it, show no noise.
#[test]
fn placed_samples_lose_no_light_of_the_pixels_that_are_traced() {
    let gpu = gpu();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.toml");
    let indirect = |policy: &str, stride: u32| {
        let scene = Scene::load(&file).unwrap().with(|s| {
            ([s.width, s.height], s.spp, s.max_depth, s.indirect_stride) = ([48, 48], 16, 3, stride);
            s.allocate.policy = tallow::allocate::policy(policy).unwrap();
        });
        let (stats, light, _) = rendered(&gpu, &scene, u32::MAX);
        let one = |(stats, light): (&PixelStats, &PixelLight)| f64::from(stats.mean[1] - light.direct[1]);
        stats.iter().zip(&light).map(one).sum::<f64>()
    };
    for stride in [2, 4] {
        let expected = indirect("uniform", stride);
        for policy in ["variance", "both"] {
            let ratio = indirect(policy, stride) / expected;
            assert!((0.98..1.02).contains(&ratio), "{policy}, stride {stride}: {ratio}");
        }
    }
    assert_silent(&gpu);
}

/// A floor below a sky that lights all of it alike, and a wall in whose place the light is another: pixels that are filled in get the
/// light of their surface.
#[test]
fn filters_fill_in_what_is_not_traced() {
    let gpu = gpu();
    let picture = |stride: u32, spp: u32, filter: &str| -> Vec<vec3> {
        let scene = scene(|s| (s.indirect_stride, s.spp, s.max_depth) = (stride, spp, 3));
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
        support::render(&gpu, &renderer);
        let method = Method::Kernels(find(filter).unwrap());
        let clean = Filtered::new(&gpu, Noisy::of_film(&renderer).unwrap(), &Recipe::new(method)).unwrap();
        let [r, g, b] = clean.join(&gpu).unwrap().colour;
        (0..r.len()).map(|i| [r[i], g[i], b[i]]).collect()
    };
    let expected = picture(1, 256, "none");
    for filter in ["none", "atrous", "guided", "auto"] {
        let found = picture(2, 64, filter);
        // The floor before the bodies, in the lowest rows.
        let mean = |image: &[vec3], odd: bool| {
            let row = 33 * if odd { 17 } else { 16 };
            let pixels = (usize::from(odd)..33).step_by(2);
            let (sum, count) = pixels.fold((0.0, 0), |(sum, n), x| (sum + image[row + x][1], n + 1));
            sum / count as f32
        };
        for odd in [false, true] {
            let ratio = mean(&found, odd) / mean(&expected, odd);
            assert!((0.9..1.1).contains(&ratio), "{filter}, odd {odd}: {ratio}");
        }
    }
    assert_silent(&gpu);
}

#[test]
fn what_needs_the_light_of_every_pixel_is_refused() {
    let gpu = gpu();
    let scene = scene(|s| s.indirect_stride = 2);
    let refused = |outputs, method| {
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, outputs).unwrap();
        support::render(&gpu, &renderer);
        let noisy = Noisy::of_film(&renderer);
        noisy.and_then(|noisy| Filtered::new(&gpu, noisy, &Recipe::new(method))).map(drop).unwrap_err().to_string()
    };
    let told = refused(Outputs::FILTERED, Method::Oidn);
    assert!(told.contains("oidn") && told.contains("indirect_stride 2"), "{told}");
    let told = refused(Outputs { split_light: false, ..Outputs::FILTERED }, Method::Kernels(find("atrous").unwrap()));
    assert!(told.contains("split_light"), "{told}");
    let told = tallow::render::can_carry(&gpu, &scene, &scene.settings).unwrap_err().to_string();
    assert!(told.contains("indirect_stride"), "{told}");
    let mut renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
    let told = renderer.keep_history(Default::default(), tallow::render::Moves::Camera).unwrap_err().to_string();
    assert!(told.contains("set indirect_stride to 1"), "{told}");
}
