//! Ranges of frames on the command line.
use crate::error::Checked;
use std::ops::Range;

/// `0..96` without the end, `0..=95` with it, or one number.
pub fn parse(text: &str) -> Checked<Range<u32>> {
    let number = |text: &str| text.trim().parse::<u32>().ok();
    let found = match (text.split_once("..="), text.split_once("..")) {
        (Some((first, last)), _) => number(first).zip(number(last).and_then(|last| last.checked_add(1))),
        (None, Some((first, end))) => number(first).zip(number(end)),
        (None, None) => number(text).and_then(|one| Some((one, one.checked_add(1)?))),
    };
    match found {
        Some((first, end)) if first < end => Ok(first..end),
        Some((first, end)) => {
            Err(format!("no frame lies from {first} on and before {end}: frames go forwards, such as 0..96"))
        }
        None => Err("expected frames such as 0..96, 0..=95 or 7, from 0 on".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn ranges_are_written_as_in_rust() {
        assert_eq!([parse("0..96"), parse("3..=5"), parse("7")], [Ok(0..96), Ok(3..6), Ok(7..8)]);
        for wrong in ["", "a", "5..5", "9..3", "-1..3", "1..", "..4", "0..=4294967295", "1..2..3"] {
            assert!(parse(wrong).is_err(), "{wrong}");
        }
        assert!(parse("9..3").unwrap_err().contains("from 9 on and before 3"));
    }
}
