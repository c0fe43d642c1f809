//! Tests what filters make of pictures through a lens.
use crate::support::{self, assert_silent, gpu};
use std::path::Path;
use tallow::denoise::filter::{Method, find};
use tallow::denoise::{Filtered, Noisy, Recipe};
use tallow::gpu::Gpu;
use tallow::image::{Picture, metrics};
use tallow::render::{Outputs, Renderer};
use tallow::scene::{Loaded, Scene};

/// Blocks in sunlight, white and red in turn, far behind a block in focus.
fn scene(spp: u32, seed: u32) -> Loaded {
    let mut text = "[camera]\nposition = [0.0, 1.0, 5.0]\ntarget = [0.0, 0.7, 0.0]\nfov = 45.0\nlens_radius = 0.3\n\
        focus_distance = 5.0\n[film]\nwidth = 64\nheight = 40\n[environment]\nradiance = 0.3\n[render]\nmax_depth = 3\n\
        [[light]]\ntype = 'directional'\ndirection = [0.4, -1.0, -0.6]\nirradiance = 4.0\n\
        [[material]]\nname = 'white'\n[[material]]\nname = 'red'\ncolor = [0.7, 0.05, 0.05]\n\
        [[mesh]]\nshape = 'rectangle'\ntransform = { rotate = [-90.0, 0.0, 0.0], scale = 30.0 }\n\
        [[mesh]]\nshape = 'cube'\nmaterial = 'red'\ntransform = { scale = 0.5, translate = [-1.2, 0.5, 0.0] }\n"
        .to_owned();
    for i in 0..40 {
        let (name, x, height) = (["white", "red"][i % 2], i as f32 * 0.6 - 12.0, 1.0 + (i * 7 % 5) as f32);
        text += &format!(
            "[[mesh]]\nshape = 'cube'\nmaterial = '{name}'\ntransform = {{ scale = [0.3, {height}, 0.3], translate = [{x}, 1.0, -12.0] }}\n"
        );
    }
    let small = |s: &mut tallow::render::settings::Settings| (s.spp, s.seed) = (spp, seed);
    Scene::parse(Path::new("lens.toml"), &text).unwrap().with(small)
}

fn filtered(gpu: &Gpu, renderer: &Renderer, filter: &str, looked_up: bool) -> Picture {
    let recipe = Recipe { looked_up, ..Recipe::new(Method::Kernels(find(filter).unwrap())) };
    let clean = Filtered::new(gpu, Noisy::of_film(renderer).unwrap(), &recipe).unwrap().join(gpu).unwrap();
    Picture::of_planes([64, 40], &clean.colour)
}

/// Sunlight and the colours of surfaces, which no filter takes where they are sharp, have the noise of the lens where they are blurred.
#[test]
fn the_noise_of_what_a_lens_blurs_is_filtered() {
    let gpu = gpu();
    let rendered = |spp, seed| {
        let scene = scene(spp, seed);
        let renderer = Renderer::new(&gpu, &scene, &scene.settings, Outputs::FILTERED).unwrap();
        support::render(&gpu, &renderer);
        renderer
    };
    let (reference, noisy) = (rendered(1024, 9).picture().unwrap(), rendered(4, 1));
    let errors = |picture: &Picture| metrics::compare(picture, &reference).relmse;
    for (filter, most) in [("auto", 0.5), ("svgf", 0.6)] {
        let [lens, kept] = [false, true].map(|looked_up| errors(&filtered(&gpu, &noisy, filter, looked_up)));
        println!("{filter}: {lens}, {kept} with what is blurred kept, {} before", errors(&noisy.picture().unwrap()));
        assert!(lens < most * kept, "{filter}: {lens} {kept}");
    }
    assert_silent(&gpu);
}
