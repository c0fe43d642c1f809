//! Values that a scene file may write in more than one way.
use crate::error::Checked;
use glam::{DAffine3, DMat4, DQuat, DVec3, EulerRot};
use serde::de::{Deserialize, Deserializer, Error, Expected, MapAccess, SeqAccess, Unexpected, Visitor, value};
use std::fmt;
use std::marker::PhantomData;

/// Three channels, written as `[r, g, b]` or as one number for all of them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rgb(pub [f32; 3]);

impl<'de> Deserialize<'de> for Rgb {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        one_or_three(deserializer, "a number or [r, g, b]").map(Self)
    }
}

/// Three numbers, or one in place of all, which is what is `expected`.
fn one_or_three<'de, D: Deserializer<'de>>(deserializer: D, expected: &'static str) -> Result<[f32; 3], D::Error> {
    struct OneOrThree(&'static str);
    impl<'de> Visitor<'de> for OneOrThree {
        type Value = [f32; 3];
        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            f.write_str(self.0)
        }
        fn visit_f64<E: Error>(self, v: f64) -> Result<[f32; 3], E> {
            Ok([v as f32; 3])
        }
        fn visit_i64<E: Error>(self, v: i64) -> Result<[f32; 3], E> {
            Ok([v as f32; 3])
        }
        fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<[f32; 3], A::Error> {
            numbers(seq, other(&self), &self)
        }
    }
    deserializer.deserialize_any(OneOrThree(expected))
}

/// Values in order: a fixed count, or an error that says what is expected and how many were given. Serde's arrays leave those unread that
/// are too many. `wrong` is the error where one of them is of another type.
pub fn numbers<'de, const N: usize, T: Deserialize<'de>, A: SeqAccess<'de>>(
    mut seq: A,
    wrong: impl Fn(A::Error) -> A::Error,
    expected: &dyn Expected,
) -> Result<[T; N], A::Error> {
    let mut found = Vec::with_capacity(N);
    while let Some(v) = seq.next_element().map_err(&wrong)? {
        found.push(v);
    }
    let count = found.len();
    found.try_into().map_err(|_| A::Error::invalid_length(count, expected))
}

/// An error of a list in which something other than numbers stands.
fn other<E: Error>(expected: &dyn Expected) -> impl Fn(E) -> E {
    move |_| E::invalid_type(Unexpected::Other("a list of something else"), expected)
}

/// A list of as many values as there are places, for `deserialize_with`.
pub fn list<'de, D: Deserializer<'de>, T: Deserialize<'de>, const N: usize>(
    deserializer: D,
) -> Result<[T; N], D::Error> {
    struct List<T, const N: usize>(PhantomData<T>);
    impl<'de, T: Deserialize<'de>, const N: usize> Visitor<'de> for List<T, N> {
        type Value = [T; N];
        fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
            write!(f, "an array of length {N}")
        }
        fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<[T; N], A::Error> {
            numbers(seq, |e| e, &self)
        }
    }
    deserializer.deserialize_seq(List(PhantomData))
}

/// The same of a key that may be absent.
pub fn some_list<'de, D: Deserializer<'de>, T: Deserialize<'de>, const N: usize>(
    deserializer: D,
) -> Result<Option<[T; N]>, D::Error> {
    list(deserializer).map(Some)
}

/// `{ translate, rotate, scale }`: scaled first, then rotated, then moved.
#[derive(Clone, Debug, Default, serde::Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Steps {
    #[serde(deserialize_with = "list")]
    translate: [f64; 3],
    rotate: Rotation,
    scale: Option<Scale>,
}

/// Degrees: `[x, y, z]` turns about x, then y, then z (fixed axes); `[x, y, z, angle]` turns about that axis.
#[derive(Clone, Debug, Default)]
struct Rotation(DQuat);

impl<'de> Deserialize<'de> for Rotation {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let what = "rotate takes 3 angles in degrees, such as [0, 90, 0], or axis and angle, such as [0, 1, 0, 90]";
        let numbers = Vec::<f64>::deserialize(deserializer).map_err(|_| D::Error::custom(what))?;
        rotation(&numbers).map(Self).map_err(D::Error::custom)
    }
}

