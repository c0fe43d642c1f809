//! Compares images that the device filters, of frames and of files, with the same images demodulated, filtered and remodulated by
//! the twins.
use crate::picture;
use crate::support::{self, assert_silent, gpu, hash};
use crate::twin::Workplace;
use std::path::Path;
use tallow::denoise::file::Layers;
use tallow::denoise::filter::firefly::Fireflies;
use tallow::denoise::filter::{FILTERS, FilterSettings, Scales, check_size, estimated, find};
use tallow::denoise::sparse::{decimated, upsampled};
use tallow::denoise::twin::{Parts, Pixels, demodulate, split};
use tallow::denoise::{Demodulation, Denoiser, Filtered, Holds, Noisy, Recipe, expected};
use tallow::gpu::{DeviceKind, FrameResources, Gpu};
use tallow::image::aov::{Aovs, Names};
use tallow::image::{Film, Samples};
use tallow::layout::{Guide, NONE, PixelLight, PixelStats, vec3, vec4};
use tallow::render::settings::Settings;
use tallow::render::{Job, Outputs, Renderer};
use tallow::scene::Scene;
use tallow::shaders::shared::sample_marks::{ALL_PASSED_OVER, SOME_BARE};
use tallow::statistics::{Pixel, variance_of_mean};

const SIZES: [[u32; 2]; 6] = [[1, 1], [31, 1], [1, 65], [64, 2], [65, 3], LARGEST];
const LARGEST: [u32; 2] = [33, 17];
const DEMODULATIONS: [Demodulation; 3] = [Demodulation::Light, Demodulation::Albedo, Demodulation::Off];
/// Buffers that a renderer leaves.
struct Frame {
    size: [u32; 2],
    stats: Vec<PixelStats>,
    light: Vec<PixelLight>,
    guide: Vec<Guide>,
    /// How far a lens blurs each pixel, if there is one.
    blur: Vec<f32>,
}

impl Frame {
    /// Walls of many colours under noise, lamps among them, and with `broken` everything that no frame should hold.
    fn new(size: [u32; 2], broken: bool) -> Self {
        let mut frame = Self { size, stats: Vec::new(), light: Vec::new(), guide: Vec::new(), blur: Vec::new() };
        for i in 0..size[0] * size[1] {
            let unit = |salt: u32| hash(i.wrapping_mul(8) + salt) as f32 / 4_294_967_296.0;
            let (is_lamp, is_glass) = (i % 23 == 7, size[0] > 16 && i % size[0] % 16 < 4);
            let albedo = if is_lamp || is_glass { [0.0; 3] } else { [0, 1, 2].map(|c| 0.005 + 0.9 * unit(c)) };
            let indirect = [unit(4), 0.3 * unit(5), 1.0];
            let mut light =
                PixelLight { direct: [unit(3); 3], indirect_m2: 2.0 * unit(7), albedo, ..PixelLight::default() };
            if is_lamp {
                light = PixelLight { direct: [20.0; 3], ..PixelLight::default() };
            } else if i % 11 == 4 {
                light = PixelLight { direct: [0.0; 3], remainder: ALL_PASSED_OVER, ..light };
            } else if i % 11 == 5 {
                light.remainder = SOME_BARE;
            }
            let mut mean: vec3 = std::array::from_fn(|c| light.direct[c] + light.albedo[c] * indirect[c]);
            // Unit but for rounding, as those of a render.
            let normal = glam::Vec3::new(0.01 * unit(7), 0.6, 0.8).normalize().to_array();
            let mut guide = Guide { normal, depth: 2.0 + unit(6), albedo, ..Guide::default() };
            guide.position = [unit(0), unit(1), -guide.depth];
            match i % 37 {
                3 if broken => mean[1] = f32::NAN,
                5 if broken => light.direct[2] = f32::INFINITY,
                9 if broken => light.albedo = [0.0, -1.0, f32::NAN],
                11 if broken => (guide.albedo[0], light.albedo[0]) = (f32::NAN, f32::NAN),
                14 if broken => (guide.albedo, light.albedo) = ([f32::INFINITY; 3], [f32::INFINITY; 3]),
                17 if broken => mean = [0.0; 3],
                _ => {}
            }
            let count = 1 + hash(i) % 4;
            frame.stats.push(PixelStats {
                mean,
                count,
                m2: mean.map(|v| v * v * count as f32),
                remainder: 0,
                ..Default::default()
            });
            frame.light.push(light);
            frame.guide.push(guide);
        }
        frame
    }

