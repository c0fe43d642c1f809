//! Twin of `glsl/trace/path.comp` and of `glsl/shared/path_step.glsl`.
use crate::layout::{
    BSDF_DIELECTRIC, BSDF_DIFFUSE, Effects, FrameConstants, MATERIAL_EMITS_BEHIND, NONE, PathConstants, SurfacePoint,
};
use crate::scene::Scene;
use crate::shaders::shared::path_step::{
    LEAST_REST, MAX_SURVIVAL, ODDS_BEYOND_COSINE, PAIR_BSDF, PAIR_CHOICE, PAIR_FIRST_BOUNCE, PAIR_LIGHT, PAIR_ROULETTE,
    PAIRS_PER_BOUNCE,
};
use crate::twins::bsdf::{
    Bsdf, bsdf_albedo, bsdf_evaluate, bsdf_gloss, bsdf_is_delta, bsdf_lets_light_through, bsdf_sample, bsdf_share,
    relative_index, seen_albedo,
};
use crate::twins::camera::{eye_ray, film_sample, path_seed};
use crate::twins::light::*;
use crate::twins::sampler::{Sampler, sample_2d, sample_2d_bits, sampler_start};
use crate::twins::surface::{
    Surface, View, facing_of, light_share, surface_at, surface_bsdf, surface_emission, view_of,
};
use crate::twins::traverse::{Hit, light_left, traverse, traverse_from};
use glam::Vec3;

pub use crate::shaders::shared::path_step::SHADOW_END;
use crate::shaders::shared::segment::PASSES_WALLS;
use crate::twins::texture::mask_seed;

/// What one path returns, linear Rec. 709. Without [`Effects::indirect`] and [`Effects::soft_light`] all light is in `direct`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PathSample {
    /// Light that needs no filter, as [`crate::layout::PixelLight::direct`].
    pub direct: Vec3,
    /// Radiance that arrived by more than one bounce; with [`Effects::soft_light`] also what all but the key light brings to the
    /// first hit.
    pub indirect: Vec3,
    /// What that radiance has been multiplied by: see [`crate::layout::PixelLight::albedo`].
    pub albedo: Vec3,
    /// Whether smooth surfaces sent it a way that few paths take: that albedo is not what the pixel shows.
    pub astray: bool,
    /// Whether it chose another light than the key light, if there is one.
    pub passed_over: bool,
    /// What the light that was chosen at the first surface that is not smooth brings there, times the probability of that choice, if it has
    /// no extent.
    pub certain: Vec3,
    /// That light, or [`NONE`] where the path had the choice between two ways, or never came to such a surface.
    pub choice: u32,
    /// Number of rays, shadow rays included.
    pub rays: u32,
    /// Whether the light was not finite, and counts as black.
    pub broken: bool,
}

impl PathSample {
    /// Direct and indirect light together.
    pub fn radiance(&self) -> Vec3 {
        self.direct + self.indirect
    }
}

/// Sampling strategies that paths use. The kernel has only `Both`; tests show by the others that either one suffices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Strategy {
    /// Both, joined by the balance heuristic.
    Both,
    /// Light sampling alone, wherever a light can be sampled.
    Light,
    /// BSDF sampling alone, which loses point, spot and directional lights.
    Bsdf,
}

/// The parts that a path's light is added up in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Direct,
    Indirect,
    Soft,
}

/// One light sampled at a surface.
struct SampledLight {
    /// What it brings; `None` where no shadow ray is needed.
    brought: Option<Vec3>,
    /// As of a [`LightSample`](crate::twins::light::LightSample).
    sharp: f32,
    /// Index of the light.
    chosen: u32,
    /// The share of it that is kept apart; 0 but for the key light.
    kept: f32,
    /// Whether there is a key light, and it is not this.
    passed_over: bool,
}

/// As `kind_of_light` of the kernel.
fn kind_of_light(seen: &Seen) -> Kind {
    match seen.scattered {
        0 if seen.share < 1.0 => Kind::Soft,
        0 => Kind::Direct,
        1 => Kind::Soft,
        _ => Kind::Indirect,
    }
}

/// What a path has met.
struct Seen {
    /// Surfaces that are not smooth.
    scattered: u32,
    /// Probability of the path's way, where smooth ones before them let it take one of two: 0 beyond one less likely than not.
    share: f32,
    /// What light is multiplied by on its way from what the path sees: see [`seen_albedo`].
    albedo: Vec3,
}

impl Seen {
    /// Notes a surface that a path of this throughput comes to.
    fn note(&mut self, p: &Shade, throughput: Vec3) {
        if self.scattered == 0 && self.share > 0.0 {
            self.albedo = seen_albedo(throughput, bsdf_albedo(&p.bsdf, p.view.wo.z), self.share);
        }
        self.scattered += u32::from(!bsdf_is_delta(&p.bsdf));
    }

