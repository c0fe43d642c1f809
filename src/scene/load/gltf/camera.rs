//! Cameras of nodes become `[camera]` tables.
use super::asset::{Asset, one_line};
use crate::scene::animation::Mover;
use crate::scene::description::{Camera, FovAxis};
use glam::{DAffine3, DMat4};
use gltf_json::camera::Type;
use gltf_json::validation::Checked;
use std::sync::Arc;

/// A camera of the scene.
#[derive(Clone, Debug)]
pub struct Named {
    /// The camera's own name, else its node's, else `camera N`.
    pub name: String,
    /// `None` where its projection is not supported.
    pub camera: Option<Camera>,
    /// What moves it.
    pub mover: Option<Arc<dyn Mover>>,
    /// The node that holds it.
    pub(super) node: usize,
}

/// The camera that `node` holds, placed by `world`: it looks along the node's -z axis, +y is up. The scale of nodes does not
/// count.
pub fn of_node(asset: &Asset, node: usize, world: &DAffine3) -> Option<Named> {
    let holder = &asset.root.nodes[node];
    let index = holder.camera?.value();
    let camera = &asset.root.cameras[index];
    let named = camera.name.as_ref().or(holder.name.as_ref()).filter(|name| !name.is_empty());
    let name = named.map_or_else(|| format!("camera {index}"), |name| one_line(name));
    let perspective = camera.perspective.as_ref().filter(|_| matches!(camera.type_, Checked::Valid(Type::Perspective)));
    let camera = perspective.map(|perspective| Camera {
        world_from_camera: Some(DMat4::from(*world).transpose().to_cols_array()),
        fov: Some(f64::from(perspective.yfov).to_degrees()),
        fov_axis: FovAxis::Y,
        ..Camera::default()
    });
    Some(Named { name, camera, mover: None, node })
}
