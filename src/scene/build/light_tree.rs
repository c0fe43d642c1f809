//! The tree over the lights of a scene of many, from which `glsl/shared/light_tree.glsl` chooses one (Conty Estevez and Kulla 2018). It is
//! built from the root down: groups of lights are cut where, by power, extent and spread of directions, least is left together.
use super::encode::{encode_normal, encode_snorms};
use crate::layout::{LIGHT_LEAF, LIGHT_SPHERE, LIGHT_SPOT, Light, LightNode};
use crate::math::octahedral::octahedral_decode;
use crate::shaders::shared::light_tree::CHILDREN;
use glam::{Vec3, vec2};
use rayon::prelude::*;
use std::f32::consts::{FRAC_PI_2, PI};

/// Slabs between which a part is cut.
const BINS: usize = 16;
/// Lights from which on the parts of one are built side by side.
const PARALLEL: usize = 4096;
/// How much more a group whose lights shine in all directions costs than one in which they shine in the same, by the solid angles that
/// they light, as in section 4.4 of the paper.
const COST_OF_SPREAD: f32 = 3.0;

/// What the tree needs of a light.
#[derive(Clone, Copy, Debug)]
pub struct Lamp {
    /// Its index in the scene.
    index: u32,
    low: Vec3,
    high: Vec3,
    /// Corners of a triangle.
    corners: [Vec3; 3],
    /// Unit normal of a triangle, else 0.
    normal: Vec3,
    /// Unit direction in which it shines brightest; 0 where it shines all round or from both sides.
    axis: Vec3,
    /// Angle to `axis` beyond which it is dark, radians.
    edge: f32,
    /// In any unit.
    power: f32,
}

impl Lamp {
    /// The light `index`, which is within the scene. Of a triangle that shines from both sides `two_sided` says so.
    pub fn new(index: u32, light: &Light, power: f64, two_sided: bool) -> Self {
        let [a, b, c] = [light.a, light.b, light.c].map(Vec3::from);
        let normal = (b - a).as_dvec3().cross((c - a).as_dvec3()).normalize_or_zero().as_vec3();
        let [low, high] = match light.kind {
            _ if light.is_triangle() => [a.min(b).min(c), a.max(b).max(c)],
            LIGHT_SPHERE => [a - b.x, a + b.x],
            _ => [a, a],
        };
        let (normal, axis, edge) = match light.kind {
            LIGHT_SPOT => (Vec3::ZERO, b, c.y),
            _ if !light.is_triangle() => (Vec3::ZERO, Vec3::ZERO, PI),
            _ if two_sided => (normal, Vec3::ZERO, PI),
            _ => (normal, normal, FRAC_PI_2),
        };
        Self { index, low, high, corners: [a, b, c], normal, axis, edge, power: power as f32 }
    }

    fn middle(&self) -> Vec3 {
        0.5 * self.low + 0.5 * self.high
    }
}

/// The tree over `lamps`, which are chosen with `probability` in all, beside lights outside of it with theirs.
pub fn build(mut lamps: Vec<Lamp>, probability: f32, outside: &[(u32, f32)]) -> Vec<LightNode> {
    let total: f64 = lamps.iter().map(|lamp| f64::from(lamp.power)).sum();
    let unit = if total > 0.0 { f64::from(probability) / total } else { 0.0 };
    lamps.iter_mut().for_each(|lamp| lamp.power = ((f64::from(lamp.power) * unit) as f32).max(f32::MIN_POSITIVE));
    let all = Part::of(&mut lamps);
    let root = if all.lamps.is_empty() { LightNode::default() } else { all.node() };
    let mut nodes = vec![LightNode { power: probability, child: 1 + outside.len() as u32, ..root }];
    nodes.extend(outside.iter().map(|&(light, power)| LightNode { power, child: LIGHT_LEAF | light, ..root }));
    if !all.lamps.is_empty() {
        append(&mut nodes, &below(all));
    }
    nodes
}

