//! Pictures and what becomes of them.
use super::*;
use glam::Vec3;

fn decode(bytes: &[u8], name: &str, kind: Kind) -> Result<Decoded> {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join(name), bytes).unwrap();
    let (mut set, mut warnings) = (TextureSet::default(), Vec::new());
    let index = set.request(dir.path(), name, kind, Mapping::default(), &mut warnings);
    assert_eq!((index, warnings.len()), (0, 0));
    assert_eq!(set.request(dir.path(), name, kind, Mapping::default(), &mut warnings), 0, "each picture once");
    crate::threads::within(|| set.decode())
}

fn encoded(picture: &image::RgbImage, format: image::ImageFormat) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

fn png(width: u32, height: u32, pixels: &[u8]) -> Vec<u8> {
    let picture = image::RgbImage::from_raw(width, height, pixels.to_vec()).unwrap();
    encoded(&picture, image::ImageFormat::Png)
}

fn jpeg(width: u32, height: u32) -> Vec<u8> {
    let picture = image::RgbImage::from_fn(width, height, |x, y| image::Rgb([6 * x as u8, 6 * y as u8, 77]));
    encoded(&picture, image::ImageFormat::Jpeg)
}

#[test]
fn the_mean_is_taken_in_linear_light() {
    let color = decode(&png(2, 1, &[0, 0, 0, 255, 255, 255]), "a.png", Kind::Color).unwrap();
    assert_eq!(color.texels, [0xff000000, 0xffffffff]);
    assert_eq!(mean(&color.textures[0], &color.texels), [0.5; 3]);
    // sRGB 188 is half of full light; 128 is a fifth.
    let grey = decode(&png(1, 1, &[188, 188, 128]), "a.png", Kind::Color).unwrap();
    let light = mean(&grey.textures[0], &grey.texels);
    assert!((light[0] - 0.5).abs() < 0.005 && (light[2] - 0.2158).abs() < 0.005, "{light:?}");
}

#[test]
fn reduced_pictures_keep_their_mean() {
    let bytes: Vec<u8> = (0..5 * 3 * 3).map(|i| (i * i * 37 % 256) as u8).collect();
    let of = decode(&png(5, 3, &bytes), "a.png", Kind::Color).unwrap();
    let texels = reduced(&of.textures[0], &of.texels, 2, 3);
    // Blocks of 2 and of 3 texels.
    let block = |i: usize| Vec3::from(rgb9e5::unpack(texels[i]));
    let found = (0..3).map(|row| 2.0 * block(2 * row) + 3.0 * block(2 * row + 1)).sum::<Vec3>() / 15.0;
    assert!(texels.len() == 6 && found.abs_diff_eq(mean(&of.textures[0], &of.texels).into(), 2e-3), "{found}");
    let first = [0, 1].map(|i| linear_from_srgb_f64(f64::from(bytes[3 * i]) / 255.0) as f32);
    assert!((block(0).x - 0.5 * (first[0] + first[1])).abs() < 2e-3, "{}", block(0));
}

#[test]
fn channels_are_picked_by_kind() {
    let found = decode(&png(1, 1, &[10, 20, 30]), "a.png", Kind::Roughness).unwrap();
    assert_eq!(found.texels[0].to_le_bytes(), [20; 4]);
    let found = decode(&png(1, 1, &[10, 20, 30]), "a.png", Kind::Mask).unwrap();
    assert_eq!(found.texels[0].to_le_bytes(), [10; 4]);
}

