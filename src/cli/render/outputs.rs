//! The files that a render writes.
use super::{Args, planned};
use crate::cli::checkpoint::{self, CheckpointFile};
use crate::cli::common::Warnings;
use crate::cli::files::{Files, Item, check_distinct, check_not_of_scene};
use crate::cli::{check_png, quoted};
use crate::error::Result;
use crate::image::difference::false_colours;
use crate::image::output::{self, Stream};
use crate::image::{self, Film, WriteOptions};
use crate::scene::{Scene, SceneFile};
use std::path::{Path, PathBuf};

/// A render may take hours; what cannot be written, or would replace what it is not to, is told before.
///
/// # Errors
/// [`crate::error::Error::Usage`] and [`crate::error::Error::Output`].
pub fn check(args: &Args) -> Result<()> {
    if !SceneFile::is_named(&args.scene) {
        // The error of opening it, before that of an output that has its name: an image's default output is the image itself.
        SceneFile::open(&args.scene)?;
    }
    let (images, checkpoint) = (args.output_files(), checkpoint::path(&args.output_files(), &args.scene));
    images.iter().try_for_each(|path| image::check_writable(path))?;
    args.heatmap.iter().try_for_each(|path| check_png("--heatmap", path))?;
    args.profile.iter().try_for_each(|path| output::check(path))?;
    if args.checkpoint.is_some() {
        output::check(&checkpoint)?;
    }
    if let Some(path) = planned::to_write(args) {
        output::check(path)?;
    }
    let (layers, colours): (Vec<_>, Vec<_>) =
        images.iter().map(|path| ("-o", path.as_path())).partition(|(_, path)| image::has_layers(path));
    let others: Vec<_> = colours.into_iter().chain(beside_images(args)).collect();
    let followed = args.plan.iter().filter(|_| !planned::is_made(args)).map(|path| ("--plan", path.as_path()));
    let resumed = args.resume.iter().map(|path| ("--resume", path.as_path()));
    // A resumed file may become the complete one.
    check_distinct(&others, &resumed.chain(followed).collect::<Vec<_>>())?;
    let partial = args.checkpoint.map(|_| ("--checkpoint", checkpoint.as_path()));
    let all: Vec<_> = layers.into_iter().chain(others).chain(partial).collect();
    check_distinct(&all, &[("the scene", &args.scene)])
}

/// What is written beside images, by its option.
fn beside_images(args: &Args) -> impl Iterator<Item = (&'static str, &Path)> {
    let maps = args.heatmap.iter().map(|path| ("--heatmap", path.as_path()));
    let traces = args.profile.iter().map(|path| ("--profile", path.as_path()));
    let plans = planned::to_write(args).map(|path| ("--plan", path));
    maps.chain(traces).chain(plans)
}

/// Once the scene is loaded, which tells what it is made of.
///
/// # Errors
/// [`crate::error::Error::Usage`].
pub fn check_with(args: &Args, scene: &Scene) -> Result<()> {
    check_not_of_scene(&all(args), scene)
}

/// All files that are written, by their options.
pub fn all(args: &Args) -> Vec<(&'static str, PathBuf)> {
    let option = if args.outputs.is_empty() { "the default output" } else { "-o" };
    let images = args.output_files().into_iter().map(|path| (option, path));
    images.chain(beside_images(args).map(|(option, path)| (option, path.to_owned()))).collect()
}

/// Writes those of the items that are files, and brings the checkpoint up to date or removes it: where an image has all layers, or
/// the render is complete, it is not needed any more.
pub fn save(
    items: &[Item],
    film: &Film,
    files: &mut Files,
    checkpoint: Option<CheckpointFile>,
    whole: bool,
    warnings: &mut Warnings,
) -> Vec<PathBuf> {
    let mut written = files.save(items, whole);
    let Some(mut checkpoint) = checkpoint else { return written };
    if !whole && !written.iter().any(|path| image::has_layers(path)) {
        written.extend(checkpoint.write(files, film, warnings));
    }
    if files.check().is_ok() {
        checkpoint.remove(&written);
    }
    written
}

