//! Tests `--filter oidn` and `--denoise oidn`: without Open Image Denoise, with a library that stands for it, and with its own where
//! TALLOW_OIDN names it.
use crate::command::{complains, stdout};
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::LazyLock;
use tallow::image::{self, Film, Samples, WriteOptions};
use tempfile::TempDir;

const SIZE: [u32; 2] = [8, 6];
/// A pixel of the noisy file that is no number.
const BROKEN: usize = 11;

/// Runs the program with a library in the place of Open Image Denoise.
fn with(library: &Path, folder: &TempDir, words: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tallow"));
    command.args(words).current_dir(folder.path()).env("TALLOW_OIDN", library).output().unwrap()
}

/// Compiles C text into a library that can be loaded.
fn compiled(name: &str, text: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let [source, library] = ["c", "so"].map(|ending| folder.join(format!("{name}.{ending}")));
    std::fs::write(&source, text).unwrap();
    let mut cc = Command::new("cc");
    // Contracted, products and sums would round differently than here.
    let done = cc.args(["-shared", "-fPIC", "-ffp-contract=off", "-o"]).args([&library, &source]).status();
    assert!(done.unwrap().success());
    library
}

static FAKE: LazyLock<PathBuf> = LazyLock::new(|| compiled("fake_oidn", include_str!("fake_oidn.c")));

/// Three values of a pixel, none of them like another's.
fn value(pixel: usize, channel: usize) -> f32 {
    (pixel * 3 + channel) as f32 / 16.0
}

fn planes(of: impl Fn(usize, usize) -> f32) -> Vec<[f32; 3]> {
    (0..(SIZE[0] * SIZE[1]) as usize).map(|i| [0, 1, 2].map(|c| of(i, c))).collect()
}

fn normal(pixel: usize, channel: usize) -> f32 {
    if channel == pixel % 3 { 1.0 } else { 0.0 }
}

/// Writes `noisy.exr`, with layers of the surface or without.
fn write_noisy(folder: &TempDir, surfaces: bool) {
    let mut film = Film::new(SIZE[0], SIZE[1]);
    film.add_vec3("", ["R", "G", "B"], &planes(|i, c| if i == BROKEN { f32::NAN } else { value(i, c) }));
    if surfaces {
        film.add_vec3("albedo", ["R", "G", "B"], &planes(|i, c| value(i, c) / 16.0));
        film.add_vec3("N", ["X", "Y", "Z"], &planes(normal));
        film.add("Z", Samples::F32(vec![5.0; film.pixels()]));
    }
    image::write(&folder.path().join("noisy.exr"), &film, &WriteOptions::default()).unwrap();
}

fn colours(folder: &TempDir, file: &str, layer: Option<&str>) -> Vec<[f32; 3]> {
    image::read(&folder.path().join(file)).unwrap().picture(layer).unwrap().pixels
}

fn scene() -> String {
    format!("{}/scenes/cornell-box/glossy.toml", env!("CARGO_MANIFEST_DIR"))
}

fn render(library: &Path, folder: &TempDir) -> Output {
    let words = ["--width", "8", "--height", "6", "--spp", "2", "--denoise", "oidn", "-o", "clean.exr", "--validation"];
    with(library, folder, &[&["render", &scene(), "--quiet"], &words[..]].concat())
}

#[test]
fn without_the_library_one_line_says_how_to_get_it_and_nothing_is_rendered() {
    let folder = tempfile::tempdir().unwrap();
    write_noisy(&folder, true);
    let missing = Path::new("/nonexistent/oidn.so");
    let parts = ["Open Image Denoise", "TALLOW_OIDN: /nonexistent/oidn.so", "install", "official release"];
    complains(&render(missing, &folder), 4, &parts);
    complains(&with(missing, &folder, &["filter", "noisy.exr", "-o", "clean.exr", "--filter", "oidn"]), 4, &parts);
    let scene = scene();
    let frames = ["sequence", &scene, "--frames", "0..3", "--turntable", "9", "--denoise", "oidn", "-o", "clean.#.exr"];
    complains(&with(missing, &folder, &frames), 4, &parts);
    assert!(!folder.path().join("clean.exr").exists());
    let other = compiled("other_library", "int nothing;");
    complains(
        &render(&other, &folder),
        4,
        &["other_library.so", "no Open Image Denoise 2", "oidnNewDevice", "install"],
    );
    assert!(!folder.path().join("clean.exr").exists());
}

