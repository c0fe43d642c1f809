//! Twin of `glsl/shared/surface.glsl` and `glsl/shared/normal_map.glsl`.
use crate::layout::{
    BSDF_DIELECTRIC, BSDF_METALLIC, MATERIAL_NORMAL_MAP, MATERIAL_TWO_SIDED, MATERIAL_UNLIT, Material, NONE,
    SMOOTH_ALPHA, Texture,
};
use crate::math::octahedral::{octahedral_decode, octahedral_vector};
use crate::math::warp::basis_from_normal;
use crate::scene::attributes::Attributes;
use crate::scene::lookup::reads_second;
use crate::scene::{FLAT, Scene};
use crate::shaders::shared::metallic::COAT_F0;
use crate::shaders::shared::surface::{CLEARANCE, MIN_ELEVATION};
use crate::twins::bsdf::{Bsdf, bsdf_is_specular};
use crate::twins::metallic::{Metallic, Parameters};
use crate::twins::scene::{material_of, object_from_world, triangle_vertices, world_from_object};
use crate::twins::sphere::Sphere;
use crate::twins::texture::texture_sample;
use crate::twins::traverse::Hit;
use glam::{Mat3, Vec2, Vec3, Vec4, vec2, vec3};
use std::f32::consts::PI;

/// What shading needs of a hit.
#[derive(Clone, Copy, Debug)]
pub struct Surface {
    /// Point in world units, interpolated from the vertices.
    pub position: Vec3,
    /// Unit normal by the winding of the triangle.
    pub geometric: Vec3,
    /// Unit normal interpolated from the vertices, on the side that they point to.
    pub smooth_normal: Vec3,
    /// Unit shading normal: the smooth one perturbed by a map.
    pub normal: Vec3,
    /// The same of a clear coat, by a map of its own.
    pub coat_normal: Vec3,
    /// Index of the material.
    pub material: u32,
    /// Flags of the material.
    pub flags: u32,
    /// Index of the object.
    pub object: u32,
    /// Texture coordinates of the point.
    pub uv: Vec2,
    /// The second set of them; as the first where there is none.
    pub second_uv: Vec2,
    /// Linear colour of the vertices, and opacity.
    pub color: Vec4,
    /// Tangent of the vertices in world space, and the sign of the bitangent, which is 0 where there is none: then the direction
    /// along which u rises, if it is known.
    pub tangent: Vec4,
    /// The triangle in world space: its first vertex and the edges from there.
    pub triangle: [Vec3; 3],
    /// Radius of a sphere, whose centre is the first of `triangle`; 0 for a triangle.
    pub radius: f32,
    /// [`Shading::brightness`](crate::layout::Shading::brightness) of its triangle.
    pub brightness: f32,
    /// Distance from the plane at which rays start, world units.
    pub clearance: f32,
}

impl Surface {
    /// A point of what a ray hits with one normal and without coordinates of textures, on a triangle or sphere that is yet to be named.
    fn bare(scene: &Scene, hit: &Hit, position: Vec3, geometric: Vec3, clearance: f32) -> Self {
        let material = material_of(scene, hit.triangle, hit.instance);
        let first = scene.instances.get(hit.instance as usize).map_or(0, |i| i.object);
        Self {
            position,
            geometric,
            smooth_normal: geometric,
            normal: geometric,
            coat_normal: geometric,
            material,
            flags: scene.materials[material as usize].flags,
            object: first + scene.triangles[hit.triangle as usize].object,
            uv: Vec2::ZERO,
            second_uv: Vec2::ZERO,
            color: Vec4::ONE,
            tangent: Vec4::ZERO,
            triangle: [Vec3::ZERO; 3],
            radius: 0.0,
            brightness: scene.shading.get(hit.triangle as usize).map_or(0.0, |s| s.brightness),
            clearance,
        }
    }

    /// Origin of a ray that leaves the surface towards `w`.
    pub fn ray_origin(&self, w: Vec3) -> Vec3 {
        let along = if w.dot(self.geometric) < 0.0 { -self.clearance } else { self.clearance };
        self.position + along * self.geometric
    }
}

