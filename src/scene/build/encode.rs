//! Packs unit vectors into words.
use crate::layout::NONE;
use glam::{Vec2, Vec3};

/// Octahedral map of a unit vector (Cigolle et al. 2014), snorm 2 x 16, x in the low half.
pub fn encode_normal(n: Vec3) -> u32 {
    let p = n.truncate() / (n.x.abs() + n.y.abs() + n.z.abs());
    let sign = Vec2::new(1f32.copysign(p.x), 1f32.copysign(p.y));
    let p = if n.z < 0.0 { (1.0 - Vec2::new(p.y, p.x).abs()) * sign } else { p };
    match encode_snorms(p) {
        NONE => NONE << 16, // means "flat": the neighbouring code is 4e-5 radians away
        code => code,
    }
}

/// Numbers of [-1, 1], snorm 2 x 16, x in the low half.
pub fn encode_snorms(p: Vec2) -> u32 {
    let snorm = |v: f32| u32::from((v.clamp(-1.0, 1.0) * 32767.0).round() as i16 as u16);
    snorm(p.x) | snorm(p.y) << 16
}
