//! Compares the kernels that place samples with their CPU twins, exactly where they compute with integers, and checks that the
//! counts sum to the budget whatever the priorities.
use crate::support::{Lent, assert_silent, gpu, words};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use tallow::allocate::{HostInputs, Inputs, POLICIES, Placing, policy};
use tallow::gpu::{Buffer, FrameResources, Location, PerBlock, Recorder};
use tallow::layout::*;
use tallow::render::pass::apportion::{Apportion, fixed_threshold};
use tallow::render::pass::choose::{self, Choose};
use tallow::render::pass::counts::Counts;
use tallow::render::pass::sample_list::{self, Batches, Bind};
use tallow::render::pass::scan::Scan;
use tallow::render::schedule::{Choice, PathRange, Plan, Share};
use tallow::twins::apportion as twin;

/// Pixels of a thread on a CPU and on a GPU.
const RUNS: [u32; 2] = [64, 16];

/// Around a thread's items, a workgroup's threads and a block.
const SIZES: [usize; 9] = [1, 15, 31, 64, 65, 1023, 1024, 1025, 70_001];

struct Bench {
    apportion: Apportion,
    scan: Scan,
    batch: Batches,
    thread_items: u32,
    /// Lent to the next test when all else is gone.
    gpu: Lent,
}

impl Bench {
    fn new() -> Self {
        Self::with(RUNS[0])
    }

    /// With threads of so many pixels.
    fn with(thread_items: u32) -> Self {
        let gpu = gpu();
        let apportion = Apportion::new(&gpu, thread_items).unwrap();
        let scan = Scan::new(&gpu, thread_items).unwrap();
        let batch = PerBlock::new(&gpu, thread_items).unwrap();
        Self { gpu, apportion, scan, batch, thread_items }
    }

    fn stats(&self, have: &[u32]) -> Buffer<PixelStats> {
        let stats: Vec<_> = have.iter().map(|&count| PixelStats { count, ..PixelStats::default() }).collect();
        Buffer::from_slice(&self.gpu, "stats", &stats).unwrap()
    }

    fn counts(&self, priority: &[f32], have: &[u32], plan: &Plan) -> Counts {
        let counts = Counts::new(&self.gpu, plan.pixels, self.thread_items).unwrap();
        counts.priority.write(0, priority).unwrap();
        let stats = self.stats(have);
        let mut frame = FrameResources::new(&self.gpu).unwrap();
        self.gpu
            .run(&mut frame, |rec| {
                self.apportion.record(rec, &stats, &counts, plan)?;
                self.scan.record(rec, &counts)
            })
            .unwrap();
        counts
    }

    /// Compares every buffer with the twins and returns the counts.
    fn check(&self, priority: &[f32], have: &[u32], plan: &Plan) -> Vec<u32> {
        let counts = self.counts(priority, have, plan);
        let (weights, broken) = twin::weigh(priority);
        let wanting = weights.iter().filter(|&&w| w > 0).count() as u32;
        let weights = match plan.share {
            Share::Next => weights,
            Share::All(total) => twin::deficit(&weights, have, total),
            Share::Need { threshold, limit } => twin::need(&weights, have, fixed_threshold(threshold), limit),
        };
        assert_eq!(counts.weight.read().unwrap(), weights, "weights, {plan:?}");
        let state = counts.state.read().unwrap()[0];
        assert_eq!((state.non_finite, state.wanting), (broken, wanting), "{plan:?}");
        let room: Vec<u32> = have.iter().map(|&n| plan.limit.unwrap_or(u32::MAX).saturating_sub(n)).collect();
        let budget = match plan.share {
            Share::Need { .. } => plan.budget.min(weights.iter().map(|&w| u64::from(w)).sum()),
            _ => plan.budget,
        };
        let expected = twin::apportion(&weights, &room, budget, plan.rounds);
        let found = counts.count.read().unwrap();
        assert_eq!(found, expected, "counts, {plan:?}");
        let most: u64 = room.iter().map(|&n| u64::from(n)).sum();
        assert_eq!(found.iter().map(|&n| u64::from(n)).sum::<u64>(), budget.min(most), "sum, {plan:?}");
        assert!(found.iter().zip(&room).all(|(n, room)| n <= room), "room, {plan:?}");
        let offsets =
            counts.offset.read().unwrap().into_iter().map(|[low, high]| u64::from(low) | u64::from(high) << 32);
        assert_eq!(offsets.collect::<Vec<_>>(), twin::offsets(&found), "offsets, {plan:?}");
        found
    }
}

