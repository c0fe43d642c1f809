//! The layers of an image that filters use (AOVs, arbitrary output variables). They are found by the channel names of
//! Tallow, Blender (Cycles), Mitsuba 3, pbrt-v4, V-Ray, Arnold, Octane and Unreal.
use super::film::{Channel, Film, NOISY, SOFTWARE, Samples, Window, split};
use crate::error::Checked;
use std::collections::BTreeMap;

/// One kind of arbitrary output variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Aov {
    /// Radiance, which every image must have.
    Colour,
    /// Direct light, which needs no filter; only in Tallow's own files.
    Direct,
    /// Indirect light before albedo; only in Tallow's own files.
    Indirect,
    /// Reflectance of the first hit.
    Albedo,
    /// Shading normal, in any fixed space.
    Normal,
    /// First hit, in any fixed space.
    Position,
    /// Distance of the first hit.
    Depth,
    /// Squared standard error of the radiance.
    Variance,
    /// Number of samples per pixel.
    Samples,
    /// Number of samples per pixel over that which the head of the file tells, as Blender has it.
    ShareOfSamples,
}

/// An AOV, its name in messages, and the layer names that renderers give it, the best first.
#[derive(Clone, Copy)]
struct Known {
    aov: Aov,
    label: &'static str,
    names: &'static [&'static str],
}

/// The colour that a file shows, which goes by no name of these.
const SHOWN: Known = Known { aov: Aov::Colour, label: "colour", names: &[] };

/// Blender names channels `ViewLayer.NAME.R`; its "Denoising" passes are made for filters. In Mitsuba the user chooses
/// the names; these are the ones in its documentation. pbrt has `Albedo.R`, `Ns.X`, `P.X`, `Variance.R`; Octane
/// `Denoiser_albedo.R`; V-Ray `diffuseFilter.R`; Arnold `diffuse_albedo.R`; Unreal `FinalImageBaseColor.R`.
const KNOWN: &[Known] = &[
    Known { names: &[NOISY], ..SHOWN },
    Known { aov: Aov::Direct, label: "direct light", names: &["direct"] },
    Known { aov: Aov::Indirect, label: "indirect light", names: &["indirect"] },
    Known {
        aov: Aov::Albedo,
        label: "albedo",
        names: &[
            "denoising albedo",
            "denoiser_albedo",
            "albedo",
            "diffcol",
            "diffuse color",
            "diffuse_albedo",
            "diffusefilter",
            "finalimagebasecolor",
        ],
    },
    Known {
        aov: Aov::Normal,
        label: "normal",
        names: &[
            "denoising normal",
            "denoiser_normal",
            "ns",
            "n",
            "sh_normal",
            "normal",
            "normals",
            "nn",
            "geo_normal",
            "ng",
            "finalimageworldnormal",
        ],
    },
    Known { aov: Aov::Position, label: "position", names: &["denoising position", "p", "position", "pos"] },
    Known {
        aov: Aov::Depth,
        label: "depth",
        names: &["denoising depth", "z", "depth", "dd.y", "dd", "finalimageworlddepth"],
    },
    Known { aov: Aov::Variance, label: "variance", names: &["variance"] },
    Known { aov: Aov::Samples, label: "samples", names: &["samples", "sample count"] },
    Known { aov: Aov::ShareOfSamples, label: "share of the samples", names: &["debug sample count"] },
];

/// Layer names given by the user, which replace the known ones. That of [`Aov::Samples`] may be a number instead, of at
/// least 1, which all pixels have.
pub type Names = BTreeMap<Aov, String>;

/// Three values per pixel, borrowed from a film; a single channel is repeated three times.
#[derive(Clone, Copy, Debug)]
pub struct Plane<'a>([&'a Samples; 3]);

impl Plane<'_> {
    /// The three values of a pixel.
    pub fn at(&self, pixel: usize) -> [f32; 3] {
        self.0.map(|samples| samples.at(pixel))
    }
}

/// A number of samples; 0 for what is none.
fn sound(samples: f32) -> f32 {
    if samples.is_finite() { samples.max(0.0) } else { 0.0 }
}

