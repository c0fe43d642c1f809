//! Tests that joints and morph targets of glTF files turn normals and tangents.
use crate::gltf_materials::with_pictures;
use crate::gltf_motion::{add, load};
use glam::{Vec3, vec3};
use serde_json::{Value, json};
use std::f32::consts::FRAC_1_SQRT_2;
use tallow::layout::{ATTRIBUTE_FLIPPED, ATTRIBUTE_TANGENTS};
use tallow::math::octahedral::octahedral_decode;

/// The triangle with these normals and tangents at its corners; `sign` is that of the bitangents.
fn with_frames(normals: [Vec3; 3], tangents: [Vec3; 3], sign: f32) -> Value {
    let mut json = with_pictures();
    json["materials"][0]["normalTexture"] = json!({ "index": 0 }); // which reads tangents
    let normal = add(&mut json, &normals.map(|n| n.to_array()).concat(), "VEC3");
    let tangent = add(&mut json, &tangents.map(|t| t.extend(sign).to_array()).concat(), "VEC4");
    json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normal);
    json["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = json!(tangent);
    json
}

/// Checks normals and tangents, of any length, and the sign of the bitangents.
fn check(json: &Value, normals: [Vec3; 3], tangents: [Vec3; 3], sign: f32) {
    let scene = load(json);
    let s = &scene.shading[0];
    let flipped = if sign < 0.0 { ATTRIBUTE_FLIPPED } else { 0 };
    assert_eq!(s.attributes, ATTRIBUTE_TANGENTS | flipped);
    let words = &scene.texels[s.first as usize..][..3];
    let found = s.normal.iter().chain(words).map(|&word| octahedral_decode(word));
    let expected = normals.into_iter().chain(tangents).map(Vec3::normalize);
    let pairs: Vec<_> = found.zip(expected).collect();
    let wrong = |(found, expected): &&(Vec3, Vec3)| found.distance(*expected) > 1e-3;
    let wrong: Vec<_> = pairs.iter().filter(wrong).collect();
    assert!(wrong.is_empty(), "found and expected, of {pairs:?}: {wrong:?}");
}

#[test]
fn joints_turn_normals_and_tangents() {
    let normals = [vec3(0.6, 0.0, 0.8), vec3(0.0, 0.6, 0.8), Vec3::Z];
    let tangents = [vec3(0.8, 0.0, -0.6), Vec3::X, Vec3::Y];
    let mut json = with_frames(normals, tangents, 1.0);
    let joints = add(&mut json, &[0.0; 12], "VEC4");
    json["accessors"][joints]["componentType"] = json!(5123);
    let weights = add(&mut json, &[1.0, 0.0, 0.0, 0.0].repeat(3), "VEC4");
    json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = json!(joints);
    json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(weights);
    json["skins"] = json!([{ "joints": [2] }]);
    json["nodes"][0]["skin"] = json!(0);
    // Twice as long along x, then a quarter turn about z: (x, y, z) goes to (-y, 2 x, z), a normal to (-y, x / 2, z).
    let turn = [0.0, 0.0, FRAC_1_SQRT_2, FRAC_1_SQRT_2];
    json["nodes"].as_array_mut().unwrap().push(json!({ "scale": [2, 1, 1], "rotation": turn }));
    json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    let turned_normals = [vec3(0.0, 0.3, 0.8), vec3(-0.6, 0.0, 0.8), Vec3::Z];
    check(&json, turned_normals, [vec3(0.0, 1.6, -0.6), Vec3::Y, Vec3::NEG_X], 1.0);
    // Joints alone say where it is.
    json["nodes"][0]["scale"] = json!([0, 0, 0]);
    let scene = load(&json);
    assert!(
        !scene.triangles.is_empty() && !scene.warnings.iter().any(|w| w.contains("scale is 0")),
        "{:?}",
        scene.warnings
    );
}

#[test]
fn morph_targets_turn_normals_and_tangents() {
    let mut json = with_frames([Vec3::Z; 3], [Vec3::X; 3], -1.0);
    let normals = add(&mut json, &[1.5, 0.0, 0.0, 0.0, 1.5, 0.0, 0.0, 0.0, 0.0], "VEC3");
    let tangents = add(&mut json, &[0.0, 0.0, -1.5, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0], "VEC3");
    json["meshes"][0]["primitives"][0]["targets"] = json!([{ "NORMAL": normals, "TANGENT": tangents }]);
    json["meshes"][0]["weights"] = json!([0.5]);
    let turned_normals = [vec3(0.75, 0.0, 1.0), vec3(0.0, 0.75, 1.0), Vec3::Z];
    check(&json, turned_normals, [vec3(1.0, 0.0, -0.75), Vec3::X, vec3(1.0, 1.0, 0.0)], -1.0);
    json["meshes"][0]["weights"] = json!([0.0]);
    check(&json, [Vec3::Z; 3], [Vec3::X; 3], -1.0);
}
