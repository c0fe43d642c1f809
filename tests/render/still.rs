//! Tests scenes in which nothing moves: what instances place is baked, where it is little, and looks as it did.
use crate::alike::alike;
use crate::gltf_file::{data, floats};
use crate::support::{assert_silent, gpu, render};
use serde_json::json;
use std::fs;
use std::path::Path;
use tallow::gpu::Gpu;
use tallow::layout::{Effects, PixelStats, SPHERE};
use tallow::render::{Outputs, Renderer, called_for};
use tallow::scene::description::Transform;
use tallow::scene::{Loaded, Pose, SceneFile};

const WORLD: &str = "[camera]\nposition = [0.0, 1.5, 6.0]\ntarget = [0.0, 0.5, 0.0]\nfov = 45.0\n[environment]\n\
    [[light]]\ntype = 'directional'\ndirection = [0.4, -1.0, -0.3]\nirradiance = [3.0, 2.0, 1.0]\n\
    [[material]]\nname = 'red'\ncolor = [0.8, 0.1, 0.1]\n[[material]]\nname = 'metal'\ntype = 'conductor'\nalpha = 0.2\n\
    [[mesh]]\nname = 'floor'\nshape = 'rectangle'\ntransform = { rotate = [-90.0, 0.0, 0.0], scale = 4.0 }\n\
    [[mesh]]\nname = 'block'\nshape = 'cube'\nmaterial = 'red'\ntransform = { scale = [0.5, 0.7, 0.5] }\n\
    [[mesh]]\nname = 'ball'\nshape = 'sphere'\nsegments = 24\nmaterial = 'metal'\n\
    [[mesh]]\nname = 'exact'\nshape = 'sphere'\ntransform = { scale = 0.4 }\n";

/// A turned block, one in another material, a mirrored and a stretched ball, and two true spheres.
const PLACED: &str = "[[instance]]\nmesh = 'block'\ntransform = { translate = [-2.0, 0.7, 0.0], rotate = [0.0, 30.0, 0.0] }\n\
    [[instance]]\nmesh = 'ball'\ntransform = { translate = [0.6, 0.5, 0.8], scale = [0.5, 0.5, -0.5] }\n\
    [[instance]]\nmesh = 'block'\nmaterial = 'metal'\ntransform = { translate = [2.0, 0.5, -1.0], scale = 0.8 }\n\
    [[instance]]\nmesh = 'ball'\ntransform = { translate = [-0.5, 1.2, -1.0], scale = [0.4, 0.8, 0.4] }\n\
    [[instance]]\nmesh = 'exact'\ntransform = { translate = [-0.8, 0.4, 1.0] }\n\
    [[instance]]\nmesh = 'exact'\ntransform = { translate = [1.4, 1.5, 0.0], rotate = [10.0, 20.0, 30.0], scale = 2.0 }\n";

fn load(more: &str, still: bool) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    fs::write(&path, format!("{WORLD}{more}")).unwrap();
    let mut file = SceneFile::open(&path).unwrap();
    if still {
        file.stays_still();
    }
    file.load().unwrap().with(|s| (s.width, s.height, s.spp, s.max_depth) = (64, 48, 16, 4))
}

const OUTPUTS: Outputs = Outputs { guides: true, counters: false, split_light: false };

fn effects_of(scene: &Loaded) -> Effects {
    called_for(scene, &scene.settings, OUTPUTS)
}

/// The pixels, and the number of the object that each shows.
fn picture(gpu: &Gpu, scene: &Loaded) -> (Vec<PixelStats>, Vec<u32>) {
    picture_with(gpu, scene, effects_of(scene))
}

fn picture_with(gpu: &Gpu, scene: &Loaded, effects: Effects) -> (Vec<PixelStats>, Vec<u32>) {
    let renderer = Renderer::specialised(gpu, scene, &scene.settings, OUTPUTS, effects).unwrap();
    let stats = render(gpu, &renderer);
    let guide = renderer.film().tiles[0].guide.read().unwrap();
    (stats, guide.iter().map(|guide| guide.object).collect())
}

