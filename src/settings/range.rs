//! What settings may be, in words and as a test.
use std::fmt::Display;
use std::ops::{RangeFull, RangeInclusive};

/// The values that a setting of the type `T` may have.
pub trait Range<T> {
    /// For help and messages ("choose 1 to 16384"); empty where every value will do.
    fn text(&self) -> String;

    /// Whether the value is one of them.
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

/// A range that needs words of its own.
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

/// Infinity included.
pub const ABOVE_0: Is<f32> = Is("a number above 0", |&x| x > 0.0);
/// Infinity included.
pub const FROM_0: Is<f32> = Is("0 or more", |&x| x >= 0.0);
/// Neither 0 nor infinity.
pub const FINITE_ABOVE_0: Is<f32> = Is("a finite number above 0", |&x| x > 0.0 && x.is_finite());
/// Without infinity.
pub const FINITE_FROM_0: Is<f32> = Is("a finite number of 0 or more", |&x| x >= 0.0 && x.is_finite());
/// Everything but NaN.
pub const NUMBER: Is<f32> = Is("a number", |&x| !x.is_nan());