    /// As a file holds it.
    fn film(&self) -> Film {
        let mut film = Film::new(self.size[0], self.size[1]);
        let mut add = |layer, of: fn(&Self, usize) -> vec3| {
            let values: Vec<_> = (0..self.stats.len()).map(|i| of(self, i)).collect();
            film.add_vec3(layer, ["R", "G", "B"], &values);
        };
        add("", |f, i| f.stats[i].mean);
        add("variance", |f, i| variance_of_mean(&f.stats[i]));
        add("direct", |f, i| f.light[i].direct);
        add("indirect", |f, i| Pixel { stats: f.stats[i], light: f.light[i] }.indirect());
        add("albedo", |f, i| if f.stats[i].count > 0 { f.light[i].albedo } else { f.guide[i].albedo });
        add("N", |f, i| f.guide[i].normal);
        add("P", |f, i| f.guide[i].position);
        film.add("light.remainder", Samples::U32(self.light.iter().map(|l| l.remainder).collect()));
        film.add("indirect.m2", Samples::F32(self.light.iter().map(|l| l.indirect_m2).collect()));
        if !self.blur.is_empty() {
            film.add("denoising blur", Samples::F32(self.blur.clone()));
        }
        film.add("Z", Samples::F32(self.guide.iter().map(|g| g.depth).collect()));
        film.add("samples", Samples::U32(self.stats.iter().map(|s| s.count).collect()));
        film.metadata.insert("software".to_owned(), "tallow test".to_owned());
        film
    }

    /// Seen through a lens: sharp, blurred by half and as a whole in turn.
    fn through_lens(mut self) -> Self {
        self.blur = (0..self.stats.len()).map(|i| (i % 3) as f32 / 2.0).collect();
        self
    }

    /// On one wall of tiles whose gloss mirrors as much light as they scatter.
    fn with_gloss(mut self) -> Self {
        for (i, (stats, light)) in self.stats.iter_mut().zip(&mut self.light).enumerate() {
            let (x, y) = (i as u32 % self.size[0], i as u32 / self.size[0]);
            let is_dark = (x / 3 + y / 3) % 2 == 0;
            let guide = &mut self.guide[i];
            (guide.normal, guide.depth) = ([0.0, 0.0, 1.0], 1.0);
            guide.position = [x as f32 * 0.01, y as f32 * 0.01, if i % 29 == 3 { 0.5 } else { 0.0 }];
            if light.albedo.iter().all(|&a| a > 0.0 && a.is_finite()) && stats.mean[1].is_finite() {
                let noise = stats.mean[1] / (light.albedo[1] + 1.0);
                light.albedo = if is_dark { [0.2, 0.25, 0.3] } else { [0.5, 0.6, 0.55] };
                stats.mean = std::array::from_fn(|c| light.direct[c] + (0.5 + 0.1 * noise) * (light.albedo[c] + 0.4));
                guide.albedo = light.albedo;
            }
        }
        self
    }

    /// The same with guides as a film has them, of other rays than the samples: those of every second pixel have found no surface that
    /// reflects.
    fn of_other_rays(mut self) -> Self {
        for (i, guide) in self.guide.iter_mut().enumerate() {
            guide.material = if self.blur[i] > 0.0 { NONE } else { 0 };
            guide.albedo = if i % 2 == 0 && self.stats[i].count > 0 { [0.0; 3] } else { guide.albedo };
        }
        self
    }

    /// Every fifth pixel without a sample, and so without light of its own.
    fn sparse(mut self) -> Self {
        for i in (0..self.stats.len()).step_by(5) {
            (self.stats[i], self.light[i]) = (PixelStats::default(), PixelLight::default());
        }
        self
    }

    fn on_the_host(
        &self,
        filter: &str,
        settings: &FilterSettings,
        demodulation: Demodulation,
        in_paint: bool,
        stride: u32,
    ) -> Vec<vec4> {
        let gloss = matches!(filter, "svgf" | "auto");
        let parts = demodulate(&self.pixels(stride, gloss), demodulation, in_paint);
        if stride == 1 {
            return twins(parts, filter, settings);
        }
        let (size, filtered) =
            (self.size, (find(filter).unwrap().reference)(&decimated(&parts.input, stride), settings));
        let whole = parts.remodulate(&upsampled(&filtered, &parts.input.guide, size, stride));
        whole.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()
    }