#[test]
fn what_instances_place_is_baked_and_looks_the_same() {
    let gpu = gpu();
    let [placed, baked] = [false, true].map(|still| load(PLACED, still));
    assert!(placed.instances.len() == 7 && baked.instances.is_empty(), "{} instances", baked.instances.len());
    assert_eq!(placed.names.objects, baked.names.objects);
    let spheres = |scene: &Loaded| scene.triangles.iter().filter(|t| t.primitive & SPHERE != 0).count();
    assert_eq!([&placed, &baked].map(spheres), [1, 2]);
    let [(before, ids), (after, its)] = [&placed, &baked].map(|scene| picture(&gpu, scene));
    alike(&before, &after, 1).unwrap();
    let elsewhere = ids.iter().zip(&its).filter(|(a, b)| a != b).count();
    assert!(elsewhere * 200 <= ids.len(), "{elsewhere} of {} pixels show another object", ids.len());
    let moved = load(&PLACED.replace("0.7, 0.0]", "0.8, 0.0]"), true);
    assert!(alike(&before, &picture(&gpu, &moved).0, 1).is_err(), "control: a block that is placed elsewhere");
    assert_silent(&gpu);
}

#[test]
fn what_moves_or_is_much_is_not_baked() {
    let still = |more: &str| load(&format!("{PLACED}{more}"), true).instances.len();
    let trees = |count: u32| {
        let one = |i| format!("[[instance]]\nmesh = 'tree'\ntransform = {{ translate = [{i}, 0, 0] }}\n");
        let placed: String = (0..count).map(one).collect();
        format!("[[mesh]]\nname = 'tree'\nshape = 'sphere'\nsegments = 48\n{placed}")
    };
    let lamp = "[[light]]\nname = 'lamp'\ntype = 'point'\nposition = [0, 5, 0]\nintensity = 1.0\n";
    for (case, more, instances) in [
        ("a few trees", trees(30), 0),
        ("a forest", trees(120), 7 + 120),
        ("a mesh that moves", "[[mesh]]\nname = 'soft'\nshape = 'cube'\nmoving = true\n".to_owned(), 8),
        ("an ellipsoid", "[[instance]]\nmesh = 'exact'\ntransform = { scale = [1, 2, 1] }\n".to_owned(), 8),
        (
            "an animation",
            format!("{lamp}[[animation]]\nlight = 'lamp'\nkeys = [{{ time = 0.0, intensity = 1.0 }}]\n"),
            7,
        ),
    ] {
        assert_eq!(still(&more), instances, "{case}");
    }
}

