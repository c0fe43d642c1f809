//! What a pose has changed in a scene's arrays.
use std::ops::Range;

/// What [`Scene::apply`](super::Scene::apply) has changed, for those who copy it to a device.
#[derive(Clone, Debug, Default)]
pub struct Change {
    /// The camera.
    pub camera: bool,
    /// Parts of [`Scene::nodes`](super::Scene::nodes).
    pub nodes: Vec<Range<usize>>,
    /// Parts of [`Scene::triangles`](super::Scene::triangles) and, where there are any, of the shading records.
    pub triangles: Vec<Range<usize>>,
    /// The instances.
    pub instances: bool,
    /// The materials.
    pub materials: bool,
    /// Parts of [`Scene::texels`](super::Scene::texels), of which there may be more.
    pub texels: Vec<Range<usize>>,
    /// The lights and their table.
    pub lights: bool,
    /// The meshes that were deformed, and what their hierarchies cost.
    pub deformed: Vec<Deformed>,
}

/// A mesh that was deformed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deformed {
    /// Number of its `[[mesh]]`.
    pub mesh: usize,
    /// What rays pay in its refitted hierarchy over what they did when that was built: its SAH cost.
    pub cost: f32,
    /// Whether it was built anew for that.
    pub rebuilt: bool,
}

impl Change {
    /// Whether nothing but the camera has changed.
    pub fn is_of_camera_alone(&self) -> bool {
        let Self { camera: _, nodes, triangles, instances, materials, texels, lights, deformed } = self;
        let arrays = nodes.is_empty() && triangles.is_empty() && texels.is_empty() && deformed.is_empty();
        arrays && !(*instances || *materials || *lights)
    }

    /// Adds what a later pose has changed.
    pub fn add(&mut self, later: Self) {
        self.camera |= later.camera;
        self.nodes.extend(later.nodes);
        self.triangles.extend(later.triangles);
        self.instances |= later.instances;
        self.materials |= later.materials;
        self.texels.extend(later.texels);
        self.lights |= later.lights;
        self.deformed.extend(later.deformed);
    }
}
