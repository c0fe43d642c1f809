//! Twin of `glsl/shared/light.glsl`.
use crate::layout::*;
use crate::math::hash::{pcg, word_of_unit};
use crate::math::srgb::luminance;
use crate::math::warp::{
    basis_from_normal, circle_point, sine_cosine, warp_cone, warp_sphere, warp_tent, warp_triangle,
};
use crate::scene::{Environment, Scene};
use crate::shaders::shared::light::{EVEN_SHARE, MAX_ODDS, MAX_SOLID_ANGLE, MIN_SOLID_ANGLE, MIN_VOLUME};
use crate::twins::light_tree::{Choice, choose_light, nominal_pdf, spot_share};
use crate::twins::scene::texture_coordinates;
use crate::twins::surface::{Surface, coat_lets_out, plane_clearance, unit_vector};
use crate::twins::texture::{surface_opacity, texture_sample, vertex_color};
use glam::{Mat3, Vec2, Vec2Swizzles, Vec3, Vec3Swizzles, Vec4, Vec4Swizzles, vec2, vec3};
use std::f32::consts::PI;

/// One light, seen from a surface point.
#[derive(Clone, Copy, Debug, Default)]
pub struct LightSample {
    /// Unit direction from the surface to the light.
    pub direction: Vec3,
    /// Distance to the offset point on the light, world units; [`INFINITE_DISTANCE`] for lights at infinity.
    pub distance: f32,
    /// Radiance, divided by the probability of the sample.
    pub radiance: Vec3,
    /// Density per solid angle; 0 for lights that no BSDF sample can hit.
    pub pdf: f32,
    /// Of a light without extent, whose shadows are sharp, the probability that it is chosen; else 0.
    pub sharp: f32,
    /// Index of the light; [`NONE`] if none can bring anything.
    pub chosen: u32,
    /// That of the key light of the point, if anything of it is kept apart; else [`NONE`].
    pub key: u32,
    /// The share that is kept of the key light.
    pub kept: f32,
}

pub use crate::shaders::shared::segment::INFINITE_DISTANCE;
pub use crate::twins::light_tree::{KeyLight, Receiver};

/// The entry that a random word chooses, and a word that is independent of it and as well stratified.
pub fn alias_choose(table: &[AliasEntry], random: u32) -> (u32, u32) {
    let product = u64::from(random) * table.len() as u64;
    let hash = pcg(random);
    let fill = (u64::from(hash) * table.len() as u64) >> 32;
    let (slot, low) = ((product >> 32) as u32, (product as u32).saturating_add(fill as u32));
    let entry = table[slot as usize];
    let stays = low < entry.threshold;
    let into = (if stays { low } else { low - entry.threshold }) as f32;
    let share = if stays { entry.threshold as f32 } else { 4294967296.0 - entry.threshold as f32 };
    (if stays { slot } else { entry.alias }, word_of_unit(into / share, hash))
}

fn environment_uv(d: Vec3, sine: f32) -> Vec2 {
    vec2(if sine > 0.0 { d.x.atan2(-d.z) * (0.5 / PI) } else { 0.0 }, sine.atan2(d.y) / PI)
}

/// Rotation from environment to world space.
fn environment_rotation(light: &Light) -> Mat3 {
    Mat3::from_cols(light.a.into(), light.b.into(), light.c.into())
}

/// Radiance without its scale, and in w the density by which texels are drawn, both bilinear.
fn environment_lookup(e: &Environment, uv: Vec2) -> Vec4 {
    let (width, height) = (e.width as i32, e.height as i32);
    let at = uv * vec2(width as f32, height as f32) - 0.5;
    let p = at.floor().as_ivec2();
    let f = at - p.as_vec2();
    let x0 = p.x.rem_euclid(width);
    let x1 = if x0 + 1 == width { 0 } else { x0 + 1 };
    let texel = |x: i32, y: i32| Vec4::from(e.texels[(y.clamp(0, height - 1) * width + x) as usize]);
    let top = texel(x0, p.y).lerp(texel(x1, p.y), f.x);
    let low = texel(x0, p.y + 1).lerp(texel(x1, p.y + 1), f.x);
    top.lerp(low, f.y)
}

