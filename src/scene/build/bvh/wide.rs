//! Eight-way nodes of a two-way tree, by Ylitie et al. 2017: dynamic programming finds the cheapest choice of the subtrees that
//! become nodes and leaves, and children are put into the slots that suit the directions in which they lie. Both run in parallel, and
//! neither result depends on the number of threads.
use super::refit::{PRIMITIVE, quantise};
use crate::layout::BvhNode;
use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Primitives in a leaf; the node format holds up to 3.
const LEAF: u32 = 3;
/// Levels of a two-way tree whose halves are handed to other threads.
const SHARED: usize = 14;
/// Subtrees that are made into nodes in parallel, and primitives below which one thread does all.
const TASKS: usize = 512;
const SMALL: usize = 10_000;

/// What a tree became.
#[derive(Default)]
pub struct Wide {
    /// The root first; children come after their parents.
    pub nodes: Vec<BvhNode>,
    /// Order of the primitives in the leaves.
    pub order: Vec<u32>,
    /// Levels of nodes.
    pub levels: usize,
}

/// The cheapest nodes over `bvh`, whose leaves hold one primitive each; `None` where it is of more than `most` levels.
pub fn collapse(bvh: &Bvh2, most: usize) -> Option<Wide> {
    let splits = (0..bvh.nodes.len() / 2).map(|_| AtomicU32::new(0)).collect();
    let mut collapse = Collapse { bvh, splits, finished: HashMap::new() };
    collapse.costs(0, 0, most)?;
    if bvh.primitive_indices.len() > SMALL {
        let roots = collapse.tasks();
        collapse.finished = roots.into_par_iter().map(|at| (at, collapse.subtree(at))).collect();
    }
    Some(collapse.subtree(0))
}

struct Collapse<'a> {
    bvh: &'a Bvh2,
    /// By inner node, at the place of its pair of children: see [`Split`].
    splits: Vec<AtomicU32>, // atomic, since threads fill it at places in no order
    /// Subtrees that are nodes already, by their root.
    finished: HashMap<u32, Wide>,
}

/// The least costs of a subtree as 1, 2 .. 7 nodes or leaves, and how many primitives it has.
type Costs = ([f32; 7], u32);

/// How a subtree is best divided between the children of its root: bits 3 i to 3 i + 2 tell how many of i + 2 nodes or leaves the
/// first child gets, less one (for i = 0, of eight), or [`FEWER`], if fewer are as cheap. Bit 21 tells that the subtree as a whole
/// is best a leaf.
#[derive(Clone, Copy)]
struct Split(u32);

const FEWER: u32 = 7;
const IS_LEAF: u32 = 1 << 21;

impl Split {
    fn first(self, i: usize) -> u32 {
        self.0 >> (3 * i) & 7
    }

    /// How many of up to `i + 1` nodes or leaves each child gets, less one; `None` if one is cheapest.
    fn of(self, i: usize) -> Option<[usize; 2]> {
        let i = (1..=i).rev().find(|&i| self.first(i) != FEWER)?;
        let first = self.first(i) as usize;
        Some([first, i - 1 - first])
    }

    /// The same of the eight that a node has room for.
    fn of_node(self) -> [usize; 2] {
        let first = self.first(0) as usize;
        [first, 6 - first]
    }
}