/// The AOVs of a film, each three values per pixel.
pub struct Aovs<'a> {
    /// The film that holds them.
    pub film: &'a Film,
    /// The channels of the colour, which a filter replaces.
    pub colour: [&'a str; 3],
    planes: BTreeMap<Aov, Plane<'a>>,
    window: Option<Window>,
    samples_of_all: Option<f32>,
    /// Whether [`Aov::Variance`] is that of one sample and not of the pixel's mean.
    of_one_sample: bool,
    /// One line per AOV, with the name under which it was found, or that it is missing; and what is wrong with the
    /// colour.
    pub notes: Vec<String>,
}

impl<'a> Aovs<'a> {
    /// Finds all known AOVs of a film, by the user's names first.
    ///
    /// # Errors
    /// When there is no colour or no pixel of it is a finite number, when a layer named by the user is missing, or when
    /// a layer covers other pixels than the colour.
    pub fn find(film: &'a Film, names: &Names) -> Checked<Self> {
        Self::find_of(film, names, KNOWN)
    }

    /// The same, but unless the user names another colour it is the one that is shown, though it was filtered and the noisy one is there.
    ///
    /// # Errors
    /// As [`Aovs::find`].
    pub fn find_shown(film: &'a Film, names: &Names) -> Checked<Self> {
        Self::find_of(film, names, &[&[SHOWN], &KNOWN[1..]].concat())
    }

    fn find_of(film: &'a Film, names: &Names, all: &[Known]) -> Checked<Self> {
        let given = names.get(&Aov::Colour).map(String::as_str);
        // The noisy image is the input of the filter and is never replaced.
        let shown = film
            .find(given.filter(|name| !is_noisy(name)))
            .ok_or_else(|| film.picture(given).err().unwrap_or_default())?;
        let view = split(split(&shown[0].name).0).0;
        // Parts of the light are no parts of another layer.
        let is_light =
            given.is_none_or(is_noisy) || film.find(None).is_some_and(|colour| colour[0].name == shown[0].name);
        let told = names.get(&Aov::Samples).and_then(|told| number(told));
        let mut found = Self {
            film,
            colour: shown.map(|c| c.name.as_str()),
            planes: BTreeMap::new(),
            window: shown[0].window,
            samples_of_all: None,
            of_one_sample: film.channels.iter().any(|c| c.name.starts_with("RelativeVariance.")),
            notes: Vec::new(),
        };
        for known in all {
            if let (Aov::Samples, Some(number)) = (known.aov, told) {
                found.notes.push(format!("samples: {number} in every pixel, as given"));
                continue;
            }
            let channels = match names.get(&known.aov) {
                Some(name) => Some(film.find(Some(name)).ok_or_else(|| absent(film, known, name))?),
                None if known.is_tallow_s_own() && !(is_light && is_tallow_s(film)) => None,
                None => known.names.iter().find_map(|name| find(film, view, name).filter(|c| known.fits(c))),
            };
            let channels = channels.or_else(|| (known.aov == Aov::Colour).then_some(shown));
            found.take(known, channels)?;
        }
        found.samples_of_all = told.or_else(|| samples_of_head(film, found.colour[0]));
        found.check_colour()?;
        found.check_samples();
        Ok(found)
    }

    /// Says how many pixels hold no colour that a filter can use.
    fn check_colour(&mut self) -> Checked {
        let held = || (0..self.film.pixels()).filter(|&i| self.holds(i));
        let broken = |i: &usize| !self.planes[&Aov::Colour].at(*i).iter().all(|v| v.is_finite());
        let (all, count) = (held().count(), held().filter(broken).count());
        if count > 0 && count == all {
            return Err(format!("holds NaN or infinity in each of its {all} pixels: render it anew"));
        }
        if count > 0 {
            let what = "which filters fill in from those around them";
            self.notes.push(format!("colour: NaN or infinite in {count} of {all} pixels, {what}"));
        }
        Ok(())
    }

    /// Leaves out numbers of samples where no pixel has any: nothing would be left to filter.
    fn check_samples(&mut self) {
        for (aov, label) in [(Aov::Samples, "samples"), (Aov::ShareOfSamples, "share of the samples")] {
            let has_some =
                |plane: &Plane| (0..self.film.pixels()).any(|i| self.holds(i) && sound(plane.at(i)[0]) > 0.0);
            if self.planes.get(&aov).is_some_and(|plane| !has_some(plane)) {
                self.planes.remove(&aov);
                self.notes.push(format!("{label}: none in any pixel, which is not believed"));
            }
        }
    }

