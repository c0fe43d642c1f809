//! Compares filtering with and without demodulation on the textures of Sponza.
use super::case::Case;
use super::frames::View;
use super::sheet::{self, Tile};
use super::sweep;
use crate::Args;
use tallow::denoise::Demodulation;
use tallow::denoise::filter;
use tallow::gpu::Gpu;

const VIEW: View = View { name: "sponza", scene: "crytek-sponza", size: [256, 144], depth: 4, reference: 256 };
const SPP: u32 = 4;

/// # Errors
/// When the scene cannot be rendered, or the device fails.
pub fn print(gpu: &Gpu, args: &Args) -> anyhow::Result<()> {
    let (noisy, reference) = (VIEW.render(args, SPP)?, VIEW.render(args, VIEW.reference)?);
    let row = filter::find("atrous").expect("a row of the table");
    let kinds = [
        ("direct light and albedo kept", Demodulation::Light),
        ("albedo kept", Demodulation::Albedo),
        ("no demodulation", Demodulation::Off),
    ];
    println!(
        "Sponza, {}x{}, {SPP} samples per pixel, filter {}: mean squared error",
        VIEW.size[0], VIEW.size[1], row.name
    );
    let mut tiles = Vec::new();
    let mut reference_picture = None;
    for (name, kind) in kinds {
        let case = Case::new(&noisy, &reference, kind)?;
        if tiles.is_empty() {
            println!("{:<30} {:8.2}", "noisy", case.mse(&case.noisy));
            tiles.push(Tile::new("noisy", &case.noisy));
        }
        let error = |settings: &_| Ok(case.mse(&case.whole(&case.run(gpu, row, settings)?)));
        let best = sweep::best(row, case.start(), error)?;
        let picture = case.whole(&case.run(gpu, row, &best.settings)?);
        println!("{name:<30} {:8.2}  {}", best.error, best.text);
        tiles.push(Tile::new(name, &picture));
        reference_picture = Some(case.reference);
    }
    let reference = reference_picture.expect("three kinds");
    sheet::write(&args.output.join("sponza-sheet.png"), &tiles, &reference)
}
