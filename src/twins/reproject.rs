//! Twin of `glsl/reproject/*.comp`.
use crate::layout::{
    BSDF_DIELECTRIC, BSDF_METALLIC, Camera, Guide, History, HistoryLight, LightChange, MATERIAL_TWO_SIDED, NONE,
    PixelLight, PixelStats, ReprojectPush, SurfacePoint,
};
pub use crate::render::Carried;
use crate::scene::Scene;
use crate::shaders::project::FARTHEST_OF_FEW;
use crate::shaders::remember::{
    LEAST_SPREAD, NEAR, SHARE_AT_EDGE, SHARE_OF_SPREAD, SURE_SPREAD, UNKNOWN_NOISE, VARIANCE_OF_MOVE,
};
use crate::shaders::shared::held::PLANE_DISTANCE;
use crate::shaders::shared::history::*;
use crate::shaders::shared::rests::AT_REST;
use crate::twins::bsdf::{Bsdf, SMOOTH_ALPHA, bsdf_evaluate, bsdf_is_specular};
use crate::twins::camera::{film_from_point, pixel_width};
use crate::twins::light_change::{probe_cell_of, square};
use crate::twins::surface::{Surface, facing_normals, surface_at, surface_bsdf, view_of};
use crate::twins::texture::surface_opacity;
use crate::twins::traverse::Hit;
use glam::{Vec2, Vec3, Vec4, vec2};

pub(super) fn dropped(reason: u32) -> u32 {
    reason << 16
}

/// Between two frames: the scene before and now, both cameras, and what the kernels are told.
#[derive(Clone, Copy)]
pub struct Reprojection<'a> {
    /// The scene of the last frame.
    pub before: &'a Scene,
    /// The scene of the new frame.
    pub scene: &'a Scene,
    /// As [`crate::scene::Change::instance_now`].
    pub instance_now: &'a [u32],
    /// As [`crate::scene::Change::triangle_now`].
    pub triangle_now: &'a [u32],
    /// How light has changed in each cell, where more than the camera has.
    pub changes: &'a [LightChange],
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

/// By what a sum of squared deviations is divided for the variance of one sample.
pub(super) fn freedom(count: u32) -> f32 {
    (count.max(2) - 1) as f32
}

/// How many new samples have a mean as far from the truth as that of `count` after a change, whose square is `change` times the
/// variance of one sample.
fn worth(count: u32, change: f32) -> u32 {
    let samples = count as f32 / (1.0 + count as f32 * change);
    if change.is_finite() { ((samples + 0.5) as u32).min(count) } else { 0 }
}

pub(super) fn surface_of(scene: &Scene, triangle: u32, instance: u32, weights: [f32; 2]) -> Surface {
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
    let mut bsdf = *bsdf;
    let view = view_of(s, &mut bsdf, facing, wo);
    let from = view.basis.transpose() * wi;
    bsdf_evaluate(&bsdf, view.wo, from).truncate() / from.z.max(1e-3)
}

