//! Compares the filters on the device with their CPU twins, and the twins with examples worked by hand.
use crate::picture::{self, SIZES, apart, line, red};
use crate::support::{assert_silent, gpu, hash};
use tallow::denoise::filter::{
    FILTERS, FilterInput, FilterSettings, GuidedSums, Planes, WaveletBasis, find, firefly, run,
};
use tallow::gpu::{DeviceKind, FrameResources, Gpu};
use tallow::layout::vec4;

#[test]
fn kernels_agree_with_their_twins() {
    let gpu = gpu();
    for row in FILTERS {
        for (width, height) in SIZES {
            let input = picture::noisy(width, height);
            for settings in picture::settings(row.name) {
                let settings = settings.scaled_to(&input);
                let (device, _) = run(&gpu, row, &input, &settings).unwrap();
                let host = (row.reference)(&input, &settings);
                let off = apart(&device, &host, 1.0);
                // An eps of 0 leaves matrices whose condition is the pivots' limit, 1e5. GPUs add in another order than the twin.
                let exact = gpu.info().kind == DeviceKind::Cpu || settings.guided.eps.iter().all(|&eps| eps > 0.0);
                assert!(
                    off < if exact { 5e-4 } else { 1e-2 },
                    "{} {width}x{height}: {off} apart with {settings:?}",
                    row.name
                );
                if width * height > 1 {
                    let mut turned = host.clone();
                    turned.rotate_right(1);
                    assert!(apart(&device, &turned, 1.0) > 1e-2, "{} control: other pixels", row.name);
                }
            }
        }
    }
    assert_silent(&gpu);
}

/// What the device makes of an image, and its twin to rounding.
fn both(gpu: &Gpu, filter: &str, input: &FilterInput, settings: &FilterSettings) -> Vec<vec4> {
    let row = find(filter).unwrap();
    let device = run(gpu, row, input, settings).unwrap().0;
    let host = (row.reference)(input, settings);
    let off = apart(&device, &host, 1.0);
    assert!(off < 1e-5, "{filter}: {off} apart with {settings:?}");
    device
}

