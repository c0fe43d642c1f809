//! From the `[camera]` table and the film's shape to the camera that kernels read.
use super::value::some_list;
use crate::error::Checked;
use crate::layout;
use crate::scene::MAX_COORDINATE;
use glam::{DMat4, DVec3};
use serde::Deserialize;

/// Which film edge the field of view spans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FovAxis {
    /// The height: `fov` is the vertical field of view.
    #[default]
    Y,
    /// The width: `fov` is the horizontal field of view.
    X,
    /// The shorter edge of the film.
    Smaller,
    /// The longer edge of the film.
    Larger,
}

/// The `[camera]` table. Positions and lengths in world units. Without `position` and `world_from_camera` the camera
/// looks at `target` (default: the middle of the scene) from where the whole scene is in view.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Camera {
    /// Point that rays start from.
    #[serde(deserialize_with = "some_list")]
    pub position: Option<[f64; 3]>,
    /// A point in the middle of the image.
    #[serde(deserialize_with = "some_list")]
    pub target: Option<[f64; 3]>,
    /// A direction that is up in the image; default +y.
    #[serde(deserialize_with = "some_list")]
    pub up: Option<[f64; 3]>,
    /// Row-major 4 x 4; the camera looks along -z, +x is right, +y is up. Scales and shear are
    /// dropped, a mirror is kept: the view keeps its axis, and up its plane with it.
    #[serde(deserialize_with = "some_list")]
    pub world_from_camera: Option<[f64; 16]>,
    /// Degrees along `fov_axis`, from 1e-6 and below 180; default 40.
    pub fov: Option<f64>,
    /// Edge of the film that `fov` spans; default the height.
    pub fov_axis: FovAxis,
    /// Length of that edge in world units, from 1e-12 to 1e12, in place of `fov`: rays are parallel, and what is far is as large as what is near.
    pub orthographic: Option<f64>,
    /// Radius of the lens; 0 (default) is a pinhole.
    pub lens_radius: f32,
    /// Distance along the view direction that is in focus; default the distance to `target`, or 1.
    pub focus_distance: Option<f32>,
    /// Nothing nearer than this along a ray is seen; default 0.
    pub near: f32,
    /// What a camera without position has in view; default the bounds of the scene. A scene that moves is framed as it was loaded,
    /// and by `tallow sequence` with all that its frames reach: a frame that followed its bounds would make the camera breathe.
    #[serde(skip)]
    pub framed: Option<[[f32; 3]; 2]>,
}

/// Position and orthonormal axes (right, up, forward).
type Frame = (DVec3, [DVec3; 3]);

/// Degrees; the axes of a narrower view are lost beside its direction.
const LEAST_FOV: f64 = 1e-6;
/// World units.
const LEAST_EDGE: f64 = 1e-12;
/// World units to a target, along the view direction: one that a matrix leaves beside or behind the camera is at none that has a focus.
const LEAST_FOCUS: f64 = 1e-12;

impl Camera {
    /// The device's camera for a film of (width, height) pixels; without a position it looks at a scene of these bounds.
    ///
    /// # Errors
    /// A sentence that names the key at fault.
    pub fn build(&self, size: [u32; 2], bounds: [[f32; 3]; 2]) -> Checked<layout::Camera> {
        let (half_x, half_y) = self.half_film(size)?;
        let (position, [right, up, forward]) = match &self.world_from_camera {
            Some(rows) => frame_from_matrix(rows)?,
            // An orthographic camera sees the same from any distance: from there, a film of 40 degrees would show all.
            None if self.orthographic.is_some() => self.frame_from_target(bounds, [20f64.to_radians().tan(); 2])?,
            None => self.frame_from_target(bounds, [half_x, half_y])?,
        };
        finite(position)?;
        let positive = |name: &str, v: f32| match v {
            v if (0.0..=MAX_COORDINATE as f32).contains(&v) => Ok(v),
            v => Err(format!("{name} is {v}: choose 0 or a positive number of at most {:e}", MAX_COORDINATE)),
        };
        let to_target = self.target.map_or(1.0, |t| (DVec3::from(t) - position).dot(forward).max(LEAST_FOCUS));
        let focus_distance = self.focus_distance.unwrap_or(to_target as f32);
        if !(focus_distance > 0.0 && focus_distance <= MAX_COORDINATE as f32) {
            return Err(format!(
                "focus_distance is {focus_distance}: choose a number above 0 and up to {MAX_COORDINATE:e}"
            ));
        }
        Ok(layout::Camera {
            position: position.as_vec3().to_array(),
            lens_radius: positive("lens_radius", self.lens_radius)?,
            right: (right * half_x).as_vec3().to_array(),
            focus_distance,
            up: (up * half_y).as_vec3().to_array(),
            near: positive("near", self.near)?,
            forward: forward.as_vec3().to_array(),
            orthographic: self.orthographic.is_some().into(),
            ..Default::default()
        })
    }

