//! Scene files become flat arrays, ready to be copied to the device as they are. Nothing here talks to a GPU.
//!
//! A scene takes three steps: a [`Description`] says what is there, `load` reads the files that it names, and `build` makes
//! the arrays of both. A front end for another format is a file of `load` that makes a description.
use crate::error::{Error, Result};
use crate::image::input;
use crate::layout::{AliasEntry, BvhNode, Camera, Instance, Light, LightNode, Material, Shading, Texture, Triangle};
use crate::scene::description::settings::Settings;
use crate::threads;
use animation::{Animation, Mover};
use build::assemble::{Choices, assemble};
use description::Description;
use load::mesh_file::{self, Format};
use load::{gltf, include};
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub mod animation;
mod apply;
pub(crate) mod attributes;
mod build;
mod change;
mod check;
pub mod description;
mod effects;
mod fingerprint;
mod load;
pub(crate) mod lookup;
mod numbers;
mod pose;
mod relit;
mod rig;

pub use build::attributes::words_of as attribute_words;
pub use build::bvh::Bounds;
pub use build::coat::{CoatRow, coat_table, microfacet_table};
pub use build::fresnel::mean_internal as mean_internal_fresnel;
pub(crate) use build::geometry::FLAT;
pub use change::{Change, Deformed};
pub use check::check_camera;
pub use effects::{effects, keeps_soft_light_apart, light_and_camera_effects};
pub use fingerprint::Fingerprint;
pub use pose::{EnvironmentChange, MaterialChange, Pose, REBUILD_ABOVE, Vertices};
pub use relit::Relit;
pub use rig::Rig;

/// Bytes that a triangle takes while the hierarchy over it is built, with what it is made of and its shading: 316 to
/// build.
const BYTES_OF_TRIANGLE: u64 = 400;

/// Largest coordinate M of triangles, of points that rays start from and of lights. With it, all numbers of the triangle test
/// fit a 32-bit float (3.4e38): seen from the ray's origin a corner is within 2 M, and sheared along the ray within 4 M; an edge
/// function is within 2 (4 M)^2 = 32 M^2, and the numerator of the distance, three of them times a depth, within
/// 3 * 32 M^2 * 2 M = 192 M^3, which is 1.9e38.
pub const MAX_COORDINATE: f64 = 1e12;

/// Largest radiance of surfaces and sky, W/(m^2 sr), and irradiance of directional lights, W/m^2. It is how far a sample may lie from
/// its pixel's mean before the variances that are kept of it saturate.
pub const MAX_RADIANCE: f32 = crate::shaders::accumulate::MAX_DEVIATION;

/// Most bytes of memory that a byte of a scene file takes while it is read.
const BYTES_OF_TOML: u64 = 40;

/// Everything that a render reads, in the form that kernels read. Code that edits it must keep to what [`Scene::check`] checks.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// The `[camera]` table; [`Scene::camera`] makes a camera of it for a film.
    pub view: description::Camera,
    /// Nodes of all levels; the indices in them are global.
    pub nodes: Vec<BvhNode>,
    /// Node where traversal starts: the top level with instances, else the only one.
    pub root: u32,
    /// Largest number of groups of nodes on a ray's stack; at least 1.
    pub stack: u32,
    /// Triangles, and spheres among them, in leaf order.
    pub triangles: Vec<Triangle>,
    /// Shading records in the order of `triangles`; empty when no mesh has vertex normals or other attributes.
    pub shading: Vec<Shading>,
    /// Instances in leaf order of the top level; empty when the scene has one level.
    pub instances: Vec<Instance>,
    /// Materials of which there is at least one.
    pub materials: Vec<Material>,
    /// Pictures that materials name; may be empty.
    pub textures: Vec<Texture>,
    /// RGBA8 texels of all textures, R in the low byte; after them the words of vertices' colours, second coordinates and tangents
    /// ([`Shading::attributes`]), and the tables of rough coats, words of floats, and of metallic microfacets.
    pub texels: Vec<u32>,
    /// Lights; without any, paths see only the emission that they hit.
    pub lights: Vec<Light>,
    /// Alias table over `lights`, by power, see `scene/build/lights.rs`; same length.
    pub light_table: Vec<AliasEntry>,
    /// For emissive triangles, `Light::probability / area = Material::emission_weight * triangle_pdf_scale`: the density
    /// per square world unit of drawing a point by [`Scene::light_table`] that a path has hit otherwise. 0 without
    /// emissive triangles. Exact up to the rounding of the table (2^-32 / lights) and of 32-bit floats.
    pub triangle_pdf_scale: f32,
    /// Whether emissive triangles are sampled by solid angle, not by area, since one of them is large, or may come to be while an
    /// animation moves the scene. It stays as the scene was loaded, so that no frame depends on those before it. An engine whose lamps grow
    /// sets it before it makes a renderer; without, the light is the same on average, with more noise near them.
    pub large_lamps: bool,
    /// Whether one of the point, spot and directional lights is chosen by what each would bring to the point that is lit, as where there
    /// are from two, be they dark now, to 32 that shine. It stays as the scene was loaded, too.
    pub weighed_lights: bool,
    /// Nodes of the tree by which lamps are chosen where there are several, see `scene/build/light_tree.rs`; else empty, and that stays, too.
    pub light_nodes: Vec<LightNode>,
    /// The environment image, when the environment is not a constant.
    pub environment: Option<Environment>,
    /// Fingerprint of all that decides the picture but camera and settings, in the order of the files. Triangles are added before
    /// the hierarchy sorts them, since another version or machine may sort them differently.
    pub content: Fingerprint,
    /// World-space bounds of all geometry; zero when there is none.
    pub bounds: Bounds,
    /// What can move: see [`Scene::apply`].
    pub rig: Rig,
    /// Names of objects and materials by index.
    pub names: Names,
    /// Readable lines about what was repaired on loading.
    pub warnings: Vec<String>,
    /// The files that it is made of, to watch or not to write over: its own first, if it has one. The poses of `[[animation]]` tables,
    /// which are read when they are shown, are not among them.
    pub files: Vec<PathBuf>,
}

