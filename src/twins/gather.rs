//! Twin of `glsl/reproject/gather.comp`.
use super::reproject::{Handed, Reprojection, dropped, surface_of};
use crate::layout::{Guide, HistoryLight, NONE, PixelLight, PixelStats, SurfacePoint};
use crate::math::srgb::luminance;
use crate::render::Carried;
use crate::shaders::gather::{MOST_M2, STEPS};
use crate::shaders::shared::history::*;
use crate::shaders::shared::sample_marks::{ALL_PASSED_OVER, SOME_BARE};
use crate::twins::camera::{film_from_point, pixel_width};
use crate::twins::surface::Surface;
use glam::{IVec2, Vec2, Vec3, ivec2, vec2};

/// What a pixel begins with: its word, statistics and light.
pub type Begun = (u32, PixelStats, PixelLight);

/// Samples of several pixels, merged, and sums of their weights.
#[derive(Default)]
struct Merged {
    stats: PixelStats,
    light: PixelLight,
    samples: f32,
    squares: f32,
    weight: f32,
    age: u32,
}

fn towards(mean: [f32; 3], other: [f32; 3], part: f32) -> [f32; 3] {
    std::array::from_fn(|k| mean[k] + (other[k] - mean[k]) * part)
}

impl Merged {
    fn add(&mut self, handed: &Handed, from: usize, c: Carried, weight: f32) {
        let (h, l) = (&handed.records[from], &handed.light[from]);
        let (stats, light, count) = (&mut self.stats, &mut self.light, c.count as f32);
        let samples = self.samples + weight * count;
        let part = weight * count / samples;
        let between = self.samples * part;
        for (k, m2) in stats.m2.iter_mut().enumerate() {
            let off = h.mean[k] - stats.mean[k];
            *m2 += weight * (count - 1.0) * h.variance[k] + off * (off * between);
        }
        let passed_over = l.remainder & ALL_PASSED_OVER != 0;
        let all_before = self.samples == 0.0 || light.remainder & ALL_PASSED_OVER != 0;
        let bare = (light.remainder | l.remainder) & SOME_BARE;
        let direct = if bare == 0 && passed_over && !all_before { light.direct } else { l.direct };
        if bare == 0 && !passed_over && all_before {
            light.direct = direct;
        }
        light.remainder = bare | if passed_over && all_before { ALL_PASSED_OVER } else { 0 };
        let other = |mean: [f32; 3], direct: [f32; 3]| luminance(Vec3::from(mean) - Vec3::from(direct));
        let off = other(h.mean, direct) - other(stats.mean, light.direct);
        light.indirect_m2 += weight * (count - 1.0) * l.indirect_variance + off * (off * between);
        light.direct = towards(light.direct, direct, part);
        light.albedo = towards(light.albedo, l.albedo, part);
        stats.mean = towards(stats.mean, h.mean, part);
        self.samples = samples;
        self.squares += weight * weight * count;
        self.weight += weight;
        self.age = self.age.max(c.age + 1);
    }

    fn finish(mut self, edge: bool) -> Begun {
        let count = ((self.samples / self.weight + 0.5) as u32).min(MOST_CARRIED);
        let scale = (count - 1) as f32 / (self.samples - self.squares / self.samples).max(1e-4 * self.samples);
        self.stats.count = count;
        self.stats.m2 = self.stats.m2.map(|m2| (m2 * scale).min(MOST_M2));
        self.light.indirect_m2 = (self.light.indirect_m2 * scale).min(MOST_M2);
        (Carried { count, age: self.age, edge, back: false }.word(), self.stats, self.light)
    }
}

