//! The film, which is the result of a render and the content of an image file: planes of samples with dotted names, as in
//! EXR files.
use super::primaries::{self, Primaries};
use crate::error::Checked;
use crate::{memory, threads};
use rayon::prelude::*;
use std::borrow::Cow;
use std::collections::{BTreeMap, BTreeSet};

/// Name of the layer that holds the colour before it was filtered, as in Blender.
pub const NOISY: &str = "Noisy Image";

/// Metadata that names the program which rendered the file: "tallow" and its version.
pub const SOFTWARE: &str = "software";

/// Metadata of what `tallow filter` wrote: the filter.
pub const FILTERED: &str = "filtered";

/// The samples of one channel, row-major, row 0 at the top.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Floats, for radiance, distances and directions.
    F32(Vec<f32>),
    /// Unsigned integers, for counts and indices.
    U32(Vec<u32>),
}

/// One plane of a [`Film`].
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Layer and component, `direct.R`; the colour itself is `R`, `G`, `B` without a layer.
    pub name: String,
    /// `width * height` values.
    pub samples: Samples,
    /// The pixels that the file stored, if it did not store all; the others are 0.
    pub window: Option<Window>,
}

/// A rectangle of a film's pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// First column and row.
    pub first: [u32; 2],
    /// Number of columns and rows.
    pub size: [u32; 2],
}

/// A picture with named layers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Film {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// All channels, in the order in which they were added.
    pub channels: Vec<Channel>,
    /// Named texts, such as scene, settings, seed and device. In EXR files they are attributes like `tallow:scene`; those of
    /// other programs are read too.
    pub metadata: BTreeMap<String, String>,
    /// Chromaticities x, y of red, green, blue and white, where the file names them; else they count as those of Rec.
    /// 709.
    pub primaries: Option<Primaries>,
}

/// Three values per pixel: what metrics, PNG and HDR work on.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// `width * height` values, row-major, row 0 at the top. Colours are linear.
    pub pixels: Vec<[f32; 3]>,
}

impl Picture {
    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// The picture of a plane per component, each of `width * height` values.
    pub fn of_planes([width, height]: [u32; 2], [r, g, b]: &[Vec<f32>; 3]) -> Self {
        let pixels = r.iter().zip(g).zip(b).map(|((&r, &g), &b)| [r, g, b]).collect();
        Self { width, height, pixels }
    }

    /// Number of pixels with a NaN or an infinity in any component.
    pub fn non_finite(&self) -> usize {
        self.pixels.iter().filter(|p| !p.iter().all(|v| v.is_finite())).count()
    }

    /// The picture, if metrics can weigh it.
    ///
    /// # Errors
    /// How many pixels have a NaN or an infinity.
    pub fn finite(self) -> Checked<Self> {
        match self.non_finite() {
            0 => Ok(self),
            n => Err(format!("{n} of {} pixels are NaN or infinite, which no metric can weigh", self.pixels.len())),
        }
    }
}

impl From<&Picture> for Film {
    /// The picture as the colour.
    fn from(picture: &Picture) -> Self {
        let mut film = Self::new(picture.width, picture.height);
        film.add_vec3("", ["R", "G", "B"], &picture.pixels);
        film
    }
}

impl Film {
    /// Makes a film of this size without channels.
    pub fn new(width: u32, height: u32) -> Self {
        Self { width, height, ..Self::default() }
    }