fn environment_pdf(e: &Environment, light: &Light, p: f32, sine: f32) -> f32 {
    light.probability * p * e.width as f32 * e.height as f32 / (2.0 * PI * PI * sine.max(1e-6))
}

/// Radiance from `direction`, and the density with which [`light_sample`] would choose it (solid angle).
pub fn environment_radiance(scene: &Scene, light: &Light, direction: Vec3) -> (Vec3, f32) {
    let scale = Vec3::from(light.value);
    let Some(e) = &scene.environment else { return (scale, light.probability * (0.25 / PI)) };
    let d = environment_rotation(light).transpose() * direction;
    let sine = d.xz().length();
    let mut uv = environment_uv(d, sine);
    uv.x -= uv.x.floor();
    let found = environment_lookup(e, uv);
    (scale * found.xyz(), environment_pdf(e, light, found.w, sine))
}

fn sample_environment(scene: &Scene, light: &Light, word: u32, u: Vec2) -> LightSample {
    let (direction, radiance, pdf) = match &scene.environment {
        None => (warp_sphere(u), light.value.into(), light.probability * (0.25 / PI)),
        Some(e) => {
            let (texel, _) = alias_choose(&e.table, word);
            let centre = vec2((texel % e.width) as f32, (texel / e.width) as f32) + 0.5;
            let at = centre + vec2(warp_tent(u.x), warp_tent(u.y));
            let mut uv = at / vec2(e.width as f32, e.height as f32);
            uv.y = 1.0 - (1.0 - uv.y.abs()).abs();
            let (azimuth, [sine, cosine]) = (circle_point(uv.x - uv.x.floor()), sine_cosine(PI * uv.y));
            let d = vec3(azimuth.y * sine, cosine, -azimuth.x * sine);
            let found = environment_lookup(e, uv);
            let radiance = Vec3::from(light.value) * found.xyz();
            (environment_rotation(light) * d, radiance, environment_pdf(e, light, found.w, sine))
        }
    };
    let radiance = if pdf > 0.0 { radiance / pdf } else { Vec3::ZERO };
    LightSample { direction, distance: INFINITE_DISTANCE, radiance, pdf, ..LightSample::default() }
}

/// A triangle seen from a point: unit vectors to its corners, and its solid angle in steradians.
struct SphericalTriangle {
    corners: [Vec3; 3],
    solid_angle: f32,
    /// Of the parallelepiped that the unit vectors to the corners span.
    volume: f32,
}

impl SphericalTriangle {
    fn new([a, e1, e2]: [Vec3; 3]) -> Self {
        let inverse = [a, a + e1, a + e2].map(|v| 1.0 / v.length_squared().max(1e-37).sqrt());
        let [a, b, c] = [a * inverse[0], (a + e1) * inverse[1], (a + e2) * inverse[2]];
        let volume = a.dot((e1 * inverse[1]).cross(e2 * inverse[2])).abs();
        let solid_angle = 2.0 * volume.atan2(1.0 + a.dot(b) + b.dot(c) + c.dot(a));
        Self { corners: [a, b, c], solid_angle, volume }
    }

    /// Whether it is sampled so, and not by area.
    fn by_solid_angle(&self, scene: &Scene) -> bool {
        scene.large_lamps
            && self.solid_angle > MIN_SOLID_ANGLE
            && self.solid_angle < MAX_SOLID_ANGLE
            && self.volume > MIN_VOLUME * self.solid_angle
    }

    /// A direction, uniform by solid angle (Arvo 1995).
    fn sample(&self, u: Vec2) -> Vec3 {
        let [a, b, c] = self.corners;
        let [sin, cos] = sine_cosine(0.5 * u.x * self.solid_angle);
        let along = (c - a.dot(c) * a).normalize();
        let volume = a.cross(b).dot(along).abs();
        let half_tan = (1.0 + a.dot(b)) * sin / (volume * cos - b.dot(along) * sin).max(1e-10);
        let d = ((1.0 - half_tan * half_tan) * a + 2.0 * half_tan * along) / (1.0 + half_tan * half_tan);
        let rest = 0.5 * u.y * (d - b).length_squared();
        let across = d - d.dot(b) * b;
        (1.0 - rest) * b + (rest * (2.0 - rest)).sqrt() * across / across.length_squared().max(1e-30).sqrt()
    }
}

