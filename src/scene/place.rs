//! Which mesh goes where: baked into world space, or stored in its own space for instances.
use super::assemble::Assembly;
use super::description::{self, Mesh, MeshTable};
use super::geometry::{Corners, Geometry, Placement, Repairs, Tag, TooFar};
use super::obj::ObjFile;
use super::shape::Shape;
use crate::error::{Error, Result};
use crate::layout::{Instance, MATERIAL_MASKED, Material, NONE};
use crate::memory;
use glam::{DAffine3, DMat3, Vec2, Vec3};
use std::collections::HashMap;
use std::path::PathBuf;

/// A mesh and where it goes.
#[derive(Clone, Copy, Debug)]
pub struct Job {
    /// Index of the `[[mesh]]`.
    pub mesh: usize,
    /// From its file to the space it is stored in; of a copy, from there to the world.
    pub affine: DAffine3,
    /// Instead of all its materials.
    pub material: Option<u32>,
    /// A sphere that is stored as one, not as triangles.
    pub exact: bool,
}

/// What is baked into world space, stored for instances, and placed.
#[derive(Debug, Default)]
pub struct Plan {
    /// Triangles in world space.
    pub baked: Vec<Job>,
    /// Triangles in object space; every one is placed by a copy.
    pub stored: Vec<Job>,
    /// In the order of the file.
    pub copies: Vec<Job>,
}

/// `mesh "name"`, by its own name, its file's or its shape's.
pub fn mesh_name(mesh: &MeshTable) -> String {
    match (&mesh.name, &mesh.file, mesh.shape) {
        (Some(name), ..) => name.clone(),
        (_, Some(file), _) => file.display().to_string(),
        (_, _, Some(shape)) => format!("{shape:?}").to_lowercase(),
        _ => "unnamed".into(),
    }
}

/// The device's form of a placement; the caller sets `material` and `object`.
pub fn instance(affine: &DAffine3, root: u32) -> Instance {
    let rows = |a: &DAffine3| {
        [0, 1, 2].map(|i| {
            let row = a.matrix3.row(i);
            [row.x as f32, row.y as f32, row.z as f32, a.translation[i] as f32]
        })
    };
    let ([world0, world1, world2], [object0, object1, object2]) = (rows(affine), rows(&affine.inverse()));
    let mirrored = u32::from(affine.matrix3.determinant() < 0.0);
    Instance {
        world0,
        world1,
        world2,
        object0,
        object1,
        object2,
        root,
        material: NONE,
        object: 0,
        mirrored,
        ..Default::default()
    }
}

