//! Values of pictures, as `glsl/shared/texture.glsl` reads them.
use super::Scene;
use super::attributes::Attributes;
use crate::layout::{
    TEXTURE_CLAMP, TEXTURE_CLAMP_U, TEXTURE_CLAMP_V, TEXTURE_FLOAT, TEXTURE_MIRROR_U, TEXTURE_MIRROR_V,
    TEXTURE_NEAREST, TEXTURE_RGB9E5, TEXTURE_SECOND_UV, TEXTURE_SHEARED, TEXTURE_SRGB, Texture,
};
use crate::math::rgb9e5;
use crate::math::srgb::linear_from_srgb;
use glam::{IVec2, Vec2, Vec2Swizzles, Vec3, Vec4, ivec2, vec2};

/// Whether a picture is read at the second set of coordinates.
pub fn reads_second(scene: &Scene, image: u32) -> bool {
    scene.textures[image as usize].flags & TEXTURE_SECOND_UV != 0
}

/// Coordinates at which a point of a triangle reads a picture; `barycentric` weighs vertices 1 and 2.
pub fn triangle_coordinates(scene: &Scene, image: u32, triangle: u32, barycentric: Vec2) -> Vec2 {
    // Where no triangle has any, kernels read all pictures at their origin.
    let Some(s) = scene.shading.get(triangle as usize) else { return Vec2::ZERO };
    let second = Attributes::of(scene, s).second_coordinates().filter(|_| reads_second(scene, image));
    let [uv0, uv1, uv2] = second.unwrap_or([s.uv0, s.uv1, s.uv2].map(Vec2::from));
    uv0 + barycentric.x * (uv1 - uv0) + barycentric.y * (uv2 - uv0)
}

/// One coordinate brought into `0..edge`, at most one period away.
fn into_range(at: i32, edge: i32, clamp: bool) -> i32 {
    match at {
        at if clamp => at.clamp(0, edge - 1),
        at if at < 0 => at + edge,
        at if at >= edge => at - edge,
        at => at,
    }
}

/// Along u and v: whether the picture is clamped, and whether it is mirrored.
fn modes(image: &Texture) -> [[bool; 2]; 2] {
    let has = |bits: u32| image.flags & bits != 0;
    let clamped = [has(TEXTURE_CLAMP | TEXTURE_CLAMP_U), has(TEXTURE_CLAMP | TEXTURE_CLAMP_V)];
    [clamped, [has(TEXTURE_MIRROR_U), has(TEXTURE_MIRROR_V)]]
}

/// A coordinate brought into [0, 1].
fn wrapped(x: f32, clamped: bool, mirrored: bool) -> f32 {
    match x {
        x if mirrored => 1.0 - (x.rem_euclid(2.0) - 1.0).abs(),
        x if clamped => x.clamp(0.0, 1.0),
        x => x - x.floor(),
    }
}

fn texture_texel(texels: &[u32], image: &Texture, at: IVec2) -> Vec4 {
    let edge = ivec2(image.width as i32, image.height as i32);
    let [clamped, mirrored] = modes(image);
    let [x, y] = [0, 1].map(|i| into_range(at[i], edge[i], clamped[i] || mirrored[i]));
    let word = texels[image.first as usize + (y * edge.x + x) as usize];
    if image.flags & TEXTURE_FLOAT != 0 {
        return Vec4::splat(f32::from_bits(word));
    }
    if image.flags & TEXTURE_RGB9E5 != 0 {
        return Vec3::from(rgb9e5::unpack(word)).extend(1.0);
    }
    let bytes = word.to_le_bytes();
    let c = Vec4::from(bytes.map(|b| f32::from(b) / 255.0));
    if image.flags & TEXTURE_SRGB != 0 { c.truncate().map(linear_from_srgb).extend(c.w) } else { c }
}

/// Texture value at `uv`, interpolated bilinearly.
pub fn texture_sample(scene: &Scene, index: u32, uv: Vec2) -> Vec4 {
    picture_sample(&scene.texels, &scene.textures[index as usize], uv)
}

/// The same of a picture among these texels.
pub fn picture_sample(texels: &[u32], image: &Texture, uv: Vec2) -> Vec4 {
    let turned = if image.flags & TEXTURE_SHEARED != 0 { uv.yx() * Vec2::from(image.shear) } else { Vec2::ZERO };
    let uv = uv * Vec2::from(image.scale) + Vec2::from(image.offset) + turned;
    let [clamped, mirrored] = modes(image);
    let [x, y] = [0, 1].map(|i| wrapped(uv[i], clamped[i], mirrored[i]));
    let at = vec2(x, 1.0 - y) * vec2(image.width as f32, image.height as f32) - 0.5;
    let at = if image.flags & TEXTURE_NEAREST != 0 { (at + 0.5).floor() } else { at };
    let corner = at.floor().as_ivec2();
    let f = at - corner.as_vec2();
    let texel = |dx, dy| texture_texel(texels, image, corner + ivec2(dx, dy));
    let top = texel(0, 0).lerp(texel(1, 0), f.x);
    let low = texel(0, 1).lerp(texel(1, 1), f.x);
    top.lerp(low, f.y)
}
