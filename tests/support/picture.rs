//! Images for the filters' tests: a floor and a wall with a step in depth, lit from one side.
#![allow(dead_code)]
use crate::support::{hash, largest};
use tallow::denoise::filter::{AtrousForm, FilterInput, FilterSettings, WaveletBasis};
use tallow::layout::{Guide, NONE, vec4};

/// Around the workgroups' sizes, and one pixel.
pub const SIZES: [(u32, u32); 7] = [(1, 1), (31, 1), (1, 65), (31, 17), (64, 65), (33, 40), (130, 7)];

/// Without noise; a fifth of the columns at the right see nothing.
pub fn clean(width: u32, height: u32) -> FilterInput {
    let pixel = |i: u32| {
        let (x, y) = (i % width, i / width);
        let (u, v) = (x as f32 / width as f32, y as f32 / height as f32);
        let light = 0.2 + u * u + if v > 0.5 { 0.5 } else { 0.0 };
        let floor = v > 0.6;
        let depth = if floor { 6.0 - 4.0 * v } else { 5.0 + u };
        let normal = if floor { [0.0, 1.0, 0.0] } else { [0.0, 0.1 * u, 1.0] };
        let position = [4.0 * u - 2.0, 2.0 - 4.0 * v, -depth];
        let guide = Guide {
            normal,
            depth,
            position,
            object: u32::from(floor),
            albedo: [0.5; 3],
            material: 0,
            ..Default::default()
        };
        let sky = Guide { object: NONE, material: NONE, ..Guide::default() };
        ([light, 0.7 * light, 0.4 * light, 4.0], if u > 0.8 { sky } else { guide })
    };
    let (radiance, guide) = (0..width * height).map(pixel).unzip();
    FilterInput { width, height, radiance, guide, variance: None }
}

/// The same with every pixel on one plane that faces the eye.
pub fn flat(width: u32, height: u32) -> FilterInput {
    let wall = Guide { normal: [0.0, 0.0, 1.0], depth: 1.0, position: [0.0, 0.0, -1.0], ..Guide::default() };
    let guide = vec![wall; (width * height) as usize];
    FilterInput { guide, ..clean(width, height) }
}

/// The same with exponential noise of the mean's size, the samples' variance beside it, 1 to 7 samples, and every 13th pixel without;
/// with surfaces of 50 albedos, one of which is none.
pub fn noisy(width: u32, height: u32) -> FilterInput {
    let mut input = clean(width, height);
    let mut variance = Vec::new();
    for (i, c) in input.radiance.iter_mut().enumerate() {
        variance.push([c[0] * c[0], c[1] * c[1], c[2] * c[2]]);
        let u = (hash(i as u32) as f32 + 0.5) / 4_294_967_296.0;
        let scale = -u.max(1e-6).ln();
        *c = [c[0] * scale, c[1] * scale, c[2] * scale, if i % 13 == 12 { 0.0 } else { (1 + i % 7) as f32 }];
    }
    for (i, g) in (0..).zip(&mut input.guide).filter(|(_, g)| g.material != NONE) {
        g.albedo = [0.02 * (hash(i) % 50) as f32; 3];
    }
    FilterInput { variance: Some(variance), ..input }
}

/// What each filter is tested with.
pub fn settings(filter: &str) -> Vec<FilterSettings> {
    let (base, off) = (FilterSettings::default(), f32::INFINITY);
    match filter {
        "atrous" => vec![
            base,
            base.with(|s| {
                s.edge.sigma_rt = 0.3;
                s.atrous.conserve_energy = true;
            }),
            base.with(|s| {
                s.atrous.form = AtrousForm::Printed;
                s.footprint.levels = 3;
                s.atrous.rt_from_level = 2;
            }),
            base.with(|s| {
                s.atrous.form = AtrousForm::Squared;
                s.edge.sigma_x = off;
                s.footprint.levels = 10;
            }),
            base.with(|s| {
                s.edge.sigma_rt = off;
                s.edge.sigma_n = off;
            }),
        ],
        "bilateral" => vec![
            base.with(|s| s.footprint.radius = 5),
            base.with(|s| {
                s.footprint.radius = 12;
                s.edge.sigma_n = off;
                s.edge.sigma_x = off;
                s.edge.sigma_rt = 0.3;
            }),
        ],
        "wavelet" => vec![
            base,
            base.with(|s| s.wavelet.basis = WaveletBasis::RedBlack),
            base.with(|s| {
                s.footprint.levels = 3;
                s.edge.sigma_rt = off;
                s.edge.sigma_n = off;
                s.edge.sigma_x = off;
            }),
        ],
        "auto" => vec![base.with(|s| s.footprint.radius = 6)],
        "svgf" => vec![
            base,
            base.with(|s| {
                s.svgf.sigma_l = 1.0;
                s.footprint.levels = 3;
            }),
        ],
        "guided" => vec![
            base.with(|s| s.footprint.radius = 5),
            base.with(|s| {
                s.footprint.radius = 1;
                s.guided.channels = 3;
                s.guided.eps = [1e-4; 4];
            }),
            base.with(|s| {
                s.footprint.radius = 40;
                s.guided.channels = 1;
            }),
            base.with(|s| {
                s.footprint.radius = 9;
                s.guided.eps = [0.0; 4];
            }),
        ],
        "none" => vec![base],
        _ => panic!("{filter}: say here what it is to be tested with"),
    }
}

/// The largest difference of a channel, relative to the pixel's largest where that is above `scale`.
pub fn apart(a: &[vec4], b: &[vec4], scale: f32) -> f32 {
    assert_eq!(a.len(), b.len());
    let unit = |c: &vec4| c[..3].iter().fold(scale, |m, v| m.max(v.abs()));
    let pair = |(a, b): (&vec4, &vec4)| largest((0..4).map(|i| (a[i] - b[i]).abs())) / unit(b);
    largest(a.iter().zip(b).map(pair))
}

/// One row of pixels on one plane, without edges.
pub fn line(values: &[f32]) -> FilterInput {
    let mut input = flat(values.len() as u32, 1);
    input.radiance = values.iter().map(|v| [*v, *v, *v, if v.is_nan() { 0.0 } else { 1.0 }]).collect();
    input
}

pub fn red(pixels: &[vec4]) -> Vec<f32> {
    pixels.iter().map(|p| p[0]).collect()
}
