//! Turns priorities into counts that sum to a budget exactly, by Hamilton's method, with radix selection and no sort.
//! Kernels: `glsl/apportion/*.comp`. Twin: [`crate::twins::apportion`].
//!
//! ```text
//! priority -> quantise_priority       weights in fixed point, and their sum
//!                  |
//!                lack                only where past samples count: what is missing of a share of all samples, or of an
//!                  |                 accuracy, and the sum of that
//!                  |
//!       +-----> quota -----+          whole samples: floor(budget * weight / sum). What full pixels leave is apportioned again
//!       +- `rounds` times -+
//!                  |
//!       +--> radix_select -+          the rest, one sample each for the largest remainders: a digit of the smallest of them at
//!       +---- 8 digits ----+          a time
//!                  |
//!       tie_sums -> give_remainders   of equal ones, those of the lowest pixels
//!                  |
//!                count
//! ```
use super::counts::Counts;
use crate::error::Result;
use crate::gpu::PerBlock;
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::layout::{ApportionPush, NONE, PixelStats};
use crate::render::schedule::{Plan, Share};
use crate::shaders::quantise_priority::{FIXED_POINT, MAX_PRIORITY};
use crate::shaders::{give_remainders, lack, quantise_priority, quota, radix_select, tie_sums};

/// Digits of a remainder, and the values of each.
const DIGITS: u32 = 8;

/// The kernels.
pub struct Apportion {
    weigh: PerBlock<quantise_priority::Bind<'static>>,
    lack: PerBlock<lack::Bind<'static>>,
    quota: PerBlock<quota::Bind<'static>>,
    pick: PerBlock<radix_select::Bind<'static>>,
    ties: PerBlock<tie_sums::Bind<'static>>,
    spread: PerBlock<give_remainders::Bind<'static>>,
}

impl Apportion {
    /// Compiles them, as [`PerBlock::new`] does.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the driver refuses one.
    pub fn new(gpu: &Gpu, thread_items: u32) -> Result<Self> {
        Ok(Self {
            weigh: PerBlock::new(gpu, thread_items)?,
            lack: PerBlock::new(gpu, thread_items)?,
            quota: PerBlock::new(gpu, thread_items)?,
            pick: PerBlock::new(gpu, thread_items)?,
            ties: PerBlock::new(gpu, thread_items)?,
            spread: PerBlock::new(gpu, thread_items)?,
        })
    }

    /// priority\[P\], stats\[P\] -> count\[P\]
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn record(&self, rec: &mut Recorder, stats: &Buffer<PixelStats>, c: &Counts, plan: &Plan) -> Result<()> {
        let (push, n) = (|round| push(plan, round), plan.pixels);
        let (sums, state, last_block) = (&c.sums, &c.state, c.last_block());
        let bind = quantise_priority::Bind { priority: &c.priority, weight: &c.weight, sums, state, last_block };
        self.weigh.record(rec, bind, &push(0), n)?;
        if !matches!(plan.share, Share::Next) {
            let bind = lack::Bind { stats, state, weight: &c.weight, sums, last_block };
            self.lack.record(rec, bind, &push(0), n)?;
        }
        for round in 0..plan.rounds {
            let (weight, key, count) = (&c.weight, &c.offset, &c.count);
            let bind = quota::Bind { weight, stats, state, key, count, sums, last_block };
            self.quota.record(rec, bind, &push(round), n)?;
        }
        self.record_remainders(rec, stats, c, plan)
    }

    fn record_remainders(&self, rec: &mut Recorder, stats: &Buffer<PixelStats>, c: &Counts, plan: &Plan) -> Result<()> {
        let (key, state, blocks, last_block) = (&c.offset, &c.state, &c.blocks, c.last_block());
        for digit in 0..DIGITS {
            let bind = radix_select::Bind { key, state, histogram: &c.histogram, last_block };
            self.pick.record(rec, bind, &push(plan, digit), plan.pixels)?;
        }
        let push = push(plan, 0);
        let bind = tie_sums::Bind { key, stats, counts: &c.count, state, blocks, last_block };
        self.ties.record(rec, bind, &push, plan.pixels)?;
        let bind = give_remainders::Bind { key, stats, state, blocks, count: &c.count };
        self.spread.record(rec, bind, &push, plan.pixels)
    }
}

/// As priorities are counted in weights, 12.20 fixed point; at least the least.
pub fn fixed_threshold(threshold: f32) -> u32 {
    ((threshold.min(MAX_PRIORITY) * FIXED_POINT) as u32).max(1)
}

fn push(plan: &Plan, step: u32) -> ApportionPush {
    let total = if let Share::All(total) = plan.share { total } else { 0 };
    let (threshold, enough) = match plan.share {
        Share::Need { threshold, limit } => (fixed_threshold(threshold), limit),
        _ => (0, 0),
    };
    ApportionPush {
        pixels: plan.pixels,
        limit: plan.limit.unwrap_or(NONE),
        step,
        repetitions: plan.rounds,
        budget: super::pair(plan.budget),
        total: super::pair(total),
        threshold,
        enough,
        ..Default::default()
    }
}
