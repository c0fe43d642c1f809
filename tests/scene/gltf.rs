//! Tests glTF files as scenes: hierarchy, instances, primitives of every mode, accessors of every kind, cameras and lights.
use crate::gltf_file::{data, floats, glb, triangle, triangle_bytes};
use serde_json::{Value, json};
use std::path::PathBuf;
use tallow::layout::{
    ATTRIBUTE_TANGENTS, LIGHT_DIRECTIONAL, LIGHT_ENVIRONMENT, LIGHT_POINT, LIGHT_SPOT, MATERIAL_EMITS_BEHIND,
};
use tallow::scene::{Loaded, Scene, SceneFile};

fn save(bytes: &[u8], name: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    (folder, path)
}

fn load(json: &Value) -> Loaded {
    let (_folder, path) = save(json.to_string().as_bytes(), "a.gltf");
    Scene::load(&path).unwrap_or_else(|e| panic!("{e}"))
}

/// Corners of all triangles in world space, sorted.
fn corners(scene: &Scene) -> Vec<[[i32; 3]; 3]> {
    let whole = |p: [f32; 3]| p.map(|v| (v * 1000.0).round() as i32);
    let mut found: Vec<_> = scene.triangles.iter().map(|t| [t.v0, t.v1, t.v2].map(whole)).collect();
    found.sort_unstable();
    found
}

/// What loading said, without what the renderer makes of materials.
fn said(scene: &Scene) -> Vec<&str> {
    scene.warnings.iter().map(String::as_str).filter(|line| !line.contains("in material")).collect()
}

#[test]
fn one_file_is_a_scene_with_camera_sky_and_material() {
    let scene = load(&triangle());
    assert_eq!(corners(&scene), [[[0, 0, 0], [1000, 0, 0], [0, 1000, 0]]]);
    assert!(said(&scene).is_empty(), "{:?}", said(&scene));
    assert_eq!(scene.names.materials[0], "red");
    assert_eq!(scene.materials[0].base_color, [1.0, 0.0, 0.0]);
    assert_eq!(scene.lights.iter().map(|l| l.kind).collect::<Vec<_>>(), [LIGHT_ENVIRONMENT]);
    let camera = scene.camera([64, 64]).unwrap();
    assert_eq!((camera.position, camera.forward), ([0.25, 0.25, 3.0], [0.0, 0.0, -1.0]));
    assert!((camera.up[1] - 0.35f32.tan()).abs() < 1e-6, "half of yfov");
}

#[test]
fn pictures_may_lie_within_the_file() {
    let mut png = std::io::Cursor::new(Vec::new());
    let texel = |x, y| image::Rgb([x as u8 * 50, y as u8 * 50, 7]);
    image::RgbImage::from_fn(3, 2, texel).write_to(&mut png, image::ImageFormat::Png).unwrap();
    let mut json = triangle();
    json["images"] = json!([{ "uri": data(&png.into_inner()) }]);
    json["textures"] = json!([{ "source": 0 }]);
    json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
    let scene = load(&json);
    assert_eq!((scene.textures.len(), scene.textures[0].width, scene.textures[0].height), (1, 3, 2));
    assert_eq!(scene.texels[..6].iter().map(|t| t.to_le_bytes()[0]).collect::<Vec<_>>(), [0, 50, 100, 0, 50, 100]);
    // Row 0 of a picture is v = 0 in glTF, and v = 1 here.
    assert_eq!([scene.shading[0].uv0, scene.shading[0].uv2], [[0.0, 0.0], [0.0, 1.0]]);
}