    fn pixels(&self, stride: u32, gloss: bool) -> Pixels {
        let Self { size, stats, light, guide, blur } = self;
        let (stats, light, guide, blur) = (stats.clone(), light.clone(), guide.clone(), blur.clone());
        let holds = Holds::film(true, true, !blur.is_empty(), stride);
        Pixels { size: *size, holds, stats, light, guide, blur, gloss }
    }

    fn upload(&self, renderer: &Renderer) {
        let tile = &renderer.film().tiles[0];
        tile.stats.write(0, &self.stats).unwrap();
        tile.light.write(0, &self.light).unwrap();
        let guide = if tile.has_seen() { &tile.seen } else { &tile.guide };
        guide.write(0, &self.guide).unwrap();
        if tile.has_blur() {
            tile.blur.write(0, &self.blur).unwrap();
        }
    }

    fn on_the_device(
        &self,
        gpu: &Gpu,
        renderer: &Renderer,
        filter: &str,
        settings: &FilterSettings,
        demodulation: Demodulation,
    ) -> Vec<vec4> {
        self.upload(renderer);
        let denoiser =
            Denoiser::new(gpu, renderer, find(filter).unwrap(), settings, demodulation, Fireflies::Off).unwrap();
        gpu.run(&mut FrameResources::new(gpu).unwrap(), |rec| denoiser.record(rec)).unwrap();
        denoiser.picture().read().unwrap()
    }
}

/// Filters what was taken apart and puts it together.
fn twins(mut parts: Parts, filter: &str, settings: &FilterSettings) -> Vec<vec4> {
    let filter = find(filter).unwrap().reference;
    let filtered = filter(&parts.input, settings);
    if let Some(direct) = &parts.direct {
        let in_painted = filter(direct, settings);
        parts.remodulate_direct(&in_painted);
    }
    parts.remodulate(&filtered).into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()
}

fn renderer(gpu: &Gpu, size: [u32; 2], outputs: Outputs, policy: &str) -> Renderer {
    renderer_of(gpu, size, outputs, policy, 1, 0.0)
}

fn renderer_of(gpu: &Gpu, size: [u32; 2], outputs: Outputs, policy: &str, stride: u32, lens: f32) -> Renderer {
    let small = |s: &mut Settings| {
        s.indirect_stride = stride;
        [s.width, s.height] = size;
        (s.spp, s.max_depth) = (4, 3);
        (s.allocate.policy, s.allocate.min_spp) = (tallow::allocate::policy(policy).unwrap(), 0);
    };
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.toml");
    let mut scene = Scene::load(&file).unwrap().with(small);
    scene.view.lens_radius = lens;
    Renderer::new(gpu, &scene, &scene.settings, outputs).unwrap()
}

#[test]
fn frames_are_taken_apart_and_put_together_as_their_twins() {
    let gpu = gpu();
    let settings = FilterSettings::default().with(|s| s.edge.extent = 3.0);
    for size in SIZES {
        // Where samples are placed, pixels may have none.
        let policies = if size == LARGEST { &["uniform", "geometry"][..] } else { &["geometry"] };
        for &policy in policies {
            let renderer = renderer(&gpu, size, Outputs::FILTERED, policy);
            let frames = [Frame::new(size, false), Frame::new(size, true), Frame::new(size, true).sparse()];
            for frame in &frames {
                let of = |filter, demodulation| {
                    let device = frame.on_the_device(&gpu, &renderer, filter, &settings, demodulation);
                    let in_paint = policy != "uniform" && demodulation == Demodulation::Light;
                    let host = frame.on_the_host(filter, &settings, demodulation, in_paint, 1);
                    let off = picture::apart(&device, &host, 1e-3);
                    assert!(off < 3e-4, "{filter} {demodulation:?} {policy} {size:?}: {off}");
                    assert!(device.iter().flatten().all(|v| v.is_finite()), "{filter} {demodulation:?} {size:?}");
                    device
                };
                let [light, albedo, off] = DEMODULATIONS;
                let pictures = [("none", light), ("svgf", light), ("svgf", albedo), ("svgf", off), ("none", albedo)];
                let pictures = pictures.map(|(filter, demodulation)| of(filter, demodulation));
                let differ = |i: usize| picture::apart(&pictures[i], &pictures[i + 1], 1e-3) > 1e-2;
                assert!(size == [1, 1] || (0..4).all(differ), "control: filters and demodulations differ");
            }
        }
    }
    assert_silent(&gpu);
}

