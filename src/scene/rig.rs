//! What can move in a scene: what is kept of its description so that a [`Pose`](super::Pose) finds it.
use super::Scene;
use super::build::brightness::Reduced;
use super::build::bvh::Bounds;
use super::build::coat::reads_table;
use super::build::soft::Soft;
use super::description::Description;
use super::fingerprint::Fingerprint;
use crate::error::{Error, Result};
use crate::layout::{Instance, Light, Material, NONE, Triangle};
use glam::DAffine3;
use std::collections::{HashMap, HashSet};
use std::ops::Range;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

/// What can move in a scene, by the names and numbers that its description gives. A scene that was not loaded or built has
/// nothing of it.
#[derive(Clone, Debug, Default)]
pub struct Rig {
    /// World space, where anything is in it, and the meshes that instances place.
    pub(in crate::scene) trees: Vec<Tree>,
    /// The numbers of the copies in the order of [`Scene::instances`]; copies are numbered tree by tree.
    pub(in crate::scene) order: Vec<u32>,
    /// By copy, its tree.
    pub(in crate::scene) tree_of: Vec<u32>,
    /// Of copies that do not place a mesh as it is stored, what comes before their transform.
    pub(in crate::scene) own: HashMap<u32, DAffine3>,
    /// Copies that are not seen: `flat` ones, and those that are too small in this pose.
    pub(in crate::scene) hidden: HashSet<u32>,
    /// Copies whose transform has no inverse. They have no other one until a pose places them again.
    pub(in crate::scene) flat: HashSet<u32>,
    /// Which of the states of all scenes of this process the scene is in: see [`Scene::serial`].
    pub(in crate::scene) serial: u64,
    /// Copies by the numbers that a pose calls them; [`NONE`] for one that is fixed.
    pub(in crate::scene) placed: Vec<u32>,
    /// Levels of the top and of the deepest tree, which kernels are compiled for.
    pub(in crate::scene) levels: [usize; 2],
    /// Lights without surface; the environment is the last.
    pub(in crate::scene) lights: Vec<Light>,
    /// Numbers of [`Scene::lights`] that no pose changes, ascending.
    pub(in crate::scene) light_numbers: Vec<u64>,
    /// Mean luminance of the environment's image, or 1.
    pub(in crate::scene) sky: f64,
    /// Share of its light that its small bright parts have beyond what is around them.
    pub(in crate::scene) sky_peaks: f64,
    /// [`Material::emission_weight`] is counted in 2 to the power of minus this.
    pub(in crate::scene) dimness: i32,
    /// Mean colours of pictures that emit or mask, by `texture::mean_key`.
    pub(in crate::scene) means: HashMap<(u32, u32), [f32; 3]>,
    /// Smaller forms of the large ones of them.
    pub(in crate::scene) reduced: HashMap<(u32, u32), Reduced>,
    /// Materials that have a table of their coat.
    pub(in crate::scene) tabled: HashSet<u32>,
    /// Fingerprint of the scene as it was loaded.
    pub(in crate::scene) content: Fingerprint,
    /// Of that, what poses change.
    pub(in crate::scene) rest: Fingerprint,
    placements: HashMap<String, usize>,
    moving: HashMap<String, usize>,
    lamps: HashMap<String, usize>,
}

/// A hierarchy over triangles.
#[derive(Clone, Debug)]
pub(in crate::scene) struct Tree {
    /// Number of its `[[mesh]]`; `None`: world space.
    pub mesh: Option<usize>,
    /// Its nodes: the root is the first, and some at the end may be unused.
    pub nodes: Range<usize>,
    /// Its triangles.
    pub range: Range<usize>,
    /// What they reach.
    pub bounds: Bounds,
    /// Those that emit light, in an order that does not depend on where the hierarchy has them if it may be built again.
    pub lit: Vec<u32>,
    /// What it takes to deform it.
    pub soft: Option<Soft>,
}

impl Tree {
    /// Its triangles, in an order as that of `lit`.
    pub fn whole(&self) -> impl Iterator<Item = usize> {
        let mut all: Vec<_> = self.range.clone().collect();
        if let Some(soft) = &self.soft {
            all.sort_unstable_by_key(|i| soft.order[i - self.range.start]);
        }
        all.into_iter()
    }

    /// The number of a triangle that no pose changes.
    pub fn number_of(&self, index: u32) -> u32 {
        let first = self.range.start as u32;
        self.soft.as_ref().map_or(index, |soft| first + soft.order[(index - first) as usize])
    }

    /// Finds the triangles that emit, given those of the scene.
    pub fn list_lit(&mut self, triangles: &[Triangle], materials: &[Material]) {
        let lit = |&i: &usize| materials[triangles[i].material as usize].emission_weight > 0.0;
        self.lit = self.range.clone().filter(lit).map(|i| i as u32).collect();
        if let Some(soft) = &self.soft {
            self.lit.sort_unstable_by_key(|&i| soft.order[i as usize - self.range.start]);
        }
    }
}

