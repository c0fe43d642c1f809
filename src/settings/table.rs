//! Reading of settings from a TOML table.
use serde::de::{DeserializeSeed, Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use std::fmt;
use std::marker::PhantomData;

/// Settings that a table can give. It replaces `flatten` of serde, which neither refuses unknown keys nor keeps the line
/// number of an error.
pub trait Table: Default {
    /// All keys that the table can have.
    fn keys() -> Vec<&'static str>;

    /// Reads the value of one of the keys.
    ///
    /// # Errors
    /// When the value is of another type.
    fn take<'de, A: MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> Result<(), A::Error>;
}

/// Reads a table of settings.
///
/// # Errors
/// For an unknown key and for a value of another type.
pub fn read<'de, T: Table, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    deserializer.deserialize_map(Entries(PhantomData))
}

struct Entries<T>(PhantomData<T>);

impl<'de, T: Table> Visitor<'de> for Entries<T> {
    type Value = T;

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a table")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<T, A::Error> {
        let mut table = T::default();
        while let Some(key) = map.next_key_seed(Known(&T::keys()))? {
            table.take(&key, &mut map)?;
        }
        Ok(table)
    }
}

/// Reads a key that must be in the list. An error raised while a key is read carries the line of that key.
struct Known<'a>(&'a [&'static str]);

impl<'de> DeserializeSeed<'de> for Known<'_> {
    type Value = String;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<String, D::Error> {
        let key = String::deserialize(deserializer)?;
        if self.0.contains(&key.as_str()) {
            return Ok(key);
        }
        // The wording of serde, so that all tables report alike.
        let known: Vec<_> = self.0.iter().map(|known| format!("`{known}`")).collect();
        Err(D::Error::custom(format!("unknown field `{key}`, expected one of {}", known.join(", "))))
    }
}
