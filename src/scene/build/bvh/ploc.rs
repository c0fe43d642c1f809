//! PLOC, parallel locally-ordered clustering (Meister and Bittner 2018): boxes in Morton order are merged in rounds, each with the
//! neighbour whose union with it is smallest, where both choose each other. The tree is that of obvhs to the bit, except for boxes
//! inside boxes, as of thin triangles that share a corner: each of them chooses the next smaller one, so that a round merges but a
//! few, and time would grow with the square of their number.
use obvhs::Boundable;
use obvhs::aabb::Aabb;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::{Bvh2, DEFAULT_MAX_STACK_DEPTH};
use obvhs::ploc::morton::morton_encode_u64_unorm;
use rayon::prelude::*;

/// Neighbours on either side that a box may choose, after two rounds with the next ones only.
const REACH: usize = 6;
const QUICK: usize = 2;
/// Visits of boxes, per item, after which slow rounds are helped. Without nested boxes there are 3 to 5, Crytek Sponza has 3.6.
const PATIENCE: usize = 16;
/// A round that merges less than one in so many boxes is slow.
const SLOW: usize = 8;
/// Boxes that a thread searches at a time.
const CHUNK: usize = 1 << 12;
/// Items from which on the box that Morton codes divide has the origin in it: obvhs does so.
const LARGE: usize = 500_000;

/// The two-way tree over `items`, and whether so many are nested that rounds were helped.
pub fn tree<T: Boundable + Sync>(items: &[T]) -> (Bvh2, bool) {
    let (bvh, visits) = paired(items);
    (bvh, visits > PATIENCE * items.len())
}

/// The tree, and how often a box was visited. After a slow round all boxes are merged two by two in their order, once
/// [`PATIENCE`] has run out: each two rounds halve their number then.
fn paired<T: Boundable + Sync>(items: &[T]) -> (Bvh2, usize) {
    let mut bvh = Bvh2::zeroed(items.len());
    bvh.primitive_indices = (0..items.len() as u32).collect();
    bvh.children_are_ordered_after_parents = true;
    let mut roots = in_morton_order(items);
    let (mut merged, mut partners) = (Vec::with_capacity(roots.len()), vec![0; roots.len()]);
    let (mut free, mut visits, mut round, mut slow) = (bvh.nodes.len(), 0, 0, false);
    while roots.len() > 1 {
        let partners = &mut partners[..roots.len()];
        match round {
            _ if slow && visits > PATIENCE * items.len() => two_by_two(partners),
            0..QUICK => search::<1>(&roots, partners),
            _ => search::<REACH>(&roots, partners),
        }
        merge(&roots, partners, &mut merged, &mut bvh.nodes, &mut free);
        visits += roots.len();
        slow = roots.len() - merged.len() < roots.len() / SLOW;
        std::mem::swap(&mut roots, &mut merged);
        round += 1;
    }
    if let (Some(node), Some(root)) = (bvh.nodes.first_mut(), roots.first()) {
        *node = *root;
    }
    bvh.max_depth = DEFAULT_MAX_STACK_DEPTH.max(round + 1);
    (bvh, visits)
}

/// Leaves with one item each.
fn in_morton_order<T: Boundable + Sync>(items: &[T]) -> Vec<Bvh2Node> {
    let leaf = |(i, item): (usize, &T)| Bvh2Node::new(item.aabb(), 1, i as u32);
    let leaves: Vec<_> = items.par_iter().with_min_len(CHUNK).enumerate().map(leaf).collect();
    let boxes = leaves.par_iter().with_min_len(CHUNK).map(|leaf| *leaf.aabb());
    let seed = if items.len() < LARGE { Aabb::empty() } else { Aabb::default() };
    let around = boxes.reduce(|| seed, |a, b| a.union(&b));
    let scale = 1.0 / around.diagonal().as_dvec3();
    let offset = -around.min.as_dvec3() * scale;
    let code = |leaf: &Bvh2Node| morton_encode_u64_unorm(leaf.aabb().center().as_dvec3() * scale + offset);
    let key = |(i, leaf)| (code(leaf), i as u32);
    let mut keys: Vec<(u64, u32)> = leaves.par_iter().with_min_len(CHUNK).enumerate().map(key).collect();
    keys.par_sort_unstable_by_key(|&(code, _)| code);
    keys.par_iter().with_min_len(CHUNK).map(|&(_, i)| leaves[i as usize]).collect()
}

/// How far from each box the one is that it chooses, of up to `N` on either side.
fn search<const N: usize>(roots: &[Bvh2Node], partners: &mut [i8]) {
    partners.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, partners)| {
        let start = chunk * CHUNK;
        let first = start.saturating_sub(N);
        // Of each of the last N boxes, what it costs to merge it with those behind it.
        let mut costs = [[f32::INFINITY; N]; N];
        for at in first..start + partners.len() {
            // One that costs nothing comparable takes the box beside it.
            let (mut least, mut partner) = (f32::INFINITY, if at == 0 { 1 } else { -1 });
            let mut choose = |cost, offset| {
                if cost <= least {
                    (least, partner) = (cost, offset);
                }
            };
            for back in (1..=N.min(at - first)).rev() {
                choose(costs[(at - back) % N][back - 1], -(back as i8));
            }
            let row = &mut costs[at % N];
            for (ahead, (other, cost)) in (1..).zip(roots[at + 1..].iter().zip(row)) {
                *cost = roots[at].aabb().union(other.aabb()).half_area();
                choose(*cost, ahead);
            }
            if at >= start {
                partners[at - start] = partner;
            }
        }
    });
}

/// Each box with its neighbour, whatever the cost; the last of an odd number is left.
fn two_by_two(partners: &mut [i8]) {
    let last = partners.len() - 1;
    let partner = |at| if at % 2 == 0 && at < last { 1 } else { -1 };
    partners.iter_mut().enumerate().for_each(|(at, p)| *p = partner(at));
}

/// Merges those that chose each other: they become the nodes before `free`, and what takes their place is in `merged`.
fn merge(roots: &[Bvh2Node], partners: &[i8], merged: &mut Vec<Bvh2Node>, nodes: &mut [Bvh2Node], free: &mut usize) {
    merged.clear();
    for (at, root) in roots.iter().enumerate() {
        let partner = at.wrapping_add_signed(partners[at].into());
        if partner.wrapping_add_signed(partners[partner].into()) != at {
            merged.push(*root);
        } else if partner < at {
            let other = roots[partner];
            *free -= 2;
            nodes[*free..*free + 2].copy_from_slice(&[*root, other]);
            merged.push(Bvh2Node::new(root.aabb().union(other.aabb()), 0, *free as u32));
        }
    }
}

#[cfg(test)]
mod tests;
