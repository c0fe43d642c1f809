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

/// Options of a command that turn settings with the entries `from` into those with the entries `to`, such as ` --spp 8`: a space before
/// each.
pub fn options(from: &[Entry], to: &[Entry]) -> String {
    let changed = from.iter().zip(to).filter(|(from, to)| from.value != to.value).map(|(_, to)| to);
    let option = |Entry { name, value, is_switch, .. }: &Entry| match (name.as_str(), is_switch) {
        ("policy", _) => format!(" --allocate {value}"),
        (_, true) => format!(" --{name}"),
        // A hyphen behind a space would begin an option.
        _ if value.starts_with('-') => format!(" --{name}={value}"),
        _ => format!(" --{name} {value}"),
    };
    changed.map(option).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_those_that_differ() {
        let entries = |policy: u32, spp: u32, floor: f32, switch: bool| {
            let numbers = [Entry::new("policy", &policy, ..), Entry::new("spp", &spp, ..)];
            let others = [Entry::new("luminance_floor", &floor, ..), Entry::new("conserve_energy", &switch, ..)];
            [numbers, others].concat()
        };
        let from = entries(0, 1, 0.5, false);
        assert_eq!(options(&from, &entries(2, 4, 0.5, false)), " --allocate 2 --spp 4");
        assert_eq!(options(&from, &entries(0, 1, -1.0, true)), " --luminance-floor=-1 --conserve-energy");
        assert_eq!(options(&from, &from), "");
    }
}