    /// Width and height in pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width as usize * self.height as usize
    }

    /// Adds one channel.
    ///
    /// # Panics
    /// When the number of samples differs from the number of pixels.
    pub fn add(&mut self, name: impl Into<String>, samples: Samples) {
        let (name, len) = (name.into(), samples.len());
        assert_eq!(len, self.pixels(), "channel {name}: one sample per pixel");
        self.channels.push(Channel { name, samples, window: None });
    }

    /// Adds three channels, such as `direct.R`, `direct.G`, `direct.B` for the layer `direct` with components `RGB`.
    /// The empty layer is the colour itself.
    ///
    /// # Panics
    /// When the number of values differs from the number of pixels.
    pub fn add_vec3(&mut self, layer: &str, components: [&str; 3], values: &[[f32; 3]]) {
        for (i, component) in components.iter().enumerate() {
            let name = if layer.is_empty() { (*component).to_owned() } else { format!("{layer}.{component}") };
            self.add(name, Samples::F32(values.iter().map(|v| v[i]).collect()));
        }
    }

    /// Appends the next pixels, row-major, to a film that is filled part by part. The first part determines the channels, which are
    /// filled side by side.
    ///
    /// # Panics
    /// When the channels differ from those of the first part.
    pub fn append(&mut self, parts: &[Self]) {
        let Some(first) = parts.first() else { return };
        if self.channels.is_empty() {
            self.channels = first.channels.iter().map(|c| c.empty(self.pixels())).collect();
        }
        let len = self.channels.len();
        assert!(parts.iter().all(|part| part.channels.len() == len), "channels of the first part");
        let fill = |(i, to): (usize, &mut Channel)| parts.iter().for_each(|part| to.append(&part.channels[i]));
        threads::within_kept(|| self.channels.par_iter_mut().enumerate().for_each(fill));
    }

    /// The channel of this exact name.
    pub fn channel(&self, name: &str) -> Option<&Samples> {
        self.channels.iter().find(|c| c.name == name).map(|c| &c.samples)
    }

    /// The channel of this exact name, if it holds floats.
    pub(crate) fn floats(&self, name: &str) -> Option<&[f32]> {
        if let Samples::F32(floats) = self.channel(name)? { Some(floats) } else { None }
    }

    /// The channel of this exact name, if it holds unsigned integers.
    pub(crate) fn words(&self, name: &str) -> Option<&[u32]> {
        if let Samples::U32(words) = self.channel(name)? { Some(words) } else { None }
    }

    /// Every layer name, sorted; the colour without a layer is the empty name.
    pub fn layers(&self) -> BTreeSet<&str> {
        self.channels.iter().map(|c| split(&c.name).0).collect()
    }

    /// Returns three values per pixel of one layer: its R, G, B or X, Y, Z, or its only channel three times.
    ///
    /// Without a name, the layer is the colour: the channels R, G, B, or a layer that other programs use for it
    /// (`ViewLayer.Combined`, `rgba`) once, or the only layer with R, G, B, or grey (Y). A name matches in full or by its last part,
    /// regardless of case; `RGB` are the channels R, G, B where no layer is called so.
    ///
    /// # Errors
    /// When there is no such layer or more than one, with a list of all channels, or when memory is out.
    pub fn picture(&self, layer: Option<&str>) -> Checked<Picture> {
        let channels = self.find(layer).ok_or_else(|| self.no_such_layer(layer))?;
        let [a, b, c] = channels.map(|c| c.samples.to_f32());
        let mut pixels = memory::reserved(self.pixels())?;
        pixels.extend(a.iter().zip(b.iter()).zip(c.iter()).map(|((&a, &b), &c)| [a, b, c]));
        Ok(Picture { width: self.width, height: self.height, pixels })
    }

    /// [`Film::picture`] of a layer that holds colour, brought from the film's primaries to those of Rec. 709, which
    /// metrics, PNG and HDR take. What Rec. 709 cannot show is cut at 0.
    ///
    /// # Errors
    /// As [`Film::picture`].
    pub fn rec709(&self, layer: Option<&str>) -> Checked<Picture> {
        self.picture(layer).map(|picture| self.as_rec709(picture))
    }

    /// The same of a picture in the film's primaries.
    pub(crate) fn as_rec709(&self, mut picture: Picture) -> Picture {
        self.foreign_primaries().iter().for_each(|own| primaries::to_rec709(own, &mut picture.pixels));
        picture
    }

    /// Its primaries, where they are others than those of Rec. 709.
    pub(crate) fn foreign_primaries(&self) -> Option<Primaries> {
        self.primaries.filter(|own| !primaries::is_rec709(own))
    }

    /// The channels that [`Film::picture`] takes, the same one three times for grey.
    pub fn find(&self, layer: Option<&str>) -> Option<[&Channel; 3]> {
        match layer {
            None => self.colour(),
            Some(name) => self.layer(name),
        }
    }

    pub(super) fn no_such_layer(&self, layer: Option<&str>) -> String {
        if let (None, [_, _, ..]) = (layer, &self.pictures()[..]) {
            return format!("holds several pictures: {}", self.pictures().join(", "));
        }
        if layer.is_none() && self.has_chroma() {
            return "holds luminance and chroma (Y, RY, BY), which is not supported: save it as R, G, B".to_owned();
        }
        let wanted = layer.map_or("no colour (R, G, B)".to_owned(), |name| format!("no single layer {name:?}"));
        let names: Vec<_> = self.channels.iter().map(|c| c.name.as_str()).collect();
        match names.is_empty() {
            true => format!("holds {wanted}, nor any other channel"),
            false => format!("holds {wanted}; its channels are {}", names.join(", ")),
        }
    }

    fn colour(&self) -> Option<[&Channel; 3]> {
        let coloured = self.coloured();
        let clean = |l: &&&str| !split(l).1.eq_ignore_ascii_case(NOISY);
        let only = || coloured.iter().find(clean).filter(|_| coloured.iter().filter(clean).count() == 1);
        match self.pictures()[..] {
            [_, _, ..] => None,
            [layer] => self.triple(layer, ["R", "G", "B"]),
            [] => match only() {
                Some(layer) => self.triple(layer, ["R", "G", "B"]),
                None => self.grey(|c| c.name == "Y").filter(|_| !self.has_chroma()),
            },
        }
    }

    /// Whether it holds what makes a colour of the luminance Y.
    fn has_chroma(&self) -> bool {
        self.channel("Y").is_some() && self.channels.iter().any(|c| ["RY", "BY"].contains(&c.name.as_str()))
    }

    /// The layers with R, G and B, sorted; one look at each channel, since files may hold thousands.
    fn coloured(&self) -> Vec<&str> {
        let mut held = BTreeMap::<&str, [bool; 3]>::new();
        for (layer, component) in self.channels.iter().map(|c| split(&c.name)) {
            let of_layer = held.entry(layer).or_default();
            ["R", "G", "B"].iter().zip(of_layer).for_each(|(c, has)| *has |= component.eq_ignore_ascii_case(c));
        }
        held.into_iter().filter(|(_, has)| *has == [true; 3]).map(|(layer, _)| layer).collect()
    }

    fn usual(&self) -> Vec<&str> {
        self.coloured().into_iter().filter(|layer| is_usual(layer)).collect()
    }

    /// The layer of the colour, by one of the names that programs give it; several where the view layers of a file have one of the same
    /// name each.
    fn pictures(&self) -> Vec<&str> {
        let usual = self.usual();
        if let Some(composite) = usual.iter().find(|layer| is_composite(split(layer).0)) {
            return vec![composite];
        }
        let Some((&first, others)) = usual.split_first() else { return Vec::new() };
        let same = |layer: &&str| split(layer).1.eq_ignore_ascii_case(split(first).1);
        let others = others.iter().copied().filter(same);
        let others = others.filter(|_| !first.is_empty() && !first.to_lowercase().ends_with(".main"));
        [first].into_iter().chain(others).collect()
    }

    /// Whether `layer` is of another view layer than `view`, where several have colours of their own, as Blender's have.
    pub(super) fn is_other_view(&self, layer: &str, view: &str) -> bool {
        let (own, pictures) = (split(layer).0, self.usual());
        let views: BTreeSet<_> =
            pictures.into_iter().map(|layer| split(layer).0).filter(|view| !view.is_empty()).collect();
        own != view && views.contains(own) && views.iter().filter(|view| !is_composite(view)).count() > 1
    }

    fn layer(&self, wanted: &str) -> Option<[&Channel; 3]> {
        let same = |name: &str| name.eq_ignore_ascii_case(wanted) || split(name).1.eq_ignore_ascii_case(wanted);
        let found: Vec<_> = self.layers().into_iter().filter(|l| !l.is_empty() && same(l)).collect();
        let exact = found.iter().find(|l| **l == wanted);
        let only = || found.first().filter(|_| found.len() == 1);
        match exact.or_else(only) {
            Some(layer) => self
                .triple(layer, ["R", "G", "B"])
                .or_else(|| self.triple(layer, ["X", "Y", "Z"]))
                .or_else(|| self.grey(|c| split(&c.name).0 == *layer && split(&c.name).1 != "A")),
            None if found.is_empty() && wanted.eq_ignore_ascii_case("RGB") => self.triple("", ["R", "G", "B"]),
            None => self.grey(|c| c.name.eq_ignore_ascii_case(wanted)),
        }
    }

    /// The only channel that passes the test, three times.
    fn grey(&self, test: impl Fn(&&Channel) -> bool) -> Option<[&Channel; 3]> {
        let mut channels = self.channels.iter().filter(test);
        match (channels.next(), channels.next()) {
            (Some(only), None) => Some([only; 3]),
            _ => None,
        }
    }

    fn triple(&self, layer: &str, components: [&str; 3]) -> Option<[&Channel; 3]> {
        let channel = |component: &str| {
            let is = |c: &&Channel| split(&c.name).0 == layer && split(&c.name).1.eq_ignore_ascii_case(component);
            self.channels.iter().find(is)
        };
        let [a, b, c] = components.map(channel);
        Some([a?, b?, c?])
    }
}

