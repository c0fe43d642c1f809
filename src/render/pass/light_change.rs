//! Finds how light has changed since the last frame, by paths that are traced before the scene changes and after it. Kernels:
//! `glsl/reproject/probe.comp`, `glsl/reproject/light_change.comp`. Twins: [`crate::twins::light_change`].
use crate::error::Result;
use crate::gpu::{Buffer, Recorder};
use crate::layout::{LightChange, LightChangePush, PathConstants, ProbePush};
use crate::render::buffers::{DeviceScene, FilmTile};
use crate::render::history::History;
use crate::shaders::{light_change, probe};

/// Distances between the cells that a level sums: windows of 3x3, 9x9 and 27x27 cells.
pub const SPACINGS: [u32; 3] = [1, 3, 9];

/// Before the scene changes: points\[P\], offered\[P\] -> probes\[cells\]
pub fn before(rec: &mut Recorder, h: &History, s: &DeviceScene, t: &FilmTile, c: &PathConstants) -> Result<()> {
    trace(rec, h, s, t, c, false)
}

/// After it has changed: probes\[cells\], history\[P\] -> changes\[cells\]
pub fn after(rec: &mut Recorder, h: &History, s: &DeviceScene, t: &FilmTile, c: &PathConstants) -> Result<()> {
    trace(rec, h, s, t, c, true)?;
    let [a, b] = &h.changes;
    let mut level = |found: &Buffer<LightChange>, sums: &Buffer<LightChange>, spacing: u32| {
        let push = LightChangePush { cells: h.cells, spacing, ..Default::default() };
        rec.dispatch_threads(&h.light_change, light_change::Bind { found, sums }, &push, h.cells[0] * h.cells[1])
    };
    level(a, b, SPACINGS[0])?;
    level(b, a, SPACINGS[1])?;
    level(a, b, SPACINGS[2])
}

fn trace(
    rec: &mut Recorder,
    h: &History,
    s: &DeviceScene,
    t: &FilmTile,
    constants: &PathConstants,
    after: bool,
) -> Result<()> {
    let bind = probe::Bind {
        scene: h.probe_scene(s, after),
        frame: s.bind_frame(),
        points: &t.points,
        history: &h.records,
        offered: &h.offered,
        previous: &h.previous,
        probes: &h.probes,
        changes: &h.changes[0],
    };
    let (constants, cells) = (h.probe_constants(constants), h.cells[0] * h.cells[1]);
    rec.dispatch_threads(
        &h.probe,
        bind,
        &ProbePush { constants, cells, after: after.into(), ..Default::default() },
        cells,
    )
}