impl Reprojection<'_> {
    /// Twin of `gather.comp`. `guide` and `points` are those of the new frame.
    pub fn gather(&self, handed: &Handed, guide: &[Guide], points: &[SurfacePoint]) -> Vec<Begun> {
        let nothing = |word| (word, PixelStats::default(), PixelLight::default());
        let of = |pixel: usize| {
            let (h, l, word) = (&handed.records[pixel], &handed.light[pixel], handed.offered[pixel]);
            let count = Carried::of(word).count;
            match self.still() {
                true if count > 0 => {
                    let stats = PixelStats { mean: h.mean, m2: h.variance, count, ..Default::default() };
                    let HistoryLight { direct, albedo, indirect_variance: indirect_m2, remainder, .. } = *l;
                    (word, stats, PixelLight { direct, albedo, indirect_m2, remainder, ..Default::default() })
                }
                true => nothing(word),
                false => self.take(handed, guide, points[pixel], pixel).unwrap_or_else(nothing),
            }
        };
        (0..guide.len()).map(of).collect()
    }

    fn was_at(&self, handed: &Handed, s: &Surface, centre: Vec2) -> Vec3 {
        let size = Vec2::from(self.push.size.map(|n| n as f32));
        let mut at = film_from_point(&self.previous, s.position, self.push.size);
        for _ in 0..if self.push.moved == 0 { 0 } else { STEPS } {
            let q = at.truncate().max(Vec2::ZERO).min(size - 0.5).floor();
            let h = &handed.records[(q.y * size.x + q.x) as usize];
            if h.triangle == NONE || !at.is_finite() {
                break;
            }
            let point = surface_of(self.scene, h.triangle, h.instance, h.weights).position;
            let now = film_from_point(&self.camera, point, self.push.size);
            at = (q + 0.5 + centre - now.truncate()).extend(now.z);
        }
        at
    }

    fn reason_to_leave(
        &self,
        handed: &Handed,
        seen: &Guide,
        from: usize,
        edge: bool,
        view: f32,
        c: &mut Carried,
    ) -> u32 {
        if c.edge != edge {
            return DROPPED_HIDDEN;
        }
        let h = &handed.records[from];
        let s = surface_of(self.scene, h.triangle, h.instance, h.weights);
        let back = s.geometric.dot(Vec3::from(self.camera.position) - s.position) < 0.0;
        if c.back != back || !self.shows(seen, &s) {
            return DROPPED_HIDDEN;
        }
        c.count = self.after_change(from, c.count);
        if c.count == 0 {
            return DROPPED_LIGHT;
        }
        c.count = self.worth_in_view(c.count, view, h);
        if c.count == 0 {
            return DROPPED_VIEW;
        }
        c.count = self.shared_out(c.count, s.position);
        0
    }

    /// What a pixel takes, or its word with why it takes nothing.
    fn take(&self, handed: &Handed, guide: &[Guide], at: SurfacePoint, pixel: usize) -> Result<Begun, u32> {
        let (size, corner) = (IVec2::from(self.push.size.map(|n| n as i32)), IVec2::ZERO);
        if at.triangle == NONE {
            return Err(0);
        }
        let s = surface_of(self.scene, at.triangle, at.instance, at.weights);
        let edge = !self.is_whole(guide, pixel, s.geometric, pixel_width(&self.camera, self.push.size));
        let here = vec2((pixel as i32 % size.x) as f32, (pixel as i32 / size.x) as f32) + 0.5;
        if let Some(mut c) = self.resting(handed, guide, pixel, edge) {
            c.count = self.after_change(pixel, c.count);
            if c.count == 0 {
                return Err(dropped(DROPPED_LIGHT));
            }
            let mut merged = Merged::default();
            merged.add(handed, pixel, c, 1.0);
            return Ok(merged.finish(edge));
        }
        let film = self.was_at(handed, &s, here);
        if !(film.z > 0.0 && film.is_finite()) {
            return Err(dropped(DROPPED_OUTSIDE));
        }
        let at = film.truncate().clamp(Vec2::splat(-2.0), size.as_vec2() + 2.0) - 0.5;
        let view = self.view_change(&s);
        let (mut reason, mut merged) = (DROPPED_OUTSIDE, Merged::default());
        for k in 0..4 {
            let q = at.floor().as_ivec2() + ivec2(k & 1, k >> 1);
            if q.cmplt(corner).any() || q.cmpge(size).any() {
                continue;
            }
            let (from, share) = ((q.y * size.x + q.x) as usize, 1.0 - (at - q.as_vec2()).abs());
            let (mut c, weight) = (Carried::of(handed.offered[from]), share.x * share.y);
            let why = match c.count {
                0 if c.age > 0 => DROPPED_HIDDEN,
                0 => 0,
                _ => self.reason_to_leave(handed, &guide[pixel], from, edge, view, &mut c),
            };
            if why == 0 && c.count > 0 && weight > 0.0 {
                merged.add(handed, from, c, weight);
            }
            reason = if reason == 0 { 0 } else { why };
        }
        if merged.weight > 0.0 {
            Ok(merged.finish(edge))
        } else {
            Err(dropped(if edge { DROPPED_EDGE } else { reason }))
        }
    }
}