/// The roughness of a coat keeps its 16 bits, and formats that are not read leave what the material says without a picture.
#[test]
fn pictures_within_the_file_are_read_as_files_are() {
    let (mut png, folder) = (std::io::Cursor::new(Vec::new()), tempfile::tempdir().unwrap());
    let texel = |x: u32, y: u32| image::Rgb([7, 0x8000 + x as u16 + 3 * y as u16, 0xffff]);
    image::ImageBuffer::from_fn(3, 2, texel).write_to(&mut png, image::ImageFormat::Png).unwrap();
    let png = png.into_inner();
    let with = |image: Value| {
        let mut json = triangle();
        json["images"] = json!([image]);
        json["textures"] = json!([{ "source": 0 }]);
        let coat =
            json!({ "clearcoatFactor": 1, "clearcoatRoughnessFactor": 1, "clearcoatRoughnessTexture": { "index": 0 } });
        json["materials"][0]["extensions"] = json!({ "KHR_materials_clearcoat": coat });
        json["extensionsUsed"] = json!(["KHR_materials_clearcoat"]);
        std::fs::write(folder.path().join("a.gltf"), json.to_string()).unwrap();
        Scene::load(&folder.path().join("a.gltf")).unwrap()
    };
    std::fs::write(folder.path().join("n.png"), &png).unwrap();
    let [within, file] = [json!({ "uri": data(&png) }), json!({ "uri": "n.png" })].map(with);
    assert_eq!((&within.textures, &within.texels), (&file.textures, &file.texels));
    let different = |texels: &[u32]| texels.iter().collect::<std::collections::HashSet<_>>().len();
    let own: u32 = within.textures.iter().map(|t| t.width * t.height).sum(); // tables lie behind them
    let texels = &within.texels[..own as usize];
    assert!(different(texels) >= 6, "control: they differ by the last of 16 bits: {texels:x?}");
    let other = with(json!({ "uri": data(b"RIFF\x10\0\0\0WEBPVP8 ") }));
    assert_eq!(other.textures, []);
    assert!(said(&other)[0].contains("a.gltf: image 0: is no EXR, PNG"), "{:?}", other.warnings);
}

#[test]
fn the_binary_form_is_the_same_scene() {
    let mut json = triangle();
    json["buffers"][0].as_object_mut().unwrap().remove("uri");
    let (_folder, path) = save(&glb(&json, &triangle_bytes()), "a.glb");
    let scene = Scene::load(&path).unwrap();
    assert_eq!(corners(&scene), corners(&load(&triangle())));
    assert_eq!(scene.fingerprint([8, 8]).unwrap(), load(&triangle()).fingerprint([8, 8]).unwrap());
}

#[test]
fn nodes_are_placed_below_their_parents() {
    let mut json = triangle();
    json["nodes"] = json!([
        { "translation": [10.0, 0.0, 0.0], "children": [1] },
        { "rotation": [0.0, 0.0, 1.0, 1.0], "scale": [2.0, 2.0, 2.0], "children": [2] },
        { "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 3, 1], "mesh": 0 }
    ]);
    json["scenes"][0]["nodes"] = json!([0]);
    // Turned by a right angle about z; the rotation is not of length 1.
    assert_eq!(corners(&load(&json)), [[[10000, 0, 6000], [10000, 2000, 6000], [8000, 0, 6000]]]);
}

#[test]
fn a_mesh_of_several_nodes_is_stored_once_and_mirrors_keep_their_outside() {
    let mut json = triangle();
    json["nodes"] = json!([
        { "mesh": 0 }, { "mesh": 0, "translation": [0, 0, 1] }, { "mesh": 0, "scale": [-1, 1, 1] },
        { "mesh": 0, "scale": [1, 0, 1] }
    ]);
    json["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    let scene = load(&json);
    assert_eq!((scene.triangles.len(), scene.instances.len()), (1, 3));
    assert_eq!(scene.instances.iter().filter(|i| i.mirrored == 1).count(), 1);
    assert_eq!(said(&scene), ["1 meshes whose scale is 0 are not rendered"]);
}

#[test]
fn instancing_multiplies_a_node() {
    let mut json = triangle();
    let places = floats(&[0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 0.0, 5.0, 0.0]);
    json["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": 36, "uri": data(&places) }));
    json["bufferViews"].as_array_mut().unwrap().push(json!({ "buffer": 1, "byteLength": 36 }));
    json["accessors"]
        .as_array_mut()
        .unwrap()
        .push(json!({ "bufferView": 3, "componentType": 5126, "count": 3, "type": "VEC3" }));
    json["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
    json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 3 } } });
    let scene = load(&json);
    assert_eq!((scene.triangles.len(), scene.instances.len()), (1, 3));
    assert_eq!(scene.bounds, [[0.0; 3], [6.0, 6.0, 0.0]]);
}

