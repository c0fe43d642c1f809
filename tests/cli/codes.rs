//! Tests the built program's exit codes, and that errors are one readable line.
use crate::command::{complains, names, scene, stdout, tallow};
use crate::flat;
use serde_json::Value;
use std::path::PathBuf;
use std::process::Command;
use tallow::image::{self, Film, WriteOptions};
use tempfile::TempDir;

fn write(folder: &TempDir, name: &str, size: u32, value: f32) -> PathBuf {
    let mut film = Film::new(size, size);
    film.add_vec3("", ["R", "G", "B"], &vec![[value, value, 0.5]; film.pixels()]);
    film.add_vec3("albedo", ["R", "G", "B"], &vec![[0.5; 3]; film.pixels()]);
    let path = folder.path().join(name);
    image::write(&path, &film, &WriteOptions::default()).unwrap();
    path
}

#[test]
fn help_lists_the_exit_codes_and_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let help = tallow(&folder, &["--help"]);
    assert_eq!(help.status.code(), Some(0));
    for word in ["render", "filter", "compare", "explain", "devices", "130  interrupted", "3    input", "70   internal"]
    {
        assert!(stdout(&help).contains(word), "{word}");
    }
    assert!(stdout(&tallow(&folder, &["--version"])).starts_with("tallow "));
}

#[test]
fn usage_errors_are_one_line_and_exit_2() {
    let folder = tempfile::tempdir().unwrap();
    let run = |words: &[&str]| tallow(&folder, words);
    complains(&run(&[]), 2, &["error: name a command"]);
    complains(&run(&["compare", "a.exr"]), 2, &["<B>", "(see tallow compare --help)"]);
    complains(&run(&["--compare"]), 2, &["(see tallow --help)"]);
    complains(&run(&["compare", "a.exr", "b.exr", "--map", "m.png"]), 2, &["--statistical", "--map"]);
    let limited = run(&["compare", "a.exr", "b.exr", "--statistical", "--max-mse", "1"]);
    complains(&limited, 2, &["'--statistical' cannot be used with '--max-mse <N>'"]);
    complains(&run(&["compare", "a.exr", "b.exr", "--max-mes", "1"]), 2, &["'--max-mes'", "tip:", "'--max-mse'"]);
    // Beside an option of the metrics, one of the test alone was passed over.
    for option in [
        "--map m.png",
        "--html a.html",
        "--junit j.xml",
        "--evidence e",
        "--errors e.exr",
        "--resolve 0.1",
        "--accept 0.1",
    ] {
        let words = format!("compare a.exr b.exr --max-mse 1 {option}");
        complains(&run(&words.split(' ').collect::<Vec<_>>()), 2, &["cannot be used with", "--max-mse"]);
    }
    complains(&run(&["filter", "a.exr", "-o", "b.exr", "--no-demodulate", "--eye-rays", "4"]), 2, &["--no-demodulate"]);
    complains(&run(&["compare", "a.exr", "b.exr", "--min-psnr", "nan"]), 2, &["finite"]);
    complains(&run(&["compare", "a.exr", "b.exr", "--diff", "d.exr"]), 2, &["d.exr", ".png"]);
    complains(&run(&["render", "s.toml", "-o", "a.tif"]), 2, &["a.tif", ".exr", ".png", ".hdr"]);
    complains(&run(&["render", "s.toml", "--sampler", "x"]), 2, &["sobol"]);
    complains(&run(&["render", "s.toml", "--width", "wide"]), 2, &["--width", "(see tallow render --help)"]);
    complains(&run(&["render", "s.toml", "--checkpoint", "0"]), 2, &["--checkpoint", "minutes above 0"]);
    let negative = run(&["render", "s.toml", "--spp", "-1"]);
    complains(&negative, 2, &["'-1'", "'--spp <N>'"]);
    assert!(!String::from_utf8_lossy(&negative.stderr).contains("-- -1"), "a wrong tip");
}

