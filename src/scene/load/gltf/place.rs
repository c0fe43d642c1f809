//! Puts the meshes of nodes into a description: baked where one node shows them, as instances where several do, and in a copy
//! of their own where joints or morph targets move them.
use super::asset::{Asset, one_line};
use super::clip::Channel;
use super::deform::{Skin, deformed, is_flat};
use super::instancing;
use super::material;
use super::motion::{MovedInstance, MovedMesh};
use super::node::Tree;
use super::picture::Pictures;
use super::primitive::{self, Primitive};
use super::tangent;
use crate::error::Result;
use crate::memory;
use crate::scene::description::{Description, InstanceTable, MaterialTable, Mesh, MeshTable, Transform};
use glam::{DAffine3, DVec3, Vec3};
use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

/// Bytes of a vertex that joints or morph targets have moved.
const BYTES_OF_BENT_VERTEX: usize = 72;

/// Bytes of an instance while a scene is made.
const BYTES_OF_INSTANCE: u64 = 1024;

/// Which nodes move.
pub struct Moved {
    /// By node: whether it moves, itself or with its ancestors.
    pub nodes: Vec<bool>,
    /// By node: whether the weights of its morph targets change.
    weights: Vec<bool>,
}

impl Moved {
    /// By these channels, and the nodes that a scene file's keys move.
    pub fn new(tree: &Tree, channels: &[Channel], keyed: impl Iterator<Item = usize>) -> Self {
        let mut weights = vec![false; tree.locals.len()];
        channels.iter().filter(|channel| channel.is_morph()).for_each(|channel| weights[channel.node] = true);
        let nodes = channels.iter().filter(|channel| !channel.is_morph()).map(|channel| channel.node);
        Self { nodes: tree.moved(nodes.chain(keyed)), weights }
    }
}

/// A place where a node shows a mesh.
#[derive(Clone, Copy)]
struct Copy {
    node: usize,
    /// Seen from the node.
    own: DAffine3,
}

/// What nodes move, by its numbers in the description.
pub struct Placed {
    /// Instances.
    pub instances: Vec<MovedInstance>,
    /// Meshes that are deformed.
    pub meshes: Vec<MovedMesh>,
}

/// Collects what nodes show.
pub struct Placer<'a> {
    asset: &'a Asset<'a>,
    /// By node.
    worlds: &'a [DAffine3],
    moved: &'a Moved,
    /// Primitives of the meshes that were read.
    meshes: HashMap<usize, Vec<Arc<Primitive>>>,
    skins: HashMap<usize, Arc<Skin>>,
    /// By mesh: where nodes show it at rest.
    placed: BTreeMap<usize, Vec<Copy>>,
    found: Placed,
    tables: Vec<MeshTable>,
    instances: Vec<InstanceTable>,
    materials: Vec<MaterialTable>,
    /// By index of the material, or `None` for the default one: its name.
    names: HashMap<Option<usize>, String>,
    mesh_names: Names,
    material_names: Names,
    pictures: Pictures,
    /// Numbers of materials that were clamped.
    clamped: Vec<String>,
    /// Numbers of what was left out, for the warnings.
    without_surface: usize,
    without_positions: usize,
    flat: usize,
}

impl<'a> Placer<'a> {
    /// With the world transforms of all nodes at rest.
    pub fn new(asset: &'a Asset<'a>, worlds: &'a [DAffine3], moved: &'a Moved) -> Self {
        Self {
            asset,
            worlds,
            moved,
            meshes: HashMap::new(),
            skins: HashMap::new(),
            found: Placed { instances: Vec::new(), meshes: Vec::new() },
            placed: BTreeMap::new(),
            tables: Vec::new(),
            instances: Vec::new(),
            materials: Vec::new(),
            names: HashMap::new(),
            mesh_names: Names::default(),
            material_names: Names::default(),
            pictures: Pictures::default(),
            clamped: Vec::new(),
            without_surface: 0,
            without_positions: 0,
            flat: 0,
        }
    }

