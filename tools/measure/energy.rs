//! Measures how much light À-Trous keeps, and by how much the error grows when it keeps all of it.
use super::case::Case;
use super::ranking::VIEWS;
use crate::Args;
use tallow::denoise::Demodulation;
use tallow::denoise::filter::{self, AtrousForm};
use tallow::gpu::Gpu;
use tallow::layout::vec4;
use tallow::report::table;

const FORMS: [(&str, AtrousForm); 3] =
    [("listing", AtrousForm::Listing), ("squared", AtrousForm::Squared), ("printed", AtrousForm::Printed)];

/// # Errors
/// When a scene cannot be rendered, or the device fails.
pub fn print(gpu: &Gpu, args: &Args) -> anyhow::Result<()> {
    println!(
        "EAW at its default settings, 1 sample per pixel: the mean of filtered indirect light over that of the noisy,"
    );
    println!(
        "and its error as in the ranking; weights normalised as published, and what they fall short of kept by the"
    );
    println!("centre pixel (--conserve-energy).\n");
    let atrous = filter::find("atrous").expect("a row of the table");
    let mut rows = Vec::new();
    for view in VIEWS {
        let case = Case::new(&view.render(args, 1)?, &view.render(args, view.reference)?, Demodulation::Light)?;
        for (name, form) in FORMS {
            let mut row = vec![view.name.to_owned(), name.to_owned()];
            for conserve_energy in [false, true] {
                let filtered = case.run(
                    gpu,
                    atrous,
                    &case.start().with(|s| {
                        s.atrous.form = form;
                        s.atrous.conserve_energy = conserve_energy;
                    }),
                )?;
                let kept = light(&case, &filtered) / light(&case, &case.parts.input.radiance);
                row.extend([format!("{kept:.3}"), format!("{:.2}", case.mse(&case.filtered_light(&filtered)))]);
            }
            rows.push(row);
        }
    }
    let header = ["scene", "form", "published: light", "error", "conserving: light", "error"];
    println!("{}", table::text(&header, &rows));
    Ok(())
}

/// Sum over the pixels that have samples.
fn light(case: &Case, image: &[vec4]) -> f64 {
    let known = image.iter().zip(&case.parts.input.radiance).filter(|(_, noisy)| noisy[3] > 0.0);
    known.map(|(pixel, _)| pixel[..3].iter().map(|&v| f64::from(v)).sum::<f64>()).sum()
}
