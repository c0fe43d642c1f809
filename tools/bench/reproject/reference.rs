//! Converged images, and how far others are from them.
use anyhow::{Result, anyhow, ensure};
use std::path::Path;
use tallow::gpu::{FrameResources, Gpu};
use tallow::image::{self, Film, Picture, WriteOptions, metrics};
use tallow::layout::{Camera, vec3};
use tallow::render::{Job, Outputs, Renderer};
use tallow::scene::Loaded;

/// Share of the pixels that are left out of an error, those where it is largest: fireflies would decide it alone.
const TRIMMED: f64 = 0.001;

/// A converged image, and the variance of its pixels' means.
pub struct Reference {
    pub picture: Picture,
    variance: Vec<vec3>,
}

impl Reference {
    /// Renders it, or reads it from `file`, and keeps it there.
    pub fn new(gpu: &Gpu, scene: &Loaded, camera: Camera, spp: u32, file: Option<&Path>) -> Result<Self> {
        let size = scene.settings.size();
        let film = match file {
            Some(file) if file.exists() => image::read(file)?,
            _ => {
                let film = render(gpu, scene, camera, spp)?;
                file.map_or(Ok(()), |file| image::write(file, &film, &WriteOptions::default()))?;
                film
            }
        };
        ensure!(film.size() == size, "a reference of {} x {} pixels", film.width, film.height);
        let layer = |name| film.picture(name).map_err(|what| anyhow!(what));
        Ok(Self { picture: layer(None)?, variance: layer(Some("variance"))?.pixels })
    }

    /// The relative MSE without the largest 0.1 % of pixels.
    pub fn error(&self, picture: &Picture) -> f64 {
        metrics::trimmed_mean(metrics::relative_squares(picture, &self.picture), TRIMMED)
    }

    /// What of an error is the reference's own, about.
    pub fn noise(&self) -> f64 {
        metrics::relative_noise(&self.picture, &self.variance)
    }

    /// How far a picture is off, in units of the reference's brightness there.
    pub fn off(&self, picture: &Picture) -> Vec<f64> {
        let pairs = picture.pixels.iter().zip(&self.picture.pixels);
        pairs.map(|(a, b)| (grey(a) - grey(b)) / scale(b)).collect()
    }

    /// The mean absolute change from this error image to the next that a picture without any error would show, about.
    pub fn flicker(&self, next: &Self) -> f64 {
        // Channels of one path rise and fall together.
        let squared = |r: &Self, i: usize| {
            let deviation = grey(&r.variance[i].map(f32::sqrt)) / scale(&r.picture.pixels[i]);
            deviation * deviation
        };
        let change = |i| (squared(self, i) + squared(next, i)).sqrt() * (2.0 / std::f64::consts::PI).sqrt();
        (0..self.variance.len()).map(change).sum::<f64>() / self.variance.len() as f64
    }
}

fn render(gpu: &Gpu, scene: &Loaded, camera: Camera, spp: u32) -> Result<Film> {
    let long = scene.clone().with(|s| (s.spp, s.seed) = (spp, 1 << 20));
    let mut renderer = Renderer::new(gpu, &long, &long.settings, Outputs::default())?;
    renderer.set_camera(camera)?;
    let job = Job::new(&renderer);
    let status = job.run_to_end(&mut FrameResources::new(gpu)?)?;
    Ok(job.film(&status)?)
}

fn grey(p: &vec3) -> f64 {
    p.iter().map(|&v| f64::from(v)).sum::<f64>() / 3.0
}

fn scale(p: &vec3) -> f64 {
    grey(p) + 0.01
}
