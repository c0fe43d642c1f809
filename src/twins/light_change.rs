//! Twin of `glsl/reproject/probe.comp` and `glsl/reproject/light_change.comp`.
use crate::layout::{Camera, History, LightChange, NONE, Probe, SurfacePoint};
use crate::math::hash::pcg;
use crate::render::Carried;
use crate::shaders::light_change::{CERTAIN_ACROSS, LEAST_SPACING, WIDEST_SPACING};
use crate::shaders::shared::probe_cell::PROBE_CELL;
use crate::twins::path::Tracer;
use glam::Vec3;

/// Cells across and down of a film.
pub fn probe_cells_of(size: [u32; 2]) -> [u32; 2] {
    size.map(|n| n.div_ceil(PROBE_CELL))
}

/// The cell of a pixel, row-major.
pub fn probe_cell_of(pixel: u32, size: [u32; 2]) -> u32 {
    pixel / size[0] / PROBE_CELL * probe_cells_of(size)[0] + pixel % size[0] / PROBE_CELL
}

/// Index of a cell's sample in the sequence that all share.
fn sample_of(cell: u32, size: [u32; 2]) -> u32 {
    let across = probe_cells_of(size)[0];
    let digit = |of: u32| of % 3;
    let [x, y] = [cell % across, cell / across];
    [9, 3, 1].iter().fold(0, |index, part| 9 * index + 3 * digit(y / part) + digit(x / part))
}

/// The pixel whose point a cell's path starts at, or [`NONE`].
pub fn chosen_pixel(cell: u32, size: [u32; 2], seed: u32, hands_on: impl Fn(u32) -> bool) -> u32 {
    let across = probe_cells_of(size)[0];
    let (x, y) = (PROBE_CELL * (cell % across), PROBE_CELL * (cell / across));
    let first = pcg(cell.wrapping_add(pcg(seed)));
    let places = (0..PROBE_CELL * PROBE_CELL).map(|k| first.wrapping_add(k) % (PROBE_CELL * PROBE_CELL));
    let pixels = places
        .map(|place| [x + place % PROBE_CELL, y + place / PROBE_CELL])
        .filter(|at| at[0] < size[0] && at[1] < size[1]);
    let mut pixels = pixels.map(|[x, y]| y * size[0] + x);
    pixels.find(|&pixel| hands_on(pixel)).unwrap_or(NONE)
}

/// What every pixel hands on: the word, and what it keeps if it rests.
type HandedOn<'a> = (&'a [u32], &'a [History]);

/// Paths of all cells before the scene changes. The tracer's seed is that of the probes.
pub fn before(tracer: &Tracer, eye: &Camera, points: &[SurfacePoint], (offered, records): HandedOn) -> Vec<Probe> {
    let (size, seed) = (tracer.frame.path.size, tracer.frame.path.seed);
    let [across, down] = probe_cells_of(size);
    let counts = |word: u32| Carried::of(word).count > 0;
    let hands_on = |pixel: u32| {
        let (word, resting) = (offered[pixel as usize], records[pixel as usize].resting);
        counts(word) || word != 0 && counts(resting)
    };
    let probe = |cell| match chosen_pixel(cell, size, seed, hands_on) {
        NONE => Probe { pixel: NONE, ..Probe::default() },
        pixel => {
            let sample = tracer.light_from(points[pixel as usize], eye.position.into(), sample_of(cell, size));
            let (light, certain) = (sample.radiance().into(), sample.certain.into());
            Probe { light, certain, choice: sample.choice, pixel, ..Probe::default() }
        }
    };
    (0..across * down).map(probe).collect()
}

/// Pixels of the square of nine around one, those of the border repeated.
pub(super) fn square(pixel: usize, [width, height]: [u32; 2]) -> impl Iterator<Item = usize> {
    let [width, height, pixel] = [width as i32, height as i32, pixel as i32];
    let (x, y) = (pixel % width, pixel / width);
    (0..9).map(move |k| ((y + k / 3 - 1).clamp(0, height - 1) * width + (x + k % 3 - 1).clamp(0, width - 1)) as usize)
}

