//! The test of one region, and of all regions of a scale.
use super::distribution::{largest_significant, quantile, two_sided};
use super::region::{Partition, Scale};
use super::{Estimate, Finding, Level, MIN_PIXELS, MIN_SAMPLES, Noise, Options, Outcome, WORST};
use rayon::prelude::*;

/// Standard normal quantile of 0.9: what a difference must lie beyond the limit to be found nine times in ten.
const NINE_IN_TEN: f64 = 1.281_551_6;

/// Both images, and what all regions share.
pub struct Judge<'a> {
    images: [&'a Estimate; 2],
    options: &'a Options,
    /// Means of the second image per channel, over the usable pixels.
    brightness: [f64; 3],
    usable: usize,
}

/// What is known of a region before its scale's limit is.
pub struct Judged {
    partition: Partition,
    /// Empty for pixels.
    sums: Vec<Sums>,
    /// One per region; NaN where there is too little to judge.
    p: Vec<f64>,
    /// Relative standard error, the largest of three channels, and its degrees of freedom, of the regions that are judged.
    errors: Vec<(f64, f64)>,
}

/// Sums over the pixels of a region, per channel.
#[derive(Clone, Copy, Default)]
struct Sums {
    pixels: usize,
    means: [[f64; 3]; 2],
    /// Least squared error of the sum, by what samples of unequal numbers show.
    least: [f64; 3],
    /// Squares and fourth powers of d, less its mean.
    squares: [f64; 3],
    fourths: [f64; 3],
}

/// A region's test in one channel.
struct Statistic {
    means: [f64; 2],
    /// What differences are relative to.
    unit: f64,
    error: f64,
    freedom: f64,
}

/// The test of the channel in which a region differs most surely; see [`Finding`].
struct Strongest {
    channel: usize,
    means: [f64; 2],
    difference: f64,
    error: f64,
}

/// What the samples of a pixel say of one channel.
struct PixelNoise {
    /// Squared standard error of the difference, by Welch.
    welch: f64,
    /// The same, if the samples of both images have one variance.
    pooled: f64,
    /// How unequal the numbers of samples are: 0 if they are equal, 1 if one is much larger.
    unequal: f64,
    freedom: f64,
}

impl<'a> Judge<'a> {
    /// Prepares the test of two images of one size.
    pub fn new(a: &'a Estimate, b: &'a Estimate, options: &'a Options) -> Self {
        let mut judge = Self { images: [a, b], options, brightness: [0.0; 3], usable: 0 };
        let usable: Vec<usize> = judge.usable_pixels().collect();
        let sum = |c: usize| usable.iter().map(|i| f64::from(b.mean[*i][c])).sum::<f64>();
        judge.brightness = [0, 1, 2].map(|c| sum(c) / usable.len().max(1) as f64);
        judge.usable = usable.len();
        judge
    }

    /// Number of pixels that both images have two samples of.
    pub fn usable(&self) -> usize {
        self.usable
    }

    /// Tests all regions of all scales, but none of a scale at which no region has enough pixels or samples.
    pub fn judge(&self, partitions: Vec<Partition>) -> Vec<Judged> {
        let sums = self.sums(&partitions);
        partitions.into_iter().zip(sums).filter_map(|(partition, sums)| self.judge_scale(partition, sums)).collect()
    }

    fn judge_scale(&self, partition: Partition, sums: Vec<Sums>) -> Option<Judged> {
        let tested: Vec<_> = (0..partition.regions)
            .into_par_iter()
            .map(|region| {
                if !self.has_enough(&sums, region) {
                    return (f64::NAN, (0.0, 1.0));
                }
                let tests = [0, 1, 2].map(|c| self.statistic(&sums, region, c));
                let p = tests.iter().map(|t| self.p(t)).fold(1.0, f64::min);
                let error = |t: &Statistic| (t.error / t.unit.max(f64::MIN_POSITIVE), t.freedom);
                ((3.0 * p).min(1.0), tests.iter().map(error).max_by(|x, y| x.0.total_cmp(&y.0)).unwrap_or_default())
            })
            .collect();
        let errors: Vec<_> = tested.iter().filter(|(p, _)| !p.is_nan()).map(|(_, error)| *error).collect();
        let p = tested.into_iter().map(|(p, _)| p).collect();
        (!errors.is_empty()).then_some(Judged { partition, sums, p, errors })
    }

