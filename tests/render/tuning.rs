//! Tests that pictures have the same bits whatever sizes work is divided into: those that suit a GPU render, place samples and
//! filter here as those that suit a CPU.
use crate::support::{assert_silent, render, tuned_gpu};
use std::path::Path;
use tallow::denoise::filter::{FILTERS, FilterSettings, Method, Row, firefly::Fireflies};
use tallow::denoise::{Demodulation, Denoiser, Noisy, Recipe, timed};
use tallow::error::Error;
use tallow::gpu::{DeviceOptions, FrameResources, Gpu, Tuning};
use tallow::image;
use tallow::layout::{Guide, vec4};
use tallow::render::settings::Settings;
use tallow::render::{Counters, FilmTile, Job, Outputs, Renderer};
use tallow::scene::{Loaded, Scene};

/// All layers that a renderer keeps, and its counters.
pub const OUTPUTS: Outputs = Outputs { split_light: true, guides: true, counters: true };

/// A scene that the repository ships, on a small film.
pub fn scene(file: &str, policy: &str) -> Loaded {
    let small = |s: &mut Settings| {
        (s.width, s.height, s.spp) = (65, 33, 4);
        s.allocate.policy = tallow::allocate::policy(policy).unwrap();
    };
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(file);
    Scene::load(&file).unwrap().with(small)
}

/// The words that values are made of.
pub fn bits<T: bytemuck::Pod>(values: &[T]) -> Vec<u32> {
    bytemuck::cast_slice(values).to_vec()
}

/// Every word that a render leaves: pixels, light, primary hits and counters.
pub fn film(gpu: &Gpu, scene: &Loaded) -> ([Vec<u32>; 3], Counters) {
    let renderer = Renderer::new(gpu, scene, &scene.settings, OUTPUTS).unwrap();
    let stats = render(gpu, &renderer);
    let tile = &renderer.film().tiles[0];
    let (light, guide) = (tile.light.read().unwrap(), tile.guide.read().unwrap());
    ([bits(&stats), bits(&light), bits(&guide)], renderer.counters().unwrap())
}

fn filtered(gpu: &Gpu, scene: &Loaded, filters: impl Fn(&str) -> bool) -> Vec<(&'static str, Vec<vec4>)> {
    let renderer = Renderer::new(gpu, scene, &scene.settings, OUTPUTS).unwrap();
    render(gpu, &renderer);
    let filter = |row: &&Row| {
        let denoiser =
            Denoiser::new(gpu, &renderer, row, &FilterSettings::default(), Demodulation::Light, Fireflies::Off)
                .unwrap();
        gpu.run(&mut FrameResources::new(gpu).unwrap(), |rec| denoiser.record(rec)).unwrap();
        (row.name, denoiser.picture().read().unwrap())
    };
    FILTERS.iter().filter(|row| filters(row.name)).map(filter).collect()
}

#[test]
fn a_gpus_sizes_leave_the_bits_of_renders() {
    let [cpu, gpu] = [Tuning::CPU, Tuning::GPU].map(tuned_gpu);
    for (file, policy) in [
        ("cornell-box/glass.toml", "both"),
        ("cornell-box/scene.toml", "geometry"),
        ("grass/scene.toml", "uniform"),
        ("bust/scene.toml", "variance"),
        ("moving/scene.toml", "threshold"),
    ] {
        let scene = scene(file, policy);
        assert!(film(&cpu, &scene) == film(&gpu, &scene), "{file}, {policy}");
    }
    [cpu, gpu].iter().for_each(assert_silent);
}

/// Filters with windows whose elements [`Tuning::windows`] lets add up in another order.
const WINDOWED: [&str; 2] = ["guided", "auto"];

/// Where windows begin decides in which order a window's few hundred floats are added, each of which rounds by 2^-24. The
/// largest difference seen was 1e-6 of a value, or 1.5e-8 of a dark one.
fn alike(one: &[vec4], other: &[vec4]) -> bool {
    one.iter()
        .flatten()
        .zip(other.iter().flatten())
        .all(|(a, b)| (a - b).abs() <= 4e-6 * a.abs().max(b.abs()).max(0.02))
}

#[test]
fn a_gpus_sizes_leave_the_bits_of_filters() {
    let scene = scene("cornell-box/scene.toml", "uniform");
    let of_windows = |windows| Tuning { windows, ..Tuning::GPU };
    let gpus = [Tuning::CPU, of_windows(0), Tuning::GPU, of_windows(1)].map(tuned_gpu);
    let [cpu, same] = [0, 1].map(|i| filtered(&gpus[i], &scene, |_| true));
    for ((filter, cpu), (_, same)) in cpu.iter().zip(&same) {
        assert!(bits(cpu) == bits(same), "{filter}");
    }
    // Kernels of the others know nothing of windows: they are what they were. Those in `auto` are those of `guided`, which
    // `windows_hold_however_threads_share_them` compares with its twin in any number.
    for (gpu, windowed) in gpus[2..].iter().zip([&WINDOWED[..], &WINDOWED[..1]]) {
        let others = filtered(gpu, &scene, |name| windowed.contains(&name));
        assert_eq!(others.len(), windowed.len());
        for (filter, other) in &others {
            let (_, cpu) = cpu.iter().find(|(name, _)| name == filter).unwrap();
            assert!(alike(cpu, other), "{filter}");
        }
    }
    gpus.iter().for_each(assert_silent);
}