fn plan(pixels: usize, budget: u64) -> Plan {
    Plan { pixels: pixels as u32, budget, limit: None, share: Share::Next, rounds: 1 }
}

fn priorities(count: usize, seed: u32) -> Vec<f32> {
    words(count, seed).into_iter().map(|w| (w >> 8) as f32 / 4e6).collect()
}

#[test]
fn counts_agree_with_hamilton_at_awkward_sizes() {
    for bench in RUNS.map(Bench::with) {
        for size in SIZES {
            for budget in [0, 1, size as u64 / 2, 4 * size as u64, 1_000_003] {
                bench.check(&priorities(size, 1), &vec![0; size], &plan(size, budget));
            }
        }
        assert_silent(&bench.gpu);
    }
}

#[test]
fn extreme_priorities_still_sum_to_the_budget() {
    let bench = Bench::new();
    let n = 5000;
    let one = |value: f32| (0..n).map(|i| if i == 4321 { value } else { 0.0 }).collect::<Vec<_>>();
    let odd = |i: usize| [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -0.0, f32::MAX, 1e-30, 1.0][i % 7];
    let cases: [Vec<f32>; 7] = [
        vec![0.0; n],
        vec![1.0; n],
        vec![f32::MAX; n], // the largest weight everywhere
        vec![f32::NAN; n],
        one(1.0),
        one(f32::INFINITY),
        (0..n).map(odd).collect(),
    ];
    for priority in &cases {
        for budget in [1, 3 * n as u64 + 1, 1 << 31] {
            let counts = bench.check(priority, &vec![0; n], &plan(n, budget));
            assert!(priority[4321] != 1.0 || priority[0] != 0.0 || u64::from(counts[4321]) == budget);
        }
        // Beyond 32 bits in all and in the products, over many pixels.
        let large = Plan { limit: Some(1 << 24), rounds: 16, ..plan(n, 50_000_000_000) };
        bench.check(priority, &vec![0; n], &large);
    }
    // Weights 2^31, 2^31, 4095 * 2^20 and 2^20 - 1 sum to W = 2^33 - 1; with W - 4 to place the first two remainders are
    // W - 1, all bits set, and must not be taken for the mark of a full pixel.
    bench.check(&[2048.0, 2048.0, 4095.0, 1.0 - 0.5_f32.powi(20)], &[0; 4], &plan(4, 8_589_934_587));
    assert_silent(&bench.gpu);
}

#[test]
fn full_pixels_hand_on_what_they_leave() {
    for bench in RUNS.map(Bench::with) {
        for size in SIZES {
            let have: Vec<u32> = words(size, 9).into_iter().map(|w| w % 20).collect();
            for (limit, budget) in [(16, 3), (16, 8), (3, 100), (25, 12), (0, 1)] {
                let budget = budget * size as u64;
                let total = have.iter().map(|&n| u64::from(n)).sum::<u64>() + budget;
                for (rounds, share) in [(16, Share::Next), (2, Share::Next), (16, Share::All(total))] {
                    let plan = Plan { limit: Some(limit), share, rounds, ..plan(size, budget) };
                    bench.check(&priorities(size, 2).iter().map(|p| p * p * p).collect::<Vec<_>>(), &have, &plan);
                }
            }
        }
        assert_silent(&bench.gpu);
    }
}