#[test]
fn pictures_of_all_forms_become_texels() {
    use image::DynamicImage;
    // More rows than are converted at a time.
    let picture = image::RgbaImage::from_fn(3, 70, |x, y| image::Rgba([3 * y as u8, x as u8, 9, 100 + y as u8]));
    let picture = DynamicImage::ImageRgba8(picture);
    let grey = DynamicImage::ImageLumaA8(picture.to_luma_alpha8());
    for form in [picture.clone(), picture.to_rgb8().into(), grey, picture.to_luma8().into()] {
        let mut bytes = std::io::Cursor::new(Vec::new());
        form.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        let rgba = form.to_rgba8();
        let words =
            |of: fn([u8; 4]) -> [u8; 4]| -> Vec<_> { rgba.pixels().map(|p| u32::from_le_bytes(of(p.0))).collect() };
        let found = |kind| decode(bytes.get_ref(), "a.png", kind).unwrap().texels;
        let color = form.color();
        assert_eq!(found(Kind::Color), words(|rgba| rgba), "{color:?}");
        assert_eq!(found(Kind::Red), words(|[r, ..]| [r; 4]), "{color:?}");
        assert_eq!(found(Kind::Roughness), words(|[_, g, ..]| [g; 4]), "{color:?}");
        assert_eq!(found(Kind::Alpha), words(|[.., a]| [a; 4]), "{color:?}");
        let mask = if color.has_alpha() { words(|[.., a]| [a; 4]) } else { words(|[r, ..]| [r; 4]) };
        assert_eq!(found(Kind::Mask), mask, "{color:?}");
    }
}

#[test]
fn what_was_decoded_is_kept_when_more_is_requested() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    std::fs::write(path("a.png"), png(1, 2, &[1, 2, 3, 4, 5, 6])).unwrap();
    std::fs::write(path("b.png"), png(1, 1, &[7, 8, 9])).unwrap();
    let mut set = TextureSet::default();
    set.request(dir.path(), "a.png", Kind::Color, Mapping::default(), &mut Vec::new());
    let early = crate::threads::within(|| set.decode()).unwrap();
    std::fs::remove_file(path("a.png")).unwrap();
    set.request(dir.path(), "b.png", Kind::Data, Mapping::default(), &mut Vec::new());
    let all = crate::threads::within(|| set.decode_after(early)).unwrap();
    assert_eq!(all.texels, [0xff030201, 0xff060504, 0xff090807]);
    let records: Vec<_> = all.textures.iter().map(|t| (t.first, t.width, t.height, t.flags)).collect();
    assert_eq!(records, [(0, 1, 2, TEXTURE_SRGB), (2, 1, 1, 0)]);
}

#[test]
fn colours_are_those_of_rec_709_and_numbers_stay_as_they_are() {
    use crate::image::primaries::tests::{AP1, file};
    for (kind, expected) in [(Kind::Color, 0.68667), (Kind::Light, 0.68667), (Kind::Data, 0.5)] {
        let found = decode(&file(Some(AP1), [0.5, 0.25, 0.125]), "a.exr", kind).unwrap();
        let red = rgb9e5::unpack(found.texels[0])[0];
        assert!((red - expected).abs() < 0.002, "{kind:?}: {red}");
    }
}

#[test]
fn damage_is_an_error_with_the_file() {
    let whole = png(40, 40, &[7; 4800]);
    for bytes in [&whole[..whole.len() / 2], &whole[..20], b"not a picture"] {
        let error = decode(bytes, "a.png", Kind::Color).unwrap_err().to_string();
        assert!(error.contains("a.png: is no usable picture") && !error.contains('\n'), "{error}");
    }
    assert!(decode(&whole, "a.png", Kind::Color).is_ok(), "control");
    let whole = jpeg(40, 40);
    for end in [whole.len() / 2, whole.len() - 40, whole.len() - 2] {
        let error = decode(&whole[..end], "a.jpg", Kind::Color).unwrap_err();
        assert_eq!(error.exit_code(), 3);
        assert!(error.to_string().contains("a.jpg: is a JPEG without its end"), "{error}");
    }
    assert!(decode(&whole, "a.jpg", Kind::Color).is_ok(), "control");
}

