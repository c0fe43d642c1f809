//! Tests `tallow compare --statistical`: verdicts, exit codes and files.
use crate::REC2020;
use crate::command::{complains, names, stdout, tallow};
use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};
use tallow::image::{self, Film, Samples, WriteOptions};
use tempfile::TempDir;

/// Writes an image like a render: every pixel is off by noise of this standard error, and the left half is brighter.
fn write(folder: &TempDir, name: &str, size: u32, error: f32, left: f32, seed: u64) {
    let mut random = fastrand::Rng::with_seed(seed);
    let mut film = Film::new(size, size);
    // Uniform noise of width w has standard deviation w / sqrt 12.
    let noise = |random: &mut fastrand::Rng| 1.0 + error * 12f32.sqrt() * (random.f32() - 0.5);
    let half = |i: usize| if i as u32 % size < size / 2 { left } else { 1.0 };
    let colour: Vec<_> = (0..film.pixels()).map(|i| [half(i) * noise(&mut random); 3]).collect();
    film.add_vec3("", ["R", "G", "B"], &colour);
    film.add_vec3("m2", ["R", "G", "B"], &vec![[error * error * 64.0 * 63.0; 3]; film.pixels()]);
    film.add("samples", Samples::U32(vec![64; film.pixels()]));
    film.metadata.insert("software".to_owned(), "tallow 0.1.0".to_owned());
    film.metadata.insert("cpu".to_owned(), "a & b\n\"c\"".to_owned());
    image::write(&folder.path().join(name), &film, &WriteOptions::default()).unwrap();
}

fn compare(folder: &TempDir, words: &str) -> Output {
    let words: Vec<_> = ["compare"].into_iter().chain(words.split_whitespace()).chain(["--statistical"]).collect();
    tallow(folder, &words)
}

fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    write(&folder, "a.exr", 32, 0.02, 1.0, 1);
    write(&folder, "b.exr", 32, 0.02, 1.0, 2);
    write(&folder, "bright.exr", 32, 0.02, 1.05, 3);
    folder
}

#[test]
fn each_verdict_has_its_exit_code() {
    let folder = folder();
    let same = compare(&folder, "a.exr b.exr");
    assert!(same.status.code() == Some(0) && same.stderr.is_empty(), "{same:?}");
    // 1024 pixels of 0.02 sqrt 2: 0.0009, of which four and a half can be seen.
    assert!(stdout(&same).starts_with("same: a difference of the whole image would have been seen from 0.4"));
    let different = compare(&folder, "bright.exr b.exr");
    complains(&different, 1, &["different: the whole image", "by +2.", "%"]);
    assert!(stdout(&different).contains("Differences are relative to B or, where B is darker"));
    assert!(!stdout(&same).contains("relative to B"), "control");
    let noisy = compare(&folder, "a.exr b.exr --resolve 0.001");
    complains(&noisy, 7, &["too noisy to say", "0.10 %", "times", "a pixel"]);
    let said = String::from_utf8(noisy.stderr).unwrap();
    let [times, each] = [" times", " a pixel"].map(|unit| said.split(unit).next().unwrap().rsplit(' ').next().unwrap());
    let digits = |number: &str| number.trim_end_matches('0').len();
    assert!(digits(times) <= 2 && digits(each) <= 2, "both are rounded alike: {said}");
    complains(&compare(&folder, "a.exr b.exr --at 16x16"), 7, &["a block of 16x16 pixels"]);
    assert_eq!(compare(&folder, "bright.exr b.exr --accept 0.1").status.code(), Some(0));
    let itself = compare(&folder, "a.exr a.exr");
    assert!(itself.status.success() && stdout(&itself).contains("equal bit for bit"));
    assert!(stdout(&tallow(&folder, &["--help"])).contains("\n  7    too noisy to say: compare --statistical"));
}

#[test]
fn beside_black_nothing_is_relative() {
    let folder = tempfile::tempdir().unwrap();
    for (name, one) in [("a.exr", 1.0), ("b.exr", 0.0)] {
        let mut film = Film::new(16, 16);
        let of_one = |value: f32| (0..256).map(|i| if i == 40 { [value; 3] } else { [0.0; 3] }).collect::<Vec<_>>();
        film.add_vec3("", ["R", "G", "B"], &of_one(one));
        film.add_vec3("m2", ["R", "G", "B"], &of_one(one * 16.0 * 15.0));
        film.add("samples", Samples::U32(vec![16; 256]));
        film.metadata.insert("software".to_owned(), "tallow 0.1.0".to_owned());
        image::write(&folder.path().join(name), &film, &WriteOptions::default()).unwrap();
    }
    let output = compare(&folder, "a.exr b.exr");
    complains(&output, 7, &["too noisy to say", "in the whole image B is black"]);
}

