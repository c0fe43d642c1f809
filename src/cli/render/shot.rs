//! Films of a render, while it goes on and at its end.
use super::Args;
use crate::error::Result;
use crate::gpu::Gpu;
use crate::image::Film;
use crate::render::{Job, Status};
use std::collections::BTreeMap;
use std::time::SystemTime;

/// What a film is made of while its render goes on, and at its end.
#[derive(Clone, Copy)]
pub struct Shot<'a> {
    /// What the user wants.
    pub args: &'a Args,
    /// What renders it.
    pub gpu: &'a Gpu,
    /// The render.
    pub job: Job<'a>,
}

impl Shot<'_> {
    /// Reads back what there is, after so many seconds of rendering.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn film(&self, status: &Status, seconds: f64) -> Result<Film> {
        let mut film = self.job.film(status)?;
        film.metadata.extend(metadata(self.args, self.gpu, seconds));
        Ok(film)
    }
}

fn metadata(args: &Args, gpu: &Gpu, seconds: f64) -> BTreeMap<String, String> {
    let info = gpu.info();
    let since_epoch = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default();
    let entries = [
        ("software", format!("tallow {}", env!("CARGO_PKG_VERSION"))),
        ("scene", args.scene.display().to_string()),
        ("device", info.name.clone()),
        ("driver", format!("{} {} {}", info.driver_name, info.driver_version, info.driver_info)),
        ("renderSeconds", format!("{seconds:.3}")),
        ("dateUnix", since_epoch.as_secs().to_string()),
    ];
    entries.map(|(k, v)| (k.to_owned(), v)).into()
}