    /// Adds what a node shows, if it has a mesh.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] for a mesh or skin that cannot be read.
    pub fn node(&mut self, node: usize) -> Result<()> {
        let json = &self.asset.root.nodes[node];
        let Some(mesh) = json.mesh.map(|mesh| mesh.value()) else { return Ok(()) };
        self.read(mesh)?;
        let skin = json.skin.map(|skin| self.skin(skin.value())).transpose()?;
        let weights = json.weights.as_ref().or(self.asset.root.meshes[mesh].weights.as_ref());
        let weighted = weights.is_some() || self.moved.weights[node];
        let weights = weights.cloned().unwrap_or_default();
        let bends = |primitive: &Arc<Primitive>| {
            skin.is_some() && !primitive.joints.is_empty() || weighted && !primitive.targets.is_empty()
        };
        let flat = self.flat;
        let (flattened, copies): (Vec<Copy>, Vec<Copy>) =
            self.copies(node)?.into_iter().partition(|copy| self.moves_flattened(copy));
        if skin.is_some() && self.meshes[&mesh].iter().all(|primitive| !primitive.joints.is_empty()) {
            self.flat = flat; // joints alone say where it is
        }
        let bends = self.meshes[&mesh].iter().any(bends);
        let name = json.name.as_ref().or(self.asset.root.meshes[mesh].name.as_ref());
        let name = name.map_or_else(|| format!("node {node}"), |name| one_line(name));
        if !flattened.is_empty() {
            self.add_moving_flattened(&name, self.meshes[&mesh].clone(), &flattened, &weights, skin.is_some())?;
        }
        if !bends {
            self.placed.entry(mesh).or_default().extend(copies);
            return Ok(());
        }
        for primitive in self.meshes[&mesh].clone() {
            let skin = skin.clone().filter(|_| !primitive.joints.is_empty());
            let weights = weights.clone();
            self.add_bent(&name, MovedMesh { number: self.tables.len(), node, primitive, skin, weights }, &copies)?;
        }
        Ok(())
    }

    /// Adds what moves and is flattened along an axis: its vertices are placed in every pose, as by a skin of one joint. Primitives of a skin are
    /// where their joints are.
    fn add_moving_flattened(
        &mut self,
        name: &str,
        primitives: Vec<Arc<Primitive>>,
        copies: &[Copy],
        weights: &[f32],
        is_skinned: bool,
    ) -> Result<()> {
        for primitive in primitives.iter().filter(|primitive| !is_skinned || primitive.joints.is_empty()) {
            let primitive = Arc::new(primitive.of_one_joint());
            for Copy { node, own } in copies {
                let skin = Some(Arc::new(Skin::of_node(*node, *own)));
                let (number, weights) = (self.tables.len(), weights.to_vec());
                let bent = MovedMesh { number, node: *node, primitive: primitive.clone(), skin, weights };
                self.add_bent(name, bent, &[])?;
            }
        }
        Ok(())
    }

    /// Adds a mesh in the pose of the file, and notes that it moves if it does.
    fn add_bent(&mut self, name: &str, bent: MovedMesh, copies: &[Copy]) -> Result<()> {
        let mesh = &bent.primitive.mesh;
        let bytes = BYTES_OF_BENT_VERTEX * mesh.positions.len() + size_of::<u32>() * mesh.indices.len();
        memory::need(self.asset.path.display(), bytes as u64)?;
        let matrices = bent.skin.as_ref().map(|skin| skin.matrices(self.worlds));
        let surface = deformed(&bent.primitive, &bent.weights, matrices.as_deref());
        let joints = bent.skin.iter().flat_map(|skin| &skin.joints);
        let moves = self.moved.weights[bent.node] || joints.into_iter().any(|&joint| self.moved.nodes[joint]);
        let material = bent.primitive.material;
        // A skin moves vertices to where they are in the world: the node that shows it does not count.
        match &bent.skin {
            Some(_) => self.add_fixed(name, surface, material)?,
            None => self.add(name, surface, material, copies)?,
        }
        // A mesh that is shown nowhere has no table.
        if let Some(table) = self.tables.get_mut(bent.number).filter(|_| moves) {
            table.moving = true;
            self.found.meshes.push(bent);
        }
        Ok(())
    }

    fn skin(&mut self, index: usize) -> Result<Arc<Skin>> {
        if let Some(skin) = self.skins.get(&index) {
            return Ok(skin.clone());
        }
        let skin = Arc::new(Skin::read(self.asset, index)?);
        self.skins.insert(index, skin.clone());
        Ok(skin)
    }

