//! Checks that a scene's arrays fit together. Kernels follow indices unchecked; loaded scenes have valid ones, but callers may
//! edit the arrays.
use super::build::attributes::words_of;
use super::build::bvh;
use super::build::coat::reads_table;
use super::{Environment, MAX_COORDINATE, Scene};
use crate::error::{Checked, Error, Result};
use crate::layout::{
    AliasEntry, BvhNode, COAT_COLUMNS, COAT_ROWS, Camera, LIGHT_LEAF, LightNode, Material, NONE, SPHERE, Shading,
    TRAVERSAL_STACK, Texture, Triangle,
};
use crate::shaders::shared::light_tree::CHILDREN;
use glam::Vec3;

/// The kind of tree that a node belongs to, if any.
#[derive(Clone, Copy, PartialEq)]
enum Level {
    Unreached,
    /// A node of the top level, whose leaves are instances.
    Top,
    /// A node of a mesh, whose leaves are triangles.
    Mesh,
}

impl Scene {
    /// Checks that every index lies within its array, that nodes form trees which [`Scene::stack`] is deep enough for, and that
    /// parallel arrays have the same length. It takes time linear in their sizes; making a
    /// [`Renderer`](crate::render::Renderer) calls it.
    ///
    /// # Errors
    /// [`Error::Scene`] with the first thing that does not fit.
    pub fn check(&self) -> Result<()> {
        self.nodes_fit()
            .and_then(|()| self.surfaces_fit())
            .and_then(|()| self.textures_fit())
            .and_then(|()| self.lights_fit())
            .map_err(Error::Scene)
    }

    fn nodes_fit(&self) -> Checked {
        let top = if self.instances.is_empty() { Level::Mesh } else { Level::Top };
        let mut levels = vec![Level::Unreached; self.nodes.len()];
        below("root", "node", self.nodes.len(), [self.root])?;
        levels[self.root as usize] = top;
        below("instance", "root", self.nodes.len(), self.instances.iter().map(|i| i.root))?;
        for (index, instance) in self.instances.iter().enumerate() {
            match &mut levels[instance.root as usize] {
                Level::Top => return Err(format!("instance {index} has the scene's root")),
                level => *level = Level::Mesh,
            }
        }
        // A node's children come after it, so that one pass finds all levels and there are no cycles.
        for (index, node) in self.nodes.iter().enumerate() {
            let leaves = match levels[index] {
                Level::Unreached => continue,
                Level::Top => self.instances.len(),
                Level::Mesh => self.triangles.len(),
            };
            self.node_fits(index, node, leaves, &mut levels).map_err(|what| format!("node {index} {what}"))?;
        }
        self.stack_fits()
    }

    fn node_fits(&self, index: usize, node: &BvhNode, leaves: usize, levels: &mut [Level]) -> Checked {
        let inner = node.e_imask >> 24;
        let meta: [u8; 8] = bytemuck::cast(node.meta);
        for (slot, meta) in (0u8..).zip(meta) {
            let fits = match (inner >> slot & 1, meta >> 5, meta & 31) {
                (1, count, place) => count == 1 && place == 24 + slot,
                (_, 0, place) => place == 0,
                (_, unary, first) => {
                    let count = unary.count_ones();
                    let end = u64::from(node.primitive_base) + u64::from(first) + u64::from(count);
                    [1, 3, 7].contains(&unary) && u32::from(first) + count <= 24 && end <= leaves as u64
                }
            };
            if !fits {
                return Err(format!("has a child {slot} that leads nowhere"));
            }
        }
        let children = node.child_base as usize..node.child_base as usize + inner.count_ones() as usize;
        if inner != 0 && (children.start <= index || children.end > levels.len()) {
            return Err(format!("has the children {children:?}, which must come after it, of {} nodes", levels.len()));
        }
        let level = levels[index];
        for child in children.filter(|_| inner != 0) {
            if levels[child] != Level::Unreached {
                return Err(format!("has the child {child}, which is another's or a root"));
            }
            levels[child] = level;
        }
        Ok(())
    }

