//! Tests from the command line that a render records only the passes that it needs, and what `tallow explain` prints about the
//! cost of the others.
use crate::command::{complains, stdout, tallow};
use serde_json::Value;
use tallow::layout::{AliasEntry, Guide, Light};
use tempfile::TempDir;

const BOX: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");

fn json(folder: &TempDir, words: &[&str]) -> Value {
    let output = tallow(folder, words);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_str(&stdout(&output)).unwrap()
}

#[test]
fn primary_hits_are_found_only_for_files_that_keep_them() {
    let folder = tempfile::tempdir().unwrap();
    let render = |files: &[&str]| {
        let outputs = files.iter().flat_map(|file| ["-o", file]);
        let words = ["render", BOX, "--width", "31", "--height", "17", "--spp", "3", "--json"];
        let summary = json(&folder, &words.into_iter().chain(outputs).collect::<Vec<_>>());
        summary["passes"].as_array().unwrap().iter().any(|p| p["pass"] == "primary_hit")
    };
    assert!(render(&["layers.exr", "beside.png"]));
    assert!(!render(&["alone.png"]));
    let read = |name| std::fs::read(folder.path().join(name)).unwrap();
    assert_eq!(read("alone.png"), read("beside.png"), "the same colours to the last bit");
}

#[test]
fn explain_takes_the_settings_of_a_render() {
    let folder = tempfile::tempdir().unwrap();
    let explain = |words: &[&str]| tallow(&folder, &[&["explain", BOX, "adaptive", "--no-measure"], words].concat());
    assert!(stdout(&explain(&[])).contains("off"));
    let placed = stdout(&explain(&["--allocate", "both"]));
    assert!(placed.contains("on") && placed.contains("allocate both"), "{placed}");
    complains(&explain(&["--width", "0"]), 2, &["width is 0"]);
    for command in ["explain", "profile", "cost", "render", "sequence"] {
        complains(&tallow(&folder, &[command, BOX, "--camera", "left"]), 2, &["camera \"left\" is not there"]);
        complains(&tallow(&folder, &[command, BOX, "--clip", "walk"]), 2, &["clip \"walk\" is not there"]);
    }
}

#[test]
fn options_that_change_nothing_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let warned = |words: &str| {
        let output = tallow(&folder, &words.split_whitespace().collect::<Vec<_>>());
        assert!(output.status.success(), "{output:?}");
        String::from_utf8(output.stderr).unwrap()
    };
    let small = format!("render {BOX} --width 8 --height 8 --spp 4 -o a.exr");
    assert_eq!(warned(&format!("{small} --window 3")), "warning: --window changes nothing: uniform does not read it\n");
    assert_eq!(warned(&format!("{small} --window 3 --allocate both")), "");
    let told = "warning: min-spp is 4: spp, 4, leaves no samples that both could place\n";
    assert_eq!(warned(&format!("{small} --allocate both --min-spp 4")), told);
    assert_eq!(warned(&format!("{small} --allocate both --min-spp 4 --noise-threshold 1")), "", "there spp is a limit");
    let told =
        |most: u32| format!("warning: max-spp is {most}, and spp 4: all pixels get {most}, and both places none\n");
    assert_eq!(warned(&format!("{small} --allocate both --max-spp 3")), told(3));
    assert_eq!(warned(&format!("{small} --allocate both --max-spp 4")), told(4));
    assert_eq!(warned(&format!("{small} --allocate both --max-spp 5")), "");
    assert_eq!(warned(&format!("{small} --allocate threshold --max-spp 3")), "", "there max-spp is no limit");
    let moving = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/moving/scene.toml");
    let frames = format!("sequence {moving} --width 8 --height 8 --frames 0..1 --spp 2 --allocate both -o f.#.exr");
    assert!(!warned(&frames).contains("min-spp"), "carried samples count");
    assert!(warned(&format!("{frames} --reproject off")).contains("warning: min-spp is 2"));
    let filter = "filter a.exr -o b.exr --filter";
    let told = "warning: --levels changes nothing: bilateral does not read it\n";
    assert_eq!(warned(&format!("{filter} bilateral --levels 3 --radius 4")), told);
    assert_eq!(warned(&format!("{filter} atrous --levels 3 --conserve-energy")), "");
    let listed = |words: &str| {
        let words: Vec<_> = words.split_whitespace().chain(["--json"]).collect();
        serde_json::from_value::<Vec<String>>(json(&folder, &words)["warnings"].take()).unwrap().join("; ")
    };
    let unread = "--window changes nothing: uniform does not read it";
    assert_eq!(listed(&format!("{small} --window 3")), unread);
    let unplaced = "min-spp is 4: spp, 4, leaves no samples that both could place";
    assert_eq!(listed(&format!("{small} --allocate both --min-spp 4")), unplaced);
    let lens = "[film]\nwidth = 8\nheight = 8\n[camera]\nposition = [0, 0, 2]\ntarget = [0, 0, 0]\nfocus_distance = 2\nlens_radius";
    let file = folder.path().join("lens.toml");
    std::fs::write(&file, format!("{lens} = 0.1\n[[mesh]]\nshape = 'rectangle'\n[environment]\n")).unwrap();
    let blurred = listed("render lens.toml --spp 1 -o lens.exr --denoise atrous");
    assert!(blurred.starts_with("atrous leaves the noise of direct light, lamps and sky"), "{blurred}");
    assert_eq!(listed("render lens.toml --spp 1 -o lens.exr --denoise svgf"), "");
    let sparse = listed(&format!("{small} --indirect-stride 2"));
    assert!(sparse.contains("add --denoise"), "{sparse}");
    assert!(listed(&frames.replace("--allocate both", "--window 3")).contains(unread));
    assert!(listed(&format!("{frames} --reproject off")).contains("min-spp is 2"));
    let cut = listed(&format!("{filter} bilateral --levels 3 --radius 4"));
    assert_eq!(cut, "--levels changes nothing: bilateral does not read it");
}

