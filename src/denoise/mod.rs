//! Denoising: what turns a render into light that filters can take, the filters, and the way back. The same kernels serve the
//! film of a renderer ([`Denoiser`], within an engine's frame) and the file of any renderer ([`Filtered`], once).
mod demodulated;
mod demodulation;
mod denoiser;
#[doc(hidden)]
pub mod expected;
pub mod file;
pub mod filter;
mod filtered;
mod gloss;
mod light_left;
mod noisy;
#[doc(hidden)]
pub mod sparse;
mod timed;
#[doc(hidden)]
pub mod twin;

pub use demodulation::Demodulation;
pub use denoiser::Denoiser;
pub use expected::ExpectedError;
pub(crate) use filtered::check_room;
pub use filtered::{Clean, Colour, Filtered, Recipe, bytes_per_pixel, host_bytes};
pub use light_left::note_of_lost_light;
pub use noisy::{Holds, Noisy};
pub(crate) use timed::Chain;
pub use timed::{Timed, timed};

use std::ops::Range;

/// Pixels that are copied between host and device at a time, so that whole planes never lie on both.
const WINDOW: usize = 1 << 16;

/// All pixels, a window at a time.
fn windows(pixels: usize) -> impl Iterator<Item = Range<usize>> {
    (0..pixels).step_by(WINDOW).map(move |first| first..pixels.min(first + WINDOW))
}
