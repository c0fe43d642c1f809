//! How threads divide an image at one level of an À-Trous transform: `glsl/shared/atrous_taps.glsl`.
use crate::shaders::shared::atrous_taps::ROWS;

/// Threads along x and y for an image of (width, height), whose taps are `spacing` pixels apart.
pub fn threads([width, height]: [u32; 2], spacing: u32) -> [u32; 2] {
    [width, height.div_ceil(ROWS as u32 * spacing) * spacing]
}
