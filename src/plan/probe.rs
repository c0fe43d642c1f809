//! Renders few samples, twice with different random numbers, and measures time and error.
use super::halves::{self, Pixels};
use super::{Target, forecasts, most_samples};
use crate::denoise::filter::Method;
use crate::denoise::{Chain, Colour, Noisy, Recipe, timed};
use crate::error::{Error, Result};
use crate::gpu::{FrameResources, Gpu, PassTime, total_ms};
use crate::image::Picture;
use crate::machine::wake;
use crate::render::settings::Settings;
use crate::render::{Outputs, Renderer, Step};
use crate::scene::Scene;

/// Each level has so many times the samples of the one before.
const GROWTH: u32 = 4;
/// A level is taken while both of its images together cost no more than this share of the time that is planned for.
const SHARE: f64 = 0.5;
/// The first levels are taken whatever they cost: one tells no power.
const LEAST_LEVELS: usize = 2;
/// Levels after which an error that seems out of reach is.
const MOST_OUT_OF_REACH: usize = 4;
/// For an error, the last level has at least the planned samples over this: Sobol points gain by more samples faster than few of them
/// tell. From a sixteenth, the error of the bust was foreseen 2.3 times too large.
const REACH: u32 = 4;

/// What a method makes of a level's images.
#[derive(Clone, Copy, Debug)]
pub struct Measured {
    /// RelMSE of one image.
    pub error: f64,
    /// GPU milliseconds of its filter, 0 without.
    pub ms: f64,
}

/// What images of so many samples cost, and how far they are off.
#[derive(Clone, Debug)]
pub struct Level {
    /// Samples per pixel.
    pub spp: u32,
    /// GPU milliseconds that more samples do not add to: before the first sample, and of deciding where samples go.
    pub start_ms: f64,
    /// GPU milliseconds of all samples.
    pub samples_ms: f64,
    /// By method.
    pub methods: Vec<Measured>,
}

/// A warm renderer for the probes of one scene.
pub struct Probe<'a> {
    gpu: &'a Gpu,
    scene: &'a Scene,
    /// Its samples per pixel are those of a level where samples are placed, else more than any level has.
    renderer: Renderer,
    frame: FrameResources,
    outputs: Outputs,
    methods: &'a [Method],
    /// By method, from the first image on.
    chains: Vec<Option<Chain<'a>>>,
    seeds: [u32; 2],
    /// GPU milliseconds so far.
    pub spent_ms: f64,
}

/// An image, and what each method makes of it.
struct Image {
    noisy: Vec<[f32; 3]>,
    filtered: Vec<Option<Vec<[f32; 3]>>>,
    start_ms: f64,
    samples_ms: f64,
    filter_ms: Vec<f64>,
}

impl<'a> Probe<'a> {
    /// Makes the renderer, which keeps `outputs`, and runs it once, so that its kernels are compiled.
    ///
    /// # Errors
    /// Those of [`Renderer::new`], and [`Error::Device`] for a device that tells no times.
    pub fn new(
        gpu: &'a Gpu,
        scene: &'a Scene,
        settings: &Settings,
        outputs: Outputs,
        methods: &'a [Method],
    ) -> Result<Self> {
        gpu.check_clock()?;
        // Batches are as large as those of a render of many samples.
        let spp = if settings.allocate.is_even() { Settings::MAX_SPP.min(4096) } else { 1 };
        let settings = Settings { spp, ..settings.clone() };
        let renderer = Renderer::new(gpu, scene, &settings, outputs)?;
        // Their random numbers are not those of the render, which would look as good as it is at the probe's expense.
        let seeds = [1, 2].map(|k| settings.seed.wrapping_add(k));
        let frame = FrameResources::new(gpu)?;
        let mut probe = Self {
            gpu,
            scene,
            renderer,
            frame,
            outputs,
            methods,
            chains: methods.iter().map(|_| None).collect(),
            seeds,
            spent_ms: 0.0,
        };
        probe.image(probe.seeds[0], 1)?;
        probe.spent_ms = 0.0;
        Ok(probe)
    }