    /// Adds what nodes show at rest, and moves all to the description.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] for materials and pictures that cannot be read.
    pub fn finish(mut self, description: &mut Description, warnings: &mut Vec<String>) -> Result<Placed> {
        for (mesh, copies) in std::mem::take(&mut self.placed) {
            let name = self.asset.root.meshes[mesh].name.as_ref().map(|name| one_line(name));
            let name = name.filter(|name| !name.is_empty()).unwrap_or_else(|| format!("mesh {mesh}"));
            for primitive in self.meshes.remove(&mesh).unwrap_or_default() {
                let material = primitive.material;
                let surface = Arc::try_unwrap(primitive).map_or_else(|shared| shared.mesh.clone(), |own| own.mesh);
                self.add(&name, surface, material, &copies)?;
            }
        }
        let rows = [
            (self.without_surface, "primitives of points or lines have no surface and are not rendered"),
            (self.without_positions, "primitives without positions are not rendered"),
            (self.flat, "meshes whose scale is 0 are not rendered"),
        ];
        warnings.extend(rows.iter().filter(|row| row.0 > 0).map(|(count, what)| format!("{count} {what}")));
        warnings.append(&mut self.pictures.warnings);
        if let Some(first) = self.clamped.first() {
            let more = self.clamped.len() - 1;
            let rest = if more > 0 { format!(" and {more} more") } else { String::new() };
            warnings.push(format!("numbers beyond what glTF allows are clamped: {first}{rest}"));
        }
        description.mesh = self.tables;
        description.instance = self.instances;
        description.material = self.materials;
        description.picture_file = self.pictures.within;
        Ok(self.found)
    }

    fn read(&mut self, mesh: usize) -> Result<()> {
        if self.meshes.contains_key(&mesh) {
            return Ok(());
        }
        let (mut primitives, place) = (Vec::new(), format!("mesh {mesh}"));
        for json in &self.asset.root.meshes[mesh].primitives {
            if !primitive::has_surface(json) {
                self.without_surface += 1;
                continue;
            }
            match primitive::read(self.asset, json, &place)? {
                Some(mut primitive) => {
                    tangent::add(self.asset, &mut primitive);
                    primitives.push(Arc::new(primitive));
                }
                None => self.without_positions += 1,
            }
        }
        self.meshes.insert(mesh, primitives);
        Ok(())
    }

    /// Where a node shows its mesh: once, or as often as `EXT_mesh_gpu_instancing` says. What has no extent is left out.
    fn copies(&mut self, node: usize) -> Result<Vec<Copy>> {
        let all = self.asset.root.nodes[node].extensions.as_ref().map(|e| &e.others);
        let place = format!("node {node}");
        let several = instancing::read(self.asset, all, &place)?;
        memory::need(self.asset.path.display(), BYTES_OF_INSTANCE * several.as_ref().map_or(0, Vec::len) as u64)?;
        let owns = several.unwrap_or_else(|| vec![DAffine3::IDENTITY]);
        let mut copies: Vec<_> = owns.into_iter().map(|own| Copy { node, own }).collect();
        copies.retain(|copy| {
            let world = Transform::from(self.world(copy));
            // What moves may be flat at rest alone.
            self.moved.nodes[node] || is_solid(&world) || spans_a_plane(&world.0)
        });
        self.flat += usize::from(copies.is_empty());
        Ok(copies)
    }

    /// Whether it is flattened along one axis, and no fixed mesh can show it: no instance has such a transform.
    fn moves_flattened(&self, copy: &Copy) -> bool {
        let (world, moved) = (Transform::from(self.world(copy)), &self.moved);
        (moved.nodes[copy.node] || moved.weights[copy.node]) && !is_solid(&world) && spans_a_plane(&world.0)
    }

    fn world(&self, copy: &Copy) -> DAffine3 {
        self.worlds[copy.node] * copy.own
    }

    /// Adds a mesh at every one of `copies`: baked where it is flattened, as instances where there are several, or where its node
    /// moves.
    fn add(&mut self, name: &str, mesh: Mesh, material: Option<usize>, copies: &[Copy]) -> Result<()> {
        let stays_whole = |copy: &&Copy| self.moved.nodes[copy.node] || is_solid(&Transform::from(self.world(copy)));
        let (copies, flat): (Vec<Copy>, Vec<Copy>) = copies.iter().partition(stays_whole);
        for copy in flat {
            self.add_flattened(name, &mesh, material, &copy)?;
        }
        if copies.is_empty() {
            return Ok(());
        }
        memory::need(self.asset.path.display(), BYTES_OF_INSTANCE * copies.len() as u64)?;
        let at = self.tables.len();
        self.add_fixed(name, mesh, material)?;
        if let [only] = copies[..]
            && !self.moved.nodes[only.node]
        {
            self.tables[at].transform = Transform::from(self.world(&only));
            return Ok(());
        }
        let mesh = self.tables[at].name.clone().unwrap_or_default();
        for copy in copies {
            let (number, Copy { node, own }) = (self.instances.len(), copy);
            self.found.instances.extend(self.moved.nodes[node].then_some(MovedInstance { number, node, own }));
            let world = Transform::from(self.world(&copy));
            let transform = if is_solid(&world) { world } else { speck(&world.0) };
            self.instances.push(InstanceTable { mesh: mesh.clone(), transform, ..InstanceTable::default() });
        }
        Ok(())
    }

