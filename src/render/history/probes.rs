//! Paths that find how light has changed since the last frame: see `glsl/reproject/probe.comp`.
use crate::error::Result;
use crate::gpu::{Buffer, Gpu, Kernel, Location, Recorder};
use crate::layout::{AliasEntry, Effects, Light, LightChange, PathConstants, Probe};
use crate::math::hash::pcg;
use crate::render::buffers::DeviceScene;
use crate::render::upload::whole;
use crate::scene::Relit;
use crate::shaders;
use crate::shaders::shared::probe_cell::PROBE_CELL;
use crate::shaders::shared::{deal, light};

/// The kernels and buffers of probes: one path for each cell of 4x4 pixels, 6 bytes a pixel.
pub struct Probes {
    /// Traces them.
    pub trace: Kernel<shaders::probe::Bind<'static>>,
    /// Sums what they find over neighbouring cells.
    pub sum: Kernel<shaders::light_change::Bind<'static>>,
    /// Cells across and down.
    pub cells: [u32; 2],
    /// A path of each cell.
    pub probes: Buffer<Probe>,
    /// How light has changed in each cell: two, of which the levels read and write one each.
    pub changes: [Buffer<LightChange>; 2],
    /// Where lights have changed: those before and those now, as probes choose them, and the table that chooses.
    lights: [Buffer<Light>; 2],
    light_table: Buffer<AliasEntry>,
    /// What the paths are told in place of the frame's constants; none where lights are as they were.
    relit: Option<PathConstants>,
    seed: u32,
}

impl Probes {
    /// For a film of `size` pixels. `stack` is [`crate::scene::Scene::stack`].
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn new(gpu: &Gpu, effects: Effects, stack: u32, size: [u32; 2]) -> Result<Self> {
        let (thread, traverse, deal) =
            (gpu.tuning().thread(), gpu.tuning().traverse(stack), deal::Constants::default());
        // A change of one light must not change which of the others are chosen.
        let effects = Effects { light_tree: false, ..effects };
        let cells = size.map(|n| n.div_ceil(PROBE_CELL));
        let count = (cells[0] * cells[1]) as usize;
        let changes = || Buffer::new(gpu, "changes of light", count, Location::Device);
        let lights = |name| Buffer::from_slice(gpu, name, &[]);
        Ok(Self {
            trace: Kernel::new(gpu, &shaders::probe::Constants { effects, thread, traverse, deal })?,
            sum: Kernel::new(gpu, &thread.into())?,
            cells,
            probes: Buffer::new(gpu, "probes", count, Location::Device)?,
            changes: [changes()?, changes()?],
            lights: [lights("lights before")?, lights("lights after")?],
            light_table: Buffer::from_slice(gpu, "table of both", &[])?,
            relit: None,
            seed: 0,
        })
    }

    /// Gets ready for a change, after a frame of these constants and this first sample.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn note(
        &mut self,
        rec: &mut Recorder,
        relit: Option<&Relit>,
        c: &PathConstants,
        first_sample: u32,
    ) -> Result<()> {
        self.seed = pcg(pcg(!c.seed).wrapping_add(first_sample));
        self.relit = relit.map(|relit| PathConstants {
            light_count: relit.table.len() as u32,
            environment: relit.environment,
            triangle_pdf_scale: c.triangle_pdf_scale * relit.pdf_scale,
            ..PathConstants::default()
        });
        let Some(relit) = relit else { return Ok(()) };
        whole(rec, &mut self.lights[0], &relit.before)?;
        whole(rec, &mut self.lights[1], &relit.after)?;
        whole(rec, &mut self.light_table, &relit.table)
    }

    /// What the paths are told, before the scene changes as after it.
    pub fn constants(&self, frame: &PathConstants) -> PathConstants {
        let own = PathConstants { seed: self.seed, ..*frame };
        self.relit.map_or(own, |relit| PathConstants {
            light_count: relit.light_count,
            environment: relit.environment,
            triangle_pdf_scale: relit.triangle_pdf_scale,
            ..own
        })
    }

    /// The lights that they choose from, before the scene changes or after it.
    pub fn lights<'a>(&'a self, scene: &'a DeviceScene, after: bool) -> light::Bind<'a> {
        let (all, own) = (scene.bind_lights(), &self.lights[usize::from(after)]);
        self.relit.map_or(all, |_| light::Bind { lights: own, light_table: &self.light_table, ..all })
    }

    /// How light has changed in each cell, once all levels are summed.
    pub fn found(&self) -> &Buffer<LightChange> {
        &self.changes[1]
    }
}