/// Unit vector along `v`, and its length; both 0 where `v` is 0.
pub fn unit_vector(v: Vec3) -> (Vec3, f32) {
    let largest = v.abs().max_element();
    let scaled = v / largest.max(1e-37);
    let length = scaled.length();
    (scaled / length.max(1e-37), length * largest)
}

/// Distance along the unit normal `n` at which a ray must start so that it meets no other triangle of the same plane. `reach`
/// holds the magnitudes of the numbers that the point is a sum of.
pub fn plane_clearance(n: Vec3, reach: Vec3, e1: Vec3, e2: Vec3) -> f32 {
    CLEARANCE * n.abs().dot(reach + e1.abs().max(e2.abs()).max_element())
}

/// Coordinates at which a surface reads a picture.
fn uv_of(scene: &Scene, s: &Surface, image: u32) -> Vec2 {
    if reads_second(scene, image) { s.second_uv } else { s.uv }
}

/// Directions along which u and v rise, in world units, if texture coordinates say so.
type Slopes = Option<[Vec3; 2]>;

/// By the edges of a triangle in space and in texture coordinates.
fn slopes_of(e1: Vec3, e2: Vec3, d1: Vec2, d2: Vec2) -> Slopes {
    let det = d1.x * d2.y - d2.x * d1.y;
    (det != 0.0).then(|| [(d2.y * e1 - d1.y * e2) / det, (d1.x * e2 - d2.x * e1) / det])
}

/// The same of the coordinates at which a picture is read, but for positive factors.
fn slopes_in(image: &Texture, [u, v]: [Vec3; 2]) -> [Vec3; 2] {
    let (scale, shear) = (Vec2::from(image.scale), Vec2::from(image.shear));
    let side = if scale.x * scale.y < shear.x * shear.y { -1.0 } else { 1.0 };
    [side * (scale.y * u - shear.y * v), side * (scale.x * v - shear.x * u)]
}

/// The smooth normal perturbed by a normal map, not normalised; `None` where nothing says how it lies on the surface.
fn normal_from_map(scene: &Scene, s: &Surface, image: u32, scale: f32, slopes: Slopes) -> Option<Vec3> {
    let given = s.tangent.w != 0.0;
    let slopes = slopes.map(|slopes| slopes_in(&scene.textures[image as usize], slopes));
    let along = if given { s.tangent.truncate() } else { slopes?[0] };
    let m = (2.0 * texture_sample(scene, image, uv_of(scene, s, image)).truncate() - 1.0) * vec3(scale, scale, 1.0);
    let n = s.smooth_normal;
    let (t, _) = unit_vector(along - n * n.dot(along));
    let b = n.cross(t);
    let flipped = if given { s.tangent.w < 0.0 } else { b.dot(slopes?[1]) < 0.0 };
    Some(m.x * t + m.y * (if flipped { -b } else { b }) + m.z * n)
}

fn normal_from_height(scene: &Scene, s: &Surface, material: &Material, [dpdu, dpdv]: [Vec3; 2]) -> Vec3 {
    let image = material.bump_texture;
    let texture = &scene.textures[image as usize];
    let size = vec2(texture.width as f32, texture.height as f32);
    let [along, across] = [texture.scale, texture.shear].map(|factors| size * Vec2::from(factors));
    let texel = 1.0 / vec2(along.x.hypot(across.y), along.y.hypot(across.x)).max(1e-6 * size);
    let uv = uv_of(scene, s, image);
    let height = |offset| texture_sample(scene, image, uv + offset).x;
    let rise = |half: Vec2| height(half) - height(-half);
    let hu = rise(vec2(0.5 * texel.x, 0.0)) / texel.x;
    let hv = rise(vec2(0.0, 0.5 * texel.y)) / texel.y;
    let pu = dpdu + s.normal * (material.bump_scale * hu - s.normal.dot(dpdu));
    let pv = dpdv + s.normal * (material.bump_scale * hv - s.normal.dot(dpdv));
    let n = pu.cross(pv);
    if n.dot(s.normal) < 0.0 { -n } else { n }
}

