//! The node hierarchy: which nodes the scene shows, and where they are.
use super::asset::Asset;
use crate::error::Result;
use crate::scene::description::Transform;
use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
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

    /// The turn alone. Of a matrix, its own z and y axes say it, and the third one where one of them has no length; with fewer it counts
    /// as none.
    fn turn(&self) -> DQuat {
        let m = match self {
            Self::Steps { rotation, .. } => return unit(*rotation),
            Self::Matrix(matrix) => matrix.matrix3,
        };
        let [x, y, z] = [m.x_axis, m.y_axis, m.z_axis].map(DVec3::try_normalize);
        let axes = match (x, y, z) {
            (_, Some(y), Some(z)) => [y.cross(z), y, z],
            (Some(x), None, Some(z)) => [x, z.cross(x), z],
            (Some(x), Some(y), None) => [x, y, x.cross(y)],
            _ => return DQuat::IDENTITY,
        };
        // Shear leaves an angle between axes: z stays, and y is what is across it.
        let across = |v: DVec3| v.reject_from_normalized(axes[2]).try_normalize();
        let up = across(axes[1]).unwrap_or_else(|| axes[2].any_orthonormal_vector());
        DQuat::from_mat3(&DMat3::from_cols(up.cross(axes[2]), up, axes[2]))
    }

    /// The same, with the steps that it is made of.
    pub fn transform(&self) -> Transform {
        match *self {
            Self::Matrix(matrix) => matrix.into(),
            Self::Steps { translation, rotation, scale } => Transform::of_steps(scale, unit(rotation), translation),
        }
    }
}

impl From<Transform> for Local {
    fn from(transform: Transform) -> Self {
        let translation = transform.0.translation;
        match transform.made_of() {
            Some((scale, rotation)) => Self::Steps { translation, rotation, scale },
            None => Self::Matrix(transform.0),
        }
    }
}

/// A rotation without length or with NaN counts as none.
fn unit(rotation: DQuat) -> DQuat {
    let length = rotation.length();
    if length.is_finite() && length > 1e-30 { rotation * (1.0 / length) } else { DQuat::IDENTITY }
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

    /// Where cameras at the nodes stand and look: the place of each node, and its and its parents' turns. Their scales do not count, as
    /// glTF 2.0 has it.
    pub fn views(&self, locals: &[Local]) -> Vec<DAffine3> {
        let mut turns = vec![DQuat::IDENTITY; locals.len()];
        for &node in &self.order {
            let turn = locals[node].turn();
            turns[node] = self.parents[node].map_or(turn, |parent| turns[parent] * turn);
        }
        let place = |(turn, world): (DQuat, DAffine3)| DAffine3::from_rotation_translation(turn, world.translation);
        turns.into_iter().zip(self.worlds(locals)).map(place).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;

    #[test]
    fn matrices_turn_views_as_their_axes_lie() {
        let turn = DQuat::from_rotation_y(0.5) * DQuat::from_rotation_x(0.25);
        let of = |m: DMat3| Local::Matrix(DAffine3::from_mat3(m)).turn();
        let axes = DMat3::from_quat(turn);
        for scale in
            [DVec3::ONE, dvec3(-1.0, 1.0, 1.0), dvec3(0.0, 2.0, 3.0), dvec3(1.0, 0.0, 3.0), dvec3(2.0, 1.0, 0.0)]
        {
            let found = of(axes * DMat3::from_diagonal(scale));
            assert!(found.dot(turn).abs() > 1.0 - 1e-12, "{scale}: {found}");
        }
        let shear = DMat3::from_cols(DVec3::X, dvec3(0.0, 1.0, 0.5), DVec3::Z);
        assert!(of(axes * shear).dot(turn).abs() > 1.0 - 1e-12);
        assert_eq!(of(DMat3::ZERO), DQuat::IDENTITY);
        let keyed = Local::from(Transform::of_steps(dvec3(1.0, -1.0, 0.0), turn, DVec3::ZERO));
        assert!(keyed.turn().dot(turn).abs() > 1.0 - 1e-12, "the steps of keys are kept");
    }

    #[test]
    fn scales_of_nodes_neither_mirror_a_view_nor_flatten_it() {
        let steps = |scale: DVec3, angle: f64| Local::Steps {
            translation: dvec3(0.0, 0.0, 2.0),
            rotation: DQuat::from_rotation_x(angle),
            scale,
        };
        let tree = |locals: [Local; 2]| Tree {
            locals: locals.to_vec(),
            parents: vec![None, Some(0)],
            order: vec![0, 1],
            shown: vec![0, 1],
        };
        let view = |parent: DVec3, own: DVec3| {
            let tree = tree([steps(parent, 0.25), steps(own, 0.5)]);
            (tree.views(&tree.locals)[1], tree.worlds(&tree.locals)[1])
        };
        let (plain, world) = view(DVec3::ONE, DVec3::ONE);
        assert!(plain.abs_diff_eq(world, 1e-12), "without scales it is the node's own");
        for flat in [dvec3(-1.0, 1.0, 1.0), dvec3(1.0, -1.0, 1.0), dvec3(1.0, 1.0, 0.0), DVec3::ZERO, -DVec3::ONE] {
            for (parent, own) in [(flat, DVec3::ONE), (DVec3::ONE, flat)] {
                let (view, world) = view(parent, own);
                assert!(view.matrix3.abs_diff_eq(plain.matrix3, 1e-12), "{parent} {own}");
                assert_eq!(view.translation, world.translation);
            }
        }
    }
}
