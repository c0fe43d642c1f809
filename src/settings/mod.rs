//! Declaration of settings. One row of `settings!` gives a field and its default, the range and the error message for a
//! value outside it, the key in TOML, and the command line option with its help.
pub mod entry;
mod range;
mod table;

pub use range::{FINITE, FINITE_ABOVE_0, FINITE_FROM_0, FROM_0, Is, Range};
pub use table::{Table, read};

/// Declares structs of settings, one row per setting:
///
/// ```text
/// settings! {
///     /// The settings of a film.
///     #[derive(Clone, Debug)]
///     pub struct Settings {
///         /// The `[film]` table.
///         Film {
///             /// Film width in pixels.
///             width: u32 = 512, 1..=16384;
///             /// Samples per pixel.
///             spp: u32 = 64, .., [visible_alias = "budget-spp"];
///             ..camera: Camera, CameraOverrides;
///         }
///         ..allocate: Allocate;
///     }
/// }
/// ```
///
/// `Settings` has a field for every row, with its default and, in [`entries`](entry::Entry), its range. `Film` has the same
/// fields as `Option`s. It is read from a TOML table, where unknown keys are errors, or with the feature `cli` from the
/// command line, where an underscore becomes a hyphen and the comment is the help; text in brackets is passed to clap.
/// `Film::apply` replaces the settings that were given. A struct may have several such parts. A row with two dots in a part
/// includes the settings of another struct: they get a field of their own but are keys and options of this part. Such a
/// row after the parts is a field with a table of its own.
macro_rules! settings {
    (
        $(#[$meta:meta])*
        pub struct $Whole:ident {
            $(
                $(#[$part_meta:meta])*
                $Part:ident {
                    $($(#[$doc:meta])* $name:ident: $type:ty = $default:expr, $range:expr $(, [$($arg:tt)*])?;)*
                    $(..$group:ident: $Group:ty, $GroupPart:ty $(, [$($attribute:tt)*])?;)*
                }
            )+
            $(..$table:ident: $Table:ty;)*
        }
    ) => {
        $(#[$meta])*
        pub struct $Whole {
            $(
                $(
                    $(#[$doc])*
                    #[doc = concat!("\n\nDefault `", stringify!($default), "`, range `", stringify!($range), "`.")]
                    pub $name: $type,
                )*
                $(
                    #[doc = concat!("See [`", stringify!($Group), "`].")]
                    $(#[$($attribute)*])?
                    pub $group: $Group,
                )*
            )+
            $(
                #[doc = concat!("See [`", stringify!($Table), "`].")]
                pub $table: $Table,
            )*
        }

        impl Default for $Whole {
            fn default() -> Self {
                Self {
                    $($($name: $default,)* $($group: Default::default(),)*)+
                    $($table: Default::default(),)*
                }
            }
        }

        impl $Whole {
            /// Every setting with its value and range, as messages and help name it.
            pub fn entries(&self) -> Vec<$crate::settings::entry::Entry> {
                let own = [
                    $(
                        vec![$($crate::settings::entry::Entry::new(stringify!($name), &self.$name, $range),)*],
                        $(self.$group.entries(),)*
                    )+
                    $(self.$table.entries(),)*
                ];
                own.concat()
            }
        }

        $(
            $(#[$part_meta])*
            #[derive(Clone, Debug, Default, PartialEq)]
            #[cfg_attr(feature = "cli", derive(clap::Args))]
            pub struct $Part {
                $(
                    $(#[$doc])*
                    #[cfg_attr(feature = "cli", arg(long $(, $($arg)*)?))]
                    pub $name: Option<$type>,
                )*
                $(
                    #[doc = concat!("See [`", stringify!($Group), "`].")]
                    #[cfg_attr(feature = "cli", command(flatten))]
                    pub $group: $GroupPart,
                )*
            }

            impl $Part {
                /// Names of the options of the settings that are given; a switch that is off is not.
                #[allow(dead_code, reason = "only of some parts it is asked")]
                pub fn given(&self) -> Vec<String> {
                    let own = [
                        vec![$(
                            self.$name
                                .filter(|value| $crate::settings::entry::is_given(value))
                                .map(|_| stringify!($name).replace('_', "-")),
                        )*],
                        $(self.$group.given().into_iter().map(Some).collect(),)*
                    ];
                    own.into_iter().flatten().flatten().collect()
                }

                /// Replaces the settings that are given.
                pub fn apply(&self, settings: &mut $Whole) {
                    $(
                        if let Some(value) = self.$name {
                            settings.$name = value;
                        }
                    )*
                    $(self.$group.apply(&mut settings.$group);)*
                }
            }

            impl $crate::settings::Table for $Part {
                fn keys() -> Vec<&'static str> {
                    let keys = [vec![$(stringify!($name)),*], $(<$GroupPart as $crate::settings::Table>::keys()),*];
                    keys.concat()
                }

                fn take<'de, A: serde::de::MapAccess<'de>>(&mut self, key: &str, map: &mut A) -> std::result::Result<(), A::Error> {
                    match key {
                        $(stringify!($name) => self.$name = Some(map.next_value()?),)*
                        $(_ if <$GroupPart as $crate::settings::Table>::keys().contains(&key) => self.$group.take(key, map)?,)*
                        _ => {}
                    }
                    Ok(())
                }
            }

            impl<'de> serde::Deserialize<'de> for $Part {
                fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> std::result::Result<Self, D::Error> {
                    $crate::settings::read(deserializer)
                }
            }
        )+
    };
}
pub(crate) use settings;

/// Declares an enum whose variants are the values of a setting. TOML, command line and messages name them in kebab case.
macro_rules! choices {
    ($(#[$meta:meta])* pub enum $Name:ident { $($variants:tt)* }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        #[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
        #[serde(rename_all = "kebab-case")]
        pub enum $Name { $($variants)* }

        impl $crate::settings::entry::Value for $Name {
            fn text(&self) -> String {
                let word = serde_json::to_value(self).unwrap_or_default();
                word.as_str().unwrap_or_default().to_owned()
            }
        }
    };
}
pub(crate) use choices;
