//! A setting as its option, its help and its error message name it.
use super::Range;
use crate::error::{Error, Result};

/// What a setting holds.
pub trait Value {
    /// What stands for the value in the help of its option; empty where that is the option's own name.
    const PLACEHOLDER: &'static str = "";
    /// Whether its option takes no value: to name it is to switch it on.
    const IS_SWITCH: bool = false;

    /// As the option takes it.
    fn text(&self) -> String;
}

impl Value for u32 {
    const PLACEHOLDER: &'static str = "N";

    fn text(&self) -> String {
        self.to_string()
    }
}

impl Value for f32 {
    const PLACEHOLDER: &'static str = "X";

    fn text(&self) -> String {
        self.to_string()
    }
}

impl Value for [f32; 4] {
    const PLACEHOLDER: &'static str = "X[,X,X,X]";

    fn text(&self) -> String {
        self.map(|x| x.to_string()).join(",")
    }
}

impl Value for bool {
    const IS_SWITCH: bool = true;

    fn text(&self) -> String {
        self.to_string()
    }
}

/// One setting and what it may be.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Of the option, without its dashes.
    pub name: String,
    /// As the option takes it.
    pub value: String,
    /// What may be chosen; empty where every value of the type may.
    pub range: String,
    /// Whether the value is in the range.
    pub holds: bool,
    /// [`Value::PLACEHOLDER`]
    pub placeholder: &'static str,
    /// [`Value::IS_SWITCH`]
    pub is_switch: bool,
}

impl Entry {
    /// The setting of the field `name`.
    pub fn new<T: Value>(name: &str, value: &T, range: impl Range<T>) -> Self {
        Self {
            name: name.replace('_', "-"),
            value: value.text(),
            range: range.text(),
            holds: range.holds(value),
            placeholder: T::PLACEHOLDER,
            is_switch: T::IS_SWITCH,
        }
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