    /// Whether where it stands or looks depends on what the scene reaches.
    pub fn frames_scene(&self) -> bool {
        let stands = self.position.is_some() && self.target.is_some();
        self.world_from_camera.is_none() && self.framed.is_none() && !stands
    }

    /// Half of the film's width and height: at distance 1, or anywhere if rays are parallel.
    fn half_film(&self, [width, height]: [u32; 2]) -> Checked<(f64, f64)> {
        let half = self.half_edge()?;
        if width == 0 || height == 0 {
            return Err(format!("a film of {width}x{height} has no pixel"));
        }
        let aspect = f64::from(width) / f64::from(height);
        let along_x = match self.fov_axis {
            FovAxis::X => true,
            FovAxis::Y => false,
            FovAxis::Smaller => aspect < 1.0,
            FovAxis::Larger => aspect > 1.0,
        };
        Ok(if along_x { (half, half / aspect) } else { (half * aspect, half) })
    }

    fn half_edge(&self) -> Checked<f64> {
        let fov = self.fov.unwrap_or(40.0);
        match self.orthographic {
            Some(_) if self.fov.is_some() => Err("has both fov and orthographic: choose one".into()),
            Some(edge) if (LEAST_EDGE..=MAX_COORDINATE).contains(&edge) => Ok(edge / 2.0),
            Some(edge) => {
                Err(format!("orthographic is {edge:?}: choose a length from {LEAST_EDGE:e} to {MAX_COORDINATE:e}"))
            }
            None if (LEAST_FOV..180.0).contains(&fov) => Ok((fov.to_radians() / 2.0).tan()),
            None => Err(format!("fov is {fov:?}: choose degrees from {LEAST_FOV:e}, below 180")),
        }
    }

    fn frame_from_target(&self, bounds: [[f32; 3]; 2], tan: [f64; 2]) -> Checked<Frame> {
        let [low, high] = self.framed.unwrap_or(bounds).map(|b| DVec3::from(b.map(f64::from)));
        let target = self.target.map_or((low + high) / 2.0, DVec3::from);
        let position = self.position.map_or_else(|| overview(target, low, high, tan), DVec3::from);
        let up = self.up.map_or(DVec3::Y, DVec3::from);
        finite(position).and(finite(target))?;
        let forward = (target - position).try_normalize().ok_or("position and target are the same point")?;
        // A camera that looks straight along `up` still needs a right: any one will do when nothing was said.
        let side = forward.cross(up).try_normalize();
        let right = match (side.filter(|_| forward.cross(up.normalize_or_zero()).length() > 1e-9), self.up) {
            (Some(right), _) => right,
            (None, None) => forward.cross(DVec3::NEG_Z * forward.y.signum()).normalize(),
            (None, Some(_)) => return Err("up is parallel to the view direction: choose another".into()),
        };
        Ok((position, [right, right.cross(forward), forward]))
    }
}

/// A point above and to the side from which the bounds fill a film of these half edges at distance 1, but for a margin.
fn overview(target: DVec3, low: DVec3, high: DVec3, tan: [f64; 2]) -> DVec3 {
    const MARGIN: f64 = 1.05;
    let back = DVec3::new(0.45, 0.35, 1.0).normalize();
    let right = DVec3::Y.cross(back).normalize();
    let up = back.cross(right);
    // The corner at `off` from the target is on the film's edge when seen from so far.
    let distance = |off: DVec3| {
        let across = (off.dot(right).abs() / tan[0]).max(off.dot(up).abs() / tan[1]);
        off.dot(back) + MARGIN * across
    };
    let corner = |k: u32| DVec3::from([0, 1, 2].map(|axis| if k >> axis & 1 == 0 { low[axis] } else { high[axis] }));
    let extent = (high - low).length();
    // Where nothing has an extent, any distance will do.
    let least = if extent > 0.0 { extent / 2.0 } else { 1e-6 };
    target + back * (0..8).map(|k| distance(corner(k) - target)).fold(least, f64::max)
}

