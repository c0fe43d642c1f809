//! Tests `tallow cost` on a small film: what is in its files, that a point can be rendered again to the same bits, and what it
//! does when it is interrupted or when points fail.
#![cfg(target_os = "linux")]
use crate::REC2020;
use crate::child::{Running, command};
use crate::command::{complains, scene};
use etcetera::BaseStrategy;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tallow::cost::Document;
use tallow::cost::document::{NoiseKind, Point};
use tallow::image;
use tallow::image::metrics::relmse;
use tempfile::TempDir;

const FILM: &str = "--width 24 --height 24 --reference-spp 64 --validation";

/// A folder whose cache is its own, but for that of llvmpipe: what it has compiled is the same for all.
fn within(folder: &TempDir, words: &str) -> Command {
    let mut command = command(folder.path(), words);
    command.env("MESA_SHADER_CACHE_DIR", etcetera::choose_base_strategy().unwrap().cache_dir());
    command.env("XDG_CACHE_HOME", folder.path().join("cache"));
    command
}

fn cost(folder: &TempDir, words: &str) -> Output {
    cost_with(folder, FILM, words)
}

fn cost_with(folder: &TempDir, film: &str, words: &str) -> Output {
    within(folder, &format!("cost {} {film} {words}", scene())).output().unwrap()
}

#[track_caller]
fn text(output: &Output, code: i32) -> String {
    assert_eq!(output.status.code(), Some(code), "{output:?}");
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn document(folder: &TempDir, name: &str) -> Document {
    serde_json::from_slice(&std::fs::read(folder.path().join(name)).unwrap()).unwrap()
}

fn point<'a>(document: &'a Document, label: &str) -> &'a Point {
    document.points.iter().find(|point| point.method.label() == label).unwrap()
}

/// The pictures of a page.
fn pictures(folder: &TempDir) -> Vec<String> {
    let page = std::fs::read_to_string(folder.path().join("all/cost.html")).unwrap();
    let begin = "<script type=\"application/octet-stream\">";
    page.split(begin).skip(1).map(|rest| rest.split('<').next().unwrap().to_owned()).collect()
}

/// The reference that was rendered and kept.
fn reference(folder: &TempDir) -> PathBuf {
    let kept = std::fs::read_dir(folder.path().join("cache/tallow/references")).unwrap();
    kept.map(|entry| entry.unwrap().path()).next().unwrap()
}

#[test]
fn what_is_refused_leaves_no_folder() {
    let folder = tempfile::tempdir().unwrap();
    for (words, code) in [("cost missing.toml", 3), ("cost --filter-only missing.exr --reference missing.exr", 3)] {
        text(&within(&folder, &format!("{words} -o results")).output().unwrap(), code);
        assert!(!folder.path().join("results").exists(), "{words}");
    }
}

#[test]
fn a_grid_is_measured_and_each_point_can_be_rendered_again() {
    let folder = tempfile::tempdir().unwrap();
    let words = "--allocate uniform,both --denoise none,atrous --spp 1,4 --repeats 2 -o all --variant";
    let mut command = within(&folder, &format!("cost {} {FILM} {words}", scene()));
    let printed = text(&command.args(["--levels 2 --sigma-n inf"]).output().unwrap(), 0);
    assert!(printed.contains("uniform + atrous, 4 spp") && printed.contains("halve relMSE"), "{printed}");
    assert_eq!(printed.contains(" *"), printed.contains("\n*: uniform unfiltered"), "{printed}");
    let document = document(&folder, "all/cost.json");
    assert!(document.complete && document.points.len() == 8 + 4, "what is not filtered has no levels: {document:?}");
    for point in &document.points {
        assert!(point.runs.len() == 2 && point.summary.is_some() && point.failed.is_none(), "{point:?}");
        let sum: f64 = point.runs[0].passes.iter().map(|pass| pass.ms).sum();
        assert!((sum - point.runs[0].gpu_ms).abs() < 1e-6 && point.runs[0].rays.unwrap() > 576);
    }
    assert!(document.reference.noise == NoiseKind::Measured && document.reference.spp == Some(64));
    replays(&folder, &document, "uniform + atrous, 4 spp");
    replays(&folder, &document, "both + atrous, 4 spp");
    replays(&folder, &document, "both + atrous, levels 2 --sigma-n inf, 4 spp");
    tables(&folder, &document);
}

