//! Begin and end of each pass, measured with the device's timestamps.
use super::{At, Gpu, explain};
use crate::error::{Error, Result};
use ash::vk;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// Queries per pool; a pass takes two.
const POOL: u32 = 1024;

/// The times of one pass. Both are on the device's clock, which [`super::Gpu::calibrate`] relates to the host's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PassTime {
    /// The kernel's name, or what was done without one: `copy`, `fill`, `update`, `upload`, `build_meshes` or `build_copies`.
    pub name: &'static str,
    /// Begin of the pass in nanoseconds.
    pub begin_ns: u64,
    /// End of the pass in nanoseconds, not before `begin_ns`.
    pub end_ns: u64,
}

impl PassTime {
    /// Duration of the pass in nanoseconds.
    pub fn duration_ns(&self) -> u64 {
        self.end_ns.saturating_sub(self.begin_ns)
    }

    /// Duration of the pass in milliseconds.
    pub fn duration_ms(&self) -> f64 {
        self.duration_ns() as f64 * 1e-6
    }
}

/// Sum of the durations of some passes in milliseconds.
pub fn total_ms<'a>(passes: impl IntoIterator<Item = &'a PassTime>) -> f64 {
    passes.into_iter().map(PassTime::duration_ns).sum::<u64>() as f64 * 1e-6
}

/// Nanoseconds of all calls of each pass, in the order in which the passes first ran.
pub(crate) fn by_pass(times: &[PassTime]) -> Vec<(&'static str, Vec<u64>)> {
    let mut passes: Vec<(&'static str, Vec<u64>)> = Vec::new();
    for time in times {
        match passes.iter_mut().find(|(name, _)| *name == time.name) {
            Some((_, durations)) => durations.push(time.duration_ns()),
            None => passes.push((time.name, vec![time.duration_ns()])),
        }
    }
    passes
}

/// A duration in milliseconds.
pub(crate) fn milliseconds(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}

/// Nanoseconds since the first call of this function, on a monotonic clock.
pub fn host_ns() -> u64 {
    static START: OnceLock<Instant> = OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_nanos() as u64
}

/// One moment on the clocks of device and host.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Calibration {
    /// Nanoseconds of the device's clock, as in [`PassTime`].
    pub device_ns: u64,
    /// Nanoseconds of the host's clock, as in [`host_ns`].
    pub host_ns: u64,
    /// Nanoseconds by which the two moments may lie apart: the deviation that the driver tells, and half the time that
    /// asking it took.
    pub deviation_ns: u64,
    /// Nanoseconds after which the device's clock begins anew.
    pub wraps_after_ns: u128,
}

impl Calibration {
    /// The host's clock, negative before [`host_ns`] is first called, at a moment of the device's, which may have begun anew once between
    /// the two: of the time after which it does, up to seven eighths before this moment and one behind it.
    pub fn host_ns_of(&self, device_ns: u64) -> i64 {
        let wraps_after = (self.wraps_after_ns as i128).max(1);
        let late = wraps_after / 8;
        let ago = (i128::from(self.device_ns) - i128::from(device_ns) + late).rem_euclid(wraps_after) - late;
        (i128::from(self.host_ns) - ago) as i64
    }
}

impl Gpu {
    /// One moment on both clocks. `None` if the device supports neither VK_KHR_calibrated_timestamps nor
    /// VK_EXT_calibrated_timestamps.
    pub fn calibrate(&self) -> Option<Calibration> {
        let clock = self.0.calibrated.as_ref()?;
        // The host's clock is read on both sides of the device's; the tightest of a few tries is kept.
        let tries = (0..5).filter_map(|_| {
            let before = host_ns();
            // SAFETY: the extension is enabled and knows the device's own domain (checked when opened).
            let (ticks, deviation) = unsafe { clock.now() }.ok()?;
            let half = (host_ns() - before).div_ceil(2);
            Some((deviation.saturating_add(half), ticks, before + half))
        });
        let (deviation_ns, ticks, host_ns) = tries.min()?;
        let clock = Clock::of(self);
        Some(Calibration {
            device_ns: clock.absolute(ticks),
            host_ns,
            deviation_ns,
            wraps_after_ns: clock.wraps_after(),
        })
    }
}

