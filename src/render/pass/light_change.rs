//! Finds how light has changed since the last frame, by paths that are traced before the scene changes and after it. Kernels:
//! `glsl/reproject/probe.comp`, `glsl/reproject/light_change.comp`. Twins: [`crate::twins::light_change`].
use crate::error::Result;
use crate::gpu::{Buffer, Recorder};
use crate::layout::{LightChange, LightChangePush, ProbePush};
use crate::render::history::{Handover, Probes};
use crate::shaders::{light_change, probe};

/// Distances between the cells that a level sums: windows of 3x3, 9x9 and 27x27 cells.
pub const SPACINGS: [u32; 3] = [1, 3, 9];

/// Traces the paths of `probes`. Before the scene changes: points\[P\], offered\[P\] -> probes\[cells\]; `after` it has changed:
/// probes\[cells\], history\[P\] -> changes\[cells\], each cell's own
pub fn trace(rec: &mut Recorder, probes: &Probes, handover: Handover, after: bool) -> Result<()> {
    let Handover { history: h, scene: s, tile: t, constants } = handover;
    let bind = probe::Bind {
        scene: s.bind(),
        light: probes.lights(s, after),
        frame: s.bind_frame(),
        ray_query: s.bind_world(),
        points: &t.points,
        history: &h.records,
        offered: &h.offered,
        previous: &h.previous,
        probes: &probes.probes,
        changes: &probes.changes[0],
    };
    let (constants, cells) = (probes.constants(constants), probes.cells[0] * probes.cells[1]);
    let push = ProbePush { constants, cells, after: after.into(), ..Default::default() };
    rec.dispatch_threads(&probes.trace, bind, &push, cells)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::{DeviceOptions, FrameResources, Gpu, Kernel, Location};
    use crate::math::hash::pcg;
    use crate::twins::light_change as twin;

    /// Grids of one cell, one row or one column are summed, too, up to the last of each.
    #[test]
    fn sums_agree_with_their_twin() {
        let gpu = Gpu::open(&DeviceOptions { validation: true, ..DeviceOptions::default() }).unwrap();
        let kernel = Kernel::<light_change::Bind>::new(&gpu, &Default::default()).unwrap();
        let mut frame = FrameResources::new(&gpu).unwrap();
        let unit = |i: u32, k: u32| pcg(pcg(i) ^ k) as f32 / u32::MAX as f32;
        let change = |i: u32| {
            let sum = [1, 2, 3].map(|k| 2.0 * unit(i, k) - 1.0);
            let size = sum.iter().fold(0.0f32, |most, v| most.max(v.abs()));
            let (light, change) = (1.0 + unit(i, 4), if unit(i, 6) < 0.02 { unit(i, 7) } else { 0.0 });
            LightChange { sum, size, squares: size * size, light, change, count: 1 }
        };
        let found = |i: u32| if unit(i, 5) < 0.2 { LightChange::default() } else { change(i) };
        for cells in [[1, 1], [17, 9], [64, 1], [65, 2], [1, 31], [40, 29]] {
            let threads = cells[0] * cells[1];
            let mut host: Vec<LightChange> = (0..threads).map(found).collect();
            for spacing in SPACINGS {
                let found = Buffer::from_slice(&gpu, "found", &host).unwrap();
                let sums = Buffer::new(&gpu, "sums", host.len(), Location::Readback).unwrap();
                let push = LightChangePush { cells, spacing, ..Default::default() };
                let bind = light_change::Bind { found: &found, sums: &sums };
                gpu.run(&mut frame, |rec| rec.dispatch_threads(&kernel, bind, &push, threads)).unwrap();
                host = twin::sums(&host, cells, spacing);
                for (i, (a, b)) in sums.read().unwrap().iter().zip(&host).enumerate() {
                    let values = |c: &LightChange| [c.sum[0], c.sum[1], c.sum[2], c.squares, c.light, c.change, c.size];
                    let near = values(a).iter().zip(values(b)).all(|(a, b)| (a - b).abs() <= 1e-5 * (1.0 + b.abs()));
                    assert!(a.count == b.count && near, "{cells:?}, spacing {spacing}, cell {i}: {a:?} {b:?}");
                }
            }
        }
        assert_eq!(gpu.validation_messages(), Vec::<String>::new());
    }
}
