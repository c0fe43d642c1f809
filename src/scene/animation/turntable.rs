//! A camera that goes around what it looks at.
use super::Mover;
use crate::error::{Checked, Error, Result};
use crate::layout;
use crate::scene::Scene;
use crate::scene::description::Camera;
use crate::scene::pose::Pose;
use glam::{DQuat, DVec3, Vec3};
use std::ops::Range;

/// Turns the camera about its target, or about the point in the middle of its image that is nearest to the middle of the scene,
/// around its `up`: the whole of `degrees` over a span of seconds, at whose begin it is not turned yet, counter-clockwise seen from
/// above. Where others move the camera, it turns what they make of it: let it be the last mover.
#[derive(Clone, Debug)]
pub struct Turntable {
    camera: Camera,
    bounds: [[f32; 3]; 2],
    size: [u32; 2],
    degrees: f64,
    span: Range<f64>,
}

impl Turntable {
    /// Around a scene as it is now, for a film of (width, height) pixels.
    pub fn new(scene: &Scene, size: [u32; 2], degrees: f64, span: Range<f64>) -> Self {
        let bounds = scene.view.framed.unwrap_or(scene.bounds);
        let camera = Camera { framed: Some(swept(bounds)), ..scene.view.clone() };
        Self { camera, bounds, size, degrees, span }
    }

    /// What a camera without target looks at. One that has the scene behind it goes around the middle of that.
    fn pivot(&self, camera: &layout::Camera) -> DVec3 {
        let [low, high] = self.bounds.map(|b| DVec3::from(b.map(f64::from)));
        let [position, forward] = [camera.position, camera.forward].map(|v| Vec3::from(v).as_dvec3());
        let middle = (low + high) / 2.0;
        let depth = (middle - position).dot(forward);
        if depth > 0.0 { position + forward * depth } else { middle }
    }

    fn turned(&self, camera: &Camera, angle: f64) -> Checked<Camera> {
        let built = camera.build(self.size, self.bounds)?;
        let pivot = camera.target.map_or_else(|| self.pivot(&built), DVec3::from);
        let around = camera.up.and_then(|up| DVec3::from(up).try_normalize()).unwrap_or(DVec3::Y);
        let turn = DQuat::from_axis_angle(around, angle);
        let axis = |v: [f32; 3]| turn * Vec3::from(v).as_dvec3().normalize();
        let (x, y, z) = (axis(built.right), axis(built.up), -axis(built.forward));
        let p = pivot + turn * (Vec3::from(built.position).as_dvec3() - pivot);
        #[rustfmt::skip]
        let rows = [x.x, y.x, z.x, p.x, x.y, y.y, z.y, p.y, x.z, y.z, z.z, p.z, 0.0, 0.0, 0.0, 1.0];
        Ok(Camera { world_from_camera: Some(rows), focus_distance: Some(built.focus_distance), ..camera.clone() })
    }
}

/// What a box reaches that is turned about its middle, so that a camera which frames it has it in view from all sides.
fn swept([low, high]: [[f32; 3]; 2]) -> [[f32; 3]; 2] {
    let reach = ((high[0] - low[0]) / 2.0).hypot((high[2] - low[2]) / 2.0);
    let middle = [0, 2].map(|axis| (low[axis] + high[axis]) / 2.0);
    let end = |y: f32, sign: f32| [middle[0] + sign * reach, y, middle[1] + sign * reach];
    [end(low[1], -1.0), end(high[1], 1.0)]
}

impl Mover for Turntable {
    fn pose(&self, seconds: f64, pose: &mut Pose) -> Result<()> {
        let camera = pose.camera.as_ref().unwrap_or(&self.camera);
        let camera = &Camera { framed: camera.framed.or(self.camera.framed), ..camera.clone() };
        let Range { start, end } = self.span;
        let angle = (self.degrees * (seconds - start) / (end - start)).to_radians();
        let turned =
            self.turned(camera, angle).map_err(|what| Error::Usage(format!("the turntable's camera: {what}")))?;
        pose.camera = Some(turned);
        Ok(())
    }

