//! Checks what every filter must keep to whatever its input: constant images come back, invalid pixels reach no others, and no NaN
//! comes out. Every check runs over every row of the table of filters, on the device and on its twin.
use crate::picture;
use crate::support::{assert_silent, gpu, hash, largest};
use tallow::denoise::filter::{AtrousForm, FILTERS, FilterInput, FilterSettings, Row, find, run};
use tallow::gpu::Gpu;
use tallow::layout::{Guide, vec4};

/// Device and twin, under every setting that the filter is tested with and these besides.
fn outputs(gpu: &Gpu, row: &Row, input: &FilterInput, more: &[FilterSettings]) -> Vec<Vec<vec4>> {
    let all = picture::settings(row.name).into_iter().chain(more.iter().copied());
    all.flat_map(|s| {
        let s = s.scaled_to(input);
        [run(gpu, row, input, &s).unwrap().0, (row.reference)(input, &s)]
    })
    .collect()
}

/// Settings at the ends of their ranges.
fn extremes() -> Vec<FilterSettings> {
    let base = FilterSettings::default();
    let sigmas = |sigma: f32| {
        base.with(|s| {
            (s.edge.sigma_rt, s.edge.sigma_n, s.edge.sigma_x) = (sigma, sigma, sigma);
            s.svgf.sigma_l = sigma;
        })
    };
    let wide = sigmas(f32::INFINITY).with(|s| {
        s.guided.eps = [0.0; 4];
        s.footprint.radius = 100;
        s.footprint.levels = 10;
    });
    vec![sigmas(0.0).with(|s| s.footprint.radius = 0), wide, sigmas(1e-30), sigmas(1e30)]
}

/// Of most images here, in pixels: kernels of windows are compiled for the lines that they go along, and so are shared. Patterns with
/// periods of 3 to 13 pixels do not repeat from row to row.
const WIDTH: u32 = 34;
const HEIGHT: u32 = 18;
/// The channels of a constant image, in units of its value.
const TINT: [f32; 3] = [1.0, 0.3, 0.7];
/// Two units in the last place.
const ULPS: f32 = 2.0 * f32::EPSILON;
/// Of what is a sum of others.
const IN_PAINTED: f32 = 2e-6;

/// Every known pixel of every output holds `value` to `tolerance`, and at least the input's known pixels are known.
fn assert_all(name: &str, outputs: &[Vec<vec4>], input: &FilterInput, value: f32, tolerance: f32) {
    for (case, output) in outputs.iter().enumerate() {
        for (i, (out, c)) in output.iter().zip(&input.radiance).enumerate() {
            let near =
                TINT.iter().zip(out).all(|(tint, v)| (v - tint * value).abs() <= tolerance * (tint * value).abs());
            let lost = out[3] == 0.0 && !(c[3] > 0.0 && c.iter().all(|v| v.is_finite()));
            assert!(near || lost, "{name} case {case} pixel {i}: {out:?}, not {value}");
        }
    }
}

/// Which pixels have a value.
fn reached(output: &[vec4]) -> Vec<bool> {
    output.iter().map(|c| c[3] > 0.0).collect()
}

fn constant(width: u32, height: u32, value: f32) -> FilterInput {
    let mut input = picture::clean(width, height);
    let [r, g, b] = TINT.map(|tint| tint * value);
    input.radiance.fill([r, g, b, 1.0]);
    input.variance = Some(vec![[0.0; 3]; input.radiance.len()]);
    input
}

#[test]
fn constant_images_come_back() {
    let gpu = gpu();
    for row in FILTERS {
        let sizes = [(1, 1), (WIDTH, 1)].map(|size| (size, 0.5));
        let values = [0.0, 1e-30, 1e20].map(|value| ((WIDTH, HEIGHT), value));
        for ((width, height), value) in sizes.into_iter().chain(values) {
            let input = constant(width, height, value);
            let outputs = outputs(&gpu, row, &input, &extremes());
            assert_all(row.name, &outputs, &input, value, ULPS);
            let mut wrong = outputs[0].clone();
            wrong[0][0] += 1e-6 * value + 1e-35;
            let caught = std::panic::catch_unwind(|| assert_all("", &[wrong], &input, value, ULPS)).is_err();
            assert!(caught, "control: a pixel is 1e-6 off");
        }
    }
    assert_silent(&gpu);
}