/// `n` normalised, or the smooth normal where there is none.
fn normal_or_smooth(s: &Surface, n: Option<Vec3>) -> Vec3 {
    let Some((n, length)) = n.map(unit_vector) else { return s.smooth_normal };
    if length > 0.0 && length < 1e37 { n } else { s.smooth_normal }
}

/// Perturbs the normals of a surface, whose normal is the smooth one so far, by the slopes of its two sets of coordinates.
fn perturb(scene: &Scene, s: &mut Surface, [first, second]: [Slopes; 2]) {
    let material = &scene.materials[s.material as usize];
    let (image, coat) = (material.bump_texture, material.clearcoat_normal_texture);
    let slopes_for = |image| if image != NONE && reads_second(scene, image) { second } else { first };
    let slopes = slopes_for(image);
    let own = match s.flags & MATERIAL_NORMAL_MAP {
        _ if image == NONE => None,
        0 => slopes.map(|slopes| normal_from_height(scene, s, material, slopes)),
        _ => normal_from_map(scene, s, image, material.normal_scale, slopes),
    };
    let coat = match coat {
        NONE => None,
        _ => normal_from_map(scene, s, coat, material.clearcoat_normal_scale, slopes_for(coat)),
    };
    s.normal = normal_or_smooth(s, own);
    s.coat_normal = normal_or_smooth(s, coat);
    if let Some([along, _]) = slopes.filter(|_| s.tangent.w == 0.0) {
        s.tangent = along.extend(0.0);
    }
}

/// As [`surface_at`], for a hit on a sphere.
fn sphere_at(scene: &Scene, hit: &Hit, ball: &Sphere) -> Surface {
    let (n, side) = (octahedral_vector(hit.barycentric), ball.side());
    let mut radius = ball.pole.length();
    let (mut centre, mut reach, mut point) = (ball.centre, ball.centre.abs(), radius * n);
    let equator = vec2(n.dot(ball.meridian), n.dot(side)).length() / radius;
    let around = (n.dot(ball.meridian) * side - n.dot(side) * ball.meridian) / radius;
    let (mut e1, mut e2) = (2.0 * PI * around, (ball.pole - n.dot(ball.pole) * n) * (PI / equator.max(1e-6)));
    let mut geometric = n;
    if let Some(i) = scene.instances.get(hit.instance as usize) {
        let world = world_from_object(i);
        (geometric, _) = unit_vector(object_from_world(i).normal(n));
        centre = world.point(centre);
        reach = world.magnitude(object_from_world(i).magnitude(centre.abs()));
        (point, e1, e2) = (world.vector(point), world.vector(e1), world.vector(e2));
        radius = world.vector(ball.pole).length();
    }
    if ball.inward() {
        geometric = -geometric;
    }
    let clearance = plane_clearance(geometric, reach, point, Vec3::splat(radius));
    let uv = ball.coordinates(n);
    let mut s = Surface {
        uv,
        second_uv: uv,
        triangle: [centre, Vec3::ZERO, Vec3::ZERO],
        radius,
        ..Surface::bare(scene, hit, centre + point, geometric, clearance)
    };
    perturb(scene, &mut s, [Some([e1, e2]); 2]);
    s
}