impl Channel {
    /// Makes a channel of the same name and kind, without samples but with capacity for `capacity` of them.
    fn empty(&self, capacity: usize) -> Self {
        let samples = match self.samples {
            Samples::F32(_) => Samples::F32(Vec::with_capacity(capacity)),
            Samples::U32(_) => Samples::U32(Vec::with_capacity(capacity)),
        };
        Self { name: self.name.clone(), samples, window: None }
    }

    fn append(&mut self, from: &Self) {
        assert_eq!(self.name, from.name, "channels of the first part");
        match (&mut self.samples, &from.samples) {
            (Samples::F32(to), Samples::F32(from)) => to.extend_from_slice(from),
            (Samples::U32(to), Samples::U32(from)) => to.extend_from_slice(from),
            _ => panic!("channel {}: samples of another kind", self.name),
        }
    }
}

impl Samples {
    /// Number of samples in the channel.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(v) => v.len(),
            Self::U32(v) => v.len(),
        }
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One sample as a float; counts above 2^24 are rounded.
    pub fn at(&self, pixel: usize) -> f32 {
        match self {
            Self::F32(v) => v[pixel],
            Self::U32(v) => v[pixel] as f32,
        }
    }

    /// All samples as floats; counts above 2^24 are rounded.
    pub fn to_f32(&self) -> Cow<'_, [f32]> {
        match self {
            Self::F32(v) => v.into(),
            Self::U32(v) => v.iter().map(|&u| u as f32).collect(),
        }
    }
}

/// What Blender's compositor makes of all view layers.
fn is_composite(view: &str) -> bool {
    view.eq_ignore_ascii_case("composite")
}

/// Whether programs call the layer of the colour so.
fn is_usual(layer: &str) -> bool {
    // Those behind "color" are Karma's, RenderMan's and LuxCore's.
    const USUAL: [&str; 9] = ["", "combined", "beauty", "rgba", "rgb", "color", "c", "ci", "rgb_imagepipeline"];
    let name = layer.to_lowercase();
    USUAL.contains(&split(name.strip_suffix(".main").unwrap_or(&name)).1) // Nuke names parts `rgba.main`
}

/// Layer and component of a channel name: `a.b.R` is (`a.b`, `R`), `Z` is (``, `Z`).
pub(super) fn split(name: &str) -> (&str, &str) {
    name.rsplit_once('.').unwrap_or(("", name))
}
