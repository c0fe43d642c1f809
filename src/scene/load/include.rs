//! glTF files that `[[mesh]]` tables name: what they show takes the place of the tables, wherever these and their instances put it.
use super::gltf::{self, Model};
use super::mesh_file::Format;
use crate::error::{Error, Result};
use crate::scene::animation::{self, Keyed, Mover};
use crate::scene::description::{Description, InstanceTable, LightTable, MaterialTable, MeshTable};
use crate::scene::pose::Pose;
use glam::{DAffine3, Vec3};
use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A description without glTF files, what moves in those that it had, warnings about them, and all files that they consist of.
pub type Included<'a> = (Cow<'a, Description>, Vec<Arc<dyn Mover>>, Vec<String>, Vec<PathBuf>);

/// Reads the glTF files that a description's meshes name; `path` is that of the scene file. Their cameras and skies are left out.
///
/// # Errors
/// [`Error::Input`] for what is wrong with a file, and for keys of its table that it cannot have.
pub fn models<'a>(path: &Path, from: &'a Description) -> Result<Included<'a>> {
    let is_model = |table: &MeshTable| table.file.as_deref().is_some_and(|file| Format::of(file) == Format::Gltf);
    // Of a name, the first mesh.
    let named: HashMap<_, _> = from.mesh.iter().enumerate().rev().filter_map(|(i, m)| Some((name_of(m)?, i))).collect();
    let names_model = |name: &str| named.get(name).is_some_and(|&number| is_model(&from.mesh[number]));
    let mut keys = keys_of_nodes(path, from, names_model)?;
    if !from.mesh.iter().any(is_model) {
        return Ok((Cow::Borrowed(from), Vec::new(), Vec::new(), Vec::new()));
    }
    let (of_models, instance): (Vec<_>, Vec<_>) = from.instance.iter().cloned().partition(|i| names_model(&i.mesh));
    let mut instances: HashMap<_, Vec<_>> = HashMap::new();
    of_models.iter().for_each(|instance| instances.entry(&*instance.mesh).or_default().push(instance));
    let mut to = Description { mesh: Vec::new(), instance, ..from.clone() };
    let (mut movers, mut warnings, mut files) = (Vec::new(), Vec::new(), Vec::new());
    for (number, table) in from.mesh.iter().enumerate() {
        if !is_model(table) {
            to.mesh.push(table.clone());
            continue;
        }
        let mut name = name_of(table).unwrap_or_default();
        let (mut placed, mut keyed) = (Vec::new(), Vec::new());
        if named.get(&name) == Some(&number) {
            placed = instances.remove(&*name).unwrap_or_default();
            keyed = keys.remove(&name).unwrap_or_default();
        } else {
            name = format!("{name}#{}", number + 1);
        }
        let place = Place::new(path, table, name, &placed)?;
        let directory = path.parent().unwrap_or(Path::new(""));
        let file = table.file.as_ref().map(|file| file.to_string_lossy().replace('\\', "/")).unwrap_or_default();
        let file = directory.join(file);
        let mut model = gltf::load(&file, directory, table.clip.as_deref(), keyed)?;
        warnings.append(&mut model.warnings);
        files.push(file);
        files.append(&mut model.buffers);
        movers.extend(place.add(model, from, &mut to));
    }
    Ok((Cow::Owned(to), movers, warnings, files))
}

/// By the name of a glTF file's mesh: the keys of animation tables that move its nodes, by their names.
type Keys = HashMap<String, Vec<(String, Keyed)>>;

fn keys_of_nodes(path: &Path, from: &Description, is_model: impl Fn(&str) -> bool) -> Result<Keys> {
    let mut keys = Keys::new();
    for (number, table) in (1..).zip(&from.animation) {
        let Some(name) = &table.node else { continue };
        let at = |what: String| Error::input_at(path, format!("animation {number}"), what);
        let none = || at(format!("no node \"{name}\": write MESH/NODE, with the name of a mesh whose file is glTF"));
        let (mesh, node) = name.split_once('/').filter(|(mesh, _)| is_model(mesh)).ok_or_else(none)?;
        let keyed = animation::of_node(table).map_err(at)?;
        keys.entry(mesh.to_owned()).or_default().push((node.to_owned(), keyed));
    }
    Ok(keys)
}

/// What instances call a mesh of a glTF file: its table's name, or the file's.
fn name_of(table: &MeshTable) -> Option<String> {
    let stem = || Some(table.file.as_ref()?.file_stem()?.to_string_lossy().into_owned());
    table.name.clone().or_else(stem)
}

/// The table of a glTF file, and where it puts what is in it.
struct Place<'a> {
    table: &'a MeshTable,
    /// What the names of its parts begin with: no other table's do.
    name: String,
    /// Each with the material in place of all others.
    copies: Vec<(DAffine3, Option<String>)>,
    /// Whether instances put it there.
    instanced: bool,
}

impl<'a> Place<'a> {
    fn new(path: &Path, table: &'a MeshTable, name: String, instances: &[&InstanceTable]) -> Result<Self> {
        if table.group.is_some() || table.segments.is_some() {
            let what = "is a glTF file, which has neither group nor segments: it is taken whole";
            return Err(Error::input_at(path, format!("mesh \"{name}\""), what));
        }
        let own = table.transform.0;
        let of = |instance: &&InstanceTable| (instance.transform.0 * own, instance.material.clone());
        let mut copies: Vec<_> = instances.iter().map(of).collect();
        let instanced = !copies.is_empty();
        if !instanced {
            copies.push((own, None));
        }
        Ok(Self { table, name, copies, instanced })
    }

