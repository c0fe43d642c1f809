//! Trees that are too deep. Boxes inside boxes, as of thin triangles that share a corner, become chains by PLOC and by
//! reinsertion. What lies deep in them is halved instead, in the order in which the tree has it.
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

/// Halves every subtree that begins at level `from` and is higher than `most`.
pub fn level(bvh: &mut Bvh2, from: usize, most: usize) {
    let mut open = vec![(0, 0)];
    while let Some((at, level)) = open.pop() {
        let node = bvh.nodes[at];
        if level < from && !node.is_leaf() {
            open.extend([1, 0].map(|child| (node.first_index as usize + child, level + 1)));
        } else if level == from {
            let mut subtree = Subtree::of(bvh, at);
            if subtree.height > most {
                let leaves = std::mem::take(&mut subtree.leaves);
                halve(bvh, at, &leaves, &mut subtree.pairs);
            }
        }
    }
}

/// What lies below a node.
#[derive(Default)]
struct Subtree {
    /// From the first child to the second.
    leaves: Vec<Bvh2Node>,
    /// Where the children of its inner nodes are stored: one less than leaves.
    pairs: Vec<u32>,
    height: usize,
}

impl Subtree {
    fn of(bvh: &Bvh2, at: usize) -> Self {
        let (mut found, mut open) = (Self::default(), vec![(at, 0)]);
        while let Some((at, level)) = open.pop() {
            let node = bvh.nodes[at];
            found.height = found.height.max(level);
            if node.is_leaf() {
                found.leaves.push(node);
            } else {
                found.pairs.push(node.first_index);
                open.extend([1, 0].map(|child| (node.first_index as usize + child, level + 1)));
            }
        }
        found
    }
}

/// Puts the balanced tree over `leaves` at `at` and in `pairs`; returns the box around them.
fn halve(bvh: &mut Bvh2, at: usize, leaves: &[Bvh2Node], pairs: &mut Vec<u32>) -> Aabb {
    if let [leaf] = leaves {
        bvh.nodes[at] = *leaf;
        return *leaf.aabb();
    }
    let (left, right) = leaves.split_at(leaves.len() / 2);
    let pair = pairs.pop().expect("one for each inner node");
    let first = pair as usize;
    let around = halve(bvh, first, left, pairs).union(&halve(bvh, first + 1, right, pairs));
    bvh.nodes[at] = Bvh2Node::new(around, 0, pair);
    around
}
