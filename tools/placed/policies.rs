//! Every policy on five scenes: relative error at equal samples, and what it comes to at equal time.
use super::{View, mean, radiance, relative_errors, render};
use crate::Args;
use tallow::allocate::{POLICIES, Placing};
use tallow::gpu::Gpu;
use tallow::report::table;

const SPP: u32 = 32;
const SEEDS: [u32; 3] = [0, 2, 3];
/// Each seed six times: the shortest time counts.
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

/// Prints the table. Error falls as 1 / samples, so that at equal time it is the error times the time, over that of the
/// uniform render.
pub fn print(gpu: &Gpu, args: &Args) -> anyhow::Result<()> {
    let mut rows = Vec::new();
    for view in &VIEWS {
        let reference = &view.reference(gpu, args, |_| {})?[0];
        let rows_of = POLICIES.iter().filter(|row| row.placing != Placing::Chosen);
        let mut found: Vec<_> = rows_of.map(|policy| (policy.name, 0.0, f64::INFINITY)).collect();
        for seed in SEEDS.iter().cycle().take(RUNS) {
            // In turn, so that what else the machine does meets all alike.
            for (policy, error, ms) in &mut found {
                let scene = view.load(args, |s| {
                    (s.spp, s.seed, s.allocate.policy, s.allocate.min_spp) = (SPP, *seed, (*policy).into(), 4);
                    s.allocate.filtered = 0.0;
                })?;
                let rendered = render(gpu, &scene)?;
                *error += mean(&relative_errors(&radiance(&rendered.pixels), reference)) / RUNS as f64;
                *ms = ms.min(rendered.ms);
            }
        }
        let (_, base, base_ms) = found[0];
        for (name, error, ms) in found {
            rows.push(vec![
                view.name.to_owned(),
                name.to_owned(),
                format!("{error:.2e}"),
                format!("{ms:.0}"),
                format!("{:.2}", error / base),
                format!("{:.2}", error * ms / (base * base_ms)),
            ]);
        }
    }
    println!(
        "relMSE (eps 0.01), {SPP} samples per pixel, least 4, mean of {} seeds; `both` expects no filter\n",
        SEEDS.len()
    );
    let header = ["scene", "policy", "relMSE", "ms", "of uniform, equal samples", "equal time"];
    println!("{}", table::text(&header, &rows));
    Ok(())
}
