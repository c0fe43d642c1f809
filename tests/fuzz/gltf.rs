//! Damaged glTF files: they load or give one line, without a panic, a hang or memory that the file does not account for.
//! TALLOW_FUZZ sets the cases of each of the three targets (default 200; 333334 makes a million in all), PROPTEST_RNG_SEED the numbers.
//! An input takes 0.1 to 0.3 ms: tools/results/gltf.md says how many were run.
use crate::gltf_file::{data, floats, glb, triangle, triangle_bytes};
use proptest::prelude::*;
use serde_json::{Value, json};
use std::sync::LazyLock;
use tallow::scene::Scene;

fn cases() -> ProptestConfig {
    let cases = std::env::var("TALLOW_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(200);
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

/// The pool that consists of the calling thread.
fn alone() -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build().expect("a pool of this thread")
}

/// Loads `bytes`; an error must be one readable line, and a scene must fit together.
fn feed(name: &str, bytes: &[u8]) {
    thread_local!(static DIR: tempfile::TempDir = tempfile::tempdir().expect("a temporary directory"));
    // The thread is a pool of its own; to start and end one for every file takes longer than all else.
    thread_local!(static POOL: rayon::ThreadPool = alone());
    POOL.with(|_| {});
    DIR.with(|dir| {
        let path = dir.path().join(name);
        std::fs::write(&path, bytes).expect("written");
        match Scene::load(&path) {
            Ok(loaded) => {
                loaded.check().expect("arrays that fit together");
                let mut scene = loaded.scene.clone();
                let pose = loaded.animation.at(0.7).expect("a pose, which reads no file");
                match scene.apply(&pose) {
                    Ok(_) => scene.check().expect("arrays that fit together in another pose"),
                    Err(e) => assert!(!e.to_string().contains(char::is_control) && !e.to_string().is_empty(), "{e}"),
                }
            }
            Err(e) => assert!(!e.to_string().contains(char::is_control) && !e.to_string().is_empty(), "{e}"),
        }
    });
}

/// A file with every part that is read: instances, a skin, morph targets, sparse accessors, textures, extensions, lights.
static RICH: LazyLock<Value> = LazyLock::new(|| {
    let mut json = triangle();
    let identity = floats(&glam::Mat4::IDENTITY.to_cols_array());
    let bytes = [
        vec![0u8; 12],                                                         // joints
        floats(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]), // weights
        identity,                                                              // inverse bind matrix
        vec![1, 2, 0, 0],                                                      // sparse indices
        small_png(),
    ]
    .concat();
    let length = bytes.len();
    push(&mut json, "buffers", json!({ "byteLength": length, "uri": data(&bytes) }));
    for (first, end) in [(0, 12), (12, 60), (60, 124), (124, 126), (128, length)] {
        push(&mut json, "bufferViews", json!({ "buffer": 1, "byteOffset": first, "byteLength": end - first }));
    }
    push(&mut json, "accessors", json!({ "bufferView": 3, "componentType": 5121, "count": 3, "type": "VEC4" }));
    push(&mut json, "accessors", json!({ "bufferView": 4, "componentType": 5126, "count": 3, "type": "VEC4" }));
    push(&mut json, "accessors", json!({ "bufferView": 5, "componentType": 5126, "count": 1, "type": "MAT4" }));
    push(
        &mut json,
        "accessors",
        json!({ "componentType": 5126, "count": 3, "type": "VEC3", "sparse": {
        "count": 2, "indices": { "bufferView": 6, "componentType": 5121 }, "values": { "bufferView": 0 } } }),
    );
    let attributes = json!({ "POSITION": 0, "NORMAL": 6, "TANGENT": 4, "COLOR_0": 4, "JOINTS_0": 3, "WEIGHTS_0": 4,
        "TEXCOORD_0": 2, "TEXCOORD_1": 2 });
    push(
        &mut json,
        "meshes",
        json!({ "primitives": [
        { "attributes": attributes, "mode": 5, "material": 1, "targets": [{ "POSITION": 6, "NORMAL": 0 }] },
        { "attributes": { "POSITION": 6 }, "mode": 6 }, { "attributes": { "POSITION": 0 }, "mode": 1 },
        { "attributes": { "POSITION": 0, "NORMAL": 6, "TEXCOORD_0": 2 }, "material": 1, "targets": [{ "NORMAL": 0 }] }
    ], "weights": [0.5] }),
    );
    json["images"] = json!([{ "bufferView": 7, "mimeType": "image/png" }, { "uri": "none.png" }]);
    json["samplers"] = json!([{ "wrapS": 33071, "wrapT": 33648, "magFilter": 9728 }]);
    json["textures"] = json!([{ "source": 0, "sampler": 0 }, { "source": 1 }]);
    let texture = json!({ "index": 0, "texCoord": 1, "extensions": {
        "KHR_texture_transform": { "offset": [0.5, 0.5], "rotation": 1.0, "scale": [2, 2], "texCoord": 0 } } });
    push(
        &mut json,
        "materials",
        json!({ "pbrMetallicRoughness": { "baseColorTexture": texture,
            "metallicRoughnessTexture": { "index": 1 }, "metallicFactor": 0.5, "roughnessFactor": 0.5 },
        "normalTexture": { "index": 0, "scale": 0.5 }, "emissiveTexture": texture, "emissiveFactor": [1, 1, 1],
        "alphaMode": "MASK", "alphaCutoff": 0.3, "doubleSided": true, "extensions": {
            "KHR_materials_ior": { "ior": 1.4 }, "KHR_materials_emissive_strength": { "emissiveStrength": 3 },
            "KHR_materials_clearcoat": { "clearcoatFactor": 1, "clearcoatTexture": texture,
                "clearcoatNormalTexture": { "index": 0, "scale": 0.5 } },
            "KHR_materials_transmission": { "transmissionFactor": 0.5 }, "KHR_materials_unlit": {},
            "KHR_materials_specular": { "specularFactor": 0.5, "specularColorTexture": texture } } }),
    );
    json["cameras"].as_array_mut().expect("a list").insert(
        0,
        json!({ "type": "orthographic",
        "orthographic": { "xmag": 2, "ymag": 3, "zfar": 9, "znear": 0 } }),
    );
    json["skins"] = json!([{ "joints": [0], "inverseBindMatrices": 5 }]);
    json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "spot", "intensity": 3,
        "spot": { "innerConeAngle": 0.1, "outerConeAngle": 0.5 } }] } });
    json["extensionsUsed"] = json!(["KHR_lights_punctual", "VENDOR_thing"]);
    let rich = [
        json!({ "mesh": 1, "skin": 0, "children": [3] }),
        json!({ "mesh": 1, "rotation": [0, 0, 0, 1], "scale": [-1, 2, 1], "children": [4] }),
        json!({ "mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 3, 1],
            "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 6, "ROTATION": 4 } },
                "KHR_lights_punctual": { "light": 0 } } }),
    ];
    rich.into_iter().for_each(|node| push(&mut json, "nodes", node));
    json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    // Keys at 0, 1 and 2 seconds; the triangle's corners are translations, and the skin's weights rotations.
    let times = floats(&[0.0, 1.0, 2.0]);
    push(&mut json, "buffers", json!({ "byteLength": 12, "uri": data(&times) }));
    push(&mut json, "bufferViews", json!({ "buffer": 2, "byteLength": 12 }));
    push(&mut json, "accessors", json!({ "bufferView": 8, "componentType": 5126, "count": 3, "type": "SCALAR" }));
    let channel =
        |sampler: u32, node: u32, path: &str| json!({ "sampler": sampler, "target": { "node": node, "path": path } });
    json["animations"] = json!([{
        "samplers": [{ "input": 7, "output": 0 }, { "input": 7, "output": 4, "interpolation": "STEP" }, { "input": 7, "output": 7 }],
        "channels": [channel(0, 0, "translation"), channel(1, 3, "rotation"), channel(2, 3, "weights")]
    }]);
    json
});

