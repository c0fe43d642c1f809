//! Image files of one value throughout, in which few bytes stand for many pixels, and headers that claim what they like.
#![allow(dead_code)]

/// A zlib stream of zeros (RFC 1950 and 1951), one fixed block: 13 bits for 258 of them.
pub fn deflated(zeros: u64) -> Vec<u8> {
    let mut bits = Bits { bytes: vec![0x78, 0x01], free: 0 };
    bits.push(0b1, 1); // the last block
    bits.push(0b10, 2); // fixed codes; its bits come the other way round
    let (runs, rest) = ((zeros - 1) / 258, (zeros - 1) % 258);
    (0..=rest).for_each(|_| bits.push(0b0011_0000, 8)); // a literal 0
    (0..runs).for_each(|_| bits.push(0b1100_0101 << 5, 13)); // 258 times what was 1 before
    bits.push(0, 7); // the end
    let sum = (((zeros % 65_521) as u32) << 16) | 1;
    [bits.bytes, sum.to_be_bytes().to_vec()].concat()
}

/// Codes are written from their highest bit, into bytes from the lowest.
struct Bits {
    bytes: Vec<u8>,
    free: u32,
}

impl Bits {
    fn push(&mut self, code: u32, length: u32) {
        for bit in (0..length).rev() {
            if self.free == 0 {
                self.bytes.push(0);
                self.free = 8;
            }
            let last = self.bytes.last_mut().expect("one with a free bit");
            *last |= ((code >> bit & 1) as u8) << (8 - self.free);
            self.free -= 1;
        }
    }
}

/// A black PNG: grey of 1 bit.
pub fn png(width: u32, height: u32) -> Vec<u8> {
    let chunk = |kind: &[u8; 4], data: &[u8]| {
        let body = [&kind[..], data].concat();
        [&(data.len() as u32).to_be_bytes()[..], &body, &crc(&body).to_be_bytes()].concat()
    };
    let head = [&width.to_be_bytes()[..], &height.to_be_bytes(), &[1, 0, 0, 0, 0]].concat();
    let rows = deflated((u64::from(width).div_ceil(8) + 1) * u64::from(height));
    [&b"\x89PNG\r\n\x1a\n"[..], &chunk(b"IHDR", &head), &chunk(b"IDAT", &rows), &chunk(b"IEND", &[])].concat()
}

/// As PNG has it (ISO 3309).
fn crc(bytes: &[u8]) -> u32 {
    let shift = |c: u32| if c & 1 == 1 { 0xedb8_8320 ^ (c >> 1) } else { c >> 1 };
    !bytes.iter().fold(!0, |c, &byte| (0..8).fold(c ^ u32::from(byte), |c, _| shift(c)))
}

/// The head of an EXR file of float channels.
pub struct ExrHead {
    /// By its number in the format.
    pub compression: u8,
    /// Width and height of the pixels that are stored.
    pub data: [i32; 2],
    /// Width and height of the picture.
    pub display: [i32; 2],
    pub channels: u32,
    /// The tiles of a tiled file.
    pub tile: Option<u32>,
    /// The kind of the part, where it is named.
    pub kind: Option<&'static str>,
}

pub const NO_COMPRESSION: u8 = 0;
pub const ZIP_16_LINES: u8 = 3;

impl ExrHead {
    pub fn new(compression: u8, size: [i32; 2]) -> Self {
        Self { compression, data: size, display: size, channels: 3, tile: None, kind: None }
    }

    pub fn bytes(&self) -> Vec<u8> {
        let window = |[w, h]: [i32; 2]| [0, 0, w - 1, h - 1].map(i32::to_le_bytes).concat();
        let channel = |i: u32| {
            let name = format!("c{i:05}\0").into_bytes();
            [name, [2, 0, 1, 1].map(i32::to_le_bytes).concat()].concat()
        };
        let channels = [(0..self.channels).flat_map(channel).collect(), vec![0]].concat();
        let mut out = vec![0x76, 0x2f, 0x31, 0x01, 2, if self.tile.is_some() { 2 } else { 0 }, 0, 0];
        let mut put = |name: &str, kind: &str, value: &[u8]| {
            let length = (value.len() as u32).to_le_bytes();
            out.extend([name.as_bytes(), b"\0", kind.as_bytes(), b"\0", &length, value].concat());
        };
        put("channels", "chlist", &channels);
        put("compression", "compression", &[self.compression]);
        put("dataWindow", "box2i", &window(self.data));
        put("displayWindow", "box2i", &window(self.display));
        put("lineOrder", "lineOrder", &[0]);
        put("pixelAspectRatio", "float", &1f32.to_le_bytes());
        put("screenWindowCenter", "v2f", &[0; 8]);
        put("screenWindowWidth", "float", &1f32.to_le_bytes());
        if let Some(edge) = self.tile {
            put("tiles", "tiledesc", &[&edge.to_le_bytes()[..], &edge.to_le_bytes(), &[0]].concat());
        }
        if let Some(kind) = self.kind {
            put("type", "string", kind.as_bytes());
        }
        out.push(0);
        out
    }

    /// The whole file, in ZIP blocks of 16 lines.
    pub fn flat_file(&self) -> Vec<u8> {
        let head = self.bytes();
        let blocks = (self.data[1] as u64).div_ceil(16);
        let block_of = |lines: u64| deflated(lines * self.data[0] as u64 * 4 * u64::from(self.channels));
        let whole = block_of(16);
        let mut chunks: Vec<Vec<u8>> = Vec::new();
        for block in 0..blocks {
            let lines = (self.data[1] as u64 - 16 * block).min(16);
            let data = if lines == 16 { whole.clone() } else { block_of(lines) };
            let start = [16 * block as u32, data.len() as u32].map(u32::to_le_bytes).concat();
            chunks.push([start, data].concat());
        }
        let mut at = (head.len() as u64) + 8 * blocks;
        let mut table = Vec::new();
        for chunk in &chunks {
            table.extend(at.to_le_bytes());
            at += chunk.len() as u64;
        }
        [head, table, chunks.concat()].concat()
    }
}
