//! The `[[material]]` tables.
use super::value::Rgb;
use serde::Deserialize;
use std::path::PathBuf;

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

/// A `[[material]]` table. Colours are linear Rec. 709, one number or `[r, g, b]`; files are relative to the scene file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MaterialTable {
    /// What meshes and OBJ files call it; replaces an MTL material of that name.
    pub name: String,
    /// Kind of the material; default diffuse.
    #[serde(rename = "type")]
    pub kind: Type,
    /// Albedo, or the tint of a mirror or conductor; default 0.5 (diffuse, coated without texture), else 1.
    pub color: Option<Rgb>,
    /// sRGB picture that multiplies `color`.
    pub color_texture: Option<PathBuf>,
    /// Microfacet roughness in [0, 1]; below 0.01 smooth; default 0.
    pub alpha: f32,
    /// Microfacet distribution; default Beckmann.
    pub distribution: Distribution,
    /// Index of refraction of a conductor.
    pub eta: Option<Rgb>,
    /// Extinction of a conductor.
    pub k: Option<Rgb>,
    /// Name of the metal that gives a conductor's `eta` and `k`.
    pub metal: Option<String>,
    /// Interior over exterior index of a dielectric or a coat; default 1.5.
    pub ior: Option<f32>,
    /// Tint of specular reflection; default 1.
    pub specular: Option<Rgb>,
    /// sRGB picture that multiplies `specular`.
    pub specular_texture: Option<PathBuf>,
    /// Tint of transmission; default 1.
    pub transmission: Option<Rgb>,
    /// Radiance of the front side, W/(m^2 sr).
    pub emission: Option<Rgb>,
    /// sRGB picture that multiplies `emission` (default then 1).
    pub emission_texture: Option<PathBuf>,
    /// Opacity in [0, 1]; default 1.
    pub opacity: Option<f32>,
    /// Picture that masks the surface by its alpha channel, or by its red channel where it has none.
    pub opacity_texture: Option<PathBuf>,
    /// Height map that perturbs normals.
    pub bump: Option<PathBuf>,
    /// Height in world units per unit of the height map; default 1.
    pub bump_scale: Option<f32>,
    /// Tangent-space normal map, in place of `bump`.
    pub normal_map: Option<PathBuf>,
    /// Perceptual roughness (root of alpha) in its green channel; multiplies the root of `alpha` (default then 1).
    pub roughness_texture: Option<PathBuf>,
    /// Whether both sides scatter light; default true.
    pub two_sided: Option<bool>,
    /// Coated: light that is reflected below the coat takes on the base's colour each time; default false.
    pub nonlinear: bool,
}