    /// Adds the facets of a mesh that keep an area when it is moved to a plane. Normals have no direction there.
    fn add_flattened(&mut self, name: &str, mesh: &Mesh, material: Option<usize>, copy: &Copy) -> Result<()> {
        let bytes = BYTES_OF_BENT_VERTEX * mesh.positions.len() + size_of::<u32>() * mesh.indices.len();
        memory::need(self.asset.path.display(), bytes as u64)?;
        let world = self.world(copy);
        let place = |p: &[f32; 3]| world.transform_point3(DVec3::from(p.map(f64::from))).as_vec3();
        let positions: Vec<_> = mesh.positions.iter().map(place).collect();
        let area = |t: &&[u32]| {
            let [a, b, c] = [0, 1, 2].map(|corner| positions[t[corner] as usize]);
            (b - a).cross(c - a) != Vec3::ZERO
        };
        let indices: Vec<_> = mesh.indices.chunks_exact(3).filter(area).flatten().copied().collect();
        if indices.is_empty() {
            self.flat += 1;
            return Ok(());
        }
        let positions = positions.into_iter().map(|p| p.to_array()).collect();
        let plane = Mesh { positions, indices, normals: Vec::new(), tangents: Vec::new(), ..mesh.clone() };
        self.add_fixed(name, plane, material)
    }

    /// Adds a mesh whose vertices are where they are in the world.
    fn add_fixed(&mut self, name: &str, mesh: Mesh, material: Option<usize>) -> Result<()> {
        let (name, material) = (Some(self.mesh_names.unused(name)), Some(self.material(material)?));
        // A mesh without normals is meant to be flat: glTF 2.0, section 3.7.2.1.
        let flat = mesh.normals.is_empty();
        self.tables.push(MeshTable { name, data: Some(mesh), material, flat, ..MeshTable::default() });
        Ok(())
    }

    /// The name of a material, whose table is made when it is first asked for.
    fn material(&mut self, index: Option<usize>) -> Result<String> {
        if let Some(name) = self.names.get(&index) {
            return Ok(name.clone());
        }
        let table = match index {
            Some(index) => {
                let named = self.asset.root.materials[index].name.as_deref().map(one_line);
                let named = named.filter(|name| !name.is_empty()).unwrap_or_else(|| format!("material {index}"));
                let name = self.material_names.unused(&named);
                material::table(self.asset, index, name, &mut self.pictures, &mut self.clamped)?
            }
            None => MaterialTable { name: self.material_names.unused(material::DEFAULT), ..material::default_table() },
        };
        let name = table.name.clone();
        self.materials.push(table);
        self.names.insert(index, name.clone());
        Ok(name)
    }
}

/// Names that are taken, and how many asked for each.
#[derive(Default)]
struct Names(HashMap<String, usize>);

impl Names {
    /// `name`, or with a number where another has it; from then on it is taken.
    fn unused(&mut self, name: &str) -> String {
        let mut free = name.to_owned();
        while self.0.contains_key(&free) {
            let asked = self.0.entry(name.to_owned()).or_insert(1);
            *asked += 1;
            free = format!("{name} {asked}");
        }
        self.0.insert(free.clone(), 1);
        free
    }
}

/// Whether a transform leaves meshes an extent in all directions, so that an instance can have it.
fn is_solid(transform: &Transform) -> bool {
    transform.has_inverse() && !is_flat(&transform.0.matrix3)
}

/// Whether a transform leaves meshes two directions at least. The bound is the square of the scale below which
/// [`Transform::has_inverse`] sees none.
fn spans_a_plane(affine: &DAffine3) -> bool {
    const LEAST: f64 = 1e-36;
    let m = affine.matrix3;
    let areas = [m.x_axis.cross(m.y_axis), m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis)];
    affine.is_finite() && areas.iter().any(|area| area.length() >= LEAST)
}

/// Stands in at rest for what is flat then, and moves: so small that it is not seen.
fn speck(affine: &DAffine3) -> Transform {
    const SIZE: f64 = 1e-6;
    Transform::from(DAffine3 { translation: affine.translation, ..DAffine3::from_scale(DVec3::splat(SIZE)) })
}