/// The children of the node over a part, and all that is below them; indices count from the first of them.
fn below(part: Part) -> Vec<LightNode> {
    let many = part.lamps.len() > PARALLEL;
    let children = part.children();
    let mut nodes: Vec<_> = children.iter().map(Part::node).collect();
    let lights: Vec<_> = children.iter().map(|child| (child.lamps.len(), child.lamps[0].index)).collect();
    nodes.resize(CHILDREN as usize, LightNode { child: LIGHT_LEAF, ..LightNode::default() });
    let subtree = |child: Part| if child.lamps.len() > 1 { below(child) } else { Vec::new() };
    let subtrees: Vec<_> = match many {
        true => children.into_par_iter().map(subtree).collect(),
        false => children.into_iter().map(subtree).collect(),
    };
    for (i, ((count, light), subtree)) in lights.into_iter().zip(subtrees).enumerate() {
        nodes[i].child = if count > 1 { nodes.len() as u32 } else { LIGHT_LEAF | light };
        append(&mut nodes, &subtree);
    }
    nodes
}

/// Adds nodes whose indices count from the first of them.
fn append(nodes: &mut Vec<LightNode>, subtree: &[LightNode]) {
    let first = nodes.len() as u32;
    let moved = |node: &LightNode| LightNode { child: node.child + if is_leaf(node) { 0 } else { first }, ..*node };
    nodes.extend(subtree.iter().map(moved));
}

fn is_leaf(node: &LightNode) -> bool {
    node.child & LIGHT_LEAF != 0
}

/// Some of the lamps, and what they have in common.
struct Part<'a> {
    lamps: &'a mut [Lamp],
    group: Group,
}

impl<'a> Part<'a> {
    fn of(lamps: &'a mut [Lamp]) -> Self {
        let mut group = Group::NONE;
        lamps.iter().for_each(|lamp| group.add(lamp));
        Self { lamps, group }
    }

    /// A node without children. Angles are those to the axis as it is stored.
    fn node(&self) -> LightNode {
        /// Above what bounds lose by rounding, of 16 bits for angles.
        const SLACK: f32 = 3e-5;
        let Group { low, high, axis, power } = self.group;
        let plane = self.plane(SLACK * (high - low).length());
        let middle = 0.5 * low + 0.5 * high;
        let centre = plane.map_or(middle, |(at, normal)| middle - (middle - at).dot(normal) * normal);
        let axis = encode_normal(plane.map_or(axis, |(_, normal)| normal).try_normalize().unwrap_or(Vec3::Z));
        let (decoded, mut radius2, mut edge, mut mean) = (octahedral_decode(axis), 0.0f32, 0.0f32, 0.0);
        for lamp in self.lamps.iter() {
            radius2 = radius2.max((lamp.low - centre).abs().max((lamp.high - centre).abs()).length_squared());
            edge = edge.max(lamp.axis.dot(decoded).clamp(-1.0, 1.0).acos() + lamp.edge);
            mean += lamp.power / power * if lamp.normal == Vec3::ZERO { 0.0 } else { lamp.axis.dot(decoded) };
        }
        let radius = radius2.sqrt() * (1.0 + SLACK);
        let mean = if plane.is_some() { -1.0 } else { mean.max(0.0) };
        let beams = encode_snorms(vec2(edge.min(PI).cos() - SLACK, mean));
        LightNode { centre: centre.into(), radius, axis, beams, power, ..LightNode::default() }
    }

    /// A point and the normal of the plane in which all lamps lie but for `rounding`, if there is one and they all shine from their front, or
    /// all from both sides.
    fn plane(&self, rounding: f32) -> Option<(Vec3, Vec3)> {
        let Lamp { corners: [at, ..], normal, axis, .. } = self.lamps[0];
        let beside = |lamp: &Lamp| {
            let same = if axis == Vec3::ZERO { lamp.normal.dot(normal).abs() } else { lamp.axis.dot(normal) };
            same > 0.999_999
                && (lamp.axis == Vec3::ZERO) == (axis == Vec3::ZERO)
                && lamp.corners.iter().all(|corner| (corner - at).dot(normal).abs() <= rounding)
        };
        (normal != Vec3::ZERO && self.lamps.iter().all(beside)).then_some((at, normal))
    }