impl Collapse<'_> {
    fn split(&self, first_child: u32) -> &AtomicU32 {
        &self.splits[first_child as usize / 2]
    }

    /// Decides the whole subtree. `None` where it is too deep.
    fn costs(&self, at: u32, level: usize, most: usize) -> Option<Costs> {
        let node = &self.bvh.nodes[at as usize];
        let area = node.aabb().half_area();
        if node.is_leaf() {
            return Some(([area * PRIMITIVE; 7], 1));
        }
        if level == most {
            return None;
        }
        let first = node.first_index;
        let below = |at| self.costs(at, level + 1, most);
        let (left, right) = match level < SHARED {
            true => rayon::join(|| below(first), || below(first + 1)),
            false => (below(first), below(first + 1)),
        };
        let ((left, a), (right, b)) = (left?, right?);
        let (costs, split) = divided(&left, &right, area, a + b);
        self.split(first).store(split.0, Relaxed);
        Some((costs, a + b))
    }

    /// Roots of subtrees that together are all but the top of the tree, in no particular order.
    fn tasks(&self) -> Vec<u32> {
        let mut open = vec![0];
        while !open.is_empty() && open.len() < TASKS {
            let wider: Vec<u32> = open.iter().flat_map(|&at| self.inner(self.children(at))).collect();
            if wider.len() <= open.len() {
                return wider;
            }
            open = wider;
        }
        open
    }

    /// The nodes of a subtree, of which all but those that are finished are made here.
    fn subtree(&self, at: u32) -> Wide {
        let mut wide = Wide { nodes: vec![BvhNode::default()], ..Wide::default() };
        let more = |part: fn(&Wide) -> usize| self.finished.values().map(part).sum::<usize>();
        wide.nodes.reserve(more(|part| part.nodes.len()));
        wide.order.reserve(more(|part| part.order.len()));
        self.add(at, 0, 1, &mut wide);
        wide
    }

    /// Makes the node at `slot`, and what is below it.
    fn add(&self, at: u32, slot: usize, level: usize, wide: &mut Wide) {
        wide.levels = wide.levels.max(level);
        let children = self.children(at);
        let mut node = BvhNode {
            child_base: wide.nodes.len() as u32,
            primitive_base: wide.order.len() as u32,
            ..BvhNode::default()
        };
        let (mut meta, mut boxes) = ([0u8; 8], [Aabb::empty(); 8]);
        for (i, &child) in children.iter().enumerate().filter(|(_, child)| **child != NO_CHILD) {
            boxes[i] = *self.bvh.nodes[child as usize].aabb();
            if self.is_inner(child) {
                meta[i] = 0x20 | (24 + i as u8);
                node.e_imask |= 1 << (24 + i);
            } else {
                let before = wide.order.len();
                self.primitives(child, &mut wide.order);
                let unary = (1u8 << (wide.order.len() - before)) - 1;
                meta[i] = unary << 5 | (before - node.primitive_base as usize) as u8;
            }
        }
        node.meta = bytemuck::cast(meta);
        quantise(&mut node, self.bvh.nodes[at as usize].aabb(), &boxes);
        wide.nodes[slot] = node;
        let inner = self.inner(children);
        let first = wide.nodes.len();
        wide.nodes.resize(first + inner.clone().count(), BvhNode::default());
        for (slot, child) in (first..).zip(inner) {
            match self.finished.get(&child) {
                Some(part) => wide.append(slot, level, part),
                None => self.add(child, slot, level + 1, wide),
            }
        }
    }

    /// The children of the eight-way node over `at`, in their slots.
    fn children(&self, at: u32) -> [u32; 8] {
        let mut found = Vec::with_capacity(8);
        let node = &self.bvh.nodes[at as usize];
        if node.is_leaf() {
            found.push(at);
        } else {
            let split = Split(self.split(node.first_index).load(Relaxed));
            self.open(node.first_index, split.of_node(), &mut found);
        }
        in_slots(self.bvh, node.aabb(), &found)
    }

    /// Adds what a pair of nodes gives when each is divided into so many, less one.
    fn open(&self, pair: u32, counts: [usize; 2], found: &mut Vec<u32>) {
        for (child, count) in (pair..).zip(counts) {
            let node = &self.bvh.nodes[child as usize];
            let split = || Split(self.split(node.first_index).load(Relaxed)).of(count);
            match if node.is_leaf() { None } else { split() } {
                Some(counts) => self.open(node.first_index, counts, found),
                None => found.push(child),
            }
        }
    }

    /// Those of a node's children that are nodes themselves.
    fn inner(&self, children: [u32; 8]) -> impl Iterator<Item = u32> + Clone {
        children.into_iter().filter(|&child| child != NO_CHILD && self.is_inner(child))
    }

    fn is_inner(&self, at: u32) -> bool {
        let node = &self.bvh.nodes[at as usize];
        !node.is_leaf() && self.split(node.first_index).load(Relaxed) & IS_LEAF == 0
    }

    fn primitives(&self, at: u32, order: &mut Vec<u32>) {
        let node = &self.bvh.nodes[at as usize];
        match node.is_leaf() {
            true => order.push(self.bvh.primitive_indices[node.first_index as usize]),
            false => [0, 1].iter().for_each(|i| self.primitives(node.first_index + i, order)),
        }
    }
}