#[test]
fn every_mode_with_a_surface_makes_triangles_that_face_the_same_way() {
    let quad = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0]);
    let fan = floats(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    for (mode, bytes, count) in [(4, &quad, 1), (5, &quad, 2), (6, &fan, 2)] {
        let mut json = triangle();
        json["buffers"][0] = json!({ "byteLength": 48, "uri": data(bytes) });
        json["bufferViews"] = json!([{ "buffer": 0, "byteLength": 48 }]);
        json["accessors"] = json!([{ "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3" }]);
        json["meshes"][0]["primitives"] = json!([{ "attributes": { "POSITION": 0 }, "mode": mode }]);
        let scene = load(&json);
        assert_eq!(scene.triangles.len(), count, "mode {mode}");
        for t in &scene.triangles {
            let [a, b, c] = [t.v0, t.v1, t.v2].map(glam::Vec3::from);
            assert!((b - a).cross(c - a).z > 0.0, "mode {mode} turns a triangle around");
        }
        assert_eq!(scene.names.materials[0], "default");
    }
    let mut json = triangle();
    for mode in 0..4 {
        let line = json!({ "attributes": { "POSITION": 0 }, "mode": mode });
        json["meshes"][0]["primitives"].as_array_mut().unwrap().push(line);
    }
    let scene = load(&json);
    assert_eq!(scene.triangles.len(), 1);
    assert_eq!(said(&scene), ["4 primitives of points or lines have no surface and are not rendered"]);
}

#[test]
fn accessors_may_be_interleaved_normalized_or_sparse() {
    let expected = corners(&load(&triangle()));
    let mut interleaved = triangle();
    let bytes: Vec<u8> = triangle_bytes()[..36].chunks(12).flat_map(|p| [p, &[7; 4]].concat()).collect();
    interleaved["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": 48, "uri": data(&bytes) }));
    interleaved["bufferViews"][0] = json!({ "buffer": 1, "byteLength": 48, "byteStride": 16 });
    assert_eq!(corners(&load(&interleaved)), expected);

    let mut small = triangle();
    small["buffers"]
        .as_array_mut()
        .unwrap()
        .push(json!({ "byteLength": 12, "uri": data(&[0, 0, 0, 9, 127, 0, 0, 9, 0, 127, 128, 9]) }));
    small["bufferViews"][0] = json!({ "buffer": 1, "byteLength": 12, "byteStride": 4 });
    small["accessors"][0] =
        json!({ "bufferView": 0, "componentType": 5120, "normalized": true, "count": 3, "type": "VEC3" });
    small["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
    assert_eq!(corners(&load(&small)), [[[0, 0, 0], [1000, 0, 0], [0, 1000, -1000]]], "-128 counts as -127");

    // Without a buffer view all elements are zero; the sparse list then replaces the last two.
    let mut sparse = triangle();
    let bytes = [vec![1, 2, 0, 0], triangle_bytes()[12..36].to_vec()].concat();
    sparse["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": 28, "uri": data(&bytes) }));
    sparse["bufferViews"]
        .as_array_mut()
        .unwrap()
        .extend([json!({ "buffer": 1, "byteLength": 2 }), json!({ "buffer": 1, "byteOffset": 4, "byteLength": 24 })]);
    sparse["accessors"][0] = json!({ "componentType": 5126, "count": 3, "type": "VEC3", "sparse": { "count": 2,
        "indices": { "bufferView": 3, "componentType": 5121 }, "values": { "bufferView": 4 } } });
    assert_eq!(corners(&load(&sparse)), expected);
}

