//! Tests files that scenes name: each is read once, mistakes have their place, limits hold, and memory or threads that run out give
//! one readable line.
use crate::command::complains;
use crate::support;
use image::codecs::png::PngEncoder;
use std::fs::File;
use std::process::{Command, Output};
use tallow::render::{Outputs, Renderer, frame_constants};
use tallow::scene::{Loaded, Scene, SceneFile};
use tallow::twins::primary_hit::guide;
use tempfile::TempDir;

const TRIANGLE: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 1\n";

fn folder(files: &[(&str, &str)]) -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    files.iter().for_each(|(name, text)| std::fs::write(folder.path().join(name), text).unwrap());
    folder
}

fn load(folder: &TempDir, name: &str) -> tallow::error::Result<Loaded> {
    Scene::load(&folder.path().join(name))
}

/// Renders under limits, in a shell; the address space in KiB.
#[cfg(target_os = "linux")]
fn render(folder: &TempDir, scene: &str, kib: u32, before: &str) -> Output {
    let line = format!("ulimit -v {kib}; {before} exec \"$0\" render {scene} --width 8 --height 8 --spp 1 -q -o o.png");
    let mut shell = Command::new("sh");
    shell.args(["-c", &line, env!("CARGO_BIN_EXE_tallow")]).current_dir(folder.path()).output().unwrap()
}

/// Without coordinates every point reads a picture at its origin.
#[test]
fn pictures_of_lamps_need_no_coordinates() {
    let folder = tempfile::tempdir().unwrap();
    let lamp = "mtllib lamp.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl lamp\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    std::fs::write(folder.path().join("lamp.obj"), lamp).unwrap();
    std::fs::write(folder.path().join("lamp.mtl"), "newmtl lamp\nKe 1 1 1\nmap_Ke a.png\n").unwrap();
    image::RgbImage::from_pixel(2, 2, image::Rgb([255; 3])).save(folder.path().join("a.png")).unwrap();
    let scene = Scene::load(&folder.path().join("lamp.obj")).unwrap();
    assert!(scene.has_light_tree() && scene.shading.is_empty());
}

#[test]
fn a_library_is_read_once_however_often_it_is_named() {
    let mtl: String = (0..2000).map(|i| format!("newmtl m{i}\nKd 1 0 0\n")).collect();
    let named: String = (0..2000).map(|i| format!("mtllib {}m.mtl\n", "./".repeat(i % 7))).collect();
    let obj = format!("{named}{TRIANGLE}usemtl m1999\nf 1//1 2//1 3//1\n");
    let folder = folder(&[("m.mtl", &mtl), ("a.obj", &obj)]);
    let scene = load(&folder, "a.obj").unwrap();
    assert_eq!((scene.materials.len(), scene.warnings.len()), (2000, 0));
    assert_eq!(scene.materials[scene.triangles[0].material as usize].base_color, [1.0, 0.0, 0.0]);
}

#[test]
fn the_name_of_a_library_may_stand_in_quotes() {
    for named in ["\"my lib.mtl\"", "\"b.mtl\" \"my lib.mtl\""] {
        let obj = format!("mtllib {named}\n{TRIANGLE}usemtl a\nf 1//1 2//1 3//1\n");
        let folder = folder(&[("my lib.mtl", "newmtl a\nKd 1 0 0\n"), ("b.mtl", "newmtl b\n"), ("a.obj", &obj)]);
        let scene = load(&folder, "a.obj").unwrap();
        assert_eq!(scene.materials[scene.triangles[0].material as usize].base_color, [1.0, 0.0, 0.0], "{named}");
    }
}

#[test]
fn what_is_not_read_is_named() {
    let obj = format!("mtllib m.mtl\n{TRIANGLE}f 1//1 2//1 3//1\ncurv 0 1 1 2 3\nsurf 0 1 0 1 1 2\nsurf 0 1 0 1 2 3\n");
    let folder = folder(&[("m.mtl", "newmtl a\nrefl -type sphere a.png\n"), ("a.obj", &obj)]);
    let said = load(&folder, "a.obj").unwrap().scene.warnings;
    for words in ["a.obj: not read: curv, surf", "m.mtl: not read: refl"] {
        assert_eq!(said.iter().filter(|line| line.ends_with(words)).count(), 1, "{said:?}");
    }
}

