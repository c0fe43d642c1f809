//! Tests that films survive being written to files and read back.
use std::path::Path;
use tallow::error::Error;
use tallow::image::aov::{Aov, Aovs, Names};
use tallow::image::{self, Film, Samples, WriteOptions, output, tone::ToneMap};

/// Bit patterns that a lossy or converting writer would change: negative zero, denormals, infinities, a NaN with payload.
fn awkward(i: usize) -> f32 {
    const SOME: [u32; 6] = [0x8000_0000, 0x0000_0001, 0x7f80_0000, 0xff80_0000, 0x7fc0_1234, 0x7f7f_ffff];
    f32::from_bits(SOME.get(i % 11).copied().unwrap_or((i as u32).wrapping_mul(2_654_435_761) >> 2))
}

/// Every layer that a render writes.
fn full_film(width: u32, height: u32) -> Film {
    let mut film = Film::new(width, height);
    let n = film.pixels();
    let vectors =
        |salt: usize| -> Vec<[f32; 3]> { (0..n).map(|i| [0, 1, 2].map(|c| awkward(salt + 3 * i + c))).collect() };
    for (salt, layer) in ["", "direct", "indirect", "albedo", "variance"].into_iter().enumerate() {
        film.add_vec3(layer, ["R", "G", "B"], &vectors(salt));
    }
    film.add_vec3("N", ["X", "Y", "Z"], &vectors(7));
    film.add_vec3("P", ["X", "Y", "Z"], &vectors(8));
    film.add("Z", Samples::F32((0..n).map(awkward).collect()));
    film.add("samples", Samples::U32((0..n as u32).map(|i| i.wrapping_mul(0x9e37_79b9)).collect()));
    film.add("id", Samples::U32((0..n as u32).map(|i| u32::MAX - i).collect()));
    film
}

fn bits(samples: &Samples) -> Vec<u32> {
    match samples {
        Samples::F32(v) => v.iter().map(|f| f.to_bits()).collect(),
        Samples::U32(v) => v.clone(),
    }
}

fn same_bits(a: &Film, b: &Film) -> bool {
    let same = |name: &str| match (a.channel(name), b.channel(name)) {
        (Some(a), Some(b)) => std::mem::discriminant(a) == std::mem::discriminant(b) && bits(a) == bits(b),
        _ => false,
    };
    a.channels.len() == b.channels.len() && a.channels.iter().all(|c| same(&c.name))
}

#[test]
fn exr_keeps_every_bit_of_every_layer() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.exr");
    for (width, height) in [(1, 1), (31, 1), (1, 31), (65, 33), (16, 16)] {
        let film = full_film(width, height);
        image::write(&path, &film, &WriteOptions::default()).unwrap();
        let back = image::read(&path).unwrap();
        assert_eq!((back.width, back.height), (width, height));
        assert!(same_bits(&film, &back), "{width}x{height}");
        // Control: one bit in one channel must be noticed.
        let mut other = back.clone();
        if let Samples::F32(v) = &mut other.channels[0].samples {
            v[0] = f32::from_bits(v[0].to_bits() ^ 1);
        }
        assert!(!same_bits(&film, &other));
    }
}

#[test]
fn a_film_filled_part_by_part_is_the_film() {
    let (whole, mut filled) = (full_film(5, 3), Film::new(5, 3));
    let part = |range: std::ops::Range<usize>| {
        let mut part = Film::new(range.len() as u32, 1);
        for channel in &whole.channels {
            let samples = match &channel.samples {
                Samples::F32(v) => Samples::F32(v[range.clone()].to_vec()),
                Samples::U32(v) => Samples::U32(v[range.clone()].to_vec()),
            };
            part.add(channel.name.clone(), samples);
        }
        part
    };
    filled.append(&[part(0..4), part(4..5)]);
    filled.append(&[]);
    filled.append(&[part(5..15)]);
    assert!(same_bits(&whole, &filled));
}

