//! Tests that scenes from an engine's memory equal those from files, and the messages about mistakes.
use crate::gltf_file::{triangle, triangle_bytes};
use image::codecs::png::PngEncoder;
use std::fs::File;
use tallow::image::{Picture, WriteOptions};
use tallow::scene::description::*;
use tallow::scene::{Loaded, Scene};

const FILES: &str = "
[film]
width = 32
height = 16
[camera]
position = [1, 2, 9]
target = [0, 0, 0]
[environment]
file = \"sky.exr\"
scale = 0.5
[[material]]
name = \"wall\"
color_texture = \"checks.png\"
opacity_texture = \"checks.png\"
[[material]]
name = \"lamp\"
emission = [4, 3, 2]
[[mesh]]
name = \"wall\"
file = \"wall.obj\"
material = \"wall\"
[[mesh]]
name = \"lamp\"
file = \"lamp.obj\"
material = \"lamp\"
[[instance]]
mesh = \"lamp\"
transform = { translate = [0, 0, 2] }
[[instance]]
mesh = \"lamp\"
transform = { translate = [2, 0, 2] }
[[light]]
type = \"point\"
position = [0, 3, 0]
intensity = 10
";

const CORNERS: [[f32; 3]; 4] = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.25], [-1.0, 1.0, 0.0]];
const NORMALS: [[f32; 3]; 4] = [[0.0, 0.0, 1.0], [0.0, 0.6, 0.8], [0.6, 0.0, 0.8], [0.0, 0.0, 1.0]];
const UVS: [[f32; 2]; 4] = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
const INDICES: [u32; 6] = [0, 1, 2, 0, 2, 3];

fn texel(i: u32) -> [u8; 4] {
    [(40 * i) as u8, (250 - 30 * i) as u8, 7, (60 * i) as u8]
}

fn sky() -> Picture {
    Picture { width: 4, height: 2, pixels: (0..8).map(|i| [i as f32, 1.0, 0.5 * i as f32]).collect() }
}

/// OBJ text of the same corners.
fn obj(extras: bool) -> String {
    let line = |key: &str, v: &[f32]| format!("{key} {}\n", v.iter().map(f32::to_string).collect::<Vec<_>>().join(" "));
    let mut text: String = CORNERS.iter().map(|v| line("v", v)).collect();
    if extras {
        text += &NORMALS.iter().map(|v| line("vn", v)).collect::<String>();
        text += &UVS.iter().map(|v| line("vt", v)).collect::<String>();
    }
    let corner = |i: u32| if extras { format!("{0}/{0}/{0}", i + 1) } else { (i + 1).to_string() };
    for t in INDICES.chunks(3) {
        text += &format!("f {} {} {}\n", corner(t[0]), corner(t[1]), corner(t[2]));
    }
    text
}

fn from_files() -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    std::fs::write(at("wall.obj"), obj(true)).unwrap();
    std::fs::write(at("lamp.obj"), obj(false)).unwrap();
    let picture = image::RgbaImage::from_raw(3, 2, (0..6).flat_map(texel).collect()).unwrap();
    picture.write_with_encoder(PngEncoder::new(File::create(at("checks.png")).unwrap())).unwrap();
    let mut film = tallow::image::Film::new(4, 2);
    film.add_vec3("", ["R", "G", "B"], &sky().pixels);
    tallow::image::write(&at("sky.exr"), &film, &WriteOptions::default()).unwrap();
    Scene::parse(&at("scene.toml"), FILES).map(|scene| scene.with(|s| s.spp = 7)).unwrap()
}

fn described() -> Description {
    let wall = Mesh {
        positions: CORNERS.to_vec(),
        normals: NORMALS.to_vec(),
        uvs: UVS.to_vec(),
        indices: INDICES.to_vec(),
        ..Mesh::default()
    };
    let lamp = Mesh { normals: Vec::new(), uvs: Vec::new(), ..wall.clone() };
    let mesh = |name: &str, data| MeshTable {
        name: Some(name.to_owned()),
        material: Some(name.to_owned()),
        data: Some(data),
        ..MeshTable::default()
    };
    let instance = |x: f64| InstanceTable {
        mesh: "lamp".to_owned(),
        transform: [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 0.0, 0.0, 0.0, 1.0].try_into().unwrap(),
        ..InstanceTable::default()
    };
    let checks = Some(TextureTable::from("pictures/checks"));
    Description {
        film: Film { width: Some(32), height: Some(16), ..Film::default() },
        camera: Camera { position: Some([1.0, 2.0, 9.0]), target: Some([0.0; 3]), ..Camera::default() },
        environment: Some(EnvironmentTable {
            picture: Some(sky()),
            scale: Some(Rgb([0.5; 3])),
            ..EnvironmentTable::default()
        }),
        material: vec![
            MaterialTable {
                name: "wall".to_owned(),
                color_texture: checks.clone(),
                opacity_texture: checks,
                ..MaterialTable::default()
            },
            MaterialTable { name: "lamp".to_owned(), emission: Some(Rgb([4.0, 3.0, 2.0])), ..MaterialTable::default() },
        ],
        mesh: vec![mesh("wall", wall), mesh("lamp", lamp)],
        instance: vec![instance(0.0), instance(2.0)],
        light: vec![LightTable {
            kind: LightType::Point,
            position: Some([0.0, 3.0, 0.0]),
            intensity: Some(Rgb([10.0; 3])),
            ..LightTable::default()
        }],
        bitmap: vec![Bitmap {
            name: "pictures\\checks".into(),
            width: 3,
            height: 2,
            rgba: (0..6).map(texel).collect(),
        }],
        ..Description::default()
    }
}

