//! Turns priorities into counts that sum to a budget exactly, by Hamilton's method, with radix selection and no sort.
//! Kernels: `glsl/apportion/*.comp`. Twin: [`crate::twins::apportion`].
//!
//! ```text
//! priority -> quantise_priority -> sum_weights          weights in fixed point, and their sum
//!                  |
//!          lack_of_share or lack_of_accuracy            only where past samples count: what is missing of a share of
//!                  |                                    all samples, or of an accuracy; then
//!             sum_weights                               the sum of that
//!                  |
//!       +-----> quota ------> redistribute --+          whole samples: floor(budget * weight / sum). What full pixels
//!       +------- `rounds` times -------------+          leave is apportioned again
//!                  |
//!       +--> radix_count --> radix_select ---+          the rest, one sample each for the largest remainders: a digit of
//!       +------- 8 digits -------------------+          the smallest of them at a time
//!                  |
//!       tie_sums -> scan_block_sums -> give_remainders  of equal ones, those of the lowest pixels
//!                  |
//!                count
//! ```
use super::counts::Counts;
use super::scan::Blocks;
use crate::error::Result;
use crate::gpu::PerBlock;
use crate::gpu::{Buffer, Gpu, Recorder};
use crate::layout::{ApportionPush, NONE, PixelStats};
use crate::render::schedule::{Plan, Share};
use crate::shaders::{
    give_remainders, lack_of_accuracy, lack_of_share, quantise_priority, quota, radix_count, radix_select,
    redistribute, sum_weights, tie_sums,
};

/// Digits of a remainder, and the values of each.
const DIGITS: u32 = 8;

/// The kernels.
pub struct Apportion {
    weigh: PerBlock<quantise_priority::Bind<'static>>,
    total: PerBlock<sum_weights::Bind<'static>>,
    deficit: PerBlock<lack_of_share::Bind<'static>>,
    need: PerBlock<lack_of_accuracy::Bind<'static>>,
    quota: PerBlock<quota::Bind<'static>>,
    settle: PerBlock<redistribute::Bind<'static>>,
    digit: PerBlock<radix_count::Bind<'static>>,
    pick: PerBlock<radix_select::Bind<'static>>,
    ties: PerBlock<tie_sums::Bind<'static>>,
    blocks: Blocks,
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
            total: PerBlock::new(gpu, thread_items)?,
            deficit: PerBlock::new(gpu, thread_items)?,
            need: PerBlock::new(gpu, thread_items)?,
            quota: PerBlock::new(gpu, thread_items)?,
            settle: PerBlock::new(gpu, thread_items)?,
            digit: PerBlock::new(gpu, thread_items)?,
            pick: PerBlock::new(gpu, thread_items)?,
            ties: PerBlock::new(gpu, thread_items)?,
            blocks: Blocks::new(gpu, thread_items)?,
            spread: PerBlock::new(gpu, thread_items)?,
        })
    }

    /// priority\[P\], stats\[P\] -> count\[P\]
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn record(&self, rec: &mut Recorder, stats: &Buffer<PixelStats>, c: &Counts, plan: &Plan) -> Result<()> {
        let (push, n) = (|round| push(plan, round), plan.pixels);
        let bind = quantise_priority::Bind { priority: &c.priority, weight: &c.weight, sums: &c.sums };
        self.weigh.record(rec, bind, &push(0), n)?;
        self.total.record_one(rec, sum_weights::Bind { sums: &c.sums, state: &c.state }, &push(0))?;
        match plan.share {
            Share::Next => {}
            Share::All(_) => {
                let bind = lack_of_share::Bind { stats, state: &c.state, weight: &c.weight, sums: &c.sums };
                self.deficit.record(rec, bind, &push(0), n)?;
            }
            Share::Need { .. } => {
                let bind = lack_of_accuracy::Bind { stats, weight: &c.weight, sums: &c.sums };
                self.need.record(rec, bind, &push(0), n)?;
            }
        }
        if plan.share != Share::Next {
            self.total.record_one(rec, sum_weights::Bind { sums: &c.sums, state: &c.state }, &push(1))?;
        }
        for round in 0..plan.rounds {
            let bind = quota::Bind {
                weight: &c.weight,
                stats,
                state: &c.state,
                key: &c.offset,
                count: &c.count,
                sums: &c.sums,
            };
            self.quota.record(rec, bind, &push(round), n)?;
            self.settle.record_one(rec, redistribute::Bind { sums: &c.sums, state: &c.state }, &push(round))?;
        }
        self.record_remainders(rec, stats, c, plan)
    }

    fn record_remainders(&self, rec: &mut Recorder, stats: &Buffer<PixelStats>, c: &Counts, plan: &Plan) -> Result<()> {
        for round in 0..DIGITS {
            let push = push(plan, round);
            let bind = radix_count::Bind { key: &c.offset, state: &c.state, histogram: &c.histogram };
            self.digit.record(rec, bind, &push, plan.pixels)?;
            self.pick.record_one(rec, radix_select::Bind { state: &c.state, histogram: &c.histogram }, &push)?;
        }
        let push = push(plan, 0);
        let bind = tie_sums::Bind { key: &c.offset, stats, counts: &c.count, state: &c.state, blocks: &c.blocks };
        self.ties.record(rec, bind, &push, plan.pixels)?;
        self.blocks.record(rec, &c.blocks, plan.pixels)?;
        let bind = give_remainders::Bind { key: &c.offset, stats, state: &c.state, blocks: &c.blocks, count: &c.count };
        self.spread.record(rec, bind, &push, plan.pixels)
    }
}

/// As priorities are counted in weights, 12.20 fixed point; at least the least.
pub fn fixed_threshold(threshold: f32) -> u32 {
    ((threshold.min(4095.0) * 1_048_576.0) as u32).max(1)
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