/// By filters that weigh noise; others keep sharp light and textures.
#[test]
fn what_a_lens_blurs_is_filtered_as_it_is() {
    let gpu = gpu();
    let settings = FilterSettings::default().with(|s| s.edge.extent = 3.0);
    for size in SIZES {
        let renderer = renderer_of(&gpu, size, Outputs::FILTERED, "uniform", 1, 0.1);
        for broken in [false, true] {
            let (frame, sharp) = (Frame::new(size, broken).through_lens(), Frame::new(size, broken));
            for (filter, demodulation, alike) in
                DEMODULATIONS.iter().map(|d| ("svgf", *d, &frame)).chain([("bilateral", DEMODULATIONS[0], &sharp)])
            {
                let device = frame.on_the_device(&gpu, &renderer, filter, &settings, demodulation);
                let off = |frame: &Frame| {
                    picture::apart(&device, &frame.on_the_host(filter, &settings, demodulation, false, 1), 1e-3)
                };
                assert!(off(alike) < 3e-4, "{filter} {demodulation:?} {size:?}: {}", off(alike));
                assert!(device.iter().flatten().all(|v| v.is_finite()), "{filter} {demodulation:?} {size:?}");
                let same = filter != "svgf" || demodulation == Demodulation::Off || size == [1, 1];
                assert!(same || off(&sharp) > 1e-2, "control: {filter} {demodulation:?} {size:?}");
            }
        }
    }
    assert_silent(&gpu);
}

/// By filters that weigh noise; others keep to albedo, as their papers do.
#[test]
fn what_a_gloss_mirrors_is_filtered_as_it_is() {
    let gpu = gpu();
    let settings = FilterSettings::default().with(|s| s.edge.extent = 3.0);
    for size in [[1, 1], [31, 1], [1, 65], [64, 2], [65, 37], [32, 48]] {
        let renderer = renderer(&gpu, size, Outputs::FILTERED, "uniform");
        for (broken, demodulation) in [false, true].iter().flat_map(|&b| DEMODULATIONS.map(|d| (b, d))) {
            let frame = Frame::new(size, broken).with_gloss();
            let device = frame.on_the_device(&gpu, &renderer, "svgf", &settings, demodulation);
            let off = |gloss| {
                let host = twins(demodulate(&frame.pixels(1, gloss), demodulation, false), "svgf", &settings);
                picture::apart(&device, &host, 1e-3)
            };
            assert!(off(true) < 3e-4, "{demodulation:?} {size:?} {broken}: {}", off(true));
            assert!(device.iter().flatten().all(|v| v.is_finite()), "{demodulation:?} {size:?} {broken}");
            // Small windows have too few pairs of pixels.
            let same = demodulation != Demodulation::Light || size[0].min(size[1]) < 30;
            assert_eq!(off(false) > 1e-2, !same, "control: {demodulation:?} {size:?} {broken}: {}", off(false));
        }
    }
    assert_silent(&gpu);
}

/// Of which indirect light is traced in every third column and row; broken ones hold what no frame should.
#[test]
fn sparse_frames_are_filled_in_as_by_their_twins() {
    let gpu = gpu();
    let settings = FilterSettings::default().with(|s| s.edge.extent = 3.0);
    for size in SIZES {
        let renderer = renderer_of(&gpu, size, Outputs::FILTERED, "uniform", 3, 0.0);
        for (frame, filter) in [(Frame::new(size, false), "svgf"), (Frame::new(size, true), "none")] {
            let device = frame.on_the_device(&gpu, &renderer, filter, &settings, Demodulation::Light);
            let host = |stride| frame.on_the_host(filter, &settings, Demodulation::Light, false, stride);
            let off = picture::apart(&device, &host(3), 1e-3);
            assert!(off < 3e-4, "{filter} {size:?}: {off}");
            assert!(device.iter().flatten().all(|v| v.is_finite()), "{filter} {size:?}");
            assert!(size == [1, 1] || picture::apart(&device, &host(2), 1e-3) > 1e-2, "control: another stride");
        }
    }
    assert_silent(&gpu);
}

