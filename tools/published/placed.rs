//! Renders with one allocation policy, with the device's time for them, and errors against references.
use super::view::View;
use crate::Args;
use anyhow::anyhow;
use tallow::gpu::{FrameResources, Gpu, total_ms};
use tallow::image::Picture;
use tallow::layout::{Guide, PixelStats, vec3, vec4};
use tallow::profile::wake;
use tallow::render::settings::{Settings, Split};
use tallow::render::{Job, Outputs, Renderer, Step, traces_paths};
use tallow::scene::{Loaded, Scene};
use tallow::statistics::Pixel;

/// The result of a render, with the device's time for its passes.
pub struct Rendered {
    /// Radiance, direct and indirect light of every pixel.
    pub pixels: Vec<Pixel>,
    /// Primary hit of every pixel.
    pub guide: Vec<Guide>,
    /// Milliseconds of all passes except the primary hits.
    pub ms: f64,
    /// Milliseconds of tracing and accumulating alone.
    pub path_ms: f64,
}

impl View {
    /// Loads the scene with the settings of the view and those that `change` makes.
    ///
    /// # Errors
    /// When the scene cannot be found or loaded.
    pub fn load(&self, args: &Args, change: impl Fn(&mut Settings)) -> anyhow::Result<Loaded> {
        let all = |s: &mut Settings| {
            ([s.width, s.height], s.max_depth, s.roulette_depth) = (self.size(args), self.depth, 0);
            // The references of `View::render` are split like this; what is compared must be the same light.
            s.split = Split::Indirect;
            change(s);
        };
        Ok(Scene::load(&self.scene_file(args)?).map(|scene| scene.with(all))?)
    }

    /// Radiance of the reference.
    ///
    /// # Errors
    /// As [`View::render`].
    pub fn radiance(&self, args: &Args) -> anyhow::Result<Picture> {
        self.reference(args)?.film.picture(None).map_err(|what| anyhow!(what))
    }
}

/// Tests for the kinds of steps, in the order of a render.
const ONE_OF_EACH: [fn(&Step) -> bool; 5] = [
    |s| matches!(s, Step::Start),
    |s| matches!(s, Step::Uniform(_)),
    |s| matches!(s, Step::Allocate(_)),
    |s| matches!(s, Step::Choose(_)),
    |s| matches!(s, Step::Listed(_)),
];

/// Renders a scene with its settings. Each kernel runs once before that without being timed, because drivers compile then.
pub fn render(gpu: &Gpu, scene: &Loaded) -> anyhow::Result<Rendered> {
    let renderer = Renderer::new(gpu, scene, &scene.settings, Outputs::FILTERED)?;
    let mut frame = FrameResources::new(gpu)?;
    for kind in ONE_OF_EACH {
        renderer.steps().find(kind).map_or(Ok(Vec::new()), |step| renderer.run(&mut frame, &step))?;
    }
    wake(gpu)?;
    let times = Job::new(&renderer).run_to_end(&mut frame)?.times;
    let took = |counts: fn(&str) -> bool| total_ms(times.iter().filter(|pass| counts(pass.name)));
    let (ms, path_ms) = (took(|name| name != "primary_hit"), took(|name| traces_paths(name) || name == "accumulate"));
    let tile = &renderer.film().tiles[0];
    let (stats, light) = (tile.stats.read()?, tile.light.read()?);
    let pixels = stats.into_iter().zip(light).map(|(stats, light)| Pixel { stats, light }).collect();
    Ok(Rendered { pixels, guide: tile.guide.read()?, ms, path_ms })
}

/// Arithmetic mean of the values.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Radiance of every pixel.
pub fn radiance(pixels: &[Pixel]) -> Vec<vec3> {
    pixels.iter().map(|p| p.stats.mean).collect()
}

/// Indirect irradiance with the number of its samples, as filters take it.
pub fn indirect(pixels: &[Pixel]) -> Vec<vec4> {
    let of = |PixelStats { count, .. }: PixelStats, [r, g, b]: vec3| [r, g, b, count as f32];
    pixels.iter().map(|p| of(p.stats, p.indirect())).collect()
}