/// The surface that a ray hits: position, normals, material.
pub fn surface_at(scene: &Scene, hit: &Hit) -> Surface {
    if let Some(ball) = Sphere::of(scene, hit.triangle) {
        return sphere_at(scene, hit, &ball);
    }
    let [mut p0, p1, p2] = triangle_vertices(scene, hit.triangle);
    let (mut e1, mut e2) = (p1 - p0, p2 - p0);
    let mut reach = p0.abs();
    let instance = scene.instances.get(hit.instance as usize);
    if let Some(i) = instance {
        let world = world_from_object(i);
        (p0, e1, e2) = (world.point(p0), world.vector(e1), world.vector(e2));
        reach = world.magnitude(object_from_world(i).magnitude(p0.abs()));
    }
    let mirrored = instance.is_some_and(|i| i.mirrored != 0);
    let scaled = if mirrored { e2.cross(e1) } else { e1.cross(e2) };
    let (geometric, _) = unit_vector(scaled);
    let position = p0 + hit.barycentric.x * e1 + hit.barycentric.y * e2;
    let clearance = plane_clearance(geometric, reach, e1, e2);
    let mut s = Surface { triangle: [p0, e1, e2], ..Surface::bare(scene, hit, position, geometric, clearance) };
    let Some(shading) = scene.shading.get(hit.triangle as usize) else { return s };
    if shading.normal != FLAT {
        let placed = |n| instance.map_or(n, |i| unit_vector(object_from_world(i).normal(n)).0);
        let [n0, n1, n2] = shading.normal.map(|n| placed(octahedral_decode(n)));
        let n = n0 * (1.0 - hit.barycentric.x) + n1 * hit.barycentric.x + hit.barycentric.y * (n2 - n0);
        let (n, length) = unit_vector(n);
        s.normal = if length > 0.0 { n } else { geometric };
        s.smooth_normal = s.normal;
    }
    let [uv0, uv1, uv2] = [shading.uv0, shading.uv1, shading.uv2].map(Vec2::from);
    let (d1, d2) = (uv1 - uv0, uv2 - uv0);
    let b = hit.barycentric;
    s.uv = uv0 + b.x * d1 + b.y * d2;
    s.second_uv = s.uv;
    let mut slopes = [slopes_of(e1, e2, d1, d2); 2];
    let attributes = Attributes::of(scene, shading);
    s.color = attributes.color(b);
    s.tangent = attributes.tangent(b);
    if let Some(i) = instance {
        let sign = if mirrored { -s.tangent.w } else { s.tangent.w };
        s.tangent = world_from_object(i).vector(s.tangent.truncate()).extend(sign);
    }
    if let Some([uv0, uv1, uv2]) = attributes.second_coordinates() {
        let (d1, d2) = (uv1 - uv0, uv2 - uv0);
        s.second_uv = uv0 + b.x * d1 + b.y * d2;
        slopes[1] = slopes_of(e1, e2, d1, d2);
    }
    perturb(scene, &mut s, slopes);
    s
}

/// 1 where `w` leaves the surface on the side of its normals, else -1: the plane of the triangle decides.
pub fn side_of(s: &Surface, w: Vec3) -> f32 {
    if s.smooth_normal.dot(s.geometric) * s.geometric.dot(w) < 0.0 { -1.0 } else { 1.0 }
}

/// The normals of a surface for a viewer: the smooth one, and the one that lobes are around.
#[derive(Clone, Copy, Debug)]
pub struct Facing {
    /// Unit normal before a map.
    pub smooth_normal: Vec3,
    /// Unit normal that lobes are around.
    pub normal: Vec3,
    /// Share of the lobes that maps shadow.
    pub shadowed: f32,
}

/// Normals for a viewer towards `wo`, on the viewer's side where the surface `turns`. Smooth normals that face away, or that send
/// the mirror image of `wo` below the plane (where the surface `mirrors`), are bent; those of maps are turned by half a turn.
pub fn facing_normals(s: &Surface, wo: Vec3, turns: bool, mirrors: bool) -> Facing {
    let side = side_of(s, wo);
    let (mut n, mut mapped) = (side * s.smooth_normal, side * s.normal);
    let along = n.dot(wo);
    let plane = if n.dot(s.geometric) < 0.0 { -s.geometric } else { s.geometric };
    let image = 2.0 * along * n - wo;
    let height = image.dot(plane);
    if (if mirrors { height } else { along }) < 0.0 {
        let raised = (image + (MIN_ELEVATION - height) * plane).normalize();
        n = (if mirrors { wo + raised } else { n + (MIN_ELEVATION - along) * wo }).normalize();
        mapped = n;
    }
    if mapped.dot(wo) < 0.0 {
        mapped = 2.0 * mapped.dot(n) * n - mapped;
    }
    let back = if turns { 1.0 } else { side };
    Facing { smooth_normal: back * n, normal: back * mapped, shadowed: 1.0 }
}

