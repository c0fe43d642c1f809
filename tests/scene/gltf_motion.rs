//! Tests animations of glTF files: nodes, joints, morph targets, cameras and lights at times, and damaged samplers.
use crate::gltf_file::{data, floats, triangle};
use serde_json::{Value, json};
use tallow::scene::{Loaded, Scene, SceneFile};

fn open(json: &Value) -> SceneFile<'static> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, json.to_string()).unwrap();
    SceneFile::open(&path).unwrap_or_else(|e| panic!("{e}"))
}

pub fn load(json: &Value) -> Loaded {
    open(json).load().unwrap_or_else(|e| panic!("{e}"))
}

/// Adds an accessor of floats; returns its index.
pub fn add(json: &mut Value, numbers: &[f32], kind: &str) -> usize {
    let width = match kind {
        "VEC3" => 3,
        "VEC4" => 4,
        "MAT4" => 16,
        _ => 1,
    };
    let bytes = floats(numbers);
    let list = |json: &Value, name: &str| json[name].as_array().unwrap().len();
    let (buffer, view) = (list(json, "buffers"), list(json, "bufferViews"));
    push(json, "buffers", json!({ "byteLength": bytes.len(), "uri": data(&bytes) }));
    push(json, "bufferViews", json!({ "buffer": buffer, "byteLength": bytes.len() }));
    let count = numbers.len() / width;
    push(json, "accessors", json!({ "bufferView": view, "componentType": 5126, "count": count, "type": kind }));
    list(json, "accessors") - 1
}

fn push(json: &mut Value, list: &str, value: Value) {
    json[list].as_array_mut().unwrap().push(value);
}

/// A clip that changes one thing from time 0 to time 2.
fn animate(json: &mut Value, node: usize, path: &str, values: &[f32], kind: &str) {
    let (input, output) = (add(json, &[0.0, 2.0], "SCALAR"), add(json, values, kind));
    if json.get("animations").is_none() {
        json["animations"] = json!([]);
    }
    push(
        json,
        "animations",
        json!({
            "channels": [{ "sampler": 0, "target": { "node": node, "path": path } }],
            "samplers": [{ "input": input, "output": output }]
        }),
    );
}

/// Corners of the first triangle in the world once `scene` is as it is at a time.
fn corners(loaded: &Loaded, seconds: f64) -> Vec<[f32; 3]> {
    let mut scene: Scene = loaded.scene.clone();
    scene.apply(&loaded.animation.at(seconds).unwrap()).unwrap();
    scene.check().unwrap();
    let t = &scene.triangles[0];
    let rows = scene.instances.first().map(|i| [i.world0, i.world1, i.world2].map(glam::Vec4::from));
    let world = |p: [f32; 3]| match rows {
        Some(rows) => rows.map(|row| row.dot(glam::Vec3::from(p).extend(1.0))),
        None => p,
    };
    [t.v0, t.v1, t.v2].map(world).to_vec()
}

#[test]
fn nodes_carry_meshes_cameras_and_lights() {
    let mut json = triangle();
    json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 8 }] } });
    json["nodes"] = json!([
        { "children": [1, 2, 3] }, { "mesh": 0 }, { "camera": 0, "name": "eye", "translation": [0, 0, 3] },
        { "extensions": { "KHR_lights_punctual": { "light": 0 } } }
    ]);
    json["scenes"][0]["nodes"] = json!([0]);
    animate(&mut json, 0, "translation", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0], "VEC3");
    let loaded = load(&json);
    assert_eq!(loaded.animation.end(), 2.0);
    assert_eq!(corners(&loaded, 0.0)[0], [0.0, 0.0, 0.0]);
    assert_eq!(corners(&loaded, 1.0)[0], [2.0, 0.0, 0.0]);
    assert_eq!(corners(&loaded, 9.0)[1], [5.0, 0.0, 0.0]);
    let pose = loaded.animation.at(1.5).unwrap();
    assert_eq!(pose.lights[0].1.position, Some([3.0, 0.0, 0.0]));
    assert_eq!(pose.camera.unwrap().build([8, 8], [[0.0; 3]; 2]).unwrap().position, [3.0, 0.0, 3.0]);
    assert_eq!(loaded.fingerprint([8, 8]).unwrap(), load(&json).fingerprint([8, 8]).unwrap());
}

#[test]
fn a_camera_that_frames_the_scene_stays_where_it_is() {
    let mut json = triangle();
    json["scenes"][0]["nodes"] = json!([0]);
    animate(&mut json, 0, "translation", &[0.0, 0.0, 0.0, 400.0, 0.0, 0.0], "VEC3");
    let loaded = load(&json);
    let mut scene = loaded.scene.clone();
    scene.apply(&loaded.animation.at(2.0).unwrap()).unwrap();
    assert_eq!(scene.bounds[1], [401.0, 1.0, 0.0]);
    assert_eq!(scene.camera([8, 8]).unwrap(), loaded.camera([8, 8]).unwrap());
}

