//! The kernels of a renderer, compiled for what its scene calls for.
use crate::allocate::{Policy, PolicyPass};
use crate::error::Result;
use crate::gpu::{Gpu, Kernel, PerBlock, thread_items};
use crate::layout::Effects;
use crate::render::pass::apportion::Apportion;
use crate::render::pass::scan::Scan;
use crate::render::pass::{accumulate, choose, path, primary_hit, sample_list};
use crate::render::settings::Settings;
use crate::shaders;
use crate::threads::both;

/// The kernels of every render.
pub struct Kernels {
    /// Finds what lies behind the centre of each pixel.
    pub primary_hit: primary_hit::Guides,
    /// Traces paths.
    pub path: path::Paths,
    /// Adds samples to the statistics of their pixels.
    pub accumulate: accumulate::Fold,
}

impl Kernels {
    /// Compiles them with these effects, for at most `paths` paths at once of at most `max_depth` edges; `stack` is the depth that
    /// traversal needs, [`crate::scene::Scene::stack`].
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses one, or the paths do not fit.
    pub fn new(gpu: &Gpu, effects: Effects, stack: u32, max_depth: u32, paths: u32) -> Result<Self> {
        let thread = gpu.tuning().thread();
        let path = || path::Paths::new(gpu, effects, stack, max_depth, paths);
        let primary_hit = || primary_hit(gpu, effects, stack, false);
        let accumulate = || Kernel::new(gpu, &shaders::accumulate::Constants { effects, thread });
        let (path, (primary_hit, accumulate)) = both(path, || both(primary_hit, accumulate))?;
        Ok(Self { primary_hit, path, accumulate })
    }
}

/// The kernel that finds primary hits. For films that keep a history it writes their `points` as well.
///
/// # Errors
/// [`crate::error::Error::Device`] when the driver refuses it.
pub fn primary_hit(gpu: &Gpu, effects: Effects, stack: u32, points: bool) -> Result<primary_hit::Guides> {
    let (thread, traverse) = (gpu.tuning().thread(), gpu.tuning().traverse(stack));
    Kernel::new(gpu, &shaders::primary_hit::Constants { effects, thread, traverse, points })
}

/// The kernels that decide where samples go, for renders that do not spread them evenly.
pub struct Allocation {
    /// What makes a pixel worth samples.
    pub policy: Box<dyn PolicyPass>,
    /// Turns priorities into counts.
    pub apportion: Apportion,
    /// Turns priorities into one sample or none.
    pub choose: choose::Choose,
    /// Turns counts into offsets.
    pub scan: Scan,
    /// Turns offsets into paths.
    pub sample_list: sample_list::Batches,
    /// Whether a list of paths may have fewer than its step has room for: only the device knows.
    pub list_may_be_short: bool,
}

impl Allocation {
    /// Compiles them for a film of the settings' size.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses one.
    pub fn new(gpu: &Gpu, policy: &Policy, settings: &Settings) -> Result<Self> {
        let pixels = settings.pixels() as u32;
        let thread_items = thread_items(gpu, pixels);
        Ok(Self {
            policy: (policy.make)(gpu, pixels)?,
            apportion: Apportion::new(gpu, thread_items)?,
            choose: Kernel::new(gpu, &gpu.tuning().thread().into())?,
            scan: Scan::new(gpu, thread_items)?,
            sample_list: PerBlock::new(gpu, thread_items)?,
            list_may_be_short: settings.allocate.list_may_be_short(),
        })
    }
}