/// Latitude-longitude image: row 0 is straight up (+y), column 0 begins at direction -z, columns turn towards +x. For a
/// unit direction d in environment space `u = atan2(d.x, -d.z) / (2 pi)`, `v = acos(d.y) / pi`; texel centres lie at
/// half-integers. Texels are interpolated bilinearly, columns wrap and rows clamp. Directions are drawn with the density
/// `w * width * height / (2 pi^2 sin(theta))` per solid angle, w interpolated as radiance is.
#[derive(Clone, Debug, Default)]
pub struct Environment {
    /// Width in texels (longitude).
    pub width: u32,
    /// Height in texels (latitude).
    pub height: u32,
    /// Linear radiance in xyz; in w the probability that `table` returns this texel.
    pub texels: Vec<[f32; 4]>,
    /// Alias table that chooses one of `texels`.
    pub table: Vec<AliasEntry>,
}

/// Names of a scene's parts.
#[derive(Clone, Debug, Default)]
pub struct Names {
    /// Names of the objects, by index.
    pub objects: Vec<String>,
    /// Names of the materials, by index.
    pub materials: Vec<String>,
}

impl Names {
    /// Index in [`Scene::materials`] of the material of this name, the first if there are several.
    pub fn material(&self, name: &str) -> Option<usize> {
        self.materials.iter().position(|material| material == name)
    }
}

/// A scene, and the settings that its file gives.
#[derive(Clone, Debug, Default)]
pub struct Loaded {
    /// The scene to be rendered.
    pub scene: Scene,
    /// The file's settings over the defaults.
    pub settings: Settings,
    /// What moves in the scene.
    pub animation: Animation,
}

impl Loaded {
    /// The same with other settings.
    pub fn with(mut self, change: impl FnOnce(&mut Settings)) -> Self {
        change(&mut self.settings);
        self
    }
}

impl std::ops::Deref for Loaded {
    type Target = Scene;

    fn deref(&self) -> &Scene {
        &self.scene
    }
}

impl std::ops::DerefMut for Loaded {
    fn deref_mut(&mut self) -> &mut Scene {
        &mut self.scene
    }
}

/// A scene file that was read, without the models and images that it names.
pub struct SceneFile<'a> {
    path: PathBuf,
    description: Cow<'a, Description>,
    choices: Choices,
    /// The cameras that a glTF file holds, and the number of the one that is looked through.
    cameras: Vec<gltf::Named>,
    through: usize,
    /// What was repaired or passed over so far.
    warnings: Vec<String>,
    /// Files that were read so far.
    files: Vec<PathBuf>,
    /// What the loader of the file makes move, besides the description's own tables.
    movers: Vec<Arc<dyn Mover>>,
}

impl<'a> SceneFile<'a> {
    fn of(path: &Path, description: Cow<'a, Description>) -> Self {
        let (choices, cameras, through, warnings, files, movers) = Default::default();
        Self { path: path.to_owned(), description, choices, cameras, through, warnings, files, movers }
    }