#[test]
fn a_threshold_is_given_what_it_needs_and_no_more() {
    let bench = Bench::new();
    for size in SIZES {
        let have: Vec<u32> = words(size, 5).into_iter().map(|w| w % 40).collect();
        let priority: Vec<f32> = priorities(size, 6).into_iter().map(|p| if p < 1.0 { 0.0 } else { p }).collect();
        for (threshold, limit) in [(1e-9, 30), (0.3, 1 << 20), (0.3, 30), (2.0, 0), (1e9, 1 << 20)] {
            let share = Share::Need { threshold, limit };
            for budget in [0, 3, size as u64, 1 << 40] {
                let counts = bench.check(&priority, &have, &Plan { share, ..plan(size, budget) });
                let fits = |i: usize| counts[i] == 0 || counts[i] <= have[i].max(4) && have[i] + counts[i] <= limit;
                assert!((0..size).all(fits), "{share:?}");
                assert!((0..size).all(|i| priority[i] > 0.0 || counts[i] == 0), "{share:?}");
            }
        }
    }
    assert_silent(&bench.gpu);
}

#[test]
fn random_images_agree() {
    let bench = Bench::new();
    let mut runner = TestRunner::new(Config { cases: 150, failure_persistence: None, ..Config::default() });
    let pixel = (prop_oneof![Just(0.0_f32), Just(1.0), Just(f32::NAN), 0.0_f32..1e-5, 0.0_f32..9e3], 0_u32..40);
    let input = (prop::collection::vec(pixel, 1..600), 0_u64..100_000, 0_u32..60, 1_u32..5, 0..3);
    let result = runner.run(&input, |(pixels, budget, limit, rounds, share)| {
        let (priority, have): (Vec<f32>, Vec<u32>) = pixels.into_iter().unzip();
        let plan = plan(priority.len(), budget);
        let plan = match share {
            0 => Plan { limit: Some(limit), rounds, ..plan },
            1 => {
                let total = have.iter().map(|&n| u64::from(n)).sum::<u64>() + budget;
                Plan { limit: Some(limit), rounds, share: Share::All(total), ..plan }
            }
            _ => Plan { share: Share::Need { threshold: 0.01 * rounds as f32, limit }, ..plan },
        };
        bench.check(&priority, &have, &plan);
        Ok(())
    });
    result.unwrap();
    assert_silent(&bench.gpu);
}

#[test]
fn every_path_of_every_batch_is_listed_once() {
    for bench in RUNS.map(Bench::with) {
        for size in [1, 65, 4097] {
            let have: Vec<u32> = words(size, 3).into_iter().map(|w| w % 5).collect();
            // Of the larger films, some samples are of earlier frames; what else is in a word does not matter.
            let carried: Vec<u32> = match size {
                1 => vec![0],
                _ => have.iter().zip(words(size, 8)).map(|(&n, w)| (w % (n + 1)) | (w & 0xffff_0000)).collect(),
            };
            let next: Vec<u32> = have.iter().zip(&carried).map(|(n, word)| n + 7 - (word & 0xffff)).collect();
            let carried = Buffer::from_slice(&bench.gpu, "carried", &carried).unwrap();
            let budget = 3 * size as u64 + 1;
            let counts = bench.counts(&priorities(size, 4), &have, &plan(size, budget));
            let (stats, offsets) = (bench.stats(&have), twin::offsets(&counts.count.read().unwrap()));
            let mut frame = FrameResources::new(&bench.gpu).unwrap();
            for rounds in [1, 3] {
                for paths in [1_u32, 31, 64, 4096] {
                    let mine: Vec<_> = (0..rounds).map(|round| twin::dealt(&offsets, round, rounds)).collect();
                    assert_eq!(mine.iter().map(|m| m[size]).sum::<u64>(), budget);
                    for (round, dealt) in mine.iter().enumerate() {
                        // All batches where they are few, else the first and the last.
                        let firsts: Vec<u64> = (0..dealt[size]).step_by(paths as usize).collect();
                        let some = firsts
                            .iter()
                            .filter(|&&f| firsts.len() < 20 || f == 0 || f + 2 * u64::from(paths) > dealt[size]);
                        for &first in some {
                            let n = u64::from(paths).min(dealt[size] - first) as u32;
                            let range = PathRange { first, paths: n, round: round as u32, rounds };
                            let list = Buffer::new(&bench.gpu, "paths", n as usize, Location::Device).unwrap();
                            let record = |rec: &mut Recorder| {
                                let bind =
                                    Bind { offset: &counts.offset, stats: &stats, carried: &carried, paths: &list };
                                sample_list::record(&bench.batch, rec, bind, &range, 7)
                            };
                            bench.gpu.run(&mut frame, record).unwrap();
                            assert_eq!(list.read().unwrap(), twin::batch(dealt, &next, first, n), "{size} {range:?}");
                        }
                    }
                }
            }
        }
        assert_silent(&bench.gpu);
    }
}

