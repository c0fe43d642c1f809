//! Frames filtered where they were rendered, against the same frames as files: taken apart, filtered and put together by
//! the twins.
#[path = "support/picture.rs"]
mod picture;
mod support;

use std::path::Path;
use support::{assert_silent, gpu, hash};
use tallow::denoise::Denoiser;
use tallow::denoise::composition::{Demodulation, split};
use tallow::denoise::filter::{FilterSettings, check_size, find};
use tallow::gpu::{DeviceKind, FrameResources, Gpu};
use tallow::image::aov::{Aovs, Names};
use tallow::image::{Film, Samples};
use tallow::layout::{Guide, PixelLight, PixelStats, vec3, vec4};
use tallow::render::settings::Settings;
use tallow::render::{Outputs, Renderer};
use tallow::scene::Scene;
use tallow::statistics::variance_of_mean;

const SIZES: [[u32; 2]; 6] = [[1, 1], [31, 1], [1, 65], [64, 2], [65, 3], [33, 17]];
const ALL: Outputs = Outputs { split_light: true, guides: true, counters: false };

/// What a renderer leaves.
struct Frame {
    size: [u32; 2],
    stats: Vec<PixelStats>,
    light: Vec<PixelLight>,
    guide: Vec<Guide>,
}

impl Frame {
    /// Walls of many colours under noise, lamps among them, and with `broken` everything that no frame should hold.
    fn new(size: [u32; 2], broken: bool) -> Self {
        let mut frame = Self { size, stats: Vec::new(), light: Vec::new(), guide: Vec::new() };
        for i in 0..size[0] * size[1] {
            let unit = |salt: u32| hash(i.wrapping_mul(8) + salt) as f32 / 4_294_967_296.0;
            let is_lamp = i % 23 == 7;
            let albedo = if is_lamp { [0.0; 3] } else { [0, 1, 2].map(|c| 0.005 + 0.9 * unit(c)) };
            let indirect = [unit(4), 0.3 * unit(5), 1.0];
            let mut light =
                PixelLight { direct: [unit(3); 3], indirect_m2: 2.0 * unit(7), indirect, ..PixelLight::default() };
            if is_lamp {
                light = PixelLight { direct: [20.0; 3], ..PixelLight::default() };
            }
            let mut mean: vec3 = std::array::from_fn(|c| light.direct[c] + albedo[c] * light.indirect[c]);
            let mut guide = Guide { normal: [0.0, 0.6, 0.8], depth: 2.0 + unit(6), albedo, ..Guide::default() };
            guide.position = [unit(0), unit(1), -guide.depth];
            match i % 37 {
                3 if broken => mean[1] = f32::NAN,
                5 if broken => light.direct[2] = f32::INFINITY,
                9 if broken => light.indirect = [0.0, -1.0, f32::NAN],
                11 if broken => guide.albedo[0] = f32::NAN,
                14 if broken => guide.albedo = [f32::INFINITY; 3],
                17 if broken => mean = [0.0; 3],
                _ => {}
            }
            let count = 1 + hash(i) % 4;
            frame.stats.push(PixelStats { mean, count, m2: mean.map(|v| v * v * count as f32), remainder: 0 });
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
        add("indirect", |f, i| f.light[i].indirect);
        add("albedo", |f, i| f.guide[i].albedo);
        add("N", |f, i| f.guide[i].normal);
        add("P", |f, i| f.guide[i].position);
        film.add("indirect.m2", Samples::F32(self.light.iter().map(|l| l.indirect_m2).collect()));
        film.add("Z", Samples::F32(self.guide.iter().map(|g| g.depth).collect()));
        film.add("samples", Samples::U32(self.stats.iter().map(|s| s.count).collect()));
        film.metadata.insert("software".to_owned(), "tallow test".to_owned());
        film
    }

    fn on_the_host(&self, filter: &str, settings: &FilterSettings, demodulation: Demodulation) -> Vec<vec4> {
        let film = self.film();
        let parts = split(&Aovs::find(&film, &Names::new()).unwrap(), demodulation);
        let filtered = (find(filter).unwrap().reference)(&parts.input, settings);
        parts.join(&filtered).into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect()
    }

    fn on_the_device(
        &self,
        gpu: &Gpu,
        renderer: &Renderer,
        filter: &str,
        settings: &FilterSettings,
        demodulation: Demodulation,
    ) -> Vec<vec4> {
        let tile = &renderer.film().tiles[0];
        tile.stats.write(0, &self.stats).unwrap();
        tile.light.write(0, &self.light).unwrap();
        tile.guide.write(0, &self.guide).unwrap();
        let denoiser = Denoiser::new(gpu, renderer, find(filter).unwrap(), settings, demodulation).unwrap();
        gpu.run(&mut FrameResources::new(gpu).unwrap(), |rec| denoiser.record(rec)).unwrap();
        denoiser.picture().read().unwrap()
    }
}

fn renderer(gpu: &Gpu, size: [u32; 2], outputs: Outputs, policy: &str) -> Renderer {
    let small = |s: &mut Settings| {
        [s.width, s.height] = size;
        (s.spp, s.max_depth) = (4, 3);
        (s.allocate.policy, s.allocate.min_spp) = (tallow::allocate::policy(policy).unwrap(), 0);
    };
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/scene.toml");
    let scene = Scene::load(&file).unwrap().with(small);
    Renderer::new(gpu, &scene, &scene.settings, outputs).unwrap()
}

#[test]
fn frames_are_taken_apart_and_put_together_as_files_are() {
    let gpu = gpu();
    let settings = FilterSettings::default().with(|s| s.edge.extent = 3.0);
    for size in SIZES {
        let renderer = renderer(&gpu, size, ALL, "uniform");
        for frame in [false, true].map(|broken| Frame::new(size, broken)) {
            let of = |filter, demodulation| {
                let device = frame.on_the_device(&gpu, &renderer, filter, &settings, demodulation);
                let host = frame.on_the_host(filter, &settings, demodulation);
                let off = picture::apart(&device, &host, 1e-3);
                assert!(off < 1e-4, "{filter} {demodulation:?} {size:?}: {off}");
                assert!(device.iter().flatten().all(|v| v.is_finite()), "{filter} {demodulation:?} {size:?}");
                device
            };
            let all = [Demodulation::Light, Demodulation::Albedo, Demodulation::Off];
            let pictures = [("none", all[0]), ("svgf", all[0]), ("svgf", all[1]), ("svgf", all[2]), ("none", all[1])];
            let pictures = pictures.map(|(filter, demodulation)| of(filter, demodulation));
            let differ = |i: usize| picture::apart(&pictures[i], &pictures[i + 1], 1e-3) > 1e-2;
            assert!(size == [1, 1] || (0..4).all(differ), "control: filters and demodulations differ");
        }
    }
    assert_silent(&gpu);
}

#[test]
fn a_frame_without_what_the_filter_needs_is_refused() {
    let gpu = gpu();
    let refused = |outputs, policy, demodulation| {
        let renderer = renderer(&gpu, [8, 8], outputs, policy);
        let settings = FilterSettings::default();
        Denoiser::new(&gpu, &renderer, find("atrous").unwrap(), &settings, demodulation).err().map(|e| e.to_string())
    };
    let has =
        |error: Option<String>, word: &str| assert!(error.as_ref().is_some_and(|e| e.contains(word)), "{error:?}");
    has(refused(Outputs { guides: false, ..ALL }, "uniform", Demodulation::Off), "Outputs::guides");
    has(refused(Outputs { split_light: false, ..ALL }, "uniform", Demodulation::Light), "Outputs::split_light");
    has(refused(ALL, "geometry", Demodulation::Light), "min_spp");
    for demodulation in [Demodulation::Albedo, Demodulation::Off] {
        assert_eq!(refused(Outputs { split_light: false, ..ALL }, "geometry", demodulation), None);
    }
    let renderer = renderer(&gpu, [8, 8], ALL, "uniform");
    let wrong = FilterSettings::default().with(|s| s.edge.extent = -1.0);
    has(
        Denoiser::new(&gpu, &renderer, find("atrous").unwrap(), &wrong, Demodulation::Light)
            .err()
            .map(|e| e.to_string()),
        "extent",
    );
    assert_silent(&gpu);
}

#[test]
fn what_no_binding_holds_is_refused_beforehand() {
    let gpu = gpu();
    let most = (gpu.info().max_storage_range / 16).min(gpu.info().max_texel_elements / 3) as u32;
    let rows = most / 50_000;
    check_size(&gpu, [50_000, rows], 3).unwrap();
    let long = [60_001, 1].map(|edge| [edge, 60_002 - edge]);
    let long = long.into_iter().filter(|_| gpu.info().kind == DeviceKind::Cpu);
    for size in long.chain([[50_000, rows + 1], [49_993, most / 49_993 + 1]]) {
        let refused = check_size(&gpu, size, 3).unwrap_err();
        assert!(refused.exit_code() == 4 && refused.to_string().contains(&most.to_string()), "{refused}");
    }
}
