//! Light from infinitely far: a constant, or a latitude-longitude image.
//!
//! Orientation is that of Mitsuba 3's `envmap`: in environment space, for a unit direction d, `u = atan2(d.x, -d.z) /
//! (2 pi)` wrapped to [0, 1) and `v = acos(d.y) / pi`; so +y is up (row 0), column 0 begins at -z and u grows towards
//! +x. Texel centres lie at `(column + 0.5) / width` and `(row + 0.5) / height` (Mitsuba stretches rows so that the
//! first and last lie on the poles: half a texel apart at most).
use super::{Environment, alias};
use crate::error::{Error, Result};
use crate::image::{self, Picture};
use glam::DMat3;
use std::path::Path;

/// Luminance of linear Rec. 709.
pub fn luminance(c: [f32; 3]) -> f32 {
    0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]
}

/// Sine of the polar angle at the centre of a row: proportional to the solid angle of its texels.
fn row_sine(row: u32, height: u32) -> f64 {
    ((f64::from(row) + 0.5) / f64::from(height) * std::f64::consts::PI).sin()
}

/// Reads an image and builds its alias table. `None` for an image that is black throughout.
///
/// # Errors
/// [`Error::Input`] for a file that cannot be read or decoded, [`Error::Memory`].
pub fn load(path: &Path, warn: &mut Vec<String>) -> Result<Option<Environment>> {
    decode(path, &image::input::read(path)?, warn)
}

/// [`load`] from bytes; `path` is for messages.
///
/// # Errors
/// See [`load`].
pub fn decode(path: &Path, bytes: &[u8], warn: &mut Vec<String>) -> Result<Option<Environment>> {
    let unusable =
        |what| Error::input(path, format!("is no usable environment image ({what}): save it again as HDR or EXR"));
    image::check_room(path, bytes)?;
    let picture = image::decode(bytes).and_then(|film| film.picture(None)).map_err(unusable)?;
    from_picture(&path.display().to_string(), &picture, warn).map_err(unusable)
}

/// [`load`] of linear radiance; `name` is for warnings.
///
/// # Errors
/// A sentence, for a picture without pixels, or with others than its size says.
pub fn from_picture(
    name: &str,
    picture: &Picture,
    warn: &mut Vec<String>,
) -> std::result::Result<Option<Environment>, String> {
    let &Picture { width, height, ref pixels } = picture;
    if pixels.is_empty() || pixels.len() != width as usize * height as usize {
        return Err(format!("it has {} pixels for {width} x {height}", pixels.len()));
    }
    let mut repaired = 0usize;
    let texels = pixels.iter().map(|&p| sane(p, &mut repaired)).collect();
    if repaired > 0 {
        warn.push(format!("{name}: {repaired} NaN, infinite or negative channels set to 0"));
    }
    Ok(with_table(width, height, texels))
}

fn sane(rgb: [f32; 3], repaired: &mut usize) -> [f32; 4] {
    let [r, g, b] = rgb.map(|v| {
        let usable = v.is_finite() && v >= 0.0;
        *repaired += usize::from(!usable);
        if usable { v } else { 0.0 }
    });
    [r, g, b, 0.0]
}

/// Texels are drawn in proportion to the largest luminance among the 3 x 3 texels around them (columns wrap, rows
/// clamp), since radiance is looked up bilinearly and a dark texel beside the sun is not dark at its edge.
fn with_table(width: u32, height: u32, mut texels: Vec<[f32; 4]>) -> Option<Environment> {
    let at = |x: u32, y: u32| y as usize * width as usize + x as usize;
    let light: Vec<f32> = texels.iter().map(|t| luminance([t[0], t[1], t[2]])).collect();
    if light.iter().all(|&l| l == 0.0) {
        return None;
    }
    // The maximum over a square is the maximum over columns of the maxima over rows.
    let mut weights: Vec<f64> = Vec::with_capacity(light.len());
    for y in 0..height {
        let (above, below) = (y.saturating_sub(1), (y + 1).min(height - 1));
        let column = |x: u32| light[at(x, above)].max(light[at(x, y)]).max(light[at(x, below)]);
        let row = (0..width).map(|x| column((x + width - 1) % width).max(column(x)).max(column((x + 1) % width)));
        weights.extend(row.map(|l| f64::from(l) * row_sine(y, height)));
    }
    let table = alias::build(&weights);
    drop(weights);
    let probabilities = alias::probabilities(&table);
    texels.iter_mut().zip(probabilities).for_each(|(t, p)| t[3] = p as f32);
    Some(Environment { width, height, texels, table })
}

