//! Reproduces GEO's result: before a geometry-aware filter, the same number of samples is more useful where the filter
//! removes little.
use super::{View, indirect, mean, render};
use crate::Args;
use tallow::denoise::filter::{self, AtrousForm, FilterInput, FilterSettings};
use tallow::gpu::Gpu;
use tallow::layout::{Guide, vec3, vec4};
use tallow::math::srgb::srgb_from_linear;
use tallow::render::settings::{PixelFilter, Settings};
use tallow::report::table;

struct Case {
    view: View,
    min_spp: u32,
    /// Published MSE of uniform and of adaptive samples after filtering.
    published: (f64, f64),
}

/// Average number of indirect samples per pixel, with two bounces of indirect light.
const SPP: u32 = 4;
const SEEDS: [u32; 3] = [0, 2, 3];
/// Tolerance of normals for the importance. The paper uses that of the filter but does not state it.
const SIGMA_NORMAL: f32 = 0.1;
const SIGMA_POSITION: f32 = 0.01;
const CASES: [Case; 2] = [
    Case {
        view: View { name: "bust", scene: "scenes/bust/scene.toml", size: [300, 400], depth: 4, reference: 4096 },
        min_spp: 2,
        published: (329.0, 244.0),
    },
    Case {
        view: View { name: "grass", scene: "scenes/grass/scene.toml", size: [640, 360], depth: 4, reference: 512 },
        min_spp: 1,
        published: (127.0, 86.0),
    },
];

/// Takes all samples through the pixel's centre, as in the paper, so that only the directions in the hemisphere differ.
fn centred(s: &mut Settings) {
    s.filter = PixelFilter::Point;
}

struct Image {
    light: Vec<vec4>,
    guide: Vec<Guide>,
}

/// Two independent references a and b. The mean of (f - a)(f - b) is the squared error of f alone, whereas that of
/// (f - a)^2 includes the noise of the reference, which is as large as the noise that a filter leaves.
struct Truth {
    halves: [Vec<vec3>; 2],
    /// Whether each pixel shows a surface.
    surface: Vec<bool>,
}

impl Truth {
    /// Squared errors in 8-bit sRGB code values, one for every pixel that shows a surface.
    fn errors(&self, image: &[vec4]) -> Vec<f64> {
        let [a, b] = &self.halves;
        let off = |x: f32, y: f32| 255.0 * f64::from(srgb_from_linear(x) - srgb_from_linear(y));
        let of = |i: usize| (0..3).map(|c| off(image[i][c], a[i][c]) * off(image[i][c], b[i][c])).sum::<f64>() / 3.0;
        (0..image.len()).filter(|&i| self.surface[i]).map(of).collect()
    }
}

fn filtered(gpu: &Gpu, image: &Image, size: [u32; 2], s: &FilterSettings) -> anyhow::Result<Vec<vec4>> {
    let (radiance, guide) = (image.light.clone(), image.guide.clone());
    let input = FilterInput { width: size[0], height: size[1], radiance, guide, variance: None };
    let row = filter::find("atrous").ok_or_else(|| anyhow::anyhow!("no filter \"atrous\""))?;
    Ok(filter::run(gpu, row, &input, &s.scaled_to(&input))?.0)
}

/// Number of pixels whose squared error is more than `times` times the median of the uniform image's.
fn outliers(squares: &[f64], of: &[f64], times: f64) -> usize {
    let mut sorted = of.to_vec();
    sorted.sort_by(f64::total_cmp);
    let limit = times * sorted[sorted.len() / 2];
    squares.iter().filter(|&&e| e > limit).count()
}

/// Finds the filter settings with the least error on the uniform image; as in the paper, both images use them. Unlike
/// EAW's listing, GEO weights normals alike on every level.
fn best(gpu: &Gpu, image: &Image, truth: &Truth, size: [u32; 2], normals: &[f32]) -> anyhow::Result<FilterSettings> {
    let mut found = (f64::INFINITY, FilterSettings::default());
    for &sigma_n in normals {
        for (levels, sigma_rt) in (1..=6).flat_map(|levels| [(levels, 0.5), (levels, f32::INFINITY)]) {
            for sigma_x in [0.01, 0.03, 0.1] {
                let form = AtrousForm::Squared;
                let s = FilterSettings::default().with(|s| {
                    s.footprint.levels = levels;
                    s.edge.sigma_rt = sigma_rt;
                    s.edge.sigma_n = sigma_n;
                    s.edge.sigma_x = sigma_x;
                    s.atrous.form = form;
                });
                let error = mean(&truth.errors(&filtered(gpu, image, size, &s)?));
                if error < found.0 {
                    found = (error, s);
                }
            }
        }
    }
    Ok(found.1)
}

