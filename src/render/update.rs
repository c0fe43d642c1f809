//! Brings a scene that has changed to the device, within the commands of a frame.
use super::buffers::DeviceScene;
use super::frame;
use super::push::{frame_constants, priority_push};
use super::renderer::{Renderer, called_for, half_updated, lacks_effect};
use super::upload::{parts, whole};
use crate::error::{Error, Result};
use crate::gpu::Recorder;
use crate::layout::{Effect, Effects};
use crate::scene::{Change, Scene, keeps_soft_light_apart, light_and_camera_effects};

impl Renderer {
    /// Records the upload of what a pose has changed: see [`Scene::apply`]. Frames that were recorded before keep the scene as it was,
    /// done or not; what was accumulated belongs to it, so that a [`Step::Start`](super::Step::Start) has to follow, or, where a history is
    /// kept, a [`Step::Reproject`](super::Step::Reproject): samples move with the surfaces that they are of, and stay behind where their light
    /// has changed. That is found by paths traced here and there, two for 16 pixels, of which a change of the camera alone needs none. Of
    /// two updates between frames the second carries nothing: [`Change::add`] makes them one. `scene` is that of [`Renderer::new`] in
    /// another pose. Textures and the picture of the environment stay on the device as they are: edited ones need a new renderer. Other
    /// arrays that were edited by hand are brought by [`Change::everything`], which has them checked; but spheres that are traced by ray
    /// queries need a new renderer.
    ///
    /// Every change has to be brought, in order, or several as one by [`Change::add`]; what an earlier one leaves out is told by
    /// [`Scene::serial`]. [`Change::everything`] makes up for all.
    ///
    /// A camera that [`Renderer::set_camera`] has set stays, until a pose names one, or with [`Change::everything`].
    ///
    /// What is recorded has to be submitted, in this order: later updates bring only what changed since. After a recording that was thrown
    /// away, update with [`Change::everything`].
    ///
    /// Nothing is compiled. Memory is allocated where there is more of something than ever before, such as nodes of a hierarchy or
    /// lights, with room for more, and where more is uploaded than by the last two recordings into the frame.
    ///
    /// # Errors
    /// [`Error::Usage`] with the first effect that the scene calls for now and that was not compiled: make the renderer with it, by
    /// [`Renderer::specialised`]. [`Error::Usage`] also for a recorder of another device, where the scene has changed otherwise than by
    /// `change`, for a camera that cannot be, for a scene of its own whose hierarchy is deeper, such as one that was loaded in another
    /// pose, and for one with another number of triangles, materials or textures or an environment of another size; [`Error::Scene`]
    /// where everything has changed, to what [`Scene::check`] refuses; [`Error::Device`] and [`Error::OutOfDeviceMemory`].
    /// But for the last two, nothing has changed in the renderer then; the scene keeps its pose. To go back, apply the pose before
    /// anew, and update with both changes as one. After [`Error::Device`] and [`Error::OutOfDeviceMemory`], host and device do not agree:
    /// [`Renderer::record`] refuses all steps until an update with [`Change::everything`] has succeeded.
    pub fn update(&mut self, rec: &mut Recorder, scene: &Scene, change: &Change) -> Result<()> {
        rec.gpu().owns("the renderer", &self.gpu)?;
        self.check_told(scene, change)?;
        self.check_parts(scene)?;
        if change.everything {
            scene.check()?;
        }
        self.check_effects(scene, change)?;
        let mut constants = frame_constants(scene, &self.settings)?;
        *self.relabelled.get_mut() = true;
        self.serial = None; // until all of it is recorded
        // Without a fingerprint the camera is not the scene's but one that was set.
        let follows_scene = self.fingerprint.is_some();
        if !(change.camera || change.framing && follows_scene) {
            constants.camera = self.frame.constants.camera;
        }
        if !change.is_of_camera_alone() {
            self.remember(rec, scene, change)?;
        }
        upload(rec, &mut self.frame.scene, scene, change)?;
        self.frame.constants = constants;
        self.frame.priority_push = priority_push(scene, &self.settings);
        self.soft_lights = scene.has_soft_lights();
        if change.camera || self.fingerprint.is_some() {
            self.fingerprint = Some(scene.fingerprint(self.settings.size())?);
        }
        self.serial = Some(scene.serial());
        Ok(())
    }