    fn stack_fits(&self) -> Checked {
        let needed = bvh::stack_size(&self.nodes, self.root, &self.instances);
        match (needed..=TRAVERSAL_STACK).contains(&self.stack) {
            true => Ok(()),
            false => {
                Err(format!("stack is {}: its nodes need {needed}, and {TRAVERSAL_STACK} is the most", self.stack))
            }
        }
    }

    fn surfaces_fit(&self) -> Checked {
        let triangles = self.triangles.len();
        if ![0, triangles].contains(&self.shading.len()) {
            return Err(format!("there are {} records of shading for {triangles} triangles", self.shading.len()));
        }
        let words = self.texels.len() as u64;
        let past = |s: &Shading| s.attributes != 0 && u64::from(s.first) + u64::from(words_of(s.attributes)) > words;
        if let Some(index) = self.shading.iter().position(past) {
            return Err(format!("the attributes of triangle {index} end beyond the {words} texels"));
        }
        let materials = self.materials.len();
        below("triangle", "material", materials, self.triangles.iter().map(|t| t.material))?;
        if let Some(index) = self.triangles.iter().position(|t| t.primitive & SPHERE != 0 && !is_sphere(t)) {
            return Err(format!("sphere {index} needs a centre, and a pole and a meridian as long as its radius"));
        }
        below_or_none("instance", "material", materials, self.instances.iter().map(|i| i.material))
    }

    fn textures_fit(&self) -> Checked {
        let all = self.textures.len();
        for (index, material) in self.materials.iter().enumerate() {
            let maps = material.textures().map(|(_, map)| map);
            below("map", "texture", all, maps).map_err(|what| format!("material {index}: {what}"))?;
        }
        let texels = self.texels.len() as u64;
        let table = u64::from(COAT_ROWS * COAT_COLUMNS);
        let lacks_table = |m: &Material| reads_table(m) && u64::from(m.coat_table) + table > texels;
        if let Some(index) = self.materials.iter().position(lacks_table) {
            return Err(format!("material {index}: its table of reflectance ends beyond the {texels} texels"));
        }
        let past = |t: &Texture| {
            let end = u64::from(t.first).checked_add(u64::from(t.width) * u64::from(t.height));
            t.width == 0 || t.height == 0 || end.is_none_or(|end| end > texels)
        };
        match self.textures.iter().position(past) {
            Some(index) => Err(format!("texture {index} is empty or ends beyond the {texels} texels")),
            None => Ok(()),
        }
    }

    fn lights_fit(&self) -> Checked {
        if let Some(index) = self.lights.iter().position(|light| light.effect().is_none()) {
            return Err(format!("light {index}: its kind {} is none of the LIGHT_ constants", self.lights[index].kind));
        }
        for (index, light) in self.lights.iter().enumerate().filter(|(_, light)| light.has_surface()) {
            let of = |what| format!("light {index}: {what}");
            below("it", "triangle", self.triangles.len(), [light.triangle]).map_err(of)?;
            below("it", "material", self.materials.len(), [light.material]).map_err(of)?;
        }
        table_fits("light_table", &self.light_table, self.lights.len())?;
        self.light_tree_fits()?;
        self.environment.as_ref().map_or(Ok(()), environment_fits)
    }

    /// Children lie behind their parents, so that every way down ends.
    fn light_tree_fits(&self) -> Checked {
        let count = self.light_nodes.len();
        let lights = self.light_nodes.iter().filter(|n| n.child & LIGHT_LEAF != 0 && n.power > 0.0);
        below("node of lights", "light", self.lights.len(), lights.map(|n| n.child & !LIGHT_LEAF))?;
        let inner = self.light_nodes.iter().enumerate().filter(|(_, n)| n.child & LIGHT_LEAF == 0);
        let lost =
            |&(i, n): &(usize, &LightNode)| n.child as usize <= i || n.child as usize + CHILDREN as usize > count;
        // A root without lights below it has no children.
        match inner.filter(|(_, n)| n.power > 0.0).find(lost) {
            Some((index, node)) => Err(format!("node {index} of lights names children {} of {count}", node.child)),
            None => Ok(()),
        }
    }
}

