//! The node hierarchy: which nodes the scene shows, and where they are.
use super::asset::Asset;
use crate::error::Result;
use crate::scene::description::Transform;
use glam::{DAffine3, DMat4, DQuat, DVec3};
use gltf_json::scene::Node;

/// The transform of a node relative to its parent.
#[derive(Clone, Copy, Debug)]
pub enum Local {
    /// As the file gives it.
    Matrix(DAffine3),
    /// Scaled first, then turned, then moved. Only these can be animated.
    Steps {
        /// Distance that it is moved by.
        translation: DVec3,
        /// Rotation of any length but 0; see [`Local::affine`].
        rotation: DQuat,
        /// Factors along the axes, which may be negative or 0.
        scale: DVec3,
    },
}

impl Local {
    fn of(node: &Node) -> Self {
        let triple = |v: [f32; 3]| DVec3::from(v.map(f64::from));
        match &node.matrix {
            Some(columns) => Self::Matrix(DAffine3::from_mat4(DMat4::from_cols_array(&columns.map(f64::from)))),
            None => Self::Steps {
                translation: triple(node.translation.unwrap_or_default()),
                rotation: node.rotation.map_or(DQuat::IDENTITY, |r| DQuat::from_array(r.0.map(f64::from))),
                scale: triple(node.scale.unwrap_or([1.0; 3])),
            },
        }
    }

    /// The transform; a rotation without length or with NaN counts as none.
    pub fn affine(&self) -> DAffine3 {
        self.transform().0
    }

    /// The same, with the steps that it is made of.
    pub fn transform(&self) -> Transform {
        match *self {
            Self::Matrix(matrix) => matrix.into(),
            Self::Steps { translation, rotation, scale } => {
                let length = rotation.length();
                let usable = length.is_finite() && length > 1e-30;
                let turn = if usable { rotation * (1.0 / length) } else { DQuat::IDENTITY };
                Transform::of_steps(scale, turn, translation)
            }
        }
    }
}

/// The nodes of a file, all trees of which are known to end.
#[derive(Debug)]
pub struct Tree {
    /// By node: its transform relative to its parent as the file has it.
    pub locals: Vec<Local>,
    /// By node: its parent.
    parents: Vec<Option<usize>>,
    /// All nodes, parents before children.
    order: Vec<usize>,
    /// The nodes that the scene shows, parents before children.
    pub shown: Vec<usize>,
}

impl Tree {
    /// The nodes of a file, and which of them its default scene shows: the first scene where it names none, and all nodes where
    /// it has no scene. Walks keep a list, not a stack of calls, so that a chain of any length is followed.
    ///
    /// # Errors
    /// [`crate::error::Error::Input`] for a node with two parents or among its own ancestors. Indices must have been checked.
    pub fn new(asset: &Asset) -> Result<Self> {
        let nodes = &asset.root.nodes;
        let children = |node: usize| nodes[node].children.iter().flatten().map(|child| child.value());
        let mut parents = vec![None; nodes.len()];
        for parent in 0..nodes.len() {
            for child in children(parent) {
                if parents[child].replace(parent).is_some() {
                    return Err(asset.at(format!("node {child}"), "is a child twice: export the file again"));
                }
            }
        }
        let below = |roots: Vec<usize>| {
            let mut order = roots;
            let mut next = 0;
            while let Some(&node) = order.get(next) {
                order.extend(children(node));
                next += 1;
            }
            order
        };
        let order = below((0..nodes.len()).filter(|&node| parents[node].is_none()).collect());
        if order.len() < nodes.len() {
            let mut reached = vec![false; nodes.len()];
            order.iter().for_each(|&node| reached[node] = true);
            let lost = reached.iter().position(|reached| !reached).unwrap_or(0);
            return Err(asset.at(format!("node {lost}"), "is among its own ancestors: export the file again"));
        }
        let scene = asset.root.scene.map_or(0, |scene| scene.value());
        let shown = match asset.root.scenes.get(scene) {
            Some(scene) => {
                let mut roots: Vec<_> = scene.nodes.iter().map(|node| node.value()).collect();
                roots.sort_unstable();
                roots.dedup();
                if let Some(child) = roots.iter().find(|&&root| parents[root].is_some()) {
                    return Err(asset.at(format!("node {child}"), "is a root of a scene and a child: export it again"));
                }
                below(roots)
            }
            None => order.clone(),
        };
        let locals: Vec<_> = nodes.iter().map(Local::of).collect();
        match locals.iter().position(|local| !local.affine().is_finite()) {
            Some(node) => Err(asset.at(format!("node {node}"), "has a transform with numbers that are too large")),
            None => Ok(Self { locals, parents, order, shown }),
        }
    }

    /// By node: whether it moves when `nodes` do, as all nodes below them.
    pub fn moved(&self, nodes: impl Iterator<Item = usize>) -> Vec<bool> {
        let mut moved = vec![false; self.locals.len()];
        nodes.for_each(|node| moved[node] = true);
        for &node in &self.order {
            moved[node] |= self.parents[node].is_some_and(|parent| moved[parent]);
        }
        moved
    }

    /// World transforms of all nodes, where `locals` are those relative to their parents.
    pub fn worlds(&self, locals: &[Local]) -> Vec<DAffine3> {
        let mut worlds = vec![DAffine3::IDENTITY; locals.len()];
        for &node in &self.order {
            let local = locals[node].affine();
            worlds[node] = self.parents[node].map_or(local, |parent| worlds[parent] * local);
        }
        worlds
    }
}
