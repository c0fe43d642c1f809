//! The list of lights, the table that chooses one in proportion to its power, and where there are many a tree over them. The table takes
//! delta lights and the small bright parts of a sky's picture [`DELTA_WEIGHT`] times as often, those at infinity and the others
//! at least [`LEAST_SHARE`] of the time each, the others beside a sky without directional lights at least [`LEAST_BESIDE_SKY`]. Beside
//! suns alone, a sky of one colour is not chosen.
//!
//! Power, by luminance, in watts up to a common factor: emissive triangle or sphere `pi * area * L` (L the mean over its texture
//! times the mean opacity, twice that where both sides shine), point `4 pi I`, spot `2 pi I (1 - mean of the two cosines)`, directional
//! `pi R^2 E`, environment `4 pi^2 R^2` times its mean, R the radius of the scene.
use super::brightness::brightness;
use super::environment::{mean_luminance, share_above};
use super::light_tree::{self, Lamp};
use super::{alias, bvh, geometry};
use crate::error::Result;
use crate::layout::*;
use crate::math::srgb::luminance;
use crate::memory;
use crate::scene::Scene;
use crate::scene::load::texture;
use crate::scene::rig::Tree;
use glam::{Mat4, Vec3};
use rayon::prelude::*;
use std::f64::consts::PI;
use xxhash_rust::xxh3::{xxh3_64, xxh3_64_with_seed};

/// Adds the emissive triangles to the scene's lights (which hold the others), drops lights without power, and builds
/// the table. Sets [`Material::emission_weight`], [`Light::probability`], [`Scene::triangle_pdf_scale`], [`Scene::large_lamps`],
/// [`Scene::weighed_lights`] and [`Scene::light_nodes`].
///
/// # Errors
/// [`Error::Memory`](crate::error::Error::Memory).
pub fn finish(scene: &mut Scene) -> Result<()> {
    scene.rig.lights = std::mem::take(&mut scene.lights);
    scene.rig.sky = scene.environment.as_ref().map_or(1.0, mean_luminance);
    scene.rig.sky_peaks = scene.environment.as_ref().map_or(0.0, |sky| share_above(sky, PEAK * scene.rig.sky));
    weigh(scene);
    choose_unit(scene);
    list(scene)?;
    scene.large_lamps = scene.lights.iter().any(|l| is_large(scene, l));
    // Dark ones may light up later.
    let deltas = |lights: &[Light]| lights.iter().filter(|l| l.is_delta()).count();
    scene.weighed_lights = deltas(&scene.rig.lights) > 1 && deltas(&scene.lights) <= MOST_WEIGHED;
    if scene.lights.iter().filter(|l| is_in_tree(scene, l)).count() > MOST_BY_POWER {
        tell_brightness(scene);
        scene.light_nodes = tree(scene);
    }
    Ok(())
}

/// Sets [`Shading::brightness`], which stays: any is right for MIS that rays and light samples find alike.
fn tell_brightness(scene: &mut Scene) {
    let has_picture =
        |light: &&Light| light.is_triangle() && scene.materials[light.material as usize].emission_texture != NONE;
    let told = |light: &Light| (light.triangle as usize, brightness(scene, light) as f32);
    let all: Vec<_> = scene.lights.par_iter().filter(has_picture).map(told).collect();
    for (triangle, brightness) in all {
        if let Some(record) = scene.shading.get_mut(triangle) {
            record.brightness = brightness;
        }
    }
}

/// Sets [`Material::emission_weight`] of all materials, and finds the triangles that emit.
pub fn weigh(scene: &mut Scene) {
    let unit = unit(scene);
    let (textures, texels, means) = (&scene.textures, &scene.texels, &mut scene.rig.means);
    // Many materials may share a picture.
    let mut mean = |image: u32| match textures.get(image as usize) {
        Some(t) => *means.entry(texture::mean_key(t)).or_insert_with(|| texture::mean(t, texels)),
        None => [1.0; 3],
    };
    for m in &mut scene.materials {
        let mean_emission = mean(m.emission_texture);
        let emission: [f32; 3] = std::array::from_fn(|c| m.emission[c] * mean_emission[c]);
        let masked = m.flags & MATERIAL_MASKED != 0;
        let opacity = if masked { m.opacity * mean(m.opacity_texture)[0] } else { 1.0 };
        let sides = if m.flags & MATERIAL_EMITS_BEHIND != 0 { 2.0 } else { 1.0 };
        m.emission_weight = (f64::from(luminance(emission) * opacity * sides) / unit) as f32;
    }
    scene.rig.trees.iter_mut().for_each(|tree| tree.list_lit(&scene.triangles, &scene.materials));
}