fn is_sphere(t: &Triangle) -> bool {
    let [centre, pole, meridian] = [t.v0, t.v1, t.v2].map(Vec3::from);
    let radius = pole.length();
    let alike = (meridian.length() - radius).abs() <= 1e-3 * radius;
    centre.is_finite() && radius.is_finite() && radius > 0.0 && alike
}

fn environment_fits(sky: &Environment) -> Checked {
    let Environment { width, height, texels, table } = sky;
    if u64::from(*width) * u64::from(*height) != texels.len() as u64 || texels.is_empty() {
        return Err(format!("the environment of {width} x {height} has {} texels", texels.len()));
    }
    table_fits("the environment's table", table, texels.len())
}

fn table_fits(name: &str, table: &[AliasEntry], entries: usize) -> Checked {
    if table.len() != entries {
        return Err(format!("{name} has {} entries for {entries}", table.len()));
    }
    below(&format!("entry of {name}"), "alias", entries, table.iter().map(|entry| entry.alias))
}

/// Checks that all of `indices`, which belong to `which` in order, are below `count`.
fn below(which: &str, what: &str, count: usize, indices: impl IntoIterator<Item = u32>) -> Checked {
    fit(which, what, count, indices, |index| (index as usize) < count)
}

/// The same where [`NONE`] is allowed.
fn below_or_none(which: &str, what: &str, count: usize, indices: impl IntoIterator<Item = u32>) -> Checked {
    fit(which, what, count, indices, |index| index == NONE || (index as usize) < count)
}

fn fit(
    which: &str,
    what: &str,
    count: usize,
    indices: impl IntoIterator<Item = u32>,
    fits: impl Fn(u32) -> bool,
) -> Checked {
    match indices.into_iter().enumerate().find(|(_, index)| !fits(*index)) {
        Some((at, index)) => Err(format!("{which} {at} names {what} {index} of {count}")),
        None => Ok(()),
    }
}

/// By how much the length of a camera's `forward` may differ from 1.
const UNIT: f32 = 1e-3;

/// Least volume, of axes of length 1, of a camera's axes: below, they lie in one plane up to rounding.
const LEAST_VOLUME: f64 = 1e-6;

/// Checks that rays can leave a camera: its numbers are finite, lengths and coordinates at most 1e12, `forward` is a unit vector, its axes
/// span space, and no length is negative.
///
/// # Errors
/// [`Error::Usage`].
pub fn check_camera(camera: &Camera) -> Result<()> {
    let numbers: &[f32] = bytemuck::cast_slice(std::slice::from_ref(camera));
    let [right, up, forward] = [camera.right, camera.up, camera.forward].map(|axis| Vec3::from(axis).as_dvec3());
    let volume = right.normalize_or_zero().cross(up.normalize_or_zero()).dot(forward);
    let needs = match camera {
        _ if !numbers.iter().all(|number| number.is_finite()) => "finite numbers alone",
        _ if (forward.length() - 1.0).abs() > f64::from(UNIT) => "a unit vector as forward",
        _ if volume.abs() < LEAST_VOLUME => "right, up and forward that lie in no plane",
        Camera { position: [x, y, z], lens_radius, near, focus_distance, .. }
            if [x, y, z, lens_radius, near, focus_distance].iter().any(|v| v.abs() > MAX_COORDINATE as f32) =>
        {
            "coordinates and lengths of at most 1e12"
        }
        Camera { lens_radius, near, .. } if lens_radius.min(*near) < 0.0 => "a lens_radius and near of at least 0",
        Camera { lens_radius, focus_distance, .. } if *lens_radius > 0.0 && *focus_distance <= 0.0 => {
            "a focus_distance above 0 to a lens"
        }
        _ => return Ok(()),
    };
    Err(Error::Usage(format!("camera: give {needs}, not {camera:?}")))
}
