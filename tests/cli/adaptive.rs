//! Tests placed samples from the command line: resuming, merging, thresholds, and their error messages.
use crate::command::{complains, film, names, scene, tallow};
use std::path::Path;
use std::process::Output;
use tallow::image::{self, Film, Samples};
use tempfile::TempDir;

fn run(folder: &TempDir, words: &str) -> Output {
    tallow(folder, &words.split_whitespace().collect::<Vec<_>>())
}

#[track_caller]
fn render(folder: &TempDir, words: &str) -> String {
    let small = "--width 40 --height 30 --max-depth 3";
    let output = run(folder, &format!("render {} {small} {words}", scene()));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

fn same(a: &Film, b: &Film, layers: &[&str]) -> bool {
    let planes = |film: &Film, layer: &str| film.picture(Some(layer).filter(|l| !l.is_empty())).unwrap().pixels;
    layers.iter().all(|layer| planes(a, layer) == planes(b, layer))
}

const LAYERS: [&str; 7] = ["", "m2", "variance", "direct", "indirect", "indirect.m2", "samples"];

fn counts(film: &Film) -> Vec<u32> {
    match film.channel("samples") {
        Some(Samples::U32(counts)) => counts.clone(),
        _ => panic!("no counts"),
    }
}

#[test]
fn priorities_counts_and_a_heat_map_are_written() {
    let folder = tempfile::tempdir().unwrap();
    let said =
        render(&folder, "--allocate geometry --budget-spp 4 --min-spp 1 --heatmap map.png -o a.exr --validation");
    assert!(said.contains("samples per pixel, 4.00 on average"), "{said}");
    let film = film(&folder, "a.exr");
    assert_eq!(counts(&film).iter().sum::<u32>(), 4 * 40 * 30);
    assert!(matches!(film.channel("priority"), Some(Samples::F32(p)) if p.iter().any(|&p| p > 0.0)));
    assert_eq!(image::read(&folder.path().join("map.png")).unwrap().height, 30);
    render(&folder, "--spp 1 -o plain.exr");
    assert!(image::read(&folder.path().join("plain.exr")).unwrap().channel("priority").is_none());
}

#[test]
fn a_threshold_stops_and_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let said = render(&folder, "--noise-threshold 0.08 --max-spp 4000 -o easy.exr");
    assert!(said.contains("every pixel is estimated below the threshold"), "{said}");
    let easy = counts(&film(&folder, "easy.exr"));
    assert!(
        easy.iter().sum::<u32>() < 400 * 40 * 30 && easy.iter().min() < easy.iter().max(),
        "it went on to the limit"
    );
    let said = render(&folder, "--noise-threshold 0.0001 --max-spp 6 -o hard.exr");
    assert!(said.contains("pixels are above the threshold at their limit"), "{said}");
    assert_eq!(counts(&film(&folder, "hard.exr")).iter().max(), Some(&6));
}

#[test]
fn resuming_with_more_samples_is_one_render() {
    let folder = tempfile::tempdir().unwrap();
    render(&folder, "--spp 5 -o part.exr");
    render(&folder, "--spp 9 -o whole.exr");
    render(&folder, "--spp 9 --resume part.exr -o resumed.exr");
    let (whole, resumed) = (film(&folder, "whole.exr"), film(&folder, "resumed.exr"));
    assert!(same(&whole, &resumed, &LAYERS));
    assert!(!same(&whole, &film(&folder, "part.exr"), &[""]), "the comparison cannot fail");
}

#[test]
fn disjoint_ranges_merge_and_others_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    render(&folder, "--spp 9 -o whole.exr");
    render(&folder, "--spp 4 -o a.exr");
    render(&folder, "--spp 5 --first-sample 4 -o b.exr");
    assert!(run(&folder, "merge a.exr b.exr -o c.exr").status.success());
    let (whole, merged) = (film(&folder, "whole.exr"), film(&folder, "c.exr"));
    assert_eq!(counts(&whole), counts(&merged));
    let [a, b] = [&whole, &merged].map(|f| f.picture(None).unwrap().pixels.concat());
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= 3e-6 * a + 1e-9));
    let [a, b] = [&whole, &merged].map(|f| f.picture(Some("indirect.m2")).unwrap().pixels.concat());
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= 1e-5 * a + 1e-6) && a.iter().any(|&a| a > 0.1));
    complains(&run(&folder, "merge a.exr whole.exr -o d.exr"), 3, &["whole.exr", "count twice"]);
    render(&folder, "--spp 4 --clamp-indirect 3 -o other.exr");
    complains(
        &run(&folder, "merge a.exr other.exr -o d.exr"),
        3,
        &["other.exr", "other settings: clamp-indirect is 3, and 0 in another"],
    );
    assert!(!folder.path().join("d.exr").exists());
}

