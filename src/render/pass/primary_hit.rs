//! Primary hits at pixel centres. Kernel: `glsl/trace/primary_hit.comp`. Twin: [`crate::twins::primary_hit`].
use crate::error::Result;
use crate::gpu::{Kernel, Recorder};
use crate::layout::{PathConstants, PathPush};
use crate::render::buffers::{DeviceScene, FilmTile, part_if};
use crate::shaders::primary_hit::Bind;

/// The specialised kernel.
pub type Guides = Kernel<Bind<'static>>;

/// camera -> guide\[tile\]; where they are kept seen\[tile\], blur\[tile\], points\[tile\]
pub fn record(
    k: &Guides,
    rec: &mut Recorder,
    s: &DeviceScene,
    tile: &FilmTile,
    constants: &PathConstants,
) -> Result<()> {
    tile.windows().try_for_each(|w| {
        let (first_pixel, pixels) = (tile.first_pixel + w.start, w.end - w.start);
        let part = w.start as usize..w.end as usize;
        let guides = &tile.guide.part(part.clone())?;
        let points = &part_if(tile.has_points(), &tile.points, &part)?;
        let seen = &part_if(tile.has_seen(), &tile.seen, &part)?;
        let push = PathPush { constants: *constants, first_pixel, pixels, ..PathPush::default() };
        let blur = &part_if(tile.has_blur(), &tile.blur, &part)?;
        let (scene, frame, ray_query) = (s.bind(), s.bind_frame(), s.bind_world());
        rec.dispatch_threads(k, Bind { scene, frame, ray_query, guides, points, seen, blur }, &push, pixels)
    })
}
