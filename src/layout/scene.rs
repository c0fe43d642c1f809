//! Structs of a scene as kernels read it: camera, geometry, materials, lights.
use super::constants::{
    LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT, LIGHT_MIRRORED, LIGHT_POINT, LIGHT_SPHERE, LIGHT_SPOT, LIGHT_TRIANGLE,
    MATERIAL_NORMAL_MAP, NONE,
};
use super::effects::Effect;
#[cfg(doc)]
use super::*;
use super::{Field, Struct, float, uint, uvec2, uvec3, vec2, vec3, vec4};
use bytemuck::{Pod, Zeroable};

gpu_structs! {
    /// Camera rays start at `position` (pinhole) or on a disk of `lens_radius` around it. For film coordinates
    /// `sx`, `sy` in [-1, 1] (right, up): `direction = forward + sx * right + sy * up`, all in world space; `right`
    /// and `up` are already scaled by the tangent of half the field of view, so they need not be unit, nor
    /// right-handed (a mirrored camera). An orthographic camera's rays start at `position + sx * right + sy * up` along `forward`;
    /// `right` and `up` are half of the film's edges then, in world units.
    struct Camera {
        /// Centre of the lens, world units.
        position: vec3,
        /// Radius of the lens, world units; 0 is a pinhole.
        lens_radius: float,
        /// Unit vector to the right, scaled by tan(horizontal fov / 2), or by half the width of an orthographic film.
        right: vec3,
        /// Distance along `forward` to the plane in focus, world units.
        focus_distance: float,
        /// Unit vector up in the image, scaled as `right`.
        up: vec3,
        /// Near clip distance along the ray, world units; 0 clips nothing.
        near: float,
        /// Unit vector of the view direction.
        forward: vec3,
        /// 1 when rays are parallel, else 0.
        orthographic: uint,
    }

    /// One eight-way compressed node (Ylitie et al. 2017), as `scene::build::bvh` lays it out; child and triangle indices are global.
    /// 5 texels.
    struct BvhNode {
        /// Origin of the quantisation grid, world (or object) units.
        p: vec3,
        /// Exponents of x, y, z in the low three bytes, mask of inner children in the high byte.
        e_imask: uint,
        /// Index of the first inner child.
        child_base: uint,
        /// Index of the first primitive: a triangle, or an instance in the top level.
        primitive_base: uint,
        /// Eight bytes: kind and offset of each child.
        meta: uvec2,
        /// Eight bytes: the children's quantised lower bounds along x; the other bounds likewise.
        min_x: uvec2,
        /// Upper bounds along x.
        max_x: uvec2,
        /// Lower bounds along y.
        min_y: uvec2,
        /// Upper bounds along y.
        max_y: uvec2,
        /// Lower bounds along z.
        min_z: uvec2,
        /// Upper bounds along z.
        max_z: uvec2,
    }

    /// The part of a triangle that traversal reads, in leaf order. 3 texels. One with [`SPHERE`] is a sphere instead: `v0` is its
    /// centre, `v1` and `v2` lead from there to the pole and to where the meridian of u = 0 crosses the equator.
    struct Triangle {
        /// Vertex 0, in world units, or object units below an instance.
        v0: vec3,
        /// Index of the triangle in its mesh file, for reports; or SPHERE_ bits.
        primitive: uint,
        /// Vertex 1, as `v0`.
        v1: vec3,
        /// Index of the material.
        material: uint,
        /// Vertex 2, as `v0`.
        v2: vec3,
        /// Index of the object (shape), the `id` layer of the outputs.
        object: uint,
    }

    /// Vertex normals, texture coordinates and further attributes of the [`Triangle`] of the same index. 3 texels.
    /// Present only when a mesh of the scene has any of them.
    struct Shading {
        /// Octahedral unit normals of the three vertices, snorm 2 x 16, x in the low half. All three 0xffffffff: flat.
        normal: uvec3,
        /// Texture coordinates of vertex 0; v points up, so row 0 of an image is v = 1.
        uv0: vec2,
        /// Texture coordinates of vertex 1.
        uv1: vec2,
        /// Texture coordinates of vertex 2.
        uv2: vec2,
        /// Combination of the ATTRIBUTE_ bits.
        attributes: uint,
        /// Index among the texels of the first word of the attributes, which follow each other in the order of their bits.
        first: uint,
        /// Luminance of a triangle whose emission is a picture, beside the mean of its material, where a tree chooses lights; 0 for others.
        brightness: float,
    }

    /// A placed mesh. 7 texels. Matrices are three rows of four, `x_world = rows * (x_object, 1)`.
    struct Instance {
        /// Row 0 of world_from_object.
        world0: vec4,
        /// Row 1 of world_from_object.
        world1: vec4,
        /// Row 2 of world_from_object.
        world2: vec4,
        /// Row 0 of object_from_world.
        object0: vec4,
        /// Row 1 of object_from_world.
        object1: vec4,
        /// Row 2 of object_from_world.
        object2: vec4,
        /// Index of the mesh's root node.
        root: uint,
        /// Material for the whole instance, or [`NONE`] to keep those of the triangles.
        material: uint,
        /// Added to the triangles' object index.
        object: uint,
        /// 1 when the transform mirrors (negative determinant): the geometric normal flips.
        mirrored: uint,
    }

    /// A material. 12 texels, of which a diffuse surface without textures needs the first two. Colours are linear Rec. 709 in [0, 1]
    /// unless said otherwise.
    struct Material {
        /// Diffuse albedo; multiplies `base_texture`.
        base_color: vec3,
        /// Combination of the MATERIAL_ bits.
        flags: uint,
        /// Emitted radiance of the front side, W/(m^2 sr); 0 emits nothing.
        emission: vec3,
        /// Luminance of the mean emission times the mean opacity, in units of a power of two that is 1 unless all lamps of the scene are
        /// dimmer. Emissive triangles are chosen in proportion to it times their area.
        emission_weight: float,
        /// Index of refraction per channel (conductor), or interior / exterior in `x` (dielectric, coated; metallic, where keys alone read
        /// it).
        eta: vec3,
        /// Constant opacity in [0, 1]; multiplies `opacity_texture`.
        opacity: float,
        /// Extinction per channel (conductor).
        k: vec3,
        /// Microfacet roughness (alpha itself, not its root); see [`SMOOTH_ALPHA`].
        alpha: float,
        /// Tint of specular reflection, or the dielectric's reflectance head on (metallic); multiplies `specular_texture`.
        specular: vec3,
        /// Height of a bump map in world units per unit of texture value.
        bump_scale: float,
        /// Tint of specular transmission (dielectric).
        transmission: vec3,
        /// Texture index or [`NONE`].
        base_texture: uint,
        /// Tint; texture index or [`NONE`].
        specular_texture: uint,
        /// Opacity in its red channel (the loader moves an alpha channel there); texture index or [`NONE`].
        opacity_texture: uint,
        /// Height map, or normal map with MATERIAL_NORMAL_MAP.
        bump_texture: uint,
        /// Perceptual roughness r in its red channel, multiplies sqrt(alpha). Metallic: r in its green channel, and in its blue one a
        /// factor of `metallic`.
        roughness_texture: uint,
        /// Multiplies `emission`.
        emission_texture: uint,
        /// Diffuse reflectance of the smooth interface seen from inside (coated): mean internal Fresnel reflectance.
        internal_fresnel: float,
        /// One of the BSDF_ constants.
        kind: uint,
        /// Index of the first word of its table among the texels (coated and metallic, where rough); else zero.
        coat_table: uint,
        /// Share of metal (metallic, as the fields that follow).
        metallic: float,
        /// Factor of `specular`, and the dielectric's reflectance at grazing angles.
        specular_factor: float,
        /// Share of the dielectric that lets light through a thin wall.
        transmission_factor: float,
        /// Strength of the clear coat.
        clearcoat: float,
        /// Microfacet roughness of the clear coat.
        clearcoat_alpha: float,
        /// Factor of the x and y components of a normal map.
        normal_scale: float,
        /// Opacity from which on the surface stops all rays, and below which none; 0: opacity is a probability.
        alpha_cutoff: float,
        /// Multiplies `specular_factor` (metallic, as the textures that follow; of each the red channel); texture index or [`NONE`].
        specular_factor_texture: uint,
        /// Multiplies `transmission_factor`.
        transmission_texture: uint,
        /// Multiplies `clearcoat`.
        clearcoat_texture: uint,
        /// Perceptual roughness, multiplies sqrt(`clearcoat_alpha`).
        clearcoat_roughness_texture: uint,
        /// Roughness along the bitangent over `alpha`, which is that along the tangent then, less 1 (conductor, dielectric).
        anisotropy: float,
        /// Normal map of the clear coat; texture index or [`NONE`].
        clearcoat_normal_texture: uint,
        /// Factor of the x and y components of the clear coat's normal map.
        clearcoat_normal_scale: float,
        /// Unused words, which are zero.
        pad: uvec2,
    }

    /// A picture in the texel buffer: RGBA8 texels (R in the low byte) unless flags say otherwise, row 0 at the top. 3 texels.
    struct Texture {
        /// Index of the first texel.
        first: uint,
        /// Width in texels.
        width: uint,
        /// Height in texels.
        height: uint,
        /// Combination of the TEXTURE_ bits.
        flags: uint,
        /// Factor of texture coordinates: the picture is read at `uv * scale + offset`, with [`TEXTURE_SHEARED`] plus `vu * shear`.
        scale: vec2,
        /// Added to scaled texture coordinates.
        offset: vec2,
        /// Factor of the other texture coordinate.
        shear: vec2,
        /// Unused words, which are zero.
        pad: uvec2,
    }

    /// A light. 4 texels; what the vectors mean depends on `kind`.
    struct Light {
        /// See the LIGHT_ constants.
        a: vec3,
        /// One of the LIGHT_ constants.
        kind: uint,
        /// See the LIGHT_ constants.
        b: vec3,
        /// Probability that the alias table returns this light.
        probability: float,
        /// See the LIGHT_ constants.
        c: vec3,
        /// Index of the triangle in leaf order (LIGHT_TRIANGLE, LIGHT_MIRRORED, LIGHT_SPHERE), else [`NONE`].
        triangle: uint,
        /// Radiance, intensity or irradiance, linear Rec. 709.
        value: vec3,
        /// Index of the material (LIGHT_TRIANGLE, LIGHT_MIRRORED, LIGHT_SPHERE), else [`NONE`].
        material: uint,
    }

    /// A node of the tree over the lights of a scene of many. 2 texels. The root is the first. Behind it lie the lights outside of the
    /// tree, with their probabilities as `power`, and then groups of siblings.
    struct LightNode {
        /// Middle of the lights below it, world units.
        centre: vec3,
        /// Distance from there within which they lie.
        radius: float,
        /// Mean of the directions in which they shine brightest, by power, octahedral as normals.
        axis: uint,
        /// Two snorms of 16 bits, the first in the low half. Cosine of the largest angle to `axis` under which one of them shines, -1 for those
        /// that shine all round or from both sides; and how far the mean of the directions in which panels shine brightest reaches along `axis`, 0
        /// if there are none, -1 if all are panels in one plane.
        beams: uint,
        /// Sum of their powers, of spots as if they shone all round, in a unit in which that of the root is the probability of all; 0 without any.
        power: float,
        /// Index of the first of its children, or of the light that it is, with [`LIGHT_LEAF`].
        child: uint,
    }

    /// One slot of an alias table (Walker 1977, Vose 1991) over n entries. From a 32-bit random word r, the slot is
    /// the high word of r * n; the low word picks the slot itself when below `threshold`, its alias otherwise.
    struct AliasEntry {
        /// Probability of the slot's own entry, in units of 2^-32; 0xffffffff stands for 1.
        threshold: uint,
        /// Index of the slot's other entry.
        alias: uint,
    }
}

