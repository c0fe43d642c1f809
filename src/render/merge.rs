//! Renders of the same picture by different samples become one.
use super::film;
use super::provenance::{self, Provenance, SampleRange};
use super::rendered::{Head, Rendered};
use crate::error::{Error, Result};
use crate::image::{self, FILTERED, Film, SOFTWARE};
use crate::render::settings::Settings;
use crate::statistics::{BrokenSamples, Pixel, join};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Settings in which merged renders may differ.
const FREE: [&str; 3] = ["spp", "first_sample", "seed"];

/// Stands between the programs that rendered the parts of a merged file.
const BETWEEN: &str = ", ";

/// A file to merge, of which only the header was read.
struct Part<'a> {
    path: &'a Path,
    splits_light: bool,
    /// The programs that rendered it, with their versions, as a file has them.
    programs: String,
    settings: Settings,
    /// Its settings are all but [`FREE`].
    provenance: Provenance,
}

impl<'a> Part<'a> {
    fn open(path: &'a Path) -> Result<Self> {
        let film = image::read_head(path)?;
        let head = Head::of(&film).map_err(|what| Error::input(path, what))?;
        let programs = film.metadata.get(SOFTWARE).map_or("tallow of an unknown version", String::as_str).to_owned();
        let Head { mut provenance, settings: own, splits_light } = head;
        if let Some(settings) = provenance.settings.as_object_mut() {
            settings.retain(|key, _| !FREE.contains(&key.as_str()));
        }
        Ok(Self { path, splits_light, programs, settings: own, provenance })
    }

    /// Reads the samples.
    fn read(&self) -> Result<(Rendered, Film)> {
        let about = |what| Error::input(self.path, what);
        let film = image::read(self.path)?;
        let bytes = film.pixels() as u64 * (size_of::<Pixel>() as u64 + film::bytes_per_pixel(false));
        image::check_memory(self.path, bytes)?;
        let rendered = Rendered::of(&film).map_err(about)?;
        match rendered.provenance.samples == self.provenance.samples {
            true => Ok((rendered, film)),
            false => Err(about("was replaced while it was read: merge again".to_owned())),
        }
    }

    fn filtered(&self, film: &Film) -> Option<(PathBuf, String)> {
        film.metadata.get(FILTERED).map(|filter| (self.path.to_owned(), filter.clone()))
    }

    /// By this the parts are sorted: no two that may be merged have the same.
    fn first(&self) -> Option<SampleRange> {
        self.provenance.samples.iter().min().copied()
    }

    /// Why they cannot be merged.
    fn conflict(&self, other: &Self) -> Option<String> {
        if self.provenance.settings != other.provenance.settings {
            return Some(format!("was rendered with other settings: {}", differences(other, self)));
        }
        if self.provenance.scene != other.provenance.scene {
            return Some("shows another scene, or the same one changed".into());
        }
        if self.splits_light != other.splits_light {
            let lacks = if other.splits_light { "has, but another lacks," } else { "lacks, but another has," };
            return Some(format!("{lacks} direct and indirect light apart"));
        }
        let again = other.provenance.samples.iter().find(|b| self.provenance.samples.iter().any(|a| a.overlaps(b)))?;
        let SampleRange { seed, first, .. } = again;
        Some(format!("has samples {first} to {} of seed {seed} as well: they would count twice", again.last()))
    }
}

/// The settings in which the first differs from the second, each with both values.
fn differences(first: &Part, second: &Part) -> String {
    let pairs = first.settings.entries().into_iter().zip(second.settings.entries());
    let pairs = pairs.filter(|(a, b)| a.value != b.value && !FREE.contains(&a.name.replace('-', "_").as_str()));
    let said: Vec<_> = pairs.map(|(a, b)| format!("{} is {}, and {} in another", a.name, a.value, b.value)).collect();
    said.join("; ")
}

/// Several renders as one.
#[derive(Clone, Debug)]
pub struct Merged {
    /// As a render's own: it can be merged again, and resumed where its samples are spread evenly and close up to one range.
    pub film: Film,
    /// What is missing between its samples.
    pub gaps: Vec<Gap>,
    /// The parts whose pictures were filtered, and by what. The merged picture is not.
    pub filtered: Vec<(PathBuf, String)>,
    /// What rendered the parts, by name and version. Where there are several, their layers of light may be told apart by other rules.
    pub programs: BTreeSet<String>,
}

/// Samples that lie between those of a merged film.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gap {
    /// The seed of their sequence.
    pub seed: u32,
    /// Index of the first.
    pub first: u32,
    /// Index of the last.
    pub last: u32,
}

