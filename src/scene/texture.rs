//! Pictures to RGBA8 texels with full mip chains, decoded on all cores straight into the one texel array.
use super::mtl::find_file;
use crate::error::{Error, Result};
use crate::gpu::layout::{NONE, TEXTURE_CLAMP, TEXTURE_SRGB, Texture};
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

/// What a picture holds, which decides how it is averaged and which channels are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// sRGB colour, averaged in linear light.
    Color,
    /// Heights or normals, linear.
    Data,
    /// Opacity: the alpha channel where the file has one, else red; copied to all channels.
    Mask,
    /// Perceptual roughness: the green channel, copied to all (grey pictures have it there, and so has glTF's
    /// occlusion-roughness-metallic packing).
    Roughness,
}

/// The pictures that materials asked for, each once per kind.
#[derive(Clone, Debug, Default)]
pub struct TextureSet {
    wanted: Vec<(PathBuf, Kind, bool)>,
    index: HashMap<(PathBuf, Kind, bool), u32>,
}

/// Device arrays of all pictures.
#[derive(Debug, Default)]
pub struct Decoded {
    /// In order of request.
    pub textures: Vec<Texture>,
    /// All levels of all pictures.
    pub texels: Vec<u32>,
}

impl TextureSet {
    /// Index of the picture, or [`NONE`] with a warning when there is no such file.
    pub fn request(&mut self, dir: &Path, file: &str, kind: Kind, clamp: bool, warn: &mut Vec<String>) -> u32 {
        let Some((path, mended)) = find_file(dir, file) else {
            warn.push(format!("texture {}: no such file; its constant colour is used", dir.join(file).display()));
            return NONE;
        };
        if mended {
            warn.push(format!("texture {}: found as {}", dir.join(file).display(), path.display()));
        }
        let key = (path, kind, clamp);
        let next = self.wanted.len() as u32;
        *self.index.entry(key).or_insert_with_key(|key| {
            self.wanted.push(key.clone());
            next
        })
    }

    /// Pictures asked for so far.
    pub fn len(&self) -> usize {
        self.wanted.len()
    }

    /// Reads every picture.
    ///
    /// # Errors
    /// [`Error::Input`] with the file that is truncated, damaged, or in a form other than PNG or JPEG.
    pub fn decode(&self) -> Result<Decoded> {
        let sizes: Vec<_> = self.wanted.par_iter().map(|(path, ..)| dimensions(path)).collect::<Result<_>>()?;
        let mut textures = Vec::with_capacity(sizes.len());
        let mut total = 0u64;
        for ((path, kind, clamp), &(width, height)) in self.wanted.iter().zip(&sizes) {
            let first = u32::try_from(total).map_err(|_| too_many(path))?;
            total += levels(width, height).map(|(w, h)| u64::from(w) * u64::from(h)).sum::<u64>();
            let bits = [(*kind == Kind::Color, TEXTURE_SRGB), (*clamp, TEXTURE_CLAMP)];
            let bits: u32 = bits.iter().filter(|b| b.0).map(|b| b.1).sum();
            let flags = bits | (levels(width, height).count() as u32) << 8;
            textures.push(Texture { first, width, height, flags });
        }
        if total > u64::from(u32::MAX) {
            return Err(too_many(&self.wanted[0].0));
        }
        let mut texels = vec![0u32; total as usize];
        self.jobs(&textures, &mut texels).into_par_iter().try_for_each(|(i, t, space)| {
            let (path, kind, _) = &self.wanted[i];
            load(path, *kind, t, space)
        })?;
        Ok(Decoded { textures, texels })
    }

    /// Each picture with its own part of the texel array.
    fn jobs<'a>(&self, textures: &[Texture], mut texels: &'a mut [u32]) -> Vec<(usize, Texture, &'a mut [u32])> {
        let mut jobs = Vec::with_capacity(textures.len());
        for (i, t) in textures.iter().enumerate() {
            let size = levels(t.width, t.height).map(|(w, h)| w as usize * h as usize).sum();
            let (own, rest) = texels.split_at_mut(size);
            jobs.push((i, *t, own));
            texels = rest;
        }
        jobs
    }
}

fn too_many(path: &Path) -> Error {
    Error::input(path, "the textures of this scene have more than 2^32 texels together: reduce them")
}

/// Sizes from the full picture to one texel.
fn levels(width: u32, height: u32) -> impl Iterator<Item = (u32, u32)> {
    let count = 32 - width.max(height).leading_zeros();
    (0..count).map(move |l| ((width >> l).max(1), (height >> l).max(1)))
}

fn reader(path: &Path) -> Result<image::ImageReader<std::io::BufReader<std::fs::File>>> {
    let open = image::ImageReader::open(path).map_err(|e| Error::input(path, format!("cannot be read: {e}")))?;
    open.with_guessed_format().map_err(|e| Error::input(path, format!("cannot be read: {e}")))
}

fn damaged(path: &Path, error: image::ImageError) -> Error {
    let remedy = "save it again as PNG or JPEG";
    Error::input(path, format!("is no usable picture ({}): {remedy}", error.to_string().replace('\n', " ")))
}

