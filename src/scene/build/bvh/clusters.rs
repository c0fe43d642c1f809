//! Boxes around one centre. Any two of them cost the same to merge, or nearly, and then a round of PLOC pairs few: time
//! would grow with the square of their number, and the tree become as deep as they are many (a minute and a refusal for
//! 50,000 copies of a triangle). So they enter PLOC as one box, which is halved afterwards.
use glam::Vec3A;
use obvhs::Boundable;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use rayon::prelude::*;

/// Boxes, sorted by centre and then by size.
pub struct Clusters {
    /// Indices of the boxes, cluster by cluster.
    pub order: Vec<u32>,
    /// Where in `order` each cluster begins, and its end.
    starts: Vec<u32>,
}

impl Clusters {
    /// Boxes whose centres are equal bit for bit share a cluster.
    pub fn new<T: Boundable + Sync>(items: &[T]) -> Self {
        let key = |i: u32| {
            let b = items[i as usize].aabb();
            let middle = b.min + b.max + Vec3A::ZERO; // zero has one sign then
            (middle.to_array().map(f32::to_bits), b.half_area().to_bits(), i)
        };
        let mut keys: Vec<_> = (0..items.len() as u32).into_par_iter().map(key).collect();
        keys.par_sort_unstable();
        let first = |&i: &usize| i == 0 || keys[i].0 != keys[i - 1].0;
        let starts = (0..keys.len()).filter(first).chain([keys.len()]).map(|i| i as u32).collect();
        Self { order: keys.into_iter().map(|key| key.2).collect(), starts }
    }

    /// The box around each cluster.
    pub fn boxes<T: Boundable>(&self, items: &[T]) -> Vec<Aabb> {
        let around = |range: &[u32]| {
            let boxes = self.order[range[0] as usize..range[1] as usize].iter().map(|&i| items[i as usize].aabb());
            boxes.reduce(|a, b| a.union(&b)).expect("no cluster is empty")
        };
        self.starts.windows(2).map(around).collect()
    }

    /// Replaces every leaf of a tree over the clusters by a balanced tree over what is in its cluster.
    pub fn unfold<T: Boundable>(&self, bvh: &mut Bvh2, items: &[T]) {
        for at in 0..bvh.nodes.len() {
            let node = bvh.nodes[at];
            if node.prim_count > 0 {
                let cluster = bvh.primitive_indices[node.first_index as usize] as usize;
                self.halve(bvh, at, [self.starts[cluster], self.starts[cluster + 1]], items);
            }
        }
        bvh.primitive_indices.clone_from(&self.order);
    }

    /// Returns the box around them.
    fn halve<T: Boundable>(&self, bvh: &mut Bvh2, at: usize, [from, to]: [u32; 2], items: &[T]) -> Aabb {
        let (left, middle) = (bvh.nodes.len(), from.midpoint(to));
        if to - from == 1 {
            let around = items[self.order[from as usize] as usize].aabb();
            bvh.nodes[at] = Bvh2Node::new(around, 1, from);
            return around;
        }
        bvh.nodes.extend([Bvh2Node::default(); 2]);
        let around =
            self.halve(bvh, left, [from, middle], items).union(&self.halve(bvh, left + 1, [middle, to], items));
        bvh.nodes[at] = Bvh2Node::new(around, 0, left as u32);
        around
    }
}
