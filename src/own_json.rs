//! Files of JSON that a command writes and another run reads: profiles, plans, and what `tallow cost` measured.
use crate::error::Checked;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::ops::RangeInclusive;

/// A kind of such files.
pub(crate) struct OwnJson {
    /// What they are, without an article, and what writes them.
    pub what: &'static str,
    /// The key that has the version of their format.
    pub version: &'static str,
    /// The versions that are read.
    pub versions: RangeInclusive<u64>,
    /// What to do about one that is damaged, or of another version.
    pub remedy: &'static str,
}

impl OwnJson {
    /// Reads a file of this kind.
    ///
    /// # Errors
    /// What is wrong with it, and what to do.
    pub fn parse<T: DeserializeOwned>(&self, text: &[u8]) -> Checked<T> {
        let Self { what, version, versions, remedy } = self;
        // Windows' own programs write this mark in front of UTF-8.
        let text = text.strip_prefix(b"\xef\xbb\xbf").unwrap_or(text);
        if text.trim_ascii().is_empty() {
            return Err(format!("is empty, and no {what}: {remedy}"));
        }
        let is_other = || format!("is no {what}");
        let value: Value = serde_json::from_slice(text).map_err(|e| match e.is_eof() {
            true => format!("ends before it is complete: {remedy}"),
            false => is_other(),
        })?;
        let found = value.get(version).and_then(Value::as_u64).ok_or_else(is_other)?;
        if !versions.contains(&found) {
            let (first, last) = (versions.start(), versions.end());
            let known = if first == last { format!("version {last}") } else { format!("versions {first} to {last}") };
            return Err(format!("is of version {found}, where this program reads {known}: {remedy}"));
        }
        drop(value);
        // By its text, so that the line is told.
        serde_json::from_slice(text).map_err(|e| format!("is damaged: {e}; {remedy}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::Deserialize;

    #[derive(Debug, PartialEq, Deserialize)]
    struct Kept {
        schema: u32,
        spp: u32,
    }

    /// The parser's words say nothing of what a file is, or of what makes another.
    #[test]
    fn files_of_other_programs_and_parts_of_files_are_told() {
        let kept = OwnJson { what: "list of jobs", version: "schema", versions: 1..=2, remedy: "list them again" };
        let other = "is no list of jobs";
        let part = "ends before it is complete: list them again";
        let version = "is of version 3, where this program reads versions 1 to 2: list them again";
        for (text, told) in [
            ("", "is empty, and no list of jobs: list them again"),
            ("\u{feff} \n", "is empty, and no list of jobs: list them again"),
            ("[1, 2]", other),
            ("3", other),
            ("\"schema\"", other),
            ("no JSON", other),
            ("{\"spp\": 3}", other),
            ("{\"schema\": \"http://json-schema.org/schema#\"}", other),
            ("{\"schema\": 1,", part),
            ("{\"schema\": 3}", version),
            ("{\"schema\": 2}", "is damaged: missing field `spp` at line 1 column 13; list them again"),
        ] {
            assert_eq!(kept.parse::<Kept>(text.as_bytes()), Err(told.to_owned()), "{text}");
        }
        let text = "\u{feff}{\"schema\": 1, \"spp\": 4}";
        assert_eq!(kept.parse(text.as_bytes()), Ok(Kept { schema: 1, spp: 4 }));
    }
}
