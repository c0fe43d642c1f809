//! Things that keys move.
use super::Mover;
use super::curve::Curve;
use super::time::hull;
use crate::error::Result;
use crate::scene::description::{Camera, LightTable, LightType, Rgb, Transform, affine};
use crate::scene::pose::{EnvironmentChange, MaterialChange, Pose};
use glam::{DQuat, DVec3};
use std::ops::Range;

/// A thing that keys move: what it is where no key says otherwise, and its number.
#[derive(Clone, Debug)]
pub enum Target {
    /// The camera.
    Camera(Camera),
    /// What a placement puts where.
    Placement(usize, Transform),
    /// A node of a glTF file, which [`Keyed::place`] puts where it belongs.
    Node,
    /// A light.
    Light(usize, LightTable),
    /// A material.
    Material(usize),
    /// The environment.
    Environment,
}

/// What can be keyed of each kind of thing: its name, and how many numbers it takes.
pub type Channels = &'static [(&'static str, &'static [usize])];

impl Target {
    /// What can be keyed.
    pub fn channels(&self) -> Channels {
        match self {
            Self::Camera(_) => &[
                ("position", &[3]),
                ("target", &[3]),
                ("up", &[3]),
                ("fov", &[1]),
                ("orthographic", &[1]),
                ("focus_distance", &[1]),
                ("lens_radius", &[1]),
            ],
            Self::Placement(..) | Self::Node => {
                &[("translate", &[3]), ("rotate", &[3, 4]), ("scale", &[3, 1]), ("transform", &[16])]
            }
            Self::Light(_, LightTable { kind: LightType::Point, .. }) => &[("position", &[3]), ("intensity", &[3, 1])],
            Self::Light(_, LightTable { kind: LightType::Directional, .. }) => {
                &[("direction", &[3]), ("irradiance", &[3, 1])]
            }
            Self::Light(_, LightTable { kind: LightType::Spot, .. }) => &[
                ("position", &[3]),
                ("direction", &[3]),
                ("target", &[3]),
                ("intensity", &[3, 1]),
                ("cone", &[1]),
                ("cutoff", &[1]),
            ],
            Self::Material(_) => &[
                ("color", &[3, 1]),
                ("specular", &[3, 1]),
                ("transmission", &[3, 1]),
                ("emission", &[3, 1]),
                ("alpha", &[1]),
                ("opacity", &[1]),
            ],
            Self::Environment => &[("radiance", &[3, 1]), ("rotation", &[1])],
        }
    }
}

/// A thing and its curves, by the names of [`Target::channels`]; those of `rotate` are quaternions.
#[derive(Clone, Debug)]
pub struct Keyed {
    /// What moves.
    pub target: Target,
    /// What of it, and how.
    pub curves: Vec<(&'static str, Curve)>,
}

impl Keyed {
    fn find(&self, name: &str, seconds: f64) -> Option<Vec<f64>> {
        self.curves.iter().find(|(of, _)| *of == name).map(|(_, curve)| curve.at(seconds))
    }

    fn one(&self, name: &str, seconds: f64) -> Option<f64> {
        self.find(name, seconds)?.first().copied()
    }

    fn three(&self, name: &str, seconds: f64) -> Option<[f64; 3]> {
        self.find(name, seconds)?.try_into().ok()
    }

    fn floats(&self, name: &str, seconds: f64) -> Option<[f32; 3]> {
        self.three(name, seconds).map(|v| v.map(|v| v as f32))
    }

    fn camera(&self, rest: &Camera, at: f64) -> Camera {
        Camera {
            position: self.three("position", at).or(rest.position),
            target: self.three("target", at).or(rest.target),
            up: self.three("up", at).or(rest.up),
            fov: self.one("fov", at).or(rest.fov),
            orthographic: self.one("orthographic", at).or(rest.orthographic),
            focus_distance: self.one("focus_distance", at).map(|v| v as f32).or(rest.focus_distance),
            lens_radius: self.one("lens_radius", at).map_or(rest.lens_radius, |v| v as f32),
            ..rest.clone()
        }
    }

    fn light(&self, rest: &LightTable, at: f64) -> LightTable {
        let [direction, target] = ["direction", "target"].map(|name| self.floats(name, at));
        let aimed = direction.is_some() || target.is_some();
        LightTable {
            position: self.floats("position", at).or(rest.position),
            direction: if aimed { direction } else { rest.direction },
            target: if aimed { target } else { rest.target },
            intensity: self.floats("intensity", at).map(Rgb).or(rest.intensity),
            irradiance: self.floats("irradiance", at).map(Rgb).or(rest.irradiance),
            cone: self.one("cone", at).map(|v| v as f32).or(rest.cone),
            cutoff: self.one("cutoff", at).map(|v| v as f32).or(rest.cutoff),
            ..rest.clone()
        }
    }

    /// Where keys put what otherwise is at `rest`.
    pub fn place(&self, rest: &Transform, at: f64) -> Transform {
        if let Some(placed) = self.find("transform", at).and_then(|rows| affine(&rows)) {
            return placed.into();
        }
        let translation = self.three("translate", at).map_or(rest.0.translation, DVec3::from);
        let [scale, rotation] = [self.find("scale", at), self.find("rotate", at)];
        if scale.is_none() && rotation.is_none() {
            return rest.moved_to(translation); // which may have shear
        }
        let (was, turned) = rest.steps().unwrap_or((DVec3::ONE, DQuat::IDENTITY));
        let scale = self.three("scale", at).map_or(was, DVec3::from);
        let rotation = rotation.map_or(turned, |q| DQuat::from_slice(&q));
        Transform::of_steps(scale, rotation, translation)
    }

    fn material(&self, at: f64) -> MaterialChange {
        MaterialChange {
            color: self.floats("color", at),
            specular: self.floats("specular", at),
            transmission: self.floats("transmission", at),
            emission: self.floats("emission", at),
            alpha: self.one("alpha", at).map(|v| v as f32),
            opacity: self.one("opacity", at).map(|v| v as f32),
        }
    }
}

impl Mover for Keyed {
    fn pose(&self, seconds: f64, pose: &mut Pose) -> Result<()> {
        match &self.target {
            Target::Camera(rest) => pose.camera = Some(self.camera(rest, seconds)),
            Target::Placement(number, rest) => pose.instances.push((*number, self.place(rest, seconds).0.into())),
            Target::Node => {}
            Target::Light(number, rest) => pose.lights.push((*number, self.light(rest, seconds))),
            Target::Material(number) => pose.materials.push((*number, self.material(seconds))),
            Target::Environment => {
                let (radiance, rotation) = (self.floats("radiance", seconds), self.one("rotation", seconds));
                pose.environment = Some(EnvironmentChange { radiance, rotation });
            }
        }
        Ok(())
    }

    fn end(&self) -> f64 {
        self.curves.iter().map(|(_, curve)| curve.end()).fold(0.0, f64::max)
    }

    fn moving(&self) -> Option<Range<f64>> {
        hull(self.curves.iter().filter_map(|(_, curve)| curve.moving()))
    }
}