/// Of a filtered image its samples are tested, which is said wherever the verdict is.
#[test]
fn filtered_images_are_told_apart() {
    let folder = folder();
    let mut film = image::read(&folder.path().join("a.exr")).unwrap();
    let samples = film.picture(None).unwrap().pixels;
    film.add_vec3("Noisy Image", ["R", "G", "B"], &samples);
    film.metadata.insert("filtered".to_owned(), "auto".to_owned());
    film.channels.retain(|channel| !["R", "G", "B"].contains(&channel.name.as_str()));
    film.add_vec3("", ["R", "G", "B"], &vec![[7.0; 3]; film.pixels()]);
    image::write(&folder.path().join("clean.exr"), &film, &WriteOptions::default()).unwrap();
    let output = compare(&folder, "a.exr clean.exr --junit a.xml --html a.html");
    let note = "clean.exr was filtered (auto): what was tested are its samples, the layer \"Noisy Image\".";
    assert!(output.status.success() && stdout(&output).contains(note), "{output:?}");
    assert!(stdout(&output).contains("\nthe means of the samples are equal bit for bit\n"), "{output:?}");
    let text = |name: &str| std::fs::read_to_string(folder.path().join(name)).unwrap();
    assert!(text("a.xml").contains("b.filtered") && text("a.html").contains("was filtered (auto)"));
    let json: Value = serde_json::from_slice(&compare(&folder, "a.exr clean.exr --json").stdout).unwrap();
    assert!(json["b"]["filtered"] == "auto" && json["a"]["filtered"].is_null(), "{json}");
    assert!(!stdout(&compare(&folder, "a.exr b.exr")).contains("filtered"), "control");
}

#[test]
fn all_figures_are_in_the_json() {
    let folder = folder();
    let output = compare(&folder, "bright.exr b.exr --json --map map.png");
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(json["outcome"]["verdict"] == "different" && json["equal"] == false, "{json}");
    let levels = json["outcome"]["levels"].as_array().unwrap();
    let scales: Vec<_> = levels.iter().map(|level| level["scale"].as_str().unwrap()).collect();
    assert_eq!(scales, ["pixel", "4x4", "16x16", "image"]);
    let worst = &levels[2]["worst"][0];
    assert!((worst["difference"].as_f64().unwrap() - 0.05).abs() < 0.01, "{worst}");
    assert!(worst["place"]["first"][0] == 0, "the left half: {worst}");
    // Orange on the left, grey on the right.
    let map = image::read(&folder.path().join("map.png")).unwrap().picture(None).unwrap();
    let is_grey = |[r, g, b]: [f32; 3]| (r - g).abs() < 0.01 && (g - b).abs() < 0.01;
    assert!((0..32).all(|y| map.pixels[32 * y][0] > map.pixels[32 * y][2] + 0.1 && is_grey(map.pixels[32 * y + 31])));
    let json: Value = serde_json::from_slice(&compare(&folder, "a.exr b.exr --json").stdout).unwrap();
    assert!(json["outcome"]["verdict"] == "same" && json["outcome"]["visible"].as_f64().unwrap() < 0.01, "{json}");
}

#[test]
fn junit_has_a_case_for_every_scale() {
    let folder = folder();
    let junit = |words: &str| {
        compare(&folder, &format!("{words} --junit t.xml"));
        std::fs::read_to_string(folder.path().join("t.xml")).unwrap()
    };
    let same = junit("a.exr b.exr");
    assert!(same.contains("tests=\"4\"") && same.contains("failures=\"0\"") && !same.contains("<failure"), "{same}");
    assert!(same.contains("a &amp; b"), "{same}");
    let different = junit("bright.exr b.exr");
    assert!(different.contains("<failure message=\"different: the whole image\">"), "{different}");
    let noisy = junit("a.exr b.exr --resolve 0.001");
    assert!(noisy.contains("errors=\"1\"") && noisy.contains("<error message=\"too noisy to say"), "{noisy}");
}

