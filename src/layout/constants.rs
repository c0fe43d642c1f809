//! Constants that both host and shaders know by name.
#[cfg(doc)]
use super::*;
use super::{float, uint};

constants! {
    /// An index that stands for "no texture", "no material override" or "no hit".
    NONE: uint = 0xffffffff;
    /// Largest number of groups of nodes on a traversal's stack; hierarchies are built so that no scene needs more.
    TRAVERSAL_STACK: uint = 32;
    /// Set in [`PathConstants::root`] when the leaves of that level are instances.
    ROOT_OF_INSTANCES: uint = 0x80000000;
    /// Set in [`Triangle::primitive`] of a sphere.
    SPHERE: uint = 0x80000000;
    /// [`Triangle::primitive`] of a sphere: its front side is the inner one.
    SPHERE_INWARD: uint = 1;
    /// [`Triangle::primitive`] of a sphere: its azimuth runs the other way, as a mirror shows it.
    SPHERE_MIRRORED: uint = 2;
    /// [`Material::kind`]: Lambertian reflection, `base_color / pi`.
    BSDF_DIFFUSE: uint = 0;
    /// [`Material::kind`]: microfacet conductor with exact Fresnel from `eta`, `k`.
    BSDF_CONDUCTOR: uint = 1;
    /// [`Material::kind`]: microfacet dielectric, reflection and refraction, `eta[0]` = interior / exterior index.
    BSDF_DIELECTRIC: uint = 2;
    /// [`Material::kind`]: diffuse base under a dielectric coat of index `eta[0]`, roughness `alpha`.
    BSDF_COATED: uint = 3;
    /// [`Material::kind`]: metallic-roughness of glTF 2.0.
    BSDF_METALLIC: uint = 4;
    /// An interface whose [`Material::alpha`] is below this is smooth.
    SMOOTH_ALPHA: float = 0.01;
    /// [`Material::flags`]: the GGX distribution instead of Beckmann.
    MATERIAL_GGX: uint = 1;
    /// [`Material::flags`]: both sides scatter alike (dielectrics ignore it: their sides differ by definition).
    MATERIAL_TWO_SIDED: uint = 2;
    /// [`Material::flags`]: `bump_texture` is a tangent-space normal map, not a height map.
    MATERIAL_NORMAL_MAP: uint = 4;
    /// [`Material::flags`]: hits are subject to an alpha mask (`opacity_texture` or `opacity` below 1).
    MATERIAL_MASKED: uint = 8;
    /// [`Material::flags`]: light that scatters below a coat takes on the base's colour at every turn.
    MATERIAL_NONLINEAR: uint = 16;
    /// [`Material::flags`]: the colours of vertices multiply `emission`.
    MATERIAL_UNLIT: uint = 32;
    /// [`Material::flags`]: it shines from behind, too.
    MATERIAL_EMITS_BEHIND: uint = 64;
    /// [`Material::flags`]: a smooth thin wall without a coat, which shadow rays of lights without extent pass.
    MATERIAL_CLEAR_WALL: uint = 128;
    /// [`Material::flags`]: opacities of vertices, of which some are below 1, are part of its mask.
    MATERIAL_VERTEX_MASK: uint = 256;
    /// [`PathConstants::pixel_filter`]: uniform over the pixel.
    PIXEL_FILTER_BOX: uint = 0;
    /// [`PathConstants::pixel_filter`]: triangle of radius 1 pixel.
    PIXEL_FILTER_TENT: uint = 1;
    /// [`PathConstants::pixel_filter`]: Gaussian of standard deviation 0.5 pixels, cut at radius 2.
    PIXEL_FILTER_GAUSSIAN: uint = 2;
    /// [`PathConstants::pixel_filter`]: the pixel's centre.
    PIXEL_FILTER_POINT: uint = 3;
    /// Rows of the table of a rough coat or of metallic microfacets, one for each roughness ([`crate::scene::coat_table`]).
    COAT_ROWS: uint = 32;
    /// Numbers in a row: reflectances at [`COAT_COLUMNS`] - 1 cosines, and a mean for diffuse light, which a coat gets from inside.
    COAT_COLUMNS: uint = 49;
    /// [`Texture::flags`]: RGB is stored with the sRGB curve and decoded when read.
    TEXTURE_SRGB: uint = 1;
    /// [`Texture::flags`]: coordinates outside [0, 1] clamp to the border texel; otherwise they repeat.
    TEXTURE_CLAMP: uint = 2;
    /// [`Texture::flags`]: the same along u alone.
    TEXTURE_CLAMP_U: uint = 4;
    /// [`Texture::flags`]: the same along v alone.
    TEXTURE_CLAMP_V: uint = 8;
    /// [`Texture::flags`]: along u every other repetition is mirrored.
    TEXTURE_MIRROR_U: uint = 16;
    /// [`Texture::flags`]: along v every other repetition is mirrored.
    TEXTURE_MIRROR_V: uint = 32;
    /// [`Texture::flags`]: the texel that holds the point, without interpolation.
    TEXTURE_NEAREST: uint = 64;
    /// [`Texture::flags`]: coordinates are multiplied by `shear` too.
    TEXTURE_SHEARED: uint = 128;
    /// [`Texture::flags`]: the second set of coordinates is read.
    TEXTURE_SECOND_UV: uint = 256;
    /// [`Texture::flags`]: a texel is not RGBA8 but three linear numbers of 9 bits that share an exponent, from 0 to 65408.
    TEXTURE_RGB9E5: uint = 512;
    /// [`Texture::flags`]: a texel is one float, which stands in all channels.
    TEXTURE_FLOAT: uint = 1024;
    /// [`Shading::attributes`]: three colours, of two words of unorm 2 x 16 each: red and green, blue and opacity.
    ATTRIBUTE_COLORS: uint = 1;
    /// [`Shading::attributes`]: a second set of texture coordinates, of two floats each.
    ATTRIBUTE_SECOND_UV: uint = 2;
    /// [`Shading::attributes`]: three tangents, octahedral as normals.
    ATTRIBUTE_TANGENTS: uint = 4;
    /// [`Shading::attributes`]: `-cross(normal, tangent)`, not `cross(normal, tangent)`, is the direction along +v.
    ATTRIBUTE_FLIPPED: uint = 8;
    /// [`Light::kind`]: emissive triangle `a`, `b`, `c` (vertices in world units), radiance `value`.
    LIGHT_TRIANGLE: uint = 0;
    /// [`Light::kind`]: point at `a`, radiant intensity `value` in W/sr.
    LIGHT_POINT: uint = 1;
    /// [`Light::kind`]: spot at `a` along unit `b`; `c` = (the angle of full intensity, that of the cut-off, 0), in radians.
    LIGHT_SPOT: uint = 2;
    /// [`Light::kind`]: directional along unit `b` (the way light travels), irradiance `value` on a facing plane.
    LIGHT_DIRECTIONAL: uint = 3;
    /// [`Light::kind`]: the environment; rows of the rotation environment_from_world in `a`, `b`, `c`; radiance scale `value`.
    LIGHT_ENVIRONMENT: uint = 4;
    /// [`Light::kind`]: sphere around `a` of radius `b.x` (world units), emits radiance `value` outward.
    LIGHT_SPHERE: uint = 5;
    /// [`Light::kind`]: as [`LIGHT_TRIANGLE`], of a mirrored instance: `b` is the third corner of the stored triangle, `c` the second.
    LIGHT_MIRRORED: uint = 6;
    /// [`LightNode::child`]: what remains is the index of a light.
    LIGHT_LEAF: uint = 0x80000000;
}
