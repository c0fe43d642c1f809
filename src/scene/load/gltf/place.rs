//! Puts the meshes of nodes into a description: baked where one node shows them, as instances where several do, and in a copy
//! of their own where joints or morph targets move them.
use super::accessor::Elements;
use super::asset::{Asset, one_line};
use super::deform::{Skin, deformed};
use super::extension::{self, Instancing};
use super::material;
use super::picture::Pictures;
use super::primitive::{self, Primitive};
use crate::error::Result;
use crate::memory;
use crate::scene::description::{Description, InstanceTable, MaterialTable, Mesh, MeshTable, Transform};
use glam::{DAffine3, DQuat, DVec3};
use std::collections::{BTreeMap, HashMap};

/// Bytes of an instance while a scene is made.
const BYTES_OF_INSTANCE: u64 = 1024;

/// Collects what nodes show.
pub struct Placer<'a> {
    asset: &'a Asset<'a>,
    /// By node.
    worlds: &'a [DAffine3],
    /// Primitives of the meshes that were read.
    meshes: HashMap<usize, Vec<Primitive>>,
    /// By mesh: the nodes that show it at rest, and where.
    placed: BTreeMap<usize, Vec<DAffine3>>,
    tables: Vec<MeshTable>,
    instances: Vec<InstanceTable>,
    materials: Vec<MaterialTable>,
    /// By index of the material, or `None` for the default one: its name.
    names: HashMap<Option<usize>, String>,
    mesh_names: Names,
    material_names: Names,
    pictures: Pictures,
    /// Numbers of what was left out, for the warnings.
    without_surface: usize,
    without_positions: usize,
    flat: usize,
}