    /// Reads a scene file (`.toml`, `.gltf`, `.glb`), or takes a model (`.obj`, `.ply`, `.ply.gz`) for one.
    ///
    /// # Errors
    /// [`Error::Input`] with file, place and remedy.
    pub fn open(path: &Path) -> Result<Self> {
        Self::open_clip(path, None)
    }

    /// Whether a file of such a name is read as a scene.
    #[cfg(feature = "cli")]
    pub(crate) fn is_named(path: &Path) -> bool {
        let extension = path.extension().unwrap_or_default().to_ascii_lowercase();
        extension == "toml" || extension == "obj" || Format::of(path) != Format::Obj
    }

    /// As [`SceneFile::open`], but of a glTF file only the animation `clip` is played, if one is named.
    ///
    /// # Errors
    /// As [`SceneFile::open`]; [`Error::Usage`] for a clip of another kind of file.
    pub fn open_clip(path: &Path, clip: Option<&str>) -> Result<Self> {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or("").to_lowercase();
        let mut asset = gltf::Model::default();
        let (description, sky) = match (extension.as_str(), Format::of(path)) {
            (_, Format::Gltf) => {
                asset = gltf::load(path, path.parent().unwrap_or(Path::new("")), clip, Vec::new())?;
                (std::mem::take(&mut asset.description), false)
            }
            ("toml", _) => {
                let text = String::from_utf8(input::read_text(path, BYTES_OF_TOML)?);
                let text = text.map_err(|_| Error::input(path, "is no text: write it in UTF-8"))?;
                (description::parse(path, &text)?, false)
            }
            ("obj", _) | (_, Format::Ply) => (model(path), true),
            (other, _) => {
                input::open(path)?; // a missing file is that first of all
                let none = || format!("\"{other}\" is none of toml, obj, ply, ply.gz, gltf, glb");
                let what = mesh_file::remedy(path).unwrap_or_else(none);
                return Err(Error::input(path, format!("is no scene: {what}")));
            }
        };
        if let (Some(clip), false) = (clip, Format::of(path) == Format::Gltf) {
            let what = format!("{}: clip \"{clip}\" is not there: only glTF files have clips", path.display());
            return Err(Error::Usage(what));
        }
        let gltf::Model { cameras, warnings, mover, buffers, .. } = asset;
        let (choices, movers) = (Choices { sky, still: false }, mover.into_iter().collect());
        let files = [vec![path.to_owned()], buffers].concat();
        Ok(Self { choices, cameras, warnings, files, movers, ..Self::of(path, Cow::Owned(description)) })
    }

    /// Looks through the camera of this name, which a glTF file holds. The film takes its shape.
    ///
    /// # Errors
    /// [`Error::Usage`] with the names of the cameras that there are.
    pub fn look_through(&mut self, name: &str) -> Result<()> {
        if let Some(place) = self.cameras.iter().position(|camera| camera.name == name) {
            self.through = place;
            let (description, chosen) = (self.description.to_mut(), &self.cameras[place]);
            (description.camera, description.film) = (chosen.camera.clone(), chosen.film.clone());
            return Ok(());
        }
        let names: Vec<_> = self.cameras.iter().map(|camera| format!("\"{}\"", camera.name)).collect();
        let what = match names.is_empty() {
            true => "is not there: only glTF files have named cameras, and this one has none".to_owned(),
            false => format!("is not there: choose one of {}", names.join(", ")),
        };
        Err(Error::Usage(format!("{}: camera \"{name}\" {what}", self.path.display())))
    }

    /// Promises that no [`Pose`] will place anything elsewhere or deform it. Instances of few triangles are then stored as meshes of
    /// their own, through which rays take about half the time. A scene with animations keeps its instances. `tallow render` loads scenes so: do
    /// the same for its bits, and to go on with its files.
    pub fn stays_still(&mut self) {
        self.choices.still = true;
    }

    /// The file's settings over the defaults.
    ///
    /// # Errors
    /// [`Error::Input`] with the setting that is out of range.
    pub fn settings(&self) -> Result<Settings> {
        let settings = self.description.settings();
        settings.validate().map_err(|e| Error::input(&self.path, e))?;
        Ok(settings)
    }

    /// What the file says, to be changed before it is loaded: another camera, another sky.
    pub fn description_mut(&mut self) -> &mut Description {
        self.description.to_mut()
    }