#[test]
fn words_of_other_programs_are_answered_by_those_of_this() {
    let folder = tempfile::tempdir().unwrap();
    let run = |words: &[&str]| tallow(&folder, words);
    // Words of other programs, of which the most alike by their letters were "--sampler" and "--counters".
    std::fs::write(folder.path().join("my s.toml"), "").unwrap();
    for (words, tip) in [
        ("render s.toml --samples 4", "'--samples' found; tip: here that is --spp (see"),
        ("render s.toml --bounces 4", "tip: here that is --max-depth (see"),
        ("render s.toml --resolution 64x64", "tip: here that is --width, --height (see"),
        ("render s.toml a.png", "'a.png' found; tip: what is written is named by -o a.png (see"),
        ("compare a.exr b.exr --threshold 1", "tip: here that is --max-mse, --max-relmse, --max-flip, "),
        ("denoise a.exr", "'denoise'; tip: here that is tallow filter (see"),
        ("render s.toml --spp 1e3", "expected a whole number (see"),
        ("render s.toml --spp=", "expected a whole number (see"),
        ("render s.toml --spp 99999999999999999999", "the number is too large (see"),
        ("filter a.exr b.png", "'b.png' found; tip: what is written is named by -o b.png (see"),
        ("sequence s.toml f.#.png", "'f.#.png' found; tip: what is written is named by -o 'f.#.png' (see"),
        ("bench s.toml", "tip: here that is tallow profile (tallow cost for filters and policies) (see"),
        ("info", "tip: here that is tallow devices, or tallow explain for a scene (see"),
        ("render s.toml --outfile a.png", "'--outfile' found; tip: here that is --output (see"),
        ("render s.toml --frames 0..3", "'--frames' found; tip: here that is tallow sequence --frames (see"),
        ("render s.toml --frame 3", "'--frame' found; tip: here that is tallow sequence --frames (see"),
        ("render s.toml --list-devices", "tip: here that is tallow devices (see"),
        ("render s.toml -o -x.png", "'-x' found; tip: a file of such a name is ./-x.png (see"),
        ("render --x.toml", "'--x.toml' found; tip: a file of such a name is ./--x.toml (see"),
        ("--list-devices", "'--list-devices' found; tip: here that is tallow devices (see"),
        // What clap takes for alike: "--denoise", "--version" and "--window".
        ("render s.toml --verbose", "unexpected argument '--verbose' found (see"),
        ("--verbose s.toml", "unexpected argument '--verbose' found (see tallow --help)"),
        ("render s.toml --cropwindow", "unexpected argument '--cropwindow' found (see"),
        ("render s.toml --max-samples 9", "tip: a similar argument exists: '--max-spp' (see"),
        ("--samples 3", "'--samples' found; tip: a command comes first: tallow render has --spp (see tallow --help)"),
        ("--spp=3 s.toml", "tip: a command comes first: tallow render has --spp (see"),
        ("-o a.png s.toml", "'-o' found; tip: a command comes first: tallow render has -o (see"),
        ("--frames 0..3 s.toml", "tip: a command comes first: tallow sequence has --frames (see"),
    ] {
        complains(&run(&words.split(' ').collect::<Vec<_>>()), 2, &[tip]);
    }
    // Names of neither images nor scenes are answered by neither tip.
    std::fs::write(folder.path().join("a.txt"), "").unwrap();
    for words in ["render s.toml b.toml", "render s.toml a.tif", "sequence s.toml a.png", "devices a.png", "a.txt"] {
        let output = run(&words.split(' ').collect::<Vec<_>>());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && !said.contains("-o ") && !said.contains("to render it"), "{said}");
    }
    complains(&run(&["my s.toml"]), 2, &["tip: to render it, tallow render 'my s.toml' (see tallow --help)"]);
}

#[test]
fn files_in_the_place_of_others_are_told_by_what_they_are() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder, "a.exr", 12, 0.5);
    std::fs::write(folder.path().join("s.toml"), "").unwrap();
    let run = |words: &str| tallow(&folder, &words.split(' ').collect::<Vec<_>>());
    // Its default output would replace it.
    complains(&run("render a.exr"), 3, &["error: a.exr: is no scene: \"exr\" is none of toml, obj"]);
    complains(&run("profile s.toml --compare a.exr"), 3, &["a.exr: is no profile, which tallow profile --json prints"]);
    complains(
        &run("sequence s.toml -o a.gif"),
        2,
        &["a.gif: frames go to .exr, .png or .hdr files; --preview a.gif writes"],
    );
    for number in ["0", "-1", "nan", "inf"] {
        let refused = run(&format!("filter a.exr -o b.exr --samples {number}"));
        complains(&refused, 2, &["--samples", "expected a number of at least 1, or the name of a layer"]);
    }
    complains(&run("filter a.exr -o b.exr --samples spp"), 3, &["holds no single layer \"spp\""]);
}

