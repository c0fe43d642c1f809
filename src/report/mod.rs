//! Reports about a run: text tables and traces of its passes.
pub mod table;
pub mod trace;
