//! Measures scenes that move: what moving costs (100 instances in Crytek Sponza, a cloth of 100,000 triangles that is refitted or
//! built anew), and whether hierarchies, filters and samples follow characters, as in the dynamic scene of
//! Bauszat, Eisemann and Magnor 2011 ("Guided image filtering for interactive high-quality global illumination").
//!   TALLOW_DATA=../shared cargo run --release --example bench-motion [FRAMES [cost|follow]]
#![allow(missing_docs)]
mod cost;
mod follow;

use anyhow::{Context, Result};
use std::path::Path;
use tallow::gpu::{DeviceOptions, Gpu};

fn main() -> Result<()> {
    let frames = std::env::args().nth(1).map_or(Ok(9), |n| n.parse())?;
    let part = std::env::args().nth(2);
    let wants = |name| part.as_deref().is_none_or(|part| part == name);
    let data = std::env::var_os("TALLOW_DATA").context("TALLOW_DATA names no folder of outside data")?;
    let (gpu, data) = (Gpu::open(&DeviceOptions::default())?, Path::new(&data));
    let info = gpu.info();
    println!("{} ({} {})\n", info.name, info.driver_name, info.driver_info);
    if wants("cost") {
        cost::report(&gpu, data, frames)?;
    }
    if wants("follow") {
        follow::report(&gpu, data, frames)?;
    }
    Ok(())
}
