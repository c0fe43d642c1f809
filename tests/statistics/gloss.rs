//! Noise of light sampling where a lamp's mirror image is seen, on the CPU twin.
use crate::twin::Workplace;
use glam::{Vec3, vec3};
use std::fmt::Write;
use tallow::scene::Loaded;
use tallow::twins::bsdf::bsdf_evaluate;
use tallow::twins::light::{Receiver, light_sample};
use tallow::twins::path::receiver_of;
use tallow::twins::sampler::{sample_2d, sample_2d_bits, sampler_start};
use tallow::twins::surface::{facing_of, surface_at, surface_bsdf, view_of};
use tallow::twins::traverse::traverse;

const MATERIALS: [&str; 3] = [
    "type = 'coated'\ncolor = 0.04\nalpha = 0.1",
    "type = 'conductor'\nmetal = 'Al'\nalpha = 0.1",
    "type = 'metallic-roughness'\ncolor = 0.04\nroughness = 0.316",
];

/// A floor of this material below lamps in a row, from right above what is looked at to twenty times as far.
fn street(material: &str, lamps: u32, point: bool) -> Loaded {
    let mut text = format!(
        "[[material]]\nname = 'floor'\n{material}\n\
         [[material]]\nname = 'lamp'\nemission = 100.0\n\
         [[mesh]]\nshape = 'rectangle'\nmaterial = 'floor'\n\
         transform = {{ rotate = [-90.0, 0.0, 0.0], scale = 50.0 }}\n"
    );
    for i in 0..lamps {
        let at = [0.0, 2.0, -40.0 * i as f32 / (lamps - 1) as f32];
        let lamp = match point {
            true => format!("[[light]]\ntype = 'point'\nposition = {at:?}\nintensity = 3.0\n"),
            false => format!(
                "[[mesh]]\nshape = 'sphere'\nmaterial = 'lamp'\ntransform = {{ scale = 0.1, translate = {at:?} }}\n"
            ),
        };
        text.write_str(&lamp).expect("text grows");
    }
    Workplace::new().scene(&text)
}

/// Variance of light samples over the square of their mean where the mirror image of a lamp six times as far as the nearest is seen. The
/// receiver is as `changed` makes it.
fn relative_variance(scene: &Loaded, changed: fn(Receiver) -> Receiver) -> f64 {
    let direction = vec3(0.0, -2.0, -12.0).normalize();
    let hit = traverse(scene, -5.0 * direction, direction, 1e9, false, 0);
    let s = surface_at(scene, &hit);
    let mut bsdf = surface_bsdf(scene, &s);
    let facing = facing_of(&s, &bsdf, -direction);
    let view = view_of(&s, &mut bsdf, facing, -direction);
    let receiver = changed(receiver_of(&s, &bsdf, &view));
    let light = |i| {
        let random = sampler_start(0, i, 5, true);
        let light = light_sample(scene, &receiver, sample_2d_bits(random, 0)[0], sample_2d(random, 1));
        let wi = view.basis.transpose() * light.direction;
        f64::from((bsdf_evaluate(&bsdf, view.wo, wi).truncate() * light.radiance).dot(Vec3::ONE))
    };
    let n = 1 << 15;
    let (sum, squares) = (0..n).map(light).fold((0.0, 0.0), |(sum, squares), v| (sum + v, squares + v * v));
    squares * f64::from(n) / (sum * sum) - 1.0
}

#[test]
fn lamps_whose_mirror_image_is_seen_are_chosen_often() {
    for (lamps, point) in [(28, false), (28, true), (50, true)] {
        for material in MATERIALS {
            let scene = street(material, lamps, point);
            assert_eq!((scene.has_light_tree(), scene.weighed_lights), (!point || lamps > 32, point && lamps <= 32));
            let [found, without] = [|r| r, |r| Receiver { gloss: 0.0, ..r }].map(|r| relative_variance(&scene, r));
            println!("{lamps} {material}: {found:.2}, without the lobe {without:.2}");
            assert!(found < 0.6, "{lamps} lamps, {material}: {found}");
            assert!(without > 4.0 * found + 1.0, "control: {without}, {found}");
        }
    }
}
