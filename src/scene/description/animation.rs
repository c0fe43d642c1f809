//! The `[[animation]]` tables: what moves, and where it is when.
use super::Description;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// What lies between two keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Interpolation {
    /// A straight line; for a rotation the shortest way on the sphere.
    #[default]
    Linear,
    /// What the earlier key says.
    Step,
}

/// An `[[animation]]` table. It moves one thing: the camera, an instance, a node of a glTF file, a light, a material, the environment,
/// or the vertices of a mesh.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AnimationTable {
    /// Whether it moves the camera: `position`, `target`, `up`, `fov`, `focus_distance`, `lens_radius`.
    pub camera: bool,
    /// Name of the `[[instance]]`, or of a `[[mesh]]` without instances, that it places: `translate`, `rotate`, `scale`, or
    /// `transform`.
    pub instance: Option<String>,
    /// `"MESH/NODE"`: the node of the glTF file that the `[[mesh]]` of this name (or of this file name without its ending) names, with
    /// all that hangs on it. NODE is its name, or that of the mesh that it shows, or `node N` by its number; of several of one name
    /// the first is meant. Keys as for an instance, relative to the node's parent; they win over the file's own animation.
    pub node: Option<String>,
    /// Name of the `[[light]]` that it changes: `position`, `direction`, `target`, `intensity`, `irradiance`, `cone`, `cutoff`.
    pub light: Option<String>,
    /// Name of the material that it changes: `color`, `specular`, `transmission`, `emission` (with its strength in it), `alpha`
    /// (`alpha_v` keeps its ratio to it), `opacity`.
    pub material: Option<String>,
    /// Whether it changes the environment: `radiance` (with an image, its factor) and `rotation` in degrees.
    pub environment: bool,
    /// Name of the `[[mesh]]` that it deforms, by `file`.
    pub mesh: Option<String>,
    /// What lies between two keys or files.
    pub interpolation: Interpolation,
    /// Whether it begins again after its last key or file; otherwise the ends last.
    pub repeat: bool,
    /// The keys, by their time.
    pub keys: Vec<Key>,
    /// OBJ or PLY files of a mesh in one pose each; `####` stands for their number with that many digits.
    pub file: Option<PathBuf>,
    /// Number of the first file.
    pub first: u32,
    /// Number of the last file.
    pub last: u32,
    /// Files per second; default 24.
    pub fps: Option<f64>,
}

/// Numbers at a time. A key need not say everything: what it leaves out goes on from the key before to the one behind.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct Key {
    /// Seconds.
    pub time: f64,
    /// By the name of what changes, the numbers that its table has.
    #[serde(flatten)]
    pub values: BTreeMap<String, Numbers>,
}

/// One number or a list.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Numbers {
    /// One number.
    One(f64),
    /// A list of numbers.
    Many(Vec<f64>),
}

impl Numbers {
    /// As a list.
    pub fn list(&self) -> Vec<f64> {
        match self {
            Self::One(number) => vec![*number],
            Self::Many(numbers) => numbers.clone(),
        }
    }
}

/// Number of the first `[[mesh]]` of a name.
pub(in crate::scene) fn mesh_number(description: &Description, name: &str) -> Option<usize> {
    description.mesh.iter().position(|mesh| mesh.name.as_deref() == Some(name))
}

/// Numbers of the meshes that animations move, and that are not stored apart yet; of one without a source, the file too.
pub(in crate::scene) fn meshes_to_free(description: &Description) -> Vec<(usize, Option<PathBuf>)> {
    let of = |table: &AnimationTable| {
        let placed = table.instance.as_ref().filter(|name| {
            let is_it = |i: &super::InstanceTable| i.name.as_ref() == Some(name);
            !description.instance.iter().any(is_it)
        });
        let number = mesh_number(description, placed.or(table.mesh.as_ref())?)?;
        let m = &description.mesh[number];
        let lacks = m.file.is_none() && m.shape.is_none() && m.data.is_none();
        let first =
            table.file.as_ref().filter(|_| lacks).and_then(|file| numbered(&file.to_string_lossy(), table.first));
        (!m.moving || first.is_some()).then(|| (number, first.map(PathBuf::from)))
    };
    description.animation.iter().filter_map(of).collect()
}

/// A name with `number` in place of its last run of `#`, with at least as many digits; none for a name without.
pub fn numbered(name: &str, number: u32) -> Option<String> {
    let end = name.rfind('#')? + 1;
    let start = name[..end].trim_end_matches('#').len();
    Some(format!("{}{number:0width$}{}", &name[..start], &name[end..], width = end - start))
}

#[cfg(test)]
mod tests {
    use super::numbered;

    #[test]
    fn numbers_take_the_place_of_the_last_run_of_signs() {
        assert_eq!(numbered("a#b/frame.####.exr", 12).unwrap(), "a#b/frame.0012.exr");
        assert_eq!(numbered("#", 1234).unwrap(), "1234");
        assert_eq!(numbered("frame.exr", 1), None);
    }
}
