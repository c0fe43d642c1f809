//! Damaged files give one line and no panic. `TALLOW_FUZZ` sets the number of mutations (default 2000).
use proptest::prelude::*;
use std::sync::LazyLock;
use tallow::image::{self, Film, Samples, WriteOptions};

const SIZE: u32 = 24;

fn film() -> Film {
    let mut film = Film::new(SIZE, SIZE);
    let n = film.pixels();
    let value = |i: usize| (i as f32 * 0.37).sin().abs();
    film.add_vec3("", ["R", "G", "B"], &(0..n).map(|i| [value(i), value(i + 1), value(i + 2)]).collect::<Vec<_>>());
    film.add("id", Samples::U32((0..n as u32).collect()));
    film.metadata.insert("scene".to_owned(), "box".to_owned());
    film
}

fn written(name: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    image::write(&path, &film(), &WriteOptions::default()).unwrap();
    std::fs::read(path).unwrap()
}

/// An EXR in tiles with another compression, in two parts, which takes other ways through the decoder.
fn exr_in_parts(compression: exr::prelude::Compression) -> Vec<u8> {
    use exr::prelude::*;
    let side = SIZE as usize;
    let half = FlatSamples::F16((0..side * side).map(|i| f16::from_f32(i as f32 * 0.01)).collect());
    let float = FlatSamples::F32((0..side * side).map(|i| i as f32 * 0.01).collect());
    let encoding = Encoding { compression, blocks: Blocks::Tiles(Vec2(16, 16)), line_order: LineOrder::Increasing };
    let part = |name: &str, samples: &FlatSamples| {
        let channels = AnyChannels::sort([AnyChannel::new("Y", samples.clone())].into_iter().collect());
        Layer::new((side, side), LayerAttributes::named(name), encoding, channels)
    };
    let attributes = ImageAttributes::with_size((side, side));
    let image = Image::from_layers(attributes, vec![part("a", &half), part("b", &float)]);
    let mut out = std::io::Cursor::new(Vec::new());
    image.write().to_buffered(&mut out).unwrap();
    out.into_inner()
}

fn jpeg() -> Vec<u8> {
    encoded(::image::ImageFormat::Jpeg)
}

fn encoded(format: ::image::ImageFormat) -> Vec<u8> {
    let rgb = ::image::RgbImage::from_fn(SIZE, SIZE, |x, y| ::image::Rgb([x as u8 * 9, y as u8 * 9, 77]));
    let mut out = std::io::Cursor::new(Vec::new());
    rgb.write_to(&mut out, format).unwrap();
    out.into_inner()
}

static FILES: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    use exr::prelude::Compression;
    let mut files = vec![written("a.exr"), written("a.png"), written("a.hdr"), jpeg()];
    files.extend([::image::ImageFormat::Tga, ::image::ImageFormat::Bmp].map(encoded));
    files.extend([Compression::PIZ, Compression::RLE, Compression::PXR24, Compression::B44].map(exr_in_parts));
    files
});

/// Decodes and checks what every caller relies on; returns whether it was accepted.
fn check(bytes: &[u8]) -> bool {
    match image::decode(bytes) {
        Ok(film) => {
            assert!(film.pixels() > 0);
            assert!(film.channels.iter().all(|c| c.samples.len() == film.pixels()));
            true
        }
        Err(line) => {
            assert!(!line.trim().is_empty() && !line.contains('\n'), "{line:?}");
            false
        }
    }
}

#[test]
fn whole_files_are_accepted_and_truncated_ones_refused() {
    for (i, file) in FILES.iter().enumerate() {
        assert!(check(file), "file {i}");
        // A PNG is complete without its last chunk, 12 bytes without content.
        let needed = if i == 1 { file.len() - 12 } else { file.len() };
        for length in 0..needed {
            assert!(!check(&file[..length]), "file {i} of {} bytes accepted with {length}", file.len());
        }
    }
}

#[test]
fn ends_within_or_behind_a_jpeg_are_not_its_end() {
    let whole = jpeg();
    let (start, rest) = whole.split_at(2);
    // A thumbnail is a whole JPEG in a segment; the length of a segment counts itself.
    let length = (whole.len() as u16 + 2).to_be_bytes();
    let with_thumbnail = [start, &[0xff, 0xe1], &length[..], &whole[..], rest].concat();
    assert!(check(&with_thumbnail));
    assert!(!check(&with_thumbnail[..with_thumbnail.len() - 2]), "the thumbnail's end is not the picture's");
    let with_video = [&whole[..], b"video \xff\xda and more"].concat();
    assert!(check(&with_video), "what follows the end is no part of the picture");
}

#[test]
fn headers_that_ask_for_too_much_are_refused_before_memory_is_taken() {
    let mut png = FILES[1].clone();
    png[16..24].copy_from_slice(&[0, 0, 0xf0, 0, 0, 0, 0xf0, 0]);
    assert!(!check(&png));
    let exr = &FILES[0];
    let window = exr.windows(11).position(|w| w == b"dataWindow\0").unwrap() + 11 + 6 + 4;
    let mut huge = exr.clone();
    huge[window + 8..window + 16].copy_from_slice(&[0xff, 0xff, 0, 0, 0xff, 0xff, 0, 0]);
    assert!(!check(&huge));
    // Control: the same bytes written back are accepted, so that it is the size which was refused.
    huge[window + 8..window + 16].copy_from_slice(&exr[window + 8..window + 16]);
    assert!(check(&huge));
}

#[test]
fn what_is_no_image_is_refused() {
    for bytes in
        [&b""[..], b"\n", b"P6 2 2 255 ", b"GIF89a", b"#?RADIANCE\n", b"\x76\x2f\x31\x01", b"\x89PNG\r\n\x1a\n"]
    {
        assert!(!check(bytes), "{bytes:?}");
    }
}

fn cases() -> u32 {
    std::env::var("TALLOW_FUZZ").ok().and_then(|n| n.parse().ok()).unwrap_or(2000)
}

/// Where, and by what a byte is replaced: values at the edges of ranges are the likeliest to hurt.
fn edits() -> impl Strategy<Value = Vec<(prop::sample::Index, u8)>> {
    let byte = prop_oneof![any::<u8>(), Just(0), Just(0xff), Just(0x7f), Just(0x80), Just(1)];
    prop::collection::vec((any::<prop::sample::Index>(), byte), 1..8)
}

/// Panics that [`image::decode`] turns into errors would otherwise fill the output.
fn silence_decoders() {
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(|| {
        let tell = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |panic| {
            if !image::is_decoding() {
                tell(panic);
            }
        }));
    });
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), failure_persistence: None, ..ProptestConfig::default() })]
    #[test]
    fn mutated_files_never_panic(
        file in 0..FILES.len(), edits in edits(), header_only: bool, cut in prop::option::weighted(0.2, any::<prop::sample::Index>())
    ) {
        silence_decoders();
        let mut bytes = FILES[file].clone();
        // Half of the mutations hit the first 400 bytes, where the sizes are.
        let reach = if header_only { bytes.len().min(400) } else { bytes.len() };
        for (index, value) in edits {
            bytes[index.index(reach)] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(cut.index(bytes.len()));
        }
        check(&bytes);
    }
}