    /// Says which regions differ, at a level that all regions of the scale share.
    pub fn level(&self, judged: Judged, share: f64) -> Level {
        let Judged { partition, sums, p, mut errors } = judged;
        let limit = largest_significant(p.iter().copied().filter(|p| !p.is_nan()).collect(), share);
        let mut different: Vec<usize> = (0..p.len()).filter(|r| limit.is_some_and(|limit| p[*r] <= limit)).collect();
        let found = |region: usize| self.finding(&partition, &sums, region, p[region]);
        let mut map = Vec::new();
        if limit.is_some() {
            let mut relative = vec![0.0; p.len()];
            different.iter().for_each(|r| relative[*r] = self.strongest(&sums, *r).difference as f32);
            let of_region = |pixel| partition.region(pixel).map_or(0.0, |r| relative[r]);
            map = (0..self.images[0].mean.len()).map(of_region).collect();
        }
        let count = different.len();
        different.sort_by(|x, y| p[*x].total_cmp(&p[*y]));
        let worst = different.into_iter().take(WORST).map(found).collect();
        let (regions, nine_tenths) = (errors.len(), (errors.len() - 1) * 9 / 10);
        let (_, &mut (error, freedom), _) = errors.select_nth_unstable_by(nine_tenths, |x, y| x.0.total_cmp(&y.0));
        let limit = quantile(share / (3 * regions) as f64, freedom);
        let visible = (limit + NINE_IN_TEN) * error + self.options.accept;
        Level { scale: partition.scale, regions, different: count, visible, worst, map }
    }

    /// The pixels that differ most surely by themselves, among those of the finest regions that differ, or of all if none does.
    pub fn suspects(&self, outcome: &Outcome) -> Vec<Finding> {
        let map = outcome.levels.iter().map(|level| &level.map).find(|map| !map.is_empty());
        let pixels = Partition::pixels(self.images[0]);
        let sure = |pixel: usize| {
            let tests = [0, 1, 2].map(|c| self.of_pixel(pixel, c));
            let deviation = |t: &Statistic| match (t.means[0] - t.means[1]).abs() {
                0.0 => 0.0,
                d => d / t.error,
            };
            tests.iter().map(deviation).fold(0.0, f64::max)
        };
        let within = |pixel: &usize| map.is_none_or(|map| map[*pixel] != 0.0) && self.is_usable(*pixel);
        let mut sorted: Vec<_> = (0..pixels.regions).filter(within).map(|pixel| (sure(pixel), pixel)).collect();
        sorted.sort_by(|x, y| y.0.total_cmp(&x.0));
        let p = |pixel| (0..3).map(|c| self.p(&self.of_pixel(pixel, c))).fold(1.0, f64::min);
        let found = |(_, pixel): (f64, usize)| self.finding(&pixels, &[], pixel, (3.0 * p(pixel)).min(1.0));
        sorted.into_iter().take(WORST).map(found).collect()
    }

    fn usable_pixels(&self) -> impl Iterator<Item = usize> {
        (0..self.images[1].mean.len()).filter(|i| self.is_usable(*i))
    }

    fn is_usable(&self, pixel: usize) -> bool {
        self.images.iter().all(|image| samples(image, pixel) >= 2.0)
    }

    fn has_enough(&self, sums: &[Sums], region: usize) -> bool {
        match sums.get(region) {
            Some(sums) => sums.pixels >= MIN_PIXELS,
            None => self.images.iter().all(|image| samples(image, region) >= MIN_SAMPLES),
        }
    }

    fn difference(&self, pixel: usize, c: usize) -> f64 {
        f64::from(self.images[0].mean[pixel][c]) - f64::from(self.images[1].mean[pixel][c])
    }

    /// Sums over the regions of each scale; none for pixels. The noise of a pixel, which takes longest, is found once for all.
    fn sums(&self, partitions: &[Partition]) -> Vec<Vec<Sums>> {
        let regions = |p: &Partition| if p.scale == Scale::Pixel { 0 } else { p.regions };
        let mut all: Vec<_> = partitions.iter().map(|p| vec![Sums::default(); regions(p)]).collect();
        for i in self.usable_pixels() {
            let least = [0, 1, 2].map(|c| self.noise(i, c)).map(|noise| noise.unequal * noise.pooled);
            for (sums, partition) in all.iter_mut().zip(partitions) {
                let Some(sums) = partition.region(i).and_then(|region| sums.get_mut(region)) else { continue };
                sums.pixels += 1;
                for (c, least) in least.iter().enumerate() {
                    (0..2).for_each(|k| sums.means[k][c] += f64::from(self.images[k].mean[i][c]));
                    sums.least[c] += least;
                }
            }
        }
        all.iter_mut().zip(partitions).for_each(|(sums, partition)| self.add_spread(partition, sums));
        all
    }

