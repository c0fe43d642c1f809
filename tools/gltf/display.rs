//! Pictures as displays show them, and how far they are from each other.
use tallow::image::Picture;

/// A picture of display values in [0, 1], multiplied by its alpha.
pub struct Shown {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Colours over black.
    pub pixels: Vec<[f32; 3]>,
    /// Share of each pixel that the model covers.
    pub alpha: Vec<f32>,
}

/// The ACES curve of three.js, by S. Hill: rows of the matrices before and after it.
const INTO: [[f32; 3]; 3] = [[0.59719, 0.35458, 0.04823], [0.076, 0.90834, 0.01566], [0.0284, 0.13383, 0.83777]];
const OUT: [[f32; 3]; 3] =
    [[1.60475, -0.53108, -0.07367], [-0.10208, 1.10813, -0.00605], [-0.00327, -0.07276, 1.07602]];

impl Shown {
    /// Radiance as the other renderers were told to show it: divided by 0.6, by the ACES curve and a gamma of 2.2.
    pub fn of(picture: &Picture) -> Self {
        let times = |m: &[[f32; 3]; 3], v: [f32; 3]| m.map(|row| row.iter().zip(v).map(|(a, b)| a * b).sum());
        let curve = |v: f32| (v * (v + 0.0245786) - 0.000090537) / (v * (0.983729 * v + 0.432951) + 0.238081);
        let show = |p: &[f32; 3]| {
            let v: [f32; 3] = times(&INTO, p.map(|v| v / 0.6));
            times(&OUT, v.map(curve)).map(|v: f32| v.clamp(0.0, 1.0).powf(1.0 / 2.2))
        };
        let pixels: Vec<_> = picture.pixels.iter().map(show).collect();
        Self { size: picture.size(), alpha: vec![1.0; pixels.len()], pixels }
    }

    /// Averages squares of so many pixels.
    pub fn smaller(&self, times: u32) -> Self {
        let [width, height] = self.size.map(|n| n / times);
        let square = |at: u32| {
            let corner = at / width * times * self.size[0] + at % width * times;
            (0..times * times).map(move |k| (corner + k / times * self.size[0] + k % times) as usize)
        };
        let share = 1.0 / (times * times) as f32;
        let add = |sum: [f32; 3], i: usize| std::array::from_fn(|c| sum[c] + share * self.pixels[i][c]);
        let pixels = (0..width * height).map(|at| square(at).fold([0.0; 3], add)).collect();
        let alpha = (0..width * height).map(|at| square(at).map(|i| share * self.alpha[i]).sum()).collect();
        Self { size: [width, height], pixels, alpha }
    }

    /// Averages `bytes` of so many channels to another size.
    pub fn shrunk(bytes: &[u8], channels: usize, from: [u32; 2], size: [u32; 2]) -> Self {
        let (mut pixels, mut alpha) = (Vec::new(), Vec::new());
        for y in 0..size[1] {
            for x in 0..size[0] {
                let (mut sum, mut covered, mut count) = ([0.0; 3], 0.0, 0.0);
                let range =
                    |at: u32, axis: usize| at * from[axis] / size[axis]..((at + 1) * from[axis]).div_ceil(size[axis]);
                for (row, column) in range(y, 1).flat_map(|row| range(x, 0).map(move |column| (row, column))) {
                    let texel = &bytes[(row * from[0] + column) as usize * channels..][..channels];
                    let a = texel.get(3).map_or(1.0, |&a| f32::from(a) / 255.0);
                    (0..3).for_each(|c| sum[c] += a * f32::from(texel[c]) / 255.0);
                    (covered, count) = (covered + a, count + 1.0);
                }
                pixels.push(sum.map(|v| v / count));
                alpha.push(covered / count);
            }
        }
        Self { size, pixels, alpha }
    }

    /// Keeps what `alpha` covers.
    pub fn cut_out(&mut self, alpha: Vec<f32>) {
        self.pixels.iter_mut().zip(&alpha).for_each(|(pixel, a)| *pixel = pixel.map(|v| v * a));
        self.alpha = alpha;
    }

    /// Root mean square difference of the values, over the pixels that the model covers whole in both pictures: infinite where
    /// there are none.
    pub fn difference(&self, other: &Self) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0);
        let whole = |i: &usize| self.alpha[*i] > WHOLE && other.alpha[*i] > WHOLE;
        for i in (0..self.pixels.len()).filter(whole) {
            let pairs = self.pixels[i].iter().zip(other.pixels[i]);
            sum += pairs.map(|(a, b)| f64::from(a - b).powi(2)).sum::<f64>() / 3.0;
            count += 1.0;
        }
        if count > 0.0 { f64::sqrt(sum / count) } else { f64::INFINITY }
    }

    /// Of the pixels that either covers at least half, the share that the other does not.
    pub fn covered_otherwise(&self, other: &Self) -> f64 {
        let (mut either, mut one) = (0.0, 0.0);
        for (a, b) in self.alpha.iter().zip(&other.alpha).map(|(a, b)| (*a >= 0.5, *b >= 0.5)) {
            either += f64::from(u8::from(a || b));
            one += f64::from(u8::from(a != b));
        }
        one / f64::max(either, 1.0)
    }
}

/// Least alpha of a pixel that shows nothing but the model.
const WHOLE: f32 = 0.995;
