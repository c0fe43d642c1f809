//! Decodes pictures to texels of 32 bits, on all cores and straight into the one texel array.
mod normals;
mod source;

use super::find::find_file;
use super::mapping::Mapping;
use crate::error::{Checked, Error, Result};
use crate::image::{NO_IMAGE, contained, input, is_unread};
use crate::layout::{NONE, TEXTURE_FLOAT, TEXTURE_RGB9E5, TEXTURE_SRGB, Texture};
use crate::math::rgb9e5;
use crate::math::srgb::linear_from_srgb_f64;
use crate::memory;
use crate::scene::description::mesh::{Bitmap, PictureFile};
use rayon::prelude::*;
use source::Source;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Contents of a picture, which decide how it is decoded and which channels are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Kind {
    /// Colour in [0, 1], stored with the sRGB curve unless as floats.
    Color,
    /// Emitted light, as colour but without a limit of floats.
    Light,
    /// Linear numbers in [0, 1], such as normals.
    Data,
    /// Heights: the red channel, of floats without limits.
    Height,
    /// Opacity: the alpha channel where the file has one and says something, else red; copied to all channels.
    Mask,
    /// Opacity: the alpha channel where the file has one, else 1; copied to all channels.
    Alpha,
    /// A factor: the red channel, copied to all.
    Red,
    /// Perceptual roughness: the green channel, copied to all (grey pictures have it there, and so has glTF's
    /// occlusion-roughness-metallic packing).
    Roughness,
}

impl Kind {
    /// Whether it is one number, which 16 bits of a file are kept of. Three of them in one word would be cut to 9 bits at most,
    /// and where a normal points out of the surface to 8, as bytes are.
    fn is_number(self) -> bool {
        matches!(self, Self::Height | Self::Mask | Self::Alpha | Self::Red | Self::Roughness)
    }

    /// The TEXTURE_ bits of a picture of bytes.
    fn of_bytes(self) -> u32 {
        if matches!(self, Self::Color | Self::Light) { TEXTURE_SRGB } else { 0 }
    }

    /// The TEXTURE_ bits of a picture of floats.
    fn of_floats(self) -> u32 {
        if self.is_number() { TEXTURE_FLOAT } else { TEXTURE_RGB9E5 }
    }

    /// Whether a picture of floats may have these numbers. What 8 bits would not show is no reason for a warning.
    fn takes(self, rgb: [f32; 3], alpha: Option<f32>) -> bool {
        let unit = |v: f32| (-1.0 / 255.0..=1.0 + 1.0 / 255.0).contains(&v);
        match self {
            Self::Color | Self::Data => rgb.iter().all(|v| unit(*v)),
            // What is too bright is told apart.
            Self::Light => rgb.iter().all(|v| *v >= 0.0),
            Self::Height => rgb[0].is_finite(),
            Self::Mask => unit(alpha.unwrap_or(rgb[0])),
            Self::Alpha => unit(alpha.unwrap_or(1.0)),
            Self::Red => unit(rgb[0]),
            Self::Roughness => unit(rgb[1]),
        }
    }

    /// What becomes of numbers that it may not have.
    fn remedy(self) -> &'static str {
        match self {
            Self::Light => "are negative or NaN: set to 0",
            Self::Height => "are NaN or infinite: set to 0",
            _ => "lie outside [0, 1] or are NaN: clamped",
        }
    }

    /// The texel of a picture of floats.
    fn word(self, [r, g, b]: [f32; 3], alpha: Option<f32>) -> u32 {
        let unit = |v: f32| if v.is_nan() { 0.0 } else { v.clamp(0.0, 1.0) };
        let one = |v: f32| unit(v).to_bits();
        match self {
            Self::Color | Self::Data => rgb9e5::pack([r, g, b].map(unit)),
            Self::Light => rgb9e5::pack([r, g, b]),
            Self::Height => (if r.is_finite() { r } else { 0.0 }).to_bits(),
            Self::Mask => one(alpha.unwrap_or(r)),
            Self::Alpha => one(alpha.unwrap_or(1.0)),
            Self::Red => one(r),
            Self::Roughness => one(g),
        }
    }
}

/// The pictures that materials name. Each is stored once per kind, however many mappings share it.
#[derive(Clone, Debug, Default)]
pub struct TextureSet {
    in_memory: HashMap<PathBuf, InMemory>,
    pictures: Vec<(PathBuf, Kind)>,
    /// Index of each kind of each picture, by its canonical path.
    known: HashMap<(PathBuf, Kind), usize>,
    /// Index of the picture and how it is mapped.
    wanted: Vec<(usize, Mapping)>,
    index: HashMap<(PathBuf, Kind, [u32; 7]), u32>,
    /// Whether pictures that were asked about are normal maps.
    normals: HashMap<PathBuf, bool>,
}