#[test]
fn a_constant_image_stands_any_guide() {
    let gpu = gpu();
    let bad = |v: f32| Guide { normal: [v; 3], depth: v, position: [v; 3], albedo: [v; 3], ..Guide::default() };
    let fills = [0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, 1e-38, 1e7].map(bad);
    // Holes, so that a pixel may have nothing alike in reach.
    let holed = || {
        let mut input = constant(WIDTH, HEIGHT, 3.0);
        input.radiance.iter_mut().step_by(3).for_each(|c| *c = [f32::NAN, 3.0, 3.0, 1.0]);
        input
    };
    for row in FILTERS {
        let mut mixed = holed();
        for (i, fill) in fills.iter().enumerate() {
            mixed.guide.iter_mut().skip(i).step_by(11).for_each(|g| *g = *fill);
        }
        for fill in [f32::NAN, f32::MAX] {
            let mut input = holed();
            input.guide.fill(bad(fill));
            assert_all(row.name, &outputs(&gpu, row, &input, &extremes()), &input, 3.0, IN_PAINTED);
        }
        assert_all(row.name, &outputs(&gpu, row, &mixed, &extremes()), &mixed, 3.0, IN_PAINTED);
    }
    assert_silent(&gpu);
}

#[test]
fn bad_radiance_reaches_no_other_pixel() {
    let gpu = gpu();
    for row in FILTERS {
        let mut input = constant(WIDTH, HEIGHT, 0.25);
        let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
        for (i, c) in input.radiance.iter_mut().enumerate().filter(|(i, _)| i % 7 == 3) {
            *c = match i % 4 {
                3 => [9.0, 9.0, 9.0, [0.0, -1.0, f32::NAN, f32::INFINITY][i / 4 % 4]],
                j => [0.25, bad[j], 0.25, 1.0],
            };
        }
        for (i, v) in input.variance.as_mut().unwrap().iter_mut().enumerate().filter(|(i, _)| i % 5 == 1) {
            *v = [bad[i % 3], -1.0, 1e38];
        }
        assert_all(row.name, &outputs(&gpu, row, &input, &extremes()), &input, 0.25, IN_PAINTED);
    }
    assert_silent(&gpu);
}

#[test]
fn one_known_pixel_is_all_there_is() {
    const KNOWN: usize = 6 * WIDTH as usize + 14;
    let gpu = gpu();
    for row in FILTERS {
        let mut input = constant(WIDTH, HEIGHT, 7.0);
        input.radiance.iter_mut().enumerate().filter(|(i, _)| *i != KNOWN).for_each(|(_, c)| *c = [5.0, 5.0, 5.0, 0.0]);
        // Wall and floor differ by 2 when squared: weights of 2^-45, and of 2^-76, whose square is 0.
        let faint = [45.0, 76.0].map(|exponent: f32| {
            FilterSettings::default().with(|s| {
                s.edge.sigma_n = (2.0 * std::f32::consts::LOG2_E / exponent).sqrt();
                s.edge.sigma_x = f32::INFINITY;
            })
        });
        let outputs = outputs(&gpu, row, &input, &[&extremes()[..], &faint].concat());
        for (case, pair) in outputs.chunks(2).enumerate() {
            assert_eq!(reached(&pair[0]), reached(&pair[1]), "{} case {case}: in-painted by one alone", row.name);
        }
        for output in &outputs {
            let odd = output.iter().find(|c| **c != [0.0; 4] && (0..3).any(|i| (c[i] - 7.0 * TINT[i]).abs() > 1e-5));
            assert!(odd.is_none() && output[KNOWN][3] > 0.0, "{}: {odd:?}", row.name);
        }
    }
    assert_silent(&gpu);
}