#[test]
fn upsampling_solves_the_worked_example() {
    // Two traced pixels, of 1 and 4, two columns apart; the plane that they lie in faces the camera.
    let on_plane = |x: f32| Guide { normal: [0.0, 0.0, 1.0], position: [x, 0.0, 0.0], depth: 1.0, ..Guide::default() };
    let mut guide = [0.0, 1.0, 2.0, 3.0].map(on_plane);
    let traced = [[1.0, 1.0, 1.0, 2.0], [4.0, 4.0, 4.0, 2.0]];
    let red = |guide: &[Guide], traced: &[vec4]| -> Vec<f32> {
        upsampled(traced, guide, [4, 1], 2).iter().map(|pixel| pixel[0]).collect()
    };
    // The mean between them, and the last beyond them.
    assert_eq!(red(&guide, &traced), [1.0, 2.5, 4.0, 4.0]);
    // A pixel half a length in front of the second's plane, whose sine towards it is 1 / sqrt(1.25): 2^(-16 * 0.2) of the weight.
    guide[2].position[2] = 0.5;
    let w = (-16.0f32 * 0.2).exp2();
    assert!((red(&guide, &traced)[1] - (1.0 + 4.0 * w) / (1.0 + w)).abs() < 1e-5);
    // What nothing reached fills in nothing, and of unlike surfaces the one most alike counts.
    assert_eq!(red(&guide, &[[9.0, 9.0, 9.0, 0.0], traced[1]]), [0.0, 4.0, 4.0, 4.0]);
    guide[0].normal = [0.0, 1.0, 0.0];
    guide[2].object = NONE;
    assert!((red(&guide, &traced)[1] - 1.0).abs() < 1e-4);
}

/// Whatever a file lacks of what Tallow writes.
#[test]
fn files_are_taken_apart_and_put_together_as_their_twins() {
    let gpu = gpu();
    let settings = FilterSettings::default().with(|s| s.edge.extent = 3.0);
    let lacking: [&[&str]; 7] =
        [&[], &["albedo"], &["direct"], &["variance"], &["indirect.m2"], &["variance", "indirect.m2"], &["samples"]];
    let of_largest = lacking.map(|missing| (LARGEST, missing)).into_iter();
    let cases = of_largest.chain(SIZES.iter().filter(|&&size| size != LARGEST).map(|&size| (size, lacking[0])));
    for (size, missing) in cases {
        for frame in [Frame::new(size, false), Frame::new(size, true).sparse(), Frame::new(size, true).through_lens()] {
            let mut film = frame.film();
            film.channels.retain(|c| !missing.iter().any(|layer| c.name.starts_with(layer)));
            let aovs = Aovs::find(&film, &Names::new()).unwrap();
            for demodulation in DEMODULATIONS {
                let host = twins(split(&aovs, demodulation, true), "svgf", &settings);
                let recipe = Recipe {
                    method: find("svgf").unwrap().into(),
                    demodulation: Some(demodulation),
                    looked_up: false,
                    fireflies: Fireflies::Off,
                    settings: &|_| settings,
                };
                let noisy = Layers::new(&aovs).upload(&gpu).unwrap();
                let [r, g, b] = Filtered::new(&gpu, noisy, &recipe).unwrap().join(&gpu).unwrap().colour;
                let device: Vec<vec4> = (0..r.len()).map(|i| [r[i], g[i], b[i], 1.0]).collect();
                let off = picture::apart(&device, &host, 1e-3);
                assert!(off < 3e-4, "{demodulation:?} {size:?} without {missing:?}: {off}");
            }
        }
    }
    assert_silent(&gpu);
}

