//! Tests `tallow filter` through the built program: the image, the printed text, and the input that it refuses.
use crate::command::{complains, stdout, tallow};
use tallow::image::{self, Film, Samples, WriteOptions};
use tempfile::TempDir;

const SIZE: u32 = 32;

/// A plane facing the camera. Its albedo is a checkerboard of single pixels, 0.2 and 0.8; the light that falls on it is
/// 1 with noise of standard deviation 0.29; `direct` is another checkerboard, of 2x2 pixels.
fn noisy(is_tallow_s: bool) -> Film {
    let mut film = Film::new(SIZE, SIZE);
    let pixels: Vec<(u32, u32)> = (0..SIZE * SIZE).map(|i| (i % SIZE, i / SIZE)).collect();
    let each = |value: &dyn Fn(u32, u32) -> f32| pixels.iter().map(|&(x, y)| [value(x, y); 3]).collect::<Vec<_>>();
    let light = |x, y| 0.5 + random(x, y);
    let direct = |x, y| if is_tallow_s { ((x / 2 + y / 2) % 2) as f32 } else { 0.0 };
    film.add_vec3("", ["R", "G", "B"], &each(&|x, y| direct(x, y) + checker(x, y) * light(x, y)));
    film.add_vec3("albedo", ["R", "G", "B"], &each(&checker));
    film.add_vec3("N", ["X", "Y", "Z"], &vec![[0.0, 0.0, 1.0]; pixels.len()]);
    film.add("Z", Samples::F32(vec![5.0; pixels.len()]));
    if is_tallow_s {
        film.metadata.insert("software".to_owned(), "tallow 0.1.0".to_owned());
        film.add_vec3("direct", ["R", "G", "B"], &each(&direct));
        film.add_vec3("indirect", ["R", "G", "B"], &each(&light));
    }
    film
}

fn checker(x: u32, y: u32) -> f32 {
    if (x + y).is_multiple_of(2) { 0.2 } else { 0.8 }
}

/// A number in [0, 1) that depends on the pixel.
fn random(x: u32, y: u32) -> f32 {
    let h = (x * 7919 + y * 104_729).wrapping_mul(0x9e37_79b9);
    ((h ^ (h >> 15)).wrapping_mul(0x85eb_ca6b) >> 8) as f32 / (1 << 24) as f32
}

fn write(folder: &TempDir, name: &str, film: &Film) {
    image::write(&folder.path().join(name), film, &WriteOptions::default()).unwrap();
}

/// Parts of so many pixels square with so many channels.
fn write_parts(folder: &TempDir, name: &str, parts: [(usize, &str, &[&str]); 2]) {
    use exr::prelude::*;
    let part = |(size, name, channels): (usize, &str, &[&str])| {
        let plane = |c: &&str| AnyChannel::new(*c, FlatSamples::F32(vec![0.5; size * size]));
        let planes = AnyChannels::sort(channels.iter().map(plane).collect());
        Layer::new((size, size), LayerAttributes::named(name), Encoding::FAST_LOSSLESS, planes)
    };
    let image = Image::from_layers(ImageAttributes::with_size((parts[0].0, parts[0].0)), parts.map(part).to_vec());
    image.write().to_file(folder.path().join(name)).unwrap();
}

fn read(folder: &TempDir, name: &str) -> Film {
    image::read(&folder.path().join(name)).unwrap()
}

/// Renders the scene to `noisy.exr`.
fn render(folder: &TempDir, scene: &str, spp: &str) {
    let size = SIZE.to_string();
    let words = ["render", scene, "-o", "noisy.exr", "--width", &size, "--height", &size, "--spp", spp, "--quiet"];
    assert_eq!(tallow(folder, &words).status.code(), Some(0));
}

/// Filters `noisy.exr` to `clean.exr` under the validation layers.
fn filter(folder: &TempDir, options: &[&str]) -> Film {
    let words = [&["filter", "noisy.exr", "-o", "clean.exr", "--validation", "--quiet"], options].concat();
    let output = tallow(folder, &words);
    assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]));
    assert_eq!(stdout(&output), "");
    read(folder, "clean.exr")
}

/// Root mean square distance of the red channel from `expected`, over the pixels 4 or more from the border.
fn error(film: &Film, expected: impl Fn(u32, u32) -> f32) -> f32 {
    let red = film.channel("R").unwrap().to_f32();
    let inner = 4..SIZE - 4;
    let square = |(x, y): (u32, u32)| (red[(y * SIZE + x) as usize] - expected(x, y)).powi(2);
    let sum: f32 = inner.clone().flat_map(|y| inner.clone().map(move |x| (x, y))).map(square).sum();
    (sum / (inner.len() * inner.len()) as f32).sqrt()
}

