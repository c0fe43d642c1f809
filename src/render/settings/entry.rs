//! A setting as its option, its help and its error message name it.
use crate::error::{Error, Result};
use serde::Serialize;
use std::fmt::Display;

/// One setting and what it may be.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Of the option, without its dashes.
    pub name: &'static str,
    /// As the option takes it.
    pub value: String,
    /// What may be chosen; empty where every value of the type may.
    pub range: String,
    /// Whether the value is in the range.
    pub holds: bool,
}

impl Entry {
    /// Any value will do.
    pub fn any(name: &'static str, value: impl Display) -> Self {
        Self::within(name, value, "", true)
    }

    /// One of a list.
    pub fn one_of(name: &'static str, value: &impl Serialize) -> Self {
        let word = serde_json::to_value(value).unwrap_or_default();
        Self::any(name, word.as_str().unwrap_or_default())
    }

    /// From `low` to `high`.
    pub fn whole(name: &'static str, value: u32, [low, high]: [u32; 2]) -> Self {
        Self::within(name, value, &format!("{low} to {high}"), (low..=high).contains(&value))
    }

    /// As described.
    pub fn within(name: &'static str, value: impl Display, range: &str, holds: bool) -> Self {
        Self { name, value: value.to_string(), range: range.to_owned(), holds }
    }
}

/// # Errors
/// [`Error::Usage`] with the first setting that is out of range, its value and its range.
pub fn check(entries: &[Entry]) -> Result<()> {
    match entries.iter().find(|e| !e.holds) {
        Some(Entry { name, value, range, .. }) => Err(Error::Usage(format!("{name} is {value}: choose {range}"))),
        None => Ok(()),
    }
}
