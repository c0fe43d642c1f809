//! The JSON descriptions of the outside scenes, in Mitsuba's terms, with one struct for each of its plugins. Unknown keys
//! are errors, so that nothing is dropped silently.
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;

/// A colour in linear RGB.
pub type Rgb = [f64; 3];
/// A row-major matrix for column vectors.
pub type Matrix = [[f64; 4]; 4];

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Description {
    pub camera: Camera,
    pub integrator: Integrator,
    pub shapes: Vec<Shape>,
    pub emitters: Vec<Emitter>,
    pub materials: BTreeMap<String, Material>,
    #[serde(rename = "note")]
    _note: IgnoredAny,
    #[serde(rename = "reference")]
    _reference: IgnoredAny,
    #[serde(rename = "triangles")]
    _triangles: IgnoredAny,
}

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase", deny_unknown_fields)]
pub enum Camera {
    Perspective {
        origin: Rgb,
        forward: Rgb,
        up: Rgb,
        /// Direction of the right edge of the image, which tells whether the image is mirrored.
        right: Rgb,
        fov_y_deg: f64,
        width: u32,
        height: u32,
        rfilter: String,
        #[serde(rename = "det_to_world")]
        _determinant: IgnoredAny,
        #[serde(rename = "fov_deg")]
        _fov: IgnoredAny,
        #[serde(rename = "fov_axis")]
        _fov_axis: IgnoredAny,
        /// Without a lens it changes nothing.
        #[serde(rename = "focus_distance", default)]
        _focus_distance: Option<f64>,
    },
}

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase", deny_unknown_fields)]
pub enum Integrator {
    /// Depth in edges, -1 without limit.
    Path { max_depth: i64 },
    /// Emission and direct light.
    Direct {},
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shape {
    pub id: String,
    #[serde(rename = "type")]
    pub kind: String,
    pub material: String,
    pub to_world_row_major: Option<Matrix>,
    pub file: Option<String>,
    pub center: Option<Rgb>,
    pub radius: Option<f64>,
    /// The material holds the same value.
    #[serde(rename = "emission", default)]
    _emission: IgnoredAny,
    #[serde(rename = "triangles")]
    _triangles: IgnoredAny,
    #[serde(rename = "in_obj", default)]
    _in_obj: IgnoredAny,
    #[serde(rename = "shape_index", default)]
    _shape_index: IgnoredAny,
    #[serde(rename = "note", default)]
    _note: IgnoredAny,
}

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase", deny_unknown_fields)]
pub enum Emitter {
    Constant {
        #[serde(default = "white")]
        radiance: Rgb,
        #[serde(rename = "id", default)]
        _id: IgnoredAny,
    },
    Envmap {
        filename: String,
    },
    Point {
        position: Rgb,
        intensity: Rgb,
    },
    Directional {
        direction: Rgb,
        irradiance: Rgb,
    },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    pub bsdf: Bsdf,
    /// Radiance of the front side.
    pub emission: Option<Rgb>,
}

/// Plain BSDFs other than dielectrics are black from behind; `twosided` makes the back like the front.
#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase", deny_unknown_fields)]
pub enum Bsdf {
    Diffuse {
        reflectance: Option<Color>,
        #[serde(rename = "id", default)]
        _id: IgnoredAny,
    },
    Twosided {
        bsdf: Box<Bsdf>,
        #[serde(rename = "id", default)]
        _id: IgnoredAny,
    },
    Mask {
        opacity: Color,
        bsdf: Box<Bsdf>,
    },
    Conductor {
        eta: Rgb,
        k: Rgb,
    },
    RoughConductor {
        alpha: f64,
        distribution: String,
        eta: Rgb,
        k: Rgb,
        specular_reflectance: Option<Rgb>,
    },
    Dielectric {
        #[serde(default = "glass")]
        int_ior: Index,
        #[serde(default = "air")]
        ext_ior: Index,
    },
    RoughDielectric {
        alpha: f64,
        distribution: String,
        #[serde(default = "glass")]
        int_ior: Index,
        #[serde(default = "air")]
        ext_ior: Index,
    },
    Plastic {
        diffuse_reflectance: Color,
        #[serde(default = "plastic")]
        int_ior: Index,
        #[serde(default = "air")]
        ext_ior: Index,
    },
    RoughPlastic {
        alpha: f64,
        distribution: String,
        diffuse_reflectance: Color,
        #[serde(default = "plastic")]
        int_ior: Index,
        #[serde(default = "air")]
        ext_ior: Index,
    },
}

/// A constant, or an image in the sRGB encoding.
#[derive(Deserialize)]
#[serde(untagged)]
pub enum Color {
    Constant(Rgb),
    Bitmap(Bitmap),
}

#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase", deny_unknown_fields)]
pub enum Bitmap {
    Bitmap {
        filename: String,
        #[serde(rename = "id", default)]
        _id: IgnoredAny,
    },
}

/// An index of refraction, or the name of a substance.
#[derive(Deserialize)]
#[serde(untagged)]
pub enum Index {
    Number(f64),
    Name(String),
}

impl Index {
    /// # Errors
    /// On a substance that is not in the table.
    pub fn value(&self) -> anyhow::Result<f64> {
        match self {
            Self::Number(n) => Ok(*n),
            // Mitsuba 3's values.
            Self::Name(name) => match name.as_str() {
                "air" => Ok(1.000277),
                "bk7" => Ok(1.5046),
                "diamond" => Ok(2.419),
                "polypropylene" => Ok(1.49),
                _ => anyhow::bail!("the index of refraction of `{name}` is not known here; give a number"),
            },
        }
    }
}

// Mitsuba's defaults.
fn white() -> Rgb {
    [1.0; 3]
}

fn glass() -> Index {
    Index::Name("bk7".into())
}

fn plastic() -> Index {
    Index::Name("polypropylene".into())
}

fn air() -> Index {
    Index::Name("air".into())
}
