//! Compares the guided filter with its twin, which is in double precision, and the twin with examples worked by hand.
use crate::picture::{self, SIZES, apart, line, red};
use crate::support::kernels::merge;
use crate::support::{assert_silent, gpu, hash, tuned_gpu};
use tallow::denoise::filter::{FilterInput, FilterSettings, GuidedSums, find, run};
use tallow::gpu::{Buffer, FrameResources, Gpu, Location, Tuning};
use tallow::layout::vec4;

/// A constant guide leaves `guided` nothing but box means, and box means of those.
#[test]
fn guided_solves_the_worked_examples() {
    let reference = find("guided").unwrap().reference;
    let base = FilterSettings::default().with(|s| s.footprint.radius = 1);
    // Windows of 0 0 6 0 0: means 0 2 2 2 0; an end has a window of two. Their means: 1 4/3 2 4/3 1.
    let box_means = red(&reference(&line(&[0.0, 0.0, 6.0, 0.0, 0.0]), &base));
    let expected = [1.0, 4.0 / 3.0, 2.0, 4.0 / 3.0, 1.0];
    assert!(box_means.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{box_means:?}");
    // Light that is a linear function of the guide is its own best fit, whatever the window.
    let mut input = line(&[1.0, 3.0, 5.0, 7.0, 9.0]);
    (0..5).for_each(|i| input.guide[i].depth = i as f32);
    let exact = base.with(|s| s.guided.eps = [0.0; 4]);
    let fitted = red(&reference(&input, &exact));
    assert!(fitted.iter().zip([1.0, 3.0, 5.0, 7.0, 9.0]).all(|(a, b)| (a - b).abs() < 1e-5), "{fitted:?}");
    // With eps the slope shrinks by var / (var + eps): over depths 0 1 2 by (2/3) / (2/3 + 2/3); the middle stays.
    let half = red(&reference(&input, &exact.with(|s| s.guided.eps = [2.0 / 3.0; 4])));
    assert!((half[2] - 5.0).abs() < 1e-6 && half[0] > 1.5, "{half:?}");
}

/// What lies beyond the border is no part of a window, and its infinities are none either.
#[test]
fn records_that_are_not_there_leave_nothing_behind() {
    let gpu = gpu();
    let from = [1.0, 3.0, 3e38, f32::INFINITY, f32::NAN];
    let kernel = merge::Kernel::new(&gpu, &Default::default()).unwrap();
    let values = Buffer::from_slice(&gpu, "from", &from).unwrap();
    let results = Buffer::new(&gpu, "results", 4 * from.len(), Location::Readback).unwrap();
    let bind = merge::Bind { from: &values, results: &results };
    let count = from.len() as u32;
    gpu.run(&mut FrameResources::new(&gpu).unwrap(), |rec| rec.dispatch(&kernel, bind, &count, [1; 3])).unwrap();
    for (value, sums) in from.iter().zip(results.read().unwrap().chunks(4)) {
        assert_eq!([sums[0], sums[2]], [30.0, 16.0], "not with {value}");
        assert!((sums[1] - 30.0).abs() > 0.5 || sums[1].is_nan(), "control: with {value} it is {}", sums[1]);
    }
    assert_silent(&gpu);
}

/// Single precision against double, on guides that break sums of squares.
#[test]
fn guided_holds_in_single_precision() {
    let gpu = gpu();
    let row = find("guided").unwrap();
    let (width, height) = (70, 50);
    let base = FilterSettings::default().with(|s| s.guided.eps = [1e-4; 4]);
    for (name, depth, bright) in [
        ("flat", [5.0, 0.0, 0.0], 1.0),
        ("tilted", [5.0, 0.01, 0.02], 1.0),
        ("far away", [1e6, 0.25, 0.5], 1.0),
        ("light of high dynamic range", [5.0, 0.01, 0.02], 1e6),
        ("guide of high dynamic range", [0.0; 3], 1.0),
    ] {
        // The last two have more groups than are kept one by one, and lines of several of their turns.
        let (size, long, tall) = ((width, height), (600, 3), (3, 600));
        for (size, radius, channels) in
            [(size, 3, 4), (size, 12, 4), (size, 60, 4), (size, 12, 3), (size, 12, 1), (long, 100, 4), (tall, 100, 4)]
        {
            let mut input = picture::noisy(size.0, size.1);
            for (i, (c, g)) in input.radiance.iter_mut().zip(&mut input.guide).enumerate() {
                let (x, y) = (i as u32 % size.0, i as u32 / size.0);
                g.depth = depth[0] + depth[1] * x as f32 + depth[2] * y as f32;
                if name == "guide of high dynamic range" {
                    g.depth = 10f32.powf(6.0 * hash(i as u32) as f32 / u32::MAX as f32);
                }
                if i % 97 == 0 {
                    *c = [bright, bright, bright, 1.0];
                }
            }
            let settings = base.with(|s| {
                s.footprint.radius = radius;
                s.guided.channels = channels;
            });
            let device = run(&gpu, row, &input, &settings).unwrap().0;
            let host = (row.reference)(&input, &settings);
            let off = apart(&device, &host, 1e-3);
            // A model is stated at its block's first pixel, and depths of six magnitudes lose digits on the way to the others.
            let most = if name == "guide of high dynamic range" { 2e-4 } else { 1e-4 };
            assert!(off < most, "{name}, {size:?}, radius {radius}, {channels} channels: {off}");
        }
    }
    // Two equal channels and a constant one, with an eps of 0: a matrix of rank 1.
    let mut input = picture::noisy(width, height);
    input.guide.iter_mut().for_each(|g| g.normal = [g.normal[1], g.normal[1], 0.5]);
    let settings = base.with(|s| {
        s.footprint.radius = 9;
        s.guided.channels = 3;
        s.guided.eps = [0.0; 4];
    });
    for radius in [1, 3, 9, 30, 60, 100] {
        let settings = settings.with(|s| s.footprint.radius = radius);
        let off = apart(&run(&gpu, row, &input, &settings).unwrap().0, &(row.reference)(&input, &settings), 1e-3);
        assert!(off < 1e-4, "rank 1, radius {radius}: {off}");
    }
    let device = run(&gpu, row, &input, &settings).unwrap().0;
    let other = settings.with(|s| s.footprint.radius = 11);
    assert!(apart(&device, &(row.reference)(&input, &other), 1e-3) > 1e-3, "control: another radius");
    // A channel that varies less than rounding counts as constant.
    input.guide.iter_mut().zip(0..).for_each(|(g, i)| g.normal[2] = 1e-11 * (i % 70) as f32);
    let faint = run(&gpu, row, &input, &settings).unwrap().0;
    assert!(apart(&faint, &(row.reference)(&input, &settings), 1e-3) < 1e-4);
    assert_silent(&gpu);
}

/// However many windows a thread takes, at once or in turn: narrow ones, wide ones, and wider ones than a GPU's threads take at once.
#[test]
fn windows_hold_however_threads_share_them() {
    let row = find("guided").unwrap();
    let gpus = [0, 1, 2, 3, 4].map(|windows| tuned_gpu(Tuning { windows, ..Tuning::GPU }));
    for (size, radius) in [((31, 5), 0), ((31, 5), 1), ((65, 33), 7), ((64, 31), 30), ((701, 2), 300), ((2, 701), 300)]
    {
        let input = picture::noisy(size.0, size.1);
        let settings = FilterSettings::default().with(|s| s.footprint.radius = radius);
        let host = (row.reference)(&input, &settings);
        for (windows, gpu) in gpus.iter().enumerate() {
            let off = apart(&run(gpu, row, &input, &settings).unwrap().0, &host, 1e-3);
            assert!(off < 1e-4, "{windows} windows a thread, {size:?}, radius {radius}: {off}");
        }
    }
    // More windows than an axis of a dispatch has workgroups.
    for (size, radius) in [((70_000, 1), 0), ((70_000, 1), 3), ((1, 70_000), 3)] {
        let input = picture::noisy(size.0, size.1);
        let settings = FilterSettings::default().with(|s| s.footprint.radius = radius);
        let off = apart(&run(&gpus[1], row, &input, &settings).unwrap().0, &(row.reference)(&input, &settings), 1e-3);
        assert!(off < 1e-4, "{size:?}, radius {radius}: {off}");
    }
    gpus.iter().for_each(assert_silent);
}

/// The published sums agree where they can, and lose digits where the others do not.
#[test]
fn guided_tables_agree_near_by_and_lose_digits_far_away() {
    let gpu = gpu();
    let row = find("guided").unwrap();
    let base = FilterSettings::default().with(|s| {
        s.footprint.radius = 5;
        s.guided.eps = [0.01; 4];
    });
    let table = base.with(|s| s.guided.sums = GuidedSums::Table);
    let off = |input: &FilterInput, s: &FilterSettings| {
        let s = s.scaled_to(input);
        apart(&run(&gpu, row, input, &s).unwrap().0, &(row.reference)(input, &s), 1.0)
    };
    for (width, height) in SIZES {
        let input = picture::noisy(width, height);
        for s in [
            table,
            table.with(|s| {
                s.footprint.radius = 40;
                s.guided.channels = 1;
            }),
        ] {
            assert!(off(&input, &s) < 2e-3, "{width}x{height}: {}", off(&input, &s));
        }
    }
    let mut far = picture::noisy(70, 50);
    (0..).zip(&mut far.guide).for_each(|(i, g)| g.depth = 1e4 + (i % 70) as f32);
    let (table, blocks) = (off(&far, &table), off(&far, &base));
    assert!(table > 100.0 * blocks, "{table}, {blocks}");
    assert_silent(&gpu);
}

/// What both ways to sum make of one row, and the twin, which is in double precision.
fn all(gpu: &Gpu, input: &FilterInput) -> [Vec<vec4>; 3] {
    let row = find("guided").unwrap();
    let blocks = FilterSettings::default().with(|s| {
        s.footprint.radius = 1;
        s.guided.eps = [0.0; 4];
    });
    let table = blocks.with(|s| s.guided.sums = GuidedSums::Table);
    let device = |s: &FilterSettings| run(gpu, row, input, s).unwrap().0;
    [device(&blocks), device(&table), (row.reference)(input, &blocks)]
}

#[test]
fn guided_stands_extremes() {
    let gpu = gpu();
    // Windows of the first two pixels know the first: light reaches one pixel further than they do, and nothing else.
    let none = f32::NAN;
    for output in all(&gpu, &line(&[1.0, none, none, none, none, none])) {
        assert_eq!(output, [[1.0; 4], [1.0; 4], [1.0; 4], [0.0; 4], [0.0; 4], [0.0; 4]]);
    }
    // A depth that is none counts as 0, which leaves the mean; the farthest is 1e7, and any step of it is a perfect guide.
    // Light is cut at 1e24.
    for (values, depths, expected) in [
        ([1.0, 3.0], [0.0, f32::INFINITY], [2.0, 2.0]),
        ([1.0, 3.0], [f32::NAN, 0.0], [2.0, 2.0]),
        ([1.0, 3.0], [0.0, 3e38], [1.0, 3.0]),
        ([0.0, 3e38], [0.0, 0.0], [5e23, 5e23]),
    ] {
        let mut input = line(&values);
        (0..2).for_each(|i| input.guide[i].depth = depths[i]);
        for (case, output) in all(&gpu, &input).iter().enumerate() {
            let near = red(output).iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5 * b);
            assert!(near, "case {case}, {values:?} over depths {depths:?}: {output:?}");
        }
    }
    // A slope of 1e24 over 1e-9, at a guide of 1e7: no float holds that, and the pixel stays unknown.
    let mut input = line(&[0.0, 1e24, none]);
    (0..3).for_each(|i| input.guide[i].depth = [0.0, 1e-9, 1e7][i]);
    for (case, output) in all(&gpu, &input).iter().enumerate() {
        let near = red(output).iter().zip([0.0, 1e24, 0.0]).all(|(a, b)| (a - b).abs() < 1e19);
        assert!(near && output[2] == [0.0; 4], "case {case}: {output:?}");
    }
    assert_silent(&gpu);
}
