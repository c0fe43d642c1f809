//! Extensions of glTF: which ones are understood, and what they hold. Those of materials are in `material`.
use super::asset::{Asset, one_line};
use crate::error::{Error, Result};
use crate::scene::load::few;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};

/// Extensions that are read.
const READ: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "KHR_lights_punctual",
    "KHR_materials_clearcoat",
    "KHR_materials_emissive_strength",
    "KHR_materials_ior",
    "KHR_materials_specular",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_texture_transform",
];

/// Extensions that say nothing about the picture.
const SILENT: &[&str] = &["KHR_xmp", "KHR_xmp_json_ld"];

/// Checks the extensions that a file uses; returns the warning about those that are passed over.
///
/// # Errors
/// [`Error::Input`] for those without which meshes cannot be read: the file requires them, and they are about more than
/// materials, which can be shown without.
pub fn check(asset: &Asset) -> Result<Option<String>> {
    let unknown = |name: &&String| !READ.contains(&name.as_str()) && !SILENT.contains(&name.as_str());
    let names = |list: Vec<&String>| few(list.iter().map(|name| one_line(name)));
    let (required, used) = (&asset.root.extensions_required, &asset.root.extensions_used);
    let looks = |name: &&String| name.contains("_materials_") || name.contains("_texture_");
    let needed: Vec<_> = required.iter().filter(unknown).filter(|name| !looks(name)).collect();
    if !needed.is_empty() {
        let what = format!("needs {}, which cannot be read: export it without", names(needed));
        return Err(Error::input(asset.path, what));
    }
    let mut left: Vec<_> = used.iter().chain(required).filter(unknown).collect();
    left.sort_unstable();
    left.dedup();
    Ok((!left.is_empty()).then(|| format!("{}: not rendered: {}", asset.path.display(), names(left))))
}

/// The extension `name` among `all`, if it is there.
///
/// # Errors
/// [`Error::Input`] when it does not hold what it should; `place` says where it is.
pub fn read<T: DeserializeOwned>(
    asset: &Asset,
    all: Option<&Map<String, Value>>,
    name: &str,
    place: &str,
) -> Result<Option<T>> {
    let Some(value) = all.and_then(|all| all.get(name)) else { return Ok(None) };
    let read = T::deserialize(value);
    read.map(Some).map_err(|e| asset.at(place, format!("has {name} that is damaged: {}", one_line(&e.to_string()))))
}

/// `KHR_lights_punctual` of a file.
#[derive(Deserialize)]
pub struct Lights {
    /// The lights that nodes name.
    pub lights: Vec<Light>,
}

/// `KHR_lights_punctual` of a node.
#[derive(Deserialize)]
pub struct NodeLight {
    /// Index of the light.
    pub light: usize,
}

/// A light of `KHR_lights_punctual`. Its `range` is a hint for renderers that cut light off, which this one does not.
#[derive(Deserialize, PartialEq)]
#[serde(default)]
pub struct Light {
    /// `directional`, `point` or `spot`.
    #[serde(rename = "type")]
    pub kind: String,
    /// Linear Rec. 709.
    pub color: [f32; 3],
    /// Candela of a point or spot light, lux of a directional one.
    pub intensity: f32,
    /// Cone of a spot light.
    pub spot: Spot,
}

impl Default for Light {
    fn default() -> Self {
        Self { kind: String::new(), color: [1.0; 3], intensity: 1.0, spot: Spot::default() }
    }
}

/// Cone of a spot light; angles from its axis in radians.
#[derive(Clone, Copy, Deserialize, PartialEq)]
#[serde(default, rename_all = "camelCase")]
pub struct Spot {
    /// Angle up to which the intensity is full.
    pub inner_cone_angle: f32,
    /// Angle from which it is dark.
    pub outer_cone_angle: f32,
}

impl Default for Spot {
    fn default() -> Self {
        Self { inner_cone_angle: 0.0, outer_cone_angle: std::f32::consts::FRAC_PI_4 }
    }
}