#[test]
fn textures_stay_sharp_while_noise_goes() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder, "noisy.exr", &noisy(false));
    let before = error(&noisy(false), checker);
    let after = error(&filter(&folder, &["--filter", "atrous"]), checker);
    assert!(after < 0.3 * before, "{before} {after}");
    // Control: without demodulation the checkerboard fades towards grey, 0.3 off everywhere.
    let plain = error(&filter(&folder, &["--filter", "atrous", "--no-demodulate"]), checker);
    assert!(plain > 4.0 * after, "{plain} {after}");
}

#[test]
fn direct_light_of_our_own_files_stays_as_it_is_and_other_layers_too() {
    let folder = tempfile::tempdir().unwrap();
    let film = noisy(true);
    write(&folder, "noisy.exr", &film);
    let lit = |x, y| ((x / 2 + y / 2) % 2) as f32 + checker(x, y);
    let (before, clean) = (error(&film, lit), filter(&folder, &["--filter", "atrous"]));
    let after = error(&clean, lit);
    assert!(after < 0.3 * before, "{before} {after}");
    for channel in film.channels.iter().filter(|c| c.name.len() > 1 || c.name == "Z") {
        assert_eq!(clean.channel(&channel.name), Some(&channel.samples), "{}", channel.name);
    }
    let mut metadata = film.metadata.clone();
    metadata.insert("filtered".to_owned(), "atrous".to_owned());
    assert_eq!(clean.metadata, metadata);
    assert!(error(&filter(&folder, &["--filter", "atrous", "--light", "all"]), lit) > 0.2);
    // Without lights whose shadows are sharp, all light is filtered unless the user says otherwise.
    let mut soft = film.clone();
    soft.metadata.insert("sharpDirect".to_owned(), "false".to_owned());
    write(&folder, "noisy.exr", &soft);
    assert!(error(&filter(&folder, &["--filter", "atrous"]), lit) > 0.2);
    assert!(error(&filter(&folder, &["--filter", "atrous", "--light", "indirect"]), lit) < 0.3 * before);
    // Control: taken for a file of another renderer, direct light is filtered along.
    let mut foreign = film.clone();
    foreign.metadata.clear();
    write(&folder, "noisy.exr", &foreign);
    assert!(error(&filter(&folder, &["--filter", "atrous"]), lit) > 0.2);
}

/// Direct light of 1.5 and 2.5 in 2x2 squares, before the albedo; a fifth of the pixels has no sample.
#[test]
fn pixels_without_samples_take_direct_light_from_the_others_which_keep_theirs() {
    let folder = tempfile::tempdir().unwrap();
    let mut film = noisy(true);
    let pixels = || (0..SIZE * SIZE).map(|i| (i % SIZE, i / SIZE));
    let unsampled = |x: u32, y: u32| (x + 2 * y).is_multiple_of(5);
    let direct = |x: u32, y: u32| checker(x, y) * (1.5 + ((x / 2 + y / 2) % 2) as f32);
    let indirect = film.channel("indirect.R").unwrap().to_f32().into_owned();
    for channel in film.channels.iter_mut().filter(|c| c.name.len() == 1 && c.name != "Z" || c.name.contains("direct"))
    {
        let value = |(i, (x, y)): (usize, (u32, u32))| match channel.name.as_str() {
            _ if unsampled(x, y) => 0.0,
            name if name.starts_with("indirect") => indirect[i],
            name if name.starts_with("direct") => direct(x, y),
            _ => direct(x, y) + checker(x, y) * indirect[i],
        };
        channel.samples = Samples::F32(pixels().enumerate().map(value).collect());
    }
    film.add("samples", Samples::U32(pixels().map(|(x, y)| if unsampled(x, y) { 0 } else { 4 }).collect()));
    write(&folder, "noisy.exr", &film);
    let clean = filter(&folder, &["--filter", "atrous"]).channel("R").unwrap().to_f32().into_owned();
    for (i, (x, y)) in pixels().enumerate() {
        let lit = clean[i] / checker(x, y);
        let [low, high] = match unsampled(x, y) {
            true => [1.6 + 0.7, 2.4 + 1.3],
            false => [direct(x, y) / checker(x, y) + 0.7, direct(x, y) / checker(x, y) + 1.3],
        };
        assert!((low..high).contains(&lit), "pixel {x} {y}: {lit}, not within {low} and {high}");
    }
    let text = stdout(&tallow(&folder, &["filter", "noisy.exr", "-o", "clean.exr"]));
    assert!(text.contains("direct light of pixels without a sample"), "{text}");
}