#[test]
fn explain_tells_what_effects_cost() {
    let folder = tempfile::tempdir().unwrap();
    // Two samples of each of 128 x 128 pixels are in flight at a time.
    let file = format!("file = \"{}/", BOX.trim_end_matches("/scene.toml"));
    let small = [("spp = 64", "spp = 2"), ("= 512", "= 128"), ("file = \"", &file)];
    let scene = small.iter().fold(std::fs::read_to_string(BOX).unwrap(), |text, (from, to)| text.replace(from, to));
    std::fs::write(folder.path().join("box.toml"), scene).unwrap();
    let document = json(&folder, &["explain", "box.toml", "textures", "emissive", "adaptive", "guides", "--json"]);
    assert_eq!(document["film_size"], serde_json::json!([128, 128]));
    let rows = &document["effects"];
    let names: Vec<_> = rows.as_array().unwrap().iter().map(|row| row["effect"].as_str().unwrap()).collect();
    assert_eq!(names, ["textures", "emissive", "adaptive", "guides"]);
    let [textures, emissive, adaptive, guides] = [0, 1, 2, 3].map(|i| &rows[i]);
    assert_eq!((&textures["on"], &textures["called_for_by"]), (&false.into(), &"".into()));
    assert_eq!((&emissive["on"], &emissive["called_for_by"]), (&true.into(), &"material \"light\"".into()));
    // All that reads surfaces, lights and maps is compiled: a fifth of the pipelines' time, several times what it varies by
    // where nothing else takes it.
    let compiles = |row: &Value| row["compile_ms"].as_f64().unwrap() > 0.0;
    let again = || compiles(&json(&folder, &["explain", BOX, "textures", "--json"])["effects"][0]);
    assert!(compiles(textures) || again() || again(), "{textures}");
    for row in [textures, emissive, guides] {
        let [with, without] = ["gpu_ms_with", "gpu_ms_without"].map(|name| row[name].as_f64().unwrap());
        let [low, high] = [0, 1].map(|end| row["gpu_ms_added"][end].as_f64().unwrap());
        assert!(with > 0.0 && without > 0.0 && low <= high, "{row}");
    }
    assert_eq!([&adaptive["gpu_ms_with"], &adaptive["gpu_ms_added"]], [&Value::Null; 2]);
    // The lamp's two triangles, with their entries in the alias table; a guide for each of 128 x 128 primary hits, and where
    // samples are placed 20 bytes a pixel, weight, count, offset and priority, and 8 bytes for each of two paths. Where they are
    // not, buffers have one element.
    assert_eq!(emissive["bytes"], 2 * (size_of::<Light>() + size_of::<AliasEntry>()));
    let pixels = 128 * 128;
    for (row, bytes) in [(guides, size_of::<Guide>() as u64 * pixels), (adaptive, (20 + 2 * 8) * pixels)] {
        assert!(row["bytes"].as_u64().unwrap().abs_diff(bytes) < 1024, "{row}");
    }
}

#[test]
fn explain_knows_its_effects() {
    let folder = tempfile::tempdir().unwrap();
    complains(&tallow(&folder, &["explain", BOX, "texture"]), 2, &["\"texture\"", "textures", "guides"]);
    complains(&tallow(&folder, &["explain", "nope.toml"]), 3, &["nope.toml"]);
}

#[test]
fn what_was_repaired_in_a_scene_is_in_every_document() {
    let folder = tempfile::tempdir().unwrap();
    let dark =
        "[film]\nwidth = 8\nheight = 8\n[render]\nspp = 1\n[[mesh]]\nshape = 'cube'\n[environment]\nradiance = 0\n";
    std::fs::write(folder.path().join("dark.toml"), dark).unwrap();
    for words in [
        "explain dark.toml lens",
        "profile dark.toml --frames 2",
        "sequence dark.toml --frames 0..2 -o f.#.png",
        "cost dark.toml --spp 1 --denoise none --repeats 2 --reference-spp 64 -o results",
    ] {
        let plain: Vec<_> = words.split(' ').collect();
        let document = json(&folder, &[&plain[..], &["--json"]].concat());
        let warnings: Vec<_> =
            document["warnings"].as_array().unwrap_or_else(|| panic!("{words}: {document}")).iter().collect();
        assert!(warnings.iter().any(|w| w.as_str().unwrap().contains("has no light")), "{words}: {document}");
        let moves = warnings.iter().any(|w| w.as_str().unwrap().contains("nothing moves"));
        assert_eq!(moves, words.starts_with("sequence"), "{words}: {document}");
    }
    let told = tallow(&folder, &["explain", "dark.toml", "lens"]);
    let line = String::from_utf8(told.stderr).unwrap();
    assert!(line.starts_with("warning: ") && line.contains("has no light"), "{line}");
}
