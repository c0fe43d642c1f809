//! glTF 2.0 files become descriptions: meshes in memory, materials, instances, lights and cameras.
//!
//! The crate `gltf-json` parses the JSON. What it says is checked here, and buffers are read here: the crate `gltf`, which would
//! do so, panics on counts of 0 and wrong types, and reads files anywhere.
mod accessor;
mod asset;
mod camera;
mod check;
mod clip;
mod curve;
mod deform;
mod extension;
mod glb;
mod instancing;
mod light;
mod material;
mod motion;
mod node;
mod picture;
mod place;
mod primitive;
mod tangent;
mod uri;

use crate::error::Result;
use crate::memory;
use crate::scene::animation::{Keyed, Mover};
use crate::scene::description::{Description, EnvironmentTable, nearest};
use asset::{Asset, one_line};
pub use camera::Named;
use gltf_json::Node;
use motion::{CameraMotion, Motion, MovedLight};
use node::Tree;
use place::{Moved, Placed, Placer};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// What a glTF file holds.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// The default scene, seen by its first camera, or by one that frames it.
    pub description: Description,
    /// All cameras of the scene, in the order of its nodes.
    pub cameras: Vec<Named>,
    /// What moves besides cameras.
    pub mover: Option<Arc<dyn Mover>>,
    /// Readable lines about what is not rendered or was repaired.
    pub warnings: Vec<String>,
    /// Files of its buffers.
    pub buffers: Vec<PathBuf>,
}

/// Reads a `.gltf` or `.glb` file. A file without lights of `KHR_lights_punctual` gets a sky of radiance 1, since glTF has no
/// other place for the light that its models are shown in. Pictures are named relative to `base`, where they lie below it. `clip`
/// names the animation that is played; without, all are that do not move the same as an earlier one. `keys` move nodes of these names.
///
/// # Errors
/// [`crate::error::Error::Input`] with file, place and remedy, also for a clip or node that is not there; [`crate::error::Error::Memory`].
pub fn load(path: &Path, base: &Path, clip: Option<&str>, keys: Vec<(String, Keyed)>) -> Result<Model> {
    let (asset, left_out) = Asset::read(path, base, extension::check)?;
    let mut model = Model { buffers: asset.buffer_files(), ..Model::default() };
    model.warnings.extend(left_out);
    check::check(&asset)?;
    let tree = Tree::new(&asset)?;
    let surfaces = asset.root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let bytes =
        surfaces.map(|surface| primitive::bytes(&asset, surface).saturating_add(tangent::bytes(&asset, surface)));
    let bytes = bytes.fold(0, u64::saturating_add);
    memory::need(path.display(), bytes)?;
    let (worlds, views) = (tree.worlds(&tree.locals), tree.views(&tree.locals));
    let lights = light::read(&asset, &mut model.warnings)?;
    let channels = clip::read(&asset, &tree, clip, &mut model.warnings)?;
    let keyed = nodes_of(&asset, keys)?;
    let moved = Moved::new(&tree, &channels, keyed.iter().map(|(node, _)| *node));
    let mut placer = Placer::new(&asset, &worlds, &moved);
    let mut moved_lights = Vec::new();
    for &node in &tree.shown {
        placer.node(node)?;
        if let Some(table) = light::of_node(&asset, node, &worlds[node], &lights)? {
            let number = model.description.light.len();
            moved_lights.extend(moved.nodes[node].then(|| MovedLight { number, node, table: table.clone() }));
            model.description.light.push(table);
        }
        model.cameras.extend(camera::of_node(&asset, node, &views[node], &mut model.warnings));
    }
    let placed = placer.finish(&mut model.description, &mut model.warnings)?;
    let moves = moved.nodes;
    let Placed { instances, meshes } = placed;
    let motion = Arc::new(Motion { tree, channels, keyed, instances, meshes, lights: moved_lights });
    if !(motion.channels.is_empty() && motion.keyed.is_empty()) {
        for named in model.cameras.iter_mut().filter(|named| moves[named.node]) {
            let (motion, node, camera) = (motion.clone(), named.node, named.camera.clone());
            named.mover = Some(Arc::new(CameraMotion { motion, node, camera }));
        }
        model.mover = Some(motion);
    }
    if model.description.light.is_empty() {
        model.description.environment = Some(EnvironmentTable::default());
    }
    if let Some(first) = model.cameras.first() {
        (model.description.camera, model.description.film) = (first.camera.clone(), first.film.clone());
    }
    Ok(model)
}

/// The nodes that keys move. Several names may be those of one.
fn nodes_of(asset: &Asset, keys: Vec<(String, Keyed)>) -> Result<Vec<(usize, Keyed)>> {
    let mut keyed: Vec<(usize, Keyed)> = Vec::new();
    for (name, keys) in keys {
        let node = node_of(asset, &name)?;
        if keyed.iter().any(|(earlier, _)| *earlier == node) {
            let what = "is moved by an earlier table: put all keys into one";
            return Err(asset.at(format!("node \"{name}\""), what));
        }
        keyed.push((node, keys));
    }
    Ok(keyed)
}

/// The first node of a name: its own, that of its mesh, or its number.
fn node_of(asset: &Asset, name: &str) -> Result<usize> {
    let mesh_of = |node: &Node| node.mesh.and_then(|mesh| asset.root.meshes[mesh.value()].name.as_deref());
    let nodes = || asset.root.nodes.iter().enumerate();
    let named = |(index, node): (usize, &Node)| {
        let own = node.name.as_deref().or(mesh_of(node)).map(one_line);
        own.filter(|own| !own.is_empty()).unwrap_or_else(|| format!("node {index}"))
    };
    let by_number = name.strip_prefix("node ").and_then(|number| number.parse().ok());
    let found = nodes().position(|node| named(node) == name);
    found.or(by_number.filter(|&number: &usize| number < asset.root.nodes.len())).ok_or_else(|| {
        let names: Vec<_> = nodes().map(named).collect();
        let near = nearest(name, names.iter().map(String::as_str)).unwrap_or("(there are no nodes)");
        asset.at(format!("node \"{name}\""), format!("is not there: did you mean \"{near}\"?"))
    })
}
