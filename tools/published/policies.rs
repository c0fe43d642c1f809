//! Every policy on five scenes: the relative error at equal samples, and the resulting error at equal time.
use super::placed::{radiance, render};
use super::view::View;
use super::{Section, push};
use crate::Args;
use tallow::allocate::{POLICIES, Placing};
use tallow::gpu::Gpu;
use tallow::image::{Picture, metrics};
use tallow::report::html::Table;

/// Average and least number of samples per pixel.
const BUDGETS: [[u32; 2]; 3] = [[8, 1], [16, 2], [32, 4]];
const SEEDS: [u32; 3] = [0, 2, 3];
/// Number of runs. Each seed runs six times, and the shortest time counts.
const RUNS: usize = 18;
const fn view(name: &'static str, scene: &'static str, size: [u32; 2]) -> View {
    View { name, scene, size, full: [1280, 720], depth: 4, reference: 1024 }
}

const VIEWS: [View; 5] = [
    view("cornell", "scenes/cornell-box/scene.toml", [192, 192]),
    view("sponza", "crytek-sponza", [112, 63]),
    view("bust", "scenes/bust/scene.toml", [180, 240]),
    view("grass", "scenes/grass/scene.toml", [224, 126]),
    view("directional", "scenes/cornell-box/directional.toml", [192, 192]),
];

/// # Errors
/// When a scene cannot be rendered, or the device fails.
pub fn measure(gpu: &Gpu, args: &Args) -> anyhow::Result<Section> {
    let how = "relMSE (eps 0.01), mean of 3 seeds; both expects no filter. The squared error falls as 1 / samples, so the error at equal \
        time is the error times the time, relative to that product of the uniform render.";
    let mut section = Section::new("Every policy on five scenes", &[how]);
    for [spp, least] in BUDGETS {
        let title = format!("{spp} samples per pixel, least {least}");
        let mut table =
            Table::new(&title, &["scene", "policy", "relMSE", "ms", "of uniform, equal samples", "equal time"]);
        for view in &VIEWS {
            of_view(gpu, args, view, [spp, least])?.into_iter().for_each(|row| push(&mut table, row));
        }
        section.tables.push(table);
    }
    Ok(section)
}

/// Measures one scene and returns a row for every policy.
fn of_view(gpu: &Gpu, args: &Args, view: &View, [spp, least]: [u32; 2]) -> anyhow::Result<Vec<Vec<String>>> {
    let reference = &view.radiance(args)?;
    let rows_of = POLICIES.iter().filter(|row| row.placing != Placing::Chosen);
    let mut found: Vec<_> = rows_of.map(|policy| (policy.name, 0.0, f64::INFINITY)).collect();
    for seed in SEEDS.iter().cycle().take(RUNS) {
        // Policies alternate, so that other work on the machine affects all alike.
        for (policy, error, ms) in &mut found {
            let scene = view.load(args, |s| {
                (s.spp, s.seed, s.allocate.policy, s.allocate.min_spp) =
                    (spp, *seed, tallow::allocate::policy(policy).unwrap(), least);
                s.allocate.both.filtered = 0.0;
            })?;
            let rendered = render(gpu, &scene)?;
            let picture = Picture { pixels: radiance(&rendered.pixels), ..*reference };
            *error += metrics::relmse(&picture, reference) / RUNS as f64;
            *ms = ms.min(rendered.ms);
        }
    }
    let (_, base, base_ms) = found[0];
    let row = |(name, error, ms): (&str, f64, f64)| {
        let of_uniform = [error / base, error * ms / (base * base_ms)].map(|ratio| format!("{ratio:.2}"));
        [view.name.to_owned(), name.to_owned(), format!("{error:.2e}"), format!("{ms:.0}")]
            .into_iter()
            .chain(of_uniform)
    };
    Ok(found.into_iter().map(|f| row(f).collect()).collect())
}
