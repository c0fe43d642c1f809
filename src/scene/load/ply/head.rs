//! Headers of PLY files. The crate's grammar knows names of letters, digits, `_` and `-`, each once, and lines of UTF-8; programs write
//! properties such as `scalar_Linearity_(0.5)`, some of one name, and comments in whatever code they have.
use crate::error::Checked;
use std::collections::HashSet;
use std::io::{BufRead, Read};

/// Bytes of the longest header.
const LONGEST: u64 = 1 << 20;

/// The header with names that the crate knows, as many lines and as many properties; up to its end, or to where the file ends before.
///
/// # Errors
/// For one that is too long.
pub fn read(reader: &mut dyn BufRead) -> Checked<Vec<u8>> {
    let (mut head, mut names, mut left) = (String::new(), HashSet::new(), LONGEST);
    loop {
        let mut line = Vec::new();
        let read = (&mut *reader).take(left).read_until(b'\n', &mut line).unwrap_or(0);
        left -= read as u64;
        let line = String::from_utf8_lossy(&line);
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        if left == 0 && words != ["end_header"] {
            return Err("has a header of more than 1 MiB: is it a PLY file?".to_owned());
        }
        match words[..] {
            ["element", ..] => names.clear(),
            ["property", .., name] if !(is_known(name) && names.insert(name.to_owned())) => {
                let fresh = (names.len()..)
                    .map(|n| format!("unread_{n}"))
                    .find(|name| !names.contains(name))
                    .unwrap_or_default();
                let end = &line[line.trim_end().len()..];
                head += &format!("{} {fresh}{end}", words[..words.len() - 1].join(" "));
                names.insert(fresh);
                continue;
            }
            _ => {}
        }
        head += &line;
        if words == ["end_header"] || read == 0 {
            return Ok(head.into_bytes());
        }
    }
}

/// Whether the crate's grammar knows a name.
fn is_known(name: &str) -> bool {
    let part = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    name.chars().all(part) && name.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
}
