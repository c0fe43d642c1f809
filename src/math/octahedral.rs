//! Directions as points of an unfolded octahedron (Meyer et al. 2010, Cigolle et al. 2014). Twin of
//! `glsl/shared/octahedral.glsl`.
use glam::{Vec2, Vec3, vec2, vec3};

/// Two numbers of [-1, 1] from snorms of 16 bits, the first in the low half.
pub fn snorms(bits: u32) -> [f32; 2] {
    [bits, bits >> 16].map(|b| (f32::from(b as u16 as i16) / 32767.0).max(-1.0))
}

/// Unit normal from two snorms of 16 bits.
pub fn octahedral_decode(bits: u32) -> Vec3 {
    octahedral_vector(snorms(bits).into())
}

/// Unit vector that a point of the unfolded octahedron, the square [-1, 1]^2, stands for.
pub fn octahedral_vector(e: Vec2) -> Vec3 {
    let z = 1.0 - e.x.abs() - e.y.abs();
    let t = (-z).max(0.0);
    let fold = |e: f32| if e >= 0.0 { e - t } else { e + t };
    vec3(fold(e.x), fold(e.y), z).normalize()
}

/// Inverse of [`octahedral_vector`]; `n` may have any length but 0.
pub fn octahedral_point(n: Vec3) -> Vec2 {
    let e = n.truncate() / (n.x.abs() + n.y.abs() + n.z.abs());
    let fold = |own: f32, other: f32| (1.0 - other.abs()) * if own >= 0.0 { 1.0 } else { -1.0 };
    if n.z < 0.0 { vec2(fold(e.x, e.y), fold(e.y, e.x)) } else { e }
}
