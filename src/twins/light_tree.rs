//! Twin of `glsl/shared/light_tree.glsl`.
use crate::layout::{LIGHT_DIRECTIONAL, LIGHT_LEAF, LIGHT_SPOT, Light, LightNode, NONE};
use crate::math::hash::{pcg, unit_interval, word_of_unit};
use crate::math::octahedral::{octahedral_decode, snorms};
use crate::scene::Scene;
use crate::shaders::shared::light::{EVEN_SHARE, KEY_PROBABILITY, MAX_ODDS};
use crate::shaders::shared::light_tree::{CHILDREN, COSINE_SLACK, LARGEST_SEEN, LEAST_COSINES, UNIT_STEP, WORD};
use crate::shaders::shared::pcg::BELOW_ONE;
use glam::Vec3;

/// What light is sampled for.
#[derive(Clone, Copy, Debug)]
pub struct Receiver {
    /// World units.
    pub position: Vec3,
    /// Unit normal of the lobes, on the viewer's side.
    pub normal: Vec3,
    /// Whether light from the other side counts, too.
    pub lets_light_through: bool,
    /// Added to the cosine in the odds of a light, for lobes that reflect more than the cosine says.
    pub odds_beyond_cosine: f32,
    /// Unit vector towards the viewer.
    pub viewer: Vec3,
    /// By which the lobe around the mirror image of the viewer counts beside the cosine; 0 without that lobe.
    pub gloss: f32,
    /// Squared roughness of that lobe, above 0.
    pub alpha2: f32,
}

impl Receiver {
    /// A point that light from everywhere reaches alike.
    pub fn point(position: Vec3) -> Self {
        Self {
            position,
            normal: Vec3::ZERO,
            lets_light_through: true,
            odds_beyond_cosine: 1.0,
            viewer: Vec3::Z,
            gloss: 0.0,
            alpha2: 1.0,
        }
    }

    /// What the odds of lights along `w` get for the lobe around the mirror image of the viewer, where they fill a cone around `w`: `spread`
    /// is half of 1 - cosine of half its angle.
    pub fn odds_of_lobe(&self, w: Vec3, spread: f32) -> f32 {
        let (h, alpha2) = (self.viewer + w, self.alpha2 + spread);
        let along = self.normal.dot(h);
        let (across2, along2) = ((h - along * self.normal).length_squared(), along.max(0.0).powi(2));
        let shape = (across2 + along2) / (across2 + alpha2 * along2).max(1e-30);
        self.gloss * alpha2 * shape * shape
    }
}

/// The light without extent that a point chooses most often.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeyLight {
    /// Index of the light; [`NONE`] without one.
    pub index: u32,
    /// Probability of the choice.
    pub probability: f32,
    /// That of the likeliest other light without extent; 0 without one.
    pub rival: f32,
}

impl KeyLight {
    /// That of a point none of whose lights has been considered.
    pub const NONE: Self = Self { index: NONE, probability: 0.0, rival: 0.0 };

    /// Takes a light without extent for it, if it is chosen more often than those before; else it may be their rival.
    pub fn consider(&mut self, index: u32, probability: f32) {
        if probability > self.probability {
            *self = Self { index, probability, rival: self.probability };
        } else {
            self.rival = self.rival.max(probability);
        }
    }

    /// The share of its light that is kept apart, 0 to 1: 0 where another light becomes the key light.
    pub fn kept_share(&self) -> f32 {
        if self.probability <= KEY_PROBABILITY {
            return 0.0;
        }
        let rival = self.rival / self.probability;
        (self.probability / KEY_PROBABILITY - 1.0).min(1.0) * (1.0 - rival * rival)
    }
}

/// Share of a spot's intensity along `w`, from the point that it lights.
pub fn spot_share(light: &Light, w: Vec3) -> f32 {
    let axis = Vec3::from(light.b);
    let angle = axis.cross(w).length().atan2(-axis.dot(w));
    let [full, cut, _] = light.c;
    ((cut - angle) / (cut - full).max(1e-6)).clamp(0.0, 1.0)
}

