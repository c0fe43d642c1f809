//! Boxes around one centre. Any two of them cost the same to merge, or nearly, and then a round of PLOC pairs few: time
//! would grow with the square of their number, and the tree become as deep as they are many (a minute and a refusal for
//! 50,000 copies of a triangle). So they enter PLOC as one box, which is halved afterwards.
use glam::Vec3A;
use obvhs::Boundable;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;
use rayon::prelude::*;
use std::ops::Range;
use xxhash_rust::xxh3::xxh3_64;

/// Items that share a centre with no other, and clusters of those that do.
pub struct Clusters {
    /// Indices of the items, cluster by cluster, in the order of the first of each.
    order: Vec<u32>,
    /// Where in `order` each cluster begins, and its end.
    starts: Vec<u32>,
}

/// Clusters that a thread unfolds at a time.
const CHUNK: usize = 1 << 12;

impl Clusters {
    /// Boxes whose centres are equal bit for bit share a cluster. `None` if no two are.
    pub fn new<T: Boundable + Sync>(items: &[T]) -> Option<Self> {
        let groups = Groups::of(items);
        if groups.ends.is_empty() {
            return None;
        }
        let (mut order, mut starts) = (Vec::with_capacity(items.len()), Vec::with_capacity(items.len() + 1));
        for (i, place) in (0..).zip(groups.places(items.len())).filter(|(_, place)| *place != WITH_ANOTHER) {
            starts.push(order.len() as u32);
            match place {
                ALONE => order.push(i),
                group => order.extend_from_slice(groups.members(group)),
            }
        }
        starts.push(order.len() as u32);
        Some(Self { order, starts })
    }

    /// Where in `order` the members of a cluster are.
    fn range(&self, cluster: u32) -> Range<u32> {
        self.starts[cluster as usize]..self.starts[cluster as usize + 1]
    }

    fn aabb<T: Boundable>(&self, place: u32, items: &[T]) -> Aabb {
        items[self.order[place as usize] as usize].aabb()
    }

    /// The box around each cluster.
    pub fn boxes<T: Boundable + Sync>(&self, items: &[T]) -> Vec<Aabb> {
        let around = |cluster| {
            let boxes = self.range(cluster).map(|place| self.aabb(place, items));
            boxes.reduce(|a, b| a.union(&b)).expect("no cluster is empty")
        };
        (0..self.starts.len() as u32 - 1).into_par_iter().map(around).collect()
    }

    /// Replaces every leaf of a tree over the clusters by a balanced tree over what is in its cluster.
    pub fn unfold<T: Boundable + Sync>(self, bvh: &mut Bvh2, items: &[T]) {
        let size = |node: &Bvh2Node| if node.is_leaf() { self.range(node.first_index).len() } else { 0 };
        let several = |at: &u32| size(&bvh.nodes[*at as usize]) > 1;
        let several: Vec<u32> = (0..bvh.nodes.len() as u32).into_par_iter().filter(several).collect();
        let mut next = bvh.nodes.len();
        let chunks = several.chunks(CHUNK).map(|chunk| {
            let base = next;
            next += chunk.iter().map(|&at| 2 * size(&bvh.nodes[at as usize]) - 2).sum::<usize>();
            (chunk, base)
        });
        let chunks: Vec<_> = chunks.collect();
        let trees = chunks.into_par_iter().map(|(chunk, base)| {
            let mut below = Vec::new();
            let range = |&at: &u32| self.range(bvh.nodes[at as usize].first_index);
            let roots = chunk.iter().map(|at| self.halved(range(at), items, base, &mut below)).collect();
            (roots, below)
        });
        let trees: Vec<(Vec<_>, Vec<_>)> = trees.collect();
        bvh.nodes.par_iter_mut().filter(|node| node.is_leaf()).for_each(|node| {
            node.first_index = self.starts[node.first_index as usize];
        });
        bvh.nodes.reserve_exact(next - bvh.nodes.len());
        for ((roots, below), chunk) in trees.into_iter().zip(several.chunks(CHUNK)) {
            roots.into_iter().zip(chunk).for_each(|(root, &at)| bvh.nodes[at as usize] = root);
            bvh.nodes.extend(below);
        }
        bvh.primitive_indices = self.order;
    }