#[test]
fn workgroups_leave_the_bits_of_filters() {
    let large = |s: &mut Settings| (s.width, s.height, s.spp) = (300, 300, 1); // two of the largest in a row
    let scene = scene("cornell-box/scene.toml", "uniform").with(large);
    let [usual, others @ ..] = [32, 128, 256].map(|filter_workgroup| {
        let gpu = tuned_gpu(Tuning { filter_workgroup, ..Tuning::CPU });
        // Kernels of these two have workgroups of lines, or no pixels around their own.
        let pictures = filtered(&gpu, &scene, |name| !["guided", "none"].contains(&name));
        assert_silent(&gpu);
        pictures
    });
    for ((filter, usual), (_, other)) in others.iter().flat_map(|other| usual.iter().zip(other)) {
        assert!(bits(usual) == bits(other), "{filter}");
    }
}

/// Every switch of renders by itself, and all together, none of which changes a bit.
fn switches() -> Vec<(&'static str, Tuning)> {
    let own = Tuning { deals: false, ..Tuning::CPU };
    vec![
        ("native_bits", Tuning { native_bits: true, ..own }),
        ("triangles_a_step", Tuning { triangles_a_step: 2, ..own }),
        ("triangles_a_step and deals", Tuning { triangles_a_step: 1, ..Tuning::CPU }),
        ("wavefront", Tuning { wavefront: true, triangles_a_step: 2, ..own }),
        ("interleaves", Tuning { interleaves: true, thread_items: 5, ..Tuning::CPU }),
        ("all", Tuning { native_bits: true, triangles_a_step: 2, interleaves: true, ..Tuning::GPU }),
    ]
}

#[test]
fn switches_leave_the_bits_of_renders() {
    let cpu = tuned_gpu(Tuning::CPU);
    let scenes = [
        ("cornell-box/glass.toml", "both"),
        ("grass/scene.toml", "uniform"),
        ("bust/scene.toml", "variance"),
        ("moving/scene.toml", "threshold"),
    ]
    .map(|(file, policy)| (file, scene(file, policy)));
    let films = scenes.each_ref().map(|(_, scene)| film(&cpu, scene));
    for (switch, tuning) in switches() {
        let gpu = tuned_gpu(tuning);
        for ((file, scene), usual) in scenes.iter().zip(&films) {
            assert!(film(&gpu, scene) == *usual, "{switch}: {file}");
        }
        assert_silent(&gpu);
    }
}

/// What [`film`] returns but for counters, of a film in so many buffers, with what the lens blurs and what is seen in smooth surfaces,
/// and the channels of its file.
fn film_of_tiles(gpu: &Gpu, scene: &Loaded, tiles: usize) -> (Vec<Vec<u32>>, image::Film) {
    let renderer = Renderer::new(gpu, scene, &scene.settings, OUTPUTS).unwrap();
    let status = Job::new(&renderer).run_to_end(&mut FrameResources::new(gpu).unwrap()).unwrap();
    let film = &renderer.film().tiles;
    assert_eq!(film.len(), tiles);
    let all = |of: &dyn Fn(&FilmTile) -> Vec<u32>| film.iter().flat_map(of).collect::<Vec<_>>();
    let layers = vec![
        all(&|tile| bits(&tile.stats.read().unwrap()[..tile.pixels as usize])),
        all(&|tile| bits(&tile.light.read().unwrap()[..tile.pixels as usize])),
        all(&|tile| bits(&tile.guide.read().unwrap()[..tile.pixels as usize])),
        all(&|tile| bits(&tile.seen.read().unwrap()[..tile.pixels as usize])),
    ];
    assert!(Noisy::of_film(&renderer).is_ok() == (tiles == 1));
    (layers, Job::new(&renderer).film(&status).unwrap())
}