#[test]
fn a_merged_file_still_knows_every_sample_that_it_holds() {
    let folder = tempfile::tempdir().unwrap();
    let merges = |words: &str| assert!(run(&folder, &format!("merge {words}")).status.success(), "{words}");
    let refuses = |words: &str, parts: &[&str]| {
        complains(&run(&folder, &format!("merge {words} -o not.exr")), 3, parts);
        assert!(!folder.path().join("not.exr").exists());
    };
    render(&folder, "--spp 4 -o a.exr");
    render(&folder, "--spp 5 --first-sample 4 -o b.exr");
    render(&folder, "--spp 2 --first-sample 9 -o c.exr");
    render(&folder, "--spp 3 --seed 1 -o other.exr");
    merges("b.exr a.exr -o ba.exr");
    refuses("ba.exr a.exr", &["a.exr", "0 to 3 of seed 0", "count twice"]);
    merges("ba.exr other.exr c.exr -o all.exr");
    for again in ["a", "b", "c", "other", "ba", "all"] {
        refuses(&format!("all.exr {again}.exr"), &[&format!("{again}.exr"), "count twice"]);
        refuses(&format!("{again}.exr all.exr"), &["all.exr", "count twice"]);
    }
    assert_eq!(counts(&film(&folder, "all.exr")), [14; 40 * 30]);
    let small = "--width 40 --height 30 --max-depth 3";
    let resumed = run(&folder, &format!("render {} {small} --spp 20 --resume all.exr -o not.exr", scene()));
    complains(&resumed, 3, &["was merged", "--first-sample"]);
}

/// A light so near to a surface that its irradiance is no number where the middle pixel looks.
const TOO_BRIGHT: &str = "[film]\nwidth = 5\nheight = 5\n[camera]\nposition = [0, 0, 2]\ntarget = [0, 0, 0]\nfov = 45\n\
    [render]\nspp = 4\nmax_depth = 2\n[[mesh]]\nshape = 'rectangle'\n\
    [[light]]\ntype = 'point'\nposition = [0, 0, 1e-5]\nintensity = [1e30, 1e30, 1e30]\n";