    /// The root of a balanced tree; the nodes below it go to `below`, whose first has the number `base`.
    fn halved<T: Boundable>(
        &self,
        places: Range<u32>,
        items: &[T],
        base: usize,
        below: &mut Vec<Bvh2Node>,
    ) -> Bvh2Node {
        if places.len() == 1 {
            return Bvh2Node::new(self.aabb(places.start, items), 1, places.start);
        }
        let (pair, middle) = (below.len(), places.start.midpoint(places.end));
        below.extend([Bvh2Node::default(); 2]);
        let halves = [places.start..middle, middle..places.end];
        let [left, right] = halves.map(|half| self.halved(half, items, base, below));
        below[pair..pair + 2].copy_from_slice(&[left, right]);
        Bvh2Node::new(left.aabb().union(right.aabb()), 0, (base + pair) as u32)
    }
}

/// Indices of items that share their centre with others, group by group, by size in each.
#[derive(Default)]
struct Groups {
    members: Vec<u32>,
    /// Where each group ends in `members`.
    ends: Vec<u32>,
}

/// In place of the number of a group: of an item in none, and of all but the first in one.
const ALONE: u32 = u32::MAX;
const WITH_ANOTHER: u32 = u32::MAX - 1;

impl Groups {
    /// Items of one centre have one hash; those of one hash are compared.
    fn of<T: Boundable + Sync>(items: &[T]) -> Self {
        let exact = |i: u32| {
            let b = items[i as usize].aabb();
            let middle = b.min + b.max + Vec3A::ZERO; // zero has one sign then
            (middle.to_array().map(f32::to_bits), b.half_area().to_bits(), i)
        };
        let key = |i: u32| xxh3_64(bytemuck::bytes_of(&exact(i).0)) & HASH | u64::from(i);
        let mut keys: Vec<_> = (0..items.len() as u32).into_par_iter().map(key).collect();
        keys.par_sort_unstable();
        let runs = keys.par_chunk_by(|a, b| a & HASH == b & HASH).filter(|run| run.len() > 1);
        let found = runs.fold(Self::default, |mut groups, run| {
            let mut alike: Vec<_> = run.iter().map(|&key| exact(key as u32)).collect();
            alike.sort_unstable();
            alike
                .chunk_by(|a, b| a.0 == b.0)
                .filter(|group| group.len() > 1)
                .for_each(|group| groups.add(group.iter().map(|one| one.2)));
            groups
        });
        found.reduce(Self::default, Self::and)
    }

    fn add(&mut self, group: impl Iterator<Item = u32>) {
        self.members.extend(group);
        self.ends.push(self.members.len() as u32);
    }

    fn and(mut self, other: Self) -> Self {
        let before = self.members.len() as u32;
        self.members.extend(other.members);
        self.ends.extend(other.ends.iter().map(|end| before + end));
        self
    }

    fn members(&self, group: u32) -> &[u32] {
        let start = group.checked_sub(1).map_or(0, |before| self.ends[before as usize]);
        &self.members[start as usize..self.ends[group as usize] as usize]
    }

    /// By item the number of its group, if it is the first in one, or what it is instead.
    fn places(&self, items: usize) -> Vec<u32> {
        let mut places = vec![ALONE; items];
        for group in 0..self.ends.len() as u32 {
            let members = self.members(group);
            members.iter().for_each(|&i| places[i as usize] = WITH_ANOTHER);
            let first = members.iter().min().expect("a group has several members");
            places[*first as usize] = group;
        }
        places
    }
}

/// The half of a key that is a hash; the other is an index.
const HASH: u64 = 0xffff_ffff << 32;
