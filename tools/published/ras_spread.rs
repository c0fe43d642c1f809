//! RAS's result: the spread of errors against time, for its choices of least and most samples, and one property at a time.
use super::placed::{mean, radiance, render};
use super::view::View;
use super::{Section, push};
use crate::Args;
use tallow::gpu::Gpu;
use tallow::layout::vec3;
use tallow::report::html::Table;

const fn view(name: &'static str, scene: &'static str, size: [u32; 2]) -> View {
    View { name, scene, size, full: [1280, 720], depth: 4, reference: 1024 }
}

const VIEWS: [View; 2] =
    [view("cornell", "scenes/cornell-box/scene.toml", [96, 96]), view("sponza", "crytek-sponza", [112, 63])];
/// The Cornell box with other lights and materials, as RAS tests them.
const PROPERTIES: [(&str, View); 6] = [
    ("area light, diffuse", VIEWS[0]),
    ("point light", view("cornell-point", "scenes/cornell-box/point.toml", [96, 96])),
    ("directional light", view("cornell-directional", "scenes/cornell-box/directional.toml", [96, 96])),
    ("soft glossy", view("cornell-glossy", "scenes/cornell-box/glossy.toml", [96, 96])),
    ("highly reflective", view("cornell-mirror", "scenes/cornell-box/mirror.toml", [96, 96])),
    ("glass", view("cornell-glass", "scenes/cornell-box/glass.toml", [96, 96])),
];
/// Samples per pixel at which properties are compared.
const PROPERTY_SPP: u32 = 32;
/// Average number of samples per pixel; for the published scheme, the number of rounds with at most one sample each.
const BUDGETS: [u32; 4] = [8, 16, 32, 64];
/// The published limits: least and most samples per pixel.
const LIMITS: [(u32, u32); 6] = [(2, 16), (4, 16), (8, 16), (2, 32), (4, 32), (8, 32)];

/// A policy with its least and most samples per pixel, where 0 is unlimited.
struct Policy {
    name: String,
    policy: String,
    min: u32,
    max: u32,
}

/// Ours needs no largest number, but it is also measured with the published ones.
fn policies() -> Vec<Policy> {
    let policy = |name: String, policy: &str, min, max| Policy { name, policy: policy.to_owned(), min, max };
    let plain = [("uniform", "uniform", 0), ("ours: min 4", "variance", 4)];
    let plain = plain.into_iter().map(|(name, row, min)| policy(name.to_owned(), row, min, 0));
    let limited = |(kind, row): (&'static str, &'static str)| {
        LIMITS.map(|(min, max)| policy(format!("{kind}: min {min}, max {max}"), row, min, max))
    };
    plain.chain([("published", "threshold"), ("ours", "variance")].into_iter().flat_map(limited)).collect()
}

/// Variance over the pixels of the distance between colour and reference.
fn spread(image: &[vec3], reference: &[vec3]) -> f64 {
    let distance = |(a, b): (&vec3, &vec3)| (0..3).map(|c| f64::from(a[c] - b[c]).powi(2)).sum::<f64>().sqrt();
    let all: Vec<f64> = image.iter().zip(reference).map(distance).collect();
    let mean = mean(&all);
    all.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / all.len() as f64
}

/// Milliseconds and spread of a render.
fn measured(
    gpu: &Gpu,
    args: &Args,
    view: &View,
    spp: u32,
    policy: &Policy,
    truth: &[vec3],
) -> anyhow::Result<[f64; 2]> {
    let Policy { policy, min, max, .. } = policy;
    let scene = view.load(args, |s| {
        (s.spp, s.allocate.policy) = (spp, tallow::allocate::policy(policy).expect("a policy"));
        (s.allocate.min_spp, s.allocate.max_spp) = (*min, *max);
    })?;
    let rendered = render(gpu, &scene)?;
    Ok([rendered.ms, spread(&radiance(&rendered.pixels), truth)])
}

/// # Errors
/// When a scene cannot be rendered, or the device fails.
pub fn measure(gpu: &Gpu, args: &Args) -> anyhow::Result<Section> {
    let how = "Variance over the pixels of the distance to the reference, and the device's time. The paper draws curves and prints no \
        figures; in its Cornell box and Sponza adaptive samples have less spread in equal time than uniform ones, in San Miguel not. \
        Of the published scheme, a sample on average is a round with at most one sample for a pixel.";
    let mut section = Section::new("RAS: the spread of errors against time", &[how]);
    for view in &VIEWS {
        let truth = view.radiance(args)?.pixels;
        let mut table = Table::new(&view.label(args), &["samples", "8 on average", "16", "32", "64"]);
        for policy in policies() {
            let mut cells = vec![policy.name.clone()];
            for spp in BUDGETS {
                let possible = policy.policy == "threshold" || policy.max == 0 || spp <= policy.max;
                let found = possible.then(|| measured(gpu, args, view, spp, &policy, &truth)).transpose()?;
                cells.push(found.map_or("-".to_owned(), |[ms, spread]| format!("{spread:.2e} in {ms:.0} ms")));
            }
            push(&mut table, cells);
        }
        section.tables.push(table);
    }
    section.tables.push(properties(gpu, args)?);
    Ok(section)
}

/// The spread of placed samples over that of uniform ones, in equal time: spread falls as the inverse of time.
fn properties(gpu: &Gpu, args: &Args) -> anyhow::Result<Table> {
    let title = format!("The Cornell box, one property at a time, {PROPERTY_SPP} samples per pixel");
    let mut table = Table::new(&title, &["property", "published scheme, 4 to 32", "ours", "both"]);
    table.note = "Spread times time, over that of uniform samples. In the paper adaptive samples win but under directional light, \
        where the scaling by luminance saturates in shade."
        .to_owned();
    for (property, view) in &PROPERTIES {
        let truth = view.radiance(args)?.pixels;
        let product = |policy: &str, min, max| {
            let policy = Policy { name: String::new(), policy: policy.to_owned(), min, max };
            let [ms, spread] = measured(gpu, args, view, PROPERTY_SPP, &policy, &truth)?;
            anyhow::Ok(ms * spread)
        };
        let uniform = product("uniform", 0, 0)?;
        let placed = [product("threshold", 4, 32)?, product("variance", 4, 0)?, product("both", 4, 0)?];
        push(&mut table, [(*property).to_owned()].into_iter().chain(placed.map(|p| format!("{:.2}", p / uniform))));
    }
    Ok(table)
}
