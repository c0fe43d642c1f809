//! From a description to the flat arrays: files are read, meshes placed, BVHs built and textures decoded.
use super::description::{self, Description, Mesh};
use super::geometry::Geometry;
use super::material::Materials;
use super::obj::{self, Library, ObjFile};
use super::place::{Job, Plan, instance, mesh_name};
use super::{Scene, bvh, environment, light};
use crate::error::{Error, Result};
use crate::layout::{Instance, LIGHT_ENVIRONMENT, NONE};
use crate::memory;
use glam::{DAffine3, Vec3};
use std::collections::{BTreeSet, HashMap};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Height of an MTL's bump map without `-bm`, as a share of the scene's diagonal.
const DEFAULT_BUMP: f32 = 0.0005;

/// Bytes that a triangle takes while the hierarchy over it is built, with what it is made of and its shading: 316 to build.
const BYTES_OF_TRIANGLE: u64 = 400;
/// Bytes of an object's name, about.
const BYTES_OF_NAME: u64 = 64;

/// A mesh in the triangle array: where, and how it is called.
struct Stored {
    mesh: Option<usize>,
    range: Range<usize>,
    objects: Vec<String>,
}

/// One scene in the making.
pub struct Assembly<'a> {
    path: &'a Path,
    /// What to build.
    pub description: &'a Description,
    /// Materials and warnings so far.
    pub library: Library,
    /// Parsed files that meshes still need.
    pub files: HashMap<PathBuf, ObjFile>,
    /// Triangles so far.
    pub geometry: Geometry,
}

/// Fills a scene's arrays. `sky`: a scene without any light gets a constant environment of radiance 1.
///
/// # Errors
/// [`Error::Input`] for what cannot be repaired.
pub fn assemble(path: &Path, description: &Description, sky: bool, scene: &mut Scene) -> Result<()> {
    let (library, files, geometry) = Default::default();
    let mut a = Assembly { path, description, library, files, geometry };
    a.bitmaps()?;
    a.materials()?;
    // Textures are decoded while geometry is read: on two cores Crytek Sponza is ready a quarter sooner.
    a.read_libraries()?;
    let early = a.library.materials.textures.clone();
    let (decoded, built) = rayon::join(|| early.decode(), || a.geometry(scene));
    let (ranges, textures) = (built?, &a.library.materials.textures);
    let decoded = if textures.len() == early.len() { decoded? } else { textures.decode()? };
    (scene.textures, scene.texels) = (decoded.textures, decoded.texels);
    a.finish(&ranges, sky, scene)
}

impl<'a> Assembly<'a> {
    /// What paths are relative to.
    pub fn directory(&self) -> &'a Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// An error at a place in the scene file.
    pub fn at(&self, place: impl std::fmt::Display, what: impl std::fmt::Display) -> Error {
        Error::input_at(self.path, place, what)
    }

    fn bitmaps(&mut self) -> Result<()> {
        for bitmap in &self.description.bitmap {
            let taken = self.library.materials.textures.add_bitmap(bitmap);
            taken.map_err(|what| self.at(format!("bitmap \"{}\"", bitmap.name.display()), what))?;
        }
        Ok(())
    }

    fn materials(&mut self) -> Result<()> {
        for table in &self.description.material {
            let place = format!("material \"{}\"", table.name);
            let directory = self.directory();
            let Library { materials, warnings, .. } = &mut self.library;
            let index = materials.push_table(table, directory, warnings).map_err(|what| self.at(&place, what))?;
            if table.name.is_empty() {
                return Err(self.at("[[material]]", "has no name: meshes could not refer to it"));
            }
            if self.library.tables.insert(table.name.clone(), index).is_some() {
                return Err(self.at(place, "is defined twice: rename one"));
            }
        }
        Ok(())
    }

    /// Index of a `[[material]]`.
    ///
    /// # Errors
    /// With the nearest name, when there is none of that name.
    pub fn material(&self, name: &str, place: &str) -> Result<u32> {
        let known = self.library.tables.keys().map(String::as_str);
        match (self.library.tables.get(name), description::nearest(name, known)) {
            (Some(&index), _) => Ok(index),
            (None, Some(near)) => Err(self.at(place, format!("no material \"{name}\": did you mean \"{near}\"?"))),
            (None, None) => Err(self.at(place, format!("no material \"{name}\": add a [[material]] table"))),
        }
    }

    /// Reads the MTL files that OBJ files name near their beginning; others are read when they turn up.
    fn read_libraries(&mut self) -> Result<()> {
        let paths: BTreeSet<_> = self.description.mesh.iter().filter_map(|m| self.file_of(m)).collect();
        paths.iter().try_for_each(|path| obj::read_libraries(path, &mut self.library))
    }

    /// Everything but textures; returns the triangles below each root that instances name.
    fn geometry(&mut self, scene: &mut Scene) -> Result<HashMap<u32, Range<usize>>> {
        self.read_files()?;
        self.lights(scene)?;
        let plan = self.plan()?;
        let stored = self.store(&plan)?;
        scene.content.add(&self.geometry.triangles);
        scene.content.add(&self.geometry.shading);
        self.build(&plan, stored, scene)
    }