/// Where the shadow ray to a lamp `distance` away ends: `clearance` before the lamp's plane.
fn distance_before(distance: f32, clearance: f32, cosine: f32) -> f32 {
    (distance - clearance / cosine.max(1e-6)).max(0.5 * distance)
}

fn sample_triangle_light(scene: &Scene, light: &Light, p: Vec3, u: Vec2) -> LightSample {
    let [a, b, c] = [light.a, light.b, light.c].map(Vec3::from);
    let mut bary = warp_triangle(u);
    let (e1, e2) = (b - a, c - a);
    let (mut n, doubled_area) = unit_vector(e1.cross(e2));
    let seen = SphericalTriangle::new([a - p, e1, e2]);
    if seen.by_solid_angle(scene) {
        let w = seen.sample(u);
        let q = (a - p).dot(n) / w.dot(n) * w - (a - p);
        bary = vec2(q.cross(e2).dot(n), e1.cross(q).dot(n)) / doubled_area;
        bary = bary.clamp(Vec2::ZERO, Vec2::ONE);
    }
    let on_light = a + bary.x * e1 + bary.y * e2;
    if scene.materials[light.material as usize].flags & MATERIAL_EMITS_BEHIND != 0 && n.dot(a - p) > 0.0 {
        n = -n;
    }
    let to_light = on_light - p;
    let d2 = to_light.dot(to_light);
    let direction = to_light / d2.sqrt();
    let cosine = -n.dot(direction);
    let distance = distance_before(d2.sqrt(), plane_clearance(n, a.abs(), e1, e2), cosine);
    let mut radiance = Vec3::from(light.value);
    let bary = if light.kind == LIGHT_MIRRORED { bary.yx() } else { bary };
    let image = scene.materials[light.material as usize].emission_texture;
    if image != NONE {
        let uv = texture_coordinates(scene, image, light.triangle, bary);
        radiance *= texture_sample(scene, image, uv).truncate();
    }
    if scene.materials[light.material as usize].flags & MATERIAL_UNLIT != 0 {
        radiance *= vertex_color(scene, light.triangle, bary).truncate();
    }
    radiance *= coat_lets_out(&scene.materials[light.material as usize], cosine, |image| {
        texture_sample(scene, image, texture_coordinates(scene, image, light.triangle, bary))
    });
    radiance *= surface_opacity(scene, light.material, light.triangle, bary);
    let lit = cosine > 0.0 && d2 > 0.0;
    let density = match seen.by_solid_angle(scene) {
        true => light.probability / seen.solid_angle,
        false => light.probability * 2.0 * d2 / (cosine * doubled_area),
    };
    let pdf = if lit { density } else { 0.0 };
    LightSample {
        direction,
        distance,
        radiance: if lit { radiance / pdf } else { Vec3::ZERO },
        pdf,
        ..LightSample::default()
    }
}

/// 1 - cosine of half the angle that a sphere takes up, seen from outside; 0 from inside.
fn sphere_cap(to_centre: Vec3, radius: f32) -> f32 {
    let sine2 = radius * radius / to_centre.length_squared().max(1e-37);
    if sine2 < 1.0 { sine2 / (1.0 + (1.0 - sine2).sqrt()) } else { 0.0 }
}

fn sample_sphere_light(scene: &Scene, light: &Light, p: Vec3, u: Vec2) -> LightSample {
    let (centre, radius) = (Vec3::from(light.a), light.b[0]);
    let to_centre = centre - p;
    let cap = sphere_cap(to_centre, radius);
    let (axis, distance) = unit_vector(to_centre);
    let w = warp_cone(u, cap);
    let squared = radius * radius - distance * distance * w.xy().length_squared();
    let across = w.xy() * ((distance * w.z - squared.max(0.0).sqrt()) / radius);
    let n = basis_from_normal(axis) * across.extend(-(1.0 - across.length_squared()).max(0.0).sqrt());
    let to_light = to_centre + radius * n;
    let distance = to_light.length();
    let direction = to_light / distance;
    let cosine = -n.dot(direction);
    let lit = cap > 0.0 && distance > 0.0 && cosine > 0.0;
    let clearance = plane_clearance(n, centre.abs(), Vec3::splat(radius), Vec3::ZERO);
    let distance = distance_before(distance, clearance, cosine);
    let pdf = if lit { light.probability / (2.0 * PI * cap) } else { 0.0 };
    // Lamps whose coat has a picture are no spheres.
    let coat = coat_lets_out(&scene.materials[light.material as usize], cosine, |_| Vec4::ONE);
    LightSample {
        direction,
        distance,
        radiance: if lit { Vec3::from(light.value) * coat / pdf } else { Vec3::ZERO },
        pdf,
        ..LightSample::default()
    }
}