/// The normals for a material that reflects the share `specular` of its light at its surface: a metal's slope, which would send
/// the mirror image of `wo` into the surface, has a normal that turns it up again.
pub fn facing_of_metal(s: &Surface, facing: Facing, wo: Vec3, specular: f32) -> Facing {
    if s.normal == s.smooth_normal {
        return facing;
    }
    let turned = Facing { shadowed: 1.0 - specular, ..facing };
    let plane = if facing.smooth_normal.dot(s.geometric) < 0.0 { -s.geometric } else { s.geometric };
    let image = 2.0 * facing.normal.dot(wo) * facing.normal - wo;
    let height = image.dot(plane);
    if specular < 0.5 || height >= 0.0 || plane.dot(wo) <= 0.0 {
        return turned;
    }
    let between = wo + image - 2.0 * height * plane;
    Facing { normal: between / between.length_squared().max(1e-30).sqrt(), ..turned }
}

/// The normals for a material at `s`. That of a dielectric stays on its outside, since its two sides differ.
pub fn facing_of(s: &Surface, b: &Bsdf, wo: Vec3) -> Facing {
    let turns = s.flags & MATERIAL_TWO_SIDED != 0 && b.kind != BSDF_DIELECTRIC;
    let facing = facing_normals(s, wo, turns, bsdf_is_specular(b));
    match b.kind {
        BSDF_METALLIC => facing_of_metal(s, facing, wo, b.metallic.specular()),
        _ => facing,
    }
}

/// The frame of lobes around `n`: x leads along the tangent where roughness depends on the direction.
pub fn shading_basis(s: &Surface, b: &Bsdf, n: Vec3) -> Mat3 {
    let (t, length) = unit_vector(s.tangent.truncate() - n * n.dot(s.tangent.truncate()));
    match b.stretch != 1.0 && length > 0.0 {
        true => Mat3::from_cols(t, n.cross(t), n),
        false => basis_from_normal(n),
    }
}

/// The normal of a clear coat in the frame `basis`; that of the frame where the viewer towards `wo` would be below it.
fn local_coat_normal(s: &Surface, facing: &Facing, basis: &Mat3, wo: Vec3) -> Vec3 {
    let n = match facing.smooth_normal.dot(s.smooth_normal) < 0.0 {
        _ if s.coat_normal == s.smooth_normal => facing.smooth_normal,
        turned => s.coat_normal * if turned { -1.0 } else { 1.0 },
    };
    let n = basis.transpose() * n;
    if n.dot(wo) > MIN_ELEVATION { n } else { Vec3::Z }
}

/// A surface as a viewer sees it.
#[derive(Clone, Copy, Debug)]
pub struct View {
    /// Normals on the viewer's side.
    pub facing: Facing,
    /// Its columns are the shading frame.
    pub basis: Mat3,
    /// Unit vector to the viewer, in that frame.
    pub wo: Vec3,
}

/// For a viewer towards `towards`, in world space. Prepares `bsdf` to be evaluated and sampled.
pub fn view_of(s: &Surface, bsdf: &mut Bsdf, facing: Facing, towards: Vec3) -> View {
    let basis = shading_basis(s, bsdf, facing.normal);
    let wo = basis.transpose() * towards;
    bsdf.metallic.coat_normal = local_coat_normal(s, &facing, &basis, wo);
    View { facing, basis, wo }
}

/// Share of the light along `w` that lobes around `facing.normal` keep; `z` is the component of `w` along that normal.
pub fn light_share(s: &Surface, facing: &Facing, w: Vec3, z: f32) -> f32 {
    let (tilt, up) = (facing.normal.dot(facing.smooth_normal), w.dot(facing.smooth_normal));
    if facing.normal.dot(s.geometric) * s.geometric.dot(w) * z < 0.0 {
        return 0.0;
    }
    if s.normal == s.smooth_normal {
        return 1.0;
    }
    if up * z <= 0.0 {
        return 0.0;
    }
    let tan2 = |cosine2: f32, least: f32| (1.0 / cosine2.max(least) - 1.0).max(0.0);
    let alpha2 = (0.125 * tan2(tilt * tilt, 1e-6)).min(1.0);
    let share = 2.0 / (1.0 + (1.0 + alpha2 * tan2(up * up, 1e-12)).sqrt());
    1.0 + (share - 1.0) * facing.shadowed
}