/// A film's frame and its file are the same image: to the bit, with scales and in-painting found on the way.
#[test]
fn a_film_and_its_file_become_one_picture() {
    let gpu = gpu();
    let [whole, sparse] = [Frame::new([65, 3], true), Frame::new([65, 3], true).sparse()];
    let blurred = Frame::new([65, 3], false).sparse().through_lens().of_other_rays();
    let glossy = Frame::new([65, 37], true).with_gloss().sparse();
    for (frame, lens) in [(whole, 0.0), (sparse, 0.0), (blurred, 0.1), (glossy, 0.0)] {
        let renderer = renderer_of(&gpu, frame.size, Outputs::FILTERED, "geometry", 1, lens);
        frame.upload(&renderer);
        let film = frame.film();
        let aovs = Aovs::find(&film, &Names::new()).unwrap();
        for row in FILTERS {
            let settings = |scales: &Scales| FilterSettings::default().scaled_by(scales);
            let recipe = Recipe {
                method: (*row).into(),
                demodulation: Some(Demodulation::Light),
                looked_up: false,
                fireflies: Fireflies::Above(3.0),
                settings: &settings,
            };
            let images = [Noisy::of_film(&renderer).unwrap(), Layers::new(&aovs).upload(&gpu).unwrap()];
            let [of_film, of_file] = images.map(|noisy| {
                let filtered = Filtered::new(&gpu, noisy, &recipe).unwrap();
                assert!(filtered.in_painted && filtered.removed.is_some());
                filtered.join(&gpu).unwrap().colour
            });
            assert!(of_film == of_file, "{}", row.name);
        }
    }
    assert_silent(&gpu);
}

/// So are those of a render in which a mirror and glass show the sky, which no layer of a file names, but for rounding.
#[test]
fn a_render_of_mirrored_sky_and_its_file_become_one_picture() {
    let gpu = gpu();
    let ball = |material: &str, x: f32| {
        format!("[[mesh]]\nshape = 'sphere'\nmaterial = '{material}'\ntransform = {{ translate = [{x}, 0, 0] }}\n")
    };
    let scene = Workplace::new().sky("sky.exr", 32, 16, |x, y| (1 + (x * 5 + y * 3) % 7) as f32).scene(&format!(
        "[camera]\nposition = [0, 1, 6]\ntarget = [0, 0, 0]\nfov = 40\n[environment]\nfile = 'sky.exr'\n\
         [[material]]\nname = 'mirror'\ntype = 'conductor'\nmetal = 'Cu'\nalpha = 0\n\
         [[material]]\nname = 'glass'\ntype = 'dielectric'\n{}{}",
        ball("mirror", -1.1),
        ball("glass", 1.1)
    ));
    let scene = scene.with(|s| (s.width, s.height, s.spp) = (64, 40, 4));
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
    let job = Job::new(&renderer);
    let film = job.film(&job.run_to_end(&mut FrameResources::new(&gpu).unwrap()).unwrap()).unwrap();
    let aovs = Aovs::find(&film, &Names::new()).unwrap();
    let settings = |scales: &Scales| FilterSettings::default().scaled_by(scales);
    let recipe = Recipe { settings: &settings, ..Recipe::new(find("auto").unwrap().into()) };
    let images = [Noisy::of_film(&renderer).unwrap(), Layers::new(&aovs).upload(&gpu).unwrap()];
    let [of_film, of_file] =
        images.map(|noisy| Filtered::new(&gpu, noisy, &recipe).unwrap().join(&gpu).unwrap().colour);
    let off = |c: usize| of_film[c].iter().zip(&of_file[c]).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
    let off = [0, 1, 2].map(off);
    assert!(off.iter().all(|&off| off < 1e-5), "{off:?}, of light up to 7");
    assert_silent(&gpu);
}

/// A frame in the command buffer and an image on its own are cut and filtered alike, where single paths through glass have brought much.
#[test]
fn frames_are_cut_as_images_are() {
    let gpu = gpu();
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/glass.toml");
    let loaded = Scene::load(&file).unwrap();
    let fixed = FilterSettings::for_scene(&loaded);
    for stride in [1, 2] {
        let scene = loaded.clone().with(|s| (s.width, s.height, s.spp, s.indirect_stride) = (64, 64, 4, stride));
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
        support::render(&gpu, &renderer);
        for row in FILTERS.iter().filter(|row| row.name != "none") {
            let settings = &|_: &Scales| fixed;
            let recipe = Recipe { demodulation: Some(Demodulation::Light), settings, ..Recipe::new((*row).into()) };
            let filtered = Filtered::new(&gpu, Noisy::of_film(&renderer).unwrap(), &recipe).unwrap();
            assert!(filtered.removed.as_ref().is_some_and(|removed| removed.pixels > 0), "control: something is cut");
            let [r, g, b] = filtered.join(&gpu).unwrap().colour;
            let denoiser = Denoiser::new(&gpu, &renderer, row, &fixed, Demodulation::Light, Fireflies::Usual).unwrap();
            let mut frame = FrameResources::new(&gpu).unwrap();
            for _ in 0..2 {
                gpu.run(&mut frame, |rec| denoiser.record(rec)).unwrap();
                let picture = denoiser.picture().read().unwrap();
                let alike = picture.iter().enumerate().all(|(i, p)| p[..3] == [r[i], g[i], b[i]]);
                assert!(alike, "{}, a stride of {stride}", row.name);
            }
        }
    }
    assert_silent(&gpu);
}