impl Material {
    /// Every texture that it names, as an index among the scene's, with the effect that reads it.
    pub fn textures(&self) -> impl Iterator<Item = (Effect, u32)> {
        let normal_map = self.flags & MATERIAL_NORMAL_MAP != 0;
        let bump = if normal_map { Effect::normal_maps } else { Effect::bump_maps };
        let all = [
            (Effect::textures, self.base_texture),
            (Effect::textures, self.specular_texture),
            (Effect::textures, self.roughness_texture),
            (Effect::textures, self.emission_texture),
            (Effect::textures, self.specular_factor_texture),
            (Effect::textures, self.transmission_texture),
            (Effect::textures, self.clearcoat_texture),
            (Effect::textures, self.clearcoat_roughness_texture),
            (Effect::coat_normals, self.clearcoat_normal_texture),
            (Effect::alpha_masks, self.opacity_texture),
            (bump, self.bump_texture),
        ];
        all.into_iter().filter(|&(_, index)| index != NONE)
    }
}

impl Light {
    /// The effect that samples it; `None` where `kind` is none of the LIGHT_ constants.
    pub fn effect(&self) -> Option<Effect> {
        match self.kind {
            LIGHT_SPHERE => Some(Effect::emissive),
            _ if self.is_triangle() => Some(Effect::emissive),
            LIGHT_POINT => Some(Effect::point_lights),
            LIGHT_SPOT => Some(Effect::spot_lights),
            LIGHT_DIRECTIONAL => Some(Effect::directional_lights),
            LIGHT_ENVIRONMENT => Some(Effect::environment),
            _ => None,
        }
    }