#[test]
fn atrous_solves_the_worked_example() {
    let off = f32::INFINITY;
    let plain = FilterSettings::default().with(|s| {
        s.footprint.levels = 1;
        s.edge.sigma_rt = off;
        s.edge.sigma_n = off;
        s.edge.sigma_x = off;
    });
    let reference = find("atrous").unwrap().reference;
    // An impulse of 16 becomes the B3 spline 1, 4, 6, 4, 1; nothing is known outside, so pixels 2 and 6 of a row of 9
    // have all their taps, 1 and 7 lack the last.
    let mut values = [0.0; 9];
    values[4] = 16.0;
    assert_eq!(red(&reference(&line(&values), &plain)), [0.0, 0.0, 1.0, 4.0, 6.0, 4.0, 1.0, 0.0, 0.0]);
    // Level 1 spreads taps of 2 pixels over that: pixel 4 takes 6/16 of 6, 4/16 of 1 + 1; pixel 0 has 6/16 and 4/16 of
    // 0 and 1 and 1/16 of 6 in reach: (4 + 6) / (6 + 4 + 1).
    let two = reference(&line(&values), &plain.with(|s| s.footprint.levels = 2));
    assert_eq!(two[4][0], (6.0 * 6.0 + 4.0 * 2.0) / 16.0);
    assert!((two[0][0] - 10.0 / 11.0).abs() < 1e-6);
    // 0 | 1 in all three channels with sigma 1: the neighbour weighs 4/16 * e^-3 beside 6/16. Conserving, it moves that
    // much of the step, times the 6/16 of the taps that lie in the row.
    let edge = plain.with(|s| s.edge.sigma_rt = 1.0);
    let w = (-3.0f32).exp() * 4.0 / 16.0;
    assert!((red(&reference(&line(&[0.0, 1.0]), &edge))[0] - w / (w + 6.0 / 16.0)).abs() < 1e-6);
    let kept = red(&reference(&line(&[0.0, 1.0]), &edge.with(|s| s.atrous.conserve_energy = true)));
    assert!((kept[0] - w * 6.0 / 16.0).abs() < 1e-6 && kept[0] + kept[1] == 1.0);
    // Level 1 looks at half of the sigma, which is four times the exponent. Of 0 | 0 | 1 level 0 makes, with e = e^-3 and the taps 6, 4
    // and 1: e / (10 + e), 4 e / (10 + 4 e) and 6 / (6 + 5 e).
    let e = (-3.0f32).exp();
    let [a, b, c] = [e / (10.0 + e), 4.0 * e / (10.0 + 4.0 * e), 6.0 / (6.0 + 5.0 * e)];
    let one = red(&reference(&line(&[0.0, 0.0, 1.0]), &edge));
    assert!([a, b, c].iter().zip(&one).all(|(a, b)| (a - b).abs() < 1e-6), "{one:?}");
    let two = edge.with(|s| s.footprint.levels = 2);
    let far = |exponent: f32, from: f32, to: f32| {
        let w = 4.0 * (-exponent).exp();
        (6.0 * from + w * to) / (6.0 + w)
    };
    let found = red(&reference(&line(&[0.0, 0.0, 1.0]), &two));
    assert!(
        (found[0] - far(4.0 * 3.0 * (c - a) * (c - a), a, c)).abs() < 1e-6 && (found[1] - b).abs() < 1e-6,
        "{found:?}"
    );
    // It begins to look at radiance where it is told to: level 0 makes 1/11, 4/14 and 6/11, level 1 looks at its own sigma.
    let found = red(&reference(&line(&[0.0, 0.0, 1.0]), &two.with(|s| s.atrous.rt_from_level = 1)));
    let [a, c] = [1.0 / 11.0, 6.0 / 11.0];
    assert!((found[0] - far(4.0 * 3.0 * (c - a) * (c - a), a, c)).abs() < 1e-6, "{found:?}");
    // Of normals the listing divides the square of a difference, here 2, by that of the distance.
    let mut bent = line(&[0.0, 0.0, 1.0]);
    bent.guide.iter_mut().for_each(|guide| guide.normal = [0.0, 0.0, 1.0]);
    bent.guide[2].normal = [1.0, 0.0, 0.0];
    let found = red(&reference(&bent, &two.with(|s| (s.edge.sigma_rt, s.edge.sigma_n) = (off, 1.0))));
    let e = (-2.0f32).exp();
    let [a, c] = [e / (10.0 + e), 6.0 / (6.0 + 5.0 * e)];
    assert!((found[0] - far(2.0 / 4.0, a, c)).abs() < 1e-6, "{found:?}");
    // The root of a pixel's samples weighs too: of 9 beside 1, 4/16 * 3 beside 6/16.
    let mut uneven = line(&[0.0, 1.0]);
    uneven.radiance[1][3] = 9.0;
    let found = reference(&uneven, &plain);
    assert!((found[0][0] - 12.0 / 18.0).abs() < 1e-6 && found[1][3] == 9.0, "{found:?}");
    // An unknown pixel between 2 and 4 takes their mean, whatever the radiance weight, and counts as one sample.
    let painted = reference(&line(&[2.0, f32::NAN, 4.0]), &plain.with(|s| s.edge.sigma_rt = 0.1));
    assert_eq!(painted[1], [3.0, 3.0, 3.0, 1.0]);
    // Any number of samples is one, as far as sums can hold them.
    uneven.radiance[1] = [1e22, 1e22, 1e22, f32::MAX];
    let many = red(&both(&gpu(), "atrous", &uneven, &plain));
    assert!(many.iter().all(|v| (v / 1e22 - 1.0).abs() < 1e-5), "{many:?}");
    // A weight that is off does not count where the square of a difference is infinite: 4/16 beside 6/16.
    let gpu = gpu();
    let bright = red(&both(&gpu, "atrous", &line(&[0.0, 1e20]), &plain));
    assert!((bright[0] / 1e20 - 0.4).abs() < 1e-6 && (bright[1] / 1e20 - 0.6).abs() < 1e-6, "{bright:?}");
    assert_silent(&gpu);
}