/// Extreme values side by side, of radiance, its variance and guides, and nothing known in a corner: whatever comes out is
/// a number.
#[test]
fn no_nan_leaves_a_filter() {
    let gpu = gpu();
    for row in FILTERS {
        let mut input = picture::noisy(35, 20);
        let values = [0.0, 1e-38, 1e-30, 65504.0, 1e20, 3e38, -1.0, -3e38];
        for (i, c) in input.radiance.iter_mut().enumerate().filter(|(i, _)| i % 3 == 0) {
            *c = [values[i / 3 % 8], values[i / 24 % 8], values[i % 8], [1.0, 4.0][i / 3 % 2]];
        }
        let corner = (0..).zip(&mut input.radiance).filter(|(i, _)| i % 35 < 17 && i / 35 < 14);
        corner.for_each(|(_, c)| c[3] = 0.0);
        for (i, v) in input.variance.iter_mut().flatten().enumerate().filter(|(i, _)| i % 5 < 2) {
            *v = [[0.0, 3e38][i % 2]; 3];
        }
        // Channels of very different contrast.
        for (i, g) in input.guide.iter_mut().enumerate().filter(|(i, _)| i % 35 > 20) {
            g.normal = [1e-9 * (i % 7) as f32, [-2e7, 2e7][i % 2], 1e-9 * (i % 5) as f32];
            g.position = [[-3e38, 3e38][i % 2], 0.0, 1e-30];
        }
        for output in outputs(&gpu, row, &input, &extremes()) {
            assert!(output.iter().flatten().all(|v| v.is_finite()), "{}: a NaN or an infinity", row.name);
        }
    }
    assert_silent(&gpu);
}

/// Two planes at right angles, lit apart.
fn two_planes() -> FilterInput {
    let mut input = constant(64, 40, 1.0);
    for (i, (c, g)) in input.radiance.iter_mut().zip(&mut input.guide).enumerate() {
        let left = i % 64 < 30;
        *g = Guide { normal: [f32::from(left), f32::from(!left), 0.0], depth: 1.0, ..Guide::default() };
        *c = if left { [0.0, 0.0, 0.0, 1.0] } else { [4.0, 4.0, 4.0, 1.0] };
    }
    input
}

/// Neither takes light from the other.
#[test]
fn edges_of_the_geometry_hold() {
    let gpu = gpu();
    for row in FILTERS {
        let input = two_planes();
        // Narrow weights of normals alike on every level, and none of radiance, which would hold the edge by itself; what a
        // filter of linear fits lets through is its eps against the contrast of the guide.
        let any = f32::INFINITY;
        let base = FilterSettings::default().with(|s| {
            s.edge.sigma_rt = any;
            s.svgf.sigma_l = any;
            s.atrous.form = AtrousForm::Squared;
        });
        let narrow = base.with(|s| {
            s.edge.sigma_n = 0.1;
            s.guided.eps = [1e-4; 4];
        });
        let narrow = narrow.scaled_to(&input);
        for output in [run(&gpu, row, &input, &narrow).unwrap().0, (row.reference)(&input, &narrow)] {
            let worst = largest(output.iter().zip(&input.radiance).map(|(a, b)| (a[0] - b[0]).abs()));
            assert!(worst < 0.25, "{}: {worst} crossed the edge", row.name);
        }
    }
    assert_silent(&gpu);
}