    fn take(&mut self, known: &Known, channels: Option<[&'a Channel; 3]>) -> Checked {
        let Some(channels) = channels else {
            if !known.is_tallow_s_own() && known.aov != Aov::ShareOfSamples {
                self.notes.push(format!("{}: not there", known.label));
            }
            return Ok(());
        };
        if let Some(c) = channels.iter().find(|c| c.window != self.window) {
            return Err(format!(
                "{} ({}) covers {}, but the colour {}: render both at one size",
                known.label,
                c.name,
                extent(self.film, c.window),
                extent(self.film, self.window)
            ));
        }
        self.planes.insert(known.aov, Plane(channels.map(|c| &c.samples)));
        self.notes.push(format!("{}: {}", known.label, channel_names(channels)));
        Ok(())
    }

    /// The values of an AOV, if the file has it.
    pub fn get(&self, aov: Aov) -> Option<Plane<'a>> {
        self.planes.get(&aov).copied()
    }

    /// Whether Tallow wrote the file.
    pub fn is_tallow_s(&self) -> bool {
        is_tallow_s(self.film)
    }

    /// The layer in which to keep the noisy image when the colour is replaced. `None` if the file already has one or if the
    /// colour is a layer that the user chose.
    pub fn keep_as(&self) -> Option<&'static str> {
        let has_one = self.film.layers().iter().any(|layer| is_noisy(split(layer).1));
        let is_shown = self.film.find(None).is_some_and(|shown| shown.map(|c| c.name.as_str()) == self.colour);
        (is_shown && !has_one).then_some(NOISY)
    }

    /// Samples of a pixel, as far as the file or the user tells: its own, or those of all, which pbrt and Cycles write into the head.
    pub fn samples(&self, pixel: usize) -> Option<f32> {
        let share = || self.scalar(Aov::ShareOfSamples, pixel).map_or(1.0, sound);
        self.scalar(Aov::Samples, pixel).map(sound).or_else(|| Some(share() * self.samples_of_all?))
    }

    /// Squared standard error of a pixel's radiance, if the file has it: pbrt stores the variance of one sample.
    pub fn variance(&self, pixel: usize) -> Option<[f32; 3]> {
        let stored = self.get(Aov::Variance)?.at(pixel);
        let n = if self.of_one_sample { self.samples(pixel).unwrap_or(1.0).max(1.0) } else { 1.0 };
        Some(stored.map(|v| v / n))
    }

    /// The first of the three values of a pixel.
    pub fn scalar(&self, aov: Aov, pixel: usize) -> Option<f32> {
        self.get(aov).map(|plane| plane.at(pixel)[0])
    }

    /// Whether the file holds this pixel.
    pub fn holds(&self, pixel: usize) -> bool {
        let at = [pixel as u32 % self.film.width, pixel as u32 / self.film.width];
        self.window.is_none_or(|w| (0..2).all(|i| at[i] >= w.first[i] && at[i] - w.first[i] < w.size[i]))
    }
}

impl Known {
    /// Whether the channels can be this AOV: a vector needs three, so a single one of that name is something else.
    fn fits(&self, channels: &[&Channel; 3]) -> bool {
        !matches!(self.aov, Aov::Normal | Aov::Position) || channels[0].name != channels[1].name
    }

    fn is_tallow_s_own(&self) -> bool {
        matches!(self.aov, Aov::Direct | Aov::Indirect)
    }
}

/// Whether a layer is that of the noisy image, which a filter reads and never replaces.
pub fn is_noisy(layer: &str) -> bool {
    layer.eq_ignore_ascii_case(NOISY)
}

/// Whether Tallow wrote the file; other programs may use the same names for something else.
fn is_tallow_s(film: &Film) -> bool {
    film.metadata.get(SOFTWARE).is_some_and(|name| name.starts_with("tallow "))
}

/// What the head of a file tells of the samples of every pixel, by pbrt's name or that of Cycles for the view layer of the colour.
fn samples_of_head(film: &Film, colour: &str) -> Option<f32> {
    let of_view = |view: &str| format!("cycles.{view}.samples");
    let view = colour.rsplitn(3, '.').nth(2).map(of_view);
    let told = ["samplesPerPixel".to_owned()].into_iter().chain(view);
    told.filter_map(|key| film.metadata.get(&key)?.parse().ok()).find(|n: &f32| n.is_finite() && *n > 0.0)
}