/// A bumpy surface with misses and broken normals, and noisy statistics with untouched pixels.
fn surroundings(pixels: usize, width: usize) -> (Vec<Guide>, Vec<PixelStats>, Vec<PixelLight>) {
    let random = words(4 * pixels, 77);
    let unit = |i: usize| (random[i] >> 8) as f32 / 16_777_216.0;
    let guide = |i: usize| {
        let (x, y) = ((i % width) as f32, (i / width) as f32);
        let normal = glam::Vec3::new(0.3 * unit(4 * i), 0.3 * unit(4 * i + 1), 1.0).normalize();
        match i % 13 {
            7 => Guide { object: NONE, ..Guide::default() },
            11 => Guide { normal: [f32::NAN; 3], ..Guide::default() },
            _ => Guide {
                normal: normal.into(),
                position: [x * 0.01, y * 0.01, unit(4 * i + 2) * 0.02],
                albedo: [0.2, 0.3, unit(4 * i + 3)],
                ..Guide::default()
            },
        }
    };
    let stats = |i: usize| match i % 5 {
        0 => PixelStats::default(),
        n => {
            let m2 = if n == 1 { 0.0 } else { unit(4 * i) };
            PixelStats {
                mean: [unit(i), 2.0 * unit(i), 0.1],
                count: n as u32,
                m2: [m2; 3],
                remainder: 0,
                ..Default::default()
            }
        }
    };
    // Some of it brighter than squares of single precision go.
    let light = |i: usize| PixelLight {
        // A key light may be brighter than the mean, in all channels or in one.
        direct: [[0.5 * unit(i), unit(i), 0.0], [1.5, 2.5, 0.3], [1.5, unit(i), 0.0]][i % 13 % 3],
        indirect_m2: [unit(4 * i + 1), 0.0, 1e35][i % 7 % 3],
        albedo: if i % 11 == 3 { [0.0; 3] } else { [unit(4 * i + 2), 1.0, 0.5] },
        remainder: 0,
        ..Default::default()
    };
    let stats = |i: usize| match i % 41 {
        20 => PixelStats { mean: [3e38; 3], count: 4, m2: [1e35; 3], remainder: 0, ..Default::default() },
        _ => stats(i),
    };
    let pixels = || 0..pixels;
    (pixels().map(guide).collect(), pixels().map(stats).collect(), pixels().map(light).collect())
}

