//! Tests that malformed glTF files give one readable line each: what cgltf, draco and fastgltf crashed on in 2026 (their issues
//! and CVE-2026-32845), what the crate gltf 1.4.1 panics on, and paths that lead out of the folder.
use crate::gltf_file::{data, glb, triangle, triangle_bytes};
use serde_json::{Value, json};
use tallow::scene::Scene;

/// Loads a file that must be refused by one line with `word`.
fn refused(bytes: &[u8], name: &str, word: &str) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    let error = Scene::load(&path).map(|_| ()).expect_err(word).to_string();
    assert!(error.contains(word) && !error.contains(char::is_control), "{error}: expected \"{word}\"");
    assert!(error.len() < 400, "{error}");
}

/// The triangle with the value at `pointer` replaced.
fn with(pointer: &str, value: Value) -> Value {
    let mut json = triangle();
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    match json.pointer_mut(parent).unwrap_or_else(|| panic!("{parent}")) {
        Value::Array(list) if key == "-" => list.push(value),
        Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
        object => object[key] = value,
    }
    json
}

fn refused_with(pointer: &str, value: Value, word: &str) {
    refused(with(pointer, value).to_string().as_bytes(), "a.gltf", word);
}

/// Its buffer without content says less than its name.
#[test]
fn an_extension_that_is_needed_is_named_before_the_buffers_that_it_leaves_out() {
    let mut json = with("/extensionsRequired", json!(["EXT_meshopt_compression"]));
    json["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": 4 }));
    refused(json.to_string().as_bytes(), "a.gltf", "needs EXT_meshopt_compression, which cannot be read");
}

#[test]
fn counts_and_offsets_that_leave_their_buffer() {
    let huge = json!(1u64 << 62);
    refused_with("/accessors/0/count", json!(0), "accessor 0: has no elements");
    refused_with("/accessors/0/count", huge.clone(), "accessor 0: ends at byte 55340232221128654848");
    refused_with("/accessors/0/count", json!(4), "ends at byte 48 of its buffer view, which has 36");
    refused_with("/accessors/0/byteOffset", json!(u64::MAX), "accessor 0: ends at byte");
    refused_with("/accessors/0", json!({ "componentType": 5126, "type": "VEC3", "count": huge }), "no buffer view");
    refused_with("/bufferViews/0/byteLength", json!(u64::MAX), "buffer view 0: ends at byte");
    refused_with("/bufferViews/0/byteOffset", json!(u64::MAX), "buffer view 0: ends at byte");
    refused_with("/bufferViews/0/byteStride", json!(u64::MAX), "accessor 0: ends at byte");
    refused_with("/bufferViews/0/byteStride", json!(0), "accessor 0: has elements of 12 bytes in steps of 0");
    refused_with("/buffers/0/byteLength", huge, "has 68 bytes where 4611686018427387904 are announced");
    refused_with("/accessors/1/count", json!(-1), "invalid value");
    refused_with("/accessors/1/count", json!(1.5), "invalid type");
}

#[test]
fn sparse_accessors_that_replace_what_is_not_there() {
    let sparse = |count: u64, indices: Value, values: Value| {
        let sparse = json!({ "count": count, "indices": indices, "values": values });
        let mut json = with("/accessors/0/sparse", sparse);
        // Four indices: 0, 2, 1, 200.
        json["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": 4, "uri": data(&[0, 2, 1, 200]) }));
        json["bufferViews"].as_array_mut().unwrap().push(json!({ "buffer": 1, "byteLength": 4 }));
        json.to_string()
    };
    let indices = |first: u64| json!({ "bufferView": 3, "byteOffset": first, "componentType": 5121 });
    let values = json!({ "bufferView": 0 });
    let refused = |text: String, word: &str| refused(text.as_bytes(), "a.gltf", word);
    refused(sparse(0, indices(0), values.clone()), "replaces 0 of its 3 elements");
    refused(sparse(4, indices(0), values.clone()), "replaces 4 of its 3 elements");
    refused(sparse(1 << 62, indices(0), values.clone()), "replaces 4611686018427387904");
    refused(sparse(2, indices(1), values.clone()), "sparse indices that do not rise");
    refused(sparse(2, indices(2), values.clone()), "or reach 3 elements");
    refused(sparse(2, indices(3), values.clone()), "sparse indices that end at byte 5");
    refused(sparse(2, indices(u64::MAX), values.clone()), "sparse indices that end at byte");
    refused(sparse(2, indices(0), json!({ "bufferView": 1 })), "sparse values that end at byte 24");
    refused(sparse(2, indices(0), json!({ "bufferView": 9 })), "buffer view 9: is not there");
    refused(sparse(2, json!({ "bufferView": 3, "componentType": 5126 }), values), "sparse indices of a type");
}