fn frame_from_matrix(rows: &[f64; 16]) -> Checked<Frame> {
    let refused = || "world_from_camera is not an invertible row-major affine matrix (last row 0 0 0 1)".to_owned();
    let m = DMat4::from_cols_array(rows).transpose();
    if !m.is_finite() || m.row(3).truncate() != DVec3::ZERO || m.w_axis.w == 0.0 {
        return Err(refused());
    }
    let position = m.w_axis.truncate() / m.w_axis.w;
    finite(position)?;
    Ok((position, axes(&m).ok_or_else(refused)?))
}

/// Right, up and forward; `None` where they are no three directions. Uneven scales of a node's parents bring shear.
fn axes(m: &DMat4) -> Option<[DVec3; 3]> {
    let axis = |i: usize, across: &[DVec3]| {
        let column = m.col(i).truncate().try_normalize()?;
        let rest = across.iter().fold(column, |v, other| v.reject_from_normalized(*other));
        rest.try_normalize().filter(|_| rest.length() > 1e-9) // less is rounding
    };
    let back = axis(2, &[])?;
    let up = axis(1, &[back])?;
    Some([axis(0, &[back, up])?, up, -back])
}

fn finite(position: DVec3) -> Checked {
    match position.is_finite() && position.abs().max_element() <= MAX_COORDINATE {
        true => Ok(()),
        false => Err(format!("point {position} is not within {:e}", MAX_COORDINATE)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_film_without_pixels_is_refused() {
        let refused = |size| Camera::default().build(size, Default::default()).unwrap_err();
        assert_eq!([[0, 8], [8, 0]].map(refused), ["a film of 0x8 has no pixel", "a film of 8x0 has no pixel"]);
    }

    #[test]
    fn looks_at_its_target_with_a_vertical_fov() {
        let camera =
            Camera { position: Some([0.0, 0.0, 5.0]), target: Some([0.0; 3]), fov: Some(90.0), ..Camera::default() };
        let found = camera.build([200, 100], [[0.0; 3]; 2]).unwrap();
        assert_eq!(found.forward, [0.0, 0.0, -1.0]);
        assert!((found.right[0] - 2.0).abs() < 1e-6 && (found.up[1] - 1.0).abs() < 1e-6);
        assert_eq!(found.focus_distance, 5.0);
    }

    #[test]
    fn the_field_of_view_spans_the_edge_that_is_named() {
        use FovAxis::{Larger, Smaller, X, Y};
        let (across, down) = ([X, Larger, X, Smaller], [Y, Smaller, Y, Larger]);
        for (k, size, along) in [(0, [200, 100], 2.0), (2, [100, 200], 0.5)] {
            let half = |fov_axis| Camera { fov_axis, fov: Some(90.0), ..Camera::default() }.half_film(size).unwrap();
            let near = |(x, y): (f64, f64), of: [f64; 2]| (x - of[0]).abs() + (y - of[1]).abs() < 1e-12;
            assert!(across[k..k + 2].iter().all(|&axis| near(half(axis), [1.0, 1.0 / along])), "{size:?}");
            assert!(down[k..k + 2].iter().all(|&axis| near(half(axis), [along, 1.0])), "{size:?}");
        }
    }

    #[test]
    fn an_orthographic_film_has_edges_in_world_units() {
        let camera = Camera {
            position: Some([0.0, 0.0, 5.0]),
            target: Some([0.0; 3]),
            orthographic: Some(3.0),
            ..Camera::default()
        };
        let found = camera.build([200, 100], [[0.0; 3]; 2]).unwrap();
        assert_eq!((found.orthographic, found.right, found.up), (1, [3.0, 0.0, 0.0], [0.0, 1.5, 0.0]));
        let both = Camera { fov: Some(40.0), ..camera.clone() };
        assert!(both.build([8, 8], [[0.0; 3]; 2]).unwrap_err().contains("choose one"));
        for edge in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            let wrong = Camera { orthographic: Some(edge), ..camera.clone() };
            assert!(wrong.build([8, 8], [[0.0; 3]; 2]).unwrap_err().contains("orthographic is"));
        }
    }

    #[test]
    fn a_matrix_may_mirror() {
        #[rustfmt::skip]
        let rows = [-2.0, 0.0, 0.0, 1.0,  0.0, 1.0, 0.0, 2.0,  0.0, 0.0, 1.0, 3.0,  0.0, 0.0, 0.0, 1.0];
        let camera = Camera { world_from_camera: Some(rows), fov: Some(90.0), ..Camera::default() };
        let found = camera.build([64, 64], [[0.0; 3]; 2]).unwrap();
        assert_eq!(found.position, [1.0, 2.0, 3.0]);
        assert!((found.right[0] + 1.0).abs() < 1e-6, "the mirrored right axis points along -x");
        assert_eq!(found.forward, [0.0, 0.0, -1.0]);
    }

    #[test]
    fn a_camera_without_position_has_all_in_view_and_fills_the_film() {
        for (size, high) in [
            ([200, 100], [1.0, 1.0, 9.0]),
            ([100, 200], [5.0, 1.0, 1.0]),
            ([64, 64], [1.0, 1.0, 1.0]),
            ([64, 64], [1e-8, 1e-8, 1e-8]),
            ([64, 64], [1e8, 1e8, 1e8]),
        ] {
            let bounds = [[-high[0], -high[1], -high[2]], high];
            let found = Camera::default().build(size, bounds).unwrap();
            let [position, right, up, forward] =
                [found.position, found.right, found.up, found.forward].map(|v| glam::Vec3::from(v).as_dvec3());
            let mut reach: f64 = 0.0;
            for k in 0..8 {
                let corner = DVec3::from([0, 1, 2].map(|axis| f64::from(bounds[k >> axis & 1][axis])));
                let off = corner - position;
                let depth = off.dot(forward);
                let film = [right, up].map(|axis| (off.dot(axis) / axis.length_squared() / depth).abs());
                assert!(depth > 0.0 && film[0].max(film[1]) <= 1.0, "{size:?} {high:?}: {film:?}");
                reach = reach.max(film[0]).max(film[1]);
            }
            assert!(reach > 0.85, "{size:?} {high:?}: the scene reaches {reach} of the way to the edge");
        }
    }

    /// The axis of view stays, then the plane that it spans with up. `mirror` is that of +x.
    #[test]
    fn a_sheared_matrix_gives_axes_at_right_angles() {
        for mirror in [1.0, -1.0] {
            let rows = [2.0 * mirror, 0.5, 0.3, 1.0, 0.2, 3.0, -0.4, 2.0, 0.7, 0.6, 0.5, 3.0, 0.0, 0.0, 0.0, 1.0];
            let camera = Camera { world_from_camera: Some(rows), fov: Some(90.0), ..Camera::default() };
            let found = camera.build([8, 8], [[0.0; 3]; 2]).unwrap();
            let [right, up, forward] = [found.right, found.up, found.forward].map(glam::Vec3::from);
            let back = glam::Vec3::new(0.3, -0.4, 0.5).normalize();
            assert!((forward + back).length() < 1e-6, "{forward}");
            assert!(up.dot(back.cross(glam::Vec3::new(0.5, 3.0, 0.6))).abs() < 1e-6 && up.y > 0.0, "{up}");
            assert!((right - mirror as f32 * up.cross(back)).length() < 1e-6, "{right}");
            assert!(up.dot(forward).abs() < 1e-6 && (up.length() - 1.0).abs() < 1e-6, "{up}");
        }
    }

    #[test]
    fn bad_cameras_are_named() {
        let build = |c: Camera| c.build([8, 8], [[0.0; 3], [1.0; 3]]);
        assert!(build(Camera::default()).is_ok());
        for fov in [180.0, 0.0, 1e-60, f64::NAN] {
            assert!(build(Camera { fov: Some(fov), ..Camera::default() }).unwrap_err().contains("fov is"));
        }
        for edge in [0.0, 1e-60, 1e13] {
            assert!(
                build(Camera { orthographic: Some(edge), ..Camera::default() }).unwrap_err().contains("orthographic")
            );
        }
        assert!(build(Camera { near: f32::NAN, ..Camera::default() }).unwrap_err().contains("near"));
        let flat = Camera { world_from_camera: Some([0.0; 16]), ..Camera::default() };
        assert!(build(flat).unwrap_err().contains("world_from_camera"));
        let along_up = Camera { position: Some([0.5, 9.0, 0.5]), ..Camera::default() };
        assert!(build(along_up).is_ok(), "looking straight down needs no `up`");
        let nowhere = [[f64::NAN, 0.0, 0.0], [0.0, f64::NAN, 0.0], [0.0, 0.0, f64::NAN], [f64::INFINITY; 3]];
        for point in nowhere.map(Some) {
            assert!(build(Camera { position: point, ..Camera::default() }).unwrap_err().contains("is not within"));
            assert!(build(Camera { target: point, ..Camera::default() }).unwrap_err().contains("is not within"));
        }
    }
}
