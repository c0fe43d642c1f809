//! Measures every policy on five scenes: the relative error at equal samples, and the resulting error at equal time.
use super::{View, mean, radiance, relative_errors, render};
use crate::Args;
use tallow::allocate::{POLICIES, Placing};
use tallow::gpu::Gpu;
use tallow::report::table;

/// Average and least number of samples per pixel.
const BUDGETS: [[u32; 2]; 3] = [[8, 1], [16, 2], [32, 4]];
const SEEDS: [u32; 3] = [0, 2, 3];
/// Number of runs. Each seed runs six times, and the shortest time counts.
const RUNS: usize = 18;
const VIEWS: [View; 5] = [
    View { name: "cornell", scene: "scenes/cornell-box/scene.toml", size: [192, 192], depth: 4, reference: 1024 },
    View { name: "sponza", scene: "crytek-sponza", size: [112, 63], depth: 4, reference: 1024 },
    View { name: "bust", scene: "scenes/bust/scene.toml", size: [180, 240], depth: 4, reference: 1024 },
    View { name: "grass", scene: "scenes/grass/scene.toml", size: [224, 126], depth: 4, reference: 1024 },
    View {
        name: "directional",
        scene: "scenes/cornell-box/directional.toml",
        size: [192, 192],
        depth: 4,
        reference: 1024,
    },
];

/// Prints the tables. The squared error falls as 1 / samples, so the error at equal time is the error times the time,
/// relative to that product of the uniform render.
pub fn print(gpu: &Gpu, args: &Args) -> anyhow::Result<()> {
    println!("relMSE (eps 0.01), mean of {} seeds; `both` expects no filter\n", SEEDS.len());
    for [spp, least] in BUDGETS {
        let mut rows = Vec::new();
        for view in &VIEWS {
            rows.extend(of_view(gpu, args, view, [spp, least])?);
        }
        println!("{spp} samples per pixel, least {least}\n");
        let header = ["scene", "policy", "relMSE", "ms", "of uniform, equal samples", "equal time"];
        println!("{}", table::text(&header, &rows));
    }
    Ok(())
}

/// Measures one scene and returns a row for every policy.
fn of_view(gpu: &Gpu, args: &Args, view: &View, [spp, least]: [u32; 2]) -> anyhow::Result<Vec<Vec<String>>> {
    let reference = &view.reference(gpu, args, |_| {})?[0];
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
            *error += mean(&relative_errors(&radiance(&rendered.pixels), reference)) / RUNS as f64;
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
