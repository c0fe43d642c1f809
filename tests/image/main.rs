//! Pictures and files.
mod damage;
mod files;
mod metrics;
mod source;
