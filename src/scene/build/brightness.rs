//! How bright lamps are where their emission is a picture, as a wall of windows of which few are lit.
use crate::layout::{Light, MATERIAL_MASKED, NONE};
use crate::math::srgb::luminance;
use crate::math::warp::warp_triangle;
use crate::scene::Scene;
use crate::scene::load::texture::mean_key;
use crate::scene::lookup::{texture_sample, triangle_coordinates};
use glam::{Vec2, Vec3, vec2};

/// Points of a lamp at which its pictures are read.
const POINTS: u16 = 32;
/// Least brightness: what lies between the points may shine.
const LEAST: f64 = 0.01;

/// Luminance of a triangle of light beside the mean over its material's pictures; 1 without pictures.
pub fn brightness(scene: &Scene, light: &Light) -> f64 {
    let m = &scene.materials[light.material as usize];
    let pictures = [m.emission_texture, if m.flags & MATERIAL_MASKED != 0 { m.opacity_texture } else { NONE }];
    if pictures == [NONE; 2] {
        return 1.0;
    }
    let shines = |value: &dyn Fn(u32) -> Vec3| {
        let [emission, opacity] = pictures.map(|image| if image == NONE { Vec3::ONE } else { value(image) });
        f64::from(luminance((Vec3::from(m.emission) * emission).to_array()) * opacity.x)
    };
    let at = |b: Vec2| {
        shines(&|image| texture_sample(scene, image, triangle_coordinates(scene, image, light.triangle, b)).truncate())
    };
    let mean = shines(&|image| {
        scene.rig.means.get(&mean_key(&scene.textures[image as usize])).map_or(Vec3::ONE, |&mean| mean.into())
    });
    let own = points().map(at).sum::<f64>() / f64::from(POINTS);
    (own / mean).max(LEAST)
}

/// Points that are spread evenly over a triangle (Hammersley), by the weights of vertices 1 and 2.
fn points() -> impl Iterator<Item = Vec2> {
    let inverse = |i: u16| f32::from(i.reverse_bits()) / 65536.0;
    (0..POINTS).map(move |i| warp_triangle(vec2((f32::from(i) + 0.5) / f32::from(POINTS), inverse(i))))
}