/// Finds a layer in the view layer of the colour, or else anywhere but in another with a colour of its own.
fn find<'a>(film: &'a Film, view: &str, name: &str) -> Option<[&'a Channel; 3]> {
    let own = (!view.is_empty()).then(|| film.find(Some(&format!("{view}.{name}")))).flatten();
    let elsewhere = || film.find(Some(name)).filter(|found| !film.is_other_view(split(&found[0].name).0, view));
    own.or_else(elsewhere)
}

/// A number of samples; all else is the name of a layer.
fn number(told: &str) -> Option<f32> {
    told.parse().ok().filter(|n: &f32| n.is_finite() && *n >= 1.0)
}

fn absent(film: &Film, known: &Known, name: &str) -> String {
    let why = film.picture(Some(name)).err().unwrap_or_default();
    format!("{}: {why}", known.label)
}

fn extent(film: &Film, window: Option<Window>) -> String {
    let w = window.unwrap_or(Window { first: [0, 0], size: film.size() });
    format!("{}x{} pixels from ({}, {})", w.size[0], w.size[1], w.first[0], w.first[1])
}

/// The three names, such as `N.X N.Y N.Z`, or the one that all share.
fn channel_names(channels: [&Channel; 3]) -> String {
    let mut names = channels.map(|c| c.name.as_str()).to_vec();
    names.dedup();
    names.join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Samples;

    /// One pixel whose channels hold 0, 1, 2... in the order given.
    fn film(names: &str) -> Film {
        let mut film = Film::new(1, 1);
        for (i, name) in names.split(' ').enumerate() {
            film.add(name.replace('_', " "), Samples::F32(vec![i as f32]));
        }
        film
    }

    /// (AOV, value of its first channel).
    fn found(film: &Film) -> Vec<(Aov, f32)> {
        let aovs = Aovs::find(film, &Names::new()).unwrap();
        KNOWN.iter().filter_map(|k| Some((k.aov, aovs.scalar(k.aov, 0)?))).collect()
    }

    #[test]
    fn tallow_s_own_layers_are_found() {
        let mut film = film(
            "R G B variance.R variance.G variance.B samples direct.R direct.G direct.B indirect.R indirect.G indirect.B \
             albedo.R albedo.G albedo.B N.X N.Y N.Z P.X P.Y P.Z Z id",
        );
        let others = [
            (Aov::Colour, 0.0),
            (Aov::Albedo, 13.0),
            (Aov::Normal, 16.0),
            (Aov::Position, 19.0),
            (Aov::Depth, 22.0),
            (Aov::Variance, 3.0),
            (Aov::Samples, 6.0),
        ];
        assert_eq!(found(&film), others, "layers called direct may be anything in the files of others");
        film.metadata.insert("software".to_owned(), "tallow 0.1.0".to_owned());
        assert_eq!(found(&film)[1..3], [(Aov::Direct, 7.0), (Aov::Indirect, 10.0)]);
    }

    #[test]
    fn blender_s_layers_are_found_in_the_view_layer_of_the_colour() {
        let file = film(
            "View.Combined.R View.Combined.G View.Combined.B View.Depth.Z View.Normal.X View.Normal.Y View.Normal.Z \
             View.Position.X View.Position.Y View.Position.Z View.DiffCol.R View.DiffCol.G View.DiffCol.B \
             View.Debug_Sample_Count.X Other.Normal.X Other.Normal.Y Other.Normal.Z",
        );
        let depth = [(Aov::Normal, 4.0), (Aov::Position, 7.0), (Aov::Depth, 3.0), (Aov::ShareOfSamples, 13.0)];
        assert_eq!(found(&file), [&[(Aov::Colour, 0.0), (Aov::Albedo, 10.0)], &depth[..]].concat());
    }

    #[test]
    fn of_several_view_layers_one_is_named_and_takes_nothing_from_the_others() {
        let mut file = film(
            "A.Combined.R A.Combined.G A.Combined.B B.Combined.R B.Combined.G B.Combined.B B.Denoising_Albedo.R \
             B.Denoising_Albedo.G B.Denoising_Albedo.B B.Denoising_Normal.X B.Denoising_Normal.Y B.Denoising_Normal.Z \
             Other.Depth.Z",
        );
        let why = Aovs::find(&file, &Names::new()).map(|_| ()).unwrap_err();
        assert_eq!(why, "holds several pictures: A.Combined, B.Combined");
        let named = |name: &str| {
            let names = Names::from([(Aov::Colour, name.to_owned())]);
            let aovs = Aovs::find(&file, &names).unwrap();
            [Aov::Colour, Aov::Albedo, Aov::Normal, Aov::Depth].map(|aov| aovs.scalar(aov, 0))
        };
        assert_eq!(named("A.Combined"), [Some(0.0), None, None, Some(12.0)]);
        assert_eq!(named("B.Combined"), [Some(3.0), Some(6.0), Some(9.0), Some(12.0)]);
        // What a compositor made of one, or a root beside it, is a picture with that one's layers.
        file.channels.drain(..3);
        ["R", "G", "B"].iter().for_each(|name| file.add(*name, Samples::F32(vec![20.0])));
        assert_eq!(found(&file)[..2], [(Aov::Colour, 20.0), (Aov::Albedo, 6.0)]);
        file.channels.iter_mut().rev().take(3).for_each(|c| c.name = format!("Composite.Combined.{}", c.name));
        assert_eq!(found(&file)[..2], [(Aov::Colour, 20.0), (Aov::Albedo, 6.0)]);
    }

    #[test]
    fn blender_s_denoising_data_are_preferred_and_its_combined_layer_is_replaced() {
        let file = film(
            "V.Combined.R V.Combined.G V.Combined.B V.Noisy_Image.R V.Noisy_Image.G V.Noisy_Image.B V.DiffCol.R V.DiffCol.G \
             V.DiffCol.B V.Denoising_Albedo.R V.Denoising_Albedo.G V.Denoising_Albedo.B V.Denoising_Normal.X \
             V.Denoising_Normal.Y V.Denoising_Normal.Z V.Denoising_Depth.Z",
        );
        let expected = [(Aov::Colour, 3.0), (Aov::Albedo, 9.0), (Aov::Normal, 12.0), (Aov::Depth, 15.0)];
        assert_eq!(found(&file), expected);
        assert_eq!(Aovs::find(&file, &Names::new()).unwrap().colour[0], "V.Combined.R");
    }

    #[test]
    fn mitsuba_s_layers_are_found_under_the_names_of_its_documentation() {
        let file = film(
            "R G B img.R img.G img.B albedo.R albedo.G albedo.B nn.X nn.Y nn.Z dd.y.T position.X position.Y position.Z",
        );
        let geometry = [(Aov::Normal, 9.0), (Aov::Position, 13.0), (Aov::Depth, 12.0)];
        assert_eq!(found(&file), [&[(Aov::Colour, 0.0), (Aov::Albedo, 6.0)], &geometry[..]].concat());
    }

    #[test]
    fn pbrt_s_layers_are_found_and_the_shading_normal_is_taken() {
        let file = film(
            "R G B Albedo.R Albedo.G Albedo.B P.X P.Y P.Z dzdx dzdy N.X N.Y N.Z Ns.X Ns.Y Ns.Z u v Variance.R Variance.G \
             Variance.B RelativeVariance.R RelativeVariance.G RelativeVariance.B",
        );
        let expected =
            [(Aov::Colour, 0.0), (Aov::Albedo, 3.0), (Aov::Normal, 14.0), (Aov::Position, 6.0), (Aov::Variance, 19.0)];
        assert_eq!(found(&file), expected);
        // Its variance is that of one sample, of as many as the head tells.
        let variance = |file: &Film| Aovs::find(file, &Names::new()).unwrap().variance(0).unwrap()[0];
        assert_eq!(variance(&file), 19.0);
        let mut told = file.clone();
        told.metadata.insert("samplesPerPixel".to_owned(), "4".to_owned());
        assert_eq!(variance(&told), 4.75);
        told.channels.retain(|channel| !channel.name.starts_with("RelativeVariance."));
        assert_eq!(variance(&told), 19.0, "of another program");
    }

    #[test]
    fn layers_of_other_renderers_are_found_by_their_names() {
        let file = |layers: &[&str]| {
            let mut film = Film::new(1, 1);
            let mut values = (0..).map(|i| (i * 3) as f32);
            layers.iter().zip(&mut values).for_each(|(layer, v)| film.add_vec3(layer, ["R", "G", "B"], &[[v; 3]]));
            film
        };
        let both = [(Aov::Colour, 0.0), (Aov::Albedo, 3.0), (Aov::Normal, 6.0)];
        for (colour, albedo, normal) in [
            ("", "diffuseFilter", "normals"),
            ("", "diffuse_albedo", "N"),
            ("Beauty", "Denoiser_albedo", "Denoiser_normal"),
            ("", "FinalImageBaseColor", "FinalImageWorldNormal"),
            ("rgba.main", "albedo.main.albedo", "N.main.N"),
            ("C", "albedo", "N"),
            ("Ci", "albedo", "normal"),
            ("RGB_IMAGEPIPELINE", "ALBEDO", "N"),
        ] {
            assert_eq!(found(&file(&[colour, albedo, normal])), both, "{colour} {albedo}");
        }
        assert_eq!(found(&file(&["", "FinalImageWorldDepth"])), [(Aov::Colour, 0.0), (Aov::Depth, 3.0)]);
    }

    #[test]
    fn samples_are_a_layer_or_a_number() {
        let file = film("R G B samples");
        let find = |told: &str| Aovs::find(&file, &Names::from([(Aov::Samples, told.to_owned())]));
        let aovs = find("32").unwrap();
        assert!(aovs.samples(0) == Some(32.0) && aovs.get(Aov::Samples).is_none());
        assert!(aovs.notes.contains(&"samples: 32 in every pixel, as given".to_owned()), "{:?}", aovs.notes);
        assert_eq!(find("samples").unwrap().scalar(Aov::Samples, 0), Some(3.0));
        for wrong in ["0", "-1", "inf", "nan", "spp"] {
            assert!(find(wrong).is_err_and(|line| line.contains(wrong)), "{wrong}");
        }
    }

    #[test]
    fn names_of_the_user_count_and_what_is_missing_is_said() {
        let file = film("R G B kd.R kd.G kd.B normal");
        let names = Names::from([(Aov::Albedo, "kd".to_owned())]);
        let aovs = Aovs::find(&file, &names).unwrap();
        assert_eq!(aovs.scalar(Aov::Albedo, 0), Some(3.0));
        assert!(aovs.notes.contains(&"albedo: kd.R kd.G kd.B".to_owned()), "{:?}", aovs.notes);
        assert!(
            aovs.notes.contains(&"normal: not there".to_owned()),
            "a single channel is no vector: {:?}",
            aovs.notes
        );
        let wrong = Names::from([(Aov::Depth, "far".to_owned())]);
        let line = Aovs::find(&file, &wrong).map(|_| ()).unwrap_err();
        assert!(line.contains("depth") && line.contains("\"far\"") && line.contains("kd.R"), "{line}");
        assert!(Aovs::find(&film("a.X b.Y"), &Names::new()).is_err(), "no colour");
    }

    #[test]
    fn numbers_of_samples_are_believed_where_there_are_some() {
        let of = |samples: [f32; 4]| {
            let mut film = Film::new(2, 2);
            film.add_vec3("", ["R", "G", "B"], &[[1.0; 3]; 4]);
            film.add("samples", Samples::F32(samples.to_vec()));
            let found = Aovs::find(&film, &Names::new()).unwrap();
            let told = found.notes.iter().any(|note| note.contains("none in any pixel"));
            ([0, 1, 2, 3].map(|i| found.samples(i)), told)
        };
        for none in [[0.0; 4], [-1.0, 0.0, f32::NAN, f32::NEG_INFINITY]] {
            assert_eq!(of(none), ([None; 4], true));
        }
        assert_eq!(of([8.0, -1.0, f32::NAN, 0.0]), ([Some(8.0), Some(0.0), Some(0.0), Some(0.0)], false));
        // Shares of what the head of the file tells, likewise.
        let share = |shares: [f32; 4]| {
            let mut film = Film::new(2, 2);
            film.add_vec3("V.Combined", ["R", "G", "B"], &[[1.0; 3]; 4]);
            film.add("V.Debug Sample Count.X", Samples::F32(shares.to_vec()));
            film.metadata.insert("cycles.V.samples".to_owned(), "64".to_owned());
            let found = Aovs::find(&film, &Names::new()).unwrap();
            [0, 1, 2, 3].map(|i| found.samples(i))
        };
        assert_eq!(share([0.0; 4]), [Some(64.0); 4]);
        assert_eq!(share([0.5, -1.0, f32::NAN, 0.0]), [Some(32.0), Some(0.0), Some(0.0), Some(0.0)]);
    }
}
