//! The only `unsafe`, the only `vk::`.
#![allow(unsafe_code)]
pub mod layout;
