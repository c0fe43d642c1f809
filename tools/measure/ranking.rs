//! Measures the error of every filter at its best settings, on GIF's three kinds of scene beside the published errors, and
//! on two more.
use super::case::Case;
use super::frames::View;
use super::sheet::{self, Tile};
use super::sweep::{self, Best};
use crate::Args;
use tallow::denoise::Demodulation;
use tallow::denoise::filter::{FILTERS, Row};
use tallow::gpu::Gpu;
use tallow::report::table;

/// Path edges for two bounces of indirect light, as in GIF.
const DEPTH: u32 = 4;

/// One scene for each of the three kinds in GIF, and two more.
pub const VIEWS: &[View] = &[
    View { name: "bust-room", scene: "scenes/bust/room.toml", size: [180, 240], depth: DEPTH, reference: 1024 },
    View { name: "dragon", scene: "stanford-dragon", size: [256, 256], depth: DEPTH, reference: 1024 },
    View { name: "sibenik-lamps", scene: "sibenik-lamps", size: [192, 108], depth: DEPTH, reference: 1024 },
    View { name: "sponza", scene: "crytek-sponza", size: [256, 144], depth: DEPTH, reference: 1024 },
    View { name: "grass", scene: "scenes/grass/scene.toml", size: [224, 126], depth: DEPTH, reference: 1024 },
];

/// Scene, samples per pixel, and the published errors of the cross bilateral, À-Trous and guided filters.
const PUBLISHED: &[(&str, u32, [f64; 3])] = &[
    ("bust-room", 1, [95.5, 190.6, 74.8]),
    ("bust-room", 4, [73.5, 92.2, 65.4]),
    ("dragon", 1, [36.0, 49.5, 30.4]),
    ("dragon", 4, [27.5, 29.6, 27.4]),
    ("sibenik-lamps", 1, [89.9, 95.3, 92.5]),
];

/// # Errors
/// When a scene cannot be rendered, or the device fails.
pub fn print(gpu: &Gpu, args: &Args) -> anyhow::Result<()> {
    println!("GIF's ranking: mean squared error in 8-bit sRGB code values against 1024 samples per pixel.");
    println!("light: filtered indirect light with the reference's direct light and albedo, which the settings are");
    println!("searched for; image: with the noisy image's own; again: light of another seed at the same settings.");
    println!("Published: other scenes of the same kind, where there are any.\n");
    for view in VIEWS {
        for spp in [1, 4] {
            one(gpu, args, view, spp)?;
        }
    }
    Ok(())
}

fn one(gpu: &Gpu, args: &Args, view: &View, spp: u32) -> anyhow::Result<()> {
    let reference = view.render(args, view.reference)?;
    let case = Case::new(&view.render(args, spp)?, &reference, Demodulation::Light)?;
    let again = Case::new(&view.render_again(args, spp)?, &reference, Demodulation::Light)?;
    let (mut rows, mut errors, mut sweeps) = (Vec::new(), Vec::new(), String::new());
    let mut tiles = vec![Tile::new("noisy", &case.noisy)];
    for row in FILTERS {
        let best = search(gpu, &case, row)?;
        let picture = case.whole(&case.run(gpu, row, &best.settings)?);
        errors.push((row.name, best.error));
        sweeps += &best.around;
        rows.push(vec![
            row.name.to_owned(),
            format!("{:.2}", best.error),
            format!("{:.2}", case.mse(&picture)),
            format!("{:.2}", again.mse(&again.filtered_light(&again.run(gpu, row, &best.settings)?))),
            published(view.name, spp, row.name),
            best.text,
        ]);
        if row.name != "none" {
            tiles.push(Tile::new(row.name, &picture));
        }
    }
    println!("{}, {}x{}, {spp} samples per pixel", view.name, view.size[0], view.size[1]);
    println!("{}", table::text(&["filter", "light", "image", "again", "published", "best settings"], &rows));
    print!("{}", ratios(view.name, spp, &errors));
    let file = |suffix| args.output.join(format!("{}-{spp}spp-{suffix}", view.name));
    std::fs::write(file("sweep.txt"), sweeps)?;
    sheet::write(&file("sheet.png"), &tiles, &case.reference)
}

/// Ratios between the errors of filters, which can be compared with the paper's although the scenes differ.
fn ratios(scene: &str, spp: u32, errors: &[(&str, f64)]) -> String {
    let ours = |name: &str| errors.iter().find(|(known, _)| *known == name).map(|(_, error)| *error);
    let theirs = |name: &str| published(scene, spp, name).parse::<f64>().ok();
    let ratio = |other: &str| {
        let (ours, theirs) = (ours("guided")? / ours(other)?, theirs("guided")? / theirs(other)?);
        Some(format!("guided / {other}: {ours:.2}, published {theirs:.2}\n"))
    };
    ["bilateral", "atrous"].into_iter().filter_map(ratio).collect()
}

fn search(gpu: &Gpu, case: &Case, row: &Row) -> anyhow::Result<Best> {
    sweep::best(row, case.start(), |settings| Ok(case.mse(&case.filtered_light(&case.run(gpu, row, settings)?))))
}

fn published(scene: &str, spp: u32, filter: &str) -> String {
    let column = ["bilateral", "atrous", "guided"].iter().position(|name| *name == filter);
    let line = PUBLISHED.iter().find(|(name, n, _)| *name == scene && *n == spp);
    line.zip(column).map_or("-".to_owned(), |((_, _, errors), i)| format!("{:.1}", errors[i]))
}