/// Renders a point by its command line, whose image must have the very error of the point's first run.
#[track_caller]
fn replays(folder: &TempDir, document: &Document, label: &str) {
    let point = point(document, label);
    for words in point.command.split(" && ").map(|command| command.strip_prefix("tallow ").unwrap()) {
        let output = within(folder, words).output().unwrap();
        assert!(output.status.success(), "{words}: {output:?}");
    }
    let picture = |path: &Path| image::read(path).unwrap().picture(None).unwrap();
    let (_, file) = point.command.rsplit_once(' ').unwrap();
    let file = file.replace("####", "0008");
    let (image, reference) = (picture(&folder.path().join(file)), picture(&reference(folder)));
    let error = relmse(&image, &reference) - document.reference.relmse.unwrap();
    let told = point.runs[0].errors.relmse.unwrap();
    assert!((error - told).abs() < 1e-9 * told, "{}: {error} is not {told}", point.command);
    // Control: another seed has another error.
    assert_ne!(point.runs[0].errors, point.runs[1].errors);
}

fn tables(folder: &TempDir, document: &Document) {
    let table = std::fs::read_to_string(folder.path().join("all/cost.csv")).unwrap();
    // Every second part is within quotation marks.
    let columns = |line: &str| line.split('"').step_by(2).map(|part| part.matches(',').count()).sum::<usize>();
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines.len(), 1 + document.points.len());
    assert!(lines.iter().all(|line| columns(line) == columns(lines[0])), "{table}");
    let page = std::fs::read_to_string(folder.path().join("all/cost.html")).unwrap();
    assert!(page.contains("cornell-box"));
}

#[test]
fn an_ablation_turns_every_knob_by_itself() {
    let folder = tempfile::tempdir().unwrap();
    let words =
        format!("cost {} {FILM} --ablate --allocate uniform --denoise none --spp 16 --repeats 2 -o all", scene());
    let mut command = within(&folder, &words);
    // A step that is asked for as a variant as well is one point.
    let printed = text(&command.args(["--variant", "--max-depth 2"]).output().unwrap(), 0);
    assert!(printed.contains("factors by options"), "{printed}");
    let document = document(&folder, "all/cost.json");
    let change = |option: &str| {
        let point = point(&document, &format!("uniform, {option}, 16 spp"));
        let change = point.summary.as_ref().unwrap().change.unwrap();
        assert!(change.time.unwrap().value > 0.0);
        (point.runs[0].rays.unwrap(), change.relmse.unwrap().value)
    };
    // Direct light alone takes fewer rays, and lacks the rest of the light.
    let own = &document.points[0];
    let (rays, error) = change("max-depth 2");
    assert!(10 * rays < 9 * own.runs[0].rays.unwrap() && error > 2.0, "{rays} {error}");
    assert_ne!(change("sampler independent").1, 1.0, "other random numbers");
    assert!(own.method.options.is_empty() && own.summary.as_ref().unwrap().change.is_none());
    let options: Vec<_> = document.points[1..].iter().map(|point| &point.method.options).collect();
    assert!(options.iter().all(|option| option.len() == 1) && options.len() == 6 + 2 + 1, "{options:?}");
    let page = std::fs::read_to_string(folder.path().join("all/cost.html")).unwrap();
    assert!(page.contains("<h2>What options change</h2>"));
}

#[test]
fn a_frame_of_a_scene_that_moves_is_measured_alone_and_as_the_end_of_a_sequence() {
    let folder = tempfile::tempdir().unwrap();
    let moving = scene().replace("cornell-box", "moving");
    let words =
        "--width 24 --height 16 --allocate uniform --denoise none,svgf --spp 2 --repeats 6 --reference-spp 64 -o all";
    let mut command = within(&folder, &format!("cost {moving} {words} --validation --variant"));
    text(&command.args(["--reproject-samples 1"]).output().unwrap(), 0);
    let document = document(&folder, "all/cost.json");
    let judged = document.scene.judged.unwrap();
    assert!(document.complete && (judged.frame, judged.fps) == (8, 24.0) && document.points.len() == 6, "{document:?}");
    let error = |label: &str| point(&document, label).summary.as_ref().unwrap().errors.relmse.unwrap().value;
    assert!(error("uniform + reprojection, 2 spp") < 0.7 * error("uniform, 2 spp"), "samples of eight frames");
    assert!(error("uniform + reprojection, 2 spp") < 0.9 * error("uniform + reprojection, reproject-samples 1, 2 spp"));
    let passes = |label: &str| point(&document, label).runs[0].passes.iter().map(|pass| pass.pass.clone()).collect();
    let [alone, carried]: [Vec<_>; 2] = ["uniform, 2 spp", "uniform + reprojection, 2 spp"].map(passes);
    let has = |passes: &[String], name: &str| passes.iter().any(|pass| pass == name);
    assert!(has(&alone, "upload") && has(&carried, "upload") && has(&carried, "carry") && !has(&alone, "carry"));
    replays(&folder, &document, "uniform + svgf, 2 spp");
    replays(&folder, &document, "uniform + reprojection + svgf, 2 spp");
    replays(&folder, &document, "uniform + reprojection + svgf, reproject-samples 1, 2 spp");
}

