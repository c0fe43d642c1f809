//! Puts the triangles of all meshes into one array: first those in world space, then one mesh after another.
use super::attributes::{Extras, MOST_WORDS, corners};
use super::geometry::{Corners, Geometry, Placement, Repairs, Tag, TooFar, face_normal};
use super::plan::{Job, Plan, override_of};
use super::soft::Soft;
use super::sources::{Sources, mesh_name};
use super::split::{self, Lamps};
use crate::error::{Error, Result};
use crate::memory;
use crate::scene::description::mesh::Mesh;
use crate::scene::description::{self, MeshTable};
use crate::scene::load::material::has_normal_map;
use crate::scene::load::mesh_file::Format;
use crate::scene::load::obj::ObjFile;
use crate::scene::load::obj_part::Part;
use crate::scene::{BYTES_OF_TRIANGLE, MAX_COORDINATE, Scene};
use glam::Vec3;
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::ops::Range;

/// Triangles that a thread places at a time, and how many such parts are placed before they are put together.
const PART: usize = 1 << 14;
const PARTS: usize = 64;

/// A mesh in the triangle array: where, and how it is called.
pub struct Stored {
    /// What is stored of which `[[mesh]]`; `None`: all that is in world space.
    pub job: Option<Job>,
    /// Indices of the mesh's triangles.
    pub range: Range<usize>,
    /// Names of the mesh's objects.
    pub objects: Vec<String>,
    /// What it takes to deform the mesh, if it is one that may be.
    pub soft: Option<Soft>,
}

/// Puts all triangles into the array; world space comes first, and is always there. Files are dropped after their last use. Lamps are split
/// by the pictures of `scene`.
///
/// # Errors
/// For an unknown group or material, coordinates that are too large, and [`Error::Memory`].
pub fn store(sources: &mut Sources, plan: &Plan, scene: &Scene, geometry: &mut Geometry) -> Result<Vec<Stored>> {
    let jobs: Vec<&Job> = plan.baked.iter().chain(&plan.stored).collect();
    let triangles: u64 = jobs.iter().map(|job| triangles_of(sources, job)).sum();
    let words = jobs.iter().map(|job| attribute_words(sources, job)).sum::<u64>();
    let bytes = triangles * BYTES_OF_TRIANGLE + words * size_of::<u32>() as u64;
    memory::need(format!("{}: {triangles} triangles", sources.path.display()), bytes)?;
    warn_of_grey(sources, plan)?;
    let description = sources.description;
    let files: Vec<_> = jobs.iter().map(|job| sources.file_of(&description.mesh[job.mesh])).collect();
    let latest: HashMap<_, _> = files.iter().enumerate().map(|(i, file)| (file, i)).collect();
    let last: Vec<bool> = files.iter().enumerate().map(|(i, file)| latest[file] == i).collect();
    let materials = sources.library.materials.list.clone();
    let lamps = Lamps { scene, materials: &materials };
    let counts = jobs.iter().map(|job| lamps_of(sources, plan, job, lamps)).collect::<Result<Vec<_>>>()?;
    let depths = split::depths(&counts);
    // At once: each of many small meshes would move all before it.
    memory::reserve(sources.path.display(), &mut geometry.triangles, triangles as usize)?;
    let read = Read::new(sources);
    let mut stored = vec![Stored { job: None, range: 0..0, objects: Vec::new(), soft: None }];
    for (i, job) in jobs.into_iter().enumerate() {
        let start = geometry.triangles.len();
        let baked = i < plan.baked.len();
        let first = if baked { stored[0].objects.len() as u32 } else { 0 };
        let (objects, soft) =
            Addition::new(sources, &read, job, first, (lamps, depths[i]))?.add(sources, geometry, last[i])?;
        let end = geometry.triangles.len();
        if baked {
            stored[0].objects.extend(objects);
            stored[0].range.end = end;
        } else {
            stored.push(Stored { job: Some(*job), range: start..end, objects, soft });
        }
    }
    sources.files.clear();
    // What is stored once for each of its instances is repaired as often.
    let mut told = HashSet::new();
    sources.library.warnings.retain(|warning| told.insert(warning.clone()));
    Ok(stored)
}

