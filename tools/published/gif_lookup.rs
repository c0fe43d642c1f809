//! GIF's supersampling, by which filtered light is looked up along eye rays, against an image from one guide ray
//! per pixel; and the case in which it fails, eye rays that hit a surface which no guide ray around them hits.
use super::case::Case;
use super::view::View;
use super::{Section, push, sweep};
use crate::Args;
use anyhow::anyhow;
use rayon::prelude::*;
use tallow::denoise::Demodulation;
use tallow::denoise::filter;
use tallow::gpu::Gpu;
use tallow::image::Picture;
use tallow::layout::{Effects, Guide, vec3, vec4};
use tallow::render::{Outputs, Renderer, frame_constants};
use tallow::report::html::Table;
use tallow::scene::Loaded;
use tallow::twins::guide_lookup::{GuideRays, eye_hit};
use tallow::twins::path::{Strategy, Tracer};

const fn view(name: &'static str, scene: &'static str, size: [u32; 2]) -> View {
    View { name, scene, size, full: [1024, 768], depth: 4, reference: 256 }
}

const VIEWS: &[View] = &[
    view("sponza", "crytek-sponza", [256, 144]),
    view("grass", "scenes/grass/scene.toml", [224, 126]),
    view("grass", "scenes/grass/scene.toml", [112, 63]),
];
const EYE_RAYS: [u32; 2] = [4, 16];
/// A guide ray can represent an eye ray whose normal differs by at most 30 degrees and whose depth by at most 5 %.
const ALIKE: (f32, f32) = (0.866, 0.05);
/// A pixel counts as lost if more than this share of its eye rays is not represented.
const LOST: f32 = 0.25;

/// # Errors
/// When a scene cannot be rendered, or the device fails.
pub fn measure(gpu: &Gpu, args: &Args) -> anyhow::Result<Section> {
    let how = "The paper shows pictures of it and prints no errors. MSE in 8-bit sRGB code values against 256 samples per pixel, with \
        the reference's direct light; indirect light of one path per pixel through its centre, filtered by guided, or without noise. \
        Lost: no guide ray stands for more than a quarter of the pixel's eye rays (normal more than 30 degrees off, or depth more \
        than 5 %).";
    let mut section = Section::new("GIF: supersampling by looking filtered light up", &[how]);
    for view in VIEWS {
        section.tables.push(one(gpu, args, view)?);
    }
    Ok(section)
}

fn one(gpu: &Gpu, args: &Args, view: &View) -> anyhow::Result<Table> {
    let reference = view.reference(args)?;
    let direct = reference.film.picture(Some("direct")).map_err(|what| anyhow!(what))?.pixels;
    let centres = |spp| view.render(args, spp, 2, "-centres", &["--filter", "point"]);
    let case = |spp| Case::new(&centres(spp)?, &reference, Demodulation::Light);
    let (noisy, settled) = (case(1)?, case(view.reference)?);
    let row = filter::find("guided").expect("a row of the table");
    let error = |settings: &_| Ok(noisy.mse(&noisy.filtered_light(&noisy.run(gpu, row, settings)?)));
    let best = sweep::best(row, noisy.start(), error)?;
    let filtered = noisy.run(gpu, row, &best.settings)?;
    let scene = view.load(args, |_| {})?;
    let renderer = Renderer::new(gpu, &scene, &scene.settings, Outputs::default())?;
    let lost = lost(&scene, renderer.effects(), &noisy.parts.input.guide, &filtered);
    let lost_pixels: Vec<bool> = lost.iter().map(|&share| share > LOST).collect();
    let mut table = Table::new(&view.label(args), &["light of the guide rays", "image", "all", "lost", "others"]);
    let share = 100.0 * lost.iter().sum::<f32>() / lost.len() as f32;
    let pixels = 100.0 * lost_pixels.iter().filter(|&&l| l).count() as f32 / lost.len() as f32;
    table.note = format!("{share:.1} % of eye rays and {pixels:.1} % of pixels are lost. guided: {}", best.text);
    for (light, case, filtered) in
        [("1 path, guided", &noisy, &filtered), ("noise-free", &settled, &settled.parts.input.radiance)]
    {
        let guide = &case.parts.input.guide;
        let centre = guide.iter().zip(filtered).map(reflected).collect();
        push(&mut table, line(light, "guide ray alone", case, &lost_pixels, &lit(case, &direct, centre)));
        push(&mut table, line(light, "own light, mean albedo", case, &lost_pixels, &case.filtered_light(filtered)));
        for eye_rays in EYE_RAYS {
            let (indirect, _) = renderer.look_up(guide, filtered, eye_rays)?;
            let name = format!("look-up, {eye_rays} eye rays");
            push(&mut table, line(light, &name, case, &lost_pixels, &lit(case, &direct, indirect)));
        }
    }
    Ok(table)
}

fn reflected((guide, light): (&Guide, &vec4)) -> vec3 {
    std::array::from_fn(|c| guide.albedo[c] * light[c])
}

fn lit(case: &Case, direct: &[vec3], indirect: Vec<vec3>) -> Picture {
    let pixel = |(direct, indirect): (&vec3, vec3)| std::array::from_fn(|c| direct[c] + indirect[c]);
    Picture { pixels: direct.iter().zip(indirect).map(pixel).collect(), ..case.reference.clone() }
}

fn line(light: &str, image: &str, case: &Case, lost: &[bool], picture: &Picture) -> Vec<String> {
    let over = |wanted: bool| {
        let mut part = case.reference.clone();
        let pixels = part.pixels.iter_mut().zip(&picture.pixels).zip(lost).filter(|(_, l)| **l == wanted);
        let count = pixels.map(|((to, from), _)| *to = *from).count();
        if count == 0 { "-".to_owned() } else { format!("{:.2}", case.mse(&part) * lost.len() as f64 / count as f64) }
    };
    vec![light.to_owned(), image.to_owned(), format!("{:.2}", case.mse(picture)), over(true), over(false)]
}

/// Returns for each pixel the share of its eye rays that none of their candidate guide rays represents.
fn lost(scene: &Loaded, effects: &Effects, guide: &[Guide], filtered: &[vec4]) -> Vec<f32> {
    let (frame, effects) = (frame_constants(scene, &scene.settings).unwrap(), *effects);
    let tracer = Tracer { scene, frame, effects, strategy: Strategy::Both };
    let guides = GuideRays { size: frame.path.size, guide, filtered };
    let is_lost = |pixel: u32, index: u32| {
        let Some((eye, film)) = eye_hit(&tracer, pixel, index) else { return false };
        guides.most_similar(&eye.guide, film).is_none_or(|q| !stands_for(&guide[q], &eye.guide))
    };
    let share = |pixel| (0..EYE_RAYS[1]).filter(|&k| is_lost(pixel, k)).count() as f32 / EYE_RAYS[1] as f32;
    (0..guide.len() as u32).into_par_iter().map(share).collect()
}

fn stands_for(guide: &Guide, eye: &Guide) -> bool {
    let cosine: f32 = (0..3).map(|c| guide.normal[c] * eye.normal[c]).sum();
    cosine >= ALIKE.0 && (guide.depth - eye.depth).abs() <= ALIKE.1 * eye.depth
}