/// Joins the EXR files of renders that differ in nothing but their sample ranges or their seeds. Means and variances are
/// joined by the rule of Chan, Golub and LeVeque (1979): within rounding they are those of one render, and they have the same bits in
/// whatever order the files are named. Of what glass shows, albedos may weigh samples otherwise than one render does.
///
/// # Errors
/// [`Error::Input`] when a file cannot be read or does not belong to the others, [`Error::Memory`] when the host has not enough
/// of it free, [`Error::Usage`] when there is no file, or when a pixel would have more samples than it can count.
pub fn merge<P: AsRef<Path>>(files: &[P]) -> Result<Merged> {
    let parts = sorted(files)?;
    let (first, others) =
        parts.split_first().ok_or_else(|| Error::Usage("there are no files to merge: name at least one".into()))?;
    // What is not joined is the same in all but for rounding: it is taken from the first.
    let (whole, mut film) = first.read()?;
    let mut filtered: Vec<_> = first.filtered(&film).into_iter().collect();
    let mut ranges = ranges(first, whole.is_full());
    let Rendered { mut pixels, mut broken, .. } = whole;
    for part in others {
        let (rendered, own) = part.read()?;
        filtered.extend(part.filtered(&own));
        ranges.extend(self::ranges(part, rendered.is_full()));
        broken = BrokenSamples::join(broken, rendered.broken);
        pixels.iter_mut().zip(&rendered.pixels).for_each(|(a, b)| *a = join(a, b));
    }
    // One that was merged has several.
    let programs: BTreeSet<_> = parts.iter().flat_map(|part| part.programs.split(BETWEEN)).map(str::to_owned).collect();
    film.metadata.insert(SOFTWARE.to_owned(), Vec::from_iter(programs.iter().map(String::as_str)).join(BETWEEN));
    let samples = closed_up(ranges);
    film::replace_pixels(&mut film, &pixels);
    film::set_broken_samples(&mut film, broken);
    film.channels.retain(|c| c.name != film::PENDING && c.name != film::PRIORITY);
    provenance::set_samples(&mut film, &samples)?;
    Ok(Merged { film, gaps: gaps(&samples), filtered, programs })
}

/// The files by their first samples, if they can be merged.
fn sorted<P: AsRef<Path>>(files: &[P]) -> Result<Vec<Part<'_>>> {
    let mut parts = Vec::<Part>::new();
    for path in files.iter().map(AsRef::as_ref) {
        let part = Part::open(path)?;
        if let Some(what) = parts.iter().find_map(|earlier| earlier.conflict(&part)) {
            return Err(Error::input(path, what));
        }
        parts.push(part);
    }
    check_sum(parts.iter().flat_map(|part| &part.provenance.samples))?;
    parts.sort_by_key(Part::first);
    Ok(parts)
}

fn check_sum<'a>(ranges: impl Iterator<Item = &'a SampleRange>) -> Result<()> {
    let (sum, most) = (ranges.map(|range| u64::from(range.count)).sum::<u64>(), Settings::MAX_SPP);
    match sum > most.into() {
        true => Err(Error::Usage(format!("together the files have {sum} samples a pixel: merge {most} at most"))),
        false => Ok(()),
    }
}

/// The ranges of a part, each with whether every pixel of the part has all samples.
fn ranges(part: &Part, is_full: bool) -> Vec<(SampleRange, bool)> {
    part.provenance.samples.iter().map(|&range| (range, is_full)).collect()
}

/// The samples of all parts, sorted. Ranges that follow each other become one where every pixel has all of the former: only
/// then is its next sample the one behind its last.
fn closed_up(mut all: Vec<(SampleRange, bool)>) -> Vec<SampleRange> {
    all.sort();
    let mut closed: Vec<(SampleRange, bool)> = Vec::new();
    for (range, is_full) in all {
        match closed.last_mut() {
            Some((last, true)) if last.ends_before(&range) => {
                last.count += range.count;
                closed.last_mut().expect("the same one").1 = is_full;
            }
            _ => closed.push((range, is_full)),
        }
    }
    closed.into_iter().map(|(range, _)| range).collect()
}

/// What is missing between sorted ranges of one seed.
fn gaps(samples: &[SampleRange]) -> Vec<Gap> {
    let gap = |pair: &[SampleRange]| {
        let (from, to, seed) = (pair[0].last() + 1, pair[1].first, pair[1].seed);
        (pair[0].seed == seed && from < to).then(|| Gap { seed, first: from, last: to - 1 })
    };
    samples.windows(2).filter_map(gap).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    type Range = (u32, u32, u32);

    fn ranges(ranges: &[Range]) -> Vec<SampleRange> {
        ranges.iter().map(|&(seed, first, count)| SampleRange { seed, first, count }).collect()
    }

    fn part(of: &[Range], is_full: bool) -> Vec<(SampleRange, bool)> {
        ranges(of).into_iter().map(|range| (range, is_full)).collect()
    }

    fn closed(parts: &[Vec<(SampleRange, bool)>]) -> Vec<Range> {
        closed_up(parts.concat()).iter().map(|r| (r.seed, r.first, r.count)).collect()
    }

    #[test]
    fn ranges_close_up_behind_full_ones_alone() {
        let full = part(&[(0, 0, 4)], true);
        assert_eq!(closed(&[part(&[(0, 4, 3)], false), full]), [(0, 0, 7)]);
        assert_eq!(closed(&[part(&[(0, 0, 4)], false), part(&[(0, 4, 3)], true)]), [(0, 0, 4), (0, 4, 3)]);
        let both = [part(&[(0, 0, 4), (0, 8, 2), (1, 10, 2)], true), part(&[(0, 4, 4)], true)];
        assert_eq!(closed(&both), [(0, 0, 10), (1, 10, 2)], "other seeds are other sequences");
    }

    #[test]
    fn gaps_within_a_seed_are_found() {
        let ranges = closed_up(part(&[(0, 0, 64), (0, 128, 64), (0, 193, 1), (2, 300, 1)], true));
        assert_eq!(gaps(&ranges), [Gap { seed: 0, first: 64, last: 127 }, Gap { seed: 0, first: 192, last: 192 }]);
    }

    #[test]
    fn more_samples_than_a_pixel_can_count_are_refused() {
        let most = Settings::MAX_SPP;
        assert!(check_sum(ranges(&[(0, 0, most)]).iter()).is_ok());
        let error = check_sum(ranges(&[(0, 0, most), (1, 0, 1)]).iter()).unwrap_err().to_string();
        assert!(error.contains("16777217 samples a pixel"), "{error}");
    }
}