/// How to read a timestamp: its meaningful low bits (`timestampValidBits`, 0 to 64) and nanoseconds per tick.
#[derive(Clone, Copy)]
pub(super) struct Clock {
    pub bits: u32,
    pub period: f32,
}

impl Clock {
    fn of(gpu: &Gpu) -> Self {
        Self { bits: gpu.info().timestamp_bits, period: gpu.info().timestamp_period }
    }

    /// Nanoseconds from `begin` to `end`; the counter may wrap once between them.
    fn between(self, begin: u64, end: u64) -> u64 {
        let mask = u64::MAX.checked_shr(64 - self.bits).unwrap_or(0);
        scale(end.wrapping_sub(begin) & mask, self.period)
    }

    /// Nanoseconds of all values that the counter has.
    fn wraps_after(self) -> u128 {
        nanoseconds(1 << self.bits, self.period)
    }

    /// Nanoseconds since the counter was 0.
    pub fn absolute(self, ticks: u64) -> u64 {
        self.between(0, ticks)
    }

    /// Converts the ticks `begin` and `end` of a pass, in a recording whose first pass began at the tick `first`.
    fn pass(self, name: &'static str, first: u64, [begin, end]: [u64; 2]) -> PassTime {
        let begin_ns = self.absolute(first).saturating_add(self.between(first, begin));
        PassTime { name, begin_ns, end_ns: begin_ns.saturating_add(self.between(begin, end)) }
    }
}

/// Converts ticks to nanoseconds, with the period in 40-bit fixed point because a double cannot hold 64-bit ticks. The
/// result is exact for a period of 1 and within a relative 2^-24 otherwise. It is limited to 64 bits.
fn scale(ticks: u64, period: f32) -> u64 {
    nanoseconds(ticks.into(), period).try_into().unwrap_or(u64::MAX)
}

/// The same without a limit.
fn nanoseconds(ticks: u128, period: f32) -> u128 {
    let fixed = (f64::from(period) * (1u64 << 40) as f64) as u128;
    (ticks * fixed) >> 40
}

/// The timestamp queries of one frame.
pub(super) struct Timer {
    gpu: Gpu,
    pools: Vec<vk::QueryPool>,
    passes: Vec<&'static str>,
    /// Whether passes are timed.
    pub timed: bool,
}

impl Timer {
    pub fn new(gpu: &Gpu) -> Self {
        Self { gpu: gpu.clone(), pools: Vec::new(), passes: Vec::new(), timed: true }
    }

    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Forgets the passes. The work that they timed must be complete.
    pub fn reset(&mut self) {
        // SAFETY: the queries are not in use, and hostQueryReset is a required feature.
        self.pools.iter().for_each(|pool| unsafe { self.gpu.0.device.reset_query_pool(*pool, 0, POOL) });
        self.passes.clear();
    }

    /// Returns the query to which the next pass writes the first of its two timestamps; `None` if the queue has none, or
    /// passes are not to be timed.
    pub fn open(&mut self, name: &'static str) -> Result<Option<(vk::QueryPool, u32)>> {
        if self.gpu.0.info.timestamp_bits == 0 || !self.timed {
            return Ok(None);
        }
        let first = 2 * self.passes.len() as u32;
        if first as usize / POOL as usize == self.pools.len() {
            self.grow()?;
        }
        self.passes.push(name);
        Ok(Some((self.pools[(first / POOL) as usize], first % POOL)))
    }

    fn grow(&mut self) -> Result<()> {
        let device = &self.gpu.0.device;
        let info = vk::QueryPoolCreateInfo::default().query_type(vk::QueryType::TIMESTAMP).query_count(POOL);
        // SAFETY: a complete info, a fresh pool, and hostQueryReset is a required feature.
        unsafe {
            let pool = device.create_query_pool(&info, None).at("timestamps")?;
            device.reset_query_pool(pool, 0, POOL);
            self.pools.push(pool);
        }
        Ok(())
    }

    /// # Errors
    /// When the work is not complete, or the device was lost.
    pub fn times(&self) -> Result<Vec<PassTime>> {
        let clock = Clock::of(&self.gpu);
        let ticks = self.ticks().map_err(|code| match code {
            vk::Result::NOT_READY => {
                Error::Usage("the times of a frame were asked for before its work was complete: wait for it".into())
            }
            code => {
                self.gpu.0.note_loss(code);
                explain("the times of a frame", code)
            }
        })?;
        let Some(&[first, _]) = ticks.first() else { return Ok(Vec::new()) };
        Ok(self.passes.iter().zip(&ticks).map(|(name, ticks)| clock.pass(name, first, *ticks)).collect())
    }