fn dimensions(path: &Path) -> Result<(u32, u32)> {
    match reader(path)?.into_dimensions().map_err(|e| damaged(path, e))? {
        (w, h) if (1..=1 << 16).contains(&w) && (1..=1 << 16).contains(&h) => Ok((w, h)),
        (w, h) => Err(Error::input(path, format!("is {w} x {h} texels: 1 to 65536 each way can be used"))),
    }
}

/// Decodes one picture and averages it down, into `space`.
fn load(path: &Path, kind: Kind, t: Texture, space: &mut [u32]) -> Result<()> {
    let picture = reader(path)?.decode().map_err(|e| damaged(path, e))?;
    let has_alpha = picture.color().has_alpha();
    if (picture.width(), picture.height()) != (t.width, t.height) {
        return Err(Error::input(path, "has another size than its header says: save it again"));
    }
    let rgba = picture.into_rgba8();
    let same = |v: u8| u32::from_le_bytes([v; 4]);
    for (texel, p) in space.iter_mut().zip(rgba.pixels()) {
        *texel = match kind {
            Kind::Color | Kind::Data => u32::from_le_bytes(p.0),
            Kind::Mask => same(if has_alpha { p.0[3] } else { p.0[0] }),
            Kind::Roughness => same(p.0[1]),
        };
    }
    drop(rgba);
    shrink(t.width, t.height, kind == Kind::Color, space);
    Ok(())
}

/// Fills every level from the one above it: the mean of 2 x 2 texels, of 3 where an odd edge would lose one.
fn shrink(width: u32, height: u32, srgb: bool, mut space: &mut [u32]) {
    let sizes: Vec<_> = levels(width, height).collect();
    for pair in sizes.windows(2) {
        let (above, rest) = space.split_at_mut(pair[0].0 as usize * pair[0].1 as usize);
        halve(above, pair[0], rest, pair[1], srgb);
        space = rest;
    }
}

fn halve(above: &[u32], (w, h): (u32, u32), below: &mut [u32], (bw, bh): (u32, u32), srgb: bool) {
    let even = w == 2 * bw && h == 2 * bh;
    for (y, out) in below[..(bw * bh) as usize].chunks_exact_mut(bw as usize).enumerate() {
        let rows = span(y as u32, bh, h);
        if even {
            let (upper, lower) = above[(rows.start * w) as usize..].split_at(w as usize);
            let pairs = upper.chunks_exact(2).zip(lower.chunks_exact(2));
            out.iter_mut().zip(pairs).for_each(|(o, (a, b))| *o = average([a[0], a[1], b[0], b[1]], srgb));
        } else {
            let cell =
                |x: u32| rows.clone().flat_map(move |r| span(x, bw, w).map(move |c| above[(r * w + c) as usize]));
            (0..bw).for_each(|x| out[x as usize] = average_any(cell(x), srgb));
        }
    }
}

/// Mean of four texels: the usual case, without division.
fn average(texels: [u32; 4], srgb: bool) -> u32 {
    let bytes = texels.map(u32::to_le_bytes);
    let data = |c: usize| ((bytes.iter().map(|b| u32::from(b[c])).sum::<u32>() + 2) >> 2) as u8;
    let light = |c: usize| bytes.iter().map(|b| u32::from(CURVES.linear[b[c] as usize])).sum::<u32>();
    let color = |c: usize| CURVES.srgb[((light(c) + 2) >> 2) as usize];
    u32::from_le_bytes(match srgb {
        true => [color(0), color(1), color(2), data(3)],
        false => [data(0), data(1), data(2), data(3)],
    })
}

/// Mean of any number of texels (at most nine: an odd edge's).
fn average_any(texels: impl Iterator<Item = u32>, srgb: bool) -> u32 {
    let (mut sum, mut count) = ([0u32; 4], 0);
    for texel in texels {
        let bytes = texel.to_le_bytes();
        for c in 0..4 {
            sum[c] += if srgb && c < 3 { CURVES.linear[bytes[c] as usize].into() } else { u32::from(bytes[c]) };
        }
        count += 1;
    }
    let mean = sum.map(|s| (s + count / 2) / count);
    let byte = |c: usize| if srgb && c < 3 { CURVES.srgb[mean[c] as usize] } else { mean[c] as u8 };
    u32::from_le_bytes([byte(0), byte(1), byte(2), byte(3)])
}

/// Texels of the level above that texel `i` of `count` covers.
fn span(i: u32, count: u32, above: u32) -> std::ops::Range<u32> {
    2 * i..if i + 1 == count { above } else { 2 * i + 2 }
}

struct Curves {
    linear: [u16; 256],
    srgb: Vec<u8>,
}

/// The sRGB curve (IEC 61966-2-1) between bytes and 16-bit linear light, both ways.
static CURVES: LazyLock<Curves> = LazyLock::new(|| {
    let linear = std::array::from_fn(|v| (decode_srgb(v as f64 / 255.0) * 65535.0).round() as u16);
    let encode = |l: f64| if l <= 0.003_130_8 { 12.92 * l } else { 1.055 * l.powf(1.0 / 2.4) - 0.055 };
    let srgb = (0..65536).map(|l| (encode(f64::from(l) / 65535.0) * 255.0).round() as u8).collect();
    Curves { linear, srgb }
});

