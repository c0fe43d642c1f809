//! Twin of `glsl/shared/surface.glsl`.
use crate::gpu::layout::{MATERIAL_NORMAL_MAP, Material, NONE};
use crate::reference::bsdf::Bsdf;
use crate::reference::scene::{material_of, object_from_world, triangle_vertices, world_from_object};
use crate::reference::texture::texture_sample;
use crate::reference::traverse::Hit;
use crate::scene::Scene;
use glam::{Vec2, Vec3, vec2, vec3};

/// What shading needs of a hit.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// World units, interpolated from the vertices.
    pub position: Vec3,
    /// Unit, by the winding of the triangle.
    pub geometric: Vec3,
    /// Unit shading normal, on the side that the vertex normals point to.
    pub normal: Vec3,
    /// Index.
    pub material: u32,
    /// Of the material.
    pub flags: u32,
    /// Index.
    pub object: u32,
    /// Texture coordinates.
    pub uv: Vec2,
}

/// Unit normal from two snorm words of 16 bits.
pub fn octahedral_decode(bits: u32) -> Vec3 {
    let snorm = |b: u32| (f32::from(b as u16 as i16) / 32767.0).max(-1.0);
    let e = vec2(snorm(bits), snorm(bits >> 16));
    let z = 1.0 - e.x.abs() - e.y.abs();
    let t = (-z).max(0.0);
    let fold = |e: f32| if e >= 0.0 { e - t } else { e + t };
    vec3(fold(e.x), fold(e.y), z).normalize()
}

/// The edges of a triangle in space and in texture coordinates.
struct Edges {
    e1: Vec3,
    e2: Vec3,
    d1: Vec2,
    d2: Vec2,
}

fn normal_from_map(scene: &Scene, s: &Surface, image: u32, dpdu: Vec3, dpdv: Vec3) -> Vec3 {
    let m = 2.0 * texture_sample(scene, image, s.uv).truncate() - 1.0;
    let t = dpdu - s.normal * s.normal.dot(dpdu);
    let t = t * (1.0 / t.dot(t).max(1e-30).sqrt());
    let b = s.normal.cross(t);
    m.x * t + m.y * (if b.dot(dpdv) < 0.0 { -b } else { b }) + m.z * s.normal
}

fn normal_from_height(scene: &Scene, s: &Surface, material: &Material, dpdu: Vec3, dpdv: Vec3) -> Vec3 {
    let image = material.bump_texture;
    let texture = &scene.textures[image as usize];
    let scale = Vec2::from(texture.scale).abs().max(Vec2::splat(1e-6));
    let texel = 1.0 / (vec2(texture.width as f32, texture.height as f32) * scale);
    let height = |offset| texture_sample(scene, image, s.uv + offset).x;
    let h = height(Vec2::ZERO);
    let hu = (height(vec2(texel.x, 0.0)) - h) / texel.x;
    let hv = (height(vec2(0.0, texel.y)) - h) / texel.y;
    let pu = dpdu + s.normal * (material.bump_scale * hu - s.normal.dot(dpdu));
    let pv = dpdv + s.normal * (material.bump_scale * hv - s.normal.dot(dpdv));
    let n = pu.cross(pv);
    if n.dot(s.normal) < 0.0 { -n } else { n }
}

fn perturbed_normal(scene: &Scene, s: &Surface, e: &Edges) -> Vec3 {
    let material = &scene.materials[s.material as usize];
    let image = material.bump_texture;
    let det = e.d1.x * e.d2.y - e.d2.x * e.d1.y;
    if image == NONE || det == 0.0 {
        return s.normal;
    }
    let dpdu = (e.d2.y * e.e1 - e.d1.y * e.e2) / det;
    let dpdv = (e.d1.x * e.e2 - e.d2.x * e.e1) / det;
    let n = match s.flags & MATERIAL_NORMAL_MAP {
        0 => normal_from_height(scene, s, material, dpdu, dpdv),
        _ => normal_from_map(scene, s, image, dpdu, dpdv),
    };
    let len = n.dot(n);
    if len > 1e-30 && len < 1e38 { n * (1.0 / len.sqrt()) } else { s.normal }
}

