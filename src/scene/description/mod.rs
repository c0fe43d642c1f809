//! The scene file: TOML tables, every key with a default, paths relative to the file.
//!
//! A `[[mesh]]` is drawn where its own `transform` puts it, unless an `[[instance]]` names it: then it is drawn once per
//! instance and nowhere else, `world_from_object = instance transform * mesh transform`.
//!
//! An engine fills in the same tables for [`Scene::build`](super::Scene::build), with [`MeshTable::data`],
//! [`Description::bitmap`], [`Description::picture_file`] and [`EnvironmentTable::picture`] in place of files.
pub(super) mod animation;
pub(super) mod camera;
mod explain;
pub(super) mod keys;
pub(super) mod light;
pub(super) mod material;
pub(super) mod mesh;
pub(super) mod shape;
pub(super) mod texture;
mod unknown;
pub(super) mod value;

pub mod settings;
pub use animation::{AnimationTable, Interpolation, Key, Numbers, numbered};
pub(super) use animation::{mesh_number, meshes_to_free};
pub use camera::{Camera, FovAxis};
use explain::explain;
pub use light::{LightTable, Type as LightType};
pub use material::{AlphaMode, Distribution, MaterialTable, Type as MaterialType};
pub use mesh::{Bitmap, Mesh, PictureFile};
pub use shape::Shape;
pub use texture::{TextureFilter, TextureTable, Wrap};
pub(super) use unknown::nearest;
pub(in crate::scene) use value::affine;
pub(super) use value::rotation;
use value::some_list;
pub use value::{Rgb, Transform};

use crate::error::{Error, Result};
use crate::image::Picture;
use serde::Deserialize;
use settings::Settings;
pub use settings::{Allocate, Film, Render};
use std::path::{Path, PathBuf};

/// The tables of a scene file.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Description {
    /// Size and pixel filter of the film.
    pub film: Film,
    /// Position, direction and lens of the camera.
    pub camera: Camera,
    /// Number and length of paths, and their random numbers.
    pub render: Render,
    /// Distribution of the samples over the pixels.
    pub allocate: Allocate,
    /// Light from infinitely far; none when absent.
    pub environment: Option<EnvironmentTable>,
    /// Meshes from files, from memory, or shapes.
    pub mesh: Vec<MeshTable>,
    /// Placed copies of meshes.
    pub instance: Vec<InstanceTable>,
    /// Materials that meshes name.
    pub material: Vec<MaterialTable>,
    /// Point, spot and directional lights.
    pub light: Vec<LightTable>,
    /// What moves, and when.
    pub animation: Vec<AnimationTable>,
    /// Textures in memory, which materials name as they name files.
    #[serde(skip)]
    pub bitmap: Vec<Bitmap>,
    /// Encoded pictures in memory, which materials name as they name files.
    #[serde(skip)]
    pub picture_file: Vec<PictureFile>,
}

/// The `[environment]` table; orientation: see `build/environment.rs`.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct EnvironmentTable {
    /// Constant radiance, W/(m^2 sr); default 1.
    pub radiance: Option<Rgb>,
    /// Latitude-longitude image (HDR, EXR, PNG, JPEG, TGA, BMP), in place of `radiance`.
    pub file: Option<PathBuf>,
    /// Latitude-longitude image in memory in place of `file`, linear Rec. 709.
    #[serde(skip)]
    pub picture: Option<Picture>,
    /// Factor of `radiance` or the image; default 1.
    pub scale: Option<Rgb>,
    /// Rotation about +y in degrees.
    pub rotation: f64,
    /// Rotation as nine row-major numbers, in place of `rotation`.
    #[serde(deserialize_with = "some_list")]
    pub world_from_environment: Option<[f64; 9]>,
}