#[test]
fn what_is_missing_is_completed_and_nothing_else_is_measured_again() {
    let folder = tempfile::tempdir().unwrap();
    let words = "--allocate uniform --denoise none --spp 1,2 --repeats 3 -o all --quiet";
    text(&cost(&folder, words), 0);
    let whole = document(&folder, "all/cost.json");
    let shown = pictures(&folder);
    assert_eq!(shown.len(), 3, "two points and the reference");
    let mut partial = whole.clone();
    partial.complete = false;
    partial.points[1].runs.pop();
    let write = |document: &Document| {
        std::fs::write(folder.path().join("all/cost.json"), serde_json::to_vec(document).unwrap()).unwrap();
    };
    write(&partial);
    // Meanwhile the reference that is kept has become better, and more of it is allowed.
    let better = |words: &str| cost_with(&folder, &FILM.replace("spp 64", "spp 512"), words);
    text(&better(&words.replace("--spp 1,2", "--spp 64").replace("-o all", "-o other")), 0);
    assert!(document(&folder, "other/cost.json").reference.spp > whole.reference.spp);
    text(&better(words), 0);
    let again = document(&folder, "all/cost.json");
    assert_eq!((again.reference.spp, again.reference.relmse), (whole.reference.spp, whole.reference.relmse));
    assert!(again.complete && again.points[0].runs == whole.points[0].runs, "kept to the last digit of their times");
    assert_eq!(again.points[1].runs[..2], whole.points[1].runs[..2]);
    assert_eq!(again.points[1].runs[2].errors, whole.points[1].runs[2].errors);
    assert_ne!(again.points[1].runs[2].gpu_ms, whole.points[1].runs[2].gpu_ms, "control: this one was measured");
    assert!(pictures(&folder) == shown, "all points are shown with their first seed");
    // What lacks nothing but its pictures gets them, whatever its time.
    write(&Document { complete: false, ..again.clone() });
    text(&better(&format!("{words} --budget-minutes 0.000001")), 0);
    let finished = document(&folder, "all/cost.json");
    assert!(finished.complete && pictures(&folder) == shown);
    let all_runs = |document: &Document| document.points.iter().map(|point| point.runs.clone()).collect::<Vec<_>>();
    assert!(all_runs(&finished) == all_runs(&again));
    // Another measurement begins anew, and does not replace a whole one by a part.
    let other = "--allocate uniform --denoise none --spp 1,2 --repeats 4 -o all --budget-minutes 0.000001";
    let output = cost(&folder, other);
    let printed = text(&output, 6);
    complains(&output, 6, &["nothing could be measured within --budget-minutes"]);
    assert!(printed.contains("not complete: 8 runs are missing") && printed.contains("cost.partial.json"), "{printed}");
    assert_eq!(document(&folder, "all/cost.json"), finished);
}

#[test]
fn a_reference_that_was_replaced_begins_another_measurement() {
    let folder = tempfile::tempdir().unwrap();
    let render = |seed| {
        let words = format!("render {} --width 24 --height 24 --quiet --spp 4 --seed {seed} -o clean.hdr", scene());
        assert!(within(&folder, &words).status().unwrap().success());
    };
    let key = |name: &str| {
        let grid = "--allocate uniform --denoise none --spp 1 --reference clean.hdr --budget-minutes 0.000001 --quiet";
        text(&cost(&folder, &format!("{grid} -o {name}")), 6);
        document(&folder, &format!("{name}/cost.json")).measurement.key
    };
    render(1);
    let first = key("first");
    assert_eq!(key("again"), first);
    render(2);
    assert_ne!(key("other"), first, "the file has the same name and another image");
}