/// Position and normals.
pub fn surface_at(scene: &Scene, hit: &Hit) -> Surface {
    let [mut p0, p1, p2] = triangle_vertices(scene, hit.triangle);
    let (mut e1, mut e2) = (p1 - p0, p2 - p0);
    let mut object = scene.triangles[hit.triangle as usize].object;
    let instance = scene.instances.get(hit.instance as usize);
    if let Some(i) = instance {
        let world = world_from_object(i);
        (p0, e1, e2) = (world.point(p0), world.vector(e1), world.vector(e2));
        object += i.object;
    }
    let material = material_of(scene, hit.triangle, hit.instance);
    let mirrored = instance.is_some_and(|i| i.mirrored != 0);
    let scaled = if mirrored { e2.cross(e1) } else { e1.cross(e2) };
    let doubled_area = scaled.length().max(1e-30);
    let geometric = scaled / doubled_area;
    let mut s = Surface {
        position: p0 + hit.barycentric.x * e1 + hit.barycentric.y * e2,
        geometric,
        normal: geometric,
        material,
        flags: scene.materials[material as usize].flags,
        object,
        uv: Vec2::ZERO,
    };
    let Some(shading) = scene.shading.get(hit.triangle as usize) else { return s };
    if shading.normal != [0xffffffff; 3] {
        let [n0, n1, n2] = shading.normal.map(octahedral_decode);
        let n = n0 * (1.0 - hit.barycentric.x) + n1 * hit.barycentric.x + hit.barycentric.y * (n2 - n0);
        let n = instance.map_or(n, |i| object_from_world(i).normal(n));
        let len = n.dot(n);
        s.normal = if len > 1e-20 { n * (1.0 / len.sqrt()) } else { geometric };
    }
    let [uv0, uv1, uv2] = [shading.uv0, shading.uv1, shading.uv2].map(Vec2::from);
    let (d1, d2) = (uv1 - uv0, uv2 - uv0);
    s.uv = uv0 + hit.barycentric.x * d1 + hit.barycentric.y * d2;
    s.normal = perturbed_normal(scene, &s, &Edges { e1, e2, d1, d2 });
    s
}

fn textured(scene: &Scene, constant: [f32; 3], image: u32, s: &Surface) -> Vec3 {
    let constant = Vec3::from(constant);
    match image {
        NONE => constant,
        _ => constant * texture_sample(scene, image, s.uv).truncate(),
    }
}

/// Radiance that the surface emits from its front side.
pub fn surface_emission(scene: &Scene, s: &Surface) -> Vec3 {
    let material = &scene.materials[s.material as usize];
    match material.emission_texture {
        NONE => material.emission.into(),
        image => Vec3::from(material.emission) * texture_sample(scene, image, s.uv).truncate(),
    }
}

/// The material with its textures looked up.
pub fn surface_bsdf(scene: &Scene, s: &Surface) -> Bsdf {
    let material = &scene.materials[s.material as usize];
    let mut alpha = material.alpha;
    if material.roughness_texture != NONE {
        let r = texture_sample(scene, material.roughness_texture, s.uv).x;
        alpha *= r * r;
    }
    let mut b = Bsdf::new(material, alpha, &scene.texels);
    b.albedo = textured(scene, material.base_color, material.base_texture, s);
    b.specular = textured(scene, material.specular, material.specular_texture, s);
    b
}

/// Moves a point off its surface along the unit normal `n` (Waechter and Binder 2019).
pub fn offset_origin(p: Vec3, n: Vec3) -> Vec3 {
    const ORIGIN: f32 = 1.0 / 32.0;
    const FLOAT_SCALE: f32 = 1.0 / 65536.0;
    const INT_SCALE: f32 = 256.0;
    let offset = |p: f32, n: f32| {
        let steps = (INT_SCALE * n) as i32;
        let stepped = f32::from_bits((p.to_bits() as i32).wrapping_add(if p < 0.0 { -steps } else { steps }) as u32);
        if p.abs() < ORIGIN { p + FLOAT_SCALE * n } else { stepped }
    };
    vec3(offset(p.x, n.x), offset(p.y, n.y), offset(p.z, n.z))
}