#[test]
fn films_in_several_buffers_have_the_bits_of_one() {
    // Of 64 pixels a guide: 2145 of them take 34, the last of which is cut.
    let tuning = Tuning { film_buffer_bytes: 64 * size_of::<Guide>() as u64, ..Tuning::CPU };
    let [one, many] = [Tuning::CPU, tuning].map(tuned_gpu);
    for (size, tiles) in [([65, 33], 34), ([1, 65], 2), ([64, 1], 1)] {
        let scene = scene("cornell-box/glass.toml", "uniform").with(|s| [s.width, s.height] = size);
        let ((usual, whole), (divided, file)) = (film_of_tiles(&one, &scene, 1), film_of_tiles(&many, &scene, tiles));
        assert!(usual == divided, "{size:?}");
        let samples = |film: &image::Film| -> Vec<_> {
            film.channels
                .iter()
                .map(|c| (c.name.clone(), (0..film.pixels()).map(|i| c.samples.at(i).to_bits()).collect::<Vec<_>>()))
                .collect()
        };
        assert!(samples(&whole) == samples(&file), "{size:?}");
    }
    // Samples are placed in films of one buffer alone.
    let placed = scene("cornell-box/glass.toml", "geometry");
    let why = Renderer::new(&many, &placed, &placed.settings, OUTPUTS).err().map(|why| why.to_string());
    assert!(why.as_ref().is_some_and(|why| why.contains("choose at most 64 pixels")), "{why:?}");
    [one, many].iter().for_each(assert_silent);
}

/// The first sample that is no number is told by its pixel in the whole film.
#[test]
fn a_broken_sample_is_told_by_its_place_in_all_buffers() {
    let gpu = tuned_gpu(Tuning { film_buffer_bytes: 64 * size_of::<Guide>() as u64, ..Tuning::CPU });
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/broken.toml");
    let text = "[film]\nwidth = 21\nheight = 21\nfilter = 'point'\n[camera]\nposition = [0, 0, 2]\ntarget = [0, 0, 0]\n[render]\nspp = 4\n\
        max_depth = 2\n[[mesh]]\nshape = 'rectangle'\n[[light]]\ntype = 'point'\nposition = [0, 0, 1e-5]\nintensity = [1e30, 1e30, 1e30]\n";
    let scene = Scene::parse(&path, text).unwrap();
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, OUTPUTS).unwrap();
    let status = Job::new(&renderer).run_to_end(&mut FrameResources::new(&gpu).unwrap()).unwrap();
    let broken = status.broken_samples.unwrap();
    assert_eq!((broken.pixel, broken.sample, renderer.film().tiles.len()), ([10, 10], 0, 7));
    assert_silent(&gpu);
}

/// Software devices end loops after 65,535 turns, and what is left of a pixel's samples would be lost: see
/// `glsl/shared/loop_limit.glsl`.
#[test]
fn no_sizes_lose_samples_of_a_pixel_with_many() {
    const SPP: u32 = (1 << 20) + (1 << 18);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/sky.toml");
    let text = "[environment]\nradiance = [1, 1, 1]\n[[mesh]]\nshape = \"rectangle\"\n";
    let one_pixel = |s: &mut Settings| {
        (s.width, s.height, s.spp, s.max_depth) = (1, 1, SPP, 1);
        s.allocate.policy = tallow::allocate::policy("geometry").unwrap();
    };
    let scene = Scene::parse(&path, text).unwrap().with(one_pixel);
    let [usual, large] = [Tuning::CPU, Tuning { thread_items: 1024, ..Tuning::GPU }].map(|tuning| {
        let gpu = tuned_gpu(tuning);
        let stats = render(&gpu, &Renderer::new(&gpu, &scene, &scene.settings, Outputs::default()).unwrap());
        assert_silent(&gpu);
        stats
    });
    assert_eq!((large[0].count, bits(&large)), (SPP, bits(&usual)));
}

/// Open Image Denoise need not be there: the size is looked at first.
#[test]
fn every_method_refuses_an_image_with_too_long_an_edge_before_it_is_timed() {
    let scene = scene("cornell-box/scene.toml", "uniform");
    let gpu = tuned_gpu(Tuning { longest_edge: 64, ..Tuning::CPU });
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, OUTPUTS).unwrap();
    for method in [Method::Oidn, Method::Kernels(FILTERS[1])] {
        let noisy = Noisy::of_film(&renderer).unwrap();
        let why = timed(&gpu, noisy, &Recipe::new(method)).err().map(|why| why.to_string()).unwrap_or_default();
        assert!(why.contains("65 x 33 is too large to filter"), "{}: {why}", method.name());
    }
}

#[test]
fn sizes_that_cannot_be_are_refused() {
    for (name, tuning) in [
        ("workgroup", Tuning { workgroup: 0, ..Tuning::GPU }),
        ("thread_items", Tuning { thread_items: 0, ..Tuning::CPU }),
        ("lines", Tuning { lines: 0, ..Tuning::GPU }),
        ("filter_workgroup", Tuning { filter_workgroup: 0, ..Tuning::GPU }),
    ] {
        let refused = Gpu::open(&DeviceOptions { tuning: Some(tuning), ..DeviceOptions::default() }).err();
        assert!(matches!(&refused, Some(Error::Usage(why)) if why.contains(name)), "{refused:?}");
    }
}