/// Of the planes above, only every 2nd or 4th pixel of every 2nd or 4th row has samples: every other takes the light of its own
/// plane. Windows of fits that end before the first sample of the other plane know nothing of it: up to 3 of 49 of `guided`'s and
/// of 9 of `auto`'s narrow ones extrapolate.
#[test]
fn sub_sampled_images_are_in_painted() {
    let gpu = gpu();
    for row in ["atrous", "bilateral", "guided", "svgf", "auto"].map(|name| find(name).unwrap()) {
        for spacing in [2, 4] {
            let mut input = two_planes();
            let unknown = |i: usize| [i % 64, i / 64].iter().any(|at| !at.is_multiple_of(spacing));
            (0..).zip(&mut input.radiance).filter(|(i, _)| unknown(*i)).for_each(|(_, c)| *c = [1e3, 1e3, 1e3, 0.0]);
            let narrow = FilterSettings::default()
                .with(|s| {
                    s.edge.sigma_n = 0.1;
                    s.guided.eps = [1e-6; 4];
                })
                .scaled_to(&input);
            for output in [run(&gpu, row, &input, &narrow).unwrap().0, (row.reference)(&input, &narrow)] {
                let off = |(i, c): (usize, &vec4)| (c[0] - if i % 64 < 30 { 0.0 } else { 4.0 }).abs();
                let worst = largest(output.iter().enumerate().map(off));
                let most = match row.name {
                    "guided" => 4.0 * 3.0 / 49.0,
                    "auto" => 4.0 * 3.0 / 9.0,
                    _ => 1e-6,
                };
                assert!(worst <= most, "{}: {worst}", row.name);
            }
        }
    }
    assert_silent(&gpu);
}

/// A wall with grooves of two pixels, lit by what faces the light: relief that a filter must not take for noise. `wavelet`
/// does, which predicts a pixel from two neighbours however small their weights (Fattal 2009).
#[test]
fn bumps_stay() {
    let (gpu, off) = (gpu(), f32::INFINITY);
    let mut input = constant(64, 40, 1.0);
    let side = |i: usize| if (i / 2).is_multiple_of(2) { 1.0 } else { -1.0 };
    for (i, (c, g)) in input.radiance.iter_mut().zip(&mut input.guide).enumerate() {
        *g = Guide { normal: [0.6 * side(i), 0.0, 0.8], depth: 5.0, position: [0.0, 0.0, -5.0], ..Guide::default() };
        *c = [1.0 + 0.3 * side(i), 1.0, 1.0, 4.0];
    }
    let kept = |row: &Row, settings: FilterSettings| {
        let output = run(&gpu, row, &input, &settings.scaled_to(&input)).unwrap().0;
        output.iter().enumerate().map(|(i, c)| side(i) * c[0]).sum::<f32>() / (0.3 * 64.0 * 40.0)
    };
    let settings = FilterSettings::default().with(|s| {
        s.edge.sigma_rt = off;
        s.svgf.sigma_l = off;
    });
    for row in FILTERS.iter().filter(|row| row.name != "wavelet") {
        assert!(kept(row, settings) > 0.85, "{} kept {}", row.name, kept(row, settings));
    }
    let blind = settings.with(|s| s.edge.sigma_n = off);
    assert!(kept(find("atrous").unwrap(), blind) < 0.1, "control: without normals they are noise");
    assert_silent(&gpu);
}

/// Light that differs from pixel to pixel: whatever differs is an edge.
#[test]
fn a_sigma_of_zero_leaves_an_image_as_it_is() {
    let gpu = gpu();
    let mut input = picture::noisy(WIDTH, HEIGHT);
    input.radiance.iter_mut().for_each(|c| c[3] = 4.0);
    let zero = FilterSettings::default()
        .with(|s| {
            s.edge.sigma_rt = 0.0;
            s.svgf.sigma_l = 0.0;
        })
        .scaled_to(&input);
    for row in ["atrous", "bilateral", "wavelet", "svgf"].map(|name| find(name).unwrap()) {
        for output in [run(&gpu, row, &input, &zero).unwrap().0, (row.reference)(&input, &zero)] {
            let odd = output.iter().zip(&input.radiance).find(|(a, b)| a != b);
            assert!(odd.is_none(), "{}: {odd:?}", row.name);
        }
    }
    assert_silent(&gpu);
}

