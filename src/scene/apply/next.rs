//! What a scene becomes by a pose, found and checked before anything is changed.
use super::material::changed;
use crate::error::Checked;
use crate::layout::{
    BSDF_METALLIC, Instance, LIGHT_ENVIRONMENT, Light, MATERIAL_MASKED, Material, NONE, SPHERE, SPHERE_INWARD, Triangle,
};
use crate::scene::build::bvh::{self, Bounds};
use crate::scene::build::environment::{self, rotation};
use crate::scene::build::hierarchy::{check_none_lost, instance, seen};
use crate::scene::build::plan::is_even;
use crate::scene::build::soft::{Placed, Soft};
use crate::scene::description::{LightTable, Transform};
use crate::scene::load::material::{radiance, reflectance};
use crate::scene::pose::{EnvironmentChange, MaterialChange, Pose, Vertices};
use crate::scene::{Fingerprint, Scene};
use glam::{DAffine3, DMat3, Vec3};
use std::collections::HashSet;

/// What is new: what a pose names that is as it was is left out, so that nothing counts as changed that is at rest.
#[derive(Default)]
pub struct Next {
    pub meshes: Vec<NextMesh>,
    pub copies: Option<NextCopies>,
    pub materials: Option<Vec<Material>>,
    pub lights: Option<Vec<Light>>,
}

/// Where copies are.
pub struct NextCopies {
    /// In the order of their numbers.
    pub all: Vec<Instance>,
    /// Numbers of those whose transform has no inverse.
    pub flat: HashSet<u32>,
    /// Numbers of those that are not seen.
    pub hidden: HashSet<u32>,
    /// What the others reach.
    pub world: Bounds,
}

impl NextCopies {
    fn are_new(&self, scene: &Scene) -> bool {
        self.flat != scene.rig.flat || self.hidden != scene.rig.hidden || self.all != copies(scene)
    }
}

/// A mesh in another pose.
pub struct NextMesh {
    /// Index of its tree.
    pub tree: usize,
    pub placed: Placed,
    pub bounds: Bounds,
    /// What identifies the vertices.
    pub pose: String,
}

impl NextMesh {
    fn is_new(&self, scene: &Scene) -> bool {
        scene.rig.trees[self.tree].soft.as_ref().is_none_or(|soft| soft.pose != self.pose)
    }
}

impl Next {
    /// # Errors
    /// A sentence with what cannot be.
    pub fn of(scene: &Scene, pose: &Pose) -> Checked<Self> {
        if !scene.rig.is_built() && !pose.is_of_camera_alone() {
            return Err("the scene was neither loaded nor built from a description: only its camera can move".into());
        }
        if pose.rebuild_above.is_nan() || pose.rebuild_above < 0.0 {
            return Err(format!("rebuild_above is {}: 0 builds always, infinity never", pose.rebuild_above));
        }
        each_once(pose.meshes.iter().map(|(mesh, _)| *mesh))?;
        let meshes = pose.meshes.iter().map(|(mesh, to)| next_meshes(scene, *mesh, to)).collect::<Checked<Vec<_>>>()?;
        let mut meshes: Vec<_> = meshes.into_iter().flatten().collect();
        meshes.retain(|mesh| pose.rebuild_above == 0.0 || mesh.is_new(scene));
        let materials = next_materials(scene, pose)?;
        let copies = match pose.moves() {
            true => Some(next_copies(scene, pose, &meshes, materials.as_deref().unwrap_or(&scene.materials))?),
            false => None,
        };
        if let Some(materials) = &materials {
            new_lamps_hold(scene, copies.as_ref(), materials)?;
        }
        if pose.camera.is_some() || copies.is_some() {
            let bounds = copies.as_ref().map_or(scene.bounds, |copies| copies.world);
            let camera = pose.camera.as_ref().unwrap_or(&scene.view);
            camera.build([1, 1], bounds).map_err(|what| format!("camera: {what}"))?;
        }
        let copies = copies.filter(|copies| !meshes.is_empty() || copies.are_new(scene));
        Ok(Self { meshes, copies, materials, lights: next_lights(scene, pose)? })
    }
}

