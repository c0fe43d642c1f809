//! Decides for each mesh whether it is baked into world space or stored in its own space for instances.
use super::sources::{Sources, mesh_name};
use crate::error::Result;
use crate::layout::{MATERIAL_MASKED, MATERIAL_UNLIT, NONE};
use crate::scene::description::shape::Shape;
use crate::scene::description::{self, Description, InstanceTable, Key, MeshTable, Numbers, Transform, affine};
use crate::scene::load::material::Materials;
use glam::{DAffine3, DMat3};
use std::collections::{HashMap, HashSet};

/// A mesh and its destination.
#[derive(Clone, Copy, Debug)]
pub struct Job {
    /// Index of the mesh's `[[mesh]]` table.
    pub mesh: usize,
    /// Transform from the mesh's file to the space it is stored in; for a copy, from that space to the world.
    pub affine: DAffine3,
    /// Material that replaces all of the mesh's own.
    pub material: Option<u32>,
    /// A sphere that is stored as one, not as triangles.
    pub exact: bool,
    /// Of a copy, its number among all that is placed: those of the `[[instance]]` tables, then meshes that are stored without.
    pub placement: u32,
    /// Of a copy, the part of `affine` that is the mesh's own.
    pub own: DAffine3,
    /// Whether the colours of an OBJ file's vertices are left out, since an instance gives it another material. Such a mesh is stored
    /// without them, besides the one that its other instances show.
    pub plain: bool,
}

impl Job {
    /// A mesh where its table puts it.
    pub fn new(mesh: usize, affine: DAffine3) -> Self {
        Self { mesh, affine, material: None, exact: false, placement: NONE, own: DAffine3::IDENTITY, plain: false }
    }

    /// What is stored once for all copies of it.
    pub fn stored_as(&self) -> (usize, bool) {
        (self.mesh, self.plain)
    }
}

/// What is baked into world space, stored for instances, and placed.
#[derive(Debug, Default)]
pub struct Plan {
    /// Meshes whose triangles are stored in world space.
    pub baked: Vec<Job>,
    /// Meshes whose triangles are stored in object space; every one is placed by a copy.
    pub stored: Vec<Job>,
    /// Copies of stored meshes, in the order of the file.
    pub copies: Vec<Job>,
}

/// Sorts meshes into baked and stored ones.
///
/// # Errors
/// For unknown names and transforms without inverse.
pub fn plan(sources: &Sources) -> Result<Plan> {
    let mut planner = Planner::new(sources);
    for (number, table) in sources.description.instance.iter().enumerate() {
        planner.place(number as u32, table)?;
    }
    for mesh in 0..sources.description.mesh.len() {
        planner.keep(mesh)?;
    }
    Ok(planner.plan)
}

/// The material that replaces all of a mesh's own.
///
/// # Errors
/// For one that is not there.
pub fn override_of(sources: &Sources, job: &Job) -> Result<Option<u32>> {
    let table = &sources.description.mesh[job.mesh];
    let place = || format!("mesh \"{}\"", mesh_name(table));
    let own = table.material.as_ref().map(|m| sources.material(m, &place())).transpose()?;
    Ok(job.material.or(own))
}

struct Planner<'s, 'a> {
    sources: &'s Sources<'a>,
    plan: Plan,
    /// Number of the next placement without a table of its own.
    next: u32,
    /// Of a name, the first mesh.
    named: HashMap<&'a str, usize>,
    /// Names that several meshes have.
    doubled: HashSet<&'a str>,
    /// By mesh: whether an instance shows it with the colours of its vertices, and whether one does without, see [`Job::plain`].
    instanced: Vec<[bool; 2]>,
    /// By mesh: whether its vertices have colours that an instance's material takes the place of.
    coloured: Vec<bool>,
    /// By mesh: whether it is stored as a sphere so far, and whether its instances stretch it, since rays meet a sphere in its
    /// own space.
    exact: Vec<bool>,
    stretched: Vec<bool>,
}

impl<'s, 'a> Planner<'s, 'a> {
    fn new(sources: &'s Sources<'a>) -> Self {
        let meshes = &sources.description.mesh;
        let named = meshes.iter().enumerate().rev().filter_map(|(i, m)| Some((m.name.as_deref()?, i)));
        let (mut known, names) = (HashSet::new(), meshes.iter().filter_map(|m| m.name.as_deref()));
        Self {
            sources,
            plan: Plan::default(),
            next: sources.description.instance.len() as u32,
            named: named.collect(),
            doubled: names.filter(|name| !known.insert(*name)).collect(),
            instanced: vec![[false; 2]; meshes.len()],
            coloured: meshes.iter().map(|mesh| sources.colors_show(mesh)).collect(),
            exact: meshes.iter().map(is_sphere).collect(),
            stretched: meshes.iter().map(|m| is_sphere(m) && !is_even(&m.transform.0)).collect(),
        }
    }