#[test]
fn a_reference_of_samples_that_are_judged_is_told_of() {
    let folder = tempfile::tempdir().unwrap();
    for seed in [1, 7] {
        let words = format!("render {} --width 24 --height 24 --quiet --spp 4 --seed {seed} -o {seed}.exr", scene());
        assert!(within(&folder, &words).status().unwrap().success());
    }
    let notes = |seed: u32| {
        let grid = "--allocate uniform --denoise none --spp 1 --repeats 2 --quiet";
        text(&cost(&folder, &format!("{grid} --reference {seed}.exr -o of{seed}")), 0);
        document(&folder, &format!("of{seed}/cost.json")).reference.notes
    };
    assert!(notes(1).iter().any(|note| note.contains("has samples of seed 1, as a run has")), "{:?}", notes(1));
    assert!(!notes(7).iter().any(|note| note.contains("seed")), "{:?}", notes(7));
}

#[test]
fn an_interrupted_measurement_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let words = |repeats| {
        let grid = format!("--allocate uniform --denoise none --spp 1 --repeats {repeats} -o all --budget-minutes 0");
        format!("cost {} {FILM} {grid} --quiet", scene())
    };
    let mut running = Running::start(within(&folder, &words(1000)), folder.path());
    running.until_there_is("all/cost.json");
    running.send(&["INT"]);
    complains(&running.end(), 130, &["interrupted: what there is was written", "the same command goes on"]);
    let partial = document(&folder, "all/cost.json");
    let runs = partial.points[0].runs.len();
    assert!(!partial.complete && (1..1000).contains(&runs), "{runs}");
    let mut running = Running::start(within(&folder, &words(1000)), folder.path());
    running.until("more runs", |at| {
        let bytes = std::fs::read(at.join("all/cost.json")).unwrap();
        serde_json::from_slice::<Document>(&bytes).unwrap().points[0].runs.len() > runs
    });
    running.send(&["TERM"]);
    assert_eq!(running.end().status.code(), Some(130));
    let more = document(&folder, "all/cost.json");
    assert_eq!(more.points[0].runs[..runs], partial.points[0].runs[..]);
    assert!(!folder.path().join("all/cost.partial.json").exists());
}

#[test]
fn a_point_that_fails_is_told_and_the_others_are_measured() {
    let folder = tempfile::tempdir().unwrap();
    let mut limited = within(&folder, &format!("cost {} {FILM} -o all", scene()));
    limited.args("--allocate both --denoise none --spp 4 --repeats 2".split(' '));
    let output = limited.args(["--variant", "--min-spp 8 --max-spp 4"]).output().unwrap();
    let told = "error: both, min-spp 8 --max-spp 4, 4 spp: min-spp is 8";
    complains(&output, 6, &[told]);
    let printed = text(&output, 6);
    assert!(printed.contains("not complete: points failed; the same command tries them again"), "{printed}");
    let read = || document(&folder, "all/cost.json");
    let found = read();
    assert!(!found.complete && point(&found, "both, 4 spp").runs.len() == 2, "what failed may be tried again");
    assert!(found.points[1].failed.is_some() && found.points[1].runs.is_empty());
    complains(&limited.arg("--quiet").output().unwrap(), 6, &[told]);
    assert_eq!(read().points[0].runs, found.points[0].runs);
    let mut none =
        within(&folder, &format!("cost {} {FILM} --allocate uniform --denoise none --spp 4 -o all", scene()));
    complains(&none.args(["--with", "--max-spp 1"]).output().unwrap(), 2, &["max-spp is 1: the policy uniform"]);
    assert_eq!(read().points[0].runs, found.points[0].runs);
}

#[test]
fn no_step_of_a_knob_contradicts_the_settings() {
    let folder = tempfile::tempdir().unwrap();
    let mut ablated = within(&folder, &format!("cost {} --width 8 --height 8 --reference-spp 64 -o all", scene()));
    ablated.args("--allocate threshold --denoise none --spp 4 --repeats 2 --ablate --quiet".split(' '));
    text(&ablated.args(["--with", "--min-spp 16"]).output().unwrap(), 0);
    let options: Vec<_> =
        document(&folder, "all/cost.json").points.into_iter().map(|point| point.method.options.concat()).collect();
    let has = |option: &str| options.iter().any(|own| own == option);
    assert!(has("--max-spp 32") && !has("--max-spp 8"), "min-spp may not exceed max-spp: {options:?}");
}