/// Mean radiance of the 3x3 pixels of the last frame around one.
fn light_around(records: &[History], pixel: usize, size: [u32; 2]) -> Vec3 {
    square(pixel, size).map(|q| Vec3::from(records[q].mean)).sum::<Vec3>() / 9.0
}

/// A path's difference and the brightest channel of its light, in units of what the pixels around have.
fn share_of_light(difference: Vec3, light: f32, around: Vec3) -> LightChange {
    let unit = (0.9 * around.max_element() + 0.1 * light).max(1e-30);
    let sum = difference / unit;
    let size = sum.abs().max_element();
    LightChange { sum: sum.into(), size, squares: size * size, light: light / unit, count: 1, ..LightChange::default() }
}

/// The share of the light around a pixel that has come or gone without noise.
fn certain_change([now, before]: [Vec3; 2], around: Vec3) -> f32 {
    let change = (now - before).abs().max_element();
    let most = around.max_element().max(now.max(before).max_element());
    if change.is_finite() { change / most.max(1e-30) } else { 0.0 }
}

/// What has changed on the same paths; `records` are those of the last frame, numbered as in the changed scene.
pub fn after(tracer: &Tracer, eye: &Camera, records: &[History], probes: &[Probe]) -> Vec<LightChange> {
    let size = tracer.frame.path.size;
    let change = |(cell, probe): (u32, &Probe)| {
        if probe.pixel == NONE {
            return LightChange::default();
        }
        let pixel = probe.pixel as usize;
        let History { triangle, instance, weights, .. } = records[pixel];
        let point = SurfacePoint { triangle, instance, weights, ..SurfacePoint::default() };
        let sample = tracer.light_from(point, eye.position.into(), sample_of(cell, size));
        let (light, around) = (sample.radiance(), light_around(records, pixel, size));
        let difference = light - Vec3::from(probe.light);
        let brightest = light.max(probe.light.into()).max_element();
        match difference.is_finite() {
            true => LightChange {
                change: match sample.choice == probe.choice && probe.choice != NONE {
                    true => certain_change([sample.certain, probe.certain.into()], around),
                    false => 0.0,
                },
                ..share_of_light(difference, brightest, around)
            },
            false => LightChange::default(),
        }
    };
    (0..).zip(probes).map(change).collect()
}

/// One level: sums of 3x3 cells that are `spacing` cells apart.
pub fn sums(found: &[LightChange], cells: [u32; 2], spacing: u32) -> Vec<LightChange> {
    let [width, height] = cells.map(|n| n as i32);
    let sum = |i: i32| {
        let inside = |across: i32, spacing: i32| {
            let at = move |k: i32| [k % across - across / 2, k / across - across / 2].map(|n| n * spacing);
            let around = (0..across * across).map(move |k| [i % width + at(k)[0], i / width + at(k)[1]]);
            let inside = around.filter(move |[x, y]| (0..width).contains(x) && (0..height).contains(y));
            inside.map(|[x, y]| &found[(y * width + x) as usize])
        };
        let mut all = LightChange::default();
        for other in inside(3, spacing as i32) {
            all.sum = (Vec3::from(all.sum) + Vec3::from(other.sum)).into();
            all.squares += other.squares;
            all.size += other.size;
            all.light += other.light;
            all.count += other.count;
        }
        let size = match spacing {
            LEAST_SPACING => all.size,
            _ => Vec3::from(all.sum).abs().max_element(),
        };
        let own = if spacing == WIDEST_SPACING { 0.0 } else { all.squares };
        let size = (size * size - own).max(0.0).sqrt();
        let change = if size > 0.0 { size / all.light } else { 0.0 };
        let before = match spacing {
            LEAST_SPACING => inside(CERTAIN_ACROSS, 1).map(|other| other.change).fold(0.0, f32::max),
            _ => found[i as usize].change,
        };
        LightChange { change: before.max(change), ..all }
    };
    (0..width * height).map(sum).collect()
}