/// Measures every view and prints the table.
pub fn print(gpu: &Gpu, args: &Args) -> anyhow::Result<()> {
    let mut rows = Vec::new();
    for case in &CASES {
        let view = &case.view;
        let half = |first: u32| {
            let samples = move |s: &mut Settings| s.first_sample = first;
            let both = view.reference(gpu, args, |s| {
                centred(s);
                samples(s);
            });
            both.map(|[_, indirect]| indirect)
        };
        let halves = [half(0)?, half(view.reference)?];
        let image = |policy: &str, seed: u32| -> anyhow::Result<Image> {
            let scene = view.load(args, |s| {
                centred(s);
                (s.spp, s.seed, s.allocate.policy, s.allocate.min_spp) =
                    (SPP, seed, tallow::allocate::policy(policy).unwrap(), case.min_spp);
                (s.allocate.geometry.sigma_normal, s.allocate.geometry.sigma_position) = (SIGMA_NORMAL, SIGMA_POSITION);
            })?;
            let rendered = render(gpu, &scene)?;
            Ok(Image { light: indirect(&rendered.pixels), guide: rendered.guide })
        };
        let of_policy = |policy| SEEDS.iter().map(|&seed| image(policy, seed)).collect::<anyhow::Result<Vec<_>>>();
        let uniform = of_policy("uniform")?;
        let surface = uniform[0].guide.iter().map(|g| g.depth > 0.0).collect();
        let truth = Truth { halves, surface };
        let kinds = [("importance's", &[SIGMA_NORMAL][..]), ("searched", &[0.1, 0.2, 0.3, 0.5])];
        let search = |(kind, normals)| Ok((kind, best(gpu, &uniform[0], &truth, view.size, normals)?));
        let filters = kinds.into_iter().map(search).collect::<anyhow::Result<Vec<_>>>()?;
        for policy in ["geometry", "both"] {
            let compared = Compared { uniform: &uniform, placed: &of_policy(policy)?, truth: &truth };
            for (kind, settings) in &filters {
                rows.push(row(gpu, case, &compared, [policy, kind], settings)?);
            }
        }
    }
    println!(
        "\
MSE of incident indirect light in 8-bit sRGB code values, {SPP} samples per pixel, mean of 3 seeds, uniform and placed
(window 4, sigmas {SIGMA_NORMAL} and {SIGMA_POSITION}); À-Trous has the settings that are best for uniform samples, its sigma of normals that
of importance or searched for as well. Outliers, placed / uniform: pixels whose error is over 10 times the median error of
the uniform image; the same of squared errors.
"
    );
    let header = [
        "scene",
        "policy",
        "sigma_n",
        "unfiltered",
        "filtered",
        "ratio",
        "published",
        "outliers",
        "of squares",
        "À-Trous",
    ];
    println!("{}", table::text(&header, &rows));
    Ok(())
}

/// The images to compare, of all seeds.
struct Compared<'a> {
    uniform: &'a [Image],
    placed: &'a [Image],
    truth: &'a Truth,
}

fn row(
    gpu: &Gpu,
    Case { view, published, .. }: &Case,
    Compared { uniform, placed, truth }: &Compared,
    [policy, kind]: [&str; 2],
    s: &FilterSettings,
) -> anyhow::Result<Vec<String>> {
    let (mut plain, mut after, mut outside) = ([0.0; 2], [0.0; 2], [[0; 2]; 2]);
    for pair in uniform.iter().zip(*placed).map(|(a, b)| [a, b]) {
        let errors = |image: &Image| Ok(truth.errors(&filtered(gpu, image, view.size, s)?));
        let errors = pair.into_iter().map(errors).collect::<anyhow::Result<Vec<_>>>()?;
        for i in 0..2 {
            plain[i] += mean(&truth.errors(&pair[i].light)) / SEEDS.len() as f64;
            after[i] += mean(&errors[i]) / SEEDS.len() as f64;
            for (sums, times) in outside.iter_mut().zip([100.0, 10.0]) {
                sums[i] += outliers(&errors[i], &errors[0], times);
            }
        }
    }
    let ratio = |a: f64, b: f64| format!("{:.2}", a / b);
    Ok(vec![
        format!("{} {}x{}", view.name, view.size[0], view.size[1]),
        policy.to_owned(),
        kind.to_owned(),
        format!("{:.0} {:.0}", plain[0], plain[1]),
        format!("{:.1} {:.1}", after[0], after[1]),
        ratio(after[1], after[0]),
        ratio(published.1, published.0),
        ratio(outside[0][1] as f64, outside[0][0].max(1) as f64),
        ratio(outside[1][1] as f64, outside[1][0].max(1) as f64),
        format!(
            "{} levels, sigma_rt {}, sigma_n {}, sigma_x {}",
            s.footprint.levels, s.edge.sigma_rt, s.edge.sigma_n, s.edge.sigma_x
        ),
    ])
}
