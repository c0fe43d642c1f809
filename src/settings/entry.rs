//! Settings as text, for options, help and error messages.
use super::Range;
use crate::error::{Error, Result};

/// A type of value that a setting can have.
pub trait Value {
    /// Placeholder for the value in the help of its option; empty for clap's default, the option's name.
    const PLACEHOLDER: &'static str = "";
    /// Whether its option takes no value and switches the setting on.
    const IS_SWITCH: bool = false;

    /// The value as the option takes it.
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

/// One setting with its value and range, as text.
#[derive(Clone, Debug)]
pub struct Entry {
    /// Name of the option, without its dashes.
    pub name: String,
    /// The value as the option takes it.
    pub value: String,
    /// The range in words; empty if every value of the type is allowed.
    pub range: String,
    /// Whether the value is in the range.
    pub holds: bool,
    /// Placeholder for the value in the help; see [`Value::PLACEHOLDER`].
    pub placeholder: &'static str,
    /// Whether the option takes no value; see [`Value::IS_SWITCH`].
    pub is_switch: bool,
}

impl Entry {
    /// Describes the setting in the field `name`.
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

/// Whether a value says something: that a switch is off is what not giving it says.
pub fn is_given<T: Value>(value: &T) -> bool {
    !T::IS_SWITCH || value.text() == true.to_string()
}

/// Checks every setting against its range.
///
/// # Errors
/// [`Error::Usage`] with the first setting that is out of range, its value and its range.
pub fn check(entries: &[Entry]) -> Result<()> {
    match entries.iter().find(|e| !e.holds) {
        Some(Entry { name, value, range, .. }) => Err(Error::Usage(format!("{name} is {value}: choose {range}"))),
        None => Ok(()),
    }
}
