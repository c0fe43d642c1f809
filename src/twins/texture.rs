//! Twin of `glsl/shared/texture.glsl`.
use crate::layout::{MATERIAL_MASKED, NONE, TEXTURE_CLAMP, TEXTURE_SRGB, Texture};
use crate::math::hash::pcg;
use crate::math::srgb::linear_from_srgb;
use crate::scene::Scene;
use crate::twins::scene::{material_of, texture_coordinates};
use glam::{IVec2, Vec2, Vec4, ivec2, vec2};

/// One coordinate brought into `0..edge`, at most one period away.
fn into_range(at: i32, edge: i32, clamp: bool) -> i32 {
    match at {
        at if clamp => at.clamp(0, edge - 1),
        at if at < 0 => at + edge,
        at if at >= edge => at - edge,
        at => at,
    }
}

fn texture_texel(scene: &Scene, image: &Texture, at: IVec2) -> Vec4 {
    let (edge, clamp) = (ivec2(image.width as i32, image.height as i32), image.flags & TEXTURE_CLAMP != 0);
    let (x, y) = (into_range(at.x, edge.x, clamp), into_range(at.y, edge.y, clamp));
    let bytes = scene.texels[image.first as usize + (y * edge.x + x) as usize].to_le_bytes();
    let c = Vec4::from(bytes.map(|b| f32::from(b) / 255.0));
    if image.flags & TEXTURE_SRGB != 0 { c.truncate().map(linear_from_srgb).extend(c.w) } else { c }
}

/// Texture value at `uv`, interpolated bilinearly.
pub fn texture_sample(scene: &Scene, index: u32, uv: Vec2) -> Vec4 {
    let image = &scene.textures[index as usize];
    let uv = uv * Vec2::from(image.scale) + Vec2::from(image.offset);
    let wrapped = if image.flags & TEXTURE_CLAMP != 0 { uv.clamp(Vec2::ZERO, Vec2::ONE) } else { uv - uv.floor() };
    let at = vec2(wrapped.x, 1.0 - wrapped.y) * vec2(image.width as f32, image.height as f32) - 0.5;
    let corner = at.floor().as_ivec2();
    let f = at - corner.as_vec2();
    let texel = |dx, dy| texture_texel(scene, image, corner + ivec2(dx, dy));
    let top = texel(0, 0).lerp(texel(1, 0), f.x);
    let low = texel(0, 1).lerp(texel(1, 1), f.x);
    top.lerp(low, f.y)
}

/// Opacity of a surface at a point of a triangle: the share of rays that it stops.
pub fn surface_opacity(scene: &Scene, material: u32, triangle: u32, barycentric: Vec2) -> f32 {
    let material = &scene.materials[material as usize];
    match material.opacity_texture {
        _ if material.flags & MATERIAL_MASKED == 0 => 1.0,
        NONE => material.opacity,
        image => {
            let uv = texture_coordinates(scene, triangle, barycentric);
            material.opacity * texture_sample(scene, image, uv).x
        }
    }
}

/// Whether a partly transparent surface stops a ray, decided by a hash of `seed`.
pub fn mask_blocks(scene: &Scene, triangle: u32, instance: u32, barycentric: Vec2, seed: u32) -> bool {
    let opacity = surface_opacity(scene, material_of(scene, triangle, instance), triangle, barycentric);
    let surface = triangle.wrapping_mul(0x9e3779b9) ^ instance.wrapping_mul(0x85ebca6b);
    opacity > (pcg(seed ^ surface) >> 8) as f32 * 5.9604645e-8
}
