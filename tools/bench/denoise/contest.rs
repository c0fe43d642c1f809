//! Noisy images of a scene, and what every filter makes of them.
use crate::Args;
use crate::reference::Reference;
use crate::strip;
use crate::view::View;
use anyhow::{Result, anyhow};
use tallow::denoise::filter::{FilterSettings, Method, OidnQuality, Scales};
use tallow::denoise::{Clean, ExpectedError, Filtered, Noisy, Recipe};
use tallow::gpu::{FrameResources, Gpu, total_ms};
use tallow::image::{Picture, metrics};
use tallow::profile::{median, wake};
use tallow::render::settings::Settings;
use tallow::render::{Job, Outputs, Renderer};
use tallow::scene::{Loaded, Scene};

/// A filter at its defaults.
pub struct Contender {
    pub name: String,
    pub method: Method,
    pub quality: OidnQuality,
}

/// How far one image is from its reference.
pub struct Score {
    pub relmse: f64,
    pub ssim: f64,
    pub flip: f64,
    pub ms: Option<f64>,
    pub expected: Option<ExpectedError>,
}

/// One noisy image.
pub struct Row {
    pub view: &'static str,
    pub spp: u32,
    pub reference_spp: f64,
    pub reference_relmse: f64,
    /// The noisy image, then what the contenders made of it.
    pub scores: Vec<Score>,
}

/// Renders a view at every number of samples, filters it, and draws what came out.
pub fn of_view(gpu: &Gpu, args: &Args, view: &'static View, contenders: &[Contender]) -> Result<Vec<Row>> {
    let file = view.scene_file(args.data.as_deref(), &args.output.join("scenes"))?;
    let Loaded { scene, settings, .. } = Scene::load(&file)?;
    let folder = args.references.clone().unwrap_or_else(|| args.output.join("references"));
    std::fs::create_dir_all(&folder)?;
    let of_reference = Settings { spp: args.reference_spp, ..settings.clone() };
    let reference = Reference::new(gpu, view, &scene, &of_reference, &folder.join(format!("{}.exr", view.name)))?;
    let mut rows = Vec::new();
    for &spp in &args.spp {
        let (noisy, filtered) = images(gpu, args, &scene, &view.settings(&settings, spp, 0), contenders)?;
        let pictures: Vec<&Picture> = filtered.iter().map(|image| &image.picture).collect();
        let of_filters = filtered.iter().map(|image| image.score(&reference));
        let scores = [score(&noisy, &reference)].into_iter().chain(of_filters).collect();
        let (name, reference_spp, reference_relmse) = (view.name, reference.spp, reference.relmse);
        rows.push(Row { view: name, spp, reference_spp, reference_relmse, scores });
        let strip = strip::draw(&noisy, &pictures, &reference.picture);
        strip::write(&strip, &args.output.join(format!("{name}-{spp}spp.png")))?;
    }
    Ok(rows)
}

/// What a filter made of an image.
struct Image {
    picture: Picture,
    ms: f64,
    expected: Option<ExpectedError>,
}

impl Image {
    fn score(&self, reference: &Reference) -> Score {
        Score { ms: Some(self.ms), expected: self.expected, ..score(&self.picture, reference) }
    }
}

/// The noisy image, and every contender's.
fn images(
    gpu: &Gpu,
    args: &Args,
    scene: &Scene,
    settings: &Settings,
    contenders: &[Contender],
) -> Result<(Picture, Vec<Image>)> {
    let renderer = Renderer::new(gpu, scene, settings, Outputs::FILTERED)?;
    let job = Job::new(&renderer);
    let status = job.run_to_end(&mut FrameResources::new(gpu)?)?;
    let noisy = job.film(&status)?.picture(None).map_err(|what| anyhow!(what))?;
    let filtered = contenders.iter().map(|contender| {
        let (mut took, mut expected) = (Vec::new(), None);
        let mut picture = noisy.clone();
        // The first run makes kernels and loads weights.
        for _ in 0..=args.runs {
            let Clean { colour, times, expected: told, .. } = contender.filter(gpu, Noisy::of_film(&renderer)?)?;
            picture = Picture::of_planes(noisy.size(), &colour);
            took.push(total_ms(&times));
            expected = told;
        }
        Ok(Image { picture, ms: median(&took[1..]), expected })
    });
    let filtered = filtered.collect::<Result<Vec<_>>>()?;
    Ok((noisy, filtered))
}

impl Contender {
    /// As `tallow render --denoise` does it; passes are timed by the device's clock, or for a library by the host's.
    fn filter(&self, gpu: &Gpu, noisy: Noisy) -> Result<Clean> {
        let quality = self.quality;
        let settings =
            |scales: &Scales| FilterSettings::default().scaled_by(scales).with(|s| s.oidn.oidn_quality = quality);
        let recipe = Recipe { settings: &settings, ..Recipe::new(self.method) };
        let filtered = Filtered::new(gpu, noisy, &recipe)?;
        wake(gpu)?; // it slept while kernels were made
        Ok(filtered.join(gpu)?)
    }
}

fn score(picture: &Picture, reference: &Reference) -> Score {
    let m = metrics::compare(picture, &reference.picture);
    Score { relmse: m.relmse, ssim: m.ssim.unwrap_or(f64::NAN), flip: m.flip, ms: None, expected: None }
}

impl Row {
    /// The least error of a contender: a reference is good enough whose own is a tenth of it.
    pub fn least_relmse(&self) -> f64 {
        self.scores.iter().map(|score| score.relmse).fold(f64::INFINITY, f64::min)
    }
}