#[test]
fn layers_of_any_name_are_taken_when_named() {
    let folder = tempfile::tempdir().unwrap();
    let mut film = noisy(false);
    for channel in &mut film.channels {
        channel.name = channel.name.replace("albedo.", "paint.").replace("N.", "bent.");
    }
    write(&folder, "noisy.exr", &film);
    let found = error(&filter(&folder, &["--filter", "atrous", "--albedo", "paint", "--normal", "bent"]), checker);
    let missed = error(&filter(&folder, &["--filter", "atrous"]), checker);
    assert!(missed > 4.0 * found && found < 0.1, "{found}; not named: {missed}");
}

/// What a mirror shows is filtered by what is seen in it: noise goes, edges stay.
#[test]
fn a_named_layer_is_what_other_formats_hold() {
    let folder = tempfile::tempdir().unwrap();
    let mut film = noisy(false);
    let pixels = film.picture(None).unwrap().pixels;
    film.channels.retain(|channel| !["R", "G", "B"].contains(&channel.name.as_str()));
    film.add_vec3("spec", ["R", "G", "B"], &pixels);
    film.add_vec3("diff", ["R", "G", "B"], &[[0.5, 0.0, 0.0]; (SIZE * SIZE) as usize]);
    write(&folder, "noisy.exr", &film);
    let filtered = filter(&folder, &["--filter", "atrous", "--colour", "spec", "-o", "clean.hdr"]);
    let [exr, hdr] = [(filtered, Some("spec")), (read(&folder, "clean.hdr"), None)]
        .map(|(film, layer)| film.picture(layer).unwrap().pixels.concat());
    assert!(exr != pixels.concat() && exr.iter().zip(&hdr).all(|(a, b)| (a - b).abs() < 0.01));
}

#[test]
fn images_without_negative_light_are_filtered_without() {
    let folder = tempfile::tempdir().unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/veach-mis/scene.toml");
    let size = ["--width", "96", "--height", "64", "--spp", "1", "--max-depth", "4"];
    let words = ["render", scene, "--quiet", "--denoise", "auto", "-o", "a.exr"];
    assert_eq!(tallow(&folder, &[&words[..], &size].concat()).status.code(), Some(0));
    let film = read(&folder, "a.exr");
    for layer in [None, Some("Noisy Image")] {
        let least = film.picture(layer).unwrap().pixels.concat().into_iter().fold(f32::INFINITY, f32::min);
        assert!(least >= 0.0, "{layer:?}: {least}");
    }
}

/// Light is looked up through the camera that the image was rendered through.
#[test]
fn a_view_of_a_gltf_file_is_that_of_its_image() {
    let folder = tempfile::tempdir().unwrap();
    let gltf = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1, 2]}], "nodes": [{"mesh": 0},
        {"name": "near", "camera": 0, "translation": [0.3, 0.3, 2]}, {"name": "far", "camera": 0, "translation": [0.3, 0.3, 4]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}], "buffers": [{"byteLength": 36,
        "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}"#;
    std::fs::write(folder.path().join("two.gltf"), gltf).unwrap();
    for camera in ["near", "far"] {
        let words = ["render", "two.gltf", "--camera", camera, "-o", "noisy.exr", "--spp", "2", "--quiet"];
        let output = tallow(&folder, &[&words[..], &["--width", "16", "--height", "16"]].concat());
        assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]));
        filter(&folder, &["--filter", "none", "--scene", "two.gltf"]);
    }
}

#[test]
fn mirrors_stay_sharp() {
    let folder = tempfile::tempdir().unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/mirror.toml");
    render(&folder, scene, "256");
    let reference = read(&folder, "noisy.exr").picture(None).unwrap().pixels;
    let filtered = || filter(&folder, &["--filter", "atrous", "--light", "indirect"]);
    let off = |film: &Film, [columns, rows]: [std::ops::Range<usize>; 2]| {
        let pixels = film.picture(None).unwrap().pixels;
        let inside = |i: &usize| columns.contains(&(i % 32)) && rows.contains(&(i / 32));
        let off = |i: usize| pixels[i].iter().zip(reference[i]).map(|(a, b)| (a - b).powi(2)).sum::<f32>();
        (0..pixels.len()).filter(inside).map(off).sum::<f32>()
    };
    render(&folder, scene, "2");
    // The front of the tall box, without its edges.
    let [before, after] = [read(&folder, "noisy.exr"), filtered()].map(|film| off(&film, [10..15, 16..24]));
    assert!(after < 0.7 * before, "squared error {before} before, {after} after");
    render(&folder, scene, "8");
    let clean = filtered();
    // Control: where nothing tells what is seen in it, the mirror guides, which is the same all over.
    let mut blind = read(&folder, "noisy.exr");
    blind.channels.retain(|channel| !channel.name.starts_with("denoising "));
    write(&folder, "noisy.exr", &blind);
    let [sharp, blurred] = [clean, filtered()].map(|film| off(&film, [9..16, 14..27]));
    assert!(sharp < 0.8 * blurred, "squared error {sharp}, and {blurred} if the mirror guides");
}