#[test]
fn what_is_flat_at_rest_may_grow() {
    let mut json = triangle();
    json["nodes"][0]["scale"] = json!([0, 0, 0]);
    animate(&mut json, 0, "scale", &[0.0, 0.0, 0.0, 2.0, 2.0, 2.0], "VEC3");
    let loaded = load(&json);
    assert_eq!(corners(&loaded, 1.0)[1], [1.0, 0.0, 0.0]);
    let mut scene = loaded.scene.clone();
    scene.apply(&loaded.animation.at(0.0).unwrap()).unwrap();
    scene.check().unwrap();
}

/// No instance is as flat as a plane: its vertices are placed in each pose. So it is seen where its parent takes it, and has its extent back
/// when it grows.
#[test]
fn what_is_flattened_along_an_axis_moves() {
    let mut json = triangle();
    json["nodes"][0]["scale"] = json!([2, 0, 1]);
    let mesh = json["nodes"].as_array().unwrap().len();
    push(&mut json, "nodes", json!({ "children": [0] }));
    json["scenes"][0]["nodes"] = json!([mesh, 1]);
    animate(&mut json, mesh, "translation", &[0.0, 0.0, 0.0, 0.0, 0.0, 4.0], "VEC3");
    animate(&mut json, 0, "scale", &[2.0, 0.0, 1.0, 2.0, 3.0, 1.0], "VEC3");
    let loaded = load(&json);
    assert_eq!(loaded.warnings, Vec::<String>::new());
    assert_eq!(corners(&loaded, 0.0), [[0.0; 3], [2.0, 0.0, 0.0], [0.0; 3]]);
    assert_eq!(corners(&loaded, 2.0), [[0.0, 0.0, 4.0], [2.0, 0.0, 4.0], [0.0, 3.0, 4.0]]);
    // Turned below and above the scale: no determinant is exactly 0.
    let mut json = triangle();
    json["nodes"][0]["rotation"] = json!([0.36, 0.48, 0.48, 0.64]);
    let parent = json["nodes"].as_array().unwrap().len();
    push(&mut json, "nodes", json!({ "children": [0], "scale": [2, 0, 1], "rotation": [0.64, -0.48, 0.48, 0.36] }));
    push(&mut json, "nodes", json!({ "children": [parent] }));
    json["scenes"][0]["nodes"] = json!([parent + 1, 1]);
    animate(&mut json, parent + 1, "translation", &[0.0, 0.0, 0.0, 0.0, 0.0, 4.0], "VEC3");
    let loaded = load(&json);
    let [from, to] = [0.0, 2.0].map(|at| corners(&loaded, at));
    assert!(from[1] != from[2] && from[1] != from[0] && from[2] != from[0], "{from:?}");
    for ([x, y, z], b) in from.iter().zip(to) {
        assert!((glam::Vec3::from(b) - glam::vec3(*x, *y, z + 4.0)).length() < 1e-5, "{from:?}");
    }
    // Weights of a mesh on a flattened node.
    let mut json = triangle();
    json["nodes"][0]["scale"] = json!([2, 1, 0]);
    json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 0 }]);
    animate(&mut json, 0, "weights", &[0.0, 1.0], "SCALAR");
    let loaded = load(&json);
    assert_eq!([0.0, 1.0].map(|at| corners(&loaded, at)[1]), [[2.0, 0.0, 0.0], [3.0, 0.0, 0.0]]);
}

#[test]
fn joints_and_weights_move_vertices() {
    let mut json = triangle();
    json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 0 }]);
    animate(&mut json, 0, "weights", &[0.0, 1.0], "SCALAR");
    let loaded = load(&json);
    assert_eq!(corners(&loaded, 0.0)[1], [1.0, 0.0, 0.0]);
    assert_eq!(corners(&loaded, 1.0)[1], [1.5, 0.0, 0.0]);

    let mut json = triangle();
    let joints = add(&mut json, &[0.0; 12], "VEC4");
    let weights = add(&mut json, &[1.0, 0.0, 0.0, 0.0].repeat(3), "VEC4");
    json["accessors"][joints]["componentType"] = json!(5123);
    json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = json!(joints);
    json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(weights);
    json["skins"] = json!([{ "joints": [2] }]);
    json["nodes"][0]["skin"] = json!(0);
    push(&mut json, "nodes", json!({}));
    json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    let half = std::f32::consts::FRAC_1_SQRT_2;
    animate(&mut json, 2, "rotation", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half], "VEC4");
    let loaded = load(&json);
    let [x, y, _] = corners(&loaded, 2.0)[1];
    assert!(x.abs() < 1e-6 && (y - 1.0).abs() < 1e-6, "a quarter turn: {x} {y}");
    // A joint that is flattened leaves no NaN.
    animate(&mut json, 2, "scale", &[1.0, 1.0, 1.0, 0.0, 0.0, 0.0], "VEC3");
    assert!(corners(&load(&json), 2.0).iter().flatten().all(|v| v.is_finite()));
    // Nor does a skin whose matrices have no inverse: it shrinks to a point.
    let nothing = add(&mut json, &[0.0; 16], "MAT4");
    json["skins"][0]["inverseBindMatrices"] = json!(nothing);
    assert_eq!(corners(&load(&json), 1.0), [[0.0; 3]; 3]);
}

