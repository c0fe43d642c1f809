//! How much light À-Trous keeps, and by how much the error grows when it keeps all of it.
use super::VIEWS;
use crate::Args;
use crate::published::case::Case;
use crate::published::{Section, push};
use tallow::denoise::Demodulation;
use tallow::denoise::filter::{self, AtrousForm};
use tallow::gpu::Gpu;
use tallow::layout::vec4;
use tallow::report::html::Table;

const FORMS: [(&str, AtrousForm); 3] =
    [("listing", AtrousForm::Listing), ("squared", AtrousForm::Squared), ("printed", AtrousForm::Printed)];

/// # Errors
/// When a scene cannot be rendered, or the device fails.
pub fn measure(gpu: &Gpu, args: &Args) -> anyhow::Result<Section> {
    let mut section = Section::new(
        "EAW: how much light the filter keeps",
        &[
            "The paper states that its filter is not energy conserving, and prints no figure. At the defaults, 1 path per pixel: the \
           mean of filtered light over that of the noisy, and its error (MSE in 8-bit sRGB code values, direct light and albedo of \
           the reference), for each form of the weights; then the same with what normalised weights fall short of left with the \
           centre pixel (--conserve-energy).",
        ],
    );
    let mut table = Table::new("", &["scene", "form", "light", "error", "conserving: light", "error"]);
    let atrous = filter::find("atrous").expect("a row of the table");
    for (view, _) in VIEWS {
        let case = Case::new(&view.render(args, 1, 0, "", &[])?, &view.reference(args)?, Demodulation::Light)?;
        for (name, form) in FORMS {
            let mut row = vec![view.name.to_owned(), name.to_owned()];
            for conserve_energy in [false, true] {
                let settings =
                    case.start().with(|s| (s.atrous.form, s.atrous.conserve_energy) = (form, conserve_energy));
                let filtered = case.run(gpu, atrous, &settings)?;
                let kept = light(&case, &filtered) / light(&case, &case.parts.input.radiance);
                row.extend([format!("{kept:.3}"), format!("{:.2}", case.mse(&case.filtered_light(&filtered)))]);
            }
            push(&mut table, row);
        }
    }
    section.tables.push(table);
    Ok(section)
}

/// Sum over the pixels that have samples.
fn light(case: &Case, image: &[vec4]) -> f64 {
    let known = image.iter().zip(&case.parts.input.radiance).filter(|(_, noisy)| noisy[3] > 0.0);
    known.map(|(pixel, _)| pixel[..3].iter().map(|&v| f64::from(v)).sum::<f64>()).sum()
}
