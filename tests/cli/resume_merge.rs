//! Tests which files `--resume` and `merge` accept, and their results.
use crate::command::{complains, names, tallow};
use std::process::Output;
use tallow::image::{self, Film, Samples, Window};
use tempfile::TempDir;

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");
const SIZE: u32 = 8;

fn run(folder: &TempDir, words: &str) -> Output {
    tallow(folder, &words.split_whitespace().collect::<Vec<_>>())
}

fn render(folder: &TempDir, words: &str) -> Output {
    run(folder, &format!("render {SCENE} --width {SIZE} --height {SIZE} --max-depth 2 --quiet {words}"))
}

#[track_caller]
fn well(output: Output) {
    assert_eq!((output.status.code(), String::from_utf8_lossy(&output.stderr).as_ref()), (Some(0), ""));
}

fn read(folder: &TempDir, name: &str) -> Film {
    image::read(&folder.path().join(name)).unwrap()
}

fn write(folder: &TempDir, name: &str, film: &Film) {
    image::write(&folder.path().join(name), film, &Default::default()).unwrap();
}

fn floats<'a>(film: &'a mut Film, name: &str) -> &'a mut Vec<f32> {
    match film.channels.iter_mut().find(|c| c.name == name).map(|c| &mut c.samples) {
        Some(Samples::F32(values)) => values,
        _ => panic!("no floats {name}"),
    }
}

fn counts<'a>(film: &'a mut Film, name: &str) -> &'a mut Vec<u32> {
    match film.channels.iter_mut().find(|c| c.name == name).map(|c| &mut c.samples) {
        Some(Samples::U32(values)) => values,
        _ => panic!("no counts {name}"),
    }
}

/// The left upper corner, or the film with a border of copies.
fn resized(film: &Film, width: u32, height: u32) -> Film {
    let at = |i: u32| ((i / width % SIZE) * SIZE + i % width % SIZE) as usize;
    let mut other = Film::new(width, height);
    for channel in &film.channels {
        let samples = match &channel.samples {
            Samples::F32(v) => Samples::F32((0..width * height).map(|i| v[at(i)]).collect()),
            Samples::U32(v) => Samples::U32((0..width * height).map(|i| v[at(i)]).collect()),
        };
        other.add(channel.name.clone(), samples);
    }
    other.metadata = film.metadata.clone();
    other
}

