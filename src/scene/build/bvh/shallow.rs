//! Trees of as few levels as there can be. A kernel's stack is compiled for a scene as it was loaded; a tree that is built later,
//! over as many items, must fit it, whatever they have become.
use super::refit::refit;
use crate::layout::BvhNode;
use glam::Vec3A;
use obvhs::aabb::Aabb;

/// Items of a leaf child at most.
const LEAF: usize = 3;

/// Nodes over boxes, the root first, numbered from 0 like the primitives; and the order of the leaves. Items are halved three
/// times along the longest axis of their centres: the largest child has an eighth of them.
pub fn build(boxes: &[Aabb]) -> (Vec<BvhNode>, Vec<u32>) {
    let mut tree = Tree { boxes, nodes: vec![BvhNode::default()], order: Vec::with_capacity(boxes.len()) };
    let mut items: Vec<u32> = (0..boxes.len() as u32).collect();
    tree.fill(0, &mut items);
    let Tree { mut nodes, order, .. } = tree;
    let all = 0..nodes.len();
    refit(&mut nodes, all, |at| boxes[order[at as usize] as usize]);
    (nodes, order)
}

struct Tree<'a> {
    boxes: &'a [Aabb],
    nodes: Vec<BvhNode>,
    order: Vec<u32>,
}

impl Tree<'_> {
    fn fill(&mut self, node: usize, items: &mut [u32]) {
        let first = self.order.len();
        let mut parts = self.halves(items, 3);
        let (mut meta, mut inner) = ([0u8; 8], 0u32);
        for (slot, part) in parts.iter().enumerate().filter(|(_, part)| !part.is_empty()) {
            if part.len() > LEAF {
                meta[slot] = 0x20 | (24 + slot as u8);
                inner |= 1 << slot;
                continue;
            }
            let unary = (1u8 << part.len()) - 1;
            meta[slot] = unary << 5 | (self.order.len() - first) as u8;
            self.order.extend_from_slice(part);
        }
        let child = self.nodes.len();
        self.nodes[node] = BvhNode {
            e_imask: inner << 24,
            child_base: child as u32,
            primitive_base: first as u32,
            meta: bytemuck::cast(meta),
            ..BvhNode::default()
        };
        self.nodes.resize(child + inner.count_ones() as usize, BvhNode::default());
        let deeper = parts.iter_mut().filter(|part| part.len() > LEAF);
        deeper.enumerate().for_each(|(i, part)| self.fill(child + i, part));
    }

    fn halves<'i>(&self, items: &'i mut [u32], times: u32) -> Vec<&'i mut [u32]> {
        if times == 0 || items.len() < 2 {
            return vec![items];
        }
        let centre = |i: u32| self.boxes[i as usize].min + self.boxes[i as usize].max;
        let seed = (Vec3A::INFINITY, Vec3A::NEG_INFINITY);
        let (low, high) = items.iter().fold(seed, |(l, h), &i| (l.min(centre(i)), h.max(centre(i))));
        let axis = (high - low).max_position();
        let middle = items.len().div_ceil(2);
        let key = |i: &u32| (centre(*i)[axis], *i);
        items.select_nth_unstable_by(middle - 1, |a, b| key(a).partial_cmp(&key(b)).unwrap_or(a.cmp(b)));
        let (left, right) = items.split_at_mut(middle);
        let mut parts = self.halves(left, times - 1);
        parts.extend(self.halves(right, times - 1));
        parts
    }
}