/// As a full disk or a copy that was broken off leaves them, and a repository whose large files were not fetched.
#[test]
fn files_without_what_they_are_to_hold_are_told() {
    let pointer = format!("version https://git-lfs.github.com/spec/v1\noid sha256:{}\nsize 42\n", "0".repeat(64));
    for (text, told) in [
        ("", "is empty: take another copy of it"),
        (&pointer, "is a pointer of Git LFS in place of the file: run git lfs pull in its repository"),
    ] {
        check_files_that_hold(text, told);
    }
    // A picture of a format that is not read is passed over with a warning; a pointer to one is told as that.
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.tga"), pointer).unwrap();
    let text = "[[material]]\nname = 'a'\ncolor_texture = 'a.tga'\n[[mesh]]\nshape = 'cube'\nmaterial = 'a'\n";
    std::fs::write(folder.path().join("a.toml"), text).unwrap();
    complains(&tallow(&folder, &["render", "a.toml", "-o", "b.exr"]), 3, &["a.tga: is a pointer of Git LFS"]);
}

/// Every kind of input that holds this text is refused for it, by its own name.
fn check_files_that_hold(text: &str, told: &str) {
    let folder = tempfile::tempdir().unwrap();
    write(&folder, "a.exr", 12, 0.5);
    for name in ["empty.exr", "empty.png", "empty.glb", "empty.gltf", "empty.hdr", "empty.bin"] {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    std::fs::write(folder.path().join("sky.toml"), "environment.file = 'empty.hdr'").unwrap();
    let picture = "[[material]]\nname = 'a'\ncolor_texture = 'empty.png'\n[[mesh]]\nshape = 'cube'\nmaterial = 'a'\n";
    std::fs::write(folder.path().join("picture.toml"), picture).unwrap();
    let buffers = r#"{"asset": {"version": "2.0"}, "buffers": [{"byteLength": 42, "uri": "empty.bin"}]}"#;
    std::fs::write(folder.path().join("a.gltf"), buffers).unwrap();
    for (words, name) in [
        ("compare a.exr empty.exr", "empty.exr"),
        ("merge empty.exr a.exr -o b.exr", "empty.exr"),
        ("filter empty.png -o b.exr", "empty.png"),
        ("render empty.glb", "empty.glb"),
        ("render empty.gltf", "empty.gltf"),
        ("render sky.toml -o b.exr", "empty.hdr"),
        ("render picture.toml -o b.exr", "empty.png"),
        ("render a.gltf -o b.exr", "empty.bin"),
    ] {
        let output = tallow(&folder, &words.split(' ').collect::<Vec<_>>());
        complains(&output, 3, &[&format!("{name}: {told}")]);
    }
}

#[test]
fn input_errors_name_the_file_and_exit_3() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder, "a.exr", 12, 0.5);
    write(&folder, "small.exr", 11, 0.5);
    write(&folder, "nan.exr", 12, f32::NAN);
    std::fs::write(folder.path().join("text.png"), "not a picture").unwrap();
    let compare = |b: &str| tallow(&folder, &["compare", "a.exr", b]);
    complains(&compare("missing.exr"), 3, &["error: missing.exr", "No such file"]);
    complains(&compare("."), 3, &["folder"]);
    complains(&compare("text.png"), 3, &["text.png", "PNG"]);
    complains(&compare("small.exr"), 3, &["12x12", "11x11"]);
    complains(&compare("nan.exr"), 3, &["nan.exr", "144 of 144 pixels"]);
    complains(&tallow(&folder, &["compare", "a.exr", "a.exr", "--layer", "N"]), 3, &["\"N\"", "albedo.R"]);
    let render = |scene: &str| tallow(&folder, &["render", scene]);
    complains(&render("missing"), 3, &["error: missing: cannot be read: No such file"]);
    let read_by_a_job = tallow(&folder, &["render", "missing", "--json"]);
    assert!(read_by_a_job.stdout.is_empty(), "{read_by_a_job:?}");
    complains(&render("missing.blend"), 3, &["missing.blend: cannot be read: No such file"]);
    complains(&render("text.png"), 3, &["text.png", "is no scene", "toml, obj, ply, ply.gz, gltf, glb"]);
    for ending in ["blend", "fbx", "usd", "usda", "usdc", "3ds", "dae", "FBX"] {
        std::fs::write(folder.path().join(format!("s.{ending}")), "x").unwrap();
        let export = format!("{} files are not read: export it to glTF (.glb) or OBJ", ending.to_lowercase());
        complains(&render(&format!("s.{ending}")), 3, &[&format!("s.{ending}: is no scene: {export}")]);
        std::fs::write(folder.path().join("m.toml"), format!("[[mesh]]\nfile = 's.{ending}'\n")).unwrap();
        complains(&render("m.toml"), 3, &[&format!("s.{ending}: is no model: {export}")]);
    }
    // Control: what is right gives no line.
    let good = compare("a.exr");
    assert_eq!((good.status.code(), good.stderr.len()), (Some(0), 0));
}

