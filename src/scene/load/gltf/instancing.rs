//! `EXT_mesh_gpu_instancing`: a node that shows its mesh many times.
use super::accessor::Elements;
use super::asset::Asset;
use super::extension;
use crate::error::Result;
use glam::{DAffine3, DQuat, DVec3};
use serde::Deserialize;
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// `EXT_mesh_gpu_instancing` of a node: accessors of `TRANSLATION`, `ROTATION` and `SCALE`.
#[derive(Deserialize)]
struct Instancing {
    /// Indices of accessors by the name of what they hold.
    attributes: BTreeMap<String, usize>,
}

/// The transforms that a node's extensions list; `None` where they list none, and the node shows its mesh once.
///
/// # Errors
/// [`crate::error::Error::Input`] for lists of different lengths or types.
pub fn read(asset: &Asset, all: Option<&Map<String, Value>>, place: &str) -> Result<Option<Vec<DAffine3>>> {
    let found: Option<Instancing> = extension::read(asset, all, "EXT_mesh_gpu_instancing", place)?;
    let all = found.map(|found| instances(asset, &found.attributes, place)).transpose()?;
    Ok(all.filter(|all| !all.is_empty()))
}

fn instances(asset: &Asset, attributes: &BTreeMap<String, usize>, place: &str) -> Result<Vec<DAffine3>> {
    let at = |what: String| asset.at(place, what);
    let translations = optional::<3>(asset, attributes, "TRANSLATION", place)?;
    let rotations = optional::<4>(asset, attributes, "ROTATION", place)?;
    let scales = optional::<3>(asset, attributes, "SCALE", place)?;
    let counts = [translations.len(), rotations.len(), scales.len()];
    let count = counts.into_iter().max().unwrap_or(0);
    if counts.iter().any(|other| ![0, count].contains(other)) {
        return Err(at(format!("places {count} instances, but not all of them have all attributes")));
    }
    let triple = |list: &[[f32; 3]], i: usize, or: DVec3| list.get(i).map_or(or, |v| DVec3::from(v.map(f64::from)));
    let turn = |i: usize| {
        let rotation = rotations.get(i).map(|r| DQuat::from_array(r.map(f64::from)));
        rotation.filter(|r| r.length() > 1e-30 && r.is_finite()).map_or(DQuat::IDENTITY, DQuat::normalize)
    };
    let one = |i: usize| {
        let (scale, moved) = (triple(&scales, i, DVec3::ONE), triple(&translations, i, DVec3::ZERO));
        DAffine3::from_scale_rotation_translation(scale, turn(i), moved)
    };
    Ok((0..count).map(one).collect())
}

fn optional<const N: usize>(
    asset: &Asset,
    attributes: &BTreeMap<String, usize>,
    name: &str,
    place: &str,
) -> Result<Vec<[f32; N]>> {
    let Some(&index) = attributes.get(name) else { return Ok(Vec::new()) };
    Elements::of(asset, index)?.numbers().map_err(|what| asset.at(format!("{place}, accessor {index}"), what))
}