#[test]
fn indices_that_lead_nowhere() {
    refused_with("/scene", json!(1), "the file: names scene 1");
    refused_with("/scenes/0/nodes", json!([7]), "scene 0: names node 7");
    refused_with("/nodes/0/mesh", json!(1), "node 0: names mesh 1, and there are 1");
    refused_with("/nodes/0/camera", json!(5), "node 0: names camera 5");
    refused_with("/nodes/0/skin", json!(0), "node 0: names skin 0, and there are 0");
    refused_with("/nodes/0/children", json!([4_000_000_000u32]), "node 0: names node 4000000000");
    refused_with("/meshes/0/primitives/0/material", json!(1), "mesh 0: names material 1");
    refused_with("/meshes/0/primitives/0/indices", json!(3), "mesh 0: names accessor 3");
    refused_with("/meshes/0/primitives/0/attributes/POSITION", json!(3), "mesh 0: names accessor 3");
    refused_with("/meshes/0/primitives/0/targets", json!([{ "POSITION": 9 }]), "mesh 0: names accessor 9");
    refused_with("/accessors/0/bufferView", json!(3), "buffer view 3: is not there");
    refused_with("/bufferViews/0/buffer", json!(1), "buffer view 0: names buffer 1 of 1");
    refused_with("/skins", json!([{ "joints": [9] }]), "skin 0: names node 9");
    refused_with("/textures", json!([{ "source": 3 }]), "texture 0: names image 3");
    refused_with("/textures", json!([{ "sampler": 3 }]), "texture 0: names sampler 3");
    refused_with("/materials/0/normalTexture", json!({ "index": 3 }), "material 0: names texture 3");
    let light = json!({ "KHR_lights_punctual": { "light": 0 } });
    refused_with("/nodes/0/extensions", light, "node 0: names light 0, and there are 0");
    let index = data(&[0, 0, 1, 0, 3, 0]);
    let mut json = with("/bufferViews/1", json!({ "buffer": 1, "byteLength": 6 }));
    json["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": 6, "uri": index }));
    refused(json.to_string().as_bytes(), "a.gltf", "mesh 0: has an index of 3, and 3 vertices");
}

#[test]
fn hierarchies_that_are_no_forest() {
    refused_with("/nodes/0/children", json!([0]), "node 0: is among its own ancestors");
    refused_with("/nodes/0/children", json!([1, 1]), "node 1: is a child twice");
    refused_with("/nodes/0/children", json!([1]), "node 1: is a root of a scene and a child");
    let circle = json!([{ "mesh": 0 }, {}, { "children": [3] }, { "children": [4] }, { "children": [2] }]);
    refused_with("/nodes", circle, "node 2: is among its own ancestors");
    refused_with("/nodes/0/scale", json!([1e300, 1, 1]), "node 0: has a transform with numbers that are too large");
    // A chain of any length is walked without calls in calls.
    let last = 200_000;
    let mut chain: Vec<_> = (1..=last).map(|child| json!({ "children": [child] })).collect();
    chain.push(json!({ "mesh": 0 }));
    let mut long = with("/nodes", Value::Array(chain));
    long["scenes"][0]["nodes"] = json!([0]);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.gltf"), long.to_string()).unwrap();
    assert_eq!(Scene::load(&folder.path().join("a.gltf")).unwrap().triangles.len(), 1);
}

#[test]
fn types_that_do_not_belong_together() {
    refused_with("/accessors/0/componentType", json!(9), "accessor 0: has a type that glTF does not know");
    refused_with("/accessors/0/type", json!("VEC9"), "accessor 0: has a type that glTF does not know");
    refused_with("/accessors/0/type", json!("VEC2"), "has elements of 2 numbers where 3 are needed");
    refused_with("/accessors/2/type", json!("SCALAR"), "has elements of 1 numbers where 2 are needed");
    refused_with("/accessors/2/count", json!(2), "has 2 elements for 3 vertices");
    refused_with("/meshes/0/primitives/0/indices", json!(0), "has no unsigned integers");
    refused_with("/materials/0/alphaMode", json!("HAZY"), "material 0: has an alphaMode");
    let ior = json!({ "KHR_materials_ior": { "ior": "glass" } });
    refused_with("/materials/0/extensions", ior, "material 0: has KHR_materials_ior that is damaged");
    refused_with("/meshes/0/primitives", json!(5), "is no glTF: invalid type");
    refused_with("/asset/version", json!("1.0\n"), "is glTF of version 1.0?: export it as glTF 2.0");
    refused_with("/asset/minVersion", json!("2.1"), "is glTF of version 2.1");
    refused_with("/extensionsRequired", json!(["KHR_draco_mesh_compression"]), "needs KHR_draco_mesh_compression");
}

