//! Statistics of light sampling on its CPU twin: directions follow the densities by which MIS weighs the same light when a bounce
//! finds it.
use crate::statistics::{chi_square, sidak};
use crate::twin::{Random, Workplace, many_lamps, many_lamps_and};
use glam::{Mat3, Vec3, dvec3, vec3};
use std::f64::consts::{PI, TAU};
use tallow::layout::{
    LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT, LIGHT_LEAF, LIGHT_POINT, LIGHT_SPOT, Light, MATERIAL_EMITS_BEHIND, NONE,
};
use tallow::math::hash::{pcg, unit_interval};
use tallow::math::srgb::luminance;
use tallow::scene::Loaded;
use tallow::shaders::shared::light::{EVEN_SHARE, KEY_PROBABILITY};
use tallow::shaders::shared::light_tree::CHILDREN;
use tallow::twins::light::*;
use tallow::twins::light_tree::{Choice, brought_by, choose_by_tree, choose_light, spot_share};
use tallow::twins::sampler::{sample_2d, sample_2d_bits, sampler_start};
use tallow::twins::scene::triangle_vertices;
use tallow::twins::surface::{Surface, surface_at, surface_emission};
use tallow::twins::traverse::{Hit, intersect_triangle, ray_space};

/// From where lights are seen.
const HERE: Vec3 = vec3(0.2, -0.1, 0.3);
const COLUMNS: usize = 32;
const ROWS: usize = 16;
/// Quadrature points per cell and axis.
const POINTS: usize = 32;

/// Cells of all directions in latitude and longitude, turned as the sky is: every texel holds whole cells.
struct Grid {
    world_from_sky: Mat3,
}

impl Grid {
    fn new(scene: &Loaded) -> Self {
        let sky = scene.lights.iter().find(|l| l.kind == LIGHT_ENVIRONMENT);
        let axes = |l: &Light| Mat3::from_cols(l.a.into(), l.b.into(), l.c.into());
        Self { world_from_sky: sky.map_or(Mat3::IDENTITY, axes) }
    }

    fn cell(&self, direction: Vec3) -> usize {
        let d = (self.world_from_sky.transpose() * direction).as_dvec3();
        let u = d.x.atan2(-d.z).rem_euclid(TAU) / TAU;
        let v = d.y.clamp(-1.0, 1.0).acos() / PI;
        let index = |v: f64, n: usize| ((v * n as f64) as usize).min(n - 1);
        index(v, ROWS) * COLUMNS + index(u, COLUMNS)
    }

    /// Directions inside the cells: index of the cell, direction, solid angle.
    fn directions(&self) -> impl Iterator<Item = (usize, Vec3, f64)> {
        let (columns, rows) = (COLUMNS * POINTS, ROWS * POINTS);
        (0..columns * rows).map(move |i| {
            let (x, y) = (i % columns, i / columns);
            let (sin_phi, cos_phi) = (TAU * (x as f64 + 0.5) / columns as f64).sin_cos();
            let (sin, cos) = (PI * (y as f64 + 0.5) / rows as f64).sin_cos();
            let direction = dvec3(sin_phi * sin, cos, -cos_phi * sin);
            let area = TAU * PI * sin / (columns * rows) as f64;
            (y / POINTS * COLUMNS + x / POINTS, self.world_from_sky * direction.as_vec3(), area)
        })
    }

    /// Integrals over the cells of what is claimed.
    fn integrate(&self, scene: &Loaded) -> Vec<f64> {
        let mut cells = vec![0.0; COLUMNS * ROWS];
        self.directions().for_each(|(cell, direction, area)| cells[cell] += density(scene, direction) * area);
        cells
    }
}

/// Of the sky, and of every emissive triangle that shines from that direction.
fn density(scene: &Loaded, direction: Vec3) -> f64 {
    let sky = scene.lights.iter().find(|l| l.kind == LIGHT_ENVIRONMENT);
    let sky = sky.map_or(0.0, |l| environment_radiance(scene, l, direction).1);
    let pdf = |(s, t): (Surface, f32)| triangle_light_pdf(scene, &s, HERE, t, s.geometric.dot(direction).abs());
    f64::from(sky) + hit(scene, direction).map(pdf).map(f64::from).sum::<f64>()
}

/// The lamps in a direction from [`HERE`] that shine there, and how far they are.
fn hit(scene: &Loaded, direction: Vec3) -> impl Iterator<Item = (Surface, f32)> {
    let ray = ray_space(HERE, direction);
    (0..scene.triangles.len() as u32).filter_map(move |triangle| {
        let (t, barycentric) = intersect_triangle(&ray, triangle_vertices(scene, triangle), INFINITE_DISTANCE)?;
        let s = surface_at(scene, &Hit { t, triangle, instance: NONE, barycentric });
        let behind = scene.materials[s.material as usize].flags & MATERIAL_EMITS_BEHIND != 0;
        (s.geometric.dot(direction) < 0.0 || behind).then_some((s, t))
    })
}