/// Meshes whose coordinates are so small that products of three of them are no numbers of 32 bits, in metres of their instances.
#[test]
fn a_mesh_that_is_tiny_in_its_own_space_looks_as_one_that_is_not() {
    let gpu = gpu();
    let placed = |own: &str, scale: [&str; 3]| {
        let [block, ball, exact] = scale;
        let mesh = |name: &str, shape: &str| {
            format!("[[mesh]]\nname = '{name}'\n{shape}\nmaterial = 'red'\ntransform = {{ scale = {own} }}\n")
        };
        let at = |name: &str, x: f64, scale: &str| {
            format!(
                "[[instance]]\nname = '{name}'\nmesh = '{name}'\n\
                 transform = {{ translate = [{x}, 0.7, 0.5], rotate = [0, 30, 0], scale = {scale} }}\n"
            )
        };
        [
            mesh("a", "shape = 'cube'"),
            mesh("b", "shape = 'sphere'\nsegments = 24"),
            mesh("c", "shape = 'sphere'"),
            at("a", -1.5, block),
            at("b", 0.0, ball),
            at("c", 1.5, exact),
        ]
        .concat()
    };
    let [mut tiny, usual] = [("1e-15", ["5e14", "6e14", "7e14"]), ("1.0", ["0.5", "0.6", "0.7"])]
        .map(|(own, scale)| load(&placed(own, scale), false));
    assert!(tiny.warnings.is_empty() && tiny.instances.len() == usual.instances.len(), "{:?}", tiny.warnings);
    let [(found, ids), (expected, its)] = [&tiny, &usual].map(|scene| picture(&gpu, scene));
    alike(&found, &expected, 1).unwrap();
    assert!(its.iter().filter(|object| **object > 0).count() > 300, "control: they are seen");
    let elsewhere = ids.iter().zip(&its).filter(|(a, b)| a != b).count();
    assert!(elsewhere * 200 <= ids.len(), "{elsewhere} pixels show another object");
    // Their instances are placed as the file has them.
    let lifted = [5e14, 0., 0., -1.5, 0., 5e14, 0., 2.0, 0., 0., 5e14, 0.5, 0., 0., 0., 1.];
    let number = tiny.rig.placement("a").unwrap();
    tiny.apply(&Pose { instances: vec![(number, Transform::try_from(lifted).unwrap())], ..Pose::default() }).unwrap();
    let high = tiny.bounds[1][1];
    assert!((high - 2.5).abs() < 1e-4, "{high}");
    assert_silent(&gpu);
}

/// A glTF file of two triangles that are bent, with normals and coordinates of textures; `tangents` gives them such, which lead elsewhere.
fn sheet(tangents: bool) -> String {
    let positions = [-1., -1., 0., 1., -1., 0.2, 1., 1., 0., -1., 1., 0.2];
    let normals = [0.1, 0., 1., 0., 0.2, 1., -0.1, 0., 1., 0., 0., 1.];
    let uvs = [0., 2., 2., 2., 2., 0., 0., 0.];
    let given = [0.6, 0.8, 0., -1., 0.6, 0.8, 0., -1., 0.6, 0.8, 0., -1., 0.6, 0.8, 0., -1.];
    let indices = [0u32, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()).collect::<Vec<_>>();
    let bytes = [floats(&positions), floats(&normals), floats(&uvs), floats(&given), indices].concat();
    let view = |first: usize, length: usize| json!({ "buffer": 0, "byteOffset": first, "byteLength": length });
    let accessor =
        |view: usize, kind: &str| json!({ "bufferView": view, "componentType": 5126, "count": 4, "type": kind });
    let mut attributes = json!({ "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2 });
    if tangents {
        attributes["TANGENT"] = json!(3);
    }
    json!({
        "asset": { "version": "2.0" }, "scenes": [{ "nodes": [0] }], "nodes": [{ "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": attributes, "indices": 4 }] }],
        "accessors": [accessor(0, "VEC3"), accessor(1, "VEC3"), accessor(2, "VEC2"), accessor(3, "VEC4"),
            { "bufferView": 4, "componentType": 5125, "count": 6, "type": "SCALAR" }],
        "bufferViews": [view(0, 48), view(48, 48), view(96, 32), view(128, 64), view(192, 24)],
        "buffers": [{ "byteLength": bytes.len(), "uri": data(&bytes) }]
    })
    .to_string()
}

/// Two sheets, a ball, a disk and a cube: each is turned, mirrored, stretched and laid down by an instance.
fn placed_in(material: &str, keys: &str) -> String {
    let meshes = [
        "file = 'sheet.gltf'",
        "file = 'turned.gltf'",
        "shape = 'sphere'\nsegments = 20",
        "shape = 'disk'",
        "shape = 'cube'",
    ];
    let places = [
        (-2, "rotate = [20, 30, 10], scale = 0.5"),
        (-1, "rotate = [0, 160, 0], scale = [-0.5, 0.5, 0.5]"),
        (1, "rotate = [10, 50, 80], scale = [0.3, 0.6, 0.5]"),
        (2, "rotate = [-90, 0, 0], scale = 0.6"),
    ];
    let mut text = format!("{WORLD}[[material]]\nname = '{material}'\n{keys}\n");
    for (number, shape) in (0u8..).zip(meshes) {
        let (y, z) = (f32::from(number) * 0.7, f32::from(number) * -0.4);
        text += &format!("[[mesh]]\nname = 'm{number}'\n{shape}\nmaterial = '{material}'\n");
        for (x, turned) in places {
            text +=
                &format!("[[instance]]\nmesh = 'm{number}'\ntransform = {{ {turned}, translate = [{x}, {y}, {z}] }}\n");
        }
    }
    text
}

