//! What the filters make of a pixel before they trust it. Twin of `glsl/shared/sanitise.glsl`.
use crate::layout::{vec3, vec4};
pub use crate::shaders::shared::sanitise::{FARTHEST, LARGEST, WIDEST};
use glam::{Vec2, Vec3, vec2};

/// Radiance that some samples stand behind.
pub fn known_radiance([r, g, b, count]: vec4) -> Option<Vec3> {
    let colour = Vec3::new(r, g, b);
    let known = count > 0.0 && count.is_finite() && colour.is_finite();
    known.then(|| colour.clamp(Vec3::splat(-LARGEST), Vec3::splat(LARGEST)))
}

/// Position that differences can be taken of; 0 where there is none.
pub fn known_position(position: vec3) -> Vec3 {
    let p = Vec3::from(position);
    if p.is_finite() { p.clamp(Vec3::splat(-FARTHEST), Vec3::splat(FARTHEST)) } else { Vec3::ZERO }
}

/// Unit normal after its way through 32 bits; 0 where there is none.
pub fn known_normal(normal: vec3) -> Vec3 {
    let n = Vec3::from(normal);
    let length = n.length_squared();
    if !(length.is_finite() && length > 1e-20) {
        return Vec3::ZERO;
    }
    let e = n.truncate() / n.abs().element_sum();
    let sign = |v: f32| if v >= 0.0 { 1.0 } else { -1.0 };
    let folded = vec2((1.0 - e.y.abs()) * sign(e.x), (1.0 - e.x.abs()) * sign(e.y));
    let kept = if n.z < 0.0 { folded } else { e };
    decode((kept.clamp(Vec2::NEG_ONE, Vec2::ONE) * 32767.0).round() / 32767.0)
}

/// As `octahedral_decode` of `glsl/shared/octahedral.glsl`.
fn decode(e: Vec2) -> Vec3 {
    let n = e.extend(1.0 - e.x.abs() - e.y.abs());
    let t = (-n.z).max(0.0);
    let toward = |v: f32| if v >= 0.0 { v - t } else { v + t };
    Vec3::new(toward(n.x), toward(n.y), n.z).normalize()
}

/// Channel of a guide in single precision that squares and products can be taken of; 0 where there is none.
pub fn known_channel(value: f32) -> f32 {
    if value.is_finite() { value.clamp(-WIDEST, WIDEST) } else { 0.0 }
}