fn samples(scene: &Loaded, count: u32, seed: u32) -> impl Iterator<Item = LightSample> {
    (0..count).map(move |i| {
        let s = sampler_start(0, i, seed, true);
        light_sample(scene, &Receiver::point(HERE), sample_2d_bits(s, 0)[0], sample_2d(s, 1))
    })
}

const LAMP: [Vec3; 3] = [vec3(-1.0, -0.8, -1.2), vec3(1.6, -0.5, -0.6), vec3(0.1, 1.2, -2.0)];

fn one_lamp() -> Loaded {
    let place = Workplace::new().obj("lamp.obj", &[LAMP]);
    let text = "[[material]]\nname = 'a'\nemission = [2.0, 3.0, 5.0]\n[[mesh]]\nfile = 'lamp.obj'\nmaterial = 'a'\n";
    let scene = place.scene(text);
    assert!(scene.large_lamps, "sampled by solid angle");
    scene
}

fn constant_sky() -> Loaded {
    Workplace::new().scene("[environment]\nradiance = [2.0, 3.0, 5.0]\n")
}

/// A sun, a gradient, and a part that is black.
fn image_sky(width: u32, height: u32) -> Loaded {
    let light = |x: u32, y: u32| match (2 * x / width, y) {
        (_, 1) if x == width - 1 => 40.0,
        (0, _) => 0.0,
        _ => 0.3 + 0.1 * (x + 2 * y) as f32,
    };
    let place = Workplace::new().sky("sky.exr", width, height, light);
    place.scene("[environment]\nfile = 'sky.exr'\nrotation = 70.0\nscale = 0.5\n")
}

/// Triangles of three strengths, half of which face away and some shine from both sides, below an image, with lights that no ray can hit.
fn many_lights() -> Loaded {
    // Some seeds make a triangle that is seen nearly edge-on, for which the grid's quadrature is too coarse (5 does).
    let mut random = Random::new(6);
    let mut triangle = || {
        let centre = HERE + 3.0 * random.point().normalize();
        [0; 3].map(|_| centre + 0.5 * random.point())
    };
    let mut place = Workplace::new().sky("sky.exr", 16, 8, |x, y| 0.02 * (1 + x + 3 * y) as f32);
    let mut text = "[environment]\nfile = 'sky.exr'\nrotation = 25.0\n".to_owned();
    for (name, emission) in
        [("a", "1.0"), ("b", "[9.0, 2.0, 1.0]\nemission_two_sided = true"), ("c", "30.0"), ("dark", "0.0")]
    {
        place = place.obj(&format!("{name}.obj"), &[0; 9].map(|_| triangle()));
        text += &format!("[[material]]\nname = '{name}'\nemission = {emission}\n");
        text += &format!("[[mesh]]\nfile = '{name}.obj'\nmaterial = '{name}'\n");
    }
    text += "[[light]]\ntype = 'point'\nposition = [0.0, 2.0, 0.0]\nintensity = 3.0\n\
             [[light]]\ntype = 'spot'\nposition = [0.0, 3.0, 0.0]\ndirection = [0.0, -1.0, 0.0]\nintensity = 9.0\n\
             [[light]]\ntype = 'directional'\ndirection = [0.0, -1.0, 0.2]\nirradiance = 0.5\n";
    let mut scene = place.scene(&text);
    scene.light_nodes.clear();
    scene.weighed_lights = false;
    scene
}

/// Lights of a kind, all at one place or from one direction.
fn lights(kind: &str, intensity: u32, count: usize) -> String {
    let (place, power) = match kind {
        "directional" => ("direction = [0.0, -1.0, 0.0]", "irradiance"),
        "spot" => ("position = [0.0, 1.0, 0.0]\ndirection = [0.0, -1.0, 0.0]", "intensity"),
        _ => ("position = [0.0, 1.0, 0.0]", "intensity"),
    };
    format!("[[light]]\ntype = '{kind}'\n{place}\n{power} = {intensity}\n").repeat(count)
}

#[test]
fn lights_that_are_dark_count_for_nothing() {
    let of = |text: &str| {
        let scene = Workplace::new().scene(text);
        (scene.weighed_lights, scene.has_light_tree())
    };
    let (one, several, many) = ((false, false), (true, false), (false, true));
    for (kind, of_many) in [("spot", many), ("point", many), ("directional", one)] {
        let found = [(1, 0), (1, 1), (32, 0), (32, 5), (33, 0), (33, 5)]
            .map(|(lit, dark)| of(&(lights(kind, 1, lit) + &lights(kind, 0, dark))));
        assert_eq!(found, [one, several, several, several, of_many, of_many], "{kind}");
    }
    for (points, suns, expected) in [(1, 1, several), (31, 1, several), (31, 2, many)] {
        let found = of(&(lights("point", 1, points) + &lights("directional", 1, suns)));
        assert_eq!(found, expected, "{points} points, {suns} suns");
    }
}

