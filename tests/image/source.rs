//! Tests that files of other programs keep everything but their colour channels, whatever their parts, windows and sample types.
use exr::prelude::*;
use std::path::{Path, PathBuf};
use tallow::error::Error;
use tallow::image::aov::{Aov, Aovs, Names};
use tallow::image::source::Source;
use tallow::image::{self, Film, Picture, Samples, Window, WriteOptions};
use tempfile::TempDir;

type Part = Layer<AnyChannels<FlatSamples>>;

fn part(name: &str, position: (i32, i32), size: (usize, usize), channels: Vec<AnyChannel<FlatSamples>>) -> Part {
    let attributes = LayerAttributes { layer_position: position.into(), ..LayerAttributes::named(name) };
    Layer::new(size, attributes, Encoding::FAST_LOSSLESS, AnyChannels::sort(channels.into()))
}

fn triple(names: [&str; 3], pixels: usize) -> Vec<AnyChannel<FlatSamples>> {
    let half = |c: usize| (0..pixels).map(|i| f16::from_f32((10 * i + c) as f32)).collect();
    (0..3).map(|c| AnyChannel::new(names[c], FlatSamples::F16(half(c)))).collect()
}

/// A display window of 4x3 pixels from the origin.
fn write(folder: &TempDir, parts: Vec<Part>) -> PathBuf {
    let path = folder.path().join("noisy.exr");
    let mut attributes = ImageAttributes::new(IntegerBounds::new((0, 0), (4, 3)));
    attributes.other.insert("samplesPerPixel".into(), attribute::AttributeValue::I32(16));
    Image::from_layers(attributes, parts).write().to_file(&path).unwrap();
    path
}

fn rewritten(source: &Source, folder: &TempDir) -> (Film, PathBuf) {
    let aovs = Aovs::find(&source.film, &Names::new()).unwrap();
    let colour = aovs.get(Aov::Colour).unwrap();
    let planes: Vec<Vec<f32>> =
        (0..3).map(|c| (0..source.film.pixels()).map(|i| colour.at(i)[c] + 0.25).collect()).collect();
    let channels: Vec<_> = aovs.colour.into_iter().zip(planes.iter().map(Vec::as_slice)).collect();
    let path = folder.path().join("clean.exr");
    std::fs::write(&path, source.encoded(&channels, None, ("filtered", Some("none"))).unwrap()).unwrap();
    assert_eq!(source.shown(None, &channels).unwrap(), shown(&path), "what is shown needs no file");
    (Source::read(&path).unwrap().film, path)
}

fn shown(path: &Path) -> Picture {
    image::read(path).unwrap().rec709(None).unwrap()
}

fn values(film: &Film, name: &str) -> Vec<f32> {
    film.channel(name).unwrap_or_else(|| panic!("no channel {name}")).to_f32().into_owned()
}

#[test]
fn only_the_colour_of_a_file_in_many_parts_changes() {
    let folder = tempfile::tempdir().unwrap();
    let colour = part("View.Combined", (0, 0), (4, 3), triple(["R", "G", "B"], 12));
    let normal = part("View.Normal", (0, 0), (4, 3), triple(["X", "Y", "Z"], 12));
    let source = Source::read(&write(&folder, vec![colour, normal])).unwrap();
    assert_eq!(source.film.metadata["samplesPerPixel"], "16");
    let (clean, path) = rewritten(&source, &folder);
    assert_eq!(clean.channel("View.Normal.Y"), source.film.channel("View.Normal.Y"));
    let filtered: Vec<f32> = values(&source.film, "View.Combined.G").iter().map(|v| v + 0.25).collect();
    assert_eq!(values(&clean, "View.Combined.G"), filtered);
    let parts = read_all_flat_layers_from_file(path).unwrap().layer_data;
    assert_eq!(parts.len(), 2);
    assert!(matches!(parts[1].channel_data.list[0].sample_data, FlatSamples::F16(_)), "what is kept keeps its type");
}

/// A file is decoded once: what is written again are the samples of the film.
#[test]
fn what_is_written_again_are_the_samples_that_were_decoded() {
    let folder = tempfile::tempdir().unwrap();
    let counts = AnyChannel::new("id", FlatSamples::U32(vec![7; 12]));
    let path = write(&folder, vec![part("main", (0, 0), (4, 3), [triple(["R", "G", "B"], 12), vec![counts]].concat())]);
    let mut source = Source::read(&path).unwrap();
    let ids = source.film.channels.iter_mut().find(|c| c.name == "id").unwrap();
    ids.samples = Samples::U32(vec![8; 12]);
    assert_eq!(values(&rewritten(&source, &folder).0, "id"), [8.0; 12]);
}