fn build(description: &Description) -> tallow::error::Result<Loaded> {
    Scene::build(description).map(|scene| scene.with(|s| s.spp = 7))
}

#[test]
fn a_scene_in_memory_is_that_of_the_files() {
    let (files, memory) = (from_files(), build(&described()).unwrap());
    assert_eq!(files.fingerprint([2, 1]).unwrap().to_string(), memory.fingerprint([2, 1]).unwrap().to_string());
    assert_eq!((&files.nodes, &files.instances), (&memory.nodes, &memory.instances));
    assert_eq!((&files.triangles, &files.shading), (&memory.triangles, &memory.shading));
    assert_eq!((&files.materials, &files.textures), (&memory.materials, &memory.textures));
    assert_eq!((&files.texels, &files.lights), (&memory.texels, &memory.lights));
    assert_eq!(
        (files.camera([2, 1]).unwrap(), files.settings.spp),
        (memory.camera([2, 1]).unwrap(), memory.settings.spp)
    );
    assert_eq!(files.environment.as_ref().unwrap().texels, memory.environment.as_ref().unwrap().texels);
    assert_eq!((files.texels.len(), files.triangles.len(), files.instances.len()), (12, 4, 3), "control: all is there");
    assert_eq!(memory.warnings, Vec::<String>::new());
    let mut other = described();
    other.mesh[0].data.as_mut().unwrap().positions[2][2] = 0.5;
    assert_ne!(
        files.fingerprint([2, 1]).unwrap().to_string(),
        build(&other).unwrap().fingerprint([2, 1]).unwrap().to_string(),
        "control"
    );
}

/// To be watched, or not written over.
#[test]
fn a_scene_tells_the_files_that_it_is_made_of() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let mut film = tallow::image::Film::new(4, 2);
    film.add_vec3("", ["R", "G", "B"], &sky().pixels);
    tallow::image::write(&at("sky.exr"), &film, &WriteOptions::default()).unwrap();
    image::RgbImage::new(1, 1).save(at("wood.png")).unwrap();
    std::fs::write(at("wood.mtl"), "newmtl wood\nmap_Kd wood.png\n").unwrap();
    let wall = "mtllib wood.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl wood\nf 1/1 2/2 3/3\n";
    std::fs::write(at("wall.obj"), wall).unwrap();
    let mut model = triangle();
    model["buffers"][0]["uri"] = "a.bin".into();
    std::fs::write(at("a.bin"), triangle_bytes()).unwrap();
    std::fs::write(at("a.gltf"), model.to_string()).unwrap();
    let text = "[environment]\nfile = 'sky.exr'\n[[mesh]]\nfile = 'wall.obj'\n[[mesh]]\nfile = 'a.gltf'\n";
    std::fs::write(at("s.toml"), text).unwrap();
    let files = |name: &str| -> Vec<String> {
        let scene = Scene::load(&at(name)).unwrap();
        scene.files.iter().map(|file| file.file_name().unwrap().to_str().unwrap().to_owned()).collect()
    };
    assert_eq!(files("s.toml"), ["s.toml", "a.gltf", "a.bin", "sky.exr", "wall.obj", "wood.mtl", "wood.png"]);
    assert_eq!(files("a.gltf"), ["a.gltf", "a.bin"]);
    assert_eq!(files("wall.obj"), ["wall.obj", "wood.mtl", "wood.png"]);
    assert_eq!(build(&described()).unwrap().files, Vec::<std::path::PathBuf>::new());
}

/// Encoded, as a file holds them.
#[test]
fn pictures_in_memory_may_be_encoded() {
    let mut description = described();
    let mut png = std::io::Cursor::new(Vec::new());
    let rgba = |x, y| image::Rgba(texel(3 * y + x));
    image::RgbaImage::from_fn(3, 2, rgba).write_to(&mut png, image::ImageFormat::Png).unwrap();
    let Bitmap { name, .. } = description.bitmap.pop().unwrap();
    description.picture_file = vec![PictureFile { name, bytes: png.into_inner().into() }];
    let (encoded, texels) = (build(&description).unwrap(), build(&described()).unwrap());
    assert_eq!((&encoded.textures, &encoded.texels), (&texels.textures, &texels.texels));
    description.picture_file[0].bytes = b"no picture"[..].into();
    let error = build(&description).unwrap_err().to_string();
    assert!(error.contains("pictures/checks") && error.contains("is no usable picture"), "{error}");
}