#[test]
fn what_is_no_number_is_far_from_all_others() {
    let [none, one] = [[[f32::NAN; 4]], [[1.0; 4]]];
    assert_eq!(
        [apart(&none, &one, 1.0), apart(&one, &none, 1.0), apart(&one, &one, 1.0)],
        [f32::INFINITY, f32::INFINITY, 0.0]
    );
}

#[test]
fn fireflies_are_cut_and_accounted_for() {
    let gpu = gpu();
    // A lone 9 over a floor of 1 is cut to twice that; two together keep each other.
    let mut input = picture::flat(20, 6);
    input.radiance.fill([1.0, 1.0, 1.0, 1.0]);
    input.radiance[2 * 20 + 4] = [9.0, 9.0, 9.0, 1.0];
    input.radiance[2 * 20 + 14] = [9.0, 9.0, 9.0, 1.0];
    input.radiance[3 * 20 + 14] = [9.0, 9.0, 9.0, 1.0];
    input.radiance[3 * 20 + 15] = [9.0, 9.0, 9.0, 1.0];
    let host = firefly::reference(&input, 2.0).radiance;
    let before = input.clone();
    let removed = firefly::remove_fireflies(&gpu, &mut input, 2.0).unwrap();
    assert!(apart(&input.radiance, &host, 1.0) < 1e-6);
    assert!((input.radiance[2 * 20 + 4][0] - 2.0).abs() < 1e-6 && input.radiance[2 * 20 + 14][0] == 9.0);
    assert_eq!((removed.pixels, removed.radiance[1].round()), (1, 7.0));
    assert!((removed.share - 7.0 / (120.0 + 4.0 * 8.0)).abs() < 1e-6, "{removed:?}");
    assert_eq!(firefly::removed(&before.radiance, &before.radiance).pixels, 0, "control: nothing was cut");
    // Over a floor of -1, and where it is itself negative, it is the same share.
    for (floor, lone) in [(-1.0, 9.0), (1.0, -9.0)] {
        let change = |c: &vec4| if c[0] == 1.0 { [floor, floor, floor, 1.0] } else { [lone, lone, lone, 1.0] };
        let mut input = FilterInput { radiance: before.radiance.iter().map(change).collect(), ..before.clone() };
        let signed = firefly::remove_fireflies(&gpu, &mut input, 2.0).unwrap();
        assert_eq!((signed.pixels, signed.share), (removed.pixels, removed.share), "{floor} {lone}: {signed:?}");
        assert_eq!(signed.radiance[1].round(), 7.0 * f64::from(lone).signum());
    }
    assert!(firefly::remove_fireflies(&gpu, &mut input, 0.5).is_err());

    // One sample has brought all of a pixel's light, whatever variance it tells; that of four without any is the light's own.
    for (count, kept) in [(1.0, 2.0), (4.0, 9.0)] {
        let mut input = FilterInput { variance: Some(vec![[0.0; 3]; 120]), ..before.clone() };
        input.radiance.iter_mut().for_each(|c| c[3] = count);
        let host = firefly::reference(&input, 2.0).radiance[2 * 20 + 4][0];
        firefly::remove_fireflies(&gpu, &mut input, 2.0).unwrap();
        assert_eq!([host, input.radiance[2 * 20 + 4][0]], [kept; 2], "{count} samples");
    }

    // Fewer than two known neighbours are no company to judge by, nor are dark ones; light below 0 counts by its size.
    let none = f32::NAN;
    let rows = [([none, 9.0, none], 9.0), ([1.0, 9.0, none], 9.0), ([1.0, 9.0, 3.0], 2.0), ([0.0, 9.0, 0.0], 9.0)];
    let below_0 = [([-0.5, 9.0, -3.0], 1.0), ([-0.5, -9.0, 3.0], -1.0), ([0.0, -9.0, 0.0], -9.0)];
    for (values, kept) in rows.into_iter().chain(below_0) {
        let mut input = line(&values);
        let host = firefly::reference(&input, 2.0).radiance;
        firefly::remove_fireflies(&gpu, &mut input, 2.0).unwrap();
        let found = [host[1][0], input.radiance[1][0]];
        assert!(found.iter().all(|v| (v - kept).abs() < 1e-6), "{values:?}: {found:?}");
    }

    let mut noisy = picture::noisy(33, 18);
    let calm = firefly::removed(&noisy.radiance, &firefly::reference(&noisy, 1.5).radiance).pixels;
    // Three times the deviation: more of it is brought by one sample.
    noisy.variance.iter_mut().flatten().for_each(|v| *v = v.map(|v| 9.0 * v));
    let host = firefly::reference(&noisy, 1.5);
    assert!(firefly::remove_fireflies(&gpu, &mut noisy, 1.5).unwrap().pixels > calm.max(3));
    assert!(apart(&noisy.radiance, &host.radiance, 1e-3) < 1e-5);
    let total = |input: &FilterInput| input.variance.iter().flatten().flatten().map(|v| f64::from(*v)).sum::<f64>();
    let [device, host] = [&noisy, &host].map(total);
    assert!(device > 0.0 && (device - host).abs() < 1e-5 * host, "{device} {host}");
    assert_silent(&gpu);
}

