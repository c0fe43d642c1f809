//! Tests that errors which are estimated without a reference are those that a reference shows.
use crate::support;
use std::path::Path;
use tallow::allocate;
use tallow::denoise::filter::{self, Method};
use tallow::denoise::{Filtered, Noisy, Recipe};
use tallow::gpu::Gpu;
use tallow::image::{Picture, metrics};
use tallow::plan::{Target, plan};
use tallow::render::{Outputs, Renderer};
use tallow::scene::{Loaded, Scene};

fn scene(file: &str, policy: &str, spp: u32, seed: u32) -> Loaded {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(file);
    let small = |s: &mut tallow::render::settings::Settings| {
        (s.width, s.height, s.spp, s.seed, s.max_depth) = (64, 64, spp, seed, 4);
        s.allocate.policy = allocate::policy(policy).unwrap();
    };
    Scene::load(&path).unwrap().with(small)
}

fn rendered(gpu: &Gpu, scene: &Loaded, filter: Option<Method>) -> Picture {
    let renderer = Renderer::new(gpu, scene, &scene.settings, Outputs::FILTERED).unwrap();
    support::render(gpu, &renderer);
    let Some(method) = filter else { return renderer.picture().unwrap() };
    let noisy = Noisy::of_film(&renderer).unwrap();
    let clean = Filtered::new(gpu, noisy, &Recipe::new(method)).unwrap().join(gpu).unwrap();
    Picture::of_planes([64, 64], &clean.colour)
}

#[test]
fn planned_errors_are_true_ones() {
    let gpu = support::gpu();
    // Where a lamp is seen, the few pixels at its rim decide the error of what a filter makes: half of it in so small a film.
    let both: &[&str] = &["none", "svgf"];
    let cases: [(_, _, &[(_, &[&str])]); 2] = [
        ("cornell-box/scene.toml", 0.01, &[("uniform", &both[..1])]),
        ("bust/scene.toml", 0.02, &[("uniform", both), ("both", &both[..1])]),
    ];
    for (file, error, methods) in cases {
        let reference = rendered(&gpu, &scene(file, "uniform", 512, 1000), None);
        let methods = methods.iter().flat_map(|&(policy, names)| names.iter().map(move |&name| (policy, name)));
        for (policy, name) in methods {
            let method = Method::Kernels(filter::find(name).unwrap());
            let first = scene(file, policy, 1, 3);
            let found =
                plan(&gpu, &first, &first.settings, Outputs::default(), &[method], Target::RelMse(error)).unwrap();
            assert!(found.chosen.relmse <= error * 1.001, "{file}, {policy}, {name}: {found:?}");
            let of = Some(method).filter(|_| name != "none");
            // Few pixels decide the error of one image, where lamps are seen: four images tell it better.
            let true_error = |spp: u32| {
                let images = (3..7).map(|seed| rendered(&gpu, &scene(file, policy, spp, seed), of));
                images.map(|image| metrics::relmse(&image, &reference)).sum::<f64>() / 4.0
            };
            let ratio = true_error(found.chosen.spp) / found.chosen.relmse;
            assert!(
                (1.0 / 1.5..1.5).contains(&ratio),
                "{file}, {policy}, {name}: {ratio} of what was expected, {:?}",
                found.chosen
            );
            // Control: a quarter of the samples has another error.
            if name == "none" && found.chosen.spp >= 8 {
                let ratio = true_error(found.chosen.spp / 4) / found.chosen.relmse;
                assert!(ratio > 2.0, "control: {ratio}");
            }
        }
    }
    support::assert_silent(&gpu);
}

/// What `auto` tells of its own error, and of the noisy image's, is between a quarter and four times the truth.
#[test]
fn told_errors_are_near_true_ones() {
    let (gpu, method) = (support::gpu(), Method::Kernels(filter::find("auto").unwrap()));
    for (file, spp) in [("cornell-box/scene.toml", 4), ("cornell-box/glossy.toml", 16), ("veach-mis/scene.toml", 16)] {
        let reference = rendered(&gpu, &scene(file, "uniform", 512, 1000), None);
        let noisy = scene(file, "uniform", spp, 3);
        let renderer = Renderer::new(&gpu, &noisy, &noisy.settings, Outputs::FILTERED).unwrap();
        support::render(&gpu, &renderer);
        let clean = Filtered::new(&gpu, Noisy::of_film(&renderer).unwrap(), &Recipe::new(method));
        let told = clean.unwrap().join(&gpu).unwrap().expected.unwrap();
        let [before, after] =
            [None, Some(method)].map(|filter| metrics::relmse(&rendered(&gpu, &noisy, filter), &reference));
        println!("{file}, {spp} samples: {told:?}, truth {before:.2e} and {after:.2e}");
        for (told, truth) in [(told.before, before), (told.after, after)] {
            assert!((0.25..4.0).contains(&(told / truth)), "{file}, {spp} samples: {told} told, {truth} true");
        }
    }
}