/// The vertices of a mesh are put in the order that its hierarchy has before the pose: a second time, that may be another.
fn each_once(meshes: impl Iterator<Item = usize>) -> Checked {
    let mut seen = HashSet::new();
    match meshes.into_iter().find(|mesh| !seen.insert(*mesh)) {
        Some(mesh) => Err(format!("mesh {mesh} is posed twice: keep one")),
        None => Ok(()),
    }
}

/// A mesh is stored twice where only some of its instances show the colours of its vertices.
fn next_meshes(scene: &Scene, mesh: usize, to: &Vertices) -> Checked<Vec<NextMesh>> {
    let of_mesh = scene.rig.trees.iter().enumerate().filter(|(_, tree)| tree.mesh == Some(mesh));
    let found = of_mesh.filter_map(|(index, tree)| Some(next_mesh(scene, index, tree.soft.as_ref()?, mesh, to)));
    let found = found.collect::<Checked<Vec<_>>>()?;
    match found.is_empty() {
        true => Err(format!("mesh {mesh} cannot be deformed: it needs `moving = true`, and triangles")),
        false => Ok(found),
    }
}

fn next_mesh(scene: &Scene, tree: usize, soft: &Soft, mesh: usize, to: &Vertices) -> Checked<NextMesh> {
    let before = &scene.triangles[scene.rig.trees[tree].range.clone()];
    let placed = soft.place(to, before).map_err(|what| format!("mesh {mesh} {what}"))?;
    let bounds = bvh::bounds(&placed.triangles).unwrap_or_default();
    let mut pose = Fingerprint::default();
    pose.add(&to.positions);
    pose.add(&to.normals);
    pose.add(&to.tangents);
    pose.add(&to.indices);
    Ok(NextMesh { tree, placed, bounds, pose: pose.to_string() })
}

fn next_copies(scene: &Scene, pose: &Pose, meshes: &[NextMesh], materials: &[Material]) -> Checked<NextCopies> {
    let (mut flat, tree_of, mut copies) = (scene.rig.flat.clone(), &scene.rig.tree_of, copies(scene));
    for (number, transform) in &pose.instances {
        let Some(&copy) = scene.rig.placed.get(*number) else {
            let count = scene.rig.placed.len();
            return Err(format!(
                "instance {number} of {count}: only instances and meshes that are `moving` can be placed"
            ));
        };
        if copy == NONE {
            return Err(format!("instance {number} is fixed: it has no triangles"));
        }
        let affine = placed_by(scene, *number, copy, transform)?;
        if !Transform::from(affine).has_inverse() {
            flat.insert(copy);
            continue;
        }
        flat.remove(&copy);
        let Instance { root, material, object, .. } = copies[copy as usize];
        copies[copy as usize] = Instance { material, object, ..instance(&affine, root) };
        if !is_even(&affine) {
            spheres_shine(scene, copy, &copies[copy as usize], materials)
                .map_err(|what| format!("instance {number} {what}"))?;
        }
    }
    let mut bounds: Vec<_> = scene.rig.trees.iter().map(|tree| tree.bounds).collect();
    meshes.iter().for_each(|mesh| bounds[mesh.tree] = mesh.bounds);
    let farthest = |tree: usize, direction| match meshes.iter().find(|mesh| mesh.tree == tree) {
        Some(mesh) => bvh::along(&mesh.placed.triangles, direction),
        None => bvh::farthest(&scene.nodes, scene.rig.trees[tree].nodes.start as u32, &scene.triangles, direction),
    };
    let (hidden, world) =
        seen(&copies, tree_of, &flat, &bounds, farthest).map_err(|what| format!("instances {what}"))?;
    check_none_lost(scene, &copies, &hidden, world).map_err(|[place, what]| format!("{place}: {what}"))?;
    Ok(NextCopies { all: copies, flat, hidden, world })
}

/// Where a transform puts a copy, which may be moved within what is placed.
fn placed_by(scene: &Scene, number: usize, copy: u32, transform: &Transform) -> Checked<DAffine3> {
    let affine = scene.rig.own.get(&copy).map_or(transform.0, |own| transform.0 * *own);
    match affine.is_finite() {
        true => Ok(affine),
        false => Err(format!("instance {number} gets a transform with NaN or infinite numbers")),
    }
}