/// What [`Material::emission_weight`] is counted in.
fn unit(scene: &Scene) -> f64 {
    2f64.powi(-scene.rig.dimness)
}

/// Lamps that are dimmer when the scene is loaded may still come to be brighter than any real one.
const MOST_DIMNESS: i32 = 64;

/// Counts weights in a smaller unit where all lamps are dim: by 1, the density of small dim lamps per power would exceed what a number
/// of 32 bits holds. A power of two rounds nothing, and a scene keeps it, so that lamps that do not change keep their weights.
fn choose_unit(scene: &mut Scene) {
    let most = scene.materials.iter().map(|m| m.emission_weight).fold(0.0, f32::max);
    if most > 0.0 && most < 1.0 {
        scene.rig.dimness = (-most.log2().floor() as i32).min(MOST_DIMNESS);
        let factor = 1.0 / unit(scene);
        let counted = |weight: f32| (f64::from(weight) * factor) as f32;
        scene.materials.iter_mut().for_each(|m| m.emission_weight = counted(m.emission_weight));
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
    drop_copies(scene.rig.lights.len(), &mut lights, &mut numbers);
    let mut powers: Vec<f64> = lights.iter().map(|l| weight(scene, l) * power(scene, l)).collect();
    let shines: Vec<bool> = powers.iter().map(|&p| p > 0.0).collect();
    geometry::retain(&mut lights, 0, &shines);
    geometry::retain(&mut numbers, 0, &shines);
    geometry::retain(&mut powers, 0, &shines);
    leave_sky(scene, &lights, &mut powers);
    share(&lights, &mut powers);
    let total: f64 = powers.iter().sum();
    scene.triangle_pdf_scale = if total > 0.0 { (PI * unit(scene) / total) as f32 } else { 0.0 };
    scene.light_table = alias::build(&powers);
    let probabilities = alias::probabilities(&scene.light_table);
    lights.iter_mut().zip(probabilities).for_each(|(l, p)| l.probability = p as f32);
    (scene.lights, scene.rig.light_numbers) = (lights, numbers);
    if scene.has_light_tree() {
        scene.light_nodes = tree(scene);
    }
    Ok(())
}

/// Rounds the probabilities of lights outside of the tree to whole words of 32 bits, one at least, by which they are chosen.
fn in_whole_words(scene: &mut Scene) {
    const WORDS: f32 = 4294967296.0;
    let outside: Vec<bool> = scene.lights.iter().map(|light| !is_in_tree(scene, light)).collect();
    for (light, _) in
        scene.lights.iter_mut().zip(outside).filter(|(light, outside)| *outside && light.probability > 0.0)
    {
        light.probability = (light.probability * WORDS).round().max(1.0) / WORDS;
    }
}

/// The tree over the lights that [`is_in_tree`]; it has a root even if none is. Those outside get probabilities of whole words.
fn tree(scene: &mut Scene) -> Vec<LightNode> {
    in_whole_words(scene);
    let scene = &*scene;
    let (mut lamps, mut outside, mut probability) = (Vec::new(), Vec::new(), 0.0);
    let powers: Vec<f64> = scene.lights.par_iter().map(|light| power_in_tree(scene, light)).collect();
    for ((index, light), power) in (0..).zip(&scene.lights).zip(powers) {
        if is_in_tree(scene, light) {
            lamps.push(Lamp::new(index, light, power, is_two_sided(scene, light)));
            probability += f64::from(light.probability);
        } else {
            outside.push((index, light.probability));
        }
    }
    let probability = match (lamps.is_empty(), outside.is_empty()) {
        (true, _) => 0.0, // all are dark, or hidden
        (false, true) => 1.0,
        (false, false) => probability as f32,
    };
    light_tree::build(lamps, probability, &outside)
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
        let material = (instance.material != NONE).then_some(instance.material);
        let at = Some((bvh::world_from_object(instance), instance.mirrored == 1));
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

/// Drops lamps that lie on an earlier one, from `start` on: rays meet one of them, so that sampling must not add them up. Those of the
/// same triangle have the same corners, wherever they begin, and the same front.
fn drop_copies(start: usize, lights: &mut Vec<Light>, numbers: &mut Vec<u64>) {
    let place = |i: usize| {
        let light = &lights[start + i];
        let corners = corners(light);
        let turned = [0, 1, 2].map(|first| [0, 1, 2].map(|i| corners[(first + i) % 3]));
        let least = turned.into_iter().min().unwrap_or(corners);
        (least, [light.material, u32::from(light.kind == LIGHT_SPHERE)])
    };
    let hash = |i: usize| {
        let (corners, rest) = place(i);
        xxh3_64_with_seed(bytemuck::bytes_of(&corners), xxh3_64(bytemuck::bytes_of(&rest)))
    };
    let first = geometry::firsts(lights.len() - start, hash, place);
    geometry::retain(lights, start, &first);
    geometry::retain(numbers, start, &first);
}

/// Bits of a lamp's corners. Adding 0 makes -0 the same.
fn corners(light: &Light) -> [[u32; 3]; 3] {
    [light.a, light.b, light.c].map(|p| p.map(|x| (x + 0.0).to_bits()))
}

/// A warning about lamps that lie on others of another material or front. None of them can be dropped: which of two rays meet depends
/// on their direction and on how the hierarchy is walked.
pub fn coincident(scene: &Scene) -> Option<String> {
    let lamps: Vec<_> = scene.lights.iter().filter(|light| light.has_surface()).collect();
    let place = |i: usize| {
        let mut corners = corners(lamps[i]);
        corners.sort_unstable(); // whichever side is in front
        corners
    };
    let first = geometry::firsts(lamps.len(), |i| xxh3_64(bytemuck::bytes_of(&place(i))), place);
    let upper = first.iter().position(|first| !first)?;
    let lower = (0..upper).find(|&i| place(i) == place(upper))?;
    let count = first.iter().filter(|first| !**first).count();
    let [lower, upper] =
        [lower, upper].map(|i| scene.names.materials.get(lamps[i].material as usize).map_or("", |n| n));
    let what = "rays meet either, while both are sampled: remove one, or move it";
    Some(format!("lamps that lie on others: {count}, the first of material \"{upper}\" on one of \"{lower}\"; {what}"))
}

/// Makes room for `more` lights, and checks memory for four times that: their table, powers and probabilities take as much again, and a
/// tree over them and what it is made of up to twice.
fn reserve(lights: &mut Vec<Light>, more: usize) -> Result<()> {
    memory::need(format!("{more} emissive triangles"), 4 * (more * size_of::<Light>()) as u64)?;
    memory::reserve("lights", lights, more)
}

/// The light of an emissive triangle or sphere, which the instance `at` places and may mirror.
fn surface_light(scene: &Scene, index: usize, at: Option<(Mat4, bool)>, material: Option<u32>) -> Light {
    let t = &scene.triangles[index];
    let material = material.unwrap_or(t.material);
    let [a, mut b, mut c] =
        [t.v0, t.v1, t.v2].map(|p| at.map_or(p, |(world, _)| world.transform_point3(p.into()).to_array()));
    let mut kind = LIGHT_TRIANGLE;
    if at.is_some_and(|(_, mirrored)| mirrored) {
        std::mem::swap(&mut b, &mut c); // the front of the mesh stays in front
        kind = LIGHT_MIRRORED;
    }
    let value = scene.materials[material as usize].emission;
    let light = Light { kind, a, b, c, triangle: index as u32, value, material, ..Light::default() };
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
    light.is_triangle() && geometry::area([light.a, light.b, light.c]) > LARGE * (high - low).length_squared()
}

/// Whether a light of a scene that has a tree of them lies in it.
fn is_in_tree(scene: &Scene, light: &Light) -> bool {
    !(light.is_far() || scene.weighed_lights && light.is_delta())
}

fn is_two_sided(scene: &Scene, light: &Light) -> bool {
    scene.materials.get(light.material as usize).is_some_and(|m| m.flags & MATERIAL_EMITS_BEHIND != 0)
}

/// How many delta lights are weighed at every point at most: it takes time in proportion to their number. A tree leaves 1.1 times the
/// relMSE of six and of twenty points, and 1.1 to 2.7 times that of as many spots, since large nodes do not know their beams.
const MOST_WEIGHED: usize = 32;

/// How many lamps, and point and spot lights that are not weighed, are chosen by their power alone at most. At 8 samples a pixel a tree leaves
/// .46 and .17 of the relMSE of a corridor with two and four panels, of two triangles each, .31 of a room with three, the same of the Cornell
/// box with one and Nori's table with two, and 1.08 of Veach's plates with three spheres, in 1.1 of the time.
const MOST_BY_POWER: usize = 3;

/// How much more often than by their power delta lights are chosen. Lamps and sky are found by BSDF sampling as well, delta lights by
/// light sampling alone. Measured at 8 samples a pixel (`scenes/grass`, sun and sky): weights of 1, 4, 8 and 16 leave a relMSE of .0216, .0135,
/// .0120 and .0112; Crytek Sponza at 4 samples behaves alike. More would starve lamps beside a strong sun.
const DELTA_WEIGHT: f64 = 8.0;

/// Luminance over the mean of a sky's picture above which its light counts as a delta light's: a sun in it is as hard to find by BSDF sampling.
const PEAK: f64 = 16.0;

/// How much more often than by its power a light is chosen.
fn weight(scene: &Scene, light: &Light) -> f64 {
    match light.kind {
        LIGHT_ENVIRONMENT => 1.0 + (DELTA_WEIGHT - 1.0) * scene.rig.sky_peaks,
        _ if light.is_delta() => DELTA_WEIGHT,
        _ => 1.0,
    }
}

/// Leaves a sky of one colour to BSDF sampling where suns alone shine beside it. A path that leaves the scene finds such a sky as well as
/// light sampling does, and every light sample then chooses a sun, whose light would have the noise of that choice otherwise.
fn leave_sky(scene: &Scene, lights: &[Light], weights: &mut [f64]) {
    let is_sun = |l: &Light| l.kind == LIGHT_DIRECTIONAL;
    if scene.environment.is_none() && lights.iter().any(is_sun) && lights.iter().all(Light::is_far) {
        lights.iter().zip(weights).filter(|(l, _)| !is_sun(l)).for_each(|(_, w)| *w = 0.0);
    }
}

/// Least share of the choices that lights at infinity get beside those in the scene, and these beside them. Measured at 64 samples a pixel
/// (a lamp over a few objects on ground 200 wide) and at 16 (`scenes/bust`): without, relMSE .038 by night, .0063 by day, .00013 by day with
/// a lamp hardly brighter than the sky, .039; with shares of .1 and .25 .00035, .00022, .00016, .039 and .00017, .00034, .00023, .025.
const LEAST_SHARE: f64 = 0.25;

/// Least share that lights in the scene get beside a sky without directional lights, most of which BSDF sampling finds as well. At 8 and
/// 16 samples a pixel a share of .5 leaves .27 to .91 of the variance that .25 does in eleven scenes, and 1.00 and 1.08 of it where a
/// lamp shines below the picture of a sky. Beside suns it leaves .8 in Sponza, 1.08 on grass and 1.3 to 1.5 on snow by day, where lamps
/// hardly matter.
const LEAST_BESIDE_SKY: f64 = 0.5;

/// Lights at infinity have the power that falls on the whole scene, which grows with ground that nobody looks at, while a lamp matters
/// near itself. So each kind has a least share.
fn share(lights: &[Light], weights: &mut [f64]) {
    let sum = |far: bool| lights.iter().zip(&*weights).filter(|(l, _)| l.is_far() == far).map(|(_, w)| w).sum::<f64>();
    let [near, far] = [sum(false), sum(true)];
    if near > 0.0 && far > 0.0 {
        let sun = lights.iter().any(|l| l.kind == LIGHT_DIRECTIONAL);
        let least_near = if sun { LEAST_SHARE } else { LEAST_BESIDE_SKY };
        let limits = [LEAST_SHARE, 1.0 - least_near].map(|share| share / (1.0 - share));
        // That of lamps stays, since `Scene::triangle_pdf_scale` counts in it.
        let factor = (far / near).clamp(limits[0], limits[1]) * near / far;
        lights.iter().zip(weights).filter(|(l, _)| l.is_far()).for_each(|(_, w)| *w *= factor);
    }
}

/// Power of a light, by the formulas of the module documentation.
fn power(scene: &Scene, light: &Light) -> f64 {
    let [low, high] = scene.bounds.map(|b| Vec3::from(b).as_dvec3());
    // The sky is there too where nothing else is, or nothing that is seen.
    let radius = Some((high - low).length() / 2.0).filter(|r| *r > 0.0).unwrap_or(1.0);
    let value = f64::from(luminance(light.value));
    let emitted = || f64::from(scene.materials[light.material as usize].emission_weight) * unit(scene);
    match light.kind {
        _ if light.is_triangle() => PI * geometry::area([light.a, light.b, light.c]) * emitted(),
        LIGHT_SPHERE => 4.0 * (PI * f64::from(light.b[0])).powi(2) * emitted(),
        LIGHT_POINT => 4.0 * PI * value,
        LIGHT_SPOT => {
            let halves = [light.c[0], light.c[1]].map(|angle| (f64::from(angle) / 2.0).sin().powi(2));
            2.0 * PI * value * (halves[0] + halves[1])
        }
        LIGHT_DIRECTIONAL => PI * radius * radius * value,
        LIGHT_ENVIRONMENT => 4.0 * PI * PI * radius * radius * value * scene.rig.sky,
        _ => 0.0,
    }
}

/// Power of a light of the tree, which knows where spots shine and how bright each triangle is.
fn power_in_tree(scene: &Scene, light: &Light) -> f64 {
    match light.kind {
        LIGHT_SPOT => 4.0 * PI * f64::from(luminance(light.value)),
        _ if light.is_triangle() => power(scene, light) * brightness(scene, light),
        _ => power(scene, light),
    }
}
