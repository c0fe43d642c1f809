//! Pictures that are still to be decoded, and how their texels are filled.
use super::{Kind, check_size, damaged};
use crate::error::{Checked, Error, Result};
use crate::image::{BAND, bands, check_end, claim, decode, has_16_bits, holds_floats, picture};
use crate::layout::TEXTURE_FLOAT;
use crate::scene::description::mesh::Bitmap;
use image::DynamicImage;
use std::borrow::Cow;
use std::path::Path;

/// A picture to be decoded.
pub enum Source<'a> {
    /// The bytes of a file, and the size that its header says.
    File(Cow<'a, [u8]>, [u32; 2]),
    /// The same of a PNG of 16 bits a channel.
    Deep(Cow<'a, [u8]>, [u32; 2]),
    /// The same of an EXR or HDR file.
    Floats(Cow<'a, [u8]>, [u32; 2]),
    Bitmap(Bitmap),
}

impl<'a> Source<'a> {
    /// Checks what the header of a file says.
    ///
    /// # Errors
    /// [`Error::Input`] for what is no picture of a usable size.
    pub fn of(bytes: Cow<'a, [u8]>, path: &Path) -> Result<Self> {
        check_end(&bytes).map_err(|what| Error::input(path, what))?;
        let [width, height] = claim(&bytes).map_err(|what| damaged(path, what))?.size;
        check_size(width, height).map_err(|what| Error::input(path, what))?;
        let form = match () {
            () if holds_floats(&bytes) => Self::Floats,
            () if has_16_bits(&bytes) => Self::Deep,
            () => Self::File,
        };
        Ok(form(bytes, [width, height]))
    }

    /// The TEXTURE_ bits of its texels.
    pub fn form(&self, kind: Kind) -> u32 {
        match self {
            Self::Floats(..) => kind.of_floats(),
            Self::Deep(..) if kind.is_number() => TEXTURE_FLOAT,
            _ => kind.of_bytes(),
        }
    }

    /// Width and height.
    pub fn size(&self) -> [u32; 2] {
        match self {
            Self::File(_, size) | Self::Deep(_, size) | Self::Floats(_, size) => *size,
            Self::Bitmap(bitmap) => [bitmap.width, bitmap.height],
        }
    }

    /// Fills the texels. Returns how many of them have numbers that the kind may not have: only pictures of floats can.
    ///
    /// # Errors
    /// What is wrong with the picture.
    pub fn decode(self, kind: Kind, space: &mut [u32]) -> Checked<usize> {
        let deep = matches!(self, Self::Deep(..)) && kind.is_number();
        let (bytes, size) = match self {
            Self::Bitmap(bitmap) => {
                let texels = || bitmap.rgba.iter().copied();
                fill(space, texels(), kind, kind != Kind::Mask || !texels().all(|rgba| is_idle(rgba, 255)));
                return Ok(0);
            }
            Self::Floats(bytes, size) => return fill_floats(space, &bytes, size, kind),
            Self::File(bytes, size) | Self::Deep(bytes, size) => (bytes, size),
        };
        let picture = picture(&bytes)?;
        if [picture.width(), picture.height()] != size {
            return Err("its header says another size".to_owned());
        }
        let has_alpha = picture.color().has_alpha() && (kind != Kind::Mask || !all_idle(&picture));
        match &picture {
            DynamicImage::ImageLuma8(grey) => fill(space, grey.pixels().map(|p| opaque([p.0[0]; 3])), kind, has_alpha),
            DynamicImage::ImageRgb8(rgb) => fill(space, rgb.pixels().map(|p| opaque(p.0)), kind, has_alpha),
            DynamicImage::ImageRgba8(rgba) => fill(space, rgba.pixels().map(|p| p.0), kind, has_alpha),
            rare => fill_by_bands(space, rare, kind, has_alpha, deep),
        }
        Ok(0)
    }
}

fn opaque([r, g, b]: [u8; 3]) -> [u8; 4] {
    [r, g, b, 255]
}

/// Whether all texels are [idle](is_idle).
fn all_idle(picture: &DynamicImage) -> bool {
    let idle = |band: DynamicImage| band.into_rgba16().pixels().all(|p| is_idle(p.0, u16::MAX));
    match picture {
        DynamicImage::ImageRgba8(rgba) => rgba.pixels().all(|p| is_idle(p.0, 255)),
        rare => bands(rare).all(idle),
    }
}

fn fill_by_bands(space: &mut [u32], picture: &DynamicImage, kind: Kind, has_alpha: bool, deep: bool) {
    let rows = space.chunks_mut(BAND as usize * picture.width() as usize);
    for (space, band) in rows.zip(bands(picture)) {
        match deep {
            true => fill_deep(space, band.into_rgba16().pixels().map(|p| p.0), kind, has_alpha),
            false => fill(space, band.into_rgba8().pixels().map(|p| p.0), kind, has_alpha),
        }
    }
}

/// Whether a texel's alpha is full and its colour grey. A mask of such texels alone was saved with an alpha channel that says
/// nothing, and red is the mask.
fn is_idle<T: PartialEq>([r, g, b, alpha]: [T; 4], full: T) -> bool {
    alpha == full && r == g && g == b
}

/// Returns how many texels have numbers that the kind may not have.
fn fill_floats(space: &mut [u32], bytes: &[u8], size: [u32; 2], kind: Kind) -> Checked<usize> {
    let film = decode(bytes)?;
    if film.size() != size {
        return Err("its header says another size".to_owned());
    }
    let colour = if matches!(kind, Kind::Color | Kind::Light) { film.rec709(None)? } else { film.picture(None)? };
    let mut alpha = film.channel("A");
    if let (Kind::Mask, Some(a)) = (kind, alpha) {
        let idle = |(i, &[r, g, b]): (usize, &[f32; 3])| is_idle([r, g, b, a.at(i)], 1.0);
        alpha = alpha.filter(|_| !colour.pixels.iter().enumerate().all(idle));
    }
    let mut odd = 0;
    for (i, (texel, rgb)) in space.iter_mut().zip(colour.pixels).enumerate() {
        let alpha = alpha.map(|alpha| alpha.at(i));
        *texel = kind.word(rgb, alpha);
        odd += usize::from(!kind.takes(rgb, alpha));
    }
    Ok(odd)
}

fn fill_deep(space: &mut [u32], texels: impl Iterator<Item = [u16; 4]>, kind: Kind, has_alpha: bool) {
    for (texel, rgba) in space.iter_mut().zip(texels) {
        let [r, g, b, alpha] = rgba.map(|v| f32::from(v) / 65535.0);
        *texel = kind.word([r, g, b], has_alpha.then_some(alpha));
    }
}

fn fill(space: &mut [u32], texels: impl Iterator<Item = [u8; 4]>, kind: Kind, has_alpha: bool) {
    let same = |v: u8| u32::from_le_bytes([v; 4]);
    match kind {
        Kind::Color | Kind::Light | Kind::Data | Kind::Height => put(space, texels, u32::from_le_bytes),
        Kind::Mask | Kind::Alpha if has_alpha => put(space, texels, |rgba| same(rgba[3])),
        Kind::Mask | Kind::Red => put(space, texels, |rgba| same(rgba[0])),
        Kind::Alpha => space.fill(same(255)),
        Kind::Roughness => put(space, texels, |rgba| same(rgba[1])),
    }
}

fn put(space: &mut [u32], texels: impl Iterator<Item = [u8; 4]>, word: impl Fn([u8; 4]) -> u32) {
    space.iter_mut().zip(texels).for_each(|(texel, rgba)| *texel = word(rgba));
}