/// The rich file in binary form; the triangle is its first buffer.
static BINARY: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let mut json = RICH.clone();
    json["buffers"][0].as_object_mut().expect("an object").remove("uri");
    glb(&json, &triangle_bytes())
});

fn push(json: &mut Value, list: &str, value: Value) {
    json[list].as_array_mut().expect("a list").push(value);
}

fn small_png() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    image::RgbaImage::new(3, 2).write_to(&mut bytes, image::ImageFormat::Png).expect("encoded");
    bytes.into_inner()
}

/// The places of all values in a file.
fn pointers(value: &Value, at: String, found: &mut Vec<String>) {
    found.push(at.clone());
    match value {
        Value::Object(map) => map.iter().for_each(|(key, value)| pointers(value, format!("{at}/{key}"), found)),
        Value::Array(list) => list.iter().enumerate().for_each(|(i, v)| pointers(v, format!("{at}/{i}"), found)),
        _ => {}
    }
}

static POINTERS: LazyLock<Vec<String>> = LazyLock::new(|| {
    let mut found = Vec::new();
    pointers(&RICH, String::new(), &mut found);
    found.retain(|at| !at.is_empty());
    found
});

/// Values that are nearly right, far off, or of another type.
fn value() -> impl Strategy<Value = Value> {
    let special = [
        json!(null),
        json!(true),
        json!([]),
        json!({}),
        json!(""),
        json!("../x"),
        json!("\n"),
        json!("none.bin"),
        json!(u64::MAX),
        json!(1u64 << 62),
        json!(1u64 << 32),
        json!(u32::MAX),
        json!(-1),
        json!(1e300),
        json!(1e38),
        json!(5121),
        json!(5123),
        json!(5125),
        json!(5126),
        json!("VEC3"),
        json!("VEC4"),
        json!("SCALAR"),
        json!("MAT4"),
        json!([0, 0]),
        json!([[0]]),
        json!([1e39, 0, 0]),
        json!(f32::MIN_POSITIVE),
        json!("BLEND"),
        json!("data:,"),
    ];
    prop_oneof![
        6 => (0u64..12).prop_map(|n| json!(n)),
        4 => prop::sample::select(special.to_vec()),
        1 => any::<u64>().prop_map(|n| json!(n)),
        1 => any::<f64>().prop_map(|n| json!(n)),
        1 => "[ -~]{0,8}".prop_map(|text| json!(text)),
    ]
}