#[test]
#[cfg(target_os = "linux")]
fn pipes_and_folders_are_refused_and_odd_names_are_not() {
    use std::os::unix::ffi::OsStringExt;
    let folder = tempfile::tempdir().unwrap();
    write(&folder, "a.exr", 12, 0.5);
    for name in ["p.toml", "p.obj", "b.exr"] {
        assert!(Command::new("mkfifo").arg(folder.path().join(name)).status().unwrap().success());
    }
    complains(&tallow(&folder, &["render", "p.toml"]), 3, &["p.toml", "pipe", "save"]);
    complains(&tallow(&folder, &["render", "p.obj"]), 3, &["p.obj", "pipe"]);
    complains(&tallow(&folder, &["compare", "a.exr", "b.exr"]), 3, &["b.exr", "pipe"]);
    complains(&tallow(&folder, &["render", "."]), 3, &["error: .: is a folder"]);
    let odd = std::ffi::OsString::from_vec(b"caf\xe9.exr".to_vec());
    let mut filter = Command::new(env!("CARGO_BIN_EXE_tallow"));
    filter.args(["filter", "a.exr", "--filter", "none", "--json", "-o"]).arg(&odd).current_dir(folder.path());
    let output = filter.output().unwrap();
    assert!(serde_json::from_slice::<Value>(&output.stdout).is_ok(), "{output:?}");
    assert!(folder.path().join(odd).exists());
}

#[test]
#[cfg(target_os = "linux")]
fn documents_of_compare_name_files_that_are_not_utf_8() {
    use std::os::unix::ffi::OsStringExt;
    let folder = tempfile::tempdir().unwrap();
    let odd = std::ffi::OsString::from_vec(b"caf\xe9.exr".to_vec());
    let run = |words: &str| {
        let words = words.split(' ').map(|word| if word == "ODD" { odd.as_os_str() } else { word.as_ref() });
        Command::new(env!("CARGO_BIN_EXE_tallow")).args(words).current_dir(folder.path()).output().unwrap()
    };
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");
    assert!(run(&format!("render {scene} --width 16 --height 16 --spp 4 --quiet -o ODD")).status.success());
    for words in ["compare ODD ODD --diff d.png --json", "compare ODD ODD --statistical --map m.png --json"] {
        let output = run(words);
        let json: Value = serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{words}: {output:?}"));
        let name = if json["a"].is_string() { &json["a"] } else { &json["a"]["file"] };
        assert_eq!(name, "caf\u{fffd}.exr", "{words}");
    }
}

#[test]
fn limits_set_the_exit_code() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder, "a.exr", 12, 0.5);
    write(&folder, "b.exr", 12, 0.6);
    // Two channels of three differ by 0.1: MSE 0.00667.
    let run = |limit: &[&str]| tallow(&folder, &[&["compare", "a.exr", "b.exr"], limit].concat());
    complains(&run(&["--max-mse", "0.006"]), 1, &["limit exceeded: mse", "--max-mse 0.006"]);
    complains(&run(&["--max-relmse", "0.001"]), 1, &["relmse"]);
    complains(&run(&["--max-flip", "0"]), 1, &["flip"]);
    complains(&run(&["--min-psnr", "90"]), 1, &["psnr"]);
    complains(&run(&["--min-ssim", "0.9999"]), 1, &["ssim"]);
    complains(&run(&["--max-mse", "nan"]), 2, &["--max-mse", "0 or more"]);
    complains(&run(&["--max-relmse", "-1"]), 2, &["--max-relmse", "0 or more"]);
    complains(&run(&["--max-flip", "-1"]), 2, &["--max-flip", "from 0 to 1"]);
    complains(&run(&["--min-ssim", "2"]), 2, &["--min-ssim", "from -1 to 1"]);
    let within = ["--max-mse", "0.007", "--max-relmse", "1", "--max-flip", "1", "--min-psnr", "5", "--min-ssim", "0.5"];
    assert_eq!(run(&within).status.code(), Some(0));
    assert_eq!(run(&["--max-mse", "0", "--layer", "albedo"]).status.code(), Some(0), "the albedo is the same");
}

#[test]
fn compare_prints_json_and_writes_the_difference() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder, "a.exr", 12, 0.5);
    write(&folder, "b.exr", 12, 0.6);
    let output = tallow(&folder, &["compare", "a.exr", "b.exr", "--json", "--diff", "d.png"]);
    let json: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!((json["metrics"]["mse"].as_f64().unwrap() - 0.02 / 3.0).abs() < 1e-6, "{json}");
    assert!((json["diff"]["scale"][1].as_f64().unwrap() - 0.2 / 3.0).abs() < 1e-6, "{json}");
    assert_eq!(image::read(&folder.path().join("d.png")).unwrap().height, 12);
}