#[test]
fn an_image_s_light_goes_through_it_whole_with_albedo_and_normals() {
    let folder = tempfile::tempdir().unwrap();
    for (surfaces, options, quality) in
        [(true, &[][..], 6.0), (true, &["--oidn-quality", "fast"], 4.0), (false, &["--oidn-quality", "balanced"], 5.0)]
    {
        write_noisy(&folder, surfaces);
        let words = ["filter", "noisy.exr", "-o", "clean.exr", "--filter", "oidn", "--validation", "--json"];
        let output = with(&FAKE, &folder, &[&words[..], options].concat());
        assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]));
        let expected = |i, c| {
            let light = if i == BROKEN { 0.0 } else { value(i, c) };
            let [albedo, normal] = if surfaces { [value(i, c) / 16.0, normal(i, c)] } else { [0.0; 2] };
            light / 2.0 + albedo / 4.0 + normal / 8.0 + quality
        };
        assert_eq!(colours(&folder, "clean.exr", None), planes(expected), "{quality}");
        let summary: Value = serde_json::from_str(&stdout(&output)).unwrap();
        let passes: Vec<_> =
            summary["passes"].as_array().unwrap().iter().map(|p| p["pass"].as_str().unwrap()).collect();
        assert_eq!(passes, ["demodulate", "oidn start (wall clock)", "oidn (wall clock)", "remodulate"]);
    }
}

#[test]
fn a_render_goes_through_it_and_keeps_the_noisy_image() {
    let folder = tempfile::tempdir().unwrap();
    let output = render(&FAKE, &folder);
    assert_eq!((output.status.code(), String::from_utf8_lossy(&output.stderr).as_ref()), (Some(0), ""));
    let noisy = colours(&folder, "clean.exr", Some("Noisy Image"));
    let [albedo, normal] = ["albedo", "N"].map(|layer| colours(&folder, "clean.exr", Some(layer)));
    let expected = planes(|i, c| noisy[i][c] / 2.0 + albedo[i][c] / 4.0 + normal[i][c] / 8.0 + 6.0);
    assert_eq!(colours(&folder, "clean.exr", None), expected);
    assert!(albedo.iter().any(|a| a != &[0.0; 3]) && normal.iter().any(|n| n != &[0.0; 3]));
}

#[test]
fn its_own_errors_are_shown_and_the_noisy_image_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_tallow"));
    command.args(["render", &scene(), "--quiet", "--width", "8", "--height", "6", "--spp", "2", "--denoise", "oidn"]);
    command.args(["-o", "noisy.exr"]).current_dir(folder.path());
    let output = command.env("TALLOW_OIDN", &*FAKE).env("FAKE_OIDN_FAILS", "1").output().unwrap();
    complains(&output, 4, &["Open Image Denoise", "the planted error"]);
    assert!(colours(&folder, "noisy.exr", None).iter().flatten().any(|&v| v > 0.0));
}

#[test]
fn what_it_cannot_do_is_told() {
    let folder = tempfile::tempdir().unwrap();
    write_noisy(&folder, true);
    let words = ["filter", "noisy.exr", "-o", "clean.exr", "--filter", "oidn", "--scene", "scene.toml"];
    complains(&with(&FAKE, &folder, &words), 2, &["--scene", "oidn"]);
    let words = ["filter", "noisy.exr", "-o", "clean.exr", "--filter", "oidn", "--light", "indirect"];
    complains(&with(&FAKE, &folder, &words), 2, &["--light", "oidn"]);
}

/// TALLOW_OIDN names Open Image Denoise itself.
#[test]
#[ignore = "needs TALLOW_OIDN"]
fn the_library_itself_takes_noise_away_and_the_same_image_gives_the_same_bits() {
    let library = std::env::var_os("TALLOW_OIDN").expect("TALLOW_OIDN names the library");
    let folder = tempfile::tempdir().unwrap();
    let render = |spp: &str, file: &str, more: &[&str]| {
        let words = ["render", &scene(), "--quiet", "--width", "64", "--height", "64", "--spp", spp, "-o", file];
        let output = with(Path::new(&library), &folder, &[&words[..], more].concat());
        assert_eq!((output.status.code(), String::from_utf8_lossy(&output.stderr).as_ref()), (Some(0), ""));
    };
    render("256", "reference.exr", &["--seed", "1"]);
    render("4", "clean.exr", &["--denoise", "oidn"]);
    render("4", "again.exr", &["--denoise", "oidn"]);
    let [clean, again] = ["clean.exr", "again.exr"].map(|file| colours(&folder, file, None));
    assert_eq!(clean, again);
    let picture = |file: &str, layer| image::read(&folder.path().join(file)).unwrap().picture(layer).unwrap();
    let reference = picture("reference.exr", None);
    let error = |layer| image::metrics::relmse(&picture("clean.exr", layer), &reference);
    let (before, after) = (error(Some("Noisy Image")), error(None));
    assert!(after < 0.25 * before, "{after} {before}");
}