impl<'a> Placer<'a> {
    /// With the world transforms of all nodes.
    pub fn new(asset: &'a Asset<'a>, worlds: &'a [DAffine3]) -> Self {
        Self {
            asset,
            worlds,
            meshes: HashMap::new(),
            placed: BTreeMap::new(),
            tables: Vec::new(),
            instances: Vec::new(),
            materials: Vec::new(),
            names: HashMap::new(),
            mesh_names: Names::default(),
            material_names: Names::default(),
            pictures: Pictures::default(),
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
        let skin = json.skin.map(|skin| Skin::read(self.asset, skin.value())).transpose()?;
        let matrices = skin.map(|skin| skin.matrices(self.worlds));
        let weights = json.weights.as_ref().or(self.asset.root.meshes[mesh].weights.as_ref());
        let moved = self.meshes[&mesh].iter().any(|primitive| {
            let skinned = matrices.is_some() && !primitive.joints.is_empty();
            skinned || weights.is_some() && !primitive.targets.is_empty()
        });
        let copies = self.copies(node)?;
        if !moved {
            self.placed.entry(mesh).or_default().extend(copies);
            return Ok(());
        }
        let weights = weights.map_or(&[][..], Vec::as_slice);
        let name = json.name.as_ref().or(self.asset.root.meshes[mesh].name.as_ref());
        let name = name.map_or_else(|| format!("node {node}"), |name| one_line(name));
        let primitives = self.meshes.remove(&mesh).unwrap_or_default();
        for primitive in &primitives {
            let skin = matrices.as_deref().filter(|_| !primitive.joints.is_empty());
            let (vertices, triangles) = (primitive.mesh.positions.len(), primitive.mesh.triangles());
            memory::need(self.asset.path.display(), 72 * vertices as u64 + 12 * triangles as u64)?;
            let surface = deformed(primitive, weights, skin);
            // A skin moves vertices to where they are in the world: the node that shows it does not count.
            let at = if skin.is_some() { vec![DAffine3::IDENTITY] } else { copies.clone() };
            self.add(&name, surface, primitive.material, at)?;
        }
        self.meshes.insert(mesh, primitives);
        Ok(())
    }

    /// Adds what nodes show at rest, and moves all to the description.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] for materials and pictures that cannot be read.
    pub fn finish(mut self, description: &mut Description, warnings: &mut Vec<String>) -> Result<()> {
        for (mesh, copies) in std::mem::take(&mut self.placed) {
            let name = self.asset.root.meshes[mesh].name.as_ref().map(|name| one_line(name));
            let name = name.filter(|name| !name.is_empty()).unwrap_or_else(|| format!("mesh {mesh}"));
            for primitive in self.meshes.remove(&mesh).unwrap_or_default() {
                self.add(&name, primitive.mesh, primitive.material, copies.clone())?;
            }
        }
        let rows = [
            (self.without_surface, "primitives of points or lines have no surface and are not rendered"),
            (self.without_positions, "primitives without positions are not rendered"),
            (self.flat, "meshes whose scale is 0 are not rendered"),
        ];
        warnings.extend(rows.iter().filter(|row| row.0 > 0).map(|(count, what)| format!("{count} {what}")));
        warnings.append(&mut self.pictures.warnings);
        description.mesh = self.tables;
        description.instance = self.instances;
        description.material = self.materials;
        description.bitmap = self.pictures.bitmaps;
        Ok(())
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
                Some(primitive) => primitives.push(primitive),
                None => self.without_positions += 1,
            }
        }
        self.meshes.insert(mesh, primitives);
        Ok(())
    }

    /// Where a node shows its mesh: once, or as often as `EXT_mesh_gpu_instancing` says. What is flattened is left out.
    fn copies(&mut self, node: usize) -> Result<Vec<DAffine3>> {
        let all = self.asset.root.nodes[node].extensions.as_ref().map(|e| &e.others);
        let place = format!("node {node}");
        let several: Option<Instancing> = extension::read(self.asset, all, "EXT_mesh_gpu_instancing", &place)?;
        let world = self.worlds[node];
        let mut copies = match several {
            Some(Instancing { attributes }) => instances(self.asset, &attributes, &place)?,
            None => vec![DAffine3::IDENTITY],
        };
        copies.iter_mut().for_each(|copy| *copy = world * *copy);
        let before = copies.len();
        copies.retain(has_inverse);
        self.flat += before - copies.len();
        Ok(copies)
    }

    /// Adds a mesh at every one of `copies`.
    fn add(&mut self, name: &str, mesh: Mesh, material: Option<usize>, copies: Vec<DAffine3>) -> Result<()> {
        if copies.is_empty() {
            return Ok(());
        }
        memory::need(self.asset.path.display(), BYTES_OF_INSTANCE * copies.len() as u64)?;
        let name = self.mesh_names.unused(name);
        let material = Some(self.material(material)?);
        let transform = if let [only] = copies[..] { only } else { DAffine3::IDENTITY };
        if copies.len() > 1 {
            let instance = |at: &DAffine3| InstanceTable {
                mesh: name.clone(),
                transform: Transform(*at),
                material: None,
                name: None,
            };
            self.instances.extend(copies.iter().map(instance));
        }
        // A mesh without normals is meant to be flat: glTF 2.0, section 3.7.2.1.
        let flat = mesh.normals.is_empty();
        let (name, data, transform) = (Some(name), Some(mesh), Transform(transform));
        self.tables.push(MeshTable { name, data, material, transform, flat, ..MeshTable::default() });
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
                material::table(self.asset, index, self.material_names.unused(&named), &mut self.pictures)?
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

/// Whether a mesh can be placed so.
fn has_inverse(affine: &DAffine3) -> bool {
    affine.is_finite() && affine.matrix3.determinant().abs() > 1e-60 && affine.inverse().is_finite()
}

/// The transforms that `EXT_mesh_gpu_instancing` lists.
fn instances(asset: &Asset, attributes: &BTreeMap<String, usize>, place: &str) -> Result<Vec<DAffine3>> {
    let at = |what: String| asset.at(place, what);
    let translations = optional::<3>(asset, attributes, "TRANSLATION", place)?;
    let rotations = optional::<4>(asset, attributes, "ROTATION", place)?;
    let scales = optional::<3>(asset, attributes, "SCALE", place)?;
    let counts = [translations.len(), rotations.len(), scales.len()];
    let count = counts.into_iter().max().unwrap_or(0);
    if counts.iter().any(|other| ![0, count].contains(other)) {
        return Err(at(format!("places {count} instances, but not all of them have all attributes")));
    }
    memory::need(asset.path.display(), BYTES_OF_INSTANCE * count as u64)?;
    let triple = |list: &[[f32; 3]], i: usize, or: DVec3| list.get(i).map_or(or, |v| DVec3::from(v.map(f64::from)));
    let turn = |i: usize| {
        let rotation = rotations.get(i).map(|r| DQuat::from_array(r.map(f64::from)));
        rotation.filter(|r| r.length() > 1e-30 && r.is_finite()).map_or(DQuat::IDENTITY, DQuat::normalize)
    };
    let one = |i: usize| {
        let (scale, moved) = (triple(&scales, i, DVec3::ONE), triple(&translations, i, DVec3::ZERO));
        DAffine3::from_scale_rotation_translation(scale, turn(i), moved)
    };
    Ok((0..count).map(one).collect())
}

fn optional<const N: usize>(
    asset: &Asset,
    attributes: &BTreeMap<String, usize>,
    name: &str,
    place: &str,
) -> Result<Vec<[f32; N]>> {
    let Some(&index) = attributes.get(name) else { return Ok(Vec::new()) };
    Elements::of(asset, index)?.numbers().map_err(|what| asset.at(format!("{place}, accessor {index}"), what))
}