#[test]
fn exr_keeps_metadata_in_any_script_and_length() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("film.exr");
    let mut film = full_film(3, 2);
    let long = "x".repeat(4000);
    let entries = [
        ("scene", "scènes/дом 家.toml"),
        ("settings", r#"{"width":3,"spp":64}"#),
        ("seed", "4294967295"),
        ("device", "llvmpipe (LLVM 15.0.6, 256 bits)"),
        ("driver", "llvmpipe Mesa 22.3.6"),
        ("version", "0.1.0"),
        ("renderSeconds", "1.5"),
        ("date", "2025-01-31T12:00:00Z"),
        ("warnings", &long),
        ("aNameOfMoreThanThirtyOneCharactersInAll", ""),
    ];
    film.metadata = entries.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    image::write(&path, &film, &WriteOptions::default()).unwrap();
    assert_eq!(image::read(&path).unwrap().metadata, film.metadata);
}

mod foreign {
    //! Files as other programs write them.
    use exr::prelude::*;
    use tallow::image::{Film, Samples, decode};

    fn plane(name: &str, samples: FlatSamples) -> AnyChannel<FlatSamples> {
        AnyChannel::new(name, samples)
    }

    fn part(
        name: &str,
        position: (i32, i32),
        size: (usize, usize),
        encoding: Encoding,
        channels: Vec<AnyChannel<FlatSamples>>,
    ) -> Layer<AnyChannels<FlatSamples>> {
        let attributes = LayerAttributes { layer_position: position.into(), ..LayerAttributes::named(name) };
        Layer::new(size, attributes, encoding, AnyChannels::sort(channels.into()))
    }

    fn film(window: ((i32, i32), (usize, usize)), parts: Vec<Layer<AnyChannels<FlatSamples>>>) -> Film {
        let window = IntegerBounds::new(window.0, window.1);
        let image = Image::from_layers(ImageAttributes::new(window), parts);
        let mut bytes = std::io::Cursor::new(Vec::new());
        image.write().to_buffered(&mut bytes).unwrap();
        decode(&bytes.into_inner()).unwrap()
    }

    #[test]
    fn half_float_and_integer_channels_in_tiles_are_read() {
        let half = FlatSamples::F16((0..6).map(|i| f16::from_f32(0.5 * i as f32)).collect());
        let tiles = Encoding { blocks: Blocks::Tiles(Vec2(2, 2)), ..Encoding::FAST_LOSSLESS };
        let channels = vec![
            plane("Y", half),
            plane("Z", FlatSamples::F32(vec![0.1; 6])),
            plane("id", FlatSamples::U32(vec![7; 6])),
        ];
        let film = film(((0, 0), (3, 2)), vec![part("any", (0, 0), (3, 2), tiles, channels)]);
        let grey = film.picture(None).unwrap();
        assert_eq!(grey.pixels[5], [2.5; 3]);
        assert_eq!(film.picture(Some("z")).unwrap().pixels[0], [0.1; 3]);
        assert_eq!(film.channel("id"), Some(&Samples::U32(vec![7; 6])));
    }

    #[test]
    fn every_part_of_a_file_is_a_layer() {
        let rgb = |v: f32| ["R", "G", "B"].map(|c| plane(c, FlatSamples::F32(vec![v; 4]))).to_vec();
        let encoding = Encoding::SMALL_LOSSLESS;
        let prefixed = vec![plane("depth.Z", FlatSamples::F32(vec![3.0; 4]))];
        let parts = vec![
            part("rgba", (0, 0), (2, 2), encoding, rgb(1.0)),
            part("albedo", (0, 0), (2, 2), encoding, rgb(2.0)),
            part("depth", (0, 0), (2, 2), encoding, prefixed),
        ];
        let film = film(((0, 0), (2, 2)), parts);
        for (layer, value) in [(None, 1.0), (Some("albedo"), 2.0), (Some("Depth"), 3.0)] {
            assert_eq!(film.picture(layer).unwrap().pixels, [[value; 3]; 4], "{layer:?}");
        }
        let lines = film.picture(Some("normals")).unwrap_err();
        assert!(lines.contains("depth.Z") && lines.contains("normals"), "{lines}");
    }

