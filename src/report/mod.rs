//! Reports about a run: text tables, traces of its passes, and web pages.
#[cfg(feature = "cli")]
pub mod html;
pub mod table;
pub mod trace;