#[test]
fn colours_are_those_of_rec_709_whatever_primaries_a_file_names() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, colour: [f32; 3], primaries| {
        let mut film = Film { primaries, ..Film::new(12, 12) };
        film.add_vec3("", ["R", "G", "B"], &[colour; 144]);
        film.add_vec3("albedo", ["R", "G", "B"], &[[0.5; 3]; 144]);
        image::write(&folder.path().join(name), &film, &WriteOptions::default()).unwrap();
    };
    // ACEScg and the same colour by the matrix of OpenColorIO.
    let ap1 = [[0.713, 0.293], [0.165, 0.83], [0.128, 0.044], [0.32168, 0.33767]];
    file("a.exr", [0.5, 0.25, 0.125], Some(ap1));
    file("b.exr", [0.68667, 0.21876, 0.09988], None);
    let filter =
        ["filter", "a.exr", "--filter", "none", "-o", "c.exr", "-o", "c.png", "-o", "c.hdr", "--reference", "b.exr"];
    let output = stdout(&tallow(&folder, &[&filter[..], &["--json"]].concat()));
    let json: Value = serde_json::from_str(&output).unwrap();
    assert!(["before", "after"].iter().all(|when| json[when]["mse"].as_f64().unwrap() < 1e-8), "{json}");
    for (same, limit) in [("a.exr", "1e-8"), ("c.exr", "1e-8"), ("c.png", "1e-4"), ("c.hdr", "1e-4")] {
        let output = tallow(&folder, &["compare", same, "b.exr", "--max-mse", limit]);
        assert_eq!(output.status.code(), Some(0), "{same}: {}", stdout(&output));
    }
    assert_eq!(image::read(&folder.path().join("c.exr")).unwrap().primaries, Some(ap1));
    let stored = tallow(&folder, &["compare", "a.exr", "b.exr", "--layer", "albedo", "--max-mse", "0"]);
    assert_eq!(stored.status.code(), Some(0), "numbers stay");
}

/// Depths of 5 and 6 are white in both pictures.
#[test]
fn metrics_of_what_is_shown_judge_nothing_that_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, depths: [f32; 2]| {
        let mut film = Film::new(12, 12);
        film.add_vec3("", ["R", "G", "B"], &[[0.5; 3]; 144]);
        let depth = (0..144).map(|i| depths[usize::from(i >= 60)]).collect();
        film.add("Z", image::Samples::F32(depth));
        image::write(&folder.path().join(name), &film, &WriteOptions::default()).unwrap();
    };
    file("a.exr", [0.25, 5.0]);
    file("b.exr", [0.25, 6.0]);
    file("c.exr", [0.25, 0.5]);
    file("d.exr", [0.25, 0.5 + f32::EPSILON]); // of which 8 bits show nothing either
    let compare = |files: [&str; 2], words: &str| {
        tallow(&folder, &[&["compare"], &files[..], &words.split_whitespace().collect::<Vec<_>>()].concat())
    };
    complains(&compare(["a.exr", "b.exr"], "--layer Z"), 0, &["58 % of the pixels differ beyond 0 and 1"]);
    let listed = stdout(&compare(["a.exr", "b.exr"], "--layer Z --json"));
    assert!(listed.contains(r#""warnings":["58 % of the pixels differ beyond 0 and 1"#), "{listed}");
    complains(&compare(["a.exr", "b.exr"], "--layer Z --max-flip 1"), 2, &["--max-flip", "by --max-mse"]);
    complains(&compare(["a.exr", "b.exr"], "--layer Z --min-psnr 1"), 2, &["--min-psnr", "58 %"]);
    let told = compare(["a.exr", "b.exr"], "--layer Z --max-mse 0.1");
    assert_eq!((told.status.code(), String::from_utf8(told.stderr).unwrap().lines().count()), (Some(1), 2));
    // What is shown, or the same, is judged.
    for words in ["--max-flip 1", "--layer Z --max-flip 1"] {
        let output = compare(["a.exr", if words.contains('Z') { "c.exr" } else { "b.exr" }], words);
        assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    }
    assert!(compare(["a.exr", "a.exr"], "--layer Z --min-psnr 99").stderr.is_empty());
    assert!(compare(["c.exr", "d.exr"], "--layer Z --min-psnr 99").status.success());
}

#[test]
fn a_file_without_colour_is_told_which_option_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut film = Film::new(12, 12);
    ["a", "b"].iter().for_each(|layer| film.add_vec3(layer, ["R", "G", "B"], &[[0.5; 3]; 144]));
    image::write(&folder.path().join("a.exr"), &film, &WriteOptions::default()).unwrap();
    complains(&tallow(&folder, &["compare", "a.exr", "a.exr"]), 3, &["no colour", "b.R", "--layer"]);
    complains(&tallow(&folder, &["filter", "a.exr", "-o", "c.exr"]), 3, &["no colour", "b.R", "--colour"]);
    write(&folder, "b.exr", 12, 0.5);
    complains(
        &tallow(&folder, &["filter", "b.exr", "-o", "c.exr", "--reference", "a.exr"]),
        3,
        &["a.exr", "as R, G, B"],
    );
}