/// What the materials of a scene read of all meshes. Found once, for many meshes.
struct Read {
    /// Whether some material reads coordinates of textures.
    uvs: bool,
    /// Whether some texture reads second ones.
    second: bool,
    /// Whether some material needs tangents.
    tangents: bool,
}

impl Read {
    fn new(sources: &Sources) -> Self {
        let materials = &sources.library.materials;
        let stretched = materials.list.iter().any(|m| m.anisotropy != 0.0);
        Self {
            uvs: stretched || !materials.textures.is_empty(),
            second: materials.textures.any_second(),
            tangents: stretched || materials.list.iter().any(has_normal_map),
        }
    }
}

/// How many triangles with a picture of emission a mesh shows that can be split: those of one that moves are counted by who moves it.
fn lamps_of(sources: &Sources, plan: &Plan, job: &Job, lamps: Lamps) -> Result<u64> {
    let table = &sources.description.mesh[job.mesh];
    if table.moving || job.exact {
        return Ok(0);
    }
    let file = sources.file_of(table).and_then(|path| sources.files.get(&path));
    let triangles = match (override_of(sources, job)?, file) {
        (Some(worn), file) if lamps.has_picture(worn) => triangles(table, file),
        (None, Some(file)) => {
            let lit = parts_of(table, file).filter(|(part, _)| lamps.has_picture(part.material));
            lit.map(|(part, _)| part.mesh.triangles() as u64).sum()
        }
        _ => 0,
    };
    let copies = || plan.copies.iter().filter(|copy| copy.stored_as() == job.stored_as()).count().max(1) as u64;
    Ok(if triangles > 0 { copies() * triangles } else { 0 })
}

/// How many triangles a mesh has before any is dropped.
pub fn triangles_of(sources: &Sources, job: &Job) -> u64 {
    let table = &sources.description.mesh[job.mesh];
    let file = sources.file_of(table).and_then(|path| sources.files.get(&path));
    if job.exact { 1 } else { triangles(table, file) }
}

/// The largest coordinate of a mesh as `job` stores it.
pub fn reach_of(sources: &Sources, job: &Job) -> f64 {
    let table = &sources.description.mesh[job.mesh];
    let file = sources.file_of(table).and_then(|path| sources.files.get(&path));
    let meshes = file.iter().flat_map(|file| parts_of(table, file)).map(|(part, _)| &*part.mesh);
    let points = table.data.iter().chain(meshes).flat_map(|mesh| &mesh.positions);
    // Shapes lie between -1 and 1.
    let corners = (0..8).map(|i| [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { -1.0 } else { 1.0 }));
    let corners = corners.filter(|_| table.shape.is_some());
    let far = |p: [f32; 3]| job.affine.transform_point3(Vec3::from(p).as_dvec3()).abs().max_element();
    points.copied().chain(corners).map(far).fold(0.0, f64::max)
}

/// Words that the attributes of a mesh's vertices may take.
fn attribute_words(sources: &Sources, job: &Job) -> u64 {
    let table = &sources.description.mesh[job.mesh];
    let file = sources.file_of(table).and_then(|path| sources.files.get(&path));
    let parts = file.iter().flat_map(|file| parts_of(table, file)).map(|(part, _)| &*part.mesh);
    let has = |m: &&Mesh| !(m.colors.is_empty() && m.uvs2.is_empty() && m.tangents.is_empty());
    table.data.iter().chain(parts).filter(has).map(|m| (m.triangles() * MOST_WORDS) as u64).sum()
}

