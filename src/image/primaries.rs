//! Colours of other primaries than Rec. 709's: what an EXR file says its red, green, blue and white are.
use exr::meta::attribute::Chromaticities;
use exr::prelude::Vec2;
use glam::{DMat3, DVec3};

/// Chromaticities x, y of red, green, blue and white.
pub type Primaries = [[f32; 2]; 4];

/// Those of ITU-R BT.709, which are sRGB's.
pub(crate) const REC709: Primaries = [[0.64, 0.33], [0.3, 0.6], [0.15, 0.06], [0.3127, 0.329]];

/// Chromaticities closer than this are the same: files round them.
const ALIKE: f32 = 2e-3;

/// Brings colours of these primaries to Rec. 709. White becomes white. What Rec. 709 cannot show is
/// cut at 0.
pub fn to_rec709(primaries: &Primaries, colours: &mut [[f32; 3]]) {
    let Some(matrix) = matrix(primaries) else { return };
    for colour in colours {
        let rgb = DVec3::from(colour.map(f64::from));
        // A comparison with NaN is false, which stays what it was.
        *colour = (matrix * rgb).to_array().map(|v| if v < 0.0 { 0.0 } else { v as f32 });
    }
}

/// As EXR files name them.
pub(super) fn from_exr(named: Chromaticities) -> Primaries {
    [named.red, named.green, named.blue, named.white].map(|Vec2(x, y)| [x, y])
}

/// As EXR files name them.
pub(super) fn to_exr(primaries: Primaries) -> Chromaticities {
    let [red, green, blue, white] = primaries.map(|[x, y]| Vec2(x, y));
    Chromaticities { red, green, blue, white }
}

/// Whether they are those of Rec. 709, to the digits that files have.
pub fn is_rec709(primaries: &Primaries) -> bool {
    let pairs = primaries.as_flattened().iter().zip(REC709.as_flattened());
    pairs.into_iter().all(|(a, b)| (a - b).abs() < ALIKE)
}

/// From linear colours of some primaries to those of Rec. 709; none where three of them span nothing.
fn matrix(primaries: &Primaries) -> Option<DMat3> {
    // Cone responses of Lam's (1985) "Bradford" transform, in which white points are scaled to each other.
    let bradford = DMat3::from_cols_array(&[0.8951, -0.7502, 0.0389, 0.2664, 1.7135, -0.0685, -0.1614, 0.0367, 1.0296]);
    let [from, to] = [primaries, &REC709].map(|p| bradford * xyz(p[3]));
    let adapted = bradford.inverse() * DMat3::from_diagonal(to / from) * bradford;
    let matrix = xyz_from_rgb(&REC709).inverse() * adapted * xyz_from_rgb(primaries);
    matrix.is_finite().then_some(matrix)
}

/// The columns are the primaries, as bright as makes their sum the white of luminance 1.
fn xyz_from_rgb(primaries: &Primaries) -> DMat3 {
    let [red, green, blue, white] = primaries.map(xyz);
    let columns = DMat3::from_cols(red, green, blue);
    columns * DMat3::from_diagonal(columns.inverse() * white)
}

/// Of luminance 1.
fn xyz(chromaticity: [f32; 2]) -> DVec3 {
    let [x, y] = chromaticity.map(f64::from);
    DVec3::new(x / y, 1.0, (1.0 - x - y) / y)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use exr::image::write::WritableImage;
    use exr::prelude::{Image, SpecificChannels};
    use std::io::Cursor;

    /// Those of ACEScg (Academy S-2014-004).
    pub const AP1: Primaries = [[0.713, 0.293], [0.165, 0.83], [0.128, 0.044], [0.32168, 0.33767]];

    pub fn file(primaries: Option<Primaries>, pixel: [f32; 3]) -> Vec<u8> {
        let channels = SpecificChannels::rgb(|_: Vec2<usize>| (pixel[0], pixel[1], pixel[2]));
        let mut image = Image::from_channels((2, 1), channels);
        image.attributes.chromaticities = primaries.map(to_exr);
        let mut bytes = Cursor::new(Vec::new());
        image.write().to_buffered(&mut bytes).unwrap();
        bytes.into_inner()
    }

    fn read(primaries: Option<Primaries>, pixel: [f32; 3]) -> [f32; 3] {
        let picture = super::super::decode(&file(primaries, pixel)).unwrap().rec709(None).unwrap();
        assert_eq!(picture.pixels[0].map(f32::to_bits), picture.pixels[1].map(f32::to_bits));
        picture.pixels[0]
    }

    /// The matrix of OpenColorIO's ACES configuration 1.2 (`ACEScg` to `Utility - Linear - sRGB`) to five digits.
    #[test]
    fn acescg_becomes_rec_709() {
        let expected = [[1.70505, -0.62179, -0.08326], [-0.13026, 1.14080, -0.01055], [-0.02400, -0.12897, 1.15297]];
        let found = matrix(&AP1).unwrap().transpose().to_cols_array_2d();
        for (found, expected) in found.as_flattened().iter().zip(expected.as_flattened()) {
            assert!((found - expected).abs() < 2e-5, "{found} {expected}");
        }
        let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-4);
        assert!(near(read(Some(AP1), [0.5, 0.25, 0.125]), [0.68667, 0.21876, 0.09988]));
        assert!(near(read(Some(AP1), [7.0; 3]), [7.0; 3]), "white stays");
        assert!(near(read(Some(AP1), [0.0, 1.0, 0.0]), [0.0, 1.14080, 0.0]), "cut at 0");
    }

    #[test]
    fn what_names_none_or_rec_709_or_nonsense_is_as_it_was() {
        let rounded = REC709.map(|xy| xy.map(|v| v + 1e-3));
        for primaries in [None, Some(REC709), Some(rounded), Some([[0.0; 2]; 4]), Some([[0.3; 2]; 4])] {
            assert_eq!(read(primaries, [0.5, -0.25, 4.0]), [0.5, -0.25, 4.0], "{primaries:?}");
        }
        assert!(read(Some(AP1), [f32::NAN, 0.0, 0.0])[0].is_nan());
    }
}
