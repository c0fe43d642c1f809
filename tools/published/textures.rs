//! Filtering with and without demodulation on the textures of Sponza.
use super::case::Case;
use super::report::Sheet;
use super::sweep;
use super::view::View;
use super::{Section, push};
use crate::Args;
use tallow::denoise::Demodulation;
use tallow::denoise::filter;
use tallow::gpu::Gpu;
use tallow::report::html::Table;

const VIEW: View =
    View { name: "sponza", scene: "crytek-sponza", size: [256, 144], full: [1280, 720], depth: 4, reference: 256 };
const SPP: u32 = 4;
const KINDS: [(&str, Demodulation); 3] = [
    ("direct light and albedo kept", Demodulation::Light),
    ("albedo kept", Demodulation::Albedo),
    ("no demodulation", Demodulation::Off),
];

/// # Errors
/// When the scene cannot be rendered, or the device fails.
pub fn measure(gpu: &Gpu, args: &Args) -> anyhow::Result<Section> {
    let (noisy, reference) = (VIEW.render(args, SPP, 0, "", &[])?, VIEW.reference(args)?);
    let row = filter::find("atrous").expect("a row of the table");
    let name = format!("{}, {SPP} spp, {}", VIEW.label(args), row.name);
    let mut section = Section::new("Textures with and without demodulation", &["MSE in 8-bit sRGB code values."]);
    let mut table = Table::new(&name, &["image", "MSE", "best settings"]);
    let (mut images, mut truth) = (Vec::new(), None);
    for (kind, demodulation) in KINDS {
        let case = Case::new(&noisy, &reference, demodulation)?;
        if images.is_empty() {
            push(&mut table, ["noisy".to_owned(), format!("{:.2}", case.mse(&case.noisy)), String::new()]);
            images.push(("noisy".to_owned(), case.noisy.clone()));
        }
        let error = |settings: &_| Ok(case.mse(&case.whole(&case.run(gpu, row, settings)?)));
        let best = sweep::best(row, case.start(), error)?;
        let picture = case.whole(&case.run(gpu, row, &best.settings)?);
        push(&mut table, [kind.to_owned(), format!("{:.2}", best.error), best.text]);
        images.push((kind.to_owned(), picture));
        truth = Some(case.reference);
    }
    section.tables.push(table);
    section.sheets.push(Sheet { name, images, reference: truth.expect("three kinds") });
    Ok(section)
}