fn decode_srgb(v: f64) -> f64 {
    if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
}

/// Mean linear colour of a colour picture.
pub fn mean(texture: &Texture, texels: &[u32]) -> [f32; 3] {
    let count = texture.width as usize * texture.height as usize;
    let mut sum = [0u64; 3];
    for texel in &texels[texture.first as usize..][..count] {
        let bytes = texel.to_le_bytes();
        (0..3).for_each(|c| sum[c] += u64::from(CURVES.linear[bytes[c] as usize]));
    }
    sum.map(|s| (s as f64 / (count as f64 * 65535.0)) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn decode(bytes: &[u8], name: &str, kind: Kind) -> Result<Decoded> {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join(name), bytes).unwrap();
        let (mut set, mut warnings) = (TextureSet::default(), Vec::new());
        let index = set.request(dir.path(), name, kind, false, &mut warnings);
        assert_eq!((index, warnings.len()), (0, 0));
        assert_eq!(set.request(dir.path(), name, kind, false, &mut warnings), 0, "each picture once");
        set.decode()
    }

    fn png(width: u32, height: u32, pixels: &[u8]) -> Vec<u8> {
        let mut bytes = std::io::Cursor::new(Vec::new());
        let picture = image::RgbImage::from_raw(width, height, pixels.to_vec()).unwrap();
        picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    }

    #[test]
    fn colours_are_averaged_in_linear_light() {
        let black_white = png(2, 1, &[0, 0, 0, 255, 255, 255]);
        let color = decode(&black_white, "a.png", Kind::Color).unwrap();
        assert_eq!((color.textures[0].flags >> 8, color.texels.len()), (2, 3));
        // Half of full light is sRGB 188, not 128.
        assert_eq!(color.texels, [0xff000000, 0xffffffff, u32::from_le_bytes([188, 188, 188, 255])]);
        let data = decode(&black_white, "a.png", Kind::Data).unwrap();
        assert_eq!(data.texels[2].to_le_bytes(), [128, 128, 128, 255]);
        let light = mean(&color.textures[0], &color.texels);
        assert!((light[0] - 0.5).abs() < 1e-5);
    }

    #[test]
    fn odd_sizes_keep_the_mean() {
        let pixels: Vec<u8> = (0..15).flat_map(|i| [i * 17; 3]).collect();
        let found = decode(&png(5, 3, &pixels), "a.png", Kind::Data).unwrap();
        assert_eq!(found.texels.len(), 15 + 2 + 1);
        // Column blocks 0-1 and 2-4, all three rows.
        let block = |columns: std::ops::Range<usize>| {
            let all: Vec<_> = (0..3).flat_map(|r| columns.clone().map(move |c| r * 5 + c)).collect();
            (all.iter().sum::<usize>() as f32 * 17.0 / all.len() as f32).round() as u8
        };
        assert_eq!(found.texels[15].to_le_bytes()[0], block(0..2));
        assert_eq!(found.texels[16].to_le_bytes()[0], block(2..5));
    }

    #[test]
    fn channels_are_picked_by_kind() {
        let found = decode(&png(1, 1, &[10, 20, 30]), "a.png", Kind::Roughness).unwrap();
        assert_eq!(found.texels[0].to_le_bytes(), [20; 4]);
        let found = decode(&png(1, 1, &[10, 20, 30]), "a.png", Kind::Mask).unwrap();
        assert_eq!(found.texels[0].to_le_bytes(), [10; 4]);
    }

    #[test]
    fn damage_is_an_error_with_the_file() {
        let whole = png(40, 40, &[7; 4800]);
        for bytes in [&whole[..whole.len() / 2], &whole[..20], b"not a picture"] {
            let error = decode(bytes, "a.png", Kind::Color).unwrap_err().to_string();
            assert!(error.contains("a.png: is no usable picture") && !error.contains('\n'), "{error}");
        }
        assert!(decode(&whole, "a.png", Kind::Color).is_ok(), "control");
    }

    #[test]
    fn a_missing_file_is_a_warning_and_case_is_mended() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir(dir.path().join("Tex")).unwrap();
        std::fs::write(dir.path().join("Tex/Wood.PNG"), png(1, 1, &[1, 2, 3])).unwrap();
        let (mut set, mut warnings) = (TextureSet::default(), Vec::new());
        assert_eq!(set.request(dir.path(), "no.png", Kind::Color, false, &mut warnings), NONE);
        for name in ["tex/wood.png", "C:/elsewhere/../Tex/wood.png"] {
            assert_eq!(
                set.request(dir.path(), name, Kind::Color, false, &mut warnings),
                if name.starts_with('C') { NONE } else { 0 }
            );
        }
        assert!(warnings[0].contains("no such file") && warnings[1].contains("found as"));
    }
}