fn triangles(table: &MeshTable, file: Option<&ObjFile>) -> u64 {
    let of_file = |file: &ObjFile| parts_of(table, file).map(|(part, _)| part.mesh.triangles() as u64).sum();
    match (&table.data, table.shape, file) {
        (Some(mesh), ..) => mesh.triangles() as u64,
        (_, Some(shape), _) => shape.triangles(segments(table)),
        (.., file) => file.map_or(0, of_file),
    }
}

/// The parts of a file that a mesh consists of, each with the number of its first triangle in the file.
fn parts_of<'f>(table: &'f MeshTable, file: &'f ObjFile) -> impl Iterator<Item = (&'f Part<'f>, u32)> {
    let numbered = file.parts.iter().scan(0, |next, part| {
        let first = *next;
        *next += part.mesh.triangles() as u32;
        Some((part, first))
    });
    numbered.filter(|(part, _)| table.group.as_ref().is_none_or(|g| *g == part.name))
}

/// Edges around a tessellated shape.
fn segments(table: &MeshTable) -> u32 {
    table.segments.unwrap_or(64)
}

/// Warns where grey replaces a material of a file that some mesh uses.
fn warn_of_grey(sources: &mut Sources, plan: &Plan) -> Result<()> {
    let meshes = &sources.description.mesh;
    let (mut worn, mut copies) = (vec![false; meshes.len()], vec![false; meshes.len()]);
    plan.copies.iter().filter(|copy| copy.material.is_none()).for_each(|copy| copies[copy.mesh] = true);
    for job in plan.baked.iter().chain(plan.stored.iter().filter(|job| copies[job.mesh])) {
        worn[job.mesh] |= override_of(sources, job)?.is_none();
    }
    for (table, _) in meshes.iter().zip(worn).filter(|(_, worn)| *worn) {
        let file = sources.file_of(table).and_then(|path| sources.files.get_mut(&path));
        sources.library.warnings.extend(file.and_then(|file| file.grey.take()));
    }
    Ok(())
}

/// A mesh on its way into the triangle array.
struct Addition<'a, 'l> {
    job: Job,
    table: &'a MeshTable,
    place: String,
    /// Material in place of the parts' own.
    material: Option<u32>,
    placement: Placement,
    /// Object index of the first part.
    first: u32,
    /// Whether some texture reads second coordinates, and whether some material needs tangents.
    second: bool,
    /// Whether colours of vertices count: those of an OBJ file where neither its table nor an instance gives it another material.
    colors: bool,
    tangents: bool,
    /// What splits lamps, and how often they may be quartered.
    lamps: (Lamps<'l>, u32),
}

impl<'a, 'l> Addition<'a, 'l> {
    fn new(sources: &Sources<'a>, read: &Read, job: &Job, first: u32, lamps: (Lamps<'l>, u32)) -> Result<Self> {
        let table = &sources.description.mesh[job.mesh];
        // Meshes from memory without normals are flat on purpose: there all vertices have one, or none has.
        let meant = table.data.as_ref().is_some_and(|mesh| mesh.normals.is_empty());
        let &Read { uvs, second, tangents, .. } = read;
        let (affine, flat, keep) = (job.affine, table.flat || meant, table.moving);
        let placement = Placement { affine, flat, flip: table.flip_normals, uvs, keep };
        let place = format!("mesh \"{}\"", mesh_name(table));
        let material = override_of(sources, job)?;
        let is_obj = table.file.as_deref().is_some_and(|file| Format::of(file) == Format::Obj);
        let colors = !(job.plain || is_obj && material.is_some());
        Ok(Self { job: *job, table, place, material, placement, first, second, colors, tangents, lamps })
    }

