//! One image filtered with scales of its own, as the command line does: of a film, or of a file.
use super::demodulated::Demodulated;
use super::demodulation::Demodulation;
use super::expected::ExpectedError;
use super::filter::firefly::{Fireflies, Removed};
use super::filter::oidn;
use super::filter::{self, FilterSettings, Method, Planes, Scales};
use super::noisy::{Holds, Noisy};
use super::windows;
use crate::error::{Checked, Result};
use crate::gpu::{Buffer, FrameResources, Gpu, PassTime, Recorder};
use crate::layout::{Guide, PixelLight, PixelStats, vec3, vec4};
use crate::memory;
use crate::render::film;
use crate::render::settings::Settings;

/// How an image is to be filtered.
pub struct Recipe<'a> {
    /// By which filter.
    pub method: Method,
    /// What is kept away from the filter, where the image tells it and the filter does not want the colour whole. By default
    /// [`Holds::usual_demodulation`].
    pub demodulation: Option<Demodulation>,
    /// Whether the light is looked up along more rays, whose albedo it is multiplied by: see [`Filtered::join_reflected`].
    pub looked_up: bool,
    /// What is cut first: see [`Recipe::fireflies`].
    pub fireflies: Fireflies,
    /// The settings for light of these scales.
    pub settings: &'a dyn Fn(&Scales) -> FilterSettings,
}

impl Recipe<'_> {
    /// By this filter at its default settings, as `tallow render --denoise` uses it.
    pub fn new(method: Method) -> Self {
        let settings = &|scales: &Scales| FilterSettings::default().scaled_by(scales);
        Self { method, demodulation: None, looked_up: false, fireflies: Fireflies::Usual, settings }
    }

    /// What is cut. Unless it is asked for, nothing where nothing is filtered, nor for Open Image Denoise, which wants the colour whole.
    pub fn fireflies(&self) -> Fireflies {
        let takes_apart = matches!(self.method, Method::Kernels(_)) && !self.method.is_none();
        if self.fireflies == Fireflies::Usual && !takes_apart { Fireflies::Off } else { self.fireflies }
    }

    /// What is kept away from the filter of an image that holds this.
    pub fn demodulation(&self, holds: Holds) -> Demodulation {
        match self.method {
            Method::Kernels(_) => {
                self.demodulation.map_or(holds.usual_demodulation(), |wanted| holds.demodulation(wanted))
            }
            Method::Oidn => Demodulation::Off,
        }
    }

    /// Makes what takes images apart that hold the same as this one. Where pixels of it lack direct light, they take it from the others.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`] when the image is too large or the device fails.
    pub(super) fn demodulated(&self, gpu: &Gpu, noisy: &Noisy) -> Result<Demodulated> {
        filter::check_size(gpu, noisy.size)?;
        let demodulation = self.demodulation(noisy.holds());
        let in_paint = demodulation == Demodulation::Light && noisy.lacks_direct_light()?;
        let weighs_noise = self.method.weighs_noise() && !self.looked_up;
        Demodulated::new(gpu, noisy, demodulation, weighs_noise, in_paint, self.fireflies())
    }
}

/// An image whose light is filtered, still taken apart.
pub struct Filtered {
    parts: Demodulated,
    /// What the filter expects of its own errors, where it does.
    expected: Option<Buffer<vec3>>,
    /// What each pass took.
    pub times: Vec<PassTime>,
    /// What was cut beforehand, if anything was to be.
    pub removed: Option<Removed>,
    /// Whether some pixels took direct light from others.
    pub in_painted: bool,
}

/// A filtered image.
pub struct Clean {
    /// Its light.
    pub colour: Colour,
    /// What each pass took.
    pub times: Vec<PassTime>,
    /// What was cut beforehand, if anything was to be.
    pub removed: Option<Removed>,
    /// How far the image is expected to be from the truth, where the filter estimates it, samples tell their variance,
    /// and every pixel has direct light of its own.
    pub expected: Option<ExpectedError>,
}

impl Clean {
    /// Lines for the user.
    pub fn notes(&self) -> Vec<String> {
        let cut = self.removed.iter().filter(|cut| cut.pixels > 0).map(Removed::note);
        cut.chain(self.expected.iter().map(ExpectedError::note)).collect()
    }
}

/// Linear radiance (Rec. 709), one plane a channel, row-major.
pub type Colour = [Vec<f32>; 3];

impl Filtered {
    /// Filters `noisy`, whose planes are freed as soon as they are taken apart. Where pixels lack direct light, the filter in-paints
    /// it, with settings for its scale.
    ///
    /// # Errors
    /// [`crate::error::Error::Usage`] for settings out of range, [`crate::error::Error::Device`] when the image is too large or the
    /// device fails.
    pub fn new(gpu: &Gpu, noisy: Noisy, recipe: &Recipe) -> Result<Self> {
        recipe.method.check_stride(noisy.holds().indirect_stride)?;
        let parts = recipe.demodulated(gpu, &noisy)?;
        let mut times = run(gpu, |rec| parts.record_split(rec, &noisy))?;
        drop(noisy);
        let removed = parts.removed()?;
        let scales = Scales::of_planes(&parts.planes)?;
        let expected = run_filter(gpu, recipe, &scales, &parts.planes, &mut times)?;
        times.extend(run(gpu, |rec| parts.record_fill(rec))?);
        let direct = parts.direct_planes();
        let in_painted = direct.is_some();
        if let Some(direct) = direct {
            run_filter(gpu, recipe, &scales.with_light(&direct.radiance)?, &direct, &mut times)?;
            times.extend(run(gpu, |rec| parts.record_direct_join(rec))?);
        }
        Ok(Self { parts, expected, times, removed, in_painted })
    }

