//! Statistics of the random numbers and of the warps built on them.
use crate::statistics::{chi_square, sidak, uniform_2d};
use glam::{Mat3, Vec2, Vec3, vec2};
use std::f64::consts::TAU;
use tallow::layout::{Camera, Effects, FrameConstants, PathConstants};
use tallow::math::warp::*;
use tallow::twins::camera::{eye_ray, film_from_pixel, film_sample};
use tallow::twins::sampler::{sample_2d, sample_2d_bits, sampler_start};

/// Every elementary interval of area 2^-k holds one of these 2^k points.
fn is_stratified(points: &[[u32; 2]]) -> bool {
    let k = points.len().trailing_zeros();
    (0..=k).all(|a| {
        let shift = |word: u32, bits: u32| if bits == 0 { 0 } else { word >> (32 - bits) };
        let mut seen = vec![false; points.len()];
        points.iter().all(|p| {
            let cell = (shift(p[0], a) << (k - a) | shift(p[1], k - a)) as usize;
            !std::mem::replace(&mut seen[cell], true)
        })
    })
}

#[test]
fn every_pair_fills_every_elementary_interval() {
    for (pixel, pair, seed) in [(0, 0, 0), (1, 0, 0), (0, 1, 0), (123_456, 77, 9), (u32::MAX, 4095, u32::MAX)] {
        let points = |first: u32, k: u32, independent: bool| -> Vec<[u32; 2]> {
            (first..first + (1 << k))
                .map(|i| sample_2d_bits(sampler_start(pixel, i, seed, independent), pair))
                .collect()
        };
        for k in 0..=12 {
            // The first 2^k points, and any later block of that length: samples can be resumed.
            assert!(is_stratified(&points(0, k, false)), "pixel {pixel} pair {pair}, 2^{k} points");
            assert!(is_stratified(&points(5 << k, k, false)), "pixel {pixel} pair {pair}, sixth block of 2^{k}");
            // Controls: independent numbers, and a block that starts between two.
            assert!(k < 4 || !is_stratified(&points(0, k, true)));
            assert!(k < 4 || !is_stratified(&points(3, k, false)));
        }
    }
}

/// Named families of points in the unit square that must look uniform.
fn families(independent: bool) -> Vec<(String, Vec<[f64; 2]>)> {
    const COUNT: u32 = 1 << 16;
    let at = |pixel: u32, index: u32, pair: u32, seed: u32| -> [f64; 2] {
        let p = sample_2d(sampler_start(pixel, index, seed, independent), pair);
        [f64::from(p.x), f64::from(p.y)]
    };
    let mut all: Vec<(String, Vec<[f64; 2]>)> = Vec::new();
    let mut add = |name: String, point: &dyn Fn(u32) -> [f64; 2]| all.push((name, (0..COUNT).map(point).collect()));
    for (a, b) in [(0, 1), (0, 2), (1, 5), (7, 8), (2, 1000)] {
        for axes in 0..4 {
            add(format!("pairs {a}, {b}, axes {axes}, over pixels"), &|p| {
                [at(p, 0, a, 0)[axes & 1], at(p, 0, b, 0)[axes >> 1]]
            });
            add(format!("pairs {a}, {b}, axes {axes}, over samples"), &|i| {
                [at(9, i, a, 0)[axes & 1], at(9, i, b, 0)[axes >> 1]]
            });
        }
    }
    for index in [0, 1, 2, 63] {
        add(format!("sample {index} over pixels"), &|p| at(p, index, 3, 0));
        add(format!("sample {index} over pairs"), &|pair| at(5, index, pair, 0));
        add(format!("sample {index} over seeds"), &|seed| at(5, index, 3, seed));
        for stride in [1, 512] {
            for axis in 0..2 {
                add(format!("sample {index}, pixels {stride} apart, axis {axis}"), &|p| {
                    [at(p, index, 3, 0)[axis], at(p + stride, index, 3, 0)[axis]]
                });
            }
        }
    }
    all
}

