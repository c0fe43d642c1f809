//! A render whose samples are taken: it is filtered, written, and told of.
use super::shot::Shot;
use super::summary::{Summary, text};
use super::{Args, Spans, outputs, planned};
use crate::cli::checkpoint::CheckpointFile;
use crate::cli::common::Warnings;
use crate::cli::files::Files;
use crate::cli::{fail_on_messages, interrupt};
use crate::denoise::filter::Method;
use crate::denoise::{self, Filtered, Noisy, Recipe};
use crate::error::Result;
use crate::gpu::{Gpu, total_ms};
use crate::image::Film;
use crate::image::aov::{Aovs, Names};
use crate::plan::Plan;
use crate::render::{Counters, Job, Status, StopReason, film};
use crate::report::table;
use crate::statistics::BrokenSamples;
use std::path::PathBuf;
use std::time::Duration;

/// A render that is over, and nowhere written yet.
pub struct Taken<'a> {
    gpu: &'a Gpu,
    film: Film,
    /// What the host did.
    host: Spans,
    status: Status,
    /// Rays and nodes, where they were counted.
    counters: Option<Counters>,
    /// What the filter says of its work.
    notes: Vec<String>,
    noisy: Option<Noisy>,
    files: Files,
    checkpoint: Option<CheckpointFile>,
    /// What `--resume` needs beside the options that were given; empty without a plan.
    instead: String,
}

/// A signal and a checkpoint wait for a step.
const STEP_TIME: Duration = Duration::from_secs(1);

/// Takes the samples of a shot, or of the one pixel that is asked for; none when it was interrupted before the first. `files` are those
/// that the run has written or may replace, `host` what it has taken time for, and `warnings` what it has warned of.
///
/// # Errors
/// [`crate::error::Error::Device`].
pub fn shoot<'gpu>(
    shot: Shot<'_, 'gpu>,
    mut files: Files,
    mut host: Spans,
    warnings: &mut Warnings,
) -> Result<Option<Taken<'gpu>>> {
    let Shot { args, gpu, job } = shot;
    let settings = job.renderer.settings();
    let noisy = args.filter(settings).map(|_| Noisy::of_film(job.renderer)).transpose()?;
    let pixel = args.pixel.map(|[x, y]| y * settings.width + x);
    let shot = Shot { args, gpu, job: Job { step_time: Some(STEP_TIME), pixel, ..job } };
    let (status, checkpoint) = host.time("render", || shot.trace(&mut files, warnings))?;
    if status.stopped == StopReason::Interrupted && status.traced == 0 {
        return Ok(None);
    }
    warnings.insist(status.broken_samples.iter().map(words_of_broken));
    let broken = status.broken_priorities;
    warnings.insist((broken > 0).then(|| format!("{broken} priorities were not finite and counted for nothing")));
    let seconds = host.seconds("render");
    let film = host.time("read back", || shot.film(&status, seconds))?;
    let counters = args.counters.then(|| job.renderer.counters()).transpose()?;
    let (notes, instead) = (Vec::new(), String::new());
    Ok(Some(Taken { gpu, film, host, status, counters, notes, noisy, files, checkpoint, instead }))
}