    /// Adds the triangles; returns the names of the objects, and what it takes to deform them.
    fn add(
        &self,
        sources: &mut Sources<'a>,
        geometry: &mut Geometry,
        last_use: bool,
    ) -> Result<(Vec<String>, Option<Soft>)> {
        let file = self.take_file(sources);
        self.check_group(sources, &file)?;
        let before = geometry.triangles.len();
        if !geometry.shading.is_empty() {
            let more = geometry.triangles.capacity() - geometry.shading.len();
            memory::reserve(&self.place, &mut geometry.shading, more)?;
        }
        let mut repairs = Repairs::default();
        let objects = self.add_parts(&file, geometry, &mut repairs).map_err(|TooFar(v)| {
            sources.at(&self.place, format!("has a coordinate of {v:e}: the limit is {MAX_COORDINATE:e}"))
        })?;
        if self.table.moving {
            self.check_moving(sources, &repairs)?;
        } else {
            repairs.copies = geometry.drop_copies(before);
        }
        let soft = (self.table.moving && !self.job.exact).then(|| self.soft(&file));
        let repaired = repairs.warning(&self.place);
        if geometry.triangles.len() == before {
            let why = repaired.as_deref().unwrap_or("no face is in it: is it of the format that its name says?");
            // It may be placed so small that no triangle is left of it, which is no fault of the file.
            match sources.file_of(self.table).filter(|_| !self.has_surface(&file)) {
                Some(path) => return Err(Error::input(path, format!("has no triangles: {why}"))),
                None => sources.library.warnings.push(format!("{} has no triangles", self.place)),
            }
        }
        sources.library.warnings.extend(repaired);
        if let (Some(path), false) = (sources.file_of(self.table), last_use) {
            sources.files.insert(path, file);
        }
        Ok((objects, soft))
    }

    /// Whether any triangle of the file has an area before it is placed.
    fn has_surface(&self, file: &ObjFile) -> bool {
        let has_area =
            |mesh: &Mesh, corners: &[u32; 3]| face_normal(corners.map(|i| mesh.positions[i as usize].into())).is_some();
        parts_of(self.table, file)
            .any(|(part, _)| part.mesh.indices.as_chunks().0.iter().any(|t| has_area(&part.mesh, t)))
    }

    /// The triangles of a mesh that may be deformed are counted, so that none may be dropped.
    fn check_moving(&self, sources: &Sources, repairs: &Repairs) -> Result<()> {
        match repairs.not_finite {
            0 => Ok(()),
            n => {
                Err(sources
                    .at(&self.place, format!("has {n} triangles with NaN or infinite coordinates: it is moving")))
            }
        }
    }

    fn soft(&self, file: &ObjFile) -> Soft {
        let whole = joined(self.table, file);
        let placement = Placement { flat: self.table.flat, ..self.placement };
        Soft::new(whole.positions.len(), whole.indices, placement)
    }

