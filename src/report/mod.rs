//! What a run tells about itself: tables and traces.
pub mod table;
pub mod trace;