impl Taken<'_> {
    /// Whether all of its samples were taken.
    pub fn is_whole(&self) -> bool {
        self.status.stopped != StopReason::Interrupted
    }

    /// Says what `--resume` needs in place of the plan that was followed.
    pub fn resumes_by(&mut self, instead: String) {
        self.instead = instead;
    }

    /// Where the images were written of which the samples are not all taken, and how to go on if the device can.
    pub fn interruption(&self, written: &[PathBuf], can_resume: bool) -> String {
        outputs::interruption(written, can_resume, &self.instead)
    }

    /// What was rendered, filtered once [`Taken::finish`] has done so.
    pub fn film(&self) -> &Film {
        &self.film
    }

    /// The same, before it is written.
    pub fn film_mut(&mut self) -> &mut Film {
        &mut self.film
    }

    /// Filters what was rendered, writes it, tells how it went, and returns where the images are. Of one that is `alone`, and
    /// no frame of many, one file is written before it is filtered, too: the noisy image is there whatever becomes of the filter, which a
    /// signal ends. So does one at the end.
    ///
    /// # Errors
    /// Of every kind; an output that fails keeps no other from being written.
    pub fn finish(
        &mut self,
        args: &Args,
        plan: Option<&Plan>,
        alone: bool,
        warnings: &mut Warnings,
    ) -> Result<Vec<PathBuf>> {
        let noisy = self.noisy.take().filter(|_| self.is_whole());
        let infinite = non_finite(&self.film);
        warnings.insist(words_of_non_finite(infinite, 0));
        if let Some((method, noisy)) = args.denoise.zip(noisy) {
            if alone {
                self.save_noisy(args, warnings)?;
            }
            self.filter(method, noisy, plan.is_some())?;
            warnings.insist(words_of_non_finite(non_finite(&self.film), infinite));
        }
        let written = self.write_all(args, plan, warnings)?;
        if alone {
            self.files.end();
        }
        let summary = self.summary(plan, &written, warnings.all());
        args.common.report(&summary, || text(args, &summary))?;
        self.files.check()?;
        Ok(written)
    }

    /// From here on a signal ends the process, which says where the noisy image is.
    fn save_noisy(&mut self, args: &Args, warnings: &mut Warnings) -> Result<()> {
        let Self { film, host, files, checkpoint, instead, .. } = self;
        let item = outputs::before_filter(args, film);
        let save = || Ok(outputs::save_noisy(item.as_slice(), film, files, checkpoint, warnings));
        let line = outputs::unfiltered(&host.time("write", save)?, instead);
        let line = files.with_failures(&line);
        if interrupt::leave_at_once(&line) {
            interrupt::leave(&line);
        }
        Ok(())
    }

    /// With the filter's default settings, scaled to the image. A plan has told what error to expect, from renders that it compared.
    fn filter(&mut self, method: Method, noisy: Noisy, planned: bool) -> Result<()> {
        let gpu = self.gpu;
        let filter = || Filtered::new(gpu, noisy, &Recipe::new(method))?.join(gpu);
        let mut clean = self.host.time("denoise", filter)?;
        clean.expected = clean.expected.filter(|_| !planned);
        self.notes = clean.notes();
        if let Ok(aovs) = Aovs::find(&self.film, &Names::new()) {
            self.notes.extend(denoise::note_of_lost_light(&aovs, &clean.colour));
        }
        film::replace_colour(&mut self.film, clean.colour, method.name());
        self.status.times.extend(clean.times);
        Ok(())
    }

    /// Files first, then pipes, which may have no reader; returns the images.
    fn write_all(&mut self, args: &Args, plan: Option<&Plan>, warnings: &mut Warnings) -> Result<Vec<PathBuf>> {
        let whole = self.is_whole();
        let Self { gpu, film, host, status, files, checkpoint, .. } = self;
        let images = outputs::items(args, film);
        let save = || Ok(outputs::save(&images, film, files, checkpoint.take(), whole, warnings));
        let mut written = host.time("write", save)?;
        fail_on_messages(gpu)?;
        let mut more: Vec<_> = args.profile.iter().map(|path| host.item(path, gpu, &status.times)).collect();
        more.extend(planned::item(args, plan)?);
        files.save(&more, whole);
        written.extend(files.pipe(&images, whole));
        files.pipe(&more, whole);
        Ok(written)
    }

    /// In numbers, with the plan that it followed, the files that were written and what was warned of.
    fn summary(&self, plan: Option<&Plan>, written: &[PathBuf], warnings: &[String]) -> Summary {
        let Self { gpu, film, host, status, counters, notes, .. } = self;
        let counts = film.words("samples").unwrap_or_default();
        let gpu_ms = total_ms(&status.times);
        let missed = plan.filter(|_| self.is_whole()).and_then(|plan| plan.missed(gpu_ms));
        Summary {
            files: written.iter().map(|f| f.display().to_string()).collect(),
            width: film.width,
            height: film.height,
            samples: counts.iter().map(|&n| u64::from(n)).sum(),
            traced: status.traced,
            least_samples: counts.iter().copied().min().unwrap_or(0),
            most_samples: counts.iter().copied().max().unwrap_or(0),
            stopped: status.stopped,
            broken_priorities: status.broken_priorities,
            broken_samples: status.broken_samples,
            plan: plan.cloned(),
            counters: *counters,
            load_seconds: host.seconds("load scene"),
            compile_seconds: host.seconds("upload and compile"),
            seconds: host.seconds("render"),
            filter_seconds: host.seconds("denoise"),
            device: gpu.info().name.clone(),
            gpu_ms,
            passes: table::summarise(&status.times),
            notes: notes.iter().cloned().chain(missed).collect(),
            warnings: warnings.to_vec(),
        }
    }
}

/// How many pixels of the picture have a number that is not finite.
fn non_finite(film: &Film) -> usize {
    film.picture(None).map_or(0, |picture| picture.non_finite())
}

/// Of pixels of which `told` are known: a filter spreads those of its input, or leaves them out.
fn words_of_non_finite(count: usize, told: usize) -> Option<String> {
    (count > told).then(|| format!("{count} pixels are not finite"))
}

/// It is a bug, light too strong for the numbers, or too much work for a path on llvmpipe.
fn words_of_broken(broken: &BrokenSamples) -> String {
    let BrokenSamples { count, pixel: [x, y], sample, seed } = broken;
    format!(
        "wrong samples: {count}, which were no number and count as black, or whose rays meet so much that the driver \
         stopped them early; the first: pixel ({x}, {y}), sample {sample}, seed {seed}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_that_are_not_finite_are_told_once() {
        let mut film = Film::new(3, 1);
        film.add_vec3("", ["R", "G", "B"], &[[1.0, f32::NAN, 1.0], [f32::INFINITY; 3], [1.0; 3]]);
        let count = non_finite(&film);
        assert_eq!(words_of_non_finite(count, 0).as_deref(), Some("2 pixels are not finite"));
        assert_eq!((words_of_non_finite(count, count), words_of_non_finite(0, 0)), (None, None));
    }
}
