//! How far filters reach: what several of them are told alike.
use crate::settings::settings;

settings! {
    /// How far filters reach.
    #[derive(Clone, Copy, Debug, PartialEq)]
    pub struct FootprintSettings {
        /// What is given of them.
        FootprintOverrides {
            /// Levels, each of which reaches twice as far as the last; auto takes at most 3.
            levels: u32 = 5, 1..=Self::MAX_LEVELS;
            /// Pixels from the centre of a window to its border.
            radius: u32 = 24, 0..=4096;
        }
    }
}

impl FootprintSettings {
    /// The most levels of a wavelet filter; the footprint of so many is 4 * 2^levels - 3 pixels wide.
    pub const MAX_LEVELS: u32 = 10;
}