/// Samples of 1, of which one in `rare` is 300; and in the middle those of a true highlight, 0 or 40. What is cut away of them.
fn cut_of(spp: u32, rare: u32) -> (firefly::Removed, f32) {
    let mut input = picture::flat(24, 24);
    let random = |i: usize, k: u32| hash(hash(i as u32) ^ (k + 1));
    let sample = |i: usize, k: u32| match (i == 12 * 24 + 12, random(i, k)) {
        (true, random) => 40.0 * (random % 2) as f64,
        (false, random) => {
            if random.is_multiple_of(rare) {
                300.0
            } else {
                1.0
            }
        }
    };
    let moments = |i: usize| {
        let samples = (0..spp).map(|k| sample(i, k));
        let mean = samples.clone().sum::<f64>() / f64::from(spp);
        let m2: f64 = samples.map(|s| (s - mean).powi(2)).sum();
        (mean as f32, (m2 / f64::from(spp * (spp - 1))) as f32)
    };
    let (means, variances): (Vec<f32>, Vec<f32>) = (0..24 * 24).map(moments).unzip();
    input.radiance = means.iter().map(|&v| [v, v, v, spp as f32]).collect();
    input.variance = Some(variances.iter().map(|&v| [v; 3]).collect());
    let cut = firefly::reference(&input, 8.0);
    (firefly::removed(&input.radiance, &cut.radiance), cut.radiance[12 * 24 + 12][0])
}

/// Fireflies go where samples are few, and their light comes back with more: nothing is lost in the limit. What many samples agree
/// on is no firefly.
#[test]
fn what_is_cut_vanishes_with_more_samples() {
    let shares = [4, 16, 64, 256, 1024].map(|spp| cut_of(spp, 200).0.share);
    println!("{shares:.4?}");
    assert!(shares[0] > 0.2 && shares.windows(2).all(|pair| pair[1] <= pair[0]) && shares[4] == 0.0, "{shares:?}");
    let (removed, highlight) = cut_of(64, u32::MAX);
    assert!(removed.pixels == 0 && highlight > 12.0, "{removed:?} {highlight}");
}

/// A window of 644,000 taps: a software device ends a thread's loops after 65,535 rounds, silently.
#[test]
fn the_widest_windows_of_bilateral_are_whole() {
    let gpu = gpu();
    let input = picture::noisy(8, 400);
    let off = f32::INFINITY;
    let settings = FilterSettings::default().with(|s| {
        s.footprint.radius = 399;
        s.edge.sigma_n = off;
        s.edge.sigma_x = off;
    });
    let wide = both(&gpu, "bilateral", &input, &settings);
    let narrow = both(&gpu, "bilateral", &input, &settings.with(|s| s.footprint.radius = 30));
    assert!(apart(&wide, &narrow, 1.0) > 1e-2, "control: the window counts");
    assert_silent(&gpu);
}