#[test]
fn expected_errors_agree_with_their_twin() {
    let gpu = gpu();
    let auto = find("auto").unwrap();
    let settings = FilterSettings::default().with(|s| s.edge.extent = 3.0);
    for (size, demodulation) in [([31, 1], Demodulation::Albedo), (LARGEST, Demodulation::Light)] {
        let frame = Frame::new(size, false);
        let renderer = renderer(&gpu, size, Outputs::FILTERED, "uniform");
        frame.upload(&renderer);
        let (method, fireflies) = (auto.into(), Fireflies::Off);
        let recipe =
            Recipe { method, demodulation: Some(demodulation), looked_up: false, fireflies, settings: &|_| settings };
        let filtered = Filtered::new(&gpu, Noisy::of_film(&renderer).unwrap(), &recipe).unwrap();
        let device = filtered.join(&gpu).unwrap().expected.unwrap();
        let Frame { stats, light, guide, blur, .. } = frame;
        let pixels = Pixels { size, holds: Holds::film(true, true, false, 1), stats, light, guide, blur, gloss: true };
        let parts = demodulate(&pixels, demodulation, false);
        let (output, expected) = estimated(&parts.input, &settings);
        let host = expected::reference(&parts, &output, &expected).unwrap();
        println!("{size:?} {demodulation:?}: {device:?} {host:?}");
        for (device, host) in [(device.before, host.before), (device.after, host.after)] {
            assert!((device - host).abs() < 1e-3 * host, "{size:?} {demodulation:?}: {device} {host}");
        }
    }
    assert_silent(&gpu);
}

/// Four pixels of light 2 over albedo 1/2: 1. Half of the variance .04 that their samples tell of the light is noise, .02 / 4 of the
/// colour; a hundredth of the square is the error that is left. Direct light adds .1 of variance where it varies around by more. Filtered light of
/// 2.4 is .2 of colour off, and Stein's estimate takes half of the noise from its square where a quarter of a pixel is kept.
#[test]
fn expected_errors_solve_the_worked_example() {
    let of = |first: vec4, sharp: [f32; 4], sharp_variance: f32, filtered: f32| {
        let mut input = picture::flat(4, 1);
        input.radiance.fill([2.0, 2.0, 2.0, 4.0]);
        input.radiance[0] = first;
        input.variance = Some(vec![[0.04; 3]; 4]);
        let sharp = sharp.map(|v| [v; 3]).to_vec();
        let parts = Parts {
            input,
            sharp,
            factor: vec![[0.5; 3]; 4],
            sharp_variance: vec![sharp_variance; 4],
            direct: None,
            light: true,
        };
        expected::reference(&parts, &[[filtered, filtered, filtered, 4.0]; 4], &[[0.01, 0.5, 0.25]; 4]).unwrap()
    };
    let row = |sharp, sharp_variance, filtered| of([2.0, 2.0, 2.0, 4.0], sharp, sharp_variance, filtered);
    let near = |a: f64, b: f64| (a - b).abs() < 1e-5;
    let broken = of([f32::NAN, f32::NAN, f32::NAN, 0.0], [0.0; 4], 0.0, 2.0);
    assert!(near(broken.before, 0.75 * 0.005 / 1.01), "a pixel without samples has no noise: {broken:?}");
    let plain = row([0.0; 4], 0.1, 2.0);
    assert!(near(plain.before, 0.005 / 1.01) && near(plain.after, 0.01 / 1.01), "{plain:?}");
    let varied = row([0.0, 2.0, 0.0, 2.0], 0.1, 2.0);
    let over = (1.0 / 1.01 + 1.0 / 9.01) / 2.0;
    assert!(near(varied.before, 0.055 * over) && near(varied.after, 0.06 * over), "{varied:?}");
    let off = row([0.0; 4], 0.1, 2.4);
    assert!(near(off.after, (0.04 - 0.5 * 0.005) / 1.45), "{off:?}");
}