/// Left, a pattern of light without noise, which every filter but none blurs; right, noise without a pattern. Towards the noise
/// the pattern fades, as what is estimated of it does, from column to column by an eighth of it at most.
#[test]
fn auto_changes_from_filter_to_filter_without_a_seam() {
    const HALF: usize = 48;
    let gpu = gpu();
    let mut input = constant(2 * HALF as u32, 48, 1.0);
    let wall = Guide { normal: [0.0, 0.0, 1.0], depth: 5.0, position: [0.0, 0.0, -5.0], ..Guide::default() };
    input.guide.fill(wall);
    let sign = |x: usize, y: usize| if (x + y).is_multiple_of(2) { 1.0 } else { -1.0 };
    for (i, c) in input.radiance.iter_mut().enumerate() {
        let (x, y) = (i % (2 * HALF), i / (2 * HALF));
        let noise = 2.0 * (hash(i as u32) as f32 / u32::MAX as f32) - 1.0;
        let (value, variance) = if x < HALF { (1.0 + 0.3 * sign(x, y), 0.0) } else { (1.0 + noise, 1.0 / 3.0) };
        *c = [value, value, value, 16.0];
        input.variance.as_mut().unwrap()[i] = [variance; 3];
    }
    let auto = find("auto").unwrap();
    let output = run(&gpu, auto, &input, &FilterSettings::default().scaled_to(&input)).unwrap().0;
    let kept = |x: usize| (0..48).map(|y| sign(x, y) * (output[y * 2 * HALF + x][0] - 1.0)).sum::<f32>() / (0.3 * 48.0);
    assert!(kept(0) > 0.99 && (HALF..2 * HALF).all(|x| kept(x).abs() < 0.1), "the pattern is kept, and noise is not");
    let steepest = largest((1..HALF).map(|x| (kept(x) - kept(x - 1)).abs()));
    assert!(steepest < 0.125, "{:.3?}", (0..HALF).map(kept).collect::<Vec<_>>());
    assert_silent(&gpu);
}

/// On a floor lit by 1, a patch whose light rises with the tilt of its normals, by 20 from 0 at a tilt of .1. At -.4 a fit in the
/// patch predicts less than 0, by a slope that `eps` makes smaller in narrow windows and next to none in wide ones: light is not
/// below 0.
#[test]
fn auto_makes_no_negative_light() {
    const EDGE: usize = 72;
    let gpu = gpu();
    let mut input = constant(EDGE as u32, EDGE as u32, 1.0);
    let tilted = |tilt: f32| Guide { normal: [tilt, 0.0, (1.0 - tilt * tilt).sqrt()], depth: 5.0, ..Guide::default() };
    for (i, (c, g)) in input.radiance.iter_mut().zip(&mut input.guide).enumerate() {
        let tilt = 0.1 + 0.3 * (hash(i as u32) as f32 / u32::MAX as f32);
        let patch = [i % EDGE, i / EDGE].iter().all(|at| (16..56).contains(at));
        (*c, *g) = if patch { ([20.0 * (tilt - 0.1); 4], tilted(tilt)) } else { ([1.0; 4], tilted(0.0)) };
        c[3] = 16.0;
    }
    // Noise that lets all pixels' errors count, of more pixels than one workgroup adds up.
    input.variance = Some(vec![[0.5; 3]; EDGE * EDGE]);
    let beyond = EDGE / 2 * EDGE + EDGE / 2;
    input.guide[beyond] = tilted(-0.4);
    input.radiance[beyond] = [0.0; 4];
    let settings = FilterSettings::default().scaled_to(&input);
    let narrow = settings.with(|s| {
        s.footprint.radius = 4;
        s.guided.eps = [1e-3; 4];
    });
    assert_eq!(
        (find("guided").unwrap().reference)(&input, &narrow)[beyond][0],
        0.0,
        "control: a fit goes below, and is cut"
    );
    let auto = find("auto").unwrap();
    let (output, reference) = (run(&gpu, auto, &input, &settings).unwrap().0, (auto.reference)(&input, &settings));
    assert!(output.iter().chain(&reference).all(|c| c[0] >= 0.0), "{:?}", output[beyond]);
    let apart = largest(output.iter().zip(&reference).map(|(a, b)| (a[0] - b[0]).abs()));
    assert!(apart < 1e-4, "{apart}");
    assert_silent(&gpu);
}