/// Threads of some filters walk along whole lines: see `check_size`.
#[test]
fn the_longest_lines_are_whole() {
    let gpu = gpu();
    let narrow = FilterSettings::default().with(|s| s.footprint.radius = 0);
    let table = FilterSettings::default().with(|s| {
        s.guided.sums = GuidedSums::Table;
        s.guided.eps = [0.1; 4];
        s.footprint.radius = 3;
    });
    let rows = [("guided", FilterSettings::default()), ("guided", narrow), ("guided", table), ("atrous", narrow)];
    for [width, height] in [[60_000, 1], [1, 60_000]] {
        let input = picture::noisy(width, height);
        for (name, settings) in &rows {
            let settings = settings.scaled_to(&input);
            let device = run(&gpu, find(name).unwrap(), &input, &settings).unwrap().0;
            let host = (find(name).unwrap().reference)(&input, &settings);
            let off = apart(&device, &host, 1.0);
            assert!(off < 1e-2, "{name} {width}x{height}: {off} apart with {settings:?}");
        }
    }
    if gpu.info().kind == DeviceKind::Cpu {
        let wider = run(&gpu, find("none").unwrap(), &picture::noisy(60_001, 1), &narrow);
        assert!(wider.unwrap_err().to_string().contains("60000 along an edge"));
    }
    assert_silent(&gpu);
}

#[test]
fn bilateral_and_wavelets_solve_the_worked_examples() {
    let off = f32::INFINITY;
    let plain = FilterSettings::default().with(|s| {
        s.edge.sigma_rt = off;
        s.edge.sigma_n = off;
        s.edge.sigma_x = off;
        s.footprint.levels = 1;
    });
    // Radius 2 has a Gaussian of standard deviation 1: neighbours weigh e^-1/2 and e^-2.
    let reference = find("bilateral").unwrap().reference;
    let (near, far) = ((-0.5f32).exp(), (-2.0f32).exp());
    let blurred = red(&reference(&line(&[0.0, 0.0, 1.0, 0.0, 0.0]), &plain.with(|s| s.footprint.radius = 2)));
    assert!((blurred[2] - 1.0 / (1.0 + 2.0 * near + 2.0 * far)).abs() < 1e-6);
    assert!((blurred[0] - far / (1.0 + near + far)).abs() < 1e-6);
    // A step of 1 in all channels under a sigma of 1: squared distance 3.
    let edge = plain.with(|s| {
        s.footprint.radius = 1;
        s.edge.sigma_rt = 1.0;
    });
    let w = (-3.0f32 - 2.0).exp();
    assert!((red(&reference(&line(&[0.0, 1.0]), &edge))[0] - w / (1.0 + w)).abs() < 1e-6);

    let reference = find("wavelet").unwrap().reference;
    // CDF(2,2), 0 0 8 0 0: odd pixels miss by -4 each, the middle becomes 8 - 4/2 = 6, the ends, with one neighbour,
    // 0 - 4/2 = -2; without details the odd ones come back as 2. Light is not negative, unless that around is: 100 less of all.
    for (base, ends) in [(0.0, 0.0), (-100.0, -100.0), (-1.0, -1.0), (5.0, 3.0)] {
        let row = red(&reference(&line(&[0.0, 0.0, 8.0, 0.0, 0.0].map(|v| v + base)), &plain));
        assert_eq!(row, [ends, 2.0 + base, 6.0 + base, 2.0 + base, ends], "{base}");
    }
    // Red-black on 3x3 with 8 in the middle, which is red: each black pixel predicts (8 + 0 + 0) / 3 and misses by that,
    // the middle becomes 8 - 4/3 and corners -4/3; on the diagonals the middle is odd and comes back as their mean.
    let mut input = picture::flat(3, 3);
    input.radiance.fill([0.0, 0.0, 0.0, 1.0]);
    input.radiance[4] = [8.0, 8.0, 8.0, 1.0];
    let square = red(&reference(&input, &plain.with(|s| s.wavelet.basis = WaveletBasis::RedBlack)));
    // Corners before the second step -4/3, the middle 20/3 misses their mean by 8: corners gain half of that, 8/3.
    assert!(square.iter().all(|v| (v - 8.0 / 3.0).abs() < 1e-5), "{square:?}");
}

