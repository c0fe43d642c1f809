//! EAW's figure 9: light traced for every pixel, for one of 2x2 and for one of 4x4.
use super::VIEWS;
use crate::Args;
use crate::published::report::Sheet;
use crate::published::view::View;
use crate::published::{Section, push};
use tallow::denoise::filter::{self, Method};
use tallow::denoise::{Noisy, Recipe, timed};
use tallow::gpu::{FrameResources, Gpu, total_ms};
use tallow::image::{Picture, metrics};
use tallow::render::settings::{Settings, Split};
use tallow::render::{Job, Outputs, Renderer};
use tallow::report::html::Table;

/// Seeds that times and errors are means of.
const SEEDS: u32 = 4;
/// How the samples lie: a policy, how many a pixel, and the stride.
const WAYS: [(&str, u32, u32); 9] = [
    ("uniform", 1, 1),
    ("uniform", 1, 2),
    ("uniform", 1, 4),
    ("uniform", 2, 1),
    ("uniform", 2, 2),
    ("uniform", 2, 4),
    ("geometry", 2, 1),
    ("uniform", 4, 2),
    ("uniform", 4, 4),
];

/// Milliseconds of the device until the samples are there, and of the filter; relMSE; FLIP.
type Row = [f64; 4];

/// # Errors
/// When a scene cannot be rendered, or the device fails.
pub fn measure(gpu: &Gpu, args: &Args) -> anyhow::Result<Section> {
    let mut section = Section::new(
        "EAW, figure 9: light traced for some pixels only",
        &[
            "The paper's frames took 1/1.1 s with a path for every pixel, .29 of that with one for 2x2 pixels and .10 with one for 4x4; \
           errors are not printed. There, pixels in between trace nothing; ours trace what is not filtered, the direct light of point, \
           spot and directional lights and the samples' albedo, for every pixel. Device milliseconds of rendering and filtering, their \
           share of those of one sample in every pixel, relMSE and FLIP, means of 4 seeds.",
        ],
    );
    for filter in ["atrous", "auto"] {
        let mut table = Table::new(filter, &["scene", "samples", "render + filter", "share", "relMSE", "FLIP"]);
        for (view, _) in VIEWS {
            let reference =
                view.render(args, view.reference, 1, "", &[])?.film.picture(None).map_err(anyhow::Error::msg)?;
            let mut sheet = Sheet { name: format!("{} {filter}", view.label(args)), images: Vec::new(), reference };
            let mut whole = None;
            for (policy, spp, stride) in WAYS {
                let ([render, filtering, relmse, flip], picture) =
                    one(gpu, args, &view, (policy, spp, stride), filter, &sheet.reference)?;
                let all = *whole.get_or_insert(render + filtering);
                let name = match stride {
                    1 => format!("{policy}, {spp}"),
                    _ => format!("{policy}, {spp}, one of {stride}x{stride} pixels"),
                };
                let times = format!("{render:.1} + {filtering:.1}");
                let share = format!("{:.2}", (render + filtering) / all);
                push(
                    &mut table,
                    [view.name.to_owned(), name.clone(), times, share, format!("{relmse:.4}"), format!("{flip:.3}")],
                );
                sheet.images.push((name, picture));
            }
            section.sheets.push(sheet);
        }
        section.tables.push(table);
    }
    Ok(section)
}

/// Means over seeds, and the last image.
fn one(
    gpu: &Gpu,
    args: &Args,
    view: &View,
    (policy, spp, stride): (&str, u32, u32),
    filter: &str,
    reference: &Picture,
) -> anyhow::Result<(Row, Picture)> {
    let change = |s: &mut Settings| {
        ([s.width, s.height], s.max_depth, s.spp, s.indirect_stride) = (view.size(args), view.depth, spp, stride);
        s.split = Split::Soft;
        s.allocate.policy = tallow::allocate::policy(policy).expect("a row of the table");
        s.allocate.min_spp = 1; // of two samples one is placed
    };
    let scene = view.load(args, change)?;
    let mut renderer = Renderer::new(gpu, &scene, &scene.settings, Outputs::FILTERED)?;
    let mut frame = FrameResources::new(gpu)?;
    let recipe = Recipe::new(Method::Kernels(filter::find(filter).expect("a row of the table")));
    Job::new(&renderer).run_to_end(&mut frame)?; // compiles
    let (mut sums, mut last) = (Row::default(), None);
    for seed in 0..SEEDS {
        renderer.set_seed(100 + seed);
        let status = Job::new(&renderer).run_to_end(&mut frame)?;
        let clean = timed(gpu, Noisy::of_film(&renderer)?, &recipe)?;
        let picture = Picture::of_planes(reference.size(), &clean.colour);
        let errors = metrics::compare(&picture, reference);
        let row = [total_ms(&status.times), total_ms(&clean.times), errors.relmse, errors.flip];
        sums = std::array::from_fn(|k| sums[k] + row[k] / f64::from(SEEDS));
        last = Some(picture);
    }
    Ok((sums, last.expect("some seeds")))
}