#[test]
fn clips_that_move_the_same_are_named() {
    let mut json = triangle();
    animate(&mut json, 0, "translation", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0], "VEC3");
    animate(&mut json, 1, "translation", &[0.0, 0.0, 3.0, 0.0, 0.0, 5.0], "VEC3");
    animate(&mut json, 0, "translation", &[0.0, 0.0, 0.0, 9.0, 0.0, 0.0], "VEC3");
    json["animations"][2]["name"] = json!("Run");
    let loaded = load(&json);
    assert_eq!(corners(&loaded, 2.0)[0], [4.0, 0.0, 0.0]);
    let pose = loaded.animation.at(2.0).unwrap();
    assert_eq!(pose.camera.unwrap().build([8, 8], [[0.0; 3]; 2]).unwrap().position, [0.0, 0.0, 5.0]);
    assert!(
        loaded
            .warnings
            .iter()
            .any(|line| line.contains("an earlier animation moves the same (a clip can be chosen): Run"))
    );
}

/// A pose at one key is that of all times, whenever the key is.
#[test]
fn one_key_alone_moves_nothing() {
    let mut json = triangle();
    animate(&mut json, 0, "translation", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0], "VEC3");
    let moving = load(&json).animation;
    assert_eq!(moving.moving(), Some(0.0..2.0));
    assert!(moving.moves_between([1.0, 3.0]) && !moving.moves_between([2.0, 3.0]));
    let (input, output) = (add(&mut json, &[5.0], "SCALAR"), add(&mut json, &[4.0, 0.0, 0.0], "VEC3"));
    json["animations"][0]["samplers"][0] = json!({ "input": input, "output": output });
    let still = load(&json).animation;
    assert_eq!((still.moving(), still.end()), (None, 5.0));
    assert!(!still.is_empty() && !still.moves_between([0.0, 9.0]));
}

#[test]
fn damaged_animations_are_not_played_and_say_so_in_a_line() {
    let said = |change: &dyn Fn(&mut Value), word: &str| {
        let mut json = triangle();
        animate(&mut json, 0, "translation", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0], "VEC3");
        change(&mut json);
        let loaded = load(&json);
        let lines: Vec<_> = loaded.warnings.iter().filter(|line| line.contains("animation")).collect();
        assert!(lines.len() == 1 && lines[0].contains(word) && !lines[0].contains(char::is_control), "{lines:?}");
        assert!(loaded.animation.at(1.0).unwrap().instances.is_empty());
    };
    let target = |key: &'static str, value: Value| {
        move |json: &mut Value| json["animations"][0]["channels"][0]["target"][key] = value.clone()
    };
    said(&target("node", json!(99)), "moves node 99, which is not there");
    said(&target("path", json!("pointer\n")), "moves what glTF does not know");
    said(&target("path", json!("weights")), "moves morph targets of node 0, which has none");
    said(&target("path", json!("rotation")), "has 6 numbers for 2 keys, which take 8");
    let sampler = |key: &'static str, value: Value| {
        move |json: &mut Value| json["animations"][0]["samplers"][0][key] = value.clone()
    };
    said(&|json| json["animations"][0]["channels"][0]["sampler"] = json!(7), "names sampler 7 of 1");
    said(&sampler("input", json!(99)), "names accessors 99");
    said(&sampler("input", json!(0)), "has elements of 3 numbers where 1 are needed");
    said(&sampler("interpolation", json!("CUBICSPLINE")), "which take 18");
    said(&sampler("interpolation", json!("BEZIER")), "an interpolation other than");
    said(&|json| json["nodes"][0]["matrix"] = json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]), "has a matrix");
    for (times, word) in
        [([2.0, 1.0], "keys out of order"), ([1.0, 1.0], "keys out of order"), ([0.0, f32::NAN], "NaN")]
    {
        let change = |json: &mut Value| {
            let input = add(json, &times, "SCALAR");
            json["animations"][0]["samplers"][0]["input"] = json!(input);
        };
        said(&change, word);
    }
    // A channel of an extension moves no node; the rest is played.
    let mut json = triangle();
    animate(&mut json, 0, "translation", &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0], "VEC3");
    let pointer = json!({ "sampler": 0, "target": { "path": "pointer" } });
    json["animations"][0]["channels"].as_array_mut().unwrap().push(pointer);
    assert_eq!(corners(&load(&json), 2.0)[0], [4.0, 0.0, 0.0]);
}
