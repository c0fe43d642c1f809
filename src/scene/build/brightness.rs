//! How bright lamps are where their emission is a picture, as a wall of windows of which few are lit.
use crate::layout::{
    Light, MATERIAL_MASKED, Material, NONE, TEXTURE_FLOAT, TEXTURE_RGB9E5, TEXTURE_SHEARED, TEXTURE_SRGB, Texture,
};
use crate::math::hash::unit_interval;
use crate::math::srgb::luminance;
use crate::math::warp::warp_triangle;
use crate::scene::Scene;
use crate::scene::load::texture::{self, mean_key};
use crate::scene::lookup::{picture_sample, triangle_coordinates};
use glam::{Vec2, Vec3, vec2};

/// Points of a lamp at which its pictures are read: a power of two near the number of texels on it, within these.
const POINTS: [u32; 2] = [32, 128];
/// Least brightness: what lies between the points may shine.
const LEAST: f64 = 0.01;

/// Largest width and height of a picture that is read for its brightness; one with more texels is read as the means of several.
const SIDE: u32 = 256;

/// The texels of a picture that was made smaller.
#[derive(Clone, Debug)]
pub struct Reduced {
    width: u32,
    height: u32,
    /// In the form of [`TEXTURE_RGB9E5`].
    texels: Vec<u32>,
}

/// Finds the means of the pictures of these materials' light, and makes smaller ones of those that are large.
pub fn read_pictures(materials: &[Material], scene: &mut Scene) {
    let lamps = materials.iter().filter(|m| m.emission_texture != NONE || m.emission != [0.0; 3]);
    for image in lamps.flat_map(pictures).filter(|image| *image != NONE) {
        let (t, texels) = (&scene.textures[image as usize], &scene.texels);
        let [width, height] = [t.width, t.height].map(|edge| edge.min(SIDE));
        scene.rig.means.entry(mean_key(t)).or_insert_with(|| texture::mean(t, texels));
        if t.width > width || t.height > height {
            let reduced = || Reduced { width, height, texels: texture::reduced(t, texels, width, height) };
            scene.rig.reduced.entry(mean_key(t)).or_insert_with(reduced);
        }
    }
}

/// The pictures of a material's emission and opacity, or [`NONE`].
fn pictures(m: &Material) -> [u32; 2] {
    [m.emission_texture, if m.flags & MATERIAL_MASKED != 0 { m.opacity_texture } else { NONE }]
}

/// A picture as it is read for its brightness, and the texels that it is among.
fn picture(scene: &Scene, image: u32) -> (Texture, &[u32]) {
    let t = scene.textures[image as usize];
    let Some(&Reduced { width, height, ref texels }) = scene.rig.reduced.get(&mean_key(&t)) else {
        return (t, &scene.texels);
    };
    let flags = t.flags & !(TEXTURE_SRGB | TEXTURE_FLOAT) | TEXTURE_RGB9E5;
    (Texture { first: 0, width, height, flags, ..t }, texels)
}

/// Luminance of a material of light, given the values of its pictures.
fn luminance_of(m: &Material, value: impl Fn(u32) -> Vec3) -> f64 {
    let [emission, opacity] = pictures(m).map(|image| if image == NONE { Vec3::ONE } else { value(image) });
    f64::from(luminance((Vec3::from(m.emission) * emission).to_array()) * opacity.x)
}

/// Luminance of a material of light at these coordinates of its pictures.
pub fn luminance_at(scene: &Scene, m: &Material, coordinates: impl Fn(u32) -> Vec2) -> f64 {
    luminance_of(m, |image| {
        let (picture, texels) = picture(scene, image);
        picture_sample(texels, &picture, coordinates(image)).truncate()
    })
}

/// Mean luminance of a material of light over its pictures.
pub fn mean_luminance(scene: &Scene, m: &Material) -> f64 {
    let mean = |image: u32| scene.rig.means.get(&mean_key(&scene.textures[image as usize]));
    luminance_of(m, |image| mean(image).map_or(Vec3::ONE, |&mean| mean.into()))
}

/// Number of texels on a triangle that are read of a material's pictures, of that with the most; at least 1. `corners` are coordinates.
pub fn texels(scene: &Scene, m: &Material, corners: impl Fn(u32) -> [Vec2; 3]) -> f32 {
    let count = |image: u32| {
        let ([a, b, c], (t, _)) = (corners(image), picture(scene, image));
        let sheared = if t.flags & TEXTURE_SHEARED != 0 { t.shear[0] * t.shear[1] } else { 0.0 };
        0.5 * ((b - a).perp_dot(c - a) * (t.scale[0] * t.scale[1] - sheared)).abs() * t.width as f32 * t.height as f32
    };
    pictures(m).into_iter().filter(|image| *image != NONE).map(count).fold(1.0, f32::max)
}

/// Luminance of a triangle of light beside the mean over its material's pictures; 1 without pictures. Where it has more texels than are read,
/// it counts for that share alone: a few bright ones are found on one lamp and missed on the next.
pub fn brightness(scene: &Scene, light: &Light) -> f64 {
    let m = &scene.materials[light.material as usize];
    if pictures(m) == [NONE; 2] {
        return 1.0;
    }
    let coordinates = |image: u32, b: Vec2| triangle_coordinates(scene, image, light.triangle, b);
    let texels = texels(scene, m, |image| [Vec2::ZERO, Vec2::X, Vec2::Y].map(|b| coordinates(image, b)));
    let count = (texels.min(f32::from(u16::MAX)) as u32).next_power_of_two().clamp(POINTS[0], POINTS[1]);
    let at = |b: Vec2| luminance_at(scene, m, |image| coordinates(image, b));
    let own = points(count).map(at).sum::<f64>() / f64::from(count);
    let known = (f64::from(count) / f64::from(texels)).min(1.0);
    1.0 + known * ((own / mean_luminance(scene, m)).max(LEAST) - 1.0)
}

/// Points that are spread evenly over a triangle (Hammersley), by the weights of vertices 1 and 2.
pub fn points(count: u32) -> impl Iterator<Item = Vec2> {
    let point = move |i: u32| vec2((i as f32 + 0.5) / count as f32, unit_interval(i.reverse_bits()));
    (0..count).map(point).map(warp_triangle)
}
