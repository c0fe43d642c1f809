//! Twin of `glsl/reproject/*.comp`.
use crate::layout::{
    BSDF_DIELECTRIC, BSDF_METALLIC, Camera, Guide, History, HistoryLight, MATERIAL_TWO_SIDED, NONE, PixelLight,
    PixelStats, ReprojectPush, SurfacePoint,
};
use crate::math::warp::basis_from_normal;
use crate::scene::Scene;
use crate::shaders::carry::OLD_PIXEL;
use crate::shaders::project::{LEAST_ALBEDO, NORMAL_COSINE, PIXEL_BITS, PLANE_DISTANCE};
use crate::shaders::shared::history::*;
use crate::twins::bsdf::{Bsdf, SMOOTH_ALPHA, bsdf_albedo, bsdf_evaluate, bsdf_is_specular};
use crate::twins::camera::{film_from_point, pixel_width};
use crate::twins::surface::{Surface, facing_normals, surface_at, surface_bsdf};
use crate::twins::traverse::Hit;
use glam::{Vec2, Vec3, vec2};
use std::f32::consts::PI;

/// The samples that a pixel has from earlier frames, as one word holds them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Carried {
    /// Their number.
    pub count: u32,
    /// How many times they have moved.
    pub age: u32,
    /// Error that they are accounted, in 255ths of the largest one.
    pub error: u32,
}

impl Carried {
    /// Out of a word of `glsl/shared/history.glsl`.
    pub fn of(word: u32) -> Self {
        Self { count: word & 0xffff, age: (word >> 16) & 0xff, error: word >> 24 }
    }

    /// As a word.
    pub fn word(self) -> u32 {
        self.count | self.age << 16 | self.error << 24
    }
}

fn dropped(reason: u32) -> u32 {
    reason << 16
}

/// Between two frames: the scene, both cameras, and what the kernels are told.
#[derive(Clone, Copy)]
pub struct Reprojection<'a> {
    /// The scene of both frames.
    pub scene: &'a Scene,
    /// The camera of the last frame.
    pub previous: Camera,
    /// The camera of the new one.
    pub camera: Camera,
    /// What the kernels are told, of the whole film.
    pub push: ReprojectPush,
}

/// What a frame leaves of every pixel.
#[derive(Clone, Copy)]
pub struct Left<'a> {
    /// Primary hits.
    pub guide: &'a [Guide],
    /// Points that the samples are of.
    pub points: &'a [SurfacePoint],
    /// Statistics.
    pub stats: &'a [PixelStats],
    /// Direct and indirect light.
    pub light: &'a [PixelLight],
    /// Words of what the frame itself began with.
    pub carried: &'a [u32],
}

/// What every pixel hands on.
#[derive(Clone, Debug, Default)]
pub struct Handed {
    /// Points and statistics.
    pub records: Vec<History>,
    /// Direct and indirect light.
    pub light: Vec<HistoryLight>,
    /// How many samples, or why none.
    pub offered: Vec<u32>,
}

fn part_of_m2(m2: f32, kept: u32, count: u32) -> f32 {
    if kept < count { m2 * ((kept.max(1) - 1) as f32 / (count - 1) as f32) } else { m2 }
}

fn surface_of(scene: &Scene, triangle: u32, instance: u32, weights: [f32; 2]) -> Surface {
    surface_at(scene, &Hit { t: 0.0, triangle, instance, barycentric: weights.into() })
}

/// Whether the surface shows a sharp image of what is around it, or lets light through.
fn is_sharp(b: &Bsdf) -> bool {
    match b.kind {
        BSDF_METALLIC => {
            let m = &b.metallic;
            m.alpha < SMOOTH_ALPHA || m.through != Vec3::ZERO || m.coat > 0.0 && m.coat_alpha < SMOOTH_ALPHA
        }
        BSDF_DIELECTRIC => true,
        _ => bsdf_is_specular(b) && b.alpha < SMOOTH_ALPHA,
    }
}

/// The BSDF towards `wo`, without the cosine, for light from `wi`.
fn scattered(s: &Surface, bsdf: &Bsdf, wo: Vec3, wi: Vec3) -> Vec3 {
    let facing = facing_normals(s, wo, s.flags & MATERIAL_TWO_SIDED != 0, true);
    let to_local = basis_from_normal(facing.normal).transpose();
    let (towards, from) = (to_local * wo, to_local * wi);
    bsdf_evaluate(bsdf, towards, from).truncate() / from.z.max(1e-3)
}

