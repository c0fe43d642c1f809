//! Tests that headers which claim more than their files can hold are refused, and all others are read.
use crate::flat::{self, ExrHead, NO_COMPRESSION, ZIP_16_LINES};
use tallow::image::source::Unread;
use tallow::image::{self, Samples};

const SMALL: [i32; 2] = [8, 8];

#[track_caller]
fn refuses(bytes: &[u8], parts: &[&str]) {
    let line = image::decode(bytes).unwrap_err();
    assert!(parts.iter().all(|p| line.contains(p)), "{line}");
}

/// So many bytes behind the head.
fn behind(head: &ExrHead, bytes: usize) -> Vec<u8> {
    [head.bytes(), vec![0; bytes]].concat()
}

#[test]
fn pixels_that_the_compression_cannot_hold_are_refused() {
    // 800 MB: 65536 to 1 would let 12 KB claim them.
    let head = ExrHead::new(NO_COMPRESSION, [8192, 8192]);
    refuses(&behind(&head, 100_000), &["805306368 bytes of pixels", "complete?"]);
    refuses(&behind(&ExrHead::new(ZIP_16_LINES, [8192, 8192]), 100_000), &["805306368 bytes", "complete?"]);
    // What the head itself takes holds no pixels: 60000 channels are 1.4 MB, which deflate could unpack to 1.4 GB.
    let head = ExrHead { channels: 60_000, ..ExrHead::new(ZIP_16_LINES, [64, 64]) };
    refuses(&behind(&head, 1000), &["983040000 bytes", "complete?"]);
}

#[test]
fn a_table_of_more_chunks_than_the_file_has_is_refused() {
    let head = ExrHead { channels: 1, tile: Some(1), ..ExrHead::new(ZIP_16_LINES, [4096, 4096]) };
    refuses(&behind(&head, 1_000_000), &["claims 67108864 bytes of pixels"]);
}

#[test]
fn a_frame_may_be_larger_than_its_picture_but_not_without_measure() {
    let framed = |display| ExrHead { display, ..ExrHead::new(ZIP_16_LINES, SMALL) }.flat_file();
    refuses(&framed([48, 8_388_656]), &["48 x 8388656", "stores 64 pixels"]);
    refuses(&framed([8_388_656, 48]), &["stores 64 pixels"]);
    let film = image::decode(&framed([3840, 2160])).unwrap();
    assert_eq!((film.width, film.height, film.channels.len()), (3840, 2160, 3), "a corner of a 4K frame");
    // Parts far from each other span a frame of their own.
    assert!(image::decode(&framed(SMALL)).is_ok(), "control");
}

#[test]
fn the_flattest_files_of_every_compression_are_read() {
    use exr::prelude::*;
    const SIDE: usize = 512;
    let (half, float) = (FlatSamples::F16(vec![f16::ZERO; SIDE * SIDE]), FlatSamples::F32(vec![0.0; SIDE * SIDE]));
    let kinds = [Compression::Uncompressed, Compression::RLE, Compression::ZIP1, Compression::ZIP16, Compression::PIZ];
    let lossy = [Compression::PXR24, Compression::B44, Compression::B44A];
    for compression in kinds.into_iter().chain(lossy) {
        for samples in [&half, &float] {
            let encoding = Encoding { compression, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
            let channels = AnyChannels::sort(vec![AnyChannel::new("Y", samples.clone())].into());
            let layer = Layer::new((SIDE, SIDE), LayerAttributes::default(), encoding, channels);
            let mut out = std::io::Cursor::new(Vec::new());
            Image::from_layer(layer).write().to_buffered(&mut out).unwrap();
            let film = image::decode(out.get_ref()).unwrap_or_else(|line| panic!("{compression:?}: {line}"));
            assert_eq!(film.channel("Y"), Some(&Samples::F32(vec![0.0; SIDE * SIDE])), "{compression:?}");
        }
    }
}

#[test]
fn deep_files_are_named_as_what_they_are() {
    let head = ExrHead { kind: Some("deepscanline"), ..ExrHead::new(NO_COMPRESSION, SMALL) };
    let line = image::decode(&behind(&head, 1000)).unwrap_err();
    assert!(line.contains("deep data") && line.contains("flat") && !line.contains("complete"), "{line}");
}

#[test]
fn pixels_of_one_bit_are_believed() {
    // 1264 pixels for a byte.
    let bytes = flat::png(2048, 1024);
    assert!(bytes.len() * 1032 < 2048 * 1024, "{} bytes", bytes.len());
    let film = image::decode(&bytes).unwrap();
    assert_eq!((film.width, film.height), (2048, 1024));
    refuses(&bytes[..bytes.len() / 2], &["complete?"]);
}

/// 4.3 billion pixels are no damage: what they take is a question to the machine.
#[test]
fn what_a_picture_takes_is_known_before_it_is_decoded() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("large.png");
    std::fs::write(&path, flat::png(65_535, 65_535)).unwrap();
    let claim = Unread::open(&path).unwrap().claim;
    // A byte as it is decoded, and three floats.
    assert_eq!((claim.size, claim.bytes), ([65_535; 2], 65_535 * 65_535 * 13));
}

#[test]
fn messages_hold_no_words_of_a_library() {
    let png = flat::png(64, 64);
    let at = |name: &[u8]| png.windows(4).position(|w| w == name).unwrap();
    let mut refused = 0;
    for (place, value) in [(at(b"IDAT") + 8, 0xff), (at(b"IHDR") + 12, 7), (at(b"IEND"), 0), (at(b"IDAT"), b'X')] {
        let mut broken = png.clone();
        broken[place] = value;
        let Err(line) = image::decode(&broken) else { continue };
        refused += 1;
        assert!(["{", "Format error", "ChunkType", "Decoder"].iter().all(|word| !line.contains(word)), "{line}");
    }
    assert!(refused >= 3, "{refused} of 4 are refused");
    let mut exr = ExrHead::new(ZIP_16_LINES, SMALL).flat_file();
    let end = exr.len();
    exr[end - 30..].fill(0x55);
    refuses(&exr, &["compressed pixels are damaged", "complete?"]);
}