    /// Adds the copy that an `[[instance]]` table places.
    fn place(&mut self, number: u32, table: &InstanceTable) -> Result<()> {
        let place = &format!("instance {} of mesh \"{}\"", number + 1, table.mesh);
        let (sources, meshes) = (self.sources, &self.sources.description.mesh);
        let Some(&mesh) = self.named.get(table.mesh.as_str()) else {
            let names = meshes.iter().filter_map(|m| m.name.as_deref());
            let what = match description::nearest(&table.mesh, names) {
                Some(near) => format!("no such mesh: did you mean \"{near}\"?"),
                None => format!("no such mesh, since none has a name: write name = \"{}\" in its table", table.mesh),
            };
            return Err(sources.at(place, what));
        };
        if self.doubled.contains(table.mesh.as_str()) {
            return Err(sources.at(place, "two meshes have this name: rename one"));
        }
        let affine = invertible(sources, table.transform, place)?;
        let material = table.material.as_ref().map(|m| sources.material(m, place)).transpose()?;
        let own = invertible(sources, meshes[mesh].transform, place)?;
        let plain = material.is_some() && self.coloured[mesh];
        self.instanced[mesh][usize::from(plain)] = true;
        let whole = Job { material, placement: number, own, plain, ..Job::new(mesh, affine * own) };
        self.exact[mesh] = self.exact[mesh] && may_be_exact(sources, &whole)?;
        self.plan.copies.push(match self.stretched[mesh] {
            true => whole,
            false => Job { affine, own: DAffine3::IDENTITY, ..whole },
        });
        Ok(())
    }

    /// Stores a mesh for its instances, or where it has none, bakes it.
    fn keep(&mut self, mesh: usize) -> Result<()> {
        let table = &self.sources.description.mesh[mesh];
        let affine = invertible(self.sources, table.transform, &format!("mesh \"{}\"", mesh_name(table)))?;
        let job = Job::new(mesh, affine);
        let (exact, stretched) = (self.exact[mesh], self.stretched[mesh]);
        if self.instanced[mesh] == [false; 2] {
            let exact = exact && may_be_exact(self.sources, &job)?;
            match exact && stretched || table.moving {
                true => {
                    self.plan.stored.push(Job { affine: DAffine3::IDENTITY, exact, ..job });
                    self.plan.copies.push(Job { placement: self.next, ..job });
                    self.next += 1;
                }
                false => self.plan.baked.push(Job { exact, ..job }),
            }
        } else {
            let affine = if stretched { DAffine3::IDENTITY } else { affine };
            let kinds = [false, true].into_iter().zip(self.instanced[mesh]).filter(|(_, placed)| *placed);
            self.plan.stored.extend(kinds.map(|(plain, _)| Job { affine, exact, plain, ..job }));
        }
        Ok(())
    }
}

/// Whether a sphere can be stored as one, where `job` places it in the world. Lamps are chosen by the cone in which they are
/// seen: that takes a sphere of even radiance which emits outward, also as animations have it.
fn may_be_exact(sources: &Sources, job: &Job) -> Result<bool> {
    let table = &sources.description.mesh[job.mesh];
    let Some(worn) = override_of(sources, job)? else { return Ok(is_sphere(table)) };
    let Materials { list, names, .. } = &sources.library.materials;
    let (m, name) = (&list[worn as usize], &names[worn as usize]);
    let keyed = |key: &str| {
        let tables = sources.description.animation.iter().filter(|t| t.material.as_ref() == Some(name));
        tables.flat_map(|t| &t.keys).any(|k| k.values.contains_key(key))
    };
    let unlit = m.flags & MATERIAL_UNLIT != 0;
    let lamp = m.emission != [0.0; 3] || keyed("emission") || unlit && keyed("color");
    let opaque = m.flags & MATERIAL_MASKED == 0 && !keyed("opacity");
    let plain = m.emission_texture == NONE && m.clearcoat_texture == NONE;
    let even = plain && opaque && is_even(&job.affine) && !is_stretched(sources.description, job);
    Ok(is_sphere(table) && (!lamp || even && !table.flip_normals))
}

/// Whether an animation scales what `job` places by other factors along other axes.
fn is_stretched(description: &Description, job: &Job) -> bool {
    let instance = description.instance.get(job.placement as usize);
    let name = instance.map_or(&description.mesh[job.mesh].name, |instance| &instance.name);
    let tables = description.animation.iter().filter(|t| t.instance.is_some() && t.instance == *name);
    let is_uneven = |key: &Key| {
        let numbers = |name: &str| key.values.get(name).map(Numbers::list);
        let scale = numbers("scale").is_some_and(|s| s.windows(2).any(|two| two[0] != two[1]));
        let matrix = numbers("transform").and_then(|rows| affine(&rows));
        scale || matrix.is_some_and(|affine| !is_even(&affine))
    };
    tables.flat_map(|t| &t.keys).any(is_uneven)
}

fn invertible(sources: &Sources, transform: Transform, place: &str) -> Result<DAffine3> {
    match transform.has_inverse() {
        true => Ok(transform.0),
        false if !transform.0.is_finite() => {
            Err(sources.at(place, "its transform has a number that is NaN or infinite"))
        }
        false => Err(sources.at(place, "its transform has no inverse: choose scales other than 0, of 1e-18 or more")),
    }
}

/// A sphere that need not be tessellated: nobody asks for its segments or facets.
fn is_sphere(table: &MeshTable) -> bool {
    table.shape == Some(Shape::Sphere) && table.segments.is_none() && !table.flat
}

/// Whether spheres stay spheres, up to what six digits of a matrix leave open.
pub fn is_even(affine: &DAffine3) -> bool {
    let gram = affine.matrix3.transpose() * affine.matrix3;
    let mean = (gram.x_axis.x + gram.y_axis.y + gram.z_axis.z) / 3.0;
    (gram * (1.0 / mean)).abs_diff_eq(DMat3::IDENTITY, 1e-5)
}