#[test]
fn the_filter_none_returns_every_kind_of_image() {
    let folder = tempfile::tempdir().unwrap();
    for film in [noisy(true), noisy(false)] {
        write(&folder, "noisy.exr", &film);
        assert!(film.picture(None) == filter(&folder, &["--filter", "none"]).picture(None));
    }
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");
    render(&folder, scene, "2");
    let size = ["--width", "32", "--height", "32"];
    let words = [&["render", scene, "--denoise", "none", "--spp", "2", "-o", "none.exr"], &size[..]].concat();
    assert!(tallow(&folder, &words).status.success());
    let channels = |name: &str| read(&folder, name).channels;
    assert!(channels("none.exr") == channels("noisy.exr"), "no layer of a noisy image beside it");
    // Nor has a file that was filtered by none, unless something was cut or filled in.
    let same = filter(&folder, &["--filter", "none"]);
    assert!(same.channels == channels("noisy.exr") && !same.metadata.contains_key("filtered"));
    let mut film = Film::new(2, 1);
    film.add("Y", Samples::F32(vec![1.3e38, 0.7]));
    write(&folder, "noisy.exr", &film);
    assert!(filter(&folder, &["--filter", "none"]).channels == film.channels, "a mean would round, or overflow");
    let mut film = noisy(false);
    let marks = |film: &Film, words: &[&str]| {
        write(&folder, "noisy.exr", film);
        let clean = filter(&folder, &[&["--filter", "none"], words].concat());
        (clean.metadata.contains_key("filtered"), clean.channel("Noisy Image.R").is_some())
    };
    assert_eq!((marks(&film, &[]), marks(&film, &["--fireflies", "1e6"])), ((false, false), (false, false)));
    assert_eq!(marks(&film, &["--fireflies", "1"]), (true, true));
    film.channels[0].samples = Samples::F32([&[f32::NAN][..], &[1.0; 1023]].concat());
    assert_eq!(marks(&film, &[]), (true, true));
}

/// Devices on the processor filter no edge that is longer than 60,000 pixels.
#[test]
fn an_image_that_is_too_large_for_filters_can_be_left_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let mut wide = Film::new(60_001, 1);
    wide.add_vec3("", ["R", "G", "B"], &[[0.1, f32::NAN, 0.3], [0.7; 3], [1.1; 3]].repeat(20_001)[..60_001]);
    write(&folder, "noisy.exr", &wide);
    let pixels = filter(&folder, &["--filter", "none", "--light", "all"]).picture(None).unwrap().pixels;
    assert!(pixels.chunks(3).all(|three| three == &[[0.0; 3], [0.7; 3], [1.1; 3]][..three.len()]));
    let device = tallow::gpu::Gpu::open(&Default::default()).unwrap();
    for words in [&["--filter", "atrous"][..], &["--filter", "none", "--fireflies", "9"]] {
        let output = tallow(&folder, &[&["filter", "noisy.exr", "-o", "b.exr"], words].concat());
        let fits = device.info().kind != tallow::gpu::DeviceKind::Cpu;
        assert_eq!(output.status.code(), Some(if fits { 0 } else { 4 }), "{output:?}");
    }
}

#[test]
fn broken_pixels_are_filled_in_from_their_neighbours() {
    let folder = tempfile::tempdir().unwrap();
    let mut film = noisy(false);
    if let Samples::F32(red) = &mut film.channels[0].samples {
        red[(16 * SIZE + 16) as usize] = f32::NAN;
    }
    write(&folder, "noisy.exr", &film);
    let after = error(&filter(&folder, &["--filter", "atrous"]), checker);
    assert!(after < 0.1, "{after}");
    let run = || tallow(&folder, &["filter", "noisy.exr", "-o", "clean.exr"]);
    let said = stdout(&run());
    assert!(said.contains("colour: NaN or infinite in 1 of 1024 pixels"), "{said}");
    film.channels[0].samples = Samples::F32(vec![f32::INFINITY; film.pixels()]);
    write(&folder, "noisy.exr", &film);
    complains(&run(), 3, &["noisy.exr", "NaN or infinity in each of its 1024 pixels"]);
}