#[test]
fn lamps_that_shine_from_both_sides_have_twice_the_power() {
    let place = Workplace::new().obj("one.obj", &[LAMP]).obj("two.obj", &[LAMP.map(|p| p + 3.0)]);
    let lamp = |name: &str, more| {
        format!(
            "[[material]]\nname = '{name}'\nemission = 1.0\n{more}[[mesh]]\nfile = '{name}.obj'\nmaterial = '{name}'\n"
        )
    };
    let scene = place.scene(&(lamp("one", "") + &lamp("two", "emission_two_sided = true\n")));
    let probability = |behind| {
        let flags = |l: &&Light| scene.materials[l.material as usize].flags & MATERIAL_EMITS_BEHIND != 0;
        scene.lights.iter().find(|l| flags(l) == behind).unwrap().probability
    };
    assert!((probability(true) - 2.0 / 3.0).abs() < 1e-6 && (probability(false) - 1.0 / 3.0).abs() < 1e-6);
}

fn single_lights() -> [(&'static str, Loaded); 4] {
    let mut by_area = one_lamp();
    by_area.large_lamps = false;
    [
        ("triangle", one_lamp()),
        ("triangle by area", by_area),
        ("constant sky", constant_sky()),
        ("image sky", image_sky(16, 8)),
    ]
}

#[test]
fn directions_follow_the_density() {
    const COUNT: u32 = 200_000;
    let scenes = [single_lights().to_vec(), vec![("many lights", many_lights())]].concat();
    let level = sidak(scenes.len());
    for (seed, (name, scene)) in scenes.iter().enumerate() {
        let grid = Grid::new(scene);
        let mut expected: Vec<f64> = grid.integrate(scene).iter().map(|p| p * f64::from(COUNT)).collect();
        // The last cell: what faces away, and lights that are points.
        expected.push((f64::from(COUNT) - expected.iter().sum::<f64>()).max(0.0));
        let mut observed = vec![0.0; expected.len()];
        for s in samples(scene, COUNT, seed as u32) {
            observed[if s.pdf > 0.0 { grid.cell(s.direction) } else { COLUMNS * ROWS }] += 1.0;
        }
        let p = chi_square(&observed, &expected);
        assert!(p > level, "{name}: p = {p:.1e}");
        let planted: Vec<f64> = expected.iter().map(|e| 1.03 * e).collect();
        assert!(chi_square(&observed, &planted) < level, "{name}: the test cannot see a density that is 3 % off");
    }
}

#[test]
fn lights_are_drawn_with_their_probabilities() {
    let mut scene = many_lights();
    assert_eq!(scene.lights.len(), 31, "27 triangles, three lights and the sky");
    let p = |scene: &Loaded| {
        let mut observed = vec![0.0; scene.lights.len()];
        let words = (0..1 << 18).map(|i| sample_2d_bits(sampler_start(0, i, 9, true), 0)[0]);
        words.for_each(|word| observed[alias_choose(&scene.light_table, word).0 as usize] += 1.0);
        let expected: Vec<_> = scene.lights.iter().map(|l| f64::from(l.probability) * f64::from(1 << 18)).collect();
        chi_square(&observed, &expected)
    };
    assert!(p(&scene) > sidak(1));
    scene.light_table.iter_mut().for_each(|entry| entry.threshold -= entry.threshold / 20);
    assert!(p(&scene) < sidak(1), "control: thresholds that are 5 % off");
}

/// Probabilities of the lights of a tree: most of the choices go by what is brought all the way down, the others are even at every node.
fn by_tree(scene: &Loaded, r: &Receiver) -> Vec<f64> {
    let mut found = vec![0.0; scene.lights.len()];
    let mut open = vec![(scene.light_nodes[0].child, 1.0, 1.0)];
    while let Some((at, by_odds, even)) = open.pop() {
        if at & LIGHT_LEAF != 0 {
            let share = f64::from(EVEN_SHARE);
            found[(at & !LIGHT_LEAF) as usize] = (1.0 - share) * by_odds + share * even;
            continue;
        }
        let nodes = &scene.light_nodes[at as usize..(at + CHILDREN) as usize];
        let brings: Vec<_> = nodes.iter().map(|node| f64::from(brought_by(scene, node, r))).collect();
        let (sum, number) = (brings.iter().sum::<f64>(), brings.iter().filter(|b| **b > 0.0).count() as f64);
        let lit = nodes.iter().zip(brings).filter(|(_, brings)| *brings > 0.0);
        open.extend(lit.map(|(node, brings)| (node.child, by_odds * brings / sum, even / number)));
    }
    found
}

/// A floor, a glossy one, a pane of glass that has light behind it, and a point.
fn receivers() -> [Receiver; 4] {
    let floor =
        Receiver { normal: Vec3::Y, lets_light_through: false, odds_beyond_cosine: 0.0, ..Receiver::point(HERE) };
    let glossy = Receiver { viewer: vec3(0.6, 0.8, 0.0), gloss: 2.0, alpha2: 0.01, ..floor };
    [floor, glossy, Receiver { lets_light_through: true, ..floor }, Receiver::point(HERE)]
}

/// So many words, a power of two, each in its own part of all.
fn words(count: u32) -> impl Iterator<Item = u32> {
    let bits = count.ilog2();
    (0..count).map(move |i| i << (32 - bits) | pcg(i) >> bits)
}

#[test]
fn a_tree_draws_lights_with_their_probabilities() {
    // Of a hundred thousand lamps each is drawn alone about once, and steps down the tree use up the digits of a number.
    let crowd: Vec<_> = (0..100_000).map(|i| corners(i, vec3(30.0, 1.0, 30.0))).collect();
    let text = "[[material]]\nname = 'a'\nemission = 1.0\n[[mesh]]\nfile = 'crowd.obj'\nmaterial = 'a'\n";
    let crowd = Workplace::new().obj("crowd.obj", &crowd).scene(text);
    for (name, scene, alike, count) in [("few", many_lamps(40), 1, 1 << 18), ("crowd", crowd, 256, 1 << 16)] {
        assert!(scene.has_light_tree(), "{name}");
        for r in receivers() {
            let claimed = by_tree(&scene, &r);
            let mut observed = vec![0.0; scene.lights.len().div_ceil(alike) + 1];
            let mut expected = observed.clone();
            claimed.iter().enumerate().for_each(|(i, p)| expected[i / alike] += p * f64::from(count));
            let whole = observed.len() - 1;
            for word in words(count) {
                let (light, p) = choose_by_tree(&scene, &r, unit_interval(word), pcg(word));
                let expected = if p > 0.0 { claimed[light as usize] } else { 0.0 };
                assert!(
                    (f64::from(p) - expected).abs() <= 1e-4 * expected,
                    "{name}: {p} of light {light} is {expected}"
                );
                observed[if p > 0.0 { light as usize / alike } else { whole }] += 1.0;
            }
            expected[whole] = (f64::from(count) - expected.iter().sum::<f64>()).max(0.0);
            // Words are spread evenly, so that numbers of draws differ less from what is expected than by chance.
            let p = chi_square(&observed, &expected);
            assert!(p > sidak(8), "{name}, {r:?}: {p:.1e}");
            let planted: Vec<f64> = observed.iter().zip(0..).map(|(o, i)| o * (0.9 + 0.2 * f64::from(i % 2))).collect();
            assert!(
                chi_square(&planted, &expected) < sidak(8),
                "{name}: the test cannot see a choice that is 10 % off"
            );
        }
    }
}

/// A sky, two suns, a bulb and a spot.
fn sky_suns_and_lamps() -> Loaded {
    Workplace::new().scene(
        "[environment]\nradiance = 0.3\n\
         [[light]]\ntype = 'directional'\ndirection = [0.5, -1.0, 0.2]\nirradiance = 2.0\n\
         [[light]]\ntype = 'directional'\ndirection = [-0.9, -0.4, 0.2]\nirradiance = [0.1, 0.5, 3.0]\n\
         [[light]]\ntype = 'point'\nposition = [0.3, 0.9, 0.1]\nintensity = 0.4\n\
         [[light]]\ntype = 'spot'\nposition = [0.5, 2.0, 0.0]\ndirection = [0.0, -1.0, 0.0]\ncutoff = 40.0\nintensity = 3.0\n",
    )
}

/// Probabilities of the lights without extent, where they are weighed: by what each brings, lamps as a whole and suns as a whole by that to
/// the power of 3/4, and a part of the choices evenly.
fn by_place(scene: &Loaded, r: &Receiver) -> Vec<f64> {
    let brings = |light: &Light| {
        let (w, d2) = match light.kind {
            LIGHT_DIRECTIONAL => (-Vec3::from(light.b), 1.0),
            _ => {
                let way = Vec3::from(light.a) - r.position;
                (way.normalize(), f64::from(way.length_squared()))
            }
        };
        let facing = if r.lets_light_through { r.normal.dot(w).abs() } else { r.normal.dot(w) };
        let beam = if light.kind == LIGHT_SPOT { spot_share(light, w) } else { 1.0 };
        let reflects = facing + r.odds_beyond_cosine + r.odds_of_lobe(w, 0.0);
        let lit = light.is_delta() && (facing > 0.0 || r.lets_light_through);
        if lit { f64::from(beam * reflects * luminance(light.value)) / d2 } else { 0.0 }
    };
    let brought: Vec<f64> = scene.lights.iter().map(brings).collect();
    let far: Vec<bool> = scene.lights.iter().map(Light::is_far).collect();
    let sum = |kind: bool| brought.iter().zip(&far).filter(|(_, far)| **far == kind).map(|(b, _)| b).sum::<f64>();
    let sums = [false, true].map(sum);
    let (kinds, number) = (sums.map(|sum| sum.powf(0.75)), brought.iter().filter(|b| **b > 0.0).count() as f64);
    let group: f64 = scene.lights.iter().filter(|l| l.is_delta()).map(|l| f64::from(l.probability)).sum();
    let share = |(&b, &far): (&f64, &bool)| {
        let odds =
            if b > 0.0 { b / sums[usize::from(far)] * kinds[usize::from(far)] / (kinds[0] + kinds[1]) } else { 0.0 };
        let even = if b > 0.0 { 1.0 / number } else { 0.0 };
        group * (f64::from(EVEN_SHARE) * even + f64::from(1.0 - EVEN_SHARE) * odds)
    };
    brought.iter().zip(&far).map(share).collect()
}

#[test]
fn suns_and_lamps_are_chosen_by_what_they_bring() {
    const COUNT: u32 = 1 << 16;
    let scene = sky_suns_and_lamps();
    assert!(scene.weighed_lights && !scene.has_light_tree() && scene.lights.len() == 5);
    for r in receivers() {
        let expected = by_place(&scene, &r);
        let mut observed = vec![0.0; scene.lights.len()];
        for i in 0..COUNT {
            let s = sampler_start(0, i, 1, true);
            let light = light_sample(&scene, &r, sample_2d_bits(s, 0)[0], sample_2d(s, 1));
            observed[light.chosen as usize] += 1.0;
            let claimed = if light.pdf > 0.0 { 0.0 } else { f64::from(light.sharp) };
            let sky = scene.lights[light.chosen as usize].kind == LIGHT_ENVIRONMENT;
            assert!(sky || (claimed / expected[light.chosen as usize] - 1.0).abs() < 1e-4, "{light:?}: {expected:?}");
        }
        let (deltas, sky) = (0..5).partition::<Vec<usize>, _>(|&i| scene.lights[i].is_delta());
        let mut expected: Vec<f64> = deltas.iter().map(|&i| expected[i] * f64::from(COUNT)).collect();
        let observed: Vec<f64> = deltas.iter().chain(&sky).map(|&i| observed[i]).collect();
        expected.push(f64::from(COUNT) - expected.iter().sum::<f64>());
        let p = chi_square(&observed, &expected);
        assert!(p > sidak(4), "{r:?}: {p:.1e}, {observed:?} of {expected:?}");
        let planted: Vec<f64> = observed.iter().zip(0..).map(|(o, i)| o * (0.97 + 0.06 * f64::from(i % 2))).collect();
        assert!(chi_square(&planted, &expected) < sidak(4), "the test cannot see a choice that is 3 % off");
    }
}

/// The key light and the share that is kept of it, by how often each light was chosen.
fn expected_key(scene: &Loaded, chosen: &[f32]) -> (u32, f32) {
    // The likeliest light of a tree is not known to those that go another way down.
    let told = |light: &Light| scene.weighed_lights || !scene.has_light_tree() || light.kind == LIGHT_DIRECTIONAL;
    let considered = |i: &usize| scene.lights[*i].is_delta() && told(&scene.lights[*i]);
    let mut likely: Vec<_> = (0..chosen.len()).filter(considered).collect();
    likely.sort_by(|&a, &b| chosen[b].total_cmp(&chosen[a]));
    match likely[..] {
        [key, ..] if chosen[key] > KEY_PROBABILITY => {
            let rival = likely.get(1).filter(|_| scene.weighed_lights).map_or(0.0, |&i| chosen[i]);
            let often = (chosen[key] / KEY_PROBABILITY - 1.0).min(1.0);
            (key as u32, often * (1.0 - (rival / chosen[key]).powi(2)))
        }
        _ => (NONE, 0.0),
    }
}

/// The key light of a place is the same however the choice falls, and the light without extent that it falls on most often; of one that
/// others rival less is kept, but where lights are chosen as often everywhere.
#[test]
fn the_key_light_is_the_one_that_is_chosen_most_often() {
    let bulb = "[[light]]\ntype = 'point'\nposition = [0.3, 0.9, 0.1]\nintensity = 1.0\n";
    let sun = |irradiance: f32| {
        format!("[[light]]\ntype = 'directional'\ndirection = [0.5, -1.0, 0.2]\nirradiance = {irradiance}\n")
    };
    let sky = "[environment]\nradiance = 0.1\n";
    let alone = Workplace::new().scene(&format!("{sky}{bulb}{}", sun(0.2)));
    let few = Workplace::new().scene(&format!("{bulb}{}{}", bulb.replace("0.3", "-0.4"), sun(6.0)));
    let (mut of_kinds, mut without, mut rivalled) = ([0; 8], 0, 0);
    for scene in [
        many_lamps(3),
        many_lamps(40),
        many_lamps_and(3, bulb),
        many_lamps_and(3, &sun(4.0)),
        many_lamps_and(40, &sun(4.0)),
        many_lamps_and(40, &[sun(4.0), sun(3.0).replace("0.5", "-0.5")].concat()),
        alone,
        few,
    ] {
        for r in receivers() {
            let (mut chosen, mut keys) = (vec![0.0; scene.lights.len()], Vec::new());
            for i in 0..1 << 14 {
                let s = sampler_start(0, i, 1, false);
                let light = light_sample(&scene, &r, sample_2d_bits(s, 0)[0], sample_2d(s, 1));
                chosen[light.chosen as usize] += 1.0 / f32::from(1_u16 << 14);
                keys.push((light.key, light.kept));
            }
            let (key, kept) = expected_key(&scene, &chosen);
            assert!(
                chosen.iter().all(|share| (share - KEY_PROBABILITY).abs() > 0.01),
                "control: {chosen:?} decide nothing"
            );
            let as_expected = |&(index, share): &(u32, f32)| index == key && (share - kept).abs() < 0.02;
            assert!(keys.iter().all(as_expected), "{kept} of {key}, but {:?}: {chosen:?}", keys[0]);
            rivalled += usize::from((0.1..0.9).contains(&kept));
            match key {
                NONE => without += 1,
                key => of_kinds[scene.lights[key as usize].kind as usize] += 1,
            }
        }
    }
    let seen = [LIGHT_POINT, LIGHT_DIRECTIONAL].map(|kind| of_kinds[kind as usize]);
    assert!(seen.iter().all(|&n| n > 3) && without > 3 && rivalled > 3, "control: {of_kinds:?}, {without}, {rivalled}");
}

fn corners(i: u32, size: Vec3) -> [Vec3; 3] {
    let mut random = Random::stream(i as usize);
    let middle = size * random.point() + 2.0 * Vec3::Y;
    [0; 3].map(|_| middle + 0.02 * random.point())
}

#[test]
fn trees_pass_over_lights_behind_a_surface_and_not_behind_glass() {
    let scene = many_lamps(0);
    let highest = scene.lights.iter().flat_map(|l| [l.a, l.b, l.c]).map(|p| p[1]).fold(0.0, f32::max);
    let above = Receiver { position: vec3(0.3, highest + 1.0, 0.2), ..receivers()[0] };
    let chance = |r: &Receiver| by_tree(&scene, r).iter().sum::<f64>();
    assert_eq!(chance(&above), 0.0);
    assert_eq!(choose_by_tree(&scene, &above, 0.5, 1).1, 0.0);
    assert!(chance(&Receiver { lets_light_through: true, ..above }) > 0.9, "glass");
    assert!(chance(&Receiver { normal: -Vec3::Y, ..above }) > 0.9, "control: turned round");
    assert_eq!(light_sample(&scene, &above, 1 << 20, glam::Vec2::splat(0.5)).radiance, Vec3::ZERO);
}

/// Share of samples of `scene` whose density and light are not what `claimed` says of their directions.
fn unlike(scene: &Loaded, claimed: &Loaded) -> f64 {
    let light = &claimed.lights[0];
    let differs = |s: &LightSample| {
        let radiance = match light.kind {
            LIGHT_ENVIRONMENT => environment_radiance(claimed, light, s.direction).0,
            _ => light.value.into(),
        };
        let (seen, pdf) = (s.radiance * s.pdf, density(claimed, s.direction) as f32);
        (s.pdf - pdf).abs() > 1e-3 * pdf || (seen - radiance).abs().max_element() > 1e-3 * radiance.max_element()
    };
    samples(scene, 1 << 14, 3).filter(differs).count() as f64 / f64::from(1 << 14)
}

#[test]
fn samples_know_their_density_and_their_light() {
    for (name, scene) in single_lights() {
        // Rounding moves a few over the edge of a triangle, and counts where the sky is nearly black.
        let share = unlike(&scene, &scene);
        assert!(share < 1e-3, "{name}: {share} of the samples");
        let (mut brighter, mut likelier) = (scene.clone(), scene.clone());
        brighter.lights[0].value = scene.lights[0].value.map(|v| 1.01 * v);
        likelier.lights[0].probability *= 1.01;
        likelier.triangle_pdf_scale *= 1.01;
        for control in [brighter, likelier] {
            assert!(unlike(&scene, &control) > 0.9, "{name}: control");
        }
    }
}

#[test]
fn the_density_of_a_sky_integrates_to_one() {
    for (width, height) in [(16, 8), (4, 2), (32, 4)] {
        let mut scene = image_sky(width, height);
        let sum = |scene: &Loaded| Grid::new(scene).integrate(scene).iter().sum::<f64>();
        let whole = sum(&scene);
        assert!((whole - 1.0).abs() < 1e-4, "{width} x {height}: {whole}");
        let seen = |d| environment_radiance(&scene, &scene.lights[0], d);
        let missed = |&(_, d, _): &(usize, Vec3, f64)| seen(d).1 == 0.0 && seen(d).0 != Vec3::ZERO;
        assert_eq!(Grid::new(&scene).directions().filter(missed).count(), 0, "{width} x {height}: light never drawn");
        scene.environment.as_mut().unwrap().texels[width as usize - 1][3] += 1e-3;
        assert!((sum(&scene) - 1.0).abs() > 1e-4, "control: {width} x {height}");
    }
}

/// Directions follow the interpolated radiance, so that all samples of a grey sky bring the same, in and beside its sun, across the seam
/// and up to the poles, but for the sines of neighbouring rows.
#[test]
fn all_samples_of_a_sky_bring_the_same() {
    let place = Workplace::new().sky("sky.exr", 128, 64, |x, y| if (x, y) == (0, 32) { 5000.0 } else { 0.5 });
    let scene = place.scene("[environment]\nfile = 'sky.exr'\n");
    let brought: Vec<f64> = samples(&scene, 1 << 14, 5).map(|s| f64::from(s.radiance.x)).collect();
    let mean = brought.iter().sum::<f64>() / brought.len() as f64;
    let variance = brought.iter().map(|b| (b / mean - 1.0).powi(2)).sum::<f64>() / brought.len() as f64;
    assert!(variance < 1e-3, "relative variance {variance}");
}

#[test]
fn what_is_left_of_a_choice_is_independent_of_it() {
    const BINS: usize = 16;
    let table = &many_lights().light_table;
    let p = |rest: &dyn Fn(u32) -> (u32, u32)| {
        let mut observed = vec![0.0; table.len() * BINS];
        for i in 0..1 << 19 {
            let (chosen, rest) = rest(sample_2d_bits(sampler_start(0, i, 9, true), 0)[0]);
            observed[chosen as usize * BINS + (rest >> 28) as usize] += 1.0;
        }
        let expected: Vec<_> =
            observed.chunks(BINS).flat_map(|c| [c.iter().sum::<f64>() / BINS as f64; BINS]).collect();
        chi_square(&observed, &expected)
    };
    let found = p(&|word| alias_choose(table, word));
    assert!(found > sidak(1), "{found:.1e}");
    let word_itself = p(&|word| (alias_choose(table, word).0, word));
    assert!(word_itself < sidak(1), "control: the word that chose");
}

/// Large skies read all digits of the word that a choice leaves them: without one of them, every second of some texels is never drawn.
#[test]
fn a_sky_beside_a_tree_gets_a_word_of_even_digits() {
    const WORDS: u32 = 1 << 18;
    let lamps: Vec<_> = (0..8).map(|i| corners(i, Vec3::ONE)).collect();
    for (emission, share) in [(1e6, 0.25), (1e-6, 0.5)] {
        let place = Workplace::new().obj("lamps.obj", &lamps).sky("sky.exr", 4, 2, |_, _| 1.0);
        let scene = place.scene(&format!(
            "[environment]\nfile = 'sky.exr'\n[[material]]\nname = 'a'\nemission = {emission}\n\
             [[mesh]]\nfile = 'lamps.obj'\nmaterial = 'a'\n"
        ));
        assert!(scene.has_light_tree());
        let choices = words(WORDS).map(|word| choose_light(&scene, &receivers()[0], word));
        let is_sky = |choice: &Choice| scene.lights[choice.light as usize].kind == LIGHT_ENVIRONMENT;
        let rests: Vec<u32> = choices.filter(is_sky).map(|choice| choice.rest).collect();
        let drawn = rests.len() as f64 / f64::from(WORDS);
        assert!((drawn - share).abs() < 1e-4, "a share of {drawn}, where even digits are hardest to get at {share}");
        let uneven = |digits: &dyn Fn(u32) -> usize| {
            let mut observed = [0.0; 16];
            rests.iter().for_each(|&rest| observed[digits(rest)] += 1.0);
            chi_square(&observed, &[rests.len() as f64 / 16.0; 16])
        };
        for shift in (0..32).step_by(4) {
            let p = uneven(&|rest| (rest >> shift & 15) as usize);
            assert!(p > sidak(16), "{share}, from bit {shift}: {p:.1e}");
            let stuck = uneven(&|rest| (rest >> shift & 15 | 1) as usize);
            assert!(stuck < sidak(16), "control: a digit that is always 1, from bit {shift}");
        }
    }
}

/// Bulbs beside a tree of lamps that shine many million times as bright, counted over the words that choose them: all of the last ones.
#[test]
fn faint_lights_beside_a_tree_are_chosen_as_often_as_told() {
    let lamps: Vec<_> = (0..8).map(|i| corners(i, Vec3::ONE)).collect();
    let place = Workplace::new().obj("lamps.obj", &lamps);
    for emission in [1e8, 1e10] {
        let scene = place.scene(&format!(
            "[[material]]\nname = 'a'\nemission = {emission}\n[[mesh]]\nfile = 'lamps.obj'\nmaterial = 'a'\n\
             [[light]]\ntype = 'point'\nposition = [0, 1, 0]\nintensity = 0.01\n\
             [[light]]\ntype = 'point'\nposition = [1, 1, 0]\nintensity = 0.02\n"
        ));
        assert!(scene.has_light_tree());
        let (mut told, mut chosen) = ([0.0; 2], [0_u32; 2]);
        for word in (u32::MAX - (1 << 20))..=u32::MAX {
            let choice = choose_light(&scene, &receivers()[0], word);
            let light = &scene.lights[choice.light as usize];
            if light.kind == LIGHT_POINT {
                let bulb = usize::from(light.a[0] > 0.5);
                chosen[bulb] += 1;
                told[bulb] = f64::from(choice.probability) * 2f64.powi(32);
                assert_eq!(choice.probability, light.probability, "which other functions count by");
            }
        }
        for (chosen, told) in chosen.into_iter().zip(told) {
            assert!((1..1 << 18).contains(&chosen), "{emission}: {chosen} words");
            assert_eq!(f64::from(chosen), told, "{emission}");
        }
    }
}

fn variance(scene: &Loaded, independent: bool) -> f64 {
    moments(scene, independent)[1]
}

/// Of the mean of 64 light samples' irradiance on a floor, the mean and the variance over many pixels.
fn moments(scene: &Loaded, independent: bool) -> [f64; 2] {
    let irradiance = |pixel: u32| {
        let sample = |i| {
            let s = sampler_start(pixel, i, 1, independent);
            let light = light_sample(scene, &Receiver::point(HERE), sample_2d_bits(s, 0)[0], sample_2d(s, 1));
            f64::from(light.radiance.x * light.direction.y.max(0.0))
        };
        (0..64).map(sample).sum::<f64>() / 64.0
    };
    let all: Vec<f64> = (0..400).map(irradiance).collect();
    let mean = all.iter().sum::<f64>() / 400.0;
    [mean, all.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / 399.0]
}

/// A lamp with one bright patch above [`HERE`], which is not split if it may be deformed.
fn patch_lamp(moving: bool) -> Loaded {
    let patch = |x: u32, y: u32| if (8..12).contains(&x) && (3..7).contains(&y) { [255; 3] } else { [30; 3] };
    Workplace::new().picture("patch.png", 16, patch).scene(&format!(
        "[[material]]\nname = 'a'\nemission = 9.0\nemission_texture = 'patch.png'\n\
         [[mesh]]\nname = 'lamp'\nshape = 'rectangle'\nmaterial = 'a'\nmoving = {moving}\n\
         transform = {{ rotate = [90.0, 0.0, 0.0], translate = [0.1, 1.5, 0.0] }}\n"
    ))
}

/// Light samples of a lamp with a picture beside those of one that is not split.
#[test]
fn lamps_with_a_picture_are_sampled_where_it_is_bright() {
    let (split, whole) = (patch_lamp(false), patch_lamp(true));
    assert_eq!(whole.lights.len(), 2);
    let ([mean, noise], [expected, noise_of_whole]) = (moments(&split, true), moments(&whole, true));
    let error = ((noise + noise_of_whole) / 400.0).sqrt();
    assert!((mean - expected).abs() < 4.0 * error, "{mean}, not {expected}, to {error}");
    println!("{} lamps: {:.3} of the variance", split.lights.len(), noise / noise_of_whole);
    assert!(noise < 0.1 * noise_of_whole, "{noise}, {noise_of_whole}");
}

/// Of the irradiance of a floor at [`HERE`] that MIS with a bounce by the cosine gives, what light samples bring and what bounces do.
fn shares(scene: &Loaded) -> [f64; 2] {
    let weighed = |own: f32, other: f32| f64::from(own / (own + other).max(1e-30));
    let sampled = |s: LightSample| {
        let cosine = s.direction.y.max(0.0);
        f64::from(s.radiance.x * cosine) * weighed(s.pdf, cosine / PI as f32)
    };
    let by_light = samples(scene, 100_000, 3).map(sampled).sum::<f64>() / 1e5;
    let met = |(_, direction, area): (usize, Vec3, f64)| {
        let cosine = direction.y.max(0.0);
        let (s, t) = hit(scene, direction).next()?;
        let pdf = triangle_light_pdf(scene, &s, HERE, t, -s.geometric.dot(direction));
        let radiance = f64::from(surface_emission(scene, &s, -s.geometric.dot(direction)).x);
        Some(radiance * f64::from(cosine) * weighed(cosine / PI as f32, pdf) * area)
    };
    let grid = Grid { world_from_sky: Mat3::IDENTITY };
    [by_light, grid.directions().filter_map(met).sum()]
}

/// Parts of a picture count for MIS as often as they are chosen, and for rays and light samples alike.
#[test]
fn mis_leaves_the_bright_part_of_a_picture_to_light_samples() {
    let scene = patch_lamp(false);
    let mut by_mean = scene.clone();
    by_mean.scene.shading.iter_mut().for_each(|s| s.brightness = 0.0);
    let [parts, mean] = [&scene, &by_mean].map(shares);
    println!(
        "light samples bring {:.3}, by the mean {:.3}",
        parts[0] / (parts[0] + parts[1]),
        mean[0] / (mean[0] + mean[1])
    );
    let [all, expected] = [parts, mean].map(|[light, bounce]| light + bounce);
    assert!((all / expected - 1.0).abs() < 0.01, "{all}, not {expected}");
    assert!(parts[1] < 0.7 * mean[1], "{parts:?}, {mean:?}");
}

#[test]
fn skies_gain_from_stratified_samples() {
    let sky = |x: u32, y: u32| 0.2 + ((x * x * 7 + y * 13) % 32) as f32 * if y < 12 { 0.3 } else { 0.02 };
    let place = Workplace::new().sky("sky.exr", 64, 32, sky);
    let alone = place.scene("[environment]\nfile = 'sky.exr'\n");
    let light = "[[light]]\ntype = 'directional'\ndirection = [0.0, -1.0, 0.2]\nirradiance = 5.0\n";
    let beside = place.scene(&format!("[environment]\nfile = 'sky.exr'\n{light}"));
    for (name, scene) in [("alone", alone), ("beside a light", beside)] {
        let ratio = variance(&scene, false) / variance(&scene, true);
        println!("{name}: {ratio:.3} of the variance of independent samples");
        assert!(ratio < 0.8, "{name}: {ratio}");
    }
}
