//! Tests `--indirect-stride` through the built program.
use crate::command::{complains, tallow};
use tallow::image;
use tempfile::TempDir;

const SCENE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");
const STRIDE: [&str; 6] = ["--width", "32", "--height", "24", "--indirect-stride", "2"];

#[test]
fn a_sparse_render_is_filled_in_at_once_or_from_its_file() {
    let folder = TempDir::new().unwrap();
    let run = |words: &[&str]| {
        let output = tallow(&folder, words);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stderr).unwrap()
    };
    let render = |words: &[&str]| run(&[&["render", SCENE], &STRIDE[..], words].concat());
    let told = render(&["--spp", "4", "-o", "noisy.exr"]);
    assert!(told.contains("warning: with indirect_stride 2 most pixels lack"), "{told}");
    let told = render(&["--spp", "4", "-o", "clean.exr", "--denoise", "auto"]);
    assert!(!told.contains("warning"), "{told}");
    run(&["filter", "noisy.exr", "--filter", "auto", "-o", "filtered.exr"]);
    let colour = |name: &str| image::read(&folder.path().join(name)).unwrap().picture(None).unwrap();
    let [noisy, clean, filtered] = ["noisy.exr", "clean.exr", "filtered.exr"].map(colour);
    assert_eq!(clean.pixels, filtered.pixels);
    // All light of the box is its lamp's, so that pixels in between are black until they are filled in; beside the box all are.
    let black = |picture: &image::Picture| picture.pixels.iter().filter(|pixel| **pixel == [0.0; 3]).count();
    let (before, after) = (black(&noisy), black(&clean));
    assert!(before > 3 * after, "{before} black pixels, then {after}");
    // What was filled in stays so.
    run(&["filter", "clean.exr", "--filter", "none", "-o", "again.exr"]);
    assert_eq!(colour("again.exr").pixels, clean.pixels);
    // More samples join as any others.
    render(&["--spp", "8", "--resume", "noisy.exr", "-o", "more.exr"]);
    render(&["--spp", "8", "-o", "whole.exr"]);
    assert_eq!(colour("more.exr").pixels, colour("whole.exr").pixels);
}

/// Layers beside the colour are whole; what is filtered of it is its indirect light.
#[test]
fn a_sparse_file_has_whole_layers() {
    let folder = TempDir::new().unwrap();
    let run = |words: &[&str]| tallow(&folder, words);
    let render = [&["render", SCENE, "--quiet", "--spp", "4", "-o", "noisy.exr"], &STRIDE[..]].concat();
    assert!(run(&render).status.success());
    let layer =
        |name: &str, layer: &str| image::read(&folder.path().join(name)).unwrap().picture(Some(layer)).unwrap().pixels;
    for name in ["albedo", "direct"] {
        assert!(run(&["filter", "noisy.exr", "--colour", name, "--filter", "none", "-o", "same.exr"]).status.success());
        assert!(layer("same.exr", name) == layer("noisy.exr", name), "{name}");
    }
    assert!(
        run(&["filter", "noisy.exr", "--colour", "direct", "--filter", "atrous", "-o", "other.exr"]).status.success()
    );
    assert!(layer("other.exr", "direct") != layer("noisy.exr", "direct"), "it is filtered itself");
    for option in [&["--no-demodulate"][..], &["--light", "all"]] {
        let words = [&["filter", "noisy.exr", "--filter", "atrous", "-o", "no.exr"], option].concat();
        complains(&run(&words), 2, &["leave out", option[0], "indirect_stride"]);
    }
}

#[test]
fn what_cannot_be_sparse_is_one_line() {
    let folder = TempDir::new().unwrap();
    let cost = ["cost", SCENE, "--denoise", "none,atrous", "--spp", "1", "--with", "--indirect-stride 2"];
    complains(&tallow(&folder, &cost), 2, &["leave out the filter none"]);
    let planned = [&["render", SCENE, "--time", "50ms"], &STRIDE[..]].concat();
    complains(&tallow(&folder, &planned), 2, &["set indirect_stride to 1"]);
    assert!(!folder.path().join("scene.exr").exists());
}