fn mean_cosine(cosine: f32, m: f32, share: f32) -> f32 {
    let (along, across) = (m * cosine, (0.6 * (1.0 - m)).min(0.25));
    let spread = across + ((0.25 - 0.5 * m).max(0.0) - across) * cosine * cosine;
    0.5 * (along + (along * along + share * spread).sqrt())
}

/// About what the lights below a node bring to a receiver, up to a factor that all nodes have; 0 only if they bring nothing.
pub fn brought_by(scene: &Scene, node: &LightNode, r: &Receiver) -> f32 {
    let (to_node, axis) = (Vec3::from(node.centre) - r.position, octahedral_decode(node.axis));
    let centre2 = to_node.length_squared();
    let inverse = 1.0 / centre2.max(1e-30).sqrt();
    let (w, within) = (to_node * inverse, (node.radius * inverse).min(1e15));
    let (seen, slack) = ((1.0 - within * within).max(0.0).sqrt(), COSINE_SLACK * (1.0 + within));
    let towards = if within < 1.0 { 0.5 + 0.5 * seen } else { 0.5 / within };
    let (cosine, beam, tilt) = (r.normal.dot(w), -axis.dot(w), r.normal.dot(axis));
    let [edge, mean] = snorms(node.beams);
    let in_a_plane = mean < 0.0;
    let both_sides = in_a_plane && edge < -0.5;
    let share = if in_a_plane { (1.0 - tilt * tilt).max(0.0) } else { 1.0 };
    let behind = if r.lets_light_through { mean_cosine(-cosine, towards, share) } else { 0.0 };
    let arrives = mean_cosine(cosine, towards, share) + behind;
    let faced = r.lets_light_through || cosine > -within * share.sqrt() - slack;
    let nearest = if beam >= seen { 1.0 } else { beam * seen + (1.0 - beam * beam).max(0.0).sqrt() * within };
    let lit = both_sides || if in_a_plane { beam > -slack } else { within >= 1.0 || nearest > edge - slack };
    let m = if in_a_plane { 1.0 } else { mean } * towards;
    let front = mean_cosine(beam, m, 1.0);
    let emits = if both_sides { 0.5 * (front + mean_cosine(-beam, m, 1.0)) } else { front };
    let leaf = (node.child & LIGHT_LEAF != 0).then(|| &scene.lights[(node.child & !LIGHT_LEAF) as usize]);
    let emits = leaf.filter(|light| light.kind == LIGHT_SPOT).map_or(emits, |light| emits * spot_share(light, w));
    let reflects = arrives + r.odds_beyond_cosine + r.odds_of_lobe(w, 0.5 - 0.5 * seen);
    let brings = (emits * reflects).max(LEAST_COSINES) * node.power;
    let d2 = centre2.max(0.25 * node.radius * node.radius).max(1e-30);
    if faced && lit { (brings / d2).min(MAX_ODDS) } else { 0.0 }
}

/// The light that `u` chooses, and the probability of the choice, which is 0 if no light brings anything.
pub fn choose_by_tree(scene: &Scene, r: &Receiver, mut u: f32, mut bits: u32) -> (u32, f32) {
    let mut at = scene.light_nodes[0].child;
    let (mut probability, mut by_odds) = (1.0, 1.0 - EVEN_SHARE);
    loop {
        let nodes = &scene.light_nodes[at as usize..(at + CHILDREN) as usize];
        let brings: Vec<f32> = nodes.iter().map(|node| brought_by(scene, node, r)).collect();
        let sum: f32 = brings.iter().sum();
        let number = brings.iter().filter(|b| **b > 0.0).count() as f32;
        let (mut before, mut start, mut share, mut odds_here) = (0.0, 0.0, 0.0, 0.0);
        for (node, brings) in nodes.iter().zip(brings).filter(|(_, brings)| *brings > 0.0) {
            let odds = brings / sum;
            let part = 1.0 / number * (1.0 - by_odds) + odds * by_odds;
            if u >= before {
                (at, start, share, odds_here) = (node.child, before, part, odds);
            }
            before += part;
        }
        if share == 0.0 {
            return (0, 0.0);
        }
        probability *= share;
        if at & LIGHT_LEAF != 0 {
            return (at & !LIGHT_LEAF, probability);
        }
        by_odds = (by_odds * odds_here / share).min(1.0);
        u = ((u - start + UNIT_STEP * unit_interval(bits)) / share).min(BELOW_ONE);
        bits = pcg(bits);
    }
}

