//! Renders frames one after another.
use anyhow::{Context, Result};
use glam::Vec3;
use tallow::allocate::policy;
use tallow::denoise::filter::Method;
use tallow::denoise::{Clean, Filtered, Noisy, Recipe};
use tallow::gpu::{FrameResources, Gpu, PassTime, total_ms};
use tallow::image::Picture;
use tallow::layout::Camera;
use tallow::profile::wake;
use tallow::render::{Moves, Outputs, Renderer, Reproject, Step};
use tallow::scene::{Change, Loaded};

/// How frames are rendered.
#[derive(Clone, Copy)]
pub struct Arm {
    pub policy: &'static str,
    pub carries: Option<Reproject>,
    pub filter: Option<&'static str>,
    /// Whether each pixel is four of a film twice as wide and high, which carry their samples each on its own.
    pub quarters: bool,
}

/// A renderer of an arm, and what it needs.
pub struct Film {
    pub renderer: Renderer,
    gpu: Gpu,
    frame: FrameResources,
    arm: Arm,
}

/// Whether a pass carries samples, or finds how light has changed.
pub fn carries(pass: &PassTime) -> bool {
    ["remember", "edges", "project", "carry", "gather", "probe", "light_change"].contains(&pass.name)
}

impl Film {
    pub fn new(gpu: &Gpu, scene: &Loaded, arm: Arm, spp: u32) -> Result<Self> {
        let scene = scene.clone().with(|s| {
            let [wide, of] = if arm.quarters { [2, 4] } else { [1, 1] };
            (s.width, s.height, s.spp) = (s.width * wide, s.height * wide, spp / of);
            s.allocate.policy = policy(arm.policy).unwrap_or(s.allocate.policy);
            s.allocate.min_spp = 2.min(s.spp); // of one sample, no noise is known
        });
        let mut renderer = Renderer::new(gpu, &scene, &scene.settings, Outputs::FILTERED)?;
        let moves = if scene.animation.is_empty() { Moves::Camera } else { Moves::Scene };
        arm.carries.map_or(Ok(()), |settings| renderer.keep_history(settings, moves))?;
        Ok(Self { renderer, gpu: gpu.clone(), frame: FrameResources::new(gpu)?, arm })
    }

    /// Renders a frame from a camera, after what has changed in the scene. Returns its passes.
    pub fn shoot(&mut self, camera: Camera, change: Option<(&Loaded, &Change)>, seed: u32) -> Result<Vec<PassTime>> {
        let (gpu, renderer) = (&self.gpu, &mut self.renderer);
        wake(gpu)?;
        let mut times = Vec::new();
        if let Some((scene, change)) = change {
            times.extend(gpu.run(&mut self.frame, |rec| renderer.update(rec, scene, change))?);
        }
        renderer.set_camera(camera)?;
        renderer.set_seed(seed);
        let steps: Vec<Step> = match self.arm.carries {
            Some(_) => {
                let (began, rest) = renderer.begin_frame(&mut self.frame)?;
                times.extend(began);
                rest
            }
            None => renderer.steps().collect(),
        };
        for step in &steps {
            times.extend(renderer.run(&mut self.frame, step)?);
        }
        Ok(times)
    }

    /// What is shown: the mean, or what the arm's filter makes of it; and what that took.
    pub fn picture(&self) -> Result<(Picture, f64)> {
        let size = self.renderer.settings();
        let pixels = self.renderer.film().tiles[0].stats.read()?.iter().map(|s| s.mean).collect();
        let picture = Picture { width: size.width, height: size.height, pixels };
        let picture = if self.arm.quarters { halved(&picture) } else { picture };
        let Some(name) = self.arm.filter else { return Ok((picture, 0.0)) };
        let method = Method::all().find(|method| method.name() == name).context("a filter of that name")?;
        let Clean { colour, times, .. } =
            Filtered::new(&self.gpu, Noisy::of_film(&self.renderer)?, &Recipe::new(method))?.join(&self.gpu)?;
        Ok((Picture::of_planes(picture.size(), &colour), total_ms(&times)))
    }
}

/// The means of four pixels each.
fn halved(fine: &Picture) -> Picture {
    let [width, height] = [fine.width / 2, fine.height / 2];
    let mean = |i: u32| {
        let corner = (i / width * 2 * fine.width + i % width * 2) as usize;
        let four = [0, 1, fine.width as usize, fine.width as usize + 1].map(|k| Vec3::from(fine.pixels[corner + k]));
        (four.into_iter().sum::<Vec3>() / 4.0).to_array()
    };
    Picture { width, height, pixels: (0..width * height).map(mean).collect() }
}