#[test]
fn what_is_missing_is_said_once() {
    let named = "mtllib no.mtl\n".repeat(200_000);
    let worn: String = (0..100).map(|i| format!("usemtl n{i:03}\nf 1//1 2//1 3//1\n")).collect();
    let folder = folder(&[("a.obj", &format!("{named}{TRIANGLE}{worn}"))]);
    let said = load(&folder, "a.obj").unwrap().scene.warnings;
    let grey: Vec<_> = said.iter().filter(|w| w.contains("grey")).collect();
    assert_eq!(grey.len(), 1, "{said:?}");
    assert!(grey[0].ends_with("n006, n007 and 92 more (no such library: no.mtl)"), "{}", grey[0]);
}

#[test]
fn what_is_repaired_in_a_mesh_is_told_once_for_all_instances() {
    let folder = folder(&[("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")]);
    let instances: String =
        (0..3).map(|x| format!("[[instance]]\nmesh = \"m\"\ntransform = {{ translate = [{x}, 0, 0] }}\n")).collect();
    let text = format!("[environment]\n[[mesh]]\nname = \"m\"\nfile = \"a.obj\"\n{instances}");
    let path = folder.path().join("s.toml");
    std::fs::write(&path, text).unwrap();
    let mut file = SceneFile::open(&path).unwrap();
    file.stays_still(); // so that each instance is stored
    let scene = file.load().unwrap().scene;
    assert_eq!(scene.warnings.len(), 1, "{:?}", scene.warnings);
    assert!(scene.warnings[0].contains("1 without vertex normals"), "{:?}", scene.warnings);
}

#[test]
fn grey_is_not_spoken_of_where_the_scene_gives_a_material() {
    let obj = format!("mtllib no.mtl\n{TRIANGLE}usemtl a\nf 1//1 2//1 3//1\n");
    let folder = folder(&[("a.obj", &obj)]);
    let said = |rest: &str| {
        let mesh = "[[material]]\nname = \"red\"\n[[mesh]]\nname = \"m\"\nfile = \"a.obj\"\n";
        let text = format!("{mesh}{rest}\n[environment]");
        Scene::parse(&folder.path().join("s.toml"), &text).unwrap().scene.warnings
    };
    let instance = "[[instance]]\nmesh = \"m\"\n";
    assert_eq!(said("material = \"red\""), Vec::<String>::new());
    assert_eq!(said(&format!("{instance}material = \"red\"")), Vec::<String>::new());
    let both = format!("{instance}material = \"red\"\n{instance}");
    for rest in ["", instance, &both] {
        assert!(said(rest).iter().any(|w| w.contains("grey is used") && w.contains("no.mtl")), "{rest}");
    }
}

#[test]
fn pictures_of_materials_that_the_scene_replaces_are_not_read() {
    let obj = format!("mtllib m.mtl\n{TRIANGLE}usemtl a\nf 1//1 2//1 3//1\n");
    let mtl = "newmtl a\nmap_Kd damaged.png\nmap_Bump damaged.png\n";
    let folder = folder(&[("a.obj", &obj), ("m.mtl", mtl), ("damaged.png", "no picture")]);
    let read = |rest: &str| {
        let worn = "[[material]]\nname = \"red\"\n[[mesh]]\nfile = \"a.obj\"\nmaterial = \"red\"\n";
        Scene::parse(&folder.path().join("s.toml"), &format!("{worn}{rest}\n[environment]"))
    };
    let scene = read("").unwrap().scene;
    assert_eq!((scene.textures.len(), scene.warnings.len()), (0, 0));
    assert_eq!(scene.names.materials[scene.triangles[0].material as usize], "red");
    // Another mesh wears them; and the vertices of one that moves are numbered from material to material.
    for rest in ["[[mesh]]\nfile = \"a.obj\"", "moving = true"] {
        assert!(read(rest).unwrap_err().to_string().contains("damaged.png"), "{rest}");
    }
}