    /// As many parts as a node has children, or as there are lamps: the dearest of them is halved again and again.
    fn children(self) -> Vec<Self> {
        let mut parts = vec![self];
        while parts.len() < CHILDREN as usize {
            let several = (0..parts.len()).filter(|&i| parts[i].lamps.len() > 1);
            let cost = |i: usize| parts[i].group.cost();
            let Some(dearest) = several.max_by(|&i, &j| cost(i).total_cmp(&cost(j))) else { break };
            let halves = parts.swap_remove(dearest).halves();
            parts.extend(halves);
        }
        parts
    }

    /// Two parts, cut across the longest extent of the middles of lamps, where it leaves the least cost.
    fn halves(self) -> [Self; 2] {
        let lamps = self.lamps;
        let (low, high) = lamps.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), lamp| {
            (low.min(lamp.middle()), high.max(lamp.middle()))
        });
        let axis = (high - low).max_position();
        let scale = BINS as f32 / (high - low)[axis];
        if !scale.is_finite() || scale == 0.0 {
            let (one, other) = lamps.split_at_mut(lamps.len() / 2); // all are in one place, or further apart than numbers tell
            return [Self::of(one), Self::of(other)];
        }
        let bin_of = |lamp: &Lamp| (((lamp.middle()[axis] - low[axis]) * scale) as usize).min(BINS - 1);
        let mut bins = [Group::NONE; BINS];
        lamps.iter().for_each(|lamp| bins[bin_of(lamp)].add(lamp));
        let (end, groups) = cheapest(&bins);
        let mut before = 0;
        for i in 0..lamps.len() {
            if bin_of(&lamps[i]) < end {
                lamps.swap(i, before);
                before += 1;
            }
        }
        let (one, other) = lamps.split_at_mut(before);
        [Self { lamps: one, group: groups[0] }, Self { lamps: other, group: groups[1] }]
    }
}

/// The two groups of neighbouring bins that cost least, and the first bin of the second. The first and the last bin have lamps.
fn cheapest(bins: &[Group; BINS]) -> (usize, [Group; 2]) {
    let mut after = [Group::NONE; BINS + 1];
    (0..BINS).rev().for_each(|i| after[i] = after[i + 1].joined(&bins[i]));
    let (mut before, mut best, mut least) = (Group::NONE, (1, [bins[0], after[1]]), f32::INFINITY);
    for end in 1..BINS {
        before = before.joined(&bins[end - 1]);
        let cost = before.cost() + after[end].cost();
        if cost < least {
            (best, least) = ((end, [before, after[end]]), cost);
        }
    }
    best
}

/// What a group of lamps has in common.
#[derive(Clone, Copy)]
struct Group {
    low: Vec3,
    high: Vec3,
    /// Sum of their axes by power.
    axis: Vec3,
    power: f32,
}

impl Group {
    const NONE: Self = Self { low: Vec3::INFINITY, high: Vec3::NEG_INFINITY, axis: Vec3::ZERO, power: 0.0 };

    fn add(&mut self, lamp: &Lamp) {
        self.low = self.low.min(lamp.low);
        self.high = self.high.max(lamp.high);
        self.axis += lamp.power * lamp.axis;
        self.power += lamp.power;
    }

    fn joined(&self, other: &Self) -> Self {
        Self {
            low: self.low.min(other.low),
            high: self.high.max(other.high),
            axis: self.axis + other.axis,
            power: self.power + other.power,
        }
    }