#[test]
fn fireflies_are_cut_and_it_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let mut film = noisy(false);
    let at = (16 * SIZE + 16) as usize;
    for channel in &mut film.channels[..3] {
        let Samples::F32(values) = &mut channel.samples else { continue };
        values[at] = 400.0;
    }
    let off_by = |options: &[&str]| error(&filter(&folder, &[&["--filter", "atrous"], options].concat()), checker);
    let said = |name: &str, options: &[&str]| {
        let words = [&["filter", "noisy.exr", "-o", "clean.exr", "--filter", name], options].concat();
        stdout(&tallow(&folder, &words)).contains("fireflies: 1 pixels cut")
    };
    // Nothing tells whether one sample has brought it.
    write(&folder, "noisy.exr", &film);
    let (cut, kept) = (off_by(&[]), off_by(&["--fireflies", "off"]));
    assert!(cut < 0.1 && kept > 2.0 * cut, "{kept} {cut}");
    assert!(said("atrous", &[]) && said("none", &["--fireflies", "2"]) && !said("none", &[]));
    // One of sixteen samples has: the variance of their mean is its square.
    let mut variance = vec![[0.005; 3]; (SIZE * SIZE) as usize];
    variance[at] = [400.0 * 400.0; 3];
    film.add_vec3("variance", ["R", "G", "B"], &variance);
    film.add("samples", Samples::F32(vec![16.0; variance.len()]));
    write(&folder, "noisy.exr", &film);
    let (cut, kept) = (off_by(&[]), off_by(&["--fireflies", "off"]));
    assert!(cut < 0.1 && kept > 2.0 * cut, "{kept} {cut}");
    assert!(said("atrous", &[]) && !said("atrous", &["--fireflies", "off"]) && !said("none", &[]));
    let refused = tallow(&folder, &["filter", "noisy.exr", "-o", "clean.exr", "--fireflies", "0.5"]);
    complains(&refused, 2, &["--fireflies", "off, or a number of at least 1"]);
}

#[test]
fn files_of_earlier_versions_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let said = || {
        let output = tallow(&folder, &["filter", "noisy.exr", "-o", "clean.exr", "--filter", "none"]);
        stdout(&output).contains("an earlier version of tallow")
    };
    write(&folder, "noisy.exr", &noisy(true));
    assert!(said(), "it does not tell what its albedo is");
    write(&folder, "noisy.exr", &noisy(false));
    assert!(!said(), "of another renderer");
    render(&folder, concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml"), "2");
    assert!(!said(), "of this version");
}

#[test]
fn lamps_do_not_leak_through_their_rims() {
    let folder = tempfile::tempdir().unwrap();
    let mut film = noisy(false);
    // A lamp of radiance 50 without albedo, in the middle; the pixel beside it shows it by nine tenths.
    let lamp = |i: u32| (12..20).contains(&(i % SIZE)) && (12..20).contains(&(i / SIZE));
    let rim = 15 * SIZE + 20;
    for channel in film.channels.iter_mut().filter(|c| ["R", "G", "B"].iter().any(|n| c.name.ends_with(n))) {
        let Samples::F32(values) = &mut channel.samples else { continue };
        let (own, part) = if channel.name.starts_with("albedo") { (0.0, 0.1) } else { (50.0, 45.0) };
        (0..SIZE * SIZE).filter(|&i| lamp(i)).for_each(|i| values[i as usize] = own);
        values[rim as usize] = part;
    }
    write(&folder, "noisy.exr", &film);
    let expected = |x, y| match y * SIZE + x {
        i if lamp(i) => 50.0,
        i if i == rim => 45.0,
        _ => checker(x, y),
    };
    let after = error(&filter(&folder, &["--filter", "atrous"]), expected);
    assert!(after < 0.06, "{after}");
}

