//! Tests that renders with different seeds are rarely called different.
use crate::support;
use std::path::Path;
use tallow::gpu::Gpu;
use tallow::image::significance::{Estimate, Noise, Options, Verdict, test};
use tallow::render::{Outputs, Renderer};
use tallow::scene::Scene;

/// Edge of the images, and of the pieces that they are cut into.
const EDGE: u32 = 64;
const PIECE: u32 = 16;

/// A render of the Cornell box with a ball of glass, whose caustic is what heavy tails are.
fn render(gpu: &Gpu, spp: u32, seed: u32) -> Estimate {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/cornell-box/glass.toml");
    let scene = Scene::load(&scene).unwrap().with(|s| {
        (s.width, s.height, s.spp, s.seed) = (EDGE, EDGE, spp, seed);
    });
    let renderer = Renderer::new(gpu, &scene, &scene.settings, Outputs::default()).unwrap();
    let stats = support::render(gpu, &renderer);
    let m2 = stats.iter().map(|s| s.m2).collect();
    let count = stats.iter().map(|s| s.count as f32).collect();
    let mean = stats.iter().map(|s| s.mean).collect();
    Estimate { width: EDGE, height: EDGE, mean, noise: Noise::Samples { m2, count }, objects: None }
}

/// The pieces of an image, whose pixels have independent noise.
fn pieces(image: &Estimate) -> Vec<Estimate> {
    let along = EDGE / PIECE;
    let of = |piece: u32| {
        let first = piece / along * PIECE * EDGE + piece % along * PIECE;
        let pixels = (0..PIECE * PIECE).map(|i| (first + i / PIECE * EDGE + i % PIECE) as usize);
        let Noise::Samples { m2, count } = &image.noise else { panic!("of samples") };
        let noise = Noise::Samples {
            m2: pixels.clone().map(|i| m2[i]).collect(),
            count: pixels.clone().map(|i| count[i]).collect(),
        };
        let mean = pixels.map(|i| image.mean[i]).collect();
        Estimate { width: PIECE, height: PIECE, mean, noise, objects: None }
    };
    (0..along * along).map(of).collect()
}

#[test]
fn of_hundreds_of_pairs_of_renders_no_more_than_the_rate_are_called_different() {
    let gpu = support::gpu();
    let images: Vec<_> = (0..8).map(|i| pieces(&render(&gpu, if i % 2 == 0 { 16 } else { 64 }, i))).collect();
    let options = Options { false_alarms: 0.05, ..Options::default() };
    let (mut pairs, mut different) = (0, 0);
    for (i, a) in images.iter().enumerate() {
        for b in &images[..i] {
            let called = |(a, b)| test(a, b, &options).unwrap().verdict == Verdict::Different;
            different += a.iter().zip(b).filter(|pair| called(*pair)).count();
            pairs += a.len();
        }
    }
    assert!(pairs > 400 && different <= pairs / 20, "{different} of {pairs}");
    // Control: a piece beside another is different.
    let other = test(&images[0][5], &images[1][6], &options).unwrap();
    assert_eq!(other.verdict, Verdict::Different);
    support::assert_silent(&gpu);
}
