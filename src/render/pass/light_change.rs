//! Finds how light has changed since the last frame, by paths that are traced before the scene changes and after it. Kernels:
//! `glsl/reproject/probe.comp`, `glsl/reproject/light_change.comp`. Twins: [`crate::twins::light_change`].
use crate::error::Result;
use crate::gpu::{Buffer, Recorder};
use crate::layout::{LightChange, LightChangePush, PathConstants, ProbePush};
use crate::render::buffers::{DeviceScene, FilmTile};
use crate::render::history::{History, Probes};
use crate::shaders::{light_change, probe};

/// Distances between the cells that a level sums: windows of 3x3, 9x9 and 27x27 cells.
pub const SPACINGS: [u32; 3] = [1, 3, 9];

/// Traces the paths of `h`'s probes `p`. Before the scene changes: points\[P\], offered\[P\] -> probes\[cells\]; `after` it has changed:
/// probes\[cells\], history\[P\] -> changes\[cells\], each cell's own
pub fn trace(
    rec: &mut Recorder,
    (h, p): (&History, &Probes),
    s: &DeviceScene,
    t: &FilmTile,
    constants: &PathConstants,
    after: bool,
) -> Result<()> {
    let bind = probe::Bind {
        scene: s.bind(),
        light: p.lights(s, after),
        frame: s.bind_frame(),
        ray_query: s.bind_world(),
        points: &t.points,
        history: &h.records,
        offered: &h.offered,
        previous: &h.previous,
        probes: &p.probes,
        changes: &p.changes[0],
    };
    let (constants, cells) = (p.constants(constants), p.cells[0] * p.cells[1]);
    rec.dispatch_threads(
        &p.trace,
        bind,
        &ProbePush { constants, cells, after: after.into(), ..Default::default() },
        cells,
    )
}

/// changes\[cells\], each cell's own -> changes\[cells\], of windows around them
pub fn sum(rec: &mut Recorder, probes: &Probes) -> Result<()> {
    let ([a, b], cells) = (&probes.changes, probes.cells);
    let mut level = |found: &Buffer<LightChange>, sums: &Buffer<LightChange>, spacing: u32| {
        let push = LightChangePush { cells, spacing, ..Default::default() };
        rec.dispatch_threads(&probes.sum, light_change::Bind { found, sums }, &push, cells[0] * cells[1])
    };
    level(a, b, SPACINGS[0])?;
    level(b, a, SPACINGS[1])?;
    level(a, b, SPACINGS[2])
}
