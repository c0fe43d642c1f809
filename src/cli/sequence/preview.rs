//! `--preview`: the frames of a sequence as a small animated picture.
use crate::cli::files::{Files, Item, partial_name};
use crate::error::{Checked, Error, Result};
use crate::image::{self, Film, WriteOptions, output};
use ::image::codecs::gif::{GifEncoder, Repeat};
use ::image::imageops::dither;
use ::image::{Delay, DynamicImage, Frame, RgbImage, Rgba, RgbaImage};
use color_quant::NeuQuant;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

/// Pixels of the longer edge at most.
const EDGE: u32 = 480;

/// Checks that a preview can be written there.
///
/// # Errors
/// [`Error::Usage`] for another kind of file, [`Error::Output`].
pub fn check(path: &Path) -> Result<()> {
    if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gif")) {
        return output::check(path);
    }
    Err(Error::Usage(format!("--preview {}: a preview goes to a .gif", path.display())))
}

/// Colours that a frame of a GIF has at most.
const COLORS: usize = 256;

/// Numbers of a pixel: red, green, blue and alpha.
const CHANNELS: usize = 4;

/// Pixels that the colours are chosen by, at most: where there are more, they are taken at equal steps.
const PALETTE_PIXELS: usize = 1 << 20;

/// Small pictures so far.
#[derive(Default)]
pub struct Preview(Vec<RgbaImage>);

impl Preview {
    /// Adds a frame as a PNG of it would look.
    ///
    /// # Errors
    /// A sentence about a film that is no picture.
    pub fn add(&mut self, film: &Film, options: &WriteOptions) -> Checked {
        let picture = film.rec709(None)?;
        let whole = RgbImage::from_raw(picture.width, picture.height, image::codes(&picture, options));
        let whole = DynamicImage::from(whole.ok_or("holds no code for each pixel")?);
        let small = if whole.width().max(whole.height()) > EDGE { whole.thumbnail(EDGE, EDGE) } else { whole };
        self.0.push(small.into_rgba8());
        Ok(())
    }

    /// Writes what there is, at so many frames per second, and returns where; nothing without a frame. Viewers show no
    /// more than 50: others are left out. What is not of the `whole` sequence replaces no file but what was shown at an earlier
    /// interruption, which the whole one takes away.
    ///
    /// # Errors
    /// [`Error::Output`].
    pub fn save(&self, path: &Path, fps: f64, whole: bool) -> Result<Vec<PathBuf>> {
        if self.0.is_empty() {
            return Ok(Vec::new());
        }
        let mut bytes = Vec::new();
        self.encode(&mut bytes, fps).map_err(|e| Error::output(path, e))?;
        let (items, mut files) = ([Item::bytes(path.to_owned(), bytes)], Files::default());
        let partial = partial_name(path);
        files.go_on(&partial, partial.clone());
        let written = [files.save(&items, whole), files.pipe(&items, whole)].concat();
        if whole && files.check().is_ok() {
            files.remove_partial(&items);
        }
        files.end();
        files.check().map(|()| written)
    }

    fn encode(&self, bytes: &mut Vec<u8>, fps: f64) -> std::result::Result<(), ::image::ImageError> {
        let palette = self.palette();
        let mut encoder = GifEncoder::new(bytes);
        encoder.set_repeat(Repeat::Infinite)?;
        // A file counts in hundredths of a second, so that some frames are shown for longer than others.
        let hundredths = |frame: usize| (100.0 * frame as f64 / fps).round();
        let mut shown: Vec<usize> = Vec::new();
        let end = hundredths(self.0.len());
        for (frame, at) in (0..self.0.len()).map(|frame| (frame, hundredths(frame))) {
            if shown.last().is_none_or(|&last| (at - hundredths(last)).min(end - at) >= 2.0) {
                shown.push(frame);
            }
        }
        let ends = shown.iter().skip(1).copied().chain([self.0.len()]);
        shown.iter().zip(ends).try_for_each(|(&frame, end)| {
            let time = (hundredths(end) - hundredths(frame)).clamp(2.0, 60_000.0);
            let delay = Delay::from_numer_denom_ms(10 * time as u32, 1);
            let picture = &self.0[frame];
            let shown = palette.as_ref().map_or_else(|| picture.clone(), |palette| dithered(picture, palette));
            encoder.encode_frame(Frame::from_parts(shown, 0, 0, delay))
        })
    }

    /// The 256 colours of all frames: with others for each, what stands still would change its colour. None where there are no more.
    fn palette(&self) -> Option<NeuQuant> {
        let mut colors = HashSet::new();
        let mut is_room_for = |pixel: &Rgba<u8>| {
            colors.insert(*pixel);
            colors.len() <= COLORS
        };
        if self.0.iter().flat_map(|frame| frame.pixels()).all(&mut is_room_for) {
            return None;
        }
        let pixels = self.0.iter().map(|frame| frame.len() / CHANNELS).sum::<usize>();
        let mut step = pixels.div_ceil(PALETTE_PIXELS).max(1);
        // A step that has a factor in common with the width would pass over whole columns of pixels.
        let width = self.0.first().map_or(1, |frame| frame.width() as usize);
        while (2..=step).any(|d| step.is_multiple_of(d) && width.is_multiple_of(d)) {
            step += 1;
        }
        let all = self.0.iter().flat_map(|frame| frame.chunks_exact(CHANNELS));
        let some: Vec<u8> = all.step_by(step).flatten().copied().collect();
        Some(NeuQuant::new(1, COLORS, &some))
    }
}

