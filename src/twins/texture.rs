//! Twin of `glsl/shared/texture.glsl`.
use crate::layout::{MATERIAL_CLEAR_WALL, MATERIAL_MASKED, Material, NONE, SMOOTH_ALPHA, SPHERE};
use crate::math::hash::{pcg, unit_interval};
use crate::math::octahedral::octahedral_vector;
use crate::scene::Scene;
use crate::scene::attributes::Attributes;
pub use crate::scene::lookup::texture_sample;
use crate::shaders::shared::segment::{BY_CHANCE, MASK_HASH, MASK_INDEX, PASSES_WALLS};
use crate::twins::sampler::owen_reversed;
use crate::twins::scene::{material_of, object_from_world, texture_coordinates, world_from_object};
use glam::{Vec2, Vec3, Vec4};

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

/// Share of light that a clear wall lets straight through where it is smooth.
fn clear_wall_passes(
    scene: &Scene,
    m: &Material,
    (triangle, instance): (u32, u32),
    barycentric: Vec2,
    direction: Vec3,
) -> Option<Vec3> {
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
    let factors = picture(m.roughness_texture);
    let metallic = m.metallic * factors.z;
    let f90 = m.specular_factor * picture(m.specular_factor_texture).x;
    let f0 = (Vec3::from(m.specular) * picture(m.specular_texture).truncate()).max_element().min(1.0) * f90;
    let reflected = f0 + (f90 - f0) * (1.0 - cosine.min(1.0)).powi(5);
    let is_smooth = m.alpha * factors.y * factors.y < SMOOTH_ALPHA;
    is_smooth.then(|| base * (through * (1.0 - metallic) * (1.0 - reflected)))
}

/// Of a seed of masks, without the bit of shadow rays that pass clear walls.
pub fn mask_bits(word: u32) -> u32 {
    word & !PASSES_WALLS
}

/// What decides about masks on way number `way` of a path with this `seed`: two for each bounce, to its surface and from there to a light.
pub fn mask_seed(seed: u32, way: u32) -> u32 {
    (seed & (MASK_INDEX | BY_CHANCE)) | (pcg((seed & MASK_HASH) ^ (way << 16)) & MASK_HASH)
}

/// The number in [0, 1) that a surface's opacity is compared with: over the samples of a pixel a dimension of the sampler.
fn mask_number(triangle: u32, instance: u32, seed: u32) -> f32 {
    let surface = triangle.wrapping_mul(0x9e3779b9) ^ instance.wrapping_mul(0x85ebca6b);
    match seed & BY_CHANCE {
        0 => 0.5,
        _ => unit_interval(owen_reversed(seed & MASK_INDEX, pcg(surface ^ (seed & MASK_HASH)))),
    }
}

/// What a partly transparent surface leaves of a ray's light. It stops a ray or lets it pass, decided by `seed`, but for
/// clear walls and constant opacities, which dim the light of shadow rays. `direction` is that of the ray in the space of the triangle.
pub fn mask_leaves(scene: &Scene, triangle: u32, instance: u32, barycentric: Vec2, direction: Vec3, seed: u32) -> Vec3 {
    let number = material_of(scene, triangle, instance);
    let material = &scene.materials[number as usize];
    let opacity = surface_opacity(scene, number, triangle, barycentric);
    if seed & PASSES_WALLS != 0 {
        let is_wall = material.flags & MATERIAL_CLEAR_WALL != 0;
        let passes = || clear_wall_passes(scene, material, (triangle, instance), barycentric, direction);
        let share = is_wall.then(passes).flatten();
        if share.is_some() || material.opacity < 1.0 {
            return 1.0 - opacity * (1.0 - share.unwrap_or_default());
        }
    }
    if opacity > mask_number(triangle, instance, seed) { Vec3::ZERO } else { Vec3::ONE }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seeds of one pixel, number `hash`.
    fn seed(hash: u32, index: u32) -> u32 {
        (index.reverse_bits() & MASK_INDEX) | ((hash << 2) & MASK_HASH) | BY_CHANCE
    }

    #[test]
    fn masks_are_stratified_over_the_samples_of_a_pixel() {
        for (hash, first) in [(0, 0), (1, 0), (77, 64), (16383, 4096)] {
            let number = |index| mask_number(5, NONE, mask_seed(seed(hash, index), 3));
            let mut numbers: Vec<f32> = (first..first + 64).map(number).collect();
            numbers.sort_by(f32::total_cmp);
            for (stratum, &u) in numbers.iter().enumerate() {
                assert_eq!((64.0 * u) as usize, stratum, "{hash}, {first}: {u}");
            }
        }
    }

    /// One number in 16 of each of two surfaces, ways or pixels: a table of 256 cells. With 16384 samples a cell holds 64, give or take 8.
    #[test]
    fn surfaces_ways_and_pixels_decide_independently() {
        let cell = |u: f32| (16.0 * u) as usize;
        type Numbers = fn(u32) -> [f32; 2];
        let pairs: [(&str, Numbers); 4] = [
            ("surfaces", |i| [5, 6].map(|triangle| mask_number(triangle, NONE, mask_seed(seed(9, i), 0)))),
            ("instances", |i| [0, 1].map(|instance| mask_number(5, instance, mask_seed(seed(9, i), 0)))),
            ("ways", |i| [0, 1].map(|way| mask_number(5, NONE, mask_seed(seed(9, i), way)))),
            ("pixels", |i| [i, i + 1].map(|pixel| mask_number(5, NONE, mask_seed(seed(pixel, 3), 0)))),
        ];
        for (what, numbers) in pairs {
            let mut counts = [0.0f64; 256];
            for [a, b] in (0..16384).map(numbers) {
                counts[16 * cell(a) + cell(b)] += 1.0;
            }
            let chi_square: f64 = counts.iter().map(|n| (n - 64.0) * (n - 64.0) / 64.0).sum();
            assert!(chi_square < 255.0 + 5.0 * 22.6, "{what}: {chi_square}"); // five standard deviations of 255 degrees of freedom
        }
    }
}