impl Scene {
    /// The triangles of each hierarchy over triangles: of a scene of one level, all of them.
    pub fn meshes(&self) -> Vec<Range<usize>> {
        let whole = || Some(0..self.triangles.len()).filter(|all| !all.is_empty());
        match self.rig.trees.is_empty() {
            true => whole().into_iter().collect(),
            false => self.rig.trees.iter().map(|tree| tree.range.clone()).filter(|range| !range.is_empty()).collect(),
        }
    }

    /// The mesh that each instance places, as its number among [`Scene::meshes`].
    ///
    /// # Errors
    /// [`Error::Scene`] for one that leads to none.
    pub fn meshes_of_instances(&self) -> Result<Vec<usize>> {
        let trees = self.rig.trees.iter().filter(|tree| !tree.range.is_empty());
        let mesh_at: HashMap<usize, usize> = trees.map(|tree| tree.nodes.start).zip(0..).collect();
        let lost = |i: usize, root: u32| Error::Scene(format!("instance {i}: no mesh begins at node {root}"));
        let mesh_of = |(i, instance): (usize, &Instance)| {
            mesh_at.get(&(instance.root as usize)).copied().ok_or_else(|| lost(i, instance.root))
        };
        self.instances.iter().enumerate().map(mesh_of).collect()
    }

    /// The number of the state that the scene is in: a new one where it is loaded, and after each [`Scene::apply`] that has changed
    /// something. No two scenes that were loaded in a process have the same number but by a clone. Arrays that are edited by hand keep it.
    pub fn serial(&self) -> u64 {
        self.rig.serial
    }

    /// How many instances are seen. Those that are hidden come last.
    pub fn seen_instances(&self) -> usize {
        self.instances.len() - self.rig.hidden.len().min(self.instances.len())
    }
}

impl Rig {
    /// Gives the scene a number that no scene has had; returns the one before.
    pub(in crate::scene) fn renew_serial(&mut self) -> u64 {
        static NEXT: AtomicU64 = AtomicU64::new(1);
        std::mem::replace(&mut self.serial, NEXT.fetch_add(1, Relaxed))
    }

    /// Whether the scene was loaded or built from a description: trees have levels even where there are none of them.
    pub(in crate::scene) fn is_built(&self) -> bool {
        self.levels != [0; 2]
    }

    /// Number of the instance of this name, or of the mesh of this name that is `moving` and has no instance.
    pub fn placement(&self, name: &str) -> Option<usize> {
        self.placements.get(name).copied()
    }

    /// How many placements there are: the `[[instance]]` tables in order, then meshes that are `moving` and have none.
    pub fn placements(&self) -> usize {
        self.placed.len()
    }

    /// Number of the `[[mesh]]` of this name that can be deformed.
    pub fn mesh(&self, name: &str) -> Option<usize> {
        self.moving.get(name).copied()
    }

    /// Number of the `[[light]]` of this name.
    pub fn light(&self, name: &str) -> Option<usize> {
        self.lamps.get(name).copied()
    }

    /// The instances that are seen, by their numbers, each with its tree.
    pub(in crate::scene) fn seen<'s>(
        &'s self,
        scene: &'s Scene,
    ) -> impl Iterator<Item = (u32, &'s Tree, &'s Instance)> {
        let all = self.order.iter().zip(&scene.instances);
        let mut seen: Vec<_> = all.filter(|(copy, _)| !self.hidden.contains(copy)).collect();
        seen.sort_unstable_by_key(|(copy, _)| **copy);
        seen.into_iter().map(|(&copy, instance)| (copy, &self.trees[self.tree_of[copy as usize] as usize], instance))
    }

    /// Notes what the description calls its parts.
    pub(in crate::scene) fn name(&mut self, from: &Description, materials: &[Material]) {
        self.tabled = (0..).zip(materials).filter(|(_, m)| reads_table(m)).map(|(i, _)| i).collect();
        let named = |(i, name): (usize, &Option<String>)| Some((name.clone()?, i));
        // Of several things of one name the first has it.
        self.placements.extend(from.instance.iter().map(|i| &i.name).enumerate().rev().filter_map(named));
        self.lamps.extend(from.light.iter().map(|l| &l.name).enumerate().rev().filter_map(named));
        let soft = self.trees.iter().filter(|tree| tree.soft.is_some()).filter_map(|tree| tree.mesh);
        self.moving.extend(soft.filter_map(|mesh| named((mesh, &from.mesh[mesh].name))));
        for (number, &copy) in self.placed.iter().enumerate().skip(from.instance.len()).filter(|(_, c)| **c != NONE) {
            let mesh = self.trees[self.tree_of[copy as usize] as usize].mesh;
            if let Some(name) = mesh.and_then(|mesh| from.mesh[mesh].name.clone()) {
                self.placements.entry(name).or_insert(number);
            }
        }
    }
}