impl Reprojection<'_> {
    pub(super) fn still(&self) -> bool {
        self.push.moved == 0 && self.previous == self.camera
    }

    /// Whether a pixel shows the surface that another shows, whose tangent plane has this normal.
    fn shows_same(&self, [here, other]: [&Guide; 2], plane: Vec3, width: f32) -> bool {
        let off = plane.dot(Vec3::from(other.position) - Vec3::from(here.position)).abs();
        other.object == here.object && off <= self.push.aliasing * width * here.depth
    }

    /// Whether the neighbours of a pixel show the surface that it shows.
    pub fn is_whole(&self, guide: &[Guide], pixel: usize, plane: Vec3, width: f32) -> bool {
        square(pixel, self.push.size).all(|q| self.shows_same([&guide[pixel], &guide[q]], plane, width))
    }

    /// Whether samples of a pixel may have passed through a surface, or been stopped by one, that its guide does not tell of.
    fn is_veiled(&self, guide: &[Guide], pixel: usize, at: &SurfacePoint, s: &Surface) -> bool {
        let material = |q: usize| Some(guide[q].material).filter(|&material| material != NONE);
        surface_opacity(self.before, s.material, at.triangle, at.weights.into()) < 1.0
            || square(pixel, self.push.size)
                .filter_map(material)
                .any(|m| self.before.materials[m as usize].opacity < 1.0)
    }

    /// How many of `count` samples of a pixel at an edge are worth handing on.
    fn kept_of_edge(&self, left: &Left, pixel: usize, plane: Vec3, count: u32) -> u32 {
        let width = pixel_width(&self.previous, self.push.size);
        let (mut sums, mut squares, mut lamp) = ([Vec4::ZERO; 2], 0.0, false);
        for q in square(pixel, self.push.size) {
            let (s, seen) = (&left.stats[q], &left.guide[q]);
            let same = self.shows_same([&left.guide[pixel], seen], plane, width);
            let (n, mean) = (s.count as f32, Vec3::from(s.mean));
            sums[usize::from(same)] += n * mean.extend(1.0);
            squares += s.m2[0] + s.m2[1] + s.m2[2] + (n * mean).dot(mean);
            lamp |= seen.material != NONE && self.before.materials[seen.material as usize].emission != [0.0; 3];
        }
        if lamp || sums.iter().any(|sum| sum.w == 0.0) {
            return 0;
        }
        let means = sums.map(|sum| sum.truncate() / sum.w);
        let of_means: f32 = sums.iter().zip(means).map(|(sum, mean)| sum.truncate().dot(mean)).sum();
        let variance = (squares - of_means) / (sums[0].w + sums[1].w - 2.0).max(1.0);
        worth(count, VARIANCE_OF_MOVE * (means[1] - means[0]).length_squared() / variance.max(1e-30))
    }

    /// Pixels whose means tell how much pixels near each other differ.
    fn near(&self, pixel: usize) -> impl Iterator<Item = usize> + use<> {
        let [width, height] = self.push.size.map(|n| n as i32);
        let (x, y) = (pixel as i32 % width, pixel as i32 / width);
        (0..NEAR).map(move |k| {
            let step = if k < 9 { 1 } else { 2 };
            let at = [x + step * (k % 3 - 1), y + step * (k % 9 / 3 - 1)];
            (at[1].clamp(0, height - 1) * width + at[0].clamp(0, width - 1)) as usize
        })
    }

    /// How many of `count` samples of a pixel are worth handing on by what the means of pixels around differ by.
    fn kept_by_spread(&self, left: &Left, pixel: usize, plane: Vec3, count: u32, edge: bool) -> u32 {
        let width = pixel_width(&self.previous, self.push.size);
        let same = |q: usize| self.shows_same([&left.guide[pixel], &left.guide[q]], plane, width);
        let near = self.near(pixel).enumerate().filter(|&(k, q)| edge || k < 9 || same(q));
        let near: Vec<_> = near.map(|(_, q)| &left.stats[q]).filter(|s| s.count > 0).collect();
        let (n, origin) = (near.len() as f32, Vec3::from(left.stats[pixel].mean));
        let offs = near.iter().map(|s| Vec3::from(s.mean) - origin);
        let (sum, squares) = offs.fold((Vec3::ZERO, 0.0), |(sum, squares), off| (sum + off, squares + off.dot(off)));
        let degrees: f32 = near.iter().map(|s| (s.count - 1) as f32).sum();
        let variance = near.iter().map(|s| s.m2.iter().sum::<f32>()).sum::<f32>() / degrees.max(1.0);
        let inverse: f32 = near.iter().map(|s| 1.0 / s.count as f32).sum();
        let spread = (squares - sum.dot(sum) / n) / (n - 1.0).max(1.0);
        let share = if edge { SHARE_AT_EDGE } else { SHARE_OF_SPREAD };
        let beyond = (spread - SURE_SPREAD * variance * inverse / n - LEAST_SPREAD * origin.dot(origin)).max(0.0);
        if degrees > 0.0 { worth(count, share * beyond / (variance - beyond).max(1e-30)) } else { count }
    }

    /// The noise of the pixels around one, as [`History::noise`].
    fn noise_around(&self, left: &Left, pixel: usize, plane: Vec3, edge: bool) -> f32 {
        let width = pixel_width(&self.previous, self.push.size);
        let same = |q: usize| self.shows_same([&left.guide[pixel], &left.guide[q]], plane, width);
        let near = self.near(pixel).enumerate().filter(|&(k, q)| q != pixel && (edge || k < 9 || same(q)));
        let (mut mean, mut within, mut degrees, mut n) = (Vec3::ZERO, 0.0, 0.0, 0.0);
        for s in near.map(|(_, q)| &left.stats[q]).filter(|s| s.count > 0) {
            mean += Vec3::from(s.mean);
            within += s.m2.iter().sum::<f32>();
            degrees += (s.count - 1) as f32;
            n += 1.0;
        }
        if degrees > 0.0 { within / degrees * n * n / mean.length_squared().max(1e-30) } else { UNKNOWN_NOISE }
    }

    /// Why a pixel keeps its samples, or 0: what moves of them is in `c`.
    fn reason_to_keep(&self, left: &Left, pixel: usize, c: &mut Carried, noise: &mut f32, resting: &mut u32) -> u32 {
        let at = left.points[pixel];
        if at.triangle == NONE {
            return DROPPED_SKY;
        }
        let s = surface_of(self.before, at.triangle, at.instance, at.weights);
        c.back = s.geometric.dot(Vec3::from(self.previous.position) - s.position) < 0.0;
        if is_sharp(&surface_bsdf(self.before, &s)) || self.is_veiled(left.guide, pixel, &at, &s) {
            return DROPPED_SPECULAR;
        }
        c.edge = !self.is_whole(left.guide, pixel, s.geometric, pixel_width(&self.previous, self.push.size));
        *noise = self.noise_around(left, pixel, s.geometric, c.edge);
        *resting = c.word();
        let worth = self.kept_by_spread(left, pixel, s.geometric, c.count, c.edge);
        c.count = match c.edge {
            true => self.kept_of_edge(left, pixel, s.geometric, c.count).min(worth),
            false => worth,
        };
        if c.count > 0 { 0 } else { DROPPED_EDGE }
    }

    fn numbered_anew(&self, mut at: SurfacePoint) -> SurfacePoint {
        if self.push.instances != 0 && at.instance != NONE {
            at.instance = self.instance_now[at.instance as usize];
        }
        if self.push.triangles != 0 && at.triangle != NONE {
            at.triangle = self.triangle_now[at.triangle as usize];
        }
        at
    }

    /// Twin of `remember.comp`.
    pub fn remember(&self, left: &Left) -> Handed {
        let mut handed = Handed::default();
        for (pixel, s) in left.stats.iter().enumerate() {
            let (at, l) = (left.points[pixel], left.light[pixel]);
            let still = self.still();
            let before = Some(Carried::of(left.carried[pixel])).filter(|c| c.count > 0).unwrap_or_default();
            let mut now = self.older(before, s.count);
            let (mut noise, mut resting) = (UNKNOWN_NOISE, 0);
            let reason = match (still || s.count == 0, now.count) {
                (true, _) => 0,
                (false, 0) => DROPPED_OLD,
                (false, _) => self.reason_to_keep(left, pixel, &mut now, &mut noise, &mut resting),
            };
            handed.offered.push(if reason == 0 { now.word() } else { dropped(reason) });
            let share = if still { freedom(now.count) / freedom(s.count) } else { 1.0 };
            let of_one = |m2: f32| m2 * share / if still { 1.0 } else { freedom(s.count) };
            let variance = s.m2.map(of_one);
            let SurfacePoint { triangle, instance, weights, .. } = self.numbered_anew(at);
            let mean = s.mean;
            handed.records.push(History { triangle, instance, weights, mean, variance, noise, resting });
            let PixelLight { direct, albedo, remainder, .. } = l;
            let indirect_variance = of_one(l.indirect_m2);
            handed.light.push(HistoryLight { direct, albedo, indirect_variance, remainder, ..Default::default() });
        }
        handed
    }

    fn older(&self, c: Carried, count: u32) -> Carried {
        let (limit, still) = (self.push.max_age, self.still());
        let age = (c.age * c.count + count / 2) / count.max(1);
        let most = count.min(if still { MOST_CARRIED } else { self.push.max_samples });
        let (count, age) = match !still && age >= limit {
            true => (most * limit / (age + 1), limit.max(1) - 1),
            false => (most, age),
        };
        Carried { count, age, edge: false, back: false }
    }

    pub(super) fn shows(&self, seen: &Guide, s: &Surface) -> bool {
        let off = s.geometric.dot(Vec3::from(seen.position) - s.position).abs();
        let near = off <= PLANE_DISTANCE * pixel_width(&self.camera, self.push.size) * seen.depth;
        near && seen.object == s.object && seen.material == s.material
    }

    /// Square of the share by which the changed view may move a surface's light.
    pub(super) fn view_change(&self, s: &Surface) -> f32 {
        let bsdf = surface_bsdf(self.scene, s);
        if !bsdf_is_specular(&bsdf) {
            return 0.0;
        }
        let [before, after] = [self.previous, self.camera].map(|c| (Vec3::from(c.position) - s.position).normalize());
        let n = if s.normal.dot(before) < 0.0 { -s.normal } else { s.normal };
        let of = |view: Vec3| {
            let from = 2.0 * view.dot(n) * n - view;
            let [a, b] = [before, after].map(|wo| scattered(s, &bsdf, wo, from));
            ((b - a).abs() / a.max(b).max(Vec3::splat(1e-30))).max_element()
        };
        of(before).max(of(after))
    }

    /// How many of `count` samples of an old pixel that change leaves.
    pub(super) fn worth_in_view(&self, count: u32, change: f32, h: &History) -> u32 {
        worth(count, change / (self.push.view * self.push.view * h.noise).max(1e-30))
    }

    /// Of samples that several new pixels take, because each of them is smaller at the point than the old one was, a share each: of films
    /// with direct and indirect light apart, which filters read. In others all count.
    pub(super) fn shared_out(&self, count: u32, point: Vec3) -> u32 {
        let [before, after] = [self.previous, self.camera].map(|c| (point - Vec3::from(c.position)).length_squared());
        let width = |camera| pixel_width(camera, self.push.size);
        let ratio = width(&self.previous) / width(&self.camera).max(1e-30);
        let magnified = ratio * ratio * before / after.max(1e-30);
        if magnified > 1.0 { (count as f32 / magnified + 0.5).max(1.0) as u32 } else { count }
    }

    /// How many of a pixel's samples the changed light leaves.
    pub(super) fn after_change(&self, pixel: usize, count: u32) -> u32 {
        if self.push.moved == 0 {
            return count;
        }
        let change = self.changes[probe_cell_of(pixel as u32, self.push.size) as usize].change;
        worth(count, (change / self.push.noise.max(1e-15)).powi(2))
    }

    /// Offers a pixel's samples to those around a point of the film, of an edge to edges alone. Returns why none takes them, or 0.
    fn offer(&self, guide: &[Guide], winner: &mut [u32], pixel: usize, c: Carried, s: &Surface, film: Vec2) -> u32 {
        let few = c.count < self.push.spp;
        let [width, height] = self.push.size.map(|n| n as i32);
        let (x, y) = ((film.x - 0.5).floor() as i32, (film.y - 0.5).floor() as i32);
        let around = [(x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1)];
        let mut reason = DROPPED_OUTSIDE;
        for (x, y) in around.into_iter().filter(|(x, y)| (0..width).contains(x) && (0..height).contains(y)) {
            let to = (y * width + x) as usize;
            let (at_edge, off) = (winner[to] & AT_EDGE, (film - vec2(x as f32, y as f32) - 0.5).abs().max_element());
            if few && off > FARTHEST_OF_FEW {
                continue;
            }
            if c.edge == (at_edge != 0) && self.shows(&guide[to], s) {
                let off = ((off * (FARTHEST + 1) as f32) as u32).min(FARTHEST);
                winner[to] = winner[to].min(at_edge | off << PIXEL_BITS | pixel as u32);
                reason = 0;
            } else if reason != 0 {
                reason = DROPPED_HIDDEN;
            }
        }
        reason
    }

    /// Moves a pixel's samples. Returns their word in their new pixel, or why they stay behind.
    fn moved(&self, handed: &Handed, guide: &[Guide], winner: &mut [u32], pixel: usize, mut c: Carried) -> u32 {
        let h = &handed.records[pixel];
        let s = surface_of(self.scene, h.triangle, h.instance, h.weights);
        if c.back != (s.geometric.dot(Vec3::from(self.camera.position) - s.position) < 0.0) {
            return dropped(DROPPED_HIDDEN);
        }
        c.count = self.after_change(pixel, c.count);
        if c.count == 0 {
            return dropped(DROPPED_LIGHT);
        }
        c.count = self.worth_in_view(c.count, self.view_change(&s), h);
        if c.count == 0 {
            return dropped(DROPPED_VIEW);
        }
        c.count = self.shared_out(c.count, s.position);
        let film = film_from_point(&self.camera, s.position, self.push.size);
        let ahead = film.z > 0.0 && film.is_finite();
        let reason = if ahead { self.offer(guide, winner, pixel, c, &s, film.truncate()) } else { DROPPED_OUTSIDE };
        let word = Carried { age: c.age + 1, ..c }.word();
        if reason == 0 { word } else { dropped(reason) }
    }

    fn point_rests(&self, handed: &Handed, guide: &[Guide], pixel: usize) -> bool {
        let (h, width) = (&handed.records[pixel], self.push.size[0] as usize);
        if h.triangle == NONE {
            return self.push.sky == 0 && guide[pixel].object == NONE;
        }
        let s = surface_of(self.scene, h.triangle, h.instance, h.weights);
        let film = film_from_point(&self.camera, s.position, self.push.size);
        let off = film.truncate() - vec2((pixel % width) as f32, (pixel / width) as f32) - 0.5;
        let (c, back) = (Carried::of(h.resting), s.geometric.dot(Vec3::from(self.camera.position) - s.position) < 0.0);
        c.count > 0
            && c.back == back
            && film.z > 0.0
            && off.abs().max_element() <= AT_REST
            && self.shows(&guide[pixel], &s)
    }

    /// The samples that a pixel keeps as they are, which is at an edge in the new frame or not.
    pub(super) fn resting(&self, handed: &Handed, guide: &[Guide], pixel: usize, edge: bool) -> Option<Carried> {
        let c = Carried::of(handed.records[pixel].resting);
        let seen = || square(pixel, self.push.size).filter(|&q| edge || q == pixel);
        let rests = handed.offered[pixel] != 0
            && self.previous == self.camera
            && c.count > 0
            && c.edge == edge
            && seen().all(|q| self.point_rests(handed, guide, q));
        rests.then_some(c)
    }

    /// Leaves the samples of a pixel that rests where they are.
    fn kept(&self, winner: &mut [u32], pixel: usize, mut c: Carried) -> u32 {
        c.count = self.after_change(pixel, c.count);
        if c.count == 0 {
            return dropped(DROPPED_LIGHT);
        }
        winner[pixel] = winner[pixel].min(if c.edge { AT_EDGE } else { 0 } | pixel as u32);
        Carried { age: c.age + 1, ..c }.word()
    }

    /// Twin of `edges.comp`: a key without an offer of every new pixel. `guide` and `points` are those of the new frame.
    fn edges(&self, guide: &[Guide], points: &[SurfacePoint]) -> Vec<u32> {
        let width = pixel_width(&self.camera, self.push.size);
        let plane = |at: &SurfacePoint| surface_of(self.scene, at.triangle, at.instance, at.weights).geometric;
        let edge = |(i, at): (usize, &SurfacePoint)| at.triangle != NONE && !self.is_whole(guide, i, plane(at), width);
        points.iter().enumerate().map(|at| if edge(at) { AT_EDGE | NO_OFFER } else { NO_OFFER }).collect()
    }

    /// Twin of `project.comp`: the winner's key of every new pixel. `guide` and `points` are those of the new frame.
    pub fn project(&self, handed: &mut Handed, guide: &[Guide], points: &[SurfacePoint]) -> Vec<u32> {
        let mut winner = self.edges(guide, points);
        for pixel in 0..guide.len() {
            let c = Carried::of(handed.offered[pixel]);
            if self.still() {
                if c.count > 0 {
                    winner[pixel] = pixel as u32;
                }
                continue;
            }
            match self.resting(handed, guide, pixel, winner[pixel] & AT_EDGE != 0) {
                Some(c) => handed.offered[pixel] = self.kept(&mut winner, pixel, c),
                None if c.count > 0 => handed.offered[pixel] = self.moved(handed, guide, &mut winner, pixel, c),
                None => {}
            }
        }
        winner
    }

    /// Twin of `carry.comp`: what every new pixel begins with. `points` are those of the new frame; the words of what is carried
    /// replace the keys.
    pub fn carry(
        &self,
        handed: &Handed,
        winner: &mut [u32],
        points: &mut [SurfacePoint],
    ) -> Vec<(PixelStats, PixelLight)> {
        let begin = |(key, at): (&mut u32, &mut SurfacePoint)| {
            let from = (*key & ((1 << PIXEL_BITS) - 1)) as usize;
            let nobody = if *key & AT_EDGE != 0 { dropped(DROPPED_EDGE) } else { 0 };
            let inside = *key >> PIXEL_BITS & FARTHEST <= FARTHEST / 2;
            *key = if *key & NO_OFFER == NO_OFFER { nobody } else { handed.offered[from] };
            let count = Carried::of(*key).count;
            if count == 0 {
                return (PixelStats::default(), PixelLight::default());
            }
            let (h, l) = (&handed.records[from], &handed.light[from]);
            if count >= self.push.spp && inside {
                (at.triangle, at.instance, at.weights) = (h.triangle, h.instance, h.weights);
            }
            let of_all = |variance: f32| if self.still() { variance } else { variance * (count - 1) as f32 };
            let stats = PixelStats { mean: h.mean, m2: h.variance.map(of_all), count, ..Default::default() };
            let HistoryLight { direct, albedo, remainder, .. } = *l;
            let indirect_m2 = of_all(l.indirect_variance);
            (stats, PixelLight { direct, albedo, indirect_m2, remainder, ..Default::default() })
        };
        winner.iter_mut().zip(points).map(begin).collect()
    }
}
