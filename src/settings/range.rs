//! Ranges of settings, in words and as a test.
use std::fmt::Display;
use std::ops::{RangeFull, RangeInclusive};

/// The values that a setting of the type `T` may have.
pub trait Range<T> {
    /// The range in words for help and messages ("choose 1 to 16384"); empty if every value is allowed.
    fn text(&self) -> String;

    /// Whether the value is in the range.
    fn holds(&self, value: &T) -> bool;
}

impl<T> Range<T> for RangeFull {
    fn text(&self) -> String {
        String::new()
    }

    fn holds(&self, _: &T) -> bool {
        true
    }
}

impl<T: PartialOrd + Display> Range<T> for RangeInclusive<T> {
    fn text(&self) -> String {
        format!("{} to {}", self.start(), self.end())
    }

    fn holds(&self, value: &T) -> bool {
        self.contains(value)
    }
}

/// A range given by its description and a test.
#[derive(Clone, Copy, Debug)]
pub struct Is<T>(pub &'static str, pub fn(&T) -> bool);

impl<T> Range<T> for Is<T> {
    fn text(&self) -> String {
        self.0.to_owned()
    }

    fn holds(&self, value: &T) -> bool {
        self.1(value)
    }
}

/// Numbers of 0 or more, including infinity.
pub const FROM_0: Is<f32> = Is("0 or more", |&x| x >= 0.0);
/// Numbers above 0, excluding infinity.
pub const FINITE_ABOVE_0: Is<f32> = Is("a finite number above 0", |&x| x > 0.0 && x.is_finite());
/// Numbers of 0 or more, excluding infinity.
pub const FINITE_FROM_0: Is<f32> = Is("a finite number of 0 or more", |&x| x >= 0.0 && x.is_finite());
/// Numbers of either sign. What a film's metadata tell is finite, as JSON has no infinity.
pub const FINITE: Is<f32> = Is("a finite number", |&x| x.is_finite());