/// What a delta light brings to a receiver from which it is seen, up to a factor that all have.
fn unshadowed(light: &Light, r: &Receiver) -> f32 {
    let is_sun = light.kind == LIGHT_DIRECTIONAL;
    let to_light = if is_sun { -Vec3::from(light.b) } else { Vec3::from(light.a) - r.position };
    let d2 = if is_sun { 1.0 } else { to_light.dot(to_light).max(1e-30) };
    let w = to_light / d2.sqrt();
    let cosine = r.normal.dot(w);
    let cosine = if r.lets_light_through { cosine.abs() } else { cosine };
    let emits = if light.kind == LIGHT_SPOT { spot_share(light, w) } else { 1.0 };
    let reflects = cosine + r.odds_beyond_cosine + r.odds_of_lobe(w, 0.0);
    let brings = (emits * reflects * luminance(light.value) / d2).min(MAX_ODDS);
    if cosine > 0.0 || r.lets_light_through { brings } else { 0.0 }
}

/// Chooses anew among the delta lights, which lie before those with a surface: by what each would bring if nothing were in its way. Lamps as
/// a whole, and lights at infinity as a whole, count by that to the power of 3/4. Returns the light, its index and the key light.
fn choose_by_share(scene: &Scene, r: &Receiver, u: f32) -> (Light, u32, KeyLight) {
    let before_surfaces = (0..).zip(&scene.lights).take_while(|(_, light)| !light.has_surface());
    let all: Vec<_> =
        before_surfaces.filter(|(_, light)| light.is_delta()).map(|(i, l)| (i, l, unshadowed(l, r))).collect();
    let group: f32 = all.iter().map(|(_, light, _)| light.probability).sum();
    let lit = || all.iter().filter(|(.., brings)| *brings > 0.0);
    let number = lit().count() as f32;
    let of_kind = |far: bool| lit().filter(|(_, l, _)| l.is_far() == far).map(|(.., brings)| brings).sum::<f32>();
    let sums = [of_kind(false), of_kind(true)];
    let kinds = sums.map(|sum| sum.sqrt() * sum.sqrt().sqrt());
    let (mut before, mut key) = (0.0, KeyLight::NONE);
    let mut chosen = (Light { probability: group, value: [0.0; 3], ..scene.lights[0] }, NONE);
    for &(index, light, brings) in lit() {
        let kind = usize::from(light.is_far());
        let odds = kinds[kind] / (kinds[0] + kinds[1]) * (brings / sums[kind]);
        let share = odds * (1.0 - EVEN_SHARE) + 1.0 / number * EVEN_SHARE;
        key.consider(index, group * share);
        if u >= before {
            chosen = (Light { probability: group * share, ..*light }, index);
        }
        before += share;
    }
    (chosen.0, chosen.1, key)
}

fn sample_point_light(light: &Light, p: Vec3) -> LightSample {
    let to_light = Vec3::from(light.a) - p;
    let d2 = to_light.dot(to_light).max(1e-30);
    let distance = d2.sqrt();
    let direction = to_light / distance;
    let mut radiance = Vec3::from(light.value) / (d2 * light.probability);
    if light.kind == LIGHT_SPOT {
        radiance *= spot_share(light, direction);
    }
    LightSample { direction, distance, radiance, sharp: light.probability, ..LightSample::default() }
}

/// Density over area by which MIS takes a lamp to be chosen.
fn lamp_density(scene: &Scene, material: u32, brightness: f32) -> f32 {
    let density = scene.triangle_pdf_scale * scene.materials[material as usize].emission_weight;
    if scene.has_light_tree() && brightness > 0.0 { density * brightness } else { density }
}

