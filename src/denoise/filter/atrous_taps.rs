//! How threads divide an image at one level of an À-Trous transform: `glsl/shared/atrous_taps.glsl`.
use crate::shaders::shared::atrous_taps::ROWS;

/// Weight of one of five taps, `offset` from -2 to 2: twin of the kernels' `b3_spline`.
pub fn b3_spline(offset: i64) -> f32 {
    [3.0 / 8.0, 1.0 / 4.0, 1.0 / 16.0][offset.unsigned_abs() as usize]
}

/// Threads along x and y for an image of (width, height), whose taps are `spacing` pixels apart.
pub fn threads([width, height]: [u32; 2], spacing: u32) -> [u32; 2] {
    [width, height.div_ceil(ROWS as u32 * spacing) * spacing]
}