fn mean(pixels: &[vec4]) -> f64 {
    pixels.iter().map(|c| f64::from(c[0] + c[1] + c[2])).sum::<f64>() / pixels.len() as f64
}

/// One pixel of a lamp beside an edge in the light: what lies far from it is filtered as without it.
#[test]
fn a_bright_pixel_does_not_blur_the_others() {
    let gpu = gpu();
    let mut plain = constant(64, 40, 1.0);
    let edge = |i: usize| if i % 64 < 32 { 1.0 } else { 2.0 };
    plain.radiance.iter_mut().enumerate().for_each(|(i, c)| *c = [edge(i), edge(i), edge(i), 4.0]);
    let mut lamp = plain.clone();
    lamp.radiance[0] = [1e5, 1e5, 1e5, 4.0];
    let settings = FilterSettings::default().with(|s| {
        s.edge.sigma_rt = 0.1;
        s.footprint.levels = 2;
        s.footprint.radius = 8;
    });
    let far = |i: usize| i % 64 >= 20;
    for row in ["atrous", "bilateral", "wavelet"].map(|name| find(name).unwrap()) {
        for input in [&plain, &lamp] {
            let settings = settings.scaled_to(input);
            for output in [run(&gpu, row, input, &settings).unwrap().0, (row.reference)(input, &settings)] {
                let off = output.iter().enumerate().filter(|(i, _)| far(*i)).map(|(i, c)| (c[0] - edge(i)).abs());
                let worst = largest(off);
                assert!(worst < 1e-3, "{}: {worst}", row.name);
            }
        }
    }
    assert_silent(&gpu);
}

#[test]
fn energy_is_kept() {
    let gpu = gpu();
    let row = find("atrous").unwrap();
    let mut input = picture::noisy(96, 80);
    input.radiance.iter_mut().for_each(|c| c[3] = 4.0);
    let narrow = FilterSettings::default().with(|s| s.edge.sigma_rt = 0.05).scaled_to(&input);
    let ratio = |s: &FilterSettings| mean(&run(&gpu, row, &input, s).unwrap().0) / mean(&input.radiance);
    let kept = ratio(&narrow.with(|s| s.atrous.conserve_energy = true));
    assert!((kept - 1.0).abs() < 1e-5, "{kept}");
    let lost = ratio(&narrow);
    assert!((lost - 1.0).abs() > 1e-3, "control: as published, {lost} of the light is left");
    assert_silent(&gpu);
}

#[test]
fn settings_and_images_out_of_range_are_refused() {
    let gpu = gpu();
    let (row, input, base) = (find("atrous").unwrap(), constant(4, 4, 1.0), FilterSettings::default());
    let refused = [
        base.with(|s| s.footprint.levels = 0),
        base.with(|s| s.footprint.levels = 11),
        base.with(|s| s.edge.sigma_n = -1.0),
        base.with(|s| s.edge.sigma_x = f32::NAN),
        base.with(|s| s.edge.extent = 0.0),
        base.with(|s| s.edge.intensity = f32::INFINITY),
    ];
    for settings in refused {
        let error = run(&gpu, row, &input, &settings).map(|_| ()).unwrap_err();
        assert_eq!(error.exit_code(), 2, "{error}");
    }
    let short = FilterInput { guide: vec![Guide::default(); 15], ..input.clone() };
    let error = run(&gpu, row, &short, &base).map(|_| ()).unwrap_err();
    assert!(error.to_string().contains("guide has 15 pixels"), "{error}");
    assert!(run(&gpu, row, &FilterInput::default(), &base).is_err());
    for row in FILTERS {
        // 16 GiB per plane.
        let error = row.compile(&gpu, &base, [32768, 32768]).map(|_| ()).unwrap_err();
        assert!(error.exit_code() == 4 && error.to_string().contains("too large to filter"), "{}: {error}", row.name);
    }
}
