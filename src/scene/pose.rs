//! What may change in a scene between frames while the number of everything stays.
use super::description::{Camera, LightTable, Transform};

/// SAH cost of a refitted tree over that when it was built, above which a mesh is built anew: see [`Pose::rebuild_above`].
pub const REBUILD_ABOVE: f32 = 1.4;

/// A change of a scene between two frames. What it does not name stays as it is. [`Rig`](super::Rig) finds the numbers of
/// things by their names, [`Names::material`](super::Names::material) those of materials.
#[derive(Clone, Debug)]
pub struct Pose {
    /// The `[camera]` table anew.
    pub camera: Option<Camera>,
    /// Placements by number, see [`Rig::placements`](super::Rig::placements): their `transform` anew. One without inverse, as of
    /// scale 0, hides what it places until another comes.
    pub instances: Vec<(usize, Transform)>,
    /// Meshes that are `moving`, by number of their `[[mesh]]`, each once.
    pub meshes: Vec<(usize, Vertices)>,
    /// Materials by their index in [`Scene::materials`](super::Scene::materials).
    pub materials: Vec<(usize, MaterialChange)>,
    /// The `[[light]]` tables of these numbers anew.
    pub lights: Vec<(usize, LightTable)>,
    /// The environment.
    pub environment: Option<EnvironmentChange>,
    /// A deformed mesh keeps its hierarchy, whose boxes are fitted to it, until rays pay this many times what they did when it was
    /// built; then it is built anew. 0 builds always, infinity never.
    pub rebuild_above: f32,
}

impl Pose {
    /// Whether it places or deforms something.
    pub fn moves(&self) -> bool {
        !(self.instances.is_empty() && self.meshes.is_empty())
    }

    /// Whether it changes light or matter.
    pub fn shines(&self) -> bool {
        !(self.materials.is_empty() && self.lights.is_empty()) || self.environment.is_some()
    }

    /// Whether it says where the camera is, and of nothing else.
    pub fn is_of_camera_alone(&self) -> bool {
        !self.moves() && !self.shines()
    }
}

impl Default for Pose {
    fn default() -> Self {
        Self {
            camera: None,
            instances: Vec::new(),
            meshes: Vec::new(),
            materials: Vec::new(),
            lights: Vec::new(),
            environment: None,
            rebuild_above: REBUILD_ABOVE,
        }
    }
}

/// The vertices of a mesh in another pose.
#[derive(Clone, Debug, Default)]
pub struct Vertices {
    /// Positions in object units; as many as before, unless there are indices.
    pub positions: Vec<[f32; 3]>,
    /// Normals of any length, outward; none, and facets are seen, or one per position.
    pub normals: Vec<[f32; 3]>,
    /// Tangents as those of [`Mesh`](super::description::Mesh), whose signs stay: one per position of a mesh that has some; none, and
    /// they stay too.
    pub tangents: Vec<[f32; 4]>,
    /// Vertices of the triangles, three each, where those of the mesh do not fit: as many as before. Triangles keep their order,
    /// their materials and their texture coordinates.
    pub indices: Vec<u32>,
}

/// New numbers of a material, in the units of its [`MaterialTable`](super::description::MaterialTable).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct MaterialChange {
    /// Albedo, or the tint of a conductor or mirror, clamped to 0 to 1 as all tints are; of an unlit material what it emits.
    pub color: Option<[f32; 3]>,
    /// Tint of specular reflection, from 0 to 1; of metallic-roughness the factor of what its index reflects, up to 1e6.
    pub specular: Option<[f32; 3]>,
    /// Tint of transmission, from 0 to 1.
    pub transmission: Option<[f32; 3]>,
    /// Radiance of the front side, W/(m^2 sr): with the strength that a table has apart.
    pub emission: Option<[f32; 3]>,
    /// Microfacet roughness along u, from 0 to 1; that along v keeps its ratio to it. Of metallic-roughness the square of its `roughness`.
    pub alpha: Option<f32>,
    /// Opacity, from 0 to 1.
    pub opacity: Option<f32>,
}

/// New numbers of the environment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnvironmentChange {
    /// Constant radiance, W/(m^2 sr), or the factor of the image.
    pub radiance: Option<[f32; 3]>,
    /// Rotation about +y in degrees.
    pub rotation: Option<f64>,
}
