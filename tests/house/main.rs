//! The repository itself: who imports whom, and the scripts below `tools`.
mod imports;
mod tools;