    /// Parses every file before geometry is placed: whether texture coordinates are kept depends on all materials.
    fn read_files(&mut self) -> Result<()> {
        for mesh in &self.description.mesh {
            let place = || format!("mesh \"{}\"", mesh_name(mesh));
            let sources = [mesh.file.is_some(), mesh.shape.is_some(), mesh.data.is_some()];
            if sources.into_iter().filter(|there| *there).count() != 1 {
                return Err(self.at(place(), "needs either a file or a shape (or, in memory, data)"));
            }
            mesh.data.as_ref().map_or(Ok(()), Mesh::check).map_err(|what| self.at(place(), what))?;
            if let Some(n) = mesh.segments.filter(|n| !(3..=4096).contains(n)) {
                return Err(self.at(place(), format!("segments is {n}: choose a value from 3 to 4096")));
            }
            let Some(path) = self.file_of(mesh) else { continue };
            if !self.files.contains_key(&path) {
                let parsed = obj::load(&path, &mut self.library)?;
                self.files.insert(path, parsed);
            }
        }
        Ok(())
    }

    /// Lights without surface, and the environment.
    fn lights(&mut self, scene: &mut Scene) -> Result<()> {
        for (i, table) in self.description.light.iter().enumerate() {
            let light = table.build().map_err(|what| self.at(format!("light {}", i + 1), what))?;
            scene.lights.push(light);
        }
        let Some(table) = &self.description.environment else { return Ok(()) };
        let scale = table.scale.map_or([1.0; 3], |s| s.0);
        let constant = table.radiance.map_or([1.0; 3], |r| r.0);
        let radiance: [f32; 3] = std::array::from_fn(|c| scale[c] * constant[c]);
        if !radiance.iter().all(|v| (0.0..=1e18).contains(v)) || !table.rotation.is_finite() {
            return Err(self.at("[environment]", "radiance times scale must lie from 0 to 1e18, rotation be finite"));
        }
        let rotation = environment::rotation(table.rotation, table.world_from_environment);
        let light = light::environment(radiance, rotation.map_err(|what| self.at("[environment]", what))?);
        let (directory, warnings) = (self.directory(), &mut self.library.warnings);
        scene.environment = match (&table.file, &table.picture) {
            (None, None) => {
                scene.lights.push(light);
                return Ok(());
            }
            _ if table.radiance.is_some() => {
                return Err(self.at("[environment]", "has both radiance and an image: choose one"));
            }
            (Some(file), None) => {
                environment::load(&directory.join(file.to_string_lossy().replace('\\', "/")), warnings)?
            }
            (None, Some(picture)) => environment::from_picture("[environment]", picture, warnings)
                .map_err(|what| self.at("[environment]", format!("its picture is unusable: {what}")))?,
            (Some(_), Some(_)) => return Err(self.at("[environment]", "has both file and picture: choose one")),
        };
        scene.lights.extend(scene.environment.is_some().then_some(light));
        Ok(())
    }

    /// Puts all triangles into the array: first those in world space, then one mesh after another.
    fn store(&mut self, plan: &Plan) -> Result<Vec<Stored>> {
        let jobs: Vec<&Job> = plan.baked.iter().chain(&plan.stored).collect();
        let triangles: u64 = jobs.iter().map(|job| self.triangles_of(job)).sum();
        memory::need(format!("{}: {triangles} triangles", self.path.display()), triangles * BYTES_OF_TRIANGLE)?;
        self.warn_of_grey(plan)?;
        let file = |job: &Job| self.description.mesh[job.mesh].file.as_ref();
        let latest: HashMap<_, _> = jobs.iter().enumerate().map(|(i, job)| (file(job), i)).collect();
        let last: Vec<bool> = jobs.iter().enumerate().map(|(i, job)| latest[&file(job)] == i).collect();
        let mut stored = vec![Stored { mesh: None, range: 0..0, objects: Vec::new() }];
        for (i, job) in jobs.into_iter().enumerate() {
            let start = self.geometry.triangles.len();
            if i < plan.baked.len() {
                let objects = self.add(job, stored[0].objects.len() as u32, last[i])?;
                stored[0].objects.extend(objects);
                stored[0].range.end = self.geometry.triangles.len();
            } else {
                let objects = self.add(job, 0, last[i])?;
                let range = start..self.geometry.triangles.len();
                stored.push(Stored { mesh: Some(job.mesh), range, objects });
            }
        }
        self.files.clear();
        Ok(stored)
    }

