//! Tests that the light of the key light is kept apart without the noise of the choice among lights.
use crate::support::{self, assert_silent, gpu};
use glam::Vec3;
use std::f32::consts::PI;
use std::path::Path;
use tallow::denoise::filter::{Method, find};
use tallow::denoise::{Filtered, Noisy, Recipe};
use tallow::gpu::Gpu;
use tallow::layout::{Guide, LIGHT_SPOT, PixelLight};
use tallow::render::{Outputs, Renderer};
use tallow::scene::{Loaded, Scene};
use tallow::shaders::shared::light::EVEN_SHARE;
use tallow::shaders::shared::sample_marks::ALL_PASSED_OVER;
use tallow::twins::light_tree::spot_share;

const ALBEDO: f32 = 0.5;
/// Place and intensity of two bulbs above a floor.
const BULBS: [([f32; 3], f32); 2] = [([-0.8, 0.8, 0.0], 1.0), ([0.8, 0.8, 0.2], 2.0)];

/// A floor seen from above.
fn floor(spp: u32) -> String {
    format!(
        "[film]\nwidth = 80\nheight = 61\n[camera]\nposition = [0.0, 3.0, 0.5]\ntarget = [0.0, 0.0, 0.0]\nfov = 50.0\n\
         [render]\nspp = {spp}\nmax_depth = 2\n[[material]]\nname = 'floor'\ncolor = {ALBEDO}\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'floor'\ntransform = {{ rotate = [-90.0, 0.0, 0.0], scale = 9.0 }}\n"
    )
}

fn two_bulbs(spp: u32) -> Loaded {
    let mut text = floor(spp);
    for (position, intensity) in BULBS {
        text += &format!("[[light]]\ntype = 'point'\nposition = {position:?}\nintensity = {intensity}\n");
    }
    Scene::parse(Path::new("bulbs.toml"), &text).unwrap()
}

/// What each bulb brings to the camera from a point of the floor, albedo / pi times intensity times cosine over squared distance; the
/// stronger one first.
fn brought(at: &Guide) -> [f32; 2] {
    let [x, _, z] = at.position;
    let mut each = BULBS.map(|([px, height, pz], intensity)| {
        let d2 = (x - px).powi(2) + height * height + (z - pz).powi(2);
        ALBEDO / PI * intensity * height / d2.powf(1.5)
    });
    each.sort_by(|a, b| b.total_cmp(a));
    each
}

/// The share of the stronger bulb's light that is kept, as both are chosen by what they bring.
fn kept_share([key, other]: [f32; 2]) -> f32 {
    let [key, other] = [key, other].map(|brings| (1.0 - EVEN_SHARE) * brings / (key + other) + 0.5 * EVEN_SHARE);
    1.0 - (other / key).powi(2) // it is chosen at least half of the time
}

/// A render: its light and guides, and what `auto` makes of it.
fn rendered(gpu: &Gpu, scene: &Loaded) -> (Vec<PixelLight>, Vec<Guide>, Vec<f32>) {
    let renderer = Renderer::new(gpu, scene, &scene.settings, Outputs::FILTERED).unwrap();
    support::render(gpu, &renderer);
    let tile = &renderer.film().tiles[0];
    let recipe = Recipe::new(Method::Kernels(find("auto").unwrap()));
    let clean = Filtered::new(gpu, Noisy::of_film(&renderer).unwrap(), &recipe).unwrap().join(gpu).unwrap();
    (tile.light.read().unwrap(), tile.guide.read().unwrap(), clean.colour[1].clone())
}

/// Of two bulbs the stronger one at a place is chosen in proportion to what it brings, and so seldom as half of the time: direct light is
/// a share of what it brings, but for the spread of the samples over the pixel. That share is 0 where both are alike, so that light has no
/// step where another bulb becomes the stronger one.
#[test]
fn key_light_has_no_noise_of_the_choice_of_lights() {
    let gpu = gpu();
    let (light, guide, _) = rendered(&gpu, &two_bulbs(4));
    let mut small = 0;
    for (l, at) in light.iter().zip(&guide) {
        let both = brought(at);
        let (share, kept) = (kept_share(both), l.direct[0] / both[0]);
        // Where both are as likely, samples may take each for the key light, and all pass it over.
        let known = l.remainder == 0 || share < 0.3;
        let off = if l.remainder == 0 { kept - share } else { 0.0 };
        assert!(
            known && off.abs() < if share > 0.5 { 0.08 } else { 0.15 },
            "{l:?} at {:?}, expected {share} of {both:?}",
            at.position
        );
        small += usize::from(share < 0.3);
    }
    assert!((150..900).contains(&small), "control: {small} pixels");
    // Of one sample, those that chose the other bulb know nothing.
    let (light, guide, _) = rendered(&gpu, &two_bulbs(1));
    let passed_over = |l: &PixelLight| l.remainder == ALL_PASSED_OVER;
    let share = light.iter().filter(|l| passed_over(l)).count() as f32 / light.len() as f32;
    let weaker = |at: &Guide| {
        let [key, other] = brought(at);
        (1.0 - EVEN_SHARE) * other / (key + other) + 0.5 * EVEN_SHARE
    };
    let expected = guide.iter().map(weaker).sum::<f32>() / guide.len() as f32;
    assert!((share - expected).abs() < 0.03, "{share} of the pixels pass over the key light, expected are {expected}");
    assert!(light.iter().all(|l| !passed_over(l) || l.direct == [0.0; 3]));
    assert_silent(&gpu);
}