/// A thousand primitives with three each of a million vertices, which would take 100 GB where each has them all.
#[test]
fn of_vertices_that_primitives_share_each_has_its_own() {
    let mut json = triangle();
    let places = [1000u32, 1 << 19].iter().chain(&[1 << 19, 5, 1000]).flat_map(|i| i.to_le_bytes());
    let bytes = [places.collect(), triangle_bytes()[12..36].to_vec()].concat();
    json["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": 44, "uri": data(&bytes) }));
    for (first, length) in [(0, 8), (8, 12), (20, 24)] {
        let view = json!({ "buffer": 1, "byteOffset": first, "byteLength": length });
        json["bufferViews"].as_array_mut().unwrap().push(view);
    }
    json["accessors"].as_array_mut().unwrap().extend([
        json!({ "componentType": 5126, "count": 1 << 20, "type": "VEC3", "sparse": { "count": 2,
            "indices": { "bufferView": 3, "componentType": 5125 }, "values": { "bufferView": 5 } } }),
        json!({ "bufferView": 4, "componentType": 5125, "count": 3, "type": "SCALAR" }),
    ]);
    let primitive = json!({ "attributes": { "POSITION": 3 }, "indices": 4, "targets": [{ "POSITION": 3 }] });
    json["meshes"][0]["primitives"] = Value::Array(vec![primitive; 1000]);
    json["meshes"][0]["weights"] = json!([1.0]);
    let found = corners(&load(&json));
    assert_eq!((found.len(), found[0]), (1000, [[0, 2000, 0], [0, 0, 0], [2000, 0, 0]]));
}

#[test]
fn lights_shine_along_minus_z_in_the_files_own_units() {
    let mut json = triangle();
    json["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "point", "color": [1.0, 0.5, 0.25], "intensity": 8.0, "range": 3.0 },
        { "type": "directional", "intensity": 3.0 },
        { "type": "spot", "intensity": 2.0, "spot": { "innerConeAngle": 0.1, "outerConeAngle": 0.5 } }
    ] } });
    let light = |index| {
        json!({ "rotation": [0, 1, 0, 1], "translation": [1, 2, 3],
        "extensions": { "KHR_lights_punctual": { "light": index } } })
    };
    json["nodes"].as_array_mut().unwrap().extend([light(0), light(1), light(2)]);
    json["scenes"][0]["nodes"] = json!([0, 1, 2, 3, 4]);
    let scene = load(&json);
    let of = |kind| scene.lights.iter().find(|l| l.kind == kind).unwrap();
    assert_eq!(scene.lights.len(), 3, "a file with lights has no sky");
    assert_eq!((of(LIGHT_POINT).value, of(LIGHT_POINT).a), ([8.0, 4.0, 2.0], [1.0, 2.0, 3.0]));
    let near = |a: [f32; 3], b: [f32; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-6);
    assert!(near(of(LIGHT_DIRECTIONAL).b, [-1.0, 0.0, 0.0]) && of(LIGHT_DIRECTIONAL).value == [3.0; 3]);
    let spot = of(LIGHT_SPOT);
    assert!(near(spot.b, [-1.0, 0.0, 0.0]) && near(spot.c, [0.1, 0.5, 0.0]), "{spot:?}");
}

#[test]
fn cameras_are_chosen_by_name() {
    let mut json = triangle();
    json["cameras"].as_array_mut().unwrap().push(json!({ "name": "flat", "type": "orthographic",
        "orthographic": { "xmag": 1, "ymag": 2, "znear": 0, "zfar": 9 } }));
    json["nodes"]
        .as_array_mut()
        .unwrap()
        .extend([json!({ "camera": 1 }), json!({ "camera": 0, "translation": [9, 0, 0] })]);
    json["scenes"][0]["nodes"] = json!([0, 1, 2, 3]);
    let (_folder, path) = save(json.to_string().as_bytes(), "a.gltf");
    let mut file = SceneFile::open(&path).unwrap();
    let refused = |file: &mut SceneFile, name: &str, word: &str| {
        let error = file.look_through(name).unwrap_err();
        assert!(error.exit_code() == 2 && error.to_string().contains(word), "{error}");
    };
    refused(&mut file, "ear", "choose one of \"eye\", \"flat\", \"camera 0\"");
    file.look_through("flat").unwrap();
    let flat = file.load().unwrap().camera([8, 4]).unwrap();
    assert_eq!((flat.orthographic, flat.right, flat.up), (1, [4.0, 0.0, 0.0], [0.0, 2.0, 0.0]));
    file.look_through("camera 0").unwrap();
    assert_eq!(file.load().unwrap().camera([8, 8]).unwrap().position, [9.0, 0.0, 0.0]);
}