#[test]
fn policies_agree_with_their_references() {
    let gpu = gpu();
    for [width, height] in [[1, 1], [31, 1], [1, 65], [31, 17], [64, 9]] {
        let pixels = (width * height) as usize;
        let (guide, stats, light) = surroundings(pixels, width as usize);
        let guides = Buffer::from_slice(&gpu, "guide", &guide).unwrap();
        let statistics = Buffer::from_slice(&gpu, "stats", &stats).unwrap();
        let lights = Buffer::from_slice(&gpu, "light", &light).unwrap();
        let priority = Buffer::new(&gpu, "priority", pixels, Location::Device).unwrap();
        let mut frame = FrameResources::new(&gpu).unwrap();
        for (window, luminance_floor, threshold, stride) in
            [(2, 0.05, 0.0, 1), (4, -1.0, 0.0, 2), (5, 0.1, 0.3, 3), (10, 1.0, 0.1, 8)]
        {
            let push = PriorityPush {
                size: [width, height],
                window,
                normal_scale: 9.0,
                position_scale: 2e3,
                luminance_floor,
                limit: 5,
                threshold,
                filtered: 0.9,
                round: 0,
                stride,
                ..Default::default()
            };
            for row in POLICIES {
                let policy = (row.make)(&gpu, pixels as u32).unwrap();
                let inputs = Inputs { guide: &guides, stats: &statistics, light: &lights, priority: &priority };
                gpu.run(&mut frame, |rec| {
                    policy.prepare(rec, &inputs, &push)?;
                    policy.record(rec, &inputs, &push)
                })
                .unwrap();
                let (found, expected) = (
                    priority.read().unwrap(),
                    (row.reference)(&HostInputs { guide: &guide, stats: &stats, light: &light, priority: &[], push }),
                );
                for (i, (a, b)) in found.iter().zip(&expected).enumerate() {
                    // Importance is exact on every device; roots, quotients and differences of nearly equal values are not.
                    let same = if !matches!(row.placing, Placing::Even | Placing::Once) {
                        (a - b).abs() <= 1e-5 * b.max(1e-6)
                    } else {
                        a == b
                    };
                    assert!(same && a.is_finite(), "{} {width}x{height} pixel {i}: {a} {b}", row.name);
                }
            }
        }
    }
    assert_silent(&gpu);
}

#[test]
fn one_sample_or_none_agrees_with_its_reference() {
    let gpu = gpu();
    let choose = Choose::new(&gpu, &gpu.tuning().thread().into()).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    for size in SIZES {
        let odd = |i: usize| [f32::NAN, f32::INFINITY, -1.0, 0.0, 1.0, 0.999_999_94, 0.5, 1e-30][i % 8];
        let priority: Vec<f32> = priorities(size, 2)
            .iter()
            .enumerate()
            .map(|(i, p)| if i % 3 == 0 { odd(i / 3) } else { p / 1100.0 })
            .collect();
        let counts = Counts::new(&gpu, size as u32, RUNS[0]).unwrap();
        counts.priority.write(0, &priority).unwrap();
        for (round, threshold) in [(3, 1.0), (4, 0.25), (17, 0.0), (u32::MAX, 0.0)] {
            let choice = Choice { pixels: size as u32, round, threshold };
            gpu.run(&mut frame, |rec| choose::record(&choose, rec, &counts, &choice, 7)).unwrap();
            assert_eq!(counts.count.read().unwrap(), twin::choose(&priority, round, 7, threshold), "{size} {choice:?}");
        }
    }
    assert_silent(&gpu);
}

#[test]
fn a_frozen_probability_is_the_share_of_samples_and_stays() {
    let gpu = gpu();
    let row = policy("threshold").unwrap();
    let stats: Vec<_> = (0..65).map(|count| PixelStats { count, ..PixelStats::default() }).collect();
    let kept: Vec<f32> = (0..65).map(|i| i as f32).collect();
    let buffers = (
        Buffer::from_slice(&gpu, "stats", &stats).unwrap(),
        Buffer::from_slice(&gpu, "priority", &kept).unwrap(),
        Buffer::new(&gpu, "guide", 1, Location::Device).unwrap(),
    );
    let light = Buffer::new(&gpu, "light", 1, Location::Device).unwrap();
    let policy = (row.make)(&gpu, 65).unwrap();
    let mut frame = FrameResources::new(&gpu).unwrap();
    for round in [64, 63, 65] {
        let push = PriorityPush { size: [65, 1], limit: 64, round, ..PriorityPush::default() };
        let before = buffers.1.read().unwrap();
        let inputs = Inputs { guide: &buffers.2, stats: &buffers.0, light: &light, priority: &buffers.1 };
        gpu.run(&mut frame, |rec| policy.record(rec, &inputs, &push)).unwrap();
        let host = HostInputs { guide: &[], stats: &stats, light: &[], priority: &before, push };
        assert_eq!(buffers.1.read().unwrap(), (row.reference)(&host), "round {round}");
    }
    assert_silent(&gpu);
}
