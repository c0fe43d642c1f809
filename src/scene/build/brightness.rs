//! How bright lamps are where their emission is a picture, as a wall of windows of which few are lit.
use crate::layout::{Light, MATERIAL_MASKED, NONE, TEXTURE_SHEARED};
use crate::math::hash::unit_interval;
use crate::math::srgb::luminance;
use crate::math::warp::warp_triangle;
use crate::scene::Scene;
use crate::scene::load::texture::mean_key;
use crate::scene::lookup::{texture_sample, triangle_coordinates};
use glam::{Vec2, Vec3, vec2};

/// Points of a lamp at which its pictures are read: a power of two near the number of texels on it, within these.
const POINTS: [u32; 2] = [32, 128];
/// Least brightness: what lies between the points may shine.
const LEAST: f64 = 0.01;

/// Luminance of a triangle of light beside the mean over its material's pictures; 1 without pictures. Where it has more texels than are read,
/// it counts for that share alone: a few bright ones are found on one lamp and missed on the next.
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
    let texels = pictures.map(|image| if image == NONE { 0.0 } else { texels(scene, image, light.triangle) });
    let texels = texels[0].max(texels[1]).max(1.0);
    let count = (texels.min(f32::from(u16::MAX)) as u32).next_power_of_two().clamp(POINTS[0], POINTS[1]);
    let own = points(count).map(at).sum::<f64>() / f64::from(count);
    let known = (f64::from(count) / f64::from(texels)).min(1.0);
    1.0 + known * ((own / mean).max(LEAST) - 1.0)
}

/// Number of a picture's texels on a triangle.
fn texels(scene: &Scene, image: u32, triangle: u32) -> f32 {
    let t = &scene.textures[image as usize];
    let [a, b, c] = [Vec2::ZERO, Vec2::X, Vec2::Y].map(|b| triangle_coordinates(scene, image, triangle, b));
    let sheared = if t.flags & TEXTURE_SHEARED != 0 { t.shear[0] * t.shear[1] } else { 0.0 };
    0.5 * ((b - a).perp_dot(c - a) * (t.scale[0] * t.scale[1] - sheared)).abs() * t.width as f32 * t.height as f32
}

/// Points that are spread evenly over a triangle (Hammersley), by the weights of vertices 1 and 2.
fn points(count: u32) -> impl Iterator<Item = Vec2> {
    let point = move |i: u32| vec2((i as f32 + 0.5) / count as f32, unit_interval(i.reverse_bits()));
    (0..count).map(point).map(warp_triangle)
}