/// A `[[mesh]]` table: a file, a shape, or triangles in memory.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct MeshTable {
    /// Name by which instances and animations call it; meshes of glTF files have one of their own. Reports take the file's name or the
    /// shape's where there is none.
    pub name: Option<String>,
    /// Path of an OBJ file, of a PLY file (`.ply`, `.ply.gz`), or of a glTF file, whose meshes, lights and what moves them take the
    /// place of this table.
    pub file: Option<PathBuf>,
    /// Of a glTF file, the name of the animation that is played; default all that do not move the same as an earlier one.
    pub clip: Option<String>,
    /// Object or group of the file to which the mesh is limited.
    pub group: Option<String>,
    /// A shape in place of a file.
    pub shape: Option<Shape>,
    /// Triangles in memory in place of a file or a shape.
    #[serde(skip)]
    pub data: Option<Mesh>,
    /// Disk: edges around, 3 to 4096; default 64. A sphere is exact without, and a mesh with it; also where it is `flat`, and
    /// as a lamp that is stretched, turned inside out, textured or partly transparent.
    pub segments: Option<u32>,
    /// Transform from object to world space.
    pub transform: Transform,
    /// Name of a `[[material]]` that replaces the mesh's own. Where all meshes of an OBJ file have one and none is `moving`, the file's
    /// MTL files are not read.
    pub material: Option<String>,
    /// Whether vertex normals are ignored; a file without any is then no reason for a warning.
    pub flat: bool,
    /// Whether the surface is turned inside out.
    pub flip_normals: bool,
    /// Whether it is placed or deformed anew between frames. It is stored apart then, and keeps triangles without area and copies of
    /// others, since they may change. Without it only what `[[instance]]` tables place can be moved, and nothing be deformed.
    pub moving: bool,
}

/// An `[[instance]]` table: a placed copy of a mesh.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct InstanceTable {
    /// Name of the `[[mesh]]` that is placed.
    pub mesh: String,
    /// Transform that is applied after the mesh's own.
    #[serde(default)]
    pub transform: Transform,
    /// Name of a `[[material]]` that replaces those of the mesh.
    pub material: Option<String>,
    /// Name for what moves it.
    pub name: Option<String>,
}

/// Reads a scene file.
///
/// # Errors
/// [`Error::Input`] with line, key and, for an unknown key, the nearest known one.
pub(super) fn parse(path: &Path, text: &str) -> Result<Description> {
    let description: Description = toml::from_str(text).map_err(|e| {
        let start = e.span().map_or(0, |s| s.start).min(text.len());
        let line = 1 + text.as_bytes()[..start].iter().filter(|&&b| b == b'\n').count();
        Error::input_at(path, format!("line {line}"), explain(text, start, e.message()))
    })?;
    let Camera { world_from_camera, position, up, .. } = &description.camera;
    if world_from_camera.is_some() && (position.is_some() || up.is_some()) {
        return Err(Error::input_at(path, "[camera]", "has both world_from_camera and position or up: choose one"));
    }
    Ok(description)
}

impl Description {
    /// The file's settings over the defaults.
    pub fn settings(&self) -> Settings {
        let mut settings = Settings { allocate: self.allocate.clone(), ..Settings::default() };
        self.film.apply(&mut settings);
        self.render.apply(&mut settings);
        settings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        parse(Path::new("s.toml"), text).unwrap_err().to_string()
    }

    #[test]
    fn unknown_keys_name_line_and_neighbour() {
        let found = error("[film]\nwidth = 4\nheigth = 4\n");
        assert!(found.starts_with("s.toml, line 3: unknown key \"heigth\": did you mean \"height\"?"), "{found}");
        assert!(error("[fim]\n").contains("did you mean \"film\""));
        assert!(error("[[mesh]]\nshape = \"sphre\"").contains("unknown value \"sphre\": did you mean \"sphere\""));
        assert!(
            error("[[material]]\nname = \"a\"\ncolour = 1")
                .contains("line 3: unknown key \"colour\": did you mean \"color\"")
        );
        assert!(error("[[mesh]]\ntransform = { scael = 2 }").contains("did you mean \"scale\""));
    }