    /// Notes the way that a path of this throughput leaves a surface by.
    fn pass(&mut self, p: &Shade, throughput: Vec3, u_lobe: f32) {
        if self.scattered > 0 || self.share == 0.0 {
            return;
        }
        self.share *= bsdf_share(&p.bsdf, p.view.wo, u_lobe);
        if self.share < 1.0 {
            self.albedo = seen_albedo(throughput, Vec3::ONE, 1.0);
        }
    }
}

/// Light by the kernel's sums: what is soft is added to indirect light at the path's end.
#[derive(Default)]
struct Sum {
    direct: Vec3,
    indirect: Vec3,
    soft: Vec3,
}

struct Path {
    origin: Vec3,
    direction: Vec3,
    throughput: Vec3,
    bsdf_pdf: f32,
    delta: bool,
    eta_scale: f32,
}

impl Path {
    fn new(origin: Vec3, direction: Vec3) -> Self {
        Self { origin, direction, throughput: Vec3::ONE, bsdf_pdf: 0.0, delta: true, eta_scale: 1.0 }
    }
}

/// A path tracer for one scene.
#[derive(Clone, Copy, Debug)]
pub struct Tracer<'a> {
    /// The scene that paths are traced in.
    pub scene: &'a Scene,
    /// Constants of the frame, as the kernel reads them.
    pub frame: FrameConstants,
    /// Effects that settings decide: roulette, clamp, pixel filter, sampler, split and soft light; the scene decides the rest.
    pub effects: Effects,
    /// [`Strategy::Both`] for the kernel's answer.
    pub strategy: Strategy,
}

/// The surface point that is being shaded.
struct Shade {
    surface: Surface,
    bsdf: Bsdf,
    view: View,
    pair: u32,
    /// Triangle and instance that the next ray leaves.
    from: [u32; 2],
}

/// What light is sampled for at a surface point.
pub fn receiver_of(s: &Surface, bsdf: &Bsdf, view: &View) -> Receiver {
    let (share, alpha) = bsdf_gloss(bsdf, view.wo);
    let (cosine2, alpha2) = (view.wo.z * view.wo.z, (alpha * alpha).max(1e-6));
    let area = 0.5 * (view.wo.z.abs() + (alpha2 + (1.0 - alpha2) * cosine2).sqrt());
    Receiver {
        position: s.position,
        normal: view.facing.normal,
        lets_light_through: bsdf_lets_light_through(bsdf),
        odds_beyond_cosine: if bsdf.kind == BSDF_DIFFUSE { 0.0 } else { ODDS_BEYOND_COSINE },
        viewer: view.basis * view.wo,
        gloss: share / (4.0 * area * (1.0 - share).max(LEAST_REST)),
        alpha2,
    }
}