fn textured(scene: &Scene, constant: [f32; 3], image: u32, s: &Surface) -> Vec3 {
    let constant = Vec3::from(constant);
    match image {
        NONE => constant,
        _ => constant * texture_sample(scene, image, uv_of(scene, s, image)).truncate(),
    }
}

/// Share of the light of a lamp that leaves its clear coat at `cosine`; `picture` looks up a texture.
pub fn coat_lets_out(m: &Material, cosine: f32, picture: impl Fn(u32) -> Vec4) -> f32 {
    if m.kind != BSDF_METALLIC || m.clearcoat == 0.0 {
        return 1.0;
    }
    let coat = m.clearcoat * if m.clearcoat_texture == NONE { 1.0 } else { picture(m.clearcoat_texture).x };
    1.0 - coat * (COAT_F0 + (1.0 - COAT_F0) * (1.0 - cosine.min(1.0)).powi(5))
}

/// Radiance that the surface emits towards a viewer at `cosine` to the normal of its triangle.
pub fn surface_emission(scene: &Scene, s: &Surface, cosine: f32) -> Vec3 {
    let material = &scene.materials[s.material as usize];
    let unlit = material.flags & MATERIAL_UNLIT != 0;
    let coat = coat_lets_out(material, cosine, |image| texture_sample(scene, image, uv_of(scene, s, image)));
    let emission = Vec3::from(material.emission) * if unlit { s.color.truncate() } else { Vec3::splat(coat) };
    match material.emission_texture {
        NONE => emission,
        image => emission * texture_sample(scene, image, uv_of(scene, s, image)).truncate(),
    }
}

/// What the textures of a metallic-roughness material give, whose colours are known.
fn metallic_parameters(scene: &Scene, material: &Material, b: &Bsdf, s: &Surface) -> Parameters {
    let factors = match material.roughness_texture {
        NONE => Vec3::ONE,
        image => texture_sample(scene, image, uv_of(scene, s, image)).truncate(),
    };
    let scaled = |constant: f32, image: u32| match image {
        NONE => constant,
        _ => constant * texture_sample(scene, image, uv_of(scene, s, image)).x,
    };
    let r = scaled(1.0, material.clearcoat_roughness_texture);
    Parameters {
        base: b.albedo,
        metallic: material.metallic * factors.z,
        f0: b.specular,
        f90: scaled(material.specular_factor, material.specular_factor_texture),
        transmission: scaled(material.transmission_factor, material.transmission_texture),
        alpha: material.alpha * factors.y * factors.y,
        coat: [scaled(material.clearcoat, material.clearcoat_texture), material.clearcoat_alpha * r * r],
    }
}

/// The material with its textures looked up.
pub fn surface_bsdf(scene: &Scene, s: &Surface) -> Bsdf {
    let material = &scene.materials[s.material as usize];
    let mut alpha = material.alpha;
    if material.roughness_texture != NONE {
        let r = texture_sample(scene, material.roughness_texture, uv_of(scene, s, material.roughness_texture)).x;
        alpha *= r * r;
    }
    let mut b = Bsdf::new(material, alpha, &scene.texels);
    let across = b.alpha * b.stretch;
    if b.stretch != 1.0 && b.alpha.max(across) >= SMOOTH_ALPHA {
        b.alpha = b.alpha.max(SMOOTH_ALPHA);
        b.stretch = across.max(SMOOTH_ALPHA) / b.alpha;
    }
    b.albedo = textured(scene, material.base_color, material.base_texture, s) * s.color.truncate();
    b.specular = textured(scene, material.specular, material.specular_texture, s);
    if material.kind == BSDF_METALLIC {
        b.metallic = Metallic::new(&metallic_parameters(scene, material, &b, s));
    }
    b
}