    #[test]
    fn the_picture_is_the_display_window() {
        // Data window (-1, 0) to (1, 2), display window (0, 0) to (2, 1): a column and a row are cut, one column is black.
        let data = FlatSamples::F32(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0]);
        let layer = part("y", (-1, 0), (3, 3), Encoding::UNCOMPRESSED, vec![plane("Y", data)]);
        let film = film(((0, 0), (3, 2)), vec![layer]);
        assert_eq!(film.channel("Y"), Some(&Samples::F32(vec![2.0, 3.0, 0.0, 5.0, 6.0, 0.0])));
    }
}

#[test]
fn the_colour_is_found_under_the_names_of_other_programs() {
    let film = |layers: &[&str]| {
        let mut film = Film::new(1, 1);
        for (i, layer) in layers.iter().enumerate() {
            film.add_vec3(layer, ["R", "G", "B"], &[[i as f32; 3]]);
        }
        film
    };
    let colour = |layers: &[&str]| film(layers).picture(None).map(|p| p.pixels[0][0]);
    assert_eq!(colour(&["ViewLayer.DiffCol", "ViewLayer.Combined"]), Ok(1.0));
    assert_eq!(colour(&["albedo", ""]), Ok(1.0));
    assert_eq!(colour(&["light"]), Ok(0.0));
    assert!(colour(&["light", "albedo"]).is_err(), "two candidates and no usual name");
    // Two layers match by their last part, so that neither is meant.
    assert!(film(&["a.light", "b.light"]).picture(Some("light")).is_err());
    assert_eq!(film(&["a.light", "light"]).picture(Some("light")).unwrap().pixels[0][0], 1.0);
}

/// To look at all channels for each layer would take minutes here.
#[test]
fn layers_of_many_are_found_in_time() {
    const MANY: usize = 20_000;
    let mut film = Film::new(1, 1);
    (0..MANY).for_each(|i| film.add_vec3(&format!("light {i}"), ["R", "G", "B"], &[[i as f32; 3]]));
    let start = std::time::Instant::now();
    assert!(film.picture(None).is_err(), "none is the colour");
    film.add_vec3("View.Combined", ["R", "G", "B"], &[[0.5; 3]]);
    for (layer, value) in [(None, 0.5), (Some("light 19999"), 19999.0), (Some("combined"), 0.5)] {
        assert_eq!(film.picture(layer).unwrap().pixels, [[value; 3]], "{layer:?}");
    }
    let aovs = Aovs::find(&film, &Names::from([(Aov::Albedo, "light 7".to_owned())])).unwrap();
    assert_eq!(aovs.scalar(Aov::Albedo, 0), Some(7.0));
    assert!(start.elapsed().as_secs() < 60, "{:?}", start.elapsed());
}

#[test]
fn luminance_and_chroma_are_no_grey() {
    let film = |names: &[&str]| {
        let mut film = Film::new(1, 1);
        names.iter().for_each(|name| film.add(*name, Samples::F32(vec![0.5])));
        film
    };
    let chroma = film(&["BY", "RY", "Y"]);
    let line = chroma.picture(None).unwrap_err();
    assert_eq!(line, "holds luminance and chroma (Y, RY, BY), which is not supported: save it as R, G, B");
    assert_eq!(chroma.picture(Some("Y")).unwrap().pixels, [[0.5; 3]], "it is asked for");
    for names in [&["Y", "A"][..], &["B", "BY", "G", "R", "RY", "Y"]] {
        assert_eq!(film(names).picture(None).unwrap().pixels, [[0.5; 3]], "{names:?}");
    }
}