#[test]
fn the_page_has_the_verdict_and_the_images_and_asks_nothing_of_the_network() {
    let folder = folder();
    std::fs::rename(folder.path().join("bright.exr"), folder.path().join("<b>.exr")).unwrap();
    complains(&compare(&folder, "<b>.exr b.exr --html t.html"), 1, &["different"]);
    let page = std::fs::read_to_string(folder.path().join("t.html")).unwrap();
    for part in ["different: the whole image", "data-name=\"map\"", "data-name=\"A\"", "block (0, 0) to (15, 15)"] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("<b>.exr") && !page.contains("http://") && !page.contains("https://"));
    complains(&compare(&folder, "b.exr b.exr --html b.exr"), 2, &["--html", "same file as"]);
}

#[test]
fn what_cannot_be_tested_is_one_line() {
    let folder = folder();
    write(&folder, "small.exr", 16, 0.02, 1.0, 1);
    write(&folder, "nan.exr", 32, f32::NAN, 1.0, 1);
    let mut bare = image::read(&folder.path().join("b.exr")).unwrap();
    bare.channels.retain(|c| c.name.len() == 1);
    let save =
        |film: &Film, name: &str| image::write(&folder.path().join(name), film, &WriteOptions::default()).unwrap();
    save(&bare, "bare.exr");
    save(&bare, "bare.png");
    let mut once = image::read(&folder.path().join("b.exr")).unwrap();
    once.channels.retain(|c| c.name != "samples");
    once.add("samples", Samples::U32(vec![1; 1024]));
    save(&once, "once.exr");
    let mut wide = image::read(&folder.path().join("b.exr")).unwrap();
    wide.primaries = Some(REC2020);
    save(&wide, "wide.exr");
    complains(&compare(&folder, "a.exr wide.exr"), 3, &["wide.exr", "other primaries"]);
    assert_eq!(compare(&folder, "wide.exr wide.exr").status.code(), Some(0));
    complains(&compare(&folder, "a.exr small.exr"), 3, &["32x32", "16x16"]);
    complains(&compare(&folder, "a.exr nan.exr"), 3, &["nan.exr", "each of its 1024 pixels"]);
    complains(&compare(&folder, "a.exr bare.exr"), 3, &["bare.exr", "does not say how noisy", "--errors"]);
    complains(&compare(&folder, "a.exr bare.png"), 3, &["bare.png", "--errors"]);
    complains(&compare(&folder, "a.exr once.exr"), 3, &["once.exr", "--spp 2"]);
    complains(&compare(&folder, "a.exr b.exr --at 256x256"), 3, &["256x256", "pixel, 4x4, 16x16, image"]);
    complains(&compare(&folder, "a.exr b.exr --at 5x5"), 2, &["'5x5'", "16x16"]);
    complains(&compare(&folder, "a.exr b.exr --false-alarms 0"), 2, &["above 0"]);
    complains(&compare(&folder, "a.exr b.exr --resolve 0"), 2, &["at least 1e-12"]);
    complains(&compare(&folder, "a.exr b.exr --layer N"), 2, &["--layer"]);
    complains(&compare(&folder, "a.exr b.exr --max-mse 1"), 2, &["--max-mse"]);
    complains(&compare(&folder, "a.exr b.exr --map a.exr"), 2, &["a.exr", ".png"]);
    complains(&compare(&folder, "a.exr b.exr --junit b.exr"), 2, &["--junit", "same file as B"]);
    complains(&compare(&folder, "a.exr b.exr --evidence a.exr"), 5, &["a.exr", "--evidence"]);
    // Nor does a file that was compared, or a report beside it, become another one.
    let bytes = || ["a.exr", "b.exr"].map(|name| std::fs::read(folder.path().join(name)).unwrap());
    let before = bytes();
    complains(&compare(&folder, "b.exr a.exr --evidence ."), 2, &["--evidence", "a.exr is the same file as B"]);
    complains(&compare(&folder, "a.exr b.exr --evidence . --html report.html"), 2, &["--html", "report.html"]);
    assert!(bytes() == before);
    complains(&tallow(&folder, &["compare", "a.exr", "b.exr", "--map", "m.png"]), 2, &["--statistical"]);
    // A reference without variance counts by its standard errors.
    let errors = {
        let mut film = Film::new(32, 32);
        film.add_vec3("", ["R", "G", "B"], &[[0.02; 3]; 1024]);
        film
    };
    save(&errors, "errors.exr");
    assert_eq!(compare(&folder, "a.exr bare.exr --errors errors.exr").status.code(), Some(0));
}

const CORNELL: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box");

fn render(folder: &TempDir, scene: &Path, seed: &str, output: &str) {
    let words = ["render", scene.to_str().unwrap(), "--seed", seed, "-o", output];
    let small = ["--width", "64", "--height", "64", "--spp", "256", "--quiet", "--validation"];
    let output = tallow(folder, &[&words[..], &small].concat());
    assert!(output.status.success(), "{output:?}");
}