    /// Adds what a file holds to a description; returns what moves it.
    fn add(&self, model: Model, from: &Description, to: &mut Description) -> Option<Arc<dyn Mover>> {
        let Model { description, mover, .. } = model;
        let known: HashSet<_> = to.picture_file.iter().map(|file| file.name.clone()).collect();
        to.picture_file.extend(description.picture_file.into_iter().filter(|file| !known.contains(&file.name)));
        let materials = self.add_materials(description.material, from, to);
        let placed: HashSet<_> = description.instance.iter().map(|instance| instance.mesh.clone()).collect();
        let meshes = to.mesh.len();
        for mut mesh in description.mesh {
            mesh.material = mesh.material.map(|name| materials.get(&name).cloned().unwrap_or(name));
            let own = mesh.name.as_ref().is_some_and(|name| placed.contains(name));
            self.add_mesh(mesh, own, to);
        }
        let mut instances = Vec::new();
        for instance in description.instance {
            instances.push(to.instance.len());
            let mesh = self.of(&instance.mesh);
            to.instance.extend(self.copies.iter().map(|copy| at(copy, &instance.transform.0, &mesh)));
        }
        let mut lights = Vec::new();
        for light in description.light {
            lights.push(to.light.len());
            to.light.extend(self.copies.iter().map(|(affine, _)| shining(affine, &light)));
        }
        let copies = self.copies.iter().map(|(affine, _)| *affine).collect();
        mover.map(|mover| Arc::new(Within { mover, copies, instances, meshes, lights }) as Arc<dyn Mover>)
    }

    /// The name in the scene of what the file calls `inner`.
    fn of(&self, inner: &str) -> String {
        format!("{}/{inner}", self.name)
    }

    /// Adds materials; returns their new names. As with MTL files, the scene's own material of a name wins.
    fn add_materials(
        &self,
        tables: Vec<MaterialTable>,
        from: &Description,
        to: &mut Description,
    ) -> HashMap<String, String> {
        let mut names = HashMap::new();
        let own: HashSet<_> = from.material.iter().map(|table| &table.name).collect();
        let mut taken: HashSet<_> = to.material.iter().map(|table| table.name.clone()).collect();
        for mut table in tables.into_iter().filter(|table| !own.contains(&table.name)) {
            let asked = table.name.clone();
            while !taken.insert(table.name.clone()) {
                table.name = self.of(&table.name);
            }
            names.insert(asked, table.name.clone());
            table.of_model = true;
            to.material.push(table);
        }
        names
    }

    /// Adds a mesh where the copies are, unless instances of the file place it.
    fn add_mesh(&self, mut mesh: MeshTable, placed: bool, to: &mut Description) {
        let name = self.of(&mesh.name.take().unwrap_or_default());
        mesh.material = self.table.material.clone().or(mesh.material);
        mesh.flat |= self.table.flat;
        mesh.flip_normals ^= self.table.flip_normals;
        mesh.moving |= self.table.moving;
        match self.instanced {
            _ if placed => {}
            true => to.instance.extend(self.copies.iter().map(|copy| at(copy, &DAffine3::IDENTITY, &name))),
            false => mesh.transform = (self.copies[0].0 * mesh.transform.0).into(),
        }
        mesh.name = Some(name);
        to.mesh.push(mesh);
    }
}

/// An instance of a copy.
fn at((affine, material): &(DAffine3, Option<String>), own: &DAffine3, mesh: &str) -> InstanceTable {
    let (mesh, material, transform) = (mesh.to_owned(), material.clone(), (*affine * *own).into());
    InstanceTable { mesh, transform, material, name: None }
}

/// A light of a copy.
fn shining(affine: &DAffine3, light: &LightTable) -> LightTable {
    let point = |p: [f32; 3]| affine.transform_point3(Vec3::from(p).as_dvec3()).as_vec3().to_array();
    let turned = |d: [f32; 3]| affine.transform_vector3(Vec3::from(d).as_dvec3()).as_vec3().to_array();
    LightTable { position: light.position.map(point), direction: light.direction.map(turned), ..light.clone() }
}

/// Moves what a glTF file has brought into a scene, by its numbers there.
#[derive(Debug)]
struct Within {
    mover: Arc<dyn Mover>,
    copies: Vec<DAffine3>,
    /// By instance of the file: the number of its first copy; the others follow.
    instances: Vec<usize>,
    /// Number of the file's first mesh.
    meshes: usize,
    /// As `instances`.
    lights: Vec<usize>,
}

impl Mover for Within {
    fn pose(&self, seconds: f64, pose: &mut Pose) -> Result<()> {
        let mut own = Pose::default();
        self.mover.pose(seconds, &mut own)?;
        for (number, transform) in own.instances {
            let copies = self.copies.iter().map(|copy| (*copy * transform.0).into());
            pose.instances.extend((self.instances[number]..).zip(copies));
        }
        for (number, light) in own.lights {
            pose.lights.extend((self.lights[number]..).zip(self.copies.iter().map(|copy| shining(copy, &light))));
        }
        pose.meshes.extend(own.meshes.into_iter().map(|(number, vertices)| (self.meshes + number, vertices)));
        Ok(())
    }

    fn end(&self) -> f64 {
        self.mover.end()
    }

    fn moving(&self) -> Option<Range<f64>> {
        self.mover.moving()
    }
}