type Fault = (&'static str, fn(&mut Film));

/// What a render of 2 samples a pixel cannot be, and a word of the line that says so.
const FAULTS: [Fault; 23] = [
    ("is 4x4", |f| *f = resized(f, 4, 4)),
    ("is 16x4", |f| *f = resized(f, 16, 4)),
    ("is 16x16", |f| *f = resized(f, 16, 16)),
    ("NaN", |f| floats(f, "R")[5] = f32::NAN),
    ("inf", |f| floats(f, "direct.G")[0] = f32::INFINITY),
    ("-inf", |f| floats(f, "albedo.B")[63] = f32::NEG_INFINITY),
    ("NaN in the layer m2", |f| floats(f, "m2.R")[9] = f32::NAN),
    ("pixel (1, 1) has -1 in the layer m2", |f| floats(f, "m2.B")[9] = -1.0),
    ("pixel (3, 0) has 3 samples", |f| counts(f, "samples")[3] = 3),
    ("4294967295 samples", |f| counts(f, "samples")[0] = u32::MAX),
    ("light in part", |f| f.channels.retain(|c| c.name != "direct.G")),
    ("light in part", |f| f.channels.retain(|c| !c.name.starts_with("indirect."))),
    ("m2.G", |f| f.channels.retain(|c| c.name != "m2.G")),
    ("samples", |f| f.channels.retain(|c| c.name != "samples")),
    ("\"R\"", |f| f.channels.retain(|c| c.name != "R")),
    ("allow 2", |f| f.add("pending", Samples::U32([vec![0; 63], vec![1]].concat()))),
    ("allow 2", |f| f.add("pending", Samples::U32(vec![u32::MAX; 64]))),
    ("pending", |f| f.add("pending", Samples::F32(vec![0.0; 64]))),
    ("no samples yet", |f| ranges(f, "[]")),
    ("empty", |f| ranges(f, r#"[{"seed":0,"first":0,"count":0}]"#)),
    ("32 bits", |f| ranges(f, r#"[{"seed":0,"first":4294967295,"count":2}]"#)),
    ("overlap", |f| ranges(f, r#"[{"seed":0,"first":0,"count":2},{"seed":0,"first":1,"count":2}]"#)),
    ("can count", |f| ranges(f, r#"[{"seed":0,"first":0,"count":16777217}]"#)),
];

fn ranges(film: &mut Film, text: &str) {
    film.metadata.insert("sampleRanges".to_owned(), text.to_owned());
}

#[test]
fn neither_believes_what_cannot_be() {
    let folder = tempfile::tempdir().unwrap();
    well(render(&folder, "--spp 2 -o a.exr"));
    well(render(&folder, "--spp 2 --first-sample 2 -o b.exr"));
    let right = read(&folder, "a.exr");
    for (i, (word, spoil)) in FAULTS.into_iter().enumerate() {
        let mut film = right.clone();
        spoil(&mut film);
        write(&folder, "bad.exr", &film);
        eprintln!("fault {i}, {word}");
        complains(&render(&folder, "--spp 4 --resume bad.exr -o not.exr"), 3, &["bad.exr", word]);
        complains(&run(&folder, "merge bad.exr b.exr -o not.exr"), 3, &["bad.exr", word]);
        complains(&run(&folder, "merge b.exr bad.exr -o not.exr"), 3, &["bad.exr", word]);
    }
    assert!(!folder.path().join("not.exr").exists());
    // Control: what is right is believed after it was read and written.
    write(&folder, "good.exr", &right);
    well(run(&folder, "merge good.exr b.exr -o merged.exr"));
    well(render(&folder, "--spp 4 --resume good.exr -o resumed.exr"));
}

/// Priorities of round 1 are as noisy as the samples before: sums of such squares are beyond the largest float.
#[test]
fn priorities_that_are_no_numbers_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let words = "--spp 16 --allocate variance --min-spp 4 --rounds 2";
    well(render(&folder, &format!("{words} -o a.exr")));
    let mut film = read(&folder, "a.exr");
    counts(&mut film, "samples").fill(4);
    ranges(&mut film, r#"[{"seed":0,"first":0,"count":4}]"#);
    film.metadata.insert("allocations".to_owned(), "1".to_owned());
    write(&folder, "sound.exr", &film);
    for channel in ["m2.R", "m2.G"] {
        floats(&mut film, channel)[9] = 3e38;
    }
    write(&folder, "noisy.exr", &film);
    // Of the pixel and its neighbours, whose noise it is part of.
    let told = ["warning: 9 priorities were not finite and counted for nothing"];
    complains(&render(&folder, &format!("{words} --resume noisy.exr -o b.exr")), 0, &told);
    well(render(&folder, &format!("{words} --resume sound.exr -o b.exr")));
}

/// Versions may tell direct light from indirect by other rules.
#[test]
fn parts_of_other_versions_are_told() {
    let folder = tempfile::tempdir().unwrap();
    well(render(&folder, "--spp 2 -o a.exr"));
    well(render(&folder, "--spp 2 --first-sample 2 -o b.exr"));
    let mut older = read(&folder, "b.exr");
    older.metadata.insert("software".to_owned(), "tallow 0.0.1".to_owned());
    write(&folder, "older.exr", &older);
    let own = concat!("tallow ", env!("CARGO_PKG_VERSION"));
    let told =
        format!("note: the parts are of tallow 0.0.1 and {own}: their layers direct and albedo may hold other light");
    complains(&run(&folder, "merge a.exr older.exr -o whole.exr"), 0, &[&told]);
    // What reads the file next is told so, too, and by a merge of merged files once.
    let both = format!("tallow 0.0.1, {own}");
    assert_eq!(read(&folder, "whole.exr").metadata["software"], both);
    well(render(&folder, "--spp 2 --first-sample 4 -o c.exr"));
    complains(&run(&folder, "merge c.exr whole.exr -o more.exr"), 0, &[&told]);
    assert_eq!(read(&folder, "more.exr").metadata["software"], both);
    well(run(&folder, "merge a.exr b.exr -o whole.exr"));
}

/// As other tools replace their input; what cannot be written whole replaces nothing.
#[test]
fn a_part_that_the_merged_render_replaces_is_named_and_never_lost() {
    let folder = tempfile::tempdir().unwrap();
    well(render(&folder, "--spp 2 -o a.exr"));
    well(render(&folder, "--spp 2 --first-sample 2 -o b.exr"));
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
    let before = bytes("b.exr");
    #[cfg(target_os = "linux")]
    {
        let mut shell = std::process::Command::new("sh");
        shell.args(["-c", "ulimit -f 1; exec \"$0\" merge a.exr b.exr -o ./b.exr", env!("CARGO_BIN_EXE_tallow")]);
        complains(&shell.current_dir(folder.path()).output().unwrap(), 5, &["./b.exr", "free some space"]);
        assert!(bytes("b.exr") == before && names(folder.path()) == ["a.exr", "b.exr"]);
    }
    well(run(&folder, "merge a.exr b.exr -o whole.exr"));
    complains(&run(&folder, "merge a.exr b.exr -o ./b.exr"), 0, &["note: b.exr was one of the parts"]);
    assert!(bytes("b.exr") == bytes("whole.exr") && bytes("b.exr") != before);
    // The same command again finds samples that would count twice, and leaves the file as it is.
    complains(&run(&folder, "merge a.exr b.exr -o b.exr"), 3, &["would count twice"]);
    assert!(bytes("b.exr") == bytes("whole.exr"));
}

#[test]
fn what_cannot_be_merged_is_refused_before_pixels_are_read() {
    let folder = tempfile::tempdir().unwrap();
    well(render(&folder, "--spp 2 -o a.exr"));
    let mut bytes = std::fs::read(folder.path().join("a.exr")).unwrap();
    let behind = bytes.len() - 200;
    bytes[behind..].fill(0);
    std::fs::write(folder.path().join("damaged.exr"), bytes).unwrap();
    complains(&run(&folder, "merge damaged.exr a.exr -o not.exr"), 3, &["a.exr", "count twice"]);
    // Control: they are read in the end.
    well(render(&folder, "--spp 2 --first-sample 2 -o b.exr"));
    complains(&run(&folder, "merge damaged.exr b.exr -o not.exr"), 3, &["damaged.exr", "cannot be decoded"]);
    assert!(!folder.path().join("not.exr").exists());
}

/// A file whose data window is a part of its display window: pixels that it does not hold would be black.
#[test]
fn a_cut_out_is_no_render() {
    use exr::prelude::*;
    let folder = tempfile::tempdir().unwrap();
    well(render(&folder, "--spp 2 -o a.exr"));
    let path = folder.path().join("a.exr");
    let mut file = read_all_flat_layers_from_file(&path).unwrap();
    let part = &mut file.layer_data[0];
    part.size = Vec2(8, 4);
    for channel in &mut part.channel_data.list {
        match &mut channel.sample_data {
            FlatSamples::F32(v) => v.truncate(32),
            FlatSamples::U32(v) => v.truncate(32),
            FlatSamples::F16(_) => unreachable!("renders hold none"),
        }
    }
    file.write().to_file(&path).unwrap();
    let held = self::read(&folder, "a.exr").channels[0].window;
    assert_eq!(held, Some(Window { first: [0, 0], size: [8, 4] }));
    complains(&render(&folder, "--spp 4 --resume a.exr -o not.exr"), 3, &["a.exr", "8x8, in part"]);
}

#[test]
fn what_placed_samples_lack_is_within_their_budget() {
    let folder = tempfile::tempdir().unwrap();
    let words = "--allocate variance --budget-spp 4 --min-spp 2";
    well(render(&folder, &format!("{words} -o a.exr")));
    let right = read(&folder, "a.exr");
    let resumes = |film: &Film| {
        write(&folder, "b.exr", film);
        render(&folder, &format!("{words} --resume b.exr -o c.exr"))
    };
    let pending = |of_first: u32, others: u32| {
        let mut film = right.clone();
        // As after the first two samples: 128 are still to be placed.
        counts(&mut film, "samples").fill(2);
        film.add("pending", Samples::U32([vec![of_first], vec![others; 63]].concat()));
        film
    };
    well(resumes(&pending(128, 0)));
    complains(&resumes(&pending(129, 0)), 3, &["b.exr", "257 samples", "allow 256"]);
    complains(&resumes(&pending(0, 1_000_000)), 3, &["b.exr", "allow 256"]);
    complains(&resumes(&pending(u32::MAX, 0)), 3, &["b.exr", "allow 16777216"]);
    let mut bare = right.clone();
    bare.channels.retain(|c| c.name != "priority");
    complains(&resumes(&bare), 3, &["b.exr", "\"priority\""]);
    let mut endless = right.clone();
    endless.metadata.insert("allocations".to_owned(), u32::MAX.to_string());
    complains(&resumes(&endless), 3, &["b.exr", "allocations"]);
}

#[test]
fn a_render_that_has_more_samples_than_are_asked_for_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    well(render(&folder, "--spp 6 -o a.exr"));
    let before = std::fs::read(folder.path().join("a.exr")).unwrap();
    let fewer = render(&folder, "--spp 5 --resume a.exr -o a.exr");
    complains(&fewer, 2, &["a.exr", "has 6 samples a pixel, more than --spp 5"]);
    assert!(std::fs::read(folder.path().join("a.exr")).unwrap() == before, "it was replaced");
    let mut uneven = read(&folder, "a.exr");
    counts(&mut uneven, "samples")[7] = 4;
    write(&folder, "c.exr", &uneven);
    let fewer = render(&folder, "--spp 5 --resume c.exr -o a.exr");
    complains(&fewer, 2, &["c.exr: has 4 to 6 samples a pixel, more than --spp 5: choose 6 or more"]);
    well(render(&folder, "--spp 6 --resume a.exr -o b.exr"));
    assert_eq!(counts(&mut read(&folder, "b.exr"), "samples"), &[6; 64], "as many are no contradiction");
}

#[test]
fn settings_that_keep_a_render_from_going_on_are_named() {
    let folder = tempfile::tempdir().unwrap();
    well(render(&folder, "--spp 2 -o a.exr"));
    let other = render(&folder, "--spp 4 --clamp-indirect 1.1 --filter tent --resume a.exr -o b.exr");
    let parts = ["only spp may differ: filter was box, now tent; clamp-indirect was 0, now 1.1"];
    complains(&other, 3, &parts);
    assert!(String::from_utf8_lossy(&other.stderr).trim_end().ends_with(parts[0]), "{other:?}");
    let placed = render(&folder, "--spp 4 --allocate geometry --resume a.exr -o b.exr");
    complains(&placed, 3, &["other settings: spp was 2, now 4; policy was uniform, now geometry"]);
}

/// What a filter made of its parts is no picture of all samples.
#[test]
fn that_a_filter_is_left_out_is_told() {
    let folder = tempfile::tempdir().unwrap();
    well(render(&folder, "--spp 2 -o a.exr --denoise atrous"));
    well(render(&folder, "--spp 2 --first-sample 2 -o b.exr"));
    complains(
        &run(&folder, "merge b.exr a.exr -o m.exr"),
        0,
        &["note: a.exr was filtered (atrous)", "tallow filter m.exr"],
    );
    assert!(!read(&folder, "m.exr").metadata.contains_key("filtered"));
    let words = format!("render {SCENE} --width {SIZE} --height {SIZE} --max-depth 2 --spp 4 --resume a.exr -o c.exr");
    let told = |words: &str| String::from_utf8(run(&folder, words).stderr).unwrap();
    assert!(told(&words).contains("was filtered (atrous), and this one will not be: add --denoise atrous"));
    let [filtered, quiet] = [told(&format!("{words} --denoise atrous")), told(&format!("{words} --quiet"))];
    assert!(!filtered.contains("was filtered") && quiet.is_empty(), "{filtered}{quiet}");
    // A file that the filter none has made is not filtered.
    well(render(&folder, "--spp 2 -o d.exr"));
    well(run(&folder, "filter d.exr --filter none --quiet -o none.exr"));
    well(run(&folder, "merge b.exr none.exr -o m.exr"));
    let resumed = told(&words.replace("a.exr", "none.exr"));
    assert!(!resumed.contains("filtered"), "{resumed}");
}

#[test]
fn a_file_without_layers_takes_no_merged_render() {
    let folder = tempfile::tempdir().unwrap();
    well(render(&folder, "--spp 2 -o a.exr"));
    well(render(&folder, "--spp 2 --first-sample 2 -o b.exr"));
    for name in ["m.png", "m.hdr"] {
        complains(&run(&folder, &format!("merge a.exr b.exr -o {name}")), 2, &[name, ".exr"]);
        assert!(!folder.path().join(name).exists());
    }
    well(run(&folder, "merge a.exr b.exr -o m.EXR"));
}

#[test]
fn light_that_is_not_kept_apart_is_not_halved() {
    let folder = tempfile::tempdir().unwrap();
    well(render(&folder, "--spp 2 -o a.exr"));
    well(render(&folder, "--spp 2 --first-sample 2 -o b.exr"));
    let mut whole = read(&folder, "b.exr");
    whole.channels.retain(|c| !c.name.contains("direct."));
    write(&folder, "whole.exr", &whole);
    complains(&run(&folder, "merge a.exr whole.exr -o c.exr"), 3, &["whole.exr", "lacks", "direct and indirect"]);
    complains(&run(&folder, "merge whole.exr a.exr -o c.exr"), 3, &["a.exr", "another lacks", "direct and indirect"]);
    let mut other = read(&folder, "a.exr");
    other.channels.retain(|c| !c.name.contains("direct."));
    write(&folder, "a.exr", &other);
    well(run(&folder, "merge whole.exr a.exr -o c.exr"));
}

#[test]
fn the_order_of_the_files_changes_no_bit_and_gaps_are_told() {
    let folder = tempfile::tempdir().unwrap();
    well(render(&folder, "--spp 3 -o a.exr"));
    well(render(&folder, "--spp 2 --first-sample 5 -o b.exr"));
    well(render(&folder, "--spp 1 --seed 7 -o c.exr"));
    let merged = |order: &str| {
        let output = run(&folder, &format!("merge {order} -o merged.exr"));
        complains(&output, 0, &["samples 3 to 4 of seed 0 are missing"]);
        std::fs::read(folder.path().join("merged.exr")).unwrap()
    };
    let first = merged("a.exr b.exr c.exr");
    for order in ["b.exr c.exr a.exr", "c.exr b.exr a.exr", "a.exr c.exr b.exr"] {
        assert!(merged(order) == first, "{order}");
    }
}

#[test]
fn a_merged_file_whose_ranges_close_up_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    well(render(&folder, "--spp 3 -o a.exr"));
    well(render(&folder, "--spp 2 --first-sample 3 -o b.exr"));
    well(render(&folder, "--spp 4 --first-sample 5 -o c.exr"));
    well(render(&folder, "--spp 9 -o whole.exr"));
    let resumes = |name: &str| render(&folder, &format!("--spp 9 --resume {name} -o resumed.exr"));
    let close = |a: &Film, b: &Film| {
        let [a, b] = [a, b].map(|film| film.picture(None).unwrap().pixels.concat());
        a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= 3e-6 * a + 1e-9)
    };
    well(run(&folder, "merge b.exr a.exr -o ab.exr"));
    well(resumes("ab.exr"));
    let (whole, mut resumed) = (read(&folder, "whole.exr"), read(&folder, "resumed.exr"));
    assert!(close(&whole, &resumed), "samples 5 to 8 are those that were added");
    assert_eq!(counts(&mut resumed, "samples"), &[9; 64]);
    assert!(!close(&whole, &read(&folder, "ab.exr")), "control");
    // With a gap it cannot, and once that is filled it can.
    let gap = run(&folder, "merge a.exr c.exr -o ac.exr");
    complains(&gap, 0, &["samples 3 to 4 of seed 0 are missing"]);
    complains(&resumes("ac.exr"), 3, &["ac.exr", "was merged", "--first-sample"]);
    well(run(&folder, "merge ac.exr b.exr -o abc.exr"));
    well(resumes("abc.exr"));
    assert!(close(&whole, &read(&folder, "resumed.exr")));
    // A pixel that lacks samples of the former range has a gap of its own.
    let mut short = read(&folder, "a.exr");
    counts(&mut short, "samples")[20] = 2;
    write(&folder, "short.exr", &short);
    well(run(&folder, "merge short.exr b.exr -o sb.exr"));
    complains(&resumes("sb.exr"), 3, &["sb.exr", "was merged"]);
}