/// A picture that is no file.
#[derive(Clone, Debug)]
enum InMemory {
    Bitmap(Bitmap),
    /// The bytes of a file.
    Encoded(Arc<[u8]>),
}

/// Device arrays of all pictures.
#[derive(Debug, Default)]
pub struct Decoded {
    /// The pictures, as a texture that shows each with nothing else said.
    pictures: Vec<Texture>,
    /// Records of the pictures, in order of request.
    pub textures: Vec<Texture>,
    /// Texels of all pictures, in the forms that the records' flags say.
    pub texels: Vec<u32>,
    /// Of each picture, how many texels have numbers that its kind may not have.
    odd: Vec<usize>,
}

impl TextureSet {
    /// Offers a picture in memory under its name.
    ///
    /// # Errors
    /// A sentence that says what is wrong with it.
    pub fn add_bitmap(&mut self, bitmap: &Bitmap) -> Checked {
        let &Bitmap { width, height, ref rgba, .. } = bitmap;
        check_size(width, height)?;
        if rgba.len() != width as usize * height as usize {
            return Err(format!("has {} texels for {width} x {height}", rgba.len()));
        }
        self.offer(&bitmap.name, InMemory::Bitmap(bitmap.clone()))
    }

    /// Offers an encoded picture in memory under its name.
    ///
    /// # Errors
    /// Where the name is taken. What is wrong with the picture is told when it is decoded.
    pub fn add_file(&mut self, file: &PictureFile) -> Checked {
        self.offer(&file.name, InMemory::Encoded(file.bytes.clone()))
    }

    fn offer(&mut self, name: &Path, picture: InMemory) -> Checked {
        let name = name.to_string_lossy().replace('\\', "/"); // as materials ask for it
        match self.in_memory.insert(name.into(), picture) {
            Some(_) => Err("is there twice: rename one".to_owned()),
            None => Ok(()),
        }
    }

    /// Index of the picture, or [`NONE`] with a warning when there is no such file, or one of a format that is not read.
    pub fn request(&mut self, dir: &Path, file: &str, kind: Kind, mapping: Mapping, warn: &mut Vec<String>) -> u32 {
        let in_memory = self.in_memory.contains_key(Path::new(file)).then(|| (file.into(), false));
        let Some((path, mended)) = in_memory.or_else(|| find_file(dir, file)) else {
            let path = dir.join(file);
            let why = if path.is_dir() { "is a folder" } else { "no such file" };
            warn.push(format!("texture {}: {why}; its constant colour is used", path.display()));
            return NONE;
        };
        if mended {
            warn.push(format!("texture {}: found as {}", dir.join(file).display(), path.display()));
        }
        if self.is_of_another_format(&path) {
            let what = format!("{NO_IMAGE}; its constant colour is used: save it as PNG");
            warn.push(format!("texture {}: {what}", path.display()));
            return NONE;
        }
        let (next, pictures) = (self.wanted.len() as u32, &mut self.pictures);
        *self.index.entry((path, kind, mapping.bits())).or_insert_with_key(|(path, ..)| {
            let known = path.canonicalize().unwrap_or_else(|_| path.clone());
            let picture = *self.known.entry((known, kind)).or_insert_with(|| {
                pictures.push((path.clone(), kind));
                pictures.len() - 1
            });
            self.wanted.push((picture, mapping));
            next
        })
    }

    /// Whether the colours of a picture are those of a normal map in tangent space. False for what cannot be read, which is
    /// reported when all are decoded.
    pub fn holds_normals(&mut self, dir: &Path, file: &str) -> bool {
        let in_memory = self.in_memory.contains_key(Path::new(file)).then(|| file.into());
        let Some(path) = in_memory.or_else(|| find_file(dir, file).map(|(path, _)| path)) else { return false };
        if let Some(&known) = self.normals.get(&path) {
            return known;
        }
        let found = self.source(&path).is_ok_and(|source| contained(|| normals::are_in(source)).unwrap_or(false));
        self.normals.insert(path, found);
        found
    }

    /// Whether a texture is read at the second set of coordinates.
    pub fn any_second(&self) -> bool {
        self.wanted.iter().any(|(_, mapping)| mapping.second)
    }

