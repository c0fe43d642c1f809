//! Rows of PLY files of text. The crate's grammar of numbers knows neither `.5` nor `1.` nor `nan`, which C programs write and read.
use super::short;
use crate::error::Checked;
use ply_rs_bw::ply::{ElementDef, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType};
use std::io::{BufRead, Read};
use std::str::{FromStr, SplitAsciiWhitespace};

/// Bytes of the longest row.
const LONGEST: u64 = 1 << 26;

/// The rows of an element, one a line; `line` is the number of the first, and of the line after the last in the end.
///
/// # Errors
/// A sentence with the line, and the word that is no number.
pub fn rows<E: PropertyAccess>(reader: &mut dyn BufRead, element: &ElementDef, line: &mut usize) -> Checked<Vec<E>> {
    let (mut rows, mut text) = (Vec::new(), String::new());
    for _ in 0..element.count {
        text.clear();
        let read = (&mut *reader).take(LONGEST).read_line(&mut text);
        if text.len() as u64 == LONGEST {
            return Err(format!("has more than 64 MiB in line {line}: is it a PLY file?"));
        }
        if !matches!(read, Ok(1..)) {
            return Err(format!("is damaged or ends too early in line {line}: save it again as PLY 1.0"));
        }
        rows.push(row(&text, element).map_err(|what| format!("{what} in line {line}: save it again as PLY 1.0"))?);
        *line += 1;
    }
    Ok(rows)
}

fn row<E: PropertyAccess>(text: &str, element: &ElementDef) -> Checked<E> {
    let (mut row, mut words) = (E::new(), Words(text.split_ascii_whitespace()));
    for (name, property) in &element.properties {
        let value = match &property.data_type {
            PropertyType::Scalar(kind) => words.scalar(kind)?,
            PropertyType::List(_, kind) => words.list(kind)?,
        };
        if matches!(row.set_property(name, value), PropertyAccessResult::UnsupportedType) {
            return Err(format!("has a \"{}\" of a type that it cannot have", short(name)));
        }
    }
    Ok(row)
}

struct Words<'a>(SplitAsciiWhitespace<'a>);

impl Words<'_> {
    fn number<T: FromStr>(&mut self) -> Checked<T> {
        let word = self.0.next().ok_or("is damaged or ends too early")?;
        word.parse().map_err(|_| format!("has \"{}\" in place of a number of its type", short(word)))
    }

    fn scalar(&mut self, kind: &ScalarType) -> Checked<Property> {
        Ok(match kind {
            ScalarType::Char => Property::Char(self.number()?),
            ScalarType::UChar => Property::UChar(self.number()?),
            ScalarType::Short => Property::Short(self.number()?),
            ScalarType::UShort => Property::UShort(self.number()?),
            ScalarType::Int => Property::Int(self.number()?),
            ScalarType::UInt => Property::UInt(self.number()?),
            ScalarType::Float => Property::Float(self.number()?),
            ScalarType::Double => Property::Double(self.number()?),
        })
    }

    /// A list of integers as the widest of their sign.
    fn list(&mut self, kind: &ScalarType) -> Checked<Property> {
        let count: usize = self.number()?;
        Ok(match kind {
            ScalarType::Char | ScalarType::Short | ScalarType::Int => Property::ListInt(self.numbers(count)?),
            ScalarType::UChar | ScalarType::UShort | ScalarType::UInt => Property::ListUInt(self.numbers(count)?),
            ScalarType::Float | ScalarType::Double => Property::ListDouble(self.numbers(count)?),
        })
    }

    fn numbers<T: FromStr>(&mut self, count: usize) -> Checked<Vec<T>> {
        (0..count).map(|_| self.number()).collect()
    }
}
