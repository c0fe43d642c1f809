//! What the animations of a file move: nodes move each other, and with them instances, lights, cameras and the joints of skins.
use super::clip::Channel;
use super::deform::{Skin, deformed};
use super::light;
use super::node::{Local, Tree};
use super::primitive::Primitive;
use crate::error::Result;
use crate::scene::animation::{Keyed, Mover, time::hull};
use crate::scene::description::{Camera, LightTable, Mesh, Transform};
use crate::scene::pose::{Pose, Vertices};
use glam::{DAffine3, DMat4};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// An instance that a node moves.
#[derive(Clone, Copy, Debug)]
pub struct MovedInstance {
    /// Number of its `[[instance]]` table.
    pub number: usize,
    /// The node.
    pub node: usize,
    /// Where it is, seen from the node.
    pub own: DAffine3,
}

/// A mesh whose vertices move.
#[derive(Debug)]
pub struct MovedMesh {
    /// Number of its `[[mesh]]` table.
    pub number: usize,
    /// The node that shows it, which may have weights of morph targets.
    pub node: usize,
    /// The mesh at rest.
    pub primitive: Arc<Primitive>,
    /// The joints that move it.
    pub skin: Option<Arc<Skin>>,
    /// Weights of its morph targets where no animation says otherwise.
    pub weights: Vec<f32>,
}

/// A light that a node moves.
#[derive(Clone, Debug)]
pub struct MovedLight {
    /// Number of its `[[light]]` table.
    pub number: usize,
    /// The node.
    pub node: usize,
    /// Its table at rest.
    pub table: LightTable,
}

/// All that moves.
#[derive(Debug)]
pub struct Motion {
    /// The nodes at rest.
    pub tree: Tree,
    /// What moves them.
    pub channels: Vec<Channel>,
    /// Keys of the scene file, which move nodes after that.
    pub keyed: Vec<(usize, Keyed)>,
    /// What they move.
    pub instances: Vec<MovedInstance>,
    /// What they move.
    pub meshes: Vec<MovedMesh>,
    /// What they move.
    pub lights: Vec<MovedLight>,
}

impl Motion {
    /// World transforms of all nodes at a time.
    fn worlds(&self, seconds: f64) -> Vec<DAffine3> {
        self.tree.worlds(&self.locals(seconds))
    }

    /// The same of each relative to its parent.
    fn locals(&self, seconds: f64) -> Vec<Local> {
        let mut locals = self.tree.locals.clone();
        self.channels.iter().for_each(|channel| channel.apply(seconds, &mut locals));
        for (node, keys) in &self.keyed {
            locals[*node] = keys.place(&locals[*node].transform(), seconds).into();
        }
        locals
    }
}

impl Mover for Motion {
    fn pose(&self, seconds: f64, pose: &mut Pose) -> Result<()> {
        let worlds = self.worlds(seconds);
        let morphs = self.channels.iter().filter(|channel| channel.is_morph());
        let weights: HashMap<_, _> = morphs.map(|channel| (channel.node, channel.weights(seconds))).collect();
        pose.instances.extend(self.instances.iter().map(|i| (i.number, Transform::from(worlds[i.node] * i.own))));
        pose.lights.extend(self.lights.iter().map(|l| (l.number, light::placed(&l.table, &worlds[l.node]))));
        for moved in &self.meshes {
            let matrices = moved.skin.as_ref().map(|skin| skin.matrices(&worlds));
            let weights = weights.get(&moved.node).unwrap_or(&moved.weights);
            let mesh = deformed(&moved.primitive, weights, matrices.as_deref());
            let Mesh { positions, normals, tangents, .. } = mesh;
            pose.meshes.push((moved.number, Vertices { positions, normals, tangents, indices: Vec::new() }));
        }
        Ok(())
    }

    fn end(&self) -> f64 {
        let ends = self.channels.iter().map(Channel::end).chain(self.keyed.iter().map(|(_, keys)| keys.end()));
        ends.fold(0.0, f64::max)
    }

    fn moving(&self) -> Option<Range<f64>> {
        let keyed = self.keyed.iter().filter_map(|(_, keys)| keys.moving());
        hull(self.channels.iter().filter_map(Channel::moving).chain(keyed))
    }
}

/// A camera that a node moves.
#[derive(Debug)]
pub struct CameraMotion {
    /// What moves the nodes.
    pub motion: Arc<Motion>,
    /// The node that holds the camera.
    pub node: usize,
    /// The camera at rest.
    pub camera: Camera,
}

impl Mover for CameraMotion {
    fn pose(&self, seconds: f64, pose: &mut Pose) -> Result<()> {
        let view = self.motion.tree.views(&self.motion.locals(seconds))[self.node];
        let rows = Some(DMat4::from(view).transpose().to_cols_array());
        pose.camera = Some(Camera { world_from_camera: rows, ..self.camera.clone() });
        Ok(())
    }

    fn end(&self) -> f64 {
        self.motion.end()
    }

    fn moving(&self) -> Option<Range<f64>> {
        self.motion.moving()
    }
}