fn write_and_read(name: &str, pixels: &[[f32; 3]], options: &WriteOptions) -> Vec<[f32; 3]> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let mut film = Film::new(pixels.len() as u32, 1);
    film.add_vec3("", ["R", "G", "B"], pixels);
    image::write(&path, &film, options).unwrap();
    image::read(&path).unwrap().picture(None).unwrap().pixels
}

/// 8-bit code values of a PNG written with these options.
fn codes(radiance: f32, options: &WriteOptions) -> u8 {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let mut film = Film::new(1, 1);
    film.add_vec3("", ["R", "G", "B"], &[[radiance; 3]]);
    image::write(&path, &film, options).unwrap();
    ::image::open(&path).unwrap().to_rgb8()[(0, 0)][0]
}

#[test]
fn png_holds_srgb_code_values() {
    // By the formula of IEC 61966-2-1: 1.055 * 0.5^(1/2.4) - 0.055 = 0.73536, times 255 = 187.5.
    let plain = WriteOptions::default();
    let table = [(0.0, 0), (0.002, 7), (0.18, 118), (0.5, 188), (1.0, 255), (7.0, 255), (-1.0, 0)];
    for (radiance, code) in table {
        assert_eq!(codes(radiance, &plain), code, "{radiance}");
    }
    assert_eq!(codes(f32::NAN, &plain), 0);
    assert_eq!(codes(0.045, &WriteOptions { exposure: 2.0, ..plain }), 118, "two stops are a factor of 4");
    // Narkowicz at 1: 2.54 / 3.16 = 0.8038, whose code value is 0.9080 * 255 = 231.5; without the sRGB curve 205.
    let aces = WriteOptions { tone_map: ToneMap::Aces, ..plain };
    assert!((231..=232).contains(&codes(1.0, &aces)), "{}", codes(1.0, &aces));
    assert_eq!(codes(f32::INFINITY, &aces), 255);
}

/// Writes 18 pixels, and returns the file's bytes.
fn hdr(path: &Path) -> Vec<u8> {
    let mut film = Film::new(9, 2);
    film.add_vec3("", ["R", "G", "B"], &std::array::from_fn::<_, 18, _>(|i| [i as f32, 0.25, 2.0]));
    image::write(path, &film, &WriteOptions::default()).unwrap();
    std::fs::read(path).unwrap()
}

/// Radiance's own files begin otherwise than those that Mitsuba writes.
#[test]
fn both_signatures_of_hdr_are_read_alike() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.hdr");
    let bytes = hdr(&path);
    let other = [b"#?RGBE\n", bytes.strip_prefix(b"#?RADIANCE\n").unwrap()].concat();
    let [a, b] = [&bytes, &other].map(|bytes| image::decode(bytes).unwrap().picture(None).unwrap().pixels);
    assert!(a == b && a[17][0] > 16.0, "{a:?} {b:?}");
    std::fs::write(&path, other).unwrap();
    assert!(image::read(&path).unwrap().picture(None).unwrap().pixels == a);
}