#[test]
fn what_shines_from_behind_is_double_sided_or_unlit() {
    let behind = |material: serde_json::Value| {
        let mut json = triangle();
        json["materials"][0] = material;
        load(&json).materials[0].flags & MATERIAL_EMITS_BEHIND != 0
    };
    assert!(behind(json!({ "emissiveFactor": [1, 1, 1], "doubleSided": true })));
    assert!(behind(json!({ "extensions": { "KHR_materials_unlit": {} } })));
    assert!(!behind(json!({ "emissiveFactor": [1, 1, 1] })) && !behind(json!({ "doubleSided": true })));
}

#[test]
fn numbers_beyond_what_gltf_allows_are_clamped_and_named_once() {
    let mut json = triangle();
    json["materials"][0] = json!({
        "emissiveFactor": [3.0, -1.0, 0.0],
        "pbrMetallicRoughness": { "baseColorFactor": [2.0, -1.0, 0.5, 3.0], "metallicFactor": 1.5, "roughnessFactor": -2 },
        "extensions": {
            "KHR_materials_ior": { "ior": 0.5 },
            "KHR_materials_specular": { "specularFactor": 2.0, "specularColorFactor": [-1.0, 1.0, 1e9] },
            "KHR_materials_transmission": { "transmissionFactor": 7 },
            "KHR_materials_clearcoat": { "clearcoatFactor": 2, "clearcoatRoughnessFactor": 9 },
            "KHR_materials_emissive_strength": { "emissiveStrength": 1e30 }
        }
    });
    json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "spot", "intensity": -5.0, "spot": { "innerConeAngle": 2.0, "outerConeAngle": -1.0 } }, { "type": "point" }
    ] } });
    json["nodes"][0]["extensions"] = json!({ "KHR_lights_punctual": { "light": 0 } });
    let scene = load(&json);
    let m = &scene.materials[0];
    assert_eq!((m.base_color, m.metallic, m.alpha), ([1.0, 0.0, 0.5], 1.0, 0.0));
    assert_eq!((m.specular_factor, m.transmission_factor, m.clearcoat, m.clearcoat_alpha), (1.0, 1.0, 1.0, 1.0));
    assert_eq!(m.emission, [1e17, 0.0, 0.0]);
    let clamped: Vec<_> = said(&scene).into_iter().filter(|line| line.contains("clamped")).collect();
    assert_eq!(clamped.len(), 2, "{clamped:?}");
    assert_eq!(clamped[0], "numbers beyond what glTF allows are clamped: 1 lights");
    assert!(clamped[1].ends_with("baseColorFactor of material 0 and 10 more"), "{clamped:?}");
}