    fn end(&self) -> f64 {
        self.span.end
    }

    fn moving(&self) -> Option<Range<f64>> {
        Some(f64::NEG_INFINITY..f64::INFINITY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_is_in_view_from_every_side() {
        let bounds = [[-4.0, 0.0, 2.0], [6.0, 1.0, 3.0]];
        let (size, scene) = ([100, 100], Scene { bounds, ..Scene::default() });
        let table = Turntable::new(&scene, size, 360.0, 0.0..8.0);
        let mut reach: f32 = 0.0;
        for second in 0..8 {
            let mut pose = Pose::default();
            table.pose(f64::from(second), &mut pose).unwrap();
            let camera = pose.camera.unwrap().build(size, bounds).unwrap();
            let [position, right, up, forward] =
                [camera.position, camera.right, camera.up, camera.forward].map(Vec3::from);
            for k in 0..8 {
                let off = Vec3::from([0, 1, 2].map(|axis| bounds[k >> axis & 1][axis])) - position;
                let film = [right, up].map(|axis| (off.dot(axis) / axis.length_squared() / off.dot(forward)).abs());
                reach = reach.max(film[0]).max(film[1]);
            }
        }
        // The corners of the box around the circle that is swept are 1.41 times as far as the circle, which leaves a third empty.
        assert!(reach > 0.6 && reach <= 1.0, "the farthest corner is at {reach} of the film");
    }

    #[test]
    fn a_matrix_turns_about_what_lies_before_it() {
        let (size, bounds) = ([100, 100], [[-6.0, -1.0, -1.0], [6.0, 1.0, 1.0]]);
        let half_a_turn = |z: f64| {
            let rows = [1.0, 0.0, 0.0, 5.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, z, 0.0, 0.0, 0.0, 1.0];
            let view = Camera { world_from_camera: Some(rows), ..Camera::default() };
            let scene = Scene { bounds, view, ..Scene::default() };
            let mut pose = Pose::default();
            Turntable::new(&scene, size, 180.0, 0.0..1.0).pose(1.0, &mut pose).unwrap();
            Vec3::from(pose.camera.unwrap().build(size, bounds).unwrap().position)
        };
        assert!(half_a_turn(6.0).distance(Vec3::new(5.0, 0.0, -6.0)) < 1e-5, "{}", half_a_turn(6.0));
        assert!(half_a_turn(-6.0).distance(Vec3::new(-5.0, 0.0, 6.0)) < 1e-5, "{}", half_a_turn(-6.0));
    }

    #[test]
    fn a_turn_is_the_same_whenever_it_begins() {
        let (size, bounds) = ([100, 100], [[-1.0; 3], [1.0; 3]]);
        let scene = Scene { bounds, ..Scene::default() };
        let position = |begin: f64, seconds: f64| {
            let mut pose = Pose::default();
            Turntable::new(&scene, size, 360.0, begin..begin + 4.0).pose(begin + seconds, &mut pose).unwrap();
            pose.camera.unwrap().build(size, bounds).unwrap().position
        };
        for seconds in [0.0, 1.0, 3.0] {
            assert_eq!(position(0.0, seconds), position(2.0, seconds), "after {seconds} s");
        }
        // A quarter of the turn in each of the four seconds, counter-clockwise seen from above: from +x by way of -z.
        let places = [0.0, 1.0, 2.0].map(|seconds| Vec3::from(position(2.0, seconds)));
        let quarter = |p: Vec3| Vec3::new(p.z, p.y, -p.x);
        for p in [quarter(places[0]).distance(places[1]), quarter(places[1]).distance(places[2])] {
            assert!(p < 1e-5, "{places:?}");
        }
        assert!(places[0].distance(places[1]) > 1.0, "control: {places:?}");
    }
}