    /// The last pass that began, for a message about a lost device. Most drivers still return the queries then.
    pub fn last_started(&self) -> Option<&'static str> {
        let began = self.queries().0.into_iter().step_by(2).rposition(|[_, available]| available != 0)?;
        Some(self.passes[began])
    }

    /// Number of timestamps written so far. It grows as the work proceeds.
    pub fn written(&self) -> usize {
        self.queries().0.iter().filter(|[_, available]| *available != 0).count()
    }

    /// Begin and end of every pass in ticks.
    ///
    /// # Errors
    /// `NOT_READY` when one is not available yet, and those of Vulkan.
    fn ticks(&self) -> std::result::Result<Vec<[u64; 2]>, vk::Result> {
        let (queries, found) = self.queries();
        found?;
        match queries.iter().all(|[_, available]| *available != 0) {
            true => Ok(queries.chunks_exact(2).map(|pass| [pass[0][0], pass[1][0]]).collect()),
            false => Err(vk::Result::NOT_READY),
        }
    }

    /// (ticks, availability) of every query, and the first failure; availability is 0 until the timestamp is written. A driver that
    /// fails on the way, as when the device is lost, has filled in what it came by before.
    fn queries(&self) -> (Vec<[u64; 2]>, std::result::Result<(), vk::Result>) {
        let flags = vk::QueryResultFlags::TYPE_64 | vk::QueryResultFlags::WITH_AVAILABILITY;
        let (mut queries, mut found) = (vec![[0; 2]; 2 * self.passes.len()], Ok(()));
        for (pool, results) in self.pools.iter().zip(queries.chunks_mut(POOL as usize)) {
            // SAFETY: a live pool; the results have two words per query, as the flags say.
            match unsafe { self.gpu.0.device.get_query_pool_results(*pool, 0, results, flags) } {
                Ok(()) | Err(vk::Result::NOT_READY) => {} // availabilities are written all the same
                failed => found = found.and(failed),
            }
        }
        (queries, found)
    }
}

impl Drop for Timer {
    fn drop(&mut self) {
        // SAFETY: made on this device, not in use (the frame's contract), destroyed once.
        self.gpu.0.free(|device| {
            self.pools.iter().for_each(|pool| unsafe { device.destroy_query_pool(*pool, None) });
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_counter_wraps_and_scales() {
        let clock = Clock { bits: 36, period: 1.0 };
        assert_eq!(clock.between(5, 12), 7);
        assert_eq!(clock.between((1 << 36) - 3, 4), 7, "wrapped once");
        assert_eq!(clock.between(1 << 40, (1 << 50) + 7), 7, "bits above the valid ones mean nothing");
        assert_eq!(Clock { bits: 64, period: 1.0 }.between(u64::MAX, 6), 7);
        assert_eq!(Clock { bits: 64, period: 2.5 }.between(0, 1000), 2500);
        assert_eq!(Clock { bits: 0, period: 1.0 }.between(0, 1000), 0);
        assert_eq!(Clock { bits: 64, period: 1.0 }.absolute(u64::MAX), u64::MAX, "no rounding at period 1");
    }

    #[test]
    fn times_end_where_64_bits_do() {
        let late = Clock { bits: 64, period: 2.5 }.pass("late", u64::MAX - 9, [u64::MAX - 7, u64::MAX]);
        assert_eq!(late, PassTime { name: "late", begin_ns: u64::MAX, end_ns: u64::MAX });
        let slow = Clock { bits: 64, period: 1.0 }.pass("slow", u64::MAX - 1, [u64::MAX, 5]);
        assert_eq!((slow.begin_ns, slow.duration_ns()), (u64::MAX, 0));
        let early = Clock { bits: 64, period: 2.5 }.pass("early", 100, [110, 150]);
        assert_eq!(early, PassTime { name: "early", begin_ns: 275, end_ns: 375 });
        assert_eq!(total_ms(&[early, late, early]), 200.0 * 1e-6);
    }
}
