//! Calls the steps from a description to the flat arrays: it reads files, places meshes, builds BVHs, decodes textures and makes the
//! table of lights.
use super::bake;
use super::brightness;
use super::coat;
use super::enlarge::enlarge;
use super::environment;
use super::geometry::Geometry;
use super::hierarchy;
use super::lights;
use super::plan;
use super::sources::Sources;
use super::split;
use super::store;
use crate::error::{Error, Result};
use crate::layout::*;
use crate::memory;
use crate::scene::Scene;
use crate::scene::description::Description;
use crate::scene::fingerprint::{Fingerprint, posed};
use crate::scene::load::library::Library;
use crate::scene::load::material::{is_smooth_wall, mark_clear_wall};
use glam::{DMat3, Vec3};
use std::path::Path;

/// Height of an MTL's bump map without `-bm`, as a share of the scene's diagonal.
const DEFAULT_BUMP: f32 = 0.0005;

/// What a scene file may leave open.
#[derive(Clone, Copy, Default)]
pub struct Choices {
    /// A scene without any light gets a constant environment of radiance 1.
    pub sky: bool,
    /// Nothing will be placed elsewhere or deformed.
    pub still: bool,
}

/// Fills a scene's arrays.
///
/// # Errors
/// [`Error::Input`](crate::error::Error::Input) for what cannot be repaired.
pub fn assemble(path: &Path, description: &Description, choices: Choices, scene: &mut Scene) -> Result<()> {
    let mut sources = Sources::new(path, description)?;
    // Textures are decoded while geometry is read: on two cores Crytek Sponza is ready a quarter sooner.
    let early = sources.library.materials.textures.clone();
    let (decoded, placed) = rayon::join(
        || early.decode(),
        || {
            sources.read_files()?;
            scene.files = sources.files().into_iter().collect();
            match sources.library.materials.list.iter().any(split::is_pictured) {
                true => Ok(None), // lamps are split by what their pictures show
                false => geometry(&mut sources, choices.still, scene).map(Some),
            }
        },
    );
    let placed = placed?;
    let decoded = sources.library.materials.textures.decode_after(decoded?)?;
    let clipped = sources.library.materials.textures.clipped(&decoded);
    sources.library.warnings.extend(clipped);
    (scene.textures, scene.texels) = (decoded.textures, decoded.texels);
    let attributes = match placed {
        Some(attributes) => attributes,
        None => {
            brightness::read_pictures(&sources.library.materials.list, scene);
            geometry(&mut sources, choices.still, scene)?
        }
    };
    add_attributes(path, attributes, scene)?;
    let mut warnings = add_materials(sources.library, scene);
    let emits = |t: &Triangle| scene.materials[t.material as usize].emission != [0.0; 3];
    if choices.sky && scene.lights.is_empty() && !scene.triangles.iter().any(emits) {
        scene.lights.push(environment::light([1.0; 3], DMat3::IDENTITY));
    }
    add_appearance(scene);
    coat::add_tables(&mut scene.materials, &mut scene.texels);
    lights::finish(scene)?;
    // A sky without light may be given some by a pose: a constant one, or one that keys change.
    let stays = description.animation.iter().any(|table| table.environment);
    if !stays && scene.environment.is_some() && !scene.lights.iter().any(|l| l.kind == LIGHT_ENVIRONMENT) {
        scene.environment = None;
        scene.rig.lights.retain(|l| l.kind != LIGHT_ENVIRONMENT);
    }
    if scene.triangles.is_empty() {
        warnings.push("the scene shows no surface".into());
    }
    warnings.extend(warn_of_smallness(scene));
    if scene.lights.is_empty() {
        warnings.push("the scene has no light: its image will be black".into());
    }
    warnings.extend(warn_of_panes(scene));
    warnings.extend(lights::coincident(scene));
    scene.warnings = warnings;
    scene.rig.name(description, &scene.materials);
    scene.rig.content = scene.content.clone();
    scene.rig.rest = posed(scene, Fingerprint::default());
    scene.rig.renew_serial();
    Ok(())
}

