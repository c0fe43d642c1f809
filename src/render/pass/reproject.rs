//! Carries the samples of the last frame to the pixels of a new one. Kernels: `glsl/reproject/*.comp`. Twins:
//! [`crate::twins::reproject`].
use crate::error::Result;
use crate::gpu::{Kernel, Recorder};
use crate::render::buffers::part_if;
use crate::render::history::{Forward, Handover, Way};
use crate::shaders::{carry, edges, gather, project, remember};

/// Before the scene changes, and before the new frame's primary hits: guide\[P\], points\[P\], stats\[P\], light\[P\] -> history\[P\]
pub fn remember(rec: &mut Recorder, handover: Handover) -> Result<()> {
    let Handover { history: h, scene: s, tile: t, .. } = handover;
    for (part, push) in handover.windows() {
        let bind = remember::Bind {
            scene: s.bind(),
            frame: s.bind_frame(),
            guide: &t.guide,
            stats: &t.stats,
            light: &t.light,
            points: &t.points,
            previous: &h.previous,
            carried: &h.carried,
            history: &h.records.part(part.clone())?,
            history_light: &part_if(t.has_light(), &h.light, &part)?,
            offered: &h.offered.part(part)?,
            instance_now: &h.numbers.instance_now,
            triangle_now: &h.numbers.triangle_now,
        };
        rec.dispatch_threads(&h.remember, bind, &push, push.pixels)?;
    }
    Ok(())
}

/// After them: history\[P\], guide\[P\], points\[P\], changes\[cells\] -> stats\[P\], light\[P\], carried\[P\]
pub fn carry(rec: &mut Recorder, handover: Handover) -> Result<()> {
    match &handover.history.way {
        Way::Forward(way) => forward(rec, way, handover),
        Way::Backward(gather) => backward(rec, gather, handover),
    }
}

fn forward(rec: &mut Recorder, way: &Forward, handover: Handover) -> Result<()> {
    let Handover { history: h, scene: s, tile: t, constants } = handover;
    for (part, push) in handover.windows() {
        let winner = &h.carried.part(part)?;
        let bind = edges::Bind { scene: s.bind(), frame: s.bind_frame(), guide: &t.guide, points: &t.points, winner };
        rec.dispatch_threads(&way.edges, bind, &push, push.pixels)?;
    }
    let bind = project::Bind {
        scene: s.bind(),
        frame: s.bind_frame(),
        history: &h.records,
        guide: &t.guide,
        changes: h.light_change(),
        previous: &h.previous,
        offered: &h.offered,
        winner: &h.carried,
    };
    rec.dispatch_threads(&way.project, bind, &h.push(constants, 0, t.pixels), t.pixels)?;
    for (part, push) in handover.windows() {
        let bind = carry::Bind {
            frame: s.bind_frame(),
            history: &h.records,
            history_light: &h.light,
            offered: &h.offered,
            previous: &h.previous,
            stats: &t.stats.part(part.clone())?,
            light: &part_if(t.has_light(), &t.light, &part)?,
            points: &t.points.part(part.clone())?,
            winner: &h.carried.part(part)?,
        };
        rec.dispatch_threads(&way.carry, bind, &push, push.pixels)?;
    }
    Ok(())
}

fn backward(rec: &mut Recorder, gather: &Kernel<gather::Bind<'static>>, handover: Handover) -> Result<()> {
    let Handover { history: h, scene: s, tile: t, .. } = handover;
    for (part, push) in handover.windows() {
        let bind = gather::Bind {
            scene: s.bind(),
            frame: s.bind_frame(),
            guide: &t.guide,
            points: &t.points,
            history: &h.records,
            history_light: &h.light,
            offered: &h.offered,
            changes: h.light_change(),
            previous: &h.previous,
            stats: &t.stats.part(part.clone())?,
            light: &part_if(t.has_light(), &t.light, &part)?,
            carried: &h.carried.part(part)?,
        };
        rec.dispatch_threads(gather, bind, &push, push.pixels)?;
    }
    Ok(())
}
