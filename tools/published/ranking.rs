//! The error of every filter at its best settings, on scenes of the papers' kinds beside the published errors.
use super::case::Case;
use super::eaw;
use super::report::Sheet;
use super::sweep::{self, Best};
use super::view::View;
use super::{Section, push};
use crate::Args;
use tallow::denoise::Demodulation;
use tallow::denoise::filter::{FILTERS, Row};
use tallow::gpu::Gpu;
use tallow::report::html::Table;

/// One scene for each of the three kinds in GIF, and two more: two bounces of indirect light.
const GIF: [View; 5] = [
    view("bust-room", "scenes/bust/room.toml", [180, 240]),
    view("dragon", "stanford-dragon", [256, 256]),
    view("sibenik-lamps", "sibenik-lamps", [192, 108]),
    view("sponza", "crytek-sponza", [256, 144]),
    view("grass", "scenes/grass/scene.toml", [224, 126]),
];

/// Scene, samples per pixel, and errors of the cross bilateral, À-Trous and guided filters.
type Published = (&'static str, u32, [f64; 3]);

/// GIF's errors.
const PUBLISHED: [Published; 5] = [
    ("bust-room", 1, [95.5, 190.6, 74.8]),
    ("bust-room", 4, [73.5, 92.2, 65.4]),
    ("dragon", 1, [36.0, 49.5, 30.4]),
    ("dragon", 4, [27.5, 29.6, 27.4]),
    ("sibenik-lamps", 1, [89.9, 95.3, 92.5]),
];

/// Error of each filter.
type Errors = Vec<(&'static str, f64)>;

const HOW: &str = "Mean squared error in 8-bit sRGB code values. light: filtered light with what else the reference has, for which \
    settings are searched; image: with the noisy image's own; again: light of another seed at the same settings.";

const fn view(name: &'static str, scene: &'static str, size: [u32; 2]) -> View {
    View { name, scene, size, full: [1024, 768], depth: 4, reference: 1024 }
}

/// GIF's errors.
///
/// # Errors
/// When a scene cannot be rendered, or the device fails.
pub fn gif(gpu: &Gpu, args: &Args) -> anyhow::Result<Section> {
    let stand_ins = "GIF's scenes are not free as they were lit: a bust in a room stands for its bust, the Stanford dragon and \
        Sibenik at night for its own; Sponza and grass have no published figures. Indirect light alone is filtered, two bounces.";
    let mut section = Section::new("GIF: errors of three filters, and of ours", &[HOW, stand_ins]);
    let mut ratios = Table::new("guided over the others", &["scene", "over", "ours", "published"]);
    for view in &GIF {
        for spp in [1, 4] {
            let errors = one(gpu, args, view, spp, Demodulation::Light, &PUBLISHED, &mut section)?;
            for other in ["bilateral", "atrous"] {
                ratio(view, spp, other, &errors).into_iter().for_each(|row| push(&mut ratios, row));
            }
        }
    }
    section.tables.insert(0, ratios);
    Ok(section)
}

/// EAW's comparison.
///
/// # Errors
/// When a scene cannot be rendered, or the device fails.
pub fn eaw(gpu: &Gpu, args: &Args) -> anyhow::Result<Section> {
    let what = "EAW's figures 10 and 12 show pictures and print no errors: a path per pixel, one indirect bounce, all light is \
        filtered, beside the decimated and the red-black wavelets (wavelet, by its basis) and a bilateral filter.";
    let mut section = Section::new("EAW, figures 10 and 12: errors behind one path per pixel", &[HOW, what]);
    for (view, _) in &eaw::VIEWS {
        one(gpu, args, view, 1, Demodulation::Albedo, &[], &mut section)?;
    }
    Ok(section)
}

fn one(
    gpu: &Gpu,
    args: &Args,
    view: &View,
    spp: u32,
    demodulation: Demodulation,
    theirs: &[Published],
    section: &mut Section,
) -> anyhow::Result<Errors> {
    let reference = view.reference(args)?;
    let case = |seed| Case::new(&view.render(args, spp, seed, "", &[])?, &reference, demodulation);
    let (case, again) = (case(0)?, case(3)?);
    let name = format!("{}, {spp} spp", view.label(args));
    let mut table = Table::new(&name, &["filter", "light", "image", "again", "published", "best settings"]);
    let mut errors = Errors::new();
    let mut images = vec![("noisy".to_owned(), case.noisy.clone())];
    for row in FILTERS {
        let best = search(gpu, &case, row)?;
        let picture = case.whole(&case.run(gpu, row, &best.settings)?);
        errors.push((row.name, best.error));
        let again = again.mse(&again.filtered_light(&again.run(gpu, row, &best.settings)?));
        let numbers = [best.error, case.mse(&picture), again].map(|error| format!("{error:.2}"));
        let published =
            published(theirs, view.name, spp, row.name).map_or("-".to_owned(), |error| format!("{error:.1}"));
        push(&mut table, [row.name.to_owned()].into_iter().chain(numbers).chain([published, best.text]));
        if row.name != "none" {
            images.push((row.name.to_owned(), picture));
        }
    }
    section.tables.push(table);
    section.sheets.push(Sheet { name, images, reference: case.reference });
    Ok(errors)
}

/// Ratio between the errors of filters, which can be compared with the paper's although the scenes differ.
fn ratio(view: &View, spp: u32, other: &str, errors: &Errors) -> Option<[String; 4]> {
    let ours = |name: &str| errors.iter().find(|(known, _)| *known == name).map(|(_, error)| *error);
    let theirs = |name: &str| published(&PUBLISHED, view.name, spp, name);
    let (ours, theirs) = (ours("guided")? / ours(other)?, theirs("guided")? / theirs(other)?);
    Some([format!("{}, {spp} spp", view.name), other.to_owned(), format!("{ours:.2}"), format!("{theirs:.2}")])
}

fn search(gpu: &Gpu, case: &Case, row: &Row) -> anyhow::Result<Best> {
    sweep::best(row, case.start(), |settings| Ok(case.mse(&case.filtered_light(&case.run(gpu, row, settings)?))))
}

fn published(all: &[Published], scene: &str, spp: u32, filter: &str) -> Option<f64> {
    let column = ["bilateral", "atrous", "guided"].iter().position(|name| *name == filter)?;
    let (.., errors) = all.iter().find(|(name, n, _)| *name == scene && *n == spp)?;
    Some(errors[column])
}