/// The picture in these colours, whose errors go to the pixels beside and below (Floyd and Steinberg 1976), so that there are no bands.
fn dithered(picture: &RgbaImage, palette: &NeuQuant) -> RgbaImage {
    let mut picture = picture.clone();
    // `dither` needs a pixel beside the first.
    match picture.width() {
        1 => picture.chunks_exact_mut(CHANNELS).for_each(|pixel| palette.map_pixel(pixel)),
        _ => dither(&mut picture, palette),
    }
    // The palette has alphas of its own where it is dark, which would be holes.
    picture.chunks_exact_mut(CHANNELS).for_each(|pixel| pixel[3] = u8::MAX);
    picture
}

#[cfg(test)]
mod tests {
    use super::*;
    use ::image::codecs::gif::GifDecoder;
    use ::image::{AnimationDecoder, GenericImageView};

    /// Milliseconds for which each of so many frames is shown.
    fn delays(frames: u32, fps: f64) -> Vec<u32> {
        let mut bytes = Vec::new();
        Preview((0..frames).map(|_| RgbaImage::new(1, 1)).collect()).encode(&mut bytes, fps).unwrap();
        let read = GifDecoder::new(std::io::Cursor::new(bytes)).unwrap().into_frames().collect_frames().unwrap();
        read.iter().map(|frame| frame.delay().numer_denom_ms().0).collect()
    }

    /// 16,384 colours in two directions, which stand still, and below them others, which do not.
    #[test]
    fn a_preview_keeps_its_colours_from_frame_to_frame() {
        let frame = |blue: u8| {
            RgbaImage::from_fn(128, 192, |x, y| match y {
                ..128 => Rgba([2 * x as u8, 2 * y as u8, 128, 255]),
                _ => Rgba([2 * x as u8, 255 - blue, blue, 255]),
            })
        };
        let preview = Preview(vec![frame(20), frame(230)]);
        let mut bytes = Vec::new();
        preview.encode(&mut bytes, 24.0).unwrap();
        let read = GifDecoder::new(std::io::Cursor::new(bytes)).unwrap().into_frames().collect_frames().unwrap();
        let above = |i: usize| read[i].buffer().view(0, 0, 128, 128).to_image();
        assert!(above(0) == above(1), "what stands still");
        let block = |picture: &RgbaImage, x: u32, y: u32, c: usize| {
            picture.view(16 * x, 16 * y, 16, 16).pixels().map(|(.., pixel)| f32::from(pixel[c])).sum::<f32>() / 256.0
        };
        // The palette's colours are means, so that the outermost are beyond them. Without dithering some of these blocks are off by 15.
        for (x, y, c) in (1..7).flat_map(|x| (1..7).flat_map(move |y| (0..3).map(move |c| (x, y, c)))) {
            let [made, wanted] = [&above(0), &preview.0[0]].map(|picture| block(picture, x, y, c));
            assert!((made - wanted).abs() < 10.0, "channel {c} of block {x} {y}: {made} for {wanted}");
        }
        assert!(read.iter().all(|frame| frame.buffer().pixels().all(|pixel| pixel[3] == 255)), "no holes");
        let few = Preview(vec![RgbaImage::from_fn(17, 9, |x, y| Rgba([11 * x as u8, 20, 28 * y as u8, 255])); 2]);
        let mut bytes = Vec::new();
        few.encode(&mut bytes, 24.0).unwrap();
        let read = GifDecoder::new(std::io::Cursor::new(bytes)).unwrap().into_frames().collect_frames().unwrap();
        assert!(read.iter().all(|frame| frame.buffer() == &few.0[0]), "153 colours");
    }

    /// However often a sequence is interrupted, one file is left beside an older preview, and none once it is whole.
    #[test]
    fn what_is_shown_of_a_part_does_not_pile_up() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.gif");
        let partial = folder.path().join("a.partial.gif");
        let of = |frames: usize| Preview(vec![RgbaImage::new(1, 1); frames]);
        let bytes = |path: &Path| std::fs::read(path).unwrap();
        assert_eq!(of(1).save(&path, 24.0, true).unwrap(), std::slice::from_ref(&path));
        let older = bytes(&path);
        for frames in [2, 3] {
            assert_eq!(of(frames).save(&path, 24.0, false).unwrap(), std::slice::from_ref(&partial));
        }
        let read = GifDecoder::new(std::io::Cursor::new(bytes(&partial))).unwrap().into_frames();
        assert_eq!((read.count(), bytes(&path) == older), (3, true));
        of(4).save(&path, 24.0, true).unwrap();
        let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().path()).collect();
        assert!(left == [path.clone()] && bytes(&path) != older, "{left:?}");
    }

    #[test]
    fn a_preview_lasts_as_long_as_its_frames() {
        for fps in [12, 24, 30, 48] {
            let shown = delays(fps, fps.into());
            assert_eq!(shown.iter().sum::<u32>(), 1000, "{fps}: {shown:?}");
            assert!(shown.iter().all(|ms| ms.abs_diff(1000 / fps) <= 10), "{fps}: {shown:?}");
        }
        for fps in [50, 60, 100, 120, 1000] {
            let shown = delays(fps, fps.into());
            assert!(shown.iter().sum::<u32>() == 1000 && shown.iter().all(|&ms| ms >= 20), "{fps}: {shown:?}");
        }
        assert_eq!((delays(1, 1000.0), delays(1, 1e-9)), (vec![20], vec![600_000]));
    }
}
