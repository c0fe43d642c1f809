//! Twin of `gloss.comp`, and of what `demodulate.comp` makes of its cells.
use super::{Pixels, divisor, neighbours, number, one_surface, reflects};
use crate::layout::{vec3, vec4};
use crate::shaders::gloss::{ERRORS, FEWEST, LAG, LEAST_SPREAD, REACH};
use crate::shaders::shared::albedo::SMALLEST_ALBEDO;
use crate::shaders::shared::gloss_cell::{GLOSS_CELL, MOST_CONTRAST, STEEPEST};
use crate::shaders::shared::sample_marks::SOME_BARE;
use glam::{DVec3, Vec3};

const CELL: usize = GLOSS_CELL as usize;

/// Mean albedo around the middle of each cell, and the share of the light that does not follow it.
pub fn cells(pixels: &Pixels) -> Vec<vec4> {
    let [across, down] = grid(pixels);
    (0..across * down).map(|k| cell(pixels, middle(pixels, [k % across, k / across]))).collect()
}

/// The albedo that the light of a pixel follows: of the share that does not follow it, the mean around stands for it.
pub fn followed_albedo(pixels: &Pixels, cells: &[vec4], i: usize, albedo: vec3) -> vec3 {
    if cells.is_empty() || !tells_albedo(pixels, i) {
        return albedo;
    }
    let (width, [across, down]) = (pixels.size[0] as usize, grid(pixels));
    let between = [i % width, i / width].map(|at| (at as f32 - (CELL / 2) as f32) / CELL as f32);
    let (mut sum, mut shares, mut weights) = (Vec3::ZERO, 0.0, 0.0);
    for corner in [[0, 0], [1, 0], [0, 1], [1, 1]] {
        let near = |axis: usize| 1.0 - (between[axis] - between[axis].floor() - corner[axis] as f32).abs();
        let along = |axis: usize, cells: usize| {
            (between[axis].floor() as i64 + corner[axis]).clamp(0, cells as i64 - 1) as usize
        };
        let at = [along(0, across), along(1, down)];
        let [r, g, b, share] = cells[at[1] * across + at[0]];
        if connected(pixels, middle(pixels, at), i) && one_material(&[r, g, b], &albedo) {
            let weight = near(0) * near(1);
            sum += weight * share * Vec3::new(r, g, b);
            shares += weight * share;
            weights += weight;
        }
    }
    let weights = weights.max(1e-20);
    let followed = Vec3::from(albedo) * (1.0 - shares / weights) + sum / weights;
    std::array::from_fn(|c| if albedo[c] > 0.0 { followed[c] } else { 0.0 })
}

fn cell(pixels: &Pixels, middle: usize) -> vec4 {
    let albedo = |q: usize| DVec3::from(pixels.albedo(q).map(|a| f64::from(number(a).max(0.0))));
    let light = |q: usize| {
        let (all, direct) = (pixels.stats[q].mean, pixels.light[q].direct);
        DVec3::from_array(std::array::from_fn(|c| f64::from(all[c]) - f64::from(direct[c])))
    };
    let around = window(pixels, middle);
    let count = around.len().max(1) as f64;
    let mean_albedo = around.iter().map(|&q| albedo(q)).sum::<DVec3>() / count;
    let mean_light = around.iter().map(|&q| light(q)).sum::<DVec3>() / count;
    let there: Vec<usize> =
        (0..3).filter(|&c| mean_albedo[c] > f64::from(SMALLEST_ALBEDO) && mean_light[c] > 0.0).collect();
    let (width, lag) = (pixels.size[0] as usize, LAG as usize);
    let beside = |q: usize| ((q % width + lag < width).then_some((q, q + lag)), (q, q + lag * width));
    let partners = around.iter().flat_map(|&q| beside(q).0.into_iter().chain([beside(q).1]));
    let pairs: Vec<_> = partners.filter(|&(q, o)| around.contains(&o) && connected(pixels, o, q)).collect();
    let (mut spread, mut together, mut light2) = (0.0, 0.0, 0.0);
    for (&(q, o), &c) in pairs.iter().flat_map(|pair| there.iter().map(move |c| (pair, c))) {
        let a = (albedo(q)[c] - albedo(o)[c]) / mean_albedo[c];
        let l = (light(q)[c] - light(o)[c]) / mean_light[c];
        (spread, together, light2) = (spread + a * a, together + a * l, light2 + l * l);
    }
    let (slope, count) = (together / spread, pairs.len() as f64);
    let rest = (light2 - slope * slope * spread).max(0.0);
    let share = 1.0 - slope - f64::from(ERRORS) * (rest / (count * spread)).sqrt();
    let least = f64::from(LEAST_SPREAD).powi(2) * count * there.len() as f64;
    let told = count >= f64::from(FEWEST) && spread > least && share.is_finite();
    let [r, g, b] = mean_albedo.as_vec3().to_array();
    [r, g, b, if told { share.clamp(0.0, 1.0) as f32 } else { 0.0 }]
}

/// Pixels around the middle that tell of the albedo of what it shows, in order of rows.
fn window(pixels: &Pixels, middle: usize) -> Vec<usize> {
    let around = neighbours(pixels.size, middle, REACH as usize).chain([middle]);
    let like = |q: usize| one_material(pixels.albedo(q), pixels.albedo(middle));
    let mut around: Vec<usize> =
        around.filter(|&q| tells_albedo(pixels, q) && connected(pixels, q, middle) && like(q)).collect();
    around.sort_unstable();
    around
}

fn grid(pixels: &Pixels) -> [usize; 2] {
    pixels.size.map(|side| (side as usize).div_ceil(CELL))
}

/// The pixel that a cell stands around.
fn middle(pixels: &Pixels, cell: [usize; 2]) -> usize {
    let [x, y] = [0, 1].map(|axis| (cell[axis] * CELL + CELL / 2).min(pixels.size[axis] as usize - 1));
    y * pixels.size[0] as usize + x
}

/// Whether the light of a pixel tells of the albedo of what it shows.
fn tells_albedo(pixels: &Pixels, i: usize) -> bool {
    let known = pixels.sampled(i) && pixels.light[i].direct.iter().all(|v| v.is_finite());
    known && !pixels.marked(i, SOME_BARE) && reflects(pixels.albedo(i))
}

/// Whether two albedos may be those of one material.
fn one_material(a: &vec3, b: &vec3) -> bool {
    let (a, b) = (divisor(a), divisor(b));
    (0..3).all(|c| a[c] <= MOST_CONTRAST * b[c] && b[c] <= MOST_CONTRAST * a[c])
}

/// Whether nothing that lies before or behind comes between the surfaces of two pixels.
fn connected(pixels: &Pixels, q: usize, i: usize) -> bool {
    let off = Vec3::from(pixels.guide[q].position) - Vec3::from(pixels.guide[i].position);
    let height = Vec3::from(pixels.guide[i].normal).dot(off).abs();
    one_surface(pixels, q, i) && height <= STEEPEST * off.length()
}