/// Replaces, removes or doubles values.
fn mutated(edits: Vec<(usize, u8, Value)>) -> Value {
    let mut json = RICH.clone();
    for (at, what, value) in edits {
        let pointer = &POINTERS[at % POINTERS.len()];
        let (parent, key) = pointer.rsplit_once('/').expect("a pointer");
        match (what, json.pointer_mut(parent)) {
            (0, Some(Value::Object(map))) => _ = map.remove(key),
            (1, Some(Value::Array(list))) => list.push(value),
            (2, Some(Value::Array(list))) if !list.is_empty() => list.push(list[at % list.len()].clone()),
            _ => _ = json.pointer_mut(pointer).map(|place| *place = value),
        }
    }
    json
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    fn values(edits in prop::collection::vec((any::<usize>(), 0u8..6, value()), 1..4)) {
        feed("a.gltf", mutated(edits).to_string().as_bytes());
    }

    #[test]
    fn letters(edits in prop::collection::vec((any::<usize>(), any::<u8>()), 0..6), keep in any::<usize>()) {
        let mut text = RICH.to_string().into_bytes();
        let length = text.len();
        edits.iter().for_each(|&(at, byte)| text[at % length] = byte);
        text.truncate(length - (keep % 8) * (keep % length) / 8);
        feed("a.gltf", &text);
    }

    #[test]
    fn binary(edits in prop::collection::vec((any::<usize>(), any::<u8>()), 0..6), keep in any::<usize>()) {
        let mut bytes = BINARY.clone();
        let length = bytes.len();
        edits.iter().for_each(|&(at, byte)| bytes[if byte % 4 == 0 { at % 40 } else { at % length }] = byte);
        bytes.truncate(length - (keep % 8) * (keep % length) / 8);
        feed("a.glb", &bytes);
    }
}

#[test]
fn the_undamaged_files_load_with_all_their_parts() {
    let folder = tempfile::tempdir().expect("a temporary directory");
    for (name, bytes) in [("a.gltf", RICH.to_string().into_bytes()), ("a.glb", BINARY.clone())] {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).expect("written");
        let scene = Scene::load(&path).unwrap_or_else(|e| panic!("{e}"));
        assert!(
            scene.instances.len() >= 3 && scene.textures.len() >= 3,
            "{} {}",
            scene.instances.len(),
            scene.textures.len()
        );
        assert!(scene.lights.iter().any(|light| light.kind == tallow::layout::LIGHT_SPOT));
        assert_eq!(scene.animation.end(), 2.0);
        let missing = scene.warnings.iter().filter(|line| line.contains("none.png")).count();
        assert!(missing > 0, "{:?}", scene.warnings);
    }
}
