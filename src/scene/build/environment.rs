//! Builds the light from infinitely far: a constant, or a latitude-longitude image.
//!
//! Orientation is that of Mitsuba 3's `envmap`: in environment space, for a unit direction d, `u = atan2(d.x, -d.z) /
//! (2 pi)` wrapped to [0, 1) and `v = acos(d.y) / pi`; so +y is up (row 0), column 0 begins at -z and u grows towards
//! +x. Texel centres lie at `(column + 0.5) / width` and `(row + 0.5) / height` (Mitsuba stretches rows so that the
//! first and last lie on the poles: half a texel apart at most).
use super::alias;
use super::sources::Sources;
use crate::error::{Checked, Error, Result};
use crate::image::Picture;
use crate::layout::{LIGHT_ENVIRONMENT, Light, NONE};
use crate::math::srgb::luminance;
use crate::scene::description::EnvironmentTable;
use crate::scene::load::environment::{load, unusable};
use crate::scene::{Environment, MAX_RADIANCE, Scene};
use glam::DMat3;

/// Adds the lights without surface and the environment, with its image.
///
/// # Errors
/// [`Error::Input`] for a table at fault and an image that cannot be read, [`Error::Memory`].
pub fn add_lights(sources: &mut Sources, scene: &mut Scene) -> Result<()> {
    for (i, table) in sources.description.light.iter().enumerate() {
        let light = table.build().map_err(|what| sources.at(format!("light {}", i + 1), what))?;
        scene.lights.push(light);
        sources.library.warnings.extend(table.warning(i + 1));
    }
    let Some(table) = &sources.description.environment else { return Ok(()) };
    let at = |what| Error::input_at(sources.path, PLACE, what);
    let scale = table.scale.map_or([1.0; 3], |s| s.0);
    let constant = table.radiance.map_or([1.0; 3], |r| r.0);
    let radiance: [f32; 3] = std::array::from_fn(|c| scale[c] * constant[c]);
    if !radiance.iter().all(|v| (0.0..=MAX_RADIANCE).contains(v)) || !table.rotation.is_finite() {
        return Err(at(format!("radiance times scale must lie from 0 to {MAX_RADIANCE:e}, rotation be finite")));
    }
    if table.rotation != 0.0 && table.world_from_environment.is_some() {
        return Err(at("has both rotation and world_from_environment: choose one".to_owned()));
    }
    let rotation = rotation(table.rotation, table.world_from_environment).map_err(at)?;
    let light = light(radiance, rotation);
    if table.file.is_none() && table.picture.is_none() {
        scene.lights.push(light);
        return Ok(());
    }
    let brightest = MAX_RADIANCE / radiance.into_iter().fold(1.0, f32::max);
    scene.environment = image_of(sources, table, brightest)?;
    scene.lights.extend(scene.environment.is_some().then_some(light));
    Ok(())
}

/// Place of the environment in error messages.
const PLACE: &str = "[environment]";

/// The environment's light; `radiance` is its constant, or what its image is multiplied by.
pub fn light(radiance: [f32; 3], world_from_environment: DMat3) -> Light {
    // Rows of the inverse of a rotation are its columns.
    let [a, b, c] = [0, 1, 2].map(|i| world_from_environment.col(i).as_vec3().to_array());
    Light { kind: LIGHT_ENVIRONMENT, a, b, c, triangle: NONE, value: radiance, material: NONE, ..Light::default() }
}

/// `brightest`: radiance that texels are clamped to.
fn image_of(sources: &mut Sources, table: &EnvironmentTable, brightest: f32) -> Result<Option<Environment>> {
    let at = |what: String| Error::input_at(sources.path, PLACE, what);
    let file = table.file.as_ref().map(|file| sources.beside(file));
    let warnings = &mut sources.library.warnings;
    match (file, &table.picture) {
        _ if table.radiance.is_some() => Err(at("has both radiance and an image: choose one".to_owned())),
        (Some(_), Some(_)) => Err(at("has both file and picture: choose one".to_owned())),
        _ if table.file.as_ref().is_some_and(|file| file.as_os_str().is_empty()) => {
            Err(at("its file has an empty name".to_owned()))
        }
        (Some(path), None) => {
            let picture = load(&path)?;
            from_picture(&path.display().to_string(), &picture, brightest, warnings)
                .map_err(|what| unusable(&path, &what))
        }
        (None, Some(picture)) => from_picture(PLACE, picture, brightest, warnings)
            .map_err(|what| at(format!("its picture is unusable: {what}"))),
        (None, None) => Ok(None),
    }
}

/// Sine of the polar angle at the centre of a row: proportional to the solid angle of its texels.
fn row_sine(row: u32, height: u32) -> f64 {
    ((f64::from(row) + 0.5) / f64::from(height) * std::f64::consts::PI).sin()
}

