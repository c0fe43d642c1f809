//! The binary form of glTF: a header of 12 bytes, and chunks of a length, a kind and content.
use crate::error::Checked;

/// The first four bytes of a `.glb` file.
const MAGIC: &[u8] = b"glTF";

/// The JSON of a file and, if it is a `.glb`, the first buffer that it may hold.
pub type Parts<'a> = (&'a [u8], Option<&'a [u8]>);

/// Splits a file into its JSON and its binary chunk. A file that does not begin as a `.glb` is JSON as a whole.
///
/// # Errors
/// A sentence about a chunk that is missing or longer than the file.
pub fn split(bytes: &[u8]) -> Checked<Parts<'_>> {
    let Some(header) = bytes.strip_prefix(MAGIC) else {
        return Ok((bytes.strip_prefix("\u{feff}".as_bytes()).unwrap_or(bytes), None));
    };
    let (Some(version), Some(length)) = (word(header, 0), word(header, 4)) else {
        return Err("ends within its header: take another copy of it".into());
    };
    if version != 2 {
        return Err(format!("is binary glTF of version {version}: export it as glTF 2.0"));
    }
    let Some(mut rest) = bytes.get(12..length as usize) else {
        return Err(format!("says that it has {length} bytes, and has {}: take another copy of it", bytes.len()));
    };
    let (mut json, mut binary) = (None, None);
    while !rest.is_empty() {
        let chunk = chunk(rest).ok_or("has a chunk that ends beyond the file: take another copy of it")?;
        match chunk.kind {
            b"JSON" if json.is_none() => json = Some(chunk.content),
            b"BIN\0" if binary.is_none() => binary = Some(chunk.content),
            _ => {} // Chunks of other kinds belong to extensions and are to be skipped.
        }
        rest = chunk.behind;
    }
    Ok((json.ok_or("has no JSON chunk: export it again")?, binary))
}

struct Chunk<'a> {
    kind: &'a [u8],
    content: &'a [u8],
    /// What follows it.
    behind: &'a [u8],
}

/// The first chunk; `None` where it ends beyond the file.
fn chunk(bytes: &[u8]) -> Option<Chunk<'_>> {
    let end = 8usize.checked_add(word(bytes, 0)? as usize)?;
    Some(Chunk { kind: bytes.get(4..8)?, content: bytes.get(8..end)?, behind: bytes.get(end..)? })
}

fn word(bytes: &[u8], at: usize) -> Option<u32> {
    bytes.get(at..)?.first_chunk().map(|word| u32::from_le_bytes(*word))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(version: u32, length: u32, chunks: &[(&[u8], u32, &[u8])]) -> Vec<u8> {
        let mut bytes = [MAGIC, &version.to_le_bytes(), &length.to_le_bytes()].concat();
        for (kind, length, content) in chunks {
            bytes.extend([&length.to_le_bytes(), *kind, content].concat());
        }
        bytes
    }

    #[test]
    fn chunks_are_found_and_unknown_ones_skipped() {
        let whole = file(2, 12 + 10 + 9 + 12, &[(b"JSON", 2, b"{}"), (b"XYZ\0", 1, b"?"), (b"BIN\0", 4, b"data")]);
        assert_eq!(split(&whole).unwrap(), (&b"{}"[..], Some(&b"data"[..])));
        assert_eq!(split("\u{feff}{}".as_bytes()).unwrap(), (&b"{}"[..], None));
    }

    #[test]
    fn lengths_that_lie_are_refused() {
        let refused = |bytes: &[u8], word: &str| {
            let line = split(bytes).unwrap_err();
            assert!(line.contains(word), "{line}");
        };
        refused(b"glTF\x02", "header");
        refused(&file(1, 12, &[]), "version 1");
        refused(&file(2, 0, &[]), "says that it has 0 bytes");
        refused(&file(2, 13, &[]), "says that it has 13 bytes, and has 12");
        refused(&file(2, 12, &[]), "no JSON");
        refused(&file(2, 22, &[(b"JSON", u32::MAX, b"{}")]), "beyond the file");
        refused(&file(2, 14, &[(b"JSON", 2, b"{}")]), "beyond the file");
    }
}