/// Checks that what is placed stays within the limit of coordinates, whatever else moves. What is not placed or not seen reaches nowhere.
fn stays_within(scene: &Scene, number: usize, transform: &Transform) -> Checked {
    let Some(&copy) = scene.rig.placed.get(number).filter(|copy| **copy != NONE) else { return Ok(()) };
    let affine = placed_by(scene, number, copy, transform)?;
    if !Transform::from(affine).has_inverse() {
        return Ok(());
    }
    let tree = &scene.rig.trees[scene.rig.tree_of[copy as usize] as usize];
    let root = tree.nodes.start as u32;
    let farthest = |_, direction| bvh::farthest(&scene.nodes, root, &scene.triangles, direction);
    let reach = seen(&[instance(&affine, root)], &[0], &HashSet::new(), &[tree.bounds], farthest);
    reach.map(drop).map_err(|what| format!("instance {number} would {what}"))
}

/// Checks what only now emits light or has holes, which the scene could not know when it chose spheres or meshes.
fn new_lamps_hold(scene: &Scene, next: Option<&NextCopies>, materials: &[Material]) -> Checked {
    let newly = |(m, before): (&Material, &Material)| {
        let lit = m.emission != [0.0; 3];
        lit && (before.emission == [0.0; 3] || m.flags & MATERIAL_MASKED > before.flags & MATERIAL_MASKED)
    };
    if !materials.iter().zip(&scene.materials).any(newly) {
        return Ok(());
    }
    let world = scene.rig.trees.iter().filter(|tree| tree.mesh.is_none());
    world
        .flat_map(|tree| &scene.triangles[tree.range.clone()])
        .try_for_each(|t| sphere_shines(t, true, &materials[t.material as usize]))?;
    let hidden = next.map_or(&scene.rig.hidden, |next| &next.hidden);
    let all = copies(scene);
    for (copy, at) in (0..).zip(next.map_or(&all, |next| &next.all)).filter(|(copy, _)| !hidden.contains(copy)) {
        spheres_shine(scene, copy, at, materials)?;
    }
    Ok(())
}

/// The copies by their numbers.
fn copies(scene: &Scene) -> Vec<Instance> {
    let mut copies = scene.instances.clone();
    scene.rig.order.iter().zip(&scene.instances).for_each(|(&copy, instance)| copies[copy as usize] = *instance);
    copies
}

/// [`sphere_shines`] for all triangles of a copy.
fn spheres_shine(scene: &Scene, copy: u32, at: &Instance, materials: &[Material]) -> Checked {
    let even = is_even(&DAffine3::from_mat4(bvh::world_from_object(at).as_dmat4()));
    let tree = &scene.rig.trees[scene.rig.tree_of[copy as usize] as usize];
    let worn = |triangle: &Triangle| if at.material == NONE { triangle.material } else { at.material };
    scene.triangles[tree.range.clone()].iter().try_for_each(|t| sphere_shines(t, even, &materials[worn(t) as usize]))
}

/// Lamps are sampled where they are hit: a sphere as one of even radiance, below an even coat, that shines outward.
fn sphere_shines(triangle: &Triangle, even: bool, worn: &Material) -> Checked {
    if triangle.primitive & SPHERE == 0 || worn.emission == [0.0; 3] {
        return Ok(());
    }
    let what = match () {
        () if !even => "is stretched",
        () if triangle.primitive & SPHERE_INWARD != 0 => "shines inward",
        () if worn.emission_texture != NONE => "shines by a texture",
        () if worn.clearcoat_texture != NONE => "has a clear coat by a texture",
        () if worn.flags & MATERIAL_MASKED != 0 => "is not opaque",
        () => return Ok(()),
    };
    Err(format!("has a lamp that is a sphere and {what}: give its mesh segments"))
}

fn material_name(scene: &Scene, index: usize) -> String {
    match scene.names.materials.get(index).filter(|name| !name.is_empty()) {
        Some(name) => format!("material \"{name}\""),
        None => format!("material {index}"),
    }
}

