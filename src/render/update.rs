//! Brings a scene that has changed to the device, within the commands of a frame.
use super::buffers::DeviceScene;
use super::push::{frame_constants, priority_push};
use super::renderer::{Renderer, called_for};
use crate::error::{Error, Result};
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::layout::{Effect, Effects};
use crate::scene::{Change, Scene, light_effects};
use bytemuck::Pod;
use std::ops::Range;

impl Renderer {
    /// Records the upload of what a pose has changed: see [`Scene::apply`]. Frames that were recorded before keep the scene as it was,
    /// done or not; what was accumulated belongs to it, so that a [`Step::Start`](super::Step::Start) has to follow. A
    /// [`Step::Reproject`](super::Step::Reproject) may follow in its place: it carries nothing unless the camera alone has changed, since light
    /// and the numbers of triangles may have. `scene` is
    /// that of [`Renderer::new`] in another pose.
    ///
    /// Nothing is compiled. Memory is allocated where there is more of something than ever before, such as nodes of a hierarchy or
    /// lights, with room for more.
    ///
    /// # Errors
    /// [`Error::Usage`] with the first effect that the scene calls for now and that was not compiled: make the renderer with it, by
    /// [`Renderer::specialised`]. Nothing has changed then. [`Error::Device`]; [`Error::Scene`] for a camera that cannot be.
    pub fn update(&mut self, rec: &mut Recorder, scene: &Scene, change: &Change) -> Result<()> {
        self.check_effects(scene, change)?;
        if scene.stack > self.stack {
            let (needs, has) = (scene.stack, self.stack);
            return Err(Error::Usage(format!(
                "this renderer was made for a stack of {has}, and the scene needs {needs}"
            )));
        }
        let mut constants = frame_constants(scene, &self.settings)?;
        if !change.camera {
            constants.camera = self.frame.constants.camera;
        }
        let gpu = self.gpu.clone();
        upload(&gpu, rec, &mut self.frame.scene, scene, change)?;
        if self.frame.history.is_some() && !change.is_of_camera_alone() {
            rec.fill(&self.frame.film.tiles[0].stats, 0)?; // pixels without samples hand on none
        }
        self.frame.constants = constants;
        self.frame.priority_push = priority_push(scene, &self.settings);
        self.delta_lights = scene.has_delta_lights();
        let size = [self.settings.width, self.settings.height];
        if change.camera || self.fingerprint.is_some() {
            self.fingerprint = Some(scene.fingerprint(size)?);
        }
        Ok(())
    }

    fn check_effects(&self, scene: &Scene, change: &Change) -> Result<()> {
        // Whether surfaces call for something takes a look at all of them.
        let called = match change.materials || !change.triangles.is_empty() {
            true => called_for(scene, &self.settings, self.outputs),
            false => light_effects(scene),
        };
        let called = Effects { split_light: false, ..called };
        let lacks = |(_, (calls, has)): &(&Effect, (bool, bool))| *calls && !has;
        let both = called.switches().into_iter().zip(self.effects.switches());
        match Effect::ALL.iter().zip(both).find(lacks) {
            Some((effect, _)) => Err(Error::Usage(format!(
                "this renderer was made without the effect \"{}\", which the scene calls for now: ask \
                 Renderer::specialised for it",
                effect.name()
            ))),
            None => Ok(()),
        }
    }
}

fn upload(gpu: &Gpu, rec: &mut Recorder, to: &mut DeviceScene, scene: &Scene, change: &Change) -> Result<()> {
    // A top level has at most as many nodes as it has instances; the rest of the nodes only changes when a mesh is built anew.
    let spare = scene.instances.len();
    parts(gpu, rec, "nodes", &mut to.nodes, &scene.nodes, &change.nodes, spare)?;
    parts(gpu, rec, "triangles", &mut to.triangles, &scene.triangles, &change.triangles, 0)?;
    // Kernels that read no shading have none of it, and others what the scene has.
    if !scene.shading.is_empty() && to.shading.len() == scene.triangles.len() {
        parts(gpu, rec, "shading", &mut to.shading, &scene.shading, &change.triangles, 0)?;
    }
    if change.instances {
        whole(gpu, rec, "instances", &mut to.instances, &scene.instances)?;
    }
    if change.materials {
        whole(gpu, rec, "materials", &mut to.materials, &scene.materials)?;
    }
    parts(gpu, rec, "texels of textures", &mut to.texels, &scene.texels, &change.texels, 0)?;
    if change.lights {
        whole(gpu, rec, "lights", &mut to.lights, &scene.lights)?;
        whole(gpu, rec, "light_table", &mut to.light_table, &scene.light_table)?;
    }
    Ok(())
}

fn whole<T: Pod>(gpu: &Gpu, rec: &mut Recorder, name: &str, to: &mut Buffer<T>, values: &[T]) -> Result<()> {
    parts(gpu, rec, name, to, values, std::slice::from_ref(&(0..values.len())), values.len() / 4)
}

/// Uploads the parts of an array that changed, or all of it where it has outgrown its buffer: to a new one with room for `spare`
/// more. Frames in flight keep the old one.
fn parts<T: Pod>(
    gpu: &Gpu,
    rec: &mut Recorder,
    name: &str,
    to: &mut Buffer<T>,
    values: &[T],
    changed: &[Range<usize>],
    spare: usize,
) -> Result<()> {
    if changed.is_empty() {
        return Ok(());
    }
    if values.len() > to.len() {
        *to = Buffer::for_texels(gpu, name, values.len() + spare)?;
        return rec.upload(to, &[(0, values)]);
    }
    let parts = joined(changed, values.len());
    rec.upload(to, &parts.into_iter().map(|range| (range.start, &values[range])).collect::<Vec<_>>())
}

/// Sorted ranges that do not overlap, within an array of so many elements.
fn joined(ranges: &[Range<usize>], len: usize) -> Vec<Range<usize>> {
    let mut sorted: Vec<_> = ranges.iter().map(|r| r.start.min(len)..r.end.min(len)).collect();
    sorted.sort_unstable_by_key(|range| range.start);
    let mut joined: Vec<Range<usize>> = Vec::new();
    for range in sorted {
        match joined.last_mut().filter(|last| range.start <= last.end) {
            Some(last) => last.end = last.end.max(range.end),
            None => joined.push(range),
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::joined;

    #[test]
    fn parts_do_not_overlap() {
        assert_eq!(joined(&[5..9, 0..2, 2..3, 6..12, 20..30], 10), [0..3, 5..10]);
    }
}
