//! Renders noisy images and their references.
use crate::Args;
pub use crate::view::View;
use anyhow::{Context, bail};
use std::path::{Path, PathBuf};
use std::process::Command;
use tallow::image::source::Source;

impl View {
    /// Renders the view, unless an earlier run has done so.
    ///
    /// # Errors
    /// When the scene cannot be found or rendered.
    pub fn render(&self, args: &Args, spp: u32) -> anyhow::Result<Source> {
        // References have another seed, because their samples must not be those of the noisy image.
        let seed = if spp == self.reference { "1" } else { "0" };
        self.once(args, spp, &self.file(args, spp), &["--seed", seed])
    }

    /// As [`View::render`] with other samples.
    ///
    /// # Errors
    /// As [`View::render`].
    pub fn render_again(&self, args: &Args, spp: u32) -> anyhow::Result<Source> {
        self.once(args, spp, &self.file(args, spp).with_extension("again.exr"), &["--seed", "3"])
    }

    /// As [`View::render`] with other samples, all of them at the centres of the pixels.
    ///
    /// # Errors
    /// As [`View::render`].
    pub fn render_centres(&self, args: &Args, spp: u32) -> anyhow::Result<Source> {
        let file = self.file(args, spp).with_extension("centres.exr");
        self.once(args, spp, &file, &["--seed", "2", "--filter", "point"])
    }

    fn once(&self, args: &Args, spp: u32, file: &Path, options: &[&str]) -> anyhow::Result<Source> {
        if !file.exists() {
            run(self, args, spp, file, options)?;
        }
        Ok(Source::read(file)?)
    }

    /// Path of a render of the view.
    pub fn file(&self, args: &Args, spp: u32) -> PathBuf {
        let [width, height] = self.size;
        args.output.join(format!("{}-{width}x{height}-{spp}spp.exr", self.name))
    }
}

fn run(view: &View, args: &Args, spp: u32, file: &Path, options: &[&str]) -> anyhow::Result<()> {
    let scene = view.scene_file(&args.data, &args.output)?;
    eprintln!("rendering {} with {spp} samples per pixel", view.name);
    let [width, height] = view.size.map(|n| n.to_string());
    let (spp, depth) = (spp.to_string(), view.depth.to_string());
    let mut command = Command::new(&args.tallow);
    command.arg("render").arg(scene).arg("-o").arg(file).arg("--quiet");
    command.args(["--width", &width, "--height", &height, "--spp", &spp, "--max-depth", &depth]);
    command.args(["--roulette-depth", "0"]).args(options);
    let output = command.output().with_context(|| format!("cannot start {}", args.tallow.display()))?;
    if !output.status.success() {
        bail!("{}: {}", output.status, String::from_utf8_lossy(&output.stderr).trim());
    }
    Ok(())
}