#[test]
fn one_percent_of_one_material_is_found_and_its_pixels_render_again_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let scene = Path::new(CORNELL).join("scene.toml");
    let text = std::fs::read_to_string(&scene).unwrap();
    let red = text
        .replace("[0.65, 0.05, 0.05]", "[0.6565, 0.0505, 0.0505]")
        .replace("file = \"", &format!("file = \"{CORNELL}/"));
    assert_ne!(text, red);
    let changed = folder.path().join("red wall.toml");
    std::fs::write(&changed, red).unwrap();
    render(&folder, &changed, "1", "changed.exr");
    render(&folder, &scene, "2", "b.exr");
    render(&folder, &scene, "3", "c.exr");
    let same = compare(&folder, "c.exr b.exr --evidence nothing --json");
    assert_eq!(same.status.code(), Some(0), "{same:?}");
    let json: Value = serde_json::from_slice(&same.stdout).unwrap();
    assert!(json["evidence"].is_null(), "nothing is written: {json}");
    let found = compare(&folder, "changed.exr b.exr --evidence found --json");
    let json: Value = serde_json::from_slice(&found.stdout).unwrap();
    assert_eq!(json["evidence"], "found");
    assert_eq!(json["outcome"]["verdict"], "different");
    let objects =
        json["outcome"]["levels"].as_array().unwrap().iter().find(|level| level["scale"] == "object").unwrap();
    let worst = &objects["worst"][0];
    // The red wall is at the left.
    assert!(worst["place"]["last"][0].as_u64().unwrap() < 16, "{worst}");
    let [difference, error] = ["difference", "error"].map(|key| worst[key].as_f64().unwrap());
    assert!(error < 0.004 && (difference - 0.01).abs() < 3.0 * error, "{worst}");
    assert_eq!(std::fs::read_dir(folder.path().join("nothing")).unwrap().count(), 0, "they are the same");
    replayed(&folder);
    // What shows that others were not is gone once they are; what is not of a comparison stays.
    std::fs::write(folder.path().join("found/notes.txt"), "mine").unwrap();
    assert_eq!(compare(&folder, "c.exr b.exr --evidence found").status.code(), Some(0));
    assert_eq!(names(&folder.path().join("found")), ["notes.txt"]);
    std::fs::write(folder.path().join("nothing/report.json"), "{}").unwrap();
    let refused = compare(&folder, "c.exr b.exr --evidence nothing");
    complains(&refused, 2, &["--evidence nothing", "replace nothing/report.json", "another folder"]);
    assert_eq!(names(&folder.path().join("nothing")), ["report.json"]);
}

