//! Twin of `glsl/shared/texture.glsl`.
use crate::layout::{
    MATERIAL_CLEAR_WALL, MATERIAL_MASKED, Material, NONE, SPHERE, TEXTURE_CLAMP, TEXTURE_CLAMP_U, TEXTURE_CLAMP_V,
    TEXTURE_FLOAT, TEXTURE_MIRROR_U, TEXTURE_MIRROR_V, TEXTURE_NEAREST, TEXTURE_RGB9E5, TEXTURE_SHEARED, TEXTURE_SRGB,
    Texture,
};
use crate::math::hash::{pcg, unit_interval};
use crate::math::octahedral::octahedral_vector;
use crate::math::rgb9e5;
use crate::math::srgb::linear_from_srgb;
use crate::scene::Scene;
use crate::shaders::shared::segment::PASSES_WALLS;
use crate::twins::attributes::Attributes;
use crate::twins::scene::{material_of, object_from_world, texture_coordinates, world_from_object};
use glam::{IVec2, Vec2, Vec2Swizzles, Vec3, Vec4, ivec2, vec2};

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

fn texture_texel(scene: &Scene, image: &Texture, at: IVec2) -> Vec4 {
    let edge = ivec2(image.width as i32, image.height as i32);
    let [clamped, mirrored] = modes(image);
    let [x, y] = [0, 1].map(|i| into_range(at[i], edge[i], clamped[i] || mirrored[i]));
    let word = scene.texels[image.first as usize + (y * edge.x + x) as usize];
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
    let image = &scene.textures[index as usize];
    let turned = if image.flags & TEXTURE_SHEARED != 0 { uv.yx() * Vec2::from(image.shear) } else { Vec2::ZERO };
    let uv = uv * Vec2::from(image.scale) + Vec2::from(image.offset) + turned;
    let [clamped, mirrored] = modes(image);
    let [x, y] = [0, 1].map(|i| wrapped(uv[i], clamped[i], mirrored[i]));
    let at = vec2(x, 1.0 - y) * vec2(image.width as f32, image.height as f32) - 0.5;
    let at = if image.flags & TEXTURE_NEAREST != 0 { (at + 0.5).floor() } else { at };
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
    if material.flags & MATERIAL_MASKED == 0 {
        return 1.0;
    }
    let textured = match material.opacity_texture {
        NONE => material.opacity,
        image => {
            let uv = texture_coordinates(scene, image, triangle, barycentric);
            material.opacity * texture_sample(scene, image, uv).x
        }
    };
    let opacity = textured * vertex_color(scene, triangle, barycentric).w;
    match material.alpha_cutoff {
        cutoff if cutoff > 0.0 => f32::from(u8::from(opacity >= cutoff)),
        _ => opacity,
    }
}

/// Linear colour and opacity of the vertices at a point; white where there is none.
pub fn vertex_color(scene: &Scene, triangle: u32, barycentric: Vec2) -> Vec4 {
    scene.shading.get(triangle as usize).map_or(Vec4::ONE, |s| Attributes::of(scene, s).color(barycentric))
}

/// Share of light that a smooth clear wall lets straight through.
fn clear_wall_passes(
    scene: &Scene,
    m: &Material,
    (triangle, instance): (u32, u32),
    barycentric: Vec2,
    direction: Vec3,
) -> Vec3 {
    let t = &scene.triangles[triangle as usize];
    let [a, b, c] = [t.v0, t.v1, t.v2].map(Vec3::from);
    let n = if t.primitive & SPHERE != 0 { octahedral_vector(barycentric) } else { (b - a).cross(c - a) };
    let along = n.dot(direction).abs(); // the same in the world, which the lengths are not
    let (n, direction) = match scene.instances.get(instance as usize) {
        Some(i) => (object_from_world(i).normal(n), world_from_object(i).vector(direction)),
        None => (n, direction),
    };
    let cosine = along / (n.length_squared() * direction.length_squared()).max(1e-37).sqrt();
    let picture = |image: u32| match image {
        NONE => Vec4::ONE,
        image => texture_sample(scene, image, texture_coordinates(scene, image, triangle, barycentric)),
    };
    let tint = picture(m.base_texture) * vertex_color(scene, triangle, barycentric);
    let base = Vec3::from(m.base_color) * tint.truncate();
    let through = m.transmission_factor * picture(m.transmission_texture).x;
    let metallic = m.metallic * picture(m.roughness_texture).z;
    let f90 = m.specular_factor * picture(m.specular_factor_texture).x;
    let f0 = (Vec3::from(m.specular) * picture(m.specular_texture).truncate()).max_element().min(1.0) * f90;
    let reflected = f0 + (f90 - f0) * (1.0 - cosine.min(1.0)).powi(5);
    base * (through * (1.0 - metallic) * (1.0 - reflected))
}

/// Of a seed of masks, without the bit of shadow rays that pass clear walls.
pub fn mask_bits(word: u32) -> u32 {
    word & !PASSES_WALLS
}

/// What a partly transparent surface leaves of a ray's light. It stops a ray or lets it pass, decided by a hash of `seed`, but for
/// clear walls, which dim the light of shadow rays. `direction` is that of the ray in the space of the triangle.
pub fn mask_leaves(scene: &Scene, triangle: u32, instance: u32, barycentric: Vec2, direction: Vec3, seed: u32) -> Vec3 {
    let number = material_of(scene, triangle, instance);
    let material = &scene.materials[number as usize];
    let opacity = surface_opacity(scene, number, triangle, barycentric);
    if seed & PASSES_WALLS != 0 && material.flags & MATERIAL_CLEAR_WALL != 0 {
        return 1.0
            - opacity * (1.0 - clear_wall_passes(scene, material, (triangle, instance), barycentric, direction));
    }
    let surface = triangle.wrapping_mul(0x9e3779b9) ^ instance.wrapping_mul(0x85ebca6b);
    let blocks = opacity > unit_interval(pcg(seed ^ surface));
    if blocks { Vec3::ZERO } else { Vec3::ONE }
}
