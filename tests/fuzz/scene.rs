//! Damaged and random input: parsers return errors, they do not panic or hang. TALLOW_FUZZ sets the cases of each of
//! the eight targets (default 200; 125000 makes a million in all).
use image::ImageFormat;
use proptest::prelude::*;
use std::path::Path;
use tallow::image::{Film, Samples, WriteOptions};
use tallow::scene::Scene;

fn cases() -> ProptestConfig {
    let cases = std::env::var("TALLOW_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(200);
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

/// Loads `bytes` under `name` next to what else a scene needs, and checks that an error is one readable line.
fn feed(name: &str, bytes: &[u8], start: &str) {
    thread_local!(static DIR: tempfile::TempDir = tempfile::tempdir().expect("a temporary directory"));
    DIR.with(|dir| {
        let at = |file: &str| dir.path().join(file);
        std::fs::write(at("m.obj"), OBJ).expect("written");
        std::fs::write(at(name), bytes).expect("written");
        let outcome = match start {
            "m.obj" => Scene::load(&at("m.obj")),
            text => Scene::parse(&at("s.toml"), text),
        };
        if let Err(e) = outcome {
            assert!(!e.to_string().contains('\n') && !e.to_string().is_empty(), "{e}");
        }
    });
}

const OBJ: &str = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n";
const SKY: &str = "[environment]\nfile = \"sky.hdr\"\n";
const SKY_EXR: &str = "[environment]\nfile = \"sky.exr\"\n";
const PICTURE: &str = "[[material]]\nname = \"a\"\ncolor_texture = \"a.png\"\n";
const PHOTO: &str = "[[material]]\nname = \"a\"\ncolor_texture = \"a.jpg\"\n";

/// Words that mean something, so that random lines get past the first check.
fn words(vocabulary: &'static [&'static str]) -> impl Strategy<Value = String> {
    let word = prop_oneof![
        6 => prop::sample::select(vocabulary).prop_map(str::to_owned),
        3 => (-5i64..9).prop_map(|n| n.to_string()),
        1 => any::<f32>().prop_map(|v| v.to_string()),
        1 => any::<i64>().prop_map(|v| v.to_string()),
        1 => "[ -~]{0,6}",
    ];
    prop::collection::vec((word, prop::sample::select(&[" ", " ", "\n", "/", "\\\n", "\t"][..])), 0..60)
        .prop_map(|v| v.into_iter().flat_map(|(w, s)| [w, s.to_owned()]).collect())
}

const OBJ_WORDS: &[&str] = &[
    "\nv",
    "\nv 0 0 0\n",
    "\nv 1 2 3\n",
    "\nvt 0 1\n",
    "\nvn 0 0 1\n",
    "\nf",
    "\nf 1 2 3\n",
    "\nf 1/1 2/1 3/1",
    "\no",
    "\ng",
    "\nusemtl a\n",
    "\nmtllib m.mtl\n",
    "\nmtllib",
    "\nl 1 2",
    "nan",
    "inf",
    "1e38",
    "//",
    "#",
    "\nf -1 -2 -3",
];
const MTL_WORDS: &[&str] = &[
    "\nnewmtl a\n",
    "\nnewmtl",
    "\nKd",
    "\nKs",
    "\nKe",
    "\nTf",
    "\nNs",
    "\nNi",
    "\nd",
    "\nTr",
    "\nillum",
    "\nPr",
    "\nPm",
    "\nmap_Kd",
    "\nmap_Bump",
    "-bm",
    "-s",
    "-clamp on",
    "-o",
    "a.png",
    "nan",
    "inf",
    "..",
    "\nmap_d m.obj",
];
const TOML_WORDS: &[&str] = &[
    "\n[film]\n",
    "\n[camera]\n",
    "\n[render]\n",
    "\n[environment]\n",
    "\n[[mesh]]\n",
    "\n[[material]]\n",
    "\n[[light]]\n",
    "\n[[instance]]\n",
    "width",
    "fov",
    "shape = \"cube\"\n",
    "shape = \"sphere\"\n",
    "type = \"point\"\n",
    "name = \"a\"\n",
    "mesh = \"a\"\n",
    "material = \"a\"\n",
    "transform = {",
    "scale = ",
    "translate = [1,2,3]",
    "}",
    "[",
    "]",
    ",",
    "=",
    "position = [0, 1, 2]\n",
    "intensity = 1\n",
    "emission = 3\n",
    "radiance = 1\n",
    "nan",
    "inf",
    "1e38",
    "\"",
    "rotate = ",
];

fn small_png() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let picture = image::RgbaImage::from_fn(9, 7, |x, y| image::Rgba([x as u8 * 20, y as u8 * 30, 5, 200]));
    picture.write_to(&mut bytes, ImageFormat::Png).expect("encoded");
    bytes.into_inner()
}