impl Assembly<'_> {
    /// Sorts meshes into baked and stored ones.
    ///
    /// # Errors
    /// For unknown names and transforms without inverse.
    pub fn plan(&self) -> Result<Plan> {
        let meshes = &self.description.mesh;
        let mut plan = Plan::default();
        let (mut instanced, mut copied) = (vec![false; meshes.len()], vec![false; meshes.len()]);
        let named = meshes.iter().enumerate().rev().filter_map(|(i, m)| Some((m.name.as_deref()?, i)));
        let named: HashMap<&str, usize> = named.collect(); // the first of a name counts
        let mut textured = HashMap::new();
        // Of a sphere that is stretched, its instances do the stretching: rays meet a sphere in its own space.
        let stretched: Vec<_> = meshes.iter().map(|m| is_sphere(m) && !is_even(&m.transform.0)).collect();
        let mut exact: Vec<_> = meshes.iter().map(is_sphere).collect();
        for (number, table) in self.description.instance.iter().enumerate() {
            let place = format!("instance {} of mesh \"{}\"", number + 1, table.mesh);
            let Some(&mesh) = named.get(table.mesh.as_str()) else {
                let names = meshes.iter().filter_map(|m| m.name.as_deref());
                let near = description::nearest(&table.mesh, names).unwrap_or("(none has a name)");
                return Err(self.at(place, format!("no such mesh: did you mean \"{near}\"?")));
            };
            instanced[mesh] = true;
            let affine = self.invertible(table.transform.0, &place)?;
            let material = table.material.as_ref().map(|m| self.material(m, &place)).transpose()?;
            let own = self.invertible(meshes[mesh].transform.0, &place)?;
            // Textures of a light are looked up by the corners' order, which a mirrored light has to swap: bake it.
            let mirrored = affine.matrix3.determinant() < 0.0;
            if mirrored && !textured.contains_key(&(mesh, material)) {
                textured.insert((mesh, material), self.is_textured_light(mesh, material)?);
            }
            let whole = Job { mesh, affine: affine * own, material, exact: false };
            exact[mesh] = exact[mesh] && self.may_be_exact(&whole)?;
            match mirrored && textured[&(mesh, material)] {
                true => plan.baked.push(whole),
                false if stretched[mesh] => plan.copies.push(whole),
                false => plan.copies.push(Job { affine, ..whole }),
            }
            copied[mesh] |= plan.copies.last().is_some_and(|copy| copy.mesh == mesh);
        }
        for (mesh, table) in meshes.iter().enumerate() {
            let affine = self.invertible(table.transform.0, &format!("mesh \"{}\"", mesh_name(table)))?;
            let job = Job { mesh, affine, material: None, exact: false };
            if !instanced[mesh] {
                let exact = exact[mesh] && self.may_be_exact(&job)?;
                match exact && stretched[mesh] {
                    true => {
                        plan.stored.push(Job { affine: DAffine3::IDENTITY, exact, ..job });
                        plan.copies.push(job);
                    }
                    false => plan.baked.push(Job { exact, ..job }),
                }
            } else if copied[mesh] {
                let affine = if stretched[mesh] { DAffine3::IDENTITY } else { affine };
                plan.stored.push(Job { affine, exact: exact[mesh], ..job });
            }
        }
        Ok(plan)
    }

    /// Whether a sphere can be stored as one, where `job` places it in the world. Lamps are chosen by the cone in which
    /// they are seen: that takes a sphere of even radiance which emits outward.
    fn may_be_exact(&self, job: &Job) -> Result<bool> {
        let table = &self.description.mesh[job.mesh];
        let even = |m: &Material| m.emission_texture == NONE && m.flags & MATERIAL_MASKED == 0;
        let lamp = self.override_of(job)?.map(|m| &self.library.materials.list[m as usize]);
        let lamp = lamp.filter(|m| m.emission != [0.0; 3]);
        Ok(is_sphere(table) && lamp.is_none_or(|m| even(m) && is_even(&job.affine) && !table.flip_normals))
    }

    fn invertible(&self, affine: DAffine3, place: &str) -> Result<DAffine3> {
        let det = affine.matrix3.determinant();
        match affine.is_finite() && det.abs() > 1e-60 && affine.inverse().is_finite() {
            true => Ok(affine),
            false => Err(self.at(place, "its transform has no inverse: choose scales other than 0")),
        }
    }

    /// The material that replaces all of a mesh's own.
    fn override_of(&self, job: &Job) -> Result<Option<u32>> {
        let table = &self.description.mesh[job.mesh];
        let place = || format!("mesh \"{}\"", mesh_name(table));
        let own = table.material.as_ref().map(|m| self.material(m, &place())).transpose()?;
        Ok(job.material.or(own))
    }

    fn is_textured_light(&self, mesh: usize, material: Option<u32>) -> Result<bool> {
        let list = &self.library.materials.list;
        let textured = |i: u32| {
            let m = &list[i as usize];
            m.emission != [0.0; 3] && (m.emission_texture != NONE || m.opacity_texture != NONE)
        };
        let job = Job { mesh, affine: DAffine3::IDENTITY, material, exact: false };
        Ok(
            match (self.override_of(&job)?, self.file_of(&self.description.mesh[mesh]).and_then(|p| self.files.get(&p)))
            {
                (Some(index), _) => textured(index),
                (None, Some(file)) => file.materials.iter().any(|&i| textured(i)),
                (None, None) => false,
            },
        )
    }

    /// Says where grey stands in for a material of a file that some mesh wears.
    pub fn warn_of_grey(&mut self, plan: &Plan) -> Result<()> {
        let meshes = &self.description.mesh;
        let (mut worn, mut copies) = (vec![false; meshes.len()], vec![false; meshes.len()]);
        plan.copies.iter().filter(|copy| copy.material.is_none()).for_each(|copy| copies[copy.mesh] = true);
        for job in &plan.baked {
            worn[job.mesh] |= self.override_of(job)?.is_none();
        }
        for job in plan.stored.iter().filter(|job| copies[job.mesh]) {
            worn[job.mesh] |= self.override_of(job)?.is_none();
        }
        for (table, _) in meshes.iter().zip(worn).filter(|(_, worn)| *worn) {
            let file = self.file_of(table).and_then(|path| self.files.get_mut(&path));
            self.library.warnings.extend(file.and_then(|file| file.grey.take()));
        }
        Ok(())
    }

    /// Path of a mesh's OBJ file.
    pub fn file_of(&self, table: &MeshTable) -> Option<PathBuf> {
        Some(self.directory().join(table.file.as_ref()?.to_string_lossy().replace('\\', "/")))
    }

    /// How many triangles a mesh has before any is dropped.
    pub fn triangles_of(&self, job: &Job) -> u64 {
        let table = &self.description.mesh[job.mesh];
        if job.exact { 1 } else { triangles(table, self.file_of(table).and_then(|path| self.files.get(&path))) }
    }

    /// The parsed file, taken out of the store, or a shape, or a copy of what is in memory.
    fn take_source(&mut self, job: &Job) -> ObjFile {
        let table = &self.description.mesh[job.mesh];
        if let Some(file) = self.file_of(table).and_then(|path| self.files.remove(&path)) {
            return file;
        }
        let shape = || table.shape.filter(|_| !job.exact).map(|s| s.mesh(segments(table)));
        let mesh = table.data.as_ref().map(Mesh::to_tobj).or_else(shape).unwrap_or_default();
        let models = vec![tobj::Model { mesh, name: String::new() }];
        ObjFile { models, materials: vec![self.library.grey()], grey: None }
    }

    /// Adds a mesh's triangles; their object indices count from `first` on. Returns the names of its objects. The file
    /// is dropped after its last use.
    ///
    /// # Errors
    /// For an unknown group or material, and coordinates that are too large.
    pub fn add(&mut self, job: &Job, first: u32, last_use: bool) -> Result<Vec<String>> {
        let table = &self.description.mesh[job.mesh];
        let material = self.override_of(job)?;
        let file = self.take_source(job);
        let place = format!("mesh \"{}\"", mesh_name(table));
        if let Some(group) = table.group.as_ref().filter(|g| !file.models.iter().any(|m| m.name == **g)) {
            let near = description::nearest(group, file.models.iter().map(|m| m.name.as_str())).unwrap_or("(none)");
            return Err(self.at(place, format!("no group \"{group}\": did you mean \"{near}\"?")));
        }
        let before = self.geometry.triangles.len();
        let more = if job.exact { 1 } else { triangles(table, Some(&file)) as usize };
        memory::reserve(&place, &mut self.geometry.triangles, more)?;
        if !self.geometry.shading.is_empty() {
            memory::reserve(&place, &mut self.geometry.shading, more)?;
        }
        let mut repairs = Repairs::default();
        let objects = self.add_models(table, &file, job, material, first, &mut repairs);
        let objects = objects.map_err(|TooFar(v)| {
            self.at(&place, format!("has a coordinate of {v:e}: the limit is {:e}", super::MAX_COORDINATE))
        })?;
        repairs.copies = self.geometry.drop_copies(before);
        let repaired = repairs.warning(&place);
        if self.geometry.triangles.len() == before {
            let why = repaired.as_deref().unwrap_or("no face is in it: is it an OBJ file?");
            match self.file_of(table) {
                Some(path) => return Err(Error::input(path, format!("has no triangles: {why}"))),
                None => self.library.warnings.push(format!("{place} has no triangles")),
            }
        }
        self.library.warnings.extend(repaired);
        if let (Some(path), false) = (self.file_of(table), last_use) {
            self.files.insert(path, file);
        }
        Ok(objects)
    }

    /// tobj splits an object at every change of material; the parts keep one name and one index.
    fn add_models(
        &mut self,
        table: &MeshTable,
        file: &ObjFile,
        job: &Job,
        material: Option<u32>,
        first: u32,
        repairs: &mut Repairs,
    ) -> std::result::Result<Vec<String>, TooFar> {
        let uvs = self.library.materials.textures.len() > 0;
        // Who hands over triangles without normals means it: in memory all vertices have one or none has.
        let meant = table.data.as_ref().is_some_and(|mesh| mesh.normals.is_empty());
        let at = Placement { affine: job.affine, flat: table.flat || meant, flip: table.flip_normals, uvs };
        let (mut names, mut previous, mut primitive) = (Vec::new(), None, 0);
        for (model, &own) in file.models.iter().zip(&file.materials) {
            if table.group.as_ref().is_none_or(|g| *g == model.name) {
                if previous != Some(&model.name) {
                    names.push(object_name(&mesh_name(table), &model.name));
                    previous = Some(&model.name);
                }
                let object = first + names.len() as u32 - 1;
                let tag = Tag { primitive, material: material.unwrap_or(own), object };
                match job.exact {
                    true => self.geometry.push_sphere(tag, &at, repairs)?,
                    false => add_model(&mut self.geometry, &model.mesh, tag, &at, repairs)?,
                }
            }
            primitive += (model.mesh.indices.len() / 3) as u32;
        }
        Ok(names)
    }
}

