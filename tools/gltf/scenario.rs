//! The views of the published pictures.
use anyhow::Context;
use serde_json::Value;
use std::collections::HashMap;
use std::path::Path;
use tallow::scene::description::{Camera, FovAxis};

/// How a model is seen.
#[derive(Clone)]
pub struct Scenario {
    /// `None` where nothing is published: the file's own camera, or one that frames it.
    pub camera: Option<Camera>,
    /// Width over height.
    pub aspect: f64,
    /// Whether the sky is seen.
    pub sky: bool,
    /// The environment map that the pictures were lit by.
    pub lighting: String,
}

impl Default for Scenario {
    fn default() -> Self {
        Self { camera: None, aspect: 1.0, sky: true, lighting: String::new() }
    }
}

/// Reads the views by the name of the model.
///
/// # Errors
/// When the file cannot be read or lacks a number.
pub fn read(path: &Path) -> anyhow::Result<HashMap<String, Scenario>> {
    let text = std::fs::read_to_string(path).with_context(|| path.display().to_string())?;
    let json: Value = serde_json::from_str(&text)?;
    let all = json["scenarios"].as_object().context("no scenarios")?;
    all.iter().map(|(name, value)| Ok((name.clone(), scenario(value).with_context(|| name.clone())?))).collect()
}

fn scenario(value: &Value) -> anyhow::Result<Scenario> {
    let number = |pointer: &str| value.pointer(pointer).and_then(Value::as_f64).context(pointer.to_owned());
    let triple = |place: &str| -> anyhow::Result<[f64; 3]> {
        Ok([number(&format!("{place}/0"))?, number(&format!("{place}/1"))?, number(&format!("{place}/2"))?])
    };
    let (position, look) = (triple("/derived/camera_position")?, triple("/derived/look_direction")?);
    let target = Some(std::array::from_fn(|axis| position[axis] + look[axis]));
    let fov = Some(number("/verticalFoV")?);
    let camera = Camera { position: Some(position), target, fov, fov_axis: FovAxis::Y, ..Camera::default() };
    Ok(Scenario {
        camera: Some(camera),
        aspect: number("/dimensions/width")? / number("/dimensions/height")?,
        sky: value["renderSkybox"] == true,
        lighting: value["lighting"].as_str().unwrap_or_default().to_owned(),
    })
}
