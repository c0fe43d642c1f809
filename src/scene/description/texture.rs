//! Textures as materials name them: a file, or a picture in memory, and how it lies on a surface.
use super::value::{list, numbers, some_list};
use crate::error::Checked;
use serde::Deserialize;
use serde::de::{Deserializer, Error, MapAccess, SeqAccess, Visitor, value};
use std::fmt;
use std::path::{Path, PathBuf};

/// What is seen of a picture beyond its edges, along one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Wrap {
    /// The picture again.
    #[default]
    Repeat,
    /// The picture again, every other time mirrored.
    Mirror,
    /// Its border.
    Clamp,
}

/// How a value between texels is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TextureFilter {
    /// Interpolated between the four nearest texels.
    #[default]
    Linear,
    /// That of the texel which holds the point.
    Nearest,
}

/// A texture of a material: in a scene file its path alone, or a table. The picture is read at the coordinates that glTF's
/// `KHR_texture_transform` makes of a surface's: scaled, then rotated, then moved, all about the picture's upper left corner with
/// v pointing down. (The coordinates of [`Mesh`](super::Mesh) have v up.)
#[derive(Clone, Debug, PartialEq)]
pub struct TextureTable {
    /// Path of the picture, or the name of a [`Bitmap`](super::Bitmap).
    pub file: PathBuf,
    /// Beyond the edges along u and v: `"repeat"` (default), `"mirror"`, `"clamp"`, or one of them for each axis.
    pub wrap: [Wrap; 2],
    /// `"linear"` (default) or `"nearest"`.
    pub filter: TextureFilter,
    /// Which of a mesh's sets of texture coordinates is used: 0 (default) or 1.
    pub uv: u32,
    /// Shift of the coordinates; default 0.
    pub offset: [f32; 2],
    /// Counter-clockwise turn of the coordinates in degrees, which turns the picture clockwise; default 0.
    pub rotate: f32,
    /// Factor of the coordinates; default 1.
    pub scale: [f32; 2],
}

impl Default for TextureTable {
    fn default() -> Self {
        let (file, wrap, filter) = (PathBuf::new(), [Wrap::Repeat; 2], TextureFilter::Linear);
        Self { file, wrap, filter, uv: 0, offset: [0.0; 2], rotate: 0.0, scale: [1.0; 2] }
    }
}

impl From<&Path> for TextureTable {
    fn from(file: &Path) -> Self {
        Self { file: file.to_owned(), ..Self::default() }
    }
}

impl From<&str> for TextureTable {
    fn from(file: &str) -> Self {
        Path::new(file).into()
    }
}

impl TextureTable {
    /// # Errors
    /// A sentence that names the key which is out of range.
    pub(in crate::scene) fn check(&self) -> Checked {
        let Self { uv, offset, rotate, scale, .. } = self;
        if *uv > 1 {
            return Err(format!("uv is {uv}: a mesh has the sets 0 and 1 of texture coordinates"));
        }
        // Beyond a million, coordinates have no digits left for a place in the picture.
        match offset.iter().chain(scale).chain([rotate]).all(|v| v.abs() <= 1e6) {
            true => Ok(()),
            false => Err("offset, rotate and scale must lie within 1e6".to_owned()),
        }
    }
}

/// The table form, by which `file` is not optional.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    file: PathBuf,
    #[serde(default)]
    wrap: Wraps,
    #[serde(default)]
    filter: TextureFilter,
    #[serde(default)]
    uv: u32,
    #[serde(default, deserialize_with = "list")]
    offset: [f32; 2],
    #[serde(default)]
    rotate: f32,
    #[serde(default, deserialize_with = "some_list")]
    scale: Option<[f32; 2]>,
}

impl<'de> Deserialize<'de> for TextureTable {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = TextureTable;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a path or a table with file, wrap, filter, uv, offset, rotate, scale")
            }
            fn visit_str<E: Error>(self, path: &str) -> Result<TextureTable, E> {
                Ok(path.into())
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<TextureTable, A::Error> {
                let t = Table::deserialize(value::MapAccessDeserializer::new(map))?;
                let Table { file, wrap: Wraps(wrap), filter, uv, offset, rotate, scale } = t;
                Ok(TextureTable { file, wrap, filter, uv, offset, rotate, scale: scale.unwrap_or([1.0; 2]) })
            }
        }
        deserializer.deserialize_any(Either)
    }
}

/// One mode for both axes, or one for each.
#[derive(Default)]
struct Wraps([Wrap; 2]);

impl<'de> Deserialize<'de> for Wraps {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Either;
        impl<'de> Visitor<'de> for Either {
            type Value = Wraps;
            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("repeat, mirror, clamp, or two of them for u and v")
            }
            fn visit_str<E: Error>(self, name: &str) -> Result<Wraps, E> {
                Wrap::deserialize(value::StrDeserializer::new(name)).map(|wrap| Wraps([wrap; 2]))
            }
            fn visit_seq<A: SeqAccess<'de>>(self, seq: A) -> Result<Wraps, A::Error> {
                numbers(seq, |e| e, &self).map(Wraps)
            }
        }
        deserializer.deserialize_any(Either)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, Deserialize)]
    struct Row {
        t: TextureTable,
    }

    fn read(text: &str) -> Checked<TextureTable> {
        toml::from_str::<Row>(&format!("t = {text}")).map(|row| row.t).map_err(|e| e.message().to_owned())
    }

    #[test]
    fn a_texture_is_a_path_or_a_table() {
        assert_eq!(read("'a.png'").unwrap(), "a.png".into());
        assert_eq!(read("{ file = 'a.png' }").unwrap(), "a.png".into());
        let found = read("{ file = 'a.png', wrap = ['clamp', 'mirror'], filter = 'nearest', uv = 1, scale = [2, -1] }");
        let expected = TextureTable {
            wrap: [Wrap::Clamp, Wrap::Mirror],
            filter: TextureFilter::Nearest,
            uv: 1,
            scale: [2.0, -1.0],
            ..TextureTable::from("a.png")
        };
        assert_eq!(found.unwrap(), expected);
        assert_eq!(read("{ file = 'a.png', wrap = 'clamp' }").unwrap().wrap, [Wrap::Clamp; 2]);
    }

    #[test]
    fn mistakes_are_named() {
        assert!(read("5").unwrap_err().contains("a path or a table with file"));
        assert!(read("{ wrap = 'clamp' }").unwrap_err().contains("missing field `file`"));
        assert!(read("{ file = 'a', wrap = 'clam' }").unwrap_err().contains("unknown variant `clam`"));
        let many = read("{ file = 'a', wrap = ['clamp', 'mirror', 'clamp'] }").unwrap_err();
        assert!(many.contains("invalid length 3, expected repeat, mirror, clamp, or two of them"), "{many}");
        assert!(read("{ file = 'a', rotation = 1 }").unwrap_err().contains("unknown field `rotation`"));
        let far = TextureTable { rotate: f32::NAN, ..TextureTable::default() };
        assert!(far.check().unwrap_err().contains("rotate"));
        assert!(TextureTable { uv: 2, ..TextureTable::default() }.check().unwrap_err().contains("sets 0 and 1"));
        assert!(TextureTable::default().check().is_ok());
    }
}