/// By the format's definition, radiance is what the pixels hold over the product of all lines.
#[test]
fn hdr_is_divided_by_the_exposures_of_its_header() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.hdr");
    let bytes = hdr(&path);
    let decoded = |signature: &str, lines: &str| {
        let rest = bytes.strip_prefix(b"#?RADIANCE\n").unwrap();
        image::decode(&[signature.as_bytes(), lines.as_bytes(), rest].concat())
            .map(|film| film.picture(None).unwrap().pixels)
    };
    let plain = decoded("#?RADIANCE\n", "").unwrap();
    for signature in ["#?RADIANCE\n", "#?RGBE\n"] {
        let halved = decoded(signature, "EXPOSURE=2.0\n").unwrap();
        assert!(halved.iter().zip(&plain).all(|(half, whole)| *half == whole.map(|v| v / 2.0)), "{halved:?}");
        let all = decoded(signature, "EXPOSURE=2.0\nEXPOSURE= 4\nCOLORCORR=1 0.5 2\n").unwrap();
        assert!(all.iter().zip(&plain).all(|(all, [r, g, b])| *all == [r / 8.0, g / 4.0, b / 16.0]), "{all:?}");
    }
    for wrong in ["EXPOSURE=0\n", "EXPOSURE=-1\n", "EXPOSURE=inf\n", "EXPOSURE=nan\n", "COLORCORR=1 0 1\n"] {
        let line = decoded("#?RADIANCE\n", wrong).unwrap_err();
        assert!(line.contains("EXPOSURE and COLORCORR: correct these to positive numbers"), "{wrong}: {line}");
    }
}

/// RGBE cuts off what 8 bits do not hold: half a unit, which is much of a dark channel beside a bright one.
#[test]
fn hdr_keeps_the_light_of_dark_channels() {
    let pixel = |i: u32| {
        let [v, share] = [1.0 + i as f32 / 1024.0, (i.wrapping_mul(2_654_435_761) >> 8) as f32 / (1 << 24) as f32];
        [v, 0.5 * share * v, 0.25 * share * v]
    };
    let pixels: Vec<_> = (0..4096).map(pixel).collect();
    let read = write_and_read("a.hdr", &pixels, &WriteOptions::default());
    for c in 0..3 {
        let [sum, of] = [&read, &pixels].map(|all| all.iter().map(|p| f64::from(p[c])).sum::<f64>());
        assert!((sum / of - 1.0).abs() < 1e-3, "channel {c}: {}", sum / of);
    }
    // What rounds up to the next power of two, for which the last has no exponent.
    let ends = [[1.999, 0.99, 0.0], [1.7e38, 3e38, f32::INFINITY]];
    let read = write_and_read("a.hdr", &ends, &WriteOptions::default());
    assert_eq!(read[0], [2.0, 0.984375, 0.0]);
    assert!(read[1].iter().all(|&v| v > 1.69e38 && v.is_finite()), "{read:?}");
}

#[test]
fn light_too_little_for_hdr_is_black() {
    let read = write_and_read("a.hdr", &[[1e-40; 3], [1e-44, 0.0, 0.0], [1.0; 3]], &WriteOptions::default());
    assert!(read[..2].iter().flatten().all(|&v| v <= 1e-38) && (read[2][0] - 1.0).abs() < 0.01, "{read:?}");
}

/// Its rows would begin as those of files without lengths do.
#[test]
fn an_hdr_file_of_32768_columns_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (width, fits) in [(32767, true), (32768, false), (32769, true)] {
        let (path, mut film) = (folder.path().join("a.hdr"), Film::new(width, 1));
        film.add_vec3("", ["R", "G", "B"], &(0..width).map(|x| [x as f32; 3]).collect::<Vec<_>>());
        let written = image::write(&path, &film, &WriteOptions::default());
        assert_eq!(written.is_ok(), fits, "{width}: {written:?}");
        if fits {
            let read = image::read(&path).unwrap().picture(None).unwrap();
            assert!((read.pixels[9000][0] - 9000.0).abs() < 40.0, "{width}: {:?}", read.pixels[9000]);
        }
    }
}

#[test]
fn a_png_says_that_it_is_srgb() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.png");
    let mut film = Film::new(1, 1);
    film.add_vec3("", ["R", "G", "B"], &[[0.5; 3]]);
    image::write(&path, &film, &WriteOptions::default()).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    // Chunks have a length and a name before their data, and a checksum behind, which the decoder proves.
    assert_eq!(bytes[33..42], *b"\0\0\0\x01sRGB\0");
    assert!(image::decode(&bytes).unwrap().picture(None).unwrap().pixels[0][0] > 0.49);
}