/// The pictures that [`every_material_looks_the_same_on_what_is_baked`] shows, and the sheets.
fn write_files(folder: &Path) {
    fs::write(folder.join("sheet.gltf"), sheet(false)).unwrap();
    fs::write(folder.join("turned.gltf"), sheet(true)).unwrap();
    let save = |name: &str, texel: &dyn Fn(u8, u8) -> [u8; 4]| {
        let picture = image::RgbaImage::from_fn(8, 8, |x, y| image::Rgba(texel(x as u8, y as u8)));
        picture.save(folder.join(name)).unwrap();
    };
    save("normals.png", &|x, y| [90 + 10 * x, 170 - 12 * y, 230, 255]);
    save("colour.png", &|x, y| [30 * x, 30 * y, 120, if (x + y) % 3 == 0 { 40 } else { 255 }]);
    save("height.png", &|x, y| [20 * x + 9 * y; 4].map(|v| v | 3));
}

const MATERIALS: [(&str, &str); 6] = [
    ("mapped", "normal_map = 'normals.png'"),
    ("bumped", "color = [0.7, 0.6, 0.5]\nbump = 'height.png'\nbump_scale = 0.3"),
    ("masked", "color_texture = 'colour.png'\nopacity_texture = 'colour.png'"),
    ("brushed", "type = 'conductor'\nalpha = 0.4\nalpha_v = 0.05"),
    ("shining", "emission = [2, 1, 1]\nemission_texture = 'colour.png'"),
    (
        "coated",
        "type = 'metallic-roughness'\nmetallic = 0.5\nroughness = 0.4\nnormal_map = 'normals.png'\nclearcoat = 1\n\
         clearcoat_normal_map = 'normals.png'",
    ),
];

/// What maps, masks, lamps and directions of roughness show does not depend on how a mesh is stored, wherever instances put it.
#[test]
fn every_material_looks_the_same_on_what_is_baked() {
    let gpu = gpu();
    let folder = tempfile::tempdir().unwrap();
    write_files(folder.path());
    let pairs = MATERIALS.map(|(material, keys)| {
        let path = folder.path().join("scene.toml");
        fs::write(&path, placed_in(material, keys)).unwrap();
        [false, true].map(|still| {
            let mut file = SceneFile::open(&path).unwrap();
            if still {
                file.stays_still();
            }
            file.load().unwrap().with(|s| (s.width, s.height, s.spp, s.max_depth) = (96, 72, 32, 3))
        })
    });
    // Drivers compile for seconds: all that is placed shares a kernel, and so does all that is baked.
    let [of_placed, of_baked] =
        [0, 1].map(|kind| pairs.iter().map(|pair| effects_of(&pair[kind])).reduce(Effects::or).unwrap());
    assert!(of_placed.instances && !of_baked.instances);
    for ((material, _), [placed, baked]) in MATERIALS.iter().zip(&pairs) {
        assert!(placed.instances.len() == 21 && baked.instances.is_empty(), "{material}: {}", placed.instances.len());
        let [(before, _), (after, _)] =
            [(placed, of_placed), (baked, of_baked)].map(|(scene, effects)| picture_with(&gpu, scene, effects));
        alike(&before, &after, MATERIALS.len()).unwrap_or_else(|why| panic!("{material}: {why}"));
    }
    assert_silent(&gpu);
}