#[test]
fn pixels_pairs_and_seeds_are_independent() {
    for independent in [false, true] {
        let families = families(independent);
        let level = sidak(2 * families.len());
        for (name, points) in &families {
            let p = uniform_2d(points.iter().copied());
            assert!(p > level, "{name}, independent {independent}: p = {p:.1e}");
        }
    }
    // Controls: one pair used twice; two pixels under one stream.
    let level = sidak(1);
    let twice = (0..1 << 16).map(|i| [f64::from(sample_2d(sampler_start(i, 0, 0, false), 0).x); 2]);
    assert!(uniform_2d(twice) < level);
    let shared = (0..1 << 16).map(|p| [sampler_start(p / 2, 0, 0, false); 2].map(|s| f64::from(sample_2d(s, 0).y)));
    assert!(uniform_2d(shared) < level);
}

#[test]
fn points_within_a_pixel_do_not_bias_their_mean() {
    // The mean of x * y over 16 samples, averaged over pixels: 1/4 within 4 standard errors, with less variance than
    // independent numbers give.
    let moments = |independent: bool| {
        let means: Vec<f64> = (0..1 << 14)
            .map(|pixel| {
                let sum: f32 =
                    (0..16).map(|i| sample_2d(sampler_start(pixel, i, 1, independent), 4)).map(|u| u.x * u.y).sum();
                f64::from(sum) / 16.0
            })
            .collect();
        let mean = means.iter().sum::<f64>() / means.len() as f64;
        (mean, means.iter().map(|m| (m - mean).powi(2)).sum::<f64>() / means.len() as f64)
    };
    let (sobol, independent) = (moments(false), moments(true));
    for (mean, variance) in [sobol, independent] {
        assert!((mean - 0.25).abs() < 4.0 * (variance / f64::from(1 << 14)).sqrt(), "{mean}");
    }
    // Var(xy) = 7/144; Owen-scrambled nets do at least an order better here.
    assert!((independent.1 * 16.0 - 7.0 / 144.0).abs() < 3e-3, "{independent:?}");
    assert!(sobol.1 * 10.0 < independent.1, "{sobol:?} {independent:?}");
}

fn turn(p: Vec2) -> f64 {
    f64::from(p.y).atan2(f64::from(p.x)).rem_euclid(TAU) / TAU
}

/// A warp followed by its exact inverse CDFs.
type RoundTrip = fn(Vec2) -> [f64; 2];

#[test]
fn warps_have_their_densities() {
    let warps: [(&str, RoundTrip); 7] = [
        ("cosine hemisphere", |u| {
            let w = warp_cosine_hemisphere(u);
            [f64::from(w.z * w.z), turn(w.truncate())]
        }),
        ("sphere", |u| {
            let w = warp_sphere(u);
            [0.5 + 0.5 * f64::from(w.z), turn(w.truncate())]
        }),
        ("disk", |u| {
            let p = warp_disk(u);
            [f64::from(p.length_squared()), turn(p)]
        }),
        ("cone", |u| {
            let w = warp_cone(u, 0.01);
            [(1.0 - f64::from(w.z)) / 0.01, turn(w.truncate())]
        }),
        ("triangle", |u| {
            let b = warp_triangle(u);
            let sum = f64::from(b.x + b.y);
            [sum * sum, f64::from(b.x) / sum.max(1e-30)]
        }),
        ("tent", |u| [u.x, u.y].map(|v| tent_cdf(warp_tent(v)))),
        ("gaussian", |u| [u.x, u.y].map(|v| gaussian_cdf(warp_gaussian(v)))),
    ];
    let level = sidak(warps.len());
    for (name, round_trip) in warps {
        let points = |bend: f32| {
            (0..1 << 18).map(move |i| {
                let u = sample_2d(sampler_start(0, i, 2, true), 0);
                round_trip(vec2(u.x.powf(bend), u.y))
            })
        };
        let p = uniform_2d(points(1.0));
        assert!(p > level, "{name}: p = {p:.1e}");
        assert!(uniform_2d(points(1.05)) < level, "{name}: control");
    }
}