/// The key light where the table alone chooses.
fn key_of_table(scene: &Scene) -> KeyLight {
    let mut key = KeyLight::NONE;
    for (index, light) in (0..).zip(&scene.lights).filter(|(_, light)| light.is_delta()) {
        key.consider(index, light.probability);
    }
    KeyLight { rival: 0.0, ..key } // none takes its place elsewhere
}

/// One light for a receiver. Radiance is 0 when the light cannot reach the point.
pub fn light_sample(scene: &Scene, r: &Receiver, word: u32, u: Vec2) -> LightSample {
    let by_tree = scene.has_light_tree();
    let Choice { light: chosen, rest, probability, mut key } = match by_tree {
        true => choose_light(scene, r, word),
        false if scene.lights.len() == 1 => Choice { light: 0, rest: word, probability: 0.0, key: key_of_table(scene) },
        false => {
            let (light, rest) = alias_choose(&scene.light_table, word);
            Choice { light, rest, probability: 0.0, key: key_of_table(scene) }
        }
    };
    let (mut light, mut index, p) = (scene.lights[chosen as usize], chosen, r.position);
    if by_tree && probability > 0.0 {
        light.probability = probability;
    }
    if scene.weighed_lights {
        let weighed = choose_by_share(scene, r, u.x);
        key = weighed.2;
        if light.is_delta() {
            (light, index) = (weighed.0, weighed.1);
        }
    }
    let mut sample = match light.kind {
        _ if light.is_triangle() => sample_triangle_light(scene, &light, p, u),
        LIGHT_SPHERE => sample_sphere_light(scene, &light, p, u),
        LIGHT_POINT | LIGHT_SPOT => sample_point_light(&light, p),
        LIGHT_DIRECTIONAL => LightSample {
            direction: -Vec3::from(light.b),
            distance: INFINITE_DISTANCE,
            radiance: Vec3::from(light.value) / light.probability,
            sharp: light.probability,
            ..LightSample::default()
        },
        _ => sample_environment(scene, &light, rest, u),
    };
    if by_tree && sample.pdf > 0.0 && light.has_surface() {
        let brightness = scene.shading.get(light.triangle as usize).map_or(0.0, |s| s.brightness);
        let density = lamp_density(scene, light.material, brightness);
        sample.pdf = nominal_pdf(scene, density, light.probability / sample.pdf, p);
    }
    sample.chosen = if by_tree && probability == 0.0 { NONE } else { index };
    sample.kept = key.kept_share();
    sample.key = if sample.kept > 0.0 { key.index } else { NONE };
    if by_tree && probability == 0.0 {
        sample.radiance = Vec3::ZERO;
    }
    sample
}

/// Density per solid angle with which [`light_sample`] would choose, from `origin`, a point of an emissive triangle or sphere that a ray
/// hits, if lights were chosen by the table. `density` is that over area.
fn table_pdf(scene: &Scene, density: f32, s: &Surface, origin: Vec3, t: f32, cosine: f32) -> f32 {
    let [a, e1, e2] = s.triangle;
    if s.radius > 0.0 {
        let cap = sphere_cap(a - origin, s.radius);
        return if cap > 0.0 { density * 2.0 * s.radius * s.radius / cap } else { 0.0 };
    }
    let seen = SphericalTriangle::new([a - origin, e1, e2]);
    match seen.by_solid_angle(scene) {
        true => density * 0.5 * unit_vector(e1.cross(e2)).1 / seen.solid_angle,
        false => density * t * t / cosine.max(1e-20),
    }
}

/// The same, however lights are chosen; with a tree the nominal one.
pub fn triangle_light_pdf(scene: &Scene, s: &Surface, origin: Vec3, t: f32, cosine: f32) -> f32 {
    let [_, e1, e2] = s.triangle;
    let density = lamp_density(scene, s.material, s.brightness);
    let pdf = table_pdf(scene, density, s, origin, t, cosine);
    if !scene.has_light_tree() || pdf <= 0.0 {
        return pdf;
    }
    let area = if s.radius > 0.0 { 4.0 * PI * s.radius * s.radius } else { 0.5 * unit_vector(e1.cross(e2)).1 };
    nominal_pdf(scene, density, density * area / pdf, origin)
}