    /// Makes means of the sums of the images, and adds how far pixels are off them.
    fn add_spread(&self, partition: &Partition, sums: &mut [Sums]) {
        for sums in &mut *sums {
            let n = sums.pixels.max(1) as f64;
            sums.means.iter_mut().flatten().for_each(|mean| *mean /= n);
        }
        for i in self.usable_pixels() {
            let Some(sums) = partition.region(i).and_then(|region| sums.get_mut(region)) else { continue };
            for c in 0..3 {
                let off = self.difference(i, c) - (sums.means[0][c] - sums.means[1][c]);
                sums.squares[c] += off.powi(2);
                sums.fourths[c] += off.powi(4);
            }
        }
    }

    fn noise(&self, pixel: usize, c: usize) -> PixelNoise {
        let of = |image: &Estimate| match &image.noise {
            Noise::Samples { m2, count } => (f64::from(m2[pixel][c]), f64::from(count[pixel])),
            // Nothing tells how many samples there were: as many as it takes to be certain of the variance.
            Noise::SquaredErrors(errors) => (f64::from(errors[pixel][c]), f64::INFINITY),
        };
        let [(m2_a, n_a), (m2_b, n_b)] = self.images.map(of);
        let error2 = |m2: f64, n: f64| if n.is_infinite() { m2 } else { m2 / (n * (n - 1.0)) };
        let (a, b) = (error2(m2_a, n_a), error2(m2_b, n_b));
        let welch = a + b;
        let per_freedom = a.powi(2) / (n_a - 1.0) + b.powi(2) / (n_b - 1.0);
        let freedom = if per_freedom > 0.0 { welch.powi(2) / per_freedom } else { f64::INFINITY };
        let (pooled, unequal) = match n_a.is_infinite() || n_b.is_infinite() {
            true => (welch, 1.0),
            false => ((m2_a + m2_b) / (n_a + n_b - 2.0) * (1.0 / n_a + 1.0 / n_b), (n_a - n_b).abs() / (n_a + n_b)),
        };
        PixelNoise { welch, pooled, unequal, freedom }
    }

    fn statistic(&self, sums: &[Sums], region: usize, c: usize) -> Statistic {
        let Some(sums) = sums.get(region) else { return self.of_pixel(region, c) };
        let n = sums.pixels as f64;
        let spread = sums.squares[c] / (n * (n - 1.0));
        let freedom = match sums.fourths[c] > 0.0 {
            true => (3.0 * sums.squares[c].powi(2) / sums.fourths[c]).clamp(1.0, n - 1.0),
            false => n - 1.0,
        };
        let means = sums.means.map(|means| means[c]);
        let error = spread.max(sums.least[c] / (n * n)).sqrt();
        Statistic { means, unit: means[1].abs().max(self.brightness[c]), error, freedom }
    }

    fn of_pixel(&self, pixel: usize, c: usize) -> Statistic {
        let means = self.images.map(|image| f64::from(image.mean[pixel][c]));
        let noise = self.noise(pixel, c);
        let error = noise.welch.max(noise.pooled).sqrt();
        Statistic { means, unit: means[1].abs().max(self.brightness[c]), error, freedom: noise.freedom }
    }

    /// Probability of such a difference by chance.
    fn p(&self, test: &Statistic) -> f64 {
        let beyond = (test.means[0] - test.means[1]).abs() - self.options.accept * test.unit;
        // No level of significance is above 0.3, which is the probability of one standard error or more.
        if beyond <= test.error { 1.0 } else { two_sided(beyond / test.error, test.freedom) }
    }

    /// Finding an object's place takes a look at all pixels: only for what is reported.
    fn finding(&self, partition: &Partition, sums: &[Sums], region: usize, p: f64) -> Finding {
        let Strongest { channel, means, difference, error } = self.strongest(sums, region);
        Finding { place: partition.place(region), channel, means, difference, error, p }
    }

    fn strongest(&self, sums: &[Sums], region: usize) -> Strongest {
        let tests = [0, 1, 2].map(|c| self.statistic(sums, region, c));
        let channel = (0..3).min_by(|x, y| self.p(&tests[*x]).total_cmp(&self.p(&tests[*y]))).unwrap_or(0);
        let Statistic { means, unit, error, .. } = tests[channel];
        let relative = |v: f64| if unit > 0.0 { v / unit } else { v.signum() * f64::from(u8::from(v != 0.0)) };
        Strongest { channel, means, difference: relative(means[0] - means[1]), error: relative(error) }
    }
}

/// Number of samples of a pixel; as many as one likes where only standard errors are known.
fn samples(image: &Estimate, pixel: usize) -> f64 {
    match &image.noise {
        Noise::Samples { count, .. } => f64::from(count[pixel]),
        Noise::SquaredErrors(_) => f64::INFINITY,
    }
}