#[test]
fn a_reference_gives_metrics_before_and_after() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder, "noisy.exr", &noisy(false));
    let mut clean = Film::new(SIZE, SIZE);
    clean.add_vec3(
        "",
        ["R", "G", "B"],
        &(0..SIZE * SIZE).map(|i| [checker(i % SIZE, i / SIZE); 3]).collect::<Vec<_>>(),
    );
    write(&folder, "reference.exr", &clean);
    let run = |options: &[&str]| {
        let words = ["filter", "noisy.exr", "--filter", "atrous", "-o", "a.exr", "-o", "a.png", "--reference"];
        stdout(&tallow(&folder, &[&words[..], &["reference.exr"], options].concat()))
    };
    let json: serde_json::Value = serde_json::from_str(&run(&["--json"])).unwrap();
    let mse = |when: &str| json[when]["mse"].as_f64().unwrap();
    assert!(mse("after") < 0.1 * mse("before"), "{json}");
    let passes: Vec<_> = json["passes"].as_array().unwrap().iter().map(|pass| pass["pass"].as_str().unwrap()).collect();
    assert_eq!(passes, ["demodulate", "firefly", "pack", "atrous", "remodulate"], "{json}");
    let compared = stdout(&tallow(&folder, &["compare", "a.exr", "reference.exr", "--json"]));
    let compared: serde_json::Value = serde_json::from_str(&compared).unwrap();
    assert_eq!(compared["metrics"]["mse"], json["after"]["mse"], "what is printed is what is written");
    // Of a file that was filtered before, the noisy image is what is filtered and compared, by its name as well; without a filter the
    // colour stays.
    let filtered = read(&folder, "a.exr");
    for (when, words) in [
        ("after", &["--filter", "none"][..]),
        ("after", &["--filter", "none", "--colour", "RGB"]),
        ("before", &["--filter", "none", "--colour", "Noisy Image"]),
        ("after", &["--filter", "atrous"]),
    ] {
        let again = ["filter", "a.exr", "-o", "b.exr", "-o", "b.png", "--reference", "reference.exr", "--json"];
        let again = stdout(&tallow(&folder, &[&again[..], words].concat()));
        let again: serde_json::Value = serde_json::from_str(&again).unwrap();
        let before = if words.contains(&"RGB") { "after" } else { "before" };
        assert_eq!(again["before"]["mse"], json[before]["mse"], "{words:?}");
        assert_eq!(again["after"]["mse"], json[when]["mse"], "{words:?}");
        let now = read(&folder, "b.exr");
        let layer = if when == "after" { None } else { Some("Noisy Image") };
        assert!(now.picture(None) == filtered.picture(layer), "{words:?}");
        let filter = (when == "after").then_some("atrous");
        assert_eq!(now.metadata.get("filtered").map(String::as_str), filter, "{words:?}");
    }
    let text = run(&[]);
    let expected =
        ["albedo: albedo.R albedo.G albedo.B", "variance: not there", "position: made of the depth", "median ms"];
    assert!(expected.iter().all(|part| text.contains(part)), "{text}");
    assert_eq!(read(&folder, "a.png").width, SIZE);
}

#[test]
fn what_cannot_be_filtered_is_told_in_one_line() {
    let folder = tempfile::tempdir().unwrap();
    write(&folder, "noisy.exr", &noisy(false));
    let run = |words: &[&str]| tallow(&folder, &[&["filter"], words].concat());
    complains(&run(&["noisy.exr"]), 2, &["--output"]);
    complains(&run(&["noisy.exr", "-o", "a.tif"]), 2, &["a.tif", ".exr"]);
    complains(&run(&["noisy.exr", "-o", "a.exr", "--filter", "median"]), 2, &["'median'", "atrous"]);
    complains(&run(&["noisy.exr", "-o", "a.exr", "--filter", "atrous", "--levels", "11"]), 2, &["levels", "11"]);
    complains(&run(&["noisy.exr", "-o", "a.exr", "--device", "no such"]), 4, &["no such"]);
    complains(&run(&["noisy.exr", "-o", "missing/a.exr"]), 5, &["missing", "create it"]);
    complains(&run(&["missing.exr", "-o", "a.exr"]), 3, &["missing.exr"]);
    complains(&run(&["noisy.exr", "-o", "a.exr", "--normal", "bump"]), 3, &["noisy.exr", "normal", "\"bump\"", "N.X"]);
    complains(&run(&["noisy.exr", "-o", "a.exr", "--colour", "beauty"]), 3, &["noisy.exr", "\"beauty\"", "N.X"]);
    let mut guides = Film::new(SIZE, SIZE);
    guides.add_vec3("N", ["X", "Y", "Z"], &vec![[0.0; 3]; guides.pixels()]);
    write(&folder, "guides.exr", &guides);
    complains(&run(&["guides.exr", "-o", "a.exr"]), 3, &["guides.exr", "no colour", "N.X"]);
    write_parts(&folder, "parts.exr", [(8, "rgba", &["R", "G", "B"]), (4, "albedo", &["R", "G", "B"])]);
    complains(&run(&["parts.exr", "-o", "a.exr"]), 3, &["parts.exr", "albedo", "4x4", "8x8", "at one size"]);
    let whole = std::fs::read(folder.path().join("noisy.exr")).unwrap();
    std::fs::write(folder.path().join("cut.exr"), &whole[..whole.len() / 2]).unwrap();
    complains(&run(&["cut.exr", "-o", "a.exr"]), 3, &["cut.exr", "complete?"]);
    let mut small = Film::new(8, 8);
    small.add_vec3("", ["R", "G", "B"], &[[0.5; 3]; 64]);
    write(&folder, "small.exr", &small);
    complains(&run(&["noisy.exr", "-o", "a.exr", "--reference", "small.exr"]), 3, &["32x32", "8x8"]);
    assert!(!folder.path().join("a.exr").exists(), "nothing is written");
}