/// What the left of 0 | 1 takes of the right, which weighs 4/16 beside 6/16, less what it is unlike.
fn taken(unlike: f32) -> f32 {
    let w = (-unlike).exp() * 4.0 / 16.0;
    w / (w + 6.0 / 16.0)
}

#[test]
fn guides_that_are_none_are_alike() {
    let gpu = gpu();
    let off = f32::INFINITY;
    let left = |normals: [[f32; 3]; 2], positions: [[f32; 3]; 2], sigma_x: f32| {
        let mut input = line(&[0.0, 1.0]);
        for (g, (normal, position)) in input.guide.iter_mut().zip(normals.into_iter().zip(positions)) {
            (g.normal, g.position) = (normal, position);
        }
        let settings = FilterSettings::default().with(|s| {
            s.footprint.levels = 1;
            s.edge.sigma_rt = off;
            s.edge.sigma_n = 1.0;
            s.edge.sigma_x = sigma_x;
        });
        both(&gpu, "atrous", &input, &settings)[0][0]
    };
    // Too short, and too long to be measured; every normal differs from none by 1.
    for none in [[0.0; 3], [1e-11; 3], [0.0, 0.0, 1e30], [0.0, f32::INFINITY, 0.0], [f32::NAN, 0.0, 1.0]] {
        for (other, unlike) in [([0.0; 3], 0.0), ([0.0, 0.0, -1.0], 1.0), ([0.6, 0.0, 0.8], 1.0)] {
            let found = left([none, other], [[0.0; 3]; 2], off);
            assert!((found - taken(unlike)).abs() < 1e-5, "normals {none:?}, {other:?}: {found}");
        }
    }
    // No position is 0, and the farthest is 1e18.
    for (a, b, sigma_x, unlike) in [
        ([f32::NAN, 2.0, 2.0], [0.0; 3], 1.0, 0.0),
        ([2.0, f32::NEG_INFINITY, 2.0], [0.0; 3], 1.0, 0.0),
        ([-3e38, 0.0, 0.0], [3e38, 0.0, 0.0], 4e18, 0.25),
    ] {
        let found = left([[0.0; 3]; 2], [a, b], sigma_x);
        assert!((found - taken(unlike)).abs() < 1e-5, "positions {a:?}, {b:?}: {found}");
    }
    assert_silent(&gpu);
}

