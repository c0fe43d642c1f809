//! `KHR_lights_punctual` becomes `[[light]]` tables.
//!
//! Units: glTF gives luminous intensity in candela (lm/sr), illuminance in lux (lm/m^2), and the luminance of emissive surfaces
//! in nits (lm/(m^2 sr)). All are radiometric quantities (W/sr, W/m^2, W/(m^2 sr)) times the same factor, 683 lm/W times the
//! luminous efficiency of the spectrum, and a picture is linear in light: with lumens in place of watts everywhere, lights, lamps
//! and surfaces keep their proportions, and numbers are taken as they are.
use super::asset::{Asset, one_line};
use super::extension::{self, Light, Spot};
use crate::error::Result;
use crate::scene::MAX_RADIANCE;
use crate::scene::description::{LightTable, LightType, Rgb};
use glam::{DAffine3, DVec3};
use std::f32::consts::FRAC_PI_2;

/// The lights of a file; numbers beyond what glTF allows are clamped, with one warning.
///
/// # Errors
/// For a damaged extension.
pub fn read(asset: &Asset, warnings: &mut Vec<String>) -> Result<Vec<Light>> {
    let all = asset.root.extensions.as_ref().map(|e| &e.others);
    let found = extension::read::<extension::Lights>(asset, all, "KHR_lights_punctual", "the file")?;
    let mut lights = found.map_or_else(Vec::new, |found| found.lights);
    let clamped = lights.iter_mut().map(clamp).filter(|changed| *changed).count();
    if clamped > 0 {
        warnings.push(format!("numbers beyond what glTF allows are clamped: {clamped} lights"));
    }
    Ok(lights)
}

/// Brightest light, its largest colour, and the narrowest cone in radians.
const BRIGHTEST: f32 = 1e15;
const LARGEST_COLOR: f32 = MAX_RADIANCE / BRIGHTEST;
const NARROWEST: f32 = 1e-3;

/// Whether anything had to be changed.
fn clamp(light: &mut Light) -> bool {
    let sane = |v: f32, low: f32, high: f32| if v.is_nan() { low } else { v.clamp(low, high) };
    let outer = sane(light.spot.outer_cone_angle, NARROWEST, FRAC_PI_2);
    let spot = Spot { inner_cone_angle: sane(light.spot.inner_cone_angle, 0.0, outer), outer_cone_angle: outer };
    let spot = if light.kind == "spot" { spot } else { light.spot };
    let color = light.color.map(|c| sane(c, 0.0, LARGEST_COLOR));
    let new = Light { kind: light.kind.clone(), color, intensity: sane(light.intensity, 0.0, BRIGHTEST), spot };
    let changed = new != *light;
    *light = new;
    changed
}

/// The light that `node` holds, placed by `world`.
///
/// # Errors
/// For a light that is not there or of an unknown type.
pub fn of_node(asset: &Asset, node: usize, world: &DAffine3, lights: &[Light]) -> Result<Option<LightTable>> {
    let place = format!("node {node}");
    let all = asset.root.nodes[node].extensions.as_ref().map(|e| &e.others);
    let named = extension::read::<extension::NodeLight>(asset, all, "KHR_lights_punctual", &place)?;
    let Some(index) = named.map(|named| named.light) else { return Ok(None) };
    let missing = || asset.at(&place, format!("names light {index}, and there are {}", lights.len()));
    let light = lights.get(index).ok_or_else(missing)?;
    let kind = match light.kind.as_str() {
        "directional" => LightType::Directional,
        "point" => LightType::Point,
        "spot" => LightType::Spot,
        other => {
            let what = format!("has the type \"{}\": it must be directional, point or spot", one_line(other));
            return Err(asset.at(format!("light {index}"), what));
        }
    };
    let value = Some(Rgb(light.color.map(|c| c * light.intensity)));
    let (inner, outer) = (light.spot.inner_cone_angle, light.spot.outer_cone_angle);
    let table = LightTable { kind, ..LightTable::default() };
    let table = match kind {
        LightType::Directional => LightTable { irradiance: value, ..table },
        LightType::Point => LightTable { intensity: value, ..table },
        // glTF leaves the falloff within the cone to the renderer.
        LightType::Spot => {
            let (cone, cutoff) = (Some(inner.to_degrees()), Some(outer.to_degrees()));
            LightTable { intensity: value, cone, cutoff, ..table }
        }
    };
    Ok(Some(placed(&table, world)))
}

/// The light where its node is at `world`, along whose -z axis it shines.
pub fn placed(table: &LightTable, world: &DAffine3) -> LightTable {
    let axis = world.transform_vector3(DVec3::NEG_Z).try_normalize().unwrap_or(DVec3::NEG_Z);
    let (position, direction) = (world.translation.as_vec3().to_array(), axis.as_vec3().to_array());
    LightTable {
        position: (table.kind != LightType::Directional).then_some(position),
        direction: (table.kind != LightType::Point).then_some(direction),
        ..table.clone()
    }
}