#[test]
fn tga_and_bmp_hold_what_png_does() {
    let picture = image::RgbImage::from_fn(5, 3, |x, y| image::Rgb([50 * x as u8, 80 * y as u8, 7]));
    let of = |bytes: &[u8], name: &str| decode(bytes, name, Kind::Color).map(|decoded| decoded.texels);
    let expected = of(&encoded(&picture, image::ImageFormat::Png), "a.png").unwrap();
    for (format, name) in [(image::ImageFormat::Tga, "a.tga"), (image::ImageFormat::Bmp, "a.bmp")] {
        let bytes = encoded(&picture, format);
        assert_eq!(of(&bytes, name).unwrap(), expected, "{name}");
        assert!(of(&bytes[..bytes.len() - 20], name).is_err(), "{name} without its end");
    }
    // As 3ds Max and Photoshop pack them: rows from below, runs of one colour, blue first.
    let packed = [0, 0, 10, 0, 0, 0, 0, 0, 0, 0, 0, 0, 3, 0, 2, 0, 24, 0, 0x82, 1, 2, 3, 0x82, 4, 5, 6];
    let expected = [[0xff040506; 3], [0xff010203; 3]].concat();
    assert_eq!(of(&packed, "b.tga").unwrap(), expected);
    let mut odd = packed;
    odd[7] = 24; // bits of a palette that is not there
    assert_eq!(of(&odd, "b.tga").unwrap(), expected);
}

/// As for a picture that is not there.
#[test]
fn pictures_of_other_formats_leave_the_constant_colour() {
    let dir = tempfile::tempdir().unwrap();
    let tiff = b"II*\0\x08\0\0\0 and so on";
    let of = |name: &str, bytes: &[u8]| {
        std::fs::write(dir.path().join(name), bytes).unwrap();
        let (mut set, mut warnings) = (TextureSet::default(), Vec::new());
        (set.request(dir.path(), name, Kind::Color, Mapping::default(), &mut warnings), warnings)
    };
    for (name, bytes) in [
        ("a.tif", &tiff[..]),
        ("a.GIF", b"GIF89a and so on"),
        ("a.tga", b"no TGA"),
        ("a.webp", b"RIFF....WEBP"),
        ("a.psd", b"8BPS"),
    ] {
        let (index, warnings) = of(name, bytes);
        assert!(index == NONE && warnings.len() == 1, "{name}: {warnings:?}");
        assert!(warnings[0].contains(name) && warnings[0].contains("its constant colour is used: save it as PNG"));
    }
    assert_eq!(of("b.tif", &png(1, 1, &[7, 8, 9])), (0, Vec::new()), "a PNG by another name");
    // A name without an ending, and a PNG that is none, are mistakes: the file is read, and refused.
    assert_eq!([of("c", tiff).0, of("c.png", tiff).0], [0; 2]);
    assert!(decode(tiff, "c.png", Kind::Color).is_err());
}

#[test]
fn large_pictures_are_decoded_where_memory_allows() {
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    use image::{ExtendedColorType, ImageEncoder};
    // 517 MiB as it is decoded, which the decoder's own limit refuses.
    const SIDE: u32 = 8230;
    let mut bytes = Vec::new();
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Fast, FilterType::NoFilter)
        .write_image(&vec![0; 8 * SIDE as usize * SIDE as usize], SIDE, SIDE, ExtendedColorType::Rgba16)
        .unwrap();
    let found = decode(&bytes, "a.png", Kind::Color).unwrap();
    assert!(found.texels.len() == SIDE as usize * SIDE as usize && found.texels.iter().all(|&t| t == 0));
}