#[test]
fn svgf_counts_in_deviations() {
    let gpu = gpu();
    let off = f32::INFINITY;
    let plain = FilterSettings::default().with(|s| {
        s.edge.sigma_n = off;
        s.edge.sigma_x = off;
        s.footprint.levels = 1;
        s.svgf.sigma_l = 1.0;
    });
    // One sample, or a variance that is none, is not trusted: the window's 0 and 1 have 1/2, unbiased.
    let spread = std::f32::consts::SQRT_2;
    let pair = |[a, b]: [[f32; 3]; 2], samples: f32, variance: [f32; 3]| {
        let mut input = line(&[0.0; 2]);
        input.radiance = [a, b].map(|[r, g, b]| [r, g, b, samples]).to_vec();
        FilterInput { variance: Some(vec![variance; 2]), ..input }
    };
    let step = [[0.0; 3], [1.0; 3]];
    for (samples, variance, deviations) in [
        (4.0, [1.0; 3], 1.0),
        (4.0, [1e-6; 3], 1e3),
        (2.0, [1.0; 3], 1.0),
        (8.0, [1.0; 3], 1.0),
        (128.0, [1.0; 3], 2.0), // of 16 times as many the fourth root
        (1.0, [1.0; 3], spread),
        (4.0, [1.0, f32::NAN, 1.0], spread),
        (4.0, [1.0, f32::INFINITY, 1.0], spread),
        (4.0, [1.0, 1.0, -1.0], spread),
        (4.0, [f32::MAX; 3], 0.0),
    ] {
        let left = both(&gpu, "svgf", &pair(step, samples, variance), &plain)[0][0];
        assert!((left - taken(deviations)).abs() < 1e-5, "{samples} samples, variance {variance:?}: {left}");
    }
    // An infinite sigma switches the weight off, also where nothing varies: that counts as a deviation of 1e-30.
    for (sigma_l, left) in [(off, taken(0.0)), (1e30, taken(1.0)), (1.0, 0.0), (0.0, 0.0)] {
        let settings = plain.with(|s| s.svgf.sigma_l = sigma_l);
        let found = both(&gpu, "svgf", &pair(step, 4.0, [0.0; 3]), &settings)[0][0];
        assert!((found - left).abs() < 1e-6, "sigma {sigma_l}: {found}");
        let of_many = red(&both(&gpu, "svgf", &pair([[1.0; 3]; 2], 1e7, [0.0; 3]), &settings));
        assert_eq!(of_many, [1.0; 2], "sigma {sigma_l}");
        // Red and blue of one luminance, 0.2126 to the last bit, are no step at all.
        let alike = [[1.0, 0.0, 0.0], [0.0, 0.0, 2.944_598_2]];
        let red = red(&both(&gpu, "svgf", &pair(alike, 4.0, [0.0; 3]), &settings));
        assert!((red[0] - 0.6).abs() < 1e-6 && (red[1] - 0.4).abs() < 1e-6, "sigma {sigma_l}: {red:?}");
    }
    // A hole that one level does not fill has no variance yet.
    let mut holed = picture::noisy(31, 1);
    holed.radiance[12..24].iter_mut().for_each(|c| c[3] = 0.0);
    both(&gpu, "svgf", &holed, &FilterSettings::default().scaled_to(&holed));
    // Contrast is cut at 1e18: one in a window of 7 has a variance of 1/7 of its square, so that it is one deviation away
    // from the 4 4 1 1 sixteenths around its own 6.
    let mut values = [0.0; 9];
    values[4] = 8e23;
    let cut = red(&both(&gpu, "svgf", &line(&values), &plain.with(|s| s.svgf.sigma_l = 7f32.sqrt())))[4] / 8e23;
    assert!((cut - 6.0 / (6.0 + 10.0 * (-1.0f32).exp())).abs() < 1e-5, "{cut}");
    assert_silent(&gpu);
}

/// 0 and a value beside it, on two surfaces that only `guided` takes for one: its windows make half of the value of both.
#[test]
fn auto_trusts_variances_of_two_samples() {
    let gpu = gpu();
    let settings = FilterSettings::default().with(|s| {
        s.edge.sigma_n = 0.05;
        s.guided.eps = [1e30; 4];
    });
    for (samples, variance, value, taken) in [
        // Left out, each pixel is missed: none and svgf, which changes nothing, are better.
        (2.0, 0.0, 1.0, 0.0),
        // A pixel that stands alone seems not to vary: of one sample that is no proof.
        (1.0, 0.0, 1.0, 0.5),
        // Squares stay finite: of deviations, and of values 1e23 times the luminance below which errors are absolute. Where noise drowns
        // the light, svgf is not trusted by left-out pixels alone.
        (4.0, f32::MAX, 1.0, 0.5),
        (65536.0, f32::MAX, 1.0, 0.5),
        (4.0, 0.0, 4e20, 0.0),
    ] {
        let mut input = line(&[0.0, value]);
        input.guide[1].normal = [0.0, 1.0, 0.0];
        input.radiance.iter_mut().for_each(|c| c[3] = samples);
        input.variance = Some(vec![[variance; 3]; 2]);
        let found = red(&both(&gpu, "auto", &input, &settings));
        let right = [taken, 1.0 - taken].map(|share| share * value);
        assert!(
            found.iter().zip(right).all(|(a, b)| (a - b).abs() < 1e-6 * value),
            "{samples} {variance} {value}: {found:?}"
        );
    }
    assert_silent(&gpu);
}