/// Direct light stays, and indirect light is that of the render, noise and edges apart.
#[test]
fn filtered_light_is_looked_up_in_the_scene() {
    let folder = tempfile::tempdir().unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");
    render(&folder, scene, "64");
    let before = read(&folder, "noisy.exr").channel("R").unwrap().to_f32().into_owned();
    let looked_up = filter(&folder, &["--filter", "atrous", "--scene", scene, "--eye-rays", "8"]);
    let plain = filter(&folder, &["--filter", "atrous"]);
    let distance = |film: &Film| {
        let after = film.channel("R").unwrap().to_f32();
        before.iter().zip(after.iter()).map(|(a, b)| (a - b).abs()).sum::<f32>() / before.iter().sum::<f32>()
    };
    assert!(distance(&looked_up) < 0.05, "{}", distance(&looked_up));
    assert_ne!(looked_up.channel("R").unwrap().to_f32(), plain.channel("R").unwrap().to_f32(), "control");

    let run = |words: &[&str]| tallow(&folder, &[&["filter", "-o", "clean.exr"], words].concat());
    complains(&run(&["noisy.exr", "--scene", "no.toml"]), 3, &["no.toml"]);
    assert_eq!(run(&["noisy.exr", "--eye-rays", "4"]).status.code(), Some(2));
    assert_eq!(run(&["noisy.exr", "--scene", scene, "--no-demodulate"]).status.code(), Some(2));
    let other = scene.replace("scene.toml", "mirror.toml");
    complains(&run(&["noisy.exr", "--scene", &other]), 3, &["noisy.exr", "another scene"]);
    write(&folder, "foreign.exr", &noisy(true));
    complains(&run(&["foreign.exr", "--scene", scene]), 3, &["foreign.exr", "tallow render"]);
}

