//! The `[[material]]` tables.
use super::texture::TextureTable;
use super::value::Rgb;
use serde::Deserialize;

/// How a material reflects light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Type {
    /// Lambertian reflection of `color`.
    #[default]
    Diffuse,
    /// Metal with microfacets.
    Conductor,
    /// Glass with microfacets.
    Dielectric,
    /// A conductor of eta 0, k 1, whose Fresnel reflectance is 1 at every angle, tinted by `color`.
    Mirror,
    /// A diffuse base under a dielectric coat.
    Coated,
    /// The material of glTF 2.0: a mixture of a metal and of a dielectric above a diffuse or thin transparent base.
    #[serde(rename = "metallic-roughness")]
    MetallicRoughness,
}

/// Whether rays pass through a metallic-roughness surface, by its alpha: `opacity` times the alpha channel of `color_texture`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AlphaMode {
    /// None pass.
    #[default]
    Opaque,
    /// All pass where alpha is below `alpha_cutoff`.
    Mask,
    /// They pass with the probability 1 - alpha.
    Blend,
}

/// Distribution of microfacet normals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Distribution {
    /// Beckmann's distribution.
    #[default]
    Beckmann,
    /// The GGX distribution (Trowbridge-Reitz), which has longer tails.
    Ggx,
}

/// A `[[material]]` table. Colours are linear Rec. 709, one number or `[r, g, b]`, which is clamped to [0, 1] with a
/// warning where no other range is given; numbers are finite, and outside their range an error; files are relative to
/// the scene file.
/// Keys that the type does not read are named in a warning.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MaterialTable {
    /// What meshes and OBJ files call it; replaces an MTL material of that name.
    pub name: String,
    /// Whether a glTF file brought it, beside which MTL materials of its name stay.
    #[serde(skip)]
    pub of_model: bool,
    /// Kind of the material; default diffuse.
    #[serde(rename = "type")]
    pub kind: Type,
    /// Albedo, or the tint of a mirror or conductor; default 0.5 (diffuse, coated without texture), else 1. The vertex colours of a
    /// mesh multiply it, but for those of an OBJ file, which are shown where it wears nothing.
    pub color: Option<Rgb>,
    /// sRGB picture that multiplies `color`.
    pub color_texture: Option<TextureTable>,
    /// Microfacet roughness in [0, 1]; below 0.01 smooth; default 0.
    pub alpha: f32,
    /// Conductor, dielectric: roughness in [0, 1] along v of the texture coordinates, where it differs from `alpha`,
    /// which is that along u then; the mesh's tangents, where it has some, take the place of u.
    pub alpha_v: Option<f32>,
    /// Microfacet distribution; default Beckmann.
    pub distribution: Distribution,
    /// Index of refraction of a conductor, from 0 to 100; default 1 where `k` is given, and without `k` and `metal` 0.
    pub eta: Option<Rgb>,
    /// Extinction of a conductor, from 0 to 100; default 0 where `eta` is given, and without `eta` and `metal` 1.
    pub k: Option<Rgb>,
    /// Name of the metal that gives a conductor's `eta` and `k`.
    pub metal: Option<String>,
    /// Interior over exterior index of a dielectric, a coat or the dielectric part of metallic-roughness, from 0.1 to
    /// 10 (metallic-roughness: to 1000, or 0, with which the dielectric reflects all that `specular` says); default 1.5.
    pub ior: Option<f32>,
    /// Tint of specular reflection; default 1. Metallic-roughness: from 0 to 1e6.
    pub specular: Option<Rgb>,
    /// sRGB picture that multiplies `specular`.
    pub specular_texture: Option<TextureTable>,
    /// Tint of transmission; default 1.
    pub transmission: Option<Rgb>,
    /// Radiance of the front side, W/(m^2 sr), from 0 to 1e17 once it is multiplied by `emission_strength`; default 0.
    pub emission: Option<Rgb>,
    /// sRGB picture that multiplies `emission` (default then 1).
    pub emission_texture: Option<TextureTable>,
    /// Opacity in [0, 1]; default 1.
    pub opacity: Option<f32>,
    /// Picture that masks the surface by its alpha channel, or by its red channel where it has none or is grey with full alpha throughout.
    pub opacity_texture: Option<TextureTable>,
    /// Height map that perturbs normals.
    pub bump: Option<TextureTable>,
    /// Height in world units per unit of the height map; default 1.
    pub bump_scale: Option<f32>,
    /// Tangent-space normal map, in place of `bump`.
    pub normal_map: Option<TextureTable>,
    /// Perceptual roughness (root of alpha) in its green channel; multiplies the root of `alpha` (default then 1).
    pub roughness_texture: Option<TextureTable>,
    /// Whether both sides scatter light; default true.
    pub two_sided: Option<bool>,
    /// Whether it shines from behind, too; default false.
    pub emission_two_sided: bool,
    /// Coated: light that is reflected below the coat takes on the base's colour each time; default false.
    pub nonlinear: bool,
    /// Factor of `emission`, from 0, so that the product is no more than 1e17; default 1.
    pub emission_strength: Option<f32>,
    /// Factor of the x and y components of `normal_map`; default 1.
    pub normal_scale: Option<f32>,
    /// Metallic-roughness: share of metal in [0, 1]; default 1. (Then `color` is the base colour, default 1, and `specular` with
    /// `specular_texture` the colour of the dielectric's reflection head on.)
    pub metallic: Option<f32>,
    /// Metallic-roughness: the root of alpha, in [0, 1]; default 1.
    pub roughness: Option<f32>,
    /// Metallic-roughness: a linear picture whose green channel multiplies `roughness`, and whose blue one `metallic`.
    pub metallic_roughness_texture: Option<TextureTable>,
    /// Metallic-roughness: factor of the dielectric's reflection in [0, 1]; default 1.
    pub specular_factor: Option<f32>,
    /// Metallic-roughness: a picture whose alpha channel multiplies `specular_factor`.
    pub specular_factor_texture: Option<TextureTable>,
    /// Metallic-roughness: share of the dielectric in [0, 1] that lets light through a thin wall; default 0. `color` tints that light.
    pub transmission_factor: Option<f32>,
    /// Metallic-roughness: a picture whose red channel multiplies `transmission_factor`.
    pub transmission_texture: Option<TextureTable>,
    /// Metallic-roughness: strength in [0, 1] of a clear coat of index 1.5 above all; default 0.
    pub clearcoat: Option<f32>,
    /// Metallic-roughness: a picture whose red channel multiplies `clearcoat`.
    pub clearcoat_texture: Option<TextureTable>,
    /// Metallic-roughness: the root of the clear coat's alpha, in [0, 1]; default 0.
    pub clearcoat_roughness: Option<f32>,
    /// Metallic-roughness: a picture whose green channel multiplies `clearcoat_roughness`.
    pub clearcoat_roughness_texture: Option<TextureTable>,
    /// Metallic-roughness: tangent-space normal map of the clear coat, which `normal_map` does not perturb.
    pub clearcoat_normal_map: Option<TextureTable>,
    /// Metallic-roughness: factor of the x and y components of `clearcoat_normal_map`; default 1.
    pub clearcoat_normal_scale: Option<f32>,
    /// Metallic-roughness: what alpha does; without it alpha is ignored, but `opacity` and `opacity_texture` count.
    pub alpha_mode: Option<AlphaMode>,
    /// Metallic-roughness, `alpha_mode = "mask"`: the least alpha that stops rays, from 0 to 1e6; default 0.5. Above 1
    /// none does.
    pub alpha_cutoff: Option<f32>,
    /// Metallic-roughness: the surface shows `color` in any light: it emits it to both sides and scatters none; default false.
    pub unlit: bool,
}
