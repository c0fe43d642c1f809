//! What a pose has changed in a scene's arrays.
use super::Scene;
use crate::error::{Error, Result};
use crate::layout::{LIGHT_ENVIRONMENT, Light};
use std::ops::Range;

/// What [`Scene::apply`](super::Scene::apply) has changed, for those who copy it to a device. Every renderer of the scene takes every
/// change, in order: [`Renderer::update`](crate::render::Renderer::update) refuses one that follows another which it was not told of.
#[derive(Clone, Debug, Default)]
pub struct Change {
    /// All that a pose can change, whatever the device has of it: see [`Change::everything`].
    pub everything: bool,
    /// [`Scene::serial`](super::Scene::serial) before and after it; none where nothing has changed, or an engine fills in the rest itself for
    /// arrays that it has edited.
    pub serials: Option<[u64; 2]>,
    /// The camera, which a pose has named.
    pub camera: bool,
    /// Where a camera stands or looks that is to have all of the scene in view. It does not move one that
    /// [`Renderer::set_camera`](crate::render::Renderer::set_camera) has set.
    pub framing: bool,
    /// Parts of [`Scene::nodes`](super::Scene::nodes).
    pub nodes: Vec<Range<usize>>,
    /// Parts of [`Scene::triangles`](super::Scene::triangles) and, where there are any, of the shading records.
    pub triangles: Vec<Range<usize>>,
    /// The instances.
    pub instances: bool,
    /// By the index of an instance in [`Scene::instances`](super::Scene::instances) before, its index now; empty where all keep theirs.
    pub instance_now: Vec<u32>,
    /// The same of triangles.
    pub triangle_now: Vec<u32>,
    /// The materials.
    pub materials: bool,
    /// Parts of [`Scene::texels`](super::Scene::texels), of which there may be more.
    pub texels: Vec<Range<usize>>,
    /// The lights and their table.
    pub lights: bool,
    /// The lights as they were, where they have changed, each with a number that it keeps; ascending.
    pub lights_before: Vec<(u64, Light)>,
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
    /// All that a pose can change in this scene, its camera too. A renderer that it is brought to has the scene as it is, whatever
    /// became of earlier updates, and its next frame begins with no samples of others.
    pub fn everything(scene: &Scene) -> Self {
        let whole = |len: usize| std::iter::once(0..len).collect();
        Self {
            everything: true,
            camera: true,
            nodes: whole(scene.nodes.len()),
            triangles: whole(scene.triangles.len()),
            instances: true,
            materials: true,
            texels: whole(scene.texels.len()),
            lights: true,
            ..Self::default()
        }
    }

    /// Whether nothing but the camera has changed.
    pub fn is_of_camera_alone(&self) -> bool {
        let Self {
            everything,
            serials: _,
            camera: _,
            framing: _,
            nodes,
            triangles,
            instances,
            materials,
            texels,
            lights,
            deformed,
            ..
        } = self;
        let arrays = nodes.is_empty() && triangles.is_empty() && texels.is_empty() && deformed.is_empty();
        arrays && !(*everything || *instances || *materials || *lights) // without these, no numbers are new
    }

    /// Whether the sky shows something else than before in `scene`, to which it has led.
    pub fn changes_sky(&self, scene: &Scene) -> bool {
        let before = self.lights_before.iter().map(|(_, light)| light).find(|l| l.kind == LIGHT_ENVIRONMENT);
        let now = scene.lights.iter().find(|l| l.kind == LIGHT_ENVIRONMENT);
        let shown = |sky: Option<&Light>| sky.map(|sky| (sky.value, [sky.a, sky.b, sky.c]));
        self.lights && shown(before) != shown(now)
    }

    /// Adds what a later pose has changed in the same scene.
    ///
    /// # Errors
    /// [`Error::Usage`] for a change of another scene or one that does not follow this one, which is left as it is.
    pub fn add(&mut self, later: Self) -> Result<()> {
        let serials = joined(self.serials, later.serials)?;
        let instance_now = number(&self.instance_now, later.instance_now)?;
        (self.instance_now, self.triangle_now) = (instance_now, number(&self.triangle_now, later.triangle_now)?);
        self.serials = serials;
        self.everything |= later.everything;
        self.camera |= later.camera;
        self.framing |= later.framing;
        self.nodes.extend(later.nodes);
        self.triangles.extend(later.triangles);
        self.instances |= later.instances;
        self.materials |= later.materials;
        self.texels.extend(later.texels);
        if !self.lights {
            self.lights_before = later.lights_before;
        }
        self.lights |= later.lights;
        self.deformed.extend(later.deformed);
        Ok(())
    }
}

fn not_the_next() -> Error {
    Error::Usage(
        "a change of another scene was added, or one was left out: add all changes of one scene, in their order".into(),
    )
}

/// From the serial number before a change to that after a later one.
fn joined(now: Option<[u64; 2]>, later: Option<[u64; 2]>) -> Result<Option<[u64; 2]>> {
    match (now, later) {
        (Some([_, after]), Some([before, _])) if after != before => Err(not_the_next()),
        (Some([first, _]), Some([_, last])) => Ok(Some([first, last])),
        _ => Ok(now.or(later)),
    }
}

/// A change of numbers, followed by a later one.
fn number(now: &[u32], later: Vec<u32>) -> Result<Vec<u32>> {
    match (now.is_empty(), later.is_empty()) {
        (true, _) => Ok(later),
        (false, true) => Ok(now.to_vec()),
        (false, false) => now.iter().map(|&i| later.get(i as usize).copied().ok_or_else(not_the_next)).collect(),
    }
}

/// By its index before, the index now of each of the same things, which are given in both orders; empty where that is the same.
pub(super) fn numbers(before: &[u32], now: &[u32]) -> Vec<u32> {
    if before == now {
        return Vec::new();
    }
    let mut index_of = vec![0; now.len()];
    (0..).zip(now).for_each(|(index, &thing)| index_of[thing as usize] = index);
    before.iter().map(|&thing| index_of[thing as usize]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_follow_things_through_changes() {
        let [a, b, c] = [[0, 1, 2, 3], [2, 0, 3, 1], [3, 2, 1, 0]];
        assert_eq!(numbers(&a, &b), [1, 3, 0, 2]);
        assert!(numbers(&b, &b).is_empty());
        let change = |from: &[u32], to: &[u32]| Change { instance_now: numbers(from, to), ..Change::default() };
        let mut all = change(&a, &b);
        all.add(change(&b, &b)).unwrap();
        all.add(change(&b, &c)).unwrap();
        assert_eq!(all.instance_now, numbers(&a, &c));
        let mut still = Change::default();
        still.add(change(&b, &c)).unwrap();
        assert_eq!(still.instance_now, numbers(&b, &c));
        let of_another = all.add(change(&[0, 1], &[1, 0])).unwrap_err();
        assert!(of_another.exit_code() == 2 && all.instance_now == numbers(&a, &c), "{of_another}");
    }
}
