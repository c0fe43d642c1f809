//! What a URI in a glTF file leads to: data in itself, or a file below the asset's folder and nowhere else.
use crate::error::Checked;
use base64::Engine;
use base64::alphabet::STANDARD;
use base64::engine::{DecodePaddingMode, GeneralPurpose, GeneralPurposeConfig};
use std::path::{Path, PathBuf};

/// What a URI names.
#[derive(Debug, PartialEq)]
pub enum Target {
    /// The bytes of a `data:` URI.
    Data(Vec<u8>),
    /// A path below the folder of the asset, which may not exist.
    File(PathBuf),
}

/// Exporters differ in whether they pad the last group.
const BASE64: GeneralPurpose = GeneralPurpose::new(
    &STANDARD,
    GeneralPurposeConfig::new()
        .with_decode_padding_mode(DecodePaddingMode::Indifferent)
        .with_decode_allow_trailing_bits(true),
);

/// Finds out what `uri` names, relative to `folder`. Symbolic links below the folder are followed.
///
/// # Errors
/// A sentence about a URI of another machine, one that leads out of the folder, or data that cannot be decoded.
pub fn resolve(folder: &Path, uri: &str) -> Checked<Target> {
    if let Some(rest) = uri.strip_prefix("data:") {
        return data(rest).map(Target::Data);
    }
    let path = decode(uri)?.replace('\\', "/");
    let scheme = path.split_once(':').map(|(scheme, _)| scheme);
    if scheme.is_some_and(|s| !s.is_empty() && !s.contains('/') && s.chars().all(|c| c.is_ascii_alphanumeric())) {
        return Err("is not below the asset's folder: put the file there and name it by a relative path".into());
    }
    let mut found = PathBuf::new();
    for part in path.split('/').filter(|part| *part != ".") {
        let inside = match part {
            "" => path.is_empty() || !found.as_os_str().is_empty(), // A path that begins with a slash is absolute.
            ".." => found.pop(),
            _ => {
                found.push(part);
                true
            }
        };
        if !inside {
            return Err("leads out of the asset's folder: put the file below it".into());
        }
    }
    match found.as_os_str().is_empty() || path.contains(char::is_control) {
        true => Err("names no file".into()),
        false => Ok(Target::File(folder.join(found))),
    }
}

/// The content of a `data:` URI, after the scheme.
fn data(rest: &str) -> Checked<Vec<u8>> {
    let (kind, content) = rest.split_once(',').ok_or("is a data: URI without a comma: export the file again")?;
    if !kind.ends_with(";base64") {
        return percent_decoded(content);
    }
    let written = if content.contains('%') { percent_decoded(content)? } else { content.as_bytes().to_vec() };
    BASE64.decode(written).map_err(|e| format!("is not valid base64 ({e}): export the file again"))
}

fn decode(uri: &str) -> Checked<String> {
    String::from_utf8(percent_decoded(uri)?).map_err(|_| "is not UTF-8 once its % codes are decoded".into())
}

/// Replaces `%20` and its like by the bytes that they stand for. Exporters forget to encode `%`: what is no code stays.
fn percent_decoded(text: &str) -> Checked<Vec<u8>> {
    let (bytes, mut out) = (text.as_bytes(), Vec::new());
    out.try_reserve_exact(bytes.len()).map_err(|_| "needs more memory than the system gives")?;
    let hex = |at: usize| bytes.get(at).and_then(|&c| char::from(c).to_digit(16));
    let mut at = 0;
    while let Some(&byte) = bytes.get(at) {
        let code = (byte == b'%').then(|| Some(16 * hex(at + 1)? + hex(at + 2)?)).flatten();
        out.push(code.map_or(byte, |code| code as u8));
        at += if code.is_some() { 3 } else { 1 };
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(uri: &str) -> Checked<Target> {
        resolve(Path::new("a"), uri)
    }

    #[test]
    fn names_are_decoded() {
        let named = |uri: &str, path: &str| assert_eq!(file(uri), Ok(Target::File(path.into())), "{uri}");
        named("Normal%20Map.png", "a/Normal Map.png");
        named("b/./c//d.bin", "a/b/c/d.bin");
        named("b/../c.bin", "a/c.bin");
        named("100%.png", "a/100%.png");
        named("Unicode%E2%9D%A4.png", "a/Unicode❤.png");
        named("Unicode❤.png", "a/Unicode❤.png");
    }

    #[test]
    fn nothing_leads_out_of_the_folder() {
        for uri in ["../x", "b/../../x", "%2e%2e/x", "..\\x", "/etc/passwd", "%2fetc/passwd", "//host/x"] {
            assert!(file(uri).is_err_and(|e| e.contains("leads out")), "{uri}: {:?}", file(uri));
        }
        for uri in ["file:///etc/passwd", "http://host/x", "C:\\x", "c:x"] {
            assert!(file(uri).is_err_and(|e| e.contains("not below")), "{uri}: {:?}", file(uri));
        }
        for uri in ["", ".", "b/..", "x\0y", "%00"] {
            assert!(file(uri).is_err_and(|e| e.contains("names no file")), "{uri}: {:?}", file(uri));
        }
        assert!(file("%ff").is_err_and(|e| e.contains("UTF-8")));
    }

    #[test]
    fn data_is_decoded() {
        let holds = |uri: &str, bytes: &[u8]| assert_eq!(file(uri), Ok(Target::Data(bytes.to_vec())), "{uri}");
        holds("data:application/octet-stream;base64,AAEC", &[0, 1, 2]);
        holds("data:;base64,AAE=", &[0, 1]);
        holds("data:;base64,AAE", &[0, 1]);
        holds("data:;base64,AAE%3D", &[0, 1]);
        holds("data:text/plain,a%20b", b"a b");
        for uri in ["data:;base64,A*==", "data:;base64,A", "data:base64"] {
            assert!(file(uri).is_err(), "{uri}");
        }
    }
}