fn triangles(table: &MeshTable, file: Option<&ObjFile>) -> u64 {
    let worn = |m: &&tobj::Model| table.group.as_ref().is_none_or(|g| *g == m.name);
    let of_file = |file: &ObjFile| file.models.iter().filter(worn).map(|m| m.mesh.indices.len() as u64 / 3).sum();
    match (&table.data, table.shape, file) {
        (Some(mesh), ..) => mesh.indices.len() as u64 / 3,
        (_, Some(shape), _) => shape.triangles(segments(table)),
        (.., file) => file.map_or(0, of_file),
    }
}

/// A sphere that need not be tessellated: nobody asks for its segments or facets.
fn is_sphere(table: &MeshTable) -> bool {
    table.shape == Some(Shape::Sphere) && table.segments.is_none() && !table.flat
}

/// Whether spheres stay spheres, up to what six digits of a matrix leave open.
fn is_even(affine: &DAffine3) -> bool {
    let gram = affine.matrix3.transpose() * affine.matrix3;
    let mean = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    (gram * (1.0 / mean)).abs_diff_eq(DMat3::IDENTITY, 1e-5)
}

/// Edges around a tessellated shape.
fn segments(table: &MeshTable) -> u32 {
    table.segments.unwrap_or(64)
}

fn object_name(mesh: &str, object: &str) -> String {
    if object.is_empty() || object == "unnamed_object" { mesh.to_owned() } else { format!("{mesh}/{object}") }
}

fn add_model(
    geometry: &mut Geometry,
    mesh: &tobj::Mesh,
    first: Tag,
    at: &Placement,
    repairs: &mut Repairs,
) -> std::result::Result<(), TooFar> {
    let vec3 = |from: &[f32], i: u32| Vec3::from_slice(&from[3 * i as usize..]);
    for (t, corners) in mesh.indices.chunks_exact(3).enumerate() {
        let corners = [corners[0], corners[1], corners[2]];
        let c = Corners {
            p: corners.map(|i| vec3(&mesh.positions, i)),
            n: (!mesh.normals.is_empty()).then(|| corners.map(|i| vec3(&mesh.normals, i))),
            uv: (!mesh.texcoords.is_empty())
                .then(|| corners.map(|i| Vec2::from_slice(&mesh.texcoords[2 * i as usize..]))),
        };
        let tag = Tag { primitive: first.primitive + t as u32, ..first };
        geometry.push(&c, tag, at, repairs)?;
    }
    Ok(())
}