/// Checks what a pose says of places, materials, lights, sky and camera, and returns warnings of reflectances that are clamped.
///
/// # Errors
/// A sentence with what cannot be.
pub fn check_numbers(scene: &Scene, pose: &Pose) -> Checked<Vec<String>> {
    for (index, to) in &pose.materials {
        next_material(scene, &scene.materials, *index, to)?;
    }
    let lights = placed_lights(scene);
    for (index, table) in &pose.lights {
        next_light(lights, *index, table)?;
    }
    next_of_sky(scene, pose)?;
    pose.instances.iter().try_for_each(|(number, transform)| stays_within(scene, *number, transform))?;
    if let Some(camera) = &pose.camera {
        camera.build([1, 1], scene.bounds).map_err(|what| format!("camera: {what}"))?;
    }
    let mut warnings = Vec::new();
    for (index, to) in &pose.materials {
        // That of metallic materials is a factor, which may be more.
        let specular = to.specular.filter(|_| scene.materials[*index].kind != BSDF_METALLIC);
        for (value, key) in [(to.color, "color"), (specular, "specular"), (to.transmission, "transmission")] {
            let place = material_name(scene, *index);
            value.map(|value| reflectance(value, &place, key, &mut warnings)).transpose()?;
        }
    }
    Ok(warnings)
}

fn next_materials(scene: &Scene, pose: &Pose) -> Checked<Option<Vec<Material>>> {
    if pose.materials.is_empty() {
        return Ok(None);
    }
    let mut materials = scene.materials.clone();
    for (index, to) in &pose.materials {
        materials[*index] = next_material(scene, &materials, *index, to)?;
    }
    Ok((materials != scene.materials).then_some(materials))
}

fn next_material(scene: &Scene, materials: &[Material], index: usize, to: &MaterialChange) -> Checked<Material> {
    let count = materials.len();
    let m = materials.get(index).ok_or_else(|| format!("material {index} of {count}: there is none"))?;
    changed(m, to).map_err(|what| format!("{}: {what}", material_name(scene, index)))
}

fn next_lights(scene: &Scene, pose: &Pose) -> Checked<Option<Vec<Light>>> {
    if pose.lights.is_empty() && pose.environment.is_none() {
        return Ok(None);
    }
    let (mut lights, count) = (scene.rig.lights.clone(), placed_lights(scene));
    for (index, table) in &pose.lights {
        lights[*index] = next_light(count, *index, table)?;
    }
    if let Some(sky) = next_of_sky(scene, pose)? {
        lights[count] = sky;
    }
    Ok((lights != scene.rig.lights).then_some(lights))
}

/// How many lights have a table, behind which the sky is one more.
fn placed_lights(scene: &Scene) -> usize {
    let lights = &scene.rig.lights;
    lights.iter().rposition(|light| light.kind == LIGHT_ENVIRONMENT).unwrap_or(lights.len())
}

fn next_light(count: usize, index: usize, table: &LightTable) -> Checked<Light> {
    if index >= count {
        return Err(format!("light {index} of {count}: there is none"));
    }
    table.build().map_err(|what| format!("light {index}: {what}"))
}

fn next_of_sky(scene: &Scene, pose: &Pose) -> Checked<Option<Light>> {
    let Some(to) = &pose.environment else { return Ok(None) };
    let sky = scene.rig.lights.get(placed_lights(scene)).ok_or("the scene has no environment that could change")?;
    next_sky(sky, to).map(Some)
}

fn next_sky(sky: &Light, to: &EnvironmentChange) -> Checked<Light> {
    let value =
        radiance(to.radiance.unwrap_or(sky.value), "radiance").map_err(|what| format!("environment: {what}"))?;
    let turned = match to.rotation {
        Some(degrees) if !degrees.is_finite() => return Err("environment: its rotation is no number".to_owned()),
        Some(degrees) => rotation(degrees, None)?,
        None => {
            let [x, y, z] = [sky.a, sky.b, sky.c].map(|v| Vec3::from(v).as_dvec3());
            DMat3::from_cols(x, y, z)
        }
    };
    Ok(environment::light(value, turned))
}