    /// How much the bounds of the group leave open.
    fn cost(&self) -> f32 {
        let spread = 1.0 - (self.axis.length() / self.power).min(1.0);
        self.power * (self.high - self.low).length_squared() * (1.0 + COST_OF_SPREAD * spread)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::{LIGHT_POINT, LIGHT_TRIANGLE};
    use crate::math::octahedral::snorms;
    use glam::vec3;

    /// Squares of light in clusters, every seventh a point.
    fn lamps(count: u32) -> Vec<Lamp> {
        let unit = |i: u32| crate::math::hash::unit_interval(crate::math::hash::pcg(i));
        let point = |i: u32| vec3(unit(3 * i), unit(3 * i + 1), unit(3 * i + 2)) - 0.5;
        let lamp = |i: u32| {
            let middle = 9.0 * point(i % 5) + point(i + 100);
            let [a, b, c] = [1, 2, 3].map(|k| (middle + 0.1 * point(i + k * 100_000)).to_array());
            let kind = if i % 7 == 6 { LIGHT_POINT } else { LIGHT_TRIANGLE };
            Lamp::new(i, &Light { a, b, c, kind, ..Light::default() }, f64::from(unit(i) + 0.1), false)
        };
        (0..count).map(lamp).collect()
    }

    /// Lights below a node, with those of what they reach that it does not hold.
    fn lights_below(nodes: &[LightNode], index: usize, lamps: &[Lamp], stray: &mut usize) -> Vec<u32> {
        let node = &nodes[index];
        let below = match is_leaf(node) {
            true => vec![node.child & !LIGHT_LEAF],
            false => {
                let children = node.child as usize..(node.child + CHILDREN) as usize;
                let real = children.filter(|&i| nodes[i].power > 0.0);
                real.flat_map(|i| lights_below(nodes, i, lamps, stray)).collect()
            }
        };
        let (axis, [edge, _]) = (octahedral_decode(node.axis), snorms(node.beams));
        let strays = |&&i: &&u32| {
            let lamp = &lamps[i as usize];
            let ends = [lamp.low, lamp.high].map(|p| p.distance(node.centre.into()) <= node.radius + 1e-5);
            let within = (lamp.axis.dot(axis).clamp(-1.0, 1.0).acos() + lamp.edge).min(PI).cos() >= edge;
            ends != [true; 2] || !within
        };
        *stray += below.iter().filter(strays).count();
        below
    }

    #[test]
    fn every_light_is_in_one_leaf_and_within_all_nodes_above_it() {
        for count in [1, 2, 4, 5, 9, 64, 65, 1000, 10_000] {
            let lamps = lamps(count);
            let mut nodes = build(lamps.clone(), 0.75, &[(count, 0.25)]);
            let (mut stray, all) = (0, (0..count).collect::<Vec<_>>());
            let mut found = lights_below(&nodes, 0, &lamps, &mut stray);
            found.sort_unstable();
            assert!(found == all && stray == 0, "{count}: {stray} strays");
            assert_eq!((nodes[0].power, nodes[1].power, nodes[1].child), (0.75, 0.25, LIGHT_LEAF | count));
            let children = &nodes[2..2 + CHILDREN as usize];
            assert!((children.iter().map(|n| n.power).sum::<f32>() - 0.75).abs() < 1e-5);
            nodes[2].radius *= 0.9;
            nodes[2].beams = encode_snorms(vec2(1.0, 1.0));
            lights_below(&nodes, 0, &lamps, &mut stray);
            assert!(stray > 0, "control, {count}: smaller bounds");
        }
    }

    #[test]
    fn only_lamps_in_one_plane_are_taken_to_lie_there() {
        let fan = |lift: f32| {
            let lamp = |i, corners: [Vec3; 3]| {
                let [a, b, c] = corners.map(|p| p.to_array());
                Lamp::new(i, &Light { a, b, c, kind: LIGHT_TRIANGLE, ..Light::default() }, 1.0, false)
            };
            let rim = [vec3(0.2, 0.0, 0.0), vec3(0.2, 0.2, lift), vec3(0.0, 0.2, 0.0)];
            let lamps = vec![lamp(0, [Vec3::ZERO, rim[0], rim[1]]), lamp(1, [Vec3::ZERO, rim[1], rim[2]])];
            snorms(build(lamps, 1.0, &[])[0].beams)[1]
        };
        assert!(fan(0.0) == -1.0 && fan(1e-7) == -1.0 && fan(1e-4) > 0.99);
    }

    #[test]
    fn threads_do_not_change_the_tree_nor_do_lamps_in_one_place_end_it() {
        let lamps = lamps(20_000);
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| build(lamps.clone(), 1.0, &[]))
        };
        assert_eq!(on(1), on(3));
        let same = vec![lamps[0]; 1000];
        assert!(build(same, 1.0, &[]).len() < 3000);
        let far = |x| Lamp { low: vec3(x, 0.0, 0.0), high: vec3(x, 0.0, 0.0), ..lamps[0] };
        assert!(build([3e38, -3e38].map(far).repeat(8), 1.0, &[]).len() < 50);
        assert_eq!(build(Vec::new(), 0.0, &[(0, 1.0)]).len(), 2);
    }
}
