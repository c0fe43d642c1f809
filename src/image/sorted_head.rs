//! Sorting of the attributes in an EXR file by name. The crate writes them in the order of a hash map, which differs
//! between runs, so that the same film would give different files.
use super::output::Stream;
use std::io::{Result, Seek, SeekFrom, Write};

/// A stream that holds back the headers until they are complete and then writes them sorted.
pub(super) struct SortedHead<'a> {
    out: &'a mut dyn Stream,
    head: Option<Vec<u8>>,
}

impl<'a> SortedHead<'a> {
    pub(super) fn new(out: &'a mut dyn Stream) -> Self {
        Self { out, head: Some(Vec::new()) }
    }
}

impl Write for SortedHead<'_> {
    fn write(&mut self, bytes: &[u8]) -> Result<usize> {
        let Some(head) = &mut self.head else { return self.out.write(bytes) };
        head.extend_from_slice(bytes);
        if let Some(sorted) = sorted(head) {
            self.out.write_all(&sorted)?;
            self.head = None;
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> Result<()> {
        self.out.flush()
    }
}

impl Seek for SortedHead<'_> {
    /// The writer seeks back only to the table of chunks, which follows the headers.
    fn seek(&mut self, to: SeekFrom) -> Result<u64> {
        self.out.seek(to)
    }
}

/// Returns the bytes with their headers sorted, or `None` while the headers are not complete.
fn sorted(head: &[u8]) -> Option<Vec<u8>> {
    const MANY_PARTS: u8 = 0x10;
    let (start, mut rest) = head.split_at_checked(8)?;
    let has_many = start[5] & MANY_PARTS != 0;
    let mut out = start.to_vec();
    loop {
        let mut attributes = Vec::new();
        while *rest.first()? != 0 {
            let (attribute, behind) = rest.split_at_checked(length(rest)?)?;
            attributes.push(attribute);
            rest = behind;
        }
        rest = &rest[1..];
        attributes.sort();
        out.extend(attributes.concat());
        out.push(0);
        // The headers of many parts end with an empty one.
        if !has_many || attributes.is_empty() {
            return Some([&out, rest].concat());
        }
    }
}

/// Length of an attribute in bytes: name and type, each followed by a 0, the length of the value, and the value.
fn length(attribute: &[u8]) -> Option<usize> {
    let name = attribute.iter().position(|&b| b == 0)? + 1;
    let kind = attribute[name..].iter().position(|&b| b == 0)? + 1;
    let value = attribute.get(name + kind..)?.first_chunk()?;
    Some(name + kind + 4 + u32::from_le_bytes(*value) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn attribute(name: &str, value: &[u8]) -> Vec<u8> {
        [name.as_bytes(), b"\0string\0", &(value.len() as u32).to_le_bytes(), value].concat()
    }

    #[test]
    fn attributes_are_sorted_within_their_header_as_soon_as_it_ends() {
        let (a, b, c) = (attribute("a", b"\0\0"), attribute("b", b""), attribute("c", b"x"));
        let one = [&b"\x76\x2f\x31\x01\x02\0\0\0"[..], &b, &a, b"\0", b"rest"].concat();
        let ordered = [&one[..8], &a, &b, b"\0", b"rest"].concat();
        assert_eq!(sorted(&one), Some(ordered));
        assert!((0..one.len() - 4).all(|n| sorted(&one[..n]).is_none()));
        let many = [&b"\x76\x2f\x31\x01\x02\x10\0\0"[..], &c, &a, b"\0", &b, &a, b"\0\0", b"rest"].concat();
        let ordered = [&many[..8], &a, &c, b"\0", &a, &b, b"\0\0", b"rest"].concat();
        assert_eq!(sorted(&many), Some(ordered));
    }
}
