//! What the filters make of a pixel before they trust it. Twin of `glsl/shared/sanitise.glsl`.
use crate::layout::{PixelLight, vec3, vec4};
use crate::math::octahedral::{octahedral_point, octahedral_vector};
use crate::shaders::shared::albedo::SMALLEST_ALBEDO;
pub use crate::shaders::shared::sanitise::{FARTHEST, LARGEST, WIDEST};
use glam::{Vec2, Vec3};

/// Radiance that some samples stand behind.
pub fn known_radiance([r, g, b, count]: vec4) -> Option<Vec3> {
    let colour = Vec3::new(r, g, b);
    let known = count > 0.0 && count.is_finite() && colour.is_finite();
    known.then(|| colour.clamp(Vec3::splat(-LARGEST), Vec3::splat(LARGEST)))
}

/// Position that differences can be taken of, without the lowest bit of x, which `glsl/shared/smoothing_cell.glsl` needs; 0 where there is
/// none.
pub fn known_position(position: vec3) -> Vec3 {
    let p = Vec3::from(position);
    let p = if p.is_finite() { p.clamp(Vec3::splat(-FARTHEST), Vec3::splat(FARTHEST)) } else { Vec3::ZERO };
    Vec3 { x: f32::from_bits(p.x.to_bits() & !1), ..p }
}

/// Unit normal after its way through 32 bits; 0 where there is none.
pub fn known_normal(normal: vec3) -> Vec3 {
    let n = Vec3::from(normal);
    let length = n.length_squared();
    if !(length.is_finite() && length > 1e-20) {
        return Vec3::ZERO;
    }
    let point = octahedral_point(n).clamp(Vec2::NEG_ONE, Vec2::ONE);
    octahedral_vector((point * 32767.0).round() / 32767.0)
}

/// Channel of a guide in single precision that squares and products can be taken of; 0 where there is none.
pub fn known_channel(value: f32) -> f32 {
    if value.is_finite() { value.clamp(-WIDEST, WIDEST) } else { 0.0 }
}

/// The albedo that the light of a pixel was divided by: that of its samples or, without any, of the ray through its centre. Light that is
/// no number has a count of 0, too, but samples. Twin of `glsl/shared/sampled_albedo.glsl`.
pub fn sampled_albedo(light: &PixelLight, count: f32, of_centre: vec3) -> vec3 {
    if count > 0.0 || light.albedo != [0.0; 3] { light.albedo } else { of_centre }
}

/// Whether light of this albedo is divided by it. Twin of `glsl/shared/albedo.glsl`.
pub fn reflects(albedo: &vec3) -> bool {
    largest(albedo) > SMALLEST_ALBEDO
}

/// 0 for what is no number.
pub fn largest(v: &vec3) -> f32 {
    v.iter().copied().filter(|v| v.is_finite()).fold(0.0, f32::max)
}