#[test]
fn what_is_no_obj_is_an_error() {
    let folder = folder(&[
        ("empty.obj", ""),
        ("users.obj", "root:x:0:0:root:/root:/bin/sh\ndaemon:x:1:1::/:/bin/false\n"),
        ("corners.obj", TRIANGLE),
        ("flat.obj", "v 0 0 0\nv 1 0 0\nf 1 2 2\n"),
        ("s.toml", "[[mesh]]\nfile = \"empty.obj\"\n"),
        ("sky.toml", "[environment]\n"),
    ]);
    for name in ["empty.obj", "users.obj", "corners.obj", "flat.obj", "s.toml"] {
        let error = load(&folder, name).unwrap_err();
        assert_eq!(error.exit_code(), 3);
        assert!(error.to_string().contains("has no triangles"), "{error}");
    }
    assert!(load(&folder, "sky.toml").is_ok());
    let wide = |bytes: fn(u16) -> [u8; 2]| "\u{feff}f 1 2 3\n".encode_utf16().flat_map(bytes).collect::<Vec<_>>();
    for (name, bytes) in [("le.obj", wide(u16::to_le_bytes)), ("be.obj", wide(u16::to_be_bytes))] {
        std::fs::write(folder.path().join(name), bytes).unwrap();
        let error = load(&folder, name).unwrap_err().to_string();
        assert!(error.ends_with("line 1: the file is UTF-16 text: save it as UTF-8"), "{error}");
    }
    std::fs::write(folder.path().join("m.mtl"), wide(u16::to_le_bytes)).unwrap();
    std::fs::write(folder.path().join("m.obj"), format!("mtllib m.mtl\n{TRIANGLE}f 1//1 2//1 3//1")).unwrap();
    assert!(load(&folder, "m.obj").unwrap_err().to_string().ends_with("m.mtl: is UTF-16 text: save it as UTF-8"));
}

/// It is let go of after its last use, by whatever name.
#[test]
fn a_file_may_be_spelled_in_two_ways() {
    let mesh = |file: &str| format!("[[mesh]]\nfile = '{file}'\n");
    let folder = folder(&[("s.toml", &(mesh("sub\\a.obj") + &mesh("sub/a.obj") + &mesh("sub\\a.obj")))]);
    std::fs::create_dir(folder.path().join("sub")).unwrap();
    std::fs::write(folder.path().join("sub/a.obj"), format!("{TRIANGLE}f 1//1 2//1 3//1")).unwrap();
    assert_eq!(load(&folder, "s.toml").unwrap().triangles.len(), 3);
}

#[test]
fn lines_end_in_any_way() {
    let text = format!("# one\n\n{TRIANGLE}f 1//1 \\\n2//1 3//1\n");
    let wrong = format!("{text}f 1 2 9");
    for end in ["\n", "\r\n", "\r"] {
        let folder = folder(&[("a.obj", &text.replace('\n', end)), ("b.obj", &wrong.replace('\n', end))]);
        assert_eq!(load(&folder, "a.obj").unwrap().triangles.len(), 1, "{end:?}");
        let error = load(&folder, "b.obj").unwrap_err().to_string();
        assert!(error.contains("b.obj, line 9: the face uses vertex 9"), "{end:?}: {error}");
    }
}

#[test]
fn a_comb_and_a_disk_of_many_corners_load() {
    let mut points = vec![(0, -1), (4999, -1)];
    points.extend((0..2500).rev().flat_map(|i| [(2 * i + 1, 0), (2 * i + 1, 1), (2 * i, 1), (2 * i, 0)]));
    let corners: String = points.iter().map(|(x, y)| format!("v {x} {y} 0\n")).collect();
    let face: String = (1..=points.len()).map(|i| format!(" {i}")).collect();
    let folder = folder(&[("a.obj", &format!("{corners}f{face}\n"))]);
    let scene = load(&folder, "a.obj").unwrap();
    let corner = |t: &tallow::layout::Triangle| [t.v0, t.v1, t.v2].map(glam::Vec3::from);
    let area = |[a, b, c]: [glam::Vec3; 3]| f64::from((b - a).cross(c - a).length()) / 2.0;
    let found: f64 = scene.triangles.iter().map(|t| area(corner(t))).sum();
    assert!((found / 7499.0 - 1.0).abs() < 1e-5, "{found}");
}