#[test]
fn devices_are_listed_as_vulkan_has_them() {
    let folder = tempfile::tempdir().unwrap();
    let found = tallow::gpu::survey().unwrap();
    let output = tallow(&folder, &["devices", "--json"]);
    let listed: Vec<Value> = serde_json::from_slice(&output.stdout).unwrap();
    let text = stdout(&tallow(&folder, &["devices"]));
    assert!(!found.is_empty() && output.status.success());
    assert_eq!(listed.len(), found.len());
    for (index, (device, info)) in listed.iter().zip(&found).enumerate() {
        assert_eq!(device["index"], index);
        assert!(device["name"] == info.name.as_str() && device["kind"] == info.kind.to_string(), "{device}");
        assert_eq!(device["api"], info.api_version.as_str());
        assert_eq!(device["missing"], Value::from(info.missing.clone()));
        assert_eq!(device["ray_query_lacks"], Value::from(info.ray_query_lacks.clone()));
        let limits = device["limits"].as_array().unwrap();
        let range = limits.iter().find(|l| l[0].as_str().unwrap().contains("storage buffer range")).unwrap();
        assert_eq!(range[1], info.max_storage_range);
        // A row of the table, and a block of limits.
        let row = text.lines().find(|line| line.starts_with(&format!("{index}  {}", info.name))).unwrap();
        assert_eq!(row.ends_with("yes"), info.missing.is_empty(), "{row}");
        assert!(text.contains(&format!("{index} {}: missing:", info.name)), "{text}");
        assert!(text.contains(&info.max_storage_range.to_string()), "{text}");
    }
}

/// The version of a driver is often a part of its device's name, and holds many small numbers.
#[test]
fn a_small_number_is_the_index_of_a_device_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");
    let on = |device: &str| {
        let small = ["--width", "8", "--height", "8", "--spp", "1", "--quiet", "-o", "a.exr", "--device", device];
        tallow(&folder, &[&["render", scene], &small[..]].concat())
    };
    let found = tallow::gpu::survey().unwrap();
    let beyond = found.len()..found.len() + 20;
    for index in beyond.map(|index| index.to_string()) {
        complains(&on(&index), 4, &[&format!("no device is called \"{index}\": choose one of 0: {}", found[0].name)]);
    }
    let usable = found.iter().position(|device| device.missing.is_empty()).unwrap();
    assert_eq!(on(&usable.to_string()).status.code(), Some(0), "control: an index that exists");
    assert_eq!(on(&found[usable].name[..4].to_uppercase()).status.code(), Some(0), "control: a part of a name");
}

/// Options of a command's help, each with all that is said of it.
fn options(help: &str) -> Vec<String> {
    let mut options: Vec<String> = Vec::new();
    for line in help.lines() {
        match options.last_mut() {
            _ if line.trim_start().starts_with('-') => options.push(line.trim().to_owned()),
            Some(option) => *option += &format!(" {}", line.trim()),
            None => {}
        }
    }
    options
}

#[test]
fn no_option_has_two_defaults() {
    let folder = tempfile::tempdir().unwrap();
    for command in ["render", "sequence", "filter", "compare", "cost", "merge", "explain", "profile", "devices"] {
        let help = stdout(&tallow(&folder, &[command, "--help"]));
        let options = options(&help);
        assert!(options.iter().any(|option| option.contains("--help")), "control: {help}");
        let twice = options.iter().find(|option| option.matches("[default: ").count() > 1);
        assert_eq!(twice, None, "{command}");
    }
    let help = stdout(&tallow(&folder, &["sequence", "--help"]));
    let carry: Vec<_> = options(&help).into_iter().filter(|said| said.starts_with("--reproject")).collect();
    assert!(carry.len() > 5 && carry.iter().all(|said| said.contains("[default: ")), "{carry:?}");
    let help = stdout(&tallow(&folder, &["cost", "--help"]));
    for (option, default) in [("--spp <LIST>", "1,2,4,8,16"), ("--rounds <LIST>", "0"), ("--width <N>", "512")] {
        let said = options(&help).into_iter().find(|said| said.starts_with(option)).unwrap_or_else(|| panic!("{help}"));
        assert!(said.contains(&format!("[default: {default}]")), "{said}");
    }
}

