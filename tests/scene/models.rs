//! Tests models that scene files name as meshes: glTF files with all that they hold, and PLY files.
use crate::gltf_file::{data, floats, triangle};
use serde_json::{Value, json};
use std::path::Path;
use tallow::layout::{LIGHT_POINT, MATERIAL_MASKED};
use tallow::scene::{Loaded, Scene};

/// A model of a textured triangle that moves along x from time 0 to time 2 and of one that stays, with a lamp.
fn model() -> Value {
    let mut png = std::io::Cursor::new(Vec::new());
    image::RgbImage::new(2, 2).write_to(&mut png, image::ImageFormat::Png).unwrap();
    let mut json = triangle();
    json["images"] = json!([{ "uri": "tex.png" }, { "uri": data(&png.into_inner()) }]);
    json["textures"] = json!([{ "source": 0 }, { "source": 1 }]);
    json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
    json["materials"][0]["emissiveFactor"] = json!([1, 1, 1]);
    json["materials"][0]["emissiveTexture"] = json!({ "index": 1 });
    json["extensions"] = json!({ "KHR_lights_punctual": { "lights": [{ "type": "point", "intensity": 8 }] } });
    json["nodes"] = json!([
        { "mesh": 0, "translation": [0, 0, 0] },
        { "mesh": 1 },
        { "translation": [0, 3, 0], "extensions": { "KHR_lights_punctual": { "light": 0 } } }
    ]);
    json["meshes"].as_array_mut().unwrap().push(
        json!({ "name": "still", "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "material": 0 }] }),
    );
    json["scenes"][0]["nodes"] = json!([0, 1, 2]);
    let keys = floats(&[0.0, 2.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 6.0]);
    json["buffers"].as_array_mut().unwrap().push(json!({ "byteLength": 56, "uri": data(&keys) }));
    let view = |first: u64, length: u64| json!({ "buffer": 1, "byteOffset": first, "byteLength": length });
    json["bufferViews"].as_array_mut().unwrap().extend([view(0, 8), view(8, 24), view(32, 24)]);
    let accessor =
        |view: u64, kind: &str| json!({ "bufferView": view, "componentType": 5126, "count": 2, "type": kind });
    let accessors = json["accessors"].as_array_mut().unwrap();
    accessors.extend([accessor(3, "SCALAR"), accessor(4, "VEC3"), accessor(5, "VEC3")]);
    let clip = |name: &str, output: u64| {
        json!({ "name": name, "samplers": [{ "input": 3, "output": output }],
            "channels": [{ "sampler": 0, "target": { "node": 0, "path": "translation" } }] })
    };
    json["animations"] = json!([clip("Walk", 4), clip("Jump", 5)]);
    json
}

/// A folder with the model in a folder of its own, beside a scene file.
fn folder() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let own = folder.path().join("models");
    std::fs::create_dir(&own).unwrap();
    std::fs::write(own.join("fox.gltf"), model().to_string()).unwrap();
    image::RgbImage::new(3, 1).save(own.join("tex.png")).unwrap();
    folder
}

fn parse(folder: &Path, text: &str) -> Result<Loaded, String> {
    Scene::parse(&folder.join("scene.toml"), text).map_err(|e| e.to_string())
}

/// Corners of all that is placed, in the world, in tenths.
fn corners(scene: &Scene) -> Vec<[[i32; 3]; 3]> {
    placed(scene).into_iter().map(|(corners, _)| corners).collect()
}

/// The same, with its material.
fn placed(scene: &Scene) -> Vec<([[i32; 3]; 3], u32)> {
    let tenths = |p: [f32; 3]| p.map(|v| (v * 10.0).round() as i32);
    let mut found = Vec::new();
    for i in &scene.instances {
        let rows = [i.world0, i.world1, i.world2].map(glam::Vec4::from);
        let world = |p: [f32; 3]| tenths(rows.map(|row| row.dot(glam::Vec3::from(p).extend(1.0))));
        // A mesh is one triangle, of which the root of its instance tells.
        let node = &scene.nodes[i.root as usize];
        let t = &scene.triangles[node.primitive_base as usize];
        found.push(([t.v0, t.v1, t.v2].map(world), t.material));
    }
    found.sort_unstable();
    found
}

const SCENE: &str = "[[mesh]]\nname = 'fox'\nfile = 'models/fox.gltf'\n";

#[test]
fn a_gltf_file_is_a_mesh_with_textures_lamps_and_what_moves_them() {
    let folder = folder();
    let text = format!("{SCENE}transform = {{ scale = 2, translate = [0, 1, 0] }}\n");
    let mut loaded = parse(folder.path(), &text).unwrap();
    // Both pictures are found, one beside the model and one within it.
    assert_eq!(loaded.textures.iter().map(|t| t.width).collect::<Vec<_>>(), [3, 2]);
    assert_eq!(loaded.names.objects, ["fox/still", "fox/leaf"]);
    assert!(loaded.warnings.iter().any(|w| w.contains("not played") && w.ends_with("Jump")), "{:?}", loaded.warnings);
    let lamp = loaded.lights.iter().find(|l| l.kind == LIGHT_POINT).unwrap();
    assert_eq!((lamp.a, lamp.value), ([0.0, 7.0, 0.0], [8.0; 3]));
    assert!(!loaded.lights.iter().any(|l| l.kind == tallow::layout::LIGHT_ENVIRONMENT), "a model brings no sky");
    let at_rest = [[[0, 10, 0], [20, 10, 0], [0, 30, 0]]; 2];
    assert_eq!(corners(&loaded), at_rest);
    let pose = loaded.animation.at(1.0).unwrap();
    loaded.scene.apply(&pose).unwrap();
    assert_eq!(corners(&loaded), [at_rest[0], [[40, 10, 0], [60, 10, 0], [40, 30, 0]]]);
}

#[test]
fn instances_place_all_of_it_and_its_clips_can_be_chosen() {
    let folder = folder();
    let text = format!(
        "{SCENE}clip = 'Jump'\n[[instance]]\nmesh = 'fox'\n[[instance]]\nmesh = 'fox'\nmaterial = 'red'\n\
         transform = {{ translate = [100, 0, 0] }}\n[[material]]\nname = 'red'\n"
    );
    let mut loaded = parse(folder.path(), &text).unwrap();
    assert_eq!(loaded.instances.len(), 4);
    assert_eq!(loaded.lights.iter().filter(|l| l.kind == LIGHT_POINT).count(), 2);
    let pose = loaded.animation.at(2.0).unwrap();
    loaded.scene.apply(&pose).unwrap();
    let firsts: Vec<_> = corners(&loaded).into_iter().map(|t| t[0]).collect();
    assert_eq!(firsts, [[0, 0, 0], [0, 0, 60], [1000, 0, 0], [1000, 0, 60]]);
    // The scene's own material takes the place of the model's of that name.
    assert_eq!(loaded.names.materials[0], "red");
    assert!(!loaded.names.materials.contains(&"fox/red".to_owned()));
}

#[test]
fn keys_move_nodes_of_a_model_and_what_hangs_on_them() {
    let folder = folder();
    let mut json = model();
    // The lamp hangs on the second node, which has a scale; the first has a clip of its own.
    json["nodes"][1] = json!({ "name": "arm", "mesh": 1, "children": [2], "scale": [2, 2, 2] });
    json["scenes"][0]["nodes"] = json!([0, 1]);
    std::fs::write(folder.path().join("models/fox.gltf"), json.to_string()).unwrap();
    let keys = |node: &str, to: &str| {
        let at = |time: u32, what: &str| format!("[[animation.keys]]\ntime = {time}\n{what}\n");
        format!("[[animation]]\nnode = '{node}'\n{}{}", at(0, "translate = [0, 0, 0]"), at(2, to))
    };
    let place = "transform = { translate = [0, 1, 0] }\n";
    let text = format!("{SCENE}{place}{}", keys("fox/arm", "translate = [0, 10, 0]"));
    let mut loaded = parse(folder.path(), &text).unwrap();
    assert_eq!(loaded.animation.end(), 2.0);
    let pose = loaded.animation.at(1.0).unwrap();
    loaded.scene.apply(&pose).unwrap();
    // Keys replace the translation alone; the clip goes on.
    assert_eq!(corners(&loaded), [[[0, 60, 0], [20, 60, 0], [0, 80, 0]], [[20, 10, 0], [30, 10, 0], [20, 20, 0]]]);
    let lamp = loaded.lights.iter().find(|l| l.kind == LIGHT_POINT).unwrap();
    assert_eq!(lamp.a, [0.0, 12.0, 0.0], "it hangs on the arm: 1 + 5 + 2 x 3");
    // Both instances follow; a node is found by the name of its mesh and by its number, and keys win over the clip.
    let copies = "[[instance]]\nmesh = 'fox'\n[[instance]]\nmesh = 'fox'\ntransform = { translate = [100, 0, 0] }\n";
    for node in ["fox/leaf", "fox/node 0"] {
        let mut loaded =
            parse(folder.path(), &format!("{SCENE}{copies}{}", keys(node, "translate = [0, 0, 8]"))).unwrap();
        let pose = loaded.animation.at(2.0).unwrap();
        loaded.scene.apply(&pose).unwrap();
        let firsts: Vec<_> = corners(&loaded).into_iter().map(|t| t[0]).collect();
        assert_eq!(firsts, [[0, 0, 0], [0, 0, 80], [1000, 0, 0], [1000, 0, 80]], "{node}");
    }
    let refused = |text: &str, word: &str| {
        let error = parse(folder.path(), &format!("{SCENE}{text}")).map(|_| ()).unwrap_err();
        assert!(error.contains(word) && !error.contains('\n'), "{error}");
    };
    refused(&keys("fox/arms", "scale = 1"), "node \"arms\": is not there: did you mean \"arm\"?");
    refused(&keys("fox/node 3", "scale = 1"), "node \"node 3\"");
    refused(&keys("hen/arm", "scale = 1"), "animation 1: no node \"hen/arm\"");
    refused(&keys("arm", "scale = 1"), "write MESH/NODE");
    refused(&keys("fox/arm", "fov = 1"), "unknown key \"fov\"");
    refused(&format!("{0}{0}", keys("fox/arm", "scale = 1")), "is moved by an earlier table");
    let twice = ["fox/arm", "fox/node 1"].map(|node| keys(node, "scale = 1")).concat();
    refused(&twice, "node \"node 1\": is moved by an earlier table");
    let instance = keys("fox/leaf", "scale = 1").replace("node =", "instance =");
    refused(&instance, "is placed by instances without a name: a part of a glTF file is moved by `node`");
}

/// Many files are called scene.gltf; one may be placed by several tables. Instances and keys mean the first of a name.
#[test]
fn models_of_one_name_stay_apart() {
    let folder = folder();
    let mut json = model();
    json["nodes"][1]["translation"] = json!([0, 50, 0]);
    json["materials"][0]["emissiveFactor"] = json!([0, 0, 1]);
    std::fs::create_dir(folder.path().join("others")).unwrap();
    std::fs::write(folder.path().join("others/fox.gltf"), json.to_string()).unwrap();
    image::RgbImage::new(3, 1).save(folder.path().join("others/tex.png")).unwrap();
    let table =
        |file: &str, x: u32| format!("[[mesh]]\nfile = '{file}/fox.gltf'\ntransform = {{ translate = [{x}, 0, 0] }}\n");
    let tables = [table("models", 0), table("others", 10), table("models", 20)].concat();
    // What moves is apart; all that stays is one mesh.
    let moving = |scene: &Scene| -> Vec<_> { corners(scene).into_iter().map(|t| t[0]).skip(1).collect() };
    let stays = |scene: &Scene, at: [f32; 3]| scene.triangles.iter().any(|t| t.v0 == at);
    let mut loaded = parse(folder.path(), &tables).unwrap();
    assert_eq!((loaded.triangles.len(), moving(&loaded)), (6, vec![[0, 0, 0], [100, 0, 0], [200, 0, 0]]));
    for at in [[0.0; 3], [10.0, 50.0, 0.0], [20.0, 0.0, 0.0]] {
        assert!(stays(&loaded, at), "{at:?}");
    }
    assert_eq!(loaded.materials.iter().filter(|m| m.emission == [1.0; 3]).count(), 2);
    let blue = loaded.materials.iter().position(|m| m.emission == [0.0, 0.0, 1.0]).unwrap() as u32;
    let wears_blue = |(corners, material): ([[i32; 3]; 3], u32)| (corners[0][0], material == blue);
    let worn: Vec<_> = placed(&loaded).into_iter().skip(1).map(wears_blue).collect();
    assert_eq!(worn, [(0, false), (100, true), (200, false)], "each is its own");
    let pose = loaded.animation.at(1.0).unwrap();
    loaded.scene.apply(&pose).unwrap();
    assert_eq!(moving(&loaded), [[20, 0, 0], [120, 0, 0], [220, 0, 0]]);
    let instance = "[[instance]]\nmesh = 'fox'\ntransform = { translate = [0, 0, 7] }\n";
    let loaded = parse(folder.path(), &format!("{tables}{instance}")).unwrap();
    assert_eq!(loaded.triangles.len(), 6);
    assert!(stays(&loaded, [10.0, 50.0, 0.0]) && stays(&loaded, [20.0, 0.0, 0.0]) && !stays(&loaded, [20.0, 0.0, 7.0]));
}

/// Exporters call materials alike; an MTL file's are its own, unless the scene has one of the name.
#[test]
fn a_model_takes_the_place_of_no_material_of_an_obj_file() {
    let folder = folder();
    let obj = "mtllib leaf.mtl\nv 0 0 5\nv 1 0 5\nv 0 1 5\nusemtl red\nf 1 2 3\n";
    std::fs::write(folder.path().join("leaf.obj"), obj).unwrap();
    std::fs::write(folder.path().join("leaf.mtl"), "newmtl red\nKd 0 0.25 0\n").unwrap();
    let color = |scene: &Scene| {
        let leaf = scene.triangles.iter().find(|t| t.v0 == [0.0, 0.0, 5.0]).unwrap();
        scene.materials[leaf.material as usize].base_color
    };
    let text = format!("{SCENE}[[mesh]]\nfile = 'leaf.obj'\n");
    assert_eq!(color(&parse(folder.path(), &text).unwrap()), [0.0, 0.25, 0.0]);
    let own = format!("{text}[[material]]\nname = 'red'\ncolor = [0.75, 0, 0]\n");
    assert_eq!(color(&parse(folder.path(), &own).unwrap()), [0.75, 0.0, 0.0]);
}

#[test]
fn what_a_model_cannot_have_is_named() {
    let folder = folder();
    let refused = |text: &str, word: &str| {
        let error = parse(folder.path(), text).map(|_| ()).unwrap_err();
        assert!(error.contains(word) && !error.contains('\n'), "{error}");
    };
    refused(&format!("{SCENE}clip = 'Swim'\n"), "clip \"Swim\": is not there: choose one of \"Walk\", \"Jump\"");
    refused(&format!("{SCENE}group = 'leaf'\n"), "mesh \"fox\": is a glTF file, which has neither group nor segments");
    refused("[[mesh]]\nshape = 'cube'\nclip = 'Walk'\n", "has a clip, which is for glTF files");
    refused("[[mesh]]\nfile = 'models/hen.glb'\n", "hen.glb: cannot be read");
}

#[test]
fn a_ply_file_is_a_mesh_and_a_scene() {
    let folder = tempfile::tempdir().unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
               property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n\
               property list uchar int vertex_indices\nend_header\n0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0 0 0 255\n3 0 1 2\n";
    std::fs::write(folder.path().join("leaf.ply"), ply).unwrap();
    let alone = Scene::load(&folder.path().join("leaf.ply")).unwrap();
    assert_eq!((alone.triangles.len(), alone.lights.len()), (1, 1));
    assert_eq!(
        alone.materials[alone.triangles[0].material as usize].base_color, [1.0; 3],
        "in the colours of vertices"
    );
    assert_eq!(alone.texels[..2], [0xffff, 0xffff_0000], "red, opaque");
    let loaded = parse(folder.path(), "[[mesh]]\nfile = 'leaf.ply'\n").unwrap();
    assert_eq!(loaded.triangles, alone.triangles);
}

#[test]
fn opacities_of_ply_vertices_make_holes_where_a_material_takes_them() {
    let folder = tempfile::tempdir().unwrap();
    let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
               property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
               0 0 0 9 9 9 255\n1 0 0 9 9 9 0\n0 1 0 9 9 9 0\n3 0 1 2\n";
    std::fs::write(folder.path().join("fading.ply"), ply).unwrap();
    std::fs::write(folder.path().join("opaque.ply"), ply.replace(" 9 0\n", " 9 255\n")).unwrap();
    for (file, mode, masked) in [
        ("fading", "alpha_mode = 'mask'", true),
        ("fading", "alpha_mode = 'blend'", true),
        ("fading", "alpha_mode = 'opaque'", false),
        ("fading", "alpha_mode = 'mask'\nalpha_cutoff = 0.0", false),
        ("fading", "", false),
        ("opaque", "alpha_mode = 'blend'", false),
    ] {
        let text = format!(
            "[[material]]\nname = 'm'\ntype = 'metallic-roughness'\n{mode}\n\
             [[mesh]]\nfile = '{file}.ply'\nmaterial = 'm'\n[[light]]\ntype = 'point'\nintensity = 1\nposition = [0, 0, 3]\n\
             [[animation]]\nmaterial = 'm'\nkeys = [{{ time = 0, opacity = 1 }}, {{ time = 1, opacity = 0.5 }}]\n"
        );
        let mut loaded = parse(folder.path(), &text).unwrap();
        let is_masked = |scene: &Scene| scene.materials[0].flags & MATERIAL_MASKED != 0;
        assert_eq!(is_masked(&loaded), masked, "{file}, {mode}");
        // An opacity of 1 leaves the holes of vertices, whatever it was before.
        for (time, expected) in [(0.0, masked), (1.0, true), (0.0, masked)] {
            let pose = loaded.animation.at(time).unwrap();
            loaded.scene.apply(&pose).unwrap();
            assert_eq!(is_masked(&loaded), expected, "{file}, {mode}, at {time} s");
        }
    }
}