#[test]
fn surfaces_with_normal_maps_get_tangents() {
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(1, 1).write_to(&mut png, image::ImageFormat::Png).unwrap();
    let mut json = triangle();
    json["images"] = json!([{ "uri": data(&png.into_inner()) }]);
    json["textures"] = json!([{ "source": 0 }]);
    let normals = floats(&[0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0]);
    json["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": 36, "uri": data(&normals) }));
    json["bufferViews"].as_array_mut().unwrap().push(json!({ "buffer": 1, "byteLength": 36 }));
    let accessor = json!({ "bufferView": 3, "componentType": 5126, "count": 3, "type": "VEC3" });
    json["accessors"].as_array_mut().unwrap().push(accessor);
    let tangents = |json: &Value| load(json).shading.iter().filter(|s| s.attributes & ATTRIBUTE_TANGENTS != 0).count();
    json["materials"][0]["normalTexture"] = json!({ "index": 0 });
    assert_eq!(tangents(&json), 0, "without normals it is flat");
    json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(3);
    assert_eq!(tangents(&json), 1);
    json["materials"][0]["normalTexture"] = json!({ "index": 0, "texCoord": 1 });
    assert_eq!(tangents(&json), 0, "there are no such coordinates");
    json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_1"] = json!(2);
    assert_eq!(tangents(&json), 1);
    json["materials"][0].as_object_mut().unwrap().remove("normalTexture");
    assert_eq!(tangents(&json), 0, "control: nothing reads them");
}

#[test]
fn what_is_not_rendered_is_named() {
    let mut json = triangle();
    json["extensionsUsed"] = json!(["KHR_materials_sheen", "KHR_xmp", "KHR_materials_ior", "VENDOR_b"]);
    json["extensionsRequired"] = json!(["KHR_materials_sheen"]);
    let scene = load(&json);
    let said = said(&scene);
    assert!(said.len() == 1 && said[0].ends_with("not rendered: KHR_materials_sheen, VENDOR_b"), "{said:?}");
}

#[test]
fn joints_and_morph_targets_move_vertices_from_where_they_rest() {
    let mut morphed = triangle();
    morphed["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 0 }, { "POSITION": 0 }]);
    morphed["meshes"][0]["weights"] = json!([0.0, 1.0]);
    assert_eq!(corners(&load(&morphed)), [[[0, 0, 0], [2000, 0, 0], [0, 2000, 0]]]);
    morphed["nodes"][0]["weights"] = json!([0.5, 0.0]);
    assert_eq!(
        corners(&load(&morphed)),
        [[[0, 0, 0], [1500, 0, 0], [0, 1500, 0]]],
        "a node's weights replace the mesh's"
    );

    // Corner 0 follows joint 0, corner 1 joint 1, corner 2 half of each. Joint 1 was bound at x = 1, and is at x = 5.
    let mut skinned = triangle();
    let joints = [0u8, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0];
    let weights = floats(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0]);
    let bind = |x: f32| floats(&[1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., -x, 0., 0., 1.]);
    let bytes = [joints.to_vec(), weights, bind(0.0), bind(1.0)].concat();
    skinned["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": bytes.len(), "uri": data(&bytes) }));
    for (first, length) in [(0, 12), (12, 48), (60, 128)] {
        let view = json!({ "buffer": 1, "byteOffset": first, "byteLength": length });
        skinned["bufferViews"].as_array_mut().unwrap().push(view);
    }
    skinned["accessors"].as_array_mut().unwrap().extend([
        json!({ "bufferView": 3, "componentType": 5121, "count": 3, "type": "VEC4" }),
        json!({ "bufferView": 4, "componentType": 5126, "count": 3, "type": "VEC4" }),
        json!({ "bufferView": 5, "componentType": 5126, "count": 2, "type": "MAT4" }),
    ]);
    skinned["meshes"][0]["primitives"][0]["attributes"] = json!({ "POSITION": 0, "JOINTS_0": 3, "WEIGHTS_0": 4 });
    skinned["skins"] = json!([{ "joints": [2, 3], "inverseBindMatrices": 5 }]);
    // The transform of the node that shows the mesh does not count.
    skinned["nodes"][0] = json!({ "mesh": 0, "skin": 0, "translation": [99, 0, 0] });
    skinned["nodes"].as_array_mut().unwrap().extend([json!({ "children": [3] }), json!({ "translation": [5, 0, 0] })]);
    skinned["scenes"][0]["nodes"] = json!([0, 1, 2]);
    assert_eq!(corners(&load(&skinned)), [[[0, 0, 0], [5000, 0, 0], [2000, 1000, 0]]]);
}