#[test]
fn a_picture_is_kept_once_for_all_its_mappings() {
    let mtl: String = (1..9).map(|i| format!("newmtl m{i}\nmap_Kd -s {i} {i} {}a.png\n", "b/../".repeat(i))).collect();
    let worn: String = (1..9).map(|i| format!("usemtl m{i}\nf 1//1 2//1 3//1\n")).collect();
    let folder = folder(&[("m.mtl", &mtl), ("a.obj", &format!("mtllib m.mtl\n{TRIANGLE}{worn}"))]);
    std::fs::create_dir(folder.path().join("b")).unwrap();
    let picture = image::RgbImage::from_pixel(4, 2, image::Rgb([1, 2, 3]));
    picture.write_with_encoder(PngEncoder::new(File::create(folder.path().join("a.png")).unwrap())).unwrap();
    let scene = load(&folder, "a.obj").unwrap();
    assert_eq!((scene.textures.len(), scene.texels.len()), (8, 8));
    let scales: Vec<_> = scene.textures.iter().map(|t| (t.first, t.scale[0])).collect();
    assert_eq!(scales, (1..9).map(|i| (0, i as f32)).collect::<Vec<_>>());
}

#[test]
fn coordinates_reach_to_the_limit_and_no_further() {
    let scene = |at: &str, rest: &str| {
        let mesh = "[[mesh]]\nname = \"m\"\nshape = \"rectangle\"\n";
        let text = format!("{mesh}transform = {{ scale = {at} }}\n[environment]\n{rest}");
        Scene::parse(std::path::Path::new("s.toml"), &text)
    };
    assert!(scene("1e12", "[camera]\nposition = [0, 0, 1e12]\ntarget = [0, 0, 0]").is_ok());
    for (at, rest, what) in [
        ("1.1e12", "", "mesh \"m\": has a coordinate"),
        ("1", "[camera]\nposition = [0, 0, 1.1e12]\ntarget = [0, 0, 0]", "point [0, 0, 1100000000000] is"),
        ("1", "[camera]\nlens_radius = 1.1e12", "lens_radius"),
        ("1", "[[instance]]\nmesh = \"m\"\ntransform = { scale = 1.1e12 }", "instances: reach"),
        ("1e12", "[[instance]]\nmesh = \"m\"\ntransform = { translate = [1e11, 0, 0] }", "instances: reach"),
        (
            "1e4",
            "[[instance]]\nmesh = \"m\"\n[[instance]]\nmesh = \"m\"\ntransform = { scale = 9e-9, translate = [1, 0, 0] }",
            "seen from it",
        ),
        ("1", "[[light]]\ntype = \"point\"\nintensity = 1\nposition = [0, 0, 1.1e12]", "light 1: position"),
    ] {
        let error = scene(at, rest).unwrap_err();
        let says = |part: &str| error.to_string().contains(part);
        assert!(error.exit_code() == 3 && says(what) && says("1e12"), "{at} {rest}: {error}");
    }
}

