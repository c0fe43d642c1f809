//! GEO's result: with a geometry-aware filter behind it, the same number of samples does more where the filter cannot.
use super::{View, indirect, mean, render, squared_errors};
use crate::Args;
use tallow::filter::{self, FilterInput, FilterSettings};
use tallow::gpu::Gpu;
use tallow::gpu::layout::{Guide, vec3, vec4};
use tallow::report::table;
use tallow::settings::{PixelFilter, Settings};

struct Case {
    view: View,
    min_spp: u32,
    /// Published MSE of uniform and of placed samples, filtered.
    published: (f64, f64),
}

/// Four indirect samples of every pixel on average, two bounces of indirect light.
const SPP: u32 = 4;
const SEEDS: [u32; 3] = [0, 2, 3];
const CASES: [Case; 2] = [
    Case {
        view: View { name: "bust", scene: "scenes/bust/scene.toml", size: [180, 240], depth: 4, reference: 512 },
        min_spp: 2,
        published: (329.0, 244.0),
    },
    Case {
        view: View { name: "grass", scene: "scenes/grass/scene.toml", size: [240, 135], depth: 4, reference: 512 },
        min_spp: 1,
        published: (127.0, 86.0),
    },
];

/// All samples through the pixel's centre: what differs is the hemisphere, as in the paper.
fn centred(s: &mut Settings) {
    (s.spp, s.filter) = (SPP, PixelFilter::Point);
}

struct Image {
    light: Vec<vec4>,
    guide: Vec<Guide>,
}

/// Errors of the filtered and the unfiltered image.
fn errors(
    gpu: &Gpu,
    image: &Image,
    size: [u32; 2],
    s: Option<&FilterSettings>,
    r: &[vec3],
) -> anyhow::Result<Vec<f64>> {
    let input = FilterInput {
        width: size[0],
        height: size[1],
        radiance: image.light.clone(),
        guide: image.guide.clone(),
        variance: None,
    };
    let light = match (s, filter::find("atrous")) {
        (Some(s), Some(row)) => filter::run(gpu, row, &input, &s.scaled_to(&input))?.0,
        _ => image.light.clone(),
    };
    let plain: Vec<vec3> = light.iter().map(|[r, g, b, _]| [*r, *g, *b]).collect();
    Ok(squared_errors(&plain, r))
}

/// Pixels whose error is over ten times the median of the uniform image's.
fn outliers(errors: &[f64], of: &[f64]) -> usize {
    let mut sorted = of.to_vec();
    sorted.sort_by(f64::total_cmp);
    let limit = 10.0 * sorted[sorted.len() / 2];
    errors.iter().filter(|&&e| e > limit).count()
}

/// The filter's settings with the least error on the uniform image: the paper's choice, and the same for both.
fn best(gpu: &Gpu, image: &Image, size: [u32; 2], reference: &[vec3]) -> anyhow::Result<FilterSettings> {
    let mut found = (f64::INFINITY, FilterSettings::default());
    for levels in 1..=5 {
        for sigma_rt in [0.1, 0.5, f32::INFINITY] {
            for sigma_x in [0.01, 0.05, 0.2] {
                let s = FilterSettings { levels, sigma_rt, sigma_x, ..FilterSettings::default() };
                let error = mean(&errors(gpu, image, size, Some(&s), reference)?);
                if error < found.0 {
                    found = (error, s);
                }
            }
        }
    }
    Ok(found.1)
}

/// Prints the table.
pub fn print(gpu: &Gpu, args: &Args) -> anyhow::Result<()> {
    let mut rows = Vec::new();
    for Case { view, min_spp, published } in &CASES {
        let reference = &view.reference(gpu, args, centred)?[1];
        let mut sums = [0.0; 4];
        let (mut outside, mut best_settings) = ([0; 2], None);
        for seed in SEEDS {
            let image = |policy: &str| -> anyhow::Result<Image> {
                let scene = view.load(args, |s| {
                    centred(s);
                    (s.seed, s.allocate.policy, s.allocate.min_spp) = (seed, policy.into(), *min_spp);
                })?;
                let rendered = render(gpu, &scene)?;
                Ok(Image { light: indirect(&rendered.pixels), guide: rendered.guide })
            };
            let (uniform, placed) = (image("uniform")?, image("geometry")?);
            let settings = match best_settings {
                Some(settings) => settings,
                None => *best_settings.insert(best(gpu, &uniform, view.size, reference)?),
            };
            let of = |image, s| errors(gpu, image, view.size, s, reference);
            let filtered = [of(&uniform, Some(&settings))?, of(&placed, Some(&settings))?];
            let all = [of(&uniform, None)?, of(&placed, None)?, filtered[0].clone(), filtered[1].clone()];
            (0..4).for_each(|i| sums[i] += mean(&all[i]) / SEEDS.len() as f64);
            (0..2).for_each(|i| outside[i] += outliers(&filtered[i], &filtered[0]));
        }
        let s = best_settings.unwrap_or_default();
        let ratio = |a: f64, b: f64| format!("{:.2}", a / b);
        rows.push(vec![
            format!("{} {}x{}", view.name, view.size[0], view.size[1]),
            format!("{:.2e} {:.2e}", sums[0], sums[1]),
            format!("{:.2e} {:.2e}", sums[2], sums[3]),
            ratio(sums[3], sums[2]),
            ratio(published.1, published.0),
            ratio(f64::from(outside[1] as u32), f64::from(outside[0].max(1) as u32)),
            format!("{} levels, sigma_rt {}, sigma_x {}", s.levels, s.sigma_rt, s.sigma_x),
        ]);
    }
    println!("MSE of incident indirect light, {SPP} samples per pixel, uniform and by geometry (window 4)\n");
    let header =
        ["scene", "unfiltered", "filtered", "ratio", "published", "outliers ratio", "À-Trous, best for uniform"];
    println!("{}", table::text(&header, &rows));
    Ok(())
}