    /// Whether it is a triangle of the scene.
    pub fn is_triangle(&self) -> bool {
        matches!(self.kind, LIGHT_TRIANGLE | LIGHT_MIRRORED)
    }

    /// Whether it is a triangle or a sphere of the scene, which rays meet.
    pub fn has_surface(&self) -> bool {
        self.effect() == Some(Effect::emissive)
    }

    /// Whether it has no extent, so that light sampling alone finds it.
    pub fn is_delta(&self) -> bool {
        matches!(self.effect(), Some(Effect::point_lights | Effect::spot_lights | Effect::directional_lights))
    }

    /// Whether it is infinitely far away.
    pub fn is_far(&self) -> bool {
        matches!(self.effect(), Some(Effect::directional_lights | Effect::environment))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::cast_slice_mut;

    #[test]
    fn a_material_tells_of_every_texture() {
        let described = super::STRUCTS.iter().find(|s| s.name == "Material").unwrap();
        let fields: Vec<_> = described.fields.iter().filter(|f| f.name.ends_with("_texture")).collect();
        assert_eq!(fields.len(), 11);
        for field in &fields {
            let mut material = Material::default();
            let words: &mut [u32] = cast_slice_mut(std::slice::from_mut(&mut material));
            fields.iter().for_each(|other| words[other.offset / 4] = NONE);
            words[field.offset / 4] = 7;
            assert_eq!(material.textures().map(|(_, index)| index).collect::<Vec<_>>(), [7], "{}", field.name);
        }
    }
}