/// A grey PNG of 16 bits.
fn deep(width: u32, height: u32, values: Vec<u16>) -> Vec<u8> {
    let picture = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(width, height, values).unwrap();
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

#[test]
fn numbers_of_16_bits_keep_them() {
    // A ramp of 4096 steps over a tenth of the range, more rows than are converted at a time.
    let ramp = |_: u32| (0..4096u32).map(|x| (x * 1638 / 1024) as u16);
    let bytes = deep(4096, 70, (0..70).flat_map(ramp).collect());
    for kind in [Kind::Height, Kind::Mask, Kind::Red, Kind::Roughness] {
        let found = decode(&bytes, "a.png", kind).unwrap();
        assert_eq!((found.textures[0].flags, found.texels.len()), (TEXTURE_FLOAT, 4096 * 70), "{kind:?}");
        for row in found.texels.chunks(4096) {
            let heights: Vec<_> = row.iter().map(|&word| f32::from_bits(word)).collect();
            assert_eq!(heights[4095], 6550.0 / 65535.0);
            let slope = |x: usize| (heights[x + 64] - heights[x]) * 65535.0 / 102.375;
            assert!((0..4032).all(|x| (slope(x) - 1.0).abs() < 0.02), "{kind:?}: terraces");
        }
    }
    for kind in [Kind::Color, Kind::Light, Kind::Data] {
        let found = decode(&bytes, "a.png", kind).unwrap();
        assert_eq!(found.textures[0].flags, kind.of_bytes());
        assert_eq!(found.texels[4095].to_le_bytes(), [25, 25, 25, 255], "{kind:?}");
    }
    let alpha = decode(&bytes, "a.png", Kind::Alpha).unwrap();
    assert_eq!(f32::from_bits(alpha.texels[7]), 1.0, "the file has none");
}

#[test]
fn masks_in_grey_are_read_from_red_where_alpha_says_nothing() {
    use crate::image::{Film, Samples, WriteOptions, encode};
    type Texels = [[u8; 4]; 2];
    let bytes = |texels: Texels| {
        let picture = image::RgbaImage::from_raw(2, 1, texels.concat()).unwrap();
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    };
    let deep = |texels: Texels| {
        let wide: Vec<_> = texels.concat().into_iter().map(|v| 257 * u16::from(v)).collect();
        let picture = image::ImageBuffer::<image::Rgba<u16>, _>::from_raw(2, 1, wide).unwrap();
        let mut bytes = std::io::Cursor::new(Vec::new());
        picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
        bytes.into_inner()
    };
    let floats = |texels: Texels| {
        let mut film = Film::new(2, 1);
        for (c, name) in ["R", "G", "B", "A"].into_iter().enumerate() {
            film.add(name, Samples::F32(texels.iter().map(|rgba| f32::from(rgba[c]) / 255.0).collect()));
        }
        let mut bytes = std::io::Cursor::new(Vec::new());
        encode(Path::new("a.exr"), &film, &WriteOptions::default(), &mut bytes).unwrap();
        bytes.into_inner()
    };
    let bitmap = |texels: Texels| {
        let mut set = TextureSet::default();
        set.add_bitmap(&Bitmap { name: "a".into(), width: 2, height: 1, rgba: texels.into() }).unwrap();
        set.request(Path::new(""), "a", Kind::Mask, Mapping::default(), &mut Vec::new());
        crate::threads::within(|| set.decode()).unwrap()
    };
    let cases = [
        ([[51, 51, 51, 255], [204, 204, 204, 255]], [51, 204]),
        ([[51, 51, 51, 255], [204, 204, 203, 255]], [255, 255]), // it has colour
        ([[51, 51, 51, 255], [204, 204, 204, 102]], [255, 102]), // alpha says something
    ];
    for (texels, expected) in cases {
        let words = |found: Decoded| found.texels.into_iter().map(|word| word.to_le_bytes()[0]).collect::<Vec<_>>();
        assert_eq!(words(decode(&bytes(texels), "a.png", Kind::Mask).unwrap()), expected);
        assert_eq!(words(bitmap(texels)), expected);
        let expected = expected.map(|v| f32::from(v) / 255.0);
        for (name, file) in [("a.png", deep(texels)), ("a.exr", floats(texels))] {
            let found = decode(&file, name, Kind::Mask).unwrap();
            assert_eq!([0, 1].map(|i| f32::from_bits(found.texels[i])), expected, "{name}");
        }
    }
}

#[test]
fn normal_maps_are_told_from_heights_by_their_colours() {
    let seen = |name: &str, bytes: &[u8]| {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join(name), bytes).unwrap();
        TextureSet::default().holds_normals(dir.path(), name)
    };
    let code = |v: f32| (127.5 + 127.5 * v).round() as u8;
    let waves = |steep: f32, green: f32| -> Vec<u8> {
        let texel = |i: u32| {
            let (x, y) = (steep * (i as f32).sin(), green * steep * (1.7 * i as f32).cos());
            [x, y, 1.0].map(|v| code(v / (x * x + y * y + 1.0).sqrt()))
        };
        (0..1600).flat_map(texel).collect()
    };
    for steep in [0.0, 0.3, 1.0] {
        assert!(seen("a.png", &png(40, 40, &waves(steep, 1.0))) && seen("b.png", &png(40, 40, &waves(steep, -1.0))));
    }
    let map = image::RgbImage::from_raw(40, 40, waves(0.3, 1.0)).unwrap();
    assert!(seen("a.jpg", &encoded(&map, image::ImageFormat::Jpeg)));
    let grey: Vec<u8> = (0..1600u32).flat_map(|i| [(i * 7919 % 256) as u8; 3]).collect();
    let noise: Vec<u8> = (0..4800u32).map(|i| (i * 7919 % 251) as u8).collect();
    for heights in [grey, [40, 60, 240].repeat(1600), noise, vec![230; 4800]] {
        assert!(!seen("a.png", &png(40, 40, &heights)));
    }
    assert!(!seen("a.png", b"not a picture") && !TextureSet::default().holds_normals(Path::new(""), "no.png"));
}