    /// The parsed file, taken out of the store, or a shape, or what is in memory.
    fn take_file(&self, sources: &mut Sources<'a>) -> ObjFile<'a> {
        if let Some(file) = sources.file_of(self.table).and_then(|path| sources.files.remove(&path)) {
            return file;
        }
        let shape = || self.table.shape.filter(|_| !self.job.exact).map(|s| Cow::Owned(s.mesh(segments(self.table))));
        let mesh = self.table.data.as_ref().map(Cow::Borrowed).or_else(shape).unwrap_or_default();
        let part = Part { name: String::new(), material: sources.library.grey(), mesh };
        ObjFile { parts: vec![part], grey: None }
    }

    fn check_group(&self, sources: &Sources, file: &ObjFile) -> Result<()> {
        match self.table.group.as_ref().filter(|g| !file.parts.iter().any(|part| part.name == **g)) {
            Some(group) => {
                let names = file.parts.iter().map(|part| part.name.as_str()).filter(|name| !name.is_empty());
                let what = match description::nearest(group, names) {
                    Some(near) => format!("no group \"{group}\": did you mean \"{near}\"?"),
                    None => format!("no group \"{group}\", since it has none: leave it out"),
                };
                Err(sources.at(&self.place, what))
            }
            None => Ok(()),
        }
    }

    /// Parts of one object follow each other; they have one name and one index.
    fn add_parts(
        &self,
        file: &ObjFile,
        geometry: &mut Geometry,
        repairs: &mut Repairs,
    ) -> std::result::Result<Vec<String>, TooFar> {
        let (mut names, mut previous) = (Vec::new(), None);
        for (part, primitive) in parts_of(self.table, file) {
            if previous != Some(&part.name) {
                names.push(object_name(&mesh_name(self.table), &part.name));
                previous = Some(&part.name);
            }
            let object = self.first + names.len() as u32 - 1;
            let tag = Tag { primitive, material: self.material.unwrap_or(part.material), object };
            match self.job.exact {
                true => geometry.push_sphere(tag, &self.placement, repairs)?,
                false => self.add_mesh(geometry, &part.mesh, tag, repairs)?,
            }
        }
        Ok(names)
    }

    /// Parts of the mesh are placed in parallel, so many at a time that they take little memory beside what they become.
    fn add_mesh(
        &self,
        geometry: &mut Geometry,
        mesh: &Mesh,
        first: Tag,
        repairs: &mut Repairs,
    ) -> std::result::Result<(), TooFar> {
        let parts: Vec<_> = mesh.indices.as_chunks().0.chunks(PART).zip(0..).collect();
        for parts in parts.chunks(PARTS) {
            let tag = |part: u32| Tag { primitive: first.primitive + part * PART as u32, ..first };
            let placed = parts.par_iter().map(|&(triangles, part)| self.place(mesh, triangles, tag(part)));
            for part in placed.collect::<Vec<_>>() {
                let (part, found) = part?;
                geometry.append(part);
                *repairs += found;
            }
        }
        Ok(())
    }

    /// Places triangles of a mesh, the first of which is `first`.
    fn place(
        &self,
        mesh: &Mesh,
        triangles: &[[u32; 3]],
        first: Tag,
    ) -> std::result::Result<(Geometry, Repairs), TooFar> {
        let (mut geometry, mut repairs) = (Geometry::default(), Repairs::default());
        geometry.triangles.reserve_exact(triangles.len());
        for (t, triangle) in (0..).zip(triangles) {
            let triangle = triangle.map(|i| i as usize);
            let extras = Extras {
                colors: corners(&mesh.colors, triangle).filter(|_| self.colors),
                uvs: corners(&mesh.uvs2, triangle).filter(|_| self.second),
                tangents: corners(&mesh.tangents, triangle).filter(|_| self.tangents),
            };
            let c = Corners {
                p: triangle.map(|i| mesh.positions[i].into()),
                n: corners(&mesh.normals, triangle),
                uv: corners(&mesh.uvs, triangle),
                extras,
            };
            let (tag, (lamps, depth)) = (Tag { primitive: first.primitive + t, ..first }, self.lamps);
            for (part, c) in lamps.split(&c, tag.material, depth, &self.placement.affine).iter().enumerate() {
                let mut again = Repairs::default(); // what is wrong is counted once
                let repairs = if part == 0 { &mut repairs } else { &mut again };
                geometry.push(c, tag, &self.placement, repairs)?;
            }
        }
        Ok((geometry, repairs))
    }
}

/// The triangles of a mesh in one piece, in the order of its parts. Parts without normals get zeros where others have some.
pub fn joined(table: &MeshTable, file: &ObjFile) -> Mesh {
    let mut whole = Mesh::default();
    let bent = parts_of(table, file).any(|(part, _)| !part.mesh.normals.is_empty());
    for (part, _) in parts_of(table, file) {
        let first = whole.positions.len() as u32;
        whole.positions.extend_from_slice(&part.mesh.positions);
        whole.normals.extend_from_slice(&part.mesh.normals);
        whole.normals.resize(if bent { whole.positions.len() } else { 0 }, [0.0; 3]);
        whole.indices.extend(part.mesh.indices.iter().map(|i| first + i));
    }
    whole
}

fn object_name(mesh: &str, object: &str) -> String {
    if object.is_empty() || object == "unnamed_object" { mesh.to_owned() } else { format!("{mesh}/{object}") }
}