    /// The files among the pictures, each once or more.
    pub fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.pictures.iter().map(|(path, _)| path).filter(|path| !self.in_memory.contains_key(*path))
    }

    /// Whether no texture is there so far.
    pub fn is_empty(&self) -> bool {
        self.wanted.is_empty()
    }

    /// Reads every picture.
    ///
    /// # Errors
    /// [`Error::Input`] with the file that is truncated, damaged, or of a kind that is not read.
    pub fn decode(&self) -> Result<Decoded> {
        self.decode_after(Decoded::default())
    }

    /// As [`Self::decode`], but keeps what was decoded when fewer had been requested.
    ///
    /// # Errors
    /// As [`Self::decode`].
    pub fn decode_after(&self, Decoded { mut pictures, mut texels, mut odd, .. }: Decoded) -> Result<Decoded> {
        let (before, requested) = (texels.len(), &self.pictures[pictures.len()..]);
        let sources: Vec<_> = requested.par_iter().map(|(path, _)| self.source(path)).collect::<Result<_>>()?;
        let mut total = before as u64;
        for (source, (path, kind)) in sources.iter().zip(requested) {
            let ([width, height], flags) = (source.size(), source.form(*kind));
            let first = u32::try_from(total).map_err(|_| too_many(path))?;
            pictures.push(Texture { first, width, height, flags, ..Default::default() });
            total += u64::from(width) * u64::from(height);
        }
        if total > u64::from(u32::MAX) {
            return Err(too_many(&self.pictures[0].0));
        }
        let texture = |&(picture, mapping): &(usize, Mapping)| {
            let (picture, Mapping { scale, shear, offset, .. }) = (pictures[picture], mapping);
            Texture { flags: picture.flags | mapping.flags(), scale, shear, offset, ..picture }
        };
        let textures = self.wanted.iter().map(texture).collect();
        let more = total as usize - before;
        memory::need(format!("textures of {total} texels"), 4 * more as u64 + while_decoded(&sources))?;
        memory::reserve("textures", &mut texels, more)?;
        texels.resize(total as usize, 0u32);
        let decoded = jobs(sources, &mut texels[before..]).into_par_iter().zip(requested);
        let decoded = decoded.map(|((source, space), (path, kind))| {
            contained(|| source.decode(*kind, space)).map_err(|what| damaged(path, what))
        });
        odd.extend(decoded.collect::<Result<Vec<usize>>>()?);
        Ok(Decoded { pictures, textures, texels, odd })
    }

    /// A warning for every picture of floats with numbers that its kind may not have, and for every one of emission with colours that the
    /// form of its texels cannot hold.
    pub fn clipped(&self, decoded: &Decoded) -> Vec<String> {
        let mut odd: Vec<(&Path, &str, usize)> = Vec::new();
        for ((path, kind), &count) in self.pictures.iter().zip(&decoded.odd).filter(|(_, count)| **count > 0) {
            // A picture of several kinds is told once for all of which the same becomes.
            match odd.iter_mut().find(|(other, remedy, _)| other == path && *remedy == kind.remedy()) {
                Some((.., most)) => *most = count.max(*most),
                None => odd.push((path, kind.remedy(), count)),
            }
        }
        let odd = odd.into_iter().map(|(path, remedy, count)| {
            let texels = if count == 1 { "texel" } else { "texels" };
            format!("texture {}: numbers of {count} {texels} {remedy}", path.display())
        });
        let lamps = self.pictures.iter().zip(&decoded.pictures);
        let lamps = lamps.filter(|((_, kind), t)| *kind == Kind::Light && t.flags & TEXTURE_RGB9E5 != 0);
        let warning = |((path, _), texture): (&(PathBuf, Kind), &Texture)| {
            let clipped = own_texels(texture, &decoded.texels).iter().filter(|word| rgb9e5::is_largest(**word)).count();
            let place = path.display();
            (clipped > 0).then(|| {
                format!(
                    "texture {place}: clamped to {:e}, the brightest that a picture of emission holds, in {clipped} texels: \
                     scale the picture down, and its emission up",
                    rgb9e5::LARGEST
                )
            })
        };
        odd.chain(lamps.filter_map(warning)).collect()
    }

    fn source(&self, path: &Path) -> Result<Source<'_>> {
        match self.in_memory.get(path) {
            Some(InMemory::Bitmap(bitmap)) => Ok(Source::Bitmap(bitmap.clone())),
            Some(InMemory::Encoded(bytes)) => Source::of(bytes[..].into(), path),
            None => Source::of(input::read(path)?.into(), path),
        }
    }

    fn is_of_another_format(&self, path: &Path) -> bool {
        match self.in_memory.get(path) {
            Some(InMemory::Bitmap(_)) => false,
            Some(InMemory::Encoded(bytes)) => is_unread(bytes),
            None => input::is_of_another_format(path),
        }
    }
}

