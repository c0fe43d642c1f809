//! The scenes that the papers' are replaced by, with size, depth and samples.
use crate::Args;
use crate::scenes;
use anyhow::{Context, bail};
use std::path::{Path, PathBuf};
use std::process::Command;
use tallow::image::source::Source;
use xxhash_rust::xxh3::Xxh3Default;

/// A scene with the parameters of its renders.
#[derive(Clone, Copy)]
pub struct View {
    /// Name for files and tables.
    pub name: &'static str,
    /// A name known to the converter, or a scene file of the repository.
    pub scene: &'static str,
    /// Width and height in pixels that a software device renders in minutes.
    pub size: [u32; 2],
    /// Width and height of the paper, for `--full`.
    pub full: [u32; 2],
    /// Largest number of path edges.
    pub depth: u32,
    /// Samples per pixel of the reference.
    pub reference: u32,
}

impl View {
    /// Width and height in pixels.
    pub fn size(&self, args: &Args) -> [u32; 2] {
        if args.full { self.full } else { self.size }
    }

    /// Name and size, for tables.
    pub fn label(&self, args: &Args) -> String {
        let [width, height] = self.size(args);
        format!("{} {width}x{height}", self.name)
    }

    /// Returns the path of the scene file. An outside scene is converted into the output folder.
    ///
    /// # Errors
    /// When the scene cannot be found.
    pub fn scene_file(&self, args: &Args) -> anyhow::Result<PathBuf> {
        match self.scene.ends_with(".toml") {
            true => Ok(Path::new(env!("CARGO_MANIFEST_DIR")).join(self.scene)),
            false => scenes::convert(self.scene, &args.data, &args.output),
        }
    }

    /// Renders the view with some samples per pixel and more options, unless an earlier run has done so; `kind` tells files apart.
    /// Other seeds than 1 are for noisy images, because samples of the reference must not be theirs.
    ///
    /// # Errors
    /// When the scene cannot be found or rendered.
    pub fn render(&self, args: &Args, spp: u32, seed: u32, kind: &str, options: &[&str]) -> anyhow::Result<Source> {
        let [width, height] = self.size(args);
        let scene = self.scene_file(args)?;
        let name = format!("{}-{width}x{height}-depth{}-{spp}spp-seed{seed}{kind}.exr", self.name, self.depth);
        let file = folder(args, &scene)?.join(name);
        if !file.exists() {
            eprintln!("rendering {}", file.display());
            self.run(args, [&scene, &file], &[("--spp", spp), ("--seed", seed)], options)?;
        }
        Ok(Source::read(&file)?)
    }

    /// The reference of the view, by default the pixels' mean.
    ///
    /// # Errors
    /// As [`View::render`].
    pub fn reference(&self, args: &Args) -> anyhow::Result<Source> {
        self.render(args, self.reference, 1, "", &[])
    }

    fn run(
        &self,
        args: &Args,
        [scene, file]: [&Path; 2],
        numbers: &[(&str, u32)],
        options: &[&str],
    ) -> anyhow::Result<()> {
        let [width, height] = self.size(args);
        let mut command = Command::new(&args.tallow);
        command.arg("render").arg(scene).arg("-o").arg(file);
        // The papers filter indirect light alone, or all light.
        command.args(["--quiet", "--split", "indirect", "--roulette-depth", "0"]).args(options);
        let own = [("--width", width), ("--height", height), ("--max-depth", self.depth)];
        let numbers = own.iter().chain(numbers);
        command.args(numbers.flat_map(|(name, value)| [(*name).to_owned(), value.to_string()]));
        let output = command.output().with_context(|| format!("cannot start {}", args.tallow.display()))?;
        if !output.status.success() {
            bail!("{}: {}", output.status, String::from_utf8_lossy(&output.stderr).trim());
        }
        Ok(())
    }
}

/// The folder for renders of a scene file: those of another commit, program or scene are not taken for them.
fn folder(args: &Args, scene: &Path) -> anyhow::Result<PathBuf> {
    let mut hash = Xxh3Default::new();
    for file in [args.tallow.as_path(), scene] {
        hash.update(&std::fs::read(file).with_context(|| file.display().to_string())?);
    }
    let folder = args.output.join(format!("{}-{:016x}", args.commit, hash.digest()));
    std::fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
    Ok(folder)
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use std::fs;

    #[test]
    fn renders_of_another_commit_program_or_scene_lie_elsewhere() {
        let out = tempfile::tempdir().unwrap();
        let [program, scene] = ["tallow", "scene.toml"].map(|name| out.path().join(name));
        for file in [&program, &scene] {
            fs::write(file, "old").unwrap();
        }
        let of = |commit| {
            let [output, program] = [out.path(), program.as_path()].map(|path| path.to_str().unwrap());
            let words = ["papers", "--data", ".", "--commit", commit, "--output", output, "--tallow", program];
            folder(&Args::parse_from(words), &scene).unwrap()
        };
        let first = of("a");
        assert!(first.is_dir() && of("a") == first && of("b") != first);
        fs::write(&scene, "new").unwrap();
        let second = of("a");
        fs::write(&program, "new").unwrap();
        assert!(second != first && ![first, second].contains(&of("a")));
    }
}