/// In a slot without a child.
const NO_CHILD: u32 = u32::MAX;

/// The costs of a subtree of this surface and number of primitives, by those of its children, in areas: a node
/// costs 1, a primitive [`PRIMITIVE`].
fn divided(left: &[f32; 7], right: &[f32; 7], area: f32, primitives: u32) -> ([f32; 7], Split) {
    let cheapest = |first: (f32, u32), count: usize| {
        let choices = (0..count).map(|k| (left[k] + right[count - 1 - k], k as u32));
        choices.fold(first, |best, choice| if choice.0 < best.0 { choice } else { best })
    };
    let (eight, mut split) = cheapest((f32::INFINITY, 0), 7);
    let node = eight + area;
    let leaf = if primitives > LEAF { f32::INFINITY } else { primitives as f32 * area * PRIMITIVE };
    if leaf < node {
        split |= IS_LEAF;
    }
    let mut costs = [leaf.min(node); 7];
    for i in 1..7 {
        let (cost, first) = cheapest((costs[i - 1], FEWER), i);
        costs[i] = cost;
        split |= first << (3 * i);
    }
    (costs, Split(split))
}

/// Assigns children to slots so that each lies in the direction of its slot, the most decided first: rays of an octant then meet them
/// from front to back (greedily, where the paper holds an auction).
fn in_slots(bvh: &Bvh2, around: &Aabb, children: &[u32]) -> [u32; 8] {
    let middle = around.center();
    let costs: [[f32; 8]; 8] = std::array::from_fn(|c| match children.get(c) {
        Some(&child) => {
            let offset = bvh.nodes[child as usize].aabb().center() - middle;
            std::array::from_fn(|slot| direction(slot).dot(offset))
        }
        None => [f32::INFINITY; 8],
    });
    let (mut slots, mut placed) = ([NO_CHILD; 8], 0u8);
    for _ in children {
        let mut best = (f32::INFINITY, 0, 0);
        for (c, costs) in costs.iter().enumerate().filter(|(c, _)| placed >> c & 1 == 0) {
            for (slot, &cost) in costs.iter().enumerate() {
                if cost < best.0 && slots[slot] == NO_CHILD {
                    best = (cost, c, slot);
                }
            }
        }
        placed |= 1 << best.1;
        slots[best.2] = children[best.1];
    }
    slots
}

/// Against the octant of a slot, whose bits 4, 2 and 1 stand for the positive halves of x, y and z.
fn direction(slot: usize) -> Vec3A {
    Vec3A::from([4, 2, 1].map(|bit| if slot & bit != 0 { -1.0 } else { 1.0 }))
}

impl Wide {
    /// Puts a finished subtree below a node of this level: its root at `slot`, the rest behind all that is there.
    fn append(&mut self, slot: usize, level: usize, part: &Self) {
        let (nodes, first) = (self.nodes.len() as u32 - 1, self.order.len() as u32);
        let moved =
            |n: &BvhNode| BvhNode { child_base: n.child_base + nodes, primitive_base: n.primitive_base + first, ..*n };
        let mut moved = part.nodes.iter().map(moved);
        self.nodes[slot] = moved.next().expect("a subtree has a root");
        self.nodes.extend(moved);
        self.order.extend_from_slice(&part.order);
        self.levels = self.levels.max(level + part.levels);
    }
}

#[cfg(test)]
mod tests;