/// Of the filter of radius 1.
fn tent_cdf(x: f32) -> f64 {
    let tail = 0.5 * (1.0 - f64::from(x.abs())).powi(2);
    if x < 0.0 { tail } else { 1.0 - tail }
}

/// Of the filter with standard deviation 0.5 cut at 2.
fn gaussian_cdf(x: f32) -> f64 {
    let z = x.abs() / 0.5f32 / 2f32.sqrt();
    let erf = 1.0 - erfc_scaled(z) * (-z * z).exp();
    0.5 + 0.5 * f64::from(erf.copysign(x)) / 0.99993666
}

#[test]
fn film_samples_follow_their_filter() {
    const PIXEL: u32 = 3 * 7 + 2;
    let from_corner = |filter: u32, i: u32| {
        let frame = FrameConstants {
            path: PathConstants { size: [7, 5], pixel_filter: filter, ..Default::default() },
            ..Default::default()
        };
        film_sample(&frame, &Effects::ALL, PIXEL, sampler_start(PIXEL, i, 4, true)) - vec2(2.0, 3.0)
    };
    type Cdf = fn(f32) -> f64;
    let cdfs: [(&str, Cdf); 3] =
        [("box", |x| f64::from(x)), ("tent", |x| tent_cdf(x - 0.5)), ("Gaussian", |x| gaussian_cdf(x - 0.5))];
    let level = sidak(cdfs.len());
    for (filter, (name, _)) in cdfs.iter().enumerate() {
        for (other, (_, cdf)) in cdfs.iter().enumerate() {
            let points = (0..1 << 18).map(|i| from_corner(filter as u32, i).to_array().map(cdf));
            let p = uniform_2d(points);
            // Control: by every other filter they are not uniform.
            assert!((p > level) == (filter == other), "{name} by the CDF of {}: p = {p:.1e}", cdfs[other].0);
        }
    }
    assert_eq!(from_corner(3, 0), vec2(0.5, 0.5), "the filter that is a point");
}

/// A camera that is turned, with a lens, and pixels that are no squares.
fn lens_camera() -> Camera {
    let axes = Mat3::from_rotation_y(0.7) * Mat3::from_rotation_x(-0.4);
    Camera {
        position: [1.0, -2.0, 0.5],
        lens_radius: 0.3,
        right: (1.2 * axes.x_axis).into(),
        focus_distance: 4.0,
        up: (0.5 * axes.y_axis).into(),
        near: 0.0,
        forward: (-axes.z_axis).into(),
        ..Default::default()
    }
}

#[test]
fn rays_leave_a_uniform_lens_towards_one_point_in_focus() {
    let camera = lens_camera();
    let [position, right, up, forward] = [camera.position, camera.right, camera.up, camera.forward].map(Vec3::from);
    let frame = FrameConstants { camera, path: PathConstants { size: [12, 5], ..Default::default() } };
    let film = vec2(3.3, 4.1);
    let at = film_from_pixel(film, frame.path.size);
    let focus = position + camera.focus_distance * (forward + at.x * right + at.y * up);
    let rays = || (0..1 << 18).map(|i| eye_ray(&frame, &Effects::ALL, film, sampler_start(5, i, 1, true)));
    for ray in rays().take(1000) {
        let miss = |p: Vec3| (p - ray.origin).cross(ray.direction).length();
        assert!((ray.origin - position).dot(forward).abs() < 1e-6, "{ray:?} leaves the lens");
        assert!(miss(focus) < 1e-5, "{ray:?} misses {focus}");
        let off = (ray.origin - position).length();
        assert!(off < 1e-3 || miss(focus + 0.1 * forward) > 1e-5, "control: {ray:?} meets another point");
    }
    let on_lens = |bend: f32| {
        rays().map(move |ray| {
            let p = (ray.origin - position) / camera.lens_radius;
            let p = vec2(p.dot(right.normalize()), p.dot(up.normalize()));
            [f64::from(p.length_squared().powf(bend)), turn(p)]
        })
    };
    assert!(uniform_2d(on_lens(1.0)) > sidak(1));
    assert!(uniform_2d(on_lens(1.05)) < sidak(1), "control: a lens whose middle is thinner");
}