    /// Reads what the file names and makes the scene.
    ///
    /// # Errors
    /// [`Error::Input`] with file, place and remedy.
    pub fn load(&self) -> Result<Loaded> {
        let settings = self.settings()?;
        let mut scene = Scene { view: self.description.camera.clone(), ..Scene::default() };
        let (description, included, warnings, of_models) = include::models(&self.path, &self.description)?;
        let description = animation::with_freed_meshes(&description);
        let carried = self.cameras.get(self.through).and_then(|camera| camera.mover.clone());
        let movers: Vec<_> = self.movers.iter().cloned().chain(included).chain(carried).collect();
        let still = self.choices.still && movers.is_empty() && description.animation.is_empty();
        threads::within(|| assemble(&self.path, &description, Choices { still, ..self.choices }, &mut scene))?;
        scene.warnings.splice(0..0, self.warnings.iter().chain(&warnings).cloned());
        let named: Vec<_> = self.files.iter().chain(&of_models).cloned().collect();
        scene.files.retain(|file| !named.contains(file)); // a model is a scene, and its mesh
        scene.files.splice(0..0, named);
        let camera = scene.view.build(settings.size(), scene.bounds);
        camera.map_err(|what| Error::input_at(&self.path, "[camera]", what))?;
        let (animation, warnings) = animation::load(&self.path, &description, &movers, &scene)?;
        scene.warnings.extend(warnings);
        if !animation.is_empty() {
            scene.view.framed = Some(scene.bounds);
            scene.large_lamps = scene.large_lamps || animation.moves_surfaces();
        }
        Ok(Loaded { scene, settings, animation })
    }
}

impl Scene {
    /// Reads a scene file (`.toml`, `.gltf`, `.glb`) or a model (`.obj`, `.ply`). A model alone gets a camera that frames it and, when nothing in it
    /// emits light, a sky of radiance 1. [`SceneFile`] does the same in two steps.
    ///
    /// # Errors
    /// [`Error::Input`] with file, place and remedy.
    pub fn load(path: &Path) -> Result<Loaded> {
        SceneFile::open(path)?.load()
    }

    /// Reads a scene file's text; `path` is for messages and for what it names.
    ///
    /// # Errors
    /// See [`Scene::load`].
    pub fn parse(path: &Path, text: &str) -> Result<Loaded> {
        let description = Cow::Owned(description::parse(path, text)?);
        SceneFile::of(path, description).load()
    }

    /// Whether there are point, spot or directional lights, be they dark now.
    pub fn has_delta_lights(&self) -> bool {
        self.lights.iter().chain(&self.rig.lights).any(Light::is_delta)
    }

    /// Whether some light may bring noise to what is lit by it alone: lamps and a sky, which have an extent, and one of several point, spot
    /// and directional lights, of which a sample chooses one.
    pub fn has_soft_lights(&self) -> bool {
        let count = |lights: &[Light]| lights.iter().filter(|light| light.is_delta()).count();
        // Those that are dark now are in the rig.
        count(&self.lights) < self.lights.len() || count(&self.lights).max(count(&self.rig.lights)) > 1
    }

    /// Whether lamps are chosen by a tree over them.
    pub fn has_light_tree(&self) -> bool {
        !self.light_nodes.is_empty()
    }

    /// A scene from memory: the tables of a scene file, whose meshes, textures and environment may be data. What files they
    /// name is relative to the working folder; messages call the scene "scene".
    ///
    /// # Errors
    /// See [`Scene::load`].
    pub fn build(description: &Description) -> Result<Loaded> {
        SceneFile::of(Path::new("scene"), Cow::Borrowed(description)).load()
    }

    /// The camera for a film of (width, height) pixels, in world space.
    ///
    /// # Errors
    /// [`Error::Usage`] with the key of the `[camera]` table that is at fault.
    pub fn camera(&self, size: [u32; 2]) -> Result<Camera> {
        self.view.build(size, self.bounds).map_err(|what| Error::Usage(format!("camera: {what}")))
    }

    /// Fingerprint of all that decides the picture but the settings.
    ///
    /// # Errors
    /// Those of [`Scene::camera`].
    pub fn fingerprint(&self, size: [u32; 2]) -> Result<Fingerprint> {
        let mut fingerprint = self.content.clone();
        fingerprint.add(&[self.camera(size)?]);
        Ok(fingerprint)
    }
}

/// A scene of one file.
fn model(path: &Path) -> Description {
    let file = path.file_name().map(Into::into);
    let name = path.file_stem().map(|s| s.to_string_lossy().into_owned());
    let mesh = description::MeshTable { name, file, ..Default::default() };
    Description { mesh: vec![mesh], ..Default::default() }
}
