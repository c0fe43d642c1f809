//! What a file says of an image's expectation: means, and how far they may be off.
use crate::error::Checked;
use crate::image::aov::{Aovs, Names};
use crate::image::{FILTERED, Film, Picture};

/// How far the mean of a pixel may be from its expectation.
#[derive(Clone, Debug, PartialEq)]
pub enum Noise {
    /// What the samples show.
    Samples {
        /// Sums of squared deviations from the mean.
        m2: Vec<[f32; 3]>,
        /// Numbers of samples.
        count: Vec<f32>,
    },
    /// Squared standard errors, where the number of samples is not known.
    SquaredErrors(Vec<[f32; 3]>),
}

/// An image with its noise.
#[derive(Clone, Debug, PartialEq)]
pub struct Estimate {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Means per pixel and channel, row-major.
    pub mean: Vec<[f32; 3]>,
    /// How far they may be off.
    pub noise: Noise,
    /// The object that each pixel shows, if the file says.
    pub objects: Option<Vec<u32>>,
}

impl Estimate {
    /// Checks that there is a value for every pixel, and that means are numbers, variances and counts numbers from 0 on.
    ///
    /// # Errors
    /// What is missing.
    pub fn check(&self) -> Checked {
        let pixels = self.width as usize * self.height as usize;
        let objects = self.objects.as_ref().map_or(pixels, Vec::len);
        let (squares, counts) = match &self.noise {
            Noise::Samples { m2, count } => (m2, count.len()),
            Noise::SquaredErrors(squares) => (squares, pixels),
        };
        let lengths = [self.mean.len(), squares.len(), counts, objects];
        if pixels == 0 || lengths.iter().any(|&length| length != pixels) {
            return Err(format!("{pixels} pixels, but {lengths:?} means, variances, counts and objects"));
        }
        let is_broken = |m: &[f32; 3]| !m.iter().all(|v| v.is_finite());
        if let Some(first) = self.mean.iter().position(is_broken) {
            let (broken, all) = (self.mean.iter().filter(|m| is_broken(m)).count(), self.mean.len());
            let [x, y] = [first as u32 % self.width, first as u32 / self.width];
            return Err(format!(
                "{broken} of {all} pixels are NaN or infinite, the first ({x}, {y}): render the image anew"
            ));
        }
        let positive = |v: &f32| v.is_finite() && *v >= 0.0;
        let counted = match &self.noise {
            Noise::Samples { count, .. } => count.iter().all(positive),
            Noise::SquaredErrors(_) => true,
        };
        match counted && squares.iter().flatten().all(positive) {
            true => Ok(()),
            false => {
                Err("its variances or counts are negative, NaN or infinite: take the file as it was rendered"
                    .to_owned())
            }
        }
    }

    /// Takes the means, the noise and the objects of a film. Of a filtered film the noisy image is taken.
    ///
    /// # Errors
    /// When the film has no noise, or is filtered and has only the filtered colour, or a value is not finite.
    pub fn of_film(film: &Film) -> Checked<Self> {
        let mean = mean(film)?;
        let aovs = Aovs::find(film, &Names::new())?;
        let pixels = 0..film.pixels();
        // Where the file has no such layer its head may tell: how noisy the variances themselves are depends on it.
        // Pixels that a file of a part of the picture does not hold have none.
        let held = |i: usize| if aovs.holds(i) { aovs.samples(i) } else { Some(0.0) };
        let count = pixels.clone().map(held).collect::<Option<Vec<_>>>();
        let is_part = !pixels.clone().all(|i| aovs.holds(i));
        let variance = pixels.clone().map(|i| aovs.variance(i)).collect::<Option<Vec<_>>>();
        let m2 = film.picture(Some("m2")).ok().filter(|_| aovs.is_tallow_s()).map(|m2| m2.pixels);
        let noise = match (m2, count, variance) {
            (Some(m2), Some(count), _) => Noise::Samples { m2, count },
            (None, Some(count), Some(variance)) => Noise::Samples { m2: m2_of(&variance, &count), count },
            (_, None, Some(_)) if is_part => {
                return Err(
                    "holds a part of its picture, and not how many samples its pixels have: compare whole pictures"
                        .to_owned(),
                );
            }
            (_, None, Some(variance)) => Noise::SquaredErrors(variance),
            (_, _, None) => return Err(without_noise(film)),
        };
        let objects = film.words("id").filter(|_| aovs.is_tallow_s()).map(<[u32]>::to_vec);
        Self { width: film.width, height: film.height, mean, noise, objects }.checked()
    }

    /// Makes a film's colour an estimate with standard errors that another image holds.
    ///
    /// # Errors
    /// When sizes differ, or a value is not finite or a standard error negative.
    pub fn with_errors(film: &Film, errors: &Picture) -> Checked<Self> {
        if film.size() != errors.size() {
            return Err(format!("the standard errors are {}x{}, its image is not", errors.width, errors.height));
        }
        if errors.pixels.iter().flatten().any(|e| *e < 0.0) {
            return Err("standard errors are negative: take those of its image, not differences".to_owned());
        }
        let noise = Noise::SquaredErrors(errors.pixels.iter().map(|e| e.map(|e| e * e)).collect());
        Self { width: film.width, height: film.height, mean: mean(film)?, noise, objects: None }.checked()
    }

    fn checked(self) -> Checked<Self> {
        self.check()?;
        match &self.noise {
            Noise::Samples { count, .. } if count.iter().all(|n| *n < 2.0) => Err(
                "no pixel has two samples, so that nothing tells its noise: render it with --spp 2 or more, 16 to judge \
                 pixels by themselves"
                    .to_owned(),
            ),
            _ => Ok(self),
        }
    }
}

/// The colour, or what it was before it was filtered.
fn mean(film: &Film) -> Checked<Vec<[f32; 3]>> {
    let noisy = film.picture(Some(crate::image::NOISY));
    if let (Err(_), Some(filter)) = (&noisy, film.metadata.get(FILTERED)) {
        return Err(format!(
            "was filtered ({filter}), and the mean of its samples is gone: take the file before that, since a filter's bias is \
             no noise"
        ));
    }
    noisy.or_else(|_| film.picture(None)).map(|picture| picture.pixels)
}

fn without_noise(film: &Film) -> String {
    let names: Vec<_> = film.channels.iter().map(|c| c.name.as_str()).collect();
    format!(
        "does not say how noisy it is (layers m2 and samples, or variance; it has {}): take an .exr that tallow render or merge \
         wrote, or name a file of standard errors for B with --errors",
        names.join(", ")
    )
}

/// The variance of a mean is m2 / (n (n - 1)).
fn m2_of(variance: &[[f32; 3]], count: &[f32]) -> Vec<[f32; 3]> {
    variance.iter().zip(count).map(|(v, n)| v.map(|v| v * n * (n - 1.0).max(0.0))).collect()
}