/// The names of the evidence are those of many a file of one's own.
#[test]
fn evidence_replaces_and_removes_only_what_it_wrote() {
    let folder = folder();
    let file = |name: &str| folder.path().join(name);
    let bytes = |names: &[&str]| names.iter().map(|name| std::fs::read(file(name)).unwrap()).collect::<Vec<_>>();
    write(&folder, "old.exr", 32, 0.02, 1.0, 5);
    std::fs::write(file("a.png"), "mine").unwrap();
    let own = ["a.exr", "a.png", "b.exr", "bright.exr", "old.exr"];
    let before = bytes(&own);
    // Neither images that differ nor, after them, those that are the same touch a file that is there already.
    for images in ["bright.exr old.exr", "bright.exr bright.exr"] {
        complains(&compare(&folder, &format!("{images} --evidence .")), 2, &["--evidence .", "./report.json"]);
        assert!(names(folder.path()) == own && bytes(&own) == before, "{images}");
    }
    // What a comparison wrote the next one replaces, and removes what it makes no more of.
    let red = Film::from(&image::Picture { width: 32, height: 32, pixels: vec![[0.02; 3]; 1024] });
    for name in ["errors.exr", "b.hdr"] {
        image::write(&file(name), &red, &WriteOptions::default()).unwrap();
    }
    let evidence = ["a.exr", "a.png", "b.exr", "b.png", "map.png", "replay.sh", "report.html", "report.json"];
    complains(&compare(&folder, "bright.exr old.exr --evidence found"), 1, &["different"]);
    assert_eq!(names(&file("found")), evidence);
    complains(&compare(&folder, "bright.exr b.hdr --errors errors.exr --evidence found"), 1, &["different"]);
    assert_eq!(names(&file("found")), evidence.map(|name| if name == "b.exr" { "b.hdr" } else { name }));
    // A file that takes the name of one that is gone is not the comparison's, nor what only lies beside.
    std::fs::write(file("found/b.exr"), "mine").unwrap();
    complains(&compare(&folder, "bright.exr old.exr --evidence found"), 2, &["found/b.exr", "found/report.json"]);
    std::fs::rename(file("found/b.exr"), file("found/notes.txt")).unwrap();
    // An image that is compared stays, and so do options' files.
    complains(
        &compare(&folder, "bright.exr old.exr --html found/b.hdr --evidence found"),
        2,
        &["--evidence", "--html"],
    );
    complains(&compare(&folder, "bright.exr bare.exr --errors found/b.hdr --evidence found"), 2, &["--errors"]);
    assert_eq!(compare(&folder, "found/a.exr found/a.exr --evidence found").status.code(), Some(0));
    assert_eq!(names(&file("found")), ["a.exr", "notes.txt"]);
    assert!(bytes(&["found/a.exr"]) == bytes(&["bright.exr"]) && bytes(&["found/notes.txt"]) == [b"mine"]);
    // Whatever a report lists, nothing goes but what a comparison writes.
    std::fs::write(file("found/report.json"), r#"{"files": ["../a.exr", "notes.txt", "report.json"]}"#).unwrap();
    assert_eq!(
        compare(&folder, "old.exr old.exr --evidence found").status.code(),
        Some(2),
        "found/a.exr is not listed"
    );
    assert_eq!(compare(&folder, "found/a.exr bright.exr --evidence found").status.code(), Some(0));
    assert_eq!(names(&file("found")), ["a.exr", "notes.txt"]);
    assert!(bytes(&own) == before);
}

/// Runs the first command of the evidence.
fn replayed(folder: &TempDir) {
    let file = |name: &str| folder.path().join("found").join(name);
    for name in ["a.exr", "b.exr", "a.png", "b.png", "map.png", "report.html", "report.json"] {
        assert!(file(name).is_file(), "{name}");
    }
    let report: Value = serde_json::from_slice(&std::fs::read(file("report.json")).unwrap()).unwrap();
    assert!(report["a"]["device"].is_string() && report["b"]["driver"].is_string() && report["a"]["cpu"].is_string());
    let script = std::fs::read_to_string(file("replay.sh")).unwrap();
    let line = script.lines().find(|line| line.starts_with("tallow render")).unwrap();
    let program = format!("tallow() {{ \"{}\" \"$@\"; }}; {line}", env!("CARGO_BIN_EXE_tallow"));
    let output = Command::new("sh").args(["-c", &program]).current_dir(folder.path()).output().unwrap();
    assert!(output.status.success(), "{line}: {output:?}");
    let name = line.rsplit(' ').next().unwrap();
    let [alone, whole] = [name, "changed.exr"].map(|name| image::read(&folder.path().join(name)).unwrap());
    let pixel = report["pixels"][0]["place"]["first"].as_array().unwrap();
    let at = (pixel[1].as_u64().unwrap() * 64 + pixel[0].as_u64().unwrap()) as usize;
    for channel in ["R", "G", "B", "m2.R", "samples"] {
        let [alone, whole] = [&alone, &whole].map(|film| film.channel(channel).unwrap());
        assert_eq!(alone.at(at).to_bits(), whole.at(at).to_bits(), "{channel} of {line}");
    }
    let Some(Samples::U32(counts)) = alone.channel("samples") else { panic!("counts") };
    assert!(counts.iter().enumerate().all(|(i, n)| *n == if i == at { 256 } else { 0 }), "no other pixel has samples");
}

#[test]
fn a_pixel_outside_of_the_film_and_a_file_of_one_pixel_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let scene = Path::new(CORNELL).join("scene.toml");
    let words = |pixel: &'static str| {
        let scene = scene.to_str().unwrap().to_owned();
        let words = [
            "render", &scene, "--pixel", pixel, "--width", "8", "--height", "8", "--spp", "4", "--quiet", "-o", "p.exr",
        ];
        tallow(&folder, &words)
    };
    complains(&words("8,0"), 2, &["--pixel 8,0", "8x8"]);
    complains(&words("8"), 2, &["12,34"]);
    assert!(words("7,7").status.success());
    let resume = ["render", scene.to_str().unwrap(), "--resume", "p.exr", "--width", "8", "--height", "8", "--quiet"];
    complains(&tallow(&folder, &resume), 3, &["p.exr", "metadata"]);
}