#[test]
fn rays_of_an_orthographic_camera_are_parallel() {
    let still = Camera { orthographic: 1, lens_radius: 0.0, ..lens_camera() };
    let [position, right, up, forward] = [still.position, still.right, still.up, still.forward].map(Vec3::from);
    let ray = |camera: Camera, film: Vec2, i: u32| {
        let frame = FrameConstants { camera, path: PathConstants { size: [12, 5], ..Default::default() } };
        let at = film_from_pixel(film, frame.path.size);
        (at, eye_ray(&frame, &Effects::ALL, film, sampler_start(5, i, 1, true)))
    };
    for i in 0..100 {
        let film = vec2((i % 12) as f32 + 0.3, (i % 5) as f32 + 0.8);
        let (at, from) = ray(still, film, i);
        assert!((from.direction - forward).length() < 1e-6, "{from:?}");
        let start = position + at.x * right + at.y * up;
        assert!((from.origin - start).length() < 1e-5, "{from:?} starts at {start}");
        // Through a lens all rays of a point of the film meet where it is sharp.
        let (_, through) = ray(Camera { lens_radius: 0.3, ..still }, film, i);
        let focus = start + still.focus_distance * forward;
        assert!((focus - through.origin).cross(through.direction).length() < 1e-5, "{through:?} misses {focus}");
        let perspective = ray(Camera { orthographic: 0, ..still }, film, i).1;
        assert!((perspective.direction - forward).length() > 1e-3, "control");
    }
}

#[test]
fn what_is_nearer_than_the_near_distance_is_skipped() {
    let ray = |near: f32| {
        let frame = FrameConstants {
            camera: Camera { near, ..lens_camera() },
            path: PathConstants { size: [12, 5], ..Default::default() },
        };
        eye_ray(&frame, &Effects::ALL, vec2(1.0, 2.0), sampler_start(5, 0, 1, false))
    };
    let (from_lens, clipped) = (ray(0.0), ray(1.5));
    assert_eq!(from_lens.direction, clipped.direction);
    let along = (clipped.origin - from_lens.origin).dot(from_lens.direction);
    assert!((along - 1.5).abs() < 1e-5, "{along}");
}

#[test]
fn directions_are_unit_and_finite_at_the_ends() {
    let ends = [0.0, 1e-7, 0.25, 0.5, 0.75, 1.0 - f32::EPSILON / 2.0];
    for u in ends.iter().flat_map(|&x| ends.map(|y| vec2(x, y))) {
        for w in [warp_cosine_hemisphere(u), warp_sphere(u), warp_cone(u, 1e-6), warp_cone(u, 2.0)] {
            assert!((w.length() - 1.0).abs() < 1e-6, "{u}: {w}");
        }
        assert!(warp_cosine_hemisphere(u).z > 1e-4);
        let b = warp_triangle(u);
        assert!(b.min_element() >= 0.0 && b.x + b.y <= 1.0, "{u}: {b}");
    }
}

#[test]
fn one_dimension_stays_uniform_in_its_low_bits() {
    // The alias table of the lights uses raw words: their low byte must be uniform as well.
    let mut counts = [0.0; 256];
    for i in 0..1 << 16 {
        counts[(sample_2d_bits(sampler_start(i, 3, 0, false), 2)[0] & 255) as usize] += 1.0;
    }
    assert!(chi_square(&counts, &[256.0; 256]) > sidak(1));
}
