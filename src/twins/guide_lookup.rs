//! Twin of `glsl/trace/guide_lookup.comp`.
use crate::layout::{Guide, vec3, vec4};
use crate::shaders::guide_lookup::{MIN_DEPTH_DIFFERENCE, MIN_NORMAL_DIFFERENCE};
use crate::shaders::shared::sanitise::LARGEST;
use crate::twins::camera::{eye_ray, film_sample, path_seed};
use crate::twins::path::Tracer;
use crate::twins::primary_hit::{SeenHit, seen_hit};
use crate::twins::sampler::sampler_start;
use glam::{IVec2, Vec2, Vec3, ivec2};
use std::ops::Range;

/// The guide rays of a film, row-major, and the filtered light that they carry.
#[derive(Clone, Copy, Debug)]
pub struct GuideRays<'a> {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Hits of the guide rays; one that meets nothing has depth 0 and carries no light.
    pub guide: &'a [Guide],
    /// Filtered light in rgb; w is its number of samples, 0 where there is no light.
    pub filtered: &'a [vec4],
}

impl GuideRays<'_> {
    /// Differences of normal and depth from those of the guide ray at `at`, if that carries light.
    fn differences(&self, eye: &Guide, at: IVec2) -> Option<Vec2> {
        if at.x >= self.size[0] as i32 || at.y >= self.size[1] as i32 {
            return None;
        }
        let q = self.pixel(at);
        let (normal, depth) = (Vec3::from(self.guide[q].normal), self.guide[q].depth);
        let light = self.filtered[q];
        let known = light[3] > 0.0 && light.iter().all(|v| v.is_finite());
        let carries = known && normal.is_finite() && depth.is_finite() && depth > 0.0;
        carries.then(|| Vec2::new(Vec3::from(eye.normal).distance(normal), (eye.depth - depth).abs()))
    }

    fn pixel(&self, at: IVec2) -> usize {
        at.y as usize * self.size[0] as usize + at.x as usize
    }

    /// Pixel of the guide ray with the largest S = S_n * S_d among the four nearest to `film` (pixels).
    pub fn most_similar(&self, eye: &Guide, film: Vec2) -> Option<usize> {
        let size = ivec2(self.size[0] as i32, self.size[1] as i32);
        let first = (film - 0.5).floor().as_ivec2().clamp(IVec2::ZERO, (size - 2).max(IVec2::ZERO));
        let near = film.floor().as_ivec2().clamp(IVec2::ZERO, size - 1);
        let far = 2 * first + 1 - near;
        let at = [near, ivec2(far.x, near.y), ivec2(near.x, far.y), far];
        let differences = at.map(|at| self.differences(eye, at));
        let least = Vec2::new(MIN_NORMAL_DIFFERENCE, MIN_DEPTH_DIFFERENCE * eye.depth);
        let largest = differences.iter().flatten().fold(least, |a, b| a.max(*b));
        let (mut chosen, mut best) = (None, -1.0);
        for (at, difference) in at.iter().zip(differences) {
            let Some(difference) = difference else { continue };
            let s = (1.0 - difference / largest).element_product();
            if s > best {
                (chosen, best) = (Some(self.pixel(*at)), s);
            }
        }
        chosen
    }
}

/// What sample `index` of `pixel` shows, and where it passes the film (pixels); none where a path keeps no albedo, as of the sky.
pub fn eye_hit(tracer: &Tracer, pixel: u32, index: u32) -> Option<(SeenHit, Vec2)> {
    let Tracer { scene, frame, effects, .. } = tracer;
    let random = sampler_start(pixel, index, frame.path.seed, effects.independent_sampler);
    let film = film_sample(frame, effects, pixel, random);
    let ray = eye_ray(frame, effects, film, random);
    let eye = seen_hit(scene, frame, &ray, path_seed(frame, effects, pixel, index));
    (eye.kept != Vec3::ZERO).then_some((eye, film))
}

/// Mean over the eye rays of these samples, one at least, of albedo times the light of the guide ray that is most alike.
pub fn look_up(tracer: &Tracer, guides: &GuideRays, pixel: u32, samples: Range<u32>) -> vec3 {
    let seen = |index: u32| {
        let Some((eye, film)) = eye_hit(tracer, pixel, index) else { return Vec3::ZERO };
        let Some(q) = guides.most_similar(&eye.guide, film) else { return Vec3::ZERO };
        let [r, g, b, _] = guides.filtered[q];
        eye.kept * Vec3::new(r, g, b).clamp(Vec3::splat(-LARGEST), Vec3::splat(LARGEST))
    };
    (samples.clone().map(seen).sum::<Vec3>() / samples.len() as f32).into()
}