    /// Whether the renderer knows all that has changed in the scene once it knows of `change`.
    fn check_told(&self, scene: &Scene, change: &Change) -> Result<()> {
        let now = scene.serial();
        let knows = |serial: u64| serial == now || change.serials == Some([serial, now]);
        match self.serial {
            _ if change.everything => Ok(()),
            Some(serial) if knows(serial) => Ok(()),
            Some(_) => Err(Error::Usage(
                "the scene has changed otherwise than this change says: bring all changes to every renderer, in their order (Change::add \
                 makes several one), or update once with Change::everything"
                    .into(),
            )),
            None => Err(half_updated()),
        }
    }

    /// Before the scene changes: what frames that begin with samples of the last need of it as it was.
    fn remember(&mut self, rec: &mut Recorder, scene: &Scene, change: &Change) -> Result<()> {
        let Some(history) = &mut self.frame.history else { return Ok(()) };
        if change.everything {
            history.forget(); // what the device has may be nothing that paths can be traced in
            return Ok(());
        }
        if history.has_changed() {
            return rec.fill(&history.offered, 0); // nothing is handed on
        }
        history.note(rec, scene, change, &self.frame.constants.path, self.settings.first_sample)?;
        frame::record_change(rec, &self.frame)
    }

    /// Whether the scene fits what was compiled and allocated: kernels follow its indices unchecked.
    fn check_parts(&self, scene: &Scene) -> Result<()> {
        if scene.stack > self.stack {
            let (needs, has) = (scene.stack, self.stack);
            return Err(Error::Usage(format!(
                "the scene's hierarchy needs a stack of {needs}, and this renderer was made for another scene, with one of {has}: \
                 make a new renderer, or apply the pose to the scene that it was made for"
            )));
        }
        self.frame.scene.check_parts(scene)
    }

    fn check_effects(&self, scene: &Scene, change: &Change) -> Result<()> {
        // Whether surfaces call for something takes a look at all of them.
        let called = if change.materials || !change.triangles.is_empty() {
            called_for(scene, &self.settings, self.outputs)
        } else {
            light_and_camera_effects(scene)
        };
        // Where light is not split, what is soft of it makes no difference.
        let soft_light = self.effects.split_light && keeps_soft_light_apart(scene, &self.settings);
        let called = Effects { split_light: false, soft_light, ..called };
        let lacks = |(_, (calls, has)): &(&Effect, (bool, bool))| *calls && !has;
        let both = called.switches().into_iter().zip(self.effects.switches());
        match Effect::ALL.iter().zip(both).find(lacks) {
            Some((&effect, _)) => Err(lacks_effect(effect)),
            None => Ok(()),
        }
    }
}

fn upload(rec: &mut Recorder, to: &mut DeviceScene, scene: &Scene, change: &Change) -> Result<()> {
    // A top level has at most as many nodes as it has instances; the rest of the nodes only changes when a mesh is built anew.
    let spare = scene.instances.len();
    parts(rec, &mut to.nodes, &scene.nodes, &change.nodes, spare)?;
    parts(rec, &mut to.triangles, &scene.triangles, &change.triangles, 0)?;
    // Kernels that read no shading have none of it, and others what the scene has.
    if !scene.shading.is_empty() && to.shading.len() == scene.triangles.len() {
        parts(rec, &mut to.shading, &scene.shading, &change.triangles, 0)?;
    }
    if change.instances {
        whole(rec, &mut to.instances, &scene.instances)?;
    }
    if change.materials {
        whole(rec, &mut to.materials, &scene.materials)?;
    }
    parts(rec, &mut to.texels, &scene.texels, &change.texels, 0)?;
    if let Some(world) = &to.world {
        world.update(rec, scene, &to.triangles, change)?;
    }
    if change.lights {
        whole(rec, &mut to.lights, &scene.lights)?;
        whole(rec, &mut to.light_table, &scene.light_table)?;
        whole(rec, &mut to.light_nodes, &scene.light_nodes)?;
    }
    Ok(())
}