/// Both bulbs light the floor everywhere, so that all light has the noise of an even share of the choices alone, which a filter takes. What
/// is kept from it had the noise of all choices, whose grain and rings showed on smooth floors.
#[test]
fn floors_that_bulbs_light_have_no_grain_behind_a_filter() {
    let gpu = gpu();
    for (spp, most) in [(1, 0.045), (4, 0.01)] {
        let (_, guide, clean) = rendered(&gpu, &two_bulbs(spp));
        let off = |(c, at): (&f32, &Guide)| (c / brought(at).iter().sum::<f32>() - 1.0).powi(2);
        let error = (clean.iter().zip(&guide).map(off).sum::<f32>() / clean.len() as f32).sqrt();
        assert!(error < most, "{spp} samples: {error}");
    }
    assert_silent(&gpu);
}

/// A floor in the sun, with a spot above it. Outside of the spot's cone all samples choose the sun, whose light is kept whole; in it they are
/// shared so that neither light is grainy, and no rim shows behind a filter where the share of the one that is kept changes.
#[test]
fn floors_in_the_sun_have_no_grain_where_a_spot_lights_them() {
    let gpu = gpu();
    let (irradiance, slope) = (2.0, [0.6, -0.8, 0.0]);
    for (spp, most) in [(1, 0.13), (4, 0.025)] {
        let text = format!(
            "{}[[light]]\ntype = 'directional'\ndirection = {slope:?}\nirradiance = {irradiance}\n\
             [[light]]\ntype = 'spot'\nposition = [0.2, 1.5, 0.1]\ndirection = [0.1, -1.0, 0.0]\ncutoff = 30.0\nintensity = 9.0\n",
            floor(spp)
        );
        let scene = Scene::parse(Path::new("spot.toml"), &text).unwrap();
        let (light, guide, clean) = rendered(&gpu, &scene);
        let spot = scene.lights.iter().find(|light| light.kind == LIGHT_SPOT).unwrap();
        let sun = ALBEDO / PI * irradiance * -slope[1];
        let (mut sum, mut pool) = (0.0, 0);
        for ((l, clean), at) in light.iter().zip(&clean).zip(&guide) {
            let way = Vec3::from(spot.a) - Vec3::from(at.position);
            let share = spot_share(spot, way.normalize());
            let spot = ALBEDO / PI * spot.value[0] * share * way.y / way.length().powi(3);
            sum += (clean / (sun + spot) - 1.0).powi(2);
            pool += usize::from(share > 0.0);
            let outside = way.y < way.length() * 0.8;
            let whole = l.remainder == 0 && (l.direct[0] / sun - 1.0).abs() < 1e-3;
            assert!(!outside || whole, "{l:?} at {:?}, expected {sun}", at.position);
        }
        let error = (sum / light.len() as f32).sqrt();
        assert!(error < most, "{spp} samples: {error}");
        assert!((light.len() / 10..light.len() / 2).contains(&pool), "control: {pool} pixels");
    }
    assert_silent(&gpu);
}

/// A sun and bulbs below a floor, whose side that is seen gets light from a sky of radiance 1 alone: albedo. Samples that choose the others
/// bring nothing, and none of them is a key light.
#[test]
fn a_floor_that_no_lamp_lights_has_the_light_of_the_sky() {
    let gpu = gpu();
    let mut text = floor(16) + "[environment]\nradiance = 1.0\n";
    text += "[[light]]\ntype = 'directional'\ndirection = [0.2, 1.0, 0.0]\nirradiance = 3.0\n";
    for [x, y, z] in BULBS.map(|(position, _)| position) {
        text += &format!("[[light]]\ntype = 'point'\nposition = {:?}\nintensity = 20.0\n", [x, -y, z]);
    }
    let scene = Scene::parse(Path::new("below.toml"), &text).unwrap();
    assert!(scene.weighed_lights && scene.lights.iter().any(|l| l.is_delta() && l.probability > 0.1), "control");
    let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
    support::render(&gpu, &renderer);
    let tile = &renderer.film().tiles[0];
    assert!(tile.light.read().unwrap().iter().all(|l| l.direct == [0.0; 3] && l.remainder & ALL_PASSED_OVER == 0));
    let all: Vec<f64> = tile.stats.read().unwrap().iter().map(|s| f64::from(s.mean[0])).collect();
    let n = all.len() as f64;
    let mean = all.iter().sum::<f64>() / n;
    let error = (all.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n / (n - 1.0)).sqrt();
    assert!((mean - f64::from(ALBEDO)).abs() < 4.0 * error && error < 0.005, "{mean} +- {error}");
    assert_silent(&gpu);
}
