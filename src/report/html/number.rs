//! Numbers as readers of a page see them.
use crate::cost::document::Estimate;

/// Three significant digits, such as 0.0123, 12.3, 1230 or 1.23e-5. What is no finite number is a dash.
pub fn short(v: f64) -> String {
    if !v.is_finite() {
        return "–".to_owned();
    }
    // Rounded first: 0.9996 has three digits before the point as 1.00.
    let scientific = format!("{v:.2e}");
    let exponent: i32 = scientific.rsplit('e').next().and_then(|e| e.parse().ok()).unwrap_or(0);
    match exponent {
        _ if v == 0.0 => "0".to_owned(),
        -3..=4 => format!("{v:.*}", (2 - exponent).max(0) as usize),
        _ => scientific,
    }
}

/// A share in percent with at most one decimal, such as 95 or 99.9.
pub fn percent(share: f64) -> String {
    let text = format!("{:.1}", 100.0 * share);
    text.trim_end_matches(".0").to_owned()
}

/// A count with its digits in groups of three, separated by narrow spaces that do not break lines.
pub fn count(n: u64) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}

/// Both ends of the interval, such as "0.011 to 0.013", or that it is too wide; `None` if either is unknown.
pub fn interval(estimate: &Estimate) -> Option<String> {
    estimate.interval(short)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_three_digits_and_are_never_nan() {
        let cases = [
            (0.0, "0"),
            (0.012_345, "0.0123"),
            (12.345, "12.3"),
            (1234.5, "1234"),
            (0.999_6, "1.00"),
            (1.234e-5, "1.23e-5"),
            (-2.5e7, "-2.50e7"),
            (f64::NAN, "–"),
            (f64::INFINITY, "–"),
        ];
        for (value, text) in cases {
            assert_eq!(short(value), text);
        }
    }

    #[test]
    fn counts_are_grouped_and_half_an_interval_is_none() {
        assert_eq!((percent(0.95), percent(0.999), percent(0.57)), ("95".into(), "99.9".into(), "57".into()));
        assert_eq!(
            (count(7), count(1234), count(1_234_567)),
            ("7".into(), "1\u{202f}234".into(), "1\u{202f}234\u{202f}567".into())
        );
        let whole = Estimate { value: 1.0, low: Some(0.5), high: Some(2.0) };
        assert_eq!(interval(&whole).unwrap(), "0.500 to 2.00");
        assert_eq!(interval(&Estimate { low: None, ..whole }), None);
    }
}
