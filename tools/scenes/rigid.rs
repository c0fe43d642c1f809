//! Converts one frame of the rigid animation, whose JSON file holds objects, materials and camera. It has no light, so a
//! sky is added.
use super::emit::{file, numbers, table};
use anyhow::Context;
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;
use std::path::Path;
use toml::{Table, Value};

/// Image of the sky, relative to the folder of all scenes.
const SKY: &str = "hdr/spiaggia_di_mondello_1k.hdr";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Animation {
    /// OBJ files by name.
    objects: BTreeMap<String, String>,
    /// OBJ files of the static objects, in world space.
    #[serde(rename = "static")]
    still: Vec<String>,
    /// Materials by the name of the object, or of the file of a static object.
    materials: BTreeMap<String, Look>,
    camera: Camera,
    /// Transforms by object name, one map per frame, for column vectors.
    object_to_world_row_major: Vec<BTreeMap<String, [f64; 16]>>,
    #[serde(rename = "fps")]
    _fps: IgnoredAny,
    #[serde(rename = "frames")]
    _frames: IgnoredAny,
    #[serde(rename = "loop")]
    _loop: IgnoredAny,
}

#[derive(Deserialize)]
#[serde(untagged, deny_unknown_fields)]
enum Look {
    Diffuse {
        #[serde(rename = "Kd")]
        albedo: [f64; 3],
    },
    /// Reflectance at normal incidence, and perceptual roughness.
    Metal { metal: [f64; 3], roughness: f64 },
    /// A dielectric, given by its index of refraction.
    Glass { glass: f64 },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Camera {
    origin: [f64; 3],
    target: [f64; 3],
    up: [f64; 3],
    fov_y_deg: f64,
}

/// Makes the scene file of a frame, counted from 0. `json` is relative to the folder of all scenes.
pub fn scene(scenes: &Path, json: &str, frame: usize) -> anyhow::Result<Table> {
    let json = scenes.join(json);
    build(scenes, &json, frame).with_context(|| format!("{}", json.display()))
}

fn build(scenes: &Path, json: &Path, frame: usize) -> anyhow::Result<Table> {
    let folder = json.parent().unwrap_or(scenes);
    let text = std::fs::read_to_string(json).context("cannot be read")?;
    let animation: Animation = serde_json::from_str(&text).context("says something that is not modelled")?;
    let placed = &animation.object_to_world_row_major;
    let placed =
        placed.get(frame).with_context(|| format!("has no frame {frame}: its last is {}", placed.len() - 1))?;
    let mut meshes = vec![];
    for (name, obj) in &animation.objects {
        let mut mesh = mesh(folder, name, obj)?;
        mesh.insert("transform".into(), numbers(*placed.get(name).context("does not place every object")?));
        meshes.push(Value::Table(mesh));
    }
    for obj in &animation.still {
        meshes.push(Value::Table(mesh(folder, obj.trim_end_matches(".obj"), obj)?));
    }
    let Camera { origin, target, up, fov_y_deg } = animation.camera;
    let camera = table([
        ("position", numbers(origin)),
        ("target", numbers(target)),
        ("up", numbers(up)),
        ("fov", fov_y_deg.into()),
    ]);
    let materials: Vec<Value> = animation.materials.iter().map(|(name, look)| material(name, look).into()).collect();
    Ok(table([
        ("film", table([("width", 960.into()), ("height", 540.into())]).into()),
        ("camera", camera.into()),
        ("render", table([("spp", 64.into()), ("max_depth", 8.into())]).into()),
        ("environment", table([("file", file(scenes, SKY)?)]).into()),
        ("material", materials.into()),
        ("mesh", meshes.into()),
    ]))
}

fn mesh(folder: &Path, name: &str, obj: &str) -> anyhow::Result<Table> {
    Ok(table([("name", name.into()), ("file", file(folder, obj)?), ("material", name.into())]))
}

fn material(name: &str, look: &Look) -> Table {
    let mut out = table([("name", name.into())]);
    match look {
        Look::Diffuse { albedo } => out.extend(table([("type", "diffuse".into()), ("color", numbers(*albedo))])),
        Look::Metal { metal, roughness } => {
            // Many indices have this reflectance at normal incidence; take those with n^2 + k^2 = 1, as for metals in MTL.
            out.extend(table([("type", "conductor".into()), ("alpha", (roughness * roughness).into())]));
            out.insert("eta".into(), numbers(metal.map(|r| (1.0 - r) / (1.0 + r))));
            out.insert("k".into(), numbers(metal.map(|r| 2.0 * r.sqrt() / (1.0 + r))));
        }
        Look::Glass { glass } => out.extend(table([("type", "dielectric".into()), ("ior", (*glass).into())])),
    }
    out
}