/// A warning about scenes that are so small that rays miss surfaces: they are traced by products of three lengths, which have to be
/// numbers of 32 bits.
fn warn_of_smallness(scene: &Scene) -> Option<String> {
    const SMALL: f32 = 1e-9;
    let far = scene.bounds.as_flattened().iter().fold(0.0, |far: f32, v| far.max(v.abs()));
    (!scene.triangles.is_empty() && far < SMALL).then(|| {
        format!(
            "all surfaces lie within {far:e} of the origin: rays miss what is so small; choose a smaller unit of length"
        )
    })
}

/// A warning about smooth panes that stop shadow rays: that it is dark behind them looks like a mistake.
fn warn_of_panes(scene: &Scene) -> Option<String> {
    let stops = |m: &Material| is_smooth_wall(m) && m.flags & MATERIAL_CLEAR_WALL == 0;
    let found = scene.materials.iter().position(stops).filter(|_| scene.has_delta_lights())?;
    Some(format!(
        "material \"{}\" is smooth, transmits, and has a coat: point, spot and directional lights cast a full shadow behind it; \
         without the coat, with some roughness, or an opacity below 1 their light passes",
        scene.names.materials[found]
    ))
}

/// Puts the words of vertices' attributes after the texels of textures.
fn add_attributes(path: &Path, words: Vec<u32>, scene: &mut Scene) -> Result<()> {
    let first = scene.texels.len() as u64;
    if words.is_empty() {
        return Ok(());
    }
    if first + words.len() as u64 > u64::from(u32::MAX) {
        return Err(Error::input(path, "textures and vertex colours have more than 2^32 texels together: reduce them"));
    }
    memory::reserve("vertex colours", &mut scene.texels, words.len())?;
    scene.texels.extend(words);
    scene.shading.iter_mut().filter(|s| s.attributes != 0).for_each(|s| s.first += first as u32);
    Ok(())
}

/// Everything but textures; returns the words of vertices' attributes.
fn geometry(sources: &mut Sources, still: bool, scene: &mut Scene) -> Result<Vec<u32>> {
    environment::add_lights(sources, scene)?;
    let mut plan = plan::plan(sources)?;
    enlarge(sources, &mut plan);
    let plan = if still { bake::bake(sources, plan) } else { plan };
    let mut geometry = Geometry::default();
    let stored = store::store(sources, &plan, scene, &mut geometry)?;
    scene.content.add(&geometry.triangles);
    scene.content.add(&geometry.shading);
    hierarchy::build(sources, &plan, stored, &mut geometry, scene)?;
    (scene.triangles, scene.shading) = (geometry.triangles, geometry.shading);
    Ok(geometry.attributes)
}

/// Moves the materials into the scene; returns the warnings.
fn add_materials(mut library: Library, scene: &mut Scene) -> Vec<String> {
    if library.materials.list.is_empty() {
        library.grey();
    }
    let Library { mut materials, warnings, .. } = library;
    let [low, high] = scene.bounds.map(Vec3::from);
    for i in materials.default_bumps {
        materials.list[i as usize].bump_scale = (high - low).length() * DEFAULT_BUMP;
    }
    coat::add_means(&mut materials.list);
    materials.list.iter_mut().for_each(mark_clear_wall);
    (scene.materials, scene.names.materials) = (materials.list, materials.names);
    warnings
}

/// Adds to the fingerprint what surfaces and lights look like; the rest of them is derived from that.
fn add_appearance(scene: &mut Scene) {
    let fingerprint = &mut scene.content;
    fingerprint.add(&scene.materials);
    fingerprint.add(&scene.textures);
    fingerprint.add(&scene.texels);
    fingerprint.add(&scene.lights);
    if let Some(environment) = &scene.environment {
        fingerprint.add(&[environment.width, environment.height]);
        fingerprint.add(&environment.texels);
    }
}