impl Reprojection<'_> {
    fn still(&self) -> bool {
        self.push.moved == 0 && self.previous == self.camera
    }

    /// Pixels of the square of nine around one, those of the border repeated.
    fn around(&self, pixel: usize) -> impl Iterator<Item = usize> + use<> {
        let [width, height] = self.push.size.map(|n| n as i32);
        let (x, y) = (pixel as i32 % width, pixel as i32 / width);
        (0..9)
            .map(move |k| ((y + k / 3 - 1).clamp(0, height - 1) * width + (x + k % 3 - 1).clamp(0, width - 1)) as usize)
    }

    /// Whether the neighbours of a pixel show the surface that it shows.
    pub fn is_whole(&self, guide: &[Guide], pixel: usize, plane: Vec3, width: f32) -> bool {
        let here = &guide[pixel];
        let limit = self.push.aliasing * width * here.depth;
        self.around(pixel).all(|q| {
            let off = Vec3::from(guide[q].position) - Vec3::from(here.position);
            guide[q].object == here.object && plane.dot(off).abs() <= limit
        })
    }

    fn reason_to_keep(&self, left: &Left, pixel: usize) -> u32 {
        let at = left.points[pixel];
        if at.triangle == NONE {
            return DROPPED_SKY;
        }
        let s = surface_of(self.scene, at.triangle, at.instance, at.weights);
        let bsdf = surface_bsdf(self.scene, &s);
        if is_sharp(&bsdf) {
            return DROPPED_SPECULAR;
        }
        let whole = self.is_whole(left.guide, pixel, s.geometric, pixel_width(&self.previous, self.push.size));
        if whole { 0 } else { DROPPED_EDGE }
    }

    /// Twin of `remember.comp`.
    pub fn remember(&self, left: &Left) -> Handed {
        let mut handed = Handed::default();
        for (pixel, s) in left.stats.iter().enumerate() {
            let (at, l) = (left.points[pixel], left.light[pixel]);
            let reason = if self.still() || s.count == 0 { 0 } else { self.reason_to_keep(left, pixel) };
            let kept = s.count.min(if self.still() { MOST_CARRIED } else { self.push.max_samples });
            let before = Some(Carried::of(left.carried[pixel])).filter(|c| c.count > 0).unwrap_or_default();
            let now = Carried { count: kept, ..before };
            handed.offered.push(if reason == 0 { now.word() } else { dropped(reason) });
            let m2 = s.m2.map(|m2| part_of_m2(m2, kept, s.count));
            let SurfacePoint { triangle, instance, weights, .. } = at;
            handed.records.push(History { triangle, instance, weights, mean: s.mean, m2, ..Default::default() });
            let indirect_m2 = part_of_m2(l.indirect_m2, kept, s.count);
            let light = HistoryLight { direct: l.direct, indirect: l.indirect, indirect_m2, ..Default::default() };
            handed.light.push(light);
        }
        handed
    }

    fn same_surface(&self, old: &Surface, seen: &Surface) -> bool {
        let [before, after] = [self.previous.position, self.camera.position].map(Vec3::from);
        let width = pixel_width(&self.camera, self.push.size) * seen.position.distance(after);
        let plane = seen.geometric.dot(old.position - seen.position).abs() <= PLANE_DISTANCE * width;
        let side = old.geometric.dot(before - old.position) * old.geometric.dot(after - old.position) > 0.0;
        let alike = old.object == seen.object && old.material == seen.material;
        alike && side && plane && old.geometric.dot(seen.geometric) >= NORMAL_COSINE
    }

    fn view_error(&self, s: &Surface, irradiance_of: Vec3, before: Vec3, after: Vec3) -> f32 {
        let bsdf = surface_bsdf(self.scene, s);
        if !bsdf_is_specular(&bsdf) {
            return 0.0;
        }
        let side = if s.normal.dot(before) < 0.0 { -1.0 } else { 1.0 };
        let albedo = bsdf_albedo(&bsdf, s.normal.dot(before).abs()).max(Vec3::splat(LEAST_ALBEDO));
        let irradiance = PI * irradiance_of / albedo;
        let of = |view: Vec3| {
            let n = side * s.normal;
            let from = 2.0 * view.dot(n) * n - view;
            ((scattered(s, &bsdf, after, from) - scattered(s, &bsdf, before, from)).abs() * irradiance).max_element()
        };
        of(before).max(of(after))
    }

    /// Where a pixel's samples go, and their key there; with neither, the word says why.
    fn moved(&self, handed: &Handed, points: &[SurfacePoint], pixel: usize, c: Carried) -> (u32, Option<(usize, u32)>) {
        let [width, height] = self.push.size;
        let h = &handed.records[pixel];
        let s = surface_of(self.scene, h.triangle, h.instance, h.weights);
        let film = film_from_point(&self.camera, s.position, self.push.size);
        let inside = film.x >= 0.0 && film.y >= 0.0 && film.x < width as f32 && film.y < height as f32;
        if !inside || film.z <= 0.0 || film.z.is_nan() {
            return (dropped(DROPPED_OUTSIDE), None);
        }
        let to = ((film.y as u32).min(height - 1) * width + (film.x as u32).min(width - 1)) as usize;
        let at = points[to];
        if at.triangle == NONE || !self.same_surface(&s, &surface_of(self.scene, at.triangle, at.instance, at.weights))
        {
            return (dropped(DROPPED_HIDDEN), None);
        }
        let views = [self.previous, self.camera].map(|c| (Vec3::from(c.position) - s.position).normalize());
        let light: Vec3 = self.around(pixel).map(|q| Vec3::from(handed.records[q].mean)).sum();
        let error = self.view_error(&s, light / 9.0, views[0], views[1]);
        let parts = (error * ERROR_PARTS as f32 / self.push.max_error.max(1e-30)).ceil();
        // A number that is none fails both comparisons.
        if !(error <= self.push.max_error && c.error as f32 + parts <= ERROR_PARTS as f32) {
            return (dropped(DROPPED_VIEW), None);
        }
        let off: Vec2 = (vec2(film.x, film.y).fract() - 0.5).abs();
        let key = ((off.max_element() * 126.0) as u32) << PIXEL_BITS | pixel as u32;
        (Carried { age: c.age + 1, error: c.error + parts as u32, ..c }.word(), Some((to, key)))
    }

    /// Twin of `project.comp`: the winner's key of every new pixel. `points` are those of the new frame.
    pub fn project(&self, handed: &mut Handed, points: &[SurfacePoint]) -> Vec<u32> {
        let mut winner = vec![NONE; points.len()];
        for pixel in 0..points.len() {
            let c = Carried::of(handed.offered[pixel]);
            let (word, offer) = match c.count {
                0 => continue,
                _ if self.still() => (c.word(), Some((pixel, pixel as u32))),
                _ if c.age >= self.push.max_age => (dropped(DROPPED_OLD), None),
                _ => self.moved(handed, points, pixel, c),
            };
            handed.offered[pixel] = word;
            if let Some((to, key)) = offer {
                winner[to] = winner[to].min(key);
            }
        }
        winner
    }

    /// Twin of `carry.comp`: what every new pixel begins with. `guide` and `points` are those of the new frame; the words of
    /// what is carried replace the keys.
    pub fn carry(
        &self,
        handed: &Handed,
        winner: &mut [u32],
        guide: &[Guide],
        points: &mut [SurfacePoint],
    ) -> Vec<(PixelStats, PixelLight)> {
        let width = pixel_width(&self.camera, self.push.size);
        let begin = |(pixel, (key, at)): (usize, (&mut u32, &mut SurfacePoint))| {
            let from = (*key & OLD_PIXEL) as usize;
            let mut word = if *key == NONE { 0 } else { handed.offered[from] };
            if *key != NONE && !self.still() {
                let seen = surface_of(self.scene, at.triangle, at.instance, at.weights);
                word = if self.is_whole(guide, pixel, seen.geometric, width) { word } else { dropped(DROPPED_EDGE) };
            }
            *key = word;
            let count = Carried::of(word).count;
            if count == 0 {
                return (PixelStats::default(), PixelLight::default());
            }
            let (h, l) = (&handed.records[from], &handed.light[from]);
            if count >= self.push.spp {
                (at.triangle, at.instance, at.weights) = (h.triangle, h.instance, h.weights);
            }
            let stats = PixelStats { mean: h.mean, m2: h.m2, count, ..Default::default() };
            let (direct, indirect, indirect_m2) = (l.direct, l.indirect, l.indirect_m2);
            (stats, PixelLight { direct, indirect, indirect_m2, ..Default::default() })
        };
        winner.iter_mut().zip(points).enumerate().map(begin).collect()
    }
}