#[test]
fn png_and_hdr_come_back_as_linear_values() {
    let pixels = [[0.0, 0.18, 1.0], [0.5, 0.25, 0.75]];
    let png = write_and_read("a.png", &pixels, &WriteOptions::default());
    let hdr = write_and_read("a.hdr", &pixels.map(|p| p.map(|v| 100.0 * v)), &WriteOptions::default());
    for ((png, hdr), pixel) in png.iter().zip(&hdr).zip(&pixels) {
        for c in 0..3 {
            // Half an 8-bit code near white is 0.0045 in linear terms; RGBE has 8 bits for the largest channel.
            assert!((png[c] - pixel[c]).abs() < 0.005, "{png:?} {pixel:?}");
            assert!((hdr[c] / 100.0 - pixel[c]).abs() < 1.0 / 256.0, "{hdr:?} {pixel:?}");
        }
    }
    // Control: an exposure must show.
    let brighter = write_and_read("a.png", &pixels, &WriteOptions { exposure: 0.5, ..WriteOptions::default() });
    assert!((brighter[1][0] - 0.5).abs() > 0.1);
}

fn what(result: tallow::error::Result<()>) -> String {
    match result.unwrap_err() {
        Error::Output { what, .. } => what,
        other => panic!("not an output error: {other}"),
    }
}

