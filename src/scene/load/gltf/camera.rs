//! Cameras of nodes become `[camera]` tables.
use super::asset::{Asset, one_line};
use crate::scene::MAX_COORDINATE;
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
    /// Its table.
    pub camera: Camera,
    /// What moves it.
    pub mover: Option<Arc<dyn Mover>>,
    /// The node that holds it.
    pub(super) node: usize,
}

/// The camera that `node` holds, placed by `world`: it looks along the node's -z axis, +y is up. The scale of nodes does not
/// count. The film's own shape counts, not that of the file. Numbers that no camera can have are left to the defaults.
pub fn of_node(asset: &Asset, node: usize, world: &DAffine3) -> Option<Named> {
    let holder = &asset.root.nodes[node];
    let index = holder.camera?.value();
    let camera = &asset.root.cameras[index];
    let named = camera.name.as_ref().or(holder.name.as_ref()).filter(|name| !name.is_empty());
    let name = named.map_or_else(|| format!("camera {index}"), |name| one_line(name));
    let table = Camera {
        world_from_camera: Some(DMat4::from(*world).transpose().to_cols_array()),
        fov_axis: FovAxis::Y,
        ..Camera::default()
    };
    let camera = match (&camera.type_, &camera.orthographic, &camera.perspective) {
        (Checked::Valid(Type::Orthographic), Some(flat), _) => {
            let height = 2.0 * f64::from(flat.ymag.abs());
            Camera { orthographic: Some(height).filter(|h| *h > 0.0 && *h <= MAX_COORDINATE), ..table }
        }
        (_, _, Some(perspective)) => {
            let fov = f64::from(perspective.yfov).to_degrees();
            Camera { fov: Some(fov).filter(|fov| *fov > 0.0 && *fov < 180.0), ..table }
        }
        _ => table,
    };
    Some(Named { name, camera, mover: None, node })
}
