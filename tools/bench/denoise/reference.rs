//! Converged images, and how far they are from it.
use crate::view::View;
use anyhow::{Context, Result, anyhow, ensure};
use std::path::Path;
use tallow::gpu::{FrameResources, Gpu};
use tallow::image::{self, Film, Picture, WriteOptions, metrics};
use tallow::render::settings::Settings;
use tallow::render::{Job, Outputs, Renderer};
use tallow::scene::Scene;

/// Noisy images have seed 0: a reference must not be made of their samples.
const SEED: u32 = 1;

/// An image that others are compared with.
pub struct Reference {
    pub picture: Picture,
    pub spp: f64,
    /// Its own relMSE as its samples' variance tells; Sobol points do better than that.
    pub relmse: f64,
}

impl Reference {
    /// Reads it, or renders it and keeps it.
    pub fn new(gpu: &Gpu, view: &View, scene: &Scene, settings: &Settings, file: &Path) -> Result<Self> {
        if !file.exists() {
            eprintln!("rendering {} with {} samples per pixel", file.display(), settings.spp);
            let settings = view.settings(settings, settings.spp, SEED);
            let renderer = Renderer::new(gpu, scene, &settings, Outputs::FILTERED)?;
            let job = Job::new(&renderer);
            let status = job.run_to_end(&mut FrameResources::new(gpu)?)?;
            image::write(file, &job.film(&status)?, &WriteOptions::default())?;
        }
        let film = image::read(file)?;
        let [width, height] = view.size;
        ensure!(film.size() == view.size, "{}: is not {width} x {height}", file.display());
        Self::of_film(&film).with_context(|| format!("{}", file.display()))
    }

    fn of_film(film: &Film) -> Result<Self> {
        let picture = film.picture(None).map_err(|what| anyhow!(what))?;
        let variance = film.picture(Some("variance")).map_err(|what| anyhow!(what))?;
        let samples = film.channel("samples").context("has no layer of samples")?.to_f32();
        let relmse = metrics::relative_noise(&picture, &variance.pixels);
        let spp = samples.iter().map(|&n| f64::from(n)).sum::<f64>() / samples.len() as f64;
        Ok(Self { picture, spp, relmse })
    }
}