    /// Levels up to what the target needs.
    ///
    /// # Errors
    /// [`Error::Device`], also for pixels that are no numbers.
    pub fn levels(&mut self, target: Target) -> Result<Vec<Level>> {
        let (mut pairs, mut spp) = (Vec::<(u32, [Image; 2])>::new(), 1);
        loop {
            let [first, second] = self.seeds;
            wake(self.gpu)?;
            pairs.push((spp, [self.image(first, spp)?, self.image(second, spp)?]));
            let levels = self.judged(&pairs);
            match next_spp(spp, self.most()).filter(|_| pairs.len() < LEAST_LEVELS || self.wants_more(&levels, target))
            {
                Some(next) => spp = next,
                None => return Ok(levels),
            }
        }
    }

    fn most(&self) -> u32 {
        most_samples(self.renderer.settings())
    }

    fn wants_more(&self, levels: &[Level], target: Target) -> bool {
        let last = &levels[levels.len() - 1];
        let next_ms = 2.0 * f64::from(GROWTH) * last.samples_ms;
        let forecasts = forecasts(levels, self.methods, self.most());
        match target {
            Target::GpuMs(ms) => next_ms <= SHARE * ms,
            Target::RelMse(error) => {
                let wanted = forecasts.iter().filter_map(|forecast| forecast.samples_for(error)).min();
                // What is out of reach by far is so after few levels.
                wanted.map_or(levels.len() < MOST_OUT_OF_REACH, |wanted| wanted.div_ceil(REACH) > last.spp)
            }
        }
    }

    /// Errors of all levels, relative to the radiance of the last.
    fn judged(&self, pairs: &[(u32, [Image; 2])]) -> Vec<Level> {
        let width = self.renderer.settings().width as usize;
        let last = &pairs[pairs.len() - 1].1;
        let cleanest = last.each_ref().map(|image| &image.filtered.iter().flatten().next().unwrap_or(&image.noisy)[..]);
        let scales = halves::scales(width, cleanest, last.each_ref().map(|image| &image.noisy[..]));
        let measured = |[a, b]: &[Image; 2], method: usize| {
            let noisy: [&Pixels; 2] = [&a.noisy, &b.noisy];
            let error = match (&a.filtered[method], &b.filtered[method]) {
                (Some(fa), Some(fb)) => halves::error_of_filtered([fa, fb], noisy, &scales),
                _ => halves::error(noisy, &scales),
            };
            Measured { error, ms: a.filter_ms[method].min(b.filter_ms[method]) }
        };
        let methods = |pair| (0..self.methods.len()).map(|method| measured(pair, method)).collect();
        pairs.iter().map(|(spp, pair)| level(*spp, pair, methods(pair))).collect()
    }

    fn image(&mut self, seed: u32, spp: u32) -> Result<Image> {
        let steps = self.steps(spp)?;
        self.renderer.set_seed(seed);
        let (mut start_ms, mut samples_ms) = (0.0, 0.0);
        for step in steps {
            let ms = total_ms(&self.renderer.run(&mut self.frame, &step)?);
            let traces = matches!(step, Step::Uniform(_) | Step::Listed(_));
            *(if traces { &mut samples_ms } else { &mut start_ms }) += ms;
        }
        let noisy = self.renderer.picture()?.finite().map_err(Error::Device)?;
        let size = noisy.size();
        let mut image =
            Image { noisy: noisy.pixels, filtered: Vec::new(), start_ms, samples_ms, filter_ms: Vec::new() };
        for method in 0..self.methods.len() {
            let (colour, times) = self.filtered(method)?.unzip();
            let picture = colour.map(|colour| Picture::of_planes(size, &colour).finite()).transpose();
            image.filtered.push(picture.map_err(Error::Device)?.map(|picture| picture.pixels));
            image.filter_ms.push(times.map_or(0.0, |times| total_ms(&times)));
        }
        self.spent_ms += start_ms + samples_ms + image.filter_ms.iter().sum::<f64>();
        Ok(image)
    }
}

