//! The list of lights and the table that chooses one in proportion to its power, delta lights [`DELTA_WEIGHT`] times as often.
//!
//! Power, by luminance, in watts up to a common factor: emissive triangle or sphere `pi * area * L` (front side, L the mean over
//! its texture times the mean opacity), point `4 pi I`, spot `2 pi I (1 - mean of the two cosines)`, directional
//! `pi R^2 E`, environment `4 pi^2 R^2` times its mean, R the radius of the scene.
use super::environment::mean_luminance;
use super::{alias, geometry};
use crate::error::Result;
use crate::layout::*;
use crate::math::srgb::luminance;
use crate::memory;
use crate::scene::Scene;
use crate::scene::load::texture;
use crate::scene::rig::Tree;
use glam::{Mat4, Vec3, Vec4};
use std::f64::consts::PI;

/// Adds the emissive triangles to the scene's lights (which hold the others), drops lights without power, and builds
/// the table. Sets [`Material::emission_weight`], [`Light::probability`], [`Scene::triangle_pdf_scale`] and [`Scene::large_lamps`].
///
/// # Errors
/// [`Error::Memory`](crate::error::Error::Memory).
pub fn finish(scene: &mut Scene) -> Result<()> {
    scene.rig.lights = std::mem::take(&mut scene.lights);
    scene.rig.sky = scene.environment.as_ref().map_or(1.0, mean_luminance);
    weigh(scene);
    list(scene)?;
    scene.large_lamps = scene.lights.iter().any(|l| is_large(scene, l));
    Ok(())
}

/// Sets [`Material::emission_weight`] of all materials, and finds the triangles that emit.
pub fn weigh(scene: &mut Scene) {
    let (textures, texels, means) = (&scene.textures, &scene.texels, &mut scene.rig.means);
    // Many materials may share a picture.
    let mut mean = |image: u32| match textures.get(image as usize) {
        Some(t) => *means
            .entry((t.first, t.flags & (TEXTURE_SRGB | TEXTURE_RGB9E5 | TEXTURE_FLOAT)))
            .or_insert_with(|| texture::mean(t, texels)),
        None => [1.0; 3],
    };
    for m in &mut scene.materials {
        let mean_emission = mean(m.emission_texture);
        let emission: [f32; 3] = std::array::from_fn(|c| m.emission[c] * mean_emission[c]);
        let masked = m.flags & MATERIAL_MASKED != 0;
        let opacity = if masked { m.opacity * mean(m.opacity_texture)[0] } else { 1.0 };
        m.emission_weight = luminance(emission) * opacity;
    }
    let (triangles, materials) = (&scene.triangles, &scene.materials);
    for tree in &mut scene.rig.trees {
        let lit = |&i: &usize| materials[triangles[i].material as usize].emission_weight > 0.0;
        tree.lit = tree.range.clone().filter(lit).map(|i| i as u32).collect();
        tree.sort_lit();
    }
}

/// Makes the scene's lights of those without surface and of the triangles that emit, and the table over them.
///
/// # Errors
/// As [`finish`].
pub fn list(scene: &mut Scene) -> Result<()> {
    let mut lights = scene.rig.lights.clone();
    let mut numbers: Vec<u64> = (0..lights.len() as u64).collect();
    add_triangles(scene, &mut lights, &mut numbers)?;
    let mut powers: Vec<f64> = lights.iter().map(|l| weight(l) * power(scene, l)).collect();
    let (mut kept, mut named) = (powers.iter(), powers.iter());
    lights.retain(|_| kept.next().is_some_and(|&p| p > 0.0));
    numbers.retain(|_| named.next().is_some_and(|&p| p > 0.0));
    powers.retain(|&p| p > 0.0);
    let total: f64 = powers.iter().sum();
    scene.triangle_pdf_scale = if total > 0.0 { (PI / total) as f32 } else { 0.0 };
    scene.light_table = alias::build(&powers);
    let probabilities = alias::probabilities(&scene.light_table);
    lights.iter_mut().zip(probabilities).for_each(|(l, p)| l.probability = p as f32);
    (scene.lights, scene.rig.light_numbers) = (lights, numbers);
    Ok(())
}