#[test]
fn filters_are_measured_on_a_given_image() {
    let folder = tempfile::tempdir().unwrap();
    let render = |spp, name| {
        let words = format!("render {} --width 24 --height 24 --quiet --spp {spp} -o {name}", scene());
        assert!(within(&folder, &words).status().unwrap().success());
    };
    render(2, "noisy.exr");
    render(256, "clean.exr");
    let words =
        "cost --filter-only noisy.exr --reference clean.exr --denoise none,atrous,auto --repeats 2 --validation";
    let printed = text(&within(&folder, words).output().unwrap(), 0);
    assert!(printed.contains("has the lowest relMSE"), "{printed}");
    let document = self::document(&folder, "cost/cost.json");
    assert!(document.complete && document.reference.noise == NoiseKind::Bound, "{document:?}");
    let error = |i: usize| document.points[i].runs[0].errors.relmse.unwrap();
    assert!(error(1) < error(0) && error(2) < error(0), "{} {} {}", error(0), error(1), error(2));
    // What is missing is measured, and nothing else again.
    let mut partial = document.clone();
    partial.complete = false;
    partial.points[1].runs.pop();
    std::fs::write(folder.path().join("cost/cost.json"), serde_json::to_vec(&partial).unwrap()).unwrap();
    text(&within(&folder, words).output().unwrap(), 0);
    let again = self::document(&folder, "cost/cost.json");
    assert!(again.complete && again.points[1].runs.len() == 2);
    assert_eq!(again.points[1].runs[..1], document.points[1].runs[..1]);
    assert_eq!([0, 2].map(|i| &again.points[i].runs), [0, 2].map(|i| &document.points[i].runs), "kept");
    // The filter's own command line has the same error.
    let words = document.points[2].command.strip_prefix("tallow ").unwrap();
    assert!(within(&folder, &format!("{words} --quiet")).status().unwrap().success());
    let picture = |name: &str| image::read(&folder.path().join(name)).unwrap().picture(None).unwrap();
    assert!((relmse(&picture("point.exr"), &picture("clean.exr")) / error(2) - 1.0).abs() < 1e-9);
    // What is given of the scales that are taken from the image is measured as it is filtered.
    let words = "cost --filter-only noisy.exr --reference clean.exr --denoise svgf --variant=--extent=0.02 --device 0 \
                 --repeats 2 -o scaled";
    text(&within(&folder, words).output().unwrap(), 0);
    let scaled = self::document(&folder, "scaled/cost.json");
    let errors: Vec<_> = scaled.points.iter().map(|point| point.runs[0].errors.relmse.unwrap()).collect();
    let words = scaled.points[1].command.strip_prefix("tallow ").unwrap();
    assert!(words.contains("--extent 0.02 --device 0 "), "{words}");
    assert!(within(&folder, &format!("{words} --quiet")).status().unwrap().success());
    let filtered = relmse(&picture("point.exr"), &picture("clean.exr"));
    assert!((filtered / errors[1] - 1.0).abs() < 1e-9 && errors[1] != errors[0], "{filtered}, {errors:?}");
    // Beside itself an image in other primaries has no error.
    let mut wide = image::read(&folder.path().join("noisy.exr")).unwrap();
    wide.primaries = Some(REC2020);
    image::write(&folder.path().join("wide.exr"), &wide, &image::WriteOptions::default()).unwrap();
    let words = "cost --filter-only wide.exr --reference wide.exr --denoise none --repeats 2 -o wide";
    text(&within(&folder, words).output().unwrap(), 0);
    let error = self::document(&folder, "wide/cost.json").points[0].runs[0].errors.relmse.unwrap();
    assert!(error < 1e-9, "{error}");
    // Where nothing is wrong with one, by how much another is worse is no number.
    let words = "cost --filter-only clean.exr --reference clean.exr --denoise none,atrous --repeats 2 -o same";
    text(&within(&folder, words).output().unwrap(), 0);
    let findings = serde_json::to_string(&self::document(&folder, "same/cost.json").findings).unwrap();
    assert!(findings.contains("its relMSE is ") && !findings.contains(" higher"), "{findings}");
}