/// Events of a thread of the trace: name, begin and end in microseconds.
fn spans(trace: &Value, thread: &str) -> Vec<(String, f64, f64)> {
    let events = trace["traceEvents"].as_array().unwrap();
    let named = |e: &&Value| e["name"] == "thread_name" && e["args"]["name"].as_str().unwrap().starts_with(thread);
    let id = &events.iter().find(named).unwrap_or_else(|| panic!("no thread {thread}"))["tid"];
    let span = |e: &Value| {
        let (begin, duration) = (e["ts"].as_f64().unwrap(), e["dur"].as_f64().unwrap());
        (e["name"].as_str().unwrap().to_owned(), begin, begin + duration)
    };
    events.iter().filter(|e| e["ph"] == "X" && e["tid"] == *id).map(span).collect()
}

#[test]
fn a_profile_holds_every_pass_on_the_time_axis_of_the_host() {
    let folder = tempfile::tempdir().unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");
    let words = ["--width", "16", "--height", "16", "--spp", "2", "--quiet", "-o", "box.exr", "--profile", "p.json"];
    let output = tallow(&folder, &[&["render", scene], &words[..]].concat());
    assert!(output.status.success(), "{output:?}");
    let trace: Value = serde_json::from_slice(&std::fs::read(folder.path().join("p.json")).unwrap()).unwrap();
    let (cpu, gpu) = (spans(&trace, "CPU"), spans(&trace, "GPU"));
    let of = |spans: &[(String, f64, f64)], name: &str| {
        spans.iter().find(|s| s.0 == name).unwrap_or_else(|| panic!("no {name} in {spans:?}")).clone()
    };
    let [load, compile, render, write] = ["load scene", "upload and compile", "render", "write"].map(|n| of(&cpu, n));
    assert!(load.1 == 0.0 && load.2 <= compile.1 && compile.2 <= render.1 && render.2 <= write.1, "{cpu:?}");
    let [guide, path, fold] = ["primary_hit", "path", "accumulate"].map(|n| of(&gpu, n));
    assert!(guide.2 <= path.1 && path.1 < path.2 && path.2 <= fold.1, "{gpu:?}");
    if !trace.to_string().contains("unknown") {
        let within = |s: &(String, f64, f64)| render.1 - 100.0 <= s.1 && s.2 <= render.2 + 100.0; // clocks drift
        assert!(gpu.iter().all(within), "outside {render:?}: {gpu:?}");
    }
}

#[test]
fn output_errors_exit_5_and_the_old_file_stays() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder, "a.exr", 64, 0.5);
    complains(&tallow(&folder, &["render", "s.toml", "-o", "missing/a.exr"]), 5, &["missing", "create it"]);
    complains(&tallow(&folder, &["compare", "a.exr", "a.exr", "--diff", "missing/d.png"]), 5, &["create it"]);
    let long = format!("{}.png", "a".repeat(300));
    complains(&tallow(&folder, &["compare", "a.exr", "a.exr", "--diff", &long]), 5, &["choose a shorter name"]);
    #[cfg(target_os = "linux")]
    {
        complains(&tallow(&folder, &["render", "s.toml", "-o", "/proc/a.exr"]), 5, &["/proc takes no new files"]);
        full_disk(&folder);
    }
}

/// A limit of 0 bytes per file stands in for a full disk: the temporary file opens, and writing to it fails.
#[cfg(target_os = "linux")]
fn full_disk(folder: &TempDir) {
    let old = folder.path().join("d.png");
    std::fs::write(&old, "old").unwrap();
    let shell = |setup: &str| {
        let script = format!("{setup} exec \"$0\" compare a.exr a.exr --diff d.png");
        let mut command = Command::new("sh");
        command.args(["-c", &script, env!("CARGO_BIN_EXE_tallow")]).current_dir(folder.path()).output().unwrap()
    };
    complains(&shell("ulimit -f 0;"), 5, &["d.png", "free some space"]);
    complains(&shell("ulimit -n 5;"), 5, &["d.png", "raise the limit (ulimit -n)"]);
    assert_eq!(std::fs::read(&old).unwrap(), b"old");
    assert_eq!(names(folder.path()), ["a.exr", "d.png"], "no temporary file stays");
    // Control: without the limit the file is replaced.
    assert_eq!(shell("").status.code(), Some(0));
    assert_ne!(std::fs::read(&old).unwrap(), b"old");
    let mut to_full = Command::new("sh");
    to_full.args(["-c", "exec \"$0\" compare a.exr a.exr > /dev/full", env!("CARGO_BIN_EXE_tallow")]);
    complains(&to_full.current_dir(folder.path()).output().unwrap(), 5, &["standard output"]);
}

