//! Cameras of nodes become `[camera]` tables, and films of their shape.
use super::asset::{Asset, one_line};
use crate::scene::MAX_COORDINATE;
use crate::scene::animation::Mover;
use crate::scene::description::settings::Settings;
use crate::scene::description::{Camera, Film, FovAxis};
use glam::{DAffine3, DMat4};
use gltf_json::camera::Type;
use gltf_json::validation::Checked;
use std::ops::RangeInclusive;
use std::sync::Arc;

/// A camera of the scene.
#[derive(Clone, Debug)]
pub struct Named {
    /// The camera's own name, else its node's, else `camera N`.
    pub name: String,
    /// Its table.
    pub camera: Camera,
    /// The film that has its shape.
    pub film: Film,
    /// What moves it.
    pub mover: Option<Arc<dyn Mover>>,
    /// The node that holds it.
    pub(super) node: usize,
}

/// The shapes that films may have, width over height.
const SHAPES: RangeInclusive<f32> = 0.125..=8.0;

/// The camera that `node` holds, placed by [`super::node::Tree::views`]: it looks along the node's -z axis, +y is up. A shape that no film should have is left to the defaults, and so is, with a warning, what no camera can see.
pub fn of_node(asset: &Asset, node: usize, view: &DAffine3, warnings: &mut Vec<String>) -> Option<Named> {
    let holder = &asset.root.nodes[node];
    let index = holder.camera?.value();
    let camera = &asset.root.cameras[index];
    let named = camera.name.as_ref().or(holder.name.as_ref()).filter(|name| !name.is_empty());
    let name = named.map_or_else(|| format!("camera {index}"), |name| one_line(name));
    let mut table = Camera {
        world_from_camera: Some(DMat4::from(*view).transpose().to_cols_array()),
        fov_axis: FovAxis::Y,
        ..Camera::default()
    };
    let shape = match (&camera.type_, &camera.orthographic, &camera.perspective) {
        (Checked::Valid(Type::Orthographic), Some(flat), _) => {
            let height = 2.0 * f64::from(flat.ymag.abs());
            table.orthographic = Some(height).filter(|h| *h > 0.0 && *h <= MAX_COORDINATE);
            Some((flat.xmag / flat.ymag).abs())
        }
        (_, _, Some(perspective)) => {
            let fov = f64::from(perspective.yfov).to_degrees();
            table.fov = Some(fov).filter(|fov| *fov > 0.0 && *fov < 180.0);
            perspective.aspect_ratio
        }
        _ => None,
    };
    if table.fov.is_none() && table.orthographic.is_none() {
        let what = "has neither a yfov between 0 and pi nor a ymag: it sees 40 degrees";
        warnings.push(format!("camera \"{name}\": {what}"));
    }
    let mut film = Film::default();
    if let Some(shape) = shape.filter(|shape| SHAPES.contains(shape)) {
        let Settings { height, .. } = Settings::default();
        (film.width, film.height) = (Some((height as f32 * shape).round() as u32), Some(height));
    }
    Some(Named { name, camera: table, film, mover: None, node })
}