#[test]
fn what_cannot_be_measured_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("newer")).unwrap();
    let newer = folder.path().join("newer/cost.json");
    std::fs::write(&newer, "{\"schema\": 99}").unwrap();
    let version =
        "newer/cost.json: is of version 99, where this program reads version 1: remove it to measure anew, or";
    complains(&cost(&folder, "-o newer"), 3, &[version]);
    assert_eq!(std::fs::read(&newer).unwrap(), b"{\"schema\": 99}");
    // As a full disk leaves it.
    std::fs::write(&newer, "").unwrap();
    complains(
        &cost(&folder, "-o newer"),
        3,
        &["newer/cost.json: is empty, and no result of tallow cost: remove it to"],
    );
    let words = format!("render {} --width 24 --height 20 --quiet --spp 1 -o other.exr", scene());
    assert!(within(&folder, &words).status().unwrap().success());
    complains(&cost(&folder, "--reference other.exr"), 3, &["other.exr: is 24x20, but 24x24 is measured"]);
    let words = format!(
        "render {} --width 24 --height 24 --quiet --spp 1 -o other.exr",
        scene().replace("scene.toml", "mirror.toml")
    );
    assert!(within(&folder, &words).status().unwrap().success());
    complains(&cost(&folder, "--reference other.exr"), 3, &["other.exr: shows another scene"]);
    complains(&within(&folder, "cost").output().unwrap(), 2, &["SCENE"]);
    complains(&within(&folder, "cost missing.toml").output().unwrap(), 3, &["missing.toml"]);
    std::fs::create_dir(folder.path().join("table")).unwrap();
    let rows = "method,filter,spp,seed,ms,image\nother,none,4,0,10,../other.exr\n";
    std::fs::write(folder.path().join("table/cost.csv"), rows).unwrap();
    complains(
        &cost(&folder, "--points table/cost.csv --spp 1 -o table"),
        2,
        &["table/cost.csv is the same file as --points"],
    );
    assert_eq!(std::fs::read(folder.path().join("table/cost.csv")).unwrap(), rows.as_bytes());
    complains(&cost(&folder, "--spp 0"), 2, &["spp is 0"]);
    complains(&cost(&folder, "--denoise blur"), 2, &["blur"]);
    complains(&cost(&folder, "--repeats 1"), 2, &["1"]);
    complains(&within(&folder, "cost --filter-only other.exr").output().unwrap(), 2, &["--reference"]);
    for option in
        ["--spp 4", "--allocate both", "--rounds 2", "--fps 12", "--ablate", "--reference-spp 128", "--width 8"]
    {
        let words = format!("cost --filter-only other.exr --reference other.exr {option}");
        complains(&within(&folder, &words).output().unwrap(), 2, &["--filter-only", option.split(' ').next().unwrap()]);
    }
    let output = within(&folder, &format!("cost {}", scene())).args(["--with", "--blue 4"]).output().unwrap();
    complains(&output, 2, &["\"--blue 4\"", "tallow render --help"]);
    complains(&cost(&folder, "--reproject forward"), 2, &["nothing moves"]);
    complains(&cost(&folder, "--frame 4"), 2, &["nothing moves"]);
    for (option, words, says) in [
        ("--variant", "--spp 3", "give --spp itself, as a list"),
        ("--with", "--allocate both", "give --allocate itself"),
        ("--variant", "--reproject backward", "give --reproject itself"),
        ("--variant", "--width 9", "--width is the same for all points"),
        ("--variant", "--window 4", "\"--window 4\" changes no point"),
        ("--variant", "--radius 4", "\"--radius 4\" changes no point"),
    ] {
        let mut command = within(&folder, &format!("cost {} --denoise none", scene()));
        complains(&command.args([option, words]).output().unwrap(), 2, &[says]);
    }
}

#[test]
fn a_variant_that_a_method_cannot_have_or_does_not_read_is_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = within(&folder, &format!("cost {} {FILM} -o all --repeats 2", scene()));
    command.args("--allocate uniform,both --denoise none,auto --spp 2".split(' '));
    let output = command.args(["--variant", "--indirect-stride 2", "--variant", "--min-spp 1"]).output().unwrap();
    text(&output, 0);
    let told = String::from_utf8(output.stderr.clone()).unwrap();
    assert!(
        told.contains("warning: left out uniform, indirect-stride 2: with indirect_stride 2 most pixels"),
        "{told}"
    );
    let document = document(&folder, "all/cost.json");
    let labels: Vec<_> = document.points.iter().map(|point| point.method.name()).collect();
    let grid = ["uniform", "uniform + auto", "both", "both + auto"];
    let stride = ["uniform + auto, indirect-stride 2", "both + auto, indirect-stride 2"];
    assert_eq!(labels, [&grid[..], &stride, &["both, min-spp 1", "both + auto, min-spp 1"]].concat());
}