#[test]
fn a_denoised_render_is_the_filtered_file_and_keeps_its_samples() {
    let folder = tempfile::tempdir().unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");
    let size = SIZE.to_string();
    let render = |name: &str, more: &[&str]| {
        let words = ["render", scene, "-o", name, "--width", &size, "--height", &size, "--quiet", "--validation"];
        let output = tallow(&folder, &[&words, more].concat());
        assert_eq!((output.status.code(), output.stderr.as_slice()), (Some(0), &b""[..]));
        read(&folder, name)
    };
    let layer = |film: &Film, name: Option<&str>| film.picture(name).unwrap().pixels;
    let noisy = render("noisy.exr", &["--spp", "4"]);
    let filtered = filter(&folder, &["--filter", "guided"]);
    let denoised = render("denoised.exr", &["--spp", "4", "--denoise", "guided"]);
    assert_eq!(layer(&denoised, None), layer(&filtered, None));
    assert_eq!(layer(&denoised, Some("Noisy Image")), layer(&noisy, None));
    assert_ne!(layer(&denoised, None), layer(&noisy, None), "control");

    // Resumed and merged, it is the render that it was.
    let resumed = render("resumed.exr", &["--spp", "8", "--resume", "denoised.exr"]);
    assert_eq!(layer(&resumed, None), layer(&render("whole.exr", &["--spp", "8"]), None));
    render("rest.exr", &["--spp", "4", "--first-sample", "4"]);
    let merged = ["noisy", "denoised"].map(|name| {
        let words = ["merge", &format!("{name}.exr"), "rest.exr", "-o", "merged.exr"];
        assert_eq!(tallow(&folder, &words).status.code(), Some(0));
        read(&folder, "merged.exr")
    });
    assert_eq!(layer(&merged[0], None), layer(&merged[1], None));
    assert!(merged[1].picture(Some("Noisy Image")).is_err(), "nothing is left of the filter");
    // Filtered again, the noisy image is what is filtered.
    std::fs::copy(folder.path().join("denoised.exr"), folder.path().join("noisy.exr")).unwrap();
    assert_eq!(layer(&filter(&folder, &["--filter", "guided"]), None), layer(&filtered, None));
    complains(&tallow(&folder, &["render", scene, "--denoise", "gided"]), 2, &["gided", "guided"]);
    // That file is still whole, and so is a render that was filtered, again and again and in place.
    let merge = |name: &str| tallow(&folder, &["merge", name, "rest.exr", "-o", "merged.exr"]);
    assert_eq!(merge("clean.exr").status.code(), Some(0));
    assert_eq!(layer(&read(&folder, "merged.exr"), None), layer(&merged[0], None));
    render("noisy.exr", &["--spp", "4"]);
    let once = filter(&folder, &["--filter", "guided"]);
    for _ in 0..2 {
        let again = ["filter", "clean.exr", "-o", "clean.exr", "--filter", "guided", "--quiet"];
        assert_eq!(tallow(&folder, &again).status.code(), Some(0));
        assert!(read(&folder, "clean.exr") == once, "it starts from the noisy image");
    }
    assert_eq!(merge("clean.exr").status.code(), Some(0));
    assert_eq!(layer(&read(&folder, "merged.exr"), None), layer(&merged[0], None));
    let resumed = render("resumed.exr", &["--spp", "8", "--resume", "clean.exr"]);
    assert_eq!(layer(&resumed, None), layer(&read(&folder, "whole.exr"), None));
    // Filtered by an older version, which did not keep the noisy image, it has lost its samples' mean.
    let mut lost = once;
    lost.channels.retain(|c| !c.name.starts_with("Noisy Image"));
    write(&folder, "lost.exr", &lost);
    complains(&merge("lost.exr"), 3, &["lost.exr", "was filtered (guided)", "before"]);
}

#[test]
fn what_a_filter_took_is_told_beside_the_render() {
    let folder = tempfile::tempdir().unwrap();
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/cornell-box/scene.toml");
    let render = |more: &[&str]| {
        let words = ["render", scene, "-o", "a.exr", "--width", "8", "--height", "8", "--spp", "1"];
        stdout(&tallow(&folder, &[&words, more].concat()))
    };
    let seconds = |more: &[&str]| {
        let told: serde_json::Value = serde_json::from_str(&render(&[&["--json"], more].concat())).unwrap();
        told["filter_seconds"].as_f64().unwrap()
    };
    assert!(seconds(&["--denoise", "atrous"]) > 0.0 && seconds(&[]) == 0.0);
    let first = |text: String| text.lines().next().unwrap().contains(", filtered in ");
    assert!(first(render(&["--denoise", "atrous"])) && !first(render(&[])));
}

/// As other programs write it: one part, a view layer, half floats.
#[test]
fn the_noisy_image_stays_in_the_view_of_its_colour() {
    let folder = tempfile::tempdir().unwrap();
    let mut film = noisy(false);
    film.channels.iter_mut().for_each(|c| c.name = format!("View.{}", c.name.replace("albedo", "DiffCol")));
    film.channels[..3].iter_mut().for_each(|c| c.name = c.name.replace("View.", "View.Combined."));
    write(&folder, "noisy.exr", &film);
    let clean = filter(&folder, &["--filter", "atrous"]);
    for c in ["R", "G", "B"] {
        let (kept, was) = (format!("View.Noisy Image.{c}"), format!("View.Combined.{c}"));
        assert_eq!(clean.channel(&kept), film.channel(&was));
        assert_ne!(clean.channel(&was), film.channel(&was), "control");
    }
    std::fs::copy(folder.path().join("clean.exr"), folder.path().join("noisy.exr")).unwrap();
    assert!(filter(&folder, &["--filter", "atrous"]) == clean);
    assert!(filter(&folder, &["--filter", "atrous", "--colour", "Noisy Image"]) == clean, "it is not replaced");
    // A layer of the only colour there is, under a name of its own, stays the colour.
    let mut film = noisy(false);
    film.channels[..3].iter_mut().for_each(|c| c.name = format!("light.{}", c.name));
    film.channels.retain(|c| !c.name.starts_with("albedo"));
    write(&folder, "noisy.exr", &film);
    let clean = filter(&folder, &["--filter", "atrous"]);
    assert_eq!(clean.picture(None).unwrap().pixels, clean.picture(Some("light")).unwrap().pixels);
}