/// An image of linear radiance with its alias table; `None` for one that is black throughout. Channels are clamped to
/// `brightest`; `name` is for warnings.
///
/// # Errors
/// A sentence, for a picture without pixels, or with others than its size says.
pub fn from_picture(
    name: &str,
    picture: &Picture,
    brightest: f32,
    warn: &mut Vec<String>,
) -> Checked<Option<Environment>> {
    let &Picture { width, height, ref pixels } = picture;
    if pixels.is_empty() || pixels.len() != width as usize * height as usize {
        return Err(format!("it has {} pixels for {width} x {height}", pixels.len()));
    }
    let [mut repaired, mut clamped] = [0usize; 2];
    let texels = pixels.iter().map(|&p| sane(p, brightest, [&mut repaired, &mut clamped])).collect();
    if repaired > 0 {
        warn.push(format!("{name}: {repaired} NaN, infinite or negative channels set to 0"));
    }
    if clamped > 0 {
        warn.push(format!(
            "{name}: {clamped} channels are above {brightest:e}, the brightest that can be rendered: clamped"
        ));
    }
    Ok(with_table(width, height, texels))
}

fn sane(rgb: [f32; 3], brightest: f32, [repaired, clamped]: [&mut usize; 2]) -> [f32; 4] {
    let [r, g, b] = rgb.map(|v| {
        let usable = v.is_finite() && v >= 0.0;
        *repaired += usize::from(!usable);
        *clamped += usize::from(usable && v > brightest);
        if usable { v.min(brightest) } else { 0.0 }
    });
    [r, g, b, 0.0]
}

/// Texels are drawn in proportion to their luminance and solid angle.
fn with_table(width: u32, height: u32, mut texels: Vec<[f32; 4]>) -> Option<Environment> {
    let mut weights: Vec<f64> = Vec::with_capacity(texels.len());
    for (y, row) in (0..height).zip(texels.chunks(width as usize)) {
        let sine = row_sine(y, height);
        weights.extend(row.iter().map(|t| f64::from(luminance([t[0], t[1], t[2]])) * sine));
    }
    if weights.iter().all(|&w| w == 0.0) {
        return None;
    }
    let table = alias::build(&weights);
    drop(weights);
    let probabilities = alias::probabilities(&table);
    texels.iter_mut().zip(probabilities).for_each(|(t, p)| t[3] = p as f32);
    Some(Environment { width, height, texels, table })
}

/// Mean luminance over the sphere.
pub fn mean_luminance(e: &Environment) -> f64 {
    mean(e, |luminance| luminance)
}

/// Share of the light that is what the luminance has above `level`.
pub fn share_above(e: &Environment, level: f64) -> f64 {
    mean(e, |luminance| (luminance - level).max(0.0)) / mean_luminance(e)
}

/// Mean over the sphere of a function of the luminance.
fn mean(e: &Environment, of: impl Fn(f64) -> f64) -> f64 {
    let (mut sum, mut weight) = (0.0, 0.0);
    for (y, row) in e.texels.chunks(e.width as usize).enumerate() {
        let sine = row_sine(y as u32, e.height);
        sum += sine * row.iter().map(|t| of(f64::from(luminance([t[0], t[1], t[2]])))).sum::<f64>();
        weight += sine * row.len() as f64;
    }
    sum / weight
}

/// world_from_environment as a rotation matrix: nine row-major numbers, or degrees about +y (counter-clockwise seen from
/// above, Mitsuba's `rotate y`).
///
/// # Errors
/// When the nine numbers are no rotation.
pub fn rotation(degrees: f64, matrix: Option<[f64; 9]>) -> Checked<DMat3> {
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

    /// The sines of 22.5 and 67.5 degrees are to each other as sqrt 2 - 1 to 1.
    #[test]
    fn the_mean_counts_rows_by_solid_angle() {
        let e = grey(2, 4, |_, y| [1.0, 3.0, 3.0, 1.0][y as usize]);
        assert!((mean_luminance(&e) - (1.0 + 2f64.sqrt())).abs() < 1e-6, "{}", mean_luminance(&e));
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
    fn black_images_are_none_and_damaged_pixels_are_mended() {
        assert!(with_table(2, 1, vec![[0.0; 4]; 2]).is_none());
        let [mut repaired, mut clamped] = [0; 2];
        assert_eq!(sane([f32::NAN, -1.0, 2.0], 2.0, [&mut repaired, &mut clamped]), [0.0, 0.0, 2.0, 0.0]);
        assert_eq!(sane([f32::INFINITY, 3e38, 1.0], 2.0, [&mut repaired, &mut clamped]), [0.0, 2.0, 1.0, 0.0]);
        assert_eq!((repaired, clamped), (3, 1));
    }
}