impl Tracer<'_> {
    fn balance(&self, taken: f32, other: f32, strategy: Strategy) -> f32 {
        match self.strategy {
            Strategy::Both => taken / (taken + other).max(1e-37),
            only => f32::from(only == strategy),
        }
    }

    fn add_light(&self, sum: &mut Sum, light: Vec3, kind: Kind) {
        match kind {
            Kind::Indirect if self.effects.indirect => sum.indirect += light,
            Kind::Soft if self.effects.soft_light => sum.soft += light,
            _ => sum.direct += light,
        }
    }

    /// Adds sampled light, of which the share `kept` needs no filter.
    fn add_sampled(&self, sum: &mut Sum, seen: &Seen, light: Vec3, kept: f32) {
        self.add_light(sum, kept * light, Kind::Direct);
        self.add_light(sum, (1.0 - kept) * light, kind_of_light(seen));
    }

    fn clamped(&self, light: Vec3) -> Vec3 {
        let (largest, limit) = (light.max_element(), self.frame.path.clamp_indirect);
        let clamps = self.effects.clamp && limit > 0.0 && largest > limit;
        if clamps { light * (limit / largest) } else { light }
    }

    fn light_from_miss(&self, path: &Path) -> Vec3 {
        if self.frame.path.environment == NONE {
            return Vec3::ZERO;
        }
        let light = &self.scene.lights[self.frame.path.environment as usize];
        let (radiance, pdf) = environment_radiance(self.scene, light, path.direction);
        radiance * if path.delta { 1.0 } else { self.balance(path.bsdf_pdf, pdf, Strategy::Bsdf) }
    }

    fn light_from_hit(&self, path: &Path, s: &Surface, t: f32) -> Vec3 {
        let cosine = -s.geometric.dot(path.direction);
        let front = cosine > 0.0;
        if !front && self.scene.materials[s.material as usize].flags & MATERIAL_EMITS_BEHIND == 0 {
            return Vec3::ZERO;
        }
        let certain = path.delta || (s.radius > 0.0 && !front);
        let pdf = triangle_light_pdf(self.scene, s, path.origin, t, cosine.abs());
        let weight = if certain { 1.0 } else { self.balance(path.bsdf_pdf, pdf, Strategy::Bsdf) };
        surface_emission(self.scene, s, cosine.abs()) * weight
    }

    fn light_from_nee(&self, p: &Shade, random: Sampler, mask_seed: u32) -> SampledLight {
        let s = &p.surface;
        let word = sample_2d_bits(random, p.pair + PAIR_CHOICE)[0];
        let light =
            light_sample(self.scene, &receiver_of(s, &p.bsdf, &p.view), word, sample_2d(random, p.pair + PAIR_LIGHT));
        let LightSample { sharp, chosen, .. } = light;
        let (is_key, soft) = (chosen == light.key, self.effects.soft_light && light.kept > 0.0);
        let kept = if soft && is_key { light.kept * sharp } else { 0.0 };
        let none = SampledLight { brought: None, sharp, chosen, kept, passed_over: soft && !is_key };
        if light.radiance == Vec3::ZERO {
            return none;
        }
        let wi = p.view.basis.transpose() * light.direction;
        let f = bsdf_evaluate(&p.bsdf, p.view.wo, wi);
        let share = light_share(s, &p.view.facing, light.direction, wi.z);
        let weight = if light.pdf > 0.0 { self.balance(light.pdf, f.w, Strategy::Light) } else { 1.0 };
        let contribution = f.truncate() * share * light.radiance * weight;
        if contribution.max_element() <= 0.0 || contribution.is_nan() {
            return none;
        }
        let origin = s.ray_origin(light.direction);
        let (mut direction, mut distance) = (light.direction, light.distance);
        if distance < INFINITE_DISTANCE {
            direction = s.position + light.distance * light.direction - origin;
            distance = SHADOW_END;
        }
        let mask_seed = mask_seed | if light.pdf == 0.0 { PASSES_WALLS } else { 0 };
        let left = light_left(self.scene, p.from, origin, direction, distance, mask_seed);
        SampledLight { brought: Some(contribution * left), ..none }
    }

    fn scatter(&self, path: &mut Path, p: &Shade, random: Sampler) -> bool {
        let lobe = sample_2d(random, p.pair + PAIR_CHOICE).y;
        let (scattered, next) = bsdf_sample(&p.bsdf, p.view.wo, lobe, sample_2d(random, p.pair + PAIR_BSDF));
        if !scattered {
            return false;
        }
        path.direction = p.view.basis * next.wi;
        path.throughput *= next.weight * light_share(&p.surface, &p.view.facing, path.direction, next.wi.z);
        path.origin = p.surface.ray_origin(path.direction);
        path.bsdf_pdf = next.pdf;
        path.delta = next.delta;
        if p.bsdf.kind == BSDF_DIELECTRIC && p.view.wo.z * next.wi.z < 0.0 {
            path.eta_scale *= relative_index(&p.bsdf, p.view.wo.z).powi(2);
        }
        path.throughput.max_element() > 0.0
    }

    fn survives_roulette(&self, path: &mut Path, random: Sampler, bounce: u32) -> bool {
        let (least, pair) = (self.frame.path.roulette_depth, PAIR_FIRST_BOUNCE + PAIRS_PER_BOUNCE * bounce);
        if !self.effects.roulette || least == 0 || bounce + 1 < least {
            return true;
        }
        let q = (path.throughput.max_element() * path.eta_scale).min(MAX_SURVIVAL);
        if sample_2d(random, pair + PAIR_ROULETTE).x >= q {
            return false;
        }
        path.throughput /= q;
        true
    }

    fn shade(&self, surface: Surface, direction: Vec3, pair: u32, from: [u32; 2]) -> Shade {
        let mut bsdf = surface_bsdf(self.scene, &surface);
        let facing = facing_of(&surface, &bsdf, -direction);
        let view = view_of(&surface, &mut bsdf, facing, -direction);
        Shade { bsdf, surface, view, pair, from }
    }

    /// `first` is what the path's first ray finds. A path that is `sharp_only` ends where only light can come that a filter takes.
    fn trace_path(&self, mut path: Path, sharp_only: bool, first: Hit, random: Sampler, seed: u32) -> PathSample {
        let (mut sum, mut rays, mut seen) = (Sum::default(), 0, Seen { scattered: 0, share: 1.0, albedo: Vec3::ZERO });
        let (mut certain, mut choice, mut passed_over) = (Vec3::ZERO, NONE, false);
        let mut from = [NONE; 2];
        for bounce in 0u32.. {
            let pair = PAIR_FIRST_BOUNCE + PAIRS_PER_BOUNCE * bounce;
            let on_way = mask_seed(seed, 2 * bounce);
            rays += 1;
            let hit = match bounce {
                0 => first,
                _ => traverse_from(self.scene, from, path.origin, path.direction, on_way),
            };
            let kind = kind_of_light(&seen);
            if !hit.any() {
                self.add_light(&mut sum, path.throughput * self.light_from_miss(&path), kind);
                break;
            }
            from = [hit.triangle, hit.instance];
            let s = surface_at(self.scene, &hit);
            self.add_light(&mut sum, path.throughput * self.light_from_hit(&path, &s, hit.t), kind);
            if bounce + 1 >= self.frame.path.max_depth {
                break;
            }
            let p = self.shade(s, path.direction, pair, from);
            seen.note(&p, path.throughput);
            let ends = sharp_only && seen.scattered > u32::from(!self.effects.soft_light);
            if self.frame.path.light_count > 0 && !bsdf_is_delta(&p.bsdf) {
                let sampled = self.light_from_nee(&p, random, mask_seed(seed, 2 * bounce + 1));
                let first = seen.scattered == 1;
                let brought = sampled.brought.filter(|_| !ends || sampled.kept > 0.0);
                rays += u32::from(brought.is_some());
                let light = path.throughput * brought.unwrap_or_default();
                self.add_sampled(&mut sum, &seen, light, if first { sampled.kept } else { 0.0 });
                passed_over |= first && sampled.passed_over;
                if first && choice == NONE && seen.share == 1.0 {
                    (certain, choice) = (sampled.sharp * light, sampled.chosen);
                }
            }
            if !self.scatter(&mut path, &p, random) || ends {
                break;
            }
            seen.pass(&p, path.throughput, sample_2d(random, pair + PAIR_CHOICE).y);
            if !self.survives_roulette(&mut path, random, bounce) {
                break;
            }
        }
        let filtered = self.clamped(sum.indirect) + sum.soft;
        PathSample {
            direct: sum.direct,
            indirect: if sharp_only { Vec3::ZERO } else { filtered },
            albedo: seen.albedo,
            astray: seen.share == 0.0,
            passed_over,
            certain,
            choice,
            rays,
            broken: false,
        }
    }

    /// Traces sample `index` of `pixel` (row-major).
    pub fn sample(&self, pixel: u32, index: u32) -> PathSample {
        let random = sampler_start(pixel, index, self.frame.path.seed, self.effects.independent_sampler);
        let film = film_sample(&self.frame, &self.effects, pixel, random);
        let ray = eye_ray(&self.frame, &self.effects, film, random);
        let seed = path_seed(&self.frame, &self.effects, pixel, index);
        let first = traverse(self.scene, ray.origin, ray.direction, INFINITE_DISTANCE, false, mask_seed(seed, 0));
        let PathConstants { size: [width, _], indirect_stride, .. } = self.frame.path;
        let sharp_only = [pixel % width, pixel / width].iter().any(|at| !at.is_multiple_of(indirect_stride.max(1)));
        let sample = self.trace_path(Path::new(ray.origin, ray.direction), sharp_only, first, random, seed);
        match sample.radiance().is_finite() {
            true => sample,
            false => PathSample { direct: Vec3::ZERO, indirect: Vec3::ZERO, broken: true, ..sample },
        }
    }
    /// What comes from a point towards `eye`, by the path that `probe.comp` traces with this sample.
    pub fn light_from(&self, at: SurfacePoint, eye: Vec3, index: u32) -> PathSample {
        let mut hit = Hit { t: 0.0, triangle: at.triangle, instance: at.instance, barycentric: at.weights.into() };
        let off = surface_at(self.scene, &hit).position - eye;
        hit.t = off.length();
        let random = sampler_start(0, index, self.frame.path.seed, self.effects.independent_sampler);
        let path = Path::new(eye, off / hit.t.max(1e-37));
        self.trace_path(path, false, hit, random, path_seed(&self.frame, &self.effects, 0, index))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shaders::shared::camera::{PAIR_FILM, PAIR_LENS};

    /// A pair that decides two things makes one depend on the other.
    #[test]
    fn no_two_decisions_of_a_path_use_the_same_random_numbers() {
        let events = [PAIR_CHOICE, PAIR_LIGHT, PAIR_BSDF, PAIR_ROULETTE];
        let of_bounce = |bounce: u32| events.map(|pair| PAIR_FIRST_BOUNCE + PAIRS_PER_BOUNCE * bounce + pair);
        let mut pairs = [PAIR_FILM, PAIR_LENS].into_iter().chain((0..4).flat_map(of_bounce)).collect::<Vec<_>>();
        let all = pairs.len();
        pairs.sort_unstable();
        pairs.dedup();
        assert_eq!(pairs.len(), all);
    }
}