#[test]
fn a_frame_without_what_the_filter_needs_is_refused() {
    let (gpu, other) = (gpu(), gpu());
    let refused = |outputs, policy, demodulation| {
        let renderer = renderer(&gpu, [8, 8], outputs, policy);
        let settings = FilterSettings::default();
        Denoiser::new(&gpu, &renderer, find("atrous").unwrap(), &settings, demodulation, Fireflies::Off)
            .err()
            .map(|e| e.to_string())
    };
    let has =
        |error: Option<String>, word: &str| assert!(error.as_ref().is_some_and(|e| e.contains(word)), "{error:?}");
    has(refused(Outputs { guides: false, ..Outputs::FILTERED }, "uniform", Demodulation::Off), "Outputs::guides");
    has(
        refused(Outputs { split_light: false, ..Outputs::FILTERED }, "uniform", Demodulation::Light),
        "Outputs::split_light",
    );
    assert_eq!(refused(Outputs::FILTERED, "geometry", Demodulation::Light), None);
    for demodulation in [Demodulation::Albedo, Demodulation::Off] {
        assert_eq!(refused(Outputs { split_light: false, ..Outputs::FILTERED }, "geometry", demodulation), None);
    }
    let sparse = renderer_of(&gpu, [8, 8], Outputs::FILTERED, "uniform", 2, 0.0);
    for demodulation in [Demodulation::Albedo, Demodulation::Off] {
        let whole = Denoiser::new(
            &gpu,
            &sparse,
            find("atrous").unwrap(),
            &FilterSettings::default(),
            demodulation,
            Fireflies::Off,
        )
        .err();
        has(whole.map(|e| e.to_string()), "not every pixel has (indirect_stride)");
    }
    let renderer = renderer(&gpu, [8, 8], Outputs::FILTERED, "uniform");
    let wrong = FilterSettings::default().with(|s| s.edge.extent = -1.0);
    has(
        Denoiser::new(&gpu, &renderer, find("atrous").unwrap(), &wrong, Demodulation::Light, Fireflies::Off)
            .err()
            .map(|e| e.to_string()),
        "extent",
    );
    let right = FilterSettings::default();
    let foreign =
        Denoiser::new(&other, &renderer, find("atrous").unwrap(), &right, Demodulation::Light, Fireflies::Off);
    has(foreign.err().map(|e| e.to_string()), "the renderer was made on another device");
    assert_silent(&gpu);
}

#[test]
fn settings_for_a_scene_are_near_those_that_its_image_tells() {
    let gpu = gpu();
    let renderer = renderer(&gpu, [33, 17], Outputs::FILTERED, "uniform");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.toml");
    let settings = FilterSettings::for_scene(&Scene::load(&file).unwrap());
    let denoiser =
        Denoiser::new(&gpu, &renderer, find("svgf").unwrap(), &settings, Demodulation::Albedo, Fireflies::Off).unwrap();
    Job::new(&renderer).run_to_end(&mut FrameResources::new(&gpu).unwrap()).unwrap();
    gpu.run(&mut FrameResources::new(&gpu).unwrap(), |rec| denoiser.record(rec)).unwrap();
    let told = settings.scaled_by(&denoiser.scales().unwrap());
    let ratio = settings.edge.extent / told.edge.extent;
    assert!((0.8..1.25).contains(&ratio), "{} of {}", settings.edge.extent, told.edge.extent);
    assert_eq!(FilterSettings::for_scene(&Scene::default()), FilterSettings::default(), "no surface, no size");
}

#[test]
fn what_no_binding_holds_is_refused_beforehand() {
    let gpu = gpu();
    let most = (gpu.info().max_storage_range / 16).min(gpu.info().max_texel_elements / 3) as u32;
    let rows = most / 50_000;
    check_size(&gpu, [50_000, rows]).unwrap();
    let long = [60_001, 1].map(|edge| [edge, 60_002 - edge]);
    let long = long.into_iter().filter(|_| gpu.info().kind == DeviceKind::Cpu);
    for size in long.chain([[50_000, rows + 1], [49_993, most / 49_993 + 1]]) {
        let refused = check_size(&gpu, size).unwrap_err();
        assert!(refused.exit_code() == 4 && refused.to_string().contains(&most.to_string()), "{refused}");
        assert!(refused.to_string().contains("the width counted up to a multiple of 8"), "{refused}");
    }
}