/// A light that a random word chooses.
#[derive(Clone, Copy, Debug)]
pub struct Choice {
    /// Its index.
    pub light: u32,
    /// What is left of the word.
    pub rest: u32,
    /// The probability of the choice; 0 if no light can bring anything.
    pub probability: f32,
    /// The key light among those that lie beside the tree.
    pub key: KeyLight,
}

/// The light that `word` chooses, in a scene with a tree.
pub fn choose_light(scene: &Scene, r: &Receiver, word: u32) -> Choice {
    let (hash, root, place) = (pcg(word), &scene.light_nodes[0], !word);
    let (mut begin, mut chosen) = (0, Choice { light: 0, rest: word, probability: 0.0, key: KeyLight::NONE });
    for outside in &scene.light_nodes[1..root.child as usize] {
        let words = ((outside.power.min(BELOW_ONE) * 4294967296.0) as u32).min(!begin);
        if words > 0 && place >= begin {
            let rest = word_of_unit(((place - begin) as f32 + unit_interval(hash)) / words as f32, hash);
            let probability = words as f32 * WORD;
            chosen = Choice { light: outside.child & !LIGHT_LEAF, rest, probability, ..chosen };
        }
        begin += words;
        let beside = outside.child & !LIGHT_LEAF;
        if !scene.weighed_lights && scene.lights[beside as usize].kind == LIGHT_DIRECTIONAL {
            chosen.key.consider(beside, words as f32 * WORD);
        }
    }
    chosen.key.rival = 0.0; // they are chosen as often everywhere, so that none takes another's place elsewhere
    if root.power > 0.0 && place >= begin {
        let u = unit_interval(word) + UNIT_STEP * unit_interval(hash);
        let by_tree = if begin > 0 { begin.wrapping_neg() as f32 * WORD } else { root.power };
        let (light, probability) = choose_by_tree(scene, r, (u / by_tree).min(BELOW_ONE), pcg(hash));
        return Choice { light, rest: word, probability: by_tree * probability, ..chosen };
    }
    chosen
}

/// The density per solid angle that MIS takes for a point of a lamp of the tree, which is seen under `solid_angle` from `p` and has this
/// `density` over area by the table.
pub fn nominal_pdf(scene: &Scene, density: f32, solid_angle: f32, p: Vec3) -> f32 {
    let all = &scene.light_nodes[0];
    let to_all = Vec3::from(all.centre) - p;
    let others = 0.5 * all.power / to_all.length_squared().max(all.radius * all.radius).max(1e-30);
    let own = density * solid_angle.min(LARGEST_SEEN);
    all.power * own / ((own + others) * solid_angle).max(1e-37)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mean_cosines_are_those_of_caps() {
        for c in [-1.0, -0.6, 0.0, 0.3, 1.0f32] {
            // One direction, a hemisphere and all directions.
            for (m, exact) in [(1.0, c.max(0.0)), (0.5, 0.25 + 0.25 * c), (0.0, 0.25)] {
                assert!((mean_cosine(c, m, 1.0) - exact).abs() < 1e-6, "{m}, {c}");
            }
            // A cap down to the cosine 0.6, whose mean has length 0.8, by quadrature.
            let (mut sum, n) = (0.0, 400u16);
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let [u, v] = [i, j].map(|i| (f32::from(i) + 0.5) / f32::from(n));
                let z = 1.0 - 0.4 * u;
                let x = (1.0 - z * z).sqrt() * (2.0 * std::f32::consts::PI * v).cos();
                sum += f64::from((z * c + x * (1.0 - c * c).sqrt()).max(0.0));
            }
            let exact = sum / f64::from(n).powi(2);
            assert!((f64::from(mean_cosine(c, 0.8, 1.0)) - exact).abs() < 0.025, "{c}: {exact}");
            assert!(c < 0.0 || (f64::from(mean_cosine(c, 0.4, 1.0)) - exact).abs() > 0.003, "control, {c}");
        }
    }
}