    /// Builds the BVHs; returns the triangles below each root that instances name.
    fn build(&mut self, plan: &Plan, stored: Vec<Stored>, scene: &mut Scene) -> Result<HashMap<u32, Range<usize>>> {
        let mut ranges = HashMap::new();
        if plan.copies.is_empty() {
            let world = stored.into_iter().next().expect("world space is always there");
            scene.root = bvh::build_mesh(&mut self.geometry, world.range, &mut scene.nodes);
            scene.names.objects = world.objects;
            scene.bounds = bvh::bounds(&self.geometry.triangles).unwrap_or_default();
            return Ok(ranges);
        }
        let mut boxes = HashMap::new();
        let mut copies: HashMap<usize, Vec<&Job>> = HashMap::new();
        plan.copies.iter().for_each(|copy| copies.entry(copy.mesh).or_default().push(copy));
        let copies_of = |mesh: &Stored| mesh.mesh.and_then(|m| copies.get(&m)).map_or(&[][..], |jobs| jobs);
        let names: u64 = stored.iter().map(|mesh| copies_of(mesh).len() as u64 * mesh.objects.len() as u64).sum();
        memory::need(format!("{}: {names} objects", self.path.display()), names.saturating_mul(BYTES_OF_NAME))?;
        for mesh in stored {
            let Some(bounds) = bvh::bounds(&self.geometry.triangles[mesh.range.clone()]) else { continue };
            let root = bvh::build_mesh(&mut self.geometry, mesh.range.clone(), &mut scene.nodes);
            ranges.insert(root, mesh.range.clone());
            boxes.insert(root, bounds);
            let copies = copies_of(&mesh).iter().copied();
            let identity = Job { mesh: 0, affine: DAffine3::IDENTITY, material: None, exact: false };
            let baked = mesh.mesh.is_none().then_some(&identity);
            for copy in copies.chain(baked) {
                let (material, object) = (copy.material.unwrap_or(NONE), scene.names.objects.len() as u32);
                let placed = Instance { material, object, ..instance(&copy.affine, root) };
                // Nodes are counted differently by another builder, triangles are not.
                scene.content.add(&[Instance { root: mesh.range.start as u32, ..placed }]);
                scene.content.add(&[mesh.range.end as u32]);
                scene.instances.push(placed);
                scene.names.objects.extend(mesh.objects.iter().cloned());
            }
        }
        self.top_level(&boxes, scene)?;
        Ok(ranges)
    }

    fn top_level(&self, boxes: &HashMap<u32, bvh::Bounds>, scene: &mut Scene) -> Result<()> {
        let object_bounds: Vec<_> = scene.instances.iter().map(|i| boxes[&i.root]).collect();
        let (mut low, mut high) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for (instance, &bounds) in scene.instances.iter().zip(&object_bounds) {
            let [l, h] = bvh::world_bounds(instance, bounds).map(Vec3::from);
            (low, high) = (low.min(l), high.max(h));
        }
        if scene.instances.is_empty() {
            (low, high) = (Vec3::ZERO, Vec3::ZERO);
        }
        let far = low.abs().max(high.abs()).max_element();
        if far.is_nan() || far > super::MAX_COORDINATE as f32 {
            return Err(self.at("instances", format!("reach beyond the limit of {:e}", super::MAX_COORDINATE)));
        }
        // Rays are taken to the space of each instance that they meet.
        let world = [low.to_array(), high.to_array()];
        let seen = |i: &Instance| {
            bvh::world_bounds(&turned(i), world).as_flattened().iter().map(|v| v.abs()).fold(0.0, f32::max)
        };
        if let Some(i) = scene.instances.iter().find(|i| seen(i).is_nan() || seen(i) > super::MAX_COORDINATE as f32) {
            let name = &scene.names.objects[i.object as usize];
            let what = format!(
                "seen from it, the scene reaches beyond the limit of {:e}: choose a larger scale",
                super::MAX_COORDINATE
            );
            return Err(self.at(format!("an instance of \"{name}\""), what));
        }
        scene.bounds = world;
        scene.root = bvh::build_top(&mut scene.instances, &object_bounds, &mut scene.nodes);
        Ok(())
    }

    /// Moves what is left into the scene and chooses among its lights.
    fn finish(mut self, ranges: &HashMap<u32, Range<usize>>, sky: bool, scene: &mut Scene) -> Result<()> {
        let [low, high] = scene.bounds.map(Vec3::from);
        if self.library.materials.list.is_empty() {
            self.library.grey();
        }
        let Library { mut materials, mut warnings, .. } = self.library;
        for i in materials.default_bumps {
            materials.list[i as usize].bump_scale = (high - low).length() * DEFAULT_BUMP;
        }
        (scene.materials, scene.names.materials) = (materials.list, materials.names);
        (scene.triangles, scene.shading) = (self.geometry.triangles, self.geometry.shading);
        let emits = |t: &crate::layout::Triangle| scene.materials[t.material as usize].emission != [0.0; 3];
        if sky && scene.lights.is_empty() && !scene.triangles.iter().any(emits) {
            scene.lights.push(light::environment([1.0; 3], glam::DMat3::IDENTITY));
        }
        add_appearance(scene);
        Materials::add_coat_tables(&mut scene.materials, &mut scene.texels);
        light::finish(scene, ranges)?;
        if !scene.lights.iter().any(|l| l.kind == LIGHT_ENVIRONMENT) {
            scene.environment = None;
        }
        if scene.lights.is_empty() {
            warnings.push("the scene has no light: its image will be black".into());
        }
        scene.warnings = warnings;
        Ok(())
    }
}

/// The instance whose world is the object's space.
fn turned(i: &Instance) -> Instance {
    Instance { world0: i.object0, world1: i.object1, world2: i.object2, ..*i }
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
