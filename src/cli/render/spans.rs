//! What the host did and when, for the trace.
use crate::cli::files::Item;
use crate::error::Result;
use crate::gpu::{self, Gpu, PassTime};
use crate::report::trace::chrome_trace;
use std::path::Path;

/// Host-side stages, for the trace.
#[derive(Default)]
pub struct Spans(Vec<PassTime>);

impl Spans {
    /// Does some of it, and notes when.
    ///
    /// # Errors
    /// Those of `work`.
    pub fn time<T>(&mut self, name: &'static str, work: impl FnOnce() -> Result<T>) -> Result<T> {
        let begin_ns = gpu::host_ns();
        let result = work();
        self.0.push(PassTime { name, begin_ns, end_ns: gpu::host_ns() });
        result
    }

    /// What the stages of a name took.
    pub fn seconds(&self, name: &str) -> f64 {
        let spans = self.0.iter().filter(|s| s.name == name);
        spans.map(PassTime::duration_ns).sum::<u64>() as f64 * 1e-9
    }

    /// A file of them beside the passes on the device.
    pub fn item(&self, path: &Path, gpu: &Gpu, passes: &[PassTime]) -> Item<'static> {
        Item::bytes(path.to_owned(), chrome_trace(&self.0, passes, gpu.calibrate()).into_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The sum of no floats is -0, which JSON shows.
    #[test]
    fn what_was_not_done_took_no_time() {
        assert!(Spans::default().seconds("denoise").is_sign_positive());
    }
}
