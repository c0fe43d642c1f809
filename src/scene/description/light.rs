//! The `[[light]]` tables.
use super::keys::told;
use super::value::{Rgb, some_list};
use crate::error::Checked;
use crate::layout::{LIGHT_DIRECTIONAL, LIGHT_POINT, LIGHT_SPOT, Light, NONE};
use crate::scene::{MAX_COORDINATE, MAX_RADIANCE};
use glam::Vec3;
use serde::Deserialize;

/// Which light a `[[light]]` table is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Type {
    /// A point light, which shines in all directions from `position`.
    #[default]
    Point,
    /// A spot light, which shines into a cone from `position`.
    Spot,
    /// Parallel light from infinitely far.
    Directional,
}

/// A `[[light]]` table. Positions in world units, with coordinates of up to 1e12 in absolute value.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightTable {
    /// Kind of the light, which decides the keys that it needs.
    #[serde(rename = "type")]
    pub kind: Type,
    /// Name for what moves it.
    pub name: Option<String>,
    /// Position of a point or spot light.
    #[serde(default, deserialize_with = "some_list")]
    pub position: Option<[f32; 3]>,
    /// Direction in which the light of a spot or directional light travels, of any length.
    #[serde(default, deserialize_with = "some_list")]
    pub direction: Option<[f32; 3]>,
    /// A point on the axis of a spot light, in place of `direction`.
    #[serde(default, deserialize_with = "some_list")]
    pub target: Option<[f32; 3]>,
    /// Radiant intensity of a point or spot light (of a spot on its axis), W/sr, from 0 to 1e30.
    pub intensity: Option<Rgb>,
    /// Irradiance of a directional light on a facing plane, W/m^2, from 0 to 1e17.
    pub irradiance: Option<Rgb>,
    /// Degrees from a spot light's axis up to which its intensity is full, from 0 to `cutoff`; default three quarters
    /// of that.
    pub cone: Option<f32>,
    /// Degrees from a spot light's axis beyond which it is dark, above 0 and up to 180; default 20. In between it falls
    /// linearly with the angle.
    pub cutoff: Option<f32>,
}

impl LightTable {
    /// The device's light.
    ///
    /// # Errors
    /// A sentence that names the key at fault.
    pub fn build(&self) -> Checked<Light> {
        let position = || finite(self.position.ok_or("needs a position")?, "position");
        let light = Light { triangle: NONE, material: NONE, ..Light::default() };
        match self.kind {
            Type::Point => {
                let value = emitted(self.intensity, "intensity", MAX_INTENSITY)?;
                Ok(Light { kind: LIGHT_POINT, a: position()?, value, ..light })
            }
            Type::Directional => {
                let value = emitted(self.irradiance, "irradiance", MAX_RADIANCE)?;
                Ok(Light { kind: LIGHT_DIRECTIONAL, b: self.axis(Vec3::ZERO)?, value, ..light })
            }
            Type::Spot => {
                let a = position()?;
                let cutoff = self.cutoff.unwrap_or(20.0);
                let cone = self.cone.unwrap_or(cutoff * 0.75);
                if !((0.0..=cutoff).contains(&cone) && cutoff > 0.0 && cutoff <= 180.0) {
                    return Err(format!("cone {cone} and cutoff {cutoff}: need 0 <= cone <= cutoff <= 180 degrees"));
                }
                let c = [cone.to_radians(), cutoff.to_radians(), 0.0];
                let value = emitted(self.intensity, "intensity", MAX_INTENSITY)?;
                Ok(Light { kind: LIGHT_SPOT, a, b: self.axis(a.into())?, c, value, ..light })
            }
        }
    }

    /// A warning about the keys of the table that its type does not read.
    pub fn warning(&self, number: usize) -> Option<String> {
        use Type::{Directional, Point, Spot};
        let keys: [(&str, bool, &[Type]); 7] = [
            ("position", self.position.is_some(), &[Point, Spot]),
            ("direction", self.direction.is_some(), &[Spot, Directional]),
            ("target", self.target.is_some(), &[Spot]),
            ("intensity", self.intensity.is_some(), &[Point, Spot]),
            ("irradiance", self.irradiance.is_some(), &[Directional]),
            ("cone", self.cone.is_some(), &[Spot]),
            ("cutoff", self.cutoff.is_some(), &[Spot]),
        ];
        let unread = keys.iter().filter(|(_, is_set, types)| *is_set && !types.contains(&self.kind));
        let kind = match self.kind {
            Point => "point",
            Spot => "spot",
            Directional => "directional",
        };
        told(&format!("light {number}: a {kind} light"), unread.map(|(name, ..)| *name))
    }

    /// Unit direction in which the light travels.
    fn axis(&self, from: Vec3) -> Checked<[f32; 3]> {
        let direction = match (self.direction, self.target) {
            (Some(d), None) => Vec3::from(d),
            (None, Some(t)) if self.kind == Type::Spot => Vec3::from(t) - from,
            _ => return Err("needs a direction (spot: or a target), not both".into()),
        };
        let unit = direction.as_dvec3().try_normalize().ok_or("the direction has no length")?;
        Ok(unit.as_vec3().to_array())
    }
}

fn finite(v: [f32; 3], key: &str) -> Checked<[f32; 3]> {
    match v.iter().all(|v| v.abs() <= MAX_COORDINATE as f32) {
        true => Ok(v),
        false => Err(format!("{key} {v:?} is not within {:e}", MAX_COORDINATE)),
    }
}

/// Largest intensity of a point or spot light, W/sr: in large units of length it is spread over the squares of large distances.
const MAX_INTENSITY: f32 = 1e30;

fn emitted(v: Option<Rgb>, key: &str, most: f32) -> Checked<[f32; 3]> {
    let v = v.ok_or_else(|| format!("needs {key}"))?.0;
    match v.iter().all(|v| (0.0..=most).contains(v)) {
        true => Ok(v),
        false => Err(format!("{key} {v:?} is negative, NaN or above {most:e}")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cones_have_the_defaults_that_are_documented() {
        for (given, expected) in [
            ([None, None], [15.0, 20.0]),
            ([None, Some(60.0)], [45.0, 60.0]),
            ([Some(5.0), None], [5.0, 20.0]),
            ([Some(0.0), Some(180.0)], [0.0, 180.0]),
        ] {
            let ([cone, cutoff], axis) = (given, Some([0.0, 0.0, -1.0]));
            let (position, intensity) = (Some([0.0; 3]), Some(Rgb([1.0; 3])));
            let table = LightTable {
                kind: Type::Spot,
                position,
                direction: axis,
                intensity,
                cone,
                cutoff,
                ..Default::default()
            };
            let [full, dark, _] = table.build().unwrap().c;
            assert_eq!([full, dark], expected.map(f32::to_radians), "{given:?}");
        }
    }
}
