//! What the kernels are told of a scene and its settings, besides the scene's own records.
use crate::error::Result;
use crate::layout::{FrameConstants, LIGHT_ENVIRONMENT, NONE, PathConstants, PriorityPush, ROOT_OF_INSTANCES};
use crate::render::schedule;
use crate::render::settings::Settings;
use crate::scene::Scene;

/// What the policies are told of a scene.
pub fn priority_push(scene: &Scene, s: &Settings) -> PriorityPush {
    let a = &s.allocate;
    let [low, high] = scene.bounds.map(glam::Vec3::from);
    let sigma = (a.geometry.sigma_position * high.distance(low)).max(f32::MIN_POSITIVE.sqrt());
    PriorityPush {
        size: s.size(),
        window: a.geometry.window,
        normal_scale: a.geometry.sigma_normal.max(f32::MIN_POSITIVE.sqrt()).powi(-2),
        position_scale: sigma.powi(-2),
        luminance_floor: a.variance.luminance_floor,
        limit: schedule::limit(s),
        threshold: a.noise_threshold,
        // A threshold is of the samples' own error: less what a filter removes, pixels would stop above it.
        filtered: if a.has_threshold() { 0.0 } else { a.both.filtered },
        round: 0,
        stride: s.indirect_stride,
        ..Default::default()
    }
}

/// What the kernels are told of a scene and its camera.
///
/// # Errors
/// Those of [`Scene::camera`].
pub fn frame_constants(scene: &Scene, settings: &Settings) -> Result<FrameConstants> {
    Ok(FrameConstants { camera: scene.camera(settings.size())?, path: path_constants(scene, settings) })
}

fn path_constants(scene: &Scene, settings: &Settings) -> PathConstants {
    let environment = scene.lights.iter().position(|l| l.kind == LIGHT_ENVIRONMENT);
    PathConstants {
        size: settings.size(),
        seed: settings.seed,
        max_depth: settings.max_depth,
        roulette_depth: settings.roulette_depth,
        clamp_indirect: settings.clamp_indirect,
        indirect_stride: settings.indirect_stride,
        pixel_filter: settings.filter.code(),
        light_count: scene.lights.len() as u32,
        triangle_pdf_scale: scene.triangle_pdf_scale,
        environment: environment.map_or(NONE, |i| i as u32),
        environment_size: scene.environment.as_ref().map_or([0; 2], |e| [e.width, e.height]),
        root: scene.root | if scene.instances.is_empty() { 0 } else { ROOT_OF_INSTANCES },
        ..Default::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_threshold_is_of_the_samples_own_error() {
        let mut settings = Settings::default();
        let filtered = |settings: &Settings| priority_push(&Scene::default(), settings).filtered;
        assert_eq!(filtered(&settings), 0.5);
        settings.allocate.noise_threshold = 0.02;
        assert_eq!(filtered(&settings), 0.0);
    }

    /// Its square is no number of single precision: normals that are equal would be unlike.
    #[test]
    fn the_smallest_deviations_have_a_scale() {
        let mut settings = Settings::default();
        settings.allocate.geometry.sigma_normal = 1e-30;
        settings.allocate.geometry.sigma_position = 1e-30;
        settings.validate().unwrap();
        let push = priority_push(&Scene::default(), &settings);
        assert!(push.normal_scale.is_finite() && push.position_scale.is_finite(), "{push:?}");
    }
}