/// Writes the one image from before a filter runs, that of [`before_filter`] if there is one. Where it lacks layers, a checkpoint holds
/// what the filter and further samples need, until all is written.
pub fn save_noisy(
    item: &[Item],
    film: &Film,
    files: &mut Files,
    checkpoint: &mut Option<CheckpointFile>,
    warnings: &mut Warnings,
) -> Vec<PathBuf> {
    if item.iter().any(|item| image::has_layers(&item.path)) {
        return save(item, film, files, checkpoint.take(), true, warnings);
    }
    let mut written = save(item, film, files, None, true, warnings);
    written.extend(checkpoint.as_mut().and_then(|checkpoint| checkpoint.write(files, film, warnings)));
    written
}

/// Writes what a finished film can be written to again and is no file of layers that is there: its colours may be asked for otherwise.
///
/// # Errors
/// [`crate::error::Error::Output`].
pub fn save_pictures(args: &Args, film: &Film) -> Result<()> {
    let mut items = items(args, film);
    items.retain(|item| !image::has_layers(&item.path) || !item.path.exists());
    let mut files = Files::of_frame();
    files.save(&items, true);
    files.pipe(&items, true);
    files.check()
}

/// The one image that is written before a filter runs, so that no sample is lost whatever becomes of that: the first file with
/// all layers, or else the first file. None where all are pipes.
pub fn before_filter<'a>(args: &Args, film: &'a Film) -> Option<Item<'a>> {
    let files = args.output_files().into_iter().filter(|path| !output::is_special(path));
    let path = files.min_by_key(|path| !image::has_layers(path))?;
    Some(Item::image(path, film, args.png.write_options()))
}

/// Says what there is when a signal ends the filter. `instead` is what goes behind the file to resume.
pub fn unfiltered(written: &[PathBuf], instead: &str) -> String {
    if written.is_empty() {
        return "interrupted: --denoise was not finished, and nothing was written".to_owned();
    }
    let how = written.iter().find(|path| image::has_layers(path));
    let how = how
        .map(|path| format!("; --resume {}{instead} filters it", quoted(&path.display().to_string())))
        .unwrap_or_default();
    format!("interrupted: the noisy image was written to {}, --denoise was not finished{how}", names(written))
}

/// The images: a film's own, and that of its samples.
pub fn items<'a>(args: &'a Args, film: &'a Film) -> Vec<Item<'a>> {
    let options = args.png.write_options();
    let images = args.output_files().into_iter().map(|path| Item::image(path, film, options));
    let heatmap = |path: &PathBuf| Item { path: path.clone(), fill: Box::new(|stream| heatmap(film, stream)) };
    images.chain(args.heatmap.iter().map(heatmap)).collect()
}

/// Says where what there is was written, and how to go on where a device can. `instead` is what goes behind the file to resume.
pub fn interruption(written: &[PathBuf], can_resume: bool, instead: &str) -> String {
    let resumable = written.iter().find(|path| can_resume && image::has_layers(path));
    let how = resumable.map(|path| format!("; --resume {}{instead} continues it", quoted(&path.display().to_string())));
    format!("interrupted: what there is was written to {}{}", names(written), how.unwrap_or_default())
}

fn names(written: &[PathBuf]) -> String {
    written.iter().map(|path| path.display().to_string()).collect::<Vec<_>>().join(", ")
}

/// Samples per pixel from 0 (dark) to the largest number (bright).
fn heatmap(film: &Film, stream: &mut dyn Stream) -> std::io::Result<()> {
    let counts = film.words("samples").unwrap_or_default();
    let most = counts.iter().copied().max().unwrap_or(0).max(1);
    let values: Vec<f32> = counts.iter().map(|&n| n as f32).collect();
    let picture = false_colours(film.width, &values, most as f32);
    image::encode(Path::new("map.png"), &Film::from(&picture), &WriteOptions::default(), stream)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_told_of_an_interruption_can_be_typed() {
        let written = [PathBuf::from("a.png"), PathBuf::from("my out.exr")];
        let line = interruption(&written, true, "");
        assert!(line.ends_with("written to a.png, my out.exr; --resume 'my out.exr' continues it"), "{line}");
        assert!(!interruption(&written, false, "").contains("--resume"));
    }
}