    #[test]
    fn words_of_other_renderers_are_known() {
        for (table, words, hint) in [
            ("light", ["sun", "distant"], "did you mean \"directional\"? Known: point, spot, directional"),
            ("light", ["area", "quad"], "what shines from an area is a mesh whose material has an emission. Known:"),
            ("light", ["sky", "infinite"], "what shines from all around is the table [environment]. Known: point"),
            ("material", ["glass", "dielectrc"], "did you mean \"dielectric\"? Known: diffuse, conductor"),
            ("material", ["principled", "disney"], "did you mean \"metallic-roughness\"?"),
            // Nothing is like these.
            ("light", ["xyz", "fog"], ". Known: point, spot, directional"),
        ] {
            for word in words {
                let found = error(&format!("[[{table}]]\ntype = \"{word}\"\n"));
                let rest = found.strip_prefix(&format!("s.toml, line 2: unknown value \"{word}\"")).unwrap();
                assert!(rest.trim_start_matches(": ").starts_with(hint), "{found}");
            }
        }
        assert!(!error("[[material]]\nglass = 1").contains("dielectric"));
        assert!(error("[[mesh]]\nposition = 1").contains("unknown key \"position\": did you mean \"transform\"?"));
        assert!(error("[[light]]\ncolor = 1").contains("unknown key \"color\": a light has an intensity, or"));
        assert!(error("[[sun]]\n").starts_with("s.toml, line 1: unknown key \"sun\". Known: film, camera"));
    }

    #[test]
    fn tables_of_settings_are_read_as_other_tables() {
        // Keys that policies own, and those that the scene file does not have.
        let found = error("[allocate]\n\nwindwo = 3\n");
        assert!(found.starts_with("s.toml, line 3: unknown key \"windwo\": did you mean \"window\"?"), "{found}");
        assert!(error("[render]\nfirst_sample = 3").contains("line 2: unknown key"));
        assert!(error("[allocate]\n\nfiltered = \"x\"").contains("line 3: filtered takes"));
        let found = error("[allocate]\npolicy = \"none\"");
        assert!(found.contains("line 2: no policy \"none\": choose one of uniform, geometry"), "{found}");
        let text = "[film]\nwidth = 8\n[allocate]\npolicy = \"both\"\nwindow = 3\nfiltered = 1\n";
        let settings = parse(Path::new("s.toml"), text).unwrap().settings();
        let Allocate { policy, geometry, both, .. } = &settings.allocate;
        assert_eq!((settings.width, policy.name, geometry.window, both.filtered), (8, "both", 3, 1.0));
        // A rendered file holds them as the scene file does.
        let json = serde_json::to_value(&settings.allocate).unwrap();
        assert_eq!((&json["policy"], &json["window"]), (&"both".into(), &3.into()));
        assert_eq!(serde_json::from_value::<Allocate>(json).unwrap(), settings.allocate);
    }

    #[test]
    fn wrong_types_name_their_line() {
        assert!(error("[film]\n\nwidth = \"wide\"").starts_with("s.toml, line 3: width takes a whole number"));
        assert!(error("[film]\nwidth = -1").contains("line 2"));
        assert!(error("[[light]]\nposition = [1, 2, 3]").contains("the key \"type\" is missing"));
        assert!(error("[film\n").starts_with("s.toml, line 1"));
        for text in ["[film]\nwidth = \"wide\"", "a = 1", "[[", "\u{0}"] {
            assert!(!error(text).contains('\n'), "{}", error(text));
        }
    }

    #[test]
    fn everything_has_a_default_and_numbers_may_be_integers() {
        let empty = parse(Path::new("s.toml"), "").unwrap();
        assert_eq!(empty.settings(), Settings::default());
        let text = "[film]\nwidth = 8\nfilter = \"tent\"\n[environment]\nradiance = 2\n[[material]]\nname = \"a\"\ncolor = [1, 0.5, 0]";
        let d = parse(Path::new("s.toml"), text).unwrap();
        assert_eq!(
            (d.settings().width, d.settings().filter),
            (8, crate::scene::description::settings::PixelFilter::Tent)
        );
        assert_eq!(d.environment.unwrap().radiance, Some(Rgb([2.0; 3])));
        assert_eq!(d.material[0].color, Some(Rgb([1.0, 0.5, 0.0])));
    }
}