fn small(format: ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let picture = image::RgbImage::from_fn(9, 7, |x, y| image::Rgb([x as u8 * 20, y as u8 * 30, 5]));
    picture.write_to(&mut bytes, format).expect("encoded");
    bytes.into_inner()
}

fn small_exr() -> Vec<u8> {
    let mut film = Film::new(16, 4);
    film.add("Y", Samples::F32((0..64).map(|i| i as f32).collect()));
    let folder = tempfile::tempdir().expect("a temporary directory");
    let path = folder.path().join("sky.exr");
    tallow::image::write(&path, &film, &WriteOptions::default()).expect("written");
    std::fs::read(path).expect("read")
}

fn small_hdr() -> Vec<u8> {
    let mut bytes = Vec::new();
    let pixels: Vec<_> = (0..64).map(|i| image::Rgb([i as f32, 1.0, 0.5])).collect();
    image::codecs::hdr::HdrEncoder::new(&mut bytes).encode(&pixels, 16, 4).expect("encoded");
    bytes
}

/// A valid file with some bytes changed and its end cut off.
fn damaged(whole: Vec<u8>) -> impl Strategy<Value = Vec<u8>> {
    let n = whole.len();
    (prop::collection::vec((0..n, any::<u8>()), 0..6), 0..=n).prop_map(move |(changes, keep)| {
        let mut bytes = whole.clone();
        changes.iter().for_each(|&(at, value)| bytes[at] = value);
        bytes.truncate(keep);
        bytes
    })
}

proptest! {
    #![proptest_config(cases())]

    #[test]
    fn obj(text in words(OBJ_WORDS)) {
        feed("m.obj", text.as_bytes(), "m.obj");
    }

    #[test]
    fn mtl(text in words(MTL_WORDS)) {
        feed("m.mtl", format!("newmtl a\n{text}").as_bytes(), "m.obj");
    }

    #[test]
    fn toml(text in words(TOML_WORDS)) {
        feed("m.mtl", b"", &text);
    }

    #[test]
    fn bytes(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        feed("m.obj", &bytes, "m.obj");
    }

    #[test]
    fn png(bytes in damaged(small_png())) {
        feed("a.png", &bytes, PICTURE);
    }

    #[test]
    fn jpeg(bytes in damaged(small(ImageFormat::Jpeg))) {
        feed("a.jpg", &bytes, PHOTO);
    }

    // Told by what they hold, whatever their name.
    #[test]
    fn tga(bytes in damaged(small(ImageFormat::Tga))) {
        feed("a.jpg", &bytes, PHOTO);
    }

    #[test]
    fn bmp(bytes in damaged(small(ImageFormat::Bmp))) {
        feed("a.jpg", &bytes, PHOTO);
    }

    #[test]
    fn hdr(bytes in damaged(small_hdr())) {
        feed("sky.hdr", &bytes, SKY);
    }

    #[test]
    fn exr(bytes in damaged(small_exr())) {
        feed("sky.exr", &bytes, SKY_EXR);
    }
}

#[test]
fn the_undamaged_files_load() {
    let dir = tempfile::tempdir().unwrap();
    let save = |name: &str, bytes| std::fs::write(dir.path().join(name), bytes).unwrap();
    save("a.png", small_png());
    save("a.jpg", small(ImageFormat::Jpeg));
    save("sky.hdr", small_hdr());
    save("sky.exr", small_exr());
    let load = |text: &str| Scene::parse(&Path::new(dir.path()).join("s.toml"), text).unwrap();
    assert_eq!([PICTURE, PHOTO].map(|text| load(text).textures.len()), [1, 1]);
    for text in [SKY, SKY_EXR] {
        let sky = load(text).scene.environment.unwrap();
        assert_eq!((sky.width, sky.height, sky.table.len()), (16, 4, 64));
        assert!((sky.texels.iter().map(|t| t[3]).sum::<f32>() - 1.0).abs() < 1e-5);
    }
}