#[test]
fn a_missing_file_is_a_warning_and_case_is_mended() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::create_dir(dir.path().join("Tex")).unwrap();
    std::fs::write(dir.path().join("Tex/Wood.PNG"), png(1, 1, &[1, 2, 3])).unwrap();
    let (mut set, mut warnings) = (TextureSet::default(), Vec::new());
    assert_eq!(set.request(dir.path(), "no.png", Kind::Color, Mapping::default(), &mut warnings), NONE);
    for name in ["tex/wood.png", "C:/elsewhere/../Tex/wood.png"] {
        assert_eq!(
            set.request(dir.path(), name, Kind::Color, Mapping::default(), &mut warnings),
            if name.starts_with('C') { NONE } else { 0 }
        );
    }
    assert!(warnings[0].contains("no such file") && warnings[1].contains("found as"));
}

#[test]
fn pictures_of_floats_keep_their_range() {
    use crate::image::{Film, Samples, WriteOptions, encode};
    let file = |name: &str| {
        let mut film = Film::new(2, 1);
        for (channel, values) in [("R", [2.0, -3.5]), ("G", [0.5, 0.25]), ("B", [0.25, 0.0]), ("A", [0.25, 7.0])] {
            film.add(channel, Samples::F32(values.to_vec()));
        }
        let mut bytes = std::io::Cursor::new(Vec::new());
        encode(Path::new(name), &film, &WriteOptions::default(), &mut bytes).unwrap();
        bytes.into_inner()
    };
    let exr = |kind| decode(&file("a.exr"), "a.exr", kind).unwrap();
    let colours = |found: &Decoded| found.texels.iter().map(|&word| rgb9e5::unpack(word)).collect::<Vec<_>>();
    let numbers = |kind| exr(kind).texels.into_iter().map(f32::from_bits).collect::<Vec<_>>();
    let light = exr(Kind::Light);
    assert_eq!(colours(&light), [[2.0, 0.5, 0.25], [0.0, 0.25, 0.0]]);
    assert_eq!(light.textures[0].flags, TEXTURE_RGB9E5);
    assert_eq!(mean(&light.textures[0], &light.texels), [1.0, 0.375, 0.125]);
    // What a surface reflects is no more than all.
    assert_eq!(colours(&exr(Kind::Color)), [[1.0, 0.5, 0.25], [0.0, 0.25, 0.0]]);
    assert_eq!(numbers(Kind::Height), [2.0, -3.5]);
    assert_eq!([numbers(Kind::Mask), numbers(Kind::Alpha)], [[0.25, 1.0], [0.25, 1.0]]);
    assert_eq!([numbers(Kind::Red), numbers(Kind::Roughness)], [[1.0, 0.0], [0.5, 0.25]]);
    assert_eq!(exr(Kind::Mask).textures[0].flags, TEXTURE_FLOAT);
    let hdr = decode(&file("a.hdr"), "a.hdr", Kind::Light).unwrap();
    assert_eq!(colours(&hdr), [[2.0, 0.5, 0.25], [0.0, 0.25, 0.0]]);
    for end in [5, 60, 200] {
        let error = decode(&file("a.exr")[..end], "a.exr", Kind::Color).unwrap_err().to_string();
        assert!(error.contains("a.exr") && !error.contains('\n'), "{error}");
    }
}