#[test]
fn what_was_there_stays_in_a_layer_of_the_same_part() {
    let folder = tempfile::tempdir().unwrap();
    let colour = part("View.Combined", (0, 0), (4, 3), triple(["R", "G", "B"], 12));
    let mask = part("mask", (0, 0), (4, 3), vec![AnyChannel::new("A", FlatSamples::F32(vec![1.0; 12]))]);
    let source = Source::read(&write(&folder, vec![colour, mask])).unwrap();
    let aovs = Aovs::find(&source.film, &Names::new()).unwrap();
    assert_eq!(aovs.keep_as(), Some("Noisy Image"));
    let channels: Vec<_> = aovs.colour.into_iter().map(|name| (name, &[7.0; 12][..])).collect();
    let path = folder.path().join("clean.exr");
    std::fs::write(&path, source.encoded(&channels, aovs.keep_as(), ("filtered", Some("none"))).unwrap()).unwrap();
    let clean = Source::read(&path).unwrap();
    assert_eq!(source.shown(None, &channels).unwrap(), shown(&path));
    assert_eq!(values(&clean.film, "View.Combined.G"), [7.0; 12]);
    let again = Aovs::find(&clean.film, &Names::new()).unwrap();
    let noisy = |aovs: &Aovs, i: usize| aovs.get(Aov::Colour).unwrap().at(i);
    assert!((0..12).all(|i| noisy(&again, i) == noisy(&aovs, i)), "it is what is filtered next");
    assert_eq!((again.colour, again.keep_as()), (aovs.colour, None));
    std::fs::write(&path, clean.encoded(&channels, None, ("filtered", Some("atrous"))).unwrap()).unwrap();
    let filtered = Source::read(&path).unwrap();
    assert_eq!(filtered.film.metadata["filtered"], "atrous");
    std::fs::write(&path, filtered.encoded(&[], None, ("filtered", None)).unwrap()).unwrap();
    let bare = Source::read(&path).unwrap().film;
    assert!(!bare.metadata.contains_key("filtered") && bare.channels == filtered.film.channels);
}

#[test]
fn pixels_outside_the_display_window_are_filtered_too_and_those_outside_the_data_window_are_unknown() {
    let folder = tempfile::tempdir().unwrap();
    // Colour and normal: columns -1 to 2 of rows 1 and 2. A mask of the whole display window makes the film larger.
    let colour = part("rgb", (-1, 1), (4, 2), triple(["R", "G", "B"], 8));
    let normal = part("N", (-1, 1), (4, 2), triple(["X", "Y", "Z"], 8));
    let mask = part("mask", (0, 0), (4, 3), vec![AnyChannel::new("A", FlatSamples::F32(vec![1.0; 12]))]);
    let source = Source::read(&write(&folder, vec![colour, normal, mask])).unwrap();
    assert_eq!((source.film.width, source.film.height), (5, 3));
    let aovs = Aovs::find(&source.film, &Names::new()).unwrap();
    let held: Vec<usize> = (0..15).filter(|&i| aovs.holds(i)).collect();
    assert_eq!(held, [5, 6, 7, 8, 10, 11, 12, 13]);
    let (clean, path) = rewritten(&source, &folder);
    assert_eq!(values(&clean, "rgb.R")[5..9], [0.25, 10.25, 20.25, 30.25]);
    let window = clean.channels.iter().find(|c| c.name == "rgb.R").unwrap().window;
    assert_eq!(window, Some(Window { first: [0, 1], size: [4, 2] }));
    // What is shown: column -1 is cut, row 0 and column 3 are black.
    let shown = image::read(&path).unwrap();
    assert_eq!(values(&shown, "rgb.R"), [0., 0., 0., 0., 10.25, 20.25, 30.25, 0., 50.25, 60.25, 70.25, 0.]);
}

#[test]
fn guides_of_another_size_than_the_colour_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let colour = || part("rgb", (0, 0), (4, 3), triple(["R", "G", "B"], 12));
    let albedo = |size: (usize, usize)| part("albedo", (0, 0), size, triple(["R", "G", "B"], size.0 * size.1));
    let find = |size| {
        let source = Source::read(&write(&folder, vec![colour(), albedo(size)])).unwrap();
        Aovs::find(&source.film, &Names::new()).map(|_| ())
    };
    let line = find((2, 3)).unwrap_err();
    assert!(line.contains("albedo.R") && line.contains("2x3") && line.contains("4x3"), "{line}");
    assert_eq!(find((4, 3)), Ok(()));
}

#[test]
fn other_formats_become_exr() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("noisy.hdr");
    let mut film = Film::new(2, 1);
    film.add_vec3("", ["R", "G", "B"], &[[1.0; 3], [2.0; 3]]);
    image::write(&path, &film, &WriteOptions::default()).unwrap();
    let (clean, _) = rewritten(&Source::read(&path).unwrap(), &folder);
    assert_eq!(clean.channel("R"), Some(&Samples::F32(vec![1.25, 2.25])));
}

#[test]
fn a_cut_file_is_an_input_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = write(&folder, vec![part("rgb", (0, 0), (4, 3), triple(["R", "G", "B"], 12))]);
    let bytes = std::fs::read(&path).unwrap();
    for length in [bytes.len() - 5, 100, 4] {
        std::fs::write(&path, &bytes[..length]).unwrap();
        assert!(matches!(Source::read(&path), Err(Error::Input { .. })), "{length} bytes");
    }
    assert!(matches!(Source::read(Path::new("missing.exr")), Err(Error::Input { .. })));
}