/// The one line that is said when `change` is made.
fn error(change: impl Fn(&mut Description)) -> String {
    let mut description = described();
    change(&mut description);
    let found = build(&description).unwrap_err();
    assert!(found.exit_code() == 3 && !found.to_string().contains('\n'), "{found}");
    found.to_string()
}

#[test]
fn mistakes_are_one_line_with_place_and_remedy() {
    let mesh = |change: &dyn Fn(&mut Mesh)| error(|d| change(d.mesh[0].data.as_mut().unwrap()));
    let has = |found: String, words: &[&str]| assert!(words.iter().all(|w| found.contains(w)), "{found}: {words:?}");
    has(mesh(&|m| m.indices[5] = 4), &["scene, mesh \"wall\"", "index of 4", "4 positions"]);
    has(mesh(&|m| m.indices.truncate(5)), &["mesh \"wall\"", "5 indices"]);
    has(mesh(&|m| m.normals.truncate(3)), &["mesh \"wall\"", "4 positions but 3 normals"]);
    has(mesh(&|m| m.uvs.push([0.0; 2])), &["mesh \"wall\"", "4 positions but 5 uvs"]);
    has(error(|d| d.mesh[0].shape = Some(Shape::Cube)), &["mesh \"wall\"", "choose one"]);
    has(error(|d| d.mesh[0].data = None), &["mesh \"wall\"", "needs a file"]);
    has(error(|d| d.bitmap[0].width = 4), &["bitmap \"pictures", "6 texels for 4 x 2"]);
    has(error(|d| d.bitmap[0].height = 0), &["bitmap \"pictures", "3 x 0"]);
    has(error(|d| d.bitmap.push(d.bitmap[0].clone())), &["bitmap \"pictures", "twice"]);
    let encoded = |d: &mut Description| PictureFile { name: d.bitmap[0].name.clone(), bytes: [][..].into() };
    has(error(|d| d.picture_file = vec![encoded(d)]), &["picture \"pictures", "twice"]);
    let sky = |change: &dyn Fn(&mut EnvironmentTable)| error(|d| change(d.environment.as_mut().unwrap()));
    has(sky(&|e| e.radiance = Some(Rgb([1.0; 3]))), &["[environment]", "both"]);
    has(sky(&|e| e.file = Some("a.exr".into())), &["[environment]", "both"]);
    has(sky(&|e| e.picture.as_mut().unwrap().pixels.truncate(7)), &["environment", "7 pixels for 4 x 2"]);
    has(error(|d| d.material[0].name = "wal".to_owned()), &["no material \"wall\"", "did you mean \"wal\""]);
}

#[test]
fn what_can_be_mended_is_counted() {
    let mut description = described();
    let data = description.mesh[0].data.as_mut().unwrap();
    data.positions[3][0] = f32::NAN;
    data.normals[0] = [0.0; 3];
    let scene = build(&description).unwrap();
    assert_eq!(scene.triangles.len(), 3);
    let said = scene.warnings.join("\n");
    assert!(said.contains("1 with NaN") && said.contains("1 with unusable vertex normals"), "{said}");
    let mut flat = described();
    flat.mesh[0].data.as_mut().unwrap().normals.clear();
    assert_eq!(build(&flat).unwrap().warnings, Vec::<String>::new(), "a mesh in memory has no normals on purpose");
}

#[test]
fn an_empty_scene_is_black_and_says_so() {
    let empty = Scene::build(&Description::default()).unwrap();
    assert_eq!((empty.triangles.len(), empty.settings.width), (0, tallow::render::settings::Settings::default().width));
    assert!(empty.warnings.iter().any(|w| w.contains("no light")), "{:?}", empty.warnings);
}

fn described_metal(material: MaterialTable) -> Description {
    let mut description = described();
    description.material[0] = MaterialTable {
        name: "wall".to_owned(),
        kind: MaterialType::MetallicRoughness,
        color_texture: Some("pictures/checks".into()),
        ..material
    };
    description
}

#[test]
fn a_metallic_roughness_material_is_built() {
    let loaded = Scene::build(&described_metal(MaterialTable::default())).unwrap();
    let wall = &loaded.scene.materials[0];
    assert_eq!(wall.alpha, 1.0);
    assert!(loaded.scene.warnings.len() <= 1, "{:?}", loaded.scene.warnings);
    let opaque = MaterialTable { alpha_mode: Some(AlphaMode::Opaque), opacity: Some(0.5), ..MaterialTable::default() };
    assert_eq!(Scene::build(&described_metal(opaque)).unwrap().scene.materials[0].opacity, 1.0);
    let bad = MaterialTable { roughness: Some(1.5), ..MaterialTable::default() };
    let error = Scene::build(&described_metal(bad)).unwrap_err().to_string();
    assert!(error.contains("material \"wall\": roughness is 1.5: choose a value from 0 to 1"), "{error}");
    let bad =
        MaterialTable { alpha_mode: Some(AlphaMode::Mask), alpha_cutoff: Some(f32::NAN), ..MaterialTable::default() };
    assert!(Scene::build(&described_metal(bad)).unwrap_err().to_string().contains("alpha_cutoff"));
}