/// A cell of 2x2 pixels stands for the place of one of them, whose bits it keeps: any distance at all counts.
#[test]
fn cells_lie_where_their_pixels_do() {
    let gpu = gpu();
    for samples in [1.0, 2.0] {
        let mut input = picture::noisy(25, 24);
        for (i, (c, g)) in input.radiance.iter_mut().zip(&mut input.guide).enumerate() {
            c[3] = samples;
            g.position = [(i % 5) as f32 + 1.0 / 3.0, (i / 75) as f32, 1.0];
        }
        let settings = FilterSettings::default().scaled_to(&input).with(|s| s.edge.sigma_x = 0.0);
        both(&gpu, "auto", &input, &settings);
    }
    assert_silent(&gpu);
}

/// Filters read neighbours while they write.
#[test]
fn an_output_that_is_the_radiance_is_refused() {
    let gpu = gpu();
    let input = picture::noisy(8, 8);
    for row in FILTERS {
        let planes = Planes::new(&gpu, &input).unwrap();
        let filter = row.compile(&gpu, &FilterSettings::default(), planes.size).unwrap();
        let one = Planes { output: planes.radiance.clone(), ..planes };
        let error = gpu.run(&mut FrameResources::new(&gpu).unwrap(), |rec| filter.record(rec, &one)).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains("a buffer of its own"), "{}: {error}", row.name);
    }
}

/// A sphere in noisy light of about 2000 from the side, and in light of .1 without noise from all around.
fn terminator() -> FilterInput {
    let mut input = picture::flat(32, 32);
    let mut variance = vec![[1e-12; 3]; input.radiance.len()];
    for (i, (c, g)) in input.radiance.iter_mut().zip(&mut input.guide).enumerate() {
        let [x, y] = [i % 32, i / 32].map(|k| (k as f32 - 15.5) / 11.0);
        let seen = x * x + y * y < 1.0;
        let z = (1.0 - x * x - y * y).max(0.0).sqrt();
        let lit = 2000.0 * (0.8 * x - 0.6 * z).max(0.0);
        let light = 0.1 + lit * (0.7 + 0.3 * hash(i as u32) as f32 / 2f32.powi(31));
        if lit > 0.0 {
            variance[i] = [(0.3 * lit).powi(2) / 3.0; 3];
        }
        *c = if seen { [light, light, light, 4.0] } else { [0.0; 4] };
        let normal = if seen { [x, y, z] } else { [0.0; 3] };
        (g.normal, g.position, g.depth) = (normal, normal, if seen { 4.0 - z } else { 0.0 });
    }
    input.variance = Some(variance);
    input
}

#[test]
fn light_beside_bright_edges_stays_light() {
    let gpu = gpu();
    let input = terminator();
    let settings = FilterSettings::default().scaled_to(&input);
    for (name, least) in [("auto", 0.0999), ("guided", 0.0), ("wavelet", 0.0)] {
        let row = find(name).unwrap();
        let (device, host) = (run(&gpu, row, &input, &settings).unwrap().0, (row.reference)(&input, &settings));
        for (made, by) in [(&device, "device"), (&host, "twin")] {
            let seen = made.iter().zip(&input.radiance).filter(|(_, c)| c[3] > 0.0).map(|(v, _)| v[0]);
            let dark: Vec<f32> = seen.filter(|v| v.is_nan() || *v < least).collect();
            assert!(dark.is_empty(), "{name}, {by}: {dark:?}");
        }
    }
    assert_silent(&gpu);
}