#[test]
fn a_failing_write_leaves_the_old_file_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let inside = |name: &str| folder.path().join(name);
    // A folder where the file should go makes the renaming fail, after everything has been written.
    std::fs::create_dir(inside("taken.exr")).unwrap();
    assert!(what(output::write(&inside("taken.exr"), b"new")).contains("is a folder"));
    assert!(what(image::check_writable(&inside("taken.exr"))).contains("is a folder"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no temporary file stays");
    assert!(what(image::check_writable(&inside("missing/a.exr"))).contains("create it"));
    assert!(matches!(image::check_writable(&inside("a.tif")), Err(Error::Usage(text)) if text.contains(".exr")));
    image::check_writable(&inside("a.exr")).unwrap();
    assert!(!inside("a.exr").exists(), "a check leaves nothing behind");
    // The same call succeeds where nothing is in the way, and replaces what was there.
    for text in [b"one", b"two"] {
        output::write(&inside("a.exr"), text).unwrap();
        assert_eq!(std::fs::read(inside("a.exr")).unwrap(), text);
    }
}

#[cfg(target_os = "linux")]
#[test]
fn devices_are_written_to_and_links_are_followed() {
    assert!(what(output::write(Path::new("/dev/full"), b"x")).contains("free some space"));
    let folder = tempfile::tempdir().unwrap();
    let (file, link) = (folder.path().join("file.exr"), folder.path().join("link.exr"));
    std::fs::write(&file, "old").unwrap();
    std::os::unix::fs::symlink(&file, &link).unwrap();
    output::write(&link, b"new").unwrap();
    assert_eq!(std::fs::read(&file).unwrap(), b"new");
    assert!(link.is_symlink());
}

#[cfg(unix)]
mod replaced {
    //! What a file that is replaced passes on.
    use super::what;
    use std::fs::{Permissions, hard_link, metadata, read, set_permissions, write};
    use std::os::unix::fs::{MetadataExt, PermissionsExt, chown, symlink};
    use tallow::image::output;

    #[test]
    fn modes_and_owners_stay() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        for mode in [0o600, 0o640, 0o666, 0o200] {
            write(&path, "old").unwrap();
            set_permissions(&path, Permissions::from_mode(mode)).unwrap();
            // Only root may do this; for anybody else it is the owner that there is.
            let _ = chown(&path, Some(65534), Some(65534));
            let old = metadata(&path).unwrap();
            output::write(&path, b"new").unwrap();
            let new = metadata(&path).unwrap();
            assert_eq!((new.mode(), new.uid(), new.gid()), (old.mode(), old.uid(), old.gid()));
            assert_ne!(new.ino(), old.ino(), "it was not replaced as a whole");
            std::fs::remove_file(&path).unwrap();
        }
        output::write(&path, b"new").unwrap();
        assert_eq!(metadata(&path).unwrap().mode() & 0o600, 0o600);
    }

    #[test]
    fn read_only_files_and_hard_links_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let inside = |name: &str| folder.path().join(name);
        let refused = |name: &str, word: &str| {
            assert!(what(output::check(&inside(name))).contains(word));
            assert!(what(output::write(&inside(name), b"new")).contains(word));
            assert_eq!(read(inside(name)).unwrap(), b"old");
        };
        write(inside("locked.exr"), "old").unwrap();
        set_permissions(inside("locked.exr"), Permissions::from_mode(0o444)).unwrap();
        symlink("locked.exr", inside("link.exr")).unwrap();
        refused("locked.exr", "read-only");
        refused("link.exr", "read-only");
        write(inside("one.exr"), "old").unwrap();
        hard_link(inside("one.exr"), inside("two.exr")).unwrap();
        refused("one.exr", "hard links");
        std::fs::remove_file(inside("two.exr")).unwrap();
        output::write(&inside("one.exr"), b"new").unwrap();
    }

    #[test]
    fn links_lead_where_they_led() {
        let folder = tempfile::tempdir().unwrap();
        let inside = |name: &str| folder.path().join(name);
        std::fs::create_dir(inside("x")).unwrap();
        for (link, target) in [("first.exr", "x/second.exr"), ("x/second.exr", "end.exr"), ("gone.exr", "y/end.exr")] {
            symlink(target, inside(link)).unwrap();
        }
        symlink("b.exr", inside("a.exr")).unwrap();
        symlink("a.exr", inside("b.exr")).unwrap();
        output::check(&inside("first.exr")).unwrap();
        for text in [b"one", b"two"] {
            output::write(&inside("first.exr"), text).unwrap();
            assert_eq!(read(inside("x/end.exr")).unwrap(), text);
        }
        assert!(inside("first.exr").is_symlink() && inside("x/second.exr").is_symlink());
        for broken in ["a.exr", "gone.exr"] {
            assert!(what(output::check(&inside(broken))).contains("a link that leads nowhere"));
            assert!(what(output::write(&inside(broken), b"new")).contains("a link that leads nowhere"));
            assert!(inside(broken).is_symlink());
        }
    }

    #[test]
    fn a_new_file_replaces_none() {
        let folder = tempfile::tempdir().unwrap();
        let inside = |name: &str| folder.path().join(name);
        let new = |text: &str| output::write_new(&inside("a.exr"), |stream| stream.write_all(text.as_bytes())).unwrap();
        assert_eq!([new("1"), new("2"), new("3")], ["a.exr", "a-2.exr", "a-3.exr"].map(inside));
        assert_eq!(["a.exr", "a-2.exr", "a-3.exr"].map(|name| read(inside(name)).unwrap()), [b"1", b"2", b"3"]);
    }
}

#[test]
fn a_film_without_channels_is_no_file() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.exr", "a.png", "a.hdr"] {
        let what = what(image::write(&folder.path().join(name), &Film::new(2, 2), &WriteOptions::default()));
        assert!(what.contains("channel") && what.ends_with(|end: char| end.is_alphabetic()), "{what:?}");
    }
}

/// Fields are public: a channel may have any length.
#[test]
fn a_channel_of_another_length_is_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let mut film = Film::new(2, 2);
    film.add("R", Samples::F32(vec![1.0; 4]));
    film.channels[0].samples = Samples::F32(vec![1.0]);
    let line = image::write(&folder.path().join("a.exr"), &film, &WriteOptions::default()).unwrap_err().to_string();
    assert!(line.contains("channel R has 1 samples for 4 pixels"), "{line}");
}