/// The rotation of three angles in degrees, or of an axis and an angle.
///
/// # Errors
/// A sentence about other numbers.
pub fn rotation(v: &[f64]) -> Checked<DQuat> {
    match *v {
        [x, y, z] => {
            let [x, y, z] = [x, y, z].map(f64::to_radians);
            Ok(DQuat::from_euler(EulerRot::ZYX, z, y, x))
        }
        [x, y, z, angle] => match DVec3::new(x, y, z).try_normalize() {
            Some(axis) => Ok(DQuat::from_axis_angle(axis, angle.to_radians())),
            None => Err("the axis of rotate is zero".to_owned()),
        },
        _ => Err(format!("rotate takes 3 angles or axis and angle, not {} numbers", v.len())),
    }
}

/// One factor, or one per axis.
#[derive(Clone, Debug)]
struct Scale(DVec3);

impl<'de> Deserialize<'de> for Scale {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        one_or_three(deserializer, "a number or [x, y, z]").map(|v| Self(DVec3::from(v.map(f64::from))))
    }
}

const TRANSFORM: &str =
    "16 numbers, row by row, or a table such as { translate = [0, 1, 0], rotate = [0, 90, 0], scale = 2 }";

/// A placement: 16 row-major numbers (column vectors, last row 0 0 0 1) or `{ translate, rotate, scale }`.
/// It may have no inverse: the code that uses it checks that and names the mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Transform(pub DAffine3, Option<(DVec3, DQuat)>);

impl From<DAffine3> for Transform {
    fn from(affine: DAffine3) -> Self {
        Self(affine, None)
    }
}

impl Transform {
    /// Largest factor by which the space of what is placed may be larger than the world: 1e18, whose square a 32-bit float holds.
    const MAX_GROWTH: f64 = 1e18;

    /// Scaled first, then rotated, then moved.
    pub fn of_steps(scale: DVec3, rotation: DQuat, translation: DVec3) -> Self {
        Self(DAffine3::from_scale_rotation_translation(scale, rotation, translation), Some((scale, rotation)))
    }

    /// The same scale and rotation at another place.
    pub fn moved_to(self, translation: DVec3) -> Self {
        Self(DAffine3 { translation, ..self.0 }, self.1)
    }

    /// Scale and rotation that it was made of; `None` for a matrix.
    pub fn made_of(&self) -> Option<(DVec3, DQuat)> {
        self.1
    }

    /// Scale and rotation: those that it was made of, or those of a matrix without shear, of which several with negative scales are the same.
    pub fn steps(&self) -> Option<(DVec3, DQuat)> {
        self.1.or_else(|| {
            let (scale, rotation, translation) = self.0.to_scale_rotation_translation();
            let again = DAffine3::from_scale_rotation_translation(scale, rotation, translation);
            let size = self.0.matrix3.to_cols_array().iter().fold(0f64, |most, v| most.max(v.abs()));
            let same = rotation.is_finite() && again.matrix3.abs_diff_eq(self.0.matrix3, 1e-5 * size);
            same.then_some((scale, rotation))
        })
    }

    /// Whether rays can be brought to the space of what it places.
    pub fn has_inverse(&self) -> bool {
        let inverse = self.0.inverse();
        let fits = |column: DVec3| column.abs().max_element() <= Self::MAX_GROWTH;
        let m = inverse.matrix3;
        self.0.is_finite() && inverse.is_finite() && [m.x_axis, m.y_axis, m.z_axis].into_iter().all(fits)
    }
}

/// Row-major, as in a scene file. The last row is 0 0 0 w, by which all is divided.
///
/// # Errors
/// [`Error::Usage`](crate::error::Error::Usage) for another last row, as that of a column-major matrix.
impl TryFrom<[f64; 16]> for Transform {
    type Error = crate::error::Error;

    fn try_from(rows: [f64; 16]) -> crate::error::Result<Self> {
        let m = DMat4::from_cols_array(&rows).transpose();
        match m.row(3).to_array() {
            [0.0, 0.0, 0.0, w] if w != 0.0 => Ok(DAffine3::from_mat4(m * (1.0 / w)).into()),
            row => Err(crate::error::Error::Usage(format!(
                "the last row of transform is {row:?}, not 0 0 0 1: give the matrix row by row"
            ))),
        }
    }
}

