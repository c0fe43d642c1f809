//! A render that goes on, and its films then and at its end.
use super::Args;
use crate::cli::checkpoint::{self, CheckpointFile};
use crate::cli::common::Warnings;
use crate::cli::files::Files;
use crate::cli::interrupt;
use crate::cli::progress::Progress;
use crate::error::Result;
use crate::gpu::{FrameResources, Gpu};
use crate::image::Film;
use crate::render::{Job, Status};
use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::atomic::Ordering;
use std::time::{Instant, SystemTime};

/// What a film is made of while its render goes on, and at its end.
#[derive(Clone, Copy)]
pub struct Shot<'a, 'gpu> {
    /// What the user wants.
    pub args: &'a Args,
    /// What renders it.
    pub gpu: &'gpu Gpu,
    /// The render.
    pub job: Job<'a>,
}

impl Shot<'_, '_> {
    /// Reads back what there is, after so many seconds of rendering.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn film(&self, status: &Status, seconds: f64) -> Result<Film> {
        let mut film = self.job.film(status)?;
        film.metadata.extend(metadata(self.args, self.gpu, seconds));
        Ok(film)
    }

    /// Takes the samples, shows how far it is, and writes checkpoints on the way.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn trace(&self, files: &mut Files, warnings: &mut Warnings) -> Result<(Status, Option<CheckpointFile>)> {
        let Shot { args, gpu, job } = *self;
        let mut checkpoint = args.checkpoint.map(|every| {
            let path = checkpoint::path(&args.output_files(), &args.scene);
            let resumed = files.place_of(&path);
            CheckpointFile::new(every, path, resumed)
        });
        let (begun, mut progress) = (Instant::now(), None);
        // Until here there is nothing to keep, and a signal ends the process.
        let stop = interrupt::flag();
        let mut between = |status: &Status| {
            let progress = progress.get_or_insert_with(|| Progress::new(status.planned, !args.common.talkative()));
            progress.set(status.done);
            if progress.wants_speed() {
                progress.set_speed(job.rays_of_a_few(status)?);
            }
            if stop.load(Ordering::SeqCst) {
                return Ok(ControlFlow::Break(()));
            }
            if let Some(checkpoint) = checkpoint.as_mut().filter(|c| status.traced > 0 && c.is_due()) {
                checkpoint.write(files, &self.film(status, begun.elapsed().as_secs_f64())?, warnings);
            }
            Ok(ControlFlow::Continue(()))
        };
        let status = job.run(&mut FrameResources::new(gpu)?, &mut between)?;
        progress.iter().for_each(Progress::finish);
        Ok((status, checkpoint))
    }
}

/// Of an image's metadata: which frame of a sequence it is.
pub const FRAME: &str = "frame";

fn metadata(args: &Args, gpu: &Gpu, seconds: f64) -> BTreeMap<String, String> {
    let info = gpu.info();
    let since_epoch = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let entries = [
        ("scene", args.scene.display().to_string()),
        ("device", info.name.clone()),
        ("driver", info.driver()),
        ("cpu", crate::machine::cpu()),
        ("renderSeconds", format!("{seconds:.3}")),
        ("dateUnix", since_epoch.as_secs().to_string()),
    ];
    let chosen = args.choices.given().map(|(key, name)| (key, name.to_owned()));
    entries.into_iter().chain(chosen).map(|(k, v)| (k.to_owned(), v)).collect()
}
