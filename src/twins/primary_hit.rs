//! Twin of `glsl/trace/primary_hit.comp` and of `glsl/shared/first_hit.glsl`.
use crate::layout::{BSDF_DIELECTRIC, Camera, FrameConstants, Guide, MATERIAL_TWO_SIDED, NONE, SurfacePoint};
use crate::math::hash::pcg;
use crate::scene::Scene;
use crate::twins::bsdf::{bsdf_albedo, bsdf_is_delta, bsdf_sample};
use crate::twins::camera::{Ray, camera_ray, film_from_pixel};
use crate::twins::light::INFINITE_DISTANCE;
use crate::twins::surface::{facing_normals, local_coat_normal, shading_basis, side_of, surface_at, surface_bsdf};
use crate::twins::traverse::{Hit, traverse};
use glam::{Vec2, Vec3, vec2};

/// The primary hit through the centre of `pixel` (row-major), from the middle of the lens.
pub fn guide(scene: &Scene, frame: &FrameConstants, pixel: u32) -> Guide {
    let ray = centre_ray(frame, pixel);
    first_hit(scene, frame, &ray, pcg(pixel)).guide
}

/// What the ray through the centre of `pixel` shows: that hit or, where it is smooth, what is seen in it.
pub fn seen(scene: &Scene, frame: &FrameConstants, pixel: u32) -> Guide {
    let ray = centre_ray(frame, pixel);
    seen_hit(scene, frame, &ray, pcg(pixel))
}

/// The point of that hit.
pub fn point(scene: &Scene, frame: &FrameConstants, pixel: u32) -> SurfacePoint {
    let ray = centre_ray(frame, pixel);
    let hit = traverse(scene, ray.origin, ray.direction, INFINITE_DISTANCE, false, pcg(pixel));
    let weights = hit.barycentric.into();
    SurfacePoint { triangle: hit.triangle, instance: hit.instance, weights, ..Default::default() }
}

fn centre_ray(frame: &FrameConstants, pixel: u32) -> Ray {
    let centre = vec2((pixel % frame.path.size[0]) as f32, (pixel / frame.path.size[0]) as f32) + 0.5;
    let camera = Camera { lens_radius: 0.0, ..frame.camera };
    camera_ray(&camera, film_from_pixel(centre, frame.path.size), Vec2::splat(0.5))
}

/// What a ray meets first.
pub struct FirstHit {
    /// As the kernel writes it.
    pub guide: Guide,
    /// Whether it is a smooth surface, which shows what is behind it.
    pub delta: bool,
    hit: Hit,
}

/// What a primary ray meets.
pub fn first_hit(scene: &Scene, frame: &FrameConstants, ray: &Ray, mask_seed: u32) -> FirstHit {
    let hit = traverse(scene, ray.origin, ray.direction, INFINITE_DISTANCE, false, mask_seed);
    if !hit.any() {
        return FirstHit { guide: Guide { object: NONE, material: NONE, ..Guide::default() }, delta: false, hit };
    }
    let s = surface_at(scene, &hit);
    let bsdf = surface_bsdf(scene, &s);
    let normal = side_of(&s, -ray.direction) * s.normal;
    let guide = Guide {
        normal: normal.into(),
        depth: hit.t + frame.camera.near,
        position: s.position.into(),
        object: s.object,
        albedo: bsdf_albedo(&bsdf, -s.normal.dot(ray.direction)).into(),
        material: s.material,
        ..Default::default()
    };
    FirstHit { guide, delta: bsdf_is_delta(&bsdf), hit }
}

/// What a primary ray shows.
pub fn seen_hit(scene: &Scene, frame: &FrameConstants, ray: &Ray, mask_seed: u32) -> Guide {
    let FirstHit { mut guide, mut delta, mut hit } = first_hit(scene, frame, ray, mask_seed);
    let mut way = Ray { origin: ray.origin, direction: ray.direction };
    let (mut length, mut throughput) = (0.0, Vec3::ONE);
    for bounce in 1..frame.path.max_depth {
        if !delta {
            break;
        }
        length += hit.t;
        let s = surface_at(scene, &hit);
        let mut bsdf = surface_bsdf(scene, &s);
        let turns = s.flags & MATERIAL_TWO_SIDED != 0 && bsdf.kind != BSDF_DIELECTRIC;
        let facing = facing_normals(&s, -way.direction, turns, true);
        let basis = shading_basis(&s, &bsdf, facing.normal);
        let wo = basis.transpose() * -way.direction;
        bsdf.metallic.coat_normal = local_coat_normal(&s, &facing, &basis, wo);
        let (sampled, next) = bsdf_sample(&bsdf, wo, 0.5, Vec2::splat(0.5));
        if !sampled {
            break;
        }
        let direction = basis * next.wi;
        way = Ray { origin: s.ray_origin(direction), direction };
        throughput *= next.weight;
        FirstHit { guide, delta, hit } = first_hit(scene, frame, &way, pcg(mask_seed.wrapping_add(bounce)));
        let (sky, behind) = (!hit.any(), if hit.any() { hit.t } else { 0.0 });
        if sky {
            guide.normal = (-direction).into();
        }
        guide.depth = length + behind + frame.camera.near;
        guide.position = (ray.origin + (length + behind) * ray.direction).into();
        guide.albedo = (throughput * if sky { Vec3::ONE } else { Vec3::from(guide.albedo) }).into();
    }
    guide
}