/// Bytes that the largest pictures take while each thread decodes one: as decoded (at most 8 per texel) and as texels.
fn while_decoded(sources: &[Source<'_>]) -> u64 {
    let sizes = sources.iter().map(Source::size);
    let mut texels: Vec<_> = sizes.map(|[width, height]| u64::from(width) * u64::from(height)).collect();
    texels.sort_unstable_by(|a, b| b.cmp(a));
    12 * texels.iter().take(rayon::current_num_threads()).sum::<u64>()
}

/// Each picture with its own part of the texel array.
fn jobs<'a, 'b>(sources: Vec<Source<'a>>, mut texels: &'b mut [u32]) -> Vec<(Source<'a>, &'b mut [u32])> {
    let mut jobs = Vec::with_capacity(sources.len());
    for source in sources {
        let [width, height] = source.size();
        let (own, rest) = texels.split_at_mut(width as usize * height as usize);
        jobs.push((source, own));
        texels = rest;
    }
    jobs
}

fn too_many(path: &Path) -> Error {
    Error::input(path, "the textures of this scene have more than 2^32 texels together: reduce them")
}

fn damaged(path: &Path, what: String) -> Error {
    Error::input(path, format!("is no usable picture ({what}): save it again as PNG, JPEG or EXR"))
}

fn check_size(width: u32, height: u32) -> Checked {
    match [width, height].iter().all(|n| (1..=1 << 16).contains(n)) {
        true => Ok(()),
        false => Err(format!("is {width} x {height} texels: 1 to 65536 each way can be used")),
    }
}

/// What tells the mean of one picture from that of others.
pub fn mean_key(texture: &Texture) -> (u32, u32) {
    (texture.first, texture.flags & (TEXTURE_SRGB | TEXTURE_RGB9E5 | TEXTURE_FLOAT))
}

/// Mean linear colour of a picture.
pub fn mean(texture: &Texture, texels: &[u32]) -> [f32; 3] {
    mean_of(&linear(texture), own_texels(texture, texels).iter().copied())
}

/// A picture in which every texel is the mean of those that it stands for: with `width` and `height` texels, which are fewer.
pub fn reduced(texture: &Texture, texels: &[u32], width: u32, height: u32) -> Vec<u32> {
    let (own, linear) = (own_texels(texture, texels), linear(texture));
    let edge = |i: u32, to: u32, from: u32| (u64::from(i) * u64::from(from) / u64::from(to)) as usize;
    let range = |i: u32, to: u32, from: u32| edge(i, to, from)..edge(i + 1, to, from);
    let texel = |i: u32| {
        let (columns, rows) = (range(i % width, width, texture.width), range(i / width, height, texture.height));
        let words = rows.flat_map(|row| &own[row * texture.width as usize..][columns.clone()]);
        rgb9e5::pack(mean_of(&linear, words.copied()))
    };
    (0..width * height).into_par_iter().map(texel).collect()
}

fn own_texels<'t>(texture: &Texture, texels: &'t [u32]) -> &'t [u32] {
    &texels[texture.first as usize..][..texture.width as usize * texture.height as usize]
}

fn mean_of(linear: &impl Fn(u32) -> [f64; 3], words: impl Iterator<Item = u32>) -> [f32; 3] {
    let (mut sum, mut count) = ([0.0; 3], 0.0);
    for word in words {
        let rgb = linear(word);
        (0..3).for_each(|c| sum[c] += rgb[c]);
        count += 1.0;
    }
    sum.map(|s| (s / count) as f32)
}

/// What tells the linear colour of a word of a picture.
fn linear(texture: &Texture) -> impl Fn(u32) -> [f64; 3] + Sync {
    let has = |bit: u32| texture.flags & bit != 0;
    let [floats, shared, srgb] = [TEXTURE_FLOAT, TEXTURE_RGB9E5, TEXTURE_SRGB].map(has);
    let curve: [f64; 256] = std::array::from_fn(|byte| {
        let code = byte as f64 / 255.0;
        if srgb { linear_from_srgb_f64(code) } else { code }
    });
    move |word| match word.to_le_bytes() {
        _ if floats => [f64::from(f32::from_bits(word)); 3],
        _ if shared => rgb9e5::unpack(word).map(f64::from),
        [r, g, b, _] => [r, g, b].map(|byte| curve[byte as usize]),
    }
}

#[cfg(test)]
mod tests;