/// The map of 16 row-major numbers whose last row is 0 0 0 1; `None` for another count.
pub fn affine(rows: &[f64]) -> Option<DAffine3> {
    let rows = rows.try_into().ok()?;
    Some(DAffine3::from_mat4(DMat4::from_cols_array(rows).transpose()))
}

impl<'de> Deserialize<'de> for Transform {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Transform;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str(TRANSFORM)
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Transform, A::Error> {
                Transform::try_from(numbers::<16, f64, A>(seq, other(&self), &self)?).map_err(A::Error::custom)
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Transform, A::Error> {
                let steps = Steps::deserialize(value::MapAccessDeserializer::new(map))?;
                let scale = steps.scale.map_or(DVec3::ONE, |s| s.0);
                Ok(Transform::of_steps(scale, steps.rotate.0, steps.translate.into()))
            }
        }
        deserializer.deserialize_any(Either)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    struct Row {
        t: Transform,
    }

    fn place(text: &str, p: [f64; 3]) -> [f64; 3] {
        let row: Row = toml::from_str(&format!("t = {text}")).unwrap();
        row.t.0.transform_point3(p.into()).to_array().map(|v| (v * 1e9).round() / 1e9)
    }

    #[test]
    fn steps_scale_then_rotate_then_move() {
        assert_eq!(place("{ translate = [1, 2, 3], scale = 2 }", [1.0, 0.0, 0.0]), [3.0, 2.0, 3.0]);
        assert_eq!(place("{ rotate = [0, 0, 90] }", [1.0, 0.0, 0.0]), [0.0, 1.0, 0.0]);
        assert_eq!(place("{ rotate = [0, 0, 1, 90], scale = [2, 1, 1] }", [1.0, 0.0, 0.0]), [0.0, 2.0, 0.0]);
        // x first, then z: y goes to z and stays there. The other order would leave -x.
        assert_eq!(place("{ rotate = [90, 0, 90] }", [0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]);
    }

    #[test]
    fn matrices_are_row_major() {
        let found = place("[1,0,0,5, 0,1,0,6, 0,0,1,7, 0,0,0,1]", [0.0, 0.0, 0.0]);
        assert_eq!(found, [5.0, 6.0, 7.0]);
        let error = |text: &str| toml::from_str::<Row>(text).unwrap_err().message().to_owned();
        assert!(error("t = [0, 0]").starts_with("invalid length 2, expected 16 numbers"));
        assert!(error("t = [1,0,0,5, 0,1,0,6, 0,0,1,7, 0,0,1,1]").contains("last row"));
    }

    #[test]
    fn numbers_in_memory_are_held_to_what_a_file_is() {
        let rows = [2., 0., 0., 10., 0., 2., 0., 12., 0., 0., 2., 14., 0., 0., 0., 2.];
        let halved = Transform::try_from(rows).unwrap().0;
        assert_eq!(halved, DAffine3::from_translation(DVec3::new(5., 6., 7.)));
        let columns = DMat4::from_translation(DVec3::new(5., 6., 7.)).to_cols_array();
        for wrong in [columns, [0.; 16]] {
            let error = Transform::try_from(wrong).unwrap_err();
            assert!(error.exit_code() == 2 && error.to_string().contains("last row"), "{error}");
        }
    }

    #[test]
    fn wrong_types_and_keys_are_named() {
        let error = |text: &str| toml::from_str::<Row>(text).unwrap_err().message().to_owned();
        assert!(error("t = 5").contains("16 numbers, row by row, or a table"));
        for list in ["[{ scale = 2 }]", "[[1, 0, 0, 0], [0, 1, 0, 0]]", "['1']"] {
            let said = error(&format!("t = {list}"));
            assert!(
                said.contains("list of something else, expected 16 numbers") && said.contains("{ translate"),
                "{said}"
            );
        }
        assert!(error("t = { rotate = 90 }").contains("rotate takes 3 angles in degrees, such as [0, 90, 0]"));
        assert!(error("t = { move = [1, 2, 3] }").contains("unknown field `move`"));
        assert!(error("t = { rotate = [1, 2] }").contains("rotate takes 3 angles"));
    }
}