#[test]
fn samples_that_are_no_numbers_are_told_and_add_up() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("s.toml"), TOO_BRIGHT).unwrap();
    let told = |file: &str| film(&folder, file).metadata.get("brokenSamples").cloned();
    let first = |count: u32| Some(format!(r#"{{"count":{count},"pixel":[2,2],"sample":0,"seed":0}}"#));
    let render = |words: &str| {
        let output = run(&folder, &format!("render s.toml --filter point --quiet {words}"));
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    let said = render("-o a.exr");
    assert!(
        said.lines().count() == 1
            && said.contains("wrong samples: 4, ")
            && said.contains("the first: pixel (2, 2), sample 0"),
        "{said}"
    );
    assert_eq!(told("a.exr"), first(4));
    for layer in ["", "m2", "variance", "direct", "indirect", "indirect.m2"] {
        let picture = film(&folder, "a.exr").picture(Some(layer).filter(|l| !l.is_empty())).unwrap();
        assert_eq!(picture.non_finite(), 0, "{layer}");
    }
    render("--spp 7 --resume a.exr -o more.exr");
    assert_eq!(told("more.exr"), first(7));
    render("--spp 3 --first-sample 4 -o b.exr");
    assert!(run(&folder, "merge b.exr a.exr -o both.exr").status.success());
    assert_eq!(told("both.exr"), first(7));
    let output = run(&folder, "render s.toml --filter point --json -o c.exr");
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["broken_samples"]["count"], 4);
    let warned = |output: &std::process::Output| {
        let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let lines =
            json["warnings"].as_array().unwrap().iter().map(|line| format!("warning: {}\n", line.as_str().unwrap()));
        (lines.collect::<String>(), String::from_utf8(output.stderr.clone()).unwrap())
    };
    assert_eq!(warned(&output), (said.clone(), said.clone()), "the list has what is told whatever is printed");
    let frames = run(&folder, "sequence s.toml --filter point --json --frames 0..2 --reproject off -o f.#.exr");
    let (listed, printed) = warned(&frames);
    let of_frames = [0, 1].map(|frame| said.replace("warning: ", &format!("warning: frame {frame}: "))).concat();
    assert_eq!(printed, of_frames, "each says of which frame it is");
    assert!(
        listed.starts_with("warning: all frames are alike: nothing moves") && listed.ends_with(&of_frames),
        "{listed}"
    );
    let beside = run(&folder, "render s.toml --filter box --quiet -o d.exr");
    assert!(beside.stderr.is_empty() && told("d.exr").is_none(), "control: beside it there is light: {beside:?}");
}

#[test]
fn samples_are_added_to_those_of_the_same_scene_only() {
    let folder = tempfile::tempdir().unwrap();
    let text = std::fs::read_to_string(scene()).unwrap();
    let mesh = Path::new(&scene()).parent().unwrap().display().to_string();
    let text = text.replace("file = \"", &format!("file = \"{mesh}/"));
    std::fs::write(folder.path().join("s.toml"), &text).unwrap();
    std::fs::create_dir(folder.path().join("moved")).unwrap();
    std::fs::write(folder.path().join("moved/t.toml"), &text).unwrap();
    let small = "--width 16 --height 12 --max-depth 3";
    let render = |words: &str| run(&folder, &format!("render {small} {words}"));
    let well = |output: Output| assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    well(render("s.toml --spp 2 -o a.exr"));
    well(render("moved/t.toml --spp 2 --first-sample 2 -o b.exr"));
    well(run(&folder, "merge a.exr b.exr -o ab.exr"));
    well(render("moved/t.toml --spp 4 --resume a.exr -o more.exr"));

    assert!(text.contains("fov = 39.3077"), "another edit is needed");
    std::fs::write(folder.path().join("s.toml"), text.replace("fov = 39.3077", "fov = 39.3")).unwrap();
    complains(&render("s.toml --spp 4 --resume a.exr -o not.exr"), 3, &["a.exr", "another scene"]);
    well(render("s.toml --spp 2 --first-sample 2 -o edited.exr"));
    complains(&run(&folder, "merge a.exr edited.exr -o not.exr"), 3, &["edited.exr", "another scene"]);

    let mut old = film(&folder, "a.exr");
    old.metadata.remove("sceneFingerprint").unwrap();
    image::write(&folder.path().join("old.exr"), &old, &Default::default()).unwrap();
    complains(&render("moved/t.toml --spp 4 --resume old.exr -o not.exr"), 3, &["old.exr", "sceneFingerprint"]);
    complains(&run(&folder, "merge b.exr old.exr -o not.exr"), 3, &["old.exr", "sceneFingerprint"]);
    let mut old = film(&folder, "a.exr");
    old.channels.retain(|c| c.name != "indirect.m2");
    image::write(&folder.path().join("old.exr"), &old, &Default::default()).unwrap();
    complains(
        &render("moved/t.toml --spp 4 --resume old.exr -o not.exr"),
        3,
        &["old.exr", "indirect.m2", "earlier versions"],
    );
    complains(&run(&folder, "merge b.exr old.exr -o not.exr"), 3, &["old.exr", "indirect.m2", "earlier versions"]);
    assert!(!folder.path().join("not.exr").exists());
}

#[test]
fn what_cannot_be_done_is_one_line() {
    let folder = tempfile::tempdir().unwrap();
    let fails =
        |words: &str| run(&folder, &format!("render {} --width 8 --height 8 --spp 2 {words} -o x.exr", scene()));
    complains(&fails("--allocate everywhere"), 2, &["everywhere", "geometry"]);
    complains(&fails("--allocate both --window 11"), 2, &["window", "2 to 10"]);
    complains(&fails("--allocate both --min-spp 5 --max-spp 4"), 2, &["min-spp", "max-spp"]);
    complains(&fails("--min-spp 1 --max-spp 1"), 2, &["max-spp is 1", "uniform", "spp, 2"]);
    complains(&fails("--max-spp 1"), 2, &["max-spp is 1", "uniform", "spp, 2"]);
    complains(&fails("--noise-threshold 0.1 --allocate uniform"), 2, &["noise-threshold", "variance or both"]);
    complains(&fails("--resume none.exr"), 3, &["none.exr"]);
    assert!(fails("").status.success());
    assert!(fails("--max-spp 2").status.success(), "no pixel exceeds that");
    assert!(fails("--allocate geometry --min-spp 1 --max-spp 3").status.success());
    complains(&fails("--resume x.exr --seed 3"), 3, &["x.exr", "other settings"]);
    let mut bare = Film::new(8, 8);
    bare.add_vec3("", ["R", "G", "B"], &[[0.0; 3]; 64]);
    image::write(&folder.path().join("bare.exr"), &bare, &Default::default()).unwrap();
    complains(&fails("--resume bare.exr"), 3, &["bare.exr", "settings"]);
    assert_eq!(names(folder.path()), ["bare.exr", "x.exr"]);
}