#[test]
fn a_triangle_at_the_limit_is_hit() {
    let corners = "v -1e12 -1e12 -1e12\nv 1e12 -1e12 -1e12\nv 0 1e12 -1e12\nvn 0 0 1\nf 1//1 2//1 3//1\n";
    let text = "[film]\nwidth = 8\nheight = 8\n[render]\nspp = 1\n[environment]\n[[mesh]]\nfile = \"a.obj\"\n
        [camera]\nposition = [0, 0, 1e12]\ntarget = [0, 0, 0]";
    let folder = folder(&[("a.obj", corners), ("s.toml", text)]);
    let scene = load(&folder, "s.toml").unwrap();
    let gpu = support::gpu();
    let renderer =
        Renderer::new(&gpu, &scene, &scene.settings, Outputs { guides: true, ..Outputs::default() }).unwrap();
    let stats = support::render(&gpu, &renderer);
    assert!(stats.iter().all(|s| s.count == 1 && s.mean.iter().all(|v| v.is_finite())));
    let depths: Vec<_> = renderer.film().tiles[0].guide.read().unwrap().iter().map(|g| g.depth).collect();
    let twins: Vec<_> =
        (0..64).map(|p| guide(&scene, &frame_constants(&scene, &scene.settings).unwrap(), p).depth).collect();
    for found in [depths, twins] {
        let hits: Vec<_> = found.into_iter().filter(|&depth| depth > 0.0).collect();
        assert!(hits.len() >= 16 && hits.iter().all(|depth| (1.9e12..4e12).contains(depth)), "{hits:?}");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn without_memory_the_end_is_one_line() {
    let sphere = "[[mesh]]\nshape = \"sphere\"\nsegments = 4096\n[environment]\n";
    let lit = "[[material]]\nname = \"lamp\"\nemission = 1\n[[mesh]]\nname = \"m\"\nshape = \"sphere\"\nsegments = 256\nmaterial = \"lamp\"\n";
    let lamps = (0..4000).fold(lit.to_owned(), |text, _| text + "[[instance]]\nmesh = \"m\"\n");
    let pictures: String = (0..2).map(|i| format!("newmtl m{i}\nmap_Kd {i}.png\n")).collect();
    let mapped = format!("mtllib m.mtl\n{TRIANGLE}usemtl m0\nf 1//1 2//1 3//1\nusemtl m1\nf 1//1 2//1 3//1\n");
    let files = [
        ("sphere.toml", sphere),
        ("lamps.toml", &lamps),
        ("m.mtl", &pictures),
        ("mapped.obj", &mapped),
        ("bare.toml", "[environment]"),
    ];
    let folder = folder(&files);
    std::fs::write(folder.path().join("sky.toml"), "[environment]\nfile = \"sky.png\"\n").unwrap();
    let sky = image::GrayImage::new(16_384, 8192);
    sky.write_with_encoder(PngEncoder::new(File::create(folder.path().join("sky.png")).unwrap())).unwrap();
    for name in ["0.png", "1.png"] {
        let picture = image::GrayImage::new(8192, 4096);
        picture.write_with_encoder(PngEncoder::new(File::create(folder.path().join(name)).unwrap())).unwrap();
    }
    for name in ["sparse.toml", "sparse.obj", "sparse.mtl"] {
        File::create(folder.path().join(name)).unwrap().set_len(3 << 30).unwrap();
    }
    let head = "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
        element face 20000000\nproperty list uchar int vertex_indices\nend_header\n";
    std::fs::write(folder.path().join("sparse.ply"), head).unwrap();
    let ply = File::options().append(true).open(folder.path().join("sparse.ply")).unwrap();
    ply.set_len(1 << 28).unwrap();
    std::fs::write(folder.path().join("library.obj"), format!("mtllib sparse.mtl\n{mapped}")).unwrap();
    let fails = |scene: &str, kib: u32, parts: &[&str]| complains(&render(&folder, scene, kib, ""), 4, parts);
    fails("sphere.toml", 4_000_000, &["sphere.toml: 16769024 triangles: needs 6.2 GiB of memory, "]);
    fails("lamps.toml", 4_000_000, &["emissive triangles: needs "]);
    fails("mapped.obj", 700_000, &["textures of 67108864 texels: needs "]);
    fails("sky.toml", 1_500_000, &["sky.png: needs "]);
    fails("sparse.toml", 4_000_000, &["sparse.toml: needs 120.0 GiB of memory, "]);
    fails("library.obj", 4_000_000, &["sparse.mtl: needs 12.0 GiB of memory, "]);
    // Reading its faces would take less.
    fails("sparse.ply", 4_000_000, &["sparse.ply: 20000000 faces: needs 7.5 GiB of memory, "]);
    complains(&render(&folder, "sparse.obj", 4_000_000, ""), 3, &["sparse.obj, line 1: 64 MiB without a line feed"]);
    assert!(render(&folder, "mapped.obj", 4_000_000, "").status.success(), "control");
    // A driver that runs out of addresses ends the process.
    for kib in [300_000, 410_000, 470_000, 520_000, 560_000, 640_000, 720_000] {
        fails("bare.toml", kib, &["the limit of the address space (ulimit -v)"]);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn without_threads_the_callers_own_will_do() {
    let folder = folder(&[("s.toml", "[[mesh]]\nshape = \"sphere\"\n[environment]\n")]);
    let output = render(&folder, "s.toml", 4_000_000, "RUST_MIN_STACK=100000000000");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}