#[test]
fn files_that_are_missing_or_elsewhere() {
    let buffer = |uri: &str, word: &str| refused_with("/buffers/0/uri", json!(uri), word);
    buffer("none.bin", "none.bin: cannot be read");
    buffer("../a.gltf", "buffer 0: leads out of the asset's folder");
    buffer("%2e%2e/%2e%2e/etc/passwd", "buffer 0: leads out");
    buffer("/etc/passwd", "buffer 0: leads out");
    buffer("file:///etc/passwd", "buffer 0: is not below the asset's folder");
    buffer("data:;base64,????", "buffer 0: is not valid base64");
    buffer("data:;base64,AAAA", "has 3 bytes where 68 are announced");
    buffer("a\nb.bin", "buffer 0: names no file");
    buffer(".", "buffer 0: names no file");
    refused_with("/buffers/0", json!({ "byteLength": 4 }), "buffer 0: has no uri and no binary chunk");
    let image = |image: Value, word: &str| {
        let mut json = with("/images", json!([image]));
        json["textures"] = json!([{ "source": 0 }]);
        json["materials"][0]["normalTexture"] = json!({ "index": 0 });
        refused(json.to_string().as_bytes(), "a.gltf", word);
    };
    image(json!({ "uri": "../x.png" }), "image 0: leads out of the asset's folder");
    image(json!({ "bufferView": 9 }), "buffer view 9: is not there");
    image(json!({ "bufferView": 0 }), "a.gltf: image 0: is no usable picture (is no EXR, PNG, JPEG");
    // A header of 57 bytes that claims 65535 x 65535 pixels.
    let mut png = std::io::Cursor::new(Vec::new());
    image::GrayImage::new(1, 1).write_to(&mut png, image::ImageFormat::Png).unwrap();
    let mut png = png.into_inner();
    png[16..24].copy_from_slice(&[0, 0, 255, 255, 0, 0, 255, 255]);
    let crc = crc32(&png[12..29]).to_be_bytes();
    png[29..33].copy_from_slice(&crc);
    image(json!({ "uri": data(&png) }), "claims 4294836225 pixels");
}

/// The checksum of PNG chunks (ISO 3309).
fn crc32(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, &byte| {
        (0..8).fold(crc ^ u32::from(byte), |crc, _| (crc >> 1) ^ (0xedb8_8320 & 0u32.wrapping_sub(crc & 1)))
    })
}

#[test]
fn damaged_files() {
    refused(b"", "a.gltf", "is empty: take another copy of it");
    refused(b"{}", "a.gltf", "missing field `asset`");
    refused(b"[", "a.gltf", "line 1, column 1");
    refused("{\"extras\":[".repeat(100_000).as_bytes(), "a.gltf", "is no glTF");
    refused(&[b'['; 100_000], "a.gltf", "is no glTF");
    refused(b"glTF", "a.glb", "ends within its header");
    let mut json = triangle();
    json["buffers"][0].as_object_mut().unwrap().remove("uri");
    let whole = glb(&json, &triangle_bytes());
    for cut in [4, 11, 12, 15, 19, 20, 100, whole.len() - 1] {
        refused(&whole[..cut], "a.glb", "a.glb");
    }
    let mut lie = whole.clone();
    lie[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    refused(&lie, "a.glb", "a chunk that ends beyond the file");
    let mut short = whole;
    short[8..12].copy_from_slice(&[1, 0, 0, 0]);
    refused(&short, "a.glb", "says that it has 1 bytes");
}

#[test]
fn small_files_that_ask_for_much_memory() {
    // 20000 primitives that each read the same million zeros would take 1.6 TB.
    let zeros = json!({ "componentType": 5126, "type": "VEC3", "count": 1 << 20 });
    let mut json = with("/accessors/-", zeros);
    let primitive = json!({ "attributes": { "POSITION": 3 } });
    json["meshes"][0]["primitives"] = Value::Array(vec![primitive; 20_000]);
    refused(json.to_string().as_bytes(), "a.gltf", "of memory");
}