/// Mean luminance over the sphere.
pub fn mean_luminance(e: &Environment) -> f64 {
    let (mut sum, mut weight) = (0.0, 0.0);
    for (y, row) in e.texels.chunks(e.width as usize).enumerate() {
        let sine = row_sine(y as u32, e.height);
        sum += sine * row.iter().map(|t| f64::from(luminance([t[0], t[1], t[2]]))).sum::<f64>();
        weight += sine * row.len() as f64;
    }
    sum / weight
}

/// world_from_environment as a rotation matrix: nine row-major numbers, or degrees about +y (counter-clockwise seen from
/// above, Mitsuba's `rotate y`).
///
/// # Errors
/// When the nine numbers are no rotation.
pub fn rotation(degrees: f64, matrix: Option<[f64; 9]>) -> std::result::Result<DMat3, String> {
    let Some(rows) = matrix else { return Ok(DMat3::from_rotation_y(degrees.to_radians())) };
    let m = DMat3::from_cols_array(&rows).transpose();
    match (m * m.transpose()).abs_diff_eq(DMat3::IDENTITY, 1e-3) && m.is_finite() {
        true => Ok(m),
        false => Err("world_from_environment is no rotation (rows of length 1 at right angles)".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    fn grey(width: u32, height: u32, light: impl Fn(u32, u32) -> f32) -> Environment {
        let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let texels = texels.map(|(x, y)| [light(x, y), light(x, y), light(x, y), 0.0]).collect();
        with_table(width, height, texels).unwrap()
    }

    #[test]
    fn a_constant_image_is_drawn_by_solid_angle() {
        let e = grey(8, 4, |_, _| 2.0);
        let ratio = e.texels[8][3] / e.texels[0][3];
        assert!((f64::from(ratio) - row_sine(1, 4) / row_sine(0, 4)).abs() < 1e-5);
        assert!((mean_luminance(&e) - 2.0).abs() < 1e-6);
        assert!((e.texels.iter().map(|t| t[3]).sum::<f32>() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn the_neighbours_of_a_sun_are_drawn_too_across_the_seam() {
        let e = grey(8, 6, |x, y| if (x, y) == (0, 3) { 100.0 } else { 0.0 });
        let lit: Vec<_> = (0..48).filter(|&i| e.texels[i][3] > 0.0).map(|i| (i % 8, i / 8)).collect();
        assert_eq!(lit, [(0, 2), (1, 2), (7, 2), (0, 3), (1, 3), (7, 3), (0, 4), (1, 4), (7, 4)]);
    }

    #[test]
    fn rotations_are_checked_and_turn_as_stated() {
        let z = rotation(90.0, None).unwrap() * DVec3::X;
        assert!(z.abs_diff_eq(DVec3::NEG_Z, 1e-12), "{z}");
        assert!(rotation(0.0, Some([0.0; 9])).is_err());
        let cyclic = rotation(0.0, Some([0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0])).unwrap();
        assert_eq!(cyclic * DVec3::X, DVec3::Z);
    }

    #[test]
    fn damaged_and_black_images() {
        let mut warnings = Vec::new();
        let error = decode(Path::new("a.hdr"), b"#?RADIANCE\nnonsense", &mut warnings).unwrap_err().to_string();
        assert!(error.starts_with("a.hdr: is no usable environment image") && !error.contains('\n'), "{error}");
        assert!(with_table(2, 1, vec![[0.0; 4]; 2]).is_none());
        let mut repaired = 0;
        assert_eq!(sane([f32::NAN, -1.0, 2.0], &mut repaired), [0.0, 0.0, 2.0, 0.0]);
        assert_eq!(repaired, 2);
    }
}
