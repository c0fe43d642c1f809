//! Tests what glTF allows and few files do: numbers and lists in unusual forms, transforms and attributes that say nothing.
use crate::gltf_file::{data, floats, triangle};
use serde_json::{Value, json};
use tallow::layout::ATTRIBUTE_TANGENTS;
use tallow::scene::{Loaded, Scene};

fn load_text(text: &str) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.gltf");
    std::fs::write(&path, text).unwrap();
    Scene::load(&path).unwrap_or_else(|e| panic!("{e}"))
}

fn load(json: &Value) -> Loaded {
    load_text(&json.to_string())
}

/// Adds an accessor of floats for the three vertices; returns its number.
fn add_floats(json: &mut Value, kind: &str, numbers: &[f32]) -> usize {
    let push = |json: &mut Value, key: &str, value: Value| {
        let list = json[key].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    };
    let bytes = floats(numbers);
    let buffer = push(json, "buffers", json!({ "byteLength": bytes.len(), "uri": data(&bytes) }));
    let view = push(json, "bufferViews", json!({ "buffer": buffer, "byteLength": bytes.len() }));
    push(json, "accessors", json!({ "bufferView": view, "componentType": 5126, "count": 3, "type": kind }))
}

#[test]
fn tangents_count_beside_normals_alone() {
    let mut json = triangle();
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(1, 1).write_to(&mut png, image::ImageFormat::Png).unwrap();
    json["images"] = json!([{ "uri": data(&png.into_inner()) }]);
    json["textures"] = json!([{ "source": 0 }]);
    json["materials"][0]["normalTexture"] = json!({ "index": 0 });
    let tangents = add_floats(&mut json, "VEC4", &[0.0, 1.0, 0.0, 1.0].repeat(3));
    let normals = add_floats(&mut json, "VEC3", &[0.0, 0.0, 1.0].repeat(3));
    let kept = |json: &Value| load(json).shading.iter().any(|s| s.attributes & ATTRIBUTE_TANGENTS != 0);
    json["meshes"][0]["primitives"][0]["attributes"]["TANGENT"] = json!(tangents);
    assert!(!kept(&json));
    json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = json!(normals);
    assert!(kept(&json));
}

#[test]
fn json_is_read_in_all_its_forms() {
    let mut json = triangle();
    let (text, expected) = (json.to_string(), load(&json).triangles.clone());
    for (from, to) in [
        ("\"count\":3", "\"count\":3.0"),
        ("\"byteLength\":36", "\"byteLength\":3.6e1"),
        ("\"componentType\":5126", "\"componentType\":5126.0"),
        ("\"scene\":0", "\"scene\":0,\"scene\":0"),
    ] {
        assert!(text.contains(from), "{from}");
        assert_eq!(load_text(&text.replace(from, to)).triangles, expected, "{to}");
    }
    json["scenes"].as_array_mut().unwrap().push(json!({ "name": "without nodes" }));
    assert_eq!(load(&json).triangles, expected);
}

#[test]
fn a_mesh_that_a_scale_flattens_is_seen() {
    let mut json = triangle();
    let corners = add_floats(&mut json, "VEC3", &[0.0, 0.0, 5.0, 1.0, 0.0, 6.0, 0.0, 1.0, 7.0]);
    let normals = add_floats(&mut json, "VEC3", &[1.0, 0.0, 0.0].repeat(3));
    json["meshes"][0]["primitives"][0]["attributes"] = json!({ "POSITION": corners, "NORMAL": normals });
    json["nodes"][0] = json!({ "mesh": 0, "scale": [1, 2, 0], "translation": [0, 0, 3] });
    let scene = load(&json);
    let [t] = &scene.triangles[..] else { panic!("{:?}", scene.triangles) };
    let mut corners = [t.v0, t.v1, t.v2];
    corners.sort_by(|a, b| a.partial_cmp(b).unwrap());
    assert_eq!(corners, [[0.0, 0.0, 3.0], [0.0, 2.0, 3.0], [1.0, 0.0, 3.0]]);
    let flat = scene.shading.iter().all(|s| s.normal == [u32::MAX; 3]);
    assert!(flat && !scene.warnings.iter().any(|w| w.contains("scale is 0")), "{:?}", scene.warnings);
    json["nodes"][0]["scale"] = json!([0, 2, 0]);
    assert!(load(&json).warnings.contains(&"1 meshes whose scale is 0 are not rendered".to_owned()));
}

#[test]
fn instancing_that_lists_nothing_leaves_the_mesh_as_it_is() {
    let mut json = triangle();
    json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": {} } });
    let scene = load(&json);
    assert_eq!(scene.triangles.len(), 1);
    assert!(!scene.warnings.iter().any(|w| w.contains("scale is 0")), "{:?}", scene.warnings);
}

#[test]
fn small_matrices_that_nothing_uses_are_passed_over() {
    let mut json = triangle();
    for (kind, component) in [("MAT2", 5121), ("MAT3", 5120), ("MAT3", 5123)] {
        let accessor = json!({ "bufferView": 0, "componentType": component, "count": 1, "type": kind });
        json["accessors"].as_array_mut().unwrap().push(accessor);
    }
    assert_eq!(load(&json).triangles.len(), 1);
}

#[test]
fn the_film_has_the_shape_of_the_camera_unless_it_is_absurd() {
    let size = |camera: Value| {
        let mut json = triangle();
        json["cameras"] = json!([camera]);
        let loaded = load(&json);
        let odd =
            loaded.warnings.iter().any(|line| line.contains("camera \"camera 0\"") || line.contains("camera \"eye\""));
        (loaded.settings.size(), odd)
    };
    let seen = |yfov: f64, ratio: f64| {
        size(json!({ "type": "perspective", "perspective": { "yfov": yfov, "znear": 0.1, "aspectRatio": ratio } }))
    };
    let flat = |xmag: f64, ymag: f64| {
        size(json!({ "type": "orthographic", "orthographic": { "xmag": xmag, "ymag": ymag, "znear": 0, "zfar": 9 } }))
    };
    assert_eq!(
        [seen(0.7, 1.5), seen(0.7, 0.5), seen(0.7, 1e9)],
        [([768, 512], false), ([256, 512], false), ([512; 2], false)]
    );
    assert_eq!([flat(3.0, 1.0), flat(-1.0, 2.0)], [([1536, 512], false), ([256, 512], false)]);
    assert_eq!([seen(0.0, 2.0), seen(3.2, 2.0), flat(1.0, 0.0)].map(|(_, odd)| odd), [true; 3]);
    assert!(size(json!({ "type": "fisheye" })).1);
}

#[test]
fn a_file_that_shows_nothing_says_so() {
    let mut json = triangle();
    let said = |json: &Value| load(json).warnings.contains(&"the scene shows no surface".to_owned());
    assert!(!said(&json));
    json["nodes"][0].as_object_mut().unwrap().remove("mesh");
    assert!(said(&json));
}