/// Emissive triangles in world space: of the only level, or of every instance that is seen. Their numbers are those of triangle and
/// instance, above the numbers of lights without surface.
fn add_triangles(scene: &Scene, lights: &mut Vec<Light>, numbers: &mut Vec<u64>) -> Result<()> {
    let rig = &scene.rig;
    if scene.instances.is_empty() {
        let lit = || rig.trees.iter().flat_map(|tree| &tree.lit);
        reserve(lights, lit().count())?;
        lit().for_each(|&index| lights.push(surface_light(scene, index as usize, None, None)));
        numbers.extend(lit().map(|&index| 1 << 32 | u64::from(index)));
        return Ok(());
    }
    let emits = |material: u32| scene.materials[material as usize].emission_weight > 0.0;
    let lit = |tree: &Tree, instance: &Instance| match instance.material {
        NONE => tree.lit.len(),
        worn if emits(worn) => tree.range.len(),
        _ => 0,
    };
    let placed = || rig.seen(scene).filter(|(_, tree, instance)| lit(tree, instance) > 0);
    reserve(lights, placed().map(|(_, tree, instance)| lit(tree, instance)).sum())?;
    for (copy, tree, instance) in placed() {
        let rows = [instance.world0, instance.world1, instance.world2].map(Vec4::from);
        let world = Mat4::from_cols(rows[0], rows[1], rows[2], Vec4::W).transpose();
        let material = (instance.material != NONE).then_some(instance.material);
        let at = Some((world, instance.mirrored == 1));
        let mut add = |index: usize| {
            lights.push(surface_light(scene, index, at, material));
            numbers.push(u64::from(copy + 1) << 32 | u64::from(tree.number_of(index as u32)));
        };
        match material {
            Some(_) => tree.whole().for_each(&mut add),
            None => tree.lit.iter().for_each(|&index| add(index as usize)),
        }
    }
    Ok(())
}

/// Makes room for `more` lights, and checks memory for twice that: their table, powers and probabilities take as much again.
fn reserve(lights: &mut Vec<Light>, more: usize) -> Result<()> {
    memory::need(format!("{more} emissive triangles"), 2 * (more * size_of::<Light>()) as u64)?;
    memory::reserve("lights", lights, more)
}

/// The light of an emissive triangle or sphere, which the instance `at` places and may mirror.
fn surface_light(scene: &Scene, index: usize, at: Option<(Mat4, bool)>, material: Option<u32>) -> Light {
    let t = &scene.triangles[index];
    let material = material.unwrap_or(t.material);
    let [a, mut b, mut c] =
        [t.v0, t.v1, t.v2].map(|p| at.map_or(p, |(world, _)| world.transform_point3(p.into()).to_array()));
    if at.is_some_and(|(_, mirrored)| mirrored) {
        std::mem::swap(&mut b, &mut c); // the front of the mesh stays in front
    }
    let value = scene.materials[material as usize].emission;
    let light = Light { kind: LIGHT_TRIANGLE, a, b, c, triangle: index as u32, value, material, ..Light::default() };
    if geometry::radius(t).is_none() {
        return light;
    }
    let pole = at.map_or(t.v1.into(), |(world, _)| world.transform_vector3(t.v1.into()));
    Light { kind: LIGHT_SPHERE, b: [pole.length(), 0.0, 0.0], c: [0.0; 3], ..light }
}

/// Area of an emissive triangle, in squares of the scene's diagonal, above which sampling by solid angle pays.
const LARGE: f64 = 0.01;

/// Whether a lamp is so large that, seen from points near it, its nearest parts outshine the others.
pub fn is_large(scene: &Scene, light: &Light) -> bool {
    let [low, high] = scene.bounds.map(|b| Vec3::from(b).as_dvec3());
    light.kind == LIGHT_TRIANGLE && geometry::area([light.a, light.b, light.c]) > LARGE * (high - low).length_squared()
}

/// How much more often than by their power delta lights are chosen. Lamps and sky are found by BSDF sampling as well, delta lights by
/// light sampling alone. Measured at 8 samples a pixel (`scenes/grass`, sun and sky): weights of 1, 4, 8 and 16 leave a relMSE of .0216, .0135,
/// .0120 and .0112; Crytek Sponza at 4 samples behaves alike. More would starve lamps beside a strong sun.
const DELTA_WEIGHT: f64 = 8.0;

fn weight(light: &Light) -> f64 {
    if matches!(light.kind, LIGHT_POINT | LIGHT_SPOT | LIGHT_DIRECTIONAL) { DELTA_WEIGHT } else { 1.0 }
}

/// Power of a light, by the formulas of the module documentation.
fn power(scene: &Scene, light: &Light) -> f64 {
    let [low, high] = scene.bounds.map(|b| Vec3::from(b).as_dvec3());
    let radius = ((high - low).length() / 2.0).max(if scene.triangles.is_empty() { 1.0 } else { 0.0 });
    let value = f64::from(luminance(light.value));
    match light.kind {
        LIGHT_TRIANGLE => {
            let weight = scene.materials[light.material as usize].emission_weight;
            PI * geometry::area([light.a, light.b, light.c]) * f64::from(weight)
        }
        LIGHT_SPHERE => {
            let weight = scene.materials[light.material as usize].emission_weight;
            4.0 * (PI * f64::from(light.b[0])).powi(2) * f64::from(weight)
        }
        LIGHT_POINT => 4.0 * PI * value,
        LIGHT_SPOT => 2.0 * PI * value * (1.0 - f64::from(light.c[0] + light.c[1]) / 2.0),
        LIGHT_DIRECTIONAL => PI * radius * radius * value,
        _ => 4.0 * PI * PI * radius * radius * value * scene.rig.sky,
    }
}