impl Probe<'_> {
    /// Renders so many samples as a render does that has just been made, and returns its GPU milliseconds.
    ///
    /// # Errors
    /// Those of [`Renderer::new`].
    pub fn rehearse(&mut self, spp: u32) -> Result<f64> {
        self.chains.iter_mut().for_each(|chain| *chain = None);
        let settings = Settings { spp, ..self.renderer.settings().clone() };
        self.renderer = Renderer::new(self.gpu, self.scene, &settings, self.outputs)?;
        wake(self.gpu)?;
        let mut took = 0.0;
        for step in self.renderer.steps() {
            took += total_ms(&self.renderer.run(&mut self.frame, &step)?);
        }
        self.spent_ms += took;
        Ok(took)
    }

    /// The steps of an image of so many samples. Where they are placed depends on how many there are, so that each number has a
    /// renderer of its own, which runs once before it is timed.
    fn steps(&mut self, spp: u32) -> Result<Vec<Step>> {
        let settings = self.renderer.settings();
        if settings.allocate.is_even() {
            return Ok([Step::Start].into_iter().chain(self.renderer.samples(0, spp)).collect());
        }
        if settings.spp != spp {
            self.rehearse(spp)?;
        }
        Ok(self.renderer.steps().collect())
    }

    /// What a method makes of the image that the renderer holds; nothing without a filter. Kernels are compiled once.
    fn filtered(&mut self, method: usize) -> Result<Option<(Colour, Vec<PassTime>)>> {
        if self.methods[method].is_none() {
            return Ok(None);
        }
        let recipe = Recipe::new(self.methods[method]);
        let row = match self.methods[method] {
            Method::Kernels(row) => row,
            Method::Oidn => {
                let found = timed(self.gpu, Noisy::of_film(&self.renderer)?, &recipe)?;
                return Ok(Some((found.colour, found.times)));
            }
        };
        let chain = match self.chains[method].take() {
            Some(chain) => chain,
            None => {
                let chain = Chain::new(self.gpu, Noisy::of_film(&self.renderer)?, &recipe, row)?;
                chain.run()?;
                chain
            }
        };
        let (times, _) = chain.run()?;
        let colour = chain.colour()?;
        self.chains[method] = Some(chain);
        Ok(Some((colour, times)))
    }
}

/// Of a pair of images, whose times are the mean of both.
fn level(spp: u32, [a, b]: &[Image; 2], methods: Vec<Measured>) -> Level {
    let [start_ms, samples_ms] = [a.start_ms + b.start_ms, a.samples_ms + b.samples_ms].map(|both| 0.5 * both);
    Level { spp, start_ms, samples_ms, methods }
}

/// Samples per pixel of the level after one of so many; none where a render has no more.
fn next_spp(spp: u32, most: u32) -> Option<u32> {
    Some(spp.saturating_mul(GROWTH).min(most)).filter(|&next| next > spp)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_costs_what_one_of_its_images_does() {
        let image = |start_ms, samples_ms| Image {
            noisy: Vec::new(),
            filtered: Vec::new(),
            start_ms,
            samples_ms,
            filter_ms: Vec::new(),
        };
        let level = level(4, &[image(1.0, 10.0), image(3.0, 14.0)], Vec::new());
        assert_eq!((level.spp, level.start_ms, level.samples_ms), (4, 2.0, 12.0));
    }

    #[test]
    fn levels_end_where_renders_do() {
        let levels = |most| std::iter::successors(Some(1), move |spp| next_spp(*spp, most)).collect::<Vec<_>>();
        assert_eq!((levels(Settings::MAX_SPP).len(), levels(Settings::MAX_SPP).last()), (13, Some(&Settings::MAX_SPP)));
        assert_eq!([levels(1), levels(6), levels(16)], [vec![1], vec![1, 4, 6], vec![1, 4, 16]]);
    }
}
