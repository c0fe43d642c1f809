//! Tests what the built program says of an image that is black.
use crate::command::{stdout, tallow};
use serde_json::Value;
use tempfile::TempDir;

/// A camera at the origin of a box, beside a lamp that is outside of it.
const SCENE: &str = "[camera]
position = [0, 0, 0]
target = [0, 0, -1]
[[mesh]]
shape = 'cube'
name = 'hall'
transform = { scale = 4 }
[[light]]
type = 'point'
position = [9, 0, 0]
intensity = 100
";

/// The warnings of a render of the scene.
fn warnings(folder: &TempDir, scene: &str, words: &str) -> Vec<String> {
    std::fs::write(folder.path().join("s.toml"), scene).unwrap();
    let words = format!("render s.toml --width 8 --height 8 --spp 1 --json {words}");
    let output = tallow(folder, &words.split(' ').collect::<Vec<_>>());
    assert!(output.status.success() && output.stderr.is_empty(), "{output:?}");
    let json: Value = serde_json::from_str(&stdout(&output)).unwrap();
    json["warnings"].as_array().unwrap().iter().map(|line| line.as_str().unwrap().to_owned()).collect()
}

#[test]
fn an_image_is_told_why_it_is_black() {
    let folder = tempfile::tempdir().unwrap();
    let pillar = "[[mesh]]\nshape = 'sphere'\ntransform = { scale = 0.1, translate = [0, 0, -1] }\n";
    let (inside, beside) =
        ("the camera sees one object alone, \"hall\", ", "no sample found light on what the camera sees ");
    let away = SCENE
        .replace("position = [0, 0, 0]", "position = [0, 0, -9]")
        .replace("target = [0, 0, -1]", "target = [0, 0, -10]");
    for (scene, words, why) in [
        (SCENE.to_owned(), "-o a.exr", inside),
        (SCENE.to_owned() + pillar, "-o a.exr", beside),
        // It has no layer of objects.
        (SCENE.to_owned(), "-o a.png", beside),
        (away, "-o a.exr", "the camera sees neither "),
    ] {
        let said = warnings(&folder, &scene, words);
        assert!(said.len() == 1 && said[0].starts_with(&format!("the image is black: {why}")), "{words}: {said:?}");
    }
    let unlit = SCENE.split("[[light]]").next().unwrap();
    assert_eq!(warnings(&folder, unlit, "-o a.exr"), ["the scene has no light: its image will be black"]);
    // Controls: one of which some is lit, and a pixel, which is one of many.
    assert!(warnings(&folder, &SCENE.replace("[9, 0, 0]", "[1, 0, 0]"), "-o a.exr").is_empty());
    assert!(warnings(&folder, SCENE, "-o a.exr --pixel 3,3").is_empty());
}

#[test]
fn a_black_frame_is_told_by_its_number() {
    let folder = tempfile::tempdir().unwrap();
    let keys = "[[animation]]\ncamera = true\nkeys = [{ time = 0, position = [0, 0, 0] }, { time = 1, position = [9, 0, 9] }]\n";
    let target = "target = [0, 0, -1]";
    let scene = SCENE.replace(target, "target = [4, 0, 0]") + keys;
    std::fs::write(folder.path().join("s.toml"), scene).unwrap();
    let words = "sequence s.toml --width 8 --height 8 --spp 1 --fps 1 --frames 0..2 --json -o a.#.exr";
    let output = tallow(&folder, &words.split(' ').collect::<Vec<_>>());
    let json: Value = serde_json::from_str(&stdout(&output)).unwrap();
    let said = json["warnings"].as_array().unwrap();
    assert!(said.len() == 1 && said[0].as_str().unwrap().starts_with("frame 0: the image is black: "), "{said:?}");
}