/// The process has so many KiB of addresses: what asks for more ends in an abort, unless it is told before.
#[cfg(target_os = "linux")]
fn within(kib: u32, folder: &TempDir, words: &str) -> std::process::Output {
    let script = format!("ulimit -v {kib}; exec \"$0\" {words}");
    let mut shell = Command::new("sh");
    shell.args(["-c", &script, env!("CARGO_BIN_EXE_tallow")]).current_dir(folder.path()).output().unwrap()
}

#[cfg(target_os = "linux")]
#[test]
fn files_that_claim_much_take_little_memory() {
    use flat::{ExrHead, NO_COMPRESSION, ZIP_16_LINES};
    let folder = tempfile::tempdir().unwrap();
    let save = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    let framed = ExrHead { display: [48, 8_388_656], ..ExrHead::new(ZIP_16_LINES, [8, 8]) };
    save("framed.exr", &framed.flat_file());
    save("bare.exr", &[ExrHead::new(NO_COMPRESSION, [8192, 8192]).bytes(), vec![0; 6000]].concat());
    let channels = ExrHead { channels: 60_000, ..ExrHead::new(ZIP_16_LINES, [64, 64]) };
    save("channels.exr", &[channels.bytes(), vec![0; 6000]].concat());
    let sparse = std::fs::File::create(folder.path().join("sparse.exr")).unwrap();
    sparse.set_len(3 << 30).unwrap();
    save("sky.toml", b"environment.file = \"framed.exr\"\n");
    for (words, parts) in [
        ("compare framed.exr framed.exr", ["framed.exr", "display window"]),
        ("compare bare.exr bare.exr", ["bare.exr", "complete?"]),
        ("compare channels.exr channels.exr", ["channels.exr", "complete?"]),
        ("compare sparse.exr sparse.exr", ["sparse.exr", "is no EXR"]),
        ("render sky.toml -o a.exr", ["framed.exr", "display window"]),
        ("merge sparse.exr sparse.exr -o a.exr", ["sparse.exr", "is no EXR"]),
        ("filter sparse.exr -o a.exr", ["sparse.exr", "is no EXR"]),
    ] {
        complains(&within(300_000, &folder, words), 3, &parts);
    }
    // What is right but too large for the process is another matter.
    let large = ExrHead { channels: 1, ..ExrHead::new(ZIP_16_LINES, [8192, 8192]) };
    save("large.exr", &large.flat_file());
    complains(&within(250_000, &folder, "compare large.exr large.exr"), 4, &["large.exr", "256.0 MiB of memory"]);
    let medium = ExrHead { channels: 1, ..ExrHead::new(ZIP_16_LINES, [2048, 2048]) };
    save("medium.exr", &medium.flat_file());
    complains(
        &within(300_000, &folder, "compare medium.exr medium.exr --layer c00000"),
        4,
        &["medium.exr", "of memory"],
    );
}

/// 79.2 GiB of a film within 4 GB of addresses: nothing of it can be taken before the check by mistake and go unseen.
#[cfg(target_os = "linux")]
#[test]
fn films_without_room_in_memory_are_refused_before_a_sample() {
    let folder = tempfile::tempdir().unwrap();
    let film = format!("{} --width 16384 --height 16384 --spp 1 --quiet", scene());
    for words in ["render", "render --denoise atrous", "sequence --frames 0..1 -o a.#.exr", "profile --frames 1"] {
        let refused = within(4_000_000, &folder, &format!("{words} {film}"));
        complains(&refused, 4, &["error: a film of 16384 x 16384 needs", "of memory", "choose a smaller film"]);
    }
    assert!(names(folder.path()).is_empty());
}

#[test]
fn what_no_device_can_filter_is_refused_before_it_is_decoded() {
    let folder = tempfile::tempdir().unwrap();
    // 3.2 GB of pixels, the last of which are damaged.
    let mut bytes = flat::ExrHead::new(flat::ZIP_16_LINES, [16_384, 16_384]).flat_file();
    let end = bytes.len();
    bytes[end - 100..].fill(0x55);
    std::fs::write(folder.path().join("large.exr"), bytes).unwrap();
    complains(&tallow(&folder, &["filter", "large.exr", "-o", "a.exr"]), 4, &["16384 x 16384"]);
}
