//! A small glTF file that tests change: one triangle, seen by a camera.
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

/// Bytes of numbers in order.
pub fn floats(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|v| v.to_le_bytes()).collect()
}

/// Bytes as a URI.
pub fn data(bytes: &[u8]) -> String {
    format!("data:application/octet-stream;base64,{}", STANDARD.encode(bytes))
}

/// The corners of a triangle in the plane z = 0, their indices (three 16-bit integers and two bytes of padding), and their
/// texture coordinates.
pub fn triangle_bytes() -> Vec<u8> {
    let positions = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let indices = [0u16, 1, 2, 0].iter().flat_map(|v| v.to_le_bytes()).collect();
    [positions, indices, floats(&[0.0, 1.0, 1.0, 1.0, 0.0, 0.0])].concat()
}

/// A triangle with a material, a node that shows it, and a camera, without normals.
pub fn triangle() -> Value {
    json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [
            { "mesh": 0 },
            { "name": "eye", "camera": 0, "translation": [0.25, 0.25, 3.0] }
        ],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }],
        "materials": [{ "name": "red", "pbrMetallicRoughness": {
            "baseColorFactor": [1.0, 0.0, 0.0, 1.0], "metallicFactor": 0.0 } }],
        "meshes": [{ "name": "leaf", "primitives": [{
            "attributes": { "POSITION": 0, "TEXCOORD_0": 2 }, "indices": 1, "material": 0
        }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR" },
            { "bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC2" }
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 36 },
            { "buffer": 0, "byteOffset": 36, "byteLength": 6 },
            { "buffer": 0, "byteOffset": 44, "byteLength": 24 }
        ],
        "buffers": [{ "byteLength": 68, "uri": data(&triangle_bytes()) }]
    })
}

/// The binary form of a file whose first buffer is `binary`.
pub fn glb(json: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = 12 + 8 + text.len() + 8 + binary.len();
    let word = |n: usize| (n as u32).to_le_bytes();
    let parts: [&[u8]; 9] =
        [b"glTF", &word(2), &word(length), &word(text.len()), b"JSON", &text, &word(binary.len()), b"BIN\0", binary];
    parts.concat()
}