    /// Puts the image together.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn join(self, gpu: &Gpu) -> Result<Clean> {
        let Self { parts, expected, mut times, removed, in_painted } = self;
        times.extend(run(gpu, |rec| parts.record_join(rec))?);
        // Where direct light was in-painted, it lies in the place of what was filtered.
        let told = match expected.filter(|_| !in_painted) {
            Some(expected) => parts.expected_error(gpu, &expected)?,
            None => None,
        };
        Ok(Clean { colour: colour(&parts.picture)?, times, removed, expected: told })
    }

    /// Puts the image together from light that has been multiplied by surface colour already, as a look-up of these passes returns
    /// it; one value per pixel.
    ///
    /// # Errors
    /// [`crate::error::Error::Device`].
    pub fn join_reflected(self, light: &[vec3], look_up: Vec<PassTime>) -> Result<Clean> {
        let mut whole = colour(&self.parts.picture)?;
        for (c, plane) in whole.iter_mut().enumerate() {
            plane.iter_mut().zip(light).for_each(|(sharp, light)| *sharp += light[c]);
        }
        let times = [self.times, look_up].concat();
        Ok(Clean { colour: whole, times, removed: self.removed, expected: None })
    }

    /// The surfaces.
    pub fn guide(&self) -> &Buffer<Guide> {
        &self.parts.whole().guide
    }

    /// What the filter returned.
    pub fn light(&self) -> &Buffer<vec4> {
        &self.parts.whole().output
    }
}

/// Device memory that a pixel takes at most while [`Filtered`] is made: its guide, the seven planes of an image taken apart, and what
/// it was taken from or, later, the filter's own. The host holds a window.
pub fn bytes_per_pixel(method: Method) -> u64 {
    let planes = size_of::<Guide>() + 6 * size_of::<vec4>() + size_of::<vec3>();
    let taken_from = size_of::<PixelStats>() + size_of::<PixelLight>() + size_of::<f32>();
    planes as u64 + method.device_bytes().max(taken_from as u64)
}

/// Bytes of host memory that filtering the film of a render takes at most once its renderer is gone: the film that was read
/// back, the filtered colour, what the filter takes of the host, and where the device has no memory of its own
/// ([`DeviceInfo::unified`](crate::gpu::DeviceInfo::unified)) its buffers too.
pub fn host_bytes(method: Method, settings: &Settings, unified: bool) -> u64 {
    let device = if unified { bytes_per_pixel(method) } else { 0 };
    let colour = size_of::<vec3>() as u64;
    let film = film::bytes_per_pixel(!settings.allocate.is_even());
    settings.pixels() as u64 * (film + device + colour + method.host_bytes())
}

/// Checks that the host has room for a render with these settings, and then for each of these filters of its film.
///
/// # Errors
/// What it needs and what there is.
pub(crate) fn check_room(filters: impl IntoIterator<Item = Method>, settings: &Settings, unified: bool) -> Checked {
    let filtered = filters.into_iter().map(|method| host_bytes(method, settings, unified)).max().unwrap_or(0);
    memory::check_beside_driver(film::host_bytes(settings).max(filtered))
}

/// The filter's own buffers last no longer than this, but for what it expects of its errors. What ran on the host is timed by its
/// clock, and stands behind what the device did before.
fn run_filter(
    gpu: &Gpu,
    recipe: &Recipe,
    scales: &Scales,
    planes: &Planes,
    times: &mut Vec<PassTime>,
) -> Result<Option<Buffer<vec3>>> {
    let settings = (recipe.settings)(scales);
    match recipe.method {
        Method::Kernels(row) => {
            let filter = row.compile(gpu, &settings, planes.size)?;
            times.extend(run(gpu, |rec| filter.record(rec, planes))?);
            Ok(filter.expected().cloned())
        }
        Method::Oidn => {
            for (name, took) in oidn::filter(settings.oidn, planes)? {
                let begin_ns = times.last().map_or(0, |before| before.end_ns);
                times.push(PassTime { name, begin_ns, end_ns: begin_ns.saturating_add(took.as_nanos() as u64) });
            }
            Ok(None)
        }
    }
}

fn run(gpu: &Gpu, record: impl FnOnce(&mut Recorder) -> Result<()>) -> Result<Vec<PassTime>> {
    gpu.run(&mut FrameResources::new(gpu)?, record)
}

/// Reads back an image, a window at a time.
///
/// # Errors
/// [`crate::error::Error::Device`].
pub(super) fn colour(picture: &Buffer<vec4>) -> Result<Colour> {
    let mut planes = [0; 3].map(|_| Vec::with_capacity(picture.len()));
    for window in windows(picture.len()) {
        for pixel in picture.read_range(window)? {
            planes.iter_mut().zip(pixel).for_each(|(plane, v)| plane.push(v));
        }
    }
    Ok(planes)
}
